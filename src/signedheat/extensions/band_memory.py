"""What a band takes in memory, before any of it is computed."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..errors import MemoryLimitError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..memory import available_memory, libraries
from ..operators.grid.blocks import CUBE, NODES, SIDE
from ..parallel import n_threads
from .band_completion import near_ends, needed_blocks
from .band_grids import coarse_grid
from .band_plan import TILE, BandPlan

LOOKED_AT = 24
"""Tiles of which blocks are counted, at most."""
KEPT = 0.7
"""Share of the blocks counted that have nodes in the band."""
BYTES, BYTES_AT_WORK, BYTES_SOLVED = 6, 30, 200
"""Measured: of each node of a band; of a node of a tile that is computed; and of one where the method is repeated."""
USUAL, BYTES_BEYOND = 28**3, 22
"""Blocks of the box around a tile in which completed surface is looked for; the others' bytes include that of so many,
each node more takes these."""
BYTES_ON_DISK = 10
"""Of each node, in its tile and in the band that the tiles make."""
BYTES_COMPLETED = 2 * 144
"""Of each point of completed surface, which tiles have and the band gets from them."""

ROOM = 1.25
"""By how much the spacing that is told to fit is larger than it must be."""
CLOSE = 1.01
"""Ratio up to which the spacing that fits is narrowed down."""
SURELY = 0.5
"""Share of the nodes that a band surely has, of those that the coarse field tells."""
FIXED, FIXED_AT_ENDS = 75_000_000, 75_000_000
"""Bytes that trees of faces and threads take besides; and what solving takes where the surface ends."""


def memory_of_band(plan: BandPlan) -> tuple[int, int]:
    """Estimated bytes that a band takes beside what is there already: for its values, and at work on its tiles.

    Blocks are counted in some of the tiles.
    """
    tiles = plan.tiles
    if not len(tiles):
        return 0, 0
    counts = [_blocks_of(plan, tile) for tile in _some(tiles)]
    held = np.mean([counted[0] for counted in counts]) * len(tiles)
    at_ends = [_blocks_of(plan, tile) for tile in _some(np.unique(plan.ends // (TILE * plan.steps), axis=0))]
    at_work = max(
        around * BYTES_AT_WORK + solved * BYTES_SOLVED + max(box - USUAL, 0) * BYTES_BEYOND
        for _, around, solved, box in counts + at_ends
    )
    values = NODES * KEPT * held * BYTES + BYTES_COMPLETED * completed_points(plan.coarse, plan.grid)
    fixed = FIXED + (FIXED_AT_ENDS if len(plan.ends) else 0)
    return int(values), int(fixed + NODES * n_threads() * at_work)


def _some(tiles: NDArray[Any]) -> NDArray[Any]:
    """At most `LOOKED_AT`, one after another."""
    return tiles[np.unique(np.linspace(0, len(tiles) - 1, LOOKED_AT).astype(np.int64))] if len(tiles) else tiles


def completed_points(coarse: GridField | BandField, grid: Grid) -> float:
    """About how many points of completed surface a band has: as many as the coarse field for each of its squares."""
    finer = float(coarse.grid.spacing.max() / grid.spacing.max())
    return 0.0 if coarse.surface is None else len(coarse.surface.crossings) * finer**2


def refuse_band_beyond_memory(plan: BandPlan) -> None:
    """Raise `MemoryLimitError` if a band will not fit, and tell the spacing at which it would."""
    values, at_work = memory_of_band(plan)
    _refuse(plan.far, plan.grid, plan.width, values, at_work)


def refuse_band_far_beyond_memory(coarse: GridField, grid: Grid, band: float) -> None:
    """The same before any band between is computed, where not even half the nodes would fit."""
    values = BYTES * volume_within(coarse, band) / float(np.prod(grid.spacing))
    values += BYTES_COMPLETED * completed_points(coarse, grid)
    at_work = FIXED + FIXED_AT_ENDS + n_threads() * NODES * CUBE**3 * BYTES_AT_WORK
    _refuse(coarse, grid, band, values, at_work, SURELY)


def refuse_work_beyond_memory(plan: BandPlan) -> None:
    """Raise `MemoryLimitError` if the tiles that are computed at a time will not fit, wherever they are kept."""
    available = available_memory()
    needed = memory_of_band(plan)[1] + libraries()
    if available is None or needed <= available:
        return
    raise MemoryLimitError(
        f"{n_threads()} tiles at a time need about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free",
        remedy=f"use a band narrower than {plan.width:.2g}, a larger spacing, or fewer threads",
    )


def refuse_tiles_beyond_disk(coarse: GridField, grid: Grid, band: float, folder: Path) -> None:
    """Raise `MemoryLimitError` if not even half the nodes of a band would fit on the disk of a folder."""
    there = next(place for place in (folder, *folder.parents) if place.exists())
    free = shutil.disk_usage(there).free
    needed = SURELY * BYTES_ON_DISK * volume_within(coarse, band) / float(np.prod(grid.spacing))
    if needed <= free:
        return
    fitting = ROOM * _fitting_spacing(coarse, float(grid.spacing.min()), band, SURELY * free / needed)
    raise MemoryLimitError(
        f"the tiles need about {needed / SURELY / 1e9:.2g} GB, and {free / 1e9:.2g} GB are free "
        f"on the disk of {folder}",
        remedy=f"use a spacing of {fitting:.3g} or more, a narrower band, or a folder on a larger disk",
    )


def _refuse(coarse: GridField, grid: Grid, width: float, values: float, at_work: float, surely: float = 1.0) -> None:
    """Raise `MemoryLimitError` if what is at work and a share of the values of a band are more than there is."""
    available = available_memory()
    if available is None or surely * values + at_work + libraries() <= available:
        return
    needed = values + at_work + libraries()
    told = f"the band needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free"
    left = (available - at_work - libraries()) / values
    if left <= 0:
        raise MemoryLimitError(
            told, remedy=f"free some memory, or use a narrower band: its work takes {(needed - values) / 1e9:.2g} GB"
        )
    spacing = float(grid.spacing.min())
    fitting = ROOM * _fitting_spacing(coarse, spacing, width, left)
    while _coarse_nodes(grid, fitting / spacing) > coarse.grid.n_nodes:  # of which so many did fit
        fitting *= CLOSE
    raise MemoryLimitError(
        told, remedy=f"use a spacing of {fitting:.3g} or more, or keep it on disk: tiled_distance, volume --tiles"
    )


def volume_within(coarse: GridField, reach: float) -> float:
    """Volume of the places nearer to a surface than `reach`, from the distances of coarse nodes.

    Each node stands for a cell through which distance goes up by its side.
    """
    half = 0.5 * float(coarse.grid.spacing.max())
    cells = 0.0
    for values in np.abs(coarse.values):
        within = np.minimum(values + half, reach) - np.maximum(values - half, -reach)
        cells += float(np.maximum(within, 0.0).sum(dtype=np.float64)) / (2.0 * half)
    return cells * float(np.prod(coarse.grid.spacing))


def _coarse_nodes(grid: Grid, ratio: float) -> int:
    """Nodes of the coarse grid of a band whose spacing is that of a grid times a ratio."""
    shape = np.ceil((np.array(grid.shape) - 1) / ratio).astype(np.int64) + 1
    return coarse_grid(Grid(grid.origin, ratio * grid.spacing, shape)).n_nodes


def _blocks_of(plan: BandPlan, tile: NDArray[Any]) -> tuple[int, int, int, int]:
    """Number of blocks of a tile, of those that are computed for it, where the method is repeated, and in its box."""
    low = np.asarray(tile, dtype=np.int64) * CUBE
    high = low + CUBE
    own = plan.blocks_in(low, high)
    needed, wide = needed_blocks(plan, low, high)
    last = -(-np.array(plan.grid.shape) // SIDE)
    box = np.minimum(high + wide, last) - np.maximum(low - wide, 0)
    return len(own), len(needed), int(near_ends(plan, needed).sum()) if wide else 0, int(np.prod(box)) if wide else 0


def _fitting_spacing(coarse: GridField, spacing: float, width: float, share: float) -> float:
    """The least spacing with that share of the nodes, which lie as near to the surface or in a block with such."""

    def nodes(h: float) -> float:
        return volume_within(coarse, width + 0.75 * SIDE * h) / h**3

    most = share * nodes(spacing)
    low, high = spacing, spacing
    while nodes(high) > most:
        low, high = high, 2.0 * high
    while high > CLOSE * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if nodes(middle) <= most else (middle, high)
    return high
