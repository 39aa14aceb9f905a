"""How much of a solid's surface was completed, and where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import CompletedArea
from ..geometry.components import connected_components
from ..operators.grid.boundary_areas import boundary_areas

MOST = 5
"""Parts of the completed surface that are told of."""


def completed_area(
    inside: NDArray[np.int32],
    function: NDArray[np.float64],
    distance: NDArray[np.floating],
    steps: NDArray[np.float64],
    far: float,
    origin: NDArray[np.float64],
) -> CompletedArea | None:
    """What of a zero set is farther than `far` from any face; None if nothing is.

    Parameters
    ----------
    inside, function, distance : (n₀, n₁, n₂)
        1 at nodes inside and 0 elsewhere, a function whose zero set their boundary is, and the distance to the faces.
    steps : (3,) float
        Spacing; of axes of one node, which come first, any.
    far : float
        In units of length.
    origin : (d,) float
        Position of the first node, on the axes of more than one node.
    """
    total, completed = boundary_areas(inside, function, distance, steps, far)
    if completed.sum() == 0:
        return None
    rim = np.argwhere(_rim(inside > 0) & (distance > far))
    where = np.zeros((0, 2, len(origin)))
    if len(rim):
        patches = _patches(rim, inside.shape)
        areas = np.bincount(patches)
        order = np.argsort(patches, kind="stable")
        starts = np.concatenate([[0], np.cumsum(areas)[:-1]])
        lows, highs = (f.reduceat(rim[order], starts) for f in (np.minimum, np.maximum))
        largest = np.argsort(-areas, kind="stable")[:MOST]
        nodes = np.stack([lows[largest], highs[largest]], axis=1)[..., 3 - len(origin) :]
        where = origin + nodes * steps[3 - len(origin) :]
    return CompletedArea(float(completed.sum()), float(completed.sum() / total.sum()), where)


def _rim(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Nodes inside that have a neighbour outside."""
    rim = np.zeros(inside.shape, dtype=bool)
    for axis in range(inside.ndim):
        here, there = (np.moveaxis(part, axis, 0) for part in (rim, inside))
        crossed = there[1:] != there[:-1]
        here[1:] |= crossed
        here[:-1] |= crossed
    rim &= inside
    return rim


def _patches(nodes: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(n,) number of the patch that each of (n, 3) nodes is in, in order of the first node; patches touch nowhere."""
    flat = np.ravel_multi_index(tuple(nodes.T), shape)
    tails, heads = [], []
    for step in np.argwhere(np.ones((3, 3, 3)))[14:] - 1:
        beside = nodes + step
        there = np.flatnonzero(((beside >= 0) & (beside < shape)).all(axis=1))
        wanted = np.ravel_multi_index(tuple(beside[there].T), shape)
        at = np.minimum(np.searchsorted(flat, wanted), len(flat) - 1)
        found = flat[at] == wanted
        tails.append(there[found])
        heads.append(at[found])
    return connected_components(len(nodes), np.concatenate(tails), np.concatenate(heads))
