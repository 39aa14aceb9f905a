"""Segments in a triangle become edges or ways along edges, however near to each other the points lie."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from signedheat.geometry.constrained_triangulation import arrange, paths_along, triangulate


@pytest.mark.parametrize("nearness", [1e-2, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12, 1e-15])
@pytest.mark.parametrize("corner", [0, 1, 2])
def test_every_segment_is_a_way_along_edges(nearness, corner):
    """Chords around a corner, and along a side close to it, as curves that pass a vertex make them."""
    random = np.random.default_rng(7)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    for _ in range(20):
        at = np.sort(random.random((2, 2)) * nearness, axis=1)
        first = [corners[corner] + t * (corners[(corner + 1) % 3] - corners[corner]) for t in at[0]]
        last = [corners[corner] + t * (corners[(corner + 2) % 3] - corners[corner]) for t in at[1][::-1]]
        points = [tuple(map(float, p)) for p in (*corners, *first, *last)]
        sides = [[], [], []]
        sides[corner], sides[(corner + 2) % 3] = [3, 4], [5, 6]
        ends = [(3, 6), (4, 5), (5, (corner + 1) % 3)]
        chains = arrange(points, ends)
        triangles = triangulate(points, sides, [pair for chain in chains for pair in pairwise(chain)])
        edges = {frozenset(pair) for a, b, c in triangles for pair in ((a, b), (b, c), (c, a))}
        for (a, b), chain in zip(ends, paths_along(points, triangles, chains), strict=True):
            assert (chain[0], chain[-1]) == (a, b)
            assert all(frozenset(pair) in edges for pair in pairwise(chain))
            length = sum(np.linalg.norm(np.subtract(points[u], points[v])) for u, v in pairwise(chain))
            direct = np.linalg.norm(np.subtract(points[a], points[b]))
            assert length == pytest.approx(direct, rel=1e-9, abs=10 * min(nearness, 1e-8))
