"""Exact closest points of fields in space, and calls with many points."""

import tracemalloc

import numpy as np
import pytest

import signedheat as sh
from signedheat import parallel, samples


@pytest.fixture(scope="module")
def holed():
    ball = samples.sphere(3)
    keep = ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.5
    return sh.solid_distance(sh.TriangleMesh(ball.vertices, ball.faces[keep]), resolution=32)


def points_around(n, reach=1.6):
    return np.random.default_rng(0).uniform(-reach, reach, (n, 3))  # some outside the grid


def test_places_distances_and_gradients_fit_together(holed):
    points = points_around(3000)
    found = holed.closest_points(points)
    np.testing.assert_allclose(found.points + found.distances[:, None] * found.gradients, points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.gradients, axis=1), 1, atol=1e-12)
    assert found.completed.any() and not found.completed.all()
    again = holed.closest_points(found.points)
    # a place on the completed surface is the foot on a circle that touches it: second order, but at its rim
    off = np.abs(again.distances) / holed.grid.spacing.max()
    assert np.quantile(off, 0.95) < 0.1 and off.max() < 1
    assert np.abs(again.distances[~found.completed]).max() < 1e-12


def test_distances_agree_with_those_at_the_nodes(holed):
    nodes = holed.grid.points.reshape(-1, 3)
    found = holed.closest_points(nodes)
    off = np.abs(found.distances - holed.values.ravel()) / holed.grid.spacing.max()
    near = np.abs(holed.values.ravel()) < 2 * holed.grid.spacing.max()
    # nodes take the nearest of a few candidates, here the search is exact; at the rim of a hole circles end differently
    assert off[near & (nodes[:, 2] < 0.2)].max() < 0.02
    assert np.quantile(off[near], 0.99) < 0.1 and off[near].max() < 2
    assert ((found.distances < 0) == (holed.values.ravel() < 0)).all()


def test_chunks_and_threads_do_not_change_anything(holed, monkeypatch):
    points = points_around(5000)
    whole, called, slopes = holed.closest_points(points), holed(points), holed.gradient(points)
    monkeypatch.setattr(parallel, "CHUNK", 257)
    parts = holed.closest_points(points)
    np.testing.assert_array_equal(holed(points), called)
    np.testing.assert_array_equal(holed.gradient(points), slopes)
    np.testing.assert_allclose(parts.distances, whole.distances, atol=1e-14)
    np.testing.assert_array_equal(parts.completed, whole.completed)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    alone = holed.closest_points(points)
    np.testing.assert_array_equal(alone.distances, parts.distances)
    np.testing.assert_array_equal(alone.points, parts.points)


def test_memory_is_that_of_the_result(holed):
    points = points_around(800_000)
    holed(points[:10]), holed.closest_points(points[:10])
    for call, floats in ((holed, 1), (holed.closest_points, 9)):  # twice 3 and the distance, with their copies
        tracemalloc.start()
        call(points)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        chunks = parallel.n_threads() * parallel.CHUNK * 8 * 60
        assert peak < 8 * len(points) * (2 * floats + 8) + chunks


def test_shapes_of_arguments(holed):
    assert np.ndim(holed([0.0, 0, 0])) == 0
    assert holed(np.zeros((0, 3))).shape == (0,)
    assert holed.closest_points(np.zeros((0, 3))).points.shape == (0, 3)
    assert holed.closest_points([1.0, 2, 3]).distances.shape == (1,)
    for wrong in ([[np.nan, 0, 0]], [[0.0, 0]]):
        with pytest.raises(sh.GeometryError):
            holed.closest_points(wrong)


def test_fields_without_a_surface_say_so(holed):
    with pytest.raises(sh.SourceError) as caught:
        sh.GridField(holed.grid, holed.values).closest_points([[0.0, 0, 0]])
    assert "solid_distance" in caught.value.remedy
