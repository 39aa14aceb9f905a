"""Kernels: the circumcentre of a face, where a new vertex would be inserted, and the segments that it encroaches upon.

Faces are unfolded one after the other, across the edges between them, into the plane of the first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.gluing_kernels import Gluing, apex_position, following, kernel, preceding, tangent_at

INSIDE, BLOCKED, LOST = 0, 1, 2


@kernel
def unfold(g: Gluing, h: int, side: int, tx: float, ty: float, hx: float, hy: float) -> tuple[float, float, int]:
    """Unfold the face on the other side of halfedge h, which runs from (tx, ty) to (hx, hy): its apex and its sense.

    `side` is 1 where the face of h is laid out counter-clockwise, −1 where clockwise; so is the sense returned.
    """
    t = g.sibling[h]
    if g.forward[t] == g.forward[h]:
        side = -side
    else:
        tx, ty, hx, hy = hx, hy, tx, ty
    x, y = apex_position(g, t)
    length = g.length[g.edge[t]]
    ux, uy = (hx - tx) / length, (hy - ty) / length
    return tx + x * ux - side * y * uy, ty + x * uy + side * y * ux, side


@kernel
def cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Twice the signed area of abc."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def find_circumcenter(g: Gluing, f: int) -> tuple[int, int, float, float]:
    """Walk straight from the barycentre of a face to its circumcentre.

    Returns INSIDE with the face that contains it and its position there (first halfedge along x), BLOCKED with a
    halfedge of the segment in between, or LOST where the face is flat.
    """
    x, y = np.zeros(3), np.zeros(3)
    x[1] = g.length[g.edge[3 * f]]
    x[2], y[2] = apex_position(g, 3 * f)
    if not y[2] > 0.0:
        return LOST, f, 0.0, 0.0
    cx, cy = 0.5 * x[1], 0.5 * (x[2] * (x[2] - x[1]) / y[2] + y[2])
    if not np.isfinite(cy):
        return LOST, f, 0.0, 0.0
    sx, sy = x.sum() / 3.0, y.sum() / 3.0
    side, entry = 1, -1
    for _ in range(100000):
        leaving, worst, outside = -1, 0.0, 0.0
        area = cross(x[0], y[0], x[1], y[1], x[2], y[2])
        for k in range(3):
            l = (k + 1) % 3
            beyond = -cross(x[k], y[k], x[l], y[l], cx, cy) / area
            left, right = cross(sx, sy, cx, cy, x[k], y[k]), cross(sx, sy, cx, cy, x[l], y[l])
            outside = max(outside, beyond)
            if k != entry and beyond > worst and left * right <= 0.0:
                leaving, worst = k, beyond
        if leaving < 0 and not outside < 1e-9:
            return LOST, f, 0.0, 0.0
        if leaving < 0:
            break
        h = 3 * f + leaving
        if g.fixed[g.edge[h]]:
            return BLOCKED, h, 0.0, 0.0
        l = (leaving + 1) % 3
        t = g.sibling[h]
        kt = t % 3
        ax, ay, turned = unfold(g, h, side, x[leaving], y[leaving], x[l], y[l])
        if turned == side:
            x[leaving], y[leaving], x[l], y[l] = x[l], y[l], x[leaving], y[leaving]
        tx, ty, hx, hy = x[leaving], y[leaving], x[l], y[l]
        x[kt], y[kt], x[(kt + 1) % 3], y[(kt + 1) % 3], x[(kt + 2) % 3], y[(kt + 2) % 3] = tx, ty, hx, hy, ax, ay
        f, side, entry = t // 3, turned, kt
    base = g.length[g.edge[3 * f]]
    ux, uy = (x[1] - x[0]) / base, (y[1] - y[0]) / base
    px, py = (cx - x[0]) * ux + (cy - y[0]) * uy, side * ((cy - y[0]) * ux - (cx - x[0]) * uy)
    return INSIDE, f, px, py


@kernel
def encroached(g: Gluing, f: int, px: float, py: float, ends: NDArray[np.float64], halfedges: NDArray[np.int64]) -> int:
    """A segment that p encroaches upon: visible from p, which lies in its diametral circle. −1 if there is none.

    p is given in the frame of face f. `ends` and `halfedges` are work arrays for the search.
    """
    x, y = np.zeros(3), np.zeros(3)
    x[1] = g.length[g.edge[3 * f]]
    x[2], y[2] = apex_position(g, 3 * f)
    count, visited = 0, 0
    for k in range(3):
        l = (k + 1) % 3
        halfedges[count] = 3 * f + k
        ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3], ends[count, 4] = x[k], y[k], x[l], y[l], 1.0
        count += 1
    while count > 0:
        count -= 1
        h: int = halfedges[count]
        tx, ty, hx, hy, side = ends[count]
        dot = (tx - px) * (hx - px) + (ty - py) * (hy - py)
        if g.fixed[g.edge[h]]:
            if dot < 0.0:
                return h
            continue
        t = g.sibling[h]
        n, d = tangent_at(g, preceding(t))
        in_circle = dot * 2.0 * np.sqrt(n * d) + (d - n) * abs(cross(px, py, tx, ty, hx, hy)) < 0.0
        visited += 1
        if not in_circle or count + 2 > len(ends) or visited > len(ends):
            continue
        ax, ay, turned = unfold(g, h, side, tx, ty, hx, hy)
        if turned == side:
            tx, ty, hx, hy = hx, hy, tx, ty
        halfedges[count], halfedges[count + 1] = following(t), preceding(t)
        ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3], ends[count, 4] = hx, hy, ax, ay, turned
        count += 1
        ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3], ends[count, 4] = ax, ay, tx, ty, turned
        count += 1
    return -1
