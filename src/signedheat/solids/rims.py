"""Rims: where oriented faces end, as closed loops."""

from __future__ import annotations

import itertools

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.arrangement import SAME_POINT, arranged
from ..mesh.box_tree import BoxTree
from ..mesh.components import grouped, next_in_groups, sums_of
from ..mesh.edges import edge_table
from ..mesh.triangles import area_vectors, corner_normals
from ..mesh.unit_vectors import ANGLE_ROUNDING, SAME_WAY, angles_around, unit
from ..mesh.welding import first_copies, joined_faces, tolerances
from ..parallel import PointTree
from ..surfaces.triangle_mesh import TriangleMesh

EDGE_POINTS = 8
"""Number of sample points on an edge from which other edges along it are searched for. They are closer together than
`ALONG_EDGE`."""
ALONG_EDGE = 0.1
"""Two edges run along each other within this distance, relative to the longer one. Chords of the same arc are less than
0.05 apart if it has 16 or more."""
MOST_ASKED = 1024
"""Edges are searched from in about this many groups. If the first edge of a group finds no edge opposite to it, nor do
the others search."""
SHARED_POINTS = 3
"""Two edges run along each other if at least this many sample points of one lie along the other. Edges that only meet
at a corner have fewer."""
STRAIGHT_RIM = 1e-5
"""A vertex is no corner if a loop changes its direction by at most this angle there, in radians."""


def open_edges(faces: Ints, parts: Ints) -> tuple[Ints, Ints]:
    """(k, 2) directed edges that balance the edges of faces in each part, repeated as needed; and (k,) their parts."""
    table = edge_table(faces)
    owners, edges, excess = table.unbalanced(parts)
    ends = table.vertices[edges]
    missing = np.where(excess[:, None] > 0, ends[:, ::-1], ends)
    return np.repeat(missing, np.abs(excess), axis=0), np.repeat(owners, np.abs(excess))


def boundary(faces: Ints) -> Ints:
    """(k, 2) directed edges that balance the edges of (m, 3) faces: they run along the gaps, repeated as needed."""
    return open_edges(faces, np.zeros(len(faces), dtype=np.int64))[0]


def loops(vertices: Floats, faces: Ints, edges: Ints) -> list[Ints]:
    """Split the boundary `edges`, (k, 2), of faces into closed loops around gaps, arrays of vertices.

    No loop passes a vertex twice. Where gaps meet at a vertex, an edge is followed by the edge on the other side of the
    gap beside it. Walks begin far from the middle, so that gaps connected at vertices are separated there.
    """
    if not len(edges):
        return []
    # the ends of edges around each vertex, in order of angle where there are more than two
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
    # a slit has no width: where an edge leaves along one that arrives, the gap between them is nothing
    apart = (np.diff(ends[order], prepend=-1) != 0) | (np.diff(angles[order], prepend=0.0) > ANGLE_ROUNDING)
    order = order[np.lexsort((order >= n_edges, np.cumsum(apart)))]
    edges_around = np.concatenate([np.arange(n_edges), -1 - np.arange(n_edges)])[order]
    following = _across_gaps(grouped(ends, n)[0], edges_around)
    middles, lengths = vertices[edges].mean(axis=1), np.linalg.norm(vertices[heads] - vertices[tails], axis=1)
    centre = np.average(middles, weights=lengths + np.finfo(float).tiny, axis=0)
    farthest = np.argsort(-np.linalg.norm(middles - centre, axis=1), kind="stable")
    walks, stops = _simple_loops(np.ascontiguousarray(tails), following, farthest, n)
    return np.split(tails[walks], stops[:-1])


@compiled
def _across_gaps(starts: Ints, edges_around: Ints) -> Ints:
    """(e,) the edge that follows each edge in a loop around a gap; gaps at a vertex nest like parentheses.

    `edges_around` lists the edges around each vertex, from `starts` on, in angular order: e if edge e leaves the
    vertex, and −1 − e if it arrives.
    """
    following, waiting = np.full(len(edges_around) // 2, -1), np.empty(len(edges_around) // 2, dtype=np.int64)
    for v in range(len(starts) - 1):
        depth = 0
        for turn in range(2):  # the second time around, edges that arrive take those that still wait
            for k in range(starts[v], starts[v + 1]):
                if edges_around[k] >= 0:
                    if turn == 0:
                        waiting[depth] = edges_around[k]
                        depth += 1
                elif following[-1 - edges_around[k]] < 0 and depth > 0:
                    depth -= 1
                    following[-1 - edges_around[k]] = waiting[depth]
    return following


@compiled
def _simple_loops(tails: Ints, following: Ints, order: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Divide n directed edges into loops that pass each vertex once.

    Return the edges loop by loop, and the end of each loop in this list. `tails` are the vertices that edges begin at,
    and `following` the next edge of each, a permutation, so that walks end where they began. They begin at edges in the
    order `order`. Whenever a walk comes to a vertex that it has passed, the edges since then are a loop, and are taken
    out of the walk.
    """
    n = len(tails)
    index_in_walk, walk, passed = np.full(n_vertices, -1), np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    edges, stops, count, n_loops = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), 0, 0
    for first in order:
        edge, depth = first, 0
        while True:
            begin = index_in_walk[tails[edge]]
            if begin >= 0:  # the walk from there on is a loop
                for k in range(begin, depth):
                    edges[count] = walk[k]
                    index_in_walk[tails[walk[k]]] = -1
                    count += 1
                stops[n_loops] = count
                n_loops += 1
                depth = begin
            if passed[edge]:
                break
            passed[edge] = True
            index_in_walk[tails[edge]] = depth
            walk[depth] = edge
            depth += 1
            edge = following[edge]
    return edges, stops[:n_loops].copy()


def turning(points: Floats, following: Ints) -> Bools:
    """(n,) whether closed loops change their direction at (n, 3) points; `following` is the next point of each."""
    directions, turns = unit(points[following] - points), np.empty(points.shape)
    turns[following] = directions[following] - directions
    return np.asarray(np.linalg.norm(turns, axis=1) > STRAIGHT_RIM)


def corners_of(points: Floats) -> Ints:
    """(k,) corners of a closed loop of (n, 3) points: the indices where it changes its direction."""
    return np.flatnonzero(turning(points, next_in_groups(np.array([0, len(points)]))))


def meeting_edges(ends: Floats) -> tuple[Ints, Ints]:
    """Find pairs of edges that run along each other, in either direction, but do not have the same ends.

    Edges are given by (n, 2, 3) ends; pairs are two (k,) arrays of their indices.
    """
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(lengths, 1e-300)[:, None]
    points, owners = _points_on(ends)
    tree, reach = PointTree(points), ALONG_EDGE * lengths[owners]
    crowded = np.flatnonzero(tree.query(points, 2)[0][:, 1] <= reach)  # each point finds itself, too
    near = tree.query_ball_point(points[crowded], reach[crowded]) if len(crowded) else []
    first = np.repeat(crowded, [len(ids) for ids in near])
    second = np.fromiter(itertools.chain.from_iterable(near), dtype=np.int64, count=len(first))
    # each point with the edges that it lies along, whichever of the two is the longer
    beside = np.unique(np.concatenate([first, second]) * len(ends) + owners[np.concatenate([second, first])])
    pairs, shared = np.unique(owners[beside // len(ends)] * len(ends) + beside % len(ends), return_counts=True)
    pairs = np.stack([pairs // len(ends), pairs % len(ends)], axis=1)[shared >= SHARED_POINTS]
    first, second = np.unique(np.sort(pairs, axis=1), axis=0).T
    cosines = (directions[first] * directions[second]).sum(axis=1)
    alike = np.where((cosines < 0)[:, None, None], ends[second, ::-1], ends[second])
    meeting = (np.abs(cosines) > SAME_WAY) & (ends[first] != alike).any(axis=(1, 2))
    return first[meeting], second[meeting]


def opposite_edges(ends: Floats, reaches: Floats) -> tuple[Ints, Ints]:
    """Find pairs of directed edges that run along each other in opposite directions, within (n,) reaches of both.

    Edges are given by (n, 2, 3) ends; pairs are two (k,) arrays of their indices. Each sample point on an edge has one
    partner, which is nearest in position and direction. The time is O(n log n).
    """
    # partners are searched for in position and direction at once; edges are grouped by reach, in powers of two
    directions, (points, owners) = unit(ends[:, 1] - ends[:, 0]), _points_on(ends)
    partners = np.full((len(ends), EDGE_POINTS), -1)
    sizes = np.exp2(np.ceil(np.log2(np.maximum(reaches, 1e-300))))
    groups = np.arange(len(ends)) // (1 + len(ends) // MOST_ASKED)
    firsts = np.append(True, groups[1:] != groups[:-1])[: len(ends)]
    for size in np.unique(sizes):
        # directions count so much that no edge finds its own neighbours
        tree = PointTree(np.concatenate([points / size, 2.0 * directions[owners]], axis=1))
        # a search that finds nothing takes long: where the first edge of a group finds nothing, no other one asks
        for asking in (firsts, ~firsts):
            met = (partners >= 0).any(axis=1)
            edges = np.flatnonzero((sizes == size) & asking & (firsts | np.isin(groups, groups[met])))
            rows = (EDGE_POINTS * edges[:, None] + np.arange(EDGE_POINTS)).ravel()
            back = np.concatenate([points[rows] / size, -2.0 * directions[owners[rows]]], axis=1)
            near = tree.query(back, distance_upper_bound=2.0)[1]
            partners[edges] = np.where(near < len(points), near, -1).reshape(-1, EDGE_POINTS)
    # kept are points within reach of the edge of their partner, which runs the opposite way
    partner = partners.ravel()
    first = np.flatnonzero(partner >= 0)
    edge, other = owners[first], owners[partner[first]]
    away = points[first] - ends[other, 0]
    lengths = np.linalg.norm(ends[other, 1] - ends[other, 0], axis=1)
    ahead = np.clip((away * directions[other]).sum(axis=1), 0.0, lengths)
    gaps = np.linalg.norm(away - ahead[:, None] * directions[other], axis=1)
    kept = (gaps <= np.minimum(reaches[edge], reaches[other])) & (
        (directions[edge] * directions[other]).sum(axis=1) < -SAME_WAY
    )
    kept &= (ends[edge] != ends[other, ::-1]).any(axis=(1, 2))
    pairs, shared = np.unique(edge[kept] * len(ends) + other[kept], return_counts=True)
    pairs = pairs[shared >= SHARED_POINTS]
    pairs = np.stack([pairs // max(len(ends), 1), pairs % max(len(ends), 1)], axis=1)
    first_edges, second_edges = np.unique(np.sort(pairs, axis=1), axis=0).T
    return first_edges, second_edges


def _points_on(ends: Floats) -> tuple[Floats, Ints]:
    """Return `EDGE_POINTS` points on each edge, with (n, 2, 3) ends: (k, 3) positions, and (k,) their edges."""
    shares = (np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS
    points = ends[:, :1] + shares[:, None] * (ends[:, 1:] - ends[:, :1])
    return points.reshape(-1, 3), np.repeat(np.arange(len(ends)), EDGE_POINTS)


def divided_at_rims(mesh: TriangleMesh) -> tuple[TriangleMesh, Ints]:
    """Divide faces along the open edges of others that lie in them, such as a roof along the tops of walls.

    Return the divided mesh of m faces, and the (m,) faces of `mesh` that they are parts of.
    """
    points, faces = mesh.vertices, joined_faces(mesh.vertices, mesh.faces)
    table = edge_table(faces)
    counts = np.bincount(table.face_edges[first_copies(faces)].ravel(), minlength=len(table.vertices))
    loose = (counts[table.face_edges] == 1).all(axis=1)  # loose triangles end nowhere
    in_surface = np.zeros(len(table.vertices), dtype=bool)
    in_surface[table.face_edges[~loose]] = True
    is_open = np.flatnonzero((counts == 1) & in_surface)
    if not len(is_open):
        return mesh, np.arange(mesh.n_faces)
    # pairs of an open edge and a face whose box it meets, and in whose plane it lies
    slacks = tolerances(points, faces, SAME_POINT)
    corners, ends = points[faces], table.vertices[is_open]
    owners = np.empty(len(table.vertices), dtype=np.int64)
    owners[table.face_edges.ravel()] = np.repeat(np.arange(len(faces)), 3)
    own = owners[is_open]
    starts, near = BoxTree.around(corners).meeting(points[ends[:, [0, 1, 1]]], slacks[own])
    edge = np.repeat(np.arange(len(ends)), np.diff(starts))
    apart = (near != own[edge]) & ~(faces[near][:, :, None] == ends[edge][:, None]).any(axis=1).all(axis=1)
    edge, near = edge[apart], near[apart]
    slack = np.minimum(slacks[own[edge]], slacks[near])
    a, b = points[ends[edge]].swapaxes(0, 1)
    normals = unit(area_vectors(corners[near]))
    rises = np.abs(np.einsum("kcd,kd->kc", corners[own[edge]] - corners[near, :1], normals))
    flat = normals.any(axis=1) & (rises.max(axis=1) > slack)  # and the face itself does not lie in the other one
    for end in (a, b):
        flat &= np.abs(((end - corners[near, 0]) * normals).sum(axis=1)) <= slack
    edge, near, slack, a, b, normals = (values[flat] for values in (edge, near, slack, a, b, normals))
    # the part of the edge that lies in the face, and how far its middle is from the face's sides
    low, high = np.zeros(len(edge)), np.ones(len(edge))
    triangles, depth = corners[near], np.full(len(edge), np.inf)
    inwards = [np.cross(normals, unit(triangles[:, (k + 1) % 3] - triangles[:, k])) for k in range(3)]
    for k in range(3):
        begin, end = (((at - triangles[:, k]) * inwards[k]).sum(axis=1) for at in (a, b))
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = begin / (begin - end)
        low = np.where((begin < -slack) & (end > begin), np.maximum(low, crossing), low)
        high = np.where((end < -slack) & (begin > end), np.minimum(high, crossing), high)
        low = np.where((begin < -slack) & (end < -slack), 1.0, low)
    middle = a + (0.5 * (low + high))[:, None] * (b - a)
    for k in range(3):
        depth = np.minimum(depth, ((middle - triangles[:, k]) * inwards[k]).sum(axis=1))
    lies = (np.linalg.norm(b - a, axis=1) * (high - low) > slack) & (depth > slack)
    if not lies.any():
        return mesh, np.arange(mesh.n_faces)
    pairs = np.unique(np.sort(np.stack([own[edge[lies]], near[lies]], axis=1), axis=1), axis=0)
    pieces = arranged(points, faces, pairs, slacks)
    return TriangleMesh(pieces.points, pieces.faces), pieces.origins
