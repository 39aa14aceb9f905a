"""Every comparison, as its command printed it: `python benchmarks/report.py` writes benchmarks/results.md.

    python benchmarks/report.py [NAME …]     (some comparisons only; the others keep what their last run printed)

Each comparison runs in a process of its own, ours and the peers' side by side in one run. Nothing is picked from what
it prints. How busy the machine was before and after is kept too.
"""

from __future__ import annotations

import inspect
import json
import os
import platform
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
KEPT = HERE / "results.json"
PAGE = HERE / "results.md"
PEERS = ["potpourri3d", "libigl", "meshlib", "pygeodesic", "trimesh", "numpy", "scipy", "numba", "mkl"]


@dataclass(frozen=True)
class Comparison:
    """A command, and what it compares."""

    title: str
    command: tuple[str, ...]
    about: str


COMPARISONS = {
    "grids": Comparison(
        "Grids in space",
        ("grid.py", "64", "128", "256"),
        """Seconds per step of the method alone on a closed sphere of 20,000 faces, beside one cosine transform of that
        size (dctn), the least that any solver of Poisson's equation on grids takes; memory; error before and after
        sharpening. Wall-clock times, the least of six runs.""",
    ),
    "spheres": Comparison(
        "Solids in space: spheres",
        ("grid.py", "--peers"),
        """Spheres, whole and damaged, at 128³: `sh.signed_distance` and its offset; unsigned distance × sign of fast
        winding numbers by libigl, each tree built once; offsets by MeshLib. Both do less, and are as exact or more
        where the whole surface is there or little of it is missing. CPU seconds, the least of three runs; in brackets,
        how much longer the slowest took.""",
    ),
    "solids-turned": Comparison(
        "Solids in space: whole shapes and turned faces",
        ("solids.py", "whole", "10 % of the faces turned", "half of the faces turned", "--repeats", "2"),
        """Four closed shapes, at the same resolution for all three programs. libigl and MeshLib take the winding number
        for the sign, which is right while few faces are turned; and at points they are many times faster.""",
    ),
    "solids-missing": Comparison(
        "Solids in space: missing faces",
        ("solids.py", "15 % of the faces missing", "six holes", "half of it missing", "--repeats", "1"),
        """The same shapes. Single missing faces are put back here, whose rims tell what they were; winding numbers are
        a little off there. Heat completes holes better than winding numbers. With half of the shape gone, nothing
        tells where the rest was. One run.""",
    ),
    "solids-noise": Comparison(
        "Solids in space: noise and doubled faces",
        ("solids.py", "noise", "loose faces with noise", "every face twice, shifted", "--repeats", "1"),
        """The same shapes: vertices moved by 0.01 along each axis; loose faces, each moved by as much; every face
        twice. One run.""",
    ),
    "surfaces": Comparison(
        "Triangle meshes",
        ("surface.py", "--levels", "6", "--repeats", "1"),
        """First, next and batched distances beside potpourri3d, which is the authors' own C++, and beside the two
        sparse solves that the method cannot do without (bare). CPU seconds, one run.""",
    ),
    "broken-curves": Comparison(
        "Broken curves on surfaces",
        ("broken_curves.py", "--seeds", "3"),
        """Distance to what is left of a curve against distance to the whole: five meshes, three seeds ([ten seeds
        each](../docs/evidence.md#how-good-are-broken-curves)). In brackets, how often a program failed.""",
    ),
    "polygons": Comparison(
        "Polygons, points, voxels",
        ("domains.py", "polygons", "points", "voxels", "--sizes", "4000", "16000", "--repeats", "2"),
        """Every other surface beside potpourri3d or, for voxels, beside the same without smoothing ("peer"). CPU
        seconds, the least of two runs.""",
    ),
    "volumes": Comparison(
        "Grids with walls, and tets",
        ("domains.py", "volumes", "--volumes", "70000", "--repeats", "1"),
        """There is no peer in Python: "peer" is our own field without sharpening.""",
    ),
    "tets": Comparison(
        "Tet meshes",
        ("tets.py", "--most", "8e4"),
        """Against closed forms, and beside a plain implementation of the paper's operators (following, recipe).""",
    ),
    "bands": Comparison(
        "Narrow bands",
        ("bands.py", "192", "--shapes", "whole", "six holes"),
        """Closed surfaces of unit spheres at 192 nodes along a side, from narrow bands, beside MeshLib's OpenVDB and
        winding modes, and libigl's winding numbers in blocks that it was given. MeshLib's OpenVDB mode is the fastest
        for closed meshes.""",
    ),
}
ABOUT = """# Benchmarks

What the comparisons print, whole and unchanged. In each, all programs run one after the other on the same machine, and
take turns where there are repeats. A peer is called as its documentation says; where one is better, the table shows it.
`python benchmarks/report.py` makes this page anew, `python benchmarks/report.py NAME` one comparison of it, to repeat a
run that was disturbed.

**How far to trust the times.** Errors are the same in every run. Times are not: the machine is shared. Its load, the
mean number of processes that wanted to run in the last minute, is given with each comparison: beyond the number of
cores wall-clock times mean little, and all but the first comparison therefore give CPU seconds of all threads, which
grow by a fifth or so under load. Where repeats are told, their spread is too. Ratios within one comparison hold better
than seconds, and one of less than 1.3 means little. Libraries are loaded and kernels compiled before any clock starts.

**Peers.** libigl, MeshLib and potpourri3d (`pip install libigl meshlib potpourri3d`). signedheat3d, the authors'
program for volumes, has no wheel, and its source distribution downloads other libraries while it is built, which was
not possible here: `python benchmarks/grid.py --peers` runs it where it is installed. What more packages can do at all
is in [evidence](../docs/evidence.md)."""


def main(names: list[str]) -> int:
    unknown = set(names) - set(COMPARISONS)
    if unknown:
        print(f"no such comparison: {', '.join(sorted(unknown))}; there are {', '.join(COMPARISONS)}", file=sys.stderr)
        return 2
    for name in names or COMPARISONS:
        print(f"== {name}", flush=True)
        begin, load = time.perf_counter(), os.getloadavg()[0]
        command = [sys.executable, "-W", "ignore", str(HERE / COMPARISONS[name].command[0])]
        run = subprocess.run([*command, *COMPARISONS[name].command[1:]], capture_output=True, text=True)
        if run.returncode:
            print(run.stderr, file=sys.stderr)
            return run.returncode
        load = f"{load:.1f} before, {os.getloadavg()[0]:.1f} after"
        seconds = round(time.perf_counter() - begin)
        kept = so_far()
        kept[name] = {"printed": run.stdout.rstrip(), "seconds": seconds, "load": load, **circumstances()}
        KEPT.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(run.stdout, flush=True)
    PAGE.write_text(page(so_far()), encoding="utf-8")
    return 0


def so_far() -> dict[str, dict[str, Any]]:
    """What the last run of each comparison printed; read anew each time, since several may run at once."""
    return json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}


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


def page(kept: dict[str, dict[str, Any]]) -> str:
    lines = [ABOUT]
    for name, comparison in COMPARISONS.items():
        lines += ["", f"## {comparison.title}", "", inspect.cleandoc(comparison.about), ""]
        if name not in kept:
            lines += [f"Not run yet: `python benchmarks/report.py {name}`."]
            continue
        run = kept[name]
        lines += [f"`python benchmarks/{shlex.join(comparison.command)}` (`report.py {name}`; {run['seconds']} s; "]
        lines += [f"load {run.get('load', 'unknown')}; {run['machine']}; {run['versions']})", ""]
        lines += ["```text", run["printed"], "```"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
