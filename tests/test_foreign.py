"""Objects of other packages, and pairs of arrays, are taken wherever a shape is."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
import trimesh

import signedheat as sh
from refusals import refused
from signedheat import samples, view

BALL = samples.sphere(2)
CUBE = sh.PolygonMesh(
    [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)],
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]],
)


def placed_in_a_scene():
    """A scene with the ball, moved back to where it was by its transform."""
    moved = trimesh.Trimesh(BALL.vertices + 5.0, BALL.faces, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(moved, transform=trimesh.transformations.translation_matrix([-5.0, -5.0, -5.0]))
    return scene


RING = BALL.level_set(BALL.vertices[:, 2], 0.1)
ARCS = [sh.Curve(RING[0].faces[part], RING[0].barycentric[part]) for part in (slice(30), slice(33, 44))]
ARCS[1] = ARCS[1].reversed()


def places_of(curve):
    return np.einsum("nk,nkd->nd", curve.barycentric, BALL.vertices[BALL.faces[curve.faces]])


class OwnTrimesh(trimesh.Trimesh):
    """A class of someone's own, derived from trimesh's."""


BALLS = {
    "trimesh": BALL.to_trimesh,
    "derived class": lambda: OwnTrimesh(BALL.vertices, BALL.faces, process=False),
    "scene": placed_in_a_scene,
    "pyvista": BALL.to_pyvista,
    "unstructured": lambda: BALL.to_pyvista().cast_to_unstructured_grid(),
    "blocks": lambda: pytest.importorskip("pyvista").MultiBlock([BALL.to_pyvista()]),
    "meshio": BALL.to_meshio,
    "arrays": lambda: (np.array(BALL.vertices), np.array(BALL.faces)),
    "unsigned": lambda: [BALL.vertices.astype(np.float32), BALL.faces.astype(np.uint16)],
    "lists": lambda: (BALL.vertices.tolist(), BALL.faces.tolist()),
    "open3d": lambda: pytest.importorskip("open3d") and BALL.to_open3d(),
}


@pytest.mark.parametrize("make", BALLS.values(), ids=BALLS)
def test_shapes_of_other_packages_keep_vertices_and_faces(make):
    if make is BALLS["pyvista"]:
        pytest.importorskip("pyvista")
    shape = sh.as_shape(make())
    assert isinstance(shape, sh.TriangleMesh)
    assert np.array_equal(shape.faces, BALL.faces)
    assert np.abs(shape.vertices - BALL.vertices).max() < 1e-6


TAKERS = {
    "signed_distance": lambda shape: sh.signed_distance(shape, resolution=12).values,
    "signed_distance of several": lambda shape: sh.signed_distance([shape], resolution=12).values,
    "solver": lambda shape: sh.SignedHeatSolver(sh.Grid.around(BALL.bounds, 12)).distance(shape).values,
    "many": lambda shape: sh.SignedHeatSolver(sh.Grid.around(BALL.bounds, 12)).distance_many([shape])[0].values,
    "grid": lambda shape: sh.Grid.around(shape, 12).origin,
    "orient": lambda shape: sh.orient(shape).faces,
    "complete": lambda shape: sh.complete(shape).triangles,
    "dilate": lambda shape: sh.morphology.dilate(shape, 0.2, resolution=16).vertices,
    "shell": lambda shape: sh.morphology.shell(shape, -0.3, 0.3, resolution=16).vertices,
    "thicken": lambda shape: sh.morphology.thicken(shape, 0.4, resolution=16).vertices,
    "tetrahedralize": lambda shape: sh.tetrahedralize(shape, resolution=2).vertices,
    "domain": lambda shape: sh.SignedHeatSolver(shape).distance(BALL.points_at(0)).values,
    "signed_distance of curves": lambda shape: sh.signed_distance(RING, shape).values,
    "piecewise_distance": lambda shape: sh.piecewise_distance(RING, shape).values,
    "close_curves": lambda shape: sh.close_curves(ARCS, shape)[0].barycentric,
    "orient curves": lambda shape: sh.orient(ARCS, shape)[1].faces,
    "intrinsic_delaunay": lambda shape: sh.intrinsic_delaunay(shape).triangles.edge_lengths,
    "transform": lambda shape: sh.transform(shape, np.diag([2.0, 1, -1, 1])).faces,
}


@pytest.mark.parametrize("take", TAKERS.values(), ids=TAKERS)
def test_they_are_taken_wherever_a_shape_is(take):
    expected = take(BALL)
    for given in (BALL.to_trimesh(), (BALL.vertices, BALL.faces)):
        assert np.array_equal(take(given), expected)


@pytest.mark.usefixtures("small_pictures")
def test_they_are_saved_and_drawn_and_hold_the_curves_of_files(tmp_path):
    pictures, field = {}, sh.signed_distance(BALL, resolution=12)
    for name, given in {"own": BALL, "trimesh": BALL.to_trimesh(), "arrays": (BALL.vertices, BALL.faces)}.items():
        sh.save(given, tmp_path / f"{name}.ply")
        assert np.array_equal(sh.read(tmp_path / f"{name}.ply").faces, BALL.faces)
        sh.io.write_curves(ARCS, tmp_path / f"{name}.json", given)
        again = sh.io.read_curves(tmp_path / f"{name}.json", given)
        assert np.abs(places_of(again[1]) - places_of(ARCS[1])).max() < 1e-12
        view.save_scene(given, tmp_path / f"{name}.png")
        view.save_slices(field, tmp_path / f"{name}-slices.png", given)
        view.save_row([("ball", given)], tmp_path / f"{name}-row.png")
        pictures[name] = [(tmp_path / f"{name}{end}.png").read_bytes() for end in ("", "-slices", "-row")]
    assert pictures["own"] == pictures["trimesh"] == pictures["arrays"]
    for take in (
        lambda: sh.save("ball", tmp_path / "ball.ply"),
        lambda: view.save_scene(3, tmp_path / "3.png"),
    ):
        with refused(sh.errors.UnsupportedTypeError):
            take()


def test_two_shapes_are_no_pair_of_arrays():
    far = samples.sphere(2, center=(3.0, 0, 0))
    both = sh.signed_distance([BALL.to_trimesh(), far.to_trimesh()], resolution=32)
    assert both([[0, 0, 0], [3, 0, 0], [1.5, 0, 0]]).tolist() == pytest.approx([-1, -1, 0.5], abs=0.3)
    pairs = sh.signed_distance([(BALL.vertices, BALL.faces), (far.vertices, far.faces)], resolution=32)
    assert np.array_equal(pairs.values, both.values)


def test_polygons_and_points_and_tets_keep_their_kind():
    corners = [polygon.tolist() for polygon in CUBE.polygons]
    mixed = [*corners[:-1], corners[-1][:3], [corners[-1][0], *corners[-1][2:]]]
    assert [len(p) for p in sh.as_shape((CUBE.vertices, mixed)).polygons] == [4] * 5 + [3] * 2
    for made in (CUBE.to_meshio(), (CUBE.vertices, np.array(corners))):
        assert [p.tolist() for p in sh.as_shape(made).polygons] == corners
    assert isinstance(sh.as_shape(trimesh.PointCloud(BALL.vertices)), sh.PointCloud)
    tets = sh.tetrahedralize(BALL, resolution=2)
    assert np.array_equal(sh.as_shape(tets.to_meshio()).tets, tets.tets)


def test_polygons_and_points_and_tets_come_from_pyvista():
    pyvista = pytest.importorskip("pyvista")
    again = sh.as_shape(CUBE.to_pyvista().cast_to_unstructured_grid())
    assert [p.tolist() for p in again.polygons] == [p.tolist() for p in CUBE.polygons]
    cloud = samples.oriented_points(BALL, 50)
    assert np.abs(sh.as_shape(cloud.to_pyvista()).normals - cloud.normals).max() < 1e-15
    tets = sh.tetrahedralize(BALL, resolution=2)
    assert np.array_equal(sh.as_shape(tets.to_pyvista()).tets, tets.tets)
    boundary = sh.TriangleMesh.from_pyvista(tets.to_pyvista())
    assert np.array_equal(boundary.faces, tets.boundary.faces)
    assert sh.PolygonMesh.from_pyvista(pyvista.Cube()).n_polygons == 6


def test_points_and_meshes_go_to_open3d_and_back():
    open3d = pytest.importorskip("open3d")
    cloud = samples.oriented_points(BALL, 50)
    again = sh.as_shape(cloud.to_open3d())
    assert np.array_equal(again.points, cloud.points) and np.abs(again.normals - cloud.normals).max() < 1e-12
    tensors = open3d.t.geometry.TriangleMesh.from_legacy(BALL.to_open3d())
    assert np.array_equal(sh.as_shape(tensors).faces, BALL.faces)
    with pytest.raises(sh.errors.GeometryError):
        CUBE.to_open3d()
    with pytest.raises(sh.errors.UnsupportedTypeError) as told:
        sh.as_shape(open3d.geometry.LineSet())
    assert told.value.element == "LineSet" and told.value.remedy


@pytest.mark.parametrize("take", [sh.as_shape, sh.signed_distance, sh.TriangleMesh.from_trimesh])
def test_what_is_no_shape_is_refused_with_a_remedy(take):
    lines = trimesh.load_path(np.array([[0.0, 0], [1, 1]]))
    for wrong in ("ball.stl", 3.0, lines):
        with pytest.raises(sh.errors.SignedHeatError) as told:
            take(wrong)
        assert told.value.remedy
    with pytest.raises(sh.errors.SignedHeatError) as told:
        take(trimesh.Scene())
    assert told.value.remedy


def test_volumes_lines_and_strips_of_pyvista_are_refused_with_a_remedy():
    pyvista = pytest.importorskip("pyvista")
    image = pyvista.ImageData(dimensions=(3, 3, 3))
    for wrong in (image, image.cast_to_unstructured_grid(), pyvista.Line(), BALL.to_pyvista().strip()):
        for take in (sh.as_shape, sh.TriangleMesh.from_pyvista):
            with pytest.raises(sh.errors.SignedHeatError) as told:
                take(wrong)
            assert told.value.remedy


def test_wrong_arrays_are_told():
    with pytest.raises(sh.errors.GeometryError):
        sh.signed_distance((BALL.vertices, BALL.faces + 1))
    with pytest.raises(sh.errors.GeometryError):
        sh.as_shape((BALL.vertices * np.nan, BALL.faces))
    for no_pair in ((BALL.vertices, BALL.vertices), (BALL.faces,), (1.0, 2.0)):
        with pytest.raises(sh.errors.UnsupportedTypeError):
            sh.as_shape(no_pair)


def test_meshes_of_meshio_without_faces_are_points():
    points = meshio.Mesh(BALL.vertices, [("vertex", np.arange(BALL.n_vertices)[:, None])])
    assert sh.as_shape(points).n_points == BALL.n_vertices


@pytest.mark.parametrize(("thing", "named"), [("part.stl", "sh.read"), (np.zeros((4, 3)), "PointCloud")])
def test_paths_and_bare_points_are_told_what_to_pass(thing, named):
    for take in (sh.signed_distance, sh.as_shape):
        with refused(sh.errors.SignedHeatError) as caught:
            take(thing)
        assert named in caught.value.remedy


@pytest.mark.parametrize(("kind", "corners"), [("line", 2), ("hexahedron", 8)])
def test_lines_and_other_cells_of_meshio_are_no_points(kind, corners):
    cells = meshio.Mesh(BALL.vertices, [(kind, np.arange(2 * corners).reshape(2, corners))])
    for take in (sh.as_shape, sh.signed_distance, sh.TriangleMesh.from_meshio):
        with refused(sh.errors.UnsupportedTypeError, "Mesh") as caught:
            take(cells)
        assert kind in caught.value.remedy
    assert sh.PointCloud.from_meshio(cells).n_points == BALL.n_vertices  # asked for


def test_tets_of_meshio_that_are_no_rows_of_four_vertices_are_refused():
    mesh = meshio.Mesh(np.eye(4, 3), [("tetra", np.arange(4)[None])])
    mesh.cells[0].data = np.zeros((1, 8), dtype=int)
    with refused(sh.errors.GeometryError, "tets"):
        sh.TetMesh.from_meshio(mesh)


def test_volumes_of_other_cells_beside_tets_are_refused_however_they_come(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    corners = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
    voxel = pyvista.UnstructuredGrid({10: np.array([[0, 1, 2, 4]]), 11: np.arange(8)[None]}, corners)
    voxel.save(tmp_path / "voxel.vtu")
    mixed = meshio.Mesh(corners, [("tetra", [[0, 1, 2, 4]]), ("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]])])
    for make, thing in (
        (sh.TetMesh.from_pyvista, voxel),
        (sh.TetMesh.from_meshio, mixed),
        (sh.as_shape, voxel),
        (sh.as_shape, mixed),
        (sh.read, tmp_path / "voxel.vtu"),
    ):
        with refused(sh.errors.GeometryError) as caught:
            make(thing)
        assert "not tets alone" in caught.value.cause


class OnlyDlpack:
    """An array of a library that NumPy cannot read otherwise."""

    def __init__(self, values):
        self.values = np.array(values)

    def __dlpack__(self, stream=None, **options):
        return self.values.__dlpack__()

    def __dlpack_device__(self):
        return self.values.__dlpack_device__()


def test_arrays_through_dlpack():
    ball = samples.sphere(2)
    shape = sh.TriangleMesh(OnlyDlpack(ball.vertices), OnlyDlpack(np.array(ball.faces)))
    points = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    found = sh.complete(shape).distance(OnlyDlpack(points))
    np.testing.assert_array_equal(found, sh.complete(ball).distance(points))
    np.testing.assert_array_equal(np.from_dlpack(found), found)
    levels = np.array([1.0, -1.0, 3.0])
    np.testing.assert_array_equal(sh.redistance(OnlyDlpack(levels)), sh.redistance(levels))
