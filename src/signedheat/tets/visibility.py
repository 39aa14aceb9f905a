"""Visibility along straight lines in tet meshes, and steepest ascent from cells that are not visible."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from .tet_clipping import Planes, beyond

GRAZING = 1e-6
"""Distance, relative to the size of the tets, by which a line may lie outside the mesh."""


@compiled
def stays_inside(
    planes: Planes, neighbors: Ints, tet: int, x: float, y: float, z: float, u: float, w: float, t: float, slack: float
) -> bool:
    """Whether the segment from (x, y, z), in a tet, to (u, w, t), in the mesh, lies in the mesh."""
    for _ in range(len(neighbors)):
        leave, at = -1, np.inf
        for k in range(4):
            there = beyond(planes, tet, k, u, w, t)
            if there > slack:
                here = beyond(planes, tet, k, x, y, z)
                if there > here and -here / (there - here) < at:
                    leave, at = k, -here / (there - here)
        if leave < 0:
            return True
        tet = neighbors[tet, leave]
        if tet < 0:
            return False
    return False


@compiled
def visible(planes: Planes, neighbors: Ints, starts: Floats, targets: Floats, slack: float) -> Bools:
    """(m,) whether the straight line from a point in each tet to its target stays in the mesh, up to a length."""
    seen = np.empty(len(starts), dtype=np.bool_)
    for tet in range(len(starts)):
        x, y, z = starts[tet]
        u, w, t = targets[tet]
        seen[tet] = stays_inside(planes, neighbors, tet, x, y, z, u, w, t, slack)
    return seen


def uphill_roots(heights: Floats, neighbors: Ints, settled: Bools) -> Ints:
    """(m,) the settled tet, or the local maximum, that steepest ascent from tet to tet leads to.

    Examples
    --------
    >>> chain = np.array([[1, -1, -1, -1], [0, 2, -1, -1], [1, -1, -1, -1]])
    >>> uphill_roots(np.array([3.0, 2.0, 1.0]), chain, np.array([True, False, False])).tolist()
    [0, 0, 0]
    """
    own = np.arange(len(heights))
    around = np.where(neighbors >= 0, heights[neighbors], -np.inf)
    best = around.argmax(axis=1)
    higher = ~settled & (around[own, best] > heights)
    roots = np.where(higher, neighbors[own, best], own)
    while True:  # every round doubles the length of the paths followed
        further = roots[roots]
        if (further == roots).all():
            return roots
        roots = further
