"""What `inspect` counts, on shapes of which it is known."""

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.inspection import inspect


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


def test_soup_is_all_borders():
    mesh = samples.soup(samples.sphere(1))
    found = counts(mesh, "open_edges", "borders", "components", "duplicate_vertices", "nonmanifold_vertices")
    assert found == (240, 80, 80, 240 - 42, 0)


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
