"""Surfaces of which a share is missing everywhere are solids still."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box, sheet
from signedheat import samples
from signedheat.diagnostics import BoundsNothing
from signedheat.extensions.face_density import face_density
from signedheat.extensions.uniting import winding_of
from signedheat.lowering.area_elements import sample_on_grid


@pytest.mark.parametrize("missing", [0.5, 0.75, 0.85])
def test_a_ball_without_most_of_its_faces(missing):
    field = sh.solid_distance(samples.without_faces(samples.sphere(5), missing), resolution=40)
    exact = np.linalg.norm(field.grid.points, axis=-1) - 1
    wrong = (field.values < 0) != (exact < 0)
    assert not wrong[np.abs(exact) > field.grid.spacing.max()].any()
    assert np.sqrt(np.mean((field.values - exact) ** 2)) < 0.01
    assert field.diagnostics.note(BoundsNothing) is None


def density(shape, resolution=40):
    grid = sh.Grid.around(shape.bounds, resolution)
    found = sample_on_grid([shape], grid, 1.0)
    return face_density(winding_of(found, grid), found.positions, found.vectors)


@pytest.mark.parametrize("missing", [0.6, 0.8])
def test_it_is_the_share_that_is_there(missing):
    shape = samples.without_faces(samples.sphere(5), missing)
    share = shape.face_areas.sum() / (4 * np.pi)
    assert density(shape) == pytest.approx(share, abs=0.03)
    assert density(sh.TriangleMesh(3 * shape.vertices, shape.faces)) == pytest.approx(density(shape))


def test_what_is_whole_in_some_places_is_whole():
    """Halves, patches, sheets and thin plates lack no share of every place."""
    ball = samples.sphere(4)
    half = sh.TriangleMesh(ball.vertices, ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 0] < 0])
    flat = sheet([[-1, -1, 0], [1, -1, 0], [1, 1, 0.3], [-1, 1, 0.3]])
    plate = box((-1, -1, -0.1), (1, 1, 0.1))
    for shape in (ball, half, samples.without_patches(ball, 8, 0.4), flat, plate):
        assert density(shape) == 1.0


def cover(thickness, hole):
    """A ball's hollow wall without its top, whose inner side has a hole where ``x`` is above `hole`."""
    ball = samples.sphere(4)
    directions = ball.vertices[ball.faces].mean(axis=1)
    below = directions[:, 2] < 0.5
    inside = sh.TriangleMesh((1 - thickness) * ball.vertices, ball.faces[below & (directions[:, 0] < hole)][:, ::-1])
    return samples.union(sh.TriangleMesh(ball.vertices, ball.faces[below]), inside)


@pytest.mark.parametrize(("thickness", "hole"), [(0.015, 0.9), (0.03, 0.8)])
def test_walls_thinner_than_cells_enclose_nothing(thickness, hole):
    """Winding numbers rise across them as little as if most of the faces were gone."""
    shape = cover(thickness, hole)
    assert density(shape) == 1.0
    field = sh.solid_distance(shape, resolution=48)
    deep = np.linalg.norm(field.grid.points, axis=-1) < 0.85
    assert (field.values[deep] < 0).mean() < 0.002


def test_walls_of_most_of_a_cell_are_found():
    """Those of a hollow ball that is not closed for want of one face."""
    ball = samples.sphere(4)
    inside = sh.TriangleMesh(0.94 * ball.vertices, ball.faces[1:, ::-1])
    field = sh.solid_distance(samples.union(ball, inside), resolution=40)
    radius = np.linalg.norm(field.grid.points, axis=-1)
    within = np.abs(radius - 0.97) < 0.01
    assert within.any()
    assert (field.values[within] < 0).mean() > 0.95
    assert (field.values[radius < 0.9] > 0).all()
