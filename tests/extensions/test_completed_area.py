"""How much of a surface was completed, and where: against labels of the whole grid, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from signedheat.extensions import sides
from signedheat.extensions.completed_area import completed_area


def ball(n: int = 40):
    """Nodes from −2 to 2, their spacing, and the distance to the unit sphere."""
    axis = np.linspace(-2, 2, n)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return points, axis[1] - axis[0], np.linalg.norm(points, axis=-1) - 1


def test_the_part_of_a_sphere_that_is_far_from_faces():
    points, cell, phi = ball()
    cap = points[..., 2] > 0.5
    distance = np.where(cap, 1.0, 0.0)
    found = completed_area((phi < 0).astype(np.int32), phi, distance, np.full(3, cell), cell, np.full(3, -2.0))
    assert found.completed_area == pytest.approx(2 * np.pi * 0.5, rel=0.03)
    assert found.completed_share == pytest.approx(0.25, rel=0.03)
    [(low, high)] = found.where
    assert low == pytest.approx([-np.sqrt(0.75), -np.sqrt(0.75), 0.5], abs=1.5 * cell)
    assert high == pytest.approx([np.sqrt(0.75), np.sqrt(0.75), 1.0], abs=1.5 * cell)


def test_parts_are_those_that_labels_of_all_nodes_tell():
    random = np.random.default_rng(4)
    phi = scipy.ndimage.gaussian_filter(random.normal(size=(40, 36, 30)), 2.5)
    distance = scipy.ndimage.gaussian_filter(random.normal(size=phi.shape), 4.0)
    inside = phi < 0
    found = completed_area(inside.astype(np.int32), phi, distance, np.ones(3), 0.0, np.zeros(3))
    rim = inside & ~scipy.ndimage.binary_erosion(inside, border_value=1) & (distance > 0)
    labels, _ = scipy.ndimage.label(rim, np.ones((3, 3, 3)))
    sizes = np.bincount(labels.ravel())[1:]
    boxes = [[[part.start, part.stop - 1] for part in box] for box in scipy.ndimage.find_objects(labels)]
    largest = np.argsort(-sizes, kind="stable")[:5]
    assert found.where.tolist() == np.array(boxes, dtype=float)[largest].transpose(0, 2, 1).tolist()


def test_sides_are_the_same_in_the_part_of_the_grid_that_holds_them(monkeypatch):
    points, cell, phi = ball()
    normals = np.random.default_rng(0).normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals[normals[:, 2] < 0.8]
    winding = np.where(phi < 0, 0.9, 0.05) * np.where(points[..., 2] > 0.8, 0.6, 1.0)
    arguments = winding, np.abs(phi), (normals + 2) / cell, normals * 4 * np.pi / 4000, np.full(3, cell), np.full(3, -2)
    given = phi.copy()
    found = sides.choose_sides(given, *arguments)
    monkeypatch.setattr(sides, "ROOM", 100)
    whole = sides.choose_sides(phi.copy(), *arguments)
    assert found.inside.any() and found.inside[found.box].shape != found.inside.shape
    assert (found.inside == whole.inside).all() and (found.function[found.box] == whole.function[found.box]).all()
    assert ((found.function < 0) == found.inside).all()
    assert (found.phi() == phi).all()
