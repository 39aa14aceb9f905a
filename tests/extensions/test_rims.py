"""How faces go on beyond the rims of a shape, and what that decides."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples
from signedheat.extensions.rims import rims_of

GRID = sh.Grid((-1.5, -1.5, -1.5), 0.075, (41, 41, 41))


def holed(mesh, gone):
    """The mesh without the faces whose centroids a condition on (x, y, z) takes."""
    x, y, z = mesh.vertices[mesh.faces].mean(axis=1).T
    return sh.TriangleMesh(mesh.vertices, mesh.faces[~gone(x, y, z)])


def sheet_of_squares(n):
    """A flat square in the plane z = 0 of 2 n² triangles."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([a, a + n + 1, a + n + 2, a + 1], axis=1)
    return sh.TriangleMesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def test_faces_around_a_hole_in_a_flat_face_do_not_go_on():
    flat = sheet_of_squares(10)
    rims = rims_of(holed(flat, lambda x, y, z: np.maximum(np.abs(x), np.abs(y)) < 0.4), GRID)
    assert rims.going_on.max() < 1e-12


@pytest.mark.parametrize("angle", [0.3, 0.6, np.pi / 2])
def test_around_a_cap_they_go_on_by_the_sine_of_half_its_angle(angle):
    """The rim runs along faces: it is as jagged as they are large, and the sum is that of a smooth one all the same."""
    rims = rims_of(holed(samples.sphere(5), lambda x, y, z: z > np.cos(angle)), GRID)
    assert rims.going_on == pytest.approx(np.sin(angle), abs=0.1)


def test_soups_and_closed_shapes_have_no_rims():
    assert rims_of(samples.sphere(2), GRID) is None
    assert rims_of(samples.soup(samples.sphere(2)), GRID) is None


def test_a_hole_in_a_flat_side_is_closed_flat():
    """What completes it is the side itself, where φ alone bulges."""
    corners = box((-1, -1, -0.5), (1, 1, 0.5))
    corners = corners.vertices[corners.faces]
    for _ in range(4):
        a, b, c = corners.transpose(1, 0, 2)
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate([np.stack(each, axis=1) for each in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    whole = sh.TriangleMesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    broken = holed(whole, lambda x, y, z: (z > 0.49) & (np.maximum(np.abs(x), np.abs(y)) < 0.5))
    field = sh.solid_distance(broken, GRID)
    x, y, z = np.moveaxis(GRID.points, -1, 0)
    above = (np.maximum(np.abs(x), np.abs(y)) < 0.45) & (np.abs(z) < 1)
    assert np.abs(field.values - (z - 0.5))[above & (z > 0.2)].max() < 0.5 * 0.075


def test_scattered_missing_faces_of_a_coarse_body_leave_a_solid():
    """Forty per cent of an icosahedron: winding numbers tell as much of its inside as there is."""
    ball = samples.sphere(0)
    assert ball.n_faces == 20
    left = sh.TriangleMesh(ball.vertices, ball.faces[[0, 2, 4, 6, 8, 9, 11, 13, 15, 16, 18, 19]])
    field = sh.solid_distance(left, GRID)
    deep = np.linalg.norm(GRID.points, axis=-1) < 0.5
    assert (field.values[deep] < 0).mean() > 0.9
