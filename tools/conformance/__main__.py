"""The tests of other packages, as they are, with our functions in place of theirs: ``make conformance PEERS=FOLDER``.

FOLDER holds checkouts of trimesh, gpytoolbox, pygeodesic, scikit-fmm, potpourri3d and libigl-python-bindings, or their
folders of tests alone; the packages themselves are installed. Tests that call none of our functions are counted as
such: they say nothing about us. Those of the last two compare nothing: each call is made of both, and their results
are compared.
"""

from __future__ import annotations

import argparse
import doctest
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import signedheat as sh

TESTS = {
    "trimesh": ("trimesh", ["tests/test_proximity.py", "tests/test_ray.py"]),
    "gpytoolbox": (
        "gpytoolbox",
        [
            f"test/test_{name}.py"
            for name in (
                "signed_distance",
                "signed_distance_polygon",
                "offset_surface",
                "winding_number",
                "fast_winding_number",
            )
        ],
    ),
    "pygeodesic": ("pygeodesic", ["tests/test_pygeodesic.py"]),
    "libigl-python-bindings": ("igl", ["tests/test_all.py"]),
}
"""Of packages tested by pytest: the name of the package, and files of its repository."""
HERE = Path(__file__).parent


class NotOurs(Exception):
    """An example of a function that we do not have."""


def run_pytest(folder: Path, package: str, files: list[str]) -> list[tuple[str, str, str]]:
    """Name, outcome and reason of each test that could run."""
    present = [name for name in files if (folder / name).exists()]
    paths = os.pathsep.join([str(HERE), str(HERE.parents[1] / "src"), os.environ.get("PYTHONPATH", "")])
    environment = {"PYTHONPATH": paths, "CONFORMANCE": package, "MPLBACKEND": "agg"}
    command = [sys.executable, "-m", "pytest", "-p", "shims", "-p", "no:cacheprovider", "-q", "-s", "-W", "ignore"]
    with TemporaryDirectory() as scratch:
        copied = Path(shutil.copytree(folder, Path(scratch) / "peer"))
        for name in present:  # relative imports between tests need a package
            (copied / name).with_name("__init__.py").touch()
        for listed in ("tests/data", "models/2D"):  # by trimesh, and not needed
            (copied / listed).mkdir(parents=True, exist_ok=True)
        found = subprocess.run(
            [*command, "--rootdir", ".", *present],
            cwd=copied,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
    return rows_of(found)


def rows_of(found: subprocess.CompletedProcess[str]) -> list[tuple[str, str, str]]:
    """Name, outcome and reason, from the lines of a process."""
    rows = [line.split("\t")[1:] for line in found.stdout.splitlines() if line.startswith("CONFORMANCE\t")]
    if not rows:
        print(found.stdout[-2000:], found.stderr[-2000:], file=sys.stderr)
    unused = {"passed": "not ours", "failed": "cannot run"}
    return [
        (name, outcome if called == "True" else unused.get(outcome, outcome), why)
        for name, outcome, called, why in rows
    ]


def run_sample(folder: Path) -> list[tuple[str, str, str]]:
    """The calls of potpourri3d's sample program."""
    command = [sys.executable, "-W", "ignore", str(HERE / "held.py"), str(folder / "test/sample.py")]
    return rows_of(subprocess.run(command, capture_output=True, text=True, check=False))


def run_skfmm(folder: Path) -> list[tuple[str, str, str]]:
    """The examples of scikit-fmm's documentation, with `redistance` for its `distance`."""

    def distance(
        phi: Any, dx: Any = 1.0, self_test: Any = False, order: int = 2, narrow: float = 0.0, periodic: Any = False
    ) -> Any:
        if narrow != 0 or self_test not in (True, False) or order not in (1, 2):
            raise NotOurs("narrow bands, self-tests, orders")
        several = None if np.ndim(periodic) == 0 else [bool(each) for each in periodic]
        try:
            return sh.redistance(phi, dx, periodic=bool(periodic) if several is None else several)
        except sh.errors.SignedHeatError as error:
            raise ValueError(str(error)) from None

    def theirs(*arguments: Any, **options: Any) -> Any:
        raise NotOurs("travel times, extension velocities, heaps")

    text = (folder / "skfmm/__init__.py").read_text(encoding="utf-8")
    values = {"distance": distance, "np": np} | dict.fromkeys(("travel_time", "extension_velocities"), theirs)
    rows = []
    for example in doctest.DocTestParser().get_examples(text):
        name, used = f"line {example.lineno + 1}: {example.source.splitlines()[0]:.60}", "distance(" in example.source
        if "import" in example.source and "numpy" not in example.source:
            continue
        case = doctest.DocTest([example], values, name, None, None, None)
        runner, told = doctest.DocTestRunner(verbose=False, optionflags=doctest.IGNORE_EXCEPTION_DETAIL), list[str]()
        runner.run(case, out=told.append, clear_globs=False)
        values = case.globs
        whole = "".join(told)
        if "NotOurs" in whole or "NameError" in whole:  # what follows from it is not ours either
            for name in re.findall(r"\w+", re.split(r"[^=!<>]=[^=]", example.source)[0]):
                values.pop(name, None) if name not in ("np", "distance") else None
        lost = "NotOurs" in whole or "NameError" in whole
        if used or (example.want or "assert" in example.source):
            outcome = "not ours" if lost else "failed" if told else "passed"
            rows.append((name, outcome, whole.strip().splitlines()[-1].strip() if told else ""))
    return rows


OTHERS = {"scikit-fmm": run_skfmm, "potpourri3d": run_sample}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("peers", type=Path)
    parser.add_argument("names", nargs="*", default=[*TESTS, *OTHERS], help="some of the packages")
    arguments = parser.parse_args()
    peers, names = arguments.peers.resolve(), arguments.names
    for name, (package, files) in TESTS.items():
        if name not in names:
            continue
        folder = peers / name
        if folder.is_dir() and find_spec(package):
            show(name, run_pytest(folder, package, files))
        else:
            print(f"{name}: not there, or not installed")
    for name, run in OTHERS.items():
        if name in names and (peers / name).is_dir():
            show(name, run(peers / name))


def show(name: str, rows: list[tuple[str, str, str]]) -> None:
    counts = {
        kind: sum(outcome == kind for _, outcome, _ in rows)
        for kind in ("passed", "failed", "not ours", "cannot run", "skipped")
    }
    print(f"\n{name}:", ", ".join(f"{count} {kind}" for kind, count in counts.items() if count))
    for test, outcome, why in rows:
        if outcome in ("failed", "cannot run"):
            print(f"    {test.rpartition('/')[2]}: {why}")


if __name__ == "__main__":
    main()
