"""Polygon meshes: virtual refinement, and distance on it."""

from time import perf_counter

import numpy as np
import pytest

import signedheat as sh
from shapes import domain_cases as cases
from signedheat.surfaces.polygon_mesh import virtual_refinement, virtual_vertices


def refined(vertices, polygons):
    mesh = sh.PolygonMesh(vertices, polygons)
    return mesh.refinement, mesh.triangulation


def test_the_virtual_vertex_minimises_squared_areas():
    rng = np.random.default_rng(1)
    corners = np.array([[0, 0, 0], [2, 0, 0.3], [2.5, 1, 0], [1, 2, -0.2], [-0.5, 1, 0.1]]) + 0.1 * rng.random((5, 3))
    ids = np.arange(5)
    (center,), weights = virtual_vertices(corners, ids, np.roll(ids, -1), np.zeros(5, dtype=int), 1)

    def energy(x):
        return (np.cross(corners - x, np.roll(corners, -1, axis=0) - x) ** 2).sum()

    assert weights.sum() == pytest.approx(1, abs=1e-13)
    assert weights @ corners == pytest.approx(center, abs=1e-12)
    for step in 1e-4 * np.vstack([np.eye(3), -np.eye(3)]):
        assert energy(center + step) > energy(center)


def test_weights_reproduce_linear_functions_and_do_not_move_with_the_polygon():
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    vertices, polygons = cases.bricks(6)
    vertices[:, 2] = 0.1 * np.sin(3 * vertices[:, 0])
    first, mesh = refined(vertices, polygons)
    second, _ = refined(vertices @ turn.T * 7 + 3, polygons)
    assert abs(first.prolongation - second.prolongation).max() < 1e-10
    assert first.prolongation @ vertices == pytest.approx(mesh.vertices, abs=1e-12)


def test_triangles_stay_whole_and_polygons_keep_their_order():
    refinement, mesh = refined([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]], [[0, 1, 2, 3], [1, 4, 2]])
    assert mesh.faces.tolist() == [[0, 1, 5], [1, 2, 5], [2, 3, 5], [3, 0, 5], [1, 4, 2]]
    assert refinement.face_polygons.tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize("turns", range(4))
def test_polygons_far_from_convex_are_covered_once(turns):
    horseshoe = np.array([[0, 0], [4, 0], [4, 3], [3, 3], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    plane = np.linalg.qr(np.random.default_rng(turns).normal(size=(3, 3)))[0][:, :2]
    corners = np.roll(horseshoe, turns, axis=0) @ plane.T
    _, mesh = refined(corners, [list(range(8))])
    assert mesh.face_areas.sum() == pytest.approx(8, rel=1e-12)
    normal = mesh.face_area_vectors.sum(axis=0)
    assert (mesh.face_area_vectors @ normal > 0).all()
    assert mesh.n_faces == 6 and mesh.n_vertices == 8  # diagonals only


def test_a_polygon_of_thousands_of_corners_is_cut_at_once():
    """A comb, around which no fan fits."""
    teeth = np.arange(3000)
    comb = np.concatenate([np.stack([teeth, 0 * teeth], axis=1), np.stack([teeth, 1 + 50 * (teeth % 2)], axis=1)[::-1]])
    began = perf_counter()
    _, mesh = refined(np.pad(comb, ((0, 0), (0, 1))).astype(float), [np.arange(6000)])
    assert perf_counter() - began < 20  # a tenth of a second; ear by ear, many minutes
    x, y = comb.T.astype(float)
    assert mesh.n_faces == 5998 and mesh.face_areas.sum() == pytest.approx(
        0.5 * (x @ np.roll(y, -1) - np.roll(x, -1) @ y)
    )


def test_a_polygon_that_crosses_itself_is_still_covered():
    _, mesh = refined([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0.1]], [[0, 1, 2, 3]])
    assert set(mesh.faces.ravel()) >= {0, 1, 2, 3} and np.isfinite(mesh.vertices).all()


def test_repeated_corners_are_skipped():
    fan = virtual_refinement(np.eye(3), np.array([0, 0, 1, 2, 2]), np.array([0, 5]))
    assert fan.faces.tolist() == [[0, 1, 2]]


def test_triangles_as_polygons_give_the_triangle_result():
    vertices, faces = cases.triangles(12)
    line = np.array([[-1, 0.11, 0], [0.3, 0.2, 0], [1, -0.4, 0]])
    fields = []
    for mesh in (sh.TriangleMesh(vertices, faces), sh.PolygonMesh(vertices, faces)):
        fields.append(sh.SignedHeatSolver(mesh).distance(mesh.polyline(line)).values)
    assert fields[0] == pytest.approx(fields[1], abs=1e-11)


@pytest.mark.parametrize("make", [cases.triangles, cases.quads, cases.bricks])
def test_distance_to_a_straight_line_is_exact(make):
    vertices, polygons = make(9)
    mesh = sh.PolygonMesh(vertices, polygons)
    phi = sh.SignedHeatSolver(mesh).distance(mesh.polyline([[-1, 0.123, 0], [1, 0.123, 0]])).values
    assert phi == pytest.approx(vertices[:, 1] - 0.123, abs=1e-9)


def test_tessellations_of_one_shape_agree_and_converge():
    """A circle across the faces, on four tessellations; heat at a fixed number of cells bends, so t grows with 1/h."""
    sizes = [12, 24, 48]
    for make in (cases.triangles, cases.quads, lambda n: cases.quads(n, 0.25), cases.bricks):
        errors = []
        for n in sizes:
            mesh = sh.PolygonMesh(*make(n))
            exact = 0.55 - np.linalg.norm(mesh.vertices - [0.03, 0.02, 0], axis=1)
            phi = sh.SignedHeatSolver(mesh, diffusion=n / 6).distance(mesh.level_set(exact)).values
            errors.append(cases.error(phi, exact))
        assert errors[-1] < 1.2e-3
        assert cases.fitted_order([1 / n for n in sizes], errors) > 0.9


def test_a_polyline_with_corners_inside_faces_agrees_between_tessellations():
    zigzag = np.array([[-0.7, -0.4, 0], [-0.2, 0.37, 0], [0.31, -0.13, 0], [0.66, 0.42, 0]])
    probes = []
    for make in (cases.triangles, cases.quads, lambda n: cases.quads(n, 0.25), cases.bricks):
        mesh = sh.PolygonMesh(*make(40))
        phi = sh.SignedHeatSolver(mesh, diffusion=4).distance(mesh.polyline(zigzag), sh.constraints.Free()).values
        near = [np.argmin(np.linalg.norm(mesh.vertices - [x, y, 0], axis=1)) for x in (-0.9, 0.9) for y in (-0.9, 0.9)]
        probes.append(phi[near])
    assert np.ptp(probes, axis=0).max() < 0.02


def test_parallels_of_a_globe_converge_at_second_order_and_beat_the_peer():
    peers = pytest.importorskip("potpourri3d")
    errors, peer_errors = [], []
    for n in (16, 32, 64):
        vertices, polygons = cases.globe(n)
        mesh = sh.PolygonMesh(vertices, polygons)
        equator = np.arange(2 * n) + (n // 2 - 1) * 2 * n
        exact = np.arcsin(np.clip(vertices[:, 2], -1, 1))
        phi = sh.SignedHeatSolver(mesh).distance(mesh.path(equator, closed=True)).values
        errors.append(cases.error(phi, exact))
        solver = peers.PolygonMeshHeatSolver(vertices, polygons)
        peer = np.asarray(solver.compute_signed_distance([[*map(int, equator), int(equator[0])]]))
        peer_errors.append(min(cases.error(peer, exact), cases.error(-peer, exact)))
    assert cases.fitted_order([1 / 16, 1 / 32, 1 / 64], errors) > 1.9
    assert (np.array(errors) < 0.85 * np.array(peer_errors)).all()


def test_a_curve_across_polygons_is_the_zero_set():
    vertices, polygons = cases.bricks(16)
    mesh = sh.PolygonMesh(vertices, polygons)
    (curve,) = mesh.level_set(np.hypot(vertices[:, 0], vertices[:, 1]), 0.5)
    phi = sh.SignedHeatSolver(mesh).distance(curve)
    near = np.abs(np.hypot(vertices[:, 0], vertices[:, 1]) - 0.5) < 0.2
    exact = np.hypot(vertices[:, 0], vertices[:, 1]) - 0.5
    assert np.abs(phi.values - exact)[near].max() < 0.15 * 2 / 16


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_polygons_that_pass_an_edge_twice_have_holes(n, turn):
    """A strip with square holes, each joined to a corner below by an edge that is passed there and back."""
    corners = np.array([[3.0 * k, 0.0] for k in range(n + 1)] + [[3.0 * n, 3.0], [0.0, 3.0]])
    hole = np.array([[1, 1], [1, 2], [2, 2], [2, 1]])
    holes = [hole + np.array([3 * k, 0]) for k in range(n)]
    order: list[int] = []
    for k in range(n):
        first = n + 3 + 4 * k
        order += [k, first, first + 1, first + 2, first + 3, first, k]
    polygon = [*order, n, n + 1, n + 2]
    flat = np.concatenate([corners, *holes])
    space = np.stack([flat[:, 0] * np.cos(turn), flat[:, 1], flat[:, 0] * np.sin(turn)], axis=1)
    for shift in range(0, len(polygon), 3):
        mesh = sh.PolygonMesh(space, [np.roll(polygon, shift).tolist()])
        assert mesh.triangulation.n_vertices == len(flat)
        triangles = flat[mesh.triangulation.faces]
        sides, step = np.roll(triangles, -1, axis=1) - triangles, np.random.default_rng(0).uniform(size=(500, 2))
        assert mesh.triangulation.face_areas.sum() == pytest.approx(8 * n, abs=1e-9)
        away = step * [3 * n, 3] - triangles[:, :, None]
        covered = (
            (sides[:, :, None, 0] * away[..., 1] - sides[:, :, None, 1] * away[..., 0] > 0).all(axis=1).sum(axis=0)
        )
        x, y = (step * [3 * n, 3]).T
        assert np.array_equal(covered, 1 - ((x % 3 > 1) & (x % 3 < 2) & (y > 1) & (y < 2)))
