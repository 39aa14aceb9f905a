"""Grids around shapes."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples


@pytest.mark.parametrize("padding", [None, 0.0, 0.7])
@pytest.mark.parametrize("resolution", [2, 17, 100])
def test_resolution_and_padding(resolution, padding):
    bounds = np.array([[0.0, -3.0, 5.0], [1.0, 4.0, 5.5]])
    grid = sh.Grid.around(bounds, resolution, padding)
    room = 0.2 * 7.0 if padding is None else padding
    assert max(grid.shape) == resolution
    assert (grid.origin <= bounds[0] - room + 1e-9).all()
    assert (grid.upper >= bounds[1] + room - 1e-9).all()
    assert (grid.upper - grid.origin < np.diff(bounds, axis=0)[0] + 2 * room + grid.spacing + 1e-9).all()
    np.testing.assert_allclose(grid.origin + grid.upper, bounds.sum(axis=0), atol=1e-12)


def test_spacing_on_every_axis():
    grid = sh.Grid.around([[0, 0, 0], [1, 1, 1]], padding=0.5, spacing=(0.1, 0.2, 0.5))
    assert grid.shape == (21, 11, 5)


def test_unreferenced_vertices_take_no_room():
    mesh = samples.sphere(1)
    far = sh.TriangleMesh(np.vstack([mesh.vertices, [[1e6, 0, 0]]]), mesh.faces)
    np.testing.assert_array_equal(far.bounds, mesh.bounds)
    np.testing.assert_array_equal(sh.PolygonMesh(far.vertices, far.faces).bounds, mesh.bounds)


@pytest.mark.parametrize("options", [{"resolution": 1}, {"padding": -1}, {"padding": np.nan}, {"spacing": 0.0}])
def test_nonsense_is_refused(options):
    with refused(sh.errors.GeometryError):
        sh.Grid.around([[0, 0, 0], [1, 1, 1]], **options)


def test_a_single_point_needs_padding():
    with refused(sh.errors.GeometryError):
        sh.Grid.around([[1, 1, 1], [1, 1, 1]], 8)
    assert sh.Grid.around([[1, 1, 1], [1, 1, 1]], 8, padding=1.0).shape == (8, 8, 8)


def test_sizes_beyond_counting_are_exact():
    assert sh.Grid((0, 0, 0), 1.0, (10**8, 10**8, 10**8)).n_nodes == 10**24


def test_grids_contain_points_of_their_dimension():
    grid = sh.Grid((0, 0, 0), 0.5, (3, 3, 3))
    assert grid.contains([[[0.5, 0.5, 1.0]], [[0.5, 0.5, 1.1]]]).tolist() == [[True], [False]]
    for points in ([0.5], [[0.5, 0.5]]):
        with refused(sh.errors.GeometryError, "points"):
            grid.contains(points)
