"""Faces that are lost while their vertices are there: small holes, closed by the triangles that bend least.

The surface across a hole that lost no vertices is known but for its diagonals. Of all triangulations of the hole's
loop, the one whose edges bend least, ``Σ length · angle`` with the rim's edges included (twice the total absolute mean
curvature), continues the faces around it; dynamic programming over the loop finds it (Barequet and Sharir 1995,
Liepa 2003), each part of a loop keeping the triangle at its end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.components import sums_of
from ..geometry.directions import unit
from ..geometry.edges import edge_keys, edge_table
from ..geometry.hole_filling import next_around_gap
from ..geometry.meshes import area_vectors

MOST_SIDES = 16
"""Sides of a hole from which on vertices, too, may be lost."""
BENT = np.deg2rad(70.0)
"""Root mean square of the angles at the rim from which on a lid does not continue the surface around it: at the end of
a tube it is 90°."""
TOGETHER = 4096
"""Holes that are triangulated at once."""


def lost_faces(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k, 3) triangles that close the small holes of a surface whose faces agree with their neighbours.

    They are between the same vertices and oriented as the others, and close holes of at most `MOST_SIDES` sides across
    which the surface goes on.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(2)
    >>> sorted(lost_faces(ball.vertices, ball.faces[1:])[0]) == sorted(ball.faces[0])
    True
    """
    table = edge_table(faces)
    alone = (np.bincount(faces.ravel(), minlength=len(vertices)) == 1)[faces].all(axis=1)
    owners, sides = np.nonzero((table.face_counts[table.face_edges] == 1) & ~alone[:, None])
    found = [np.empty((0, 3), dtype=np.int64)]
    if not len(owners):
        return found[0]
    tails, heads = faces[owners, sides], faces[owners, (sides + 1) % 3]
    face_normals = unit(area_vectors(vertices[faces]))
    normals = unit(sums_of(np.repeat(face_normals, 3, axis=0), faces.ravel(), len(vertices)))
    following = next_around_gap(vertices, normals, tails, heads)
    touching = np.zeros(len(vertices), dtype=bool)
    touching[tails] = True
    existing = table.vertices[touching[table.vertices].all(axis=1)]
    taken = np.sort(edge_keys(existing[:, 0], existing[:, 1]))
    for loops in _simple_loops(tails.tolist(), following.tolist()):
        for begin in range(0, len(loops), TOGETHER):
            edges = loops[begin : begin + TOGETHER, ::-1]  # around the hole, against the faces
            found.append(_lids(vertices, heads[edges], face_normals[owners[edges]], taken))
    return np.concatenate(found)


def _simple_loops(tails: list[int], following: list[int]) -> list[NDArray[np.int64]]:
    """Edges of loops that pass no vertex twice, (l, n) for each n; loops that touch themselves come apart there."""
    loops: dict[int, list[list[int]]] = {}
    passed = [False] * len(tails)
    for first in range(len(tails)):
        walk: list[int] = []
        places: dict[int, int] = {}
        edge = first
        while edge >= 0:
            begin = places.get(tails[edge])
            if begin is not None:
                loop = walk[begin:]
                del walk[begin:]
                for each in loop:
                    del places[tails[each]]
                if 3 <= len(loop) <= MOST_SIDES:
                    loops.setdefault(len(loop), []).append(loop)
            if passed[edge]:
                break
            passed[edge] = True
            places[tails[edge]] = len(walk)
            walk.append(edge)
            edge = following[edge]
    return [np.array(loops[n]) for n in sorted(loops)]


def _lids(
    vertices: NDArray[np.float64], loops: NDArray[np.int64], rim_normals: NDArray[np.float64], taken: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(k, 3) triangles that close holes of n sides across which the surface bends by an angle of at most `BENT`.

    Of each hole there are the vertices around it, (l, n), and the unit normals of the faces at the edges that begin
    there, (l, n, 3); edges with one of the sorted keys are there already. ``bends[i, j]`` is that of the best lid
    between the i-th and the j-th vertex, but for the edge that joins the two, ``rims[i, j]`` the sum of lengths times
    squared angles at the rim, and ``normals[i, j]`` that of its triangle there.
    """
    count, n = loops.shape
    corners, every = vertices[loops].transpose(1, 0, 2), np.arange(count)
    lengths = np.linalg.norm(corners[:, None] - corners, axis=-1)
    bends, rims = np.zeros((n, n, count)), np.zeros((n, n, count))
    normals, apexes = np.zeros((n, n, count, 3)), np.zeros((n, n, count), dtype=np.int64)
    for i in range(n - 1):
        normals[i, i + 1] = rim_normals[:, i]
    for span in range(2, n):
        for i in range(n - span):
            j = i + span
            made = np.array([unit(area_vectors(vertices[loops[:, [i, k, j]]])) for k in range(i + 1, j)])
            before, behind = _angles(made, normals[i, i + 1 : j]), _angles(made, normals[i + 1 : j, j])
            sums = bends[i, i + 1 : j] + lengths[i, i + 1 : j] * before
            sums += bends[i + 1 : j, j] + lengths[i + 1 : j, j] * behind
            best = np.argmin(sums, axis=0)
            bends[i, j] = sums[best, every]
            if span < n - 1:
                keys = edge_keys(loops[:, i], loops[:, j])
                at = np.minimum(np.searchsorted(taken, keys), len(taken) - 1)
                bends[i, j][taken[at] == keys] = np.inf
            at_rim = rims[i, i + 1 : j] + rims[i + 1 : j, j]
            at_rim[0] += lengths[i, i + 1] * before[0] ** 2
            at_rim[-1] += lengths[j - 1, j] * behind[-1] ** 2
            rims[i, j], normals[i, j], apexes[i, j] = at_rim[best, every], made[best, every], best + i + 1
    at_rim = rims[0, -1] + lengths[-1, 0] * _angles(normals[0, -1], rim_normals[:, -1]) ** 2
    around = lengths[np.arange(n), np.arange(n) - 1].sum(axis=0)
    triangles, of_hole = _triangles(apexes, np.flatnonzero(np.isfinite(bends[0, -1])))
    closed = at_rim <= BENT**2 * around
    result: NDArray[np.int64] = np.take_along_axis(loops[of_hole], triangles, axis=1)[closed[of_hole]]
    return result


def _triangles(apexes: NDArray[np.int64], holes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k, 3) places around loops of the corners of the triangles of some holes' best lids, and the hole of each."""
    triangles, owners = [np.empty((0, 3), dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    parts = [(0, len(apexes) - 1, holes)]
    while parts:
        i, j, some = parts.pop()
        for k in np.unique(apexes[i, j, some]).tolist() if j - i > 1 else []:
            here = some[apexes[i, j, some] == k]
            triangles.append(np.tile([i, k, j], (len(here), 1)))
            owners.append(here)
            parts += [(i, k, here), (k, j, here)]
    return np.concatenate(triangles), np.concatenate(owners)


def _angles(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) angles between (..., 3) unit vectors; 0 where one of them is 0."""
    flat = ~np.logical_and(one.any(axis=-1), other.any(axis=-1))
    angles: NDArray[np.float64] = np.arccos(np.clip(np.einsum("...j,...j->...", one, other), -1.0, 1.0))
    return np.where(flat, 0.0, angles)
