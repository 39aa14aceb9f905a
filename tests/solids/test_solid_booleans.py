"""Unions, intersections and differences of solids: exact volumes, areas and signs."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box, sheet
from signedheat import samples
from signedheat.diagnostics import CompletedArea

CUBE = sh.complete(box((0, 0, 0), (1, 1, 1)))
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
PLACE = np.block([[TURN, np.array([[5.0], [-3.0], [7.0]])], [np.zeros((1, 3)), 1.0]])


def boxes(lower, upper, place):
    """The unit cube and another box, as solids, both moved."""
    return [sh.complete(sh.transform(shape, place)) for shape in (box((0, 0, 0), (1, 1, 1)), box(lower, upper))]


@pytest.mark.parametrize("place", [np.eye(4), PLACE], ids=["along the axes", "turned"])
@pytest.mark.parametrize(
    ("lower", "upper", "common", "areas"),
    [
        ((0.5, 0.5, 0.5), (1.5, 1.5, 1.5), 0.125, (10.5, 1.5, 6.0)),  # corners
        ((0.5, 0, 0), (1.5, 1, 1), 0.5, (8.0, 4.0, 4.0)),  # flush sides
        ((0.25, 0.25, -1), (0.5, 0.5, 2), 0.0625, (8.0, 1.125, 6.875)),  # right through
        ((0.25, 0.25, 0.25), (0.5, 0.5, 0.5), 0.015625, (6.0, 0.375, 6.375)),  # one in the other
        ((0.25, 0.25, 0), (0.5, 0.5, 1), 0.0625, (6.0, 1.125, 6.875)),  # a bore as long as the cube
        ((0, 0, 0), (1, 1, 1), 1.0, (6.0, 6.0, None)),  # the same
        ((1, 0, 0), (2, 1, 1), 0.0, (10.0, None, 6.0)),  # sides that touch
        ((0.25, 0.25, 1), (0.5, 0.5, 2), 0.0, (7.0, None, 6.0)),
        ((2, 0, 0), (3, 1, 1), 0.0, (12.0, None, 6.0)),  # apart
    ],
)
def test_volumes_and_areas_of_boxes(lower, upper, common, areas, place):
    a, b = boxes(lower, upper, place)
    other = float(np.prod(np.subtract(upper, lower)))
    for operation, volume, area in zip(
        ("__or__", "__and__", "__sub__"), (1 + other - common, common, 1 - common), areas, strict=True
    ):
        if area is None:
            with refused(sh.errors.SourceError):
                getattr(a, operation)(b)
            continue
        result = getattr(a, operation)(b)
        assert result.volume == pytest.approx(volume, rel=1e-9)
        assert result.area == pytest.approx(area, rel=1e-9)
        surface = result.surface()
        assert surface.to_trimesh().volume == pytest.approx(volume, rel=1e-6)


def test_signs_and_distances_are_those_of_the_two():
    a = sh.complete(samples.without_patches(samples.sphere(3), 3, 0.4))
    b = sh.complete(samples.torus(0.7, 0.3, 40, 20))
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))
    inside_a, inside_b = a.inside(points), b.inside(points)
    least = np.minimum(np.abs(a.distance(points)), np.abs(b.distance(points)))
    for result, inside in (
        (a | b, inside_a | inside_b),
        (a & b, inside_a & inside_b),
        (a - b, inside_a & ~inside_b),
        (b - a, inside_b & ~inside_a),
    ):
        np.testing.assert_array_equal(result.inside(points), inside)
        distances = result.distance(points)
        np.testing.assert_array_equal(distances < 0, inside)
        assert (np.abs(distances) >= least - 1e-9).all()  # the boundary is part of the two


def test_inclusion_and_exclusion():
    a, b = sh.complete(samples.sphere(3)), sh.complete(samples.sphere(3, 0.8, (0.6, 0.1, -0.2)))
    assert (a | b).volume + (a & b).volume == pytest.approx(a.volume + b.volume, rel=1e-9)
    assert (a - b).volume + (a & b).volume == pytest.approx(a.volume, rel=1e-9)
    assert (a - b).volume + (b - a).volume == pytest.approx((a | b).volume - (a & b).volume, rel=1e-9)
    c = sh.complete(samples.sphere(2, 0.5, (0.3, 0.9, 0.2)))
    assert ((a | b) - c).volume == pytest.approx(((a - c) | (b - c)).volume, rel=1e-6)


def test_places_know_their_face_and_their_confidence():
    a = sh.complete(samples.without_patches(samples.sphere(3), 3, 0.4))
    b = sh.complete(box((0.2, 0.2, 0.2), (2, 2, 2)))
    found = (a | b).closest(np.random.default_rng(1).uniform(-1.5, 2.5, (500, 3)))
    given = found.faces >= 0
    faces = np.concatenate([a.source.vertices[a.source.faces], b.source.vertices[b.source.faces]])
    places = np.einsum("ij,ijk->ik", found.barycentric[given], faces[found.faces[given]])
    np.testing.assert_allclose(places, found.points[given], atol=1e-9)
    assert found.completed.any() and (found.confidence[~given] < 1).all() and (found.confidence[given] == 1).all()


def test_sheets_take_no_part():
    with_sheet = sh.complete(
        samples.union(box((0, 0, 0), (1, 1, 1)), sheet([[2, 0, 0], [2, 1, 0], [2, 1, 1], [2, 0, 1]]))
    )
    assert with_sheet.volume == pytest.approx(1) and with_sheet.area == pytest.approx(6)
    bitten = with_sheet - sh.complete(box((0.5, 0, 0), (3, 1, 1)))
    assert bitten.volume == pytest.approx(0.5) and bitten.bounds[1, 0] == pytest.approx(0.5)


def test_with_fields_they_are_fields():
    ball, cube = sh.complete(samples.sphere(3)), sh.complete(box((0, 0, 0), (2, 2, 2)))
    field, nodes = ball.field(resolution=16), cube.field(grid=ball.field(resolution=16).domain)
    for mixed, fields in (
        (field | cube, field | nodes),
        (cube | field, field | nodes),
        (field & cube, field & nodes),
        (cube & field, field & nodes),
        (field - cube, field - nodes),
        (cube - field, nodes - field),
        (sh.morphology.smooth_union(field, cube, 0.2), sh.morphology.smooth_union(field, nodes, 0.2)),
    ):
        np.testing.assert_array_equal(mixed.values, fields.values)
    band = ball.field(spacing=0.05, band=0.2)
    np.testing.assert_array_equal((band | ball).values, band.values)


@pytest.mark.parametrize("operation", ["__or__", "__and__", "__sub__"])
def test_numbers_are_not_combined(operation):
    assert getattr(CUBE, operation)(0.1) is NotImplemented


def test_notes_of_moved_and_combined_solids_say_what_is_completed_of_these():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    whole, broken = (
        sh.complete(sh.TriangleMesh(corners + np.array([9, 0, 0]), faces)),
        sh.complete(sh.TriangleMesh(corners, faces[:3])),
    )
    moved = sh.transform(broken, np.diag([2.0, 2, 2, 1])).diagnostics
    given, told = (solid.note(CompletedArea) for solid in (broken.diagnostics, moved))
    assert told.completed_area == pytest.approx(4 * given.completed_area)
    np.testing.assert_allclose(told.where, 2 * np.array(given.where))
    both = [note for note in (whole | broken).diagnostics.notes if isinstance(note, CompletedArea)]
    assert [note.completed_share for note in both] == pytest.approx([1 / 8])
