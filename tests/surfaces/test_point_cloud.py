"""Point clouds as a domain: local triangulations, and distance on them."""

import warnings

import numpy as np
import pytest
from scipy.spatial import Delaunay

import signedheat as sh
from refusals import refused
from shapes import domain_cases as cases
from signedheat.diagnostics import PointsLeftOut
from signedheat.fields.solutions import spread
from signedheat.samples import sphere
from signedheat.solids.point_orientation import orient_points
from signedheat.surfaces import point_cloud
from signedheat.surfaces.local_triangulations import hole_fillings, local_triangulations
from signedheat.surfaces.normal_orientation import neighbors_agree, spread_out


def sphere_with_circle(n, height=0.3, seed=0):
    """Points with a circle of points among them; the circle's ids; distance to it."""
    ring = cases.parallel(int(np.sqrt(n)), height)
    points = cases.sphere_points(n, seed)
    near = np.linalg.norm(points[:, None] - ring[None], axis=2).min(axis=1)
    points = np.concatenate([ring, points[near > 1.2 / np.sqrt(n)]])
    return points, np.arange(len(ring)), np.arcsin(points[:, 2]) - np.arcsin(height)


def cylinder_with_circle(n, seed=0):
    rng = np.random.default_rng(seed)
    angle, height = 2 * np.pi * rng.random(n), 4 * rng.random(n) - 2
    ring_angle = np.linspace(0, 2 * np.pi, int(0.8 * np.sqrt(n)), endpoint=False)
    keep = np.abs(height - 0.2) > 0.8 / np.sqrt(n)
    angle = np.concatenate([ring_angle, angle[keep]])
    height = np.concatenate([np.full(len(ring_angle), 0.2), height[keep]])
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=1)
    return points, np.arange(len(ring_angle)), height - 0.2


def plane_with_circle(n, seed=0):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, int(0.7 * np.sqrt(n)), endpoint=False)
    ring = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.column_stack([2 * rng.random((n, 2)) - 1, np.zeros(n)])
    keep = np.abs(np.linalg.norm(points, axis=1) - 0.5) > 0.8 / np.sqrt(n)
    points = np.concatenate([ring, points[keep]])
    return points, np.arange(len(ring)), 0.5 - np.linalg.norm(points, axis=1)


CASES = {"sphere": sphere_with_circle, "cylinder": cylinder_with_circle, "plane": plane_with_circle}


def outward(name, points):
    """(n, 3) unit normals: out of the sphere and the cylinder, up from the plane. `exact` is positive to the left."""
    normals = {"sphere": points, "cylinder": points * [1, 1, 0], "plane": points * 0 + [0, 0, 1]}[name]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def along_the_circle(cloud, ids, normals):
    """Distance to a closed path, positive to its left as seen from outside."""
    path = cloud.path(ids if (cloud.surface_normals * normals).sum() > 0 else ids[::-1], closed=True)
    return sh.SignedHeatSolver(cloud).distance(path).values


def test_in_the_plane_the_local_triangulations_are_the_delaunay_triangulation():
    points = np.random.default_rng(0).random((400, 2))
    found = local_triangulations(np.column_stack([points, np.zeros(400)]), np.tile([0.0, 0, 1], (400, 1))).faces
    inner = (np.abs(points - 0.5) < 0.35).all(axis=1)

    def well_inside(faces):
        return {tuple(sorted(f)) for f in faces.tolist() if inner[f].all()}

    assert well_inside(found) == well_inside(Delaunay(points).simplices)


@pytest.mark.parametrize("n", [200, 3000])
def test_a_sphere_of_points_becomes_a_closed_sphere(n):
    points = cases.sphere_points(n)
    mesh = sh.PointCloud(points).triangulation
    assert (mesh.edges.face_counts == 2).all()
    assert n - len(mesh.edges.vertices) + mesh.n_faces == 2
    outward = (mesh.face_area_vectors * points[mesh.faces].sum(axis=1)).sum(axis=1)
    assert (outward > 0).all()


def test_points_on_a_lattice_are_covered_once_however_ambiguous():
    points = np.stack(np.meshgrid(np.arange(12.0), np.arange(9.0), [0.0]), axis=-1).reshape(-1, 3)
    mesh = sh.PointCloud(points).triangulation
    assert mesh.n_faces == 2 * 11 * 8
    assert mesh.face_areas == pytest.approx(0.5)


def test_a_noisy_cloud_hardly_has_holes_and_no_edge_has_three_faces():
    points = cases.sphere_points(4000) + 0.006 * np.random.default_rng(1).normal(size=(4000, 3))
    counts = sh.PointCloud(points).triangulation.edges.face_counts
    assert counts.max() == 2
    assert (counts == 1).mean() < 0.005


def test_small_holes_are_filled_and_outer_boundaries_stay():
    vertices, polygons = cases.triangles(6)
    faces = np.array(polygons)
    hole = [30, 31]
    filled = hole_fillings(vertices, np.tile([0.0, 0, 1], (len(vertices), 1)), np.delete(faces, hole, axis=0))
    assert {tuple(sorted(f)) for f in filled.tolist()} == {tuple(sorted(f)) for f in faces[hole].tolist()} or (
        len(filled) == 2 and set(filled.ravel()) == set(faces[hole].ravel())
    )


@pytest.mark.parametrize("name", CASES)
def test_error_falls_and_is_below_the_peers(name):
    peers = pytest.importorskip("potpourri3d")
    errors, sizes = [], [400, 1000, 2500]
    for n in sizes:
        points, ids, exact = CASES[name](n)
        normals = outward(name, points)
        errors.append(cases.error(along_the_circle(sh.PointCloud(points), ids, normals), exact))
        solver = peers.PointCloudHeatSolver(points)
        peer = np.asarray(solver.compute_signed_distance([[*map(int, ids), int(ids[0])]], normals))
        assert errors[-1] < min(cases.error(peer, exact), cases.error(-peer, exact))
    assert cases.fitted_order([n**-0.5 for n in sizes], errors) > 0.9


def test_flipped_normals_change_nothing_when_the_curve_brings_its_own():
    points, ids, exact = sphere_with_circle(1500)
    north = np.cross(np.cross(points[ids], [0, 0, 1]), points[ids])
    fields = []
    for part in (0.0, 0.3, 0.7, 1.0):
        flips = np.where(np.random.default_rng(5).random(len(points)) < part, -1.0, 1.0)
        cloud = sh.PointCloud(points, points * flips[:, None])
        path = cloud.path(ids, closed=True)
        curve = sh.Curve(path.faces, path.barycentric, closed=True, normals=north)
        fields.append(sh.SignedHeatSolver(cloud).distance(curve).values)
    assert cases.error(fields[0], exact) < 2e-3
    for field in fields[1:]:
        assert field == pytest.approx(fields[0], abs=1e-9)


def test_some_flipped_normals_do_not_turn_the_side_of_a_curve():
    points, ids, exact = sphere_with_circle(1500)
    flips = np.where(np.random.default_rng(6).random(len(points)) < 0.3, -1.0, 1.0)
    for normals, sign in ((points, 1), (points * flips[:, None], 1), (None, 1), (-points, -1)):
        cloud = sh.PointCloud(points, normals)
        phi = sh.SignedHeatSolver(cloud).distance(cloud.path(ids, closed=True)).values
        assert cases.error(sign * phi, exact) < 2e-3


def test_polylines_and_paths_through_the_same_points_agree():
    points, ids, _ = sphere_with_circle(2000)
    cloud = sh.PointCloud(points)
    solver = sh.SignedHeatSolver(cloud)
    by_ids = solver.distance(cloud.path(ids, closed=True)).values
    by_points = solver.distance(cloud.polyline(points[ids], closed=True)).values
    assert by_points == pytest.approx(by_ids, abs=1e-6)
    between = solver.distance(cloud.polyline(cases.parallel(90, 0.1), closed=True), sh.constraints.Free()).values
    assert cases.error(between, np.arcsin(points[:, 2]) - np.arcsin(0.1)) < 4e-3


def test_the_boundary_of_an_open_cloud_does_not_bend_distance():
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.random((3000, 2)), np.zeros(3000)])
    cloud = sh.PointCloud(points, np.tile([0.0, 0, 1], (3000, 1)))
    curve = cloud.polyline([[0.02, 0.5, 0], [0.98, 0.5, 0]])
    phi = sh.SignedHeatSolver(cloud).distance(curve).values
    assert np.abs(phi - (points[:, 1] - 0.5)).max() < 0.02


def test_points_that_coincide_get_the_same_distance_as_without_them():
    points, ids, _ = sphere_with_circle(800)
    cloud = sh.PointCloud(points)
    phi = sh.SignedHeatSolver(cloud).distance(cloud.path(ids, closed=True)).values
    order = np.concatenate([np.arange(len(points)), np.repeat(np.arange(0, 200), 40)])
    double = sh.PointCloud(points[order])
    field = sh.SignedHeatSolver(double).distance(double.path(len(points) + 40 * ids[:5]))
    assert field.diagnostics.note(PointsLeftOut).duplicate_points == 8000
    again = sh.SignedHeatSolver(double).distance(double.path(ids, closed=True)).values
    assert again == pytest.approx(phi[order], abs=1e-9)


def test_outliers_get_no_distance_and_disturb_no_one():
    points, ids, exact = sphere_with_circle(1500)
    far = np.array([[3.0, 0, 0], [0, 2.5, 0], [0.1, 0, 0.1]])
    cloud = sh.PointCloud(np.concatenate([points, far]))
    with pytest.warns(sh.errors.UnreachedWarning):
        field = sh.SignedHeatSolver(cloud).distance(cloud.path(ids, closed=True))
    assert np.isnan(field.values[-3:]).all()
    assert cases.error(field.values[:-3], exact) < 2e-3
    assert field.diagnostics.note(PointsLeftOut).points_without_triangles == [len(points) + k for k in range(3)]
    pieces = [ids[: len(ids) // 2], ids[len(ids) // 2 - 1 :]]
    with pytest.warns(sh.errors.UnreachedWarning):
        completed = sh.signed_distance([cloud.path(piece) for piece in pieces], cloud)
    assert np.isnan(completed.values[-3:]).all()
    assert cases.error(completed.values[:-3], exact) < 2e-3


def test_distance_goes_on_within_a_sheet_and_not_to_a_finer_one_beside_it():
    """Of the nearest points of a coarse sheet half lie on the fine one below it, whose own all lie on itself."""
    sheets = []
    for spacing, z in ((0.1, 0.0), (0.02, -0.1)):
        x, y = np.meshgrid(np.arange(0, 1, spacing), np.arange(0, 1, spacing), indexing="ij")
        sheets.append(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)]))
    points, coarse = np.concatenate(sheets), len(sheets[0])
    values = np.where(np.arange(len(points)) < coarse // 2, points[:, 0] - 0.7, np.nan)
    found = spread(points, values, np.ones(len(points), dtype=bool))
    assert np.isfinite(found[:coarse]).all() and (found[:coarse] < 0).all()
    assert np.isnan(found[coarse:]).all()


def test_a_mobius_strip_of_points_is_like_one_of_triangles():
    """A strip with a half twist has no consistent normals: a curve across it brings its own."""
    along, across = np.meshgrid(
        np.linspace(0, 2 * np.pi, 120, endpoint=False), np.linspace(-0.3, 0.3, 9), indexing="ij"
    )
    radius = 1 + across * np.cos(along / 2)
    points = np.stack([radius * np.cos(along), radius * np.sin(along), across * np.sin(along / 2)], axis=-1)
    ids = np.arange(along.size).reshape(along.shape)
    ahead = np.vstack([ids[1:], ids[:1, ::-1]])
    cells = np.stack([ids[:, :-1], ahead[:, :-1], ahead[:, 1:], ids[:, 1:]], axis=-1).reshape(-1, 4)
    points = points.reshape(-1, 3)
    mesh = sh.TriangleMesh(points, np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]))
    cloud = sh.PointCloud(points, n_neighbors=24)
    fields = []
    for domain in (mesh, cloud):
        path = domain.path(ids[0])
        curve = sh.Curve(path.faces, path.barycentric, normals=np.tile([0.0, 1, 0], (path.n_segments, 1)))
        fields.append(sh.SignedHeatSolver(domain, 1.0).distance(curve).values)
    assert fields[1] == pytest.approx(fields[0], abs=0.02)
    assert fields[0].max() > 0.5


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((5, 3)),
        np.outer(np.arange(9.0), [1, 2, 3]),
        np.random.default_rng(0).random((9, 2)),
    ],
)
def test_clouds_that_are_no_surface_are_refused(points):
    with refused(sh.errors.GeometryError, "points"):
        sh.SignedHeatSolver(sh.PointCloud(points)).distance([sh.SurfacePoints([0], [[1, 0, 0]])])


def test_scale_and_motion():
    points, ids, _ = sphere_with_circle(700)
    turn = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    fields = []
    for positions in (points, 1e3 * points @ turn.T + [5e3, -2e3, 1e3]):
        cloud = sh.PointCloud(positions)
        fields.append(sh.SignedHeatSolver(cloud).distance(cloud.path(ids, closed=True)).values)
    assert fields[1] / 1e3 == pytest.approx(fields[0], abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_every_point_of_a_connected_surface_gets_a_value(seed):
    """Thin sheets with noise: neighbours see such points in planes so different that none of their triangles fit."""
    random = np.random.default_rng(seed)
    points = sphere(4).vertices * [1.0, 0.6, 0.12]
    points = (points + random.normal(scale=0.01, size=points.shape))[random.random(len(points)) < 0.8]
    cloud = sh.PointCloud(points)
    assert np.isfinite(sh.SignedHeatSolver(cloud).distance(cloud.points_at(0)).values).all()


PLATE = np.array([1.0, 0.8, 0.05])


def points_on_a_plate(n=12000, seed=0):
    """Points on a plate hardly thicker than they are apart; unit normals; a loop around it, its left towards +x."""
    random = np.random.default_rng(seed)
    areas = PLATE.prod() / PLATE
    axis = random.choice(3, n, p=areas / areas.sum())
    end = random.choice([-1.0, 1.0], n)
    points = random.uniform(-0.5, 0.5, (n, 3))
    points[np.arange(n), axis] = end / 2
    normals = np.eye(3)[axis] * end[:, None]
    y, z = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T / 2
    corners = np.stack([0 * y, y, z], axis=1) * PLATE
    share = np.linspace(0, 1, 20, endpoint=False)[:, None]
    loop = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    kept = spread_out(points * PLATE, np.full(n, 0.024))
    return points[kept] * PLATE, normals[kept], loop


def test_left_on_a_thin_plate_is_that_of_its_normals_wherever_curves_start_and_in_any_order():
    points, normals, loop = points_on_a_plate()
    random = np.random.default_rng(0)
    order = random.permutation(len(points))
    far = np.abs(points[:, 0]) > 0.1
    ways = {
        "given": (points, normals, loop, 1),
        "inverted": (points, -normals, loop, -1),
        "not given": (points, None, loop, 1),
        "from elsewhere": (points, None, np.roll(loop, 31, axis=0), 1),
        "in another order": (points[order], None, loop, 1),
    }
    for name, (positions, directions, line, sign) in ways.items():
        cloud = sh.PointCloud(positions, directions)
        values = sh.signed_distance(cloud.polyline(line, closed=True), cloud).values
        assert np.isfinite(values).all(), name
        values = values[np.argsort(order)] if positions is not points else values
        assert (np.sign(values) == sign * np.sign(points[:, 0]))[far].all(), name


@pytest.mark.parametrize("name", [*CASES, "noisy sphere", "sphere and one inside out"])
def test_given_normals_that_agree_everywhere_are_taken_without_a_search_for_inverted_ones(name, monkeypatch):
    kind = next(kind for kind in CASES if kind in name)
    points, _, _ = CASES[kind](1500)
    normals = outward(kind, points)
    if "noisy" in name:
        points = points + np.random.default_rng(0).normal(scale=0.02, size=points.shape)
    if "inside out" in name:
        points, normals = np.concatenate([points, points + 3]), np.concatenate([normals, -normals])
    assert neighbors_agree(points, normals)
    wrong = normals.copy()
    wrong[len(wrong) // 2] *= -1
    assert not neighbors_agree(points, wrong)
    taken = sh.PointCloud(points, normals)
    faces, directions = taken.triangulation.faces, taken.surface_normals
    monkeypatch.setattr(point_cloud, "neighbors_agree", lambda points, normals: False)
    searched = sh.PointCloud(points, normals)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that half of the normals face inwards, where one sphere is inside out
        np.testing.assert_array_equal(searched.triangulation.faces, faces)
    np.testing.assert_allclose(searched.surface_normals, directions, atol=1e-12)
    assert ((directions * normals).sum(axis=1) > 0.5).all()


def test_normals_on_both_sides_of_a_thin_wall_do_not_agree():
    assert not neighbors_agree(*both_sides(0.3 * 0.058))


@pytest.mark.parametrize("thickness", [0.5, 1.0])
def test_the_sides_of_a_thin_plate_are_joined_at_its_rim_and_nowhere_else(thickness):
    """Each side is sampled for itself; left of a loop around the plate, over its rim, is right on both sides."""
    spacing, random = 0.05, np.random.default_rng(0)
    size = np.array([1.0, 0.8, thickness * spacing])
    areas = size.prod() / size
    axis = random.choice(3, 20000, p=areas / areas.sum())
    end, cells = random.choice([-1.0, 1.0], len(axis)), np.arange(len(axis))
    points, normals = random.uniform(-0.5, 0.5, (len(axis), 3)), np.zeros((len(axis), 3))
    points[cells, axis], normals[cells, axis] = end / 2, end
    points *= size
    kept = spread_out(np.column_stack([points, normals]), np.full(len(axis), 0.8 * spacing))
    points, normals = points[kept], normals[kept]
    cloud = sh.PointCloud(points, normals)
    edges = cloud.triangulation.edges
    assert (edges.face_counts == 1).mean() < 0.02
    assert ((cloud.surface_normals * normals).sum(axis=1) > 0).mean() > 0.995
    y, z = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T / 2
    corners = np.stack([0 * y, y, z], axis=1) * size
    share = np.linspace(0, 1, 20, endpoint=False)[:, None]
    loop = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    values = sh.signed_distance(cloud.polyline(loop, closed=True), cloud).values
    far = np.abs(points[:, 0]) > 2 * spacing
    assert (np.sign(values) == np.sign(points[:, 0]))[far].all()


def both_sides(thickness, spacing=0.058):
    """Points on a hollow ball, spread evenly over either side for itself, and normals."""
    random = np.random.default_rng(1)
    points, normals = [], []
    for side in (1, -1):
        directions = random.normal(size=(6000, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        kept = directions[spread_out(directions, np.full(len(directions), 0.8 * spacing))]
        points.append(kept * (1 + side * thickness / 2))
        normals.append(side * kept)
    return np.concatenate(points), np.concatenate(normals)


@pytest.mark.parametrize(
    ("thickness", "given", "announced"),
    [(0.1, True, False), (0.5, True, False), (0.1, False, True), (0.5, False, True), (1, False, False)],
)
def test_sides_nearer_than_points_are_apart_are_kept_apart_or_announced(thickness, given, announced):
    points, normals = both_sides(thickness * 0.058)
    cloud = sh.PointCloud(points, normals if given else None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        agree = (cloud.surface_normals * normals).sum(axis=1) > 0
    assert bool(caught) == announced
    assert announced or max(agree.mean(), 1 - agree.mean()) > 0.98


def test_few_points_on_a_ball_are_not_those_of_two_sides():
    """They stick out of planes all alike."""
    points = cases.sphere_points(100)
    assert ((sh.PointCloud(points).surface_normals * points).sum(axis=1) > 0).all()


def test_without_normals_a_cloud_has_the_sides_that_orienting_it_gives():
    points, _, _ = points_on_a_plate(seed=5)
    cloud = sh.PointCloud(points)
    given, _ = orient_points(cloud)
    normals = sh.PointCloud(points, given.normals).surface_normals
    assert ((cloud.surface_normals * given.normals).sum(axis=1) > 0).mean() > 0.98
    assert ((cloud.surface_normals * normals).sum(axis=1) > 0).mean() > 0.98


def test_of_points_in_a_plane_the_upper_side_is_out_in_any_order():
    random = np.random.default_rng(2)
    points = np.column_stack([random.random((400, 2)), np.zeros(400)])
    for _ in range(4):
        cloud = sh.PointCloud(random.permutation(points))
        assert cloud.surface_normals[:, 2] == pytest.approx(1.0)


@pytest.mark.parametrize("sides", [(1, 1, 1), (1, 0.6, 0.3)])
def test_points_on_the_lattices_of_a_box_face_outwards_in_any_order(sides):
    """Tets behind the faces of the hull are flat there, and on which side of them is in must not hang on rounding."""
    side = np.linspace(-1, 1, 7)
    lattice = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    points = lattice[np.abs(lattice).max(axis=1) == 1] * sides
    first = sh.PointCloud(points).surface_normals
    assert (first * points).sum(axis=1).min() > 0
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(points))
        assert np.array_equal(sh.PointCloud(points[order]).surface_normals, first[order])


def test_outliers_do_not_turn_normals():
    points = cases.sphere_points(1500)
    far = np.array([[3.0, 0, 0], [0, 2.5, 0], [0.1, 0, 0.1]])
    normals = orient_points(sh.PointCloud(np.concatenate([points, far])))[0].normals[:1500]
    assert ((normals * points).sum(axis=1) > 0).all()
