"""Grids of one, two and four dimensions: polylines, points with normals, boolean images, lines of equal distance."""

from __future__ import annotations

import matplotlib.image
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import distance_to_box
from signedheat import view


def circle(n=400, radius=1.0, center=(0.0, 0.0), part=1.0):
    """Clockwise, so that φ < 0 inside."""
    angle = -2 * np.pi * part * np.arange(n) / n
    return sh.Polyline(center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), closed=part == 1.0)


SQUARE = sh.Polyline([[-1, -1], [-1, 1], [1, 1], [1, -1]], closed=True)


def away_from(field):
    return np.linalg.norm(field.domain.points, axis=-1) - 1


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def test_distance_to_a_line_is_exact_and_positive_to_its_left():
    grid = sh.Grid((-1, -1), 0.05, (41, 31))
    phi = sh.SignedHeatSolver(grid).distance(sh.Polyline([[-1.0, -0.23], [1.0, -0.23]]))
    np.testing.assert_allclose(phi.values, grid.points[..., 1] + 0.23, atol=1e-5)
    back = sh.SignedHeatSolver(grid).distance(sh.Polyline([[1.0, -0.23], [-1.0, -0.23]]))
    np.testing.assert_allclose(back.values, -phi.values, atol=1e-12)


def test_distance_to_a_circle_converges():
    sizes = (32, 64, 128)
    errors = []
    for n in sizes:
        phi = sh.SignedHeatSolver(sh.Grid.around(circle(8 * n), n)).distance(circle(8 * n))
        assert max(phi.domain.shape) == n and phi.domain.dimension == 2
        assert rms(phi.values - away_from(phi)) < 0.25 * phi.domain.spacing[0]
        errors.append(rms(sh.sharpen(phi).values - away_from(phi)))
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.7


def test_distance_to_a_square():
    phi = sh.sharpen(sh.SignedHeatSolver(sh.Grid.around(SQUARE, 128)).distance(SQUARE))
    error = phi.values - distance_to_box(phi.domain.points, (-1, -1), (1, 1))
    assert rms(error) < 0.3 * phi.domain.spacing[0]
    assert np.abs(error).max() < 1.0 * phi.domain.spacing[0]


def test_broken_and_doubled_circles():
    whole = circle()
    arcs = [sh.Polyline(whole.points[k : k + 30]) for k in range(0, 400, 50)]
    phi = sh.sharpen(sh.SignedHeatSolver(sh.Grid.around(arcs, 96)).distance(arcs))
    assert rms(phi.values - away_from(phi)) < 0.01
    twice = sh.SignedHeatSolver(sh.Grid.around([whole, whole], 64)).distance([whole, whole])
    np.testing.assert_allclose(
        twice.values, sh.SignedHeatSolver(sh.Grid.around(whole, 64)).distance(whole).values, atol=1e-4
    )


def test_a_line_that_crosses_itself():
    """A figure eight: one loop clockwise, the other counter-clockwise."""
    t = 2 * np.pi * np.arange(400) / 400
    eight = sh.Polyline(np.stack([np.sin(t), 0.5 * np.sin(2 * t)], axis=1), closed=True)
    phi = sh.SignedHeatSolver(sh.Grid.around(eight, 64)).distance(eight)
    left, right = phi([[-0.6, 0.0], [0.6, 0.0]])
    assert left == pytest.approx(-right, abs=0.01)
    assert abs(left) == pytest.approx(np.linalg.norm(eight.points - [0.6, 0], axis=1).min(), abs=0.02)


def test_several_components_and_levels():
    inner, outer = circle(radius=0.5), circle(radius=1.0)
    phi = sh.SignedHeatSolver(sh.Grid.around([inner, outer], 64)).distance(
        [inner, outer], sh.constraints.LevelValues([0.0, 0.5])
    )
    assert rms(phi.values - (away_from(phi) + 0.5)) < 0.01
    each = sh.SignedHeatSolver(sh.Grid.around([inner, outer], 64)).distance(
        [inner, outer], sh.constraints.EachComponent()
    )
    assert np.ptp(each([[1.0, 0.0], [0.0, 1.0]]) - each([[0.5, 0.0], [0.0, 0.5]])) < 0.01
    assert each([[1.0, 0.0]]) - each([[0.5, 0.0]]) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_distance_scales(scale):
    small = sh.SignedHeatSolver(sh.Grid.around(circle(), 32)).distance(circle())
    large = sh.SignedHeatSolver(sh.Grid.around(sh.Polyline(scale * circle().points, closed=True), 32)).distance(
        sh.Polyline(scale * circle().points, closed=True)
    )
    np.testing.assert_allclose(large.values, scale * small.values, atol=1e-6 * scale)


def test_points_on_a_line():
    ends = np.array([[-0.52], [0.73]])
    grid = sh.Grid([-1.0], 0.05, [61])
    phi = sh.SignedHeatSolver(grid).distance(sh.PointCloud(ends, normals=[[-1.0], [1.0]]))
    x = grid.points[:, 0]
    exact = np.maximum(-0.52 - x, x - 0.73)
    assert np.abs(phi.values - exact).max() < 0.5 * 0.05  # at the ridge between both
    assert np.abs(sh.sharpen(phi).values - exact).max() < 1e-5
    np.testing.assert_allclose(phi.gradient([[-0.9], [1.5]]), [[-1.0], [1.0]], atol=1e-5)


def test_a_sphere_in_four_dimensions():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(3000, 4))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    phi = sh.SignedHeatSolver(sh.Grid.around(sh.PointCloud(points, normals=points), 12, padding=0.4)).distance(
        sh.PointCloud(points, normals=points)
    )
    assert phi.domain.dimension == 4
    assert rms(phi.values - away_from(phi)) < 0.1 * phi.domain.spacing[0]
    assert phi([[0.7, 0.7, 0.7, 0.7]])[0] == pytest.approx(0.4, abs=0.02)
    assert rms(sh.sharpen(phi).values - away_from(phi)) < 0.1 * phi.domain.spacing[0]


def test_lines_of_equal_distance_are_oriented_and_close():
    phi = sh.sharpen(sh.SignedHeatSolver(sh.Grid.around(circle(), 96)).distance(circle()))
    [line] = phi.contour(0.15)
    assert line.closed and line.signed_area < 0
    np.testing.assert_allclose(np.linalg.norm(line.points, axis=1), 1.15, atol=1e-3)
    assert line.length == pytest.approx(2 * np.pi * 1.15, rel=1e-3)
    again = sh.SignedHeatSolver(phi.domain).distance(line)  # oriented so that φ grows to the left
    assert again([[0, 0]])[0] < 0 < again([[1.4, 0]])[0]
    [out] = phi.offset(-0.5)
    assert -out.signed_area == pytest.approx(np.pi * 0.25, rel=2e-3)
    with refused(sh.errors.OutsideError):
        phi.offset(0.5)
    with pytest.raises(sh.errors.OutsideError):
        phi.contour(10.0)


def test_open_lines_end_at_the_box():
    grid = sh.Grid((0, 0), 0.1, (21, 11))
    [line] = sh.SignedHeatSolver(grid).distance(sh.Polyline([[0, 0.52], [2, 0.52]])).contour(0.2)
    assert not line.closed
    np.testing.assert_allclose(line.points[[0, -1]], [[0, 0.72], [2, 0.72]], atol=1e-4)


def test_field_in_the_plane(tmp_path):
    phi = sh.SignedHeatSolver(sh.Grid.around(circle(), 64)).distance(circle())
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.3, 1.3, (50, 2))
    radius = np.linalg.norm(points, axis=1)
    points, radius = points[radius > 0.2], radius[radius > 0.2]
    np.testing.assert_allclose(phi(points), radius - 1, atol=0.02)
    np.testing.assert_allclose(phi.gradient(points), points / radius[:, None], atol=0.12)
    for ending in ("npz", "vti", "nrrd", "npy"):
        phi.save(tmp_path / f"phi.{ending}")
        again = sh.read_field(tmp_path / f"phi.{ending}")
        np.testing.assert_array_equal(again.values, phi.values)
        np.testing.assert_array_equal(again.domain.origin, phi.domain.origin)
    view.save_slices(phi, tmp_path / "phi.png", [circle()], [0.2])
    assert matplotlib.image.imread(tmp_path / "phi.png")[..., :3].std() > 0.05


def test_boolean_images():
    x, y = np.meshgrid(np.linspace(-2, 2, 161), np.linspace(-1.5, 1.5, 121), indexing="ij")
    inside = (np.hypot(x + 0.8, y) < 0.7) | (np.hypot(x - 0.8, y) < 0.6)
    lines = sh.Polyline.from_mask(inside, (-2, -1.5), 4 / 160)
    assert len(lines) == 2 and all(line.closed and line.signed_area < 0 for line in lines)
    assert sum(-line.signed_area for line in lines) == pytest.approx(np.pi * (0.49 + 0.36), rel=0.01)
    phi = sh.SignedHeatSolver(sh.Grid.around(lines, 96)).distance(lines)
    exact = np.minimum(
        *(np.hypot(phi.domain.points[..., 0] - a, phi.domain.points[..., 1]) - r for a, r in ((-0.8, 0.7), (0.8, 0.6)))
    )
    assert rms(phi.values - exact) < 0.03
    [border] = sh.Polyline.from_mask(np.ones((3, 3), dtype=bool))  # what meets the border of the image is closed
    assert border.closed and border.bounds.tolist() == [[-0.5, -0.5], [2.5, 2.5]]
    with refused(sh.errors.GeometryError):
        sh.Polyline.from_mask(np.ones((3, 3)))
    with refused(sh.errors.GeometryError):
        sh.Polyline.from_mask(np.zeros((3, 3), dtype=bool))


def test_polylines_are_checked():
    with refused(sh.errors.GeometryError, "points"):
        sh.Polyline([[0, 0]])
    with refused(sh.errors.GeometryError, "points"):
        sh.Polyline([[1, 1], [1, 1], [1, 1]])
    with refused(sh.errors.GeometryError, "number 1"):
        sh.Polyline([[0, 0], [np.nan, 1]])
    with refused(sh.errors.GeometryError, "points"):
        sh.Polyline([[0, 0, 0], [1, 0, 0]])
    assert sh.Polyline([[0, 0], [1, 0], [1, 1], [0, 0]], closed=True).n_points == 3
    repeated = sh.Polyline([[-1, 0], [0, 0], [0, 0], [1, 0]])  # ugly, but valid
    grid = sh.Grid((-1, -1), 0.1, (21, 21))
    np.testing.assert_allclose(sh.SignedHeatSolver(grid).distance(repeated).values, grid.points[..., 1], atol=1e-5)


def test_sources_of_the_wrong_dimension_are_refused():
    with refused(sh.errors.SourceError, "source 0"):
        sh.SignedHeatSolver(sh.Grid((0, 0, 0), 0.1, (4, 4, 4))).distance(SQUARE)
    with refused(sh.errors.SourceError, "source 0"):
        sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (4, 4))).distance(sh.TriangleMesh(np.eye(3), [[0, 1, 2]]))
    with refused(sh.errors.SourceError):
        sh.SignedHeatSolver(sh.Grid((5, 5), 0.1, (4, 4))).distance(SQUARE)


@pytest.mark.parametrize(("diffusion", "least", "most"), [(1.0, 0.01, 0.04), (10.0, 0.04, 0.07), (100.0, 0.13, 0.19)])
def test_long_diffusion_rounds_corners(diffusion, least, most):
    gap, ends = 0.4, np.roll(SQUARE.points, -1, axis=0)
    along = (ends - SQUARE.points) / 2
    sides = [sh.Polyline([a + gap * t, b - gap * t]) for a, b, t in zip(SQUARE.points, ends, along, strict=True)]
    grid = sh.Grid((-1.5, -1.5), 3 / 120, (121, 121))
    [line] = sh.SignedHeatSolver(grid, diffusion=diffusion).distance(sides).contour(0.0)
    assert least < np.linalg.norm(line.points - [1, 1], axis=1).min() < most


def test_points_in_the_plane_need_no_grid():
    points = circle(60).points
    cloud = sh.PointCloud(points, points)
    alone = sh.signed_distance(cloud, resolution=40)
    assert np.array_equal(alone.values, sh.signed_distance(cloud, alone.domain).values)
