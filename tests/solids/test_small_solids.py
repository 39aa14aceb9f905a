"""Closed bodies keep their inside, however small beside a cell they are."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.solids.completion import scatter_of


@pytest.mark.parametrize(("resolution", "padding"), [(16, 5.25), (24, 2.0), (32, 0.3)])
def test_a_ball_of_a_few_cells(resolution, padding):
    field = sh.signed_distance(samples.sphere(3), resolution=resolution, padding=padding)
    exact = np.linalg.norm(field.domain.points, axis=-1) - 1
    assert (np.sign(field.values) == np.sign(exact)).all()
    assert np.abs(field.values - exact).max() < 0.03


def test_a_plate_thinner_than_a_tenth_of_a_cell_is_solid():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 0.002)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    field = sh.signed_distance(sh.PolygonMesh(corners, quads), resolution=32)
    grown = field.offset(0.1)
    assert grown.bounds[0] == pytest.approx([-0.1, -0.1, -0.1], abs=0.005)
    assert grown.bounds[1] == pytest.approx([1.1, 1.1, 0.102], abs=0.005)
    assert field.values.max() == pytest.approx(np.linalg.norm([0.2, 0.2, 0.2]), rel=0.15)


def test_what_lies_outside_the_grid_counts():
    ball = samples.sphere(3)
    grid = sh.Grid((0, -1.5, -1.5), 0.1, (16, 31, 31))
    field = sh.signed_distance(ball, grid)
    whole = sh.signed_distance(ball, sh.Grid((-1.5, -1.5, -1.5), 0.1, (31, 31, 31)))
    np.testing.assert_allclose(field.values, whole.values[15:], atol=1e-12)


@pytest.mark.parametrize("noise", [1e-5, 1e-3, 1e-1])
def test_cells_of_a_soup_are_not_much_finer_than_its_faces(noise):
    ball = samples.sphere(1)
    soup = ball.vertices[ball.faces] + np.random.default_rng(1).normal(scale=noise, size=(80, 3, 3))
    cell = scatter_of(soup, np.arange(80))
    assert cell >= noise and cell >= 0.05 * np.sqrt(4 * np.pi / 80)


def test_triangles_on_one_line_bound_nothing():
    shares = np.random.default_rng(5).random((300, 1))
    faces = np.random.default_rng(6).integers(0, 300, (300, 3))
    solid = sh.complete(sh.TriangleMesh(shares * [[1.0, 2.0, 3.0]], faces))
    assert solid.volume == 0 and not solid.bounding.any()
