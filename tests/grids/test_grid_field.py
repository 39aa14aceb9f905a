import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import assert_closed_manifold, enclosed_volume
from signedheat import samples


def ball(radius=0.5, spacing=0.1):
    grid = sh.Grid((-1.0, -1.0, -1.0), spacing, (21, 21, 21))
    return sh.Field(grid, np.linalg.norm(grid.points, axis=-1) - radius)


@pytest.mark.parametrize("levels", [None, 2, 3, 7])
def test_contours_of_anything_are_closed_manifold_surfaces(levels):
    # with few distinct values the level is hit exactly at many nodes, and on the walls too
    rng = np.random.default_rng(1)
    grid = sh.Grid((3.0, -2.0, 5.0), (1.0, 2.0, 0.5), (18, 15, 16))
    values = rng.normal(size=grid.shape) if levels is None else rng.integers(-levels, levels + 1, grid.shape) / levels
    surface = sh.Field(grid, values).contour(0.0)
    assert_closed_manifold(surface)
    assert enclosed_volume(surface) > 0
    assert len(np.unique(surface.vertices, axis=0)) == surface.n_vertices


def test_contour_lies_in_world_coordinates_and_encloses_the_negative_side():
    grid = sh.Grid((10.0, 20.0, 30.0), (0.05, 0.1, 0.2), (61, 31, 16))
    center = 0.5 * (grid.origin + grid.upper)
    field = sh.Field(grid, np.linalg.norm(grid.points - center, axis=-1) - 1.0)
    surface = field.contour(0.0)
    # linear interpolation of a distance is off by at most h²/8 of its curvature
    assert np.abs(np.linalg.norm(surface.vertices - center, axis=1) - 1).max() < 0.2**2 / 8 * 1.2
    assert enclosed_volume(sh.TriangleMesh(surface.vertices - center, surface.faces)) == pytest.approx(4.19, rel=0.03)
    inverse = sh.Field(grid, -field.values).contour(0.0)
    assert enclosed_volume(sh.TriangleMesh(inverse.vertices - center, inverse.faces)) < 0


def test_contours_beside_a_number_near_the_largest_are_finite():
    values = ball().values.copy()
    values[10, 10, 10] = -1e300
    assert np.isfinite(sh.Field(ball().domain, values).contour().vertices).all()


def test_offset_keeps_its_distance_or_says_why_not():
    field = ball()
    assert_closed_manifold(field.offset(0.2))
    assert np.abs(np.linalg.norm(field.offset(-0.2).vertices, axis=1) - 0.3).max() < 5e-3
    with refused(sh.errors.OutsideError):
        field.offset(0.6)
    with refused(sh.errors.OutsideError, "level 5"):
        field.contour(5.0)


def test_an_open_shape_is_closed_along_the_box():
    grid = sh.Grid((-1.0, -1.0, -1.0), 0.1, (21, 21, 21))
    surface = sh.Field(grid, grid.points[..., 2]).offset(0.3)
    assert_closed_manifold(surface)
    assert enclosed_volume(surface) == pytest.approx(2 * 2 * 1.3, rel=0.005)  # 1 % of a cell beyond each wall


def test_values_between_nodes_and_beyond_the_box():
    rng = np.random.default_rng(2)
    grid = sh.Grid((-1.0, 0.0, 2.0), (0.1, 0.2, 0.3), (11, 9, 8))
    slope, inside = np.array([0.36, -0.48, 0.8]), rng.uniform(grid.origin, grid.upper, (50, 3))
    field = sh.Field(grid, grid.points @ slope)
    for points in (inside, grid.origin + 30 * rng.normal(size=(50, 3))):
        np.testing.assert_allclose(field(points), points @ slope, atol=1e-10)
        np.testing.assert_allclose(field.gradient(points), np.broadcast_to(slope, (50, 3)), atol=1e-10)
    np.testing.assert_allclose(field(grid.points.reshape(-1, 3)), field.values.ravel(), atol=1e-12)
    assert np.ndim(field(inside[0])) == 0


def test_beyond_the_box_a_convex_shape_is_at_least_that_far():
    points = np.random.default_rng(3).normal(size=(500, 3)) * 4
    field = ball()
    exact = np.linalg.norm(points, axis=1) - 0.5
    outside = ~field.domain.contains(points)
    assert (field(points[outside]) < exact[outside] + 0.01).all()
    assert (field(points[outside]) > 0.4).all()


def test_bad_input_is_refused():
    field = ball()
    with refused(sh.errors.GeometryError, "values"):
        sh.Field(field.domain, np.zeros((3, 3, 3)))
    with refused(sh.errors.GeometryError, "points"):
        field([[np.nan, 0, 0]])
    with refused(sh.errors.GeometryError, "points"):
        field([[0.0, 0.0]])


def test_bands_are_sharpened_and_combined_as_whole_fields_are():
    band = sh.complete(samples.sphere(2)).field(resolution=48, band=0.2)
    assert np.array_equal(sh.sharpen(2 * band).values, band.values, equal_nan=True)
    read = sh.Field(band.domain, band.values, coarse=band.coarse)
    with refused(sh.errors.GeometryError, "field"):
        sh.sharpen(read)
    for either in (2 * read | read, read | 2 * read):
        with refused(sh.errors.OutsideError, "level 0.3"):
            either.contour(0.3)


def test_contours_in_the_plane_are_not_written_as_meshes(tmp_path):
    grid = sh.Grid((-1, -1), 0.1, (21, 21))
    with refused(sh.errors.GeometryError):
        sh.Field(grid, np.linalg.norm(grid.points, axis=-1) - 0.5).save_contour(tmp_path / "disk.ply")


def test_fields_without_values_say_so(tmp_path):
    plane = sh.Field(sh.Grid((0, 0), 1.0, (4, 5)), np.full((4, 5), np.nan))
    space = sh.Field(sh.Grid((0, 0, 0), 1.0, (4, 5, 6)), np.full((4, 5, 6), np.nan))
    corner = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    for field in (plane, space, sh.Field(corner, np.full(4, np.nan))):
        with refused(sh.errors.GeometryError, "values"):
            field.contour()
        with refused(sh.errors.GeometryError, "field"):
            sh.view.save_slices(field, tmp_path / "none.png")
