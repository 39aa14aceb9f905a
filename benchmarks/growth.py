"""How running times grow: seconds for n, 2n and 4n, and the exponent fitted to them; 1 is linear.

python benchmarks/growth.py
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import signedheat as sh
from signedheat import samples

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes.triangulated import hull, spiral


def fine_curve_in_a_face(n: int) -> Callable[[], object]:
    """An unoriented flower of n points inside one triangle."""
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    angle = 2 * np.pi * np.arange(n) / n
    radius = 0.2 * (0.6 + 0.4 * np.cos(7 * angle))
    x, y = 0.33 + radius * np.cos(angle), 0.33 + radius * np.sin(angle)
    curve = sh.Curve(np.zeros(n, dtype=int), np.stack([1 - x - y, x, y], axis=1), closed=True, oriented=False)
    return lambda: sh.SignedHeatSolver(mesh).discretization.adapt([curve])


def many_curves(n: int) -> Callable[[], object]:
    """n unoriented curves, one across every other face of a sphere."""
    mesh = samples.sphere(int(np.ceil(np.log(max(n / 10, 1)) / np.log(4))))
    ends = [[0.5, 0.3, 0.2], [0.2, 0.5, 0.3]]
    curves = [sh.Curve([f, f], ends, oriented=False) for f in range(0, min(2 * n, mesh.n_faces), 2)]
    return lambda: sh.SignedHeatSolver(mesh).discretization.adapt(curves)


def curve_along_an_edge(n: int) -> Callable[[], object]:
    """An unoriented curve of n points along one edge, with an end inside the face."""
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    along = np.linspace(0.1, 0.9, n)
    places = np.stack([1 - along, along, np.zeros(n)], axis=1)
    places = np.concatenate([places, [[0.3, 0.3, 0.4]]])
    curve = sh.Curve(np.zeros(n + 1, dtype=int), places, oriented=False)
    return lambda: sh.SignedHeatSolver(mesh).discretization.adapt([curve])


def piecewise_on_many_parts(n: int) -> Callable[[], object]:
    """Piecewise distance on n octahedra, each with a curve of its own."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    shifts = 3.0 * np.stack([np.arange(n), np.zeros(n), np.zeros(n)], axis=1)
    vertices = (corners + shifts[:, None]).reshape(-1, 3)
    mesh = sh.TriangleMesh(vertices, (faces + 6 * np.arange(n)[:, None, None]).reshape(-1, 3))
    curves = [mesh.path([6 * k, 6 * k + 2]) for k in range(n)]
    return lambda: sh.piecewise_distance(mesh, curves)


def groups_on_tets(n: int) -> Callable[[], object]:
    """n spheres in a tet mesh, each at a level of its own."""
    ball = samples.sphere(1, 0.3)
    side = int(np.ceil(n ** (1 / 3)))
    places = np.stack(np.indices((side,) * 3), axis=-1).reshape(-1, 3)[:n]
    vertices = (ball.vertices + places[:, None]).reshape(-1, 3)
    faces = (ball.faces + ball.n_vertices * np.arange(n)[:, None, None]).reshape(-1, 3)
    shape = sh.TriangleMesh(vertices, faces)
    tets = sh.tetrahedralize(shape, resolution=3 * side)
    solver = sh.SignedHeatSolver(tets)
    return lambda: solver.distance(shape, sh.EachComponent())


def open_boxes(n: int) -> Callable[[], object]:
    """Solids of n boxes without a lid."""
    corners = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]])
    faces = sides[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    places = 2.0 * np.stack(np.unravel_index(np.arange(n), (int(np.ceil(n ** (1 / 3))),) * 3), axis=1)
    vertices = (corners + places[:, None]).reshape(-1, 3)
    shape = sh.TriangleMesh(vertices, (faces + 8 * np.arange(n)[:, None, None]).reshape(-1, 3))
    return lambda: sh.complete(shape)


def holes_in_one_part(n: int) -> Callable[[], object]:
    """The solid of a ball with n holes, of 200 faces each."""
    points = spiral(100 * n)
    faces = hull(points)
    away = cKDTree(points[50::100]).query(points[faces].mean(axis=1))[0]
    shape = sh.TriangleMesh(points, faces[away > 0.8 / n**0.5])
    return lambda: sh.complete(shape)


CASES = {
    fine_curve_in_a_face: 1000,
    curve_along_an_edge: 1000,
    many_curves: 640,
    piecewise_on_many_parts: 200,
    groups_on_tets: 16,
    open_boxes: 250,
    holes_in_one_part: 100,
}


def seconds(run: Callable[[], object]) -> float:
    """Processor time of one run."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def main() -> None:
    for case, n in CASES.items():
        seconds(case(n))  # compiles
        sizes = [n, 2 * n, 4 * n]
        times = [seconds(case(size)) for size in sizes]
        exponent = np.polyfit(np.log(sizes), np.log(times), 1)[0]
        print(f"{case.__name__:26}", *(f"{m:6d}: {t:7.3f} s" for m, t in zip(sizes, times, strict=True)), end="")
        print(f"   n^{exponent:.2f}", flush=True)


if __name__ == "__main__":
    main()
