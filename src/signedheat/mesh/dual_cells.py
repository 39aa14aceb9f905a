"""Connectivity of dual contouring: the edges of a grid that a level set crosses, and its pieces within each cell.

Each connected piece of the level set within a cell gets a vertex, so that the surface is manifold (Nielson 2004,
Schaefer, Ju & Warren 2007). A piece is a cycle of crossed edges of the cell, each linked to the next through a face.
Where all four edges of a face are crossed, there are two ways to link them, and the sign at the middle of the face
decides. If both links then belong to one piece in both cells at the face, two vertices would have two edges between
them. In this case the other way is used, which divides the pieces (Wenger 2013, Sec. 3.2, does so by exchanging table
entries).

Axes b and c follow axis a cyclically. Edge ``4 a + 2 β + γ`` of a cell runs along a, from the cell's first node shifted
by β along b and γ along c. Face ``2 a + σ`` is the one across a, at the first node shifted by σ.

Around a crossed edge lie four vertices, one in each cell. The edge and two neighbouring vertices span a tetrahedron,
four in all. Tetrahedra of different edges do not overlap (Ju & Udeshi 2006, Sec. 4), so triangles within them do not
intersect those of other edges. On a regular grid the line between vertices of neighbouring cells always passes through
the face between them, so that no vertices on faces are needed. Where neither diagonal of the four vertices stays within
the tetrahedra, they are joined to the point where the edge is crossed. So the only triangles that may intersect others
are those with a vertex outside its cell or in a cell with several pieces, and those of flipped edges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..parallel import in_chunks
from .components import connected_components
from .self_intersections import self_intersections
from .triangles import flipped_along_creases

CELLS_AROUND = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
"""β and γ of an edge in the four cells around it, counter-clockwise as seen from the end of the edge."""
AXES_AFTER = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
"""Each axis, followed by the next two axes, cyclically."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """e edges of a grid that a level set crosses."""

    nodes: NDArray[np.integer]  # (e, 3) indices of the first node of each edge
    axes: NDArray[np.integer]  # (e,) the axis along which it runs, 0 to 2
    rising: Bools  # (e,) whether the first node is inside
    shares: Floats  # (e,) distance of the crossing from the first node, in cells

    @classmethod
    def joined(cls, parts: Sequence[Crossings]) -> Crossings:
        """Join the crossings of several windows or axes."""
        return cls(*(np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(cls)))


@dataclass(frozen=True, eq=False)
class DualCells:
    """c cells through which a level set passes, and its v pieces in them."""

    places: NDArray[np.int32]  # (c, 3) indices of the first node of each cell
    edges: NDArray[np.int32]  # (c, 12) number of each crossed edge; −1 where an edge is not crossed
    # (c, 12) the piece of the level set to which each crossed edge belongs; −1 where an edge is not crossed
    pieces: NDArray[np.int32]
    owners: NDArray[np.int32]  # (v,) the cell of each piece, ascending
    quads: NDArray[np.int32]  # (e, 4) the pieces around each crossed edge, counter-clockwise as seen from its end


class CrossedCells(NamedTuple):
    """c cells around e crossed edges."""

    places: NDArray[np.int32]  # (c, 3) indices of the first node of each cell
    edges: NDArray[np.int32]  # (c, 12) number of each crossed edge; −1 where an edge is not crossed
    rows: NDArray[np.int32]  # (e, 4) the cells around each crossed edge, counter-clockwise as seen from its end
    sides: NDArray[np.int8]  # (e, 4) index of the crossed edge among the 12 edges of each of these cells


def crossings_in(heights: NDArray[np.floating], first: Ints) -> Crossings:
    """Find the crossed edges between the nodes of a window of a grid.

    `heights` are values at its nodes, negative inside, and linear along edges. `first` are the indices of its first
    node in the grid, (3,). Edges with NaN at an end are not crossed.
    """
    below, held, parts = heights < 0, ~np.isnan(heights), []
    for axis in range(3):
        ahead = tuple(slice(1, None) if k == axis else slice(0, -1) for k in range(3))
        inner = (slice(0, -1),) * 3
        nodes = np.argwhere((below[inner] != below[ahead]) & held[inner] & held[ahead])
        low, high = (heights[ends][tuple(nodes.T)].astype(np.float64) for ends in (inner, ahead))
        axes = np.full(len(nodes), axis, dtype=np.int8)
        parts.append(Crossings((first + nodes).astype(np.int32), axes, low < 0, low / (low - high)))
    return Crossings.joined(parts)


def crossed_cells(crossings: Crossings, shape: tuple[int, ...]) -> CrossedCells:
    """Find the cells around crossed edges of a grid with `shape` nodes."""
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    back = strides[AXES_AFTER[:, 1:]] @ CELLS_AROUND.T
    cells, numbers = np.unique((crossings.nodes @ strides)[:, None] - back[crossings.axes], return_inverse=True)
    rows = numbers.reshape(-1, 4).astype(np.int32)
    sides = (4 * np.arange(3)[:, None] + CELLS_AROUND @ [2, 1]).astype(np.int8)[crossings.axes]
    edges = np.full((len(cells), 12), -1, dtype=np.int32)
    edges[rows, sides] = np.arange(len(rows))[:, None]
    positions = np.stack(np.unravel_index(cells, shape), axis=1, dtype=np.int32, casting="same_kind")
    return CrossedCells(positions, edges, rows, sides)


def dual_cells(
    crossings: Crossings, around: CrossedCells, shape: tuple[int, ...], inside: Callable[[Floats], Bools]
) -> DualCells:
    """Find the pieces of a level set in the cells around crossed edges of a grid with `shape` nodes.

    ``inside(points)`` returns (n,) bool, true where (n, 3) points, in coordinates of nodes, are inside.
    """
    positions, edges, rows, sides = around
    ways = np.zeros((len(positions), 6), dtype=np.bool_)  # to link crossed edges at each face: see `_pieces_of_cell`
    # ambiguous faces, with four crossed edges: the way is decided by whether the middle of the face is inside
    cells, faces = np.nonzero(_crossed_faces(edges) == 4)
    across, side = faces // 2, faces % 2
    first = positions[cells]
    first[np.arange(len(cells)), across] += side
    keys = np.ravel_multi_index(tuple(first.T), shape) * 3 + across
    order = np.argsort(keys, kind="stable").reshape(-1, 2)  # the two cells at each face
    middles = first[order[:, 0]] + 0.5 * (np.arange(3) != across[order[:, 0], None])
    # whether the first corner of the face is inside
    corner = crossings.rising[edges[cells, 4 * AXES_AFTER[across, 1] + side]]
    way = inside(middles) == corner[order[:, 0]]
    while True:
        ways[cells[order], faces[order]] = way[:, None]
        pieces, counts = _pieces(edges, ways)
        pieces_at_faces = pieces[cells[:, None], _face_edges(faces)]
        # both links at a face belong to one piece in both cells: they get the other way
        double = np.flatnonzero((pieces_at_faces == pieces_at_faces[:, :1]).all(axis=1)[order].all(axis=1))
        if not len(double):
            break
        # one face of a cell at a time: each change divides the pieces of both cells, but two may join them again
        first_of = np.full(len(positions), len(order))
        np.minimum.at(first_of, cells[order[double]], double[:, None])
        way[double[(first_of[cells[order[double]]] == double[:, None]).all(axis=1)]] ^= True
    owners = np.repeat(np.arange(len(positions), dtype=np.int32), counts)
    return DualCells(positions, edges, pieces, owners, pieces[rows, sides])


def open_cells(edges: NDArray[np.int32]) -> Ints:
    """Return the cells with a face of which an odd number of edges is crossed, since a node of it has no value.

    `edges` are those of `CrossedCells`, (c, 12).
    """
    return np.flatnonzero((_crossed_faces(edges) % 2 == 1).any(axis=1))


def _face_edges(faces: Ints) -> Ints:
    """Return (n, 4) the edges, 0 to 11, around each of (n,) faces of a cell, 0 to 5."""
    axis, side = faces // 2, faces % 2
    b, c = 4 * AXES_AFTER[axis, 1], 4 * AXES_AFTER[axis, 2] + 2 * side
    return np.stack([b + side, c + 1, b + 2 + side, c], axis=1)


def _crossed_faces(edges: NDArray[np.int32]) -> NDArray[np.int8]:
    """Return (c, 6) the number of crossed edges around each face of cells, whose `edges` are −1 if not crossed."""
    crossed, kinds = _kinds(edges >= 0)
    return crossed[:, _face_edges(np.arange(6))].sum(axis=2, dtype=np.int8)[kinds]


def _pieces(edges: NDArray[np.int32], ways: Bools) -> tuple[NDArray[np.int32], Ints]:
    """Return (c, 12) the piece of each crossed edge, numbered over all cells, or −1, and (c,) numbers of pieces.

    `edges` are −1 where not crossed, (c, 12), and `ways` the ways to link crossed edges at each face, (c, 6).
    """
    flags, kinds = _kinds(np.concatenate([edges >= 0, ways], axis=1))
    pieces = _pieces_of_cell(flags[:, :12], flags[:, 12:])
    counts = (pieces.max(axis=1, initial=-1) + 1)[kinds]
    result = pieces.astype(np.int32)[kinds]
    result += (np.cumsum(counts) - counts).astype(np.int32)[:, None]
    result[edges < 0] = -1
    return result, counts


def _kinds(flags: Bools) -> tuple[Bools, Ints]:
    """Return the distinct rows of (c, n) flags, n at most about 20, and (c,) the index of each row among these."""
    size = flags.shape[1]
    codes = np.packbits(flags, axis=1, bitorder="little") @ (1 << 8 * np.arange(-(-size // 8)))
    present = np.flatnonzero(np.bincount(codes, minlength=1 << size))
    numbers = np.empty(1 << size, dtype=np.int64)
    numbers[present] = np.arange(len(present))
    return (present[:, None] >> np.arange(size) & 1).astype(np.bool_), numbers[codes]


def _pieces_of_cell(crossed: Bools, ways: Bools) -> Ints:
    """Return (c, 12) the piece of each crossed edge, numbered from 0 in each cell, or −1.

    `crossed` is (c, 12). If all four edges of a face are crossed, its way, in `ways`, (c, 6), links the first with the
    last and the second with the third if false, and the first with the second and the third with the last if true.
    """
    around = _face_edges(np.arange(6))
    of_faces = crossed[:, around]
    cells, faces, edge = np.nonzero(of_faces)
    way = np.where(ways[cells, faces], edge ^ 1, 3 - edge)
    linked = np.where(of_faces[cells, faces].all(axis=1), way, of_faces[cells, faces].argmax(axis=1))
    numbers = np.cumsum(crossed).reshape(crossed.shape) - 1
    links = (numbers[cells, around[faces, end]] for end in (edge, linked))
    result = np.full(crossed.shape, crossed.size)
    result[crossed] = connected_components(int(crossed.sum()), *links)  # numbered by their first edges, cell by cell
    return np.where(crossed, result - result.min(axis=1)[:, None], -1)


DIAGONAL_CLEARANCE = 1e-6
"""Least distance, in cells, of a diagonal from the sides of the tetrahedra, for which it counts as inside them."""


def dual_triangles(
    cells: DualCells, crossings: Crossings, vertices: Floats, fanned: Bools
) -> tuple[Floats, Ints, Ints]:
    """Make triangles, with outward normals, between the vertices of the four pieces around each crossed edge.

    Each quadrilateral is divided along the better diagonal. If the edge is `fanned`, (e,), or neither diagonal is
    possible, its crossing becomes a vertex, which is joined to the four others. Returns (n, 3) vertices in cells,
    (m, 3) triangles, and the edges whose crossings are vertices. `vertices` are those of pieces, (v, 3) in cells.
    """
    quads, axes, shares = cells.quads, crossings.axes, crossings.shares

    def chosen(edges: Ints) -> tuple[Bools, Bools]:
        corners = vertices[quads[edges]] - crossings.nodes[edges, None]
        return _better_diagonals(corners, axes[edges], shares[edges])

    second, possible = in_chunks(chosen, np.arange(len(quads)))
    fan = fanned | ~possible
    plain, fans = np.flatnonzero(~fan), np.flatnonzero(fan)
    rotated = np.where(second[plain, None], np.roll(quads[plain], -1, axis=1), quads[plain])
    added = crossings.nodes[fans].astype(np.float64)
    added[np.arange(len(fans)), axes[fans]] += shares[fans]
    tips = np.repeat(len(vertices) + np.arange(len(fans)), 4)
    ends = quads[fans].ravel(), np.roll(quads[fans], -1, axis=1).ravel()
    parts = rotated[:, [0, 1, 2]], rotated[:, [0, 2, 3]], np.stack([tips, *ends], axis=1)
    faces = np.concatenate(parts, dtype=np.int64)
    falling = ~crossings.rising[np.concatenate([plain, plain, np.repeat(fans, 4)])]
    faces[falling] = faces[falling][:, ::-1]
    return np.concatenate([vertices, added]), faces, fans


def _better_diagonals(around: Floats, axes: NDArray[np.integer], shares: Floats) -> tuple[Bools, Bools]:
    """Choose diagonals of quadrilaterals around n crossed edges, with their `axes` and `shares` of `Crossings`.

    `around` are the corners relative to the first nodes of the edges, (n, 4, 3) in cells. Returns (n,) whether the
    second diagonal (corner 1 to 3) is better than the first (0 to 2), and (n,) whether one of them stays within the
    tetrahedra of the edge. A diagonal outside is never chosen. Of two inside, the better one makes triangles that cross
    the edge nearer to where the level set does, or is shorter.
    """
    rows, corners = np.arange(len(around))[:, None], np.arange(4)
    along_edge = around[rows, corners, axes[:, None]]
    across_edge = np.stack([around[rows, corners, AXES_AFTER[axes, 1 + k][:, None]] for k in range(2)], axis=2)
    safe, misses, lengths = np.empty((2, len(axes)), dtype=bool), np.empty((2, len(axes))), np.empty((2, len(axes)))
    for k in range(2):
        safe[k], crossed_at = _safe(np.roll(across_edge, -k, axis=1), np.roll(along_edge, -k, axis=1))
        misses[k] = np.abs(crossed_at - shares)
        lengths[k] = np.linalg.norm(around[:, k] - around[:, k + 2], axis=1)
    differ = np.abs(misses[0] - misses[1]) > DIAGONAL_CLEARANCE
    second_is_better = np.where(differ, misses[1] < misses[0], lengths[1] < lengths[0])
    return safe[1] & (second_is_better | ~safe[0]), safe[0] | safe[1]


def separate_triangles(cells: DualCells, crossings: Crossings, choices: Floats) -> tuple[Floats, Ints]:
    """Make vertices and triangles that do not intersect each other, if possible, with edges along creases.

    `choices` are three positions for the vertex of each piece, (3, v, 3) in cells, the last of them in its cell. Where
    triangles intersect, their vertices move to the next choice, or crossings become vertices.
    """
    count = choices.shape[1]
    chosen, fanned = np.zeros(count, dtype=np.int64), np.zeros(len(cells.quads), dtype=bool)
    crowded = (np.bincount(cells.owners) > 1)[cells.owners]
    for _ in range(8):  # two rounds are enough for nearly all shapes
        vertices = choices[np.minimum(chosen, 2), np.arange(count)]
        points, straight, centres = dual_triangles(cells, crossings, vertices, fanned)
        beside = np.zeros(len(centres), dtype=bool)
        faces = flipped_along_creases(points, straight, np.concatenate([chosen > 0, beside]))
        # all other triangles stay within the tetrahedra of their edges
        out = np.concatenate([crowded | (np.floor(vertices) != cells.places[cells.owners]).any(axis=1), beside])
        asked = (faces != straight).any(axis=1) | out[faces].any(axis=1)
        meeting = np.unique(faces[self_intersections(points, faces, asked)])
        if not len(meeting):
            break
        meeting = np.union1d(meeting[meeting < count], cells.quads[centres[meeting[meeting >= count] - count]])
        chosen[meeting] += 1
        fanned |= np.isin(cells.quads, meeting).sum(axis=1) > 1
    return points, faces


def _safe(flat: Floats, height: Floats) -> tuple[Bools, Floats]:
    """Return (n,) whether the diagonal from corner 0 to 2 stays within the tetrahedra of a crossed edge.

    `flat`, (n, 4, 2), and `height`, (n, 4), are coordinates of corners across and along the edge, in cells. The edge is
    at the origin, with heights from 0 to 1. Also returns (n,) the height at which the triangles along the diagonal
    cross the edge.
    """
    p, r = flat[:, 0], flat[:, 2]
    is_left = _cross(p, r) > 0  # the origin is to the left of the diagonal, with the fourth corner
    rows = np.arange(len(flat))
    with_origin, opposite = np.where(is_left, 3, 1), np.where(is_left, 1, 3)
    s, q = flat[rows, with_origin], flat[rows, opposite]
    # barycentric coordinates of the origin in the triangle p, r, s
    weights = np.stack([_cross(r, s), _cross(s, p), _cross(p, r)], axis=1)
    total = weights.sum(axis=1)
    total = np.where(np.abs(total) > 1e-300, total, 1e-300)
    heights = np.stack([height[:, 0], height[:, 2], height[rows, with_origin]], axis=1)
    crossed_at = (weights * heights).sum(axis=1) / total
    # where the diagonal, from p to r, passes the line from the origin to q: the shares of both, and its height
    divisor = _cross(p - r, q)
    share = _cross(p, q) / np.where(np.abs(divisor) > 1e-300, divisor, 1e-300)
    passing = p + share[:, None] * (r - p)
    share_to_q = (passing * q).sum(axis=1) / np.maximum((q * q).sum(axis=1), 1e-300)
    passing_height = height[:, 0] + share * (height[:, 2] - height[:, 0])
    # there the triangle of the edge and q reaches from one to the other of these heights
    bottom = share_to_q * height[rows, opposite]
    top = (1 - share_to_q) + bottom
    safe = (crossed_at > DIAGONAL_CLEARANCE) & (crossed_at < 1 - DIAGONAL_CLEARANCE)
    safe &= share_to_q < 1 - DIAGONAL_CLEARANCE
    safe &= (passing_height > bottom + DIAGONAL_CLEARANCE) & (passing_height < top - DIAGONAL_CLEARANCE)
    return safe, crossed_at


def _cross(u: Floats, v: Floats) -> Floats:
    """Return (n,) cross products of (n, 2) vectors."""
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
