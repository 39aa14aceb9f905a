"""The connectivity of dual contouring."""

import numpy as np
import pytest

from signedheat.mesh.dual_cells import Crossings, crossed_cells, dual_cells, dual_triangles
from signedheat.mesh.self_intersections import self_intersections


def _crossings(below, shares):
    """Crossed edges of a grid whose nodes lie `below` a level or not; `shares` of a number of edges."""
    nodes, axes = [], []
    for axis in range(3):
        found = np.argwhere(np.diff(below, axis=axis))
        nodes.append(found)
        axes.append(np.full(len(found), axis))
    nodes = np.concatenate(nodes)
    return Crossings(nodes, np.concatenate(axes), below[tuple(nodes.T)], shares(len(nodes)))


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
def test_manifold_whatever_the_signs(share):
    """Checkerboards, in which all edges of cells are crossed, with some nodes turned."""
    for seed in range(150):
        rng = np.random.default_rng(seed)
        below = np.zeros((7, 7, 7), dtype=bool)
        below[1:-1, 1:-1, 1:-1] = (np.indices((5, 5, 5)).sum(axis=0) % 2 == 0) ^ (rng.random((5, 5, 5)) < share)
        crossings = _crossings(below, lambda count: np.full(count, 0.5))
        around = crossed_cells(crossings, below.shape)
        cells = dual_cells(crossings, around, below.shape, lambda at, rng=rng: rng.random(len(at)) < 0.5)
        tails, heads = cells.quads.ravel(), np.roll(cells.quads, -1, axis=1).ravel()
        sides = np.stack([np.minimum(tails, heads), np.maximum(tails, heads)], axis=1)
        assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()


@pytest.mark.parametrize("share", [0.05, 0.3, 0.5])
def test_triangles_meet_only_beside_cells_with_several_pieces(share):
    """Vertices anywhere within their cells, crossings anywhere on their edges (Ju & Udeshi 2006)."""
    met = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        below = np.zeros((8, 8, 8), dtype=bool)
        below[1:-1, 1:-1, 1:-1] = rng.random((6, 6, 6)) < share
        crossings = _crossings(below, lambda count, rng=rng: rng.uniform(0.01, 0.99, count))
        around = crossed_cells(crossings, below.shape)
        cells = dual_cells(crossings, around, below.shape, lambda at, rng=rng: rng.random(len(at)) < 0.5)
        vertices = cells.places[cells.owners] + rng.uniform(0.01, 0.99, (len(cells.owners), 3))
        points, faces, centres = dual_triangles(cells, crossings, vertices, rng.random(len(cells.quads)) < 0.2)
        crowded = np.append((np.bincount(cells.owners) > 1)[cells.owners], np.zeros(len(centres), dtype=bool))
        pairs = self_intersections(points, faces)
        assert crowded[faces][pairs].any(axis=(1, 2)).all()
        met += len(pairs)
        asked = crowded[faces].any(axis=1)
        np.testing.assert_array_equal(self_intersections(points, faces, asked), pairs[asked[pairs].any(axis=1)])
    assert met
