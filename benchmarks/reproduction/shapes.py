"""Generated shapes that stand for the paper's: organic surfaces, broken curves in the plane, curves on surfaces."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

import signedheat as sh
from shapes.triangulated import flat, hull
from signedheat import samples

Array = NDArray[np.float64]


def organic(seed: int, n_vertices: int = 300, handles: int = 0) -> sh.TriangleMesh:
    """A smooth bumpy surface on scattered points: a sphere's for no handle, a torus's for one; irregular triangles."""
    rng = np.random.default_rng(seed)
    if handles:
        base = samples.torus(
            1.0, 0.45, n_around=round(np.sqrt(2 * n_vertices)), n_across=round(np.sqrt(n_vertices / 2))
        )
        jitter = rng.normal(scale=0.25 / np.sqrt(n_vertices), size=base.vertices.shape)
        points, faces = base.vertices + jitter, base.faces
    else:
        points = rng.normal(size=(n_vertices, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        for _ in range(6):  # pushed apart a little: still far from regular
            away = points[:, None] - points[None]
            strength = 1 / ((away**2).sum(axis=2) + 1e-2) ** 1.5
            points = points + 0.02 * (away * strength[..., None]).mean(axis=1)
            points /= np.linalg.norm(points, axis=1, keepdims=True)
        faces = hull(points)
    waves, phases = 1.6 * rng.normal(size=(6, 3)), rng.uniform(0, 2 * np.pi, 6)
    swell = 1 + 0.11 * np.cos(points @ waves.T + phases).sum(axis=1) / np.sqrt(2)
    return sh.TriangleMesh(points * swell[:, None], faces)


def mean_edge(mesh: sh.TriangleMesh) -> float:
    """Mean length of the edges."""
    return float(mesh.edge_lengths.mean())


def subdivided(mesh: sh.TriangleMesh, levels: int) -> sh.TriangleMesh:
    """Loop's subdivision (1987)."""
    if levels == 0:
        return mesh
    return sh.TriangleMesh(*trimesh.remesh.subdivide_loop(mesh.vertices, mesh.faces, iterations=levels))


def height(points: Array, seed: int) -> Array:
    """A smooth function of the position whose zero set is a closed curve across the middle of a shape."""
    rng = np.random.default_rng(1000 + seed)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    return -(points @ direction + 0.12 * np.sin(3 * points @ rng.normal(size=3)) + 0.0123)


def pieces(mesh: sh.TriangleMesh, heights: Array, lost: float, seed: int) -> list[sh.Curve]:
    """The zero set without random intervals that make up about a share `lost` of each curve."""
    rng, kept = np.random.default_rng(seed), []
    for curve in mesh.level_set(heights, 0.0):
        n = curve.n_points
        gaps = max(2, n // 25)
        gone = np.zeros(n, dtype=bool)
        for start in rng.choice(n, gaps, replace=False):
            gone[(start + np.arange(max(1, round(lost * n / gaps)))) % n] = True
        order = (np.arange(n) + int(np.argmax(gone))) % n
        runs = np.split(order, np.flatnonzero(np.diff(gone[order].astype(int))) + 1)
        kept += [sh.Curve(curve.faces[r], curve.barycentric[r]) for r in runs if not gone[r[0]] and len(r) > 1]
    return kept


def blob(n: int = 240) -> sh.Polyline:
    """A closed curve in the plane of size about one; clockwise, so that its normals point outwards."""
    angle = -np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = 1 + 0.25 * np.cos(3 * angle + 0.4) + 0.08 * np.sin(5 * angle)
    return sh.Polyline(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), True)


def broken_blob(gaps: int = 5, share: float = 0.35, n: int = 240) -> list[sh.Polyline]:
    """The blob without evenly placed gaps."""
    points, step = blob(n).points, n // gaps
    kept = round(step * (1 - share))
    return [sh.Polyline(points[np.arange(k * step, k * step + kept + 1) % n]) for k in range(gaps)]


def star(points: int = 5, n: int = 60) -> sh.Polyline:
    """A star with straight sides of n segments each; clockwise."""
    angle = -np.pi * np.arange(2 * points) / points + 0.3
    radius = np.where(np.arange(2 * points) % 2, 0.55, 1.25)
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    along = np.linspace(0, 1, n, endpoint=False)[:, None]
    sides = [a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return sh.Polyline(np.concatenate(sides), True)


def flat_disk(n: int, seed: int = 0) -> sh.TriangleMesh:
    """A disk of radius 2 in irregular triangles, with about n vertices."""
    rng = np.random.default_rng(seed)
    rings = max(4, round(np.sqrt(n / np.pi)))
    polar = [(r / rings, np.arange(max(1, round(2 * np.pi * r))) + 0.5 * (r % 2)) for r in range(rings + 1)]
    points = np.concatenate(
        [2 * r * np.stack([np.cos(t), np.sin(t)], 1) for r, k in polar for t in [2 * np.pi * k / max(len(k), 1)]]
    )
    inner = np.linalg.norm(points, axis=1) < 2 - 1e-9
    points[inner] += rng.uniform(-0.25, 0.25, (int(inner.sum()), 2)) * 2 / rings
    return flat(points, least=1e-3 / rings**2)


def flat_square(n: int, seed: int = 1) -> sh.TriangleMesh:
    """The square [−2, 2]² on about n random points: triangles of all sizes and angles."""
    side = round(np.sqrt(n))
    along, one = np.linspace(-2, 2, side, endpoint=False), np.full(side, 2.0)
    rim = [np.stack(pair, axis=1) for pair in ((along, -one), (one, along), (-along, one), (-one, -along))]
    inner = np.random.default_rng(seed).uniform(-2, 2, (n - 4 * side, 2)) * (1 - 1 / side)
    return flat(np.concatenate([*rim, inner]))


def placed(mesh: sh.TriangleMesh, line: sh.Polyline) -> sh.Curve:
    """A curve of the plane on a flat mesh."""
    return mesh.polyline(np.pad(line.points, ((0, 0), (0, 1))), closed=line.closed)
