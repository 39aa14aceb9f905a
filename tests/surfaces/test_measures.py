"""Area, volume and watertightness of meshes."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

CUBE = sh.PolygonMesh(
    [[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)],
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]],
)


def test_box():
    for mesh in (CUBE, CUBE.triangulation):
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(6.0, rel=1e-14) and mesh.area == pytest.approx(22.0, rel=1e-14)


def test_ball_agrees_with_its_solid_wherever_it_is():
    ball = samples.sphere(3)
    assert ball.volume == pytest.approx(sh.complete(ball).volume, rel=1e-12)
    far = sh.TriangleMesh(ball.vertices + 1e6, ball.faces)
    assert far.volume == pytest.approx(ball.volume, rel=1e-8)
    assert sh.TriangleMesh(ball.vertices, ball.faces[:, ::-1]).volume == pytest.approx(-ball.volume)


def test_seams_of_files_without_vertices_are_closed():
    loose = samples.soup(samples.sphere(2))
    assert loose.is_watertight and loose.volume == pytest.approx(samples.sphere(2).volume)


@pytest.mark.parametrize(
    "mesh",
    [
        samples.without_faces(samples.sphere(2), 0.01, seed=1),
        samples.with_flipped_faces(samples.sphere(2), 0.01, seed=1),
        samples.with_duplicate_faces(samples.sphere(2), 0.01, seed=1),
        sh.PolygonMesh(CUBE.vertices, CUBE.polygons[1:]),
    ],
    ids=["hole", "flipped", "double", "open box"],
)
def test_volume_of_what_is_not_closed_is_refused(mesh):
    assert not mesh.is_watertight and mesh.area > 0
    with refused(sh.errors.GeometryError, element="faces") as caught:
        assert np.isfinite(mesh.volume)
    assert "sh.complete" in caught.value.remedy


def test_two_balls_that_touch_in_a_vertex():
    one, other = samples.sphere(1), samples.sphere(1)
    apart = other.vertices + one.vertices[0] - other.vertices[1]
    both = sh.TriangleMesh(np.concatenate([one.vertices, apart]), np.concatenate([one.faces, other.faces + 42]))
    assert both.is_watertight and both.volume == pytest.approx(2 * one.volume)
