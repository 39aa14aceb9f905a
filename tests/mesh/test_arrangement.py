"""Triangles divided where they meet: pieces have whole edges in common, and what was closed still is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from signedheat import samples
from signedheat.mesh.arrangement import arranged
from signedheat.mesh.components import connected_components
from signedheat.mesh.edges import edge_table
from signedheat.mesh.pinches import separated, split_at_pinches
from signedheat.mesh.planar_triangulation import triangulate_faces
from signedheat.mesh.self_intersections import self_intersections
from signedheat.mesh.triangles import face_areas

CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
BOX = SIDES[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)


def boxes(lower, sizes):
    points = np.concatenate([low + size * CORNERS for low, size in zip(lower, sizes, strict=True)])
    return points, np.concatenate([BOX + 8 * k for k in range(len(lower))])


def volume(points, faces):
    a, b, c = (points - points.mean(axis=0))[faces].swapaxes(0, 1)
    return (a * np.cross(b, c)).sum() / 6


def assert_arranged(points, faces):
    """It is closed, has the volume and area of what it was made of, and no two pieces cross."""
    pieces = arranged(points, faces)
    assert not edge_table(pieces.faces).balance.any()
    assert volume(pieces.points, pieces.faces) == pytest.approx(volume(points, faces), rel=1e-12)
    of_each = np.bincount(pieces.origins, face_areas(pieces.points[pieces.faces]), len(faces))
    np.testing.assert_allclose(of_each, face_areas(points[faces]), rtol=1e-9)
    return pieces


@pytest.mark.parametrize("seed", range(6))
def test_boxes_that_cross_and_share_planes_are_the_same_however_they_lie(seed):
    """Coordinates are whole numbers: corners on faces and edges, sides that lie in each other, many planes through
    one point."""
    rng = np.random.default_rng(seed)
    points, faces = boxes(rng.integers(0, 4, (12, 3)), rng.integers(1, 4, (12, 3)))
    counts = []
    for turn in (Rotation.identity(), Rotation.random(random_state=seed)):
        pieces = assert_arranged(turn.apply(points), faces)
        counts.append(len(pieces.faces))
    assert counts[0] == counts[1]


@pytest.mark.parametrize("seed", range(3))
def test_rotated_boxes_do_not_cross_afterwards(seed):
    rng = np.random.default_rng(seed)
    points, faces = boxes(-rng.random((12, 3)), 1 + rng.random((12, 3)))
    for k, turn in enumerate(Rotation.random(12, random_state=seed)):
        points[8 * k : 8 * k + 8] = turn.apply(points[8 * k : 8 * k + 8]) + rng.random(3)
    pieces = assert_arranged(points, faces)
    assert not len(self_intersections(pieces.points, pieces.faces))


def test_what_meets_nothing_stays_as_it_is():
    ball = samples.sphere(3)
    points = np.concatenate([ball.vertices, ball.vertices + np.array([1.2, 0, 0])])
    faces = np.concatenate([ball.faces, ball.faces + ball.n_vertices])
    pieces = assert_arranged(points, faces)
    whole = np.bincount(pieces.origins, minlength=len(faces)) == 1
    assert 0.8 < whole.mean() < 1
    kept = whole[pieces.origins]
    np.testing.assert_array_equal(pieces.faces[kept], faces[pieces.origins[kept]])


def test_cells_are_what_lies_between_lines():
    """A square of two triangles with another one in it, which has its diagonal the other way."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    points = np.concatenate([4 * square - [1.5, 1.5, 0], square])
    pieces = arranged(points, np.array([[0, 1, 2], [0, 2, 3], [5, 6, 7], [5, 7, 4]]))
    areas = face_areas(pieces.points[pieces.faces])
    cells = np.bincount(pieces.cells, areas)
    sizes = np.sort(np.round(cells, 9))  # four quarters of the small square, twice, and two halves of what is around
    np.testing.assert_allclose(sizes, [0.25] * 8 + [7.5] * 2)


def test_edges_end_on_edges_and_slivers_close_them():
    points, faces = boxes([[0, 0, 0]], [[1, 1, 1]])
    a, b, c = faces[0]
    points = np.concatenate([points, [0.5 * (points[a] + points[b])]])
    halves = np.concatenate([faces[1:], [[a, 8, c], [8, b, c], [a, b, 8]]])
    assert not edge_table(halves).balance.any()
    for given in (halves, halves[:-1]):
        pieces = arranged(points, given)
        assert not edge_table(pieces.faces).balance.any()
        assert len(pieces.faces) == 14
        assert volume(pieces.points, pieces.faces) == pytest.approx(1)


def test_segments_become_edges():
    rng = np.random.default_rng(0)
    for _ in range(20):
        corners = np.array([[0.0, 0, 0], [4, 0, 0], [1, 3, 0]])
        sides = [np.sort(rng.random(n)) for n in rng.integers(0, 4, 3)]
        rim = [corners[k] + t * (corners[(k + 1) % 3] - corners[k]) for k in range(3) for t in np.append(0, sides[k])]
        points = np.array([*rim, *(rng.dirichlet([1, 1, 1], 20) @ corners)])
        n = len(rim)
        inner = points[n:, 0].argsort() + n  # a path from left to right does not cross itself
        segments = np.stack([inner[:-1], inner[1:]], axis=1)
        places = np.array([[1 + len(sides[0]), 2 + len(sides[0]) + len(sides[1]), n]])
        made, _, across = triangulate_faces(
            points,
            np.array([0, len(points)]),
            np.arange(len(points)),
            places,
            np.array([0, len(segments)]),
            segments,
        )
        assert len(made) == 2 * len(points) - n - 2
        a, b, c = points[made].swapaxes(0, 1)
        areas = np.cross(b - a, c - a)[:, 2]
        assert areas.min() > -1e-12
        assert areas.sum() == pytest.approx(12)
        edges = {tuple(sorted(edge)) for edge in np.sort(edge_table(made).vertices, axis=1).tolist()}
        assert {tuple(sorted(segment)) for segment in segments.tolist()} <= edges
        rows, sides = np.nonzero(across >= 0)
        assert not connected_components(len(made), rows, across[rows, sides]).any()  # one cell, around the path


def test_bodies_that_touch_have_edges_and_vertices_of_their_own():
    lower = np.array([[0, 0, 0], [1, 1, 0], [2, 2, 1]])
    points, faces = boxes(lower, np.ones((3, 3)))
    used, faces = np.unique(np.unique(points, axis=0, return_inverse=True)[1].ravel()[faces], return_inverse=True)
    welded = np.unique(points, axis=0)[used]
    faces = faces.reshape(-1, 3)
    assert len(welded) == 21
    split, parted = split_at_pinches(welded, faces)
    assert len(split) == 24
    np.testing.assert_array_equal(split[parted], welded[faces])
    assert (edge_table(parted).face_counts == 2).all()
    again, same = split_at_pinches(split, parted)
    assert again is split
    assert same is parted


def test_two_tets_that_share_a_vertex_are_split_there():
    tet = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    two = np.concatenate([tet, np.where(tet > 0, tet + 3, 0)])
    assert len(separated(np.zeros((7, 3)), two)[0]) == 8


def test_segments_end_in_faces_that_rounding_flattens():
    """Within the rounding of its length, 10¹⁶, every point of this face lies on every segment."""
    points = np.zeros((10, 3))
    points[:, 0] = 0, 1, 6.9e15, 2.61290342e9, 2.61287066e9, 0, 0, 0.85, 0.5, 0.671
    points[:, 2] = 0, 0, 2.6e9, 2.61287091e9, 2.61287091e9, 2.61287091e9, 1, 0.526, 0.809, 0.671
    corners, segments = np.array([[2, 5, 7]]), np.array([[7, 1], [7, 9], [6, 8], [8, 9]])
    made, _, _ = triangulate_faces(points, np.array([0, 10]), np.arange(10), corners, np.array([0, 4]), segments)
    assert set(made.ravel()) == set(range(10)) and len(made) == 2 * 10 - 7 - 2
