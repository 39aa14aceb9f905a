"""The grids of a band's coarser fields, and how wide those in bands must be."""

from __future__ import annotations

import numpy as np

from ..domains.grid import Grid
from ..operators.grid.blocks import SIDE

RATIO = 4
"""Spacing of the coarse grid over that of the band, where nothing speaks against it."""
STEEPEST = 16
"""The same from which on another band is computed between them: near the ends of the surface fine nodes within some
coarse cells are solved for, whose number grows with its square."""
FEWEST, MOST = 64, 257
"""Nodes of the coarse grid along its longest side: with fewer it misses what it must complete, with more it is slow."""
FAR = 1.5
"""Cells from any face beyond which a zero set stands in for missing surface."""
SLACK = 0.75
"""Coarse cells by which distance may be off between the nodes of the coarse field."""
ENDS = 2.5
"""Coarse cells from ends of the surface up to which the fine solution counts."""
LEAST = 2.0
"""Cells that a band is wide on either side at least."""


def coarse_grid(grid: Grid) -> Grid:
    """The grid of the coarse field for a band on a grid: its nodes are some of those, as far as they reach."""
    factor, longest = RATIO, max(grid.shape) - 1
    while longest // factor >= MOST:
        factor *= 2
    while factor > 1 and longest // factor < FEWEST - 1:
        factor //= 2
    return Grid(grid.origin, factor * grid.spacing, [max(2, 1 - (-(n - 1) // factor)) for n in grid.shape])


def grid_between(coarse: Grid, grid: Grid) -> Grid | None:
    """That of another band, where the grid of a band is far finer than its coarse one; None where it is not."""
    if round(float((coarse.spacing / grid.spacing).max())) < STEEPEST:
        return None
    return Grid(grid.origin, RATIO * grid.spacing, [1 - (-(n - 1) // RATIO) for n in grid.shape])


def width_between(grid: Grid, band: float) -> float:
    """Half width of the band of that: wherever blocks of a band are computed, it tells their coarse field."""
    fine = float(grid.spacing.max())
    beside = float(np.linalg.norm(SIDE * grid.spacing)) + (max(FAR, ENDS) + SLACK) * RATIO * fine
    return max(float(band), LEAST * fine) + float(np.linalg.norm(grid.spacing)) + beside
