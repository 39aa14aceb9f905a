"""Pictures: the parts of them that can be wrong."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples, view
from signedheat.view.figures import isolines_between, legible
from signedheat.view.slice_pictures import cross_section, lines_by_style, rounded
from signedheat.view.surface_pictures import axes_of_view


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
    view.save_slices(sh.Field(grid, 2 + grid.points[..., 0]), tmp_path / "a.png", shape)
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_completed_parts_of_levels_are_dashed():
    """A circle, of which the right half is completed: solid on the left, dashed on the right, both whole."""
    u = v = np.linspace(-1, 1, 41)
    radius = np.hypot(*np.meshgrid(u, v, indexing="ij"))
    trusted = np.where(u[:, None] > 0.025, 0.5, 1.0) * np.ones((1, 41))
    lines = lines_by_style(u, v, radius - 0.8, 0.0, trusted.astype(np.float32))
    solid, dashed = np.concatenate(lines["solid"]), np.concatenate(lines["dashed"])
    np.testing.assert_allclose(np.hypot(*solid.T), 0.8, atol=2e-3)
    assert solid[:, 0].max() < 0.06 < 0.75 < dashed[:, 0].max() and dashed[:, 0].min() > -0.06
    lengths = [sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines[k]) for k in lines]
    np.testing.assert_allclose(sum(lengths), 1.6 * np.pi, rtol=1e-2)
    assert not lines_by_style(u, v, radius - 0.8, 0.0)["dashed"]


def test_a_picture_of_unknown_kind_is_refused(tmp_path):
    with refused(sh.errors.FileFormatError):
        view.save_scene(samples.sphere(0), tmp_path / "a.bmp")


def test_isolines_and_labels_are_round_numbers():
    levels, step = isolines_between(-0.25, 0.5, 8)
    assert step == 0.1
    np.testing.assert_allclose(levels, [-0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert legible(np.array([-0.5, 0.5, 1.0, 1.5, 2.0]), -0.7, 2.2) == [-0.5, 0, 0.5, 1, 1.5, 2]
    assert legible(np.arange(11.0), 0.0, 10.5) == [0, 1, 2, 3, 4, 5, 7, 9]
    positions = (-5e-7, 0.03), (12.34567, 0.03), (12345.6, 30.0)
    assert [rounded(position, spacing) for position, spacing in positions] == ["0", "12.346", "12346"]


def test_the_view_along_y_has_x_to_the_right_and_z_up():
    assert axes_of_view(np.array([0.0, -1.0, 0.0])).tolist() == [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
