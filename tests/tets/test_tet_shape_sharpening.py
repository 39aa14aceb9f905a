"""Sharpening to a shape on tets: closed forms, what is missing, walls, sides, bad input."""

import numpy as np
import pytest
import scipy

import signedheat as sh
from refusals import refused
from shapes.bodies import box, distance_to_box
from shapes.tet_cases import ell, lattice, rms, sphere
from signedheat import samples
from signedheat.diagnostics import FacesRestored, SharpenedToShape
from signedheat.errors import SourceError, UnsupportedTypeError


def cube(half: float) -> sh.TriangleMesh:
    return box([-half] * 3, [half] * 3)


@pytest.fixture(scope="module")
def tets() -> sh.TetMesh:
    return lattice(12)


def test_a_cube_is_exact_at_its_edges_too(tets):
    field = sh.SignedHeatSolver(tets).distance(cube(0.83))
    exact = distance_to_box(tets.vertices, [-0.83] * 3, [0.83] * 3)
    sharp = sh.sharpen(field, cube(0.83))
    assert np.abs(sharp.values - exact).max() < 1e-12
    assert rms(sh.sharpen(field).values - exact) > 1e-3
    assert sharp.diagnostics.note(SharpenedToShape).completed_zero_set == 0
    assert np.array_equal(sh.sharpen(field, source=[cube(0.83)]).values, sharp.values)


def test_a_solid_is_on_tets_what_its_shape_is(tets):
    """With the notes on what was completed, as on grids."""
    shape = samples.without_faces(samples.sphere(2, radius=0.8), 0.2)
    of_shape, of_solid = (sh.signed_distance(source, tets) for source in (shape, sh.complete(shape)))
    np.testing.assert_array_equal(of_solid.values, of_shape.values)
    assert [*map(repr, of_solid.diagnostics.notes)] == [*map(repr, of_shape.diagnostics.notes)]


def test_solids_on_tets_are_measured_to_the_shape(tets):
    """Whichever way its faces look, and though one was lost."""
    shape = cube(0.83)
    turned = np.where(np.isin(np.arange(12), [2, 5, 6])[:, None], shape.faces[:, ::-1], shape.faces)[1:]
    field = sh.signed_distance(sh.TriangleMesh(shape.vertices, turned), tets)
    assert np.abs(field.values - distance_to_box(tets.vertices, [-0.83] * 3, [0.83] * 3)).max() < 1e-12
    assert field.diagnostics.note(FacesRestored).restored_faces == 1


def test_one_call_on_tets_gives_what_the_solid_says(tets):
    holed = samples.without_patches(sphere(3), 2, 0.4, seed=1)
    field = sh.signed_distance(holed, tets)
    assert np.abs(field.values - sh.complete(holed).distance(tets.vertices)).max() < 1e-12


def test_where_surface_is_missing_its_zero_set_stands_in(tets):
    ball = sphere(4)
    holed = sh.TriangleMesh(ball.vertices, ball.faces[(ball.vertices[ball.faces].mean(axis=1) @ [1, 2, 2]) < 3 * 0.8])
    field = sh.SignedHeatSolver(tets).distance(holed)
    exact = sh.signed_distance(ball, tets).values
    sharp, own = sh.sharpen(field, holed), sh.sharpen(field)
    away = tets.vertices @ [1, 2, 2] / 3 / np.maximum(np.linalg.norm(tets.vertices, axis=1), 1e-9)
    there, missing = away < 0.5, away > 0.9
    assert rms((sharp.values - exact)[there]) < 0.05 * rms((own.values - exact)[there])
    assert rms((sharp.values - own.values)[missing]) < 0.02
    assert 0.02 < sharp.diagnostics.note(SharpenedToShape).completed_zero_set < 0.2


def test_lines_bend_round_the_corners_of_the_mesh():
    n = 8
    mesh, wall, exact = ell(n)
    x, y, _ = mesh.vertices.T
    sharp = sh.sharpen(sh.SignedHeatSolver(mesh).distance(wall), wall)
    straight = (y <= 1) | (x > 1)
    assert np.abs(sharp.values - exact)[straight].max() < 1e-12
    assert np.abs(np.abs(sharp.values) - np.abs(exact)).max() < 1 / n


def test_a_plate_thinner_than_a_tet_keeps_its_sides(tets):
    corner = np.array([1.0, 1.0, 0.01])
    field = sh.signed_distance(box(-corner, corner), tets)
    exact = distance_to_box(tets.vertices, -corner, corner)
    assert np.abs(field.values - exact).max() < 1e-9


def test_points_and_methods_beside_shapes_are_refused(tets):
    field = sh.SignedHeatSolver(tets).distance(cube(0.8))
    cloud = sh.PointCloud(samples.sphere(2).vertices, samples.sphere(2).vertices)
    with refused(SourceError, "shape"):
        sh.sharpen(field, cloud)
    with refused(UnsupportedTypeError):
        sh.sharpen(field, cube(0.8), method=sh.methods.Convex())


def test_it_can_be_cancelled(tets):
    class Stop(Exception):
        pass

    def stop(fraction, step):
        raise Stop

    with pytest.raises(Stop):
        sh.sharpen(sh.SignedHeatSolver(tets).distance(cube(0.8)), cube(0.8), progress=stop)


@pytest.mark.parametrize("noise", [0.0, 1e-13])
def test_lines_of_sight_pass_flat_tets(noise):
    """Delaunay's tets of a lattice fill the cube, a fifth of them flat, and inside out or not by rounding."""
    side = np.linspace(-1, 1, 8)
    points = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    points = points + noise * np.random.default_rng(3).normal(size=points.shape)
    mesh = sh.TetMesh(points, scipy.spatial.Delaunay(points).simplices)
    phi = sh.signed_distance(sh.samples.sphere(4, radius=0.5), mesh)
    assert np.abs(phi.values - (np.linalg.norm(points, axis=1) - 0.5)).max() < 1e-3
