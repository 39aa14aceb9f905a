"""Contours that are written part by part are those made at once."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import assert_closed_manifold, sphere


def sorted_rows(values):
    return values[np.lexsort(values.T)]


@pytest.mark.parametrize("cut", [2.0, 0.3])
def test_parts_make_the_same_surface(tmp_path, cut):
    whole = sphere(1500)
    middles = whole.vertices[whole.faces].mean(axis=1)
    part = sh.TriangleMesh(whole.vertices, whole.faces[middles[:, 2] < cut])  # leaves the box, or not
    band = sh.signed_distance(part, resolution=100, band=0.12)
    for level in (0.0, 0.05):
        path = tmp_path / "contour.ply"
        counts = band.save_contour(path, level)
        found, known = sh.read(path), band.contour(level)
        assert counts == (found.n_vertices, found.n_faces) == (known.n_vertices, known.n_faces)
        assert_closed_manifold(found)
        np.testing.assert_allclose(sorted_rows(found.vertices.round(9)), sorted_rows(known.vertices.round(9)))


def test_levels_and_files_that_cannot_be_are_refused(tmp_path):
    band = sh.signed_distance(sphere(300), resolution=40, band=0.2)
    with refused(sh.errors.OutsideError, element="level 0.5"):
        band.save_contour(tmp_path / "a.ply", 0.5)
    with refused(sh.errors.FileFormatError, file="a.stl"):
        band.save_contour(tmp_path / "a.stl")
    assert not list(tmp_path.iterdir())
