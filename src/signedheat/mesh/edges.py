"""Edges of triangles and polygons: the halfedges along each, and how the faces that they belong to are connected."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Frozen, Ints, mask_of, read_only
from ..compiled import compiled
from .components import connected_components, first_members, grouped

CLEARANCE = 1e-3
"""Least distance of crossings from the ends of edges, relative to their lengths, so that no two vertices coincide."""


@dataclass(frozen=True, eq=False)
class HalfedgePairs:
    """Edges of polygons, and the halfedges that run along them; halfedge c begins at the face's corner c."""

    edges: Ints  # (h,) edge of each halfedge; −1 where it joins a vertex to itself or its face is left out
    counts: Ints  # (e,) halfedges of each edge
    # (e,) the lowest and the second lowest halfedge of each edge; −1 where there is no second
    first: Ints
    second: Ints

    @property
    def around(self) -> Ints:
        """(h,) number of halfedges along the edge of each; 0 for halfedges without an edge."""
        return np.append(self.counts, 0)[self.edges]


@dataclass(frozen=True, eq=False)
class FaceOrientation:
    """Parts of a surface that are connected across edges of two faces, and which of their faces to turn to agree."""

    parts: Ints  # (n_faces,) part of each face; parts are numbered by first appearance
    turned: Bools  # (n_faces,) whether each face must be turned; False in parts that cannot be oriented
    orientable: Bools  # (n_parts,) whether all neighbours of the part can agree
    disagreeing: int  # number of edges whose two faces run along them the same way


def following_corners(offsets: Ints) -> NDArray[np.int32]:
    """Return (c,) the corner that follows each around its face."""
    following = np.arange(1, offsets[-1] + 1, dtype=np.int32)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


def pair_halfedges(tails: Ints, heads: Ints, n_vertices: int, used: Bools | None = None) -> HalfedgePairs:
    """Find the edges of polygons and the first two used halfedges of each. The time is O(n), even at hubs."""
    chosen = tails != heads if used is None else used & (tails != heads)
    edges, _, *table = find_edges(read_only(tails), read_only(heads), chosen, n_vertices)
    return HalfedgePairs(edges, *table)


def orient_faces(faces: Ints, weights: Floats, n_vertices: int, used: Bools | None = None) -> FaceOrientation:
    """Find which triangles to turn to agree across edges of two used ones; in each part the larger weight stays."""
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
    """Return whether two faces may have the same corners; tails and following corners are (c,)."""
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
    """Edges, and how faces and edges are incident."""

    vertices: Ints  # (e, 2) tail and head: the direction in which the FIRST face of the edge runs along it
    face_edges: Ints  # (m, 3) edge from corner k to corner k + 1 of each face
    forward: Bools  # (m, 3) whether the face runs along that edge from tail to head

    @cached_property
    def face_counts(self) -> Ints:
        """(e,) number of faces at each edge: 1 at a boundary, more than 2 where nonmanifold."""
        return read_only(np.bincount(self.face_edges.ravel(), minlength=len(self.vertices)))

    @cached_property
    def balance(self) -> Ints:
        """(e,) number of faces that run along each edge, less those that run against it."""
        ahead = np.bincount(self.face_edges.ravel(), self.forward.ravel(), len(self.vertices)).astype(np.int64)
        return read_only(2 * ahead - self.face_counts)

    def unbalanced(self, groups: Ints, weights: Ints | int = 1) -> tuple[Ints, Ints, Ints]:
        """Return (k,) groups of faces, (k,) edges that do not cancel in them, and (k,) excess of faces along these.

        Results ascend by group and edge. Face f is in `groups[f]` and counts `weights[f]` times, negative if against.
        """
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
        """(e + 1,) where the halfedges 3 f + k of each edge begin, and the halfedges: see `grouped`."""
        return grouped(self.face_edges.ravel(), len(self.vertices))

    @cached_property
    def mates(self) -> Ints:
        """(3 m,) the other halfedge of the edge of each, where there are exactly two; else −1."""
        starts, members = self.halfedges
        first = starts[:-1][np.diff(starts) == 2]
        mates = np.full(self.face_edges.size, -1)
        mates[members[first]], mates[members[first + 1]] = members[first + 1], members[first]
        return read_only(mates)

    @cached_property
    def pairs(self) -> Ints:
        """(k, 2) both halfedges of each edge that has exactly two."""
        first = np.flatnonzero(self.mates > np.arange(len(self.mates)))
        return read_only(np.stack([first, self.mates[first]], axis=1))

    def elimination_order(self, vertex_order: NDArray[np.integer]) -> Ints:
        """Order edges for elimination by their ends' order, ``order[k]`` k-th: vertex separators separate edges."""
        a, b = np.argsort(vertex_order)[self.vertices].T  # the rank of each end
        return np.argsort((np.minimum(a, b) + 1) * len(vertex_order) - np.maximum(a, b), kind="stable")


def edge_table(faces: Ints) -> EdgeTable:
    """Find the edges of triangles, numbered by first appearance (corner 0–1, 1–2, 2–0, face after face)."""
    faces = np.asarray(faces, dtype=np.int64)
    tails, heads = faces.flatten(), np.roll(faces, -1, axis=1).ravel()
    every, n_vertices = np.ones(len(tails), dtype=np.bool_), int(tails.max(initial=-1)) + 1
    edges, forward, _, first, _ = find_edges(read_only(tails), read_only(heads), every, n_vertices)
    vertices = np.stack([tails[first], heads[first]], axis=1)
    return EdgeTable(vertices, edges.reshape(-1, 3), forward.reshape(-1, 3))


def edge_keys(tails: NDArray[np.integer], heads: NDArray[np.integer]) -> Ints:
    """Return (k,) a number for each pair of vertices, whichever of the two comes first."""
    return (np.minimum(tails, heads).astype(np.int64) << 32) | np.maximum(tails, heads)


@compiled
def find_edges(tails: Ints, heads: Ints, used: Bools, n_vertices: int) -> tuple[Ints, Bools, Ints, Ints, Ints]:
    """Find edges of the used halfedges (h,): the edge of each, or −1, and whether it runs as the first along it does.

    Also returns (e,) the number of halfedges of each edge, the first one, and the second one or −1.
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
        keeper, other = tails[h], heads[h]
        if degrees[other] < degrees[keeper] or (degrees[other] == degrees[keeper] and other < keeper):
            keeper, other = other, keeper
        edge = last[keeper]
        while edge >= 0 and tails[first[edge]] + heads[first[edge]] - keeper != other:
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
