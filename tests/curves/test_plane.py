"""Distance to drawings in the plane: exact to their lines, completed where lines are missing."""

import warnings
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes import strokes
from shapes.bodies import distance_to_box
from signedheat import samples
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.curves.outlines import OutlinesFilled
from signedheat.errors import InexactWarning

SQUARE = np.array([[-1.0, -1], [-1, 1], [1, 1], [1, -1]])


def sides(gap):
    """The sides of the square, without this share of each at both ends."""
    ends = np.roll(SQUARE, -1, axis=0)
    return [sh.Polyline([a + gap * (b - a), b - gap * (b - a)]) for a, b in zip(SQUARE, ends, strict=True)]


@pytest.mark.parametrize("resolution", [24, 57])
def test_a_whole_drawing_is_exact(resolution):
    square = sh.Polyline(SQUARE, closed=True)
    field = sh.signed_distance(square, resolution=resolution)
    np.testing.assert_allclose(field.values, distance_to_box(field.domain.points, (-1, -1), (1, 1)), atol=1e-12)
    back = sh.signed_distance(sh.Polyline(SQUARE[::-1], closed=True), field.domain)
    np.testing.assert_allclose(back.values, field.values, atol=1e-12)
    turned = sh.signed_distance(sh.Polyline(SQUARE[::-1], closed=True), field.domain, as_oriented=True)
    away = np.abs(field.values) > 1e-9
    np.testing.assert_allclose(turned.values[away], -field.values[away], atol=1e-12)
    points = np.random.default_rng(0).uniform(-3, 3, (50, 4, 2))
    np.testing.assert_allclose(field(points), distance_to_box(points, (-1, -1), (1, 1)), atol=1e-12)


def crossings(points, outline):
    """How often outlines, (n, 2), run around each of (k, 2) points, and how often a ray from it meets them."""
    a, b = outline, np.roll(outline, -1, axis=0)
    x, y = points[:, None].transpose(2, 0, 1)
    side = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])
    up, down = (a[:, 1] <= y) & (b[:, 1] > y) & (side > 0), (b[:, 1] <= y) & (a[:, 1] > y) & (side < 0)
    return (up.astype(int) - down).sum(axis=1), (up | down).sum(axis=1)


def stars(rng, count, turned):
    """Outlines around random places, many of which cross themselves and each other."""
    outlines = []
    for _ in range(count):
        n = rng.integers(3, 12)
        angles = np.sort(rng.uniform(0, 2 * np.pi, n)) * rng.integers(1, 3)
        around = rng.uniform(0.2, 1, (n, 1)) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        step = rng.choice([-1, 1]) if turned else np.sign(sh.Polyline(around, closed=True).signed_area).astype(int)
        outlines.append((around + rng.uniform(-1, 1, 2))[::step])
    return outlines


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("fill", ["nonzero", "evenodd"])
def test_closed_outlines_are_filled(seed, fill):
    rng = np.random.default_rng(seed)
    outlines, points = stars(rng, rng.integers(1, 7), fill == "evenodd"), rng.uniform(-2, 2, (3000, 2))
    place = rng.choice([0.0, 1e3])
    field = sh.signed_distance([sh.Polyline(o + place, closed=True) for o in outlines], resolution=16, fill=fill)

    def is_filled(places):
        windings, meetings = np.array([crossings(places, outline) for outline in outlines]).transpose(1, 0, 2)
        return (windings != 0).any(axis=0) if fill == "nonzero" else meetings.sum(axis=0) % 2 == 1

    found = field.closest(points + place)
    np.testing.assert_array_equal(found.distances < 0, is_filled(points))
    angles = 2 * np.pi * np.arange(90) / 90
    ring = 1e-5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    around = is_filled((found.points[:100, None] - place + ring).reshape(-1, 2)).reshape(-1, 90)
    assert np.mean(around.any(axis=1) & ~around.all(axis=1)) > 0.5  # but at spikes
    nearer = points + rng.uniform(0, 0.7, points.shape) * found.distances[:, None]
    np.testing.assert_array_equal(is_filled(nearer), is_filled(points))
    np.testing.assert_allclose(np.linalg.norm(points + place - found.points, axis=1), np.abs(found.distances))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-5, 1e-6])
def test_spikes_and_clefts_have_sides(width, seed):
    rng = np.random.default_rng(seed)
    spike = np.array([[0, 0], [1, -width], [1, -1], [2, -1], [2, 1], [1, 1], [1, width]])
    cleft = np.array([[0, 0], [1.5, width], [1.5, 1], [-1, 1], [-1, -1], [1.5, -1], [1.5, -width]])
    angle, place = rng.uniform(0, 2 * np.pi), rng.uniform(-5, 5, 2) * (seed > 3)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    outline = (cleft if seed % 2 else spike) @ turn + place
    # points beside the tip, nearly at a right angle to it
    angles = rng.choice([-1, 1], 200) * (np.pi / 2 + width * rng.normal(size=200))
    away = np.stack([np.cos(angles), np.sin(angles)], axis=1) * 10 ** rng.uniform(-9, -1, (200, 1))
    points = outline[0] + away @ turn
    found = sh.signed_distance([sh.Polyline(outline, closed=True)], resolution=16).closest(points).distances
    corners = [tuple(map(Fraction, corner)) for corner in outline.tolist()]
    inside = [is_inside(corners, *map(Fraction, point)) for point in points.tolist()]
    np.testing.assert_array_equal(found < 0, inside)


@pytest.mark.parametrize("gap", [1e-10, 1e-9, 2e-9, 1e-8])
def test_corners_that_nearly_meet_have_sides(gap):
    rng = np.random.default_rng(0)
    places, sizes = np.array([[-0.5, 0], [0.45, 0.1]]), np.array([0.3, 0.35])
    square = np.concatenate(
        [SQUARE[k] + np.linspace(0, 0.9, 10)[:, None] * (SQUARE[k - 1] - SQUARE[k]) for k in (0, 3, 2, 1)]
    )
    open_square = np.vstack([square, square[-1] + (1 - gap) * (square[0] - square[-1])])
    outlines = [place + size * open_square for place, size in zip(places, sizes, strict=True)]
    lattice = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 2), axis=2).reshape(-1, 2)
    points = np.concatenate([lattice, rng.uniform(-1.5, 1.5, (4000, 2))])
    found = sh.signed_distance([sh.Polyline(outline) for outline in outlines], resolution=16).closest(points).distances
    inside = (np.abs(points[:, None] - places) < sizes[:, None]).all(axis=2).any(axis=1)
    away = np.abs(found) > 1e-6
    np.testing.assert_array_equal(found[away] < 0, inside[away])


def is_inside(corners, x, y):
    """Whether a point is inside an outline, without rounding."""
    meetings = 0
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (ay <= y) != (by <= y):
            meetings += ((bx - ax) * (y - ay) > (by - ay) * (x - ax)) == (by > ay)
    return meetings % 2 == 1


@pytest.mark.parametrize("step", [1e-15, 1e-13, 1e-12, 1e-10, 1e-9, 1e-8])
@pytest.mark.parametrize("place", [0.0, 1e3])
def test_segments_that_are_short_beside_rounding_have_no_say(step, place):
    """A square that misses its first corner by a step in any direction, and one with all corners given twice."""
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.uniform(-3, 3, (1000, 2)), rng.normal(size=(100, 2)) * 1e3])
    for _ in range(10):
        angle = rng.uniform(0, np.pi)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        open_ring = np.vstack([SQUARE, SQUARE[:1]]) + step * rng.normal(size=(5, 2))
        twice = np.repeat(SQUARE, 2, axis=0) + step * rng.normal(size=(8, 2))
        for line in (sh.Polyline(open_ring @ turn + place), sh.Polyline(twice @ turn + place, closed=True)):
            found = sh.signed_distance(line, resolution=16).closest(points @ turn + place).distances
            np.testing.assert_allclose(found, distance_to_box(points, (-1, -1), (1, 1)), atol=1e-7)


@pytest.mark.parametrize("slit", [0.0, 1e-13, 3e-13, 1e-12, 2e-12, 1e-9])
def test_boxes_that_nearly_touch_have_sides(slit):
    points = np.random.default_rng(2).uniform([-1.3, -1.3], [3.3, 1.3], (500, 2))
    exact = np.minimum(distance_to_box(points, (-1, -1), (1, 1)), distance_to_box(points, (1, -1), (3, 1)))
    for angle in np.linspace(0.0, 3.0, 20):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        boxes = [sh.Polyline((SQUARE + move) @ turn, closed=True) for move in ([0, 0], [2 + slit, 0])]
        found = sh.signed_distance(boxes, resolution=16)(points @ turn)
        away = np.abs(exact) > 1e-6
        np.testing.assert_array_equal(found[away] < 0, exact[away] < 0)


@pytest.mark.parametrize("place", [0.0, 1e6, 1e8])
def test_walls_that_end_in_other_walls_are_one_wherever_they_are(place):
    """A box beside another that is higher: far from the origin, its corners lie off the wall by rounding."""
    for angle in np.linspace(0.05, 3.0, 20):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        boxes = [SQUARE, SQUARE * [1, 0.5] + [2, 0.1]]
        field = sh.signed_distance([sh.Polyline(box @ turn + place, closed=True) for box in boxes], resolution=16)
        found = field.closest(np.array([[1.0, 0.1], [0.9, 0.1]]) @ turn + place).distances
        np.testing.assert_allclose(found, [-0.5, -np.hypot(0.5, 0.1)], atol=1e-9 + 1e-15 * place)


def test_outlines_unite_whichever_way_they_run():
    moves = np.array([[0, 0], [0.5, 0.3], [-0.3, 0.9], [4, 0]])
    outlines = [(SQUARE + move)[::step] for move, step in zip(moves, (1, -1, 1, -1), strict=True)]
    outlines.append(0.25 * SQUARE[::-1])
    points = np.random.default_rng(0).uniform(-2, 6, (2000, 2))
    inside = np.array([distance_to_box(points, o.min(axis=0), o.max(axis=0)) < 0 for o in outlines])
    united = inside[:4].any(axis=0) & ~(inside[4] & (inside[:4].sum(axis=0) < 2))  # the last one is a hole in the first
    for _ in range(2):
        field = sh.signed_distance([sh.Polyline(o, closed=True) for o in outlines], resolution=32)
        np.testing.assert_array_equal(field(points) < 0, united)
        outlines = [o[::-1] for o in outlines[::-1]]


def test_a_drawing_filled_says_what_lies_inside():
    field = sh.signed_distance([sh.Polyline(s * SQUARE, closed=True) for s in (1, 0.5)], resolution=16)
    note = field.diagnostics.note(OutlinesFilled)
    assert note.important and note.length_inside == pytest.approx(1 / 3)
    with refused(sh.errors.SignedHeatError, "fill"):
        sh.signed_distance(sh.Polyline(SQUARE, closed=True), fill="odd")


def test_offsets_of_a_drawing_are_exact():
    [outline] = sh.signed_distance(sh.Polyline(SQUARE, closed=True), resolution=33).offset(0.25)
    np.testing.assert_allclose(distance_to_box(outline.points, (-1, -1), (1, 1)), 0.25, atol=1e-4)


def test_a_drawing_with_gaps_is_exact_where_it_is_there():
    field = sh.signed_distance(sides(0.1), resolution=97)
    exact, points = distance_to_box(field.domain.points, (-1, -1), (1, 1)), field.domain.points
    beside = (np.abs(points).min(axis=-1) < 0.5) & (np.abs(exact) < 0.4)
    np.testing.assert_allclose(field.values[beside], exact[beside], atol=1e-12)
    assert np.abs(field.values - exact).max() < 0.2  # corners are cut off by less than the gaps
    assert ((field.values < 0) == (exact < 0))[np.abs(exact) > 0.15].all()


def test_a_turned_and_scaled_drawing_has_the_same_distances():
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (400, 2))
    one = sh.signed_distance(sides(0.1), resolution=80)
    other = sh.signed_distance([sh.Polyline(1e3 * line.points @ turn) for line in sides(0.1)], resolution=80)
    assert np.abs(other(1e3 * points @ turn) / 1e3 - one(points)).max() < 0.03


@pytest.mark.filterwarnings("ignore:.*of the length of the curves was left out")
@pytest.mark.parametrize("damage", ["pieces_turned", "twice_turned", "bits", "long_strays", "scribbles"])
def test_strokes_are_turned_or_left_out(damage):
    drawing, lines = strokes.drawing_in_plane(np.random.default_rng(4), damage)
    places = drawing.mesh.vertices[:, :2]
    field = sh.signed_distance(lines, sh.Grid.around([places.min(axis=0), places.max(axis=0)], 97, padding=0.0))
    outside = drawing.sides[places.sum(axis=1).argmax()]  # what is bounded is inside, whichever way it runs
    assert strokes.wrong_share(drawing, outside * field(places)) < 0.03


def rectangle(begin, gone, way):
    """10 by 6, without a share of its length, beginning at another, either way round; as an open line."""
    corners = np.array([[0, 0], [10, 0], [10, 6], [0, 6], [0, 0]])
    at = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))]) / 32
    share = np.unique(
        [begin, *at[(at > begin) & (at < begin + 1 - gone)], *(1 + at[1 + at < begin + 1 - gone]), begin + 1 - gone]
    )
    points = np.stack([np.interp(share % 1, at, corners[:, axis]) for axis in (0, 1)], axis=1)
    return sh.Polyline(points[::way])


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("begin", [0.0, 0.45])
@pytest.mark.parametrize("gone", [0.0, 1e-14, 1e-6, 0.01, 0.2, 0.3])
def test_a_ring_is_a_ring_whatever_it_misses(gone, begin, way):
    line = rectangle(begin, gone, way)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InexactWarning if gone > 0.2 else ())
        field = sh.signed_distance(line, resolution=64, padding=3.0)
    depth = 3.0 if gone < 0.2 else 2.5
    assert field([5.0, 3.0]) < -depth + 1e-6 and (field([[-2.5, -2.5], [12.5, 8.5]]) > 2.5).all()
    [outline] = field.offset(1.0)
    assert abs(abs(outline.signed_area) - (12 * 8 - 4 + np.pi)) < (0.2 if gone < 0.1 else 16)
    if gone < 1e-9:
        np.testing.assert_allclose(field.values, distance_to_box(field.domain.points, (0, 0), (10, 6)), atol=1e-9)


@pytest.mark.parametrize("ways", [(1, 1, 1, 1), (1, -1, 1, -1), (-1, -1, -1, 1)])
def test_lines_that_close_together_are_filled(ways):
    """The sides of a square as a drawing program writes them, in any order and either way, also given twice."""
    lines = [side if way > 0 else side.reversed() for side, way in zip(sides(0.0), ways, strict=True)]
    for given in (lines, lines[::-1], [*lines, lines[2], lines[0].reversed()]):
        field = sh.signed_distance(given, resolution=24)
        np.testing.assert_allclose(field.values, distance_to_box(field.domain.points, (-1, -1), (1, 1)), atol=1e-12)
        assert field.diagnostics.note(OutlinesFilled).outlines == 1


def test_lines_drawn_there_and_back_are_no_outline():
    line = np.array([[0.0, 0.0], [1.0, 0.2], [2.0, 0.0]])
    one = sh.signed_distance(sh.Polyline(line), resolution=24)
    twice = sh.signed_distance([sh.Polyline(line), sh.Polyline(line + 1e-13)], one.domain)
    np.testing.assert_allclose(twice.values, one.values, atol=1e-7)  # the gap times the slope of heat beyond the ends


@pytest.mark.parametrize("way", [1, -1])
def test_direction_decides_where_nothing_is_bounded(way):
    arc = np.linspace(0, 0.6 * np.pi, 30)
    for line in ([[0.0, 0.0], [2.0, 0.1]], np.stack([np.cos(arc), np.sin(arc)], axis=1)):
        points = np.asarray(line)[::way]
        field = sh.signed_distance(sh.Polyline(points), resolution=32)
        middle = points[len(points) // 2 - 1 : len(points) // 2 + 1]
        left = np.array([[0, -1], [1, 0]]) @ (middle[1] - middle[0])
        assert field(middle.mean(axis=0) + 0.05 * left) > 0 > field(middle.mean(axis=0) - 0.05 * left)


@pytest.mark.parametrize("gap", [1e-10, 1e-5, 0.05])
@pytest.mark.parametrize("way", [1, -1])
def test_outlines_with_and_without_gaps_are_filled_alike(gap, way):
    square = sh.Polyline(SQUARE, closed=True)
    broken = sh.Polyline(np.vstack([SQUARE, [[gap - 1, -1]]])[::way] + np.array([4, 0]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InexactWarning)  # two alike that run against each other
        field = sh.signed_distance([square, broken], resolution=64)
    np.testing.assert_allclose(field([[0, 0], [4, 0], [2, 0]]), [-1, -1, 1], atol=1e-9)


@pytest.mark.parametrize("angle", [0.1, 0.17, 0.87, 2.27])
def test_outlines_that_share_lines_are_filled_by_turns(angle):
    """What Clipper makes of them runs along the shared lines there and back."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    low, high = np.array([[0, 0], [1, 0], [0.4, 0]]), np.array([[2, 1], [3, 0.7], [1.5, 0.5]])
    boxes = [np.array([a, [b[0], a[1]], b, [a[0], b[1]]]) for a, b in zip(low, high, strict=True)]
    lines = [sh.Polyline(box @ turn + [0.3, 0.7], closed=True) for box in boxes]
    field = sh.signed_distance(lines, resolution=32, fill="evenodd")
    places = (field.domain.points - [0.3, 0.7]) @ turn.T
    inside = ((places[..., None, :] > low) & (places[..., None, :] < high)).all(axis=-1).sum(axis=-1) % 2 == 1
    clear = np.abs(field.values) > 1e-9
    np.testing.assert_array_equal((field.values < 0)[clear], inside[clear])


def circle(x, y, radius, begin=0.0, gone=0.0, n=200):
    """A circle without a share of it after an angle, as an open line that ends where it begins if nothing is gone."""
    angles = begin + 2 * np.pi * np.linspace(gone, 1.0, n)
    return np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)


@pytest.mark.parametrize("gone", [0.0, 1e-9, 1e-3, 0.01, 0.025])
@pytest.mark.parametrize("way", [1, -1])
def test_rings_with_narrow_gaps_are_outlines_whatever_they_meet(gone, way):
    """Rings that cross, that begin at a common point, and that are drawn twice; their gaps are closed straight."""
    points = np.random.default_rng(0).uniform(-2.2, 2.2, (2000, 2))
    scenes = {
        "cross": [(-0.5, 0.1, 1.0), (0.5, 0, 0.9)],
        "begin together": [(-1.0, 0, 1.0), (1.0, 0, 1.0, np.pi)],
        "twice": [(0, 0, 1.0), (0, 1e-9, 1.0)],
    }
    for rings in scenes.values():
        lines = [circle(*ring, gone=gone)[:: way if k == 1 else 1] for k, ring in enumerate(rings)]
        away = [np.linalg.norm(points - ring[:2], axis=1) - ring[2] for ring in rings]
        inside = (away[0] < 0) | (away[1] < 0)
        field = sh.signed_distance([sh.Polyline(line) for line in lines], resolution=16)
        clear = np.min(np.abs(away), axis=0) > np.pi**2 * gone**2 / 2 + 2e-3  # the sagitta of the gap, and of segments
        found = field.closest(points)
        np.testing.assert_array_equal((found.distances < 0)[clear], inside[clear])
        assert (found.faces < 0).mean() <= 2 * gone + 0.01 and ((found.faces < 0).any() or gone < 0.01)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("gone", [(0.01, 0.0), (0.0, 0.01), (0.02, 0.015), (0.1, 0.0)])
def test_a_ring_with_a_gap_is_a_hole_in_another_whichever_way_it_runs(gone, way):
    lines = [circle(0, 0, 1, gone=gone[0]), circle(0.1, 0, 0.5, 2.0, gone=gone[1])[::way]]
    if gone[1] == 0:  # what closes says itself on which side it is, by its direction
        lines = [lines[0][::way], lines[1][::-way]]
    field = sh.signed_distance([sh.Polyline(line) for line in lines], resolution=48)
    np.testing.assert_array_equal(field([[0.1, 0], [-0.7, 0], [0.85, 0], [1.15, 0]]) < 0, [False, True, True, False])


@pytest.mark.parametrize("gone", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("broken", [0, 1, 2])
@pytest.mark.parametrize("way", [1, -1])
def test_an_island_in_a_lake_stays_whichever_shore_has_a_gap(gone, broken, way):
    radii, ways = [1.0, 0.7, 0.4], [1, -1, 1]
    if gone > 0:
        ways[broken] = way
    lines = [
        sh.Polyline(circle(0, 0, radius, k, gone * (k == broken))[::step])
        for k, (radius, step) in enumerate(zip(radii, ways, strict=True))
    ]
    field = sh.signed_distance(lines, resolution=16)
    found = field.closest([[0.0, 0.1], [0.0, 0.5], [0.0, 0.9], [0.0, 1.1]]).distances
    np.testing.assert_allclose(found, [-0.3, 0.1, -0.1, 0.1], atol=0.01)


def test_distance_across_a_gap_is_to_its_straight_line():
    field = sh.signed_distance(sh.Polyline(circle(0, 0, 1, gone=0.02)), resolution=16)
    found = field.closest(np.array([[0.5, 0.5 * np.tan(0.02 * np.pi)], [-0.5, 0.0]]))
    expected = np.cos(0.02 * np.pi) - 0.5 / np.cos(0.02 * np.pi)
    np.testing.assert_allclose(found.distances, [-expected, -0.5], atol=2e-4)
    assert found.faces[0] == -1 and found.confidence[0] == 0 and found.faces[1] >= 0 and found.confidence[1] == 1


@pytest.mark.parametrize("ways", [(1, 1, 1), (1, -1, 1), (-1, -1, -1)])
def test_lines_that_join_and_nearly_close_are_an_outline(ways):
    """Three sides of a box, beside a whole one whose sides are lines of their own."""
    whole = sides(0.0)
    box = [side if way > 0 else side.reversed() for side, way in zip(sides(0.0)[:3], ways, strict=True)]
    lines = [*whole, *(sh.Polyline(side.points * [0.5, 1.0] + [3, 0]) for side in box)]
    field = sh.signed_distance(lines, resolution=48)
    assert field([[0, 0], [3, 0]]).max() < -0.4 and field([[1.5, 0], [-1.5, 0], [4.5, 0], [3, 1.5]]).min() > 0.3


ROOMS = {"two": [(0, 0), (2, 0)], "bend": [(0, 0), (2, 0), (0, 2)], "four": [(0, 0), (2, 0), (0, 2), (2, 2)]}


@pytest.mark.parametrize("plan", [*ROOMS, "row", "diagonal"])
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.1])
@pytest.mark.parametrize("walls", ["twice", "once"])
def test_rooms_that_share_walls_are_filled_however_their_walls_are_given(plan, angle, walls):
    """Every wall is a line of its own; those between rooms are given once, or with each room."""
    moves = {"row": [(2 * k, 0) for k in range(5)], "diagonal": [(0, 0), (2, 2)], **ROOMS}[plan]
    rng = np.random.default_rng(0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    sides_of_rooms = [np.array(side) + move for move in moves for side in pairwise([*SQUARE, SQUARE[0]])]
    if walls == "once":
        sides_of_rooms = list({tuple(side.mean(axis=0)): side for side in sides_of_rooms}.values())
    lines = [sh.Polyline(side[:: rng.choice([-1, 1])] @ turn) for side in sides_of_rooms]
    stairs = sh.Polyline(np.array([[-1, -1], [-1.4, -1.2]]) @ turn)  # they lead nowhere
    points = rng.uniform(-1.5, 9.5, (2000, 2))
    inside = np.any([(np.abs(points - move) < 1).all(axis=1) for move in moves], axis=0)
    exact = sh.signed_distance([sh.Polyline((SQUARE + m) @ turn, closed=True) for m in moves], resolution=16)
    field = sh.signed_distance([lines[k] for k in rng.permutation(len(lines))], resolution=16)
    found, expected = (f.closest(points @ turn).distances for f in (field, exact))
    clear = np.abs(expected) > 1e-9
    np.testing.assert_array_equal((found < 0)[clear], inside[clear])
    np.testing.assert_allclose(found, expected, atol=1e-9)
    left = sh.signed_distance([*lines, stairs], resolution=48)
    assert ((left.closest(points @ turn).distances < 0) == inside)[np.abs(expected) > 0.1].all()


def test_a_bow_in_strokes_is_a_guess():
    """Its loops run against each other, and strokes that overlap show no outline."""
    angles = 2 * np.pi * np.linspace(0, 1, 200)
    bow = np.stack([np.sin(angles), 0.6 * np.sin(2 * angles)], axis=1)
    for n in (6, 8):
        starts = np.arange(n) * 199 // n
        strokes = [bow[(k + np.arange(220 // n + 10)) % 199] for k in starts]
        with pytest.warns(InexactWarning, match="guess"):
            sh.signed_distance([sh.Polyline(stroke) for stroke in strokes], resolution=48)


def test_a_tie_is_announced_and_decided_alike_however_it_is_given():
    """Two halves of a circle that face each other: one of them is turned."""
    angles = 2 * np.pi * np.arange(19) / 40
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found = []
    for scale, order in ((1.0, [0, 1]), (1000.0, [0, 1]), (1.0, [1, 0]), (1.0, [1, 0, 0, 1])):
        halves = [sh.Polyline(scale * arc), sh.Polyline(-scale * arc[::-1])]
        with pytest.warns(InexactWarning, match="is a guess"):
            field = sh.signed_distance([halves[k] for k in order], resolution=32)
        found.append(field([[0.0, 0.0]]).item() / scale)
    np.testing.assert_allclose(found, found[0], rtol=1e-3)


def test_what_was_done_with_strokes_is_noted_and_may_be_refused():
    lines = sides(0.1)
    lines[1] = lines[1].reversed()
    scribble = sh.Polyline([[0.2, 0.3], [0.4, 0.35], [0.5, 0.2]])
    field = sh.signed_distance([*lines, scribble], resolution=48)
    note = field.diagnostics.note(CurvesTaken)
    assert note.turned == [1]
    assert note.left_out == [4]
    assert note.share_left_out == pytest.approx(0.07, abs=0.02) and "of the length" in str(note)
    np.testing.assert_array_equal(field.values, sh.signed_distance(sides(0.1), field.domain).values)
    assert sh.signed_distance([*lines, scribble], field.domain, as_oriented=True)([[0.0, 0.9]]) > 0
    kept = sh.signed_distance([*sides(0.1), scribble], field.domain, every_piece=True)
    assert abs(kept([scribble.points[1]])) < 0.05


def test_a_guess_is_announced():
    with pytest.warns(InexactWarning, match="curve"):
        sh.signed_distance([side.reversed() if k % 2 else side for k, side in enumerate(sides(0.05))], resolution=32)


@pytest.fixture(scope="module")
def drawing():
    """Sides of which one is turned, and distance around them."""
    lines = sides(0.1)
    lines[2] = lines[2].reversed()
    return lines, sh.signed_distance(lines, resolution=65)


@pytest.mark.parametrize("side", [0.4, 1.2, 18.0])
def test_a_drawing_is_completed_alike_wherever_distance_is_asked(side, drawing):
    lines, everywhere = drawing
    grid = sh.Grid.around([[0.7, 0.7], [0.7 + side, 0.7 + side]], 19, padding=0.0)  # at, and around, a missing corner
    inside = everywhere.domain.contains(grid.points)
    field = sh.signed_distance(lines, grid)
    np.testing.assert_allclose(field.values[inside], everywhere(grid.points[inside]), atol=0.03)
    np.testing.assert_allclose(field.values, distance_to_box(grid.points, (-1, -1), (1, 1)), atol=0.15)


def test_points_with_normals_in_the_plane():
    angles = 2 * np.pi * np.arange(300) / 300
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    grid = sh.Grid.around([[-1, -1], [1, 1]], 80)
    field = sh.signed_distance(sh.PointCloud(circle, circle), grid)
    assert np.abs(field.values - (np.linalg.norm(grid.points, axis=-1) - 1)).max() < 0.02
    one = sh.signed_distance(sh.PointCloud([[0.0, 0]], [[0, 1.0]]), grid)
    assert one([[0.0, 0.5]]) > 0 > one([[0.0, -0.5]])


def test_what_does_not_fit_is_refused():
    with refused(sh.errors.ConstraintError):
        sh.signed_distance(sides(0.1), resolution=16, constraint=sh.constraints.EachComponent())
    with refused(sh.errors.UnsupportedTypeError, "band"):
        sh.signed_distance(sides(0.1), resolution=16, band=0.1)
    with refused(sh.errors.SourceError):
        sh.signed_distance(samples.sphere(1).path([0, 1]))


@pytest.mark.parametrize("ending", ["svg", "csv"])
def test_open_lines_far_away_stay_open_and_no_lines_are_no_file(tmp_path, ending):
    far = sh.Polyline([[1e9, 0], [1e9 + 0.5, 0], [1e9 + 0.5, 0.5], [1e9 + 0.25, 0.5]])
    sh.io.write_polylines(far, tmp_path / f"far.{ending}")
    [read] = sh.io.read_polylines(tmp_path / f"far.{ending}")
    assert not read.closed and np.array_equal(read.points, far.points)
    with refused(sh.errors.FileFormatError, file=f"none.{ending}"):
        sh.io.write_polylines([], tmp_path / f"none.{ending}")


@pytest.mark.parametrize("ending", ["svg", "csv"])
def test_lines_there_and_back_are_closed_in_every_format(tmp_path, ending):
    back = sh.Polyline([[0, 0], [1, 0]], closed=True)
    sh.io.write_polylines(back, tmp_path / f"back.{ending}")
    [read] = sh.io.read_polylines(tmp_path / f"back.{ending}")
    assert read.closed and read.points.tolist() == back.points.tolist()


def test_drawings_report_what_is_done():
    fractions = []
    sh.signed_distance(sides(0.1), resolution=24, progress=lambda fraction, _: fractions.append(fraction))
    assert len(fractions) > 3 and fractions == sorted(fractions) and fractions[-1] == 1.0


@pytest.mark.parametrize(
    "inner",
    [[[0, 1], [2, 1], [2, 3], [0, 3]], [[0, 1.7], [1, 1], [2, 2], [1, 2.5]], [[1, 1], [2, 1], [2, 3], [1, 3]]],
    ids=["shares a wall", "touches with a corner", "lies apart"],
)
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1, 2.2, 4.0])
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_a_hole_that_touches_a_ring_with_a_gap_is_one_wherever_they_lie(inner, turn, away):
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ring = np.array([[0.0, 2.0], [0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 2.05]])
    lines = [sh.Polyline(ring @ matrix + away), sh.Polyline(inner @ matrix + away, closed=True)]
    points = np.array([[0.5, 0.5], [1.2, 2.0], [1.5, 2.0], [3.0, 2.0], [-0.5, 2.0]]) @ matrix + away
    for given in (lines, lines[::-1], [line.reversed() for line in lines]):
        assert (sh.signed_distance(given)(points) < 0).tolist() == [True, False, False, True, False]
