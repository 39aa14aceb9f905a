"""Segments in a triangle become ways along edges, however near to each other the points lie and where they cross."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from signedheat.mesh.conforming_refinement import with_middles
from signedheat.mesh.planar_triangulation import triangulate_crossing
from signedheat.mesh.surface_points import ZERO_COORDINATE

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def check(given: np.ndarray, corners: list[int], ends: list[tuple[int, int]], slack: float) -> None:
    """Every segment is a way along edges, hardly longer than it; the triangles fill the triangle and none is flat."""
    points, divided, triangles, across, chains, starts = triangulate_crossing(
        given, np.array(corners), np.array(ends), ZERO_COORDINATE
    )
    assert len(points) == len(given) + len(divided) and len(triangles) == 2 * len(points) - corners[2] - 2
    np.testing.assert_array_equal(points[: len(given)], given)
    edges = {frozenset(pair) for row in triangles.tolist() for pair in pairwise([*row, row[0]])}
    held = {
        frozenset((row[k], row[k - 2]))
        for row, beyond in zip(triangles, across, strict=True)
        for k in range(3)
        if beyond[k] < 0
    }
    middles = {(u, v): len(given) + k for k, edge in enumerate(divided.tolist()) for u, v in (edge, edge[::-1])}
    for (a, b), way in zip(ends, np.split(chains, starts[1:-1]), strict=True):
        chain = with_middles(way.tolist(), middles)
        assert (chain[0], chain[-1]) == (a, b)
        assert all(frozenset(pair) in edges & held for pair in pairwise(chain))
        length = np.linalg.norm(np.diff(points[chain], axis=0), axis=1).sum()
        assert length == pytest.approx(np.linalg.norm(points[a] - points[b]), rel=1e-9, abs=slack)
    first, second = points[triangles[:, 1:]].swapaxes(0, 1) - points[triangles[:, 0]]
    areas = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    assert areas.sum() == pytest.approx(1.0, abs=1e-12) and areas.min() > -1e-15


@pytest.mark.parametrize("nearness", [1e-2, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12, 1e-15])
@pytest.mark.parametrize("corner", [0, 1, 2])
def test_every_segment_is_a_way_along_edges(nearness, corner):
    """Chords around a corner, and along a side close to it, as curves that pass a vertex make them."""
    random = np.random.default_rng(7)
    for _ in range(20):
        at = np.sort(random.random((2, 2)) * nearness, axis=1)
        first = [CORNERS[corner] + t * (CORNERS[(corner + 1) % 3] - CORNERS[corner]) for t in at[0]]
        last = [CORNERS[corner] + t * (CORNERS[(corner + 2) % 3] - CORNERS[corner]) for t in at[1][::-1]]
        sides = [[], [], []]
        sides[corner], sides[(corner + 2) % 3] = first, last
        places = np.cumsum([0, *(1 + len(side) for side in sides)]).tolist()
        points = np.array([place for k in range(3) for place in (CORNERS[k], *sides[k])])
        (a, b), (c, d) = (range(places[k] + 1, places[k] + 3) for k in (corner, (corner + 2) % 3))
        check(points, places[1:], [(a, d), (b, c), (c, places[(corner + 1) % 3])], 10 * min(nearness, 1e-8))


@pytest.mark.parametrize("digits", [1, 2, 15])
@pytest.mark.parametrize("seed", range(10))
def test_segments_that_cross_overlap_and_share_ends(digits, seed):
    """Few digits put many points on one line, and many segments through one point."""
    random = np.random.default_rng(seed)
    places = np.unique(random.random((40, 2)).round(digits), axis=0)
    places = places[(places.min(axis=1) > 0) & (places.sum(axis=1) < 1 - 1e-6)]
    points = np.concatenate([CORNERS, places])
    ends = [tuple(random.choice(len(points), 2, replace=False).tolist()) for _ in range(40)]
    check(points, [1, 2, 3], ends, 1e-8)


def test_a_curve_of_many_segments_takes_time_in_proportion():
    """A spiral in one triangle: finding where its points lie, and what its segments cross, is local."""
    angles = np.linspace(0, 40 * np.pi, 4000)
    spiral = 0.3 + (0.002 * angles / np.pi / 2 * np.stack([np.cos(angles), np.sin(angles)])).T
    points = np.concatenate([CORNERS, spiral])
    check(points, [1, 2, 3], list(pairwise(range(3, len(points)))), 1e-9)
