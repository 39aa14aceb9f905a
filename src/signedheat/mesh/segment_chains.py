"""Polylines from segments."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints


def assemble_polylines(tails: Ints, heads: Ints, directed: bool = True) -> list[tuple[Ints, Bools, bool]]:
    """Join segments end to end into polylines, which end at nodes where not exactly two segments meet.

    Segments join nodes; undirected ones are reversed where needed. Returns the segments of each polyline in order,
    which of them run from head to tail, and whether it is closed.

    Examples
    --------
    >>> lines = assemble_polylines(np.array([1, 0, 5]), np.array([2, 1, 5]))
    >>> [(segments.tolist(), closed) for segments, _, closed in lines]
    [([1, 0], False), ([2], True)]
    """
    nodes, ends = np.unique(np.concatenate([tails, heads]), return_inverse=True)
    (tails, heads), n = ends.reshape(2, -1), len(nodes)
    leaving, arriving = np.bincount(tails, minlength=n), np.bincount(heads, minlength=n)
    through = (leaving == 1) & (arriving == 1) if directed else leaving + arriving == 2
    segments_at: list[list[int]] = [[] for _ in range(n)]
    for segment, (tail, head) in enumerate(zip(tails.tolist(), heads.tolist(), strict=True)):
        segments_at[tail].append(segment)
        if not directed:
            segments_at[head].append(segment)
    used = np.zeros(len(tails), dtype=bool)

    def walk(segment: int, start: int) -> tuple[list[int], list[bool], int]:
        order, backwards, node = [], [], start
        while True:
            used[segment] = True
            order.append(segment)
            backwards.append(bool(tails[segment] != node))
            node = int(tails[segment] if backwards[-1] else heads[segment])
            onward = [s for s in segments_at[node] if not used[s]] if through[node] else []
            if not onward:
                return order, backwards, node
            segment = onward[0]

    polylines = []
    for pass_through in (False, True):  # first from ends and junctions; the segments left form loops
        for segment in range(len(tails)):
            start = int(tails[segment])
            if not directed and not pass_through and through[start]:
                start = int(heads[segment])
            if used[segment] or (not pass_through and through[start]):
                continue
            order, backwards, end = walk(segment, start)
            polylines.append((np.array(order), np.array(backwards), end == start))
    return polylines


def leaving(points: Floats, closed: bool, room: Floats) -> Ints:
    """Return which of (n, d) points of a polyline are left for a place farther away than the `room` (n,) of each.

    The end of an open polyline is kept as well.

    Examples
    --------
    >>> leaving(np.array([[0.0], [0.0], [1.0], [1.1]]), False, np.full(4, 0.5)).tolist()
    [1, 3]
    >>> leaving(np.array([[0.0], [1.0], [2.0], [0.0]]), True, np.zeros(4)).tolist()
    [0, 1, 2]
    """
    moves = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) > room
    if not closed:
        moves[-1] = True
    return np.flatnonzero(moves)
