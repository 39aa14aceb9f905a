"""The nearest faces of the nodes of a grid, with one search for each block of nodes.

For points q and y of the surface and nodes x of a box, ``|x − y|² − |x − q|²`` is linear in x. If it is positive at the
corner of the box that favours y, then y is not the nearest point of any node of the box. Few faces remain for a block,
and fewer for each eighth of it, down to single nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.box_tree import BOXES_PER_LEAF, order_along_curve
from ..search.face_tree import FaceTree
from ..search.nearest_triangles import away_from_triangle, foot_on_triangle
from .blocks import BLOCK


class Lattice(NamedTuple):
    """Nodes in rows along three axes."""

    origin: Floats  # (3,) position of the first node
    steps: Floats  # (3,) distance between neighbouring nodes along each axis
    shape: Ints  # (3,) number of nodes along each axis


SQUARE_ROUNDING = 1e-12
"""Relative rounding error of squared distances."""
EIGHTHS = np.stack([np.arange(8) >> 2, np.arange(8) >> 1 & 1, np.arange(8) & 1])
"""(3, 8) offsets of the eighths of a cube, 0 or 1 along each axis."""
CROWDED_LEAVES = 1500
"""A block with more candidate leaves of the tree than this is crowded: its nodes are searched for one by one."""
ALONG_A_CURVE = np.stack(
    [sum((np.arange(BLOCK**3) >> (3 * bit + 2 - axis) & 1) << bit for bit in range(3)) for axis in range(3)], axis=1
)
"""(512, 3) nodes of a block along a space-filling curve."""


def nearest_at_nodes(tree: FaceTree, lattice: Lattice, first: Ints, blocks: Ints) -> tuple[Floats, NDArray[np.int32]]:
    """Return (a, b, c) squared distances and nearest faces of the nodes of blocks, from node `first` on.

    `blocks` are the (n, 3) indices of blocks. At nodes that are in none of them, values are NaN and −1.
    """
    origin, steps, limits = lattice
    shape = tuple(np.minimum((blocks.max(axis=0) + 1) * BLOCK, limits) - first)
    squares, faces = np.full(shape, np.nan), np.full(shape, -1, dtype=np.int32)
    boxes = tree.features.rows, tree.tree.bounds, tree.discs, tree.tree.items
    firsts = BLOCK * blocks[order_along_curve(blocks.astype(np.float64))]
    last = np.minimum(firsts + BLOCK, limits) - 1
    near, _ = tree.nearest(origin + 0.5 * (firsts + last) * steps)
    crowded = _fill(*boxes, *lattice, firsts, near, first, EIGHTHS, squares, faces)
    if crowded.any():
        nodes = (firsts[crowded, None] + ALONG_A_CURVE).reshape(-1, 3)
        nodes = nodes[(nodes < limits).all(axis=1)]
        where = tuple((nodes - first).T)
        faces[where], squares[where] = tree.nearest(origin + nodes * steps)
    return squares, faces


@compiled
def _fill(
    rows: Floats,
    bounds: Floats,
    discs: Floats,
    items: Ints,
    origin: Floats,
    steps: Floats,
    limits: Ints,
    firsts: Ints,
    start: NDArray[np.int32],
    window: Ints,
    eighths: Ints,
    out_squares: Floats,
    out_faces: NDArray[np.int32],
) -> Bools:
    """Write squared distances and nearest faces of the nodes of blocks; return (n,) which blocks are too crowded.

    A block is too crowded if more than `CROWDED_LEAVES` leaves of the tree can be nearest to its nodes. Nothing is
    written for it. Blocks begin at (n, 3) nodes `firsts`, and `start`, (n,), are the faces nearest to their centres.
    `rows`, (f, 16), `bounds`, (2 · leaves, 6), `discs`, (2 · leaves, 8), and `items`, (leaves · `BOXES_PER_LEAF`,), are
    those of the search tree of f faces; `origin`, `steps` and `limits`, (3,), are the fields of the `Lattice`. The
    arrays to write to, `out_squares` and `out_faces`, (a, b, c), begin at node `window`, (3,). `eighths` is `EIGHTHS`.
    """
    leaves, parts = len(bounds) // 2, eighths.shape[1]
    most = BOXES_PER_LEAF * min(CROWDED_LEAVES, leaves) + 1
    # candidates of each eighth at three levels of division, and their numbers
    faces, counts = np.empty((3, parts, most), dtype=np.int32), np.empty((3, parts), dtype=np.int64)
    # centres of the eighths of a cube, and what `_nearest` writes for them
    centres, away = np.empty((3, parts)), np.empty((most, 4, parts))
    least_squares, nearest = np.empty(parts), np.empty(parts, dtype=np.int64)
    # the box of a block, the leaves near it, and a stack to find them; and the cubes still to divide
    box, near, stack = np.empty(9), np.empty(CROWDED_LEAVES, dtype=np.int64), np.empty(64, dtype=np.int64)
    cubes = np.empty((3 * parts, 5), dtype=np.int64)
    crowded = np.zeros(len(firsts), dtype=np.bool_)
    for b in range(len(firsts)):
        # centre and half widths of the block, the nearest point of its centre, and the leaves that can be nearer
        for d in range(3):
            half = 0.5 * (min(firsts[b, d] + BLOCK, limits[d]) - 1 - firsts[b, d])
            box[d], box[3 + d] = origin[d] + (firsts[b, d] + half) * steps[d], half * steps[d]
        _, _, box[6], box[7], box[8] = foot_on_triangle(rows, np.int64(start[b]), box[0], box[1], box[2])
        n_near = _leaves_of_tree(bounds, discs, box, stack, near)
        crowded[b] = n_near > len(near)
        if crowded[b]:
            continue
        # all faces in these leaves are candidates for the whole block
        faces[0, 0, 0], counts[0, 0] = start[b], 1
        for c in range(n_near):
            for item in range((near[c] - leaves) * BOXES_PER_LEAF, (near[c] - leaves + 1) * BOXES_PER_LEAF):
                if items[item] >= 0:
                    faces[0, 0, counts[0, 0]] = items[item]
                    counts[0, 0] += 1
        # divide cubes, (first node, level, row of candidates), into eighths until these are single nodes
        for d in range(3):
            cubes[0, d] = firsts[b, d]
        cubes[0, 3], cubes[0, 4] = 0, 0
        depth = 1
        while depth > 0:
            depth -= 1
            i, j, k, level, slot = cubes[depth]
            side = BLOCK >> level + 1
            for e in range(parts):
                centres[0, e] = origin[0] + (i + side * eighths[0, e] + 0.5 * (side - 1)) * steps[0]
                centres[1, e] = origin[1] + (j + side * eighths[1, e] + 0.5 * (side - 1)) * steps[1]
                centres[2, e] = origin[2] + (k + side * eighths[2, e] + 0.5 * (side - 1)) * steps[2]
            candidates, n = faces[level, slot], counts[level, slot]
            _nearest(rows, candidates, n, centres, away, least_squares, nearest)
            if side > 1:
                # each eighth keeps the candidates that can be nearest to one of its nodes
                widths, out, out_counts = 0.5 * (side - 1) * steps, faces[level + 1], counts[level + 1]
                _divide(candidates, n, away, least_squares, nearest, widths, out, out_counts)
            # eighths on the lattice are divided next, or written if they are single nodes
            for e in range(parts):
                p, q, r = i + side * eighths[0, e], j + side * eighths[1, e], k + side * eighths[2, e]
                if p < limits[0] and q < limits[1] and r < limits[2]:
                    if side > 1:
                        cubes[depth, 0], cubes[depth, 1], cubes[depth, 2] = p, q, r
                        cubes[depth, 3], cubes[depth, 4] = level + 1, e
                        depth += 1
                    else:
                        out_squares[p - window[0], q - window[1], r - window[2]] = least_squares[e]
                        out_faces[p - window[0], q - window[1], r - window[2]] = candidates[nearest[e]]
    return crowded


@compiled
def _nearest(
    rows: Floats,
    faces: NDArray[np.int32],
    count: int,
    points: Floats,
    away: Floats,
    least_squares: Floats,
    nearest: Ints,
) -> None:
    """Find the nearest of `count` faces for each of (3, e) points.

    Write the squared distances and vectors from all faces to `away`, (count, 4, e), and the least squared distance and
    the index of its face among the `count` to `least_squares` and `nearest`, (e,).
    """
    for e in range(len(nearest)):
        least_squares[e], nearest[e] = np.inf, 0
    for c in range(count):
        away_from_triangle(rows, np.int64(faces[c]), points, c, away)
        for e in range(len(nearest)):
            nearer = away[c, 0, e] < least_squares[e]
            least_squares[e] = away[c, 0, e] if nearer else least_squares[e]
            nearest[e] = c if nearer else nearest[e]


@compiled
def _divide(
    faces: NDArray[np.int32],
    count: int,
    away: Floats,
    least_squares: Floats,
    nearest: Ints,
    half: Floats,
    out: NDArray[np.int32],
    counts: Ints,
) -> None:
    """Write the faces that can be nearest in each of eight boxes with half widths `half`, (3,), to `out`, (8, f).

    Their numbers are written to `counts`, (8,). `away`, `least_squares` and `nearest` are what `_nearest` found for the
    centres of the boxes. Let v be the vector to a centre from its foot on a candidate, and w from that on the face
    nearest to it. At the centre plus e, squared distances are at least ``|v|² + 2 v·e`` and at most ``|w + e|²``. So a
    candidate is nearest nowhere in the box if ``|v|² − 2 Σ half |v − w|`` exceeds ``|w|² + |half|²``.
    """
    # (4, 8): the square that a candidate must not exceed, and the vectors of the faces nearest to the centres
    to_beat, is_candidate = np.empty((4, len(nearest))), np.empty(len(nearest), dtype=np.int64)
    for e in range(len(nearest)):
        counts[e] = 0
        for d in range(4):
            to_beat[d, e] = away[nearest[e], d, e]
        to_beat[0, e] = (
            least_squares[e] * (1.0 + SQUARE_ROUNDING) + half[0] * half[0] + half[1] * half[1] + half[2] * half[2]
        )
    a, b, c = 2.0 * half[0], 2.0 * half[1], 2.0 * half[2]
    for k in range(count):
        total = 0
        for e in range(len(nearest)):
            low = away[k, 0, e] - a * abs(away[k, 1, e] - to_beat[1, e])
            low -= b * abs(away[k, 2, e] - to_beat[2, e]) + c * abs(away[k, 3, e] - to_beat[3, e])
            is_candidate[e] = 1 if low <= to_beat[0, e] else 0
            total += is_candidate[e]
        if total > 0:
            for e in range(len(nearest)):
                out[e, counts[e]] = faces[k]
                counts[e] += is_candidate[e]


@compiled
def _leaves_of_tree(bounds: Floats, discs: Floats, box: Floats, stack: Ints, out: Ints) -> int:
    """Write the leaves that can be nearest to a node of a box to `out`; return their number, or one more than it holds.

    `box`, (9,), has the centre, the half widths and the nearest point of the centre.
    """
    leaves = len(bounds) // 2
    kept, depth = 0, 1
    stack[0] = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if bounds[node, 0] <= bounds[node, 3] and _can_be_nearest(bounds, discs, node, box):
            if node >= leaves:
                if kept == len(out):
                    return kept + 1
                out[kept] = node
                kept += 1
            else:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
                depth += 2
    return kept


@compiled
def _can_be_nearest(bounds: Floats, discs: Floats, node: int, box: Floats) -> bool:
    """Whether a point y in the bounds of a tree's node can be as near to some x of a box as q, nearest to its centre.

    ``|x − y|² − |x − q|²`` at the worst x is the sum over axes of ``y² − q² − 2 e |y − q|``, where e is half the width
    of the box. It is least at ±e, at q or at an end of the bounds. `box`, (9,), has the centre, from which positions
    are measured, the half widths and q. The faces of the node lie in the disc ``discs[node]``: centre, unit normal,
    radius and half thickness, which is negative without a disc.
    """
    total, q_square = 0.0, 0.0
    for d in range(3):
        low, high = bounds[node, d] - box[d], bounds[node, 3 + d] - box[d]
        q, e = box[6 + d] - box[d], box[3 + d]
        least = np.inf
        if high >= q:
            y = min(max(e, low, q), high)
            least = y * y - 2.0 * e * (y - q)
        if low <= q:
            y = max(min(-e, high, q), low)
            least = min(least, y * y - 2.0 * e * (q - y))
        total += least - q * q
        q_square += q * q
    if total >= SQUARE_ROUNDING * q_square:
        return False
    thick = discs[node, 7]
    if thick < 0.0:
        return True
    x, y, z = box[0] - discs[node, 0], box[1] - discs[node, 1], box[2] - discs[node, 2]
    nx, ny, nz = discs[node, 3], discs[node, 4], discs[node, 5]
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    from_axis = np.sqrt(x * x + y * y + z * z)
    # the vector v from the nearest place of the disc to the centre of the box. With w, that from q, nothing in the disc
    # is as near as q to any x if |v|² − 2 Σ e |v − w| exceeds |w|² + Σ e², as in `_divide`
    outside = max(1.0 - discs[node, 6] / from_axis, 0.0) if from_axis > 0.0 else 0.0
    above = along - min(max(along, -thick), thick)
    x, y, z = outside * x + above * nx, outside * y + above * ny, outside * z + above * nz
    low = x * x + y * y + z * z - q_square * (1.0 + SQUARE_ROUNDING)
    for d in range(3):
        away = x if d == 0 else y if d == 1 else z
        low -= 2.0 * box[3 + d] * abs(away - box[d] + box[6 + d]) + box[3 + d] * box[3 + d]
    return bool(low < 0.0)
