"""Curves that run along the rim of a surface for a while are closed by one loop."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.surfaces import disk


def grid(n: int = 31, m: int = 21) -> sh.TriangleMesh:
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(m)), indexing="ij")
    corner = np.arange(n * m).reshape(n, m)[:-1, :-1].ravel()
    faces = np.concatenate([corner[:, None] + [0, m, m + 1], corner[:, None] + [0, m + 1, 1]])
    return sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)


def drawn(mesh: sh.TriangleMesh, corners, **options) -> sh.Curve:
    return mesh.polyline(np.pad(np.array(corners, dtype=float), ((0, 0), (0, 1))), **options)


def area(mesh: sh.TriangleMesh, curve: sh.Curve) -> float:
    """Signed, of what a closed curve in the plane has to its left."""
    x, y, _ = np.einsum("nk,nkd->dn", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    "corners",
    [
        [[8, 0], [20, 0], [20, 8.3], [8, 8.3]],  # one side on the rim
        [[7.4, 0], [20.7, 0], [20.7, 8.3], [7.4, 8.3]],  # which begins and ends between vertices
        [[0, 0], [12, 0], [12, 8.3], [0, 8.3]],  # two sides
        [[0, 0], [30, 0], [30, 8.3], [0, 8.3]],  # three
        [[8, 0], [13, 0], [14, 3], [15, 0], [20, 0], [20, 9], [8, 9]],  # twice
        [[8, 3], [14, 0], [20, 3], [14, 9]],  # a corner
    ],
)
def test_a_closed_curve_along_the_rim_is_one_loop(corners, turned):
    mesh = grid()
    curve = drawn(mesh, corners[::-1] if turned else corners, closed=True)
    (whole,) = sh.close_curves(curve, mesh)
    assert whole.closed
    assert area(mesh, whole) == pytest.approx(area(mesh, curve), rel=0.02)


def test_pieces_along_the_rim_are_closed_by_one_loop():
    mesh = grid()
    pieces = [[[8, 0], [20, 0], [20, 5]], [[18, 8], [10, 8]], [[8, 6], [8, 0]]]
    (whole,) = sh.close_curves([drawn(mesh, piece) for piece in pieces], mesh)
    assert whole.closed
    assert area(mesh, whole) == pytest.approx(96, rel=0.1)


def test_the_whole_rim_is_a_loop():
    mesh = disk(8)
    (rim,) = mesh.boundary_curves()
    (whole,) = sh.close_curves(rim, mesh)
    assert whole.closed
    assert area(mesh, whole) == pytest.approx(area(mesh, rim), rel=1e-3)


def test_curves_that_end_on_the_rim_still_do():
    mesh = grid()
    for start in (0.0, 0.4):
        (whole,) = sh.close_curves(drawn(mesh, [[20, start], [20, 8.3], [8, 8.3], [8, start]]), mesh)
        assert not whole.closed
        at = np.einsum("nk,nkd->nd", whole.barycentric, mesh.vertices[mesh.faces[whole.faces]])
        assert np.abs(at[[0, -1], 1]).max() < 1e-6
