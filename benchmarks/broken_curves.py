"""Broken curves on surfaces: how far distance to what is left is from distance to the whole, ours and others'.

Closed curves on five generated meshes, one with a handle, are cut into about twelve pieces and damaged: 10, 25 or 50 %
of the length gone in random intervals; pieces moved across themselves by a normal deviate of one mean edge length;
10 or 30 % of the pieces turned; four spurious pieces. Truth is exact distance to the whole curve. Ways:

* one call: `sh.signed_distance`
* heat: `SignedHeatSolver.distance` of the pieces as they are; zero set: that, sharpened to its own zero set
* potpourri3d: as heat
* nearest: exact distance to the pieces, with the side of the nearest segment
* winding: exact distance to the pieces, with the sign of winding numbers on surfaces (`surface_winding.py`)

Error: root mean square of the difference, over the range of the truth, in percent; median and worst over meshes and
seeds. A failure of a program is counted, not averaged.

    python benchmarks/broken_curves.py [--seeds 10] [--picture broken.png]
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import potpourri3d as pp3d
import trimesh
from scipy.spatial import Delaunay, cKDTree

import signedheat as sh
from signedheat.discretization import discretize
from signedheat.geodesics.exact_distance import distance_to_segments
from signedheat.geodesics.geodesic_sources import PlacedSegments

sys.path.insert(0, str(Path(__file__).parents[1]))
from surface_winding import winding_side

from shapes.triangulated import upward

N_PIECES = 12
DAMAGES = {
    "10 % gone": {"lost": 0.1},
    "25 % gone": {"lost": 0.25},
    "50 % gone": {"lost": 0.5},
    "moved": {"lost": 0.25, "jitter": True},
    "10 % turned": {"lost": 0.25, "turned": 0.1},
    "30 % turned": {"lost": 0.25, "turned": 0.3},
    "spurious": {"lost": 0.25, "spurious": 4},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--meshes", nargs="+", help="names of some of them; by default all")
    parser.add_argument("--errors", help="where errors are kept (.npz); those that it holds are counted too")
    parser.add_argument("--picture", help="where to draw one case of each mesh")
    arguments = parser.parse_args()
    shown: dict[str, tuple] = {}
    kept = Path(arguments.errors) if arguments.errors else None
    errors = study(arguments.seeds, arguments.meshes, kept, shown)
    ways = list(dict.fromkeys(way for _, way in errors))
    print(f"{'median / worst, %':>18}" + "".join(f"{way:>22}" for way in ways))
    for damage in DAMAGES:
        row = ""
        for way in ways:
            row += f"{told(errors[damage, way]):>22}"
        print(f"{damage:>18}{row}")
    if arguments.picture:
        draw(shown, arguments.picture)


def study(
    seeds: int, names: list[str] | None = None, kept: Path | None = None, shown: dict[str, tuple] | None = None
) -> dict[tuple[str, str], list[float]]:
    """Errors by damage and way, of all meshes and seeds; what `kept` has is counted too."""
    warnings.simplefilter("ignore", sh.errors.InexactWarning)
    begin, errors = time.perf_counter(), {}
    if kept and kept.exists():
        errors = {tuple(key.split("|")): found.tolist() for key, found in np.load(kept).items()}
    for name, (mesh, heights) in meshes().items():
        if names and name not in names:
            continue
        curve = max(mesh.level_set(heights, 0.0), key=lambda c: c.n_points)
        region = np.sign(heights) if name != "torus" else np.sign(sh.signed_distance(curve, mesh).values)
        truth = region * unsigned(mesh, [curve])
        solver = sh.SignedHeatSolver(mesh)
        peer = pp3d.MeshSignedHeatSolver(np.array(mesh.vertices), np.array(mesh.faces))
        for damage, options in DAMAGES.items():
            for seed in range(seeds):
                pieces = damaged(mesh, heights, curve, np.random.default_rng(seed), **options)
                for way, values in answers(mesh, solver, peer, pieces).items():
                    errors.setdefault((damage, way), []).append(error(values, truth))
                if shown is not None and damage == "moved" and seed == 0:
                    shown[name] = mesh, pieces, solver.distance(pieces).values, truth
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)
        if kept:
            np.savez(kept, **{"|".join(key): found for key, found in errors.items()})
    return errors


def told(found: list[float]) -> str:
    """Median and worst, and how many failed."""
    failed = int(np.isnan(found).sum())
    worst = np.nanmax(found)
    return f"{np.nanmedian(found):.2f} / {worst:,.{2 if worst < 100 else 0}f}" + (f" ({failed})" if failed else "")


def answers(mesh, solver, peer, pieces) -> dict[str, np.ndarray]:
    """Values at the vertices, by way."""
    heat = solver.distance(pieces)
    distance = unsigned(mesh, pieces)
    try:
        theirs = np.asarray(peer.compute_distance([nodes(mesh, piece) for piece in pieces]))
    except (RuntimeError, ValueError):
        theirs = np.full(mesh.n_vertices, np.nan)
    return {
        "one call": sh.signed_distance(pieces, mesh).values,
        "heat": heat.values,
        "zero set": sh.sharpen(heat).values,
        "potpourri3d": theirs,
        "nearest": distance * nearest_side(mesh, pieces),
        "winding": distance * np.sign(winding_side(mesh, pieces)),
    }


def unsigned(mesh, curves) -> np.ndarray:
    """Exact distance of the vertices to curves."""
    surface = discretize(mesh)
    parts = [part for group in surface.segments(curves) for part in group]
    return distance_to_segments(surface.triangles, PlacedSegments.of(surface.triangles, parts))[0]


def nearest_side(mesh, curves) -> np.ndarray:
    """Side of the nearest of many points on the curves, in space."""
    points, sides = [], []
    normals = mesh.face_area_vectors / np.linalg.norm(mesh.face_area_vectors, axis=1)[:, None]
    for curve in curves:
        at = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
        end = slice(1, None) if not curve.closed else np.r_[1 : len(at), 0]
        start = at[:-1] if not curve.closed else at
        left = np.cross(normals[curve.faces[: len(start)]], at[end] - start)
        for t in np.linspace(0.05, 0.95, 8):
            points.append(start + t * (at[end] - start))
            sides.append(left)
    points, sides = np.concatenate(points), np.concatenate(sides)
    found = cKDTree(points).query(mesh.vertices)[1]
    return np.where(np.einsum("ij,ij->i", mesh.vertices - points[found], sides[found]) < 0, -1.0, 1.0)


def damaged(mesh, heights, curve, rng, lost, jitter=False, turned=0.0, spurious=0) -> list[sh.Curve]:
    """The pieces of a curve that are left, some turned, and some that belong to no curve."""
    pieces = broken(mesh, heights, curve, lost, jitter, rng)
    wrong = rng.permutation(len(pieces))[: round(turned * len(pieces))]
    pieces = [piece.reversed() if k in wrong else piece for k, piece in enumerate(pieces)]
    while spurious:
        center = mesh.vertices[rng.integers(mesh.n_vertices)]
        ball = np.linalg.norm(mesh.vertices - center, axis=1) - rng.uniform(0.1, 0.3) * np.ptp(mesh.vertices)
        rings = [ring for ring in mesh.level_set(ball + 1e-7 * rng.normal(size=len(ball))) if ring.closed]
        if rings:
            ring, start = max(rings, key=lambda c: c.n_points), rng.random()
            at = np.einsum("nk,nkd->nd", ring.barycentric, mesh.vertices[mesh.faces[ring.faces]])
            piece = between(at, ring, start, start + 0.15)
            if piece is not None:
                pieces.append(piece)
                spurious -= 1
    return pieces


def meshes() -> dict[str, tuple[sh.TriangleMesh, np.ndarray]]:
    """Five surfaces, and on each a function whose zero set is a closed, wavy curve.

    It meets no vertex: potpourri3d 1.4 crashes on curves that go from edges to vertices and back.
    """
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(4)
    unit = np.array(ball.vertices)
    x, y, z = unit.T
    wave = z + 0.0123 - 0.25 * np.sin(3 * np.arctan2(y, x)) * (1 - z**2)
    bumps = 1 + 0.2 * np.sin(5 * x + y) * np.cos(4 * y + z)
    ring = trimesh.creation.torus(1.0, 0.4, major_sections=80, minor_sections=32)
    patch = 0.55 - np.linalg.norm(ring.vertices - [1.0, 0.0, 0.4], axis=1)
    plane = rng.uniform(-1, 1, (2500, 2))
    plane = np.concatenate([plane, rim(50)])
    faces = upward(plane, Delaunay(plane).simplices)
    star = np.hypot(*plane.T) - 0.55 * (1 + 0.25 * np.cos(5 * np.arctan2(plane[:, 1], plane[:, 0])))
    hills = 0.25 * np.sin(4 * plane[:, 0]) * np.cos(3 * plane[:, 1])
    return {
        "sphere": (sh.TriangleMesh(unit, ball.faces), wave),
        "bumpy sphere": (sh.TriangleMesh(unit * bumps[:, None], ball.faces), wave),
        "torus": (sh.TriangleMesh(ring.vertices, ring.faces), patch),
        "random square": (sh.TriangleMesh(np.pad(plane, ((0, 0), (0, 1))), faces), star),
        "hills": (sh.TriangleMesh(np.column_stack([plane, hills]), faces), star),
    }


def rim(n: int) -> np.ndarray:
    """Points round the square [−1, 1]²."""
    s = np.linspace(-1, 1, n, endpoint=False)
    one = np.ones(n)
    return np.concatenate([np.stack(side, axis=1) for side in ((s, -one), (one, s), (-s, one), (-one, -s))])


def broken(mesh, heights, curve, lost, jitter, rng) -> list[sh.Curve]:
    """What is left of a curve; if jittered, each piece is from another level of the curve's function."""
    n_gaps = N_PIECES
    gaps = rng.dirichlet(np.ones(n_gaps)) * lost
    kept = rng.dirichlet(2 * np.ones(n_gaps)) * (1 - lost)
    ends = np.cumsum(np.stack([kept, gaps], axis=1).ravel()) + rng.random()
    points = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    pieces = []
    for begin, end in zip(np.concatenate([[ends[-1] - 1], ends[1:-1:2]]), ends[::2], strict=True):
        if not jitter:
            chosen = between(points, curve, begin, end)
            pieces += [] if chosen is None else [chosen]
            continue
        slope = np.abs(heights[mesh.edges.vertices[:, 1]] - heights[mesh.edges.vertices[:, 0]]).mean()
        level = slope * rng.normal()
        moved = max(mesh.level_set(heights, level), key=lambda c: c.n_points)
        at = np.einsum("nk,nkd->nd", moved.barycentric, mesh.vertices[mesh.faces[moved.faces]])
        start, stop = (nearest(at, points[along(points, s)]) for s in (begin, end))
        chosen = run(moved, start, stop)
        pieces += [] if chosen is None else [chosen]
    return pieces


def along(points, fraction) -> int:
    """Index of the point at a fraction of a closed curve's length."""
    length = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    position = np.concatenate([[0], np.cumsum(length)[:-1]]) / length.sum()
    return int(np.searchsorted(position, fraction % 1.0, side="right") - 1)


def between(points, curve, begin, end) -> sh.Curve | None:
    return run(curve, along(points, begin), along(points, end))


def nearest(points, x) -> int:
    return int(np.linalg.norm(points - x, axis=1).argmin())


def run(curve, start, stop) -> sh.Curve | None:
    """The points of a closed curve from one to another."""
    index = np.arange(start, start + (stop - start) % curve.n_points + 1) % curve.n_points
    return sh.Curve(curve.faces[index], curve.barycentric[index]) if len(index) > 1 else None


def nodes(mesh, curve) -> list:
    """A curve as potpourri3d takes it."""
    result = []
    for face, weights in zip(curve.faces, curve.barycentric, strict=True):
        first, second = np.sort(np.argsort(weights)[1:])
        corner = first if second == first + 1 else second
        edge = mesh.edges.face_edges[face, corner]
        head = (corner + 1) % 3 if mesh.edges.forward[face, corner] else corner
        result.append((int(edge), [float(weights[head])]))
    return result


def error(phi, whole) -> float:
    return float(100 * np.sqrt(np.mean((phi - whole) ** 2)) / np.ptp(whole))


def draw(shown, file) -> None:
    """φ of one broken curve per mesh, its zero set and that of the whole."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(5 * len(shown), 5))
    for k, (name, (mesh, pieces, phi, whole)) in enumerate(shown.items()):
        axes = figure.add_subplot(1, len(shown), k + 1, projection="3d", computed_zorder=False)
        limit = np.abs(phi).max()
        bands = np.floor(phi[mesh.faces].mean(axis=1) / limit * 8) / 8 * limit
        surface = axes.plot_trisurf(*mesh.vertices.T, triangles=mesh.faces, cmap="RdBu", linewidth=0, zorder=0)
        surface.set_array(bands)
        surface.set_clim(-limit, limit)
        view = np.array([0.6, -0.4, 0.7])
        for values, color in ((whole, "0.4"), (phi, "gold")):
            for curve in mesh.level_set(values, 0.0):
                line(axes, mesh, curve, color, 1.2, view, name)
        for curve in pieces:
            line(axes, mesh, curve, "black", 3, view, name)
        axes.view_init(
            elev=np.degrees(np.arcsin(view[2] / np.linalg.norm(view))), azim=np.degrees(np.arctan2(view[1], view[0]))
        )
        axes.set_box_aspect(np.ptp(mesh.vertices, axis=0) + 1e-9 if np.ptp(mesh.vertices[:, 2]) else (1, 1, 0.05))
        axes.set_axis_off()
        axes.set_title(f"{name}: black left, gold zero set, grey whole")
    figure.tight_layout()
    figure.savefig(file, dpi=70)


def line(axes, mesh, curve, color, width, view, name) -> None:
    points = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    normals = mesh.face_area_vectors[curve.faces]
    if curve.closed:
        points, normals = np.concatenate([points, points[:1]]), np.concatenate([normals, normals[:1]])
    points = np.where((normals @ view > 0)[:, None], points, np.nan)
    axes.plot(*points.T, color=color, linewidth=width, zorder=1)


if __name__ == "__main__":
    main()
