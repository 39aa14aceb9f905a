"""Fields as arrays, and arithmetic with numbers: on every kind of field."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples

KINDS = ["grid", "band", "vertices", "tets", "piecewise"]


@cache
def field(kind):
    ball = samples.sphere(3)
    if kind == "grid":
        return sh.SignedHeatSolver(sh.Grid.around(ball, 12)).distance(ball)
    if kind == "band":
        return sh.signed_distance(ball, resolution=24, band=0.3)
    if kind == "tets":
        mesh = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        return sh.Field(mesh, mesh.vertices[:, 2] - 0.3)
    curve = ball.path(np.flatnonzero(np.abs(ball.vertices[:, 2]) < 0.05)[:2])
    solver = {"vertices": sh.SignedHeatSolver(ball).distance, "piecewise": lambda c: sh.piecewise_distance(c, ball)}
    return solver[kind](curve)


@pytest.mark.parametrize("kind", KINDS)
def test_operators_change_the_values_and_nothing_else(kind):
    phi = field(kind)
    for changed, expected in (
        (-phi, -phi.values), (abs(phi), abs(phi.values)), (2 * phi, 2 * phi.values),
        (phi * np.float64(0.5), phi.values / 2),
        (phi + 1, phi.values + 1), (1 - phi, 1 - phi.values), (phi - 0.25, phi.values - 0.25),
        (phi / 4, phi.values / 4), (np.float64(3) * phi, 3 * phi.values), (np.float32(1) + phi, 1 + phi.values),
    ):  # fmt: skip
        assert type(changed) is type(phi) and changed.values.dtype == phi.values.dtype
        np.testing.assert_allclose(changed.values, expected, rtol=1e-6)
    assert (-phi).domain is phi.domain


@pytest.mark.parametrize("kind", KINDS)
def test_numpy_takes_fields_for_their_values(kind):
    phi = field(kind)
    np.testing.assert_array_equal(np.asarray(phi), phi.values)
    assert np.max(phi) == phi.values.max() and np.ndim(np.max(phi)) == 0
    assert np.asarray(phi, dtype=np.float32).dtype == np.float32
    np.testing.assert_array_equal(np.abs(phi), np.abs(phi.values))
    copied = np.array(phi)
    copied[...] = 0
    assert phi.values.any()


@pytest.mark.parametrize("kind", ["grid", "band", "vertices"])
def test_less_a_number_is_an_offset(kind):
    phi = field(kind)
    level = 0.1 * float(np.nanmax(phi))
    moved, whole = (phi - level).contour(0.0), phi.contour(level)
    if kind == "vertices":
        assert [len(curve.faces) for curve in moved] == [len(curve.faces) for curve in whole]
    else:
        assert len(moved.vertices) == len(whole.vertices)


def test_values_beyond_the_nodes_change_too():
    phi = field("band")
    far = [[1.2, 1.1, 1.3]]
    assert (2 * phi + 1)(far)[0] == pytest.approx(2 * phi.interpolate(far)[0] + 1, rel=1e-6)


@pytest.mark.parametrize("other", ["a", None, [1.0], sh.constraints.ZeroSet()])
def test_what_is_no_number_is_refused(other):
    for operate in (lambda a, b: a + b, lambda a, b: a * b, lambda a, b: b - a, lambda a, b: a - b):
        with pytest.raises(TypeError):
            operate(field("grid"), other)
