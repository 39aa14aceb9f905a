"""X₀ and the rows on surfaces: closed forms, parity with the published code, and where we depart from it on purpose."""

from __future__ import annotations

import numpy as np
import potpourri3d as pp3d
import pytest

import signedheat as sh
from shapes.surface_cases import band, book, flipped, laid_out, positions, sphere, square
from signedheat.diagnostics import VerticesAdded
from signedheat.mesh.conforming_refinement import refine_to_conform
from signedheat.mesh.surface_points import locate_points
from signedheat.surfaces.source_segments import segments_of, segments_of_each
from signedheat.surfaces.surface_source import surface_source


def peer(mesh, curves=(), signs=(), points=(), constraint="None"):
    solver = pp3d.MeshSignedHeatSolver(np.array(mesh.vertices), np.array(mesh.faces))
    curves = [[(int(v), []) for v in curve] for curve in curves]
    return solver.compute_distance(curves, list(signs), [(int(v), []) for v in points], level_set_constraint=constraint)


def difference(ours, theirs):
    """Largest difference up to a constant, relative to the range."""
    return float(np.ptp(ours - theirs) / np.ptp(theirs))


def bumpy():
    ball = sphere(4)
    wave = 1 + 0.15 * np.sin(4 * ball.vertices[:, :1]) * np.cos(3 * ball.vertices[:, 1:2])
    noise = np.random.default_rng(0).normal(size=ball.vertices.shape) * 0.003
    return sh.TriangleMesh(ball.vertices * wave + noise, ball.faces)


def loop_of(mesh, height=0.31):
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    curve = max(mesh.region_boundary(centers[:, 2] > height), key=lambda c: c.n_points)
    return mesh.faces[curve.faces, curve.barycentric.argmax(axis=1)].tolist(), curve


def test_oriented_edge_curves_match_the_published_code():
    mesh = bumpy()
    vertices, _ = loop_of(mesh)
    phi = (
        sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(mesh.path(vertices[:40]), sh.constraints.Free()).values
    )
    ref = peer(mesh, [vertices[:40]])
    assert np.abs(phi - ref).max() < 1e-10 * np.ptp(ref)


def test_oriented_curves_across_faces_match_the_published_code():
    mesh = bumpy()
    (curve,) = mesh.level_set(mesh.vertices[:, 2] + 0.1 * mesh.vertices[:, 0], 0.2)
    places = locate_points(laid_out(mesh), curve.faces, curve.barycentric)
    nodes = [(int(e), [float(s)]) for e, s in zip(places.elements, places.along, strict=True)]
    peer_solver = pp3d.MeshSignedHeatSolver(np.array(mesh.vertices), np.array(mesh.faces))
    ref = peer_solver.compute_distance([[*nodes, nodes[0]]], level_set_constraint="None")
    phi = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve, sh.constraints.Free()).values
    assert np.abs(phi - ref).max() < 1e-10 * np.ptp(ref)


def test_points_match_the_published_code():
    mesh = bumpy()
    phi = (
        sh.SignedHeatSolver(mesh, 1.0, intrinsic=False)
        .distance(mesh.points_at([5, 900, 1200]), sh.constraints.Free())
        .values
    )
    assert difference(phi, peer(mesh, points=[5, 900, 1200])) < 1e-10


def test_unoriented_edge_curves_match_the_published_code_on_the_plane():
    mesh = square(14, 0.15)
    for vertices in ([60, 74, 88, 102], [60, 74, 89, 90, 104]):
        curve = mesh.path(vertices, oriented=False)
        phi = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve, sh.constraints.Free()).values
        assert difference(phi, peer(mesh, [vertices], [False])) < 1e-10


def test_unoriented_ends_on_curved_vertices_are_symmetric_and_near_the_published_code():
    """There the published code measures one limit of the arc in scaled angles, the other in plain ones."""
    mesh = bumpy()
    vertices = loop_of(mesh)[0][:30]
    curve = mesh.path(vertices, oriented=False)
    phi = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve, sh.constraints.Free()).values
    assert difference(phi, peer(mesh, [vertices], [False])) < 1e-3
    mirror = sh.TriangleMesh(mesh.vertices * np.array([1, 1, -1]), mesh.faces[:, ::-1])
    curve = mirror.path(vertices, oriented=False)
    other = sh.SignedHeatSolver(mirror, 1.0, intrinsic=False).distance(curve, sh.constraints.Free()).values
    assert np.abs(phi - other).max() < 1e-12


def test_pieces_inside_a_face_and_along_its_edge_have_the_same_weight():
    """The published code weighs pieces inside faces three times as much."""
    mesh = square(21)
    triangles = laid_out(mesh)
    tail, head = triangles.edges.vertices.T
    frames = (mesh.vertices[head] - mesh.vertices[tail])[:, :2] @ [1, 1j]
    frames /= np.abs(frames)
    for shift in (0.0, 1e-7, 0.03):
        curve = mesh.polyline([[-0.9, 0.5 + shift, 0], [0.9, 0.5 + shift, 0]])
        assert (segments_of(curve, triangles).edges >= 0).all() == (shift == 0)
        total = (surface_source(triangles, [curve], 1.0, 1.0).vectors @ frames).sum()
        assert total == pytest.approx(1.8j, rel=1e-9)


def test_points_and_curves_keep_their_weights_when_the_mesh_is_scaled():
    mesh = square(16, 0.25)
    big = sh.TriangleMesh(mesh.vertices * 1000, mesh.faces)
    found = []
    for m in (mesh, big):
        sources = [m.path([40, 41, 42, 43]), m.points_at([180])]
        found.append(sh.SignedHeatSolver(m, intrinsic=False).distance(sources, sh.constraints.Free()).values)
    assert np.abs(found[1] / 1000 - found[0]).max() < 1e-12

    vertices = [40, 41, 42, 43]
    theirs = [peer(m, [vertices], [True], [180]) for m in (mesh, big)]
    assert np.abs(theirs[1] / 1000 - theirs[0]).max() > 1e-3  # theirs depends on the unit


def test_faces_turned_over_change_nothing_when_normals_are_given():
    mesh = sphere(3)
    z = mesh.vertices[:, 2]
    (curve,) = mesh.level_set(z, 0.2)
    points = positions(mesh, curve)
    middle = 0.5 * (points + np.roll(points, -1, axis=0))
    normals = np.array([0, 0, 1]) - middle[:, 2:] * middle
    found = []
    for m in (mesh, flipped(mesh), flipped(mesh, 0.5, seed=4)):
        weights = np.stack(
            [
                [w[mesh.faces[f].tolist().index(v)] for v in m.faces[f]]
                for f, w in zip(curve.faces, curve.barycentric, strict=True)
            ]
        )
        source = sh.Curve(curve.faces, weights, closed=True, normals=normals)
        found.append(sh.SignedHeatSolver(m, intrinsic=False).distance(source).values)
    assert np.abs(found[1] - found[0]).max() < 1e-10 and np.abs(found[2] - found[0]).max() < 1e-10
    assert np.abs(found[0] - (np.arcsin(z) - np.arcsin(0.2))).max() < 0.03


def test_given_normals_that_are_the_implied_ones_change_nothing():
    mesh = square(12, 0.2)
    curve = mesh.polyline([[-0.7, -0.3, 0], [0.8, 0.4, 0]])
    step = np.diff(positions(mesh, curve), axis=0)
    left = np.stack([-step[:, 1], step[:, 0], step[:, 2]], axis=1)
    given = sh.Curve(curve.faces, curve.barycentric, normals=left)
    triangles = laid_out(mesh)
    a = surface_source(triangles, [curve], 1.0, 1.0).vectors
    b = surface_source(triangles, segments_of_each([given], triangles, mesh.vertices), 1.0, 1.0).vectors
    assert abs(a - b).max() < 1e-14


def test_samples_weights_components_and_owners():
    mesh = square(8)
    line, branch, apart = mesh.path([9, 10, 11, 12]), mesh.path([19, 11]), mesh.path([33, 34])
    source = surface_source(laid_out(mesh), [line, [branch, apart], mesh.points_at([50, 50, 9])], 2.0, 0.1)
    assert source.components.tolist() == [0, 0, 0, 0, 0, 0, 1, 1, 2, 0]
    assert source.source_ids.tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    h = 2 / 7
    assert source.weights == pytest.approx([h / 2, h, h, h / 2, h / 2, h / 2, h / 2, h / 2, 0.1, 0.1])
    assert source.interpolation.indices.tolist() == [9, 10, 11, 12, 19, 11, 33, 34, 50, 9]
    assert source.time == pytest.approx(0.02) and source.oriented


def test_rows_interpolate():
    mesh = square(9, 0.3)
    curve = mesh.polyline([[-0.7, -0.55, 0], [0.65, 0.8, 0]])
    linear = mesh.vertices @ [2.0, -3.0, 0.0] + 1
    source = surface_source(laid_out(mesh), [curve], 1.0, 1.0)
    assert source.interpolation @ linear == pytest.approx(positions(mesh, curve) @ [2.0, -3.0, 0.0] + 1)


def test_free_ends_point_away_from_the_curve_but_not_at_junctions_or_boundaries():
    mesh = square(15)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    distance = np.hypot(np.maximum(np.abs(mesh.vertices[:, 0]) - 3 / 7, 0), mesh.vertices[:, 1])
    row = [int(np.argmin(np.hypot(*(mesh.vertices[:, :2] - [k / 7, 0]).T))) for k in range(-3, 4)]
    phi = solver.distance(mesh.path(row, oriented=False)).values
    assert np.abs(phi - distance).max() < 0.1
    halves = [mesh.path(row[:4], oriented=False), mesh.path(row[3:], oriented=False)]
    assert np.abs(solver.distance(halves).values - phi).max() < 1e-12  # where they meet, neither end is free
    across = [int(np.argmin(np.hypot(*(mesh.vertices[:, :2] - [k / 7, 0]).T))) for k in range(-7, 8)]
    whole = solver.distance(mesh.path(across, oriented=False)).values
    assert np.abs(whole - np.abs(mesh.vertices[:, 1])).max() < 1e-9


def test_an_unoriented_curve_is_the_same_run_backwards_and_twice():
    mesh = square(12, 0.3)
    there = mesh.path([40, 41, 42, 55])
    forth = mesh.path([40, 41, 42, 55], oriented=False)
    back = mesh.path([55, 42, 41, 40], oriented=False)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    phi = solver.distance(forth).values
    assert np.abs(solver.distance(back).values - phi).max() < 1e-13
    assert np.abs(solver.distance([forth, back]).values - phi).max() < 1e-12
    assert (solver.distance(there).values < -0.1).any() and phi.min() > -0.05


def test_embedding_keeps_the_surface_and_the_curves():
    mesh = square(10, 0.3)
    triangles = laid_out(mesh)
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    eight = np.stack([0.6 * np.sin(turn), 0.4 * np.sin(2 * turn) + 0.01, 0 * turn], axis=1)
    sources = [
        mesh.polyline(eight, closed=True, oriented=False),
        mesh.polyline([[-0.8, -0.7, 0], [0.7, 0.8, 0]]),
        [mesh.polyline([[-0.5, 0.6, 0], [0.55, -0.6, 0]], oriented=False), sh.SurfacePoints([5], [[0.2, 0.2, 0.6]])],
    ]
    groups = segments_of_each(sources, triangles)
    finer, moved = refine_to_conform(triangles, groups)
    assert finer.face_areas.sum() == pytest.approx(4.0) and finer.face_areas.min() > 0
    assert finer.n_vertices - finer.n_edges + finer.n_faces == 1  # Euler characteristic of a disk
    assert finer.is_consistently_oriented
    for before, after in zip(groups, moved, strict=True):
        for old, new in zip(before, after, strict=True):
            assert new.is_conforming and new.lengths.sum() == pytest.approx(old.lengths.sum(), rel=1e-12)
            in_edges = np.abs(finer.edge_vectors[new.faces]).min(axis=1) if len(new.ends) else np.ones(1)
            assert (in_edges > 0).all()
            assert new.oriented == old.oriented
    components = surface_source(finer, moved, 1.0, 0.1).components
    assert components.max() + 1 == 2  # everything crosses but the point


def test_embedding_of_nothing_changes_nothing():
    mesh = square(6)
    triangles = laid_out(mesh)
    groups = segments_of_each([mesh.path([7, 8], oriented=False), mesh.polyline([[0, 0, 0], [0.4, 0.3, 0]])], triangles)
    assert refine_to_conform(triangles, groups)[0] is triangles


def test_an_edge_curve_shifted_into_faces_gives_nearly_the_same_distance():
    mesh = square(25)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    exact = np.hypot(np.maximum(np.abs(mesh.vertices[:, 0]) - 0.5, 0), mesh.vertices[:, 1])
    on_edges = solver.distance(mesh.polyline([[-0.5, 0, 0], [0.5, 0, 0]], oriented=False))
    inside = solver.distance(mesh.polyline([[-0.5, 1e-4, 0], [0.5, 1e-4, 0]], oriented=False))
    assert inside.diagnostics.note(VerticesAdded).vertices_added > 20
    assert np.abs(inside.values - exact).max() < 2 * np.abs(on_edges.values - exact).max() < 0.2


@pytest.mark.parametrize("where", [[0.2113, -0.1371, 0.0], [0.05, 0.3, 0.0], [-0.4, 0.23, 0.0]])
def test_points_anywhere_converge_to_the_exact_distance(where):
    """Cut out of faces and made vertices, they would not: Eq. 19 is isotropic on regular fans of faces alone."""
    errors = []
    for n in (13, 25, 49):
        mesh = square(n, 0.2)
        line = mesh.polyline([where, [0.9, 0.9, 0.0]])
        phi = (
            sh.SignedHeatSolver(mesh, intrinsic=False)
            .distance(sh.SurfacePoints(line.faces[:1], line.barycentric[:1]))
            .values
        )
        errors.append(np.sqrt(np.mean((phi - np.linalg.norm(mesh.vertices - where, axis=1)) ** 2)))
    assert np.polyfit(np.log([13, 25, 49]), np.log(errors), 1)[0] < -0.6
    assert errors[-1] < 0.05


def test_unoriented_circles_inside_faces_converge():
    errors = []
    turn = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    for n in (12, 24, 48):
        mesh = square(n, 0.2)
        circle = mesh.polyline(0.55 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1), True, oriented=False)
        phi = sh.SignedHeatSolver(mesh, intrinsic=False).distance(circle).values
        errors.append(np.sqrt(np.mean((phi - np.abs(np.hypot(*mesh.vertices[:, :2].T) - 0.55)) ** 2)))
    assert np.polyfit(np.log([12, 24, 48]), np.log(errors), 1)[0] < -0.9


def test_embedding_on_a_nonmanifold_surface():
    pages = book(3, 16)
    line = pages.polyline([[0.33, 0, 0.21], [0.33, 0, 0.83]], oriented=False)
    phi = sh.SignedHeatSolver(pages, intrinsic=False).distance(line).values
    radius = np.hypot(pages.vertices[:, 0], pages.vertices[:, 1])
    on_page = pages.vertices[:, 0] > 1e-9
    exact = np.where(on_page, np.abs(radius - 0.33), radius + 0.33)
    middle = np.abs(pages.vertices[:, 2] - 0.5) < 0.2
    assert np.abs(phi - exact)[middle].max() < 0.06


def test_an_oriented_curve_that_meets_an_embedded_one_is_the_same_curve():
    mesh = square(16, 0.3)
    straight = mesh.polyline([[-0.9, 0.0713, 0], [0.9, 0.0713, 0]])
    stub = mesh.polyline([[0.9, 0.0713, 0], [0.95, 0.0713, 0]], oriented=False)
    alone = sh.SignedHeatSolver(mesh, intrinsic=False).distance(straight, sh.constraints.Free()).values
    together = sh.SignedHeatSolver(mesh, intrinsic=False).distance([straight, stub], sh.constraints.Free())
    assert together.diagnostics.note(VerticesAdded).vertices_added > 10  # the whole curve was embedded
    left = mesh.vertices[:, 0] < 0
    assert np.abs(together.values - alone)[left].max() < 0.06


@pytest.mark.parametrize("mesh", [band(40, 6, twisted=True), sphere(3)], ids=["Moebius strip", "sphere"])
def test_faces_turned_over_change_nothing_for_embedded_curves_and_points(mesh):
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    near = centers[np.argsort(np.linalg.norm(centers - centers[17], axis=1))]
    unoriented, oriented = mesh.polyline(near[[0, 40, 90]], oriented=False), mesh.polyline(near[[20, 60]])
    step, up = np.diff(positions(mesh, oriented), axis=0), mesh.face_area_vectors[oriented.faces[:-1]]
    left = np.cross(up / np.linalg.norm(up, axis=1, keepdims=True), step)

    def found(m):
        def moved(source):
            corners = (mesh.faces[source.faces][:, None] == m.faces[source.faces][:, :, None]).argmax(axis=2)
            return np.take_along_axis(source.barycentric, corners, axis=1)

        solver = sh.SignedHeatSolver(m, intrinsic=False)
        curve = sh.Curve(unoriented.faces, moved(unoriented), oriented=False)
        across = sh.Curve(oriented.faces, moved(oriented), normals=left)
        points = sh.SurfacePoints(oriented.faces[3:5], moved(oriented)[3:5])
        return [solver.distance(sources).values for sources in (curve, [curve, across], points)]

    reference = found(mesh)
    for seed in (0, 1):
        for ours, phi in zip(found(flipped(mesh, 0.4, seed)), reference, strict=True):
            assert np.abs(ours - phi).max() < 1e-11


def test_moving_scaling_and_renumbering_change_nothing():
    mesh = square(14, 0.25)
    line = mesh.polyline([[-0.7, -0.61, 0], [0.5, 0.43, 0]], oriented=False)
    loop = mesh.level_set(np.hypot(mesh.vertices[:, 0] - 0.3, mesh.vertices[:, 1] + 0.4), 0.35)[0]
    reference = sh.SignedHeatSolver(mesh, intrinsic=False).distance([line, loop]).values
    rng = np.random.default_rng(0)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    moved = sh.TriangleMesh(7 * mesh.vertices @ turn.T + [3, -5, 2], mesh.faces)
    assert (
        np.abs(sh.SignedHeatSolver(moved, intrinsic=False).distance([line, loop]).values / 7 - reference).max() < 1e-9
    )

    vertices, faces = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    new_vertex, new_face = np.argsort(vertices), np.argsort(faces)
    shuffled = sh.TriangleMesh(mesh.vertices[vertices], new_vertex[mesh.faces][faces])
    sources = [sh.Curve(new_face[c.faces], c.barycentric, c.closed, c.oriented) for c in (line, loop)]
    phi = sh.SignedHeatSolver(shuffled, intrinsic=False).distance(sources).values
    assert np.abs(phi[new_vertex] - reference).max() < 1e-9
