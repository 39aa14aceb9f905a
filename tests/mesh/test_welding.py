"""What rounding tears is welded, and nothing else, however far from the origin."""

import numpy as np
import pytest

import signedheat as sh
from signedheat.mesh.welding import ONE_PLACE, joined_copies, joined_rims, same_positions, welded, welded_within

PLACES = ((0, 0, 0), (1e3, -1e3, 10), (431250, 5412300, 100), (1e6, 1e6, 1e6), (1e7, 0, 0), (1e7, 1e7, 1e7))
SIDES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])


def box(low, high, sides=range(6)):
    """Vertices, and two triangles for each of the sides; the first of which is at the bottom."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = SIDES[list(sides)]
    return np.where(corners, high, low), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def house(unit, sides=range(6)):
    """A house with thin walls and a chimney of one unit."""
    outer, inner, chimney = (
        box(*(unit * np.array(ends) for ends in both), sides)
        for both in (([0, 0, 0], [20, 16, 12]), ([1, 1, 1], [19, 15, 11]), ([4, 4, 11], [5, 5, 17]))
    )
    vertices = np.concatenate([outer[0], inner[0], chimney[0]])
    return vertices, np.concatenate([outer[1], inner[1][:, ::-1] + 8, chimney[1] + 16])


def classes(vertices, faces):
    same = same_positions(vertices)
    corners = same[faces]
    return joined_rims(vertices, corners.ravel(), np.roll(corners, -1, axis=1).ravel(), ONE_PLACE)[same]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("sides", [range(6), range(1, 6), [0, 2, 4]])
@pytest.mark.parametrize("unit", [1.0, 0.5])
def test_coordinates_on_lattices_are_kept_wherever_they_are(place, sides, unit):
    last_place = np.spacing(np.float32(np.abs(place).max()))
    vertices, faces = house(max(unit, 2 * last_place), sides)
    corners = (vertices + place)[faces].reshape(-1, 3)
    soup = classes(corners, np.arange(len(corners)).reshape(-1, 3))
    assert len(np.unique(soup)) == len(np.unique(faces))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("size", [1.0, 30.0])
def test_single_precision_closes_facets_that_were_rounded_one_by_one(place, size):
    ball = sh.samples.sphere(3)
    last_place = np.spacing(np.float32(np.abs(place).max()))
    corners = (max(size, 300 * size * last_place) * ball.vertices + place)[ball.faces].reshape(-1, 3)
    noise = np.random.default_rng(0).normal(size=corners.shape)
    torn = (corners * (1 + 2.0**-25 * noise)).astype(np.float32).astype(np.float64)
    assert len(np.unique(torn, axis=0)) > 2 * ball.n_vertices
    assert len(np.unique(classes(torn, np.arange(len(torn)).reshape(-1, 3)))) == ball.n_vertices


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("unit", [1.0, 0.5])
def test_a_house_has_its_volume_wherever_it_is(place, unit):
    vertices, faces = house(2 * unit)
    kept = sh.complete((vertices + place, faces)).surface()
    corners = (kept.vertices - place)[kept.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    walls = 20 * 16 * 12 - 18 * 14 * 10 + 5  # and the chimney, from which the wall takes one cube
    assert volume == pytest.approx(walls * (2 * unit) ** 3, rel=1e-9)


def test_slivers_whose_sizes_differ_by_forty_decades_are_joined_in_the_end():
    slivers = np.array(
        [
            [[-768.98566, 2e-41, -1.7e-25], [3.1e-22, 2e-41, 1.5e-5], [2e-41, 1.5e-5, 3.1e-22]],
            [[-1.7e-25, -768.98474, 2e-41], [3.1e-22, 2e-41, 1.5e-5], [3.1e-22, 2e-41, 1.5e-5]],
            [[2e-41, -1.7e-25, -770.98474], [2e-41, 1.5e-5, 3.1e-22], [2e-41, 0.0, 0.0]],
        ]
    )
    points = slivers.astype(np.float32).astype(float).reshape(-1, 3)
    joined = joined_rims(points, np.arange(9), np.arange(9) // 3 * 3 + (np.arange(9) + 1) % 3, ONE_PLACE)
    assert (joined[joined] == joined).all()


@pytest.mark.parametrize("far", [1e12, 1e19, 1e25, 1e35, 1e300])
def test_points_far_away_join_none_of_those_here(far):
    here = np.random.default_rng(0).random((200, 3))
    points = np.concatenate([here, here + np.array([1e-10, 0, -1e-10]), here * far, here * far])
    one = np.arange(200)
    there = np.concatenate([400 + one, 400 + one])
    np.testing.assert_array_equal(welded(points, 1e-9), np.concatenate([one, one, there]))
    reaches = np.repeat([1e-9, 1e-9 * far], 400)
    np.testing.assert_array_equal(welded_within(points, reaches), np.concatenate([one, one, there]))
    np.testing.assert_array_equal(welded(points, 0.0), np.concatenate([np.arange(400), there]))


@pytest.mark.parametrize("far", [1e6, 1e20, 1e30, 1e35])
@pytest.mark.parametrize("other", [1e3, 1e12])
def test_two_corners_far_away_take_no_other_face_with_them(far, other):
    ball = sh.samples.sphere(1)
    vertices = ball.vertices.copy()
    vertices[3, 0], vertices[7, 1] = far, -other
    solid = sh.complete((vertices, ball.faces))
    kept = ball.faces[~np.isin(ball.faces, [3, 7]).any(axis=1)]
    middles = vertices[kept].mean(axis=1)
    assert np.abs(solid.distance(middles)).max() < 1e-9 + 4 * np.spacing(other)


def two(first, second, move):
    """Bodies side by side in one mesh, the second one moved."""
    vertices = np.concatenate([first[0], second[0] + move])
    return vertices, np.concatenate([first[1], second[1] + len(first[0])])


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("sides", [range(6), [0, 2, 4]])
def test_faces_that_only_rounding_separates_are_copies(place, sides):
    unit = 30 * np.spacing(np.float32(np.abs(place).max()))
    body, last_place = house(unit, sides), np.spacing(np.abs(place).max() + 20 * unit)
    vertices, faces = two(body, body, last_place)
    ids = joined_copies(vertices + place, faces)[faces]
    np.testing.assert_array_equal(ids[: len(ids) // 2], ids[len(ids) // 2 :])
    assert len(np.unique(ids)) == len(np.unique(body[1]))


@pytest.mark.parametrize("move", [1e-4, 1e-2, 1.0])
def test_faces_farther_apart_than_rounding_are_no_copies(move):
    vertices, faces = two(house(1.0), house(1.0), move)
    np.testing.assert_array_equal(joined_copies(vertices, faces), np.arange(len(vertices)))


def test_a_body_keeps_its_own_places_where_a_copy_of_it_has_moved():
    """A wall as thin as rounding is there twice: which of its sides would be the other's copy is not known."""
    wall = box((0, 0, 0), (1, 1, 3e-16))
    vertices, faces = two(wall, wall, 0.0)
    np.testing.assert_array_equal(joined_copies(vertices, faces), np.arange(len(vertices)))
