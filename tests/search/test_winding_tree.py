"""Winding numbers through a tree, beside closed forms and whole numbers."""

from __future__ import annotations

import numpy as np
import pytest

from signedheat import samples
from signedheat.mesh.box_tree import BoxTree
from signedheat.search.winding_tree import WindingTree, winding_sums


def winding(triangles, points):
    tree = BoxTree.of(triangles.min(axis=1), triangles.max(axis=1))
    return WindingTree(triangles, tree).numbers(np.asarray(points, dtype=float))


def test_closed_surfaces_have_whole_numbers():
    ball = samples.sphere(4)
    triangles = ball.vertices[ball.faces]
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (500, 3))
    points = points[np.abs(np.linalg.norm(points, axis=1) - 1) > 0.02]
    inside = np.linalg.norm(points, axis=1) < 1
    assert np.abs(winding(triangles, points) - inside).max() < 0.05
    twice = np.concatenate([triangles, triangles])
    assert winding(twice, points) == pytest.approx(2 * winding(triangles, points), abs=0.05)
    assert winding(triangles[:, ::-1], points) == pytest.approx(-winding(triangles, points), abs=1e-12)


@pytest.mark.parametrize("height", [0.1, 0.5, 2.0])
def test_a_cap_is_seen_under_its_solid_angle(height):
    """From below, on its axis, a disc of radius a at distance h is seen under ``2π (1 − h / √(h² + a²))``."""
    ball = samples.sphere(5)
    triangles = ball.vertices[ball.faces]
    triangles = triangles[triangles[:, :, 2].min(axis=1) > -1e-9]
    rim = 1 / np.hypot(1, height)
    seen = 0.5 * (1 - height * rim)
    assert winding(triangles, [[0, 0, -height]])[0] == pytest.approx(seen, abs=0.01)


def test_far_moments_have_every_triangle():
    """Of few triangles each counts: the tree errs by a thousandth of what is seen of all, as the sum over them is."""
    rng = np.random.default_rng(3)
    triangles = rng.uniform(-1, 1, (1, 3, 3)) + 0.3 * rng.normal(size=(9, 3, 3))
    points = rng.normal(size=(100, 3))
    points *= 20 / np.linalg.norm(points, axis=1)[:, None]
    exact = winding_sums(triangles, points)
    np.testing.assert_allclose(winding(triangles, points), exact, rtol=0, atol=1e-3 * np.abs(exact).max())
