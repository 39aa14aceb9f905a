"""Level sets on grids: closed manifold surfaces in space, polylines in the plane."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GeometryError, OutsideError
from ..packages import lazy_module

measure: Any = lazy_module("skimage.measure", "contours")

CLEARANCE = 1e-3
"""Crossings stay this fraction of a cell away from the nodes, so that no two vertices of a surface coincide."""
CAP = 0.01
"""Fraction of a cell by which a surface that is closed along the box lies outside the box."""


def closed_surface(
    values: NDArray[np.float64],
    origin: NDArray[np.float64],
    spacing: NDArray[np.float64],
    level: float,
    refine: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Marching cubes (Lewiner et al. 2003), with closed, manifold, outward-oriented output for every input.

    Values are those at ``origin + (i, j, k) * spacing``. `refine` moves (n, 3) points of the level set along the edges
    of the grid that they lie on. Faces are counter-clockwise as seen from the side of greater values.
    """
    if values.ndim != 3:
        raise GeometryError(
            f"fields are contoured in 2 and 3 dimensions, and this grid has {values.ndim}", element="field"
        )
    if np.isinf(values).any():
        raise GeometryError("infinite values have no contour", element="values")
    height = closed_without_values(heights_above(values, spacing, level))
    largest = float(np.abs(height).max())
    if not 1e-30 < largest < 1e30 and largest > 0:  # what follows computes with single precision
        height = height / largest
    shift = 0
    if wall_signs(height) == {True, False}:
        height, shift = capped(height), 1
    vertices, faces, _, _ = measure.marching_cubes(height, 0.0, gradient_direction="descent")
    positions = origin + (vertices.astype(np.float64) - shift) * spacing
    return positions if refine is None else refine(positions), faces


def level_lines(
    values: NDArray[np.float64], origin: NDArray[np.float64], spacing: NDArray[np.float64], level: float
) -> list[tuple[NDArray[np.float64], bool]]:
    """Marching squares: points (k, 2) of each line, greater values to the left, and whether it closes.

    Lines are closed, unless they end at the box or at NaN values.

    Examples
    --------
    >>> [(points, closed)] = level_lines(np.array([[0.0] * 3, [1.0] * 3]), np.zeros(2), np.ones(2), 0.5)
    >>> points.tolist(), closed
    ([[0.5, 2.0], [0.5, 1.0], [0.5, 0.0]], False)
    """
    lines = measure.find_contours(heights_above(values, spacing, level), 0.0, positive_orientation="high")
    closed = [len(line) > 3 and bool((line[0] == line[-1]).all()) for line in lines]
    return [(origin + at * spacing, end) for at, end in zip(lines, closed, strict=True)]


def heights_above(values: NDArray[np.float64], spacing: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Values minus the level, kept away from zero so that crossings respect `CLEARANCE`."""
    height = values - level
    finite = height[np.isfinite(height)]
    low, high = float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))
    if not low < 0 < high:
        raise OutsideError(
            f"level {level:g} is outside the values of the grid, {low + level:g} to {high + level:g}",
            remedy="choose another level, or smaller cells if the shape is thinner than they are"
            if low > 0
            else "choose another level, or a larger grid",
            element=f"level {level:g}",
        )
    least = CLEARANCE * float(spacing.min())
    height[(height >= 0) & (height < least)] = least
    height[(height < 0) & (height > -least)] = -least
    return height


def closed_without_values(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nodes without a value made positive, so that crossings lie about `CAP` cells from neighbours that have one."""
    unknown = np.isnan(height)
    if not unknown.any():
        return height
    depth = np.pad(np.where(height < 0, -height, 0.0), 1)
    sums, counts = np.zeros_like(height), np.zeros_like(height)
    for shift in np.ndindex((3,) * height.ndim):
        shifted = depth[tuple(slice(i, i + n) for i, n in zip(shift, height.shape, strict=True))]
        sums += shifted
        counts += shifted > 0
    filling = np.where(counts > 0, (1 / CAP - 1) * sums / np.maximum(counts, 1), 1.0)
    return np.where(unknown, filling, height)


def wall_signs(height: NDArray[np.float64]) -> set[bool]:
    """Signs of the nodes on the walls of the box: {True} if all are positive, {False} if all are negative, or both."""
    walls = [height.take(end, axis=axis) for axis in range(height.ndim) for end in (0, -1)]
    return {bool(sign) for wall in walls for sign in ((wall > 0).any(), (wall > 0).all())}


def capped(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """One more layer of nodes all around, positive, so that crossings lie `CAP` cells outside the walls."""
    padded = np.pad(height, 1, mode="edge")
    for axis in range(height.ndim):
        for end in (0, -1):
            layer = np.moveaxis(padded, axis, 0)[end]
            np.copyto(layer, -layer * (1 / CAP - 1), where=layer < 0)
    return padded
