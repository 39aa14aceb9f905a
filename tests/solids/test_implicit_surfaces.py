"""Contours of functions and of arrays: corners of boxes, the order of balls, surfaces that the walls close."""

from __future__ import annotations

import threading

import numpy as np
import pytest
import scipy

import signedheat as sh
from signedheat import samples
from signedheat.mesh.self_intersections import self_intersections
from signedheat.shapes.inspection import inspect

CUBE = [[-1, -1, -1], [1, 1, 1]]
HALVES = np.array([0.7, 0.5, 0.4])
CORNERS = HALVES * (2 * np.array(list(np.ndindex(2, 2, 2))) - 1)
TURNED = scipy.spatial.transform.Rotation.from_euler("xyz", [0.4, 0.9, 0.3]).as_matrix()


def box(points, turn=TURNED):
    """Distance to a turned box."""
    beyond = np.abs(points @ turn) - HALVES
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def slopes(points, f=box, step=1e-6):
    ways = step * np.eye(3)
    return np.stack([(f(points + way) - f(points - way)) / (2 * step) for way in ways], axis=1)


def ball(points):
    return np.linalg.norm(points, axis=1) - 0.63


def nodes(n):
    """(n³, 3) nodes of the cube."""
    x = np.linspace(-1, 1, n)
    return np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)


def assert_closed_and_manifold(surface):
    report = inspect(surface)
    assert report.is_closed and report.is_manifold and report.inconsistent_edges == 0
    assert not len(self_intersections(surface.vertices, surface.faces))


def away_from_corners(surface, turn=TURNED):
    return scipy.spatial.cKDTree(surface.vertices).query(CORNERS @ turn.T)[0].max()


def test_corners_of_a_box_are_exact_to_rounding():
    surface = sh.contour(lambda points: box(points, np.eye(3)), CUBE, 0.08)
    assert away_from_corners(surface, np.eye(3)) < 1e-8
    assert_closed_and_manifold(surface)


@pytest.mark.parametrize("gradient", [None, slopes])
def test_a_turned_box_is_sharp(gradient):
    surface = sh.contour(box, CUBE, 0.08, gradient=gradient)
    assert_closed_and_manifold(surface)
    assert away_from_corners(surface) < 0.1 * 0.08
    assert surface.to_trimesh().volume == pytest.approx(8 * HALVES.prod(), rel=1e-4)
    cut = sh.contour(box, CUBE, 0.08, sharp=False)
    assert cut.to_trimesh().volume < (1 - 1e-3) * 8 * HALVES.prod()


@pytest.mark.parametrize(
    "surface",
    [
        lambda f: sh.contour(f, CUBE, 0.08),
        lambda f: sh.complete(samples.sphere(3)).offset(lambda places: 0.2 + 0.1 * f(places), resolution=64),
    ],
)
def test_functions_are_called_in_the_thread_that_asks(surface):
    """They may hold state, or contexts of other libraries, that belong to one thread."""
    threads = set()

    def told(points):
        threads.add(threading.get_ident())
        return box(points)

    assert surface(told).n_faces > 1000
    assert threads == {threading.get_ident()}


def test_arrays_have_edges_too():
    """With gradients corners are exact; with differences edges are off, but by a tenth of what marching cubes cut."""
    places, true = nodes(31), 8 * HALVES.prod()
    values = box(places).reshape(31, 31, 31)
    exact = sh.contour(values, CUBE, gradient=slopes(places).reshape(31, 31, 31, 3))
    assert away_from_corners(exact) < 1e-6
    assert exact.to_trimesh().volume == pytest.approx(true, rel=1e-4)
    np.testing.assert_array_equal(sh.contour(values, CUBE, gradient=slopes).vertices, exact.vertices)
    sharp, cut = (sh.contour(values, CUBE, sharp=each) for each in (True, False))
    assert_closed_and_manifold(sharp)
    field = sh.Field(sh.Grid((-1, -1, -1), 2 / 30, (31, 31, 31)), values)
    assert abs(sharp.to_trimesh().volume - true) < 0.2 * abs(field.contour().to_trimesh().volume - true)
    assert abs(sharp.to_trimesh().volume - true) < abs(cut.to_trimesh().volume - true)


def test_balls_converge_with_the_square_of_the_cells():
    errors = []
    for n in (25, 49):
        for surface in (sh.contour(ball, CUBE, 2 / (n - 1)), sh.contour(ball(nodes(n)).reshape(n, n, n), CUBE)):
            assert_closed_and_manifold(surface)
            errors.append(np.abs(ball(surface.vertices[surface.faces].mean(axis=1))).mean())
    assert (np.log2(np.array(errors[:-2]) / errors[2:]) > 1.8).all() and max(errors[-2:]) < 1e-3


@pytest.mark.parametrize("array", [False, True])
def test_walls_of_the_box_close_what_they_cut(array):
    bounds = np.array([[-1, -1, -1], [1, 1, 0.2]])
    x, z = np.linspace(-1, 1, 31), np.linspace(-1, 0.2, 19)
    places = np.stack(np.meshgrid(x, x, z, indexing="ij"), axis=-1)
    f = ball(places.reshape(-1, 3)).reshape(31, 31, 19) if array else ball
    surface = sh.contour(f, bounds) if array else sh.contour(f, bounds, 2 / 30)
    assert_closed_and_manifold(surface)
    height = 0.63 - 0.2
    true = 4 / 3 * np.pi * 0.63**3 - np.pi * height**2 * (3 * 0.63 - height) / 3
    assert surface.to_trimesh().volume == pytest.approx(true, rel=0.005)
    assert surface.bounds[1, 2] == pytest.approx(0.2, abs=0.001)


def test_a_level_set_that_is_no_distance():
    """The part below of a gyroid is half of the box, by symmetry."""
    surface = sh.contour(
        lambda p: 5 * (np.sin(p) * np.cos(np.roll(p, -1, axis=1))).sum(axis=1), np.pi * np.array(CUBE), resolution=32
    )
    assert_closed_and_manifold(surface)
    assert surface.to_trimesh().volume == pytest.approx(0.5 * (2 * np.pi) ** 3, rel=2e-3)


def test_single_precision_columns_and_levels():
    def column(points):
        return box(points.astype(np.float32), np.eye(3, dtype=np.float32)).astype(np.float32)[:, None]

    assert away_from_corners(sh.contour(column, CUBE, 0.08), np.eye(3)) < 1e-3
    grown = sh.contour(ball, CUBE, 0.1, 0.2)
    assert np.linalg.norm(grown.vertices, axis=1) == pytest.approx(0.83, abs=1e-3)


@pytest.mark.parametrize(
    ("f", "bounds", "options", "message"),
    [
        (ball, [[0, 0, 0], [0, 1, 1]], {}, "lower and the upper corner"),
        (lambda points: points, CUBE, {}, "returns shape"),
        (lambda points: np.full(len(points), "a"), CUBE, {}, "real numbers"),
        (ball, ball, {}, "real numbers"),
        (np.full((4, 4, 4), "a"), CUBE, {"resolution": None}, "real numbers"),
        (lambda points: np.log(points[:, 0] - 2), CUBE, {}, "not finite"),
        (np.zeros((4, 4)), CUBE, {"resolution": None}, "3 axes"),
        (np.full((4, 4, 4), np.nan), CUBE, {"resolution": None}, "finite"),
        (np.zeros((4, 4, 4)), CUBE, {"spacing": 0.1, "resolution": None}, "spacing has no effect"),
        (np.zeros((4, 4, 4)), CUBE, {}, "resolution has no effect"),
        (np.zeros((4, 4, 4)), CUBE, {"gradient": np.zeros((4, 4, 4)), "resolution": None}, "gradients"),
        (ball, CUBE, {"gradient": np.zeros(3)}, "must be a function"),
        (ball, CUBE, {"level": 9.0}, "below level 9 everywhere"),
        (ball, CUBE, {"level": -9.0}, "nowhere"),
        (ball, CUBE, {"spacing": 1e-6}, "free"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_cannot_be_contoured_is_refused(f, bounds, options, message):
    with pytest.raises(sh.SignedHeatError, match=message):
        sh.contour(f, bounds, **{"resolution": 8, **options})
