"""Broken curves on surfaces: how far the distance to what is left is from the distance to the whole, ours and a peer's.

Closed curves on five generated meshes lose 10, 25 and 50 % of their length in random intervals, and are then also
jittered: every piece moves across itself by a normal deviate of one mean edge length. Error: root mean square of the
difference from the whole curve's field, over the field's range (the measure of the paper); sign: percentage of vertices
whose sign agrees. Averages over seeds. A failure of a program is counted, not averaged.

    python benchmarks/broken_curves.py [--seeds 10] [--picture broken.png]
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import potpourri3d as pp3d
import trimesh
from scipy.spatial import Delaunay

import signedheat as sh

LOSSES = (0.1, 0.25, 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--picture", help="where to draw one case of each mesh")
    arguments = parser.parse_args()
    begin, shown = time.perf_counter(), {}
    columns = ["error", "where both", "peer error", "sign %", "peer sign %", "each error", "peer fails", "worst ratio"]
    print(f"{'mesh':>14} {'lost':>5} {'jitter':>6}" + "".join(f"{c:>13}" for c in columns))
    for name, (mesh, heights) in meshes().items():
        curve = max(mesh.level_set(heights, 0.0), key=lambda c: c.n_points)
        ours = sh.SignedHeatSolver(mesh)
        peer = pp3d.MeshSignedHeatSolver(np.array(mesh.vertices), np.array(mesh.faces))
        whole = ours.distance(curve).values
        for jitter in (False, True):
            for lost in LOSSES:
                rows, failed = [], 0
                for seed in range(arguments.seeds):
                    rng = np.random.default_rng(seed)
                    pieces = broken(mesh, heights, curve, lost, jitter, rng)
                    phi = ours.distance(pieces).values
                    each = ours.distance(pieces, sh.EachComponent()).values
                    try:
                        theirs = np.asarray(peer.compute_distance([nodes(mesh, c) for c in pieces]))
                    except (RuntimeError, ValueError):
                        failed, theirs = failed + 1, np.full(len(phi), np.nan)
                    rows.append([error(phi, whole), error(theirs, whole), same(phi, whole), same(theirs, whole)])
                    rows[-1] += [error(each, whole), error(phi, whole) / error(theirs, whole)]
                    if jitter and lost == 0.25 and seed == 0:
                        shown[name] = mesh, pieces, phi, whole
                rows = np.array(rows)
                rows_of_both = np.where(np.isfinite(rows).all(axis=1)[:, None], rows, np.nan)
                with warnings.catch_warnings(action="ignore"):  # means of nothing, where the peer always failed
                    peers, worst = np.nanmean(rows_of_both, axis=0), np.nanmax(rows_of_both[:, 5])
                means = rows.mean(axis=0)
                figures = [means[0], peers[0], peers[1], means[2], peers[3], means[4], failed, worst]
                print(f"{name:>14} {lost:>5.0%} {jitter!s:>6}" + "".join(f"{v:>13.4f}" for v in figures), flush=True)
    print(f"{time.perf_counter() - begin:.0f} s")
    if arguments.picture:
        draw(shown, arguments.picture)


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
    flat = Delaunay(plane).simplices
    star = np.hypot(*plane.T) - 0.55 * (1 + 0.25 * np.cos(5 * np.arctan2(plane[:, 1], plane[:, 0])))
    hills = 0.25 * np.sin(4 * plane[:, 0]) * np.cos(3 * plane[:, 1])
    return {
        "sphere": (sh.TriangleMesh(unit, ball.faces), wave),
        "bumpy sphere": (sh.TriangleMesh(unit * bumps[:, None], ball.faces), wave),
        "torus": (sh.TriangleMesh(ring.vertices, ring.faces), patch),
        "random square": (upward(np.pad(plane, ((0, 0), (0, 1))), flat), star),
        "hills": (upward(np.column_stack([plane, hills]), flat), star),
    }


def rim(n: int) -> np.ndarray:
    """Points round the square [−1, 1]²."""
    s = np.linspace(-1, 1, n, endpoint=False)
    one = np.ones(n)
    return np.concatenate([np.stack(side, axis=1) for side in ((s, -one), (one, s), (-s, one), (-one, -s))])


def upward(points: np.ndarray, faces: np.ndarray) -> sh.TriangleMesh:
    a, b, c = (points[faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(area[:, None] > 0, faces, faces[:, ::-1])
    return sh.TriangleMesh(points, faces[np.abs(area) > 1e-9])


def broken(mesh, heights, curve, lost, jitter, rng) -> list[sh.Curve]:
    """What is left of a curve; if jittered, each piece is from another level of the curve's function."""
    n_gaps = 6
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
    return float(np.sqrt(np.mean((phi - whole) ** 2)) / np.ptp(whole))


def same(phi, whole) -> float:
    return float(100 * np.mean(np.sign(phi) == np.sign(whole))) if np.isfinite(phi).all() else np.nan


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
