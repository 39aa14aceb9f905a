"""Distance on surfaces as a result: values, gradients, contours, files, completed curves."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.surface_cases import band, flipped, positions, sphere, square
from signedheat.io.field_files import load_vertex_field


def field_on_sphere(subdivisions=4):
    mesh = sphere(subdivisions)
    return sh.SignedHeatSolver(mesh).distance(mesh.level_set(mesh.vertices[:, 2], 0.2))


def test_values_between_vertices_are_linear():
    mesh = square(9, 0.3)
    phi = sh.Field(mesh, mesh.vertices @ np.array([2.0, -1.0, 0.0]))
    curve = mesh.polyline([[-0.8, -0.7, 0], [0.3, 0.9, 0], [0.6, -0.2, 0]])
    exact = positions(mesh, curve) @ np.array([2.0, -1.0, 0.0])
    assert phi(curve) == pytest.approx(exact, abs=1e-14)
    assert phi(positions(mesh, curve) + np.array([0, 0, 0.1])) == pytest.approx(exact, abs=1e-14)
    assert np.abs(phi.gradient(curve) - [2, -1, 0]).max() < 1e-12
    with refused(sh.errors.SourceError, "face 9999"):
        phi(sh.SurfacePoints([9999], [[1, 0, 0]]))


def test_gradients_are_tangent_unit_and_grow_like_the_field():
    phi = field_on_sphere()
    mesh = phi.domain
    gradient = phi.cell_gradients
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    assert np.abs(np.einsum("ij,ij->i", gradient, mesh.face_area_vectors)).max() < 1e-14
    away = np.abs(centers[:, 2]) < 0.8
    north = np.array([0, 0, 1]) - centers[:, 2:] * centers / (centers**2).sum(axis=1, keepdims=True)
    north /= np.linalg.norm(north, axis=1, keepdims=True)
    assert np.abs(gradient - north)[away].max() < 0.15
    corners = mesh.vertices[mesh.faces]
    step = corners[:, 1] - corners[:, 0]
    rise = phi.values[mesh.faces[:, 1]] - phi.values[mesh.faces[:, 0]]
    assert np.abs(np.einsum("ij,ij->i", gradient, step) - rise).max() < 1e-13


def test_contours_close_and_round_trip_through_the_solver():
    phi = field_on_sphere()
    (curve,) = phi.contour(0.4)
    assert curve.closed and np.abs(phi(curve) - 0.4).max() < 1e-14
    again = sh.SignedHeatSolver(phi.domain).distance(curve)
    assert np.abs(again.values - (phi.values - 0.4))[np.abs(phi.values) < 0.8].max() < 0.03
    assert np.abs(phi(phi.contour(0.0)[0])).max() < 1e-14
    with refused(sh.errors.OutsideError, "level 100"):
        phi.contour(100.0)


def test_contours_are_the_same_lines_when_faces_are_turned_over():
    phi = field_on_sphere(3)
    turned = sh.Field(flipped(phi.domain), phi.values)
    (a,), (b,) = phi.contour(0.3), turned.contour(0.3)
    assert b.closed and a.n_points == b.n_points
    first = positions(phi.domain, a)
    second = positions(turned.domain, b)
    assert np.abs(first[np.lexsort(first.round(9).T)] - second[np.lexsort(second.round(9).T)]).max() < 1e-12
    gradient = turned.gradient(b)
    assert (np.einsum("ij,ij->i", b.normals, gradient) > 0).all()


def test_unreached_parts_are_left_out_of_contours():
    mesh = square(5)
    two = sh.TriangleMesh(
        np.concatenate([mesh.vertices, mesh.vertices + np.array([0, 0, 1])]),
        np.concatenate([mesh.faces, mesh.faces + 25]),
    )
    with pytest.warns(sh.errors.UnreachedWarning) as caught:
        phi = sh.SignedHeatSolver(two).distance(two.path([10, 11, 12, 13, 14]))
    assert caught[0].filename == __file__  # the line of the user, not one of ours
    assert np.isnan(phi.values[25:]).all() and phi.diagnostics.unreached.tolist() == list(range(25, 50))
    for curve in phi.contour(0.1):
        assert (positions(two, curve)[:, 2] == 0).all()


@pytest.mark.parametrize("extension", ["ply", "vtp", "obj"])
def test_fields_are_written_whole(extension, tmp_path):
    phi = field_on_sphere(2)
    path = tmp_path / f"phi.{extension}"
    phi.save(path)
    mesh = sh.read(path)
    assert (mesh.vertices == phi.domain.vertices).all() and (mesh.faces == phi.domain.faces).all()
    if extension == "obj":
        lines = [line.split() for line in path.read_text().splitlines()]
        assert [float(words[1]) for words in lines if words[0] == "vt"] == phi.values.tolist()
    if extension == "ply":
        import trimesh

        data = trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]["data"]
        assert np.array_equal(np.asarray(data["signed_distance"]).ravel(), phi.values)
    if extension == "vtp":
        pyvista = pytest.importorskip("pyvista")
        assert (pyvista.read(path)["signed_distance"] == phi.values).all()


def test_bad_names_and_damaged_files_are_refused(tmp_path):
    phi = field_on_sphere(1)
    with refused(sh.errors.FileFormatError):
        phi.save(tmp_path / "phi.docx")
    with refused(sh.errors.FileFormatError):
        phi.save(tmp_path / "missing" / "phi.ply")
    phi.save(tmp_path / "phi.npz")
    whole = (tmp_path / "phi.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(sh.errors.FileFormatError):
        load_vertex_field(tmp_path / "half.npz")


def test_broken_circles_are_closed():
    mesh = square(41, 0.2)
    turn = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    circle = 0.6 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    broken = [mesh.polyline(circle[a:b]) for a, b in ((0, 20), (28, 55), (66, 80), (85, 113))]
    whole = sh.close_curves(broken, mesh)
    longest = max(whole, key=lambda curve: curve.n_points)
    assert longest.closed
    radius = np.linalg.norm(positions(mesh, longest), axis=1)
    assert np.abs(radius - 0.6).max() < 0.05
    assert sh.SignedHeatSolver(mesh).distance(longest).values[840] > 0  # to the left is inside


def test_broken_rings_on_a_cylinder_are_closed():
    ring = band(64, 12, twisted=False)
    middle = [13 * i + 6 for i in range(64)]
    broken = [ring.path(middle[:20]), ring.path(middle[26:50])]
    (whole,) = sh.close_curves(broken, ring)
    assert whole.closed and np.abs(positions(ring, whole)[:, 2]).max() < 0.02


def test_a_refined_field_is_linear_on_its_pieces():
    """A long strip: φ at points is the same from the pieces as from the intrinsic triangles."""
    x = np.linspace(0, 9, 4)
    vertices = np.concatenate([np.stack([x, 0 * x + y, 0.3 * x * y], axis=1) for y in (0.0, 1.0)])
    a = np.arange(3)
    mesh = sh.TriangleMesh(vertices, np.concatenate([np.c_[a, a + 1, a + 5], np.c_[a, a + 5, a + 4]]))
    curve = mesh.polyline([[2.2, 0, 0], [2.9, 1, 0.87]])
    phi = sh.SignedHeatSolver(mesh, intrinsic=True).distance(curve)
    pieces = phi.expand()
    assert len(pieces.values) > mesh.n_vertices
    np.testing.assert_allclose(pieces.values[: mesh.n_vertices], phi.values, atol=1e-12)
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 200)
    points = np.einsum("pk,pkd->pd", weights, mesh.vertices[mesh.faces[np.arange(200) % 6]])
    np.testing.assert_allclose(pieces(points), phi(points), atol=1e-9)
    assert pieces.expand() is pieces


def slab():
    """A thin plate in two slivers and a flap; fields of two lines across it, each on triangles of its own."""
    plate = sh.TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0], [4, 3, 2]], [[0, 1, 2], [0, 2, 3], [3, 2, 4]])
    lines = [plate.polyline([[x, 0, 0], [x, 1, 0]]) for x in (3.0, 6.0)]
    return plate, [sh.SignedHeatSolver(plate, intrinsic=True).distance(line) for line in lines]


def test_gradient_is_that_of_the_finer_triangles():
    plate, (phi, _) = slab()
    rng = np.random.default_rng(0)
    faces, weights = rng.integers(0, 3, 60), rng.dirichlet(np.ones(3), 60)
    gradient = phi.gradient(sh.SurfacePoints(faces, weights))
    corners = plate.vertices[plate.faces[faces]]
    step = 1e-6 * weights.min(axis=1)[:, None]
    for k in (1, 2):
        move = step * (np.eye(3)[k] - np.eye(3)[0])
        rise = phi(sh.SurfacePoints(faces, weights + move)) - phi(sh.SurfacePoints(faces, weights - move))
        slope = np.einsum("pd,pd->p", gradient, corners[:, k] - corners[:, 0])
        assert np.median(np.abs(rise / (2 * step[:, 0]) - slope)) < 1e-6
    assert np.abs(np.einsum("pd,pd->p", gradient, plate.face_area_vectors[faces])).max() < 1e-12


def test_sets_of_regions_keep_the_finer_triangles():
    plate, (left, right) = slab()
    x = np.linspace(0.2, 8.8, 40)
    at = np.stack([x, np.full_like(x, 0.4), 0 * x], axis=1)
    between = (left & ~right) if left([[4.5, 0.4, 0]]) < 0 else (right & ~left)
    assert between.finer is not None and np.array_equal(between.finest.values[:5], between.values)
    inner = np.abs(x - 4.5) < 0.7  # where both lines are as near: a ridge between vertices
    exact = np.maximum(3 - x, x - 6)
    assert between(at)[~inner] == pytest.approx(exact[~inner], abs=0.1)
    assert between(at)[inner] == pytest.approx(exact[inner], abs=0.3)
    assert (~between)(at) == pytest.approx(-between(at), abs=1e-12)
    crossings = np.concatenate([positions(plate, curve) for curve in between.contour()])
    flat = crossings[crossings[:, 1] < 1]
    assert np.abs(np.abs(flat[:, 0] - 4.5) - 1.5).max() < 0.1
    other = sh.Field(plate, left.values)
    assert (left | other).finer is not None and (other | other).finer is None


def test_values_are_one_number_for_each_vertex():
    """As of fields on grids and tets: lists and whole numbers are taken, and anything else is refused."""
    mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    phi = sh.Field(mesh, [0, 1, 2, 3])
    assert phi([0.5, 0.5, 0.0]) == pytest.approx(1.0)
    assert (-phi).values.tolist() == [0, -1, -2, -3]
    assert (phi | sh.Field(mesh, np.arange(3, -1, -1))).values.tolist() == [0, 1, 1, 0]
    for wrong in (np.zeros(3), np.zeros(5), np.zeros((4, 1)), ["a"] * 4, [1j] * 4):
        with refused(sh.errors.GeometryError, "values"):
            sh.Field(mesh, wrong)
    with refused(sh.errors.UnsupportedTypeError, "domain"):
        sh.Field(mesh.vertices, np.zeros(4))
