"""Triangles between points of a grid, of the plane and of a sphere; surfaces made of them; polygons in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay

import signedheat as sh

Floats = NDArray[np.float64]


def cut_quads(ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two triangles for each quad of neighbours in an (n, m) array of vertex ids; all first halves come first."""
    a, b, c, d = (corner.ravel() for corner in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def grid(points: Floats, around: int = 0, across: bool = False) -> sh.TriangleMesh:
    """The mesh of an (n, m, 3) array of points, its last row joined to the first for ±1, turned over for −1.

    With `across`, its last column is joined to the first as well.
    """
    n, m = points.shape[:2]
    ids = np.arange(n * m).reshape(n, m)
    if around:
        turned = -np.arange(m) % m if across else np.arange(m)[::-1]
        ids = np.vstack([ids, ids[:1, turned if around < 0 else slice(None)]])
    return sh.TriangleMesh(points.reshape(-1, 3), cut_quads(np.hstack([ids, ids[:, :1]]) if across else ids))


def angles(n: int) -> Floats:
    """Equal steps round a circle, from 0 on."""
    return 2 * np.pi * np.arange(n) / n


def cylinder(n: int, m: int, height: float = 2.0) -> sh.TriangleMesh:
    """An open cylinder of radius one round the z axis; vertex (i, j) is number i m + j."""
    u, v = np.meshgrid(angles(n), np.linspace(0, height, m), indexing="ij")
    return grid(np.stack([np.cos(u), np.sin(u), v], axis=-1), around=1)


def moebius(n: int = 80, m: int = 8, width: float = 0.3) -> sh.TriangleMesh:
    """A strip with half a twist around the z axis; vertex (i, j) is number i (m + 1) + j."""
    u, v = np.meshgrid(np.arange(n), np.arange(m + 1), indexing="ij")
    angle, across = 2 * np.pi * u / n, width * (2 * v / m - 1)
    ring = 1 + across * np.cos(angle / 2)
    points = np.stack([ring * np.cos(angle), ring * np.sin(angle), across * np.sin(angle / 2)], axis=-1)
    return grid(points, around=-1)


def klein_bottle(n: int, m: int) -> sh.TriangleMesh:
    """A figure of eight, turned by half while it goes round the z axis; vertex (i, j) is number i m + j."""
    u, v = np.meshgrid(angles(n), angles(m), indexing="ij")
    out, up = np.sin(v), np.sin(2 * v)
    ring, z = 3 + np.cos(u / 2) * out - np.sin(u / 2) * up, np.sin(u / 2) * out + np.cos(u / 2) * up
    return grid(np.stack([ring * np.cos(u), ring * np.sin(u), z], axis=-1), around=-1, across=True)


def planks(n: int, ratio: float) -> sh.TriangleMesh:
    """The square [−1, 1]² in about 2n right triangles, `ratio` times as long as wide."""
    x, y = np.meshgrid(*(np.linspace(-1, 1, int(np.sqrt(n * r)) + 1) for r in (1 / ratio, ratio)), indexing="ij")
    return grid(np.stack([x, y, 0 * x], axis=-1))


def upward(points: Floats, faces: NDArray[np.integer], least: float = 1e-9) -> NDArray[np.int64]:
    """Faces between (n, 2) points of the plane, turned so that all run counter-clockwise.

    Those of less than `least`, twice the area, are left out.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.where(double[:, None] > 0, faces, faces[:, ::-1])[np.abs(double) > least].astype(np.int64)


def flat(points: Floats, stretch: float = 1.0, least: float = 1e-9) -> sh.TriangleMesh:
    """Delaunay's triangles between points of the plane, as if it were `stretch` times as wide; they face up."""
    faces = upward(points, Delaunay(points * [stretch, 1.0]).simplices, least)
    return sh.TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces)


def disk(n: int, stretch: float = 1.0, jitter: float = 0.0) -> sh.TriangleMesh:
    """The unit disk in about 2n triangles; Delaunay after a stretch, hence obtuse where it is not 1."""
    i = np.arange(n) + 0.5
    radius, angle = np.sqrt(i / n), np.pi * (1 + 5**0.5) * i
    inner = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)[radius < 1 - 1 / np.sqrt(n)]
    inner += np.random.default_rng(n).uniform(-jitter, jitter, inner.shape) / np.sqrt(n)
    rim = np.linspace(0, 2 * np.pi, int(2 * np.sqrt(np.pi * n)), endpoint=False)
    return flat(np.concatenate([inner, np.stack([np.cos(rim), np.sin(rim)], axis=1)]), stretch)


def star(waves: float, n: int = 1500) -> Floats:
    """Corners of a polygon, a five-pointed wave around a circle of radius one half."""
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return 0.5 * (1 + waves * np.cos(5 * t))[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)


def polygon_distance(points: Floats, corners: Floats) -> Floats:
    """Exact signed distance in the plane, positive inside a counter-clockwise polygon."""
    from matplotlib.path import Path

    sides = np.roll(corners, -1, axis=0) - corners
    distance = np.full(len(points), np.inf)
    for a, e in zip(corners, sides, strict=True):
        t = np.clip((points - a) @ e / (e @ e), 0, 1)
        distance = np.minimum(distance, np.hypot(*(points - a - t[:, None] * e).T))
    return np.where(Path(corners).contains_points(points), distance, -distance)


def hull(points: Floats) -> NDArray[np.int64]:
    """Faces of the convex hull of points around the origin, outward."""
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def spiral(n: int) -> Floats:
    """(n, 3) points of a spiral on the unit sphere, evenly spread."""
    i = np.arange(n) + 0.5
    z, angle = 1 - 2 * i / n, np.pi * (1 + 5**0.5) * i
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
