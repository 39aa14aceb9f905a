"""Rims: where oriented faces end, as closed loops."""

from __future__ import annotations

import itertools

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.components import grouped, next_in_groups, sums_of
from ..mesh.edges import edge_table
from ..mesh.triangles import corner_normals
from ..mesh.unit_vectors import SAME_WAY, angles_around, unit

EDGE_PLACES = 8
"""Number of places on an edge from which edges that run along it are searched for, nearer together than
`ALONG_EDGE`."""
ALONG_EDGE = 0.1
"""Two edges run along each other within this distance, relative to the longer one. Chords of the same arc are less than
.05 apart if it has 16 or more."""
SHARED_PLACES = 3
"""Number of places of one of two edges that lie along the other. Edges that only meet at a corner share fewer."""
STRAIGHT_RIM = 1e-5
"""A vertex is no corner if the angle between its two edges is at most this, in radians."""


def open_edges(faces: Ints, parts: Ints) -> tuple[Ints, Ints]:
    """(k, 2) directed edges that the faces of each part lack, with multiplicity; and (k,) their parts, ascending."""
    table = edge_table(faces)
    owners, edges, excess = table.unbalanced(parts)
    ends = table.vertices[edges]
    missing = np.where(excess[:, None] > 0, ends[:, ::-1], ends)
    return np.repeat(missing, np.abs(excess), axis=0), np.repeat(owners, np.abs(excess))


def boundary(faces: Ints) -> Ints:
    """(k, 2) directed edges that faces lack, with multiplicity: together with them, all edges are balanced."""
    return open_edges(faces, np.zeros(len(faces), dtype=np.int64))[0]


def loops(vertices: Floats, faces: Ints, edges: Ints) -> list[Ints]:
    """Find closed loops around the gaps of faces, along all boundary edges; no loop passes a vertex twice.

    Where gaps meet at a vertex, an edge is followed by the edge on the other side of the gap beside it. Walks
    begin far from the middle, so that gaps connected at vertices are separated there.
    """
    if not len(edges):
        return []
    tails, heads = edges.T
    n_edges, n = len(edges), len(vertices)
    ends = np.concatenate([tails, heads])
    crossing = np.zeros(n, dtype=bool)
    crossing[np.bincount(tails, minlength=n) > 1] = True
    angles = np.zeros(2 * n_edges)
    around = np.flatnonzero(crossing[ends])
    if len(around):
        directions = vertices[np.concatenate([heads, tails])[around]] - vertices[ends[around]]
        beside = faces[crossing[faces].any(axis=1)]
        normals = sums_of(corner_normals(vertices[beside]), beside.ravel(), n)
        angles[around] = angles_around(unit(normals)[ends[around]], directions)
    order = np.lexsort((angles, ends))
    names = np.concatenate([np.arange(n_edges), -1 - np.arange(n_edges)])[order]
    following = _across_gaps(grouped(ends, n)[0], names)
    middles, lengths = vertices[edges].mean(axis=1), np.linalg.norm(vertices[heads] - vertices[tails], axis=1)
    centre = np.average(middles, weights=lengths + np.finfo(float).tiny, axis=0)
    farthest = np.argsort(-np.linalg.norm(middles - centre, axis=1), kind="stable")
    walks, stops = _simple_loops(np.ascontiguousarray(tails), following, farthest, n)
    return np.split(tails[walks], stops[:-1])


@compiled
def _across_gaps(starts: Ints, names: Ints) -> Ints:
    """Find the edge that follows each in a loop around a gap; gaps at a vertex nest like parentheses.

    `names` lists the edges around each vertex in angular order: e if e leaves it, −1 − e if e arrives.
    """
    following, waiting = np.full(len(names) // 2, -1), np.empty(len(names) // 2, dtype=np.int64)
    for v in range(len(starts) - 1):
        depth = 0
        for turn in range(2):
            for k in range(starts[v], starts[v + 1]):
                if names[k] >= 0:
                    if turn == 0:
                        waiting[depth] = names[k]
                        depth += 1
                elif following[-1 - names[k]] < 0 and depth > 0:
                    depth -= 1
                    following[-1 - names[k]] = waiting[depth]
    return following


@compiled
def _simple_loops(tails: Ints, following: Ints, order: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Return edges loop by loop, and the end of each loop; walks along edges begin at the first edges in `order`."""
    n = len(tails)
    place, walk, passed = np.full(n_vertices, -1), np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    edges, stops, count, n_loops = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), 0, 0
    for first in order:
        edge, depth = first, 0
        while True:
            begin = place[tails[edge]] if depth else -1
            if begin >= 0:
                for k in range(begin, depth):
                    edges[count] = walk[k]
                    place[tails[walk[k]]] = -1
                    count += 1
                stops[n_loops] = count
                n_loops += 1
                depth = begin
            if passed[edge]:
                break
            passed[edge] = True
            place[tails[edge]] = depth
            walk[depth] = edge
            depth += 1
            edge = following[edge]
    return edges, stops[:n_loops].copy()


def turning(points: Floats, following: Ints) -> Bools:
    """(n,) whether closed loops do not go straight on at their points, given the point after each one."""
    ways, turns = unit(points[following] - points), np.empty(points.shape)
    turns[following] = ways[following] - ways
    return np.asarray(np.linalg.norm(turns, axis=1) > STRAIGHT_RIM)


def corners_of(points: Floats) -> Ints:
    """(k,) corners of a closed loop: points where it does not go straight on."""
    return np.flatnonzero(turning(points, next_in_groups(np.array([0, len(points)]))))


def meeting_edges(ends: Floats) -> tuple[Ints, Ints, Bools]:
    """Find pairs of edges, not with the same ends, that run along each other, and whether in opposite directions."""
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    ways = along / np.maximum(lengths, 1e-300)[:, None]
    shares = (np.arange(EDGE_PLACES) + 0.5) / EDGE_PLACES
    places = (ends[:, :1] + shares[:, None] * along[:, None]).reshape(-1, 3)
    owners = np.repeat(np.arange(len(ends)), EDGE_PLACES)
    tree, reach = scipy.spatial.cKDTree(places), ALONG_EDGE * lengths[owners]
    crowded = np.flatnonzero(tree.query(places, 2)[0][:, 1] <= reach)  # each place finds itself, too
    near = tree.query_ball_point(places[crowded], reach[crowded]) if len(crowded) else []
    first = np.repeat(crowded, [len(ids) for ids in near])
    second = np.fromiter(itertools.chain.from_iterable(near), dtype=np.int64, count=len(first))
    # each place with the edges that it lies along, whichever of the two is the longer
    beside = np.unique(np.concatenate([first, second]) * len(ends) + owners[np.concatenate([second, first])])
    pairs, shared = np.unique(owners[beside // len(ends)] * len(ends) + beside % len(ends), return_counts=True)
    pairs = np.stack([pairs // len(ends), pairs % len(ends)], axis=1)[shared >= SHARED_PLACES]
    first, second = np.unique(np.sort(pairs, axis=1), axis=0).T
    cosines = (ways[first] * ways[second]).sum(axis=1)
    alike = np.where((cosines < 0)[:, None, None], ends[second, ::-1], ends[second])
    meeting = (np.abs(cosines) > SAME_WAY) & (ends[first] != alike).any(axis=(1, 2))
    return first[meeting], second[meeting], cosines[meeting] < 0
