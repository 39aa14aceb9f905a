"""Kernels: triangles cut along others that they cross, so that each piece lies on one side of all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import BoxTree
from .directions import unit
from .edges import edge_table
from .meshes import area_vectors

TOUCHING = 1e-8
"""Depth, over the size of the shape, up to which triangles that overlap only touch: what coordinates are rounded to."""


def cut_faces(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], knives: NDArray[np.float64], knife_ids: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Cut triangles along the planes of others that they cross, and along the outlines of flat parts that they lie in.

    Triangles are corners and vertex ids. Those that share an edge do not cut each other.

    Returns
    -------
    pieces : (p, 3, 3) float
        Those of triangles that cross none are the triangles themselves.
    origins : (p,) int
        Triangle that each is a piece of, ascending.
    met : (m,) bool
        Triangles that cross or lie in another.

    Examples
    --------
    >>> flat = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]])
    >>> upright = np.array([[[1.0, -1, -1], [1, 3, -1], [1, 1, 3]]])
    >>> pieces, origins, met = cut_faces(flat, np.array([[0, 1, 2]]), upright, np.array([[3, 4, 5]]))
    >>> len(pieces), bool(np.all((pieces[:, :, 0] <= 1).all(axis=1) | (pieces[:, :, 0] >= 1).all(axis=1)))
    (3, True)
    """
    if not len(knives) or not len(triangles):
        return triangles, np.arange(len(triangles)), np.zeros(len(triangles), dtype=np.bool_)
    tree = BoxTree.of(knives.min(axis=1), knives.max(axis=1))
    size = float(np.ptp(knives.reshape(-1, 3), axis=0).max())
    corners, others = (np.ascontiguousarray(each).reshape(-1, 9) for each in (triangles, knives))
    slack = TOUCHING * size
    outlines = _outlines(knives, knife_ids, slack)
    pieces, origins, met = _cut(corners, ids, others, knife_ids, outlines, *tree.meeting(triangles, slack), slack)
    return pieces.reshape(-1, 3, 3), origins, met


def _outlines(triangles: NDArray[np.float64], ids: NDArray[np.int64], slack: float) -> NDArray[np.bool_]:
    """(m, 3) edges, from corner k to k + 1, on the outline of a flat part: not those between triangles in one plane.

    A face that lies in a flat part, wherever within the outline, has the same on both of its sides.
    """
    table = edge_table(ids)
    mates = np.where((table.balance == 0)[table.face_edges].ravel(), table.mates, -1)
    edges = np.flatnonzero(mates >= 0)
    normals = unit(area_vectors(triangles))
    own, other = edges // 3, mates[edges] // 3
    apex = triangles[other, (mates[edges] + 2) % 3]
    height = np.abs(((apex - triangles[own, 0]) * normals[own]).sum(axis=1))
    ahead = (normals[own] * normals[other]).sum(axis=1) > 0
    outlines = np.ones(ids.size, dtype=np.bool_)
    outlines[edges[(height <= slack) & ahead]] = False
    return outlines.reshape(-1, 3)


@compiled
def overlap(
    p: NDArray[np.float64], q: NDArray[np.float64], slack: float, depth: float, axis: NDArray[np.float64]
) -> bool:
    """Whether two triangles, (9,) each, overlap deeper than a depth along every axis that may separate them.

    Along their normals they may be apart by a slack.
    """
    for d in range(3):
        if min(p[d], p[3 + d], p[6 + d]) > max(q[d], q[3 + d], q[6 + d]) + slack:
            return False
        if min(q[d], q[3 + d], q[6 + d]) > max(p[d], p[3 + d], p[6 + d]) + slack:
            return False
    normals = np.zeros((2, 3))
    for a in range(17):
        # normals of both; sides turned in their planes, which part most of those that touch; products of their sides
        if a < 2:
            t = p if a == 0 else q
            ux, uy, uz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
            vx, vy, vz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
        elif a < 8:
            t = p if a < 5 else q
            i = 3 * ((a - 2) % 3)
            k = (i + 3) % 9
            ux, uy, uz = t[k] - t[i], t[k + 1] - t[i + 1], t[k + 2] - t[i + 2]
            sx, sy, sz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
            rx, ry, rz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
            vx, vy, vz = sy * rz - sz * ry, sz * rx - sx * rz, sx * ry - sy * rx
        else:
            i, j = 3 * ((a - 8) // 3), 3 * ((a - 8) % 3)
            k, m = (i + 3) % 9, (j + 3) % 9
            ux, uy, uz = p[k] - p[i], p[k + 1] - p[i + 1], p[k + 2] - p[i + 2]
            vx, vy, vz = q[m] - q[j], q[m + 1] - q[j + 1], q[m + 2] - q[j + 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(x * x + y * y + z * z)
        scale = np.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
        if not length > 1e-9 * scale:
            continue
        axis[0], axis[1], axis[2] = x / length, y / length, z / length
        if a < 2:
            normals[a, 0], normals[a, 1], normals[a, 2] = axis[0], axis[1], axis[2]
        elif a >= 8:  # along a normal both are flat, and touch
            upright = False
            for n in range(2):
                cosine = normals[n, 0] * axis[0] + normals[n, 1] * axis[1] + normals[n, 2] * axis[2]
                upright |= abs(cosine) > 1.0 - 1e-9
            if upright:
                continue
        p0 = q0 = np.inf
        p1 = q1 = -np.inf
        for c in range(0, 9, 3):
            s = p[c] * axis[0] + p[c + 1] * axis[1] + p[c + 2] * axis[2]
            p0, p1 = min(p0, s), max(p1, s)
            s = q[c] * axis[0] + q[c + 1] * axis[1] + q[c + 2] * axis[2]
            q0, q1 = min(q0, s), max(q1, s)
        if a < 2:
            if p0 > q1 + slack or q0 > p1 + slack:
                return False
        elif p0 >= q1 - depth or q0 >= p1 - depth:
            return False
    return True


@compiled
def _halve(
    pieces: NDArray[np.float64],
    alive: NDArray[np.bool_],
    count: int,
    at: int,
    nx: float,
    ny: float,
    nz: float,
    height: float,
    slack: float,
) -> int:
    """Cut a piece along the plane n · x = height; parts that are new are put at the end. Returns how many there are."""
    side = np.empty(3)
    above, below = 0, 0
    for c in range(3):
        s = pieces[at, 3 * c] * nx + pieces[at, 3 * c + 1] * ny + pieces[at, 3 * c + 2] * nz - height
        side[c] = 0.0 if abs(s) <= slack else s
        above += side[c] > 0.0
        below += side[c] < 0.0
    if above == 0 or below == 0 or count + 3 > len(pieces):
        return count
    polygon = np.empty((2, 4, 3))
    sizes = np.zeros(2, dtype=np.int64)
    for c in range(3):
        d = (c + 1) % 3
        for half in range(2):
            if (side[c] >= 0.0 and half == 0) or (side[c] <= 0.0 and half == 1):
                for k in range(3):
                    polygon[half, sizes[half], k] = pieces[at, 3 * c + k]
                sizes[half] += 1
        if side[c] * side[d] < 0.0:
            t = side[c] / (side[c] - side[d])
            for half in range(2):
                for k in range(3):
                    polygon[half, sizes[half], k] = pieces[at, 3 * c + k] + t * (
                        pieces[at, 3 * d + k] - pieces[at, 3 * c + k]
                    )
                sizes[half] += 1
    alive[at] = False
    for half in range(2):
        for corner in range(1, sizes[half] - 1):
            for k in range(3):
                pieces[count, k] = polygon[half, 0, k]
                pieces[count, 3 + k] = polygon[half, corner, k]
                pieces[count, 6 + k] = polygon[half, corner + 1, k]
            alive[count] = True
            count += 1
    return count


MOST_PIECES = 1 << 14
"""Pieces of one face from which on it is cut no further."""


@compiled
def _cut(
    corners: NDArray[np.float64],
    ids: NDArray[np.int64],
    knives: NDArray[np.float64],
    knife_ids: NDArray[np.int64],
    outlines: NDArray[np.bool_],
    starts: NDArray[np.int64],
    near: NDArray[np.int64],
    slack: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    met = np.zeros(len(corners), dtype=np.bool_)
    axis, lower, upper = np.empty(3), np.empty(3), np.empty(3)
    pieces, alive = np.empty((MOST_PIECES, 9)), np.zeros(MOST_PIECES, dtype=np.bool_)
    result, origins, total = np.empty((len(corners) + 1024, 9)), np.empty(len(corners) + 1024, dtype=np.int64), 0
    for f in range(len(corners)):
        for c in range(9):
            pieces[0, c] = corners[f, c]
        alive[0], count = True, np.int64(1)
        for d in range(3):
            lower[d] = min(corners[f, d], corners[f, 3 + d], corners[f, 6 + d]) - slack
            upper[d] = max(corners[f, d], corners[f, 3 + d], corners[f, 6 + d]) + slack
        for g in near[starts[f] : starts[f + 1]]:
            apart = False  # as most are that are in one leaf
            for d in range(3):
                apart |= lower[d] > max(knives[g, d], knives[g, 3 + d], knives[g, 6 + d])
                apart |= upper[d] < min(knives[g, d], knives[g, 3 + d], knives[g, 6 + d])
            if apart:
                continue
            shared = 0
            for i in range(3):
                for j in range(3):
                    shared += ids[f, i] == knife_ids[g, j]
            if shared > 1 or not overlap(corners[f], knives[g], slack, slack, axis):
                continue
            met[f] = True
            q = knives[g]
            nx = (q[4] - q[1]) * (q[8] - q[2]) - (q[5] - q[2]) * (q[7] - q[1])
            ny = (q[5] - q[2]) * (q[6] - q[0]) - (q[3] - q[0]) * (q[8] - q[2])
            nz = (q[3] - q[0]) * (q[7] - q[1]) - (q[4] - q[1]) * (q[6] - q[0])
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if not length > 0.0:
                continue
            nx, ny, nz = nx / length, ny / length, nz / length
            height = nx * q[0] + ny * q[1] + nz * q[2]
            flat = True
            for c in range(0, 9, 3):
                flat &= abs(corners[f, c] * nx + corners[f, c + 1] * ny + corners[f, c + 2] * nz - height) <= slack
            before = count
            for at in range(before):
                if not alive[at] or not overlap(pieces[at], q, slack, slack, axis):
                    continue
                if not flat:
                    count = _halve(pieces, alive, count, at, nx, ny, nz, height, slack)
                    continue
                for c in range(0, 9, 3):  # along each edge, whatever came of the piece before
                    if not outlines[g, c // 3]:
                        continue
                    d = (c + 3) % 9
                    ex, ey, ez = q[d] - q[c], q[d + 1] - q[c + 1], q[d + 2] - q[c + 2]
                    ax, ay, az = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
                    long = np.sqrt(ax * ax + ay * ay + az * az)
                    if not long > 0.0:
                        continue
                    level = (ax * q[c] + ay * q[c + 1] + az * q[c + 2]) / long
                    until = count
                    if alive[at]:
                        count = _halve(pieces, alive, count, at, ax / long, ay / long, az / long, level, slack)
                    for new in range(before, until):
                        if alive[new] and overlap(pieces[new], q, slack, slack, axis):
                            count = _halve(pieces, alive, count, new, ax / long, ay / long, az / long, level, slack)
        if total + count > len(result):
            more = np.empty((2 * len(result) + count, 9))
            names = np.empty(len(more), dtype=np.int64)
            for at in range(total):
                for c in range(9):
                    more[at, c] = result[at, c]
                names[at] = origins[at]
            result, origins = more, names
        for at in range(count):
            if alive[at]:
                for c in range(9):
                    result[total, c] = pieces[at, c]
                origins[total] = f
                total += 1
    return result[:total].copy(), origins[:total].copy(), met
