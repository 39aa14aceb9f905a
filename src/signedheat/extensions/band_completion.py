"""The method on the fine nodes of a band, around what is missing: where surface ends, the coarse field is too coarse.

Near the ends of faces the three steps are done anew on fine nodes, with t for their spacing: diffusion and Poisson's
equation with natural conditions at the rim of the blocks, and φ shifted to vanish at the faces by a diffused offset.
Farther than two and a half coarse cells from any face the coarse field stays, which is what the fine steps would carry
on from there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..lowering.area_elements import sample_on_grid
from ..operators.grid.block_method import BlockSources, SomeNodes
from ..operators.grid.blocks import SIDE, Blocks, block_points
from .band_grids import ENDS
from .band_plan import BandPlan
from .sides import LEVEL, MIDDLE, SLOPE, doubt_beside

FULL, NONE = 1.5, ENDS
"""Coarse cells from faces up to which the fine solution counts in full, and from which on it does not at all."""
APART = 0.75
"""Coarse cells by which fine and coarse may differ; twice that, and the coarse field has decided otherwise."""
BEND = 4.0
"""How fast guards give way to φ, per cell."""
WITHIN = 6.0
"""Coarse cells within which the level of the coarse field's completed surface counts."""
SAMPLE_SIZE = 0.5
"""Longest edge, in cells, of the pieces into which faces are cut."""
ROUNDS = 12
"""Least number of rounds of sweeps."""


def halo(plan: BandPlan) -> int:
    """Blocks around a tile whose faces matter in it."""
    return 1 + int(np.ceil(NONE * plan.coarse_cell / (SIDE * float(plan.steps.min()))))


def needed_blocks(plan: BandPlan, low: NDArray[np.int64], high: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Blocks that must be computed for those in a box [low, high), and how many blocks from it they lie at most.

    Around it those with completed surface, as far as it may be the nearest, and those near ends of the surface.
    """
    if not plan.is_open(low, high):
        return plan.blocks_in(low, high), 0
    reach = min(plan.reach / (SIDE * float(plan.steps.min())), float(max(plan.grid.shape)))
    beside = 2 + int(reach)
    wide = max(beside, halo(plan)) if plan.has_ends(low - beside, high + beside) else beside

    def kept(places: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
        first, last = places * size, (places + 1) * size
        result = np.asarray(((last > low) & (first < high)).all(axis=1))
        around = ((last > low - beside) & (first < high + beside)).all(axis=1)
        rest = np.flatnonzero(~result & around)
        result[rest] = plan.blocks_near(plan.open_places, places[rest], size)
        rest = np.flatnonzero(~result)
        result[rest] = plan.blocks_near(plan.end_tree, places[rest], size)
        return result

    return plan.blocks_in(low - wide, high + wide, kept), wide


def completed_function(
    plan: BandPlan,
    blocks: Blocks,
    distances: NDArray[np.float64],
    function: NDArray[np.float64],
    doubtful: NDArray[np.bool_],
) -> None:
    """Replace the coarse function, in place, at doubtful nodes of blocks, (n, 512) each, near the ends of faces."""
    active = near_ends(plan, blocks.places) if doubtful.any() else np.zeros(len(blocks), dtype=bool)
    if not active.any():
        return
    fine = _fine_function(plan, SomeNodes.of_blocks(Blocks(blocks.places[active], blocks.shape)))
    if fine is None:
        return
    there = fine.reshape(len(fine), -1)
    coarse, away = function[active], distances[active] / plan.coarse_cell
    weight = np.clip((NONE - away) / (NONE - FULL), 0.0, 1.0)
    weight *= doubtful[active] & np.isfinite(there)
    asked = (weight > 0) & (np.abs(coarse) < 2 * APART * plan.coarse_cell)
    points = block_points(blocks.places[active], plan.steps)[asked.ravel()]
    there[asked] = _guarded(plan, points, there[asked], distances[active][asked])
    weight *= np.clip(2.0 - np.abs(there - coarse) / (APART * plan.coarse_cell), 0.0, 1.0)
    function[active] = np.where(weight > 0, weight * np.nan_to_num(there) + (1 - weight) * coarse, coarse)


def _guarded(
    plan: BandPlan, points: NDArray[np.float64], phi: NDArray[np.float64], distances: NDArray[np.float64]
) -> NDArray[np.float64]:
    """φ at (n, 3) points, guarded by winding numbers as on a whole grid (`choose_sides`).

    Where the coarse field fills a missing side farther than that, the winding number of what completes it there is the
    level.
    """
    if plan.winding is None or not len(points):
        return phi
    winding = plan.winding.numbers(points) / plan.share
    doubt = np.full(len(points), 0.5 - LEVEL)
    if plan.rims is not None:
        planes = np.flatnonzero((np.abs(winding - 0.5) < MIDDLE) & (distances > plan.cell))
        if len(planes):
            doubt[planes] *= doubt_beside(plan.rims, points[planes])
    low, high = 0.5 - doubt, 0.5 + doubt
    if plan.levels is not None:
        tree, levels = plan.levels
        found, nearest = tree.query(points, distance_upper_bound=WITHIN * plan.coarse_cell)
        known = np.isfinite(found)
        level = levels[nearest[known]]
        low[known], high[known] = np.minimum(low[known], level), np.maximum(high[known], level)
    least, most = SLOPE * (low - winding), SLOPE * (high - winding)
    least -= np.where(least < 0, BEND * least**2, 0.0)  # where the guard agrees with φ, that stays a distance
    most += np.where(most > 0, BEND * most**2, 0.0)
    result: NDArray[np.float64] = np.minimum(np.maximum(phi, plan.cell * least), plan.cell * most)
    return result


def near_ends(plan: BandPlan, places: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(n,) which of the blocks at (n, 3) places the method is repeated in, around the ends of the surface."""
    return plan.blocks_near(plan.end_tree, places)


def _fine_function(plan: BandPlan, nodes: SomeNodes) -> NDArray[np.float64] | None:
    """(b, 8, 8, 8) φ at nodes of blocks; None where there are no faces, NaN where none is near."""
    places = nodes.blocks.places.astype(np.int64)
    first = places.min(axis=0) * SIDE
    box = Grid(first * plan.steps, plan.steps, (places.max(axis=0) + 1) * SIDE - first)
    corners = plan.features.corners.reshape(-1, 3, 3)
    near = ((corners.max(axis=1) >= box.origin) & (corners.min(axis=1) <= box.upper)).all(axis=1)
    if not near.any():
        return None
    faces = np.arange(3 * int(near.sum())).reshape(-1, 3)
    try:
        samples = sample_on_grid([TriangleMesh(corners[near].reshape(-1, 3), faces)], box, SAMPLE_SIZE)
    except SourceError:  # beside the box, or cancelled
        return None
    cells = float(plan.steps.max()) / float(plan.steps.min())
    rounds = max(ROUNDS, int(np.ceil(NONE * plan.coarse_cell / plan.cell * cells)))
    sources = BlockSources(nodes, samples.positions + first, samples.vectors, plan.steps, 1.0, rounds)
    directions, arrived = sources.directions()
    start = plan.coarse_function(nodes.nodes * plan.steps)
    phi = nodes.integrate(directions, plan.steps, start)
    offset, there = sources.offsets(phi)
    return nodes.in_blocks(np.where(arrived & there, phi - offset, np.nan))
