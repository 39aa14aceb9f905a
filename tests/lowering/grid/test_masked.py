"""Distance around solid nodes: corners, walls, rooms without a source, far ends of corridors."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import assert_closed_manifold, enclosed_volume
from signedheat.linear.restarts import matrix_forces, solve_with_restarts
from signedheat.lowering.grid import masked as masked_grid
from signedheat.lowering.grid.masked import FreeNodes

LEFT_OF_WALL = sh.Polyline([[0.3, 2.0], [0.3, 0.0]])


def room(n):
    """A square room of 2 by 2 with a wall in its middle that leaves the upper half open, on n by n nodes."""
    h = 2 / (n - 1)
    x, y = np.moveaxis(sh.Grid((0, 0), h, (n, n)).points, -1, 0)
    return sh.Grid((0, 0), h, (n, n), (np.abs(x - 1) < 0.02 + h) & (y < 1 + 1e-9))


def exact(grid):
    """Distance from x = 0.3 around the wall: along it, across its end, and down behind it."""
    x, y = np.moveaxis(grid.points, -1, 0)
    h = grid.spacing[0]
    columns, rows = (np.flatnonzero(grid.mask.any(axis=axis)) for axis in (1, 0))
    right, top = (columns[-1] + 0.5) * h, (rows[-1] + 0.5) * h
    return np.where((x > right) & (y < top), right - 0.3 + np.hypot(x - right, y - top), x - 0.3)


def error(grid, phi, wanted):
    return np.sqrt(np.mean((phi.values - wanted)[~grid.mask] ** 2))


def test_distance_bends_around_a_wall_and_converges():
    sizes = (33, 65, 129)
    errors = []
    for n in sizes:
        grid = room(n)
        phi = sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL)
        assert (np.isnan(phi.values) == grid.mask).all()
        errors.append(error(grid, phi, exact(grid)))
        assert errors[-1] < 0.8 * grid.spacing[0]
    order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert order > 0.7  # a corner is known to half a cell, so no more than 1 can be had


def test_without_bending_the_error_would_be_of_the_size_of_the_room():
    grid = room(65)
    straight = grid.points[..., 0] - 0.3
    assert np.abs((exact(grid) - straight)[~grid.mask]).max() > 0.8
    phi = sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL)
    assert np.nanmax(np.abs(phi.values - exact(grid))) < 0.06


def test_distance_bends_in_space():
    errors = []
    for n in (17, 33):
        flat = room(n)
        depth = n // 3
        grid = sh.Grid((0, 0, 0), flat.spacing[0], (n, n, depth), np.repeat(flat.mask[..., None], depth, axis=2))
        z = grid.upper[2]
        sheet = sh.TriangleMesh([[0.3, 0, 0], [0.3, 2, 0], [0.3, 2, z], [0.3, 0, z]], [[0, 1, 2], [0, 2, 3]])
        phi = sh.SignedHeatSolver(grid).distance(sheet)
        errors.append(error(grid, phi, exact(flat)[..., None]))
    assert errors[1] < 0.65 * errors[0]
    assert errors[1] < 0.55 * grid.spacing[0]
    np.testing.assert_allclose(phi.values, phi.values[..., :1] + 0 * phi.values, atol=0.3 * grid.spacing[0])


def test_the_other_side_is_negative_and_turning_the_source_over_changes_the_sign():
    grid = room(49)
    phi = sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL)
    assert phi.values[0, 10] == pytest.approx(-0.3, abs=0.01)
    turned = sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL.reversed())
    np.testing.assert_allclose(turned.values, -phi.values, atol=1e-9)


def test_distance_scales_with_the_room():
    grid = room(33)
    large = sh.Grid(1000 * grid.origin, 1000 * grid.spacing, grid.shape, grid.mask)
    phi = sh.SignedHeatSolver(large).distance(sh.Polyline(1000 * LEFT_OF_WALL.points))
    np.testing.assert_allclose(phi.values, 1000 * sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL).values, rtol=1e-7)


def test_a_door_opens_into_a_room_like_a_fan():
    """Past the end of a door in a wall, distance is that to its post."""
    n = 81
    h = 2 / (n - 1)
    x, y = np.moveaxis(sh.Grid((0, 0), h, (n, n)).points, -1, 0)
    solid = (np.abs(x - 0.5) < 1.01 * h) & (np.abs(y - 1) > 0.2 - 1e-9)
    grid = sh.Grid((0, 0), h, (n, n), solid)
    post = 0.5 + 0.01 * h  # the door leads down the middle of the wall, and so does its end
    phi = sh.SignedHeatSolver(grid).distance(sh.Polyline([[post, 1.2], [post, 0.8]]))
    wall, edge = 0.5 + 1.5 * h, 0.8 + 0.5 * h
    behind = (x > wall) & (y < edge)
    wanted = wall - post + np.hypot(x - wall, y - edge)
    assert np.sqrt(np.mean((phi.values - wanted)[behind] ** 2)) < 1.5 * h
    assert (phi.values[(x > wall)] > 0).all() and (phi.values[x < 0.5 - 1.5 * h] < 0).all()


def test_a_grid_without_solid_nodes_measures_as_one_without_a_mask():
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = sh.Polyline(np.stack([np.cos(angle), -np.sin(angle)], axis=1), closed=True)
    plain = sh.Grid((-1.6, -1.6), 0.05, (65, 65))
    masked = sh.Grid(plain.origin, plain.spacing, plain.shape, np.zeros(plain.shape, dtype=bool))
    for constraint in (sh.ZeroSet(), sh.Free(), sh.ZeroSet(hard=True), sh.Soft(10.0), sh.EachComponent()):
        here, there = (sh.SignedHeatSolver(grid).distance(circle, constraint).values for grid in (plain, masked))
        away = np.linalg.norm(plain.points, axis=-1) - 1
        assert np.abs(here - there)[np.abs(away) < 0.3].max() < 0.12 * 0.05
        assert np.abs(here - there).max() < 0.6 * 0.05  # far away the one is diffused on coarser grids
        assert np.sqrt(np.mean((there - away) ** 2)) < 0.1 * 0.05


def test_levels_and_components():
    grid = room(49)
    sources = [LEFT_OF_WALL, sh.Polyline([[0.6, 2.0], [0.6, 0.0]])]
    phi = sh.SignedHeatSolver(grid).distance(sources, sh.LevelValues([0.0, 0.3]))
    np.testing.assert_allclose(phi([[0.3, 1.5], [0.6, 1.5]]), [0, 0.3], atol=0.01)
    each = sh.SignedHeatSolver(grid).distance(sources, sh.EachComponent())
    np.testing.assert_allclose(np.diff(each([[0.3, 1.5], [0.6, 1.5]])), 0.3, atol=0.01)
    with refused(sh.errors.ConstraintError):
        sh.SignedHeatSolver(grid).distance(sources, sh.LevelValues([0.0, 0.3, 1.0]))


def test_conjugate_gradients_find_what_factors_find(monkeypatch):
    grid = room(65)
    constraints = (sh.ZeroSet(), sh.ZeroSet(hard=True))
    direct = [sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL, c).values for c in constraints]
    monkeypatch.setitem(masked_grid.DIRECT_NODES, 2, 0)
    for found, constraint in zip(direct, constraints, strict=True):
        again = sh.SignedHeatSolver(grid).distance(LEFT_OF_WALL, constraint).values
        np.testing.assert_allclose(again, found, atol=1e-4)


def test_a_room_without_a_source_is_nan_and_says_so():
    solid = np.zeros((30, 20), dtype=bool)
    solid[18:20] = True
    grid = sh.Grid((0, 0), 1.0, solid.shape, solid)
    with pytest.warns(sh.errors.UnreachedWarning, match="200"):
        phi = sh.SignedHeatSolver(grid).distance(sh.Polyline([[5.0, 19.0], [5.0, 0.0]]))
    assert np.isnan(phi.values[18:]).all() and np.isfinite(phi.values[:18]).all()
    assert len(phi.diagnostics.unreached) == 200
    assert np.isnan(phi([[25.0, 3.0]]))[0] and phi([[10.0, 3.0]])[0] == pytest.approx(5, abs=1e-4)
    assert phi([[17.4, 3.0]])[0] == pytest.approx(12, abs=1e-4)  # beside the wall: what the open nodes say
    [line] = phi.contour(3.5)
    assert not line.closed
    np.testing.assert_allclose(line.points[:, 0], 8.5, atol=1e-4)
    with refused(sh.errors.GeometryError, "field"):
        sh.sharpen(phi)


def test_corridors_have_no_end_where_numbers_underflow():
    solid = np.ones((1500, 7), dtype=bool)
    solid[:, 1:3] = solid[:, 4:6] = False
    solid[-3:, 3] = False
    grid = sh.Grid((0, 0), 1.0, solid.shape, solid)
    phi = sh.SignedHeatSolver(grid).distance(sh.Polyline([[5.3, 2.5], [5.3, 0.5]]))
    np.testing.assert_allclose(phi.values[[1400, 0], 1], [1394.7, -5.3], atol=1e-3)
    assert phi.values[0, 5] == pytest.approx(1496 - 5.3 + 1496, abs=10)  # there and back again


def test_stages_are_what_logarithms_are():
    n = 2000
    nodes = FreeNodes(sh.Grid(0.0, 1.0, n, np.zeros(n, dtype=bool)))
    from scipy import sparse

    matrix = sparse.csr_matrix(sparse.eye_array(n) + nodes.laplacian)
    factor = sparse.linalg.splu(matrix.tocsc())
    stages = solve_with_restarts(factor.solve, matrix_forces(matrix), np.eye(n)[:, :1])
    assert len(stages) > 2
    logarithm = np.full(n, np.nan)
    for values, offset in stages:
        known = ~np.isnan(values[:, 0]) & (values[:, 0] > 1e-300)
        logarithm[known] = np.log(values[known, 0]) + offset
    slopes = np.diff(logarithm)[:-20]
    np.testing.assert_allclose(slopes, -np.arccosh(1.5), rtol=1e-9)


def test_lines_of_sight():
    solid = np.zeros((5, 5), dtype=bool)
    solid[2, 2] = True
    nodes = FreeNodes(sh.Grid((0, 0), 1.0, solid.shape, solid))
    seen = np.ones((5, 5), dtype=bool)
    seen[~solid] = nodes.see(np.broadcast_to([0.0, 0.0], (24, 2)))
    hidden = {(3, 3), (4, 4), (3, 4), (4, 3), (3, 2), (2, 3)}
    assert {tuple(place) for place in np.argwhere(~seen).tolist()} == hidden
    corner = nodes.see(np.broadcast_to([3.0, 0.0], (24, 2)))  # (0, 3) to (3, 0) touches the box in a corner only
    assert corner[nodes.numbers[3]]


def test_contours_in_space_are_closed_along_solid_nodes():
    """A slab, less what a pillar takes of it up to the last free nodes, two edges of which are cut by half a cell."""
    solid = np.zeros((11, 11, 11), dtype=bool)
    solid[4:7, 4:7, :] = True
    grid = sh.Grid((0, 0, 0), 1.0, solid.shape, solid)
    source = sh.TriangleMesh([[1.3, -1, -1], [1.3, 12, -1], [1.3, 12, 12], [1.3, -1, 12]], [[0, 1, 2], [0, 2, 3]])
    surface = sh.SignedHeatSolver(grid).distance(source).offset(4.2)
    assert_closed_manifold(surface)
    assert surface.vertices[:, 0].max() == pytest.approx(5.5, abs=0.05)
    assert enclosed_volume(surface) == pytest.approx((5.5 * 10 - 2.5 * 4 + 2 * 0.5) * 10, rel=0.01)


@pytest.mark.parametrize("level", [-0.8, 0.0, 0.9])
def test_contours_among_any_solid_nodes_are_closed_manifold_surfaces(level):
    rng = np.random.default_rng(0)
    values = rng.normal(size=(12, 13, 14))
    values[rng.random(values.shape) < 0.3] = np.nan
    assert_closed_manifold(sh.GridField(sh.Grid((0, 0, 0), 0.1, values.shape), values).contour(level))


def test_masks_are_checked():
    with refused(sh.errors.GeometryError, "mask"):
        sh.Grid((0, 0), 1.0, (3, 3), np.zeros((3, 4), dtype=bool))
    with refused(sh.errors.GeometryError, "mask"):
        sh.Grid((0, 0), 1.0, (3, 3), np.zeros((3, 3)))
    with refused(sh.errors.GeometryError, "mask"):
        sh.Grid((0, 0), 1.0, (3, 3), np.ones((3, 3), dtype=bool))
    solid = np.zeros((10, 10), dtype=bool)
    solid[4:8] = True
    with refused(sh.errors.SourceError, "source 0"):
        sh.SignedHeatSolver(sh.Grid((0, 0), 1.0, (10, 10), solid)).distance(sh.Polyline([[5.2, 1.0], [5.2, 8.0]]))


def test_the_mask_is_saved(tmp_path):
    phi = sh.SignedHeatSolver(room(17)).distance(LEFT_OF_WALL)
    phi.save(tmp_path / "phi.npz")
    again = sh.load_field(tmp_path / "phi.npz")
    np.testing.assert_array_equal(again.grid.mask, phi.grid.mask)
    np.testing.assert_array_equal(again.values, phi.values)
    for ending in ("vti", "nrrd", "npy"):
        phi.save(tmp_path / f"phi.{ending}")
        np.testing.assert_array_equal(sh.load_field(tmp_path / f"phi.{ending}").values, phi.values)
