"""Sections of shapes by planes, and solids cut in two: closed forms, rigid motion, and two ways to the same area."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box, sheet
from signedheat import samples

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
PLACE = np.block([[TURN, np.array([[5.0], [-3.0], [7.0]])], [np.zeros((1, 3)), 1.0]])
CUBE = sh.complete(box((0, 0, 0), (1, 1, 1)))
DUCK = sh.complete(samples.duck(24))


def moved(place, origin, normal):
    return place[:3, :3] @ origin + place[:3, 3], place[:3, :3] @ normal


@pytest.mark.parametrize("place", [np.eye(4), PLACE], ids=["along the axes", "turned"])
@pytest.mark.parametrize(
    ("origin", "normal", "area", "length"),
    [
        ((0, 0, 0.3), (0, 0, 1), 1.0, 4.0),
        ((0, 0, 0), (0, 0, 1), 1.0, 4.0),  # in the lower side
        ((0, 0, 1), (0, 0, 2), 1.0, 4.0),  # in the upper side
        ((0, 0, 0), (1, -1, 0), np.sqrt(2), 2 + 2 * np.sqrt(2)),  # through two edges
        ((0.5, 0.5, 0.5), (1, 1, 1), 0.75 * np.sqrt(3), 3 * np.sqrt(2)),  # a hexagon
        ((0, 0, 0), (1, 1, 1), 0.0, 0.0),  # touches a corner
        ((0, 0, 0), (1, 1, 0), 0.0, 0.0),  # touches an edge
        ((0, 0, 1.1), (0, 0, 1), 0.0, 0.0),  # misses
    ],
)
def test_sections_of_a_cube(origin, normal, area, length, place):
    section = sh.transform(CUBE, place).section(*moved(place, origin, normal))
    assert section.area == pytest.approx(area, abs=1e-13)
    assert sum(line.length for line in section.outlines) == pytest.approx(length, abs=1e-13)
    assert all(line.closed for line in section.outlines) and not section.sheets


def test_coordinates_of_the_plane_are_those_of_space():
    section = CUBE.section((9, 9, 0.5))
    assert section.outlines[0].bounds.tolist() == [[0, 0], [1, 1]]
    front = CUBE.section((0, 0.25, 0), (0, -1, 0))  # as seen from the front: x to the right, z up
    assert front.outlines[0].bounds.tolist() == [[0, 0], [1, 1]]
    [points] = front.in_space
    assert (points[:, 1] == 0.25).all() and np.ptp(points[:, [0, 2]], axis=0).tolist() == [1, 1]
    tilted = DUCK.section(DUCK.bounds.mean(axis=0), (1, 2, 3))
    assert np.abs(DUCK.distance(np.concatenate(tilted.in_space))).max() < 1e-14


def test_steps_count_on_both_sides_of_a_plane_and_holes_run_clockwise():
    stairs = sh.complete(samples.union(box((0, 0, 0), (2, 2, 1)), box((0.5, 0.5, 1), (3, 1, 2))))
    level = stairs.section((0, 0, 1))
    assert level.area == pytest.approx(4 + 0.5) and len(level.outlines) == 1
    pipe = CUBE - sh.complete(box((0.25, 0.25, -1), (0.75, 0.75, 2)))
    assert sorted(line.signed_area for line in pipe.section((0, 0, 0.5)).outlines) == pytest.approx([-0.25, 1])


def test_a_section_of_a_broken_ball_is_the_circle():
    for sphere in (samples.without_faces(samples.sphere(5), 0.1), samples.without_patches(samples.sphere(5), 3, 0.4)):
        [circle] = sh.complete(sphere).section((0, 0, 0.6)).outlines
        assert np.abs(np.linalg.norm(circle.points, axis=1) - 0.8).max() < 0.01


def test_many_planes_are_as_one_at_a_time_whatever_their_order():
    heights = np.array([0.3, -0.2, 5.0, 0.1, 0.1])
    origin, normal = DUCK.bounds.mean(axis=0), np.array([0.2, -0.4, 1.0])
    together = DUCK.section(origin, normal, heights=heights)
    step = normal / np.linalg.norm(normal)
    for height, section in zip(heights, together, strict=True):
        alone = DUCK.section(origin + height * step, normal)
        assert section.area == pytest.approx(alone.area, rel=1e-12)
        assert len(section.outlines) == len(alone.outlines)
    assert together[2].outlines == []
    layers = DUCK.section((0, 0, 0), heights=(edges := np.linspace(*DUCK.bounds[:, 2], 401))[:-1] + np.diff(edges) / 2)
    assert np.diff(edges)[0] * sum(layer.area for layer in layers) == pytest.approx(DUCK.volume, rel=1e-4)


def test_sections_of_sheets_are_open_lines():
    section = sh.complete(sheet([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])).section((0.25, 0, 0), (1, 0, 0))
    assert section.outlines == [] and section.area == 0
    [line] = section.sheets
    assert not line.closed and line.length == pytest.approx(1)


@pytest.mark.parametrize("place", [np.eye(4), PLACE], ids=["along the axes", "turned"])
@pytest.mark.parametrize(
    ("shape", "origin", "normal"),
    [
        (CUBE, (0, 0, 0.25), (0, 0, 1)),
        (CUBE, (0, 0, 0), (1, -1, 0)),  # through edges
        (DUCK, DUCK.bounds.mean(axis=0), (0.1, 0.2, 1)),
    ],
)
def test_halves_are_closed_and_make_up_the_whole(shape, origin, normal, place):
    solid, (origin, normal) = sh.transform(shape, place), moved(place, np.array(origin, float), np.array(normal, float))
    halves = solid.cut(origin, normal)
    assert sum(half.volume for half in halves) == pytest.approx(solid.volume, rel=1e-10)
    cap = solid.section(origin, normal).area
    assert sum(half.area for half in halves) == pytest.approx(solid.area + 2 * cap, rel=1e-9)
    for half, way in zip(halves, (1, -1), strict=True):
        surface = half.surface()
        assert surface.to_trimesh().is_watertight
        assert (way * ((surface.vertices - origin) @ normal)).min() > -1e-12
        assert half.completion.face_areas.sum() == pytest.approx(cap, rel=1e-9)  # the given faces stay given


def test_the_volume_of_a_segment_of_a_ball():
    above, below = sh.complete(samples.sphere(5)).cut((0, 0, 0.5))
    assert above.volume == pytest.approx(np.pi * 0.25 * (1 - 0.5 / 3), rel=0.01)
    assert below.volume > 5 * above.volume


@pytest.mark.parametrize(
    ("origin", "normal", "heights", "error", "element"),
    [
        ((0, 0, 0.5), (0, 0, 0), None, sh.errors.GeometryError, "normal"),
        ((0, 0), (0, 0, 1), None, sh.errors.GeometryError, "origin"),
        ((0, 0, np.nan), (0, 0, 1), None, sh.errors.GeometryError, "origin"),
        ((0, 0, 0.5), (0, 0, 1), [[1.0]], sh.errors.GeometryError, "heights"),
        ((0, 0, 0.5), (0, 0, 1), [np.inf], sh.errors.GeometryError, "heights"),
    ],
)
def test_planes_that_are_none(origin, normal, heights, error, element):
    with refused(error, element=element):
        CUBE.section(origin, normal, heights=heights)


def test_cuts_that_are_none():
    for height in (0.0, 1.0, 3.0):
        with refused(sh.errors.OutsideError, element="origin"):
            CUBE.cut((0, 0, height))
    with refused(sh.errors.GeometryError):
        sh.complete(sheet([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])).cut((0.5, 0, 0), (1, 0, 0))
