"""Separation of surfaces that meet in edges of more than two faces, or at vertices.

Going around an edge of a closed surface, one enters the inside at some faces and leaves it at others. Each face of the
first kind is paired with one of the second, and the surface is cut open between different pairs. Where the surface
bounds a solid, the two kinds alternate, and the inside is between the faces of a pair. Where bodies overlap, faces that
are connected elsewhere, through edges of two faces, are paired as those of one body.
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
    """Double edges and vertices at which parts of a closed mesh touch, so that the mesh becomes manifold.

    Edges that would still have more than two faces are divided at their midpoints. Returns points and faces.
    """
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
    """Give each fan of faces around a vertex a vertex of its own; return points and faces.

    Faces are connected across edges as the module says, with `overlapping` as those of overlapping bodies. Edges along
    which not as many faces run in one direction as in the other connect no faces.
    """
    table = edge_table(faces)
    starts, halfedges = table.halfedges
    edges = table.face_edges.ravel()
    crowded = np.flatnonzero(table.face_counts[edges[halfedges]] > 2)  # two faces have only one order
    around = halfedges.copy()
    around[crowded] = _sorted_by_angle(points, faces, table.vertices[edges[halfedges[crowded]]], halfedges[crowded])
    labels = connected_components(len(faces), *table.pairs.T // 3) if overlapping else np.arange(len(faces))
    partners = _partners(starts, table.forward.ravel()[around], labels[around // 3])
    # corners are of one vertex if they are connected across the edges of pairs, which run opposite ways
    paired = partners >= 0
    leaving, entering = around[paired], around[partners[paired]]
    leaving_next, entering_next = (3 * (h // 3) + (h + 1) % 3 for h in (leaving, entering))
    corners = connected_components(
        faces.size, np.concatenate([leaving, leaving_next]), np.concatenate([entering_next, entering])
    )
    if int(corners.max(initial=-1)) + 1 == np.count_nonzero(np.bincount(faces.ravel())):
        return points, faces
    numbers, _ = by_first_use(corners, int(corners.max()) + 1)
    owners = np.empty(int(numbers.max()) + 1, dtype=np.int64)
    owners[numbers] = faces.ravel()
    return points[owners], numbers.reshape(-1, 3)


def _sorted_by_angle(points: Floats, faces: Ints, ends: Ints, halfedges: Ints) -> Ints:
    """Sort (k,) halfedges of each edge by the angles of their faces around the edge.

    Halfedges are given edge by edge, with the (k, 2) tails and heads of their edges.
    """
    tails, heads = points[ends].swapaxes(0, 1)
    away = points[faces.ravel()[3 * (halfedges // 3) + (halfedges + 2) % 3]] - tails
    angles = angles_around(heads - tails, away)
    edges = np.cumsum(np.append(0, (ends[1:] != ends[:-1]).any(axis=1)))
    return halfedges[np.lexsort((angles, edges[: len(ends)]))]


@compiled
def _partners(starts: Ints, forward: Bools, labels: Ints) -> Ints:
    """Pair halfedges at which one leaves the inside, going around an edge, with those at which one enters it.

    The halfedges of edge e, sorted by angle, have indices starts[e] to starts[e + 1] − 1. One leaves the inside at
    `forward` ones, (h,). Of halfedges with the same label, (h,), one of each kind is a pair if there is one of each.
    Others are paired in order, the first that enters with the first that leaves. Returns (h,) the index of the partner
    of each halfedge at which one leaves, and −1 elsewhere, also at edges without as many of both kinds.
    """
    partners = np.full(len(forward), -1)
    for edge in range(len(starts) - 1):
        # pair those that are alone of their kind with a label
        first, count = starts[edge], starts[edge + 1] - starts[edge]
        rest, level = np.ones(count, dtype=np.bool_), 0
        for k in range(count):
            level += -1 if forward[first + k] else 1
            n_entering, n_leaving, entering = 0, 0, 0
            for j in range(count):
                if labels[first + j] == labels[first + k]:
                    if forward[first + j]:
                        n_leaving += 1
                    else:
                        n_entering, entering = n_entering + 1, j
            rest[k] = n_entering != 1 or n_leaving != 1
            if forward[first + k] and not rest[k]:
                partners[first + k] = first + entering
        if level != 0:
            partners[first : first + count] = -1
            continue
        # begin where the level of the rest is least, so that nobody leaves before somebody has entered
        least, begin = 0, 0
        for k in range(count):
            if rest[k]:
                level += -1 if forward[first + k] else 1
            if level < least:
                least, begin = level, k + 1
        waiting, head, tail = np.empty(count, dtype=np.int64), 0, 0
        for k in range(count):
            index = (begin + k) % count
            if not rest[index]:
                continue
            if forward[first + index]:
                partners[first + index] = waiting[head]
                head += 1
            else:
                waiting[tail] = first + index
                tail += 1
    return partners
