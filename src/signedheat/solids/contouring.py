"""Offsets of solids as closed surfaces with sharp edges: dual contouring with exact distances.

Vertices lie within cells of a grid, not on its edges, where the planes of the surface meet (Ju, Losasso, Schaefer &
Warren 2002). Each connected piece within a cell has one (Schaefer, Ju & Warren 2007), and triangles do not pass through
each other (Ju & Udeshi 2006). Only blocks of the grid through which the level passes are computed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..errors import InexactWarning, MemoryLimitError, OutsideError, warn_user
from ..field_levels import NodeValues, on_level
from ..grids.blocks import SIDE, Blocks, BlockValues
from ..grids.grid import Grid
from ..grids.marching import CLEARANCE
from ..jobs import Progress
from ..memory import available_memory, libraries
from ..mesh.components import element_components
from ..mesh.dual_cells import Crossings, DualCells, cells_around, dual_cells, open_cells, separate_triangles
from ..surfaces.triangle_mesh import TriangleMesh
from .dual_vertices import ImplicitSurface, divided_along_creases, placed
from .gauss import Pieces, sampled
from .node_distances import solved
from .offsets import Offset
from .tiles import blocks_where, in_threads, prepared, tiles_of

BYTES_PER_BLOCK = 170_000
"""Measured peak memory of a contour, for each block of the grid near it."""
WINDOW = 8
"""Number of blocks along each edge of a window whose crossed edges are found together."""
AROUND = np.array(list(np.ndindex(3, 3, 3))) - 1
"""(27, 3) offsets of a cell and of those that touch it."""
IN_BLOCK = np.array(list(np.ndindex(SIDE, SIDE, SIDE)))
"""(512, 3) offsets of the nodes of a block."""
SAMPLED = 4096
"""Number of places on a surface at which its contour is looked for, besides one for each part."""
LOST = 0.01
"""Contours that miss a larger share of the surface are announced. Edges and tips thinner than a cell occur on most
parts, walls do not."""
STEEPEST = 2.0
"""Largest slope of the height above a surface at which blocks near it are found from coarse to fine. Distance has slope
1; where a varying distance is steeper, blocks are found by following the surface."""


def block_heights(offset: Offset, grid: Grid, blocks: Blocks) -> BlockValues:
    """Heights above a surface at the nodes of blocks, which are found together if it is a level of distance."""
    tree, windings = prepared(offset.solid)
    values = np.empty((len(blocks), SIDE, SIDE, SIDE), dtype=np.float32)
    level = offset.level

    def solve(rows: Ints) -> Ints:
        places = blocks.places[rows].astype(np.int64)
        if level is not None:
            values[rows] = solved(tree, windings, grid, places)[0].astype(np.float64) - level
            return rows
        nodes = (SIDE * places[:, None] + IN_BLOCK).reshape(-1, 3)
        heights = offset.distance(grid.origin + nodes * grid.spacing)
        heights[(nodes >= grid.shape).any(axis=1)] = np.nan
        values[rows] = heights.reshape(-1, SIDE, SIDE, SIDE)
        return rows

    for _ in in_threads(solve, tiles_of(blocks)):
        pass
    return BlockValues(blocks, values)


def sharp_surface(offset: Offset, grid: Grid, progress: Progress | None = None) -> TriangleMesh:
    """Return a surface at a distance from a solid, closed and manifold, with its edges and corners."""
    report = progress or (lambda fraction, step: None)
    values, crossings, cells = _crossed(offset, grid)
    vertices, faces = traced(offset, grid, values, crossings, cells, report)
    announce_lost(offset, grid, vertices)
    report(1.0, "faces")
    return TriangleMesh(vertices, faces)


def traced(
    offset: ImplicitSurface, grid: Grid, values: NodeValues, crossings: Crossings, cells: DualCells, report: Progress
) -> tuple[Floats, Ints]:
    """Vertices and faces of a surface, from the edges of a grid that it crosses and its pieces in cells."""
    report(0.4, "edges")
    nodes, axes = crossings.nodes, crossings.axes
    guesses = nodes.astype(np.float64)
    guesses[np.arange(len(nodes)), axes] += np.clip(crossings.shares, CLEARANCE, 1 - CLEARANCE)
    points = on_level(offset.distance, grid.origin + guesses * grid.spacing, values, grid, 0.0)
    shares = ((points - grid.origin) / grid.spacing - nodes)[np.arange(len(nodes)), axes]
    report(0.6, "vertices")
    choices = placed(offset, grid, cells, points)
    report(0.9, "faces")
    crossings = replace(crossings, shares=np.clip(shares, CLEARANCE, 1 - CLEARANCE))
    vertices, faces = separate_triangles(cells, crossings, choices)
    return divided_along_creases(offset, grid.spacing, grid.origin + vertices * grid.spacing, faces)


def announce_lost(offset: Offset, grid: Grid, vertices: Floats) -> None:
    """Warn where the contour of a surface, with (n, 3) vertices, misses whole parts of it or a share of its area."""
    parts, lost = _lost(offset, grid, vertices)
    n_parts = len(np.unique(parts))
    gone = n_parts - len(np.unique(parts[~lost]))
    if gone == 0 and lost.sum() <= LOST * len(lost):
        return
    missing = f"{gone} of {n_parts} parts" if gone else f"{lost.mean():.0%} of the surface"
    remedy = "make the cells smaller, or keep the faces" if offset.level == 0 else "make the cells smaller"
    warn_user(f"cells of {grid.spacing.max():.3g} are too large for {missing}, lost here: {remedy}", InexactWarning)


def _lost(offset: Offset, grid: Grid, vertices: Floats) -> tuple[Ints, Bools]:
    """Parts of a solid that places on a surface belong to, and which places have no vertex of its contour nearby."""
    features = offset.solid.tree.features
    moved = callable(offset.reach) or offset.reach != 0
    faces = np.arange(len(features.faces)) if moved else np.flatnonzero(offset.solid.bounding[features.ids])
    if not len(faces):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    parts = element_components(features.faces[faces].astype(np.int64))
    chosen, bases = sampled(Pieces(features.corners[faces].reshape(-1, 3, 3), parts), SAMPLED)
    reach = offset.reach(bases) if callable(offset.reach) else np.full(len(bases), offset.reach)
    moves = reach[:, None] * features.face_normals[faces[chosen]]
    places, parts = np.concatenate([bases + moves, bases - moves]), np.tile(parts[chosen], 2)
    cells = np.floor((places - grid.origin) / grid.spacing).astype(np.int64)
    on_surface = ((cells >= 0) & (cells < np.array(grid.shape) - 1)).all(axis=1)
    if moved:
        on_surface &= np.abs(offset.distance(places)) < 1e-3 * float(grid.spacing.min())
    size = np.array(grid.shape) + 2
    filled = np.floor((vertices - grid.origin) / grid.spacing).astype(np.int64) + 1
    around = (cells[on_surface, None] + AROUND + 1).reshape(-1, 3)
    near = np.isin(*(np.ravel_multi_index(tuple(places.T), size, "clip") for places in (around, filled)))
    lost = np.asarray(~near.reshape(-1, len(AROUND)).any(axis=1))
    return parts[on_surface], lost


def _crossed(offset: Offset, grid: Grid) -> tuple[BlockValues, Crossings, DualCells]:
    """Heights near a surface, the edges that it crosses, and its pieces in cells; blocks it goes on into are added."""
    places = blocks_at(offset, grid)
    done = BlockValues(Blocks.of(places[:0], grid.shape), np.empty((0, SIDE, SIDE, SIDE), dtype=np.float32))
    while True:
        new = block_heights(offset, grid, Blocks.of(places, grid.shape))
        both = Blocks.of(np.concatenate([done.blocks.places, new.blocks.places]), grid.shape)
        merged = np.empty((len(both), SIDE, SIDE, SIDE), dtype=np.float32)
        for part in (done, new):
            merged[both.rows(part.blocks.places)] = part.values
        done = BlockValues(both, merged)
        crossings = crossed_edges(done)
        cells, edges, _, _ = cells_around(crossings, grid.shape)
        around = cells[open_cells(edges)][:, None] + np.array(list(np.ndindex(2, 2, 2)))
        places = np.unique(around.reshape(-1, 3) // SIDE, axis=0)
        places = places[both.rows(places) < 0]
        if not len(places):
            break
    found = dual_cells(crossings, grid.shape, lambda at: offset.distance(grid.origin + at * grid.spacing) < 0)
    return done, crossings, found


def blocks_at(offset: Offset, grid: Grid) -> Ints:
    """(n, 3) places of the blocks of a grid with nodes near a surface, found from coarse to fine.

    Heights change by no more than one goes, so that the one at the middle of a block says how near the surface is.
    """
    diagonal = (1.0 if offset.level is not None else STEEPEST) * float(np.linalg.norm(grid.spacing))
    halves = []

    def near(centres: Floats, half: float) -> Bools:
        halves.append(half)
        return np.abs(offset.distance(centres)) <= (half + 1.0) * diagonal

    free = available_memory()
    limit = math.inf if free is None else max(free - libraries(), 0) / BYTES_PER_BLOCK
    found = blocks_where(grid, near, limit)
    if len(found) > limit:
        cell, larger = (
            float(grid.spacing.max()),
            3 * (2 * halves[-1] + 1) / SIDE,
        )  # cubes twice as large were few enough
        raise MemoryLimitError(
            f"a surface in cells of {cell:.3g} needs more than the {(free or 0) / 1e9:.2g} GB that are free",
            remedy=f"use cells of {larger * cell:.3g}",
        )
    if not len(found):
        raise OutsideError(f"the distance takes {offset.named} nowhere on the grid", remedy="choose another level")
    return found


def crossed_edges(band: BlockValues) -> Crossings:
    """Edges whose ends lie on both sides of a surface, and where, by linear interpolation."""
    parts = []
    for window in np.unique(band.blocks.places // WINDOW, axis=0).astype(np.int64):
        first, size = window * WINDOW * SIDE, WINDOW * SIDE
        parts += crossings_in(band.window(first, (size + 1,) * 3).astype(np.float64), first)
    return joined_crossings(parts)


def crossings_in(heights: Floats, first: Ints) -> list[Crossings]:
    """Crossed edges between the nodes of a window of a grid that begins at a node, along each axis."""
    below, held, found = heights < 0, ~np.isnan(heights), []
    for axis in range(3):
        ahead = tuple(slice(1, None) if k == axis else slice(0, -1) for k in range(3))
        here = (slice(0, -1),) * 3
        nodes = np.argwhere((below[here] != below[ahead]) & held[here] & held[ahead])
        low, high = heights[here][tuple(nodes.T)], heights[ahead][tuple(nodes.T)]
        found.append(Crossings(first + nodes, np.full(len(nodes), axis), low < 0, low / (low - high)))
    return found


def joined_crossings(parts: Sequence[Crossings]) -> Crossings:
    """Those of several windows and axes."""
    if not any(len(part.axes) for part in parts):
        raise OutsideError(
            "the distance takes the level nowhere between the nodes of the grid",
            remedy="choose another level, or smaller cells if the shape is thinner than they are",
        )
    names = ("nodes", "axes", "rising", "shares")
    return Crossings(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
