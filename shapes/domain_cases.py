"""Exact cases that several suites measure on: shapes as arrays, and the distance they have."""

from __future__ import annotations

import numpy as np


def error(phi: np.ndarray, exact: np.ndarray) -> float:
    """ε of Sec. 9.1, every vertex counting the same."""
    return float(np.sqrt(np.mean((phi - exact) ** 2)) / np.ptp(exact))


def fitted_order(sizes: list[float], errors: list[float]) -> float:
    """Slope of log error over log size."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def quads(n: int, jitter: float = 0.0) -> tuple[np.ndarray, list[list[int]]]:
    """The square [−1, 1]² in n × n quads, inner vertices moved by a part of their size."""
    steps = np.linspace(-1, 1, n + 1)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    move = np.random.default_rng(n).uniform(-jitter, jitter, (2, n + 1, n + 1)) * 2 / n
    move[:, [0, -1], :] = move[:, :, [0, -1]] = 0
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    corners = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1)
    return np.stack([x + move[0], y + move[1], 0 * x], axis=-1).reshape(-1, 3), corners.reshape(-1, 4).tolist()


def triangles(n: int) -> tuple[np.ndarray, list[list[int]]]:
    """The same square, its quads cut along a diagonal."""
    vertices, faces = quads(n)
    return vertices, [cut for q in faces for cut in (q[:3], [q[0], q[2], q[3]])]


def bricks(n: int) -> tuple[np.ndarray, list[list[int]]]:
    """The same square in hexagons of the shape of bricks, with quads at the ends of rows."""
    vertices, faces = quads(n)
    cell = np.array(faces).reshape(n, n, 4)
    polygons = []
    for j in range(n):
        row = [cell[i, j] for i in range(n)]
        polygons += [row.pop(0).tolist()] if j % 2 else []
        while len(row) > 1:
            a, b = row.pop(0), row.pop(0)
            polygons.append([int(k) for k in (a[0], a[1], b[1], b[2], a[2], a[3])])
        polygons += [q.tolist() for q in row]
    return vertices, polygons


def globe(n: int) -> tuple[np.ndarray, list[list[int]]]:
    """The unit sphere in quads between n parallels and 2n meridians, with triangles at the poles."""
    polar = np.linspace(0, np.pi, n + 1)[1:-1, None]
    azimuth = np.arange(2 * n)[None] * np.pi / n
    ring = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth], -1)
    vertices = np.concatenate([ring.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    ids = np.arange((n - 1) * 2 * n).reshape(n - 1, 2 * n)
    right = np.roll(ids, -1, axis=1)
    sides = np.stack([ids[:-1], ids[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4).tolist()
    north = [[len(vertices) - 2, a, b] for a, b in zip(ids[0].tolist(), right[0].tolist(), strict=True)]
    south = [[len(vertices) - 1, b, a] for a, b in zip(ids[-1].tolist(), right[-1].tolist(), strict=True)]
    return vertices, sides + north + south


def sphere_points(n: int, seed: int = 0) -> np.ndarray:
    """(n, 3) points on the unit sphere, on a spiral but for noise along the surface."""
    k = np.arange(n) + 0.5
    polar, azimuth = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    points = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    points += np.random.default_rng(seed).normal(size=points.shape) * 0.3 / np.sqrt(n)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def parallel(n: int, height: float) -> np.ndarray:
    """(n, 3) points on the circle of the unit sphere at a height, running east: north is to the left."""
    angle = np.arange(n) * 2 * np.pi / n
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, height)], axis=-1)


def ball(n: int) -> tuple[np.ndarray, float, np.ndarray]:
    """A unit ball in n³ voxels, off centre by a part of a voxel: volume, spacing, position of the first voxel."""
    spacing = 2.2 / n
    first = -1.1 + spacing * (0.5 + np.array([0.13, 0.07, 0.21]))
    index = np.stack(np.indices((n, n, n)), axis=-1)
    return np.linalg.norm(first + spacing * index, axis=-1) < 1, spacing, first
