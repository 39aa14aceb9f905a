"""What is right as it is given stays so: a shape and the same shape changed a little bound the same solid."""

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import finer
from signedheat import samples
from signedheat.errors import InexactWarning
from signedheat.solids.completion import overruled

SIDES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
"""Corners of the sides of a box: −z, z, −y, y, −x, x; corner 4 k + 2 j + i is at (i, j, k)."""


def box(low, high, without=(), diagonal=0):
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = np.roll(SIDES[[k for k in range(6) if k not in without]], diagonal, axis=1)
    return np.where(corners, high, low).astype(float), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def joined(*meshes):
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + start for (_, faces), start in zip(meshes, starts[:-1], strict=True)]),
    )


def bricks(*counts, diagonals=lambda corner: 0):
    return joined(*[box(corner, np.add(corner, 1), diagonal=diagonals(corner)) for corner in np.ndindex(*counts)])


def ball(level=3, radius=1.0, center=(0, 0, 0)):
    mesh = samples.sphere(level, radius=radius, center=center)
    return np.array(mesh.vertices), np.array(mesh.faces)


def below(mesh, height):
    vertices, faces = mesh
    return vertices, faces[vertices[faces].mean(axis=1)[:, 2] < height]


def turned(mesh, which):
    faces = mesh[1].copy()
    faces[which] = faces[which][:, ::-1]
    return mesh[0], faces


def volume(mesh, **options):
    return sh.complete(mesh, **options).volume


@pytest.mark.parametrize("diagonals", [lambda corner: 0, lambda corner: sum(corner) % 2], ids=["alike", "crossed"])
def test_bricks_that_touch_stay_bricks_without_any_one_triangle(diagonals):
    """Whichever way their sides are divided, so that walls between them are there twice, or as other triangles."""
    vertices, faces = bricks(2, 2, 1, diagonals=diagonals)
    for gone in range(0, len(faces), 5):
        assert volume((vertices, np.delete(faces, gone, axis=0))) == pytest.approx(4.0, rel=0.005)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_bricks_that_touch_stay_bricks_whichever_way_their_triangles_run(share):
    mesh = bricks(2, 2, 1, diagonals=lambda corner: sum(corner) % 2)
    which = np.random.default_rng(3).random(len(mesh[1])) < share
    assert volume(turned(mesh, which)) == pytest.approx(4.0)


def test_halves_of_a_body_that_touch_are_the_body():
    halves = joined(box((0, 0, 0), (1, 1, 1)), finer(*box((1, 0, 0), (2, 1, 1))))
    assert volume(halves) == pytest.approx(2.0)
    assert volume((halves[0], np.delete(halves[1], 3, axis=0))) == pytest.approx(2.0, rel=0.005)


OPEN = {"box": finer(*box((0, 0, 0), (2, 1, 0.7), without=(1,))), "half a ball": below(ball(2), 0.05)}


@pytest.mark.parametrize("name", OPEN)
@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-3])
def test_an_open_body_given_twice_is_one_body(name, noise):
    vertices, faces = OPEN[name]
    moved = vertices + noise * np.random.default_rng(0).normal(size=vertices.shape)
    once, twice = sh.complete((vertices, faces)), sh.complete(joined((vertices, faces), (moved, faces)))
    assert twice.volume == pytest.approx(once.volume, rel=0.01 + 10 * noise)
    assert twice.inside([[0.5, 0.3, 0.0 if name == "half a ball" else 0.3]]).all()


@pytest.mark.parametrize("noise", [1e-12, 1e-9])
@pytest.mark.parametrize("lost", [(), (5, 40)])
def test_an_open_ring_given_twice_a_rounding_apart_is_one_ring(noise, lost):
    ring = sh.samples.torus(2, 1, 24, 12)
    vertices, faces = below((ring.vertices, ring.faces), 0.0)
    moved = vertices + noise * np.random.default_rng(0).normal(size=vertices.shape)
    copies = [np.delete(faces, lost[k : k + 1], axis=0) for k in (0, 1)]
    assert volume(joined((vertices, copies[0]), (moved, copies[1]))) == pytest.approx(
        volume((vertices, faces)), rel=0.01
    )


@pytest.mark.parametrize("move", [1e-9, 1e-7, 1e-5])
def test_a_closed_body_given_twice_is_one_body(move):
    vertices, faces = box((0, 0, 0), (2, 1, 0.7))
    twice = joined((vertices, faces), (vertices + move * np.array([1, 0.3, -0.5]), faces))
    assert volume(twice) == pytest.approx(1.4, rel=10 * move + 1e-9)


@pytest.mark.parametrize("noise", [1e-12, 1e-10, 1e-9, 1e-8])
def test_triangles_that_only_rounding_separates_are_not_divided_along_each_other(noise):
    """Sides of a slender box in pieces of four coplanar triangles each, every piece with vertices of its own."""
    vertices, faces = box((0, 0, 0), (4, 1, 0.1))
    apart = vertices[faces].reshape(-1, 3)
    apart = apart + noise * np.random.default_rng(0).normal(size=apart.shape)
    solid = sh.complete(finer(apart, np.arange(len(apart)).reshape(-1, 3)))
    assert len(solid.triangles) == 48 and (solid.origins >= 0).all()
    assert solid.volume == pytest.approx(0.4, rel=40 * noise)


@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-9, 1e-8])
@pytest.mark.parametrize("which", [slice(0), slice(None), slice(None, None, 2)], ids=["alike", "turned", "half turned"])
def test_triangles_that_only_rounding_separates_are_one_body_given_twice(noise, which):
    vertices, faces = box((0, 0, 0), (2, 1, 0.7))
    apart = vertices[faces].reshape(-1, 3)
    apart = apart + noise * np.random.default_rng(0).normal(size=apart.shape), np.arange(len(apart)).reshape(-1, 3)
    solid = sh.complete(joined(apart, turned(apart, which)))
    assert solid.volume == pytest.approx(1.4, rel=1e-12 + 10 * noise) and (solid.origins >= 0).all()


@pytest.mark.parametrize(("count", "height"), [(4, 1 / 64), (8, 1 / 8)])
def test_thin_plates_that_touch_stay_plates_without_any_one_triangle(count, height):
    """Walls between them, divided along different diagonals, are most of their area."""
    vertices, faces = bricks(1, 1, count, diagonals=lambda corner: sum(corner) % 2)
    vertices = vertices * [1.5, 1.0, height]
    for gone in range(0, len(faces), 7):
        left = vertices, np.delete(faces, gone, axis=0)
        assert volume(left) == pytest.approx(1.5 * height * count, rel=1e-9)


@pytest.mark.parametrize("gap", [0.002, 0.01, 0.04])
def test_panels_with_gaps_between_them_are_the_body(gap):
    """Octants of an ellipsoid, moved apart; each has the vertices of its own."""
    axes, whole = np.array([2.0, 0.9, 0.6]), ball(4)
    panels, middles = [], whole[0][whole[1]].mean(axis=1)
    for signs in 1 - 2 * np.array(list(np.ndindex(2, 2, 2))):
        kept = (middles * signs > 0).all(axis=1)
        panels.append((axes * whole[0] + gap / 2 * signs, whole[1][kept]))
    solid = sh.complete(joined(*panels))
    assert solid.volume == pytest.approx(4 / 3 * np.pi * axes.prod(), rel=0.01 + 3 * gap)
    assert solid.inside([[0, 0, 0], [0.5, 0.3, 0.2], [-1.5, 0, 0]]).all() and not solid.inside([[2.2, 0, 0]])[0]


@pytest.mark.parametrize("distance", [1e4, 1e7, 1e9, 1e12])
def test_bodies_far_apart_do_not_know_of_each_other(distance):
    first, second = ball(2), ball(2, center=(distance, 0, 0))
    own = samples.sphere(2).volume
    solid = sh.complete(joined(first, second))
    assert solid.inside([[0, 0, 0], [distance, 0, 0]]).all() and not solid.inside([[0, 0, 1.5]])[0]
    assert solid.distance([[0.0, 0, 0]])[0] == pytest.approx(sh.complete(first).distance([[0.0, 0, 0]])[0], rel=1e-9)
    near = sh.complete(first)
    assert len(solid.triangles) == len(first[1]) + len(second[1]) and near.volume == pytest.approx(own)
    corners = second[0][second[1]] - [distance, 0, 0]  # as rounded there
    rounded = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert solid.volume == pytest.approx(own + rounded, rel=1e-9)


BESIDE = {
    "a triangle": (np.eye(3), np.arange(3)[None]),
    "an open box": box((0, 0, 0), (1, 1, 1), without=[1]),
    "loose triangles": (lambda soup: (np.array(soup.vertices), np.array(soup.faces)))(
        samples.soup(samples.sphere(2), 0.02, 1)
    ),
}


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("size", [0.01, 100.0])
def test_loose_triangles_do_not_know_of_what_is_far_away(beside, size):
    points = 0.8 * np.random.default_rng(0).normal(size=(200, 3))
    soup = samples.soup(samples.sphere(2), 0.03, 0)
    vertices, faces = BESIDE[beside]
    together = joined((soup.vertices, soup.faces), (size * vertices + [10 * (size + 1), 0, 0], faces))
    alone, both = sh.complete(soup).distance(points), sh.complete(together).distance(points)
    np.testing.assert_allclose(both, alone, atol=1e-5)


@pytest.mark.parametrize("size", [0.01, 1.0, 100.0])
def test_open_bodies_do_not_know_of_loose_triangles_far_away(size):
    points = 0.8 * np.random.default_rng(0).normal(size=(200, 3)) + 0.5
    vertices, faces = BESIDE["loose triangles"]
    bodies = joined(BESIDE["an open box"], box((0.25, 0.25, 1.5), (0.75, 0.75, 2), without=[0]))
    together = joined(bodies, (size * vertices + [10 * (size + 1), 0, 0], faces))
    alone, both = sh.complete(bodies).distance(points), sh.complete(together).distance(points)
    np.testing.assert_allclose(both, alone, atol=1e-9)


@pytest.mark.parametrize("reach", [1e3, 1e7, 1e10])
def test_a_face_that_reaches_far_away_changes_nothing_near_by(reach):
    vertices, faces = ball(2)
    spike = np.concatenate([vertices, [[reach, 0, 0]]]), np.concatenate([faces, [[0, 1, len(vertices)]]])
    assert sh.complete(spike).distance([[0.0, 0, 0]])[0] == pytest.approx(-0.98, abs=0.02)


@pytest.mark.parametrize("place", [1e3, 1e6, 1e9, 1e12])
def test_a_body_far_from_the_origin_is_as_exact_as_its_coordinates(place):
    vertices, faces = ball(2)
    moved = vertices + place * np.array([0.6, -0.64, 0.48])
    assert volume((moved, faces)) == pytest.approx(samples.sphere(2).volume, rel=1e-9 + 2**-48 * place)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_walls_that_end_in_the_middle_of_a_roof_make_no_eaves(share, copies):
    """The roof's faces have no vertices at the walls: what reaches beyond these bounds nothing."""
    walls = box((0, 0, 0), (2, 3, 1), without=(1,))
    roof = np.array([[-0.5, -0.5, 1], [2.5, -0.5, 1], [2.5, 3.5, 1], [-0.5, 3.5, 1]]), np.array([[0, 1, 2], [0, 2, 3]])
    mesh = joined(*[walls] * copies, roof)
    solid = sh.complete(turned(mesh, np.random.default_rng(1).random(len(mesh[1])) < share))
    assert solid.volume == pytest.approx(6.0) and (solid.origins >= 0).all()
    assert solid.distance([[-0.4, 1, 0.9], [-0.4, 1, 1.1]]) == pytest.approx(0.1)


@pytest.mark.parametrize("inner", [False, True])
@pytest.mark.parametrize("outer", [False, True])
def test_a_low_tray_of_two_skins_is_hollow_whichever_way_they_face(inner, outer):
    skins = box((0, 0, 0), (150, 100, 25), without=(0,)), box((2, 2, 0), (148, 98, 23), without=(0,))
    mesh = joined(turned(skins[0], slice(None) if outer else []), turned(skins[1], [] if inner else slice(None)))
    assert volume(mesh) == pytest.approx(150 * 100 * 25 - 146 * 96 * 23)


def test_a_thread_without_ends_is_closed_flat():
    around, up = np.meshgrid(2 * np.pi * np.arange(48) / 48, np.linspace(0, 2, 41))
    radius = 1 + 0.2 * np.abs((up / 0.5 - around / (2 * np.pi)) % 1 - 0.5)
    points = np.stack([radius * np.cos(around), radius * np.sin(around), up], axis=-1)
    ids = np.arange(points.size // 3).reshape(41, 48)
    a, b, c, d = ids[:-1], np.roll(ids, -1, axis=1)[:-1], np.roll(ids, -1, axis=1)[1:], ids[1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    mesh = points.reshape(-1, 3), faces
    assert volume(mesh) == pytest.approx(volume(mesh, lids="flat"), rel=0.003)


@pytest.mark.parametrize("level", [1, 2, 4])
def test_flat_lids_on_jagged_rims_are_flat(level):
    """As large as the fan of triangles from the middle of the rim."""
    vertices, faces = ball(level)
    kept = faces[vertices[faces].mean(axis=1)[:, 0] > 1e-9]
    solid = sh.complete((vertices, kept), lids="flat")
    edges = np.sort(np.stack([kept, np.roll(kept, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, counts = np.unique(edges, axis=0, return_counts=True)
    corners = vertices[kept] - vertices[np.unique(edges[counts == 1])].mean(axis=0)
    cones = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert solid.volume == pytest.approx(cones, rel=0.02)


def test_folded_cards_near_a_body_bound_nothing():
    rng, parts = np.random.default_rng(5), [ball(3)]
    for _ in range(60):
        along = rng.normal(size=3)
        along /= np.linalg.norm(along)
        side = 0.04 * np.linalg.qr(np.stack([along, rng.normal(size=3)], axis=1))[0][:, 1]
        fold = 7.5 * np.cross(along, side)
        ends = (1.02 * along, 1.3 * along, 1.3 * along + fold)
        corners = np.concatenate([[end - side, end + side] for end in ends])
        parts.append((corners, np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]])))
    assert volume(joined(*parts)) == pytest.approx(samples.sphere(3).volume, rel=1e-9)


def test_vertices_in_the_middle_of_edges_change_no_lid():
    vertices, faces = below(ball(3), 0.05)
    some = np.random.default_rng(0).choice(len(faces), len(faces) // 8, replace=False)
    corners = vertices[faces[some]]
    a, b, c = faces[some].T
    p, q, r = (len(vertices) + 3 * np.arange(len(some))[:, None] + np.arange(3)).T
    rest = np.delete(faces, some, axis=0)
    split = np.vstack([rest, np.c_[a, p, r], np.c_[p, b, q], np.c_[r, q, c], np.c_[p, q, r]])
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    assert volume((np.vstack([vertices, middles.reshape(-1, 3)]), split)) == pytest.approx(
        volume((vertices, faces)), rel=0.01
    )


def test_where_most_is_missing_a_warning_says_so():
    with pytest.warns(InexactWarning, match="is completed"):
        sh.complete(below(ball(3), 0.0))


@pytest.mark.parametrize("share", [0.01, 0.03])
def test_stray_points_are_left_out_and_told(share):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    strays = rng.uniform(-2, 2, (int(share * 4000), 3))
    solid = sh.complete(sh.PointCloud(np.concatenate([points, strays])))
    assert solid.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert "stray points left out" in str(solid.diagnostics.notes[0])
    assert not sh.complete(sh.PointCloud(points)).diagnostics.notes[0].as_dict().get("stray_points")


@pytest.mark.parametrize("far", [1e6, 1e10, 1e30])
def test_stray_points_may_be_anywhere(far):
    points = ball(3)[0]
    alone = sh.complete(sh.PointCloud(points))
    solid = sh.complete(sh.PointCloud(np.concatenate([[[far, 0, -far]], points, [[0, -2 * far, 0]]])))
    assert solid.volume == alone.volume and "stray points left out: 2" in str(solid.diagnostics.notes[0])


@pytest.mark.parametrize("seed", [0, 1, 2, 44])
@pytest.mark.parametrize("diagonals", [lambda corner: 0, lambda corner: sum(corner) % 2], ids=["alike", "crossed"])
def test_bricks_that_touch_stay_bricks_when_a_tenth_of_their_triangles_is_flipped(seed, diagonals):
    shape = bricks(2, 2, 1, diagonals=diagonals)
    flipped = np.random.default_rng(seed).random(len(shape[1])) < 0.1
    assert volume(turned(shape, flipped)) == pytest.approx(4.0)


def test_a_bowl_with_a_jagged_lip_is_hollow():
    outer, inner = below(ball(), 0.05), below(ball(3, 0.8), 0.05)
    bowl = volume(joined(outer, turned(inner, slice(None))))
    assert bowl == pytest.approx(2 / 3 * np.pi * (1 - 0.8**3), rel=0.05)


def test_winding_numbers_that_the_completion_overrules_are_counted():
    solid = sh.complete(ball())
    assert overruled(solid, solid.triangles[:1, [0, 0, 0]]) == 0  # a lid without area
    assert overruled(solid, solid.triangles) == pytest.approx(np.pi / 6, rel=0.1)  # of the box around it


@pytest.mark.parametrize("seed", [0, 143])
def test_copies_of_which_each_lies_within_the_other_are_one_body(seed):
    angles, i = 2 * np.pi * np.arange(24) / 24, np.arange(24)
    circle = np.stack([0.7 * np.cos(angles), 0.7 * np.sin(angles), 0 * angles], axis=1)
    vertices = np.concatenate([circle, [[0, 0, 0], [0, 0, 1.5]]])
    sides = np.stack([i, np.roll(i, -1), np.full(24, 25)], axis=1)
    base = np.stack([np.roll(i, -1), i, np.full(24, 24)], axis=1)
    cone = vertices, np.concatenate([sides, base])
    copy = vertices + 1e-8 * np.random.default_rng(seed).normal(size=vertices.shape), cone[1]
    assert volume(joined(cone, copy)) == pytest.approx(volume(cone), rel=1e-6)


BARS = [((x, y, 0), (x + 1, y + 1, 9)) for x in (0, 8) for y in (0, 5)]
BARS += [((0, y, z), (9, y + 1, z + 1)) for y in (0, 5) for z in (0, 4, 8)]
BARS += [((x, 0, z), (x + 1, 6, z + 1)) for x in (0, 8) for z in (0, 4, 8)]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("flipped", ["triangles", "bars", "triangles, and some lost"])
def test_bars_that_cross_and_share_corners_are_a_frame_however_they_face(flipped, seed):
    """Edges and planes of several bars coincide; by the indices of the mesh, each is a body by itself."""
    mesh, rng = joined(*[box(*bar) for bar in BARS]), np.random.default_rng(seed)
    which = np.repeat(rng.random(len(BARS)) < 0.3, 12) if flipped == "bars" else rng.random(12 * len(BARS)) < 0.2
    kept = rng.random(len(which)) > (0.02 if "lost" in flipped else 0.0)
    vertices, faces = turned(mesh, which)
    cells = {
        cell
        for low, high in BARS
        for cell in np.ndindex(10, 10, 10)
        if all(np.less_equal(low, cell) & np.less(cell, high))
    }
    exact = {"rel": 0.03} if "lost" in flipped else {"rel": 1e-9}
    assert volume((vertices, faces[kept])) == pytest.approx(len(cells), **exact)


def test_confidence_does_not_know_of_what_is_far_away():
    near = below(ball(), 0.5)
    alone, beside = sh.complete(near), sh.complete(joined(near, ball(1, center=(100, 0, 0))))
    confidence = [np.sort(solid.confidence[solid.origins < 0]) for solid in (alone, beside)]
    np.testing.assert_allclose(*confidence, rtol=1e-5)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_a_frame_with_flipped_triangles_given_twice_a_rounding_apart_is_one_frame(seed):
    mesh, rng = joined(*[box(*bar) for bar in BARS]), np.random.default_rng(seed)
    vertices, faces = turned(mesh, rng.random(12 * len(BARS)) < 0.2)
    shaken = vertices + 1e-8 * rng.normal(size=vertices.shape)
    assert volume(joined((vertices, faces), (shaken, faces))) == pytest.approx(102, rel=1e-6)


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_hidden_bodies_stay_bodies_though_some_of_their_faces_are_flipped(share):
    """What most of their area says decides: a cavity stays one, too."""
    rng = np.random.default_rng(4)
    around, parts = box((0, 0, 0), (4, 1, 1)), [ball(3), ball(3)]
    hidden = [(0.3 * part[0] + [x, 0.5, 0.5], part[1]) for part, x in zip(parts, (1, 3), strict=True)]
    mesh = joined(around, hidden[0], turned(hidden[1], np.ones(len(hidden[1][1]), dtype=bool)))
    flipped = rng.random(len(mesh[1])) < share
    flipped[: len(around[1])] = False
    found = sh.complete(turned(mesh, flipped))
    assert found.volume == pytest.approx(4.0 - volume(hidden[1]))
    assert found.inside([[1, 0.5, 0.5], [3, 0.5, 0.5]]).tolist() == [True, False]
