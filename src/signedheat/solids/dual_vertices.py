"""Vertices of dual contouring, where tangent planes of the surface meet in a cell.

They minimise quadratic error functions within boxes: around a centre m the error is
``E(y) = Σ (nᵢ · (y − pᵢ))² = yᵀ A y − 2 bᵀ y + c`` (Ju, Losasso, Schaefer & Warren 2002, Eq. 1), with ``A = Σ nᵢ nᵢᵀ``
and ``b = Σ nᵢ (nᵢ · pᵢ)``. Along directions in which the planes hardly turn, where A has small eigenvalues, the minimum
stays at m (Lindstrom 2000).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..grids.grid import Grid
from ..grids.marching import CLEARANCE
from ..mesh.components import sums_of
from ..mesh.dual_cells import DualCells
from ..mesh.edges import edge_table
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import MOST, area_vectors, divided_at
from ..mesh.unit_vectors import unit

FLAT = 0.05
"""Planes count as one if the tangent of half the angle between them is below this. Creases of 5.7° are cut off by a
hundredth of a cell at most. With .2 creases of 20° are lost; with .01 facets of smooth surfaces become creases."""


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Sums over planes, for each of n points."""

    products: Floats  # (n, 3, 3) A
    sides: Floats  # (n, 3) b

    @classmethod
    def of(cls, owners: Ints, places: Floats, normals: Floats, count: int) -> Quadrics:
        """Sum planes, each through a place, relative to the centre of its owner, with a normal of length 1."""
        along = (normals * places).sum(axis=1)[:, None]
        products = sums_of(normals[:, :, None] * normals[:, None, :], owners, count)
        return cls(products, sums_of(normals * along, owners, count))

    def __add__(self, other: Quadrics) -> Quadrics:
        return Quadrics(self.products + other.products, self.sides + other.sides)

    def __getitem__(self, rows: Ints | slice) -> Quadrics:
        return Quadrics(self.products[rows], self.sides[rows])


def minimizers(quadrics: Quadrics, lower: Floats, upper: Floats) -> tuple[Floats, Ints, Floats]:
    """(n, 3) points of least error of quadrics in boxes, how many directions planes fix, and the one fixed least.

    A minimum outside of its box moves along the direction in which the error grows the least, that of a crease, until
    it is in the box; or else it is looked for again on the wall that it is beyond the farthest, up to three times.
    The corners of boxes, and the points, are relative to the centres.

    Examples
    --------
    >>> normals = np.eye(3)
    >>> corner = Quadrics.of(np.zeros(3, dtype=int), np.full((3, 3), 0.2), normals, 1)
    >>> points, ranks, _ = minimizers(corner, np.full((1, 3), -1.0), np.array([[1.0, 1.0, 0.1]]))
    >>> points.round(3).tolist(), ranks.tolist()
    ([[0.2, 0.2, 0.1]], [3])
    """
    values, vectors = np.linalg.eigh(quadrics.products)
    least = FLAT**2 * np.maximum(values[:, 2], 1e-300)
    ranks = (values > least[:, None]).sum(axis=1)
    points = _solved(values, vectors, quadrics.sides, least)
    points += _way_into(points, vectors[:, :, 0], lower, upper) * (ranks > 1)[:, None]
    fixed, held = np.zeros(points.shape, dtype=bool), np.zeros_like(points)
    for _ in range(3):
        beyond = np.where(fixed, 0.0, np.maximum(lower - points, points - upper))
        axis = beyond.argmax(axis=1)
        rows = np.flatnonzero(beyond[np.arange(len(points)), axis] > 0)
        if not len(rows):
            break
        axis = axis[rows]
        fixed[rows, axis] = True
        held[rows, axis] = np.clip(points[rows, axis], lower[rows, axis], upper[rows, axis])
        free = ~fixed[rows]
        inner = quadrics.products[rows] * (free[:, :, None] & free[:, None, :])
        sides = (quadrics.sides[rows] - np.einsum("nij,nj->ni", quadrics.products[rows], held[rows])) * free
        points[rows] = _solved(*np.linalg.eigh(inner), sides, least[rows]) + held[rows]
    return np.clip(points, lower, upper), ranks, vectors[:, :, 0]


def _way_into(points: Floats, along: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return the shortest moves along directions into boxes; 0 where a line misses its box."""
    slow = np.where(np.abs(along) > 1e-12, along, 1e-12)
    first, second = (lower - points) / slow, (upper - points) / slow
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    way = np.where(enter <= leave, np.clip(0.0, enter, np.maximum(enter, leave)), 0.0)
    return way[:, None] * along


def _solved(values: Floats, vectors: Floats, sides: Floats, least: Floats) -> Floats:
    """A⁻¹ b without eigenvalues below `least`."""
    inverse = np.where(values > least[:, None], 1.0 / np.where(values > least[:, None], values, 1.0), 0.0)
    return np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, sides, optimize=True)


MANY = 1 << 17
"""Batch size for pieces of the level."""
ASIDE = 0.05
"""Distance from a crease, in cells, of probes for its ends."""
ON = 1e-3
"""Distance from the level, in cells, above which a vertex is moved onto it."""
BEYOND = 0.6
"""Distance, in cells, by which a vertex may leave its cell."""
APART = 0.2
"""Least distance, in cells, between vertices that have left their cells."""
BENT = np.deg2rad(5.0)
"""Angle between two faces above which their edge is checked; it is small where a corner is missing."""
CHORD = 0.02
"""Distance from the level, in cells, above which an edge along a crease is divided."""
DIVISIONS = 6
"""Rounds of division; the largest error on a bracket is .08 cells with three rounds, and .05 with six."""
NEAR = 4.0
"""Distance, in cells, within which triangles of a new vertex may intersect others."""
BETWEEN = 0.1, 0.3, 0.6
"""Positions of probes, as shares of the way from the middle of an edge to the opposite corner."""
AHEAD = 0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5
"""Distances along a crease, in cells, of probes for its ends."""


class ImplicitSurface(Protocol):
    """The zero set of a function of (n, 3) points that grows outwards."""

    def distance(self, points: Floats, /) -> Floats:
        """(n,) values, negative inside."""

    def slopes(self, points: Floats, /) -> tuple[Floats, Floats]:
        """(n,) distances from the surface, negative inside, and (n, 3) unit vectors along which they grow."""

    def planes(self, points: Floats, /) -> tuple[Floats, Floats]:
        """(n, 3) places on the surface near points, and its normals there."""


def placed(offset: ImplicitSurface, grid: Grid, cells: DualCells, points: Floats) -> Floats:
    """(3, v, 3) candidates for the vertex of each piece of a level: the best anywhere, in its cell, in its middle."""
    count = len(cells.owners)
    vertices, middles, wider = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    rows, sides = np.nonzero(cells.edges >= 0)
    pieces = cells.pieces[rows, sides]
    order = np.argsort(pieces, kind="stable")
    pieces, edges = pieces[order], cells.edges[rows, sides][order]
    alone = np.bincount(cells.owners)[cells.owners] == 1
    for begin in range(0, count, MANY):
        stop = min(begin + MANY, count)
        here = slice(*np.searchsorted(pieces, [begin, stop]))
        parts = _vertices(
            offset,
            grid,
            cells.places[cells.owners[begin:stop]],
            alone[begin:stop],
            pieces[here] - begin,
            points[edges[here]],
        )
        for whole, part in zip((vertices, middles, wider), parts, strict=True):
            whole[begin:stop] = (part - grid.origin) / grid.spacing
    taken = _apart(cells, vertices, wider)
    return np.stack([np.where(taken[:, None], wider, vertices), vertices, middles])


def _apart(cells: DualCells, vertices: Floats, wider: Floats) -> Bools:
    """(v,) whether to take the wider candidate: of those near each other, the one that moves the least."""
    away = np.where(np.isnan(wider[:, 0]), np.inf, np.linalg.norm(wider - vertices, axis=1))
    taken: Bools = (np.floor(wider) == cells.places[cells.owners]).all(axis=1)
    rows = np.flatnonzero(np.isfinite(away) & ~taken)
    if len(rows):
        rows = rows[np.argsort(away[rows], kind="stable")]
        settled = np.where(taken[:, None], wider, vertices)
        near = scipy.spatial.cKDTree(settled).query_ball_point(wider[rows], APART, workers=-1)
        rows = rows[[set(others) <= {row} for row, others in zip(rows, near, strict=True)]]
        first, second = scipy.spatial.cKDTree(wider[rows]).query_pairs(APART, output_type="ndarray").T
        taken[np.delete(rows, np.maximum(first, second))] = True
    return taken


def _vertices(
    offset: ImplicitSurface, grid: Grid, places: Ints, alone: Bools, owners: Ints, points: Floats
) -> tuple[Floats, Floats, Floats]:
    """Vertices of some pieces in their cells, their middles, and wider candidates up to `BEYOND` outside, or NaN."""
    count = len(places)
    step = float(grid.spacing.max())
    corners = grid.origin + places * grid.spacing
    room = CLEARANCE * grid.spacing
    lower, upper = corners + room, corners + grid.spacing - room
    middles = np.clip(sums_of(points, owners, count) / np.bincount(owners, minlength=count)[:, None], lower, upper)
    lower, upper = lower - middles, upper - middles
    on, normals = offset.planes(points)
    quadrics = Quadrics.of(owners, on - middles[owners], normals, count)
    found, ranks, along = minimizers(quadrics, lower, upper)
    off = offset.distance(middles + found)
    wider = np.full((count, 3), np.nan)
    creased = np.flatnonzero((ranks > 1) & alone)
    if len(creased):
        # find planes in a cell with a crease that do not cross its edges
        low, high = lower[creased] - BEYOND * grid.spacing, upper[creased] + BEYOND * grid.spacing
        probes = found[creased][:, None] + _probes(along[creased], quadrics.sides[creased], grid.spacing)
        on, normals = offset.planes((middles[creased][:, None] + probes).reshape(-1, 3))
        which = np.repeat(np.arange(len(creased)), probes.shape[1])
        on -= middles[creased][which]
        within = ((on > low[which]) & (on < high[which])).all(axis=1)
        more = Quadrics.of(which[within], on[within], normals[within], len(creased))
        farther, higher, _ = minimizers(quadrics[creased] + more, low, high)
        error = np.abs(offset.distance(middles[creased] + farther))
        wanted = (error < ON * step) & ((higher > ranks[creased]) | (higher == 3) | (np.abs(off[creased]) > ON * step))
        wider[creased[wanted]] = middles[creased[wanted]] + farther[wanted]
    for _ in range(2):
        off, gradients = offset.slopes(middles + found)
        onto = np.clip(found - off[:, None] * gradients, lower, upper)
        found = np.where((np.abs(off) > ON * step)[:, None], onto, found)
    return middles + found, middles, wider


def _probes(along: Floats, across: Floats, spacing: Floats) -> Floats:
    """(n, p, 3) offsets of probes from vertices on creases: around them, and on both sides along the crease."""
    around = np.broadcast_to(0.5 * spacing * (2 * np.array(list(np.ndindex(2, 2, 2))) - 1), (len(along), 8, 3))
    length = np.linalg.norm(across, axis=1)[:, None]
    aside = ASIDE * spacing * across / np.where(length > 0, length, 1.0)
    ahead = [way * share * spacing * along + sign * aside for share in AHEAD for way in (-1, 1) for sign in (-1, 1)]
    return np.concatenate([around, np.stack(ahead, axis=1)], axis=1)


def divided_along_creases(
    offset: ImplicitSurface, spacing: Floats, vertices: Floats, faces: Ints
) -> tuple[Floats, Ints]:
    """Divide bent edges that are off the level, with new vertices on the level, unless triangles would intersect.

    This restores creases through cells whose edges the level does not cross, and which thus have no vertex.
    """
    for _ in range(DIVISIONS if len(faces) <= MOST else 0):
        edges, points = _creases_off(offset, spacing, vertices, faces)
        while len(edges):
            found, made = _divided(vertices, faces, edges, points)
            away, _ = scipy.spatial.cKDTree(points).query(found, distance_upper_bound=NEAR * float(spacing.max()))
            near = made[np.isfinite(away)[made].any(axis=1)]  # the other triangles are unchanged
            meeting = near[self_intersections(found, near)]
            if not len(meeting):
                break
            wrong = np.unique(meeting[meeting >= len(vertices)]) - len(vertices)
            kept = np.delete(np.arange(len(edges)), wrong if len(wrong) else slice(None))
            edges, points = edges[kept], points[kept]
        if not len(edges):
            break
        vertices, faces = found, made
    return vertices, faces


def _creases_off(offset: ImplicitSurface, spacing: Floats, vertices: Floats, faces: Ints) -> tuple[Ints, Floats]:
    """(k, 2) halfedges of bent edges off the level, one per face, and (k, 3) places on creases or the level."""
    step = float(spacing.max())
    normals, edges = unit(area_vectors(vertices[faces])), edge_table(faces).pairs
    edges = edges[normals[edges // 3].prod(axis=1).sum(axis=1) < np.cos(BENT)]
    tails, heads = faces.ravel()[edges[:, 0]], faces.ravel()[edges[:, 1]]
    middles = 0.5 * (vertices[tails] + vertices[heads])
    off = np.abs(offset.distance(middles))
    rows = np.flatnonzero(off > CHORD * step)
    rows = rows[np.argsort(-off[rows], kind="stable")]
    edges, middles = edges[rows], middles[rows]
    across = vertices[faces[edges // 3, (edges + 2) % 3]]
    probes = [middles + share * (across[:, side] - middles) for share in BETWEEN for side in range(2)]
    on, directions = offset.planes(np.concatenate(probes))
    owners = np.tile(np.arange(len(edges)), len(probes))
    room = np.broadcast_to(BEYOND * spacing, middles.shape)
    moves, _, _ = minimizers(Quadrics.of(owners, on - middles[owners], directions, len(edges)), -room, room)
    off, gradients = offset.slopes(middles)
    points, nearest = middles + moves, middles - off[:, None] * gradients
    points = np.where((np.abs(offset.distance(points)) < ON * step)[:, None], points, nearest)
    first = np.full(len(faces), len(edges))
    np.minimum.at(first, edges // 3, np.arange(len(edges))[:, None])
    alone = (first[edges // 3] == np.arange(len(edges))[:, None]).all(axis=1)
    return edges[alone], points[alone]


def _divided(vertices: Floats, faces: Ints, edges: Ints, points: Floats) -> tuple[Floats, Ints]:
    """Insert a point on each of (k, 2) halfedges, and divide the faces on both sides."""
    rows, corners = edges.ravel() // 3, edges.ravel() % 3
    new = np.repeat(len(vertices) + np.arange(len(edges)), 2)
    return np.concatenate([vertices, points]), divided_at(faces, rows, corners, new)
