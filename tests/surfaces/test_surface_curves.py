"""Curves on surfaces: where points lie, how points are joined, ways to make curves, and what is refused."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.surface_cases import band, book, flipped, laid_out, positions, sphere, square
from signedheat.mesh.surface_points import EDGE, FACE, VERTEX, locate_points, unique_points
from signedheat.surfaces.source_segments import segments_of
from signedheat.surfaces.surface import closest_points


def through_every_face(mesh, faces, weights):
    """The same points given through every face that has them."""
    for face, weight in zip(faces, weights, strict=True):
        ids = mesh.faces[face][weight > 0]
        for other in np.flatnonzero(np.isin(mesh.faces, ids).sum(axis=1) == len(ids)):
            moved = np.zeros(3)
            for v, w in zip(mesh.faces[face], weight, strict=True):
                if w > 0:
                    moved[mesh.faces[other] == v] = w
            yield other, moved


def test_points_on_edges_and_vertices_are_recognised_through_any_face():
    mesh = square(6, 0.3)
    triangles = laid_out(mesh)
    face = 12
    for weight, kind in (([0.3, 0.7, 0.0], EDGE), ([0.0, 1.0, 0.0], VERTEX), ([0.2, 0.3, 0.5], FACE)):
        given = list(through_every_face(mesh, [face], [np.array(weight)]))
        assert len(given) == {EDGE: 2, VERTEX: 6, FACE: 1}[kind]
        places = locate_points(triangles, np.array([g[0] for g in given]), np.array([g[1] for g in given]))
        assert (places.kinds == kind).all()
        assert len(np.unique(places.elements)) == 1 and np.ptp(places.along) < 1e-15
        assert len(unique_points(places)[0]) == 1


def test_rounding_does_not_move_points_off_edges():
    triangles = laid_out(square(6))
    places = locate_points(triangles, np.array([3]), np.array([[0.4 - 3e-10, 0.6, 3e-10]]))
    assert places.kinds[0] == EDGE and places.barycentric[0, 2] == 0.0


def test_the_route_through_which_points_are_given_does_not_matter():
    mesh = square(8, 0.3)
    path = mesh.path([9, 17, 26, 35])
    phi = sh.SignedHeatSolver(mesh).distance(path).values
    moved = [list(through_every_face(mesh, [f], [w]))[-1] for f, w in zip(path.faces, path.barycentric, strict=True)]
    other = sh.Curve([f for f, _ in moved], [w for _, w in moved])
    assert (other.faces != path.faces).any()
    assert np.abs(sh.SignedHeatSolver(mesh).distance(other).values - phi).max() < 1e-13


def test_straight_lines_are_traced_exactly_on_the_plane():
    mesh = square(30, 0.35)
    triangles = laid_out(mesh)
    ends = np.array([[-0.83, -0.71, 0], [0.77, 0.64, 0], [-0.9, 0.5, 0], [0.9, 0.5, 0]])
    curve = mesh.polyline(ends)
    assert curve.n_points > 60
    assert segments_of(curve, triangles).lengths.sum() == pytest.approx(
        np.linalg.norm(np.diff(ends, axis=0), axis=1).sum(), rel=1e-13
    )
    points = positions(mesh, curve)
    on_some_segment = np.zeros(len(points), dtype=bool)
    for a, b in pairwise(ends):
        on_some_segment |= np.abs(np.cross(b - a, points - a)[:, 2]) < 1e-12
    assert on_some_segment.all()


def test_traced_lines_are_shortest_on_a_sphere():
    mesh = sphere(4)
    rng = np.random.default_rng(3)
    faces = rng.integers(0, mesh.n_faces, 120)
    curve = sh.Curve(faces, rng.dirichlet([1, 1, 1], len(faces)))
    points = positions(mesh, curve)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    arcs = np.arccos(np.clip((points[1:] * points[:-1]).sum(axis=1), -1, 1)).sum()
    assert segments_of(curve, laid_out(mesh)).lengths.sum() == pytest.approx(arcs, rel=2e-3)


def test_traced_lines_match_exact_polyhedral_geodesics():
    geodesic = pytest.importorskip("pygeodesic.geodesic")
    mesh = sphere(3)
    bumpy = sh.TriangleMesh(mesh.vertices * (1 + 0.2 * np.sin(5 * mesh.vertices[:, :1])), mesh.faces)
    exact = geodesic.PyGeodesicAlgorithmExact(np.array(bumpy.vertices), np.array(bumpy.faces))
    rng = np.random.default_rng(0)
    ratios = []
    for a, b in rng.integers(0, bumpy.n_vertices, (30, 2)):
        if a != b:
            ours = segments_of(bumpy.path([a, b]), laid_out(bumpy)).lengths.sum()
            ratios.append(ours / exact.geodesicDistance(int(a), int(b))[0])
    assert min(ratios) > 1 - 1e-9
    assert np.median(ratios) < 1 + 1e-9 and max(ratios) < 1.1  # now and then on the other side of a bump


def test_lines_cross_nonmanifold_edges_and_pinched_vertices():
    pages = book(3, 6)
    across = pages.polyline([[0.7, 0.0, 0.31], 0.6 * np.array([np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3), 0.9])])
    assert segments_of(across, laid_out(pages)).lengths.sum() == pytest.approx(np.hypot(1.3, 0.23), rel=1e-12)

    touching = sh.TriangleMesh([[-1, -1, 0], [-1, 1, 0], [0, 0, 0], [1, -1, 0], [1, 1, 0]], [[0, 2, 1], [3, 4, 2]])
    through = touching.polyline([[-0.9, 0.1, 0], [0.9, 0.1, 0]])
    assert 2 in [int(touching.faces[f][w.argmax()]) for f, w in zip(through.faces, through.barycentric, strict=True)]
    assert segments_of(through, laid_out(touching)).lengths.sum() == pytest.approx(2 * np.hypot(0.9, 0.1))


def test_repeated_points_are_skipped_and_two_point_loops_work():
    mesh = square(8, 0.2)
    plain = sh.SignedHeatSolver(mesh).distance(mesh.path([9, 18, 27])).values
    stuttering = sh.SignedHeatSolver(mesh).distance(mesh.path([9, 9, 18, 18, 18, 27])).values
    assert np.abs(plain - stuttering).max() < 1e-13
    loop = sh.SignedHeatSolver(mesh).distance([mesh.path([9, 18, 27]), mesh.path([36, 45], closed=True)])
    assert np.isfinite(loop.values).all()
    there_and_back = mesh.path([9, 18], closed=True, oriented=False)
    once = mesh.path([9, 18], oriented=False)
    a, b = (sh.SignedHeatSolver(mesh).distance(c).values for c in (there_and_back, once))
    assert np.abs(a - b).max() < 1e-13


def test_level_sets_close_and_run_with_larger_values_to_their_left():
    mesh = sphere(4)
    z = mesh.vertices[:, 2]
    (curve,) = mesh.level_set(z, 0.25)
    assert curve.closed
    points = positions(mesh, curve)
    assert np.abs(points[:, 2] - 0.25).max() < 1e-14
    along = np.roll(points, -1, axis=0) - points
    assert (np.cross(points, along)[:, 2] > 0).all()
    phi = sh.SignedHeatSolver(mesh).distance(curve).values
    assert np.abs(phi - (np.arcsin(z) - np.arcsin(0.25))).max() < 0.02


def test_level_sets_through_vertices_and_of_ties():
    mesh = square(9)
    (curve,) = mesh.level_set(mesh.vertices[:, 0], 0.0)
    points = positions(mesh, curve)
    assert np.abs(points[:, 0]).max() == 0 and np.ptp(points[:, 1]) == 2
    peak = np.where(np.arange(81) == 40, 1.0, 0.0)
    assert mesh.level_set(peak, 1.0) == []
    holed = np.where(np.arange(81) == 40, np.nan, mesh.vertices[:, 0])
    (beside,) = mesh.level_set(mesh.vertices[:, 0], 0.01)
    assert sum(c.n_segments for c in mesh.level_set(holed, 0.01)) < beside.n_segments


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # its gap is wide
@pytest.mark.parametrize("intrinsic", [False, True])
def test_rounding_changes_no_number_of_points(intrinsic):
    """Lines through vertices and along edges, of values and places that are off by rounding."""
    flat = square(9)
    values, random = flat.vertices[:, 0], np.random.default_rng(0)
    domain = sh.intrinsic_delaunay(flat) if intrinsic else flat
    for level in (0.0, 0.25, 0.1):
        (expected,) = domain.level_set(values, level)
        for _ in range(20):
            (found,) = domain.level_set(values + 1e-16 * random.normal(size=len(values)), level)
            assert found.n_points == expected.n_points
    strokes = [[[-1, 0.1, 0], [-0.4, 0.1, 0]], [[0.4, 0.1, 0], [1, 0.1, 0]]]
    completed = set()
    for _ in range(5):
        moved = sh.TriangleMesh(flat.vertices + 1e-16 * random.normal(size=flat.vertices.shape), flat.faces)
        completed.add(sh.close_curves([moved.polyline(stroke) for stroke in strokes], moved)[0].n_points)
    assert len(completed) == 1


def test_level_sets_boundaries_and_paths_survive_faces_turned_over():
    mesh = square(12, 0.3)
    values = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    phi = sh.SignedHeatSolver(mesh).distance(mesh.level_set(values, 0.5), sh.constraints.Free()).values
    turned = flipped(mesh)
    curves = turned.level_set(values, 0.5)
    assert len(curves) == 1 and curves[0].closed and curves[0].normals is not None
    other = sh.SignedHeatSolver(turned).distance(curves, sh.constraints.Free()).values
    assert np.abs(other - phi).max() < 0.05  # normals by gradient here, by turning there

    region = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0.1
    phi = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.region_boundary(region)).values
    other = sh.SignedHeatSolver(turned, intrinsic=False).distance(turned.region_boundary(region)).values
    assert np.abs(other - phi).max() < 1e-10


def test_region_boundaries_have_the_region_to_their_left():
    mesh = sphere(3)
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    curves = mesh.region_boundary(centers[:, 2] > 0.3)
    assert len(curves) == 1 and curves[0].closed
    phi = sh.SignedHeatSolver(mesh).distance(curves).values
    assert (phi[mesh.vertices[:, 2] > 0.5] > 0).all() and (phi[mesh.vertices[:, 2] < 0.1] < 0).all()
    assert mesh.region_boundary(np.ones(mesh.n_faces, dtype=bool)) == []


def test_boundary_curves():
    assert sphere(2).boundary_curves() == []
    (rim,) = square(5).boundary_curves()
    assert rim.closed and rim.n_points == 16
    ring = band(24, 4, twisted=False)
    assert [c.closed for c in ring.boundary_curves()] == [True, True]
    phi = sh.SignedHeatSolver(ring).distance(ring.boundary_curves())
    assert phi.values.max() == pytest.approx(0.4, abs=0.03) and phi.values.min() > -1e-12
    (rim,) = band(24, 3, twisted=True).boundary_curves()
    assert rim.closed and rim.n_points == 48


def test_given_normals_make_a_moebius_strip_indifferent_to_faces_turned_over():
    strip = band(60, 4, twisted=True)
    u = 2 * np.pi * 20 / 60
    normal = np.array([-np.sin(u), np.cos(u), 0.0])
    rim = strip.boundary_curves()
    found = []
    for mesh in (strip, flipped(strip), flipped(strip, 0.5, seed=7)):
        arc = mesh.path([20 * 5 + j for j in range(5)])
        given = sh.Curve(arc.faces, arc.barycentric, normals=np.tile(normal, (4, 1)))
        found.append(sh.SignedHeatSolver(mesh).distance(given).values)
    assert np.abs(found[1] - found[0]).max() < 1e-10 and np.abs(found[2] - found[0]).max() < 1e-10
    phi = sh.SignedHeatSolver(strip).distance(rim).values.reshape(60, 5)
    assert phi[:, 2] == pytest.approx(0.4, abs=0.03)


def test_given_normals_make_a_moebius_strip_of_squares_indifferent_to_squares_turned_over():
    strip = band(60, 4, twisted=True)
    squares = np.column_stack([strip.faces[0::2], strip.faces[1::2, 2]])
    over = np.random.default_rng(3).random(len(squares)) < 0.5
    u = 2 * np.pi * 20 / 60
    found = []
    for polygons in (squares, np.where(over[:, None], squares[:, ::-1], squares)):
        mesh = sh.PolygonMesh(strip.vertices, polygons)
        arc = mesh.path([20 * 5 + j for j in range(5)])
        given = sh.Curve(arc.faces, arc.barycentric, normals=np.tile([-np.sin(u), np.cos(u), 0.0], (4, 1)))
        found.append(sh.SignedHeatSolver(mesh).distance(given).values.reshape(60, 5))
    assert np.abs(found[1] - found[0]).max() < 1e-10
    assert (found[0][22:26] > 0.02).all() and (found[0][15:19] < -0.02).all()


def test_curves_on_a_nonmanifold_spine():
    pages = book(3, 8)
    phi = sh.SignedHeatSolver(pages).distance(pages.path(np.arange(9), oriented=False))
    distance = np.hypot(pages.vertices[:, 0], pages.vertices[:, 1])
    assert np.abs(phi.values - distance).max() < 1e-9


def test_polylines_far_away_are_refused_with_the_farthest_distance():
    mesh = sphere(2)
    with refused(sh.errors.SourceError, "point 1"):
        mesh.polyline([[1, 0, 0], [0, 2.5, 0]])
    assert mesh.polyline([[1, 0, 0], [0, 2.5, 0]], max_distance=2).n_points > 2


@pytest.mark.parametrize(
    ("make", "element"),
    [
        (lambda m: sh.Curve([0], [[1, 0, 0]]), None),
        (lambda m: sh.Curve([], []), None),
        (lambda m: sh.SurfacePoints([], []), None),
        (lambda m: sh.Curve([0, 1], [[1, 0, 0], [0.5, 0.2, 0.2]]), "point 1"),
        (lambda m: sh.Curve([0, 1], [[1.5, -0.5, 0], [1, 0, 0]]), "point 0"),
        (lambda m: sh.Curve([0, 1], [[np.nan, 1, 0], [1, 0, 0]]), "number 0"),
        (lambda m: sh.Curve([0.5, 1.0], [[1, 0, 0], [1, 0, 0]]), "faces"),
        (lambda m: sh.Curve([0, 1], [[1, 0, 0], [0, 1, 0]], normals=[[0, 0, 1], [0, 0, 1]]), "normals"),
        (lambda m: m.path([1, 2, 99999]), "vertex 99999"),
        (lambda m: m.path([0.5, 2.0]), "vertices"),
        (lambda m: m.points_at([-1]), "vertex -1"),
        (lambda m: sh.PolygonMesh(m.vertices[:4], [[0, 1, 2, 3]]).points_at([4]), "vertex 4"),  # a virtual one
        (lambda m: m.level_set(np.zeros(3)), "values"),
        (lambda m: m.region_boundary(np.zeros(3, dtype=bool)), "face_mask"),
        (lambda m: m.region_boundary(np.zeros(m.n_faces)), "face_mask"),
        (lambda m: m.polyline([[1, 0, 0]]), None),
        (lambda m: m.polyline([[1, 0, 0], [0, np.inf, 0]]), "number 1"),
        (lambda m: sh.SignedHeatSolver(m).distance(sh.Curve([0, 99999], np.eye(3)[:2])), "face 99999"),
        (lambda m: sh.SignedHeatSolver(m).distance(sh.Curve([0, 0], np.eye(3)[[0, 0]])), "curve 0"),
        (lambda m: sh.SignedHeatSolver(m).distance(m.path([0, 12], closed=True)), "curves"),
        (lambda m: sh.SignedHeatSolver(m).distance([m.path([0, 12]), m.path([12, 0])]), "curves"),
        (lambda m: sh.SignedHeatSolver(m).distance(sh.Curve([0] * 3, 0.1 + 0.7 * np.eye(3), True)), "curves"),
        (lambda m: sh.SignedHeatSolver(m).distance([]), None),
        (lambda m: sh.SignedHeatSolver(m).distance([[]]), None),
        (lambda m: sh.SignedHeatSolver(m).distance("curve"), "source 0"),
    ],
)
def test_bad_input_is_refused_by_name(make, element):
    with refused(sh.errors.SourceError, element):
        make(sphere(1))


def test_normals_that_leave_the_surface_and_points_on_two_components_are_refused():
    mesh = square(4)
    path = mesh.path([5, 6])
    with refused(sh.errors.SourceError, "face 1"):
        sh.SignedHeatSolver(mesh).distance(sh.Curve(path.faces, path.barycentric, normals=[[0, 0, 1]]))
    two = sh.TriangleMesh(
        np.concatenate([mesh.vertices, mesh.vertices + np.array([0, 0, 1]), [[5, 5, 5]]]),
        np.concatenate([mesh.faces, mesh.faces + 16]),
    )
    with refused(sh.errors.SourceError, "face 0"):
        sh.SignedHeatSolver(two).distance(two.path([5, 21]))
    with refused(sh.errors.SourceError, "vertex 32"):
        two.path([5, 32])


def test_reversing_a_curve_turns_the_sign():
    mesh = square(10, 0.3)
    curve = mesh.polyline([[-0.6, -0.5, 0], [0.1, 0.3, 0], [0.7, 0.2, 0]])
    forward, backward = (sh.SignedHeatSolver(mesh).distance(c).values for c in (curve, curve.reversed()))
    assert np.abs(forward + backward).max() < 1e-13


def test_closest_points_are_closest():
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(40, 3, 3))
    corners[5] = corners[5, 0]  # a point
    corners[6, 2] = 0.3 * corners[6, 0] + 0.7 * corners[6, 1]  # a segment
    mesh = sh.TriangleMesh(corners.reshape(-1, 3), np.arange(120).reshape(-1, 3))
    points = rng.normal(size=(200, 3)) * 2
    _, weights, distances = closest_points(mesh, points)
    assert (weights >= 0).all() and np.abs(weights.sum(axis=1) - 1).max() < 1e-12
    u, v = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
    inside = u + v <= 1
    grid = np.stack([1 - u - v, u, v], axis=-1)[inside]
    samples = np.einsum("sk,fkj->fsj", grid, corners).reshape(-1, 3)
    sampled = np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])
    assert (distances <= sampled + 1e-12).all() and np.abs(distances - sampled).max() < 0.03


@pytest.mark.parametrize("order", [None, 0], ids=["in order", "shuffled"])
def test_polylines_run_as_ever_where_faces_are_there_both_ways(order):
    ball = sh.samples.sphere(3)
    faces = np.concatenate([ball.faces, ball.faces[:, ::-1]])
    both = sh.TriangleMesh(ball.vertices, faces if order is None else np.random.default_rng(order).permutation(faces))
    angle = np.linspace(0.1, 6, 60)
    line = np.stack([0.8 * np.cos(angle), 0.8 * np.sin(angle), np.full(60, 0.6)], axis=1)
    once, twice = ball.polyline(line), both.polyline(line)
    assert np.allclose(both.positions(twice), ball.positions(once), rtol=0, atol=1e-12)
    phi = sh.signed_distance(once, ball).values
    assert np.allclose(abs(sh.signed_distance(twice, both).values), abs(phi), rtol=0, atol=1e-9)
