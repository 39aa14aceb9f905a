"""Edges of triangles and polygons, the halfedges along them, and the orientation of connected faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Frozen, Ints, mask_of, read_only
from ..compiled import compiled
from .components import connected_components, first_members, grouped

CLEARANCE = 1e-3
"""Least distance of a crossing from the ends of an edge, relative to the length of the edge, to which crossings are
moved. So no two vertices of a level set coincide."""


@dataclass(frozen=True, eq=False)
class HalfedgePairs:
    """e edges of polygons, and the h halfedges along them; halfedge c begins at corner c of its face."""

    edges: Ints  # (h,) edge of each halfedge; −1 if it joins a vertex to itself or its face is left out
    counts: Ints  # (e,) number of halfedges of each edge
    # (e,) the lowest and the second lowest halfedge of each edge; −1 if there is no second
    first: Ints
    second: Ints

    @property
    def around(self) -> Ints:
        """Number of halfedges along the edge of each halfedge, (h,) int; 0 for halfedges without an edge."""
        return np.append(self.counts, 0)[self.edges]


@dataclass(frozen=True, eq=False)
class FaceOrientation:
    """Parts of a surface, connected across edges of two faces, and the faces to flip to orient them consistently."""

    parts: Ints  # (n_faces,) part of each face; parts are numbered in order of their first face
    turned: Bools  # (n_faces,) whether each face must be flipped; false in parts that cannot be oriented
    orientable: Bools  # (n_parts,) whether each part can be oriented consistently
    disagreeing: int  # number of edges whose two faces run along them in the same direction


def following_corners(offsets: Ints) -> NDArray[np.int32]:
    """Return (c,) the corner after each corner around its face; face f has corners offsets[f] to offsets[f + 1] − 1."""
    following = np.arange(1, offsets[-1] + 1, dtype=np.int32)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


def pair_halfedges(tails: Ints, heads: Ints, n_vertices: int, used: Bools | None = None) -> HalfedgePairs:
    """Find the edges of polygons from the (h,) tails and heads of their halfedges.

    If `used`, (h,), is given, only halfedges for which it is true count. The time is O(h), even at vertices of many
    faces.
    """
    chosen = tails != heads if used is None else used & (tails != heads)
    edges, _, *table = find_edges(read_only(tails), read_only(heads), chosen, n_vertices)
    return HalfedgePairs(edges, *table)


def orient_faces(faces: Ints, weights: Floats, n_vertices: int, used: Bools | None = None) -> FaceOrientation:
    """Find the (m, 3) triangles to flip so that neighbours across edges of two have consistent orientations.

    Faces for which `used`, (m,), is false do not count. In each connected part, the orientation with the larger sum of
    `weights`, (m,), is kept.
    """
    tails, owners = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
    pairs = pair_halfedges(
        tails, np.roll(faces, -1, axis=1).ravel(), n_vertices, None if used is None else used[owners]
    )
    two = pairs.counts == 2
    disagree = tails[pairs.first[two]] == tails[pairs.second[two]]
    first, second, n = owners[pairs.first[two]], owners[pairs.second[two]], len(weights)
    parts = connected_components(n, first, second)
    # the graph has each face f twice, as it is, f, and turned over, f + n: faces that agree are connected
    over = np.where(disagree, second + n, second), np.where(disagree, second, second + n)
    cover = connected_components(2 * n, np.concatenate([first, first + n]), np.concatenate(over))
    orientable = ~mask_of(int(parts.max(initial=-1)) + 1, parts[cover[:n] == cover[n:]])
    turned = cover[:n] != cover[first_members(parts, len(orientable))[parts]]
    balance = np.bincount(parts, np.where(turned, -weights, weights), len(orientable))
    turned = orientable[parts] & (turned != (balance < 0)[parts])
    return FaceOrientation(parts, turned, orientable, int(disagree.sum()))


def may_coincide(pairs: HalfedgePairs, tails: Ints, following: NDArray[np.integer]) -> bool:
    """Whether two faces may have the same corners; if false, none do.

    `tails` are the vertices at corners, (c,), and `following` the next corner of each around its face, (c,).
    """
    two = pairs.counts == 2
    first, second = pairs.first[two], pairs.second[two]
    preceding = np.empty_like(following)
    preceding[following] = np.arange(len(following), dtype=following.dtype)
    first_beyond = tails[following[following[first]]]
    alike = tails[first] == tails[second]  # else the corner beyond the edge is the one before it
    second_beyond = tails[np.where(alike, following[following[second]], preceding[second])]
    return bool((pairs.counts > 2).any() or (first_beyond == second_beyond).any())


@dataclass(frozen=True, eq=False)
class EdgeTable(Frozen):
    """e edges of m triangles, and their incidence."""

    vertices: Ints  # (e, 2) tail and head of each edge, in the direction in which its first face runs along it
    face_edges: Ints  # (m, 3) edge from corner k to corner k + 1 of each face
    forward: Bools  # (m, 3) whether the face runs along that edge from tail to head

    @cached_property
    def face_counts(self) -> Ints:
        """Number of faces at each edge, (e,) int: 1 at a boundary, more than 2 where nonmanifold."""
        return read_only(np.bincount(self.face_edges.ravel(), minlength=len(self.vertices)))

    @cached_property
    def balance(self) -> Ints:
        """Number of faces that run along each edge from tail to head, less those from head to tail, (e,) int."""
        ahead = np.bincount(self.face_edges.ravel(), self.forward.ravel(), len(self.vertices)).astype(np.int64)
        return read_only(2 * ahead - self.face_counts)

    def unbalanced(self, groups: Ints, weights: Ints | int = 1) -> tuple[Ints, Ints, Ints]:
        """Find the edges of groups of faces along which faces do not cancel.

        Face f is in group groups[f], (m,), and counts weights[f] times. Returns (k,) groups, (k,) edges, and (k,) the
        number of faces that run along the edge less that of faces that run against it, which is not 0. They are sorted
        by group and edge.
        """
        # edges to count: those at which all faces together, or faces of several groups, may leave something
        n, edges, owners = len(self.vertices), self.face_edges.ravel(), np.repeat(groups, 3)
        ways = (np.where(self.forward, 1, -1) * np.reshape(weights, (-1, 1))).ravel()
        is_open, last = np.bincount(edges, ways, n) != 0, np.empty(n, dtype=np.int64)
        last[edges] = owners
        is_open[edges[owners != last[edges]]] = True  # faces of several groups; those of one group cancel
        rows = np.flatnonzero(is_open[edges])
        keys, which = np.unique(owners[rows] * n + edges[rows], return_inverse=True)
        excess = np.bincount(which, ways[rows], len(keys)).astype(np.int64)
        keys, excess = keys[excess != 0], excess[excess != 0]
        return keys // max(n, 1), keys % max(n, 1), excess

    @cached_property
    def halfedges(self) -> tuple[Ints, Ints]:
        """Halfedges 3 f + k of each edge, as (e + 1,) offsets and (3 m,) halfedges (`grouped`)."""
        return grouped(self.face_edges.ravel(), len(self.vertices))

    @cached_property
    def mates(self) -> Ints:
        """The opposite halfedge of each halfedge, (3 m,) int, if its edge has exactly two; else −1."""
        starts, members = self.halfedges
        first = starts[:-1][np.diff(starts) == 2]
        mates = np.full(self.face_edges.size, -1)
        mates[members[first]], mates[members[first + 1]] = members[first + 1], members[first]
        return read_only(mates)

    @cached_property
    def pairs(self) -> Ints:
        """Both halfedges of each edge that has exactly two, (k, 2) int."""
        first = np.flatnonzero(self.mates > np.arange(len(self.mates)))
        return read_only(np.stack([first, self.mates[first]], axis=1))

    def elimination_order(self, vertex_order: NDArray[np.integer]) -> Ints:
        """Return (e,) an order of the edges for elimination, from a good one of the vertices, which are given in order.

        Edges are sorted by their earlier end, so that a separator of vertices separates edges, too.
        """
        a, b = np.argsort(vertex_order)[self.vertices].T  # the rank of each end
        return np.argsort((np.minimum(a, b) + 1) * len(vertex_order) - np.maximum(a, b), kind="stable")


def has_three_corners(faces: Ints) -> Bools:
    """Return (m,) whether the corners of each of (m, 3) triangles are three different vertices."""
    a, b, c = faces.T
    return np.asarray((a != b) & (b != c) & (c != a))


def edge_table(faces: Ints) -> EdgeTable:
    """Find the edges of (m, 3) triangles, numbered by first appearance (corner 0–1, 1–2, 2–0, face after face)."""
    faces = np.asarray(faces, dtype=np.int64)
    tails, heads = faces.flatten(), np.roll(faces, -1, axis=1).ravel()
    every, n_vertices = np.ones(len(tails), dtype=np.bool_), int(tails.max(initial=-1)) + 1
    edges, forward, _, first, _ = find_edges(read_only(tails), read_only(heads), every, n_vertices)
    vertices = np.stack([tails[first], heads[first]], axis=1)
    return EdgeTable(vertices, edges.reshape(-1, 3), forward.reshape(-1, 3))


def edge_keys(tails: NDArray[np.integer], heads: NDArray[np.integer]) -> Ints:
    """Return (k,) a number for each pair of vertices, which is the same for both orders of the two."""
    return (np.minimum(tails, heads).astype(np.int64) << 32) | np.maximum(tails, heads)


@compiled
def find_edges(tails: Ints, heads: Ints, used: Bools, n_vertices: int) -> tuple[Ints, Bools, Ints, Ints, Ints]:
    """Find the edges of halfedges, given by (h,) tails and heads; those for which `used` is false have none.

    Returns (h,) the edge of each halfedge, or −1, and (h,) whether it has the direction of the first halfedge of its
    edge; then for each of e edges its number of halfedges, its first halfedge, and its second halfedge or −1. Each edge
    is in a linked list of edges at one of its ends, of which `last` is the head for each vertex.
    """
    degrees, last = np.zeros(n_vertices, dtype=np.int64), np.full(n_vertices, -1)
    for h in range(len(tails)):
        degrees[tails[h]] += 1
        degrees[heads[h]] += 1
    following, counts = np.empty(len(tails), dtype=np.int64), np.zeros(len(tails), dtype=np.int64)
    first, second = np.empty(len(tails), dtype=np.int64), np.full(len(tails), -1)
    edges, forward = np.full(len(tails), -1), np.zeros(len(tails), dtype=np.bool_)
    n_edges = 0
    for h in range(len(tails)):
        if not used[h]:
            continue
        keeper, far_end = tails[h], heads[h]  # edges are listed at the end of lower degree, so that lists are short
        if degrees[far_end] < degrees[keeper] or (degrees[far_end] == degrees[keeper] and far_end < keeper):
            keeper, far_end = far_end, keeper
        edge = last[keeper]
        while edge >= 0 and tails[first[edge]] + heads[first[edge]] - keeper != far_end:
            edge = following[edge]
        if edge < 0:
            edge = n_edges
            first[edge], following[edge], last[keeper] = h, last[keeper], edge
            n_edges += 1
        elif counts[edge] == 1:
            second[edge] = h
        counts[edge] += 1
        edges[h], forward[h] = edge, tails[h] == tails[first[edge]]
    return edges, forward, counts[:n_edges].copy(), first[:n_edges].copy(), second[:n_edges].copy()
