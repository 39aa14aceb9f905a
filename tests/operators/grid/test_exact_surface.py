"""Points of levels: what is near the nodes of their edge against a search through all that there is."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.operators.grid import exact_surface

SHAPES = {
    "holes": lambda: samples.without_patches(samples.sphere(4), 6, 0.3, seed=3),
    "valley": lambda: samples.union(samples.sphere(4), samples.sphere(4, center=(1.2, 0, 0))),
    "ring": lambda: samples.torus(1.0, 0.4),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("level", [0.15, -0.15])
def test_vertices_of_offsets_lie_on_their_level(name, level):
    field = sh.solid_distance(SHAPES[name](), resolution=40)
    surface, vertices = field.surface, field.contour(level).vertices
    off = np.abs(surface.nearest(vertices - surface.origin).distances - abs(level)) / surface.steps.min()
    assert np.mean(off > 0.01) < 0.005  # a walk from the faces of the nodes may end beside a nearer one
    assert off.max() < 0.25


def test_points_in_runs_get_the_places_of_all_together(monkeypatch):
    surface = sh.solid_distance(SHAPES["holes"](), resolution=32).surface
    points = np.random.default_rng(0).uniform(0.0, 2.4, (2500, 3))
    together = surface.nearest(points)
    monkeypatch.setattr(exact_surface, "MANY", 1000)
    apart = surface.nearest(points)
    np.testing.assert_array_equal(apart.distances, together.distances)
    np.testing.assert_array_equal(apart.completed, together.completed)
    np.testing.assert_allclose(np.linalg.norm(points - apart.feet, axis=1), apart.distances, atol=1e-9)
    assert surface.nearest(points[:0]).feet.shape == (0, 3)
