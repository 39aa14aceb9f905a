"""Kernels of the local triangulations of point clouds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

MAX_SIDES = 64
TOUCHING = 1e-7  # radians by which the sectors of two triangles at a corner may overlap


@compiled
def voronoi_fans(
    x: NDArray[np.float64], y: NDArray[np.float64], reach: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Delaunay neighbours of the origin among the points of each row, counter-clockwise.

    The Voronoi cell of the origin starts as a square and is cut by the bisectors of its neighbours, nearest first. Two
    neighbours whose sides of the cell meet span a Delaunay triangle with the origin, and the corner between them is its
    circumcentre: no circumradius exceeds the square's.

    Parameters
    ----------
    x, y : (n, k) float
        Neighbours of each point in its own tangent plane, relative to the point, nearest first.
    reach : (n,) float
        Half the side of the square.

    Returns
    -------
    neighbours : (n, MAX_SIDES) int
        Column of the neighbour beyond each side of the cell; −1 on sides that are left of the square.
    counts : (n,) int
        Number of sides.
    """
    n, k = x.shape
    neighbours = np.full((n, MAX_SIDES), -1, dtype=np.int64)
    counts = np.zeros(n, dtype=np.int64)
    for i in range(n):
        corner = np.empty((MAX_SIDES, 2))  # corner c is where side c starts
        beyond = np.full(MAX_SIDES, -1, dtype=np.int64)
        new_corner = np.empty((MAX_SIDES, 2))
        new_beyond = np.empty(MAX_SIDES, dtype=np.int64)
        r = reach[i]
        corner[0, 0], corner[1, 0], corner[2, 0], corner[3, 0] = r, r, -r, -r
        corner[0, 1], corner[1, 1], corner[2, 1], corner[3, 1] = -r, r, r, -r
        m, farthest = 4, 2 * r * r
        for j in range(k):
            px, py = x[i, j], y[i, j]
            square = px * px + py * py
            if square > 4 * farthest or square < 1e-24 * r * r:
                continue
            half = 0.5 * square
            slack = 1e-9 * half  # a bisector that only touches a corner of the cell does not cut it
            cut = False
            for c in range(m):
                cut = cut or corner[c, 0] * px + corner[c, 1] * py > half + slack
            if not cut or m + 1 >= MAX_SIDES:
                continue
            new = 0
            for c in range(m):
                d = (c + 1) % m
                here = corner[c, 0] * px + corner[c, 1] * py - half
                there = corner[d, 0] * px + corner[d, 1] * py - half
                if here <= slack:
                    new_corner[new, 0], new_corner[new, 1] = corner[c, 0], corner[c, 1]
                    new_beyond[new] = beyond[c]
                    new += 1
                if (here <= slack) != (there <= slack):
                    s = min(max(here / (here - there), 0.0), 1.0)
                    for axis in range(2):
                        new_corner[new, axis] = corner[c, axis] + s * (corner[d, axis] - corner[c, axis])
                    new_beyond[new] = j if here <= slack else beyond[c]
                    new += 1
            m, farthest = new, 0.0
            for c in range(m):
                corner[c, 0], corner[c, 1] = new_corner[c, 0], new_corner[c, 1]
                beyond[c] = new_beyond[c]
                farthest = max(farthest, corner[c, 0] ** 2 + corner[c, 1] ** 2)
        counts[i] = m
        for c in range(m):
            neighbours[i, c] = beyond[c]
    return neighbours, counts


@compiled
def accept_apart(
    triangles: NDArray[np.int64], starts: NDArray[np.float64], widths: NDArray[np.float64], n_points: int
) -> NDArray[np.bool_]:
    """(m,) triangles whose sector overlaps that of no triangle accepted earlier, at any of their three corners.

    At corner k of triangle f the sector goes from angle ``starts[f, k]`` counter-clockwise by ``widths[f, k]``.
    """
    accepted = np.zeros(len(triangles), dtype=np.bool_)
    taken = np.zeros((n_points, MAX_SIDES, 2))
    count = np.zeros(n_points, dtype=np.int64)
    for f in range(len(triangles)):
        apart = True
        for k in range(3):
            v = triangles[f, k]
            apart = apart and count[v] < MAX_SIDES
            for s in range(count[v]):
                ahead = (starts[f, k] - taken[v, s, 0]) % (2 * np.pi)
                behind = (taken[v, s, 0] - starts[f, k]) % (2 * np.pi)
                inside = min(ahead, behind) > TOUCHING and (ahead < taken[v, s, 1] - TOUCHING)
                around = min(ahead, behind) > TOUCHING and (behind < widths[f, k] - TOUCHING)
                same = min(ahead, behind) <= TOUCHING and min(widths[f, k], taken[v, s, 1]) > TOUCHING
                apart = apart and not (inside or around or same)
        if apart:
            accepted[f] = True
            for k in range(3):
                v = triangles[f, k]
                taken[v, count[v], 0], taken[v, count[v], 1] = starts[f, k], widths[f, k]
                count[v] += 1
    return accepted
