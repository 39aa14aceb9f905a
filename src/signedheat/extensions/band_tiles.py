"""The nodes of one tile of a band: exact distance to the faces that are there, and to what completes them.

A tile is computed from its plan alone, and so is the same whatever else is computed, and where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.nearest_faces import NearestFaces
from ..operators.grid.blocks import CUBE, NODES, SIDE, Blocks, block_points, off_grid
from ..operators.grid.closest_points import crossed_edges, crossings_at, distances_to_crossings
from .band_completion import NONE, completed_function, needed_blocks
from .band_grids import FAR
from .band_plan import NEAR, BandPlan
from .band_specks import without_specks
from .shape_sharpening import stands_in

TOGETHER = 512
"""Blocks whose faces are searched at a time."""
LEVEL = 0.5
"""Winding number of places inside, where no face tells."""
COVERED, CLEAR = 0.75, 0.25
"""The same where the nearest face says that they are outside, and where it says that they are inside."""


@dataclass(frozen=True, eq=False)
class Tile:
    """Blocks of a band with their values.

    Attributes
    ----------
    places : (n, 3) int32
        First nodes of the blocks, divided by `SIDE`.
    values : (n, 8, 8, 8) float32
        Signed distance; NaN beyond the grid.
    confidence : (n, 8, 8, 8) float16
        As in `GridField`.
    crossings : (c, 18) float
        Points in the tile of what completes the surface: see `crossings_at`.
    """

    places: NDArray[np.int32]
    values: NDArray[np.float32]
    confidence: NDArray[np.float16]
    crossings: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Sides:
    """Blocks with distances to faces, functions that are negative inside, confidence in the nearest face, and its ends.

    `told` tells whether the side is that of faces, `at_ends` whether the nearest place is on an edge or vertex beyond
    which the surface does not go on.
    """

    blocks: Blocks
    distances: NDArray[np.float64]
    function: NDArray[np.float64]
    told: NDArray[np.bool_]
    trusted: NDArray[np.float16]
    at_ends: NDArray[np.bool_]


def solve_tile(plan: BandPlan, tile: NDArray[np.integer]) -> Tile:
    """The blocks of a tile, given by its first node divided by `TILE`, that hold nodes of the band."""
    low = np.asarray(tile, dtype=np.int64) * CUBE
    high = low + CUBE
    needed, wide = needed_blocks(plan, low, high)
    blocks = Blocks.of(needed, plan.grid.shape)
    sides = _sides(plan, blocks)
    if wide and plan.faces is not None:
        without_specks(blocks, sides.function, sides.told)
    own = ((blocks.places >= low) & (blocks.places < high)).all(axis=1)
    signs = np.where(sides.function[own] < 0, -1.0, 1.0)
    distances, places = sides.distances[own], blocks.places[own]
    confidence = sides.trusted[own]
    crossings = np.zeros((0, 18))
    if wide:
        last = -(-np.array(plan.grid.shape) // SIDE)
        crossings = _crossings(plan, sides, np.maximum(low - wide, 0), np.minimum(high + wide, last))
        _completed(plan, places, distances, confidence, crossings)
    values = (signs * distances).astype(np.float32).reshape(-1, SIDE, SIDE, SIDE)
    confidence = confidence.reshape(values.shape)
    off_grid(values, Blocks(places, blocks.shape), np.nan)
    in_band = np.nanmin(np.abs(values), axis=(1, 2, 3), initial=np.inf) <= plan.reach
    kept = in_band | plan.at_walls(places, SIDE) & (values < 0).any(axis=(1, 2, 3))
    deep = kept & ~in_band  # crossings near them are not all in the tile
    roughly = np.maximum(np.abs(sides.function[own][deep]), plan.reach).reshape(-1, SIDE, SIDE, SIDE)
    values[deep] = np.sign(values[deep]) * np.minimum(np.abs(values[deep]), roughly)
    place = crossings[:, 1:4] / (SIDE * plan.steps)
    inner = ((place >= low) & (place < high)).all(axis=1)
    return Tile(places[kept], values[kept], confidence[kept], crossings[inner])


def _sides(plan: BandPlan, blocks: Blocks) -> _Sides:
    """Distances to faces, (n, 512), and signed functions: what the nearest face tells, else the coarse field."""
    n = len(blocks)
    distances, function = np.full((n, NODES), np.inf), np.empty((n, NODES))
    told, doubtful, at_ends = (np.zeros((n, NODES), dtype=bool) for _ in range(3))
    trusted = np.ones((n, NODES), dtype=np.float16)
    reached = _reached(plan, blocks)
    for begin in range(0, n, TOGETHER):
        some = slice(begin, begin + TOGETHER)
        points = block_points(blocks.places[some], plan.steps)
        coarse = plan.coarse_function(points)
        function[some] = coarse.reshape(-1, NODES)
        here = begin + np.flatnonzero(reached[some])
        if plan.faces is None or not len(here):
            continue
        points = points.reshape(-1, NODES, 3)[here - begin].reshape(-1, 3)
        found = plan.faces.search(points)
        signed, known, ended = _told(plan, points, found, coarse.reshape(-1, NODES)[here - begin].ravel())
        distances[here] = found.distances.reshape(-1, NODES)
        function[here] = signed.reshape(-1, NODES)
        told[here] = known.reshape(-1, NODES)
        doubtful[here] = (~known & (plan.telling | plan.asked)[found.faces]).reshape(-1, NODES)
        trusted[here] = plan.features.trusted[found.faces].reshape(-1, NODES)
        at_ends[here] = ended.reshape(-1, NODES)
    completed_function(plan, blocks, distances, function, doubtful)
    return _Sides(blocks, distances, function, told, trusted, at_ends)


def _reached(plan: BandPlan, blocks: Blocks) -> NDArray[np.bool_]:
    """Blocks with nodes for which faces may matter: in the middle of large holes all are too far away."""
    if plan.faces is None:
        return np.zeros(len(blocks), dtype=bool)
    centres = (blocks.places.astype(np.int64) * SIDE + 0.5 * (SIDE - 1)) * plan.steps
    radius = 0.5 * (SIDE - 1) * float(np.linalg.norm(plan.steps))
    far = max(NONE, NEAR) * plan.coarse_cell + plan.reach + 2 * radius
    return np.asarray(plan.faces.distances(centres) <= far)


def _told(
    plan: BandPlan, points: NDArray[np.float64], found: NearestFaces, coarse: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """(n,) signed functions, whether faces tell them, and whether these end at the nearest place and some may miss.

    The nearest face tells, or all together by their winding number.

    All are asked around walls that the coarse grid does not see, where the nearest face and the coarse field contradict
    each other, since it may be folded over or lie in what is inside, where another face lies on it, and at edges beyond
    which it does not go on, though nothing is missing there.
    """
    near = min(NEAR * plan.coarse_cell, plan.open_reach)
    by_face = found.regular & (found.distances < near) & plan.telling[found.faces]
    by_all = found.regular & (found.distances < near) & plan.asked[found.faces]
    ended = ~found.regular
    at = np.flatnonzero(ended & (found.distances < near))
    by_all[at] = plan.away_from_ends(points[at])
    ended &= ~by_all
    outside = found.cosines >= 0
    signed = np.where(outside, found.distances, -found.distances)
    contrary = by_face & (((coarse >= 0) != outside) | plan.touching[found.faces])
    asked = np.flatnonzero(by_all | contrary)
    if len(asked) and plan.winding is not None:
        winding = plan.winding.numbers(points[asked]) / plan.share
        level = np.where(by_all[asked], LEVEL, np.where(outside[asked], COVERED, CLEAR))
        signed[asked] = np.where(winding > level, -found.distances[asked], found.distances[asked])
    told = by_face | by_all
    return np.where(told, signed, coarse), told, ended


def _crossings(plan: BandPlan, sides: _Sides, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float64]:
    """(c, 18) points of the zero set of the sides where faces are missing (`stands_in`): see `crossings_at`."""
    first, shape = low * SIDE, tuple((high - low) * SIDE)
    n = len(sides.blocks)
    function, distance, at_ends = (
        sides.blocks.window(values.astype(np.float32).reshape(n, SIDE, SIDE, SIDE), first, shape)
        for values in (sides.function, sides.distances, sides.at_ends)
    )
    field = function.astype(np.float64)
    edges = crossed_edges(field[None])
    ends = edges[:, 1:4], edges[:, 1:4] + (edges[:, 4, None] == np.array([1, 2, 3]))
    known = np.logical_and.reduce([np.isfinite(field[tuple(end.T)]) for end in ends])
    away = np.maximum.reduce([distance[tuple(end.T)] for end in ends])
    ended = np.logical_or.reduce([at_ends[tuple(end.T)] > 0 for end in ends])
    edges = edges[known & (ended | (away > FAR * plan.cell))]
    result: NDArray[np.float64] = crossings_at(field[None], edges, np.array([1.0, *plan.steps]))
    unknown = np.flatnonzero(~np.isfinite(result).all(axis=1))
    result[unknown] = _straight(field, edges[unknown], plan.steps)
    result[:, 1:4] += first * plan.steps
    if plan.faces is None:
        return result
    return result[stands_in(plan.faces.search(np.ascontiguousarray(result[:, 1:4])), plan.cell)]


def _straight(field: NDArray[np.float64], edges: NDArray[np.int32], steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Crossings from the two ends of their edges alone, where not enough nodes around have a value."""
    result = np.zeros((len(edges), 18))
    axis = edges[:, 4] - 1
    start = edges[:, 1:4].astype(np.int64)
    stop = start + np.eye(3, dtype=np.int64)[axis]
    here, there = field[tuple(start.T)], field[tuple(stop.T)]
    result[:, 1:4] = (start + (here / (here - there))[:, None] * (stop - start)) * steps
    result[np.arange(len(edges)), 5 + axis] = np.where(there > here, 1.0, -1.0)
    return result


def _completed(
    plan: BandPlan,
    places: NDArray[np.int32],
    distances: NDArray[np.float64],
    confidence: NDArray[np.float16],
    crossings: NDArray[np.float64],
) -> None:
    """Take over distances to crossings where they are nearer than the faces."""
    if not len(crossings) or not len(places):
        return
    tree = scipy.spatial.cKDTree(crossings[:, 1:4])
    radius = 0.5 * (SIDE - 1) * float(np.linalg.norm(plan.steps))
    centres = (places.astype(np.int64) * SIDE + 0.5 * (SIDE - 1)) * plan.steps
    gap, _ = tree.query(centres)
    in_band = np.minimum(gap - radius, distances.min(axis=1)) <= plan.reach  # the others are not kept
    rows = np.flatnonzero(in_band & (gap - radius < distances.max(axis=1)))
    trusted = plan.coarse_confidence(crossings[:, 1:4])
    reach = float(np.linalg.norm(plan.steps))
    inner = np.linalg.norm(
        block_points(np.zeros((1, 3), dtype=np.int32), plan.steps) - 0.5 * (SIDE - 1) * plan.steps, axis=1
    )
    for begin in range(0, len(rows), TOGETHER):
        some = rows[begin : begin + TOGETHER]
        block, node = np.nonzero(gap[some, None] - inner < distances[some])  # the others are nearer to faces
        points = block_points(places[some], plan.steps).reshape(-1, NODES, 3)[block, node]
        block = some[block]
        found, nearest = tree.query(points)
        nearer = found < distances[block, node]  # not its circle, which is no surface far from where it touches
        block, node, points, nearest = block[nearer], node[nearer], points[nearer], nearest[nearer]
        other = np.empty(len(points))
        distances_to_crossings(points, nearest.astype(np.int32), crossings, reach, other)
        taken = block, node
        distances[taken], confidence[taken] = np.minimum(other, distances[taken]), trusted[nearest]
