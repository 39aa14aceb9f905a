"""Kernels: windows propagate from face to face in order of distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .geodesic_sources import GeodesicSources
from .geodesic_windows import (
    BEAM,
    FOCUS,
    KIND,
    POINT,
    S0,
    S1,
    SIGMA,
    P,
    Q,
    arrival,
    hit,
    merge,
    outdoes,
    outrun,
    put,
    ray,
    straighten,
    trim,
    trim_by,
)
from .heap_kernels import Queue, pop, push
from .initial_windows import MADE, Faces, Search, free_row, has_room, initial_windows, propagate_across, take_row

ROUND = 1e-10
MANY = 4
"""Windows on a halfedge, the comparing of which with each other counts as the making of one."""


@compiled
def _reach(
    distance: NDArray[np.float64], pseudosources: NDArray[np.bool_], queue: Queue, first: int, v: int, length: float
) -> None:
    """Record a path of this length to a vertex; if paths can bend around it (a pseudosource), queue it."""
    if length < distance[v] * (1.0 - 1e-14):
        distance[v] = length
        if pseudosources[v]:
            push(queue, first + v, length)


@compiled
def _collect(
    search: Search, halfedge: int, at_tail: float, at_head: float, length: float, slack: float, tolerance: float
) -> tuple[NDArray[np.float64], int]:
    """The windows queued for a halfedge, in order along it, trimmed against each other and merged where possible.

    Only what is nearer than the windows that crossed the halfedge before is left, and joins them: without this, waves
    multiply without end where many faces share edges.
    """
    _, _, _, queued, settled, windows, following, counts = search
    count, row = 0, queued[halfedge]
    while row >= 0:
        count += 1
        row = following[row]
    row, before = settled[halfedge], 0
    while row >= 0:
        before += 1
        row = following[row]
    counts[MADE] += count * (count + before) // MANY**2  # each is compared with every other one
    chosen = np.empty((count, 6))
    count, row = 0, queued[halfedge]
    while row >= 0:
        w = windows[row]
        if not outrun(w, at_tail, at_head, length, slack) and _left(windows, following, settled[halfedge], w, length):
            k = count
            while k > 0 and chosen[k - 1, S0] > w[S0]:
                put(chosen[k - 1], chosen, k)
                k -= 1
            put(w, chosen, k)
            count += 1
        after = following[row]
        free_row(counts, following, row)
        row = after
    queued[halfedge] = -1
    kept = 0
    for k in range(count):
        if kept > 0:
            trim(chosen[kept - 1], chosen[k])
            if chosen[kept - 1, S1] <= chosen[kept - 1, S0]:
                kept -= 1
        if chosen[k, S1] <= chosen[k, S0]:
            continue
        if tolerance > 0.0 and kept > 0 and merge(chosen[kept - 1], chosen[k], length, tolerance):
            continue
        put(chosen[k], chosen, kept)
        kept += 1
    return chosen, kept


@compiled
def _left(
    windows: NDArray[np.float64], following: NDArray[np.int64], row: int, w: NDArray[np.float64], length: float
) -> bool:
    """Trim a window against those of a list; whether anything is left."""
    while row >= 0:
        trim_by(windows[row], w, ROUND * length)
        if not w[S1] - w[S0] > 1e-12 * length:
            return False
        row = following[row]
    return True


@compiled
def _settle(search: Search, halfedge: int, chosen: NDArray[np.float64], count: int) -> None:
    """Add windows to those that have crossed a halfedge, instead of the ones that they outdo."""
    _, _, _, _, settled, windows, following, counts = search
    row, before = settled[halfedge], -1
    while row >= 0:
        after, outdone = following[row], False
        for k in range(count):
            outdone = outdone or outdoes(chosen[k], windows[row])
        if not outdone:
            before = row
        elif before < 0:
            settled[halfedge] = after
        else:
            following[before] = after
        if outdone:
            free_row(counts, following, row)
        row = after
    for k in range(count):
        row = take_row(counts, following)
        put(chosen[k], windows, row)
        following[row] = settled[halfedge]
        settled[halfedge] = row


@compiled
def start_search(faces: Faces, sources: GeodesicSources, search: Search, slack: float) -> None:
    """Distances at the sources, and the first windows, as far as there is room."""
    initial_windows(faces, sources, search, slack)
    for v in range(len(search.distance)):
        if search.pseudosources[v] and search.distance[v] < np.inf:
            push(search.queue, len(search.queued) + v, search.distance[v])


@compiled
def _most_windows(faces: Faces, queued: NDArray[np.int64], following: NDArray[np.int64], item: int) -> int:
    """The most windows that one item of the queue can make."""
    most, n_halfedges = 0, len(queued)
    if item >= n_halfedges:
        v = item - n_halfedges
        for k in range(faces.first_corner[v], faces.first_corner[v + 1]):
            edge = faces.edges[faces.corners[k] // 3, (faces.corners[k] % 3 + 1) % 3]
            most += faces.first_halfedge[edge + 1] - faces.first_halfedge[edge]
        return most
    row, face = queued[item], item // 3
    while row >= 0:
        most += 1
        row = following[row]
    beyond = 1
    for side in range(3):
        edge = faces.edges[face, side]
        beyond += faces.first_halfedge[edge + 1] - faces.first_halfedge[edge]
    return most * beyond


@compiled
def continue_search(faces: Faces, search: Search, slack: float, tolerance: float, limit: int) -> None:
    """Propagate in order of distance until nothing is queued, room is wanted, or `limit` windows have been made."""
    distance, pseudosources, queue, queued, _, windows, following, counts = search
    n_halfedges = len(queued)
    while queue.size[0] > 0 and counts[MADE] < limit:
        if not has_room(counts, len(windows), _most_windows(faces, queued, following, queue.items[0])):
            return
        halfedge = pop(queue)
        if halfedge >= n_halfedges:  # a pseudosource
            v = halfedge - n_halfedges
            key = distance[v]
            for k in range(faces.first_corner[v], faces.first_corner[v + 1]):
                face, corner = faces.corners[k] // 3, faces.corners[k] % 3
                source = faces.positions[face, corner]
                for step in range(1, 3):
                    other = (corner + step) % 3
                    length = key + abs(faces.positions[face, other] - source)
                    _reach(distance, pseudosources, queue, n_halfedges, faces.vertices[face, other], length)
                side = (corner + 1) % 3
                propagate_across(faces, search, face, side, POINT, 0.0, 1.0, source, 0j, key, slack)
            continue

        face, side = halfedge // 3, halfedge % 3
        edge = faces.edges[face, side]
        length = faces.lengths[edge]
        tail, head = faces.edge_vertices[edge]
        here, n_here = _collect(search, halfedge, distance[tail], distance[head], length, slack * length, tolerance)
        _settle(search, halfedge, here, n_here)
        a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
        ahead = faces.forward[face, side]
        origin, unit = (a, (b - a) / length) if ahead else (b, (a - b) / length)
        up = 1j if ahead else -1j  # faces lie to the left of their sides
        apex = (faces.positions[face, (side + 2) % 3] - origin) * unit.conjugate()
        cx, cy = apex.real, abs(apex.imag)
        tail_side, head_side = ((side + 2) % 3, (side + 1) % 3) if ahead else ((side + 1) % 3, (side + 2) % 3)
        for k in range(n_here):
            w = here[k]
            if w[KIND] == FOCUS and w[Q] <= cy:
                straighten(w)
            s0, s1 = w[S0], w[S1]
            d0x, d0y = ray(w, s0)
            d1x, d1y = ray(w, s1)
            left = d0x * cy - d0y * (cx - s0)  # negative: the ray leaves the apex to its right
            right = d1x * cy - d1y * (cx - s1)
            # an apex outside the visible sector, perhaps in a gap between windows, is reached by way of a window's end
            if left > 0.0:
                to_apex = arrival(w, s0, 0.0) + np.hypot(cx - s0, cy)
            elif right < 0.0:
                to_apex = arrival(w, s1, 0.0) + np.hypot(cx - s1, cy)
            else:
                to_apex = arrival(w, cx, cy)
            _reach(distance, pseudosources, queue, n_halfedges, faces.vertices[face, (side + 2) % 3], to_apex)
            turned = unit * (w[P] + up * w[Q])
            source, normal = (origin, turned) if w[KIND] == BEAM else (origin + turned, 0j)
            if left < 0.0:  # visible on the side from tail to apex
                t0 = hit(s0, d0x, d0y, 0.0, 0.0, cx, cy)
                t1 = hit(s1, d1x, d1y, 0.0, 0.0, cx, cy) if right < 0.0 else 1.0
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                propagate_across(faces, search, face, tail_side, w[KIND], t0, t1, source, normal, w[SIGMA], slack)
            if right > 0.0:  # visible on the side from apex to head
                t0 = hit(s0, d0x, d0y, cx, cy, length, 0.0) if left > 0.0 else 0.0
                t1 = hit(s1, d1x, d1y, cx, cy, length, 0.0)
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                propagate_across(faces, search, face, head_side, w[KIND], t0, t1, source, normal, w[SIGMA], slack)
