"""Pieces of broken curves: turned where they disagree, left out where they belong to nothing."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from shapes.surfaces import disk
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.errors import InexactWarning
from signedheat.samples import sphere


def circle(mesh: sh.TriangleMesh, radius: float, begin: float, end: float) -> sh.Curve:
    """An arc round the origin of the plane, in turns."""
    angle = 2 * np.pi * np.linspace(begin, end, 12)
    return mesh.polyline(radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))


@pytest.fixture(scope="module")
def mesh() -> sh.TriangleMesh:
    return disk(24)


@pytest.fixture(scope="module")
def pieces(mesh) -> list[sh.Curve]:
    """A circle of radius 0.6 in six pieces, with gaps of a fifth of their length."""
    return [circle(mesh, 0.6, k / 6, k / 6 + 5 / 36) for k in range(6)]


def taken(field: sh.Field) -> tuple[list[int], list[int]]:
    note = field.diagnostics.note(CurvesTaken)
    return ([], []) if note is None else (note.turned, note.left_out)


def test_turned_pieces_make_no_difference(mesh, pieces):
    right = sh.signed_distance(pieces, mesh)
    given = [*pieces[:2], pieces[2].reversed(), *pieces[3:]]
    phi = sh.signed_distance(given, mesh)
    assert taken(right) == ([], [])
    assert taken(phi) == ([2], [])
    assert str(phi.diagnostics.note(CurvesTaken)) == "curves flipped: 1, the first of them number 2"
    assert np.abs(phi.values - right.values).max() < 1e-9
    exact = 0.6 - np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(phi.values - exact).max() < 0.05
    assert np.abs(sh.signed_distance(given, mesh, as_oriented=True).values - exact).max() > 0.2


def test_a_spurious_piece_is_left_out_with_a_note(mesh, pieces):
    spurious = mesh.polyline([[-0.1, 0.05, 0], [0.2, 0.1, 0]])
    right = sh.signed_distance(pieces, mesh)
    phi = sh.signed_distance([*pieces[:3], spurious, *pieces[3:]], mesh)
    assert taken(phi) == ([], [3])
    assert np.abs(phi.values - right.values).max() < 1e-9
    for option in ("every_piece", "as_oriented"):
        all_of_them = sh.signed_distance([spurious, *pieces], mesh, **{option: True})
        assert taken(all_of_them)[1] == []
        assert np.abs(all_of_them.values).min() < 0.02
        assert np.abs(all_of_them.values[np.linalg.norm(mesh.vertices, axis=1) < 0.05]).max() < 0.2


def test_closing_leaves_it_out_too(mesh, pieces):
    spurious = mesh.polyline([[-0.1, 0.05, 0], [0.2, 0.1, 0]])
    (whole,) = sh.close_curves([pieces[0].reversed(), spurious, *pieces[1:]], mesh)
    at = np.einsum("nk,nkd->nd", whole.barycentric, mesh.vertices[mesh.faces[whole.faces]])
    assert whole.closed
    assert np.abs(np.linalg.norm(at, axis=1) - 0.6).max() < 0.05


def test_strokes_of_which_none_bounds_anything_are_a_guess_and_stay(mesh):
    strokes = [mesh.polyline([[x, -0.2, 0], [x, 0.2, 0]]) for x in (-0.6, 0.5)]
    with pytest.warns(sh.errors.InexactWarning, match="bound nothing"):
        phi = sh.signed_distance(strokes, mesh)
    assert taken(phi)[1] == []
    for curve in strokes:
        assert np.abs(phi(curve)).max() < 0.06


@pytest.mark.parametrize("closed", [False, True])
def test_a_stroke_is_left_out_beside_a_curve_that_is_whole_as_beside_one_with_a_gap(mesh, closed):
    last = [[0.28, -0.02, 0]] * (not closed)
    ring = mesh.polyline([[0.3, 0, 0], [0, 0.3, 0], [-0.3, 0, 0], [0, -0.3, 0], *last], closed=closed)
    phi = sh.signed_distance([ring, mesh.polyline([[-0.6, -0.2, 0], [-0.6, 0.2, 0]])], mesh)
    assert taken(phi) == ([], [1])


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # that it may as well be nothing is told
@pytest.mark.parametrize("seed", range(3))
def test_no_piece_is_left_out_where_half_of_the_curve_is_gone(seed):
    mesh, rng = sphere(4), np.random.default_rng(seed)
    curve = mesh.level_set(mesh.vertices @ [0.1, 0.2, 1.0] + 0.1 * np.sin(4 * mesh.vertices[:, 0]), 0.3)[0]
    ends = np.cumsum(rng.uniform(0.5, 1.5, 20))
    ends = (ends / ends[-1] * (curve.n_points - 1)).astype(int)
    pieces = [
        sh.Curve(curve.faces[a : b + 1], curve.barycentric[a : b + 1])
        for a, b in zip(ends[:-1:2], ends[1::2], strict=True)
    ]
    assert taken(sh.signed_distance(pieces, mesh)) == ([], [])


def test_lines_from_rim_to_rim_are_turned_like_others(mesh):
    """Parallel lines that face the same way contradict each other between them; those that do not are as given."""
    lines = [mesh.level_set(mesh.vertices[:, 0] - x)[0] for x in (-0.31, 0.32)]
    found = sh.orientation(lines, mesh)
    assert found.turned.sum() == 1
    assert found.agreement.min() > 0.999
    assert not sh.orientation([lines[0], lines[1].reversed()], mesh).turned.any()


def tube(n_around: int = 48, n_along: int = 49, length: float = 4.0) -> sh.TriangleMesh:
    """An open tube of radius 1 round the z axis."""
    angle, z = np.meshgrid(2 * np.pi * np.arange(n_around) / n_around, np.linspace(-0.5, 0.5, n_along) * length)
    grid = np.arange(n_around * n_along).reshape(n_along, n_around)
    a, b = grid[:-1], grid[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = np.concatenate([np.stack([a, c, d], axis=-1), np.stack([a, d, b], axis=-1)]).reshape(-1, 3)
    return sh.TriangleMesh(np.stack([np.cos(angle), np.sin(angle), z], axis=-1).reshape(-1, 3), faces)


def rings(mesh: sh.TriangleMesh, apart: float, n: int, lost: float) -> list[sh.Curve]:
    """The boundary of a band round a tube, each of its two rings in n pieces, a part of the length of each lost."""
    pieces = []
    for ring in mesh.level_set(np.abs(mesh.vertices[:, 2]) - apart / 2 + 1e-4, 0.0):
        for k in range(n):
            run = np.arange(k * ring.n_points // n, int((k + 1 - lost) * ring.n_points / n) + 1)
            pieces.append(sh.Curve(ring.faces[run], ring.barycentric[run]))
    return pieces


@pytest.mark.parametrize("apart", [0.6, 1.2])
@pytest.mark.parametrize(("n", "lost"), [(3, 0.4), (8, 0.5)])
@pytest.mark.parametrize("wrong", [[], [1]])
def test_rings_that_face_each_other_stay_so(apart, n, lost, wrong):
    """How their ends attract each other tells nothing of two rings; that φ has slope one between them does."""
    mesh = tube()
    given = [piece.reversed() if k in wrong else piece for k, piece in enumerate(rings(mesh, apart, n, lost))]
    phi = sh.signed_distance(given, mesh)
    exact = np.abs(mesh.vertices[:, 2]) - apart / 2
    assert (np.sign(phi.values) != np.sign(exact)).mean() < 0.03
    assert taken(phi) == (wrong, [])


def test_orienting_keeps_rings_that_face_each_other_too():
    mesh = tube()
    pieces = rings(mesh, 0.6, 3, 0.4)
    given = [pieces[0], pieces[1].reversed(), *pieces[2:]]
    assert sh.orientation(pieces, mesh).turned.tolist() == [False] * 6
    assert sh.orientation(given, mesh).turned.tolist() == [False, True, False, False, False, False]


def test_rings_nearer_than_their_gaps_are_long():
    """Three pieces each, with gaps more than twice as long as the rings are apart: which is meant is a guess."""
    mesh = tube()
    with pytest.warns(InexactWarning, match="ran against about as much of the others"):
        sh.signed_distance(rings(mesh, 0.3, 3, 0.4), mesh)


@pytest.mark.parametrize("radii", [(0.45, 0.5, 0.56), (0.5, 0.53, 0.6), (0.46, 0.5, 0.52, 0.55, 0.6)])
def test_loops_side_by_side_that_run_alike_agree(radii):
    """A loop drawn again and again, by hand: none of them is flipped to bound a narrow band."""
    mesh = disk(24)
    angle = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    loops = [mesh.polyline(radius * ring, closed=True) for radius in radii]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InexactWarning)  # that distance jumps between them, or that one is left out
        phi = sh.signed_distance(loops, mesh)
    away = np.linalg.norm(mesh.vertices, axis=1)
    clear = (away < min(radii) - 0.05) | (away > max(radii) + 0.05)
    assert (np.sign(phi.values) == np.sign(np.mean(radii) - away))[clear].all()
    assert phi.diagnostics.note(CurvesTaken) is None or not phi.diagnostics.note(CurvesTaken).turned


@pytest.mark.parametrize("intrinsic", [True, False, "auto"])
def test_progress_never_goes_back(mesh, pieces, intrinsic):
    told: list[float] = []
    small = [circle(mesh, 0.05, k / 3, k / 3 + 0.3) for k in range(3)]  # these get triangles of their own
    whole = [circle(mesh, 0.6, k / 6, (k + 1) / 6) for k in range(6)]
    for curves in (pieces, small, whole):
        sh.signed_distance(curves, mesh, intrinsic=intrinsic, progress=lambda done, step: told.append(done))
        assert told == sorted(told) and told[-1] == 1.0
        told.clear()


@pytest.mark.parametrize(("below", "above", "gap"), [(0.013, 0.2, 0.8), (0.013, 0.3, 1.2), (-0.1, 0.4, 1.2)])
def test_gaps_beside_other_curves_are_closed_straight(below, above, gap):
    """Heat from the nearer rim of a band bends the line across a gap in the other away from it."""
    ball = sphere(4)

    def parallel(z: float, begin: float, gap: float) -> sh.Curve:
        angle = begin + np.linspace(0, 2 * np.pi - gap, 80)
        radius = np.sqrt(1 - z * z)
        return ball.polyline(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z], axis=1))

    given = [parallel(below, 0.0, gap), parallel(above, np.pi, 0.05).reversed()]
    height = ball.vertices[:, 2]
    within = (height > below) & (height < above)
    wrong = (sh.signed_distance(given, ball).values > 0) != within
    assert wrong.sum() <= 0.01 * within.sum()


def test_strokes_nearer_to_each_other_than_an_edge_are_two():
    """Where triangles are made for curves, these say how near copies are, not the larger ones of the mesh."""
    mesh = box((0, 0, 0), (6, 4, 1))
    given = []
    for x, y in ((1, 1), (3, 1), (1, 3)):
        for radius, way in ((0.4, 1), (0.3, -1)):
            angle = np.linspace(0, 2 * np.pi, 61)
            ring = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle), 0 * angle + 1], axis=1)[::way]
            given += [mesh.polyline(ring[begin : begin + 18]) for begin in (0, 20, 40)]
    assert taken(sh.signed_distance(given, mesh)) == ([], [])
