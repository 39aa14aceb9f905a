"""Bad triangulations of good surfaces."""

from __future__ import annotations

import numpy as np

import signedheat as sh

from .triangulated import flat


def stretched_square(n: int, stretch: float, seed: int = 0) -> sh.TriangleMesh:
    """[−1, 1]² with about n vertices, joined as if it were `stretch` times as wide: hardly an angle is good."""
    rng = np.random.default_rng(seed)
    inner = rng.uniform(-0.99, 0.99, (n, 2))
    side = np.linspace(-1, 1, int(np.sqrt(n)))
    ones = np.ones_like(side)
    rim = [np.stack(pair, axis=1) for pair in ((side, ones), (side, -ones), (ones, side), (-ones, side))]
    points = np.unique(np.concatenate([inner, *rim]), axis=0)
    return flat(points, stretch, least=1e-12)


def with_needles(mesh: sh.TriangleMesh, nearness: float) -> sh.TriangleMesh:
    """Every face gets a vertex all but at its first corner."""
    return _with_a_vertex_in_each_face(mesh, [1 - 2 * nearness, nearness, nearness])


def with_caps(mesh: sh.TriangleMesh, flatness: float) -> sh.TriangleMesh:
    """Every face gets a vertex all but on its first edge."""
    return _with_a_vertex_in_each_face(mesh, [0.5 - flatness / 2, 0.5 - flatness / 2, flatness])


def _with_a_vertex_in_each_face(mesh: sh.TriangleMesh, weights: list[float]) -> sh.TriangleMesh:
    new = mesh.n_vertices + np.arange(mesh.n_faces)
    a, b, c = mesh.faces.T
    faces = np.concatenate([np.stack(corners, axis=1) for corners in ((a, b, new), (b, c, new), (c, a, new))])
    added = np.einsum("k,mkd->md", weights, mesh.vertices[mesh.faces])
    return sh.TriangleMesh(np.concatenate([mesh.vertices, added]), faces)
