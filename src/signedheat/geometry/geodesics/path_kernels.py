"""Kernels: shortest paths across the faces of an intrinsic mesh.

Halfedge ``3 f + k`` of face f runs from corner k to corner k + 1. A *sleeve* is a sequence of faces: each is left
through a halfedge, and the next one entered through another halfedge of the same edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from .heap_kernels import pop, push

TIE = 1e-9
"""How much dearer ways are through one edge than through another of the same length: of ways around a symmetric peak,
whose lengths differ by 1e-16, the same one is always found. Any number from 1e-12 to 1e-6 does."""


@compiled
def middle(corners, h):
    """Midpoint of a halfedge, in the layout of its face."""
    return 0.5 * (corners[h // 3, h % 3] + corners[h // 3, (h % 3 + 1) % 3])


@compiled
def toll(e: int) -> float:
    """What a way through an edge costs beside its length: evenly spread numbers, by the golden ratio."""
    return 1.0 + TIE * ((e * 0.6180339887498949) % 1.0)


@compiled
def find_sleeve(corners, edge_of, begin, sides, starts, start_points, ends, end_points, cost, leave, enter, queue):
    """The faces between two sets of faces on the shortest path through midpoints of edges (Dijkstra).

    Returns the halfedges through which all faces but the last are left, and those through which all but the first are
    entered; empty if there is no path. `cost`, `leave`, `enter` and `queue` are work space, restored before returning.
    """
    touched = [np.int64(0)]
    touched.pop()
    for s in range(len(starts)):
        for k in range(3):
            h = 3 * starts[s] + k
            e = edge_of[h]
            d = abs(middle(corners, h) - start_points[s]) * toll(e)
            if d < cost[e]:
                cost[e], leave[e], enter[e] = d, h, -1
                touched.append(e)
                push(queue, e, d)
    best, last = np.inf, np.int64(-1)
    while queue.size[0] > 0:
        e = pop(queue)
        d = cost[e]
        if d >= best:
            break
        for k in range(begin[e], begin[e + 1]):
            h = sides[k]
            if h == leave[e]:
                continue
            here = middle(corners, h)
            for s in range(len(ends)):
                if ends[s] == h // 3 and d + abs(here - end_points[s]) < best:
                    best, last = d + abs(here - end_points[s]), h
            for turn in range(1, 3):
                out = h - h % 3 + (h + turn) % 3
                to = edge_of[out]
                there = d + abs(middle(corners, out) - here) * toll(to)
                if there < cost[to]:
                    cost[to], leave[to], enter[to] = there, out, h
                    touched.append(to)
                    push(queue, to, there)
    n, h = 0, last
    while h >= 0:
        n, h = n + 1, enter[edge_of[h]]
    left, entered = np.empty(n, np.int64), np.empty(n, np.int64)
    while n > 0:
        n -= 1
        entered[n], left[n] = last, leave[edge_of[last]]
        last = enter[edge_of[last]]
    for e in touched:
        cost[e], queue.places[e] = np.inf, -1
    queue.size[0] = 0
    return left, entered


@compiled
def unfold(corners, forward, left, entered):
    """Unfold a sleeve into the plane of its first face: tails and heads of the halfedges left, and the last face.

    Also whether each face, the last one included, is turned over in that plane.
    """
    n = len(left)
    tails, heads = np.empty(n, np.complex128), np.empty(n, np.complex128)
    over = np.zeros(n + 1, np.bool_)
    placed = corners[left[0] // 3].copy()
    for i in range(n):
        k = left[i] % 3
        tails[i], heads[i] = placed[k], placed[(k + 1) % 3]
        face, side = entered[i] // 3, entered[i] % 3
        same = forward[left[i]] == forward[entered[i]]
        a, b = (tails[i], heads[i]) if same else (heads[i], tails[i])
        over[i + 1] = over[i] != same
        base = corners[face, (side + 1) % 3] - corners[face, side]
        apex = corners[face, (side + 2) % 3] - corners[face, side]
        ratio = apex / base if abs(base) > 0 else 0j
        if over[i + 1]:
            ratio = np.conj(ratio)
        placed[side], placed[(side + 1) % 3], placed[(side + 2) % 3] = a, b, a + ratio * (b - a)
    return tails, heads, over, placed


@compiled
def turns(a: complex, b: complex) -> float:
    """Cross product of plane vectors: positive where b is counter-clockwise of a."""
    return a.real * b.imag - a.imag * b.real


@compiled
def funnel(tails, heads, over, start, end):
    """Shortest path inside an unfolded sleeve, by the simple stupid funnel algorithm.

    Returns the portals at which the path bends, whether it bends at their left end (1) or right (0), and its length.
    """
    n = len(tails)
    bends, to_left = [np.int64(0)], [np.int64(0)]
    bends.pop()
    to_left.pop()
    apex = left = right = start
    at_left = at_right = -1
    total = 0.0
    i = 0
    while i <= n:
        if i == n:
            l = r = end
        elif over[i]:
            l, r = tails[i], heads[i]
        else:
            l, r = heads[i], tails[i]
        if turns(right - apex, r - apex) >= 0:
            if apex == right or turns(left - apex, r - apex) < 0:
                if i < n:
                    right, at_right = r, i
            else:
                bends.append(at_left)
                to_left.append(1)
                total += abs(left - apex)
                apex = right = left
                i = at_right = at_left
                i += 1
                continue
        if turns(left - apex, l - apex) <= 0:
            if apex == left or turns(right - apex, l - apex) > 0:
                if i < n:
                    left, at_left = l, i
            else:
                bends.append(at_right)
                to_left.append(0)
                total += abs(right - apex)
                apex = left = right
                i = at_left = at_right
                i += 1
                continue
        i += 1
    return bends, to_left, total + abs(end - apex)


@compiled
def other_way(edge_of, forward, begin, sides, left, entered, tails, heads, bend, point):
    """The sleeve that passes the vertex of a bend on its other side; empty where no faces connect there."""
    first = last = bend
    while first > 0 and (tails[first - 1] == point or heads[first - 1] == point):
        first -= 1
    while last + 1 < len(left) and (tails[last + 1] == point or heads[last + 1] == point):
        last += 1
    goal, at_tail = entered[last] // 3, tails[first] == point
    # walk around the vertex in all directions, breadth first: halfedges through which faces are left, and entered
    out, into, before = [turned(left[first], at_tail)], [left[first]], [np.int64(-1)]
    tail_there = [np.int64(not at_tail)]
    k = 0
    while k < len(out):
        h = out[k]
        e = edge_of[h]
        for c in range(begin[e], begin[e + 1]):
            across = sides[c]
            if across // 3 == h // 3 or is_among(into, across, 0, len(into)) or is_among(left, across, first, last + 1):
                continue
            if across // 3 == goal:
                return spliced(left, entered, first, last, out, into, before, k, across)
            at_tail = (tail_there[k] == 1) == (forward[h] == forward[across])
            out.append(turned(across, at_tail))
            into.append(across)
            before.append(k)
            tail_there.append(np.int64(not at_tail))
        k += 1
    return left[:0], entered[:0]


@compiled
def is_among(values: NDArray[np.int64], value: int, begin: int, end: int) -> bool:
    """Whether a value is among some of others."""
    for k in range(begin, end):
        if values[k] == value:
            return True
    return False


@compiled
def spliced(left, entered, first, last, out, into, before, k, across):
    """A sleeve whose crossings `first` to `last` are exchanged for those of a walk, which ends at its entry k."""
    n, j = 1, k
    while before[j] >= 0:
        n, j = n + 1, before[j]
    size = first + n + len(left) - 1 - last
    new_left, new_entered = np.empty(size, np.int64), np.empty(size, np.int64)
    for i in range(first):
        new_left[i], new_entered[i] = left[i], entered[i]
    for i in range(last + 1, len(left)):
        new_left[first + n + i - last - 1], new_entered[first + n + i - last - 1] = left[i], entered[i]
    for i in range(first + n - 1, first - 1, -1):
        new_left[i], new_entered[i] = out[k], across
        across, k = into[k], before[k]
    return new_left, new_entered


@compiled
def turned(h: int, at_tail: bool) -> int:
    """The other halfedge of the face at the tail of a halfedge, or at its head."""
    return h - h % 3 + (h + 2) % 3 if at_tail else h - h % 3 + (h + 1) % 3


@compiled
def point_in(faces: NDArray[np.int64], points: NDArray[np.complex128], face: int) -> np.complex128:
    """The point listed for a face, in its layout."""
    for s in range(len(faces)):
        if faces[s] == face:
            return points[s]
    return points[0]


@compiled
def straighten(corners, edge_of, forward, begin_at, sides, left, entered, starts, start_points, ends, end_points):
    """The shortest path in a sleeve, improved as long as passing a vertex on its other side makes it shorter.

    Returns the halfedges crossed and the fraction along each.
    """
    tails, heads, over, placed = unfold(corners, forward, left, entered)
    begin = point_in(starts, start_points, left[0] // 3)
    end = locate_end(corners, entered, placed, over, ends, end_points)
    bends, to_left, length = funnel(tails, heads, over, begin, end)
    k = 0
    while k < len(bends):
        i = bends[k]
        point = heads[i] if (to_left[k] == 1) != over[i] else tails[i]
        try_left, try_entered = other_way(edge_of, forward, begin_at, sides, left, entered, tails, heads, i, point)
        k += 1
        if len(try_left) == 0:
            continue
        t, h, o, p = unfold(corners, forward, try_left, try_entered)
        b = point_in(starts, start_points, try_left[0] // 3)
        f = locate_end(corners, try_entered, p, o, ends, end_points)
        try_bends, try_to_left, shorter = funnel(t, h, o, b, f)
        if shorter < length * (1 - 1e-12):
            left, entered, tails, heads, over, begin, end = try_left, try_entered, t, h, o, b, f
            bends, to_left, length = try_bends, try_to_left, shorter
            k = 0
    fractions = np.empty(len(left))
    here, k = begin, 0
    for i in range(len(left)):
        if k < len(bends) and bends[k] == i:
            fractions[i] = 1.0 if (to_left[k] == 1) != over[i] else 0.0
            here = heads[i] if (to_left[k] == 1) != over[i] else tails[i]
            k += 1
            continue
        if k == len(bends):
            there = end
        else:
            j = bends[k]
            there = heads[j] if (to_left[k] == 1) != over[j] else tails[j]
        along, span = there - here, heads[i] - tails[i]
        across = turns(along, span)
        if across != 0:
            fractions[i] = turns(along, here - tails[i]) / across
        else:
            fractions[i] = (np.conj(span) * (here - tails[i])).real / max(abs(span) ** 2, 1e-300)
        fractions[i] = min(max(fractions[i], 0.0), 1.0)
    return left, fractions


@compiled
def locate_end(corners, entered, placed, over, ends, end_points):
    """The end of a path, unfolded into the plane of its sleeve's first face."""
    face = entered[-1] // 3
    point = point_in(ends, end_points, face)
    q = corners[face]
    base = q[1] - q[0]
    ratio = (point - q[0]) / base if abs(base) > 0 else 0j
    if over[-1]:
        ratio = np.conj(ratio)
    return placed[0] + ratio * (placed[1] - placed[0])


@compiled
def shortest_lines(
    corners, edge_of, forward, begin, around, queue, starts, start_points, start_at, ends, end_points, end_at
):
    """Shortest paths for many pairs of points: halfedges crossed, fractions along them, their number for each pair.

    The faces at the i-th start are ``starts[start_at[i] : start_at[i + 1]]``, and `start_points` has its position in
    the layout of each; likewise for ends; `begin` and `around` are the halfedges of each edge, `queue` is an empty one
    of edges. The number is −1 where there is no path.
    """
    n_edges = len(queue.places)
    cost = np.full(n_edges, np.inf)
    leave, enter = np.empty(n_edges, np.int64), np.empty(n_edges, np.int64)
    counts = np.empty(len(start_at) - 1, np.int64)
    sides, fractions = [np.int64(0)], [0.0]
    sides.pop()
    fractions.pop()
    for job in range(len(counts)):
        first_faces, first_points = (
            starts[start_at[job] : start_at[job + 1]],
            start_points[start_at[job] : start_at[job + 1]],
        )
        last_faces, last_points = ends[end_at[job] : end_at[job + 1]], end_points[end_at[job] : end_at[job + 1]]
        left, entered = find_sleeve(
            corners,
            edge_of,
            begin,
            around,
            first_faces,
            first_points,
            last_faces,
            last_points,
            cost,
            leave,
            enter,
            queue,
        )
        if len(left) == 0:
            counts[job] = -1
            continue
        crossed, where = straighten(
            corners, edge_of, forward, begin, around, left, entered, first_faces, first_points, last_faces, last_points
        )
        counts[job] = len(crossed)
        for k in range(len(crossed)):
            sides.append(crossed[k])
            fractions.append(where[k])
    return np.array(sides), np.array(fractions), counts
