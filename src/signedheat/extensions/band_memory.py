"""What a band takes in memory, before any of it is computed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MemoryLimitError
from ..memory import available_memory, libraries
from ..operators.grid.blocks import CUBE, NODES, SIDE
from ..parallel import n_threads
from .band_completion import near_ends, needed_blocks
from .band_plan import TILE, BandPlan

LOOKED_AT = 24
"""Tiles of which blocks are counted, at most."""
KEPT = 0.7
"""Share of the blocks counted that have nodes in the band."""
BYTES, BYTES_AT_WORK, BYTES_SOLVED = 6, 30, 200
"""Measured: of each node of a band; of a node of a tile that is computed; and of one where the method is repeated."""
BYTES_COMPLETED = 2 * 144
"""Of each point of completed surface, which tiles have and the band gets from them."""

ROOM = 1.1
"""By how much the spacing that is told to fit is larger than it must be."""
LEAST = 0.01
"""Share of the values that is taken to fit where even less would not."""
FIXED, FIXED_AT_ENDS = 75_000_000, 50_000_000
"""Bytes that trees of faces and threads take besides; and what solving takes where the surface ends."""


def memory_of_band(plan: BandPlan) -> tuple[int, int]:
    """Estimated bytes that a band takes beside what is there already: for its values, and at work on its tiles.

    Blocks are counted in some of the tiles.
    """
    tiles = plan.tiles
    if not len(tiles):
        return 0, 0
    counts = [_blocks_of(plan, tile) for tile in _some(tiles)]
    held = np.mean([own for own, _, _ in counts]) * len(tiles)
    at_ends = [_blocks_of(plan, tile) for tile in _some(np.unique(plan.ends // (TILE * plan.steps), axis=0))]
    at_work = max(around * BYTES_AT_WORK + solved * BYTES_SOLVED for _, around, solved in counts + at_ends)
    values = NODES * KEPT * held * BYTES + BYTES_COMPLETED * completed_points(plan)
    fixed = FIXED + (FIXED_AT_ENDS if len(plan.ends) else 0)
    return int(values), int(fixed + NODES * n_threads() * at_work)


def _some(tiles: NDArray[Any]) -> NDArray[Any]:
    """At most `LOOKED_AT`, one after another."""
    return tiles[np.unique(np.linspace(0, len(tiles) - 1, LOOKED_AT).astype(np.int64))] if len(tiles) else tiles


def completed_points(plan: BandPlan) -> float:
    """About how many points of completed surface a band has: as many as the coarse field for each of its squares."""
    surface = plan.coarse.surface
    return 0.0 if surface is None else len(surface.crossings) * (plan.coarse_cell / plan.cell) ** 2


def refuse_band_beyond_memory(plan: BandPlan) -> None:
    """Raise `MemoryLimitError` if a band will not fit, and tell the spacing at which it would."""
    available = available_memory()
    values, at_work = memory_of_band(plan)
    needed = values + at_work + libraries()
    if available is None or needed <= available:
        return
    spacing, width = float(plan.steps.min()), plan.width
    share = max((available - at_work - libraries()) / values, LEAST)
    fitting = ROOM * _fitting_spacing(spacing, width, share)
    raise MemoryLimitError(
        f"the band needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free",
        remedy=f"use a spacing of {fitting:.2g} or more, or keep it on disk: tiled_distance, volume --tiles",
    )


def _blocks_of(plan: BandPlan, tile: NDArray[Any]) -> tuple[int, int, int]:
    """Number of blocks of a tile, of those that are computed for it, and of those where the method is repeated."""
    low = np.asarray(tile, dtype=np.int64) * CUBE
    high = low + CUBE
    own = plan.blocks_in(low, high)
    needed, wide = needed_blocks(plan, low, high)
    return len(own), len(needed), int(near_ends(plan, needed).sum()) if wide else 0


def _fitting_spacing(spacing: float, width: float, share: float) -> float:
    """The least spacing with that share of the nodes, of which there are 2 (b / h + 6) / h² for a piece of surface."""

    def nodes(h: float) -> float:
        return (width / h + 0.75 * SIDE) / h**2

    low, high = spacing, spacing
    while nodes(high) > share * nodes(spacing):
        high *= 2.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if nodes(middle) <= share * nodes(spacing) else (middle, high)
    return high
