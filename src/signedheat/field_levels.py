"""Levels of a field: which leave its domain, and points moved to where the distance to its solid passes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import OutsideError
from .grids.grid import Grid
from .grids.marching import CLEARANCE

CLOSE = 1e-3
"""Cells off a level that a point may be and stay as it is."""
ROUNDS = 10
"""Times a point is moved at most: from 2 on where distance bends, and few need more than 4."""


class NodeValues(Protocol):
    """Values of nodes by their indices: an array, or anything indexed like one."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    def __getitem__(self, nodes: tuple[NDArray[np.int64], ...], /) -> NDArray[np.float64]: ...


def refuse_beyond_walls(walls: NDArray[np.float64], distance: float, domain: str, remedy: str) -> None:
    """Raise `OutsideError` if what lies at a distance leaves a domain although the shape itself does not.

    `walls` are the values at its boundary, `domain` and `remedy` words of the message.
    """
    low, high = float(np.fmin.reduce(walls)), float(np.fmax.reduce(walls))
    if (low > 0 or high < 0) and low < distance < high:
        raise OutsideError(
            f"what lies at distance {distance:g} leaves the {domain}, which holds distances up to "
            f"{low if low > 0 else high:g}",
            remedy=remedy,
        )


def on_level(
    distance: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    points: NDArray[np.float64],
    values: NodeValues,
    grid: Grid,
    level: float,
) -> NDArray[np.float64]:
    """Points on edges of a grid, where values of the nodes pass a level, moved along to where distance does.

    By regula falsi, halving the weight of an end that stays twice (Dowell & Jarratt 1971). Points inside cells stay.

    Parameters
    ----------
    distance : callable
        The distance at (n, 3) points, which the values are at the nodes.
    points : (n, 3) float
        Where linear interpolation passes the level.
    values : (*shape) float
        Of the nodes.
    grid : Grid
        Where they are.
    level : float
        Which.
    """
    cells = (points - grid.origin) / grid.spacing
    near = np.rint(cells)
    cells = np.where(np.abs(cells - near) < 0.5 * CLEARANCE, near, cells)
    base = np.floor(cells).astype(np.int64)
    fraction = cells - base
    axis = fraction.argmax(axis=1)
    upper = base.copy()
    upper[np.arange(len(points)), axis] += 1
    inside = (base >= 0).all(axis=1) & (upper < np.array(values.shape)).all(axis=1)
    movable = np.flatnonzero(inside & ((fraction > 0).sum(axis=1) == 1))
    low, high = (values[tuple(at[movable].T)] - level for at in (base, upper))
    crossed = (low < 0) != (high < 0)
    movable, low, high = movable[crossed], low[crossed], high[crossed]
    moved = np.array(points, dtype=np.float64)
    base, axis, far = base[movable], axis[movable], CLOSE * float(grid.spacing.min())
    start, stop, last = np.zeros(len(base)), np.ones(len(base)), np.zeros(len(base), dtype=np.int8)
    active = np.arange(len(base))
    for _ in range(ROUNDS):
        if not len(active):
            break
        share = low[active] / (low[active] - high[active])
        share = np.clip(start[active] + share * (stop[active] - start[active]), CLEARANCE, 1 - CLEARANCE)
        at = base[active].astype(np.float64)
        at[np.arange(len(active)), axis[active]] += share
        places = grid.origin + at * grid.spacing
        off = distance(places) - level
        moved[movable[active]] = places
        same = (off < 0) == (low[active] < 0)
        ahead, behind = active[same], active[~same]
        start[ahead], low[ahead] = share[same], off[same]
        stop[behind], high[behind] = share[~same], off[~same]
        high[ahead] *= np.where(last[ahead] > 0, 0.5, 1.0)
        low[behind] *= np.where(last[behind] < 0, 0.5, 1.0)
        last[ahead], last[behind] = 1, -1
        active = active[np.abs(off) > far]
    return moved
