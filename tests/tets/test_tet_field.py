"""Fields on tets: values, gradients, level sets, files; lattices around shapes; the example."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import assert_closed_manifold, enclosed_volume
from shapes.tet_cases import boxes, lattice, rectangle, rms, sphere

pytestmark = pytest.mark.usefixtures("forked_parsers")


@pytest.fixture(scope="module")
def ball():
    """Exact distance from the unit sphere at the vertices of a lattice."""
    mesh = lattice(10)
    return sh.Field(mesh, np.linalg.norm(mesh.vertices, axis=1) - 1)


def test_interpolation_is_linear_inside_and_straight_outside():
    mesh = boxes((3, 3, 3), 1.0, jitter=0.15)
    slope = np.array([0.3, -0.5, 0.8])
    phi = sh.Field(mesh, mesh.vertices @ slope + 1)
    points = np.random.default_rng(0).uniform(-2, 5, (500, 3))
    assert phi(points) == pytest.approx(points @ slope + 1, abs=1e-12)
    assert phi.gradient(points) == pytest.approx(np.tile(slope, (500, 1)), abs=1e-12)
    assert phi.cell_gradients == pytest.approx(np.tile(slope, (mesh.n_tets, 1)), abs=1e-12)
    assert phi([1.0, 1.0, 1.0]) == pytest.approx(1.6)
    with refused(sh.errors.GeometryError, "points"):
        phi([[0.0, 1.0]])
    with refused(sh.errors.GeometryError, "values"):
        sh.Field(mesh, [1.0, 2.0])


def test_level_sets_are_closed_manifold_and_face_outward(ball):
    for level, radius in ((0.0, 1.0), (-0.4, 0.6), (0.3, 1.3)):
        surface = ball.contour(level)
        assert_closed_manifold(surface)
        assert enclosed_volume(surface) == pytest.approx(4.19 * radius**3, rel=0.1)
    with refused(sh.errors.OutsideError, "level 9"):
        ball.contour(9.0)
    with refused(sh.errors.OutsideError):
        ball.offset(0.9)
    assert ball.offset(0.4).n_faces > 0


def test_level_sets_of_anything_are_closed_manifold(ball):
    mesh = ball.domain
    rng = np.random.default_rng(4)
    for values in (rng.normal(size=mesh.n_vertices), rng.integers(-1, 2, mesh.n_vertices) * 1.0, mesh.vertices[:, 0]):
        assert_closed_manifold(sh.Field(mesh, values).contour(0.0))


@pytest.mark.parametrize("slope", [(1, -1, 0.1), (-1, 1, 0.1), (0, 0, 1), (1, 1, 1), (-1, -1, -1)])
def test_level_sets_of_cubes_that_touch_along_an_edge_are_manifold(slope):
    mesh = boxes((2, 2, 1), 1.0, keep=lambda centres: (centres[:, 0] < 1) == (centres[:, 1] < 1))
    values = (mesh.vertices - [1.0, 1.0, 0.4]) @ np.array(slope)
    surface = sh.Field(mesh, values).contour()
    assert_closed_manifold(surface)
    other = sh.Field(mesh, -values).contour()
    assert enclosed_volume(surface) + enclosed_volume(other) == pytest.approx(2.0)


def test_level_sets_at_edges_without_faces_between_are_manifold():
    tets = [[0, 1, 2, 3], [0, 1, 4, 5]]
    mesh = sh.TetMesh([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], tets)
    surface = sh.Field(mesh, [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0]).contour()
    assert_closed_manifold(surface)


@pytest.mark.parametrize("ending", [".mesh", ".meshb", ".msh", ".vtu", ".vtk", ".ele", ".node"])
def test_meshes_survive_files(ending, tmp_path):
    mesh = boxes((2, 2, 1), 1.0, jitter=0.1)
    path = tmp_path / f"mesh{ending}"
    mesh.save(path)
    again = sh.read(path)
    assert (again.tets == mesh.tets).all()
    assert again.vertices == pytest.approx(mesh.vertices, abs=1e-15)
    sh.save(mesh, path)


def test_tetgen_files_may_count_from_one(tmp_path):
    (tmp_path / "one.node").write_text("# written by hand\n4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n")
    (tmp_path / "one.ele").write_text("1 4 0\n1 1 2 3 4\n")
    assert sh.read(tmp_path / "one.ele").tets.tolist() == [[0, 1, 2, 3]]


def test_bad_files_are_named(tmp_path):
    for ending in (".mesh", ".msh", ".vtu", ".vtk", ".ele"):
        path = tmp_path / f"bad{ending}"
        with refused(sh.errors.FileFormatError):
            sh.read(path)
        path.write_text("nonsense")
        path.with_suffix(".node").write_text("nonsense")
        with refused(sh.errors.FileFormatError):
            sh.read(path)
    good = tmp_path / "good.mesh"
    boxes((1, 1, 1), 1.0).save(good)
    good.write_bytes(good.read_bytes()[:-40])
    with refused(sh.errors.SignedHeatError):
        sh.read(good)


def test_surfaces_in_tet_formats_are_surfaces(tmp_path):
    import meshio

    flat = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))])
    meshio.medit.write(str(tmp_path / "flat.mesh"), flat)
    assert isinstance(sh.read(tmp_path / "flat.mesh"), sh.TriangleMesh)


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh"])
def test_fields_survive_files(ball, ending, tmp_path):
    values = ball.values.copy()
    values[3] = np.nan
    sh.Field(ball.domain, values).save(tmp_path / f"phi{ending}")
    again = sh.read_field(tmp_path / f"phi{ending}")
    assert isinstance(again.domain, sh.TetMesh)
    assert np.array_equal(again.values, values, equal_nan=True)
    assert (again.domain.tets == ball.domain.tets).all()
    with refused(sh.errors.FileFormatError):
        ball.save(tmp_path / "phi.stl")


def test_meshes_go_to_pyvista_and_back():
    pytest.importorskip("pyvista")
    mesh = boxes((2, 1, 1), 1.0)
    again = sh.TetMesh.from_pyvista(mesh.to_pyvista())
    assert (again.tets == mesh.tets).all() and (again.vertices == mesh.vertices).all()


@pytest.mark.parametrize(("grading", "resolution"), [(2.7, 16), (4.0, 16), (np.inf, 10)])
def test_lattices_fill_a_box_with_good_tets(grading, resolution):
    mesh = sh.tetrahedralize(sphere(3), resolution=resolution, padding=1.0, grading=grading)
    normals = mesh.geometry.area_vectors / np.linalg.norm(mesh.geometry.area_vectors, axis=2, keepdims=True)
    cosines = np.stack([np.einsum("mi,mi->m", normals[:, i], normals[:, j]) for i in range(4) for j in range(i)])
    angles = 180 - np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    assert 29.9 < angles.min() and angles.max() < 135.1
    assert mesh.tet_volumes.sum() == pytest.approx(np.prod(np.ptp(mesh.bounds, axis=0)), rel=1e-12)
    assert set(np.unique(mesh.faces.tet_counts)) == {1, 2}
    walls = mesh.vertices[np.unique(mesh.boundary.faces)]
    assert (np.isclose(walls, mesh.bounds[0]) | np.isclose(walls, mesh.bounds[1])).any(axis=1).all()
    if np.isfinite(grading):
        sizes = mesh.geometry.longest_edges
        away = np.abs(np.linalg.norm(mesh.tet_barycenters, axis=1) - 1)
        assert (sizes <= np.maximum(2 / resolution, away) + 2 / resolution).all() and sizes.max() > 1.9 * sizes.min()


def test_lattices_take_any_shape_in_space():
    soup = np.random.default_rng(2).uniform(-1, 1, (30, 3))
    for shape in (sh.TriangleMesh(soup, np.arange(30).reshape(10, 3)), sh.PointCloud(soup)):
        mesh = sh.tetrahedralize(shape, resolution=6)
        assert (mesh.bounds[0] <= soup.min(axis=0)).all() and (mesh.bounds[1] >= soup.max(axis=0)).all()
    with refused(sh.errors.GeometryError, "shape"):
        sh.tetrahedralize(sh.PointCloud([[1, 1, 1]]))
    with refused(sh.errors.GeometryError, "grading"):
        sh.tetrahedralize(sphere(1), grading=1.0)
    with refused(sh.errors.MemoryLimitError):
        sh.tetrahedralize(sphere(1), resolution=5000, grading=np.inf)


def test_a_broken_shape_is_completed():
    """A sphere without a fifth of its faces."""
    whole = sphere(3)
    keep = np.random.default_rng(0).random(whole.n_faces) > 0.2
    broken = sh.TriangleMesh(whole.vertices, whole.faces[keep])
    phi = sh.SignedHeatSolver(sh.tetrahedralize(broken, resolution=12)).distance(broken)
    exact = np.linalg.norm(phi.domain.vertices, axis=1) - 1
    assert rms(phi.values - exact) < 0.02
    surface = phi.contour()
    assert_closed_manifold(surface)
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 1).max() < 0.05


def test_open_level_sets_end_at_the_boundary():
    mesh = boxes((4, 4, 4), 0.5)
    phi = sh.SignedHeatSolver(mesh).distance(rectangle([0, 0, 0.8], [2, 0, 0], [0, 2, 0]))
    lid = phi.contour()
    assert_closed_manifold(lid)
    assert enclosed_volume(lid) == pytest.approx(4 * 0.8, rel=1e-6)
