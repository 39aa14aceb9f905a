"""Edges of level sets run along their creases."""

import numpy as np
import pytest
import scipy

import signedheat as sh
from signedheat import samples
from signedheat.grids.exact_levels import on_level
from signedheat.grids.marching import closed_surface
from signedheat.mesh.edges import edge_table
from signedheat.mesh.triangles import CREASE_ANGLE, flipped_along_creases


def bends(mesh):
    """Length times angle at every edge of a closed surface."""
    table = edge_table(mesh.faces)
    order = np.argsort(table.face_edges.ravel(), kind="stable") // 3
    normals = mesh.face_area_vectors / np.linalg.norm(mesh.face_area_vectors, axis=1)[:, None]
    one, other = normals[order.reshape(-1, 2)].transpose(1, 0, 2)
    lengths = np.linalg.norm(np.diff(mesh.vertices[table.vertices], axis=1)[:, 0], axis=1)
    return lengths * np.arccos(np.clip((one * other).sum(axis=1), -1, 1))


def sharp(mesh):
    """Edges where two faces make more than 25°."""
    table = edge_table(mesh.faces)
    return bends(mesh) > CREASE_ANGLE * np.linalg.norm(np.diff(mesh.vertices[table.vertices], axis=1)[:, 0], axis=1)


@pytest.fixture(scope="module")
def field():
    """Two balls, 2.2 apart: their offset has a crease around the axis, which runs askew to the grid."""
    balls = samples.union(samples.sphere(4), samples.sphere(4, center=2.2 * np.array([0.6, 0.48, 0.64])))
    return sh.signed_distance(balls, resolution=72, padding=0.6)


def test_the_crease_between_two_balls_has_no_teeth(field):
    """Around the circle at which the two offsets meet the surface bends by their angle, and teeth bend more."""
    made = field.contour(0.3)
    grid = field.domain
    points, faces = closed_surface(field.values, grid.spacing, 0.3)
    toothed = sh.TriangleMesh(
        on_level(field.solid.distance, points, field.values, grid.origin, grid.spacing, 0.3), faces
    )
    assert np.array_equal(toothed.vertices, made.vertices)
    exact = 2 * np.pi * np.sqrt(1.3**2 - 1.1**2) * 2 * np.arcsin(1.1 / 1.3)
    before, after = (bends(mesh)[sharp(mesh)].sum() / exact for mesh in (toothed, made))
    assert 0.6 < after < before - 0.2
    assert after < 1.4


def test_it_stays_a_closed_surface_on_the_same_vertices(field):
    made = field.contour(0.3)
    counts = edge_table(made.faces).face_counts
    assert (counts == 2).all()
    forward = edge_table(made.faces)
    assert (np.bincount(forward.face_edges.ravel(), np.where(forward.forward.ravel(), 1, -1)) == 0).all()
    assert len(np.unique(made.faces)) == made.n_vertices
    again = flipped_along_creases(made.vertices, made.faces)
    assert np.array_equal(again, made.faces)


@pytest.mark.parametrize("integers", [np.int32, np.int64])
@pytest.mark.parametrize("width", [0.5, 0.8])
def test_narrow_necks_of_noise_stay_closed_and_manifold(width, integers):
    rough = scipy.ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(24, 24, 24)), width)
    vertices, faces = closed_surface(rough, np.ones(3), 0.0)
    flipped = flipped_along_creases(vertices, faces.astype(integers))
    assert (flipped != faces).any()
    table = edge_table(flipped)
    assert (table.face_counts == 2).all()
    assert (np.bincount(table.face_edges.ravel(), np.where(table.forward.ravel(), 1, -1)) == 0).all()
    assert (flipped != np.roll(flipped, 1, axis=1)).all()


def test_no_flip_makes_it_bend_more():
    rng = np.random.default_rng(3)
    sphere = samples.sphere(3)
    rough = sh.TriangleMesh(sphere.vertices * (1 + 0.4 * rng.random(len(sphere.vertices)))[:, None], sphere.faces)
    flipped = flipped_along_creases(rough.vertices, rough.faces)
    after = sh.TriangleMesh(rough.vertices, flipped)
    assert (flipped != rough.faces).any()
    assert bends(after).sum() < bends(rough).sum()
    assert (edge_table(flipped).face_counts == 2).all()


def test_smooth_surfaces_and_open_ones_stay():
    sphere = samples.sphere(4)
    assert flipped_along_creases(sphere.vertices, sphere.faces) is sphere.faces
    ridge = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, np.tan(1.1 * CREASE_ANGLE)], [0, -1, np.tan(1.1 * CREASE_ANGLE)]])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    assert (edge_table(flipped_along_creases(ridge, faces)).face_counts <= 2).all()
    assert len(flipped_along_creases(ridge, faces[:0])) == 0
