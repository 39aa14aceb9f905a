"""How running times grow: seconds for n, 2n and 4n, and exponents fitted to them, of n and of the solids' triangles.

python benchmarks/growth.py [CASE …]
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


def circle(mesh: sh.TriangleMesh, begin: float, end: float) -> sh.Curve:
    """A part of a circle on the unit sphere, between shares of it."""
    angle = 2 * np.pi * np.linspace(begin, end, 60)
    return mesh.polyline(np.stack([np.cos(angle), np.sin(angle), np.full(60, 0.2)], axis=1))


def broken_curve(n: int) -> Callable[[], object]:
    """The distance to a circle with a gap, on a sphere of n vertices."""
    ball = hull_of(spiral(n))
    curve = circle(ball, 0.0, 0.9)
    return lambda: sh.signed_distance(curve, ball)


def strokes(n: int) -> Callable[[], object]:
    """The distance to n strokes along a circle on a sphere, every third of which is turned."""
    ball = samples.sphere(5)
    pieces = [circle(ball, k / n, (k + 0.8) / n) for k in range(n)]
    pieces = [piece.reversed() if k % 3 == 0 else piece for k, piece in enumerate(pieces)]
    return lambda: sh.signed_distance(pieces, ball)


def piecewise_on_many_parts(n: int) -> Callable[[], object]:
    """Piecewise distance on n octahedra, each with a curve of its own."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    shifts = 3.0 * np.stack([np.arange(n), np.zeros(n), np.zeros(n)], axis=1)
    vertices = (corners + shifts[:, None]).reshape(-1, 3)
    mesh = sh.TriangleMesh(vertices, (faces + 6 * np.arange(n)[:, None, None]).reshape(-1, 3))
    curves = [mesh.path([6 * k, 6 * k + 2]) for k in range(n)]
    return lambda: sh.piecewise_distance(curves, mesh)


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
    return lambda: solver.distance(shape, sh.constraints.EachComponent())


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
    """The solid of a ball of 200 n faces with holes around n places, some of which run together."""
    points = spiral(100 * n)
    faces = hull(points)
    away = cKDTree(points[50::100]).query(points[faces].mean(axis=1))[0]
    shape = sh.TriangleMesh(points, faces[away > 0.8 / n**0.5])
    return lambda: sh.complete(shape)


def tube(n: int, heights: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a tube of radius 1 with n sides, in rows between heights."""
    angle, side = 2 * np.pi * np.arange(n) / n, np.arange(n)
    rings = [np.stack([np.cos(angle), np.sin(angle), np.full(n, height)], axis=1) for height in heights]
    after = (side + 1) % n
    row = np.concatenate([np.stack([side, after, n + after], axis=1), np.stack([side, n + after, n + side], axis=1)])
    return np.concatenate(rings), np.concatenate([row + n * k for k in range(len(heights) - 1)])


def rim_edges(n: int) -> Callable[[], object]:
    """The solid of a short tube, whose two rims have n edges as long as its faces are high."""
    shape = tube(n, [0.0, 2 * np.pi / n, 4 * np.pi / n])
    return lambda: sh.complete(shape)


def slivers(n: int) -> Callable[[], object]:
    """The solid of a tube of 2 n faces that are as high as the tube is wide."""
    shape = tube(n, [0.0, 1.0])
    return lambda: sh.complete(shape)


def valence(n: int) -> Callable[[], object]:
    """The solid of two cones, whose tips n faces meet in."""
    ring = tube(n, [0.0, 1.0])[0][:n]
    side, after = np.arange(n), (np.arange(n) + 1) % n
    faces = [np.stack([side, after, 0 * side + n], axis=1), np.stack([after, side, 0 * side + n + 1], axis=1)]
    shape = np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]), np.concatenate(faces)
    return lambda: sh.complete(shape)


def corners_of_polygons(n: int) -> Callable[[], object]:
    """The solid of a prism over a flower of n corners."""
    rings = tube(n, [-0.5, 0.5])[0]
    rings[:, :2] *= 1 + 0.2 * np.cos(9 * 2 * np.pi * np.arange(2 * n) / n)[:, None]
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    shape = sh.PolygonMesh(rings, [list(range(n))[::-1], list(range(n, 2 * n)), *sides])
    return lambda: sh.complete(shape)


def crossing_faces(n: int) -> Callable[[], object]:
    """The solid of n large triangles through each other: those of a ball whose vertices change places."""
    points = spiral(n // 2 + 2)
    shape = np.random.default_rng(0).permutation(points), hull(points)
    return lambda: sh.complete(shape, keep_overlaps=True)


def bars(n: int) -> Callable[[], object]:
    """The solid of n bars through one place, where the faces of all cross those of all others."""
    rng, box = np.random.default_rng(0), hull_of(np.array(list(np.ndindex(2, 2, 2))) * [2, 0.1, 0.1] - [1, 0.05, 0.05])
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(n)]
    shape = copies(box, [box.vertices @ (turn * np.linalg.det(turn)) for turn in turns])
    return lambda: sh.complete(shape, keep_overlaps=True)  # all pieces are the output


def nested_shells(n: int) -> Callable[[], object]:
    """The solid of n closed balls, each in the next."""
    ball = samples.sphere(2)
    shape = copies(ball, [ball.vertices * radius for radius in np.linspace(0.2, 1.0, n)])
    return lambda: sh.complete(shape)


def panels(n: int) -> Callable[[], object]:
    """The solid of a ball in n panels from pole to pole, with gaps between their long rims."""
    turn, height = np.meshgrid(np.linspace(0, 0.999, 3), np.linspace(-0.45, 0.45, 24) * np.pi)
    corner = np.arange(72).reshape(24, 3)[:-1, :-1].ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 4], corner[:, None] + [0, 4, 3]])
    places = []
    for k in range(n):
        angle = 2 * np.pi * (k + turn) / n
        place = np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)
        places.append(np.stack(place, axis=-1).reshape(-1, 3))
    shape = copies(sh.TriangleMesh(places[0], faces), places)
    return lambda: sh.complete(shape)


def collinear_faces(n: int) -> Callable[[], object]:
    """The solid of n triangles between random points of one line, which only rounding gives areas."""
    rng = np.random.default_rng(5)
    shape = sh.TriangleMesh(rng.random((n, 1)) * [[1, 2, 3]], rng.integers(0, n, (n, 3)))
    return lambda: sh.complete(shape)


def overlapping_balls(n: int) -> Callable[[], object]:
    """The solid of n balls along a chain, each of which overlaps the next."""
    ball = samples.sphere(2)
    middles = np.stack([1.2 * np.arange(n), np.zeros(n), np.zeros(n)], axis=1)
    middles += 0.1 * np.random.default_rng(0).normal(size=(n, 3))
    return lambda: sh.complete(copies(ball, list(ball.vertices + middles[:, None])))


def clustered_balls(n: int) -> Callable[[], object]:
    """The solid of n balls in a cube, each of which overlaps a few others."""
    ball = samples.sphere(1)
    middles = n ** (1 / 3) * np.random.default_rng(0).random((n, 3)) * 1.6
    return lambda: sh.complete(copies(ball, list(ball.vertices + middles[:, None])))


def loose_pieces(n: int) -> Callable[[], object]:
    """The solid of a ball of n triangles that do not touch each other."""
    points = spiral(n // 2 + 2)
    triangles = points[hull(points)]
    triangles += 0.02 / n**0.5 * np.random.default_rng(0).normal(size=(len(triangles), 1, 3))
    shape = triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    return lambda: sh.complete(shape)


def points(n: int) -> Callable[[], object]:
    """The solid of n points on a ball, without normals."""
    cloud = sh.PointCloud(spiral(n))
    return lambda: sh.complete(cloud)


def faces(n: int) -> Callable[[], object]:
    """The solid of a ball of n faces."""
    places = spiral(n // 2 + 2)
    shape = places, hull(places)
    return lambda: sh.complete(shape)


def voxels(n: int) -> Callable[[], object]:
    """The solid of a ball of about n voxels."""
    side = round((6 * n / np.pi) ** (1 / 3))
    at = np.stack(np.indices((side,) * 3), axis=-1) - (side - 1) / 2
    inside = np.linalg.norm(at, axis=-1) < side / 2
    return lambda: sh.complete(sh.DigitalSurface(inside).smooth_surface)


def hull_of(corners: np.ndarray) -> sh.TriangleMesh:
    """The convex hull of some points."""
    return sh.TriangleMesh(corners, hull(corners))


def copies(shape: sh.TriangleMesh, places: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """A mesh as often as there are places of its vertices."""
    firsts = shape.n_vertices * np.arange(len(places))
    return np.concatenate(places), (shape.faces + firsts[:, None, None]).reshape(-1, 3)


CASES = {
    fine_curve_in_a_face: 1000,
    curve_along_an_edge: 1000,
    many_curves: 640,
    broken_curve: 10000,
    strokes: 10,
    piecewise_on_many_parts: 200,
    groups_on_tets: 16,
    open_boxes: 250,
    holes_in_one_part: 100,
    faces: 20000,
    points: 1000,
    voxels: 20000,
    valence: 4000,
    rim_edges: 1000,
    slivers: 4000,
    corners_of_polygons: 2000,
    loose_pieces: 4000,
    overlapping_balls: 50,
    clustered_balls: 60,
    crossing_faces: 40,
    bars: 5,
    nested_shells: 32,
    panels: 16,
    collinear_faces: 500,
}


def measured(run: Callable[[], object]) -> tuple[float, float]:
    """Processor time of one run, and how many triangles it made, if it made a solid."""
    begin = time.process_time()
    made = run()
    return time.process_time() - begin, float(len(made.triangles)) if isinstance(made, sh.Solid) else np.nan


def main() -> None:
    print("| case | n | seconds for n, 2 n, 4 n | exponent of n | of the output |\n|---|--:|--:|--:|--:|")
    for case, n in CASES.items():
        if sys.argv[1:] and case.__name__ not in sys.argv[1:]:
            continue
        measured(case(n))  # compiles
        sizes = np.array([n, 2 * n, 4 * n])
        times, made = np.transpose([measured(case(size)) for size in sizes.tolist()])
        exponents = [np.polyfit(np.log(x), np.log(times), 1)[0] for x in (sizes, made) if x[-1] > 1.5 * x[0]]
        told = ", ".join(f"{seconds:.3g}" for seconds in times)
        row = f"{case.__name__.replace('_', ' ')} | {n:,} | {told} | " + " | ".join(f"{x:.2f}" for x in exponents)
        print(f"| {row} |" + " – |" * (2 - len(exponents)), flush=True)


if __name__ == "__main__":
    main()
