"""Exact distance to faces at the nodes of blocks of a grid, which neighbours find together.

For any place q of the surface and nodes x of a box, ``|x − y|² − |x − q|²`` is linear in x: where it is positive at the
corner of the box that favours y, no node of the box has y as its nearest place. Few faces remain for a block, and fewer
for each half of it; those of single nodes are looked at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..compiled import compiled
from ..domains.grid import Grid
from ..geometry.box_tree import LEAF, morton_codes
from ..geometry.face_tree import FaceTree
from ..geometry.nearest import foot_on_triangle
from ..operators.grid.blocks import SIDE
from .winding import Windings

SLACK = 1e-12
"""Of squares, by which rounding may be off."""
CROWDED = 400
"""Leaves that may be nearest to some node of a block, above which its nodes are searched for one by one. On meshes of
5,000 to 1.3 million faces at 48 to 256 nodes, seconds differ by a fifth at most between half of it and twice."""
ALONG_A_CURVE = np.stack(
    [sum((np.arange(SIDE**3) >> (3 * bit + 2 - axis) & 1) << bit for bit in range(3)) for axis in range(3)], axis=1
)
"""(512, 3) nodes of a block along a space-filling curve."""


@dataclass(frozen=True, eq=False)
class Tile:
    """Signed distances at the nodes of a box, in some or all of its blocks.

    Attributes
    ----------
    values : (a, b, c) float
        NaN where there is no block.
    faces : (a, b, c) int
        Number of the nearest triangle of the tree; −1 where there is no block.
    """

    values: NDArray[np.float64]
    faces: NDArray[np.int32]


def distances_in(
    tree: FaceTree, windings: Windings, grid: Grid, first: NDArray[np.int64], places: NDArray[np.int64]
) -> Tile:
    """Signed distances at the nodes of blocks, all within `TILE` nodes of each other.

    Parameters
    ----------
    tree : FaceTree
        What to measure to.
    windings : Windings
        What tells the inside.
    grid : Grid
        Whose nodes.
    first : (3,) int
        First node of the box.
    places : (n, 3) int
        First nodes of the blocks, divided by `SIDE`.
    """
    shape = np.minimum((places.max(axis=0) + 1) * SIDE, grid.shape) - first
    squares, faces = np.full(tuple(shape), np.nan), np.full(tuple(shape), -1, dtype=np.int32)
    ordered = places[np.argsort(morton_codes(places.astype(np.float64)), kind="stable")]
    steps, limits = np.array(grid.spacing), np.array(grid.shape)
    last = np.minimum((ordered + 1) * SIDE, limits) - 1
    centres = grid.origin + 0.5 * (ordered * SIDE + last) * steps
    near = tree.search(centres).faces
    boxes = tree.tree.bounds, tree.discs, tree.tree.items
    crowded = _fill(
        tree.features.rows, *boxes, np.array(grid.origin), steps, limits, ordered * SIDE, near, first, squares, faces
    )
    if crowded.any():
        nodes = (ordered[crowded, None] * SIDE + ALONG_A_CURVE).reshape(-1, 3)
        nodes = nodes[(nodes < limits).all(axis=1)]
        where = tuple((nodes - first).T)
        faces[where], squares[where] = tree.nearest(grid.origin + nodes * steps)
    values = np.sqrt(squares, out=squares)
    inside = _inside(windings, grid, first, values)
    return Tile(np.negative(values, out=values, where=inside), faces)


def solved(
    tree: FaceTree, windings: Windings, grid: Grid, places: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """(n, 8, 8, 8) signed distances at the nodes of blocks near each other, and confidence; NaN beyond the grid."""
    first = places.min(axis=0)
    tile = distances_in(tree, windings, grid, SIDE * first, places)
    values = np.full((len(places), SIDE, SIDE, SIDE), np.nan, dtype=np.float32)
    confidence = np.ones(values.shape, dtype=np.float16)
    for row, place in enumerate(SIDE * (places - first)):
        a, b, c = (slice(p, p + SIDE) for p in place)
        there = tile.values[a, b, c]
        i, j, k = there.shape
        values[row, :i, :j, :k] = there
        confidence[row, :i, :j, :k] = tree.features.trusted[tile.faces[a, b, c]]
    return values, confidence


def _inside(windings: Windings, grid: Grid, first: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where nodes are inside, of which one is asked for all that no surface can divide.

    Of two neighbours that are both farther than half a step no surface is between, nor a gap if they are farther than
    these are wide.
    """
    origin, steps = grid.origin + first * grid.spacing, grid.spacing
    inside = np.zeros(values.shape, dtype=bool)
    far = values > max(0.5 * (1.0 + SLACK) * float(steps.max()), windings.sided_beyond)
    groups, count = scipy.ndimage.label(far)
    if count:
        farthest = _farthest(values, groups, count)
        where = np.stack(np.unravel_index(farthest, values.shape), axis=1)
        found = np.concatenate([[False], windings.inside(origin + where * steps)])
        inside = found[groups]
    nodes = np.argwhere(~np.isnan(values) & ~far)
    if len(nodes):
        inside[tuple(nodes.T)] = windings.inside(origin + nodes * steps)
    return inside


@compiled
def _farthest(values: NDArray[np.float64], groups: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """(count,) flat index of the node of each group from 1 on with the greatest value."""
    result = np.full(count, -1, dtype=np.int64)
    most = np.zeros(count)
    n0, n1, n2 = values.shape
    for i in range(n0):
        for j in range(n1):
            for k in range(n2):
                group = groups[i, j, k] - 1
                if group >= 0 and values[i, j, k] > most[group]:
                    most[group] = values[i, j, k]
                    result[group] = (i * n1 + j) * n2 + k
    return result


@compiled
def _fill(
    rows: NDArray[np.float64],
    bounds: NDArray[np.float64],
    discs: NDArray[np.float64],
    items: NDArray[np.int64],
    origin: NDArray[np.float64],
    steps: NDArray[np.float64],
    limits: NDArray[np.int64],
    firsts: NDArray[np.int64],
    start: NDArray[np.int32],
    window: NDArray[np.int64],
    out_squares: NDArray[np.float64],
    out_faces: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """Squares of the distances of the nodes of blocks to the nearest faces, and these; returns which are left out.

    Leaves of the tree are chosen for a block, faces for its eighths, fewer faces for the eighths of these.

    Parameters
    ----------
    rows, bounds, discs, items : arrays
        Of a `FaceTree`.
    origin, steps, limits : (3,)
        Origin, spacing and shape of the grid.
    firsts : (n, 3) int
        First nodes of the blocks.
    start : (n,) int
        The face that is nearest to the centre of each.
    window : (3,) int
        The node whose values come first in the results.
    out_squares, out_faces : (a, b, c)
        What is found.
    """
    leaves = len(bounds) // 2
    lists = np.empty((2, leaves), dtype=np.int64)
    stack, box = np.empty(64, dtype=np.int64), np.empty(9)
    many, few, lows = np.empty((4, LEAF * leaves)), np.empty((4, LEAF * leaves)), np.empty(LEAF * leaves)
    many_faces, few_faces = np.empty(LEAF * leaves, dtype=np.int64), np.empty(LEAF * leaves, dtype=np.int64)
    centre, crowded = np.empty(3), np.zeros(len(firsts), dtype=np.bool_)
    for b in range(len(firsts)):
        i, j, k = firsts[b]
        face = np.int64(start[b])
        _box(i, j, k, 8, origin, steps, limits, box)
        _, _, box[6], box[7], box[8] = foot_on_triangle(rows, face, box[0], box[1], box[2])
        count = _leaves_of_tree(bounds, discs, box, stack, lists[0])
        crowded[b] = count > CROWDED
        if crowded[b]:
            continue
        for eighth in range(8):
            i1, j1, k1 = i + 4 * (eighth >> 2), j + 4 * (eighth >> 1 & 1), k + 4 * (eighth & 1)
            if i1 >= limits[0] or j1 >= limits[1] or k1 >= limits[2]:
                continue
            _box(i1, j1, k1, 4, origin, steps, limits, box)
            face = _nearest(rows, bounds, discs, items, lists[0], count, box, face)
            fewer = _leaves_of_list(bounds, discs, box, lists[0], count, lists[1])
            at = 0
            for c in range(fewer):
                for item in range((lists[1, c] - leaves) * LEAF, (lists[1, c] - leaves + 1) * LEAF):
                    if items[item] >= 0:
                        many_faces[at] = items[item]
                        at += 1
            n_many = _faces_of_list(rows, box, many_faces, at, many_faces, many)
            centre[0], centre[1], centre[2] = box[0], box[1], box[2]
            for part in range(8):
                i2, j2, k2 = i1 + 2 * (part >> 2), j1 + 2 * (part >> 1 & 1), k1 + 2 * (part & 1)
                if i2 >= limits[0] or j2 >= limits[1] or k2 >= limits[2]:
                    continue
                _box(i2, j2, k2, 2, origin, steps, limits, box)
                u, v, w = box[0] - centre[0], box[1] - centre[1], box[2] - centre[2]
                first = _heights(many, n_many, u, v, w, lows)
                face = many_faces[first]
                best, _, box[6], box[7], box[8] = foot_on_triangle(rows, face, box[0], box[1], box[2])
                for c in range(n_many):
                    if lows[c] < best and c != first:
                        square, _, x, y, z = foot_on_triangle(rows, many_faces[c], box[0], box[1], box[2])
                        if square < best:
                            best, face = square, many_faces[c]
                            box[6], box[7], box[8] = x, y, z
                x, y, z = box[0] - box[6], box[1] - box[7], box[2] - box[8]
                room = box[3] * box[3] + box[4] * box[4] + box[5] * box[5] + best * (1.0 + SLACK)
                _lower_by_box(many, n_many, box, lows)
                n_few = 0
                for c in range(n_many):
                    if lows[c] < room:
                        few_faces[n_few] = many_faces[c]
                        n_few += 1
                n_few = _faces_of_list(rows, box, few_faces, n_few, few_faces, few)
                for node in range(8):
                    i3, j3, k3 = i2 + (node >> 2), j2 + (node >> 1 & 1), k2 + (node & 1)
                    if i3 >= limits[0] or j3 >= limits[1] or k3 >= limits[2]:
                        continue
                    x, y, z = origin[0] + i3 * steps[0], origin[1] + j3 * steps[1], origin[2] + k3 * steps[2]
                    u, v, w = x - box[0], y - box[1], z - box[2]
                    first = _heights(few, n_few, u, v, w, lows)
                    face = few_faces[first]
                    best, _, _, _, _ = foot_on_triangle(rows, face, x, y, z)
                    for c in range(n_few):
                        if lows[c] < best and c != first:
                            square, _, _, _, _ = foot_on_triangle(rows, few_faces[c], x, y, z)
                            if square < best:
                                best, face = square, few_faces[c]
                    p, q, r = i3 - window[0], j3 - window[1], k3 - window[2]
                    out_squares[p, q, r], out_faces[p, q, r] = best, face
    return crowded


@compiled
def _box(
    i: int,
    j: int,
    k: int,
    side: int,
    origin: NDArray[np.float64],
    steps: NDArray[np.float64],
    limits: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    """Centre and half the sides of a box of nodes; those beyond the grid are left out."""
    for d in range(3):
        first = i if d == 0 else j if d == 1 else k
        half = 0.5 * (min(first + side, limits[d]) - 1 - first)
        out[d] = origin[d] + (first + half) * steps[d]
        out[3 + d] = half * steps[d]


@compiled
def _nearest(
    rows: NDArray[np.float64],
    bounds: NDArray[np.float64],
    discs: NDArray[np.float64],
    items: NDArray[np.int64],
    chosen: NDArray[np.int64],
    count: int,
    box: NDArray[np.float64],
    face: int,
) -> int:
    """The nearest of the faces in some leaves to the centre of a box, whose foot is put into the box."""
    leaves = len(bounds) // 2
    x, y, z = box[0], box[1], box[2]
    best, _, box[6], box[7], box[8] = foot_on_triangle(rows, face, x, y, z)
    for at in range(count):
        leaf = chosen[at]
        u = max(bounds[leaf, 0] - x, x - bounds[leaf, 3], 0.0)
        v = max(bounds[leaf, 1] - y, y - bounds[leaf, 4], 0.0)
        w = max(bounds[leaf, 2] - z, z - bounds[leaf, 5], 0.0)
        square = u * u + v * v + w * w
        if square < best and discs[leaf, 7] >= 0.0:
            u, v, w = x - discs[leaf, 0], y - discs[leaf, 1], z - discs[leaf, 2]
            along = u * discs[leaf, 3] + v * discs[leaf, 4] + w * discs[leaf, 5]
            height = max(abs(along) - discs[leaf, 7], 0.0)
            beside = max(np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) - discs[leaf, 6], 0.0)
            square = height * height + beside * beside
        if square < best:
            for item in range((leaf - leaves) * LEAF, (leaf - leaves + 1) * LEAF):
                if items[item] >= 0:
                    square, _, a, b, c = foot_on_triangle(rows, items[item], x, y, z)
                    if square < best:
                        best, face = square, items[item]
                        box[6], box[7], box[8] = a, b, c
    return face


@compiled
def _faces_of_list(
    rows: NDArray[np.float64],
    box: NDArray[np.float64],
    given: NDArray[np.int64],
    count: int,
    out: NDArray[np.int64],
    planes: NDArray[np.float64],
) -> int:
    """Of some faces those that can be nearest to a node of a box; returns how many.

    Squared distance is convex, so that a plane through its value at the centre is below it: its value and slopes.
    """
    kept = 0
    x, y, z = box[0] - box[6], box[1] - box[7], box[2] - box[8]
    room = (x * x + y * y + z * z) * (1.0 + SLACK) + box[3] * box[3] + box[4] * box[4] + box[5] * box[5]
    for at in range(count):
        square, _, a, b, c = foot_on_triangle(rows, given[at], box[0], box[1], box[2])
        a, b, c = 2.0 * (box[0] - a), 2.0 * (box[1] - b), 2.0 * (box[2] - c)
        low = square - box[3] * abs(a - 2.0 * x) - box[4] * abs(b - 2.0 * y) - box[5] * abs(c - 2.0 * z)
        if low < room:
            out[kept] = given[at]
            planes[0, kept], planes[1, kept], planes[2, kept], planes[3, kept] = square, a, b, c
            kept += 1
    return kept


@compiled
def _heights(planes: NDArray[np.float64], count: int, u: float, v: float, w: float, out: NDArray[np.float64]) -> int:
    """Of some planes the heights above a place; returns which is the lowest."""
    for c in range(count):
        out[c] = planes[0, c] + u * planes[1, c] + v * planes[2, c] + w * planes[3, c]
    first = 0
    for c in range(1, count):
        if out[c] < out[first]:
            first = c
    return first


@compiled
def _lower_by_box(planes: NDArray[np.float64], count: int, box: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Take from heights what they may be lower in a box, beside the square of the distance to its foot."""
    x, y, z = 2.0 * (box[0] - box[6]), 2.0 * (box[1] - box[7]), 2.0 * (box[2] - box[8])
    a, b, c = box[3], box[4], box[5]
    for k in range(count):
        out[k] -= a * abs(planes[1, k] - x) + b * abs(planes[2, k] - y) + c * abs(planes[3, k] - z)


@compiled
def _leaves_of_list(
    bounds: NDArray[np.float64],
    discs: NDArray[np.float64],
    box: NDArray[np.float64],
    given: NDArray[np.int64],
    count: int,
    out: NDArray[np.int64],
) -> int:
    """Of some leaves those that can be nearest to a node of a box; returns how many."""
    kept = 0
    for at in range(count):
        if _can_be_nearest(bounds, discs, given[at], box):
            out[kept] = given[at]
            kept += 1
    return kept


@compiled
def _leaves_of_tree(
    bounds: NDArray[np.float64],
    discs: NDArray[np.float64],
    box: NDArray[np.float64],
    stack: NDArray[np.int64],
    out: NDArray[np.int64],
) -> int:
    """The same, of all leaves of a tree."""
    leaves = len(bounds) // 2
    kept, depth = 0, 1
    stack[0] = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if bounds[node, 0] <= bounds[node, 3] and _can_be_nearest(bounds, discs, node, box):
            if node >= leaves:
                out[kept] = node
                kept += 1
            else:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
                depth += 2
    return kept


@compiled
def _can_be_nearest(
    bounds: NDArray[np.float64], discs: NDArray[np.float64], node: int, box: NDArray[np.float64]
) -> bool:
    """Whether a place y in the box or disc of a node is as near to some x of a box as the foot q of its centre.

    Around the centre ``|x − y|² − |x − q|²`` at the worst x is the sum over the axes of ``y² − q² − 2 e |y − q|``, e
    half the box, each of which is least where y is e or −e, or at an end. For a disc as in `_faces_of_list`.
    """
    total, scale = 0.0, 0.0
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
        scale += q * q
    if total >= SLACK * scale:
        return False
    thick = discs[node, 7]
    if thick < 0.0:
        return True
    x, y, z = box[0] - discs[node, 0], box[1] - discs[node, 1], box[2] - discs[node, 2]
    nx, ny, nz = discs[node, 3], discs[node, 4], discs[node, 5]
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    beside = np.sqrt(x * x + y * y + z * z)
    out = max(1.0 - discs[node, 6] / beside, 0.0) if beside > 0.0 else 0.0
    up = along - min(max(along, -thick), thick)
    x, y, z = out * x + up * nx, out * y + up * ny, out * z + up * nz  # from the nearest place of the disc
    low = x * x + y * y + z * z - scale * (1.0 + SLACK)
    for d in range(3):
        away = x if d == 0 else y if d == 1 else z
        low -= 2.0 * box[3 + d] * abs(away - box[d] + box[6 + d]) + box[3 + d] * box[3 + d]
    return bool(low < 0.0)
