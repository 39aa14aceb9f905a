"""Distance to the zero set of arrays: closed forms, rates, symmetries, and arrays of nothing but signs."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused


def nodes(n, dimension, spacing=1.0):
    """Positions of the nodes of a cube around 0, coordinates first."""
    axes = [np.arange(n) - (n - 1) / 2] * dimension
    return np.stack(np.meshgrid(*axes, indexing="ij")) * np.reshape(spacing, (-1,) + (1,) * dimension)


def ball(points, radius, centre=0.0):
    return np.linalg.norm(points - np.reshape(centre, (-1,) + (1,) * (len(points.shape) - 1)), axis=0) - radius


def box(points, half):
    off = np.abs(points) - np.reshape(half, (-1,) + (1,) * (len(points.shape) - 1))
    return np.linalg.norm(np.maximum(off, 0), axis=0) + np.minimum(off.max(axis=0), 0)


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
@pytest.mark.parametrize("slope", [1e-300, 0.3, 1e300])
def test_distance_to_planes_is_exact(dimension, slope):
    steps = np.array([0.5, 2.0, 1.0, 0.7])[:dimension]
    points, normal = nodes(12, dimension, steps), np.array([1.0, -0.3, 0.7, 0.4])[:dimension]
    normal /= np.linalg.norm(normal)
    plane = np.tensordot(normal, points, 1) - 0.137
    feet = points - plane * normal.reshape((-1,) + (1,) * dimension)
    away = (np.abs(feet) < 4 * steps.reshape((-1,) + (1,) * dimension)).all(axis=0)
    found = sh.redistance(slope * plane, steps)
    np.testing.assert_allclose(found[away], plane[away], atol=2e-15 if dimension == 1 else 1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_distance_to_a_sphere_of_any_level_set_is_of_third_order_and_far_better_than_marching(dimension):
    """Fast marching (scikit-fmm 2025.6) is off by .35 cells in the plane and .44 in space with 48 nodes."""
    worst = []
    for n in (24, 48):
        points = nodes(n, dimension, 2 / (n - 1))
        exact = ball(points, 0.6, [0.011, -0.017, 0.003][:dimension])
        bent = exact * (1 + 0.5 * np.sin(3 * points[0]) * np.cos(2 * points[1]))
        for level_set in (exact, (exact + 0.6) ** 2 - 0.36, bent):
            error = np.abs(sh.redistance(level_set, 2 / (n - 1)) - exact)
            worst.append(error.max() * (n - 1) / 2)
    assert max(worst) < 0.03
    assert worst[3] < worst[0] / 2 and worst[5] < worst[2] / 1.3


@pytest.mark.parametrize("dimension", [2, 3])
def test_signs_alone_tell_distance_to_half_a_cell(dimension):
    """Fast marching is off by up to .55 cells in the plane and .72 in space, by .25 and .20 in the mean square."""
    rng = np.random.default_rng(3)
    greatest, squares = [], []
    for _ in range(4):
        exact = ball(nodes(48, dimension), 14.1, rng.uniform(-0.5, 0.5, dimension))
        error = sh.redistance(np.where(exact < 0, -1, 1)) - exact
        greatest.append(np.abs(error).max())
        squares.append(np.sqrt((error**2).mean()))
    assert max(greatest) < 0.51 and max(squares) < (0.22 if dimension == 2 else 0.16)


def test_signs_in_four_dimensions_tell_distance_to_half_a_cell():
    """A distance transform, less half a cell, is off by .25 cells in the mean square."""
    exact = ball(nodes(15, 4), 4.3, [0.2, -0.1, 0.3, 0.4])
    error = sh.redistance(np.where(exact < 0, -1.0, 1.0)) - exact
    assert np.abs(error).max() < 0.56 and np.sqrt((error**2).mean()) < 0.2


@pytest.mark.parametrize("row", [1, 4, 8])
def test_a_straight_line_between_signs_is_midway_also_beside_a_wall(row):
    values = np.where(np.arange(9)[:, None] < row, -1, 1) * np.ones((9, 6))
    exact = np.arange(9)[:, None] - row + 0.5 + np.zeros((9, 6))
    np.testing.assert_allclose(sh.redistance(values), exact, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_edges_are_as_the_contour_has_them(dimension):
    """Linear interpolation cuts corners off by less than a cell."""
    exact = box(nodes(24, dimension), np.array([6.3, 7.2, 5.4])[:dimension])
    assert np.abs(sh.redistance(exact) - exact).max() < 1
    for clip in (1.0, 3.0):
        clipped = ball(nodes(32, dimension), 9.2)
        assert np.abs(sh.redistance(np.clip(clipped, -clip, clip)) - clipped).max() < 0.15


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize(("kind", "slack"), [("smooth", 0.03), ("noise", 0.35), ("signs", 0.35), ("integers", 0.35)])
def test_symmetries(dimension, kind, slack):
    """In rough arrays marching cubes has a preferred direction."""
    rng = np.random.default_rng(dimension)
    values = rng.normal(size=(7, 9, 6)[:dimension])
    if kind == "smooth":
        values = ball(nodes(9, dimension), 2.7)[tuple(slice(n) for n in values.shape)]
    elif kind == "signs":
        values = np.sign(values)
    elif kind == "integers":
        values = np.round(2 * values)
    steps = np.array([1.0, 0.5, 1.5])[:dimension]
    found = sh.redistance(values, steps)
    np.testing.assert_array_equal(np.sign(found), np.sign(values))
    np.testing.assert_allclose(sh.redistance(7 * values, 10 * steps), 10 * found, rtol=1e-9, atol=1e-9)
    near = {"rtol": 0, "atol": 1e-9 if dimension == 1 else slack}
    np.testing.assert_allclose(sh.redistance(np.flip(values), steps), np.flip(found), **near)
    np.testing.assert_allclose(sh.redistance(values.T, steps[::-1]), found.T, **near)
    if kind != "integers":  # whose zeros change sides
        np.testing.assert_allclose(sh.redistance(-values, steps), -found, **near)


@pytest.mark.parametrize(("values", "distances"), [
    ([-1, 0, 1], [-1, 0, 1]), ([0, 0], [0, 0]), ([0, 1, 1], [0, 1, 2]), ([-1, -1, 3], [-1.25, -0.25, 0.75]),
    ([1, -1, 1], [0.5, -0.5, 0.5]), ([[1, 0, -1]], [[1, 0, -1]]), ([[3], [-1]], [[0.75], [-0.25]]),
    ([[0, 1], [1, 1]], [[0, 1], [1, np.sqrt(2)]]),
])  # fmt: skip
def test_small_arrays(values, distances):
    np.testing.assert_allclose(sh.redistance(values), distances, atol=1e-15)


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_a_zero_among_positive_values_is_a_point_of_the_zero_set(dimension):
    values = np.ones((9,) * dimension)
    values[(2,) * dimension] = 0
    exact = np.sqrt(((nodes(9, dimension) + 2.0) ** 2).sum(axis=0))  # from the middle of the array
    np.testing.assert_allclose(sh.redistance(values), exact, atol=1e-12)
    values[(7,) * dimension] = -1  # far away
    near = exact < 3
    np.testing.assert_allclose(sh.redistance(values)[near], exact[near], atol=1e-12)


def test_a_periodic_axis_has_no_end():
    exact = ball(nodes(20, 2), 4.3)
    for shift in (0, 7, 11):
        moved = np.roll(exact, shift, axis=0)
        found = sh.redistance(moved, periodic=(True, False))
        np.testing.assert_allclose(found, np.roll(sh.redistance(exact), shift, axis=0), atol=1e-3)
    assert sh.redistance(np.roll(exact, 5, axis=0)).max() > sh.redistance(exact).max() + 3


@pytest.mark.parametrize(("values", "options"), [
    ([1.0, 2.0], {}), ([[True, False]], {}), (np.ones((2,) * 5), {}), (3.0, {}), ([-1.0], {}), ([], {}),
    ([-1.0, np.inf], {}), ([-1.0, 1j], {}), (["a", "b"], {}), ([np.nan, np.nan], {}), ([-1.0, 1.0], {"spacing": 0.0}),
    ([-1.0, 1.0], {"spacing": [1.0, 1.0]}), ([-1.0, 1.0], {"periodic": [True, True]}),
    ([-1.0, 1.0], {"periodic": "yes"}), ([-1.0, np.nan, 1.0, 1.0], {}),
    (np.ma.masked_array([-1.0, 0.0, 1.0], [False, True, False]), {}),
])  # fmt: skip
def test_what_has_no_distance_is_refused(values, options):
    with refused(sh.errors.SignedHeatError):
        sh.redistance(values, **options)


def test_sharpening_fields_without_a_shape_is_the_same():
    grid = sh.Grid((-1, -1, -1), 0.125, (17, 17, 17))
    signs = np.where(ball(np.moveaxis(grid.points, -1, 0), 0.61) < 0, -1.0, 1.0)
    np.testing.assert_array_equal(sh.sharpen(sh.Field(grid, signs)).values, sh.redistance(signs, 0.125))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("near", [0.0, 1e-17, -1e-17, 1e-12, -1e-12])
def test_crossings_at_nodes_that_are_all_but_zero_do_not_end_the_search(dimension, near):
    """A ball of five cells' radius passes through nodes, at which several crossings are in one place."""
    points = nodes(21, dimension)
    exact = ball(points, 5.0)
    np.testing.assert_allclose(sh.redistance(np.where(np.abs(exact) < 1e-9, near, exact)), exact, atol=0.03)


@pytest.mark.parametrize("shape", [(24,), (1, 24), (18, 24), (12, 18, 14), (8, 10, 1, 9)])
def test_periodic_arrays_are_like_repeated_ones(shape):
    """The middle of three copies along each axis: of a bumpy ball across the corners of the array."""
    axes = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in shape), indexing="ij")
    values = sum(np.cos(axis + 0.3 * k) for k, axis in enumerate(axes) if axis.shape[k] > 1) - 0.4
    steps = 0.5 + 0.25 * np.arange(len(shape))
    thrice = sh.redistance(np.tile(values, [3] * len(shape)), steps)
    middle = thrice[tuple(slice(n, 2 * n) for n in shape)]
    # where two places are equally near, either may be taken, and the touching circles there differ a little
    found = sh.redistance(values, steps, periodic=True)
    np.testing.assert_allclose(found, middle, atol=0.05 * steps.min())
    assert np.mean(np.abs(found - middle) < 1e-9) > 0.99


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_masks_of_zeros_and_ones_have_no_sign(dtype):
    mask = np.zeros((9, 9), dtype=dtype)
    mask[3:6, 3:7] = 1
    with pytest.raises(sh.errors.GeometryError) as caught:
        sh.redistance(mask)
    assert caught.value.element == "values" and "where" in caught.value.remedy
    assert sh.redistance(np.where(mask == 1, -1.0, 1.0))[4, 4] < 0
