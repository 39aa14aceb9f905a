"""Digital surfaces: surfels, corrected normals, and distance that converges because of them."""

import contextlib

import numpy as np
import pytest
import scipy

import signedheat as sh
from refusals import refused
from shapes import domain_cases as cases
from shapes.grid_cases import assert_closed_manifold
from signedheat.discretization import discretize
from signedheat.mesh.self_intersections import self_intersections
from signedheat.mesh.triangles import area_vectors
from signedheat.mesh.unit_vectors import unit
from signedheat.solids.completion import complete
from signedheat.surfaces.digital_surface import boundary_surfels

AXIS = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])


def ball_surface(n, radius=None):
    return sh.DigitalSurface(*cases.ball(n), radius=radius)


def latitude(surface):
    unit = surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True)
    return np.arcsin(np.clip(unit @ AXIS, -1, 1)) - np.arcsin(0.3)


def error_on_a_ball(n, radius=None):
    surface = ball_surface(n, radius)
    exact = latitude(surface)
    return cases.error(sh.SignedHeatSolver(surface).distance(surface.level_set(exact)).values, exact)


def test_surfels_of_random_voxels_are_closed_and_point_out():
    volume = np.random.default_rng(0).random((6, 7, 5)) < 0.5
    found = boundary_surfels(volume)
    padded = np.pad(volume, 1)
    changes = sum(np.count_nonzero(np.diff(padded, axis=axis)) for axis in range(3))
    assert len(found.corners) == changes
    corner = found.vertices[found.corners]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 3] - corner[:, 0])
    assert (area[np.arange(len(area)), found.axes] == found.signs).all()
    assert (area.sum(axis=0) == 0).all()
    outward = ((corner.mean(axis=1) - (found.voxels + 0.5)) * area).sum(axis=1)
    assert (outward == 0.5).all()
    volume_by_flux = (corner.mean(axis=1) * area).sum() / 3
    assert volume_by_flux == pytest.approx(volume.sum(), rel=1e-12)


def test_corrected_normals_converge_to_those_of_the_ball():
    mean_angles = []
    for n in (16, 32, 64):
        surface = ball_surface(n)
        centers = surface.squares.polygon_centroids
        cosine = (surface.normals * centers).sum(axis=1) / np.linalg.norm(centers, axis=1)
        mean_angles.append(np.arccos(np.clip(cosine, -1, 1)).mean())
    assert mean_angles[-1] < np.radians(2)
    assert cases.fitted_order([1 / 16, 1 / 32, 1 / 64], mean_angles) > 0.8


def test_corrected_normals_see_slopes_between_the_axes_and_unequal_voxels():
    spacing = np.array([0.5, 1.0, 0.25])
    normal = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    position = np.stack(np.indices((60, 40, 100)), axis=-1) * spacing - [15, 20, 12]
    surface = sh.DigitalSurface(position @ normal < 0, spacing, radius=4.0)
    centers = surface.squares.polygon_centroids - [15, 20, 12]
    inner = (np.abs(centers) < 3).all(axis=1)
    assert inner.sum() > 100
    assert np.degrees(np.arccos(surface.normals[inner] @ normal)).max() < 2


def test_flattened_area_is_that_of_the_ball_and_raw_area_is_not():
    corrected = discretize(ball_surface(48)).triangles.face_areas.sum()
    raw = discretize(ball_surface(48, radius=0)).triangles.face_areas.sum()
    assert corrected == pytest.approx(4 * np.pi, rel=0.01)
    assert raw == pytest.approx(6 * np.pi, rel=0.03)


def test_given_normals_are_seen_in_the_corrected_planes():
    surface = ball_surface(32)
    exact = latitude(surface)
    (curve,) = surface.level_set(exact)
    corners = surface.triangulation.vertices[surface.triangulation.faces[curve.faces]]
    along = np.einsum("pk,pkd->pd", curve.barycentric, corners)
    middle = 0.5 * (along + np.roll(along, -1, axis=0))
    north = AXIS - (middle @ AXIS / (middle**2).sum(axis=1))[:, None] * middle
    given = sh.Curve(curve.faces, curve.barycentric, closed=True, normals=north)
    solver = sh.SignedHeatSolver(surface)
    errors = [cases.error(solver.distance(c, sh.constraints.Free()).values, exact) for c in (curve, given)]
    assert errors[1] < 1.1 * errors[0]  # four times as large if normals are seen in the planes of voxel faces


def test_distance_converges_with_corrected_normals_and_not_without():
    sizes = [1 / 12, 1 / 24, 1 / 48]
    corrected = [error_on_a_ball(n) for n in (12, 24, 48)]
    raw = [error_on_a_ball(n, radius=0) for n in (12, 24, 48)]
    assert cases.fitted_order(sizes, corrected) > 1.2
    assert corrected[-1] < 1e-3
    assert cases.fitted_order(sizes, raw) < 0.2
    assert raw[-1] > 0.03


def test_along_a_box_the_raw_faces_are_exact():
    surface = sh.DigitalSurface(np.ones((20, 12, 6)), spacing=0.5, radius=0)
    belt = surface.level_set(surface.vertices[:, 0], 3.11)
    phi = sh.SignedHeatSolver(surface).distance(belt).values
    sides = (surface.vertices[:, 0] > 1.5) & (surface.vertices[:, 0] < 8)  # heat from behind the ends blurs the rest
    assert phi[sides] == pytest.approx(surface.vertices[sides, 0] - 3.11, abs=0.05)


def test_polylines_in_space_are_laid_on_the_surface():
    surface = ball_surface(24)
    equator = cases.parallel(200, 0.0)
    turn = np.linalg.svd(AXIS[None])[2]
    frame = np.stack([turn[1], np.cross(AXIS, turn[1]), AXIS])
    phi = (
        sh.SignedHeatSolver(surface)
        .distance(surface.polyline(equator @ frame, closed=True), sh.constraints.Free())
        .values
    )
    assert cases.error(phi, latitude(surface) + np.arcsin(0.3)) < 0.02


def touching(offset):
    volume = np.zeros((12, 12, 12), dtype=bool)
    volume[1:6, 1:6, 1:6] = True
    start = np.array([6, 6, 6]) - (1 - np.array(offset)) * 5
    volume[tuple(slice(s, s + 5) for s in start)] = True
    return volume


@pytest.mark.parametrize("offset", [(1, 1, 0), (0, 1, 1), (1, 0, 1)])
def test_voxels_that_touch_along_an_edge_are_connected(offset):
    surface = sh.DigitalSurface(touching(offset), radius=1.5)
    assert (surface.triangulation.edges.face_counts == 4).sum() == 5
    triangles = discretize(surface).triangles
    assert (triangles.edges.face_counts == 2).all()
    assert triangles.is_consistently_oriented
    tail = np.where(triangles.edges.forward, triangles.corner_vertices, np.roll(triangles.corner_vertices, -1, axis=1))
    assert (tail == triangles.edges.vertices[triangles.edges.face_edges, 0]).all()

    axis = int(np.argmax(offset))  # a belt round the first box: distance goes on over the second
    phi = sh.SignedHeatSolver(surface).distance(surface.level_set(surface.vertices[:, axis], 3.0))
    far = surface.vertices @ np.array(offset) > 17
    assert np.isfinite(phi.values).all()
    assert phi.values[far].min() > 1 and phi.values[far].mean() > 5
    assert sh.sharpen(phi).values[far].min() > 7  # along the shortest way, through the edge where the boxes touch


@pytest.mark.parametrize("offset", [(1, 1, 1), (1, 0, 1)])
def test_heat_passes_where_voxels_touch_along_an_edge_and_not_at_a_corner(offset):
    """A corner has no width for heat to pass; on both sides of it lie surfaces of their own, which share a vertex."""
    surface = sh.DigitalSurface(touching(offset), radius=1.5)
    belt = surface.polyline([[1, 0.5, 1.3], [3, 0.5, 1.3], [5, 0.5, 1.3]])
    at_corner = offset == (1, 1, 1)
    with pytest.warns(sh.errors.UnreachedWarning) if at_corner else contextlib.nullcontext():
        phi = sh.SignedHeatSolver(surface).distance(belt).values
    second = (surface.vertices > 5.4).all(axis=1) if at_corner else np.zeros(len(phi), dtype=bool)
    shared = (surface.vertices == 5.5).all(axis=1)
    assert shared.sum() == 1
    assert np.array_equal(np.isnan(phi), second & ~shared)


def test_voxels_at_random_work():
    volume = np.random.default_rng(4).random((9, 9, 9)) < 0.5
    surface = sh.DigitalSurface(volume, radius=2.0)
    start = surface.path(surface.squares.corners[:2])
    with np.errstate(all="raise"):
        normals = surface.normals
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)
    try:
        phi = sh.SignedHeatSolver(surface).distance(start).values
    except sh.errors.UnreachedWarning:  # warnings are errors here; parts apart from the source are NaN
        with pytest.warns(sh.errors.UnreachedWarning):
            phi = sh.SignedHeatSolver(surface).distance(start).values
    assert np.isfinite(phi).sum() > 100


def test_two_balls_apart_only_reach_one():
    volume = np.zeros((24, 12, 12), dtype=bool)
    small = np.linalg.norm(np.indices((12, 12, 12)) - 5.5, axis=0) < 4
    volume[:12], volume[12:] = small, small
    surface = sh.DigitalSurface(volume)
    curve = surface.polyline([[5.5, 1.4, 5.5], [5.5, 5.5, 9.6], [5.5, 9.6, 5.5]])
    with pytest.warns(sh.errors.UnreachedWarning):
        phi = sh.SignedHeatSolver(surface).distance(curve).values
    assert np.array_equal(np.isnan(phi), surface.vertices[:, 0] > 11.5)


def test_spacing_and_origin_scale_and_move():
    volume, _, _ = cases.ball(14)
    one = sh.DigitalSurface(volume)
    other = sh.DigitalSurface(volume, spacing=2.5, origin=(1, 2, 3))
    assert other.vertices == pytest.approx(one.vertices * 2.5 + [1, 2, 3])
    fields = [sh.SignedHeatSolver(s).distance(s.level_set(one.vertices[:, 2], 6.2)).values for s in (one, other)]
    assert fields[1] == pytest.approx(2.5 * fields[0], rel=1e-9)


def test_volumes_come_from_files(tmp_path):
    volume, spacing, origin = cases.ball(8)
    grid = sh.Grid(origin, spacing, volume.shape)
    np.save(tmp_path / "plain.npy", volume)
    plain = sh.read(tmp_path / "plain.npy")
    assert (plain.volume == volume).all() and (plain.spacing == 1).all() and (plain.origin == 0).all()
    for name in ("image.nrrd", "image.vti", "image.npy"):
        sh.Field(grid, volume.astype(float)).save(tmp_path / name)
        surface = sh.read(tmp_path / name)
        assert (surface.volume == volume).all()
        assert surface.spacing == pytest.approx([spacing] * 3) and surface.origin == pytest.approx(origin)


@pytest.mark.parametrize(
    ("arguments", "element"),
    [
        ({"volume": np.ones((3, 3))}, "volume"),
        ({"volume": np.zeros((3, 3, 3))}, "volume"),
        ({"volume": np.full((3, 3, 3), 0.3)}, None),
        ({"volume": np.ones((3, 3, 3)), "spacing": 0.0}, "spacing"),
        ({"volume": np.ones((3, 3, 3)), "spacing": (1, 2)}, "spacing"),
        ({"volume": np.ones((3, 3, 3)), "origin": (0, np.nan, 0)}, "origin"),
        ({"volume": np.ones((3, 3, 3)), "radius": -1.0}, "radius"),
        ({"volume": np.empty((0, 3, 3), dtype=bool)}, "volume"),
    ],
)
def test_what_is_no_volume_is_refused(arguments, element):
    with refused(sh.errors.GeometryError, element):
        sh.DigitalSurface(**arguments)


def masks():
    ball = np.linalg.norm(np.moveaxis(np.indices((31, 31, 31)), 0, -1) - [14.8, 15.3, 15.1], axis=-1) < 12.3
    yield pytest.param(ball, id="ball")
    yield pytest.param(np.ones((1, 1, 1), dtype=bool), id="one voxel")
    yield pytest.param(np.indices((3, 3, 3)).sum(axis=0) % 2 == 0, id="chequered")
    noise = np.random.default_rng(0).random((2, 12, 9, 11))
    yield pytest.param(noise[0] < 0.4, id="noise")
    smooth = scipy.ndimage.gaussian_filter(noise[1], 1.0)
    yield pytest.param(smooth < np.median(smooth), id="smooth noise")


@pytest.mark.parametrize("mask", list(masks()))
def test_smooth_surfaces_of_masks_are_closed_and_give_the_mask_back(mask, tmp_path):
    """Also after rounding to 32 bits, far from the origin, as STL writes it."""
    surface = sh.DigitalSurface(mask, 0.7, origin=(0.0, 50.0, -90.0)).smooth_surface
    assert_closed_manifold(surface)
    sh.io.save(surface, tmp_path / "mask.ply")
    read = sh.read(tmp_path / "mask.ply")
    assert_closed_manifold(read)
    assert not len(self_intersections(read.vertices, read.faces))
    centres = np.indices(np.array(mask.shape) + 2).reshape(3, -1).T - 1
    solid = complete(read, as_oriented=True)
    np.testing.assert_array_equal(solid.inside(0.7 * centres + [0.0, 50.0, -90.0]), np.pad(mask, 1).ravel())


@pytest.mark.parametrize(("kind", "most"), [("ball", 1.8), ("torus", 3.0)])
def test_smooth_surfaces_have_the_normals_of_what_was_digitised(kind, most):
    """Those of a mask blurred over a voxel, by marching cubes, are 3.6 to 4.4° off at this size, stairs 32°."""
    places = np.indices((48, 48, 48)).reshape(3, -1).T - np.array([23.4, 23.8, 23.1])

    def height(x):
        if kind == "ball":
            return np.linalg.norm(x, axis=1) - 20
        return np.hypot(np.hypot(x[:, 0], x[:, 1]) - 14, x[:, 2]) - 6

    surface = sh.DigitalSurface((height(places) < 0).reshape(48, 48, 48), origin=places[0]).smooth_surface
    corners = surface.vertices[surface.faces]
    middles, normals = corners.mean(axis=1), area_vectors(corners)
    step = 1e-4 * np.eye(3)
    slopes = np.stack([height(middles + each) - height(middles - each) for each in step], axis=1)
    cosines = (unit(normals) * unit(slopes)).sum(axis=1)
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    assert np.average(angles, weights=np.linalg.norm(normals, axis=1)) < most
    assert abs(np.average(height(middles), weights=np.linalg.norm(normals, axis=1))) < 0.05


def test_smooth_surfaces_of_boxes_lose_no_more_than_their_edges():
    mask = np.zeros((40, 30, 24), dtype=bool)
    mask[5:35, 5:25, 5:19] = True
    surface = sh.DigitalSurface(mask).smooth_surface
    corners = surface.vertices[surface.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(mask.sum(), rel=0.05)
    assert np.abs(surface.vertices - np.round(surface.vertices + 0.5) + 0.5).max() <= 0.5
