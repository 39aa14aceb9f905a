"""Pairs of triangles of a mesh that intersect each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..parallel import ROWS_PER_TASK, in_threads
from .box_tree import boxes_around, order_along_curve
from .edges import has_three_corners
from .oriented_boxes import TRIANGLES_PER_LEAF, OrientedBoxes, boxes_apart, oriented_apart
from .unit_vectors import unit
from .welding import same_positions, tolerances

TOUCHING_DEPTH = 1e-10
"""Depth of an intersection, relative to the size of the smaller of their parts, up to which triangles only touch."""
COVERING_FOLD = 1e-10
"""One minus the cosine of the angle between two faces at their common edge, up to which they are folded onto each
other and overlap."""
ARC_ROUNDING = 1e-6
"""Angle between faces around a vertex, in radians, up to which they may overlap because of rounding."""
CROWD = 64
"""Number of faces around a vertex above which their intersections are found by directions from it, not in space."""


def self_intersections(vertices: Floats, faces: Ints, asked: Bools | None = None) -> Ints:
    """Return (k, 2) pairs of faces that intersect or overlap, and those that touch and have no common vertex.

    Vertices at the same position are one. If `asked`, (m,), is given, only pairs with a face for which it is
    true are returned.
    """
    faces = same_positions(vertices)[faces]
    return overlapping_faces(vertices, faces, tolerances(vertices, faces, TOUCHING_DEPTH), asked)


def overlapping_faces(vertices: Floats, faces: Ints, slacks: Floats, asked: Bools | None = None) -> Ints:
    """Return (k, 2) pairs of faces that overlap, or touch if they have no common vertex.

    Faces touch if their distance is below the (m,) slacks of both. Faces with a common edge overlap if one is folded
    onto the other. If `asked`, (m,), is given, only pairs with a face for which it is true are returned.
    """
    proper = np.flatnonzero(has_three_corners(faces))
    if len(proper) < len(faces):
        asked_proper = None if asked is None else asked[proper]
        return proper[overlapping_faces(vertices, faces[proper], slacks[proper], asked_proper)]
    count = len(faces) if asked is None else int(asked.sum())
    if not count:
        return np.zeros((0, 2), dtype=np.int64)
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    hubs = _hubs(faces, len(vertices))
    order = _order(vertices.take(faces, axis=0), vertices, hubs)
    ids, hubs, slacks = np.ascontiguousarray(faces[order], dtype=np.int64), hubs[order], slacks[order]
    asked = np.ones(len(ids), dtype=np.bool_) if asked is None else asked[order]
    corners = vertices.take(ids, axis=0).reshape(-1, 9)
    triangles = Triangles(corners, ids, slacks)
    # pairs in space, except those around hubs, which are found by directions from the hub
    pairs = _near(OrientedBoxes.of(corners, slacks, hubs, asked), triangles, False)
    fans = np.flatnonzero(hubs >= 0)
    if len(fans):
        arcs = _arcs(vertices, ids[fans], hubs[fans])
        around = order_along_curve(arcs.mean(axis=1))
        fans, arcs, angles = fans[around], arcs[around].reshape(-1, 9), np.full(len(fans), ARC_ROUNDING)
        triangles = Triangles(corners[fans], ids[fans], slacks[fans])
        tree = OrientedBoxes.of(arcs, angles, hubs[fans], asked[fans])
        pairs = np.concatenate([pairs, fans[_near(tree, triangles, True)]])
    pairs = np.sort(order[pairs], axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


class Triangles(NamedTuple):
    """n triangles that may overlap."""

    corners: Floats  # (n, 9) coordinates of the three corners
    ids: Ints  # (n, 3) ids of the vertices
    slacks: Floats  # (n,) distance below which each touches others


def _near(tree: OrientedBoxes, triangles: Triangles, around: bool) -> Ints:
    """Return (k, 2) pairs of triangles that overlap, found with a tree of their boxes.

    If `around`, these are pairs around the same hub, otherwise all others.
    """
    count = len(triangles.corners)
    tasks = 1 << max((count // ROWS_PER_TASK).bit_length() - 1, 0)

    def of_task(task: int) -> Ints:
        """(k, 2) pairs found from one node of the tree, in an array that is enlarged until there is room for all."""
        room = ROWS_PER_TASK
        while True:
            pairs = np.empty((room, 2), dtype=np.int64)
            count = _pairs_of(tree, triangles, around, task, 2 * tasks, pairs)
            if count <= room:
                return pairs[:count]
            room = count

    return np.concatenate(list(in_threads(of_task, range(tasks, 2 * tasks))))


def _hubs(faces: Ints, n_vertices: int) -> Ints:
    """Return (m,) the hub of each face, its vertex of most faces, if these are more than `CROWD`; else −1."""
    valences = np.bincount(faces.ravel(), minlength=n_vertices)
    if valences.max(initial=0) <= CROWD:
        return np.full(len(faces), -1)
    valences = valences[faces]
    hubs = np.take_along_axis(faces, valences.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(valences.max(axis=1) > CROWD, hubs, -1)


def _order(corners: Floats, vertices: Floats, hubs: Ints) -> Ints:
    """Return (m,) indices that sort triangles along a space-filling curve, with those around the same hub together."""
    lower, upper = boxes_around(corners)
    middles = 0.5 * (lower + upper)
    if not (hubs >= 0).any():
        return order_along_curve(middles)
    groups = np.unique(np.where(hubs >= 0, hubs, len(vertices) + np.arange(len(hubs))), return_inverse=True)[1]
    of_groups = np.argsort(order_along_curve(np.where((hubs >= 0)[:, None], vertices[hubs], middles)))
    first = np.full(len(hubs), len(hubs))
    np.minimum.at(first, groups, of_groups)
    return order_along_curve(middles, first[groups])


def _arcs(vertices: Floats, faces: Ints, hubs: Ints) -> Floats:
    """Return for each of k faces a triangle that contains the directions to it from one of its vertices, (k, 3, 3).

    These are the hubs, (k,) vertex ids. The directions form an arc of the unit sphere around the hub, and the corners
    of the triangle are the ends of the arc and a point beyond its middle. Triangles of different hubs are moved apart.
    """
    corner = np.argmax(faces == hubs[:, None], axis=1)
    ends = [faces[np.arange(len(faces)), (corner + k) % 3] for k in (1, 2)]
    first, second = (unit(vertices[end] - vertices[hubs]) for end in ends)
    tip = (first + second) / np.maximum(1.0 + (first * second).sum(axis=1), 1e-3)[:, None]
    names = np.unique(hubs, return_inverse=True)[1]
    arcs = np.stack([first, second, tip], axis=1)
    arcs[..., 0] += 4.0 * names[:, None]
    return arcs


@compiled
def _pairs_of(tree: OrientedBoxes, triangles: Triangles, around: bool, node: int, end: int, out: Ints) -> int:
    """Write to `out` the pairs of overlapping triangles below a node, and of these with others below nodes up to `end`.

    Returns the number of pairs, which may be larger than the room in `out`. Pairs of nodes are descended together; one
    is left out if its boxes are apart, if no triangle is asked for, or if all are around one hub and `around` is false.
    Columns of `own` and `largest` are described in `OrientedBoxes`.
    """
    own, largest, oriented = tree
    corners, ids, slacks = triangles
    count, stack, ways = 0, np.empty((256, 2), dtype=np.int64), np.empty((10, 3))
    leaves, n = len(largest) // 2, len(corners)
    for other in range(node, end):
        stack[0, 0], stack[0, 1], depth = node, other, 1
        while depth > 0:
            depth -= 1
            a, b = stack[depth, 0], stack[depth, 1]
            slack = min(largest[a, 6], largest[b, 6])
            if a != b and (boxes_apart(largest, a, largest, b, slack) or oriented_apart(oriented, a, b, slack)):
                continue
            if largest[a, 7] + largest[b, 7] <= 0.0:  # none asked for
                continue
            if not around and largest[a, 8] >= 0.0 and largest[a, 8] + largest[a, 9] == 0.0:  # all of one hub
                if largest[b, 8] == largest[a, 8] and largest[b, 9] == largest[a, 9]:
                    continue
            if a < leaves:  # both nodes are on the same level; of a node with itself, each pair of children once
                for i in range(4):
                    if a != b or i != 2:
                        stack[depth, 0], stack[depth, 1] = 2 * a + i // 2, 2 * b + i % 2
                        depth += 1
                continue
            first, second = (a - leaves) * TRIANGLES_PER_LEAF, (b - leaves) * TRIANGLES_PER_LEAF
            for f in range(first, min(first + TRIANGLES_PER_LEAF, n)):
                if boxes_apart(own, f, largest, b, slack):
                    continue
                for g in range(f + 1 if a == b else second, min(second + TRIANGLES_PER_LEAF, n)):
                    if boxes_apart(own, f, own, g, slack) or own[f, 7] + own[g, 7] <= 0.0:
                        continue
                    if (own[f, 8] >= 0.0 and own[f, 8] == own[g, 8]) != around:
                        continue
                    if _overlapping(corners, ids, slacks, f, g, ways):
                        if count < len(out):
                            out[count, 0], out[count, 1] = f, g
                        count += 1
    return count


@compiled
def _overlapping(corners: Floats, ids: Ints, slacks: Floats, f: int, g: int, ways: Floats) -> bool:
    """Return whether triangles f and g overlap, or, if they have a common edge, are folded along it."""
    shared, apex, beyond = 0, 3, 3  # apex and beyond: 0 + 1 + 2 less two common corners is the third
    for i in range(3):
        for j in range(3):
            if ids[f, i] == ids[g, j]:
                shared, apex, beyond = shared + 1, apex - i, beyond - j
    if shared == 2:
        return _is_folded(corners[f], corners[g], apex, beyond)
    if shared == 1 and _beside(corners, f, g, 3 - apex, 3 - beyond):
        return False
    slack = min(slacks[f], slacks[g])
    return shared > 2 or overlap(corners[f], corners[g], slack, slack if shared else -slack, ways)


@compiled
def _beside(corners: Floats, f: int, g: int, i: int, j: int) -> bool:
    """Return whether a certain plane separates triangles f and g with one common corner, number i of f and j of g.

    Its normal is the difference of the unit vectors from that corner to the midpoints of the opposite sides. A row of
    `corners` has the nine coordinates of a triangle.
    """
    first, second = 0.0, 0.0  # of twice the vectors to the midpoints, the squared lengths, and then their inverses
    a, b, c, d = 3 * ((i + 1) % 3), 3 * ((i + 2) % 3), 3 * ((j + 1) % 3), 3 * ((j + 2) % 3)
    for e in range(3):
        o = corners[f, 3 * i + e]
        first += (corners[f, a + e] - o + corners[f, b + e] - o) ** 2
        second += (corners[g, c + e] - o + corners[g, d + e] - o) ** 2
    if not (first > 0.0 and second > 0.0):
        return False
    first, second = 1.0 / np.sqrt(first), 1.0 / np.sqrt(second)
    height_a, height_b, height_c, height_d = 0.0, 0.0, 0.0, 0.0  # of the other corners above the plane
    for e in range(3):
        o = corners[f, 3 * i + e]
        p, q, r, s = corners[f, a + e] - o, corners[f, b + e] - o, corners[g, c + e] - o, corners[g, d + e] - o
        normal = first * (p + q) - second * (r + s)
        height_a, height_b = height_a + normal * p, height_b + normal * q
        height_c, height_d = height_c + normal * r, height_d + normal * s
    return height_a >= 0.0 and height_b >= 0.0 and height_c <= 0.0 and height_d <= 0.0


@compiled
def _is_folded(p: Floats, q: Floats, apex: int, beyond: int) -> bool:
    """Return whether triangles p and q, (9,) each, are folded onto each other along their common edge.

    The edge is opposite to corner `apex` of p and corner `beyond` of q.
    """
    # how far along the edge both apexes are
    start, end = 3 * ((apex + 1) % 3), 3 * ((apex + 2) % 3)
    square, share_p, share_q = 0.0, 0.0, 0.0
    for d in range(3):
        along = p[end + d] - p[start + d]
        square += along * along
        share_p += along * (p[3 * apex + d] - p[start + d])
        share_q += along * (q[3 * beyond + d] - p[start + d])
    # the angle between the vectors to them, across the edge
    first, second, product = 0.0, 0.0, 0.0
    for d in range(3):
        along = (p[end + d] - p[start + d]) / square
        x = p[3 * apex + d] - p[start + d] - share_p * along
        y = q[3 * beyond + d] - p[start + d] - share_q * along
        first, second, product = first + x * x, second + y * y, product + x * y
    return product > (1.0 - COVERING_FOLD) * np.sqrt(first * second)


@compiled
def overlap(p: Floats, q: Floats, slack: float, depth: float, axes: Floats) -> bool:
    """Return whether triangles p and q, (9,) each, overlap, by the separating axis test.

    They do if their projections overlap by more than `depth` along all axes across sides. Along their normals the
    projections may be apart by `slack`. `axes`, (10, 3), is a work array: rows 0–2 and 3–5 are the sides of p and of q,
    6 and 7 their normals, and 8 and 9 these of unit length, or 0.
    """
    ox, oy, oz = p[0], p[1], p[2]  # rounding of products belongs to these triangles, not to where they are
    for d in range(3):
        if min(p[d], p[3 + d], p[6 + d]) > max(q[d], q[3 + d], q[6 + d]) + slack:
            return False
        if min(q[d], q[3 + d], q[6 + d]) > max(p[d], p[3 + d], p[6 + d]) + slack:
            return False
    for t in range(2):
        corners = p if t == 0 else q
        for c in range(3):
            for d in range(3):
                axes[3 * t + c, d] = corners[(3 * c + 3) % 9 + d] - corners[3 * c + d]
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            axes[6 + t, d] = axes[3 * t + 2, e] * axes[3 * t, f] - axes[3 * t + 2, f] * axes[3 * t, e]
            axes[8 + t, d] = 0.0
    for number in range(17):
        # normals; sides turned in their planes, which separate most triangles that touch; cross products of sides: each
        # axis (x, y, z) is the cross product of rows i and j
        if number < 2:
            i, j = 3 * number, 3 * number + 2
        elif number < 8:
            i, j = number - 2, 6 + (number - 2) // 3
        else:
            i, j = (number - 8) // 3, 3 + (number - 8) % 3
        ux, uy, uz, vx, vy, vz = axes[i, 0], axes[i, 1], axes[i, 2], axes[j, 0], axes[j, 1], axes[j, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(x * x + y * y + z * z)
        scale = np.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
        if not length > 1e-9 * scale:
            continue
        x, y, z = x / length, y / length, z / length
        if number < 2:
            axes[8 + number, 0], axes[8 + number, 1], axes[8 + number, 2] = x, y, z
        elif number >= 8:  # along a normal both are flat and touch
            upright = False
            for t in range(2):
                cosine = axes[8 + t, 0] * x + axes[8 + t, 1] * y + axes[8 + t, 2] * z
                upright |= abs(cosine) > 1.0 - 1e-13
            if upright:
                continue
        p_low = q_low = np.inf
        p_high = q_high = -np.inf
        for c in range(0, 9, 3):
            along = (p[c] - ox) * x + (p[c + 1] - oy) * y + (p[c + 2] - oz) * z
            p_low, p_high = min(p_low, along), max(p_high, along)
            along = (q[c] - ox) * x + (q[c + 1] - oy) * y + (q[c + 2] - oz) * z
            q_low, q_high = min(q_low, along), max(q_high, along)
        if number < 2:
            if p_low > q_high + slack or q_low > p_high + slack:
                return False
        elif p_low >= q_high - depth or q_low >= p_high - depth:
            return False
    return True
