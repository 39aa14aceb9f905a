"""Small meshes with known geometry, for tests of curves on surfaces."""

from __future__ import annotations

import numpy as np

import signedheat as sh

from .triangulated import grid


def square(n: int, jitter: float = 0.0, seed: int = 0) -> sh.TriangleMesh:
    """[−1, 1]² as 2 (n − 1)² triangles; inner vertices moved by up to `jitter` cells."""
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1)
    moved = np.random.default_rng(seed).uniform(-jitter, jitter, (n, n, 2)) * 2 / (n - 1)
    points[1:-1, 1:-1, :2] += moved[1:-1, 1:-1]
    return grid(points)


def sphere(subdivisions: int) -> sh.TriangleMesh:
    """Unit sphere, an icosahedron subdivided."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions)
    return sh.TriangleMesh(np.array(ball.vertices), np.array(ball.faces))


def band(n: int, m: int, twisted: bool) -> sh.TriangleMesh:
    """A closed band of n × m quads, each cut in two: a cylinder, or a Möbius strip."""
    u, v = np.meshgrid(np.arange(n) / n * 2 * np.pi, np.linspace(-0.4, 0.4, m + 1), indexing="ij")
    half = u / 2 if twisted else 0 * u
    radius = 1 + v * np.sin(half)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), v * np.cos(half)], axis=-1)
    faces = []
    for i in range(n):
        for j in range(m):
            a, b = i * (m + 1) + j, i * (m + 1) + j + 1
            c, d = a + m + 1, b + m + 1
            if i == n - 1:
                c, d = (m - j, m - j - 1) if twisted else (j, j + 1)
            faces += [[a, c, d], [a, d, b]]
    return sh.TriangleMesh(points.reshape(-1, 3), np.array(faces))


def book(pages: int, n: int) -> sh.TriangleMesh:
    """Square pages that share one spine, along z."""
    vertices, faces = [[0.0, 0.0, k / n] for k in range(n + 1)], []
    for page in range(pages):
        angle = 2 * np.pi * page / pages
        first = len(vertices)
        for i in range(1, n + 1):
            vertices += [[i / n * np.cos(angle), i / n * np.sin(angle), k / n] for k in range(n + 1)]

        def at(i, k, first=first):
            return k if i == 0 else first + (i - 1) * (n + 1) + k

        for i in range(n):
            for k in range(n):
                a, b, c, d = at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)
                faces += [[a, b, c], [a, c, d]]
    return sh.TriangleMesh(np.array(vertices), np.array(faces))


def flipped(mesh: sh.TriangleMesh, fraction: float = 0.4, seed: int = 0) -> sh.TriangleMesh:
    """Some faces turned over at random."""
    faces = mesh.faces.copy()
    chosen = np.random.default_rng(seed).random(len(faces)) < fraction
    faces[chosen] = faces[chosen][:, ::-1]
    return sh.TriangleMesh(mesh.vertices, faces)


def positions(mesh: sh.TriangleMesh, source) -> np.ndarray:
    """Points of a curve or of surface points, in space."""
    return np.einsum("ik,ikj->ij", source.barycentric, mesh.vertices[mesh.faces[source.faces]])


def laid_out(mesh: sh.TriangleMesh):
    """The triangles that the solver runs on."""
    return sh.SignedHeatSolver(mesh, intrinsic=False).discretization.triangles
