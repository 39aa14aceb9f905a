"""Offsets of solids as closed surfaces with sharp edges: dual contouring with exact distances.

Vertices lie within cells of a grid, not on its edges, where the planes of the surface meet (Ju, Losasso, Schaefer &
Warren 2002). Each connected piece of it within a cell has one (Schaefer, Ju & Warren 2007), and triangles do not pass
through each other (Ju & Udeshi 2006). Only blocks of the grid through which the level passes are computed.

Vertices minimise quadratic error functions within boxes: around a centre m the error is
``E(y) = Σ (nᵢ · (y − pᵢ))² = yᵀ A y − 2 bᵀ y + c``, with ``A = Σ nᵢ nᵢᵀ`` and ``b = Σ nᵢ (nᵢ · pᵢ)``. Along directions
in which the planes hardly turn, where A has small eigenvalues, the minimum stays at m (Lindstrom 2000).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, mask_of
from ..diagnostics import SMALL_SHARE
from ..errors import InexactWarning, MemoryLimitError, OutsideError, percent, warn_user
from ..grids.blocks import BLOCK, WINDOW, Blocks, BlockValues
from ..grids.exact_levels import ON_LEVEL, NodeValues, on_level
from ..grids.grid import Grid
from ..jobs import report
from ..memory import available_memory, libraries, refuse_beyond_memory
from ..mesh.components import element_components, places_among, sums_of
from ..mesh.dual_cells import (
    CrossedCells,
    Crossings,
    DualCells,
    crossed_cells,
    crossings_in,
    dual_cells,
    open_cells,
    separate_triangles,
)
from ..mesh.edges import CLEARANCE
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import MOST_CREASED_FACES, bent_edges, divided_at
from ..parallel import PointTree, in_threads
from ..surfaces.triangle_mesh import TriangleMesh
from .gauss import Pieces, sampled
from .offsets import Offset
from .tiles import blocks_where, prepared, solved, tiles_of

CREASE_TANGENT = 0.05
"""Two planes make no crease if the tangent of half the angle between them is below this. Creases of 5.7° are cut off by
a hundredth of a cell at most. With 0.2 creases of 20° are lost; with 0.01 facets of smooth surfaces become creases."""


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Quadratic error functions of n vertices, each a sum over planes: see the module."""

    products: Floats  # (n, 3, 3) matrices A
    sides: Floats  # (n, 3) vectors b

    @classmethod
    def of(cls, owners: Ints, places: Floats, normals: Floats, count: int) -> Quadrics:
        """Sum k planes by owner: (k,) `owners` from 0 to `count` − 1, and (k, 3) unit normals and points on the planes.

        Points are relative to the centre of their owner.
        """
        along = (normals * places).sum(axis=1)[:, None]
        products = sums_of(normals[:, :, None] * normals[:, None, :], owners, count)
        return cls(products, sums_of(normals * along, owners, count))

    def __add__(self, other: Quadrics) -> Quadrics:
        return Quadrics(self.products + other.products, self.sides + other.sides)

    def __getitem__(self, rows: Ints | slice) -> Quadrics:
        return Quadrics(self.products[rows], self.sides[rows])


def minimizers(quadrics: Quadrics, lower: Floats, upper: Floats) -> tuple[Floats, Ints]:
    """Return the (n, 3) points at which quadrics are least within boxes, and the (n,) ranks of their matrices A.

    A minimum outside of its box moves into it along the direction in which the error grows least, that of a crease. If
    it cannot, it is the minimum on the wall of the box that it is farthest beyond. `lower` and `upper` are (n, 3).
    """
    values, vectors = np.linalg.eigh(quadrics.products)
    least = CREASE_TANGENT**2 * np.maximum(values[:, 2], 1e-300)
    ranks = (values > least[:, None]).sum(axis=1)
    points = _solved(values, vectors, quadrics.sides, least)
    points += _way_into(points, vectors[:, :, 0], lower, upper) * (ranks > 1)[:, None]
    fixed, fixed_values = np.zeros(points.shape, dtype=bool), np.zeros_like(points)
    for _ in range(3):
        beyond = np.where(fixed, 0.0, np.maximum(lower - points, points - upper))
        axis = beyond.argmax(axis=1)
        rows = np.flatnonzero(beyond[np.arange(len(points)), axis] > 0)
        if not len(rows):
            break
        axis = axis[rows]
        fixed[rows, axis] = True
        fixed_values[rows, axis] = np.clip(points[rows, axis], lower[rows, axis], upper[rows, axis])
        free = ~fixed[rows]
        inner = quadrics.products[rows] * (free[:, :, None] & free[:, None, :])
        sides = (quadrics.sides[rows] - np.einsum("nij,nj->ni", quadrics.products[rows], fixed_values[rows])) * free
        points[rows] = _solved(*np.linalg.eigh(inner), sides, least[rows]) + fixed_values[rows]
    return np.clip(points, lower, upper), ranks


def _way_into(points: Floats, along: Floats, lower: Floats, upper: Floats) -> Floats:
    """(n, 3) shortest moves of points along (n, 3) directions into their boxes; 0 where the line misses its box."""
    slow = np.where(np.abs(along) > 1e-12, along, 1e-12)
    first, second = (lower - points) / slow, (upper - points) / slow
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    move = np.where(enter <= leave, np.clip(0.0, enter, np.maximum(enter, leave)), 0.0)
    return move[:, None] * along


def _solved(values: Floats, vectors: Floats, sides: Floats, least: Floats) -> Floats:
    """(n, 3) solutions of A x = b, by eigenvalues and eigenvectors of A, leaving out eigenvalues of at most `least`."""
    inverse = np.where(values > least[:, None], 1.0 / np.where(values > least[:, None], values, 1.0), 0.0)
    return np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, sides, optimize=True)


CELLS_AT_ONCE = 1 << 16
"""Batch size for cells that the surface passes through."""
OUTSIDE_CELL = 0.6
"""Distance, in cells, by which a vertex may leave its cell."""
VERTEX_SPACING = 0.2
"""Vertices that would leave their cells stay inside if another vertex is closer than this, in cells."""
CHORD_ERROR = 0.02
"""An edge along a crease is divided if its midpoint is farther than this from the surface, in cells."""
DIVISIONS = 6
"""Number of rounds in which edges are divided: the largest error on a bracket is 0.08 cells with three, 0.05 with 6."""
CROSS_REACH = 4.0
"""Triangles within this distance of new vertices, in cells, are checked for intersections."""
PROBE_OFFSETS = np.array(list(np.ndindex(2, 2, 2))) - 0.5
"""Offsets, in cells, of the points around a vertex on a crease at which further planes are looked for."""
PROBE_SHARES = 0.1, 0.3, 0.6
"""Points at which planes beside an edge are looked for, as shares of the way from its middle to the opposite corner."""


class ImplicitSurface(Protocol):
    """The zero set of a function of (n, 3) points that grows outwards."""

    def distance(self, points: Floats, /) -> Floats:
        """(n,) values, negative inside."""

    def slopes(self, points: Floats, /) -> tuple[Floats, Floats]:
        """(n,) distances from the surface, negative inside, and (n, 3) unit vectors along which they grow."""

    def planes(self, points: Floats, /) -> tuple[Floats, Floats]:
        """(n, 3) points on the surface near given ones, and (n, 3) unit normals there."""


def placed(offset: ImplicitSurface, grid: Grid, cells: DualCells, points: Floats) -> Floats:
    """Return (3, v, 3) candidates for the vertex of each piece of the surface in a cell, as positions in cells.

    They are the best one, the best inside the cell, and the middle of the piece. `points` are the (e, 3) points at
    which the surface crosses edges of the grid.
    """
    count = len(cells.owners)
    vertices, middles, wider = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    alone = np.bincount(cells.owners)[cells.owners] == 1
    for begin in range(0, len(cells.places), CELLS_AT_ONCE):  # in one thread: functions may be a caller's
        edges, pieces = (part[begin : begin + CELLS_AT_ONCE] for part in (cells.edges, cells.pieces))
        first, stop = np.searchsorted(cells.owners, [begin, begin + CELLS_AT_ONCE])
        used, crossed = np.unique(edges[edges >= 0], return_inverse=True)  # each edge is in four cells
        piece_cells, owners = cells.places[cells.owners[first:stop]], pieces[edges >= 0] - first
        parts = _vertices(offset, grid, piece_cells, alone[first:stop], owners, crossed, points[used])
        for whole, part in zip((vertices, middles, wider), parts, strict=True):
            whole[first:stop] = (part - grid.origin) / grid.spacing
    chosen = _apart(cells, vertices, wider)
    return np.stack([np.where(chosen[:, None], wider, vertices), vertices, middles])


def _apart(cells: DualCells, vertices: Floats, wider: Floats) -> Bools:
    """(v,) which vertices may use their `wider` position, (v, 3) in cells, which may be NaN or outside of their cell.

    Of positions outside of cells that are close together, only that which moved least is used.
    """
    away = np.where(np.isnan(wider[:, 0]), np.inf, np.linalg.norm(wider - vertices, axis=1))
    in_cell: Bools = (np.floor(wider) == cells.places[cells.owners]).all(axis=1)
    rows = np.flatnonzero(np.isfinite(away) & ~in_cell)
    if len(rows):
        rows = rows[np.argsort(away[rows], kind="stable")]
        settled = np.where(in_cell[:, None], wider, vertices)
        near = PointTree(settled).query_ball_point(wider[rows], VERTEX_SPACING)
        rows = rows[[set(others) <= {row} for row, others in zip(rows, near, strict=True)]]
        first, second = PointTree(wider[rows]).query_pairs(VERTEX_SPACING, output_type="ndarray").T
        in_cell[np.delete(rows, np.maximum(first, second))] = True
    return in_cell


def _vertices(
    offset: ImplicitSurface,
    grid: Grid,
    cells: NDArray[np.int32],
    alone: Bools,
    owners: Ints,
    crossed: Ints,
    points: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Return (p, 3) vertices of pieces of the surface in their cells, middles of pieces, and wider candidates or NaN.

    `cells` are the (p, 3) cells of pieces, and `alone` tells whether a piece has its cell alone. A crease or a corner
    may lie just outside of the cell whose edges show its planes: wider candidates lie up to `OUTSIDE_CELL` outside. The
    surface crosses edge `crossed[i]` in piece `owners[i]`, and edge e at `points[e]`.
    """
    count = len(cells)
    step = float(grid.spacing.max())
    corners = grid.origin + cells * grid.spacing
    room = CLEARANCE * grid.spacing
    # each vertex minimises the squared distances from the planes at the crossed edges; positions are from the middles
    lower, upper = corners + room, corners + grid.spacing - room
    middles = np.clip(
        sums_of(points[crossed], owners, count) / np.bincount(owners, minlength=count)[:, None], lower, upper
    )
    lower, upper = lower - middles, upper - middles
    feet, normals = (values[crossed] for values in offset.planes(points))
    quadrics = Quadrics.of(owners, feet - middles[owners], normals, count)
    minima, ranks = minimizers(quadrics, lower, upper)
    off, gradients = offset.slopes(middles + minima)
    wider = np.full((count, 3), np.nan)
    creased = np.flatnonzero((ranks > 1) & alone)
    if len(creased):
        room = OUTSIDE_CELL * grid.spacing
        farther, farther_ranks = _probed_minima(
            offset,
            grid,
            middles[creased],
            minima[creased],
            quadrics[creased],
            lower[creased] - room,
            upper[creased] + room,
        )
        error = np.abs(offset.distance(middles[creased] + farther))
        # if they lie on the surface, and on more of its planes, on a corner, or where the first minimum does not
        better = (error < ON_LEVEL * step) & (
            (farther_ranks > ranks[creased]) | (farther_ranks == 3) | (np.abs(off[creased]) > ON_LEVEL * step)
        )
        wider[creased[better]] = middles[creased[better]] + farther[better]
    far = np.flatnonzero(np.abs(off) > ON_LEVEL * step)
    for later_steps in (1, 0):  # of Newton's method towards the surface
        minima[far] = np.clip(minima[far] - off[far, None] * gradients[far], lower[far], upper[far])
        if later_steps:
            off[far], gradients[far] = offset.slopes(middles[far] + minima[far])
            far = far[np.abs(off[far]) > ON_LEVEL * step]
    return middles + minima, middles, wider


def _probed_minima(
    offset: ImplicitSurface,
    grid: Grid,
    middles: Floats,
    minima: Floats,
    quadrics: Quadrics,
    lower: Floats,
    upper: Floats,
) -> tuple[Floats, Ints]:
    """Return the (n, 3) minima of n quadrics, and ranks, with more planes: those near points around present minima.

    So planes of a crease count that cross no edge of the cell. Positions of `minima`, of the box from `lower` to
    `upper`, and of the result are relative to `middles`; all are (n, 3).
    """
    probes = ((middles + minima)[:, None] + PROBE_OFFSETS * grid.spacing).reshape(-1, 3)
    feet, normals = offset.planes(probes)
    owners = np.repeat(np.arange(len(minima)), len(PROBE_OFFSETS))
    feet -= middles[owners]
    within = ((feet > lower[owners]) & (feet < upper[owners])).all(axis=1)
    more = Quadrics.of(owners[within], feet[within], normals[within], len(minima))
    return minimizers(quadrics + more, lower, upper)


def divided_along_creases(
    offset: ImplicitSurface, spacing: Floats, vertices: Floats, faces: Ints
) -> tuple[Floats, Ints]:
    """Divide edges that cut off a crease of `offset` at points on the crease, unless triangles would intersect.

    Return the (n, 3) vertices and (m, 3) faces of the divided mesh, with the given vertices first. `spacing`, (3,), is
    that of the grid on which the mesh was contoured.
    """
    new = np.ones(len(faces), dtype=bool)  # faces whose edges are still to be looked at
    for _ in range(DIVISIONS if len(faces) <= MOST_CREASED_FACES else 0):
        edges, points = _creases_off(offset, spacing, vertices, faces, new)
        if not len(edges):
            break
        away, _ = PointTree(points).query(vertices, distance_upper_bound=CROSS_REACH * float(spacing.max()))
        divided, divided_faces = _divided(vertices, faces, edges, points)
        new = asked = np.any(divided_faces >= len(vertices), axis=1)
        while len(edges):
            near = np.flatnonzero(
                np.append(np.isfinite(away), np.ones(len(points), dtype=bool))[divided_faces].any(axis=1)
            )
            meeting = near[self_intersections(divided, divided_faces[near], asked[near])]
            meeting = meeting[new[meeting].any(axis=1)]
            if not len(meeting):
                break
            wrong = mask_of(len(divided), divided_faces[meeting])[len(vertices) :]
            whole = mask_of(len(faces), edges[wrong] // 3)  # faces that are not divided after all
            edges, points = edges[~wrong], points[~wrong]
            divided, divided_faces = _divided(vertices, faces, edges, points)
            new = np.any(divided_faces >= len(vertices), axis=1)
            # the others were checked before
            asked = np.append(np.delete(whole, edges // 3), np.zeros(int(new.sum()), dtype=bool))
        if not len(edges):
            break
        vertices, faces = divided, divided_faces
    return vertices, faces


def _creases_off(
    offset: ImplicitSurface, spacing: Floats, vertices: Floats, faces: Ints, new: Bools
) -> tuple[Ints, Floats]:
    """Find bent edges that are off the surface: their (k, 2) halfedges, and (k, 3) points on the surface near them.

    Only edges of faces that are `new`, (m,), are checked. No two of the edges share a face.
    """
    step = float(spacing.max())
    near = np.flatnonzero(mask_of(len(vertices), faces[new])[faces].any(axis=1))
    # half of the angle at which planes count as one, since it is small where a corner is missing
    _, _, edges = bent_edges(vertices, faces[near], np.arctan(CREASE_TANGENT))
    edges = 3 * near[edges // 3] + edges % 3
    edges = edges[new[edges // 3].any(axis=1)]
    tails, heads = faces.ravel()[edges[:, 0]], faces.ravel()[edges[:, 1]]
    middles = 0.5 * (vertices[tails] + vertices[heads])
    heights = np.abs(offset.distance(middles))
    rows = np.flatnonzero(heights > CHORD_ERROR * step)
    rows = rows[np.argsort(-heights[rows], kind="stable")]
    edges, middles = edges[rows], middles[rows]
    # the point nearest to the planes of the surface around the edge is on the crease; failing that, one on the surface
    apexes = vertices[faces[edges // 3, (edges + 2) % 3]]
    probes = [middles + share * (apexes[:, side] - middles) for share in PROBE_SHARES for side in range(2)]
    feet, normals = offset.planes(np.concatenate(probes))
    owners = np.tile(np.arange(len(edges)), len(probes))
    room = np.broadcast_to(OUTSIDE_CELL * spacing, middles.shape)
    moves, _ = minimizers(Quadrics.of(owners, feet - middles[owners], normals, len(edges)), -room, room)
    distances, gradients = offset.slopes(middles)
    points, nearest = middles + moves, middles - distances[:, None] * gradients
    points = np.where((np.abs(offset.distance(points)) < ON_LEVEL * step)[:, None], points, nearest)
    # of edges that share a face, only the one farthest from the surface is returned
    first = np.full(len(faces), len(edges))
    np.minimum.at(first, edges // 3, np.arange(len(edges))[:, None])
    is_first = (first[edges // 3] == np.arange(len(edges))[:, None]).all(axis=1)
    return edges[is_first], points[is_first]


def _divided(vertices: Floats, faces: Ints, edges: Ints, points: Floats) -> tuple[Floats, Ints]:
    """Insert (k, 3) points on edges, given by (k, 2) halfedges, and divide the faces on both sides of each."""
    rows, corners = edges.ravel() // 3, edges.ravel() % 3
    new = np.repeat(len(vertices) + np.arange(len(edges)), 2)
    return np.concatenate([vertices, points]), divided_at(faces, rows, corners, new)


BYTES_PER_BLOCK, BYTES_PER_CROSSING = 15_000, 1_200
"""Measured peak memory of a contour: per block of the grid near it, until the crossed edges are known, and afterwards
per crossed edge. Smooth surfaces take a third of the first, and a half of the second if they have more faces than
`MOST_CREASED_FACES`."""
TOUCHING_CELLS = np.array(list(np.ndindex(3, 3, 3))) - 1
"""(27, 3) offsets of a cell and of those that touch it."""
IN_BLOCK = np.array(list(np.ndindex(BLOCK, BLOCK, BLOCK)))
"""(512, 3) offsets of the nodes of a block."""
CONTOUR_POINTS = 4096
"""Number of points on a surface near which vertices of its contour are looked for, besides one for each part."""
STEEPEST_HEIGHT = 2.0
"""Blocks near a surface are found from coarse to fine as if heights above it had this slope at most. Distance has slope
1; where a varying distance is steeper, blocks are found by following the surface."""


def block_heights(offset: Offset, grid: Grid, blocks: Blocks) -> BlockValues:
    """Compute heights above a surface at the nodes of blocks, in several threads; NaN beyond the grid."""
    tree, windings = prepared(offset.solid)
    values = np.empty((len(blocks), BLOCK, BLOCK, BLOCK), dtype=np.float32)
    level = offset.level

    def solve(rows: Ints) -> Ints:
        """Write the heights at the nodes of the blocks with these row numbers; return them."""
        indices = blocks.places[rows].astype(np.int64)
        if level is not None:
            values[rows] = solved(tree, windings, grid, indices)[0].astype(np.float64) - level
            return rows
        nodes = (BLOCK * indices[:, None] + IN_BLOCK).reshape(-1, 3)
        heights = offset.distance(grid.origin + nodes * grid.spacing)
        heights[(nodes >= grid.shape).any(axis=1)] = np.nan
        values[rows] = heights.reshape(-1, BLOCK, BLOCK, BLOCK)
        return rows

    for _ in (map if callable(offset.reach) else in_threads)(solve, tiles_of(blocks)):  # a caller's stays in its thread
        pass
    return BlockValues(blocks, values)


def sharp_surface(offset: Offset, grid: Grid, heights: Floats | None = None) -> TriangleMesh:
    """Extract the closed, manifold surface at a distance from a solid, with sharp edges and corners.

    `heights` are those above the surface at all nodes, (nx, ny, nz); by default they are computed near it only.
    """
    values: NodeValues
    if heights is None:
        values, crossings, around = _crossed_near(offset, grid)
    else:
        values, (crossings, around) = heights, crossed_between(heights, grid)
    vertices, faces = traced(offset, grid, values, crossings, around)
    announce_lost(offset, grid, vertices)
    report(1.0, "faces")
    return TriangleMesh(vertices, faces)


def traced(
    offset: ImplicitSurface, grid: Grid, values: NodeValues, crossings: Crossings, around: CrossedCells
) -> tuple[Floats, Ints]:
    """Return (n, 3) vertices and (m, 3) faces of a surface, given the grid edges that it crosses and the cells around.

    `values` are heights above the surface at nodes.
    """

    def inside(nodes: Floats) -> Bools:
        """(k,) whether (k, 3) positions, in cells, are inside the surface."""
        return offset.distance(grid.origin + nodes * grid.spacing) < 0

    cells = dual_cells(crossings, around, grid.shape, inside)
    report(0.4, "edges")
    nodes, axes = crossings.nodes, crossings.axes
    guesses = nodes.astype(np.float64)
    guesses[np.arange(len(nodes)), axes] += np.clip(crossings.shares, CLEARANCE, 1 - CLEARANCE)
    points = on_level(offset.distance, guesses, values, grid.origin, grid.spacing, 0.0)
    shares = ((points - grid.origin) / grid.spacing - nodes)[np.arange(len(nodes)), axes]
    report(0.6, "vertices")
    choices = placed(offset, grid, cells, points)
    report(0.9, "faces")
    crossings = replace(crossings, shares=np.clip(shares, CLEARANCE, 1 - CLEARANCE))
    vertices, faces = separate_triangles(cells, crossings, choices)
    return divided_along_creases(offset, grid.spacing, grid.origin + vertices * grid.spacing, faces)


def announce_lost(offset: Offset, grid: Grid, vertices: Floats) -> None:
    """Warn if the contour of a surface, with (n, 3) vertices, misses whole parts of it or much of its area."""
    parts, lost = _lost(offset, grid, vertices)
    n_parts = len(np.unique(parts))
    gone = n_parts - len(np.unique(parts[~lost]))
    if gone == 0 and lost.sum() <= SMALL_SHARE * len(lost):  # most parts have edges and tips thinner than a cell
        return
    missing = f"{gone} of {n_parts} parts" if gone else f"{percent(lost.mean())} of the surface"
    remedy = "make the cells smaller, or keep the faces" if offset.level == 0 else "make the cells smaller"
    warn_user(f"cells of {grid.spacing.max():.3g} are too large for {missing}, lost here: {remedy}", InexactWarning)


def _lost(offset: Offset, grid: Grid, vertices: Floats) -> tuple[Ints, Bools]:
    """Sample a surface: (n,) part of the solid at each sample, and (n,) whether no vertex of the contour is near."""
    features = offset.solid.tree.features
    moved = callable(offset.reach) or offset.reach != 0
    faces = np.arange(len(features.faces)) if moved else np.flatnonzero(offset.solid.bounding[features.ids])
    if not len(faces):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    parts = element_components(features.faces[faces].astype(np.int64))
    chosen, bases = sampled(Pieces(features.corners[faces].reshape(-1, 3, 3), parts), CONTOUR_POINTS)
    reach = offset.reach(bases) if callable(offset.reach) else np.full(len(bases), offset.reach)
    moves = reach[:, None] * features.face_normals[faces[chosen]]
    on_offset, parts = np.concatenate([bases + moves, bases - moves]), np.tile(parts[chosen], 2)
    cells = np.floor((on_offset - grid.origin) / grid.spacing).astype(np.int64)
    on_surface = ((cells >= 0) & (cells < np.array(grid.shape) - 1)).all(axis=1)
    if moved:
        on_surface &= np.abs(offset.distance(on_offset)) < 1e-3 * float(grid.spacing.min())
    size = np.array(grid.shape) + 2
    filled = np.floor((vertices - grid.origin) / grid.spacing).astype(np.int64) + 1
    around = (cells[on_surface, None] + TOUCHING_CELLS + 1).reshape(-1, 3)
    keys, occupied = (np.ravel_multi_index(tuple(indices.T), size, "clip") for indices in (around, filled))
    near = places_among(np.sort(occupied), keys) >= 0
    lost = np.asarray(~near.reshape(-1, len(TOUCHING_CELLS)).any(axis=1))
    return parts[on_surface], lost


def _crossed_near(offset: Offset, grid: Grid) -> tuple[BlockValues, Crossings, CrossedCells]:
    """Compute heights near a surface, the edges that it crosses and the cells around, adding blocks as needed."""
    indices = blocks_at(offset, grid)
    done = BlockValues(Blocks.of(indices[:0], grid.shape), np.empty((0, BLOCK, BLOCK, BLOCK), dtype=np.float32))
    while len(indices):
        new = block_heights(offset, grid, Blocks.of(indices, grid.shape))
        both = Blocks.of(np.concatenate([done.blocks.places, new.blocks.places]), grid.shape)
        merged = np.empty((len(both), BLOCK, BLOCK, BLOCK), dtype=np.float32)
        for part in (done, new):
            merged[both.rows(part.blocks.places)] = part.values
        done = BlockValues(both, merged)
        crossings = crossed_edges(done)
        refuse_large_contour(crossings, grid)
        cells = crossed_cells(crossings, grid.shape)
        around = cells.places[open_cells(cells.edges)][:, None] + np.array(list(np.ndindex(2, 2, 2)))
        indices = np.unique(around.reshape(-1, 3) // BLOCK, axis=0)
        indices = indices[both.rows(indices) < 0]
    return done, crossings, cells


def crossed_between(heights: Floats, grid: Grid) -> tuple[Crossings, CrossedCells]:
    """Find the grid edges between nodes above and below a surface, and the cells around them, from all heights."""
    side = WINDOW * BLOCK
    parts: list[Crossings] = []
    for window in np.ndindex(*(-(-(n - 1) // side) for n in heights.shape)):  # in the order of `crossed_edges`
        first = side * np.array(window)
        parts.append(crossings_in(heights[tuple(slice(begin, begin + side + 1) for begin in first)], first))
    crossings = joined_crossings(parts)
    refuse_large_contour(crossings, grid)
    return crossings, crossed_cells(crossings, grid.shape)


def refuse_large_contour(crossings: Crossings, grid: Grid) -> None:
    """Raise `MemoryLimitError` if the contour across these edges does not fit."""
    cell, count = float(grid.spacing.max()), len(crossings.axes)
    refuse_beyond_memory(
        f"a surface in cells of {cell:.3g}",
        count,
        lambda edges: BYTES_PER_CROSSING * edges,
        lambda edges: f"use a spacing of {cell * math.sqrt(count / max(edges, 1)):.3g}",
    )


def blocks_at(offset: Offset, grid: Grid) -> Ints:
    """Find the (n, 3) blocks of a grid near a surface, by the largest slope that heights may have; raise if none is."""
    diagonal = (1.0 if offset.level is not None else STEEPEST_HEIGHT) * float(np.linalg.norm(grid.spacing))

    def near(centres: Floats, half: float) -> Bools:
        """(k,) whether cubes of the grid with (k, 3) centres may contain a part of the surface."""
        return np.abs(offset.distance(centres)) <= (half + 1.0) * diagonal

    free = available_memory()
    indices, times = blocks_where(
        grid, near, math.inf if free is None else max(free - libraries(), 0) / BYTES_PER_BLOCK
    )
    if times > 1:
        cell = float(grid.spacing.max())
        raise MemoryLimitError(
            f"a surface in cells of {cell:.3g} needs more than the {(free or 0) / 1e9:.2g} GB that are free",
            remedy=f"use a spacing of {1.5 * times * cell:.3g}",
        )
    if not len(indices):
        raise OutsideError(f"the distance reaches {offset.named} nowhere on the grid", remedy="choose another level")
    return indices


def crossed_edges(band: BlockValues) -> Crossings:
    """Find the grid edges whose ends lie on both sides of a surface, and where it crosses them, by interpolation."""
    parts = []
    for window in np.unique(band.blocks.places // WINDOW, axis=0).astype(np.int64):
        first, size = window * WINDOW * BLOCK, WINDOW * BLOCK
        parts.append(crossings_in(band.window(first, (size + 1,) * 3), first))
    return joined_crossings(parts)


def joined_crossings(parts: Sequence[Crossings]) -> Crossings:
    """Join the crossings of several windows; raise `OutsideError` if there are none at all."""
    if not any(len(part.axes) for part in parts):
        raise OutsideError(
            "the distance reaches the level nowhere between the nodes of the grid",
            remedy="choose another level, or smaller cells if the shape is thinner than they are",
        )
    return Crossings.joined(parts)
