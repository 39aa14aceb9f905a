"""Segments in a triangle become ways along edges, however near to each other the points lie and where they cross."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from signedheat.mesh.conforming_refinement import Triangulation, edges_of, turn

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def check(cut: Triangulation, ends: list[tuple[int, int]], slack: float) -> None:
    """Every segment is a way along edges, hardly longer than it; the triangles fill the triangle and none is flat."""
    ways = [cut.connect(a, b) for a, b in ends]
    edges = {frozenset(pair) for triangle in cut.triangles for pair in edges_of(triangle)}
    for (a, b), chain in zip(ends, map(cut.along, ways), strict=True):
        assert (chain[0], chain[-1]) == (a, b)
        assert all(frozenset(pair) in edges for pair in pairwise(chain))
        length = sum(np.linalg.norm(np.subtract(cut.points[u], cut.points[v])) for u, v in pairwise(chain))
        direct = np.linalg.norm(np.subtract(cut.points[a], cut.points[b]))
        assert length == pytest.approx(direct, rel=1e-9, abs=slack)
    areas = [turn(*(cut.points[i] for i in triangle)) for triangle in cut.triangles]
    assert sum(areas) == pytest.approx(1.0, abs=1e-12) and min(areas) > -1e-15


@pytest.mark.parametrize("nearness", [1e-2, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12, 1e-15])
@pytest.mark.parametrize("corner", [0, 1, 2])
def test_every_segment_is_a_way_along_edges(nearness, corner):
    """Chords around a corner, and along a side close to it, as curves that pass a vertex make them."""
    random = np.random.default_rng(7)
    for _ in range(20):
        at = np.sort(random.random((2, 2)) * nearness, axis=1)
        first = [CORNERS[corner] + t * (CORNERS[(corner + 1) % 3] - CORNERS[corner]) for t in at[0]]
        last = [CORNERS[corner] + t * (CORNERS[(corner + 2) % 3] - CORNERS[corner]) for t in at[1][::-1]]
        points = [tuple(map(float, p)) for p in (*CORNERS, *first, *last)]
        sides = [[], [], []]
        sides[corner], sides[(corner + 2) % 3] = [3, 4], [5, 6]
        cut = Triangulation.of(points, sides)
        check(cut, [(3, 6), (4, 5), (5, (corner + 1) % 3)], 10 * min(nearness, 1e-8))


@pytest.mark.parametrize("digits", [1, 2, 15])
@pytest.mark.parametrize("seed", range(10))
def test_segments_that_cross_overlap_and_share_ends(digits, seed):
    """Few digits put many points on one line, and many segments through one point."""
    random = np.random.default_rng(seed)
    places = np.unique(random.random((40, 2)).round(digits), axis=0)
    places = places[(places.min(axis=1) > 0) & (places.sum(axis=1) < 1 - 1e-6)]
    cut = Triangulation.of([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], [[], [], []])
    ids = [0, 1, 2, *(cut.insert((float(x), float(y))) for x, y in places)]
    ends = [tuple(random.choice(ids, 2, replace=False).tolist()) for _ in range(40)]
    check(cut, ends, 1e-8)


def test_a_curve_of_many_segments_takes_time_in_proportion():
    """A spiral in one triangle: finding where its points lie, and what its segments cross, is local."""
    angles = np.linspace(0, 40 * np.pi, 4000)
    spiral = 0.3 + (0.002 * angles / np.pi / 2 * np.stack([np.cos(angles), np.sin(angles)])).T
    cut = Triangulation.of([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], [[], [], []])
    ids = [cut.insert((float(x), float(y))) for x, y in spiral]
    check(cut, list(pairwise(ids)), 1e-9)
