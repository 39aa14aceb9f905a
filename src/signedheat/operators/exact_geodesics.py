"""Kernels: distance on a polyhedral surface from line segments in its faces, exact or very nearly so.

Windows of light travel from face to face in order of distance (Mitchell, Mount & Papadimitriou 1987; Chen & Han 1990),
and those that a path through a vertex outruns are dropped (Xin & Wang 2009). A window is an interval of an edge, lit
straight from one source: a point, or, since the sources here are segments, a parallel beam at right angles to one.
Each vertex splits a window, so that their number per edge would grow with distance; neighbouring windows on an edge
that one circular or straight wave can stand for are therefore made one (as Surazhsky et al. 2005 do), and the work
stays in proportion to the number of faces.

In the frame of an edge, its tail is at the origin, its head on the positive x axis, light comes from below. A window is
a row ``(s0, s1, p, q, sigma, kind)``: the interval; kind `POINT`: waves from the point (p, q ≤ 0), whose own distance
is σ; kind `FOCUS`: waves that contract to the point (p, q ≥ 0), whose distance would be σ; kind `BEAM`: straight waves
along the direction (p, q > 0), σ their distance at the tail.
"""

from __future__ import annotations

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .laid_out_triangles import LaidOutTriangles

_ROUND = 1e-10
_POINT, _BEAM, _FOCUS = 1.0, 0.0, -1.0
_S0, _S1, _P, _Q, _SIGMA, _KIND = range(6)


def distance_to_zero_line(
    triangles: LaidOutTriangles, values: NDArray[np.float64], tolerance: float = 1e-4
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to the line on which values, linear in every face, are zero; and the windows it took.

    Parameters
    ----------
    triangles : LaidOutTriangles
        Any surface, nonmanifold and nonorientable ones too.
    values : (n,) float
        At the vertices; faces with NaN have no line.
    tolerance : float
        Windows are made one where that changes distances by less than this fraction of the edge; 0 is exact.

    Returns
    -------
    (n,) float
        inf where no line is connected.
    int
        Number of windows, a measure of the work.
    """
    n_edges = triangles.n_edges
    halfedges = np.argsort(triangles.edges.of_faces.ravel(), kind="stable")
    first_halfedge = np.concatenate([[0], np.cumsum(np.bincount(triangles.edges.of_faces.ravel(), minlength=n_edges))])
    corners = np.argsort(triangles.corner_vertices.ravel(), kind="stable")
    n = triangles.n_vertices
    first_corner = np.concatenate([[0], np.cumsum(np.bincount(triangles.corner_vertices.ravel(), minlength=n))])
    lengths = np.empty(n_edges)
    lengths[triangles.edges.of_faces] = triangles.edge_lengths
    return _propagate(
        triangles.corner_vertices,
        triangles.corner_positions,
        triangles.edges.of_faces,
        triangles.edges.forward,
        triangles.edges.vertices,
        lengths,
        halfedges,
        first_halfedge,
        corners,
        first_corner,
        bends_light(triangles),
        cleared(triangles, values, 1e-7 * float(lengths.mean())),
        tolerance,
    )


def cleared(triangles: LaidOutTriangles, values: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Values kept away from zero, so that the line crosses edges and no vertices.

    A vertex with zero gets the sign that its neighbours have less of: where both sides of a source have the same sign,
    the line runs round it.
    """
    near = np.abs(values) < least
    known = np.where(near | np.isnan(values), 0.0, np.sign(values))
    tail, head = triangles.edges.vertices.T
    around = np.bincount(tail, known[head], len(values)) + np.bincount(head, known[tail], len(values))
    return np.where(near, np.where(around > 0, -least, least), values)


def bends_light(triangles: LaidOutTriangles) -> NDArray[np.bool_]:
    """(n,) vertices that shortest lines can pass through: on a boundary, or with an angle of more than 2π."""
    angles = np.arctan2(1.0, triangles.corner_cotangents)
    total = np.bincount(triangles.corner_vertices.ravel(), angles.ravel(), triangles.n_vertices)
    special = total > 2 * np.pi + 1e-9
    special[triangles.edges.vertices[triangles.edges.face_counts != 2]] = True
    return special


@njit(cache=True, nogil=True)
def _distance(w, x, y):
    """From the source of a window to a point in the frame of its edge."""
    if w[_KIND] == _BEAM:
        return w[_SIGMA] + w[_P] * x + w[_Q] * y
    return w[_SIGMA] + w[_KIND] * np.sqrt((x - w[_P]) ** 2 + (y - w[_Q]) ** 2)


@njit(cache=True, nogil=True)
def _ray(w, x):
    """Direction of the light at a point of the edge; of any length."""
    if w[_KIND] == _BEAM:
        return w[_P], w[_Q]
    return w[_KIND] * (x - w[_P]), -w[_KIND] * w[_Q]


@njit(cache=True, nogil=True)
def _outrun(w, at_tail, at_head, length, slack):
    """Whether paths through an end of the edge reach all of the window sooner."""
    if at_tail + w[_S1] < _distance(w, w[_S1], 0.0) - slack:
        return True
    return at_head + length - w[_S0] < _distance(w, w[_S0], 0.0) - slack


@njit(cache=True, nogil=True)
def _trim(a, b):
    """Cut back two windows, a beginning first, where they overlap and the other is nearer."""
    if b[_S0] >= a[_S1]:
        return
    low, high = b[_S0], min(a[_S1], b[_S1])
    first = _distance(a, low, 0.0) - _distance(b, low, 0.0)
    last = _distance(a, high, 0.0) - _distance(b, high, 0.0)
    inside = b[_S1] < a[_S1]
    if first <= 0.0 and last <= 0.0:
        b[_S0] = high
    elif first >= 0.0 and last >= 0.0:
        if not inside:
            a[_S1] = low
    else:
        ahead = first < 0.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            if (_distance(a, middle, 0.0) < _distance(b, middle, 0.0)) == ahead:
                low = middle
            else:
                high = middle
        if ahead:
            b[_S0] = high
            if not inside:
                a[_S1] = high
        elif inside:
            b[_S1] = high


@njit(cache=True, nogil=True)
def _merge(a, b, length, tolerance):
    """Make a stand for b too, if the two are neighbours and one wave fits both: true where it does."""
    if abs(a[_S1] - b[_S0]) > 1e-6 * length:
        return False
    s0, between, s1 = a[_S0], a[_S1], b[_S1]
    ax, ay = _ray(a, s0)
    bx, by = _ray(b, s1)
    a_norm, b_norm = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
    if ay <= 1e-9 * a_norm or by <= 1e-9 * b_norm:
        return False
    ax, ay, bx, by = ax / a_norm, ay / a_norm, bx / b_norm, by / b_norm
    turn = ax * by - ay * bx
    begin, end = _distance(a, s0, 0.0), _distance(b, s1, 0.0)
    middle = 0.5 * (_distance(a, between, 0.0) + _distance(b, between, 0.0))
    merged = np.empty(6)
    merged[_S0], merged[_S1] = s0, s1
    if abs(turn) * 1e6 * length <= (s1 - s0) * by:
        x, y = ax + bx, ay + by
        norm = np.sqrt(x * x + y * y)
        merged[_P], merged[_Q], merged[_KIND] = x / norm, y / norm, _BEAM
        merged[_SIGMA] = begin - s0 * x / norm
    else:
        away = (s1 - s0) * by / turn
        if 0.0 < away < 4.0 * length:
            return False
        merged[_P], merged[_Q] = s0 + away * ax, away * ay
        merged[_KIND] = _POINT if away < 0.0 else _FOCUS
        merged[_SIGMA] = begin + away
    error, other = _distance(merged, between, 0.0) - middle, _distance(merged, s1, 0.0) - end
    if max(abs(error), abs(other)) > tolerance * length:
        return False
    merged[_SIGMA] -= 0.5 * (max(error, other, 0.0) + min(error, other, 0.0))
    a[:] = merged
    return True


@njit(cache=True, nogil=True)
def _clip(s0, s1, at_start, slope):
    """The part of [s0, s1] where ``at_start + slope s ≤ 0``."""
    if slope > 0.0:
        s1 = min(s1, -at_start / slope)
    elif slope < 0.0:
        s0 = max(s0, -at_start / slope)
    elif at_start > 0.0:
        s1 = s0 - 1.0
    return s0, s1


@njit(cache=True, nogil=True)
def _hit(x0, dx, dy, ax, ay, bx, by):
    """Where on the segment from a to b, as a fraction, the ray from (x0, 0) along (dx, dy) meets its line."""
    ex, ey = bx - ax, by - ay
    det = dx * ey - dy * ex
    if det == 0.0:
        return 0.0
    return min(max((dy * (ax - x0) - dx * ay) / det, 0.0), 1.0)


@njit(cache=True, nogil=True)
def _emit(
    state, heap, face, side, kind, t0, t1, point, normal, sigma, of_faces, forward, edge_vertices, lengths, halfedges,
    first_halfedge, corner_positions, distance, latest, slack,
):  # fmt: skip
    """Queue light that crosses a side of a face from within for the faces beyond; returns the windows.

    Layout coordinates: the side is lit from fraction t0 to t1; the source is a point, or a beam along a normal through
    a point, at distance σ.
    """
    windows, following, count = state
    edge = of_faces[face, side]
    length = lengths[edge]
    a, b = corner_positions[face, side], corner_positions[face, (side + 1) % 3]
    if not forward[face, side]:
        a, b = b, a
        t0, t1 = 1.0 - t1, 1.0 - t0
    if t1 - t0 <= 1e-12:
        return state
    if count + first_halfedge[edge + 1] - first_halfedge[edge] >= len(windows):
        more = np.empty((2 * len(windows), 6))
        more[:count] = windows[:count]
        links = np.empty(2 * len(windows), dtype=np.int64)
        links[:count] = following[:count]
        windows, following = more, links
    w = windows[count]
    w[_S0], w[_S1], w[_KIND] = t0 * length, t1 * length, kind
    unit = (b - a) / length
    if kind == _BEAM:
        turned = normal * unit.conjugate()
        w[_P], w[_Q] = turned.real, abs(turned.imag)
        w[_SIGMA] = sigma - ((point - a) * normal.conjugate()).real
    else:
        turned = (point - a) * unit.conjugate()
        w[_P], w[_Q], w[_SIGMA] = turned.real, -kind * abs(turned.imag), sigma
    tail, head = edge_vertices[edge]
    if _outrun(w, distance[tail], distance[head], length, slack * length):
        return windows, following, count
    near = min(_distance(w, w[_S0], 0.0), _distance(w, w[_S1], 0.0))
    first = count
    for k in range(first_halfedge[edge], first_halfedge[edge + 1]):
        halfedge = halfedges[k]
        if halfedge != 3 * face + side:
            windows[count] = windows[first]
            following[count] = latest[halfedge]
            if latest[halfedge] < 0:
                heapq.heappush(heap, (near + 1.5 * length, halfedge))
            latest[halfedge] = count
            count += 1
    return windows, following, count


@njit(cache=True, nogil=True)
def _crossing(values, corner_vertices, corner_positions, face, side):
    """The point of a side of a face at which the values are zero."""
    i, j = corner_vertices[face, side], corner_vertices[face, (side + 1) % 3]
    t = values[i] / (values[i] - values[j])
    return corner_positions[face, side] * (1.0 - t) + corner_positions[face, (side + 1) % 3] * t


@njit(cache=True, nogil=True)
def _segment(values, corner_vertices, corner_positions, face):
    """Whether the line crosses a face, the two sides it crosses, and where."""
    first, second = -1, -1
    for side in range(3):
        a, b = values[corner_vertices[face, side]], values[corner_vertices[face, (side + 1) % 3]]
        if (a < 0.0 < b) or (b < 0.0 < a):
            if first < 0:
                first = side
            else:
                second = side
    if second < 0:
        return False, 0, 0, 0j, 0j
    start = _crossing(values, corner_vertices, corner_positions, face, first)
    end = _crossing(values, corner_vertices, corner_positions, face, second)
    return abs(end - start) > 0.0, first, second, start, end


@njit(cache=True, nogil=True)
def _reach(v, distance_there, heap, distance, bends):
    """Note a path to a vertex; one that light bends round is queued."""
    if distance_there < distance[v] * (1.0 - 1e-14):
        distance[v] = distance_there
        if bends[v]:
            heapq.heappush(heap, (distance_there, -1 - v))


@njit(cache=True, nogil=True)
def _collect(state, latest, halfedge, at_tail, at_head, length, slack, tolerance):
    """The windows queued for a halfedge, in order along it, trimmed, and made fewer where one will do for several."""
    windows, following, _ = state
    count, number = 0, latest[halfedge]
    while number >= 0:
        count += 1
        number = following[number]
    chosen = np.empty((count, 6))
    starts = np.empty(count)
    count, number = 0, latest[halfedge]
    while number >= 0:
        if not _outrun(windows[number], at_tail, at_head, length, slack):
            chosen[count] = windows[number]
            starts[count] = windows[number, _S0]
            count += 1
        number = following[number]
    latest[halfedge] = -1
    chosen = chosen[:count][np.argsort(starts[:count])]
    if tolerance == 0.0:
        return chosen
    kept = 0
    for k in range(count):
        if kept > 0:
            _trim(chosen[kept - 1], chosen[k])
            if chosen[kept - 1, _S1] <= chosen[kept - 1, _S0]:
                kept -= 1
        if chosen[k, _S1] <= chosen[k, _S0]:
            continue
        if kept > 0 and _merge(chosen[kept - 1], chosen[k], length, tolerance):
            continue
        chosen[kept] = chosen[k]
        kept += 1
    return chosen[:kept]


@njit(cache=True, nogil=True)
def _propagate(
    corner_vertices, corner_positions, of_faces, forward, edge_vertices, lengths, halfedges, first_halfedge, corners,
    first_corner, bends, values, tolerance,
):  # fmt: skip
    n = len(bends)
    distance = np.full(n, np.inf)
    heap = [(0.0, 0)]
    heap.pop()
    state = (np.empty((1024, 6)), np.empty(1024, dtype=np.int64), 0)
    latest = np.full(3 * len(corner_vertices), -1, dtype=np.int64)  # window queued for each halfedge; others follow it
    slack = _ROUND + 2.0 * tolerance

    for face in range(len(corner_vertices)):  # the corners of crossed faces
        crossed, _, _, start, end = _segment(values, corner_vertices, corner_positions, face)
        if not crossed:
            continue
        along = end - start
        for k in range(3):
            v = corner_vertices[face, k]
            r = corner_positions[face, k] - start
            t = min(max((r * along.conjugate()).real / abs(along) ** 2, 0.0), 1.0)
            distance[v] = min(distance[v], abs(r - t * along))

    for face in range(len(corner_vertices)):
        crossed, first, second, start, end = _segment(values, corner_vertices, corner_positions, face)
        if not crossed:
            continue
        along = (end - start) / abs(end - start)
        for turn in (1.0, -1.0):  # beams to both sides
            normal = turn * 1j * along
            for side in range(3):
                a, b = corner_positions[face, side], corner_positions[face, (side + 1) % 3]
                foot = ((a - start) * along.conjugate()).real
                rate = ((b - a) * along.conjugate()).real
                height = ((a - start) * normal.conjugate()).real
                climb = ((b - a) * normal.conjugate()).real
                t0, t1 = _clip(0.0, 1.0, -foot, -rate)
                t0, t1 = _clip(t0, t1, foot - abs(end - start), rate)
                t0, t1 = _clip(t0, t1, -height, -climb)
                if t1 > t0:
                    state = _emit(
                        state, heap, face, side, _BEAM, t0, t1, start, normal, 0.0, of_faces, forward, edge_vertices,
                        lengths, halfedges, first_halfedge, corner_positions, distance, latest, slack,
                    )  # fmt: skip
        for which in range(2):  # fans between the beams of neighbouring segments
            side, point, other = (first, start, end) if which == 0 else (second, end, start)
            here = (other - point) / abs(other - point)
            edge = of_faces[face, side]
            for k in range(first_halfedge[edge], first_halfedge[edge + 1]):
                beyond, there = halfedges[k] // 3, halfedges[k] % 3
                alone = first_halfedge[edge + 1] - first_halfedge[edge] == 1
                if beyond == face and not alone:
                    continue
                # the fan in this face: behind its own segment, and behind that of the face beyond, laid out beside it
                back = here
                if not alone:
                    _, one, _, p, q = _segment(values, corner_vertices, corner_positions, beyond)
                    back = q - p if one == there else p - q
                    back /= abs(back)
                    a, b = corner_positions[beyond, there], corner_positions[beyond, (there + 1) % 3]
                    back *= (b - a).conjugate() / abs(b - a)
                    same = forward[beyond, there] == forward[face, side]
                    back = back.conjugate() if same else -back
                    a, b = corner_positions[face, side], corner_positions[face, (side + 1) % 3]
                    back *= (b - a) / abs(b - a)
                for step in range(1, 3):
                    far = (side + step) % 3
                    a, b = corner_positions[face, far], corner_positions[face, (far + 1) % 3]
                    t0, t1 = _clip(0.0, 1.0, ((a - point) * here.conjugate()).real, ((b - a) * here.conjugate()).real)
                    t0, t1 = _clip(t0, t1, ((a - point) * back.conjugate()).real, ((b - a) * back.conjugate()).real)
                    if t1 > t0:
                        state = _emit(
                            state, heap, face, far, _POINT, t0, t1, point, 0j, 0.0, of_faces, forward, edge_vertices,
                            lengths, halfedges, first_halfedge, corner_positions, distance, latest, slack,
                        )  # fmt: skip

    for v in range(n):
        if bends[v] and distance[v] < np.inf:
            heapq.heappush(heap, (distance[v], -1 - v))

    while len(heap) > 0:
        key, halfedge = heapq.heappop(heap)
        if halfedge < 0:  # light bends round a vertex
            v = -1 - halfedge
            if key > distance[v]:
                continue
            for k in range(first_corner[v], first_corner[v + 1]):
                face, corner = corners[k] // 3, corners[k] % 3
                source = corner_positions[face, corner]
                for step in range(1, 3):
                    _reach(
                        corner_vertices[face, (corner + step) % 3],
                        key + abs(corner_positions[face, (corner + step) % 3] - source), heap, distance, bends,
                    )  # fmt: skip
                state = _emit(
                    state, heap, face, (corner + 1) % 3, _POINT, 0.0, 1.0, source, 0j, key, of_faces, forward,
                    edge_vertices, lengths, halfedges, first_halfedge, corner_positions, distance, latest, slack,
                )  # fmt: skip
            continue

        face, side = halfedge // 3, halfedge % 3
        edge = of_faces[face, side]
        length = lengths[edge]
        tail, head = edge_vertices[edge]
        here = _collect(state, latest, halfedge, distance[tail], distance[head], length, slack * length, tolerance)
        a, b = corner_positions[face, side], corner_positions[face, (side + 1) % 3]
        ahead = forward[face, side]
        origin, unit = (a, (b - a) / length) if ahead else (b, (a - b) / length)
        up = 1j if ahead else -1j  # faces lie to the left of their sides
        apex = (corner_positions[face, (side + 2) % 3] - origin) * unit.conjugate()
        cx, cy = apex.real, abs(apex.imag)
        tail_side, head_side = ((side + 2) % 3, (side + 1) % 3) if ahead else ((side + 1) % 3, (side + 2) % 3)
        for w in here:
            s0, s1 = w[_S0], w[_S1]
            d0x, d0y = _ray(w, s0)
            d1x, d1y = _ray(w, s1)
            left = d0x * cy - d0y * (cx - s0)  # negative: the ray leaves the apex to its right
            right = d1x * cy - d1y * (cx - s1)
            blur = _ROUND * length
            if left <= blur * np.hypot(d0x, d0y) and right >= -blur * np.hypot(d1x, d1y):
                _reach(corner_vertices[face, (side + 2) % 3], _distance(w, cx, cy), heap, distance, bends)
            turned = unit * (w[_P] + up * w[_Q])
            source, normal = (origin, turned) if w[_KIND] == _BEAM else (origin + turned, 0j)
            if left < 0.0:  # light on the side from tail to apex
                t0 = _hit(s0, d0x, d0y, 0.0, 0.0, cx, cy)
                t1 = _hit(s1, d1x, d1y, 0.0, 0.0, cx, cy) if right < 0.0 else 1.0
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                state = _emit(
                    state, heap, face, tail_side, w[_KIND], t0, t1, source, normal, w[_SIGMA], of_faces, forward,
                    edge_vertices, lengths, halfedges, first_halfedge, corner_positions, distance, latest, slack,
                )  # fmt: skip
            if right > 0.0:  # light on the side from apex to head
                t0 = _hit(s0, d0x, d0y, cx, cy, length, 0.0) if left > 0.0 else 0.0
                t1 = _hit(s1, d1x, d1y, cx, cy, length, 0.0)
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                state = _emit(
                    state, heap, face, head_side, w[_KIND], t0, t1, source, normal, w[_SIGMA], of_faces, forward,
                    edge_vertices, lengths, halfedges, first_halfedge, corner_positions, distance, latest, slack,
                )  # fmt: skip
    return distance, state[2]
