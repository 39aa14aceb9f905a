"""Distance in a band around a shape, at a fineness that no grid of the whole box could have."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Diagnostics
from ..domains.grid import Grid
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..memory import paged
from ..operators.grid.blocks import Blocks
from ..parallel import n_threads
from ..progress import Progress, within
from .band_grids import grid_between, width_between
from .band_memory import refuse_band_beyond_memory, refuse_band_far_beyond_memory
from .band_plan import BandPlan, plan_band
from .band_tiles import Tile, solve_tile

BETWEEN = 0.2
"""Share of the progress that the band between a band and its coarse grid is."""


def band_around(coarse: GridField, grid: Grid, band: float, progress: Progress | None = None) -> BandField:
    """Distance in a band, from the distance to a solid on the `coarse_grid` of a fine grid.

    Parameters
    ----------
    coarse : GridField
        What `solid_distance` gives.
    grid : Grid
        Of the band's nodes.
    band : float
        Half width of the band, in units of length.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    BandField
        With the notes of the coarse field.

    Raises
    ------
    MemoryLimitError
        If the band cannot fit in memory; none of it has been computed then.
    """
    between = grid_between(coarse.grid, grid)
    if between is None:
        return joined_band(coarse, grid, band, progress)
    refuse_band_far_beyond_memory(coarse, grid, band)
    wide = band_around(coarse, between, width_between(grid, band), within(progress, 0.0, BETWEEN))
    return joined_band(wide, grid, band, within(progress, BETWEEN, 1.0))


def joined_band(coarse: GridField | BandField, grid: Grid, band: float, progress: Progress | None) -> BandField:
    """A band from the next coarser field; see `band_around`."""
    plan = plan_band(coarse, grid, band)
    refuse_band_beyond_memory(plan)
    tiles = plan.tiles
    results: list[Tile] = []
    for tile in in_threads(lambda place: solve_tile(plan, place), tiles):
        results.append(replace(tile, values=paged(tile.values), confidence=paged(tile.confidence)))
        if progress is not None:
            progress(len(results) / len(tiles), "band")
    return joined(plan, results, coarse.diagnostics)


def in_threads(solve: Callable[[NDArray[np.int64]], Tile], places: Iterable[NDArray[np.int64]]) -> Iterator[Tile]:
    """Tiles, in order, of which as many are computed at a time as there are processors."""
    with ThreadPoolExecutor(n_threads()) as pool:
        jobs = deque(pool.submit(solve, place) for place in places)
        try:
            while jobs:
                yield jobs.popleft().result()  # a job that is kept keeps its tile
        finally:
            for job in jobs:
                job.cancel()


def joined(plan: BandPlan, tiles: list[Tile], diagnostics: Diagnostics) -> BandField:
    """The field that tiles, in any order, make together; their list is emptied, lest all is there twice."""
    places = np.concatenate([tile.places for tile in tiles])
    blocks = Blocks.of(places, plan.grid.shape)
    values = np.empty((len(places), *tiles[0].values.shape[1:]), dtype=np.float32)
    confidence = np.empty(values.shape, dtype=np.float16)
    crossings = np.concatenate([tile.crossings for tile in tiles])
    while tiles:
        tile = tiles.pop()
        rows = blocks.rows(tile.places)
        values[rows] = tile.values
        confidence[rows] = tile.confidence
    surface = plan.surface(crossings)
    return BandField(plan.grid, blocks, values, plan.far, plan.width, diagnostics, confidence, surface)
