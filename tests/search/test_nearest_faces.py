"""Distance to triangles: feet, features, bands of nodes, and searches from candidates."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from signedheat import samples
from signedheat.search.face_tree import FaceFeatures, FaceTree
from signedheat.search.nearest_triangles import (
    TriangleTree,
    away_from_triangle,
    foot_on_triangle,
    triangle_rows,
    weights_in,
)

UNIT = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "square", "feature", "foot"),
    [
        ((0.2, 0.3, 2.0), 4.0, 0, (0.2, 0.3, 0.0)),
        ((0.4, -1.0, 0.0), 1.0, 1, (0.4, 0.0, 0.0)),
        ((1.0, 1.0, 0.0), 0.5, 2, (0.5, 0.5, 0.0)),
        ((-2.0, 0.25, 0.0), 4.0, 3, (0.0, 0.25, 0.0)),
        ((-1.0, -1.0, 1.0), 3.0, 4, (0.0, 0.0, 0.0)),
        ((3.0, 0.0, 0.0), 4.0, 5, (1.0, 0.0, 0.0)),
        ((0.0, 3.0, 0.0), 4.0, 6, (0.0, 1.0, 0.0)),
    ],
)
def test_feet_on_every_feature(point, square, feature, foot):
    found = foot_on_triangle(triangle_rows(UNIT), 0, *point)
    assert found[1] == feature
    np.testing.assert_allclose([found[0], *found[2:]], [square, *foot], atol=1e-15)


@pytest.mark.parametrize(
    "corners", [np.zeros(9), np.array([0, 0, 0, 1, 0, 0, 1, 0, 0]), np.array([0, 0, 0, 2, 0, 0, 1, 0, 0])]
)
def test_triangles_without_area_are_segments_or_points(corners):
    points = np.random.default_rng(0).normal(size=(40, 3))
    rows = triangle_rows(np.ascontiguousarray(corners, dtype=float)[None])
    ends = corners.reshape(3, 3)[:, 0]
    feet = np.zeros((40, 3))
    feet[:, 0] = np.clip(points[:, 0], ends.min(), ends.max())
    for point, foot in zip(points, feet, strict=True):
        assert foot_on_triangle(rows, 0, *point)[0] == pytest.approx(((point - foot) ** 2).sum(), rel=1e-12)


def test_needles_and_specks_keep_their_distance():
    """A triangle and the same one cut into slivers are one set of points."""
    whole = np.array([[0.0, 0, 0], [1, 0, 0], [0.3, 1e-4, 0]])
    middle = whole.mean(axis=0)
    parts = np.array([[whole[k], whole[(k + 1) % 3], middle] for k in range(3)]).reshape(3, 9)
    for point in np.random.default_rng(1).normal(size=(50, 3)):
        one = foot_on_triangle(triangle_rows(whole.reshape(1, 9)), 0, *point)[0]
        rows = triangle_rows(parts)
        assert min(foot_on_triangle(rows, f, *point)[0] for f in range(3)) == pytest.approx(one, rel=1e-9)


def distance_without_rounding(corners, point):
    """Of the nearest place inside a triangle or on its sides, in fractions."""
    a, b, c, p = (np.array([Fraction(float(x)) for x in place], dtype=object) for place in (*corners, point))
    squares = []
    for start, end in ((a, b), (b, c), (c, a)):
        side, square = end - start, (end - start) @ (end - start)
        along = min(max((p - start) @ side / square, 0), 1) if square else 0
        squares.append((p - start - along * side) @ (p - start - along * side))
    u, v, w = b - a, c - a, p - a
    area = (u @ u) * (v @ v) - (u @ v) ** 2
    if area:
        s, t = ((v @ v) * (w @ u) - (u @ v) * (w @ v)) / area, ((u @ u) * (w @ v) - (u @ v) * (w @ u)) / area
        if s > 0 and t > 0 and s + t < 1:
            squares.append((w - s * u - t * v) @ (w - s * u - t * v))
    return float(min(squares)) ** 0.5


@pytest.mark.parametrize("short", [0, 1, 2, None])
@pytest.mark.parametrize("height", [1e-3, 1e-7, 1e-10, 1e-13, 1e-15, 1e-17, 0.0])
def test_slivers_are_exact(height, short):
    """Needles, with one short side, and slivers, with a corner on the opposite side, to rounding of their length."""
    rng = np.random.default_rng(4)
    for _ in range(6):
        triangle = rng.normal(size=(3, 3))
        near = triangle[0] + rng.uniform(-0.3, 1.3) * (triangle[1] - triangle[0]) if short is None else triangle[short]
        triangle[2 if short is None else (short + 1) % 3] = near + height * rng.normal(size=3)
        points = (
            rng.dirichlet(np.ones(3), 8) @ triangle
            + rng.normal(size=(8, 3)) * np.repeat([1e-9, 1e-3, 1, 9], 2)[:, None]
        )
        exact = np.array([distance_without_rounding(triangle, point) for point in points])
        rows, ways = triangle_rows(triangle.reshape(1, 9)), np.empty((1, 4, 8))
        away_from_triangle(rows, 0, points.T.copy(), 0, ways)
        feet = np.array([foot_on_triangle(rows, 0, *point)[2:] for point in points])
        np.testing.assert_allclose(np.linalg.norm(points - feet, axis=1), exact, rtol=0, atol=1e-13)
        np.testing.assert_allclose(np.sqrt(ways[0, 0]), exact, rtol=0, atol=1e-13)
        np.testing.assert_allclose(points - ways[0, 1:].T, feet, rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            weights_in(np.repeat(triangle[None], 8, axis=0), points) @ triangle, feet, atol=1e-13
        )


def turned_triangle(rng, lean, height, first):
    """A triangle with a side of length 1 and the third corner at (lean, height) over it, turned and moved."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [lean, height, 0.0]])
    return np.roll(flat @ turn.T + rng.uniform(-20, 20, 3), first, axis=0)


@pytest.mark.parametrize("lean", [0.0, 1.0, 0.5, 1e-17, -3.0, 1 - 1e-16])
@pytest.mark.parametrize("height", [1.0, 7.0, 1e-3, 1e-6, 1e-9, 1e-12])
def test_weights_give_the_place_back(lean, height):
    """On right-angled triangles, needles and slivers, inside and on their sides: to rounding of the coordinates."""
    rng = np.random.default_rng(5)
    for first in range(3):
        for _ in range(20):
            triangle = turned_triangle(rng, lean, height, first)
            weights = rng.dirichlet(np.ones(3), 24)
            weights[:9] *= np.repeat(1 - np.eye(3), 3, axis=0)  # on each side
            weights[9:12] = np.eye(3)
            places = weights / weights.sum(axis=1, keepdims=True) @ triangle
            found = weights_in(np.repeat(triangle[None], len(places), axis=0), places)
            np.testing.assert_allclose(found @ triangle, places, rtol=0, atol=1e-13 * max(20, height))
            assert found.min() >= 0 and np.abs(found.sum(axis=1) - 1).max() < 1e-15


def test_a_search_tells_distance_and_side():
    mesh = samples.sphere(3)
    features = FaceFeatures.of(mesh.vertices, mesh.faces)
    rng = np.random.default_rng(2)
    points = rng.normal(size=(300, 3))
    points *= rng.uniform(1.0, 3.0, size=(300, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    corners = features.corners.reshape(-1, 3, 3)
    found = FaceTree.of(features).search(points)
    faces, weights = TriangleTree.of(corners).nearest(points)
    distance = np.linalg.norm(np.einsum("pk,pki->pi", weights, corners[faces]) - points, axis=1)
    np.testing.assert_allclose(found.distances, distance, rtol=1e-12)
    assert found.regular.all()
    assert (found.cosines > 0).all()


def test_features_know_open_and_turned_edges():
    mesh = samples.sphere(2)
    whole = FaceFeatures.of(mesh.vertices, mesh.faces)
    assert whole.edge_regular.all() and whole.vertex_regular.all()
    assert np.einsum("ij,ij->i", whole.vertex_normals, whole.vertices).min() > 0
    holed = FaceFeatures.of(mesh.vertices, mesh.faces[1:])
    assert (~holed.edge_regular).sum() == 3 and (~holed.vertex_regular).sum() == 3
    turned = np.concatenate([mesh.faces[:1, ::-1], mesh.faces[1:]])
    assert (~FaceFeatures.of(mesh.vertices, turned).edge_regular).sum() == 3


def test_copies_and_faces_without_extent_do_not_count():
    mesh = samples.sphere(2)
    apart = samples.soup(mesh)
    again = np.roll(apart.faces[:50], 1, axis=1)
    flat = np.array([[0, 0, 1], [2, 2, 2]])
    features = FaceFeatures.of(apart.vertices, np.concatenate([apart.faces, again, flat]))
    assert len(features.rows) == mesh.n_faces
    assert features.edge_regular.all()


def test_a_folded_sheet_tells_no_side():
    """Two faces on each other, back to back: a wall without thickness."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    features = FaceFeatures.of(vertices, np.array([[0, 1, 2], [0, 2, 1]]))
    assert not features.edge_regular.any()
