"""What `inspect` counts, on shapes of which it is known."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples
from signedheat.cli import main
from signedheat.shapes.inspection import inspect


def counts(mesh, *names):
    report = inspect(mesh)
    return tuple(getattr(report, name) for name in names)


@pytest.mark.parametrize(("mesh", "euler"), [(samples.sphere(3), 2), (samples.torus(), 0)], ids=["sphere", "torus"])
def test_closed_surfaces_have_nothing_wrong(mesh, euler):
    report = inspect(mesh)
    assert report.n_vertices - report.n_edges + report.n_faces == euler
    assert report.is_closed
    assert report.is_manifold
    wrong = ("borders", "inconsistent_edges", "degenerate_faces", "duplicate_faces", "duplicate_vertices")
    assert counts(mesh, *wrong, "unreferenced_vertices", "components") == (0, 0, 0, 0, 0, 0, 1)
    np.testing.assert_allclose(report.area, mesh.face_areas.sum(), rtol=1e-12)


def test_a_soup_of_closed_faces_is_closed():
    mesh = samples.soup(samples.sphere(1))
    found = counts(mesh, "open_edges", "borders", "components", "duplicate_vertices", "nonmanifold_vertices")
    assert found == (0, 0, 1, 240 - 42, 0)


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (300.0, -20.0, 7.0)])
@pytest.mark.parametrize("kind", ["whole", "soup", "rounding in one corner", "hole", "touching along an edge"])
def test_all_that_say_closed_agree(kind, place, tmp_path, capsys):
    """`info`, `fill`, `watertight` and the mesh itself, of a file and of a mesh."""
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    second = box((1, 1, 0), (2, 2, 1)) if "touching" in kind else box((3, 0, 0), (4, 1, 2))
    mesh = samples.union(box((0, 0, 0), (1, 1, 1)), second)
    vertices, faces = mesh.vertices @ turn.T + place, mesh.faces[1:] if kind == "hole" else mesh.faces
    vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    if kind == "rounding in one corner":
        vertices = vertices.astype(np.float32)
        vertices[5] += np.spacing(np.abs(vertices[5]))
    if kind == "whole":
        vertices, faces = mesh.vertices @ turn.T + place, mesh.faces
    closed = kind in ("whole", "soup", "rounding in one corner")
    path = tmp_path / "shape.stl"
    sh.TriangleMesh(vertices, faces).save(path)
    for shape in (sh.TriangleMesh(vertices, faces), sh.read(path)):
        report = inspect(shape)
        assert shape.is_watertight == closed
        assert (report.open_edges + report.nonmanifold_edges == 0) == closed
        assert len(sh.fill_holes(shape).filled) == (kind == "hole")
        if kind == "hole":
            with refused(sh.errors.GeometryError):
                shape.volume  # noqa: B018
        else:
            assert shape.volume == pytest.approx(2.0 if "touching" in kind else 3.0, rel=1e-4)
    main(["watertight", str(path), "-o", str(tmp_path / "made.ply"), "--workers", "1", "--json"])
    (found,) = json.loads(capsys.readouterr().out)["shapes"]
    assert found["openings"] == (kind == "hole") and found["bad_edges"] == 0
    assert sh.read(tmp_path / "made.ply").is_watertight


def test_two_cones_at_one_tip_are_connected_but_not_manifold():
    ring = [[1, 0, 1], [0, 1, 1], [-1, -1, 1]]
    vertices = [[0, 0, 0], *ring, *[[x, y, -z] for x, y, z in ring]]
    mesh = sh.TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 5, 4], [0, 6, 5], [0, 4, 6]])
    assert counts(mesh, "components", "nonmanifold_vertices", "nonmanifold_edges", "borders") == (1, 1, 0, 2)


def test_pages_of_a_book_meet_at_a_nonmanifold_edge():
    mesh = sh.TriangleMesh([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, 2], [0, 1, 3], [1, 0, 4]])
    found = counts(mesh, "nonmanifold_edges", "nonmanifold_vertices", "open_edges", "borders", "inconsistent_edges")
    assert found == (1, 2, 6, 1, 0)


def test_a_flipped_face_disagrees_with_its_three_neighbours():
    sphere = samples.sphere(2)
    faces = sphere.faces.copy()
    faces[7] = faces[7, ::-1]
    assert counts(sh.TriangleMesh(sphere.vertices, faces), "inconsistent_edges") == (3,)


def test_degenerate_duplicate_and_unreferenced_elements():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, 0], [9, 9, 9], [0, 0, 0]]
    faces = [[0, 1, 2], [2, 1, 0], [1, 3, 2], [0, 0, 1], [1, 2, 0]]
    names = ("degenerate_faces", "duplicate_faces", "unreferenced_vertices", "duplicate_vertices")
    assert counts(sh.TriangleMesh(vertices, faces), *names) == (2, 2, 2, 1)
    assert inspect(sh.TriangleMesh(vertices, faces)).upper == (1.0, 1.0, 0.0)


def test_polygons_count_as_their_triangles_do():
    mesh = samples.broken_duck()
    assert inspect(mesh) == inspect(sh.PolygonMesh(mesh.vertices, mesh.faces))
    square = sh.PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3], [3, 2, 1, 0]])
    assert counts(square, "n_edges", "duplicate_faces", "corners_per_face") == (4, 1, (4, 4))


def test_counts_do_not_depend_on_the_numbering():
    mesh, rng = samples.broken_duck(), np.random.default_rng(0)
    names = rng.permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[names] = mesh.vertices
    shuffled = sh.TriangleMesh(vertices, np.roll(names[mesh.faces][rng.permutation(mesh.n_faces)], 1, axis=1))
    one, other = vars(inspect(mesh)), vars(inspect(shuffled))
    assert one.pop("area") == pytest.approx(other.pop("area"))
    assert one == other


def test_point_clouds():
    cloud = sh.PointCloud([[0, 0, 0], [1, 2, 3], [0, 0, 0]], normals=np.eye(3))
    report = inspect(cloud)
    assert (report.n_points, report.has_normals, report.has_areas, report.duplicate_points) == (3, True, False, 1)
    assert report.upper == (1.0, 2.0, 3.0)


def test_the_duck_is_broken_in_every_way_the_demo_says():
    report = inspect(samples.broken_duck())
    assert report.open_edges > 100
    assert report.inconsistent_edges > 100
    assert report.duplicate_faces > 100
    assert report.components == 2
    assert inspect(samples.duck()).is_closed
