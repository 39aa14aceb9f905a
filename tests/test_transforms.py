"""Affine maps of shapes: places, insides, normals and areas."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import enclosed_volume
from signedheat import samples

MAPS = {
    "turned": np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0],
    "mirrored": np.diag([1.0, 1, -1]),
    "sheared": np.array([[1.0, 0.5, 0], [0, 2, 0], [0.3, 0, -0.7]]),
}


def matrix(kind):
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = MAPS[kind], [1, 2, 3]
    return whole


@pytest.mark.parametrize("kind", ["turned", "mirrored"])
def test_solids_stay_what_they_are(kind):
    """Distances of moved points to the moved solid are those before, holes closed as they were; places know faces."""
    solid = sh.complete(samples.without_patches(samples.sphere(3), 3, 0.4))
    moved = sh.transform(solid, matrix(kind))
    points = np.random.default_rng(1).normal(size=(50, 3))
    places = points @ MAPS[kind].T + [1, 2, 3]
    np.testing.assert_allclose(moved.distance(places), solid.distance(points), atol=1e-12)
    found = moved.closest(places)
    given = found.faces >= 0
    corners = moved.source.vertices[moved.source.faces[found.faces[given]]]
    rebuilt = (found.barycentric[given, :, None] * corners).sum(axis=1)
    np.testing.assert_allclose(rebuilt, found.points[given], atol=1e-12)


@pytest.mark.parametrize("kind", MAPS)
def test_volumes_grow_by_the_determinant_and_stay_positive(kind):
    ball = samples.sphere(2)
    polygons = sh.PolygonMesh(ball.vertices, ball.faces)
    moved = sh.transform(ball, matrix(kind))
    np.testing.assert_allclose(moved.vertices, ball.vertices @ MAPS[kind].T + [1, 2, 3])
    assert enclosed_volume(moved) == pytest.approx(enclosed_volume(ball) * abs(np.linalg.det(MAPS[kind])))
    assert enclosed_volume(sh.transform(polygons, matrix(kind)[:3]).triangulation) == pytest.approx(
        enclosed_volume(moved)
    )
    tets = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    assert enclosed_volume(sh.transform(tets, matrix(kind)).boundary) > 0
    voxel = sh.DigitalSurface(np.ones((1, 1, 1), dtype=bool))
    assert enclosed_volume(sh.transform(voxel, matrix(kind)).triangulation) == pytest.approx(
        abs(np.linalg.det(MAPS[kind]))
    )


@pytest.mark.parametrize("kind", MAPS)
def test_normals_and_areas_of_points_are_those_of_their_planes(kind):
    ball = samples.sphere(3)
    centers, areas = ball.vertices[ball.faces].mean(axis=1), ball.face_area_vectors
    sizes = np.linalg.norm(areas, axis=1)
    moved = sh.transform(sh.PointCloud(centers, areas / sizes[:, None], sizes), matrix(kind))
    same = sh.transform(ball, matrix(kind)).face_area_vectors
    np.testing.assert_allclose(moved.normals * moved.areas[:, None], same, atol=1e-12)


def test_what_is_no_map_is_refused():
    ball = samples.sphere(0)
    for wrong in (np.eye(3), np.diag([1, 1, 0, 1]), np.diag([1, 1, 1, 2]), np.full((3, 4), np.nan)):
        with pytest.raises(sh.errors.GeometryError):
            sh.transform(ball, wrong)
    for wrong in (ball.vertices, "ball.stl"):
        with pytest.raises(sh.errors.UnsupportedTypeError) as caught:
            sh.transform(wrong, np.eye(4))
        assert ("PointCloud" if isinstance(wrong, np.ndarray) else "sh.read") in caught.value.remedy
    with refused(sh.errors.GeometryError, "points"):
        sh.transform(sh.PointCloud([[0, 0], [1, 1]]), np.eye(4))


@pytest.mark.parametrize("entry", [np.nan, np.inf, 1e60, 1e308, "a", None])
def test_matrices_beyond_numbers_are_refused_without_a_warning(entry):
    ball = samples.sphere(1)
    with pytest.raises(sh.errors.GeometryError):
        sh.transform(ball, np.full((3, 4), entry))
    with pytest.raises(sh.errors.GeometryError):
        sh.transform(ball, [[entry, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]])
