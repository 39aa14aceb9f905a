"""Level sets of exact distance: points on edges of a grid are moved onto the level."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.edges import CLEARANCE

ON_LEVEL = 1e-3
"""A point lies on a level if it is at most this far from it, in cells."""
POINTS_AT_ONCE = 1 << 16
"""Batch size for points that are moved."""


class NodeValues(Protocol):
    """Values at the nodes of a grid: an array, or anything that is indexed by arrays of node indices like one."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    def __getitem__(self, nodes: tuple[Ints, ...], /) -> Floats: ...


def on_level(
    distance: Callable[[Floats], Floats],
    points: Floats,
    values: NodeValues,
    origin: Floats,
    spacing: Floats,
    level: float,
) -> Floats:
    """Move (n, d) points, given in cells, along edges of a grid to an exact level; return their (n, d) positions.

    `distance` is the exact function of positions, and `values` are its values at nodes, the first of which is at
    `origin`, (d,), with (d,) `spacing`. Points are not moved if they are not on an edge, or if its ends are not on both
    sides of the level. It is found by regula falsi (Dowell & Jarratt 1971), which halves the value at an end of the
    interval that stays for a second time.
    """
    if len(points) > POINTS_AT_ONCE:
        parts = np.split(points, range(POINTS_AT_ONCE, len(points), POINTS_AT_ONCE))
        return np.concatenate([on_level(distance, part, values, origin, spacing, level) for part in parts])
    # the edge of each point, and the values at its ends, above the level
    base = np.floor(points).astype(np.int64)
    fraction = points - base
    axis = fraction.argmax(axis=1)
    upper = base.copy()
    upper[np.arange(len(points)), axis] += 1
    inside = (base >= 0).all(axis=1) & (upper < np.array(values.shape)).all(axis=1)
    movable = np.flatnonzero(inside & ((fraction > 0).sum(axis=1) == 1))
    low, high = (values[tuple(nodes[movable].T)] - level for nodes in (base, upper))
    crossed = (low < 0) != (high < 0)
    movable, low, high = movable[crossed], low[crossed], high[crossed]
    moved = origin + points * spacing
    base, axis, tolerance = base[movable], axis[movable], ON_LEVEL * float(spacing.min())
    # the interval on each edge, and which of its ends moved last: 1 for the start, −1 for the stop
    start, stop, last = np.zeros(len(base)), np.ones(len(base)), np.zeros(len(base), dtype=np.int8)
    active = np.arange(len(base))
    for _ in range(10):  # few points need more than 4
        if not len(active):
            break
        share = low[active] / (low[active] - high[active])
        share = np.clip(start[active] + share * (stop[active] - start[active]), CLEARANCE, 1 - CLEARANCE)
        cells = base[active].astype(np.float64)
        cells[np.arange(len(active)), axis[active]] += share
        positions = origin + cells * spacing
        heights = distance(positions) - level
        moved[movable[active]] = positions
        like_start = (heights < 0) == (low[active] < 0)
        starts, stops = active[like_start], active[~like_start]  # intervals of which this end moves
        start[starts], low[starts] = share[like_start], heights[like_start]
        stop[stops], high[stops] = share[~like_start], heights[~like_start]
        high[starts] *= np.where(last[starts] > 0, 0.5, 1.0)
        low[stops] *= np.where(last[stops] < 0, 0.5, 1.0)
        last[starts], last[stops] = 1, -1
        active = active[np.abs(heights) > tolerance]
    return moved
