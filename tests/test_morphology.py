"""Growing and shrinking: closed forms, idempotence, volumes, broken input."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy

import signedheat as sh
from refusals import refused
from shapes.bodies import box, distance_to_box
from shapes.grid_cases import assert_closed_manifold, enclosed_volume
from shapes.tet_cases import lattice
from signedheat import memory, samples
from signedheat.cli import main
from signedheat.mesh.self_intersections import self_intersections

BALL = samples.sphere(4)


def radii(mesh):
    return np.linalg.norm(mesh.vertices, axis=1)


@cache
def box_with_arms():
    grid = sh.Grid.around(np.array([[-1.5, -0.5, -0.5], [1.5, 0.5, 0.5]]), resolution=64, padding=0.1)
    arms = [distance_to_box(grid.points, -half, half) for half in np.array([[0.5, 0.5, 0.5], [1.5, 0.1, 0.1]])]
    return sh.Field(grid, np.minimum(*arms)).contour(0.0)


def waved_sheet(n=20):
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    vertices = np.stack([x, y, 0.2 * np.sin(2 * x)], axis=-1).reshape(-1, 3)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([i, i + n + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + 1], 1)])
    return sh.TriangleMesh(vertices, faces)


@pytest.mark.parametrize(
    ("operation", "radius"),
    [(sh.morphology.dilate, 1.4), (sh.morphology.erode, 0.6), (sh.morphology.opening, 1), (sh.morphology.closing, 1)],
)
def test_balls_stay_balls(operation, radius):
    ball = operation(BALL, 0.4, resolution=48)
    assert_closed_manifold(ball)
    np.testing.assert_allclose(radii(ball), radius, atol=0.005)
    assert enclosed_volume(ball) > 0


def test_a_broken_ball_grows_as_if_it_were_whole():
    broken = samples.with_flipped_faces(samples.without_patches(BALL, 4, 0.35), 0.05)
    grown = sh.morphology.dilate(broken, 0.3, resolution=40)
    assert_closed_manifold(grown)
    # Holes of angular radius 0.35 leave 1 − cos 0.35 = 0.06 open to interpretation.
    assert np.quantile(np.abs(radii(grown) - 1.3), 0.99) < 0.06
    np.testing.assert_allclose(radii(grown), 1.3, atol=0.1)


def test_there_is_room_for_distances_that_are_larger_within_a_face():
    def bump(places):
        return 0.05 + 0.6 * np.exp(-((places[:, :2] - 0.5) ** 2).sum(axis=1) / 0.08) * (places[:, 2] > 0.5)

    made = sh.offset(box((0, 0, 0), (1, 1, 1)), bump, resolution=14)
    assert_closed_manifold(made)
    assert made.bounds[1, 2] == pytest.approx(1.65, abs=0.02)


@pytest.mark.parametrize("step", [1, -1])
def test_outlines_that_overlap_are_one_whichever_way_they_run(step):
    square = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])
    both = [sh.Polyline(square[::step] + shift, closed=True) for shift in (0.0, [0.5, 0.2])]
    for operation, reach in ((sh.morphology.dilate, 0.1), (sh.morphology.erode, -0.1), (sh.morphology.opening, 0.0)):
        [outline] = operation(both, 0.1)
        np.testing.assert_allclose(outline.bounds, [[-reach, -reach], [1.5 + reach, 1.2 + reach]], atol=1e-3)


def test_on_tets_faces_are_turned():
    grown = sh.morphology.dilate(samples.with_flipped_faces(samples.sphere(2), 0.3), 0.3, lattice(16))
    np.testing.assert_allclose(radii(grown), 1.3, atol=0.1)


@pytest.mark.parametrize("operation", [sh.morphology.opening, sh.morphology.closing])
def test_a_second_time_changes_nothing_beyond_a_cell(operation):
    grid = sh.Grid.around(np.array([[-1.5, -0.5, -0.5], [1.5, 0.5, 0.5]]), resolution=40, padding=0.5)
    once = operation(box_with_arms(), 0.2, grid)
    twice = operation(once, 0.2, grid)
    distance = sh.sharpen(sh.SignedHeatSolver(grid).distance(once))
    assert np.abs(distance(twice.vertices)).max() < grid.spacing.max()


def test_opening_takes_thin_arms_off():
    opened = sh.morphology.opening(box_with_arms(), 0.2, resolution=80)
    assert np.abs(opened.vertices).max() < 0.56


@pytest.mark.parametrize("sides", [(0.1,), (0.1, 0.0), (0.0, 0.1), (0.15, 0.1)])
def test_a_sheet_gains_twice_its_area_times_the_distance(sides):
    sheet = waved_sheet()
    solid = sh.morphology.thicken(sheet, *sides, resolution=48)
    assert_closed_manifold(solid)
    above, below = sides if len(sides) == 2 else 2 * sides
    # rims are upright, and the mean curvature of the waves, which changes its sign, cancels
    assert enclosed_volume(solid) == pytest.approx((above + below) * sheet.face_areas.sum(), rel=2e-3)


@pytest.mark.parametrize(("side", "lower", "upper"), [("both", -0.3, 0.3), ("outside", 0, 0.3), ("inside", -0.3, 0)])
def test_a_triangle_is_thickened_to_an_exact_prism(side, lower, upper):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    turn = scipy.spatial.transform.Rotation.random(random_state=1).as_matrix()
    sheet = moved(sh.TriangleMesh(corners, [[0, 1, 2]]), turn)
    solid = sh.morphology.thicken(sheet, 0.3, side=side, resolution=40)
    assert_closed_manifold(solid)
    assert enclosed_volume(solid) == pytest.approx(0.5 * (upper - lower), rel=1e-3)
    heights = (solid.vertices @ turn)[:, 2]
    np.testing.assert_allclose([heights.min(), heights.max()], [lower, upper], atol=1e-3)


def test_boards_that_stand_on_each_other_have_no_slit():
    """In planes of symmetry of the grid, where the rim below is as near as the board that it stands on."""
    lying = sh.TriangleMesh([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    upright = sh.TriangleMesh([[0.0, -1, 0], [0, 1, 0], [0, 1, 1], [0, -1, 1]], [[0, 1, 2], [0, 2, 3]])
    solid = sh.morphology.thicken([lying, upright], 0.1, resolution=41)
    assert_closed_manifold(solid)
    # a slit of a hundredth of a cell would take three times that
    assert enclosed_volume(solid) == pytest.approx(4 * 0.2 + 2 * 0.9 * 0.2, rel=5e-5)


def test_some_faces_of_a_part_are_thickened():
    part = box((-1, -1, -1), (1, 1, 1))
    top = part.face_area_vectors[:, 2] > 0
    arrays = part.vertices, part.faces
    for shape, chosen in ((part, top), (part, np.flatnonzero(top)), (arrays, top)):
        slab = sh.morphology.thicken(shape, 0.2, side="outside", faces=chosen, resolution=32)
        np.testing.assert_allclose(slab.bounds, [[-1, -1, 1], [1, 1, 1.2]], atol=1e-3)
        assert enclosed_volume(slab) == pytest.approx(0.8, rel=1e-3)
    assert (sh.complete(part) | sh.complete(slab)).volume == pytest.approx(8.8, rel=1e-4)
    with refused(sh.errors.SourceError, "faces"):
        sh.morphology.thicken(part, 0.2, faces=[99])


def test_the_rims_of_a_tube_are_flat_rings():
    n = 64
    a, b = np.arange(n), np.roll(np.arange(n), -1)
    ring = np.column_stack([np.cos(2 * np.pi * a / n), np.sin(2 * np.pi * a / n)])
    points = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (0.0, 1.0)])
    tube = sh.TriangleMesh(points, np.concatenate([np.stack([a, b, b + n], 1), np.stack([a, b + n, a + n], 1)]))
    wall = sh.morphology.thicken(tube, 0.1, resolution=48)
    assert_closed_manifold(wall)
    np.testing.assert_allclose(wall.bounds[:, 2], [0, 1], atol=1e-3)
    low = wall.vertices[wall.vertices[:, 2] < 1e-3]
    assert np.ptp(np.hypot(*low[:, :2].T)) == pytest.approx(0.2, abs=0.01)
    assert enclosed_volume(wall) == pytest.approx(np.pi * (1.1**2 - 0.9**2), rel=3e-3)  # facets: 1 − sin(x) / x


def test_hollowing_twice_changes_nothing():
    once = sh.morphology.shell(BALL, -0.2, 0.0, resolution=32, keep_outside=True)
    with pytest.warns(sh.errors.InexactWarning, match="not hollowed"):
        twice = sh.morphology.shell(once, -0.2, 0.0, resolution=32, keep_outside=True)
    assert enclosed_volume(twice) == pytest.approx(enclosed_volume(once), rel=1e-9)


def test_the_inner_shell_of_a_sliced_file_is_a_cavity_with_a_wall():
    both = samples.union(BALL, samples.sphere(4, radius=0.5))
    for nested, volume in (("cavities", 1 - 0.9**3 + 0.6**3 - 0.5**3), ("given", 1 - 0.9**3)):
        solid = sh.complete(both, nested=nested)
        wall = sh.morphology.shell(solid, -0.1, 0.0, resolution=36, keep_outside=True)
        assert enclosed_volume(wall) == pytest.approx(4 / 3 * np.pi * volume, rel=0.02)


def test_thickening_beyond_memory_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "_free", lambda: 100_000_000)
    with pytest.raises(sh.errors.MemoryLimitError) as caught:
        sh.morphology.thicken(waved_sheet(), 0.1, resolution=400)
    assert caught.value.remedy


def test_thickening_evenly_does_not_ask_which_side_is_which():
    sheet = waved_sheet()
    flipped = samples.with_flipped_faces(sheet, 0.5)
    np.testing.assert_allclose(
        sh.morphology.thicken(sheet, 0.1, resolution=48).vertices,
        sh.morphology.thicken(flipped, 0.1, resolution=48).vertices,
        atol=1e-9,
    )


def test_a_shell_lies_between_two_offsets():
    wall = sh.morphology.shell(BALL, 0.0, 0.2, resolution=64)
    assert_closed_manifold(wall)
    assert enclosed_volume(wall) == pytest.approx(4 / 3 * np.pi * (1.2**3 - 1), rel=0.01)
    assert radii(wall).min() == pytest.approx(1.0, abs=0.005)
    assert radii(wall).max() == pytest.approx(1.2, abs=0.005)


def test_a_disk_on_a_plane_grows():
    n = 40
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([i, i + n + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + 1], 1)])
    mesh = sh.TriangleMesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)
    circles = mesh.level_set(np.hypot(x, y).ravel(), 0.4)
    for operation, radius in [
        (sh.morphology.dilate, 0.6),
        (sh.morphology.erode, 0.2),
        (sh.morphology.closing, 0.4),
        (sh.morphology.opening, 0.4),
    ]:
        (grown,) = operation(circles, 0.2, mesh)
        assert grown.closed
        positions = np.einsum("ij,ijk->ik", grown.barycentric, mesh.vertices[mesh.faces[grown.faces]])
        np.testing.assert_allclose(np.linalg.norm(positions, axis=1), radius, atol=0.02)


@pytest.mark.parametrize(
    ("call", "kind", "element"),
    [
        (lambda: sh.morphology.dilate(BALL, -0.1), sh.errors.SignedHeatError, "distance"),
        (lambda: sh.morphology.dilate(BALL, np.nan), sh.errors.SignedHeatError, "distance"),
        (lambda: sh.morphology.erode(BALL, 2.0, resolution=32), sh.errors.OutsideError, "level -2"),
        (lambda: sh.morphology.shell(BALL, 0.2, 0.1), sh.errors.SignedHeatError, None),
        (lambda: sh.morphology.shell(BALL, 0.0, 0.001, resolution=32), sh.errors.SignedHeatError, None),
        (
            lambda: sh.morphology.thicken(samples.oriented_points(BALL, 50), 0.1, resolution=32),
            sh.errors.SignedHeatError,
            None,
        ),
        (lambda: sh.morphology.thicken(waved_sheet(), 0.0), sh.errors.SignedHeatError, None),
    ],
)
def test_bad_input_is_named(call, kind, element):
    with refused(kind, element):
        call()


def test_the_command_writes_a_closed_surface(tmp_path, capsys):
    source, target = tmp_path / "ball.stl", tmp_path / "out.stl"
    sh.save(BALL, source)
    assert main(["morph", "shell", str(source), "-0.2", "0.1", "-o", str(target), "--resolution", "40"]) == 0
    assert_closed_manifold(sh.read(target))
    assert main(["morph", "shell", str(source), "0.1", "-o", str(target)]) == 2
    assert main(["morph", "erode", str(source), "3", "-o", str(target), "--resolution", "32"]) == 1
    assert str(source) in capsys.readouterr().err


def moved(mesh, turn):
    return sh.TriangleMesh(mesh.vertices @ turn.T, mesh.faces)


def turned_box(lower=(-1.0, -0.7, -0.2), upper=(1.0, 0.6, 0.3), seed=3):
    turn = scipy.spatial.transform.Rotation.random(random_state=seed).as_matrix()
    return moved(box(lower, upper), turn)


def wedge(degrees, length=1.0):
    """A prism on a triangle with an angle at the origin."""
    half = np.deg2rad(degrees) / 2
    flat = np.array([[0, 0], [-np.cos(half), np.sin(half)], [-np.cos(half), -np.sin(half)]])
    points = np.concatenate([np.column_stack([flat, np.full(3, z)]) for z in (0.0, length)])
    faces = [[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    return sh.TriangleMesh(points, faces)


def test_mitred_boxes_stay_boxes():
    shape = turned_box()
    for corners in ("mitre", "sharp"):
        for distance in (0.1, -0.1):
            made = sh.offset(shape, distance, corners=corners, resolution=32)
            assert_closed_manifold(made)
            assert not len(self_intersections(made.vertices, made.faces))
            assert enclosed_volume(made) == pytest.approx(np.prod(np.array([2.0, 1.3, 0.5]) + 2 * distance), rel=1e-3)
    a, b, c, d = 2.0, 1.3, 0.5, 0.1
    steiner = a * b * c + 2 * d * (a * b + b * c + c * a) + np.pi * d**2 * (a + b + c) + 4 / 3 * np.pi * d**3
    assert enclosed_volume(sh.offset(shape, 0.1, resolution=32)) == pytest.approx(steiner, rel=3e-3)


@pytest.mark.parametrize(
    ("corners", "degrees", "tip"), [("mitre", 90, 2**0.5), ("mitre", 30, 2.0), ("sharp", 30, 3.8637)]
)
def test_tips_reach_where_planes_meet_or_as_far_as_they_may(corners, degrees, tip):
    made = sh.offset(wedge(degrees), 0.1, corners=corners, spacing=0.03)
    middle = made.vertices[np.abs(made.vertices[:, 2] - 0.5) < 0.3]
    assert middle[:, 0].max() == pytest.approx(0.1 * tip, abs=2e-3)


def test_reflex_edges_are_mitred_inside():
    """An inner offset of an L is an L."""
    flat = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    triangles = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    points = np.concatenate([np.column_stack([flat, np.full(6, z)]) for z in (0.0, 1.0)])
    i, j = np.arange(6), np.roll(np.arange(6), -1)
    faces = np.concatenate(
        [triangles[:, ::-1], triangles + 6, np.stack([i, j, j + 6], 1), np.stack([i, j + 6, i + 6], 1)]
    )
    turn = scipy.spatial.transform.Rotation.random(random_state=5).as_matrix()
    made = sh.offset(moved(sh.TriangleMesh(points, faces), turn), -0.2, corners="mitre", resolution=64)
    assert_closed_manifold(made)
    assert enclosed_volume(made) == pytest.approx(0.6 * (1.6 * 0.6 + 1.0 * 0.6), rel=2e-3)


def test_distances_may_vary():
    slope = sh.offset(BALL, lambda points: 0.2 + 0.1 * points[:, 2], resolution=24)
    same = sh.offset(BALL, 0.2 + 0.1 * BALL.vertices[:, 2], resolution=24)
    for made in (slope, same):
        assert_closed_manifold(made)
        assert not len(self_intersections(made.vertices, made.faces))
        lengths = radii(made)
        np.testing.assert_allclose(lengths, 1.2 + 0.1 * made.vertices[:, 2] / lengths, atol=3e-3)
    inwards = sh.offset(BALL, 0.2 * BALL.vertices[:, 2], resolution=32)  # outside above, inside below
    lengths = radii(inwards)
    np.testing.assert_allclose(lengths, 1 + 0.2 * inwards.vertices[:, 2] / lengths, atol=3e-3)


@pytest.mark.parametrize("distances", [lambda points: np.full(len(points), "a"), lambda points: None, lambda points: 1])
def test_functions_return_a_number_for_each_point(distances):
    with pytest.raises(sh.SignedHeatError) as caught:
        sh.offset(BALL, distances, resolution=24)
    assert caught.value.element == "distance"


def test_offsets_do_not_depend_on_scale():
    volumes = []
    for scale in (1e-6, 1.0, 1e6):
        shape = moved(turned_box(), scale * np.eye(3))
        volumes.append(enclosed_volume(sh.offset(shape, 0.1 * scale, corners="mitre", resolution=30)) / scale**3)
    np.testing.assert_allclose(volumes, 2.2 * 1.5 * 0.7, rtol=3e-3)  # some edges are cut off at so few nodes
    np.testing.assert_allclose(volumes, volumes[1], rtol=4e-4)  # where they are cut off depends on rounding


def test_a_wall_may_keep_the_faces_outside_and_have_a_drain():
    shape = turned_box((-1.0, -0.7, -0.5), (1.0, 0.6, 0.3))
    wall = sh.morphology.shell(shape, -0.1, 0.0, resolution=48, keep_outside=True)
    assert_closed_manifold(wall)
    given = {tuple(corner) for corner in shape.vertices}
    assert given <= {tuple(corner) for corner in wall.vertices}
    whole = 2 * 1.3 * 0.8 - 1.8 * 1.1 * 0.6
    assert enclosed_volume(wall) == pytest.approx(whole, rel=1e-3)
    level = box((-1.0, -0.7, -0.5), (1.0, 0.6, 0.3))
    for keep in (True, False):
        drained = sh.morphology.shell(level, -0.1, 0.0, resolution=48, keep_outside=keep, drain=0.2)
        assert_closed_manifold(drained)
        assert drained.to_trimesh().euler_number == 2  # outside and inside are one surface now
        assert enclosed_volume(drained) == pytest.approx(whole - np.pi * 0.1**2 * 0.1, rel=1e-4 if keep else 6e-3)


@pytest.mark.parametrize("keep", [True, False])
def test_walls_have_no_sealed_crumbs(keep):
    """A small ball on a stick is thicker than two walls, but only a little, and would have a cavity of its own."""
    head = samples.union(
        samples.sphere(4), box((0.9, -0.1, -0.1), (1.5, 0.1, 0.1)), samples.sphere(3, 0.27, (1.6, 0, 0))
    )
    assert sh.offset(head, -0.2, resolution=72).to_trimesh().body_count == 2
    wall = sh.morphology.shell(head, -0.2, 0.0, resolution=72, keep_outside=keep)
    assert wall.to_trimesh().body_count == 2


@pytest.mark.parametrize(("inner", "outer"), [(-0.2, 0.0), (-0.25, -0.05)])
@pytest.mark.parametrize("resolution", [40, 64])
def test_walls_of_shells_have_edges(inner, outer, resolution):
    """The wall between two boxes is as sharp as both, also where it is hardly thicker than a cell."""
    wall = sh.morphology.shell(box((0.0, 0.0, 0.0), (2.0, 3.0, 4.0)), inner, outer, resolution=resolution)
    assert_closed_manifold(wall)
    assert not len(self_intersections(wall.vertices, wall.faces))
    sizes = np.array([2.0, 3.0, 4.0])
    exact = np.prod(sizes + 2 * outer) - np.prod(sizes + 2 * inner)
    assert enclosed_volume(wall) == pytest.approx(exact, rel=1e-3)


def test_a_shell_that_the_grid_cuts_is_closed_there():
    """Of a box that reaches below the grid only the upper half is made, and its wall is closed at the bottom."""
    grid = sh.Grid((-0.5, -0.5, 2.0), 0.1, (31, 41, 31))
    wall = sh.morphology.shell(box((0.0, 0.0, 0.0), (2.0, 3.0, 4.0)), -0.3, 0.0, grid)
    assert_closed_manifold(wall)
    outward = wall.face_area_vectors[:, 2] / wall.face_areas
    middles = wall.vertices[wall.faces].mean(axis=1)
    bottom = (outward < -0.99) & (middles[:, 2] < 2.1)
    assert wall.face_areas[bottom].sum() == pytest.approx(2.0 * 3.0 - 1.4 * 2.4, rel=0.05)
    assert not (np.abs(middles[bottom, :2] - [1.0, 1.5]) < [0.6, 1.1]).all(axis=1).any()
