"""Tet meshes and exact distances that the tet suites measure on."""

from __future__ import annotations

import itertools

import numpy as np

import signedheat as sh


def boxes(counts: tuple[int, int, int], size: float, keep=None, jitter: float = 0.0) -> sh.TetMesh:
    """Cubes of a given size from the origin on, six tets in each, those whose centre `keep` accepts."""
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    if keep is not None:
        cells = cells[keep((cells + 0.5) * size)]
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    tets = []
    for order in itertools.permutations(range(3)):
        steps = np.cumsum([np.zeros(3, dtype=int), *np.eye(3, dtype=int)[list(order)]], axis=0)
        tets.append((cells[:, None] + steps) @ stride)
    ids, corners = np.unique(np.concatenate(tets), return_inverse=True)
    lattice = np.stack([ids // stride[0], ids % stride[0] // stride[1], ids % stride[1]], axis=1)
    tets = corners.reshape(-1, 4)
    vertices = lattice * size
    inner = np.ones(len(vertices), dtype=bool)
    inner[sh.TetMesh(vertices, tets).boundary.faces] = False
    vertices[inner] += np.random.default_rng(0).uniform(-jitter, jitter, (inner.sum(), 3)) * size
    return sh.TetMesh(vertices, tets)


def lattice(resolution: int, half: float = 1.6) -> sh.TetMesh:
    """A uniform body-centred cubic lattice in a cube around the origin."""
    diagonal = sh.TriangleMesh(half * np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]]), [[0, 1, 2]])
    return sh.tetrahedralize(diagonal, resolution=resolution, padding=0, grading=np.inf)


def rectangle(origin, u, v) -> sh.TriangleMesh:
    """Two triangles with normal u × v."""
    origin, u, v = (np.asarray(x, dtype=float) for x in (origin, u, v))
    return sh.TriangleMesh([origin, origin + u, origin + u + v, origin + v], [[0, 1, 2], [0, 2, 3]])


def sphere(subdivisions: int = 4, radius: float = 1.0) -> sh.TriangleMesh:
    """A sphere around the origin, facing outward."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return sh.TriangleMesh(ball.vertices, ball.faces)


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
