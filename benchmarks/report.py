"""One page with every comparison, as its commands printed it: `python benchmarks/report.py` writes docs/benchmarks.md.

    python benchmarks/report.py [NAME …]     (some comparisons only; the others keep what their last run printed)

Each comparison runs in a process of its own, ours and the peers' side by side in one run. Nothing is picked from what
it prints.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

HERE = Path(__file__).parent
KEPT = HERE.parent / "docs" / "benchmarks.json"
PAGE = HERE.parent / "docs" / "benchmarks.md"
PEERS = ["potpourri3d", "libigl", "meshlib", "pygeodesic", "trimesh", "numpy", "scipy", "numba", "mkl"]


@dataclass(frozen=True)
class Comparison:
    """A command, and what it compares."""

    title: str
    command: tuple[str, ...]
    about: str


COMPARISONS = {
    "space": Comparison(
        "Grids in space",
        ("grid.py", "64", "128", "256", "--peers"),
        "Seconds per step beside one cosine transform, memory, error; then whole, holed, scattered, turned and noisy "
        "spheres beside libigl (unsigned distance × sign of fast winding numbers, trees built once) and MeshLib. "
        "Both do less, and are as exact or more where the whole surface is there or little of it is missing.",
    ),
    "surfaces": Comparison(
        "Triangle meshes",
        ("surface.py", "--levels", "6", "--repeats", "3"),
        "First, next and batched distances beside potpourri3d, which is the authors' own C++.",
    ),
    "broken-curves": Comparison(
        "Broken curves on surfaces",
        ("broken_curves.py", "--seeds", "3"),
        "Distance to what is left of a curve against distance to the whole.",
    ),
    "domains": Comparison(
        "Polygons, points, voxels",
        ("domains.py",),
        "Every other surface beside potpourri3d where it has that domain.",
    ),
    "tets": Comparison("Tet meshes", ("tets.py",), "Against closed forms; there is no peer in Python."),
}


def main(names: list[str]) -> int:
    unknown = set(names) - set(COMPARISONS)
    if unknown:
        print(f"no such comparison: {', '.join(sorted(unknown))}; there are {', '.join(COMPARISONS)}", file=sys.stderr)
        return 2
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for name in names or COMPARISONS:
        print(f"== {name}", flush=True)
        begin = time.perf_counter()
        command = [sys.executable, "-W", "ignore", str(HERE / COMPARISONS[name].command[0])]
        run = subprocess.run([*command, *COMPARISONS[name].command[1:]], capture_output=True, text=True)
        if run.returncode:
            print(run.stderr, file=sys.stderr)
            return run.returncode
        kept[name] = {"printed": run.stdout.rstrip(), "seconds": round(time.perf_counter() - begin), **circumstances()}
        KEPT.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(run.stdout, flush=True)
    PAGE.write_text(page(kept), encoding="utf-8")
    return 0


def circumstances() -> dict[str, str]:
    """Machine and versions."""
    found = []
    for name in PEERS:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    machine = f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, Python {platform.python_version()}"
    return {"machine": machine, "versions": ", ".join(found)}


def page(kept: dict[str, dict[str, str]]) -> str:
    lines = [
        "# Benchmarks",
        "",
        "What the comparisons print, unshortened: one run each, all programs of a comparison one after the other on",
        "the same machine, which was busy with other work: times are up to several times those of an idle one, and",
        "scatter, so trust ratios, and figures of error and memory. A peer is called as its best user would call it;",
        "where one is better, the table shows it. `python benchmarks/report.py` makes this page.",
    ]
    for name, comparison in COMPARISONS.items():
        if name in kept:
            run = kept[name]
            command = " ".join(comparison.command)
            lines += ["", f"## {comparison.title}", "", comparison.about, ""]
            lines += [f"`python benchmarks/{command}` ({run['seconds']} s; {run['machine']}; {run['versions']})", ""]
            lines += ["```", run["printed"], "```"]
    left = [f"`python benchmarks/report.py {name}`" for name in COMPARISONS if name not in kept]
    if left:
        about = "Comparisons whose output this page does not have: "
        lines += ["", "## Not run yet", "", about + ", ".join(left) + "."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
