"""Triangulation of a point cloud: local Delaunay triangulations in tangent planes, reconciled by votes.

Every point triangulates its neighbours in its own tangent plane (as for the Laplacian of Sharp & Crane 2020) and
proposes the triangles around itself. A triangle has one vote for each of its corners that proposes it. Triangles are
accepted in order of votes, then of roundness, unless they overlap an accepted one around one of their corners. The
result is a mesh with at most two faces at every edge.

The two sides of a thin plate lie in the same tangent planes, and only normals keep them apart. So points first
triangulate the neighbours on their own side; what they propose among all of them comes last, and joins the sides where
they end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import in_chunks
from .components import connected_components
from .edges import edge_table
from .hole_filling import hole_fillings
from .nearest import TriangleTree
from .signed_graph import Links, signs_of
from .welding import distinct_rows

OPPOSITE = -0.5
"""Cosine between the normals of two points below which they lie on different sides of a plate, if one is over the
other. Halved, no plate or bowl of .5 to 2.5 spacings changes; at -1, where no sides are kept apart, 5 to 94 % of bowls
are wrong."""
OVER = 0.05
"""Height over a point's tangent plane, relative to the reach of its neighbours, about three times their spacing, from
which another one is over it: those in the plane lie on the same side, whatever their normals.
At 0, halved and doubled, no plate or bowl of .5 to 2.5 spacings changes; at 0, a Möbius strip lacks 9 of 4,849
triangles where its normals turn over."""
GIVEN = 1.0
"""Weight of a given normal, relative to that of a neighbour in the same plane, of which there are six."""
_CHUNK = 65536


@dataclass(frozen=True, eq=False)
class LocalTriangulations:
    """Triangles on points.

    Attributes
    ----------
    faces : (m, 3) int
        Point ids, oriented alike as far as the surface allows.
    normals : (n, 3) float
        Unit normals, on the side from which the faces at each point run counter-clockwise.
    """

    faces: NDArray[np.int64]
    normals: NDArray[np.float64]


def local_triangulations(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    n_neighbors: int = 30,
    given: NDArray[np.float64] | None = None,
) -> LocalTriangulations:
    """Triangulate points sampled from an unknown surface, in O(n log n) time.

    Parameters
    ----------
    points : (n, 3) float
        Distinct points.
    normals : (n, 3) float
        Unit normals, consistent with each other but for single ones.
    n_neighbors : int
        Size of the neighbourhoods. No triangle has a circumradius beyond the distance to the last neighbour.
    given : (n, 3) float, optional
        Unit normals to whose side each connected component is turned as a whole; `normals` by default.

    Notes
    -----
    Where the local triangulations disagree, triangles are split at points that all proposals have left out, and small
    holes are filled.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> local_triangulations(square, np.tile([0.0, 0, 1], (4, 1)), n_neighbors=3).faces.tolist()
    [[0, 1, 2], [0, 2, 3]]
    """
    axes, neighbors, reach = tangent_planes(points, normals, n_neighbors)
    beside = on_one_side(points[neighbors] - points[:, None], normals[neighbors], normals, reach)
    opposed = np.flatnonzero(~beside.all(axis=1))
    first = proposed_triangles(points, axes, neighbors, reach, np.arange(len(points)), beside)
    last = proposed_triangles(points, axes, neighbors, reach, opposed, np.ones_like(beside))
    both = np.concatenate([first[0], last[0]])
    once = np.sort(distinct_rows(both)[1])
    candidates, votes, joins = both[once], np.concatenate([first[1], last[1]])[once], once >= len(first[0])
    keep, circumradii = well_shaped_triangles(points, candidates, reach)
    candidates, votes, joins = candidates[keep], votes[keep], joins[keep]
    axis = axes[:, 2]
    if len(candidates) == 0:
        return LocalTriangulations(candidates, axis)
    faces = nonoverlapping_triangles(points, axes, candidates[np.lexsort((circumradii, -votes, joins))])
    faces = split_at_points_left(points, faces, candidates)
    oriented = axis * aligned(axis, faces, normals, normals if given is None else given)[:, None]
    faces = facing(points, oriented, faces)
    return LocalTriangulations(np.concatenate([faces, hole_fillings(points, oriented, faces)]), oriented)


def tangent_planes(
    points: NDArray[np.float64], normals: NDArray[np.float64], n_neighbors: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Axes (n, 3, 3) of each point's tangent plane, the normal last; neighbours (n, k); distance (n,) to the last.

    Planes are fitted to the neighbours on the same side: normals that come with scans often belong to another mesh, and
    fit worse.
    """
    k = min(n_neighbors, len(points) - 1)
    tree = scipy.spatial.cKDTree(points)

    def fitted(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        some, sides = rows[:, :3], rows[:, 3:]
        distances, near = tree.query(some, k=k + 1)
        offsets, reach = points[near] - some[:, None], distances[:, -1]
        weights = np.exp(-((2 * distances / reach[:, None]) ** 2)) * on_one_side(offsets, normals[near], sides, reach)
        return principal_axes(offsets, weights), near[:, 1:], reach

    axes, neighbors, reach = in_chunks(fitted, np.column_stack([points, normals]))
    return axes, neighbors, reach


def on_one_side(
    offsets: NDArray[np.float64],
    normals: NDArray[np.float64],
    normal: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(n, k) whether points at offsets (n, k, 3) from one with a normal (n, 3) lie on its side of a plate."""
    alike = np.einsum("nkd,nd->nk", normals, normal) > OPPOSITE
    return alike | (np.abs(np.einsum("nkd,nd->nk", offsets, normal)) < OVER * reach[:, None])


def principal_axes(offsets: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3) principal axes of each row of (n, k, 3) offsets with (n, k) weights, longest first."""
    weights = weights[..., None]
    offsets = offsets - (weights * offsets).sum(axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True)
    covariance = (weights * offsets).transpose(0, 2, 1) @ offsets
    first, second = np.moveaxis(np.linalg.eigh(covariance)[1][:, :, :0:-1], 2, 0)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def proposed_triangles(
    points: NDArray[np.float64],
    axes: NDArray[np.float64],
    neighbors: NDArray[np.int64],
    reach: NDArray[np.float64],
    centers: NDArray[np.int64],
    used: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(m, 3) triangles that some points propose among their neighbours (n, k) that are used, and (m,) votes for each.

    Each triangle is there once, its corners in increasing order.
    """
    triangles = [np.empty((0, 3), dtype=np.int64)]
    for begin in range(0, len(centers), _CHUNK):
        chunk = centers[begin : begin + _CHUNK]
        offsets = (points[neighbors[chunk]] - points[chunk, None]) * used[chunk, :, None]
        x, y = (np.einsum("nki,ni->nk", offsets, axes[chunk, a]) for a in range(2))
        order = np.argsort(x * x + y * y, axis=1)
        x, y = np.take_along_axis(x, order, axis=1), np.take_along_axis(y, order, axis=1)
        sides, counts = in_chunks(voronoi_fans, np.stack([x, y], axis=2) / reach[chunk, None, None])
        column = np.arange(sides.shape[1])
        following = np.where(column + 1 < counts[:, None], np.roll(sides, -1, axis=1), sides[:, :1])
        row, at = np.nonzero((column < counts[:, None]) & (sides >= 0) & (following >= 0))
        near = np.take_along_axis(neighbors[chunk], order, axis=1)
        triangles.append(np.stack([chunk[row], near[row, sides[row, at]], near[row, following[row, at]]], axis=1))
    sorted_corners = np.sort(np.concatenate(triangles), axis=1)
    number, first = distinct_rows(sorted_corners)
    found = sorted_corners[first]
    order = np.lexsort(found.T[::-1])
    return found[order], np.bincount(number)[order]


def well_shaped_triangles(
    points: NDArray[np.float64], triangles: NDArray[np.int64], reach: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Ids of triangles with area whose circumradius is within the reach of all their corners, and the radii."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    u, v, w = b - a, c - b, a - c
    twice_area = np.linalg.norm(np.cross(u, w), axis=1)
    product = np.prod([np.linalg.norm(side, axis=1) for side in (u, v, w)], axis=0)
    limit = reach[triangles].min(axis=1)
    keep = np.flatnonzero((product <= 2 * limit * twice_area) & (twice_area > 0))
    return keep, product[keep] / (2 * twice_area[keep])


def nonoverlapping_triangles(
    points: NDArray[np.float64], axes: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The triangles, in the given order, that overlap no earlier one around any of their corners.

    Two triangles overlap if the sectors that they occupy in the tangent plane of a common corner do.
    """
    starts, widths = np.empty(triangles.shape), np.empty(triangles.shape)
    for k in range(3):
        here, right, left = (triangles[:, (k + shift) % 3] for shift in range(3))
        angle = []
        for there in (right, left):
            step = points[there] - points[here]
            angle.append(np.arctan2((step * axes[here, 1]).sum(axis=1), (step * axes[here, 0]).sum(axis=1)))
        turn = np.mod(angle[1] - angle[0] + np.pi, 2 * np.pi) - np.pi
        starts[:, k], widths[:, k] = np.where(turn < 0, angle[1], angle[0]), np.abs(turn)
    return triangles[accept_apart(triangles, starts, widths, len(points))]


def split_at_points_left(
    points: NDArray[np.float64], faces: NDArray[np.int64], candidates: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The triangles, the nearest to each point that has candidates but no triangle split in three there.

    Tangent planes around such a point lie so differently that each triangle proposed at it overlaps others. Points
    without candidates are outliers.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [1, 1, 0.5], [1, 1, 9]])
    >>> split_at_points_left(corners, np.array([[0, 1, 2]]), np.array([[0, 1, 2], [0, 1, 3]])).tolist()
    [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
    """
    while len(left := np.setdiff1d(candidates, faces)):
        nearest, _ = TriangleTree.of(points[faces]).nearest(points[left])
        split, first = np.unique(nearest, return_index=True)
        around = faces[split]
        parts = [np.column_stack([around[:, k], around[:, (k + 1) % 3], left[first]]) for k in range(3)]
        faces = np.concatenate([np.delete(faces, split, axis=0), *parts])
    return faces


def aligned(
    axes: NDArray[np.float64],
    faces: NDArray[np.int64],
    normals: NDArray[np.float64],
    given: NDArray[np.float64],
) -> NDArray[np.int64]:
    """(n,) signs that make axes agree with those of their neighbours and with normals.

    Each connected component is then turned to the side to which most of the given normals point.
    """
    n = len(axes)
    tail, head = edge_table(faces).vertices.T
    parts = connected_components(n, tail, head)
    across = (axes[tail] * axes[head]).sum(axis=1)
    links = Links(tail, head, across * np.abs(across))  # planes at a crease say little
    own = GIVEN * (axes * normals).sum(axis=1)
    found = signs_of(Links.joined(links, Links(np.arange(n), np.full(n, n), own)), n + 1)
    signs = (found[:n] * found[n]).astype(np.int64)
    preference = np.bincount(parts, signs * (axes * given).sum(axis=1))
    return np.where(preference < 0, -1, 1)[parts] * signs


def facing(points: NDArray[np.float64], normals: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces, turned to be counter-clockwise as seen from the side to which the normals of their corners point."""
    a, b, c = points[faces].transpose(1, 0, 2)
    against = (np.cross(b - a, c - a) * normals[faces].sum(axis=1)).sum(axis=1) < 0
    return np.where(against[:, None], faces[:, [0, 2, 1]], faces)


MAX_SIDES = 64
TOUCHING = 1e-7  # radians by which the sectors of two triangles at a corner may overlap


@compiled
def voronoi_fans(places: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Delaunay neighbours of the origin among the points of each row, counter-clockwise.

    The Voronoi cell of the origin starts as a square, to ±1, and is cut by the bisectors of its neighbours, nearest
    first. Two neighbours whose sides of the cell meet span a Delaunay triangle with the origin, and the corner between
    them is its circumcentre: no circumradius exceeds the square's.

    Parameters
    ----------
    places : (n, k, 2) float
        Neighbours of each point in its own tangent plane, relative to the point, nearest first.

    Returns
    -------
    neighbours : (n, MAX_SIDES) int
        Column of the neighbour beyond each side of the cell; −1 on sides that are left of the square.
    counts : (n,) int
        Number of sides.
    """
    n, k = places.shape[:2]
    neighbours = np.full((n, MAX_SIDES), -1, dtype=np.int64)
    counts = np.zeros(n, dtype=np.int64)
    for i in range(n):
        corner = np.empty((MAX_SIDES, 2))  # corner c is where side c starts
        beyond = np.full(MAX_SIDES, -1, dtype=np.int64)
        new_corner = np.empty((MAX_SIDES, 2))
        new_beyond = np.empty(MAX_SIDES, dtype=np.int64)
        corner[0, 0], corner[1, 0], corner[2, 0], corner[3, 0] = 1.0, 1.0, -1.0, -1.0
        corner[0, 1], corner[1, 1], corner[2, 1], corner[3, 1] = -1.0, 1.0, 1.0, -1.0
        m, farthest = 4, 2.0
        for j in range(k):
            px, py = places[i, j]
            square = px * px + py * py
            if square > 4 * farthest or square < 1e-24:
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
