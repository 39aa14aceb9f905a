"""Orders along a space-filling curve, which trees of boxes are made of."""

import numpy as np
import pytest

from signedheat import samples
from signedheat.mesh.box_tree import BOXES_PER_LEAF, BoxTree, order_along_curve

BALL = samples.sphere(5)
MIDDLES = BALL.vertices[BALL.faces].mean(axis=1)


def length(points):
    """Length of the line through points, one after another."""
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()


@pytest.mark.parametrize("far", [1e3, 1e6, 1e9, 1e15, 1e100])
def test_points_far_away_do_not_spoil_the_order_of_others(far):
    points = np.concatenate([MIDDLES, [[far, 0, 0], [0, -2 * far, far]]])
    order = order_along_curve(points)
    assert sorted(order) == list(range(len(points)))
    assert length(points[order[order < len(MIDDLES)]]) < 1.01 * length(MIDDLES[order_along_curve(MIDDLES)])


@pytest.mark.parametrize("far", [1e3, 1e9, 1e12])
def test_leaves_of_bodies_far_apart_are_small(far):
    triangles = np.concatenate([BALL.vertices[BALL.faces], BALL.vertices[BALL.faces] * 1e-3 + far])
    tree = BoxTree.around(triangles)
    sides = np.ptp(tree.bounds[len(tree.bounds) // 2 :].reshape(-1, 2, 3), axis=1).max(axis=1)
    assert np.quantile(sides[np.isfinite(sides)], 0.99) < 0.5  # the curve jumps in a few


def test_groups_are_sorted_one_after_another_and_each_as_if_alone():
    groups = np.random.default_rng(0).integers(0, 5, len(MIDDLES))
    points = MIDDLES * 10.0 ** (3 * groups[:, None])
    order = order_along_curve(points, groups)
    own = [np.flatnonzero(groups == group) for group in range(5)]
    np.testing.assert_array_equal(order, np.concatenate([rows[order_along_curve(points[rows])] for rows in own]))


@pytest.mark.parametrize("count", [0, 1, BOXES_PER_LEAF, 1000])
def test_points_at_one_place_keep_their_order(count):
    np.testing.assert_array_equal(order_along_curve(np.ones((count, 3))), np.arange(count))


def test_places_beside_a_point_far_away_are_told_apart():
    points = np.concatenate([np.ones((1000, 3)), np.zeros((1000, 3)), [[1e30, 0, 0]]])
    expected = np.concatenate([np.arange(1000, 2000), np.arange(1000), [2000]])
    np.testing.assert_array_equal(order_along_curve(points), expected)
