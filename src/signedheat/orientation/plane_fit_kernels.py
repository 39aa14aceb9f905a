"""Loops that fit planes to neighbourhoods, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

Floats = NDArray[np.float64]


@compiled
def least_eigenvector(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, axis: Floats) -> float:
    """Write the unit eigenvector of the least eigenvalue of a symmetric 3×3 matrix; return that eigenvalue.

    Eigenvalues in closed form by the angle of their cubic (Smith 1961), the vector as a product of two rows.
    """
    mean = (xx + yy + zz) / 3.0
    ax, ay, az = xx - mean, yy - mean, zz - mean
    p = ((ax * ax + ay * ay + az * az + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0) ** 0.5
    if not p > 1e-15 * abs(mean):
        axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
        return mean
    half = (ax * (ay * az - yz * yz) - xy * (xy * az - yz * xz) + xz * (xy * yz - ay * xz)) / (2.0 * p * p * p)
    least = mean + 2.0 * p * np.cos((np.arccos(min(max(half, -1.0), 1.0)) + 2.0 * np.pi) / 3.0)
    ax, ay, az = xx - least, yy - least, zz - least
    longest = -1.0
    for pair in range(3):
        if pair == 0:
            u, v, w = xy * yz - xz * ay, xz * xy - ax * yz, ax * ay - xy * xy
        elif pair == 1:
            u, v, w = xy * az - xz * yz, xz * xz - ax * az, ax * yz - xy * xz
        else:
            u, v, w = ay * az - yz * yz, yz * xz - xy * az, xy * yz - ay * xz
        square = u * u + v * v + w * w
        if square > longest:
            longest = square
            axis[0], axis[1], axis[2] = u, v, w
    if longest <= 1e-24 * p**4:  # points along a line, whose direction each row has: any axis across it will do
        u, v, w = xx - least, xy, xz
        if yy - least > u:
            u, v, w = xy, yy - least, yz
        if zz - least > max(xx, yy) - least:
            u, v, w = xz, yz, zz - least
        if abs(u) <= abs(v) and abs(u) <= abs(w):
            axis[0], axis[1], axis[2] = 0.0, w, -v
        elif abs(v) <= abs(w):
            axis[0], axis[1], axis[2] = -w, 0.0, u
        else:
            axis[0], axis[1], axis[2] = v, -u, 0.0
        longest = axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2
    length = longest**0.5
    axis[0], axis[1], axis[2] = axis[0] / length, axis[1] / length, axis[2] / length
    value: float = max(least, 0.0)
    return value


@compiled
def weighted_plane(offsets: Floats, weights: Floats, count: int, axis: Floats, center: Floats) -> float:
    """Write normal and weighted mean of the first `count` points; return their mean squared height."""
    total = x = y = z = 0.0
    for j in range(count):
        total += weights[j]
        x += weights[j] * offsets[j, 0]
        y += weights[j] * offsets[j, 1]
        z += weights[j] * offsets[j, 2]
    x, y, z = x / total, y / total, z / total
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(count):
        a, b, c = offsets[j, 0] - x, offsets[j, 1] - y, offsets[j, 2] - z
        wa, wb = weights[j] * a, weights[j] * b
        xx, xy, xz = xx + wa * a, xy + wa * b, xz + wa * c
        yy, yz, zz = yy + wb * b, yz + wb * c, zz + weights[j] * c * c
    center[0], center[1], center[2] = x, y, z
    square: float = least_eigenvector(xx / total, xy / total, xz / total, yy / total, yz / total, zz / total, axis)
    return square


@compiled
def plane_through(a: Floats, b: Floats, axis: Floats) -> bool:
    """Write the normal of the plane spanned by two vectors; return whether they span one."""
    u, v, w = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    square = u * u + v * v + w * w
    if square <= 1e-16 * (a[0] ** 2 + a[1] ** 2 + a[2] ** 2) * (b[0] ** 2 + b[1] ** 2 + b[2] ** 2):
        return False
    length = square**0.5
    axis[0], axis[1], axis[2] = u / length, v / length, w / length
    return True


@compiled
def weigh_by_height(offsets: Floats, near: Floats, axis: Floats, base: Floats, height: float, weights: Floats) -> float:
    """Write Tukey's biweight of the heights over a plane through `base`, times `near`; return the sum."""
    total = 0.0
    level = axis[0] * base[0] + axis[1] * base[1] + axis[2] * base[2]
    for j in range(len(near)):
        part = (axis[0] * offsets[j, 0] + axis[1] * offsets[j, 1] + axis[2] * offsets[j, 2] - level) / height
        weights[j] = near[j] * (1.0 - part * part) ** 2 if abs(part) < 1.0 else 0.0
        total += weights[j]
    return total


@compiled
def robust_planes(
    points: Floats,
    neighbors: NDArray[np.int64],
    distances: Floats,
    heights: Floats,
    on_surface: bool,
    n_starts: int,
    axes: Floats,
    centers: Floats,
    deviations: Floats,
) -> None:
    """Fit a plane near each point to those of its neighbours that lie within a height of it, from several starts.

    The first neighbour is the point itself. Heights are parts of the reach, one after the other: over the plane through
    the point, if `on_surface`, else through the centre of those found before, the point itself at first. The plane with
    most neighbours within the last height is kept.
    """
    n, k = neighbors.shape
    offsets, near, weights = np.empty((k, 3)), np.empty(k), np.empty(k)
    axis, center, origin = np.empty(3), np.empty(3), np.zeros(3)
    base = origin if on_surface else center
    for i in range(n):
        reach, most = distances[i, k - 1], -1.0
        axes[i, 2] = 1.0
        if not reach > 0.0:
            continue
        for j in range(k):
            for c in range(3):
                offsets[j, c] = points[neighbors[i, j], c] - points[neighbors[i, 0], c]
            near[j] = np.exp(-((distances[i, j] / reach) ** 2))
        for start in range(n_starts):
            if start < 2:
                weighted_plane(offsets, near, k if start == 0 else min(k, 7), axis, center)
            elif k < 4 or not plane_through(offsets[1 + start // 4], offsets[2 + (start > 2)], axis):
                continue
            square, center[0], center[1], center[2] = 0.0, 0.0, 0.0, 0.0
            for height in heights:
                weigh_by_height(offsets, near, axis, base, height * reach, weights)
                square = weighted_plane(offsets, weights, k, axis, center)
            explained = weigh_by_height(offsets, near, axis, base, heights[-1] * reach, weights)
            if explained > most:
                most, deviations[i] = explained, square**0.5 / reach
                for c in range(3):
                    axes[i, c], centers[i, c] = axis[c], points[neighbors[i, 0], c] + center[c]
