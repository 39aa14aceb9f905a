"""Rims: where oriented faces end, as closed loops."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.edges import edge_table

PLACES = 8
"""Places on an edge from which edges that run along it are searched for: nearer to each other than `ALONG`."""
ALONG = 0.1
"""Distance over the length of the longer edge up to which two edges run along each other: chords of the same arc are
less than .05 apart where it has 16 or more."""
OPPOSITE = -0.7
"""Cosine of their directions up to which they run in opposite directions; with 0, leaves that cross are one part."""


def open_edges(faces: NDArray[np.int64], parts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges that the faces of each part lack, directed as the missing faces would run along them.

    Two faces that run along an edge in opposite directions cancel. If k more faces run along it in one direction than
    in the other, the edge is listed k times. As many of these edges begin at each vertex as end there.

    Returns
    -------
    edges : (k, 2) int
        Tail and head.
    owners : (k,) int
        The part that lacks it; ascending.

    Examples
    --------
    >>> open_edges(np.array([[0, 1, 2], [2, 1, 3]]), np.zeros(2, dtype=int))[0].tolist()
    [[1, 0], [0, 2], [3, 1], [2, 3]]
    """
    table = edge_table(faces)
    n, here, owners = len(table.vertices), table.face_edges.ravel(), np.repeat(parts, 3)
    lacking, last = table.balance != 0, np.empty(n, dtype=np.int64)
    last[here] = owners
    lacking[here[owners != last[here]]] = True  # of several parts; faces of one cancel
    some = np.flatnonzero(lacking[here])
    sides, which = np.unique(owners[some] * n + here[some], return_inverse=True)
    excess = np.bincount(which, np.where(table.forward.ravel()[some], 1, -1), len(sides)).astype(np.int64)
    edges = table.vertices[sides % n]
    missing = np.where(excess[:, None] > 0, edges[:, ::-1], edges)
    return np.repeat(missing, np.abs(excess), axis=0), np.repeat(sides // n, np.abs(excess))


def meeting_edges(ends: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of edges that run along each other in opposite directions, as where patches with other vertices meet.

    Edges with the same ends are no pairs: if there are three or more faces, it is unclear which belong together.

    Examples
    --------
    >>> one, other = [[0, 0, 0], [1, 0, 0]], [[0.8, 0.01, 0], [0.3, 0.02, 0]]
    >>> [edges.tolist() for edges in meeting_edges(np.array([one, other]))]
    [[0], [1]]
    """
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    ways = along / np.maximum(lengths, 1e-300)[:, None]
    at = (np.arange(PLACES) + 0.5) / PLACES
    places = (ends[:, :1] + at[:, None] * along[:, None]).reshape(-1, 3)
    owners = np.repeat(np.arange(len(ends)), PLACES)
    tree = scipy.spatial.cKDTree(places)
    found = tree.query_ball_point(places, ALONG * lengths[owners], workers=-1)
    one = np.repeat(owners, [len(each) for each in found])
    other = owners[np.concatenate([np.asarray(each, dtype=np.int64) for each in found])] if len(one) else one
    pairs = np.unique(np.sort(np.stack([one, other], axis=1)), axis=0)
    one, other = pairs[(ways[pairs[:, 0]] * ways[pairs[:, 1]]).sum(axis=1) < OPPOSITE].T
    same = (ends[one] == ends[other, ::-1]).all(axis=(1, 2))
    return one[~same], other[~same]


def loops(edges: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Closed loops of vertices, none of which passes a vertex twice, that run along all of the directed edges.

    As many edges leave each vertex as arrive there.

    Examples
    --------
    >>> [loop.tolist() for loop in loops(np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 4], [4, 0]]))]
    [[0, 1, 2], [0, 3, 4]]
    """
    if not len(edges):
        return []
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    tails, heads = edges[order].T
    names, first = np.unique(tails, return_index=True)
    following = {
        int(v): heads[a:b].tolist()[::-1] for v, a, b in zip(names, first, [*first[1:], len(tails)], strict=True)
    }
    found = []
    for start in names.tolist():
        path, place = [start], {start: 0}
        while following[path[-1]]:
            onward = following[path[-1]].pop()
            if onward in place:
                cut = place[onward]
                found.append(np.array(path[cut:]))
                for vertex in path[cut + 1 :]:
                    del place[vertex]
                del path[cut + 1 :]
            else:
                place[onward] = len(path)
                path.append(onward)
    return found
