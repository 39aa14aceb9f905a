"""Fill small holes in a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.components import grouped, members_of
from ..mesh.ear_clipping import cut_into_ears
from ..mesh.edges import edge_table

MOST_SIDES = 12


def hole_fillings(
    points: NDArray[np.float64], normals: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Triangles that fill holes of at most `MOST_SIDES` sides.

    A boundary loop is a hole if the faces lie outside it: an outer boundary, however short, is left open. An ear that
    would make an edge that exists already is not cut off. Faces run counter-clockwise as seen from their normals,
    except across a few edges, and an edge has two of them at most.

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [1, 1, 0], [1.5, 1, 0], [1, 1.5, 0]])
    >>> ring = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]])
    >>> hole_fillings(points, np.tile([0.0, 0, 1], (6, 1)), ring).tolist()
    [[5, 3, 4]]
    """
    edges = edge_table(faces)
    face, side = np.nonzero(edges.face_counts[edges.face_edges] == 1)
    tails, heads = faces[face, side], faces[face, (side + 1) % 3]
    following = next_around_gap(points, normals, tails, heads)
    at_boundary = np.zeros(len(points), dtype=bool)
    at_boundary[tails] = True
    existing = {_pair(i, j) for i, j in edges.vertices[at_boundary[edges.vertices].all(axis=1)].tolist()}
    fillings: list[tuple[int, int, int]] = []
    passed = np.zeros(len(tails), dtype=bool)
    for start in range(len(tails)):
        loop = [] if passed[start] else _loop_from(start, following)
        passed[loop] = True
        if loop:
            fillings += _ears(points, normals, tails[loop[::-1]].tolist(), existing)
    return np.array(fillings, dtype=np.int64).reshape(-1, 3)


def next_around_gap(
    points: NDArray[np.float64], normals: NDArray[np.float64], tails: NDArray[np.int64], heads: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(b,) boundary edge that follows each one around the gap to its right, or −1.

    Where several leave its head, it is the first one counter-clockwise from the reversed edge: faces lie to the left.
    """
    arriving, onward = members_of(*grouped(tails, len(points)), heads)
    at = heads[arriving]
    back, forth = points[tails[arriving]] - points[at], points[heads[onward]] - points[at]
    sine = (np.cross(back, forth) * normals[at]).sum(axis=1)
    flat = [d - (d * normals[at]).sum(axis=1)[:, None] * normals[at] for d in (back, forth)]
    turn = np.mod(np.arctan2(sine, (flat[0] * flat[1]).sum(axis=1)), 2 * np.pi)
    order = np.lexsort((turn, arriving))
    following = np.full(len(tails), -1, dtype=np.int64)
    following[arriving[order[::-1]]] = onward[order[::-1]]  # the first in order is written last
    return following


def _loop_from(start: int, following: NDArray[np.int64]) -> list[int]:
    """The boundary edges of the loop through one of them; empty if they do not close."""
    loop = [start]
    while len(loop) <= MOST_SIDES:
        onward = int(following[loop[-1]])
        if onward == start:
            return loop
        if onward < 0:
            break
        loop.append(onward)
    return []


def _ears(
    points: NDArray[np.float64], normals: NDArray[np.float64], loop: list[int], existing: set[tuple[int, int]]
) -> list[tuple[int, int, int]]:
    """Triangles that fill a loop of vertices, counter-clockwise around the hole; none if it is not a hole.

    Edges of the new triangles are added to `existing`.
    """
    if len(set(loop)) < max(len(loop), 3):
        return []
    corners = points[loop]
    normal = normals[loop].sum(axis=0)
    fan = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
    if fan @ normal <= 0:
        return []
    ears = cut_into_ears(corners, normal, lambda i, k: _pair(loop[i], loop[k]) not in existing)
    existing |= {_pair(loop[i], loop[k]) for i, _, k in ears[:-1]}
    return [(loop[i], loop[j], loop[k]) for i, j, k in ears]


def _pair(i: int, j: int) -> tuple[int, int]:
    return min(i, j), max(i, j)
