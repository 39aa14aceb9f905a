"""The connectivity of dual contouring."""

import numpy as np
import pytest

from signedheat.mesh.dual_cells import Crossings, dual_cells


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
def test_manifold_whatever_the_signs(share):
    """Checkerboards, in which all edges of cells are crossed, with some nodes turned."""
    for seed in range(150):
        rng = np.random.default_rng(seed)
        below = np.zeros((7, 7, 7), dtype=bool)
        below[1:-1, 1:-1, 1:-1] = (np.indices((5, 5, 5)).sum(axis=0) % 2 == 0) ^ (rng.random((5, 5, 5)) < share)
        nodes, axes = [], []
        for axis in range(3):
            found = np.argwhere(np.diff(below, axis=axis))
            nodes.append(found)
            axes.append(np.full(len(found), axis))
        nodes = np.concatenate(nodes)
        crossings = Crossings(nodes, np.concatenate(axes), below[tuple(nodes.T)], np.full(len(nodes), 0.5))
        cells = dual_cells(crossings, below.shape, lambda at, rng=rng: rng.random(len(at)) < 0.5)
        tails, heads = cells.quads.ravel(), np.roll(cells.quads, -1, axis=1).ravel()
        sides = np.stack([np.minimum(tails, heads), np.maximum(tails, heads)], axis=1)
        assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()
