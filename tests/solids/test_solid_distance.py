"""The default: exact where the shape is there, completed where it is missing, nothing solid in empty space."""

import numpy as np
import pytest

from refusals import refused
from shapes.bodies import box, distance_to_box, sheet, turned
from signedheat import (
    Grid,
    PointCloud,
    PolygonMesh,
    TriangleMesh,
    complete,
    samples,
    signed_distance,
)
from signedheat.diagnostics import BoundsNothing, CompletedArea, LeftOut, ShapeOriented
from signedheat.errors import SourceError


def only(mesh, chosen):
    return TriangleMesh(mesh.vertices, mesh.faces[chosen])


def distance_to_boxes(points, boxes):
    """Exact distance to the union of boxes, outside it; a lower bound inside."""
    return np.min([distance_to_box(points, *corners) for corners in boxes], axis=0)


def error(field, truth):
    return 100 * np.sqrt(np.mean((field.values - truth) ** 2)) / np.ptp(truth)


def offset_is_clear(field, mesh, distance):
    """Vertices of an offset farther than one and a half offsets from samples of the faces."""
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=4000)
    on_faces = np.einsum("wk,fkd->fwd", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
    from scipy.spatial import cKDTree

    return np.mean(cKDTree(on_faces).query(field.offset(distance).vertices)[0] > 1.5 * distance)


def test_a_box_is_exact():
    """Twelve faces, far larger than a cell: distance is that of the box to rounding, at edges and corners too."""
    field = signed_distance(box((-1, -0.5, -0.3), (1, 0.5, 0.3)), resolution=48)
    exact = distance_to_boxes(field.domain.points, [((-1, -0.5, -0.3), (1, 0.5, 0.3))])
    assert np.abs(field.values - exact).max() < 1e-6


@pytest.mark.parametrize("fraction", [0.1, 0.5, 1.0])
def test_turned_faces_change_nothing(fraction):
    ball = samples.sphere(3)
    grid = Grid.around(ball.bounds, 32)
    field = signed_distance(samples.with_flipped_faces(ball, fraction), grid)
    assert np.array_equal(field.values, signed_distance(ball, grid).values)
    assert field.diagnostics.note(ShapeOriented).turned_faces > 0
    kept = signed_distance(turned(ball), grid, as_oriented=True)
    assert (kept.values >= 0).mean() > 0.99


def test_bodies_unite():
    boxes = [
        ((-1, -0.4, -0.4), (1, 0.4, 0.4)),
        ((-0.3, -1, -0.3), (0.3, 1, 0.3)),
        ((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)),
    ]
    shape = samples.union(*(box(*each) for each in boxes))
    field = signed_distance(shape, resolution=64)
    truth = distance_to_boxes(field.domain.points, boxes)
    deep = np.abs(truth) > 2 * field.domain.spacing[0]
    assert np.array_equal((field.values < 0)[deep], (truth < 0)[deep])
    assert np.abs(field.values - truth)[truth > 0].max() < 0.5 * field.domain.spacing[0]
    assert field.diagnostics.note(LeftOut).covered_faces == 24
    kept = signed_distance(shape, field.domain, keep_overlaps=True)
    assert kept.diagnostics.note(LeftOut) is None


def test_cavities_stay():
    shell = samples.union(samples.sphere(3), turned(samples.sphere(3, radius=0.5)))
    field = signed_distance(shell, resolution=48)
    radius = np.linalg.norm(field.domain.points, axis=-1)
    truth = np.maximum(radius - 1, 0.5 - radius)
    assert error(field, truth) < 0.5


def test_half_a_sphere_is_carried_on():
    """No more is missing than is there: the completed half is about as large as the other. Winding numbers end flat."""
    ball = samples.sphere(4)
    left = only(ball, ball.vertices[ball.faces][:, :, 0].mean(axis=1) < 0)
    field = signed_distance(left, Grid.around(ball.bounds, 48))
    radius = np.linalg.norm(field.domain.points, axis=-1)
    flat = np.where(field.domain.points[..., 0] < 0, radius - 1, np.hypot(field.domain.points[..., 0], radius - 1))
    assert error(field, radius - 1) < 0.5 * 100 * np.sqrt(np.mean((flat - radius + 1) ** 2)) / np.ptp(radius)
    told = field.diagnostics.note(CompletedArea)
    assert 0.25 < told.completed_share < 0.6
    assert told.where[0][1][0] > 0.3  # it is where nothing is


def test_half_a_bar_is_closed_where_it_ends():
    bar = samples.union(box((-1, -0.25, -0.25), (1, 0.25, 0.25)))
    left = only(
        bar, (bar.vertices[bar.faces][:, :, 0] < 0).any(axis=1) & ~(bar.vertices[bar.faces][:, :, 0] > 0).all(1)
    )
    left = TriangleMesh(np.minimum(left.vertices, [0.0, np.inf, np.inf]), left.faces)
    field = signed_distance(left, Grid.around(bar.bounds, 48))
    np.testing.assert_allclose(field([[-0.1, 0, 0], [0.3, 0, 0]]), [-0.1, 0.3], atol=1e-12)


def test_patches_are_completed_within_the_surface():
    ball = samples.sphere(4)
    holed = samples.without_patches(ball, 6, 0.45)
    field = signed_distance(holed, Grid.around(ball.bounds, 48))
    truth = np.linalg.norm(field.domain.points, axis=-1) - 1
    caps = 1 - np.cos(0.45)  # how far flat caps lie inside; on a fifth of the surface, and as deep below it
    assert error(field, truth) < 100 * caps * np.sqrt(0.2) / np.ptp(truth)
    far = np.abs(truth) > 3 * field.domain.spacing[0]
    assert np.array_equal((field.values < 0)[far], (truth < 0)[far])


def test_a_sheet_has_no_inside():
    flat = sheet([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    field = signed_distance(flat, resolution=40)
    x, y, z = np.moveaxis(np.abs(field.domain.points), -1, 0)
    away = np.linalg.norm([np.maximum(x - 1, 0), np.maximum(y - 1, 0), z], axis=0)
    assert np.abs(field.values - away).max() < 1e-6
    assert field.diagnostics.note(BoundsNothing).open_area == 1.0


def test_doubled_walls_have_no_inside():
    flat = sheet([[-1, -1, 0], [1, -1, 0], [1, 1, 0.3], [-1, 1, 0.3]])
    field = signed_distance(samples.union(flat, turned(flat)), resolution=40)
    assert (field.values >= 0).all()
    assert offset_is_clear(field, flat, 0.2) < 0.02  # samples of the sheet are random


def test_furniture():
    """Closed legs below open boards of any orientation: legs are solid, no solid is in empty space."""
    legs = [box((x - 0.08, y - 0.08, -1), (x + 0.08, y + 0.08, -0.02)) for x in (-0.8, 0.8) for y in (-0.5, 0.5)]
    boards = [
        sheet([[-1, -0.7, 0], [1, -0.7, 0], [1, 0.7, 0], [-1, 0.7, 0]]),
        turned(sheet([[-1, -0.7, 0.9], [1, -0.7, 0.9], [1, 0.7, 0.9], [-1, 0.7, 0.9]])),
        sheet([[-1.2, -0.7, 0], [-1.2, 0.7, 0], [-1.2, 0.7, 0.9], [-1.2, -0.7, 0.9]]),
    ]
    shape = samples.union(*legs, *boards)
    field = signed_distance(shape, resolution=64, padding=0.4)
    assert (field([[x, y, -0.5] for x in (-0.8, 0.8) for y in (-0.5, 0.5)]) < 0).all()
    p = field.domain.points
    outside = (np.abs(p) > [1.2, 0.7, 1]).any(axis=-1)
    assert (field.values[outside] < 0).mean() < 1e-3
    assert offset_is_clear(field, shape, 0.1) < 0.01


def test_a_box_without_room_changes_nothing():
    """A tube open at both ends is closed at its ends, whatever room the box leaves."""
    tube = samples.union(box((-1, -0.4, -0.4), (1, 0.4, 0.4)))
    walls = only(tube, np.ptp(tube.vertices[tube.faces][:, :, 0], axis=1) > 1)
    field = signed_distance(walls, Grid((-1.1, -0.8, -0.8), 0.05, (45, 33, 33)))
    assert field([[0, 0, 0]])[0] == pytest.approx(-0.4, abs=0.01)


def test_polygons_points_and_several_meshes():
    cube = PolygonMesh(
        [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)],
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]],
    )
    field = signed_distance(cube, resolution=32)
    assert np.abs(field.values - distance_to_boxes(field.domain.points, [((0, 0, 0), (1, 1, 1))])).max() < 1e-6
    two = signed_distance([cube, box((2, 0, 0), (3, 1, 1))], resolution=32)
    assert two([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [2.5, 0.5, 0.5]]) == pytest.approx(
        [-0.5, 0.5, -0.5], abs=0.1
    )  # a cell is .135
    cloud = samples.oriented_points(samples.sphere(3), 1000)
    points = signed_distance(cloud, resolution=24)
    assert error(points, np.linalg.norm(points.domain.points, axis=-1) - 1) < 0.7
    with refused(SourceError, "source 1"):
        signed_distance([cube, cloud], resolution=32)


def test_the_same_bits_again():
    holed = samples.without_patches(samples.torus(n_around=48, n_across=24), 4, 0.3)
    one, other = (signed_distance(holed, resolution=40) for _ in range(2))
    assert np.array_equal(one.values, other.values)


def bracket():
    """An L of 24 faces, far larger than a cell."""
    outline = [(0, 0), (3, 0), (3, 0.4), (0.4, 0.4), (0.4, 2), (0, 2), (0.2, 0.2)]  # and a place that sees all of it
    vertices = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in outline])
    faces = []
    for a, b in ((k, (k + 1) % 6) for k in range(6)):
        faces += [[a, b, 7 + b], [a, 7 + b, 7 + a], [6, b, a], [13, 7 + a, 7 + b]]
    return TriangleMesh(vertices, faces)


@pytest.mark.parametrize("missing", [[1, 19, 20, 21], [3, 4, 5, 6], [0, 5, 14, 22]])
def test_small_holes_are_not_filled_to_the_walls_of_the_box(missing):
    """What φ < 0 fills through a missing face of an L may run on to the box, where winding numbers are small."""
    whole = bracket()
    grid = Grid.around(whole.bounds, 48)
    truth = signed_distance(whole, grid).values
    broken = signed_distance(only(whole, np.delete(np.arange(24), missing)), grid).values
    assert not (broken[truth > 0.25] < 0).any()


def test_points_on_a_plate_thinner_than_a_cell_invent_no_solid():
    """Heat from both sides cancels: winding numbers tell that it is outside everywhere, and the points how far."""
    half, rng = np.array([1.0, 0.65, 0.01]), np.random.default_rng(0)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = rng.uniform(-half, half, size=(2000, 3))
    flat[:, 2] = np.where(np.arange(2000) % 2, 1, -1) * half[2]
    normals = np.stack([np.zeros(2000), np.zeros(2000), np.sign(flat[:, 2])], axis=1)
    field = signed_distance(PointCloud(flat @ turn.T, normals @ turn.T), resolution=36)
    truth = distance_to_boxes(field.domain.points @ turn, [(-half, half)])
    cell = field.domain.spacing[0]
    assert not (field.values[truth > 2 * cell] < 0).any()
    assert np.abs(np.abs(field.values) - np.abs(truth)).max() < 4 * cell  # at the rim, where φ still tells sides


def test_half_of_the_points_of_a_ball_make_no_second_ball():
    """Where points are missing φ < 0 runs on to the box, and winding numbers keep it from there."""
    normals = np.random.default_rng(1).normal(size=(1500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[:, 2] = -np.abs(normals[:, 2])
    grid = Grid.around([[-1.0] * 3, [1.0] * 3], 40)
    field = signed_distance(PointCloud(normals, normals), grid)
    away = np.linalg.norm(grid.points, axis=-1) - 1.0
    assert not (field.values[away > 0.3] < 0).any()
    assert (field.values[(away < -0.2) & (grid.points[..., 2] < 0)] < 0).all()


def test_completed_surface_begins_at_the_rims_of_holes():
    """No groove lies between: contours of a ball look outwards as it does, at the surface and away from it."""
    solid = complete(samples.without_patches(samples.sphere(4), 6, 0.15))
    grid = Grid.around(solid.bounds, 64)
    whole, band = solid.field(grid=grid), solid.field(grid=grid, band=0.15)
    for field, level in ((whole, 2 * grid.spacing[0]), (band, 0.0)):
        made = field.contour(level)
        corners = made.vertices[made.faces]
        ahead = np.einsum("ij,ij->i", made.face_area_vectors, corners.mean(axis=1))
        cosines = ahead / np.linalg.norm(made.face_area_vectors, axis=1) / np.linalg.norm(corners.mean(axis=1), axis=1)
        areas = np.linalg.norm(made.face_area_vectors, axis=1)
        assert areas[cosines < np.cos(np.deg2rad(15))].sum() < 0.003 * areas.sum()
