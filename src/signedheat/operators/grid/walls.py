"""Kernels: straight lines past solid nodes, each of which is a box of one cell, and shortest ways around these."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ...geometry.geodesics.heap_kernels import Queue, pop, push
from .zero_contour import Contour, distance_around


@compiled
def lines_are_clear(
    starts: NDArray[np.int64],
    targets: NDArray[np.float64],
    solid: NDArray[np.bool_],
    counts: NDArray[np.int64],
    strides: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """(n,) whether lines from (n, d) nodes to (n, d) targets, in cells, avoid the boxes of solid nodes."""
    seen = np.ones(len(starts), dtype=np.bool_)
    for i in range(len(starts)):
        seen[i] = line_is_clear(starts[i], targets[i], solid, counts, strides)
    return seen


@compiled
def line_is_clear(
    start: NDArray[np.float64],
    target: NDArray[np.float64],
    solid: NDArray[np.bool_],
    counts: NDArray[np.int64],
    strides: NDArray[np.int64],
) -> bool:
    """Whether the line from a node to a target, in cells, avoids the boxes of solid nodes."""
    dimension, steps = len(start), 0
    place, last = np.empty(dimension, dtype=np.int64), np.empty(dimension, dtype=np.int64)
    for d in range(dimension):
        place[d] = np.int64(start[d])
        last[d] = min(max(np.int64(np.floor(target[d] + 0.5)), 0), counts[d] - 1)
        steps += abs(last[d] - place[d])
    entered = 0.0
    for _ in range(steps):
        axis, leave, node = -1, np.inf, np.int64(0)
        for d in range(dimension):
            node += place[d] * strides[d]
            way = target[d] - start[d]
            if place[d] != last[d] and way != 0.0:
                at = (place[d] + (0.5 if way > 0.0 else -0.5) - start[d]) / way
                if at < leave:
                    axis, leave = d, at
        # a line that only touches a corner of a box does not enter it
        if solid[node] and leave > entered + 1e-9:
            return False
        if axis < 0:
            break
        entered = max(entered, leave)
        place[axis] += 1 if target[axis] > start[axis] else -1
    return True


def distances_around_walls(
    contour: Contour,
    nearest: NDArray[np.int32],
    distances: NDArray[np.float64],
    solid: NDArray[np.bool_],
    steps: NDArray[np.float64],
) -> None:
    """Measure distances again, in place, where the straight line to the nearest crossing passes a solid node.

    Nodes are settled in order of distance. Each takes over from a neighbour the crossing, or the bend, that the
    neighbour's way starts from, if it is in sight; otherwise the way bends at the neighbour (any-angle search, Nash et
    al. 2007). Infinite where no way leads. Arrays have four axes.
    """
    counts = np.array(solid.shape)
    strides = np.append(np.cumprod(counts[:0:-1])[::-1], 1)
    queue = Queue.empty(solid.size)
    flat = (nearest.ravel(), distances.reshape(-1), solid.ravel())
    _settle(contour, *flat, np.full(solid.size, -1), steps, counts, strides, queue)


@compiled
def _settle(
    contour: Contour,
    nearest: NDArray[np.int32],
    distances: NDArray[np.float64],
    solid: NDArray[np.bool_],
    bends: NDArray[np.int64],
    steps: NDArray[np.float64],
    counts: NDArray[np.int64],
    strides: NDArray[np.int64],
    queue: Queue,
) -> None:
    """See `distances_around_walls`; `bends` are −1, and nodes are numbered in the order of the arrays."""
    n = len(distances)
    node, here, there, away, room = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    settled = np.zeros(n, dtype=np.bool_)
    for v in range(n):
        _cells(v, strides, node)
        for d in range(4):
            there[d] = contour.points[nearest[v], d] / steps[d]
        settled[v] = not solid[v] and line_is_clear(node, there, solid, counts, strides)
        if not settled[v]:
            distances[v] = np.inf
    for e in range(len(contour.edges)):
        for end in range(2):
            v = np.int64(0)
            for d in range(4):
                v += (contour.edges[e, d] + (end if d == contour.edges[e, 4] else 0)) * strides[d]
            if not settled[v]:
                _cells(v, strides, node)
                for d in range(4):
                    here[d] = node[d] * steps[d]
                distance = distance_around(contour, e, here, away, room)
                if distance < distances[v]:
                    distances[v], nearest[v] = distance, e
                    push(queue, v, distance)
    for v in range(n):
        if settled[v]:
            _cells(v, strides, node)
            for d in range(4):
                for side in range(2):
                    at = np.int64(node[d]) + 2 * side - 1
                    if 0 <= at < counts[d]:
                        neighbor = v + (2 * side - 1) * strides[d]
                        if not settled[neighbor] and not solid[neighbor]:
                            push(queue, v, distances[v])
    while queue.size[0] > 0:
        u = pop(queue)
        for d in range(4):
            for side in range(2):
                _cells(u, strides, node)
                at = np.int64(node[d]) + 2 * side - 1
                v = u + (2 * side - 1) * strides[d]
                if not 0 <= at < counts[d] or settled[v] or solid[v]:
                    continue
                _cells(v, strides, node)
                if bends[u] >= 0:
                    _cells(bends[u], strides, there)
                else:
                    for f in range(4):
                        there[f] = contour.points[nearest[u], f] / steps[f]
                bend = bends[u]
                if not line_is_clear(node, there, solid, counts, strides):
                    bend = u
                    _cells(u, strides, there)
                for f in range(4):
                    here[f] = node[f] * steps[f]
                if bend >= 0:
                    square = 0.0
                    for f in range(4):
                        square += ((node[f] - there[f]) * steps[f]) ** 2
                    distance = distances[bend] + np.sqrt(square)
                else:
                    distance = distance_around(contour, nearest[u], here, away, room)
                if distance < distances[v]:
                    distances[v], nearest[v], bends[v] = distance, nearest[u], bend
                    push(queue, v, distance)


@compiled
def _cells(node: int, strides: NDArray[np.int64], out: NDArray[np.float64]) -> None:
    """Write the four indices of a node."""
    rest = node
    for d in range(4):
        out[d] = rest // strides[d]
        rest -= np.int64(out[d]) * strides[d]
