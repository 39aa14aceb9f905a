from dataclasses import replace

import numpy as np
import pytest

import signedheat as sh
from shapes.grid_cases import sphere
from signedheat.compiled import compiled
from signedheat.samples import torus
from signedheat.search.face_tree import FaceFeatures, FaceTree
from signedheat.search.nearest_triangles import foot_on_triangle


def soup(n, seed=0):
    """Triangles of every size and direction, needles and points among them."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 10 ** rng.uniform(-3, 0, (n, 1, 1))
    corners[::17, 2] = corners[::17, 1]
    corners[::29, 1:] = corners[::29, :1]
    return sh.TriangleMesh(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))


@compiled
def least_squares_of(rows, points):
    """(n,) the least squared distance of each point to a face, all of which are tried."""
    least = np.full(len(points), np.inf)
    for i in range(len(points)):
        for f in range(len(rows)):
            least[i] = min(least[i], foot_on_triangle(rows, f, points[i, 0], points[i, 1], points[i, 2])[0])
    return least


@pytest.mark.parametrize(
    "mesh", [sphere(700), torus(n_around=40, n_across=20), soup(301), soup(3), sphere(80, 1e-3, (50.0, 0, 0))]
)
def test_the_nearest_face_is_that_of_all(mesh):
    features = FaceFeatures.of(mesh.vertices, mesh.faces)
    tree = FaceTree.of(features)
    rng = np.random.default_rng(1)
    middle, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
    points = middle + size * np.concatenate([rng.uniform(-0.6, 0.6, (150, 3)), rng.uniform(-4, 4, (150, 3))])
    nearest = np.sqrt(least_squares_of(features.rows, points))
    np.testing.assert_allclose(tree.distances(points), nearest, rtol=1e-9, atol=1e-12 * size)
    np.testing.assert_allclose(tree.search(points).distances, nearest, rtol=1e-9, atol=1e-12 * size)


def test_copies_of_faces_go_also_where_the_surface_ends():
    square, faces = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    once = FaceFeatures.of(square, faces)
    for copies in (faces[:1], np.roll(faces, 1, axis=1)):
        twice = FaceFeatures.of(square, np.concatenate([faces, copies]))
        np.testing.assert_array_equal(twice.edge_regular[twice.edges], once.edge_regular[once.edges])
    turned = FaceFeatures.of(square, np.concatenate([faces, faces[:1, ::-1]]))
    assert len(turned.faces) == 3


def test_discs_hold_the_corners_of_what_is_below_them():
    mesh = torus(n_around=60, n_across=30)
    features = FaceFeatures.of(mesh.vertices, mesh.faces)
    tree = FaceTree.of(features)
    leaves = len(tree.tree.bounds) // 2
    corners = features.corners.reshape(-1, 3, 3)
    for node in range(leaves // 8, 2 * leaves):
        centre, normal, radius, thickness = np.split(tree.discs[node], [3, 6, 7])
        if thickness >= 0:
            low, high = node, node
            while low < leaves:
                low, high = 2 * low, 2 * high + 1
            items = tree.tree.items.reshape(leaves, -1)[low - leaves : high - leaves + 1].ravel()
            away = corners[items[items >= 0]].reshape(-1, 3) - centre
            along = away @ normal
            assert (np.abs(along) <= thickness + 1e-12).all()
            assert (np.linalg.norm(away - along[:, None] * normal, axis=1) <= radius + 1e-12).all()
    assert (tree.discs[leaves:, 7] >= 0).mean() > 0.5


def test_points_far_beyond_rounding_find_their_place_beside_near_ones():
    """At 10¹⁰⁰ radii all places of a ball are equally far, to rounding; the nearest still lies in that direction."""
    mesh = sphere(700)
    tree = FaceTree.of(FaceFeatures.of(mesh.vertices, mesh.faces))
    ways = np.random.default_rng(2).normal(size=(40, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = tree.search(np.concatenate([2 * ways, 1e100 * ways]))
    np.testing.assert_allclose(found.distances[40:], 1e100)
    for places in (found.places[:40], found.places[40:]):
        assert (np.einsum("ij,ij->i", places, ways) > 0.99).all()


def test_no_tree_is_built_of_faces_without_extent():
    with pytest.raises(sh.errors.SourceError):
        FaceTree.of_triangles(np.ones((3, 3, 3)))
    with pytest.raises(sh.errors.SourceError):
        replace(sh.complete(sh.samples.sphere(1)), triangles=np.empty((0, 3, 3)))
