"""What this library and others can do, tried out: `python benchmarks/features.py` writes its table in docs/evidence.md.

Every cell of the table is a run: a task, done with the calls that a package's documentation names for it, and judged
against the same truth. The truth in space is libigl's exact distance to the whole part; on the sphere it is arc length.
Packages: potpourri3d, libigl, MeshLib, trimesh, PyVista, gpytoolbox (pip install potpourri3d libigl meshlib trimesh
rtree manifold3d pyvista gpytoolbox). What is not installed has no column.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from peers import calls, cases

import signedheat as sh
from signedheat import samples

PAGE = Path(__file__).parent.parent / "docs" / "evidence.md"
BEGIN, END = "<!-- features.py -->", "<!-- end -->"
"""What stands before and after the table."""
PACKAGES = ["signedheat", "potpourri3d", "libigl", "meshlib", "trimesh", "pyvista", "gpytoolbox"]
OFFSET = 0.1


@cache
def part() -> sh.TriangleMesh:
    """A block with a boss and a hole, closed, of one piece."""
    grid = sh.Grid((-1.5, -1.1, -0.9), 0.05, (61, 45, 41))
    x, y, z = np.moveaxis(grid.points, -1, 0)
    block = sh.Field(grid, np.maximum.reduce([np.abs(x) - 1.2, np.abs(y) - 0.8, np.abs(z + 0.2) - 0.3]))
    boss = sh.Field(grid, np.maximum(np.hypot(x - 0.4, y) - 0.4, np.abs(z) - 0.6))
    hole = sh.Field(grid, np.hypot(x + 0.6, y) - 0.3)
    return sh.morphology.smooth_difference(sh.morphology.smooth_union(block, boss, 0.2), hole, 0.1).contour()


@cache
def damaged(how: str) -> sh.TriangleMesh:
    """The part, whole or broken in one way."""
    return {
        "whole": part,
        "half of the faces turned": lambda: samples.with_flipped_faces(part(), 0.5, seed=1),
        "25 % of the faces missing": lambda: samples.without_faces(part(), 0.25, seed=2),
        "six holes": lambda: samples.without_patches(part(), 6, 0.3, seed=3),
        "three quarters of it missing": lambda: samples.without_faces(part(), 0.75, seed=4),
    }[how]()


DAMAGES = [
    "whole",
    "half of the faces turned",
    "25 % of the faces missing",
    "six holes",
    "three quarters of it missing",
]


@cache
def points() -> np.ndarray:
    low, high = part().vertices.min(axis=0) - 0.3, part().vertices.max(axis=0) + 0.3
    return np.random.default_rng(0).uniform(low, high, size=(3000, 3))


def exact(places: np.ndarray) -> np.ndarray:
    """Distance of places from the whole part."""
    import igl

    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    return np.asarray(igl.signed_distance(places, np.array(part().vertices), np.array(part().faces), kind)[0])


def relative(values: np.ndarray, truth: np.ndarray) -> str:
    """Root mean square error in per cent of the range of the truth."""
    error = 100 * np.sqrt(np.mean((np.asarray(values, dtype=float) - truth) ** 2)) / np.ptp(truth)
    return f"{error:.2g} %" if error >= 0.005 else "0"


def judged_surface(level: float) -> Callable[[Any], str]:
    """Whether a surface (vertices, faces) is closed, and how far it is from the level, in per cent of the diagonal."""

    def judge(surface: tuple[np.ndarray, np.ndarray]) -> str:
        vertices, faces = (np.asarray(array) for array in surface)
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        closed = bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())
        diagonal = np.linalg.norm(np.ptp(part().vertices, axis=0))
        off = 100 * np.sqrt(np.mean((exact(np.ascontiguousarray(vertices, dtype=float)) - level) ** 2)) / diagonal
        return f"{off:.2g} %" + ("" if closed else ", open")

    return judge


def in_space(row: str, how: str) -> tuple[str, str, Callable[[], tuple], Callable[[Any], str]]:
    more = (points(),) if row == "distance at points" else (OFFSET,)
    return (f"{row}, {how}", row, lambda: (damaged(how), *more), JUDGES[row])


JUDGES: dict[str, Callable[[Any], str]] = {
    "distance at points": lambda values: relative(values, exact(points())),
    "offset surface": judged_surface(OFFSET),
}


def either_sign(values: np.ndarray) -> str:
    """As distance at points; which side of a reconstructed surface is outside is a convention."""
    truth = exact(points())
    return relative(np.asarray(values) * np.sign(np.sum(values * truth)), truth)


def on_sphere(values: np.ndarray) -> str:
    """Error of signed distance from a parallel of the unit sphere, in either sign: sides are a convention."""
    vertices = cases.globe()[0]
    truth = np.arcsin(np.clip(vertices[:, 2], -1, 1)) - np.arcsin(vertices[cases.ring(), 2].mean())
    values = np.asarray(values, dtype=float)
    return relative(values * np.sign(np.sum(values * truth)), truth)


def unsigned_on_sphere(values: np.ndarray) -> str:
    vertices = cases.globe()[0]
    truth = np.arccos(np.clip(vertices @ vertices[cases.ring()[0]], -1, 1))
    return relative(values, truth)


def volume_of_difference(volume: float) -> str:
    """A unit cube without a smaller one, half of which sticks out of a side."""
    error = 100 * abs(volume - 0.9375) / 0.9375
    return f"{error:.2g} %" if error >= 0.005 else "0"


def in_plane(values: np.ndarray) -> str:
    return relative(values, np.linalg.norm(cases.plane_points(), axis=1) - 1)


ROWS = [
    *(in_space("distance at points", how) for how in DAMAGES),
    ("distance at points, from points with normals", "points", lambda: (cases.cloud(part()), points()), either_sign),
    ("distance at points, from points alone", "bare points", lambda: (cases.cloud(part()), points()), either_sign),
    *(in_space("offset surface", how) for how in DAMAGES),
    ("open sheet → closed wall", "thicken", tuple, lambda surface: cases.closed_wall(*surface)),
    ("a − b of closed meshes, volume", "boolean", tuple, volume_of_difference),
    ("signed distance in the plane, whole outline", "plane whole", lambda: (1.0,), in_plane),
    ("the same, 30 % of the outline missing", "plane", lambda: (0.7,), in_plane),
    ("along a surface from a point", "geodesic", tuple, unsigned_on_sphere),
    ("signed, along a surface, from a curve", "curve", lambda: (1.0,), on_sphere),
    ("the same, 30 % of the curve missing", "broken curve", lambda: (0.7,), on_sphere),
    ("the same on a mesh of polygons", "polygons", lambda: (0.7,), on_sphere),
    ("the same on points", "surface points", lambda: (0.7,), on_sphere),
]  # fmt: skip
"""Title, name of the call, its arguments, and what judges its result."""


def main() -> int:
    warnings.simplefilter("ignore")
    installed, lines = versions(), []
    for title, name, arguments, judge in ROWS:
        cells = [cell(package, name, arguments, judge) for package in installed]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    PAGE.write_text(page(installed, lines), encoding="utf-8")
    return 0


def cell(package: str, name: str, arguments: Callable[[], tuple], judge: Callable[[Any], str]) -> str:
    """What a package made of a task: the judgement, "fails", "not run", or "–" where it has no call for it."""
    call = calls.CALLS[package].get(name)
    if call is None:
        return "–"
    given = arguments()
    begin = time.perf_counter()
    try:
        result = call(*given)
        seconds = time.perf_counter() - begin
        print(f"  {package}, {name}: {seconds:.2f} s", file=sys.stderr)
        return judge(result)
    except ModuleNotFoundError:
        return "not run"  # it needs another package
    except Exception as error:  # whatever another package throws
        print(f"  {package}, {name}: {type(error).__name__}: {str(error)[:200]}", file=sys.stderr)
        return "fails"


def versions() -> dict[str, str]:
    """The packages that are installed, by name, with their versions."""
    found = {"signedheat": sh.__version__}
    for name in PACKAGES[1:]:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def page(installed: dict[str, str], lines: list[str]) -> str:
    """The page with this table in place of the old one."""
    head = "| | " + " | ".join(f"{name} {number}" for name, number in installed.items()) + " |"
    table = f"{head}\n|---|{'---|' * len(installed)}\n" + "\n".join(lines)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    return f"{before}{BEGIN}\n{table}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    sys.exit(main())
