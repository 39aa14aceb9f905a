"""Kernels: windows on the edges of a polyhedral surface.

In the frame of an edge, its tail is at the origin, its head on the positive x axis; waves arrive from below. A window
is a row ``(s0, s1, p, q, sigma, kind)``: the interval [s0, s1] of the edge, and the wave. Kind `POINT`: circular waves
from the point (p, q ≤ 0), whose own distance is σ; kind `FOCUS`: circular waves that contract to the point (p, q ≥ 0),
whose distance would be σ; kind `BEAM`: straight waves along the direction (p, q > 0), σ their distance at the tail.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

POINT, BEAM, FOCUS = 1.0, 0.0, -1.0
S0, S1, P, Q, SIGMA, KIND = range(6)


@compiled
def put(window: NDArray[np.float64], rows: NDArray[np.float64], k: int) -> None:
    """Write a window to row k, entry by entry: assignments to slices of arrays take long to compile."""
    for i in range(6):
        rows[k, i] = window[i]


@compiled
def arrival(w: NDArray[np.float64], x: float, y: float) -> float:
    """Distance from the source of a window to a point in the frame of its edge."""
    if w[KIND] == BEAM:
        return w[SIGMA] + w[P] * x + w[Q] * y
    return w[SIGMA] + w[KIND] * np.sqrt((x - w[P]) ** 2 + (y - w[Q]) ** 2)


@compiled
def ray(w: NDArray[np.float64], x: float) -> tuple[float, float]:
    """Direction of propagation at a point of the edge; of any length."""
    if w[KIND] == BEAM:
        return w[P], w[Q]
    return w[KIND] * (x - w[P]), -w[KIND] * w[Q]


@compiled
def outrun(w: NDArray[np.float64], at_tail: float, at_head: float, length: float, slack: float) -> bool:
    """Whether paths through an end of the edge are shorter everywhere in the window."""
    if at_tail + w[S1] < arrival(w, w[S1], 0.0) - slack:
        return True
    return at_head + length - w[S0] < arrival(w, w[S0], 0.0) - slack


@compiled
def trim(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    """Trim two overlapping windows, of which a begins first, to where each has the smaller distance."""
    if b[S0] >= a[S1]:
        return
    low, high = b[S0], min(a[S1], b[S1])
    first = arrival(a, low, 0.0) - arrival(b, low, 0.0)
    last = arrival(a, high, 0.0) - arrival(b, high, 0.0)
    inside = b[S1] < a[S1]
    if first <= 0.0 and last <= 0.0:
        b[S0] = high
    elif first >= 0.0 and last >= 0.0:
        if not inside:
            a[S1] = low
    else:
        ahead = first < 0.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            if (arrival(a, middle, 0.0) < arrival(b, middle, 0.0)) == ahead:
                low = middle
            else:
                high = middle
        if ahead:
            b[S0] = high
            if not inside:
                a[S1] = high
        elif inside:
            b[S1] = high


@compiled
def trim_by(old: NDArray[np.float64], w: NDArray[np.float64], slack: float) -> None:
    """Trim a window to where it is nearer, by more than `slack`, than an older one; from the middle nothing is cut."""
    low, high = max(old[S0], w[S0]), min(old[S1], w[S1])
    if not high > low:
        return
    first = arrival(old, low, 0.0) - arrival(w, low, 0.0) <= slack
    last = arrival(old, high, 0.0) - arrival(w, high, 0.0) <= slack
    if first and last:
        middle = 0.5 * (low + high)
        if arrival(old, middle, 0.0) - arrival(w, middle, 0.0) > slack:
            return
        if low <= w[S0]:
            w[S0] = high
        elif high >= w[S1]:
            w[S1] = low
        return
    if (first and low > w[S0]) or (last and high < w[S1]) or not (first or last):
        return
    for _ in range(30):
        middle = 0.5 * (low + high)
        if (arrival(old, middle, 0.0) - arrival(w, middle, 0.0) <= slack) == first:
            low = middle
        else:
            high = middle
    if first:
        w[S0] = low
    else:
        w[S1] = high


@compiled
def outdoes(w: NDArray[np.float64], old: NDArray[np.float64]) -> bool:
    """Whether a window covers another one and is nearer at its ends and in its middle."""
    if w[S0] > old[S0] or w[S1] < old[S1]:
        return False
    for k in range(3):
        x = old[S0] + 0.5 * k * (old[S1] - old[S0])
        if arrival(w, x, 0.0) > arrival(old, x, 0.0):
            return False
    return True


@compiled
def merge(a: NDArray[np.float64], b: NDArray[np.float64], length: float, tolerance: float) -> bool:
    """Merge window b into a, if they are neighbours and one wave approximates both; whether it was done."""
    if abs(a[S1] - b[S0]) > 1e-6 * length:
        return False
    s0, between, s1 = a[S0], a[S1], b[S1]
    ax, ay = ray(a, s0)
    bx, by = ray(b, s1)
    a_norm, b_norm = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
    if ay <= 1e-9 * a_norm or by <= 1e-9 * b_norm:
        return False
    ax, ay, bx, by = ax / a_norm, ay / a_norm, bx / b_norm, by / b_norm
    turn = ax * by - ay * bx
    begin, end = arrival(a, s0, 0.0), arrival(b, s1, 0.0)
    middle = 0.5 * (arrival(a, between, 0.0) + arrival(b, between, 0.0))
    merged = np.empty(6)
    merged[S0], merged[S1] = s0, s1
    if abs(turn) * 1e6 * length <= (s1 - s0) * by:
        x, y = ax + bx, ay + by
        norm = np.sqrt(x * x + y * y)
        merged[P], merged[Q], merged[KIND] = x / norm, y / norm, BEAM
        merged[SIGMA] = begin - s0 * x / norm
    else:
        away = (s1 - s0) * by / turn
        if 0.0 < away < 4.0 * length:
            return False
        merged[P], merged[Q] = s0 + away * ax, away * ay
        merged[KIND] = POINT if away < 0.0 else FOCUS
        merged[SIGMA] = begin + away
    error, other = arrival(merged, between, 0.0) - middle, arrival(merged, s1, 0.0) - end
    if max(abs(error), abs(other)) > tolerance * length:
        return False
    merged[SIGMA] -= 0.5 * (max(error, other, 0.0) + min(error, other, 0.0))
    for i in range(6):
        a[i] = merged[i]
    return True


@compiled
def straighten(w: NDArray[np.float64]) -> None:
    """Make a wave straight, nowhere nearer at the edge, which would pass its focus in the face ahead."""
    x, y = ray(w, 0.5 * (w[S0] + w[S1]))
    norm = np.sqrt(x * x + y * y)
    begin, end = arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0)
    w[P], w[Q], w[KIND] = x / norm, y / norm, BEAM
    w[SIGMA] = max(begin - w[S0] * w[P], end - w[S1] * w[P])


@compiled
def clip(s0: float, s1: float, at_start: float, slope: float) -> tuple[float, float]:
    """The part of [s0, s1] where ``at_start + slope s ≤ 0``."""
    if slope > 0.0:
        s1 = min(s1, -at_start / slope)
    elif slope < 0.0:
        s0 = max(s0, -at_start / slope)
    elif at_start > 0.0:
        s1 = s0 - 1.0
    return s0, s1


@compiled
def hit(x0: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Fraction of the way from a to b at which the ray from (x0, 0) along (dx, dy) meets the line through both."""
    ex, ey = bx - ax, by - ay
    det = dx * ey - dy * ex
    if det == 0.0:
        return 0.0
    return min(max((dy * (ax - x0) - dx * ay) / det, 0.0), 1.0)
