"""Gaps are closed on the part of a large mesh around the curves: what is farther away does not matter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import signedheat as sh
from signedheat.curves import curve_distance, surroundings
from signedheat.curves.surroundings import Surroundings
from signedheat.discretization import discretize
from signedheat.methods import SOURCE_TOLERANCE


def plate(n: int, width: float = 1.0):
    """A square mesh of (2 n + 1)² vertices, `width` apart, around the origin."""
    x, y = (c.ravel() for c in np.meshgrid(*[width * np.arange(-n, n + 1.0)] * 2, indexing="ij"))
    index = np.arange((2 * n + 1) ** 2).reshape(2 * n + 1, -1)
    a, b, c, d = (ids.ravel() for ids in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return sh.TriangleMesh(np.stack([x, y, np.zeros(len(x))], axis=1), faces)


def arc(radius: float, begin: float, end: float, n: int = 40):
    angle = np.linspace(begin, end, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)


ARCS = {"one": [(0.0, 5.6)], "two": [(0.0, 2.7), (3.2, 6.0)], "turned": [(0.0, 4.0), (6.0, 4.3)]}


@pytest.fixture
def parts_used(monkeypatch):
    """The surroundings found by each call, None where the whole mesh was used."""
    found = []

    def of(*arguments):
        found.append(Surroundings.of(*arguments))
        return found[-1]

    monkeypatch.setattr(curve_distance, "Surroundings", type("Recorded", (), {"of": staticmethod(of)}))
    return found


@pytest.mark.parametrize("arcs", ARCS.values(), ids=ARCS)
def test_it_is_nearly_the_distance_of_the_whole_mesh(arcs, parts_used, monkeypatch):
    mesh = plate(40)
    curves = [mesh.polyline(arc(6.3, *ends)) for ends in arcs]
    nearby = sh.signed_distance(curves, mesh).values
    monkeypatch.setattr(surroundings, "REACH", np.inf)
    whole = sh.signed_distance(curves, mesh).values
    assert parts_used[0] is not None and parts_used[1] is None
    assert parts_used[0].part.n_faces < mesh.n_faces / 4
    assert (np.sign(nearby) == np.sign(whole)).all()
    assert np.abs(nearby - whole).max() < 0.01 * 2 * 6.3


def test_what_is_farther_away_does_not_matter(parts_used):
    small, large = plate(40), plate(70)
    inner = (np.abs(large.vertices[:, :2]) <= 40).all(axis=1)
    assert np.array_equal(large.vertices[inner], small.vertices)
    ends = ARCS["two"]
    near, far = (sh.signed_distance([m.polyline(arc(6.3, *e)) for e in ends], m).values for m in (small, large))
    assert None not in parts_used
    np.testing.assert_allclose(far[inner], near, atol=1e-9)
    apart = sh.TriangleMesh(
        np.concatenate([small.vertices, small.vertices + np.array([0, 0, 3])]),
        np.concatenate([small.faces, small.faces + small.n_vertices]),
    )
    with pytest.warns(sh.errors.UnreachedWarning, match=f"{small.n_vertices} of {apart.n_vertices}"):
        beside = sh.signed_distance([apart.polyline(arc(6.3, *e)) for e in ends], apart)
    np.testing.assert_allclose(beside.values[: small.n_vertices], near, atol=1e-9)
    assert np.isnan(beside.values[small.n_vertices :]).all()
    assert len(beside.diagnostics.unreached) == small.n_vertices


def test_a_line_around_a_long_tube_needs_the_whole_mesh_where_its_border_disagrees(parts_used):
    n, m = 24, 240
    angle, z = 2 * np.pi * np.arange(n) / n, np.arange(m) * 2 * np.pi / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.tile(ring, (m, 1)), np.repeat(z, n)[:, None]], axis=1)
    a = (np.arange(n)[None] + n * np.arange(m - 1)[:, None]).ravel()
    b = a - a % n + (a + 1) % n
    tube = sh.TriangleMesh(points, np.concatenate([np.stack([a, b, b + n]), np.stack([a, b + n, a + n])], axis=1).T)
    middle = n * (m // 2) + np.arange(n)
    field = sh.signed_distance(tube.path(middle[: n - 3].tolist()), tube)
    assert parts_used[0] is not None  # two sides farther away, each with one sign
    np.testing.assert_allclose(np.abs(field.values), np.abs(points[:, 2] - z[m // 2]), atol=0.2)
    assert set(np.sign(field.values[points[:, 2] > z[m // 2] + 1])) == {1.0}
    # joined at the ends to a torus, what is farther away has both signs on its border
    joined = (
        tube.faces.tolist()
        + [[n * (m - 1) + i, n * (m - 1) + (i + 1) % n, (i + 1) % n] for i in range(n)]
        + [[n * (m - 1) + i, (i + 1) % n, i] for i in range(n)]
    )
    radius = m / n
    turn = 2 * np.pi * np.arange(m) / m
    around = np.repeat(turn, n)
    r = radius + np.tile(ring[:, 0], m)
    torus = sh.TriangleMesh(
        np.stack([r * np.cos(around), r * np.sin(around), np.tile(ring[:, 1], m)], axis=1), np.array(joined)
    )
    curve = torus.path(middle[: n - 3].tolist())
    segments = discretize(torus).segments([curve])[0]
    near = Surroundings.of(torus, segments)
    assert near is not None
    half = sh.signed_distance(near.on_part(curve), near.part)
    assert near.extended(half) is None


def test_neither_turn_nor_place_nor_numbering_matters(parts_used):
    mesh, random = plate(40), np.random.default_rng(1)
    turn = Rotation.random(random_state=3).as_matrix()
    order = random.permutation(mesh.n_vertices)
    place = np.argsort(order)
    faces = random.permutation(place[mesh.faces])
    other = sh.TriangleMesh(mesh.vertices[order] @ turn.T + 1e6, faces)
    ends = ARCS["two"]
    one = sh.signed_distance([mesh.polyline(arc(6.3, *e)) for e in ends], mesh).values
    two = sh.signed_distance([other.polyline(arc(6.3, *e) @ turn.T + 1e6) for e in ends], other).values
    assert parts_used[0].part.n_faces == parts_used[1].part.n_faces
    # merging windows may change distances by this share of an edge, which is 1 long, where ties are decided otherwise
    np.testing.assert_allclose(two, one[order], atol=SOURCE_TOLERANCE, rtol=1e-6)
