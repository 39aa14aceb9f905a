"""Separation of the surfaces that meet in edges of more than two faces, and at vertices.

Around an edge of a closed surface, faces at which the inside begins and faces at which it ends follow each other in
order of angle. Each of the first is paired with one of the second; what these pairs connect is separated from all else.
Where the surface bounds a solid they alternate, and each pair has the inside between it. Where bodies overlap, faces
that are connected elsewhere, through edges of two faces, are those of one body.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from .components import by_first_use, connected_components
from .edges import edge_table
from .triangles import divided_at
from .unit_vectors import angles_around


def split_at_pinches(points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Double the edges and vertices at which parts of a closed mesh touch, so that the insides of parts do not meet."""
    points, faces = separated(points, faces)
    while True:
        table = edge_table(faces)
        crowded = np.where(table.face_counts[table.face_edges] > 2, table.face_edges, len(table.vertices))
        if not (crowded < len(table.vertices)).any():
            return points, faces
        least = crowded.min(axis=1)  # of each face only one edge is divided at a time
        agreed = np.bincount(least, minlength=len(table.vertices) + 1)[:-1] == table.face_counts
        edges = np.flatnonzero(agreed & (table.face_counts > 2))
        rows, corners = np.nonzero(np.isin(table.face_edges, edges))
        middles = len(points) + np.searchsorted(edges, table.face_edges[rows, corners])
        points = np.concatenate([points, points[table.vertices[edges]].mean(axis=1)])
        points, faces = separated(points, divided_at(faces, rows, corners, middles))


def separated(points: Floats, faces: Ints, overlapping: bool = False) -> tuple[Floats, Ints]:
    """Give each fan of faces around a vertex a vertex of its own; `overlapping` keeps together what is one body.

    Edges that faces do not run along as often one way as the other connect nothing.
    """
    table = edge_table(faces)
    starts, halfedges = table.halfedges
    edges = table.face_edges.ravel()
    crowded = np.flatnonzero(table.face_counts[edges[halfedges]] > 2)  # two faces have only one order
    around = halfedges.copy()
    around[crowded] = _in_turn(points, faces, table.vertices[edges[halfedges[crowded]]], halfedges[crowded])
    labels = connected_components(len(faces), *table.pairs.T // 3) if overlapping else np.arange(len(faces))
    partners = _partners(starts, table.forward.ravel()[around], labels[around // 3])
    paired = partners >= 0
    one, other = around[paired], around[partners[paired]]
    following, beyond = (3 * (each // 3) + (each + 1) % 3 for each in (one, other))
    corners = connected_components(faces.size, np.concatenate([one, following]), np.concatenate([beyond, other]))
    if int(corners.max(initial=-1)) + 1 == np.count_nonzero(np.bincount(faces.ravel())):
        return points, faces
    numbers, _ = by_first_use(corners, int(corners.max()) + 1)
    owners = np.empty(int(numbers.max()) + 1, dtype=np.int64)
    owners[numbers] = faces.ravel()
    return points[owners], numbers.reshape(-1, 3)


def _in_turn(points: Floats, faces: Ints, ends: Ints, halfedges: Ints) -> Ints:
    """Sort (k,) halfedges, given edge by edge with (k, 2) ends of their edges, by the angles of faces around edges."""
    tails, heads = points[ends].swapaxes(0, 1)
    away = points[faces.ravel()[3 * (halfedges // 3) + (halfedges + 2) % 3]] - tails
    angles = angles_around(heads - tails, away)
    edges = np.cumsum(np.append(0, (ends[1:] != ends[:-1]).any(axis=1)))
    return halfedges[np.lexsort((angles, edges[: len(ends)]))]


@compiled
def _partners(starts: Ints, forward: Bools, labels: Ints) -> Ints:
    """Return the place at which the inside begins for each place, in order around edges, at which it ends; else −1.

    Of faces with one label, a single one at which it begins goes with a single one at which it ends; of the others, the
    first one that begins with the first one that ends.
    """
    partners = np.full(len(forward), -1)
    for edge in range(len(starts) - 1):
        first, count = starts[edge], starts[edge + 1] - starts[edge]
        rest, level = np.ones(count, dtype=np.bool_), 0
        for k in range(count):
            level += -1 if forward[first + k] else 1
            begun, ended, other = 0, 0, 0
            for j in range(count):
                if labels[first + j] == labels[first + k]:
                    if forward[first + j]:
                        ended += 1
                    else:
                        begun, other = begun + 1, j
            rest[k] = begun != 1 or ended != 1
            if forward[first + k] and not rest[k]:
                partners[first + k] = first + other
        if level != 0:
            partners[first : first + count] = -1
            continue
        least, begin = 0, 0
        for k in range(count):
            if rest[k]:
                level += -1 if forward[first + k] else 1
            if level < least:
                least, begin = level, k + 1
        waiting, head, tail = np.empty(count, dtype=np.int64), 0, 0
        for k in range(count):
            place = (begin + k) % count
            if not rest[place]:
                continue
            if forward[first + place]:
                partners[first + place] = waiting[head]
                head += 1
            else:
                waiting[tail] = first + place
                tail += 1
    return partners
