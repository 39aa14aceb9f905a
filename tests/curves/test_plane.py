"""Distance to drawings in the plane: exact to their lines, completed where lines are missing."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes import strokes
from shapes.bodies import distance_to_box
from signedheat import samples
from signedheat.curves.distance import CurvesTaken
from signedheat.errors import InexactWarning

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


@pytest.mark.parametrize("damage", ["pieces_turned", "twice_turned", "bits", "long_strays", "scribbles"])
def test_strokes_are_turned_or_left_out(damage):
    drawing, lines = strokes.drawing_in_plane(np.random.default_rng(4), damage)
    places = drawing.mesh.vertices[:, :2]
    field = sh.signed_distance(lines, sh.Grid.around([places.min(axis=0), places.max(axis=0)], 97, padding=0.0))
    assert strokes.wrong_share(drawing, field(places)) < 0.03


def test_what_was_done_with_strokes_is_noted_and_may_be_refused():
    lines = sides(0.1)
    lines[1] = lines[1].reversed()
    scribble = sh.Polyline([[0.2, 0.3], [0.4, 0.35], [0.5, 0.2]])
    field = sh.signed_distance([*lines, scribble], resolution=48)
    note = field.diagnostics.note(CurvesTaken)
    assert note.turned == [1]
    assert note.left_out == [4]
    np.testing.assert_array_equal(field.values, sh.signed_distance(sides(0.1), field.grid).values)
    assert sh.signed_distance([*lines, scribble], field.grid, as_oriented=True)([[0.0, 0.9]]) > 0
    kept = sh.signed_distance([*sides(0.1), scribble], field.grid, every_piece=True)
    assert abs(kept([scribble.points[1]])) < 0.05


def test_a_guess_is_announced():
    with pytest.warns(InexactWarning, match="curve"):
        sh.signed_distance([side.reversed() if k % 2 else side for k, side in enumerate(sides(0.05))], resolution=32)


@pytest.mark.parametrize("side", [0.4, 1.2, 18.0])
def test_a_drawing_is_completed_alike_wherever_distance_is_asked(side):
    lines = sides(0.1)
    lines[2] = lines[2].reversed()
    everywhere = sh.signed_distance(lines, resolution=65)
    grid = sh.Grid.around([[0.7, 0.7], [0.7 + side, 0.7 + side]], 19, padding=0.0)  # at, and around, a missing corner
    inside = (grid.points >= everywhere.grid.origin).all(axis=-1) & (grid.points <= everywhere.grid.upper).all(axis=-1)
    field = sh.signed_distance(lines, grid)
    np.testing.assert_allclose(field.values[inside], everywhere(grid.points[inside]), atol=0.03)
    np.testing.assert_allclose(field.values, distance_to_box(grid.points, (-1, -1), (1, 1)), atol=0.15)


def test_points_with_normals_in_the_plane():
    angles = 2 * np.pi * np.arange(300) / 300
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    grid = sh.Grid.around([[-1, -1], [1, 1]], 80)
    field = sh.signed_distance(sh.PointCloud(circle, circle), grid)
    assert np.abs(field.values - (np.linalg.norm(grid.points, axis=-1) - 1)).max() < 0.02
    one = sh.signed_distance(sh.PointCloud([[0.0, 0]], [[0, 1.0]]), grid)
    assert one([[0.0, 0.5]]) > 0 > one([[0.0, -0.5]])


def test_what_does_not_fit_is_refused():
    with refused(sh.errors.ConstraintError):
        sh.signed_distance(sides(0.1), resolution=16, constraint=sh.EachComponent())
    with refused(sh.errors.UnsupportedTypeError, "band"):
        sh.signed_distance(sides(0.1), resolution=16, band=0.1)
    with refused(sh.errors.SourceError):
        sh.signed_distance(samples.sphere(1).path([0, 1]))
