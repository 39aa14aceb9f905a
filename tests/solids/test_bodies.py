"""Boundaries of solids that are proven: where the cut of a chain is not, its bodies are united in other ways."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import signedheat as sh
from shapes.bodies import box
from shapes.grid_cases import assert_closed_manifold
from shapes.triangulated import grid
from signedheat import samples
from signedheat.errors import InexactWarning
from signedheat.mesh.pinches import separated
from signedheat.mesh.welding import indexed
from signedheat.search.winding_tree import winding_sums
from signedheat.solids import kept_faces
from signedheat.solids.bodies import Bodies, crossing_faces, not_shared, same_solid, whole_boundary
from signedheat.solids.winding import Windings

BARS = [
    *(((x - 0.05, y - 0.05, 0), (x + 0.05, y + 0.05, 1)) for x in range(3) for y in range(2)),
    *(((-0.05, y - 0.05, z - 0.05), (2.05, y + 0.05, z + 0.05)) for y in range(2) for z in (0.05, 0.5, 0.95)),
    *(((x - 0.05, -0.05, z - 0.05), (x + 0.05, 1.05, z + 0.05)) for x in range(3) for z in (0.05, 0.5, 0.95)),
]
"""Bars that meet in common planes, edges and corners."""


def bars(seed):
    turn = Rotation.random(random_state=seed)
    return [sh.TriangleMesh(box(*bar).vertices @ turn.as_matrix().T, box(*bar).faces) for bar in BARS]


def rounded(mesh, digits):
    """In single precision, or to some decimal places."""
    vertices = mesh.vertices.astype(np.float32) if digits is None else np.round(mesh.vertices, digits)
    return sh.TriangleMesh(vertices, mesh.faces)


@pytest.mark.parametrize("digits", [None, 4])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_bars_that_rounding_moves_into_each_other_are_united(seed, digits):
    """Their faces cross at angles of a millionth."""
    whole = sh.complete(samples.union(*bars(seed)))
    solid = sh.complete(rounded(samples.union(*bars(seed)), digits))
    surface = solid.surface()
    assert_closed_manifold(surface)
    assert volume_of(surface.vertices[surface.faces]) == pytest.approx(solid.volume, rel=1e-9)
    assert solid.volume == pytest.approx(whole.volume, rel=1e-6 if digits is None else 2e-4)
    places = np.random.default_rng(seed).uniform(*whole.bounds, (500, 3))
    clear = np.abs(whole.distance(places)) > 1e-3
    np.testing.assert_allclose(solid.distance(places), whole.distance(places), atol=2e-4)
    np.testing.assert_array_equal(solid.inside(places)[clear], whole.inside(places)[clear])
    assert (solid.origins >= 0).all()


def overlapping():
    """A chain of two boxes that cross, with a cavity in the first."""
    first, second, hole = (
        box((0, 0, 0), (2, 1, 1)),
        box((1, 0.25, 0.25), (3, 2, 2)),
        box((0.2, 0.2, 0.2), (0.5, 0.8, 0.8)),
    )
    hole = sh.TriangleMesh(hole.vertices, hole.faces[:, ::-1])
    return [first, second, hole], 2.0 + 2 * 1.75**2 - 0.75**2 - 0.3 * 0.6**2


def corners(*meshes):
    return np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])


def volume_of(triangles):
    return np.einsum("ij,ij->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6


def test_bodies_less_their_cavities():
    parts, volume = overlapping()
    windings = Windings(corners(*parts))
    for bodies in (Bodies.of_chain(windings), Bodies.of_mesh(samples.union(*parts), windings)):
        assert sorted(np.sign(bodies.volumes)) == [-1, 1, 1]
        assert volume_of(bodies.united) == pytest.approx(volume, rel=1e-12)
        assert same_solid(bodies.united, windings)


def ring(inner, outer, seed):
    """A square turned about an axis by eighths, in general position, to four digits."""
    angles, section = np.pi * np.arange(8) / 4, np.array([[inner, 0], [outer, 0], [outer, 0.3], [inner, 0.3]])
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    places = np.concatenate([section[:, :1] * circle[:, None], np.broadcast_to(section[:, 1:], (8, 4, 1))], axis=2)
    mesh = grid(
        (places + np.array([1.3, 1.0, 0.0])) @ Rotation.random(random_state=seed).as_matrix(), around=1, across=True
    )
    return rounded(mesh, 4)


def in_vain(triangles, windings):
    """Number of triangles that do not have the inside behind them alone."""
    behind, ahead = windings.sides(triangles)
    return int((~behind | ahead).sum())


@pytest.mark.parametrize("seed", [0, 4, 6])
def test_unions_have_no_slits_where_bodies_touch(seed):
    """Two rings with common corners, whose sides are flat in places, and cut along other diagonals."""
    rings = ring(0.2, 0.35, seed), ring(0.35, 0.45, seed)
    mesh, windings = samples.union(*rings), Windings(corners(*rings))
    boundary = whole_boundary(windings.triangles, windings, mesh)
    united = Bodies.of_mesh(mesh, windings).united
    assert same_solid(boundary, windings) and same_solid(united, windings)
    assert in_vain(boundary, windings) < in_vain(united, windings)
    assert volume_of(boundary) == pytest.approx(volume_of(united), rel=1e-8)


def test_the_proof_fails_for_any_other_solid():
    parts, _ = overlapping()
    windings = Windings(corners(*parts))
    whole = Bodies.of_chain(windings).united
    bump = box((0.6, 0.4, 0.4), (0.7, 0.5, 0.5))
    wrong = {
        "open": whole[1:],
        "turned": whole[:, ::-1],
        "cavity filled": Bodies.of_chain(Windings(corners(*parts[:2]))).united,
        "body lost": Bodies.of_chain(Windings(corners(parts[0], parts[2]))).united,
        "inner walls kept": corners(*parts),
        "another cavity": np.concatenate([whole, corners(bump)[:, ::-1]]),
        "another body within": np.concatenate([whole, corners(bump)]),
    }
    assert {name: same_solid(triangles, windings) for name, triangles in wrong.items()} == dict.fromkeys(wrong, False)


def test_faces_that_a_cut_lost_come_back():
    """From the chain, whose winding numbers are still known."""
    solid = sh.complete(samples.union(box((0, 0, 0), (2, 1, 1)), box((1, 0.25, 0.25), (3, 2, 2))))
    bounding = solid.bounding.copy()
    bounding[[3, 11, 12]] = False
    broken = replace(solid, bounding=bounding)
    made = whole_boundary(broken.triangles[bounding], solid.windings)
    assert volume_of(made) == pytest.approx(solid.volume, rel=1e-12)
    assert_closed_manifold(broken.surface())


def test_what_cannot_be_proven_is_contoured_and_announced(monkeypatch):
    monkeypatch.setattr(kept_faces, "whole_boundary", lambda *_: None)
    solid = sh.complete(samples.sphere(3))
    bounding = solid.bounding.copy()
    bounding[:2] = False
    with pytest.warns(InexactWarning, match="contoured"):
        surface = replace(solid, bounding=bounding).surface()
    assert_closed_manifold(surface)
    given = {tuple(row) for row in solid.triangles.reshape(-1, 9).round(9).tolist()}
    kept = [tuple(row) in given for row in surface.vertices[surface.faces].reshape(-1, 9).round(9).tolist()]
    assert sum(kept) > 0.8 * len(given)
    assert volume_of(surface.vertices[surface.faces]) == pytest.approx(solid.volume, rel=1e-3)


def test_bodies_with_common_edges_are_kept_apart():
    """Edges of four faces belong to the bodies whose other faces are connected, whichever way they cross."""
    for second in (box((0, 0, 0), (0.5, 2, 1)), box((0, 0, 0), (2, 2, 1)), box((-1, -1, 0), (0, 0, 1))):
        points, faces = indexed(corners(box((0, 0, 0), (1, 1, 1)), second))
        _, apart = separated(points, faces, overlapping=True)
        assert apart.max() == 15
        assert (apart.reshape(2, -1) < 8).all(axis=1).tolist() == [True, False]


def test_crossings_are_as_deep_as_their_shallower_side():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1e-6], [0.4, 0.2, 1], [0.2, 0.4, 1]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    for depth, crossing in ((1e-7, 1), (1e-5, 0)):
        assert len(crossing_faces(points, faces, np.full(2, depth))) == crossing
    fan = np.array([[0, 1, 2], [0, 4, 5]])  # touches at a corner only
    assert not len(crossing_faces(points, fan, np.full(2, 1e-9)))


def test_what_two_surfaces_do_not_share_winds_by_their_difference():
    random = np.random.default_rng(5)
    ball, block = corners(samples.sphere(2)), corners(box((-0.5, -0.4, -0.3), (1.5, 1.2, 0.9)))
    both = np.concatenate([ball, block])
    turned = np.take_along_axis(both, (random.integers(0, 3, (len(both), 1)) + np.arange(3))[..., None] % 3, axis=1)
    shuffled = random.permutation(turned)
    assert [len(each) for each in not_shared(shuffled, both)] == [0, 0]
    others = np.concatenate([block, block[:4]])
    added, lost = not_shared(shuffled, others)
    assert (len(added), len(lost)) == (len(ball), 4)
    points = random.uniform(-1, 1, (50, 3))
    first, second, more, less = (winding_sums(triangles, points) for triangles in (shuffled, others, added, lost))
    np.testing.assert_allclose(first - second, more - less, atol=1e-12)
