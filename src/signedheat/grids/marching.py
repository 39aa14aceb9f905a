"""Level sets on grids: closed manifold surfaces in space, and polylines in the plane. Their points are in cells.

On sparse grids marching cubes runs window by window, and vertices of neighbouring windows are merged. Tets in place of
cubes would make three times as many triangles.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError, OutsideError
from ..mesh.components import places_among
from ..mesh.edges import CLEARANCE
from ..packages import lazy_module
from .blocks import BLOCK, WINDOW, BlockValues

measure: Any = lazy_module("skimage.measure", "contours")

CAP = 0.01
"""Level sets that leave the box of the nodes are closed by walls this far outside of it, in cells."""
LARGEST_VALUE = 1e30
"""Values for marching cubes, which computes in single precision, are kept between this and its inverse."""


def closed_surface(values: Floats, spacing: Floats, level: float) -> tuple[Floats, Ints]:
    """Extract a level set of (nx, ny, nz) values as a closed, manifold surface that faces greater values.

    Return (n, 3) vertices, in cells, and (m, 3) faces. Cells at nodes without a value, NaN, are outside.
    """
    if values.ndim != 3:
        raise GeometryError(
            f"fields are contoured in 2 and 3 dimensions, and this grid has {values.ndim}", element="field"
        )
    if np.isinf(values).any():
        raise GeometryError("infinite values have no contour", element="values")
    height = closed_without_values(heights_above(values, spacing, level))
    largest = float(np.abs(height).max())
    if not 1 / LARGEST_VALUE < largest < LARGEST_VALUE and largest > 0:
        height = height / largest
    height = np.copysign(np.maximum(np.abs(height), 1 / LARGEST_VALUE), height)  # each keeps its sign
    shift = 0
    walls = values_at_walls(height)
    if walls.min() < 0 < walls.max():
        limit, height, shift = np.array(height.shape), np.pad(height, 1), 1
        _close_at_walls(height, np.full(3, -1), limit)
    vertices, faces = zero_set(height)
    return vertices - shift, faces


def zero_set(height: NDArray[np.floating], cells: Bools | None = None) -> tuple[Floats, Ints]:
    """Return (n, 3) vertices, in cells, and (m, 3) faces of the zero set, which face greater values, by marching cubes.

    If `cells` are given, which is True at the last node of each chosen cell, only those are used.
    """
    vertices, faces, _, _ = measure.marching_cubes(height, 0.0, gradient_direction="descent", mask=cells)
    return vertices.astype(np.float64), faces.astype(np.int64)


def level_lines(values: Floats, spacing: Floats, level: float) -> list[tuple[Floats, bool]]:
    """Return the (k, 2) points, in cells, of each line of a level set in the plane, and whether the line is closed.

    Values are those at (nx, ny) nodes, NaN where there is none, and lines end there. Greater values are to the left of
    lines. Values that differ from the level by a tiny share of the (2,) `spacing` are moved away from it, so that lines
    keep clear of nodes. Raise `OutsideError` if all values are on one side of the level.
    """
    lines = measure.find_contours(heights_above(values, spacing, level), 0.0, positive_orientation="high")
    return [(line, len(line) > 3 and bool((line[0] == line[-1]).all())) for line in lines]


def heights_above(values: Floats, spacing: Floats, level: float) -> Floats:
    """Return values at nodes minus the level, kept away from zero so that crossings respect `CLEARANCE`.

    NaN stays NaN. Raise `OutsideError` if all values are on one side of the level.
    """
    height = values - level
    finite = height[np.isfinite(height)]
    if not len(finite):
        raise GeometryError("no node has a value", remedy="compute the field anew", element="values")
    low, high = float(finite.min()), float(finite.max())
    if not low < 0 < high:
        raise OutsideError(
            f"level {level:g} is outside the values of the grid, {low + level:g} to {high + level:g}",
            remedy="choose another level, or smaller cells if the shape is thinner than they are"
            if low > 0
            else "choose another level, or a larger grid",
            element=f"level {level:g}",
        )
    _clear_of_zero(height, spacing)
    return height


def _clear_of_zero(height: NDArray[np.floating], spacing: Floats) -> None:
    """Move small values away from zero, each on its side, so that crossings respect `CLEARANCE`."""
    least = CLEARANCE * float(spacing.min())
    height[(height >= 0) & (height < least)] = least
    height[(height < 0) & (height > -least)] = -least


def closed_without_values(height: Floats) -> Floats:
    """Return values at nodes in which NaN is replaced by positive numbers, so that the zero set is closed there.

    Crossings lie about `CAP` cells from neighbours with a value.
    """
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


def values_at_walls(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values at the nodes on the walls of the box, in no particular order."""
    return np.concatenate([values.take([0, -1], axis).ravel() for axis in range(values.ndim)])


INDEX_BITS = 20
"""Number of bits of a node's index along an axis, in keys of edges."""


def window_surfaces(values: BlockValues, spacing: Floats, level: float) -> Iterator[tuple[Ints, Floats, Ints]]:
    """Yield the part of a level set in each window of blocks that it crosses, in order of windows.

    That is the (3,) indices of the window, (n, 3) vertices, in cells, and (m, 3) faces.
    """
    capped = _reaches_walls(values, level)
    for window in np.unique(values.blocks.places // WINDOW, axis=0).astype(np.int64):
        first = window * WINDOW * BLOCK
        shape = np.full(3, WINDOW * BLOCK + 1)
        if capped:  # a layer of nodes outside the walls
            beyond = (first == 0).astype(np.int64)
            first, shape = first - beyond, shape + beyond
        size = (int(shape[0]), int(shape[1]), int(shape[2]))
        height = values.window(first, size) - np.float32(level)
        if capped:
            _close_at_walls(height, first, np.array(values.shape))
        _clear_of_zero(height, spacing)
        part = _window_surface(height)
        if part is not None:
            yield window, part[0] + first, part[1]


def _window_surface(height: NDArray[np.float32]) -> tuple[Floats, Ints] | None:
    """Return (n, 3) vertices, in cells, and (m, 3) faces of the zero set in cells whose nodes all have values.

    `height`, (a, b, c), are the values at the nodes of a window of a grid, NaN where there is none. Return None if no
    such cell is crossed.
    """
    finite, inside = ~np.isnan(height), height < 0
    crossed = np.ones(tuple(n - 1 for n in height.shape), dtype=bool)  # cells with values at all nodes, of both signs
    any_inside, all_inside = np.zeros_like(crossed), np.ones_like(crossed)
    for corner in np.ndindex(2, 2, 2):
        corners = tuple(slice(c, n - 1 + c) for c, n in zip(corner, height.shape, strict=True))
        crossed &= finite[corners]
        any_inside |= inside[corners]
        all_inside &= inside[corners]
    crossed &= any_inside & ~all_inside
    if not crossed.any():
        return None
    marked = np.zeros(height.shape, dtype=bool)  # each cell is marked at its last node
    marked[1:, 1:, 1:] = crossed
    return zero_set(np.where(finite, height, np.float32(1.0)), marked)


def edges_of(vertices: Floats) -> tuple[Bools, Ints]:
    """(n,) whether (n, 3) vertices, in cells, lie on edges of the grid, and (n,) keys that identify these edges."""
    base = np.floor(vertices)
    crossed = vertices > base
    on_edge = crossed.sum(axis=1) == 1
    a, b, c = base.astype(np.int64).T + 1  # −1 next to walls
    return on_edge, ((a << INDEX_BITS | b) << INDEX_BITS | c) * 4 + np.where(on_edge, crossed.argmax(axis=1), 3)


def _reaches_walls(values: BlockValues, level: float) -> bool:
    """Return whether the level set leaves the grid: nodes on its walls lie on both sides."""
    signs: set[bool] = set()
    for axis, n in enumerate(values.shape):
        for node in (0, n - 1):
            rows = np.flatnonzero(values.blocks.places[:, axis] == node // BLOCK)
            wall: NDArray[np.float32] = np.moveaxis(values.values[rows], axis + 1, 0)[node % BLOCK]
            signs |= {bool(sign) for sign in np.unique(wall[~np.isnan(wall)] < level)}
    return len(signs) == 2


def _close_at_walls(height: NDArray[Any], first: Ints, limit: Ints) -> None:
    """Write positive values to the layer of nodes beyond the walls, so that crossings lie `CAP` cells beyond the walls.

    `height` begins at node `first` of a grid of `limit` nodes.
    """
    for axis in range(3):
        for beyond, wall in ((-1, 0), (int(limit[axis]), int(limit[axis]) - 1)):
            target, source = beyond - int(first[axis]), wall - int(first[axis])
            if 0 <= target < height.shape[axis] and 0 <= source < height.shape[axis]:
                layers: NDArray[Any] = np.moveaxis(height, axis, 0)
                layer = layers[source]
                layers[target] = np.where(layer < 0, -layer * np.float32(1 / CAP - 1), layer)


Part = tuple[Floats, Ints]
"""(n, 3) vertices and (m, 3) faces; vertex ids count on from those of the previous parts."""
_Seam = tuple[Ints, Ints]
"""Keys of the edges of the vertices on the walls of a window, ascending, and the ids of these vertices."""


def contour_parts(values: BlockValues, spacing: Floats, level: float) -> Iterator[Part]:
    """Yield the level set, in cells whose nodes have values, as parts: new vertices, and faces of new and earlier ones.

    It faces greater values, and is closed `CAP` cells outside the grid.
    """
    seams: dict[tuple[int, ...], _Seam] = {}
    count = 0
    for window, points, triangles in window_surfaces(values, spacing, level):
        # points on walls of windows are found again in the next ones, by the grid edges that they lie on
        on_edge, keys = edges_of(points)
        on_wall = (points % (WINDOW * BLOCK) == 0).any(axis=1)
        shared = np.flatnonzero(on_edge & on_wall)
        ids = np.full(len(points), -1, dtype=np.int64)
        for step in np.ndindex(3, 3, 3):
            if seam := seams.get(tuple((window + step - 1).tolist())):
                known_ids = np.append(seam[1], -1)[places_among(seam[0], keys[shared])]
                ids[shared] = np.maximum(ids[shared], known_ids)
        new = ids < 0
        ids[new] = count + np.arange(int(new.sum()))
        count += int(new.sum())
        order = shared[np.argsort(keys[shared])]
        seams[tuple(window.tolist())] = keys[order], ids[order]
        for passed in [place for place in seams if place[0] < window[0] - 1]:
            del seams[passed]
        yield points[new], ids[triangles]
    if not count:
        raise OutsideError(
            f"the values of the band do not take level {level:g}", remedy="choose another level or a wider band"
        )
