"""Segments in a triangle become ways along edges, however near their points lie and where they cross; polygons."""

from __future__ import annotations

from itertools import pairwise
from time import perf_counter

import numpy as np
import pytest

from signedheat.mesh.conforming_refinement import with_middles
from signedheat.mesh.edges import edge_table
from signedheat.mesh.planar_triangulation import triangulate_crossing, triangulate_polygon
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
    held &= edges
    middles = {(u, v): len(given) + k for k, edge in enumerate(divided.tolist()) for u, v in (edge, edge[::-1])}
    for (a, b), way in zip(ends, np.split(chains, starts[1:-1]), strict=True):
        chain = with_middles(way.tolist(), middles)
        assert (chain[0], chain[-1]) == (a, b)
        assert all(frozenset(pair) in held for pair in pairwise(chain))
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


TURNS = 2 * np.pi * np.arange(120) / 120
ROUND = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)
ROW = np.linspace(0, 1, 40)
POLYGONS = {
    "circle": ROUND,
    "star": ROUND * (1 + 0.6 * np.cos(7 * TURNS))[:, None],
    "comb": np.concatenate([np.stack([ROW, 0 * ROW], 1), np.stack([ROW[::-1], 0.1 + np.arange(40) % 2], 1)]),
    "spiral": np.concatenate([ROUND * (2 + TURNS / 7)[:, None], ROUND[::-1] * (1.98 + TURNS[::-1] / 7)[:, None]]),
}


def turns(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed areas of triangles."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


@pytest.mark.parametrize("within", [0, 60])
@pytest.mark.parametrize("shape", POLYGONS)
def test_polygons_are_filled_by_their_constrained_delaunay_triangles(shape, within):
    loop = POLYGONS[shape]
    n = len(loop)
    inner = np.random.default_rng(3).uniform(loop.min(axis=0), loop.max(axis=0), (within, 2))
    points = np.concatenate([loop, inner])
    faces = triangulate_polygon(points, n)
    used = np.unique(faces[faces >= n])
    assert len(faces) == n - 2 + 2 * len(used)
    a, b, c = points[faces].swapaxes(0, 1)
    assert turns(a, b, c).min() > 0
    assert turns(a, b, c).sum() == pytest.approx(turns(0 * loop, loop, np.roll(loop, -1, axis=0)).sum(), rel=1e-12)
    table = edge_table(faces)
    rims = {(k, (k + 1) % n) for k in range(n)}
    assert set(map(tuple, table.vertices[table.face_counts == 1].tolist())) == rims
    first, second = table.pairs.T  # opposite angles of other edges sum to half a turn at most
    opposite = [np.roll(faces, 1, axis=1).ravel()[halfedges] for halfedges in (first, second)]
    tails, heads = points[faces.ravel()[first]], points[np.roll(faces, -1, axis=1).ravel()[first]]
    sums = 0.0
    for apex in opposite:
        (x, y), (u, v) = (tails - points[apex]).T, (heads - points[apex]).T
        sums = sums + np.abs(np.arctan2(x * v - y * u, x * u + y * v))
    assert sums.max() < np.pi + 1e-6


def test_polygons_that_cross_or_touch_themselves_are_refused():
    eight = np.stack([np.sin(TURNS + 0.01), np.sin(2 * TURNS + 0.02)], axis=1)
    square = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])
    assert triangulate_polygon(eight, 120) is None
    assert triangulate_polygon(square[::-1], 4) is None  # clockwise
    touching = np.array([[0.0, 0.0], [1, 0], [1, 1], [0.5, 0.0], [0, 1]])
    assert triangulate_polygon(touching, 5) is None
    touching[3, 1] = 1e-9
    assert len(triangulate_polygon(touching, 5)) == 3


def test_points_in_one_place_and_on_one_line_end():
    """Rounding decides on which side of each other these lie: no walk is endless, and none leaves memory."""
    random = np.random.default_rng(5)
    for _ in range(200):
        points = random.random((30, 2)) * [1.0, 10.0 ** -random.integers(0, 17)]
        points[random.integers(20, 30, 4)] = points[0]
        faces = triangulate_polygon(points, int(random.integers(3, 20)))
        assert faces is None or faces.max() < 30
        near = points[:12] * 10.0 ** -random.integers(0, 16)
        given = np.concatenate([CORNERS, near[near.sum(axis=1) < 1], near[:2]])
        ends = random.integers(0, len(given), (8, 2))
        made, _, triangles, _, _, _ = triangulate_crossing(given, np.array([1, 2, 3]), ends, ZERO_COORDINATE)
        assert triangles.max() < len(made) < 2000


def test_polygons_agree_with_shapely():
    shapely = pytest.importorskip("shapely")
    random = np.random.default_rng(7)
    for _ in range(300):
        n = int(random.integers(3, 12))
        turns = np.sort(random.random(n)) * 2 * np.pi
        loop = np.stack([np.cos(turns), np.sin(turns)], axis=1) * random.uniform(0.02, 1, (n, 1))
        simple = shapely.Polygon(loop).is_valid and shapely.Polygon(loop).exterior.is_ccw
        assert (triangulate_polygon(loop, n) is not None) == simple


def test_rows_of_points_take_time_in_proportion():
    """Inserted in order, each point of one side would change the edges to all points of the other."""
    row = np.linspace(0, 1, 50_000)
    ladder = np.concatenate([np.stack([row, 0 * row], axis=1), np.stack([row[::-1], 0 * row + 1], axis=1)])
    began = perf_counter()
    assert len(triangulate_polygon(ladder, len(ladder))) == len(ladder) - 2
    assert perf_counter() - began < 20  # half a second; in order, minutes
