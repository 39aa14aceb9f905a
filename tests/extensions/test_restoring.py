"""Faces that a shape has lost are put back, told, and not trusted as those that were there."""

import numpy as np
import pytest

import signedheat as sh
from signedheat import PolygonMesh, TriangleMesh, samples, solid_distance
from signedheat.diagnostics import FacesRestored


@pytest.fixture(scope="module")
def torus():
    return samples.torus(n_around=48, n_across=24)


@pytest.fixture(scope="module")
def broken(torus):
    return samples.without_faces(torus, 0.15, seed=1)


@pytest.fixture(scope="module")
def field(broken):
    return solid_distance(broken, resolution=48)


def test_distance_is_nearly_that_of_the_whole_shape(torus, broken, field):
    whole = solid_distance(torus, field.grid)
    plain = solid_distance(broken, field.grid, as_oriented=True)
    error, without = (np.abs(each.values - whole.values).max() / field.grid.spacing.max() for each in (field, plain))
    assert error < 0.2 < without
    assert ((field.values < 0) == (whole.values < 0)).mean() > 0.9999


def test_what_was_put_back_is_told(torus, broken, field):
    note = field.diagnostics.note(FacesRestored)
    assert note.restored_faces == torus.n_faces - broken.n_faces
    lost = 1 - broken.face_areas.sum() / torus.face_areas.sum()
    assert note.restored_area == pytest.approx(lost, rel=0.05)
    assert str(note.restored_faces) in str(note)
    assert solid_distance(torus, field.grid).diagnostics.note(FacesRestored) is None


def test_it_is_trusted_less(torus, broken, field):
    kept = {tuple(sorted(face)) for face in broken.faces.tolist()}
    lost = np.array([tuple(sorted(face)) not in kept for face in torus.faces.tolist()])
    centres = torus.vertices[torus.faces].mean(axis=1)
    assert field.closest_points(centres[~lost]).completed.sum() == 0
    assert field.closest_points(centres[lost]).completed.mean() > 0.95  # but for diagonals
    assert ((field.confidence > 0.8) & (field.confidence <= 1)).all()
    assert (field.confidence < 1).any() and (field.confidence == 1).any()


def test_bands_trust_it_less_too(broken):
    band = solid_distance(broken, resolution=160, band=0.1)
    confidences = band.confidence_at(broken.vertices[broken.faces].mean(axis=1))
    assert band.diagnostics.note(FacesRestored) is not None
    assert (np.asarray(band.confidence) < 1).any()
    assert np.median(confidences) == 1.0


def test_polygons_lose_polygons():
    around, across = np.meshgrid(2 * np.pi * np.arange(24) / 24, 2 * np.pi * np.arange(12) / 12, indexing="ij")
    far = 1 + 0.4 * np.cos(across)
    vertices = np.stack([far * np.cos(around), far * np.sin(around), 0.4 * np.sin(across)], axis=-1).reshape(-1, 3)
    k, m = (each.ravel() for each in np.meshgrid(np.arange(24), np.arange(12), indexing="ij"))
    corners = [(12 * ((k + a) % 24) + (m + b) % 12).tolist() for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    squares = list(zip(*corners, strict=True))
    whole = solid_distance(PolygonMesh(vertices, squares), resolution=32)
    field = solid_distance(PolygonMesh(vertices, squares[1:]), whole.grid)
    assert field.diagnostics.note(FacesRestored).restored_faces == 2
    assert np.abs(field.values - whole.values).max() < 0.02  # the square was not flat


def test_the_ends_of_a_tube_are_not_lost_faces():
    angles = 2 * np.pi * np.arange(32) / 32
    rings = [np.stack([np.cos(angles), np.sin(angles), np.full(32, z)], axis=1) for z in (0.0, 0.2, 0.4)]
    k, after = np.arange(64), 32 * (np.arange(64) // 32) + (np.arange(64) + 1) % 32
    faces = np.concatenate([np.stack([k, after, 32 + after], 1), np.stack([k, 32 + after, 32 + k], 1)])
    field = solid_distance(TriangleMesh(np.concatenate(rings), faces), resolution=32)
    assert field.diagnostics.note(FacesRestored) is None


def test_orientation_alone_puts_nothing_back(broken):
    assert sh.orient(broken).n_faces == broken.n_faces
