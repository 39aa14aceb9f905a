"""Curves as people draw them: right, or told."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from shapes import strokes
from shapes.surfaces import disk
from signedheat.curves.curve_completion import completion
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.curves.stroke_directions import CurvePieces
from signedheat.curves.strokes import CutGraph, widened
from signedheat.discretization import discretize
from signedheat.samples import sphere, torus, with_flipped_faces


@pytest.mark.parametrize("seed", range(20))
def test_no_signs_cost_less_than_the_minimum_cut(seed):
    random = np.random.default_rng(seed)
    n = 8
    edges = np.array(list(itertools.combinations(range(n), 2)))[random.permutation(28)[:14]]
    falling, rising = random.random((2, 14)) * (random.random((2, 14)) < 0.7)
    pull, ties = random.normal(size=n), (-1) ** seed * 0.01 * random.random(n)

    def cost(signs):
        first, second = signs[edges].T
        cut = falling[(first > 0) & (second < 0)].sum() + rising[(first < 0) & (second > 0)].sum()
        return cut - (pull + ties) @ signs

    found = CutGraph.of(edges, n).cut(falling, rising, pull, ties)
    assert set(found) <= {-1.0, 1.0}
    least = min(cost(np.array(signs)) for signs in itertools.product([-1.0, 1.0], repeat=n))
    assert cost(found) <= least + 1e-6


@pytest.mark.parametrize("around", [48, 96])
@pytest.mark.parametrize("mirrored", [False, True])
def test_agreement_of_strokes_is_that_of_the_surface_whatever_its_diagonals(around, mirrored):
    """Four pieces of a loop round a torus: neighbours agree, those across by a twentieth of that."""
    ring = torus(n_around=around, n_across=around // 2)
    mesh = sh.TriangleMesh(ring.vertices * [1, -1, 1], ring.faces[:, ::-1]) if mirrored else ring
    step, n = around // 48, around // 2
    pieces = [mesh.path(n * np.arange(begin * step, (begin + 8) * step + 1)) for begin in (0, 12, 24, 36)]
    pieces.append(pieces[0].reversed())
    seen = CurvePieces.of(discretize(mesh), pieces)
    rank = seen.stroke[np.argsort(seen.numbers)]
    found = seen.strokes.agreed[np.ix_(rank, rank)]
    assert -found[0, 4] > 20 * found[0, 1]
    np.testing.assert_allclose(found[[0, 1, 2, 3], [1, 2, 3, 0]], 0.05, rtol=0.03)
    np.testing.assert_allclose(found[[0, 1], [2, 3]], 0.0022, atol=5e-4)


@pytest.mark.parametrize("damage", ["gap", "pieces", "pieces_turned", "twice", "twice_turned", "overlapping", "bits"])
@pytest.mark.parametrize("seed", range(2))
def test_strokes_are_right_without_a_warning(damage, seed):
    drawing = strokes.drawing(np.random.default_rng(seed), damage, 3)
    assert strokes.wrong_share(drawing, sh.signed_distance(drawing.given, drawing.mesh).values) < 0.03


def test_a_stroke_may_be_given_in_bits():
    """Bits that go on in each other are one stroke, whatever their order: the same curves are turned and left out."""
    drawing = strokes.drawing(np.random.default_rng(3), "pieces_turned", 3)
    bits, of = [], []
    for k, stroke in enumerate(drawing.given):
        cuts = np.linspace(0, stroke.n_points - 1, 4).astype(int)
        for begin, end in itertools.pairwise(cuts[np.append(True, np.diff(cuts) > 0)]):
            bits.append(sh.Curve(stroke.faces[begin : end + 1], stroke.barycentric[begin : end + 1]))
            of.append(k)
    order = np.random.default_rng(0).permutation(len(bits))
    whole = sh.orientation(drawing.given, drawing.mesh)
    cut = sh.orientation([bits[k] for k in order], drawing.mesh)
    assert whole.turned.any()
    np.testing.assert_array_equal(cut.turned, whole.turned[np.array(of)[order]])
    np.testing.assert_allclose(cut.agreement, whole.agreement[np.array(of)[order]], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_how_strokes_are_numbered_scaled_and_how_often_they_are_given_does_not_matter(seed):
    drawing = strokes.drawing(np.random.default_rng(seed), "pieces_turned", 3)
    mesh, random = drawing.mesh, np.random.default_rng(seed)
    large = sh.TriangleMesh(1000 * mesh.vertices, mesh.faces)
    rank = random.permutation(mesh.n_faces)
    faces = np.empty_like(mesh.faces)
    faces[rank] = mesh.faces
    twice = [drawing.given[k] for k in random.permutation(len(drawing.given))] * 2
    other = sh.TriangleMesh(mesh.vertices, faces)
    moved = [sh.Curve(rank[curve.faces], curve.barycentric) for curve in twice]
    one = sh.signed_distance(drawing.given, mesh)
    np.testing.assert_array_equal(np.sign(sh.signed_distance(drawing.given, large).values), np.sign(one.values))
    apart = np.sign(sh.signed_distance(moved, other).values) != np.sign(one.values)
    assert np.abs(one.values[apart]).max(initial=0.0) < strokes.edge_length(mesh)


def test_bits_of_a_whole_loop_leave_nothing_to_decide():
    mesh = sphere(3)
    [loop] = mesh.level_set(mesh.vertices[:, 2], 0.03)
    index = np.arange(loop.n_points + 1) % loop.n_points
    bits = [sh.Curve(loop.faces[index[k : k + 2]], loop.barycentric[index[k : k + 2]]) for k in range(loop.n_points)]
    taken = sh.signed_distance(bits[::-1], mesh)
    assert taken.diagnostics.note(CurvesTaken) is None
    np.testing.assert_allclose(taken.values, sh.signed_distance(loop, mesh).values, atol=1e-9)


@pytest.mark.parametrize("damage", ["long_strays", "scribbles", "loop_turned"])
@pytest.mark.parametrize("seed", range(2))
def test_what_belongs_nowhere_is_left_out_or_told(damage, seed):
    drawing = strokes.drawing(np.random.default_rng(seed), damage, 3)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        phi = sh.signed_distance(drawing.given, drawing.mesh)
    assert told or strokes.wrong_share(drawing, phi.values) < 0.06


@pytest.mark.parametrize(("gone", "guessed"), [(0.25, False), (0.45, True)])
def test_a_stroke_with_a_wide_gap_of_its_own_is_a_guess(gone, guessed):
    """An arc of a circle next to pieces of another one: what is missing is little of all, but not of the arc."""
    mesh = disk(24, 2)

    def arc(x: float, begin: float, end: float) -> sh.Curve:
        angles = 2 * np.pi * np.linspace(begin, end, 60)
        return mesh.polyline(np.stack([x + 0.4 * np.cos(angles), 0.4 * np.sin(angles), 0 * angles], axis=1))

    with warnings.catch_warnings(record=True) as announced:
        warnings.simplefilter("always")
        sh.signed_distance([*(arc(-0.45, k / 4, k / 4 + 0.22) for k in range(4)), arc(0.45, 0.0, 1 - gone)], mesh)
    assert ["curve number 4" in str(each.message) for each in announced] == [True] * guessed


@pytest.mark.parametrize("copies", [1, 2])
def test_two_copies_of_a_stroke_that_face_either_way_are_a_guess_unless_there_is_a_third(copies):
    ball = sphere(3)
    circles = [ball.level_set(ball.vertices[:, 2], height)[0] for height in (0.31, 0.315, 0.32)]
    drawn = [strokes.arc(ball, circle, 0.0, 0.97) for circle in circles[: 1 + copies]]
    with warnings.catch_warnings(record=True) as announced:
        warnings.simplefilter("always")
        sh.signed_distance([drawn[0].reversed(), *drawn[1:]], ball)
    assert bool(announced) == (copies == 1)


@pytest.mark.parametrize(("gone", "guessed"), [(0.1, False), (0.2, False), (0.48, True), (0.6, True)])
def test_a_wide_gap_of_a_single_stroke_is_told(gone, guessed):
    """Most of a star on hills: what is shortest and what heat does differ where two of its arms are missing."""
    mesh = disk(16, 1)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    mesh = sh.TriangleMesh(np.stack([x, y, 0.25 * np.sin(4 * x) * np.cos(3 * y)], axis=1), mesh.faces)
    star = np.hypot(x, y) - 0.55 * (1 + 0.25 * np.cos(5 * np.arctan2(y, x)))
    (curve,) = mesh.level_set(star + 1e-6, 0.0)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        sh.signed_distance(strokes.arc(mesh, curve, 0.12, 1.12 - gone), mesh)
    assert bool(told) == guessed


@pytest.mark.parametrize("seed", [4003, 4013, 4016])
def test_a_loop_of_which_most_is_gone_is_a_guess(seed):
    """What is left bounds something with a line nearly as long as itself."""
    random = np.random.default_rng(seed)
    drawn = strokes.whole(strokes.surface(random), random, most=1)
    begin = random.random()
    for gone, guessed in ((0.1, False), (0.6, True)):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            sh.signed_distance(
                strokes.arc(drawn.mesh, drawn.curves[0], begin + gone / 2, begin + 1 - gone / 2), drawn.mesh
            )
        assert bool(told) == guessed


def test_the_side_does_not_depend_on_where_a_curve_starts():
    """A tenth of the faces is turned: left is as most of the faces along the curve see it."""
    mesh = sphere(3)
    curve = mesh.level_set(mesh.vertices[:, 2] + 0.2 * np.sin(3 * mesh.vertices[:, 0]), 0.1)[0]
    torn = with_flipped_faces(mesh, 0.1)
    for start in range(0, curve.n_points, 7):
        placed = torn.polyline(np.roll(strokes.positions(mesh, curve)[:-1], -start, axis=0), closed=True)
        phi = sh.SignedHeatSolver(torn).distance(placed)
        assert phi.values[mesh.vertices[:, 2].argmax()] > 0.5


def test_gaps_of_a_cloud_are_bridged():
    """Points of one bunny-like sheet, folded so that triangles disagree at the crease: no point stays without."""
    random = np.random.default_rng(3)
    points = random.uniform(-1, 1, (900, 3)) * [1, 1, 0]
    points[:, 2] = 0.5 * np.abs(points[:, 0]) ** 0.5 + 0.03 * random.normal(size=900)
    cloud = sh.PointCloud(points)
    line = cloud.polyline([[-0.5, -0.5, 0.35], [-0.5, 0.5, 0.35]])
    used = np.zeros(900, dtype=bool)
    used[cloud.triangulation.faces] = True
    values = sh.SignedHeatSolver(cloud).distance(line).values
    assert np.isfinite(values[used]).all()


def test_a_stray_arc_that_heat_closes_by_a_large_bulge_is_announced():
    """Shortest lines close it on 2.4 % of the area, heat on 6.2 %."""
    random = np.random.default_rng([4024, list(strokes.DAMAGES).index("long_strays")])
    drawing = strokes.drawing(random, "long_strays")
    with pytest.warns(sh.errors.InexactWarning, match="depends on curve number 6"):
        sh.signed_distance(drawing.given, drawing.mesh)


@pytest.mark.parametrize(
    ("damage", "seed", "guessed"),
    [
        ("loop_turned", 9003, True),  # one of two loops, .36 of the length: the wrong one
        ("loop_turned", 9043, True),
        ("pieces_turned", 9009, False),  # two of ten strokes, .44 of the length
        ("pieces_turned", 9016, False),
        ("scribbles", 9029, False),  # a scribble whose ends are near to each other, which bounds nothing
    ],
)
def test_what_is_a_guess_is_announced_and_nothing_else(damage, seed, guessed):
    drawing = strokes.drawing(np.random.default_rng([seed, list(strokes.DAMAGES).index(damage)]), damage)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        values = sh.signed_distance(drawing.given, drawing.mesh).values
    guesses = [each for each in told if "of the length of the curves was left out" not in str(each.message)]
    assert bool(guesses) == guessed
    assert (strokes.wrong_share(drawing, values) > 0.06) == guessed


@pytest.mark.filterwarnings("ignore:.*is a guess", "ignore:.*was left out")
@pytest.mark.parametrize(("damage", "seed"), [("overlapping", 20000), ("scribbles", 20000), ("twice_turned", 20000)])
def test_what_is_turned_and_left_out_does_not_depend_on_the_triangles_of_the_method(damage, seed):
    """Copies of strokes within the width of triangles are left out or not as these happen to lie."""
    drawing = strokes.drawing(np.random.default_rng([seed, list(strokes.DAMAGES).index(damage)]), damage)
    fields = [sh.signed_distance(drawing.given, drawing.mesh, intrinsic=way) for way in ("auto", True, False)]
    fields.append(completion(drawing.mesh, drawing.given, None, 1.0)[0])
    taken = [field.diagnostics.note(CurvesTaken) for field in fields]
    assert (taken[0] is None) == (damage == "overlapping")  # copies by hand are as good as none: as given
    assert len({str(note and (note.turned, note.left_out)) for note in taken}) == 1


def test_of_two_edges_between_the_same_vertices_the_shorter_counts():
    """Two voxels that touch along an edge have it twice; both lengths together were taken for that of one."""
    volume = np.zeros((2, 2, 1), dtype=bool)
    volume[0, 0] = volume[1, 1] = True
    triangles = discretize(sh.DigitalSurface(volume, radius=0)).triangles
    ends, counts = np.unique(np.sort(triangles.edges.vertices, axis=1), axis=0, return_counts=True)
    (tail, head), length = ends[counts == 2][0], triangles.lengths_of_edges.max()
    seen = sparse.csr_matrix(([3.0], ([0], [tail])), shape=(1, triangles.n_vertices))
    assert widened(triangles, seen, 1.01 * length)[0, head] != 0
