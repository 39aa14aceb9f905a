"""Pictures: the parts of them that can be wrong."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples, visualization
from signedheat.visualization.slices import cross_section


def test_cross_section_of_a_sphere_is_a_circle():
    segments = cross_section(samples.sphere(5, radius=2.0, center=(1, 2, 3)), axis=1, position=2.6)
    radius = np.sqrt(2.0**2 - 0.6**2)
    np.testing.assert_allclose(np.linalg.norm(segments - [1, 3], axis=2), radius, rtol=1e-3)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()
    np.testing.assert_allclose(length, 2 * np.pi * radius, rtol=1e-3)


def test_cross_section_through_vertices_is_closed():
    """Every point of the section belongs to two segments, though the plane goes through vertices of an icosahedron."""
    solid = samples.sphere(0)
    segments = cross_section(solid, axis=2, position=float(solid.vertices[0, 2])).round(12)
    segments = segments[(segments[:, 0] != segments[:, 1]).any(axis=1)]
    _, counts = np.unique(segments.reshape(-1, 2), axis=0, return_counts=True)
    assert (counts % 2 == 0).all()


def test_cross_section_that_misses_is_empty():
    assert cross_section(samples.sphere(1), axis=0, position=3.0).shape == (0, 2, 2)


@pytest.mark.parametrize("shape", [None, samples.oriented_points(samples.sphere(2), 100), samples.sphere(2)])
def test_slices_of_fields_with_one_sign(tmp_path, shape):
    grid = sh.Grid((-1, -1, -1), 0.2, (11, 11, 11))
    visualization.save_slices(sh.GridField(grid, 2 + grid.points[..., 0]), tmp_path / "a.png", shape)
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_a_picture_of_unknown_kind_is_refused(tmp_path):
    with refused(sh.FileFormatError):
        visualization.save_scene(samples.sphere(0), tmp_path / "a.bmp")
