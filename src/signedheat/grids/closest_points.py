"""Closest points on the zero set of a grid function.

The zero set is known by its crossings with the edges of the grid, its normals and its curvature there. Positions are in
units of length from the grid's origin. Arrays have four axes and vectors four components, of which the first ones are
unused in fewer dimensions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled


def crossed_edges(field: NDArray[np.float64]) -> NDArray[np.int32]:
    """(e, 5) node (4 indices) and axis of each edge whose two ends have different signs; zero counts as positive."""
    found = [np.argwhere(np.diff(field < 0, axis=axis)) for axis in range(4)]
    return np.concatenate([np.insert(nodes, 4, axis, axis=1) for axis, nodes in enumerate(found)]).astype(np.int32)


@compiled
def _cubic(
    field: NDArray[np.float64], place: NDArray[np.float64], weights: NDArray[np.float64], gradient: NDArray[np.float64]
) -> float:
    """Value of the cubic convolution interpolant (Keys 1981) at a position in cells; writes its `gradient`."""
    base = np.empty(4, dtype=np.int64)
    for axis in range(4):
        n = field.shape[axis]
        base[axis] = min(max(np.int64(np.floor(place[axis])), 0), max(n - 2, 0))
        f = place[axis] - base[axis]
        g = 1.0 - f
        for side in range(2):  # weights of the value, and of the derivative
            if n == 1:
                w0, w1, w2, w3 = 0.0, 1.0 - side, 0.0, 0.0
            elif side == 0:
                w0, w3 = -0.5 * f * g * g, -0.5 * f * f * g
                w1, w2 = g * (1.0 + f - 1.5 * f * f), f * (1.0 + g - 1.5 * g * g)
            else:
                w0, w3 = -0.5 * g * (1.0 - 3.0 * f), 0.5 * f * (1.0 - 3.0 * g)
                w1, w2 = f * (4.5 * f - 5.0), -g * (4.5 * g - 5.0)
            if n > 1 and base[axis] == 0:  # linear extrapolation beyond the walls
                w1, w2, w0 = w1 + 2.0 * w0, w2 - w0, 0.0
            if n > 1 and base[axis] == n - 2:
                w2, w1, w3 = w2 + 2.0 * w3, w1 - w3, 0.0
            weights[side, axis, 0], weights[side, axis, 1] = w0, w1
            weights[side, axis, 2], weights[side, axis, 3] = w2, w3
    value = 0.0
    gradient[:] = 0.0
    for i in range(4):
        wi, si = weights[0, 0, i], weights[1, 0, i]
        if wi == 0.0 and si == 0.0:
            continue
        for j in range(4):
            wj, sj = weights[0, 1, j], weights[1, 1, j]
            if wj == 0.0 and sj == 0.0:
                continue
            for k in range(4):
                wk, sk = weights[0, 2, k], weights[1, 2, k]
                if wk == 0.0 and sk == 0.0:
                    continue
                line, slope = 0.0, 0.0
                for m in range(4):
                    if weights[0, 3, m] != 0.0 or weights[1, 3, m] != 0.0:
                        here = field[base[0] + i - 1, base[1] + j - 1, base[2] + k - 1, base[3] + m - 1]
                        line += weights[0, 3, m] * here
                        slope += weights[1, 3, m] * here
                value += wi * wj * wk * line
                gradient[0] += si * wj * wk * line
                gradient[1] += wi * sj * wk * line
                gradient[2] += wi * wj * sk * line
                gradient[3] += wi * wj * wk * slope
    return value


@compiled
def crossings_at(
    field: NDArray[np.float64], edges: NDArray[np.int32], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(e, 18) position, unit normal and shape operator (symmetric, ten numbers) of the zero set at crossed edges."""
    result = np.zeros((len(edges), 18))
    weights = np.empty((2, 4, 4))
    slope, start, place, ahead, behind = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    bend = np.empty((4, 4))
    for e in range(len(edges)):
        axis = edges[e, 4]
        i, j, k, m = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        here = field[i, j, k, m]
        there = field[i + (axis == 0), j + (axis == 1), k + (axis == 2), m + (axis == 3)]
        for d in range(4):
            start[d] = edges[e, d]
        start[axis] += here / (here - there)
        for d in range(4):
            place[d] = start[d]
        # Newton's method along the gradient, onto the zero set of the interpolant; back to the crossing if it diverges
        for _ in range(3):
            value = _cubic(field, place, weights, slope)
            square, moved = 0.0, 0.0
            for d in range(4):
                slope[d] /= steps[d]
                square += slope[d] ** 2
            for d in range(4):
                if square > 0.0:
                    place[d] -= value * slope[d] / (square * steps[d])
                moved = max(moved, abs(place[d] - start[d]))
                if place[d] < 0.0 or place[d] > field.shape[d] - 1:
                    moved = 2.0
            if not moved < 1.0:
                for d in range(4):
                    place[d] = start[d]
                break
        _cubic(field, place, weights, slope)
        square = 0.0
        for d in range(4):
            slope[d] /= steps[d]
            square += slope[d] ** 2
        length = np.sqrt(square)
        if length == 0.0:
            slope[axis] = 1.0 if there > here else -1.0
            length = 1.0
        for d in range(4):
            result[e, d] = place[d] * steps[d]
            result[e, 4 + d] = slope[d] / length
        # differences of the gradient one cell apart
        for d in range(4):
            for f in range(4):
                ahead[f] = behind[f] = place[f]
                bend[d, f] = 0.0
            ahead[d] = min(place[d] + 1.0, field.shape[d] - 1.0)
            behind[d] = max(place[d] - 1.0, 0.0)
            span = (ahead[d] - behind[d]) * steps[d] * length
            if span > 0.0:
                _cubic(field, ahead, weights, slope)
                for f in range(4):
                    bend[d, f] += slope[f] / steps[f] / span
                _cubic(field, behind, weights, slope)
                for f in range(4):
                    bend[d, f] -= slope[f] / steps[f] / span
        at = 8
        for d in range(4):
            for f in range(d + 1):
                result[e, at] = 0.5 * (bend[d, f] + bend[f, d])
                at += 1
    return result


@compiled
def circle_distance(
    crossing: NDArray[np.float64], away: NDArray[np.float64], across: NDArray[np.float64], reach: float
) -> float:
    """Distance to the touching circle in the plane of a point, `away` from a crossing, and the normal there.

    With s along the normal, r across it and bending k in the direction of r, the distance to the circle of radius 1/k
    is ``(√((1 + ks)² + k²r²) − 1) / k``, here without the cancellation. `across` is room to work in.
    """
    s, square = 0.0, 0.0
    for d in range(4):
        s += away[d] * crossing[4 + d]
        square += away[d] ** 2
    side = 0.0
    for d in range(4):
        across[d] = away[d] - s * crossing[4 + d]
        side += across[d] ** 2
    distance = np.sqrt(square)
    if side > 1e-12 * square:
        bend, at = 0.0, 8
        for d in range(4):
            for f in range(d):
                bend += 2.0 * across[d] * crossing[at] * across[f]
                at += 1
            bend += across[d] ** 2 * crossing[at]
            at += 1
        bend /= side
        root = np.sqrt(max(0.0, 1.0 + 2.0 * bend * s + bend * bend * square))
        if 1.0 + bend * s > 0.0:  # beyond its centre the other side of the circle is nearer, which is no surface
            circle = abs(2.0 * s + bend * square) / (1.0 + root)
            distance = min(distance, max(circle, distance - reach))
    return float(distance)
