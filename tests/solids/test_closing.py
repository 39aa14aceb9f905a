"""Lids close the boundary of a chain: balanced edge by edge, and the same however the chain is given."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import signedheat as sh
from shapes.bodies import finer
from signedheat import samples
from signedheat.mesh.edges import edge_table
from signedheat.solids import closing, lids, walls
from signedheat.solids.closing import closed_by
from signedheat.solids.rims import boundary, loops


def volume(vertices, faces, **options):
    """Volume of what is closed; each directed edge is balanced, and what was given stays."""
    points, added = closed_by(vertices, faces, **options)
    closed = np.concatenate([faces, added])
    assert not edge_table(closed).balance.any()
    np.testing.assert_array_equal(points[: len(vertices)], vertices)
    corners = points[closed] - vertices.mean(axis=0)
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6


def dome(height=1.0, angle=90.0, around=48, down=12):
    """A cap of a spheroid of that height above its middle, down to an angle from its pole."""
    polar, turns = np.deg2rad(angle) * np.arange(1, down + 1) / down, 2 * np.pi * np.arange(around) / around
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turns)),
            np.outer(np.sin(polar), np.sin(turns)),
            np.outer(np.cos(polar), turns**0),
        ],
        axis=-1,
    )
    vertices = np.concatenate([[[0.0, 0, 1]], rings.reshape(-1, 3)]) * [1, 1, height]
    k, after = np.arange(around), (np.arange(around) + 1) % around
    faces = [np.stack([0 * k, 1 + k, 1 + after], axis=1)]
    for ring in range(down - 1):
        a, b = 1 + ring * around, 1 + (ring + 1) * around
        faces += [np.stack([a + k, b + k, b + after], 1), np.stack([a + k, b + after, a + after], 1)]
    return vertices, np.concatenate(faces)


def cut_open(seed=0):
    """A ball with holes of all sizes, one over half of it, along the zigzags of its triangles."""
    ball = samples.sphere(3)
    middles = ball.vertices[ball.faces].mean(axis=1)
    rng = np.random.default_rng(seed)
    holes = np.linalg.norm(middles[:, None] - ball.vertices[rng.choice(len(ball.vertices), 4, replace=False)], axis=2)
    kept = (holes > [0.2, 0.35, 0.5, 0.1]).all(axis=1) & (rng.random(len(middles)) > 0.05)
    faces = ball.faces[kept]
    used, numbers = np.unique(faces, return_inverse=True)
    return ball.vertices[used], numbers.reshape(-1, 3)


def wavy_tube(around=40):
    """A tube of five flutes whose ends lie in no plane."""
    turns = 2 * np.pi * np.arange(around) / around
    radii, heights = 1 + 0.2 * np.sin(5 * turns), np.linspace(0, 1, 8)
    rings = [
        np.stack([radii * np.cos(turns), radii * np.sin(turns), h + 0.3 * h * np.sin(2 * turns)], 1) for h in heights
    ]
    k, after = np.arange(around), (np.arange(around) + 1) % around
    faces = [
        np.concatenate(
            [
                np.stack([r + k, r + after, r + around + after], 1),
                np.stack([r + k, r + around + after, r + around + k], 1),
            ]
        )
        for r in around * np.arange(7)
    ]
    return np.concatenate(rings), np.concatenate(faces)


@pytest.mark.parametrize("bent", [True, False])
@pytest.mark.parametrize("shape", [cut_open, wavy_tube, dome])
def test_what_is_closed_does_not_depend_on_how_it_is_given(shape, bent):
    vertices, faces = shape()
    expected, rng = volume(vertices, faces, bent=bent), np.random.default_rng(1)
    order = rng.permutation(len(vertices))
    numbers = np.argsort(order)
    shuffled = np.take_along_axis(numbers[faces], (np.arange(3) + rng.integers(3, size=(len(faces), 1))) % 3, axis=1)
    turned = vertices @ Rotation.random(random_state=2).as_matrix()
    assert volume(vertices[order], rng.permutation(shuffled), bent=bent) == pytest.approx(expected, rel=1e-6)
    assert volume(turned, faces, bent=bent) == pytest.approx(expected, rel=1e-6)
    assert volume(vertices + np.array([1000.0, -2000.0, 500.0]), faces, bent=bent) == pytest.approx(expected, rel=1e-6)
    assert volume(vertices + 1e-12 * rng.normal(size=vertices.shape), faces, bent=bent) == pytest.approx(
        expected, rel=1e-6
    )
    assert volume(*finer(vertices, faces), bent=bent) == pytest.approx(expected, rel=3e-3)


def test_lids_fade_as_a_spheroid_flattens():
    heights = np.arange(0.5, 1.21, 0.1)
    shares = np.array(
        [volume(*dome(k, around=32, down=8)) / volume(*dome(k, around=32, down=8), bent=False) for k in heights]
    )
    assert np.abs(np.diff(shares) / shares[:-1]).max() < 0.3  # 3 % for each hundredth
    assert shares[np.argmin(np.abs(heights - 1))] == pytest.approx(2, rel=0.03)
    assert volume(*dome(4.0)) == pytest.approx(volume(*dome(4.0), bent=False), rel=1e-9)


@pytest.mark.parametrize("height", [0.3, 1.0, 3.0])
def test_half_models_are_closed_flat(height):
    vertices, faces = dome(height, around=96, down=24)
    assert volume(vertices, faces, bent=False) == pytest.approx(2 / 3 * np.pi * height, rel=0.005)


def test_caps_of_a_ball_come_back():
    for angle, rel in ((160, 0.01), (120, 0.01), (90, 0.02)):
        assert volume(*dome(angle=angle, around=96, down=48)) == pytest.approx(4 / 3 * np.pi, rel=rel)


def test_patches_with_other_vertices_are_zipped_up():
    upper, (points, faces) = dome(around=48), dome(around=37)
    vertices = np.concatenate([upper[0], points * [1, 1, -1]])
    chain = np.concatenate([upper[1], len(upper[0]) + faces[:, ::-1]])
    for bent in (True, False):
        assert volume(vertices, chain, bent=bent) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert volume(*finer(vertices, chain)) == pytest.approx(volume(vertices, chain), rel=3e-3)


def test_faces_several_times_and_edges_of_three_faces_are_balanced():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]])
    volume(vertices, np.array([[0, 1, 2], [0, 1, 2], [1, 0, 3], [1, 0, 4]]))
    volume(vertices, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))


def test_edges_that_vertices_lie_on_are_closed_without_volume():
    """A tetrahedron with a vertex in the middle of one edge that one of its two faces does not have."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0]])
    faces = np.array([[0, 2, 1], [0, 4, 3], [4, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert volume(vertices, faces) == pytest.approx(1 / 6, rel=1e-12)
    assert len(closed_by(vertices, faces)[1]) == 1


def test_loops_are_around_gaps_where_these_meet():
    ball = samples.sphere(2)
    corner = ball.faces[0, 0]
    around = np.flatnonzero((ball.faces == corner).any(axis=1))
    first = around[0]
    apart = [f for f in around if len(np.intersect1d(ball.faces[f], ball.faces[first])) == 1]
    faces = np.delete(ball.faces, [first, apart[0]], axis=0)
    gaps = loops(ball.vertices, faces, boundary(faces))
    assert sorted(sorted(gap.tolist()) for gap in gaps) == sorted(
        sorted(ball.faces[f].tolist()) for f in (first, apart[0])
    )


def test_a_rim_of_many_edges_takes_no_quadratic_time():
    vertices, faces = dome(angle=120, around=20000, down=2)
    begin = time.process_time()
    volume(vertices, faces)
    assert time.process_time() - begin < 20


def test_a_rim_with_mirror_images_has_one_lid_in_every_order_of_faces():
    ball = samples.sphere(3)
    middles = ball.vertices[ball.faces].mean(axis=1)
    faces = ball.faces[(middles[:, 0] > 0) & (middles[:, 1] > 0)]  # four corners are equally far from the middle
    volumes = [
        sh.complete(sh.TriangleMesh(ball.vertices, faces[np.random.default_rng(seed).permutation(len(faces))])).volume
        for seed in range(3)
    ]
    np.testing.assert_allclose(volumes, volumes[0], rtol=1e-9)


def test_rims_that_a_wall_closes_may_have_a_vertex_in_common():
    """Strips had triangles on two vertices there, which were loops of one."""
    angles = 2 * np.pi * np.arange(24) / 24
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    places = np.concatenate([circle, 0.9 * circle[1:], [[0, 0, -1], [0, 0, -0.8]]])
    outer, inner = np.arange(24), np.append(0, np.arange(24, 47))
    bowl = np.stack([np.full(24, 47), np.roll(outer, -1), outer], axis=1)
    cavity = np.stack([np.full(24, 48), inner, np.roll(inner, -1)], axis=1)
    assert 0 < volume(places, np.concatenate([bowl, cavity])) < 1


def test_a_disc_has_room_for_sides_as_short_as_rounding():
    angles = 2 * np.pi * np.arange(40) / 40
    loop = np.stack([np.cos(angles), np.sin(angles), 0.3 * np.cos(5 * angles)], axis=1)
    loop[10:30] = loop[10] + 1e-13 * loop[10:30]
    rim = lids.SmoothRim.of(loop)
    points, faces = lids.draped(loop, rim.starts, None, lids.film(lids.pattern(rim, None)))
    assert set(range(len(loop))) <= set(faces.ravel().tolist()) and faces.max() == len(loop) + len(points) - 1


@pytest.mark.parametrize("height", [0.0, 1e-7])
def test_a_slit_that_is_left_between_two_corners_is_closed(monkeypatch, height):
    """As strips leave slits: their lids are triangles of no width."""
    box = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    vertices = np.concatenate([box, [[1 / 3, 0, 1 + height], [2 / 3, 0, 1 + height]]])
    sides = [
        [0, 2, 3],
        [0, 3, 1],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ]
    faces = np.array([*sides, [6, 4, 8], [6, 8, 9], [6, 9, 5], [6, 5, 7]])
    for way in ("small_lids", "strips"):
        monkeypatch.setattr(closing, way, lambda *_: np.empty((0, 3), dtype=np.int64))
    points, added = closing.closed_by(vertices, faces)
    assert sorted(np.unique(added).tolist()) == [4, 5, 8, 9]
    assert len(points) == 10
    assert not edge_table(np.concatenate([faces, added])).balance.any()


@pytest.mark.parametrize(
    ("sides", "following", "run"),
    [
        ([0, 1, 2], [1, 2, 0], [0, 1, 2]),
        ([1, 2, 3], [1, 2, 3, 4, 0], [1, 2, 3]),
        ([0, 1, 2, 3, 4, 5], [1, 2, 0, 4, 5, 3], []),
        ([0, 1, 3, 4, 5], [1, 2, 6, 4, 5, 3, 0], []),
    ],
    ids=["a loop", "a part of a loop", "two loops", "a part of a loop, and a loop"],
)
def test_sides_that_follow_each_other_are_a_run(sides, following, run):
    np.testing.assert_array_equal(walls._run(np.array(sides), np.array(following)), run)
