"""Points of levels: what is near the nodes of their edge against a search through all that there is."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples

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
