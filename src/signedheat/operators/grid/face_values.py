"""Kernels: what a grid function does along triangles, of any size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled


def values_at(function: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(s,) values of a function on a grid of three axes at (s, 3) positions in cells; 0 outside.

    Examples
    --------
    >>> values_at(np.arange(8.0).reshape(2, 2, 2), np.array([[0.5, 0.0, 1.0], [2.0, 0.0, 0.0]]))
    array([3., 0.])
    """
    values: NDArray[np.float64] = _values_at(np.ascontiguousarray(function), np.ascontiguousarray(positions))
    return values


def ranges_on_faces(
    function: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest value of a grid function on (m, 3, 3) triangles in cells, at points at most a cell apart.

    Takes time in proportion to the area of the triangles in squared cells.

    Examples
    --------
    >>> ramp = np.broadcast_to(np.arange(9.0)[:, None, None], (9, 9, 9))
    >>> ranges_on_faces(ramp, np.array([[[1.0, 0, 0], [7, 0, 0], [1, 6, 6]]]))
    (array([1.]), array([7.]))
    """
    low, high = _ranges_on_faces(np.ascontiguousarray(function), np.ascontiguousarray(corners))
    return low, high


@compiled
def _value(function: NDArray[np.float64], x: float, y: float, z: float) -> float:
    """Linear between nodes."""
    n0, n1, n2 = function.shape
    if not (0.0 <= x <= n0 - 1 and 0.0 <= y <= n1 - 1 and 0.0 <= z <= n2 - 1):
        return 0.0
    i, j, k = min(int(x), n0 - 2), min(int(y), n1 - 2), min(int(z), n2 - 2)
    f, g, h = x - i, y - j, z - k
    result = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                part = (f if a else 1.0 - f) * (g if b else 1.0 - g) * (h if c else 1.0 - h)
                result += part * function[i + a, j + b, k + c]
    return result


@compiled
def _values_at(function: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    result = np.empty(len(positions))
    for s in range(len(positions)):
        result[s] = _value(function, positions[s, 0], positions[s, 1], positions[s, 2])
    return result


@compiled
def _ranges_on_faces(
    function: NDArray[np.float64],
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = np.empty(len(corners)), np.empty(len(corners))
    largest = 4 * max(function.shape[0], function.shape[1], function.shape[2])
    for m in range(len(corners)):
        longest = 0.0
        for c in range(3):
            square = 0.0
            for d in range(3):
                square += (corners[m, c, d] - corners[m, (c + 1) % 3, d]) ** 2
            longest = max(longest, square)
        n = min(max(1, int(np.ceil(np.sqrt(longest)))), largest)
        low[m], high[m] = np.inf, -np.inf
        for i in range(n + 1):
            for j in range(n + 1 - i):
                a, b, c = i / n, j / n, (n - i - j) / n  # none below zero, for rounding
                value = _value(
                    function,
                    a * corners[m, 0, 0] + b * corners[m, 1, 0] + c * corners[m, 2, 0],
                    a * corners[m, 0, 1] + b * corners[m, 1, 1] + c * corners[m, 2, 1],
                    a * corners[m, 0, 2] + b * corners[m, 1, 2] + c * corners[m, 2, 2],
                )
                low[m], high[m] = min(low[m], value), max(high[m], value)
    return low, high
