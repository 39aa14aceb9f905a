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
from ..operators.grid.block_method import TINY, SomeNodes
from ..operators.grid.blocks import SIDE, Blocks
from .band_plan import BandPlan

FULL, NONE = 1.5, 2.5
"""Coarse cells from faces up to which the fine solution counts in full, and from which on it does not at all."""
APART = 0.75
"""Coarse cells by which fine and coarse may differ; twice that, and the coarse field has decided otherwise."""
SAMPLE_SIZE = 0.5
"""Longest edge, in cells, of the pieces into which faces are cut."""
ROUNDS = 12
"""Least number of rounds of sweeps."""


def halo(plan: BandPlan) -> int:
    """Blocks around a tile whose faces matter in it."""
    return 1 + int(np.ceil(NONE * plan.coarse_cell / (SIDE * float(plan.steps.min()))))


def completed_function(
    plan: BandPlan,
    blocks: Blocks,
    distances: NDArray[np.float64],
    function: NDArray[np.float64],
    doubtful: NDArray[np.bool_],
) -> None:
    """Replace the coarse function, in place, at doubtful nodes of blocks, (n, 512) each, near the ends of faces."""
    active = _near_ends(plan, blocks) if doubtful.any() else np.zeros(len(blocks), dtype=bool)
    if not active.any():
        return
    places = blocks.places[active].astype(np.int64)
    low, high = places.min(axis=0), places.max(axis=0) + 1
    box = np.zeros((high - low) * SIDE, dtype=bool)
    shape = (high - low).repeat(2)
    shape[1::2] = SIDE
    view = box.reshape(shape).transpose(0, 2, 4, 1, 3, 5)  # blocks, then nodes in them
    view[tuple((places - low).T)] = True
    nodes = SomeNodes.of(box)
    fine = _fine_function(plan, nodes, low * SIDE)
    if fine is None:
        return
    spread = np.zeros(box.shape)
    spread[tuple(nodes.nodes.T)] = fine
    there = spread.reshape(shape).transpose(0, 2, 4, 1, 3, 5)[tuple((places - low).T)].reshape(len(places), -1)
    coarse, away = function[active], distances[active] / plan.coarse_cell
    share = np.clip((NONE - away) / (NONE - FULL), 0.0, 1.0)
    share *= np.clip(2.0 - np.abs(there - coarse) / (APART * plan.coarse_cell), 0.0, 1.0)
    share *= doubtful[active] & np.isfinite(there)
    function[active] = np.where(share > 0, share * np.nan_to_num(there) + (1 - share) * coarse, coarse)


def _near_ends(plan: BandPlan, blocks: Blocks) -> NDArray[np.bool_]:
    """Blocks around places where the surface ends."""
    if plan.end_tree is None:
        return np.zeros(len(blocks), dtype=bool)
    centres = (blocks.places.astype(np.int64) * SIDE + 0.5 * (SIDE - 1)) * plan.steps
    within = NONE * plan.coarse_cell + 0.5 * float(np.linalg.norm((SIDE - 1) * plan.steps))
    return np.asarray(plan.end_tree.query(centres, distance_upper_bound=within)[0] <= within)


def _fine_function(plan: BandPlan, nodes: SomeNodes, first: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """(n,) φ at nodes of a box that begins at `first`; None where there are no faces, NaN where none is near."""
    grid = Grid(first * plan.steps, plan.steps, nodes.numbers.shape)
    corners = plan.features.corners.reshape(-1, 3, 3)
    near = ((corners.max(axis=1) >= grid.origin) & (corners.min(axis=1) <= grid.upper)).all(axis=1)
    if not near.any():
        return None
    faces = np.arange(3 * int(near.sum())).reshape(-1, 3)
    try:
        samples = sample_on_grid([TriangleMesh(corners[near].reshape(-1, 3), faces)], grid, SAMPLE_SIZE)
    except SourceError:  # beside the box, or cancelled
        return None
    cells = float(plan.steps.max()) / float(plan.steps.min())
    ratios = (float(plan.steps.mean()) / plan.steps) ** 2
    rounds = max(ROUNDS, int(np.ceil(NONE * plan.coarse_cell / plan.cell * cells)))
    strength = np.linalg.norm(samples.vectors, axis=1)
    weighted = np.concatenate([samples.vectors, strength[:, None]], axis=1)
    diffused = nodes.diffuse(nodes.splat(samples.positions, weighted), ratios, rounds)
    largest = np.abs(diffused[:, :3]).max(axis=1)
    arrived = largest > TINY * float(strength.max())
    directions = diffused[:, :3] / np.where(arrived, largest, 1.0)[:, None]
    lengths = np.linalg.norm(directions, axis=1)
    directions /= np.where(lengths > 0, lengths, 1.0)[:, None]
    start = plan.coarse_function((first + nodes.nodes) * plan.steps)
    phi = nodes.integrate(directions, plan.steps, start)
    heights = nodes.at(phi, samples.positions)
    known = np.isfinite(heights)
    offsets = np.zeros((int(known.sum()), 4))
    offsets[:, 0], offsets[:, 1] = strength[known], strength[known] * heights[known]
    spread = nodes.diffuse(nodes.splat(samples.positions[known], offsets), ratios, rounds)
    there = spread[:, 0] > TINY * float(strength.max())
    return np.where(arrived & there, phi - spread[:, 1] / np.where(there, spread[:, 0], 1.0), np.nan)
