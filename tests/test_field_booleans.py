"""Unions, intersections and differences of fields, against closed forms and each other."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples

GRID = sh.Grid((-2, -1.5, -1.5), 0.1, (41, 31, 31))


def ball(x, radius=1.0, grid=GRID):
    center = np.array([x] + [0.0] * (grid.dimension - 1))
    return sh.Field(grid, np.linalg.norm(grid.points - center, axis=-1) - radius)


A, B = ball(-0.5, 1.013), ball(0.5, 0.807)


def test_union_and_intersection_have_the_volumes_of_solids():
    inside = [(field.values < 0).sum() for field in (A, B, A | B, A & B, A - B, B - A)]
    a, b, union, both, only_a, only_b = inside
    assert union == only_a + both + only_b and a == only_a + both and b == only_b + both
    assert 0 < both < b < a < union


def test_rules_of_sets():
    same = [(A | B, B | A), (A & B, ~(~A | ~B)), (A - B, A & ~B), (~~A, A), (A | A, A), (A | (A & B), A)]
    for one, other in same:
        assert np.array_equal(one.values, other.values)


def test_outside_a_union_distance_is_exact():
    union = A | B
    outside = union.values > 0
    exact = np.minimum(A.values, B.values)
    assert np.array_equal(union.values[outside], exact[outside])
    assert (union.values[~outside] >= sh.sharpen(union).values[~outside] - 0.06).all()  # a bound inside


def test_sharpening_turns_a_difference_into_distance():
    bite = sh.sharpen(A - ball(0.5, 0.6))
    assert bite([[0.5, 0.0, 0.0]])[0] == pytest.approx(0.6, abs=0.03)
    assert bite([[-0.3, 0.0, 0.0]])[0] == pytest.approx(-0.2, abs=0.02)


@pytest.mark.parametrize("width", [0.0, 0.2, 0.7])
def test_blends_differ_from_sets_within_their_width_alone(width):
    near = np.abs(A.values - B.values) < width - 1e-6
    far = np.abs(A.values - B.values) >= width
    for smooth, sharp, sign in (
        (sh.morphology.smooth_union(A, B, width), A | B, -1),
        (sh.morphology.smooth_intersection(A, B, width), A & B, 1),
    ):
        change = sign * (smooth.values - sharp.values)
        assert (change[far] == 0).all() and (change[near] > 0).all()
        assert change.max() <= width / 4 + 1e-12
    near, far = np.abs(A.values + B.values) < width - 1e-6, np.abs(A.values + B.values) >= width
    change = sh.morphology.smooth_difference(A, B, width).values - (A - B).values
    assert (change[far] == 0).all() and (change[near] > 0).all()


def test_blends_have_no_edge():
    """Along a line across the crease the slope of a union jumps, that of a blend does not."""
    line = np.stack([np.linspace(-0.6, 0.6, 241), np.full(241, 0.95)], axis=1)
    grid = sh.Grid((-2, -2), 0.01, (401, 401))
    left, right = ball(-0.5, grid=grid), ball(0.5, grid=grid)
    kinks = [
        np.abs(np.diff(field(line), 2)).max() for field in (left | right, sh.morphology.smooth_union(left, right, 0.5))
    ]
    assert kinks[0] > 5 * kinks[1]


def test_fields_on_surfaces_and_tets_combine():
    mesh = samples.sphere(2)
    north, east = (sh.Field(mesh, 0.3 - mesh.vertices[:, axis]) for axis in (2, 0))
    assert np.array_equal((north | east).values, np.minimum(north.values, east.values))
    assert len((north & east).contour(0.0)) == 1
    tets = sh.tetrahedralize(mesh, resolution=3)
    phi = sh.Field(tets, np.linalg.norm(tets.vertices, axis=1) - 1)
    assert (phi - phi).values.min() >= 0


def test_missing_values_stay_missing():
    values = A.values.copy()
    values[0, 0, 0] = np.nan
    for field in (sh.Field(GRID, values) | B, B & sh.Field(GRID, values)):
        assert np.isnan(field.values[0, 0, 0]) and np.isnan(field.values).sum() == 1


def test_what_held_for_the_source_is_not_carried_on():
    solid = sh.signed_distance(samples.sphere(2), sh.Grid((-2, -2, -2), 0.25, (17, 17, 17)))
    assert solid.solid is not None and solid.confidence is not None
    both = solid | ~solid
    assert both.solid is None and both.confidence is None and both.diagnostics.notes == ()


def test_fields_of_different_domains_are_refused():
    shifted = sh.Field(sh.Grid(GRID.origin + 0.05, GRID.spacing, GRID.shape), A.values)
    with pytest.raises(sh.errors.GeometryError) as told:
        A | shifted
    assert told.value.remedy and told.value.element == "second field"
    mesh = samples.sphere(1)
    with pytest.raises(sh.errors.UnsupportedTypeError) as told:
        A - sh.Field(mesh, mesh.vertices[:, 0])
    assert told.value.element == "second field"
    with pytest.raises(sh.errors.SignedHeatError):
        sh.morphology.smooth_union(A, B, -1.0)
    with pytest.raises(sh.errors.GeometryError):
        sh.morphology.smooth_difference(A, shifted, 0.1)


def test_equal_grids_made_twice_are_one_domain():
    again = sh.Field(sh.Grid((-2, -1.5, -1.5), 0.1, (41, 31, 31)), B.values)
    assert np.array_equal((A | again).values, (A | B).values)


def test_bands_are_combined_where_they_are_the_same():
    band = sh.signed_distance(samples.sphere(2), GRID, band=0.2)
    assert np.array_equal((band | band).values, band.values, equal_nan=True)
    points = np.array([[0.9, 0.1, 0.0], [1.1, 0.0, 0.1]])
    np.testing.assert_allclose((~band).interpolate(points), -band.interpolate(points), rtol=1e-6)
    for wrong in (lambda: band - A, lambda: A & band):
        with refused(sh.errors.GeometryError, "second field"):
            wrong()
    assert (sh.signed_distance(samples.sphere(2), GRID) | A)([[-1.4, 0.0, 0.0]])[0] < 0


def test_fields_of_solids_combine_as_their_solids_do():
    grid = sh.Grid((-0.5, -0.5, -0.5), 0.1, (31, 21, 21))
    whole, bite = box((0, 0, 0), (2, 1, 1)), box((0.5, 0, 0.75), (1, 1, 1))  # with three sides in those of the whole
    one, other = (sh.signed_distance(shape, grid) for shape in (whole, bite))
    less, both, common = one - other, one | other, one & sh.complete(bite)
    assert [field.solid.volume for field in (less, both, common)] == pytest.approx([1.875, 2.0, 0.125], rel=1e-12)
    points = np.random.default_rng(0).uniform(-0.5, 1.5, (200, 3))
    assert np.array_equal(less(points), (sh.complete(whole) - sh.complete(bite)).distance(points))
    assert less([[0.75, 0.5, 1.0]])[0] == pytest.approx(0.25)  # the bound max(a, −b) has 0 there
    assert np.array_equal(sh.sharpen(less).values, less.values) and sh.sharpen(less).solid is less.solid
    np.testing.assert_array_equal(sh.sharpen(-2 * less)(points), -less(points))
    apart = one & sh.signed_distance(box((3, 3, 3), (4, 4, 4)), grid)
    assert apart.solid is None and apart.values.min() > 0
