"""Distance to drawings in the plane: exact to their lines, completed where lines are missing."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import distance_to_box
from signedheat import samples

SQUARE = np.array([[-1.0, -1], [-1, 1], [1, 1], [1, -1]])


def sides(gap):
    """The sides of the square, without this share of each at both ends."""
    ends = np.roll(SQUARE, -1, axis=0)
    return [sh.Polyline([a + gap * (b - a), b - gap * (b - a)]) for a, b in zip(SQUARE, ends, strict=True)]


@pytest.mark.parametrize("resolution", [24, 57])
def test_a_whole_drawing_is_exact(resolution):
    square = sh.Polyline(SQUARE, closed=True)
    field = sh.signed_distance(square, resolution=resolution)
    np.testing.assert_allclose(field.values, distance_to_box(field.grid.points, (-1, -1), (1, 1)), atol=1e-12)
    back = sh.signed_distance(sh.Polyline(SQUARE[::-1], closed=True), field.grid)
    away = np.abs(field.values) > 1e-9
    np.testing.assert_allclose(back.values[away], -field.values[away], atol=1e-12)


def test_a_drawing_with_gaps_is_exact_where_it_is_there():
    field = sh.signed_distance(sides(0.1), resolution=97)
    exact, points = distance_to_box(field.grid.points, (-1, -1), (1, 1)), field.grid.points
    beside = (np.abs(points).min(axis=-1) < 0.5) & (np.abs(exact) < 0.4)
    np.testing.assert_allclose(field.values[beside], exact[beside], atol=1e-12)
    assert np.abs(field.values - exact).max() < 0.2  # corners are cut off by less than the gaps
    assert ((field.values < 0) == (exact < 0))[np.abs(exact) > 0.15].all()


def test_a_turned_and_scaled_drawing_has_the_same_distances():
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (400, 2))
    one = sh.signed_distance(sides(0.1), resolution=160)
    other = sh.signed_distance([sh.Polyline(1e3 * line.points @ turn) for line in sides(0.1)], resolution=160)
    assert np.abs(other(1e3 * points @ turn) / 1e3 - one(points)).max() < 0.03


def test_points_with_normals_in_the_plane():
    angles = 2 * np.pi * np.arange(300) / 300
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    grid = sh.Grid.around([[-1, -1], [1, 1]], 80)
    field = sh.signed_distance(sh.PointCloud(circle, circle), grid)
    assert np.abs(field.values - (np.linalg.norm(grid.points, axis=-1) - 1)).max() < 0.02


def test_what_does_not_fit_is_refused():
    with refused(sh.errors.ConstraintError):
        sh.signed_distance(sides(0.1), resolution=16, constraint=sh.EachComponent())
    with refused(sh.errors.UnsupportedTypeError, "band"):
        sh.signed_distance(sides(0.1), resolution=16, band=0.1)
    with refused(sh.errors.SourceError):
        sh.signed_distance(samples.sphere(1).path([0, 1]))
