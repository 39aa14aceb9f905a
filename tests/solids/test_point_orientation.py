"""Points without normals, and loose triangles, face outwards."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.solids.gauss import Dipoles, Pieces, without_slender
from signedheat.solids.point_orientation import orient_points
from signedheat.surfaces.normal_orientation import outward_normals


def box(size, center=(0.0, 0.0, 0.0)):
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return sh.TriangleMesh(corners + np.array(center), faces)


def turned(mesh):
    return sh.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def contoured(values, extent, n=36):
    grid = sh.Grid(-np.array(extent), 2 * max(extent) / n, np.ceil(np.array(extent) / max(extent) * n).astype(int) + 1)
    return sh.Field(grid, values(grid.points)).contour(0.0)


def holed_plate():
    """Genus two."""

    def values(x):
        walls = np.abs(x) - np.array([1.2, 0.7, 0.2])
        rounded = np.linalg.norm(np.maximum(walls, 0), axis=-1) + np.minimum(walls.max(axis=-1), 0) - 0.1
        holes = [0.35 - np.hypot(x[..., 0] - side, x[..., 1]) for side in (-0.6, 0.6)]
        return np.maximum(rounded, np.maximum(*holes))

    return contoured(values, (1.5, 1.0, 0.5))


def shells():
    """A ball in the cavity of a shell."""
    return samples.union(samples.sphere(3), turned(samples.sphere(3, 0.8)), samples.sphere(2, 0.4))


SHAPES = {
    "sphere": samples.sphere,
    "torus": lambda: samples.torus(n_around=64, n_across=32),
    "genus two": holed_plate,
    "box": lambda: box((2, 1, 0.7)),
    "two bodies": lambda: samples.union(samples.sphere(), box((1, 1, 1), (1.8, 0, 0))),
    "shells": shells,
}


def share_right(cloud, normals):
    return float(((cloud.normals * normals).sum(axis=1) > 0).mean())


@pytest.mark.parametrize("name", SHAPES)
def test_clean_points_face_outwards(name):
    truth = samples.oriented_points(SHAPES[name](), 3000)
    cloud, _ = orient_points(sh.PointCloud(truth.points))
    _, fits, decision = outward_normals(truth.points)
    assert decision.sided and not fits.noisy
    assert share_right(cloud, truth.normals) > 0.99
    assert np.median(np.abs((cloud.normals * truth.normals).sum(axis=1))) > np.cos(np.radians(8))


def test_points_of_a_plate_face_outwards_whatever_their_draw():
    """Three times as thick as points are apart: of 24 draws 23 are right at .99 of the points, one at .976."""
    plate, shares = box((1, 1, 0.104)), []
    for seed in range(6):
        truth = samples.oriented_points(plate, 2000, seed=seed)
        shares.append(share_right(orient_points(sh.PointCloud(truth.points))[0], truth.normals))
    assert min(shares) > 0.95 and np.median(shares) > 0.99


@pytest.mark.parametrize("name", SHAPES)
def test_noisy_points_face_outwards(name):
    truth = samples.oriented_points(SHAPES[name](), 3000)
    diagonal = float(np.linalg.norm(np.ptp(truth.points, axis=0)))
    noise = np.random.default_rng(1).normal(scale=0.005 * diagonal, size=truth.points.shape)
    cloud, _ = orient_points(sh.PointCloud(truth.points + noise))
    assert outward_normals(cloud.points)[1].noisy
    assert share_right(cloud, truth.normals) > 0.99


def test_holes_and_uneven_sampling_do_no_harm():
    truth = samples.oriented_points(holed_plate(), 12_000)
    rng = np.random.default_rng(0)
    keep = rng.random(truth.n_points) < 0.1 + 0.9 * (truth.points[:, 0] + 1.3) / 2.6
    for center in truth.points[rng.choice(truth.n_points, 5)]:
        keep &= np.linalg.norm(truth.points - center, axis=1) > 0.25
    cloud, _ = orient_points(sh.PointCloud(truth.points[keep]))
    assert share_right(cloud, truth.normals[keep]) > 0.99


def test_half_a_torus_faces_outwards():
    truth = samples.oriented_points(samples.torus(), 4000)
    keep = truth.points[:, 0] > 0
    cloud, _ = orient_points(sh.PointCloud(truth.points[keep]))
    assert share_right(cloud, truth.normals[keep]) > 0.99


def test_signs_follow_a_rigid_motion_and_a_scale():
    truth = samples.oriented_points(holed_plate(), 4000)
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    moved = sh.PointCloud(1e3 * truth.points @ rotation.T + 1e4)
    here, there = orient_points(sh.PointCloud(truth.points))[0], orient_points(moved)[0]
    agree = ((here.normals @ rotation.T) * there.normals).sum(axis=1)
    assert (agree > 0.999).mean() > 0.995


def test_the_same_points_give_the_same_bits():
    points = samples.oriented_points(samples.torus(), 3000).points
    first, second = (orient_points(sh.PointCloud(points))[0].normals for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_points_given_twice_share_a_normal():
    points = samples.oriented_points(samples.sphere(), 1500).points
    cloud = orient_points(sh.PointCloud(np.concatenate([points, points])))[0]
    np.testing.assert_array_equal(cloud.normals[:1500], cloud.normals[1500:])
    assert ((cloud.normals * cloud.points).sum(axis=1) > 0).all()


@pytest.mark.parametrize("wrong", [0.0, 0.5, 1.0])
def test_normals_given_are_turned_where_they_are_wrong(wrong):
    truth = samples.oriented_points(samples.torus(), 4000)
    flip = np.random.default_rng(0).random(truth.n_points) < wrong
    cloud, note = orient_points(sh.PointCloud(truth.points, np.where(flip[:, None], -truth.normals, truth.normals)))
    assert share_right(cloud, truth.normals) > 0.995
    assert abs(note.normals_turned - flip.sum()) <= 0.005 * truth.n_points
    assert note.normals_fitted == 0


def test_points_in_a_plane_face_one_way_and_say_so():
    rng = np.random.default_rng(0)
    cloud, _ = orient_points(sh.PointCloud(np.c_[rng.random((500, 2)), np.zeros(500)]))
    assert not outward_normals(cloud.points)[2].sided
    np.testing.assert_allclose(cloud.normals, np.tile(cloud.normals[0], (500, 1)), atol=1e-6)


@pytest.mark.parametrize(
    "points",
    [
        np.c_[np.arange(50.0), np.zeros((50, 2))],  # along a line
        np.eye(4, 3),
        np.random.default_rng(0).random((7, 3)),
        np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3),  # no surface at all
        np.concatenate([np.zeros((1, 3)), np.random.default_rng(0).random((400, 3)) * 1e-6, np.ones((1, 3))]),
    ],
)
def test_awkward_points_get_unit_normals(points):
    normals = orient_points(sh.PointCloud(points))[0].normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_too_few_points_and_points_in_the_plane_are_refused():
    with refused(sh.errors.GeometryError, "points"):
        orient_points(sh.PointCloud([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]))
    with refused(sh.errors.GeometryError, "points"):
        orient_points(sh.PointCloud(np.random.default_rng(0).random((9, 2))))


def orient_triangles(corners):
    """Signs of loose triangles by Gauss's formula."""
    return np.where(
        Dipoles.of_triangles(Pieces(corners, np.arange(len(corners)))).weights(np.zeros(len(corners), dtype=bool)) >= 0,
        1.0,
        -1.0,
    )


@pytest.mark.parametrize(
    ("name", "wrong"), [("torus", 0.1), ("torus", 0.5), ("torus", 1.0), ("genus two", 0.5), ("shells", 0.5)]
)
def test_loose_triangles_face_outwards(name, wrong):
    mesh = SHAPES[name]()
    corners = samples.soup(mesh, 0.002).vertices.reshape(-1, 3, 3).copy()
    flip = np.random.default_rng(0).random(len(corners)) < wrong
    corners[flip] = corners[flip, ::-1]
    right = (orient_triangles(corners) > 0) != flip
    areas = mesh.face_areas
    assert (areas * right).sum() > 0.995 * areas.sum()


def test_large_triangles_are_sampled():
    mesh = box((1, 2, 3))
    corners = mesh.vertices[mesh.faces].copy()
    corners[::2] = corners[::2, ::-1]
    np.testing.assert_array_equal(orient_triangles(corners), np.where(np.arange(12) % 2, 1.0, -1.0))


def test_triangles_without_area_keep_their_order():
    corners = np.concatenate([samples.sphere(2).vertices[samples.sphere(2).faces], np.zeros((2, 3, 3))])
    np.testing.assert_array_equal(orient_triangles(corners), np.ones(len(corners)))
    np.testing.assert_array_equal(orient_triangles(np.zeros((5, 3, 3))), np.ones(5))


@pytest.mark.parametrize("move", [0.0, 1e3])
def test_only_slender_triangles_with_an_area_are_halved(move):
    """Ten thousand triangles of one line took half a minute: each became 64 dipoles."""
    random = np.random.default_rng(0)
    collinear = random.random((300, 3, 1)) * [1.0, 2.0, 3.0] + move
    strip = np.array([[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 1.0, 0.0]]]) + move
    pieces = without_slender(Pieces(np.concatenate([collinear, strip]), np.arange(301)))
    assert (np.bincount(pieces.labels)[:300] == 1).all()
    assert np.bincount(pieces.labels)[300] >= 16


def test_a_system_of_some_pieces_is_near_that_made_of_them_alone():
    corners = samples.soup(samples.torus(), 0.002).vertices.reshape(-1, 3, 3)
    kept = np.random.default_rng(1).random(len(corners)) < 0.9
    none = np.zeros(kept.sum(), dtype=bool)
    restricted = Dipoles.of_triangles(Pieces(corners, np.arange(len(corners)))).chosen(kept).weights(none)
    alone = Dipoles.of_triangles(Pieces(corners[kept], np.arange(kept.sum()))).weights(none)
    assert (restricted > 0).all()
    assert np.abs(restricted - alone).mean() < 0.1


def test_distance_to_points_without_normals_is_that_with_them():
    truth = samples.oriented_points(samples.torus(), 5000)
    grid = sh.Grid.around(truth.bounds, resolution=40)
    x = grid.points
    exact = np.hypot(np.hypot(x[..., 0], x[..., 1]) - 1, x[..., 2]) - 0.4
    errors = [
        float(np.sqrt(np.mean((sh.SignedHeatSolver(grid).distance(cloud).values - exact) ** 2)))
        for cloud in (truth, orient_points(sh.PointCloud(truth.points))[0])
    ]
    assert errors[1] < 1.15 * errors[0]


def test_few_points_keep_the_normals_that_they_are_given():
    """Where a thin part's other side is as near as the next point, those that gave normals know better."""
    assert orient_points(samples.oriented_points(samples.duck(40), 200))[1].normals_turned == 0
    assert orient_points(samples.oriented_points(samples.torus(1.0, 0.12), 300, seed=1))[1].normals_turned == 0


def test_far_between_points_nothing_is_missing():
    """300 points on a ball, ten cells apart: its inside is solid, and it was taken for sheets."""
    cloud = samples.oriented_points(samples.sphere(5), 300)
    field = sh.signed_distance(cloud, resolution=96)
    truth = np.linalg.norm(field.domain.points, axis=-1) - 1.0
    assert np.sqrt(np.mean((field.values - truth) ** 2)) < 0.02
    assert field.diagnostics.note(sh.diagnostics.BoundsNothing) is None
