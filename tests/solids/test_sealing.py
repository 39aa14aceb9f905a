"""Shapes made solid: double skins, leaks, bodies within and rubbish vanish, and what is outside stays exact."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box, finer
from signedheat import samples

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
PLACE = np.block([[TURN, np.array([[5.0], [-3.0], [7.0]])], [np.zeros((1, 3)), 1.0]])


def fine(mesh, times=3):
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(times):
        vertices, faces = finer(vertices, faces)
    return sh.TriangleMesh(vertices, faces)


def without(mesh, near, radius):
    """The mesh without the faces around a place."""
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    return sh.TriangleMesh(mesh.vertices, mesh.faces[np.linalg.norm(centres - near, axis=1) > radius])


def joined(*meshes):
    result = meshes[0]
    for mesh in meshes[1:]:
        result = samples.union(result, mesh)
    return result


def turned(mesh):
    return sh.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


OUTER, INNER = fine(box((0, 0, 0), (1, 1, 1)), 4), fine(box((0.05, 0.05, 0.05), (0.95, 0.95, 0.95)), 4)


@pytest.mark.parametrize("place", [np.eye(4), PLACE], ids=["along the axes", "turned"])
@pytest.mark.parametrize(
    "shape",
    [
        OUTER,
        joined(OUTER, turned(INNER)),  # a closed cavity
        joined(OUTER, INNER),
        without(joined(OUTER, turned(INNER)), (0.5, 0.5, 1.0), 0.09),  # both skins have a hole
        without(joined(OUTER, INNER), (0.5, 0.5, 1.0), 0.09),
        joined(OUTER, samples.sphere(2, radius=0.3, center=(0.5, 0.5, 0.5))),
        without(joined(OUTER, samples.sphere(2, radius=0.3, center=(0.5, 0.5, 0.5))), (1.0, 0.5, 0.5), 0.05),
    ],
    ids=["whole", "cavity", "two skins", "leaks", "leaks of two skins", "body within", "body behind a leak"],
)
def test_a_cube_with_something_in_it_is_a_cube(shape, place):
    solid = sh.complete(sh.transform(shape, place), seal=0.25)
    assert solid.volume == pytest.approx(1.0, abs=3e-3)
    assert solid.surface().to_trimesh().is_watertight
    corners = sh.transform(box((0, 0, 0), (1, 1, 1)), place).vertices
    assert np.abs(solid.distance(corners)).max() < 1e-12  # the corners are where they were


def test_two_skins_joined_through_a_hole_are_one_body():
    """A skin that goes in at a hole, and on as a second one within."""
    outer, inner = without(OUTER, (0.5, 0.5, 1), 0.1), turned(without(INNER, (0.5, 0.5, 0.95), 0.1))
    tube = []
    for k in range(24):
        t = 2 * np.pi * np.array([k, k + 1]) / 24
        (a, b), (c, d) = (0.5 + 0.09 * np.array([np.cos(t), np.sin(t)])).T
        tube += [[[a, b, 1.0], [c, d, 0.95], [c, d, 1.0]], [[a, b, 1.0], [a, b, 0.95], [c, d, 0.95]]]
    tube = np.array(tube)
    shape = joined(outer, inner, sh.TriangleMesh(tube.reshape(-1, 3), np.arange(3 * len(tube)).reshape(-1, 3)))
    solid = sh.complete(shape, seal=0.4)
    assert solid.volume == pytest.approx(1.0, abs=0.005)
    assert solid.inside([[0.5, 0.5, 0.5], [0.5, 0.5, 0.97], [0.5, 0.5, 1.02]]).tolist() == [True, True, False]


def test_openings_wider_than_the_length_stay_open():
    cup = without(joined(OUTER, turned(INNER)), (0.5, 0.5, 1.0), 0.3)
    inside = [[0.5, 0.5, 0.5], [0.5, 0.5, 0.2], [0.5, 0.025, 0.5]]
    assert sh.complete(cup, seal=0.2).inside(inside).tolist() == [False, False, True]
    assert sh.complete(cup, seal=1.0).inside(inside).tolist() == [True, True, True]


def test_corners_that_the_ball_does_not_fill_stay_exact():
    """An L-shaped body, and one with a bar that crosses it."""
    for times in (0, 3):
        bodies = [fine(box((0, 0, 0), (2, 1, 1)), times), fine(box((0.5, 0.25, 0.5), (1, 0.75, 2)), times)]
        assert sh.complete(joined(*bodies), seal=0.3).volume == pytest.approx(2 + 0.25, rel=1e-6)


def test_scale_order_and_what_is_given_twice_do_not_matter():
    shape = without(joined(OUTER, turned(INNER)), (0.5, 0.5, 1.0), 0.09)
    mixed = sh.TriangleMesh(shape.vertices, np.concatenate([shape.faces[::-1], shape.faces[:40]]))
    assert sh.complete(mixed, seal=0.25).volume == pytest.approx(1.0, abs=3e-3)
    large = sh.TriangleMesh(1e4 * shape.vertices + 1e6, shape.faces)
    assert sh.complete(large, seal=2500).volume == pytest.approx(1e12, rel=3e-3)


def test_lengths_that_are_none():
    for length in (0.0, -1.0, np.nan, "x"):
        with refused(sh.SignedHeatError, element="seal"):
            sh.complete(OUTER, seal=length)


def test_lengths_far_from_the_size_of_the_shape():
    volume = sh.complete(OUTER).volume
    for length in (1e13, 1e40):
        assert sh.complete(OUTER, seal=length).volume == pytest.approx(volume, rel=1e-12)
    for length in (5e-324, 1e-310, 1e160, 1.7e308):
        with refused(sh.errors.GeometryError, element="seal"):
            sh.complete(OUTER, seal=length)
    for length in (1e-40, 1e-10):
        with pytest.raises(sh.errors.MemoryLimitError, match="seal wider openings"):
            sh.complete(OUTER, seal=length)
