"""What the calls in `calls.py` are given."""

from __future__ import annotations

from functools import cache

import numpy as np

import signedheat as sh
from shapes.triangulated import grid
from signedheat import samples


def triangles(mesh: sh.TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    return np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)


def cloud(mesh: sh.TriangleMesh) -> sh.PointCloud:
    return samples.oriented_points(mesh, 8000, seed=5)


@cache
def globe() -> tuple[np.ndarray, list[list[int]]]:
    """A sphere of quadrangles between parallels and meridians, with triangles at the poles."""
    n, m = 80, 40
    latitude = np.linspace(-np.pi / 2, np.pi / 2, m + 1)[1:-1]
    angle = 2 * np.pi * np.arange(n) / n
    rings = [
        np.stack([np.cos(a) * np.cos(angle), np.cos(a) * np.sin(angle), 0 * angle + np.sin(a)], 1) for a in latitude
    ]
    at = np.arange((m - 1) * n).reshape(m - 1, n)
    south, north = at.size, at.size + 1
    right = np.roll(at, -1, axis=1)
    faces = np.stack([at[:-1], right[:-1], right[1:], at[1:]], axis=-1).reshape(-1, 4).tolist()
    faces += [[south, right[0, k], at[0, k]] for k in range(n)] + [[north, at[-1, k], right[-1, k]] for k in range(n)]
    return np.concatenate([*rings, [[0, 0, -1], [0, 0, 1]]]), faces


@cache
def globe_triangles() -> sh.TriangleMesh:
    vertices, faces = globe()
    return sh.TriangleMesh(vertices, [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)])


def ring() -> np.ndarray:
    """The vertices of a parallel, in order."""
    return 24 * 80 + np.arange(80)


def arcs(share: float) -> list[list[int]]:
    """The parallel, closed, or what is left of it: arcs of vertices."""
    if share == 1.0:
        return [[int(v) for v in [*ring(), ring()[0]]]]
    return [[int(v) for v in ring()[a : a + round(16 * share) + 1]] for a in range(0, 80, 16)]


def plane_points() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1.5, 1.5, size=(2000, 2))


def outline(share: float) -> list[np.ndarray]:
    """A circle, clockwise as its inside is to the right, or arcs of it."""
    n = 1 if share == 1.0 else 8
    starts = 2 * np.pi * np.arange(n) / n
    return [
        np.stack([np.cos(a), -np.sin(a)], 1)
        for a in (s + np.linspace(0, 2 * np.pi * share / n, 400 // n) for s in starts)
    ]


def sheet() -> sh.TriangleMesh:
    """A wavy sheet with a border."""
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41), indexing="ij")
    return grid(np.stack([x, y, 0.2 * np.sin(3 * x) * np.cos(3 * y)], -1))


def closed_wall(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Whether a wall is closed, and how much of 0.1 times the area of its sheet it holds."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
        return "open"
    corners = np.asarray(vertices, dtype=float)[faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    return f"closed, volume {volume / (0.1 * sheet().face_areas.sum()):.2f} of area × 0.1"


def box(half: float, center: tuple[float, float, float] = (0, 0, 0)) -> sh.TriangleMesh:
    import trimesh

    solid = trimesh.creation.box(extents=[2 * half] * 3)
    return sh.TriangleMesh(solid.vertices + center, solid.faces)


def volume(mesh: sh.TriangleMesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)
