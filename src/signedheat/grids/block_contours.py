"""Level sets on sparse grids: marching cubes, window by window, and vertices of neighbouring windows merged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OutsideError
from ..packages import lazy_module
from .blocks import SIDE, BlockValues
from .marching import CAP, CLEARANCE

measure: Any = lazy_module("skimage.measure", "contours")

WINDOW = 8
"""Blocks along each edge of a window."""
BITS = 20
"""Of the number of a node along an axis."""
Refine = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def block_contour(
    values: BlockValues, spacing: NDArray[np.float64], level: float, refine: Refine | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Marching cubes (Lewiner et al. 2003) in the cells whose nodes all have a value: closed where those around do.

    Neighbouring windows share nodes, and so find the same points on the edges between them; these become one. Where the
    level set leaves the grid it is closed along the walls, `CAP` cells outside. `refine` moves (n, 3) points, in cells,
    along the edges of the grid that they lie on. Vertices are in cells from the first node on, faces counter-clockwise
    as seen from the side of greater values.
    """
    vertices, faces = zip(*contour_parts(values, spacing, level, refine), strict=True)
    return np.concatenate(vertices), np.concatenate(faces)


def window_surfaces(
    values: BlockValues, spacing: NDArray[np.float64], level: float
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]]:
    """The place of each window of `WINDOW` blocks through which the level set goes, in order, with that part of it.

    Vertices are in cells from the first node of the grid, and those on walls between windows are in each of these.
    """
    least = CLEARANCE * float(spacing.min())
    capped = _reaches_walls(values, level)
    for window in np.unique(values.blocks.places // WINDOW, axis=0).astype(np.int64):
        first = window * WINDOW * SIDE
        shape = np.full(3, WINDOW * SIDE + 1)
        if capped:  # a layer of nodes outside the walls
            beyond = (first == 0).astype(np.int64)
            first, shape = first - beyond, shape + beyond
        size = (int(shape[0]), int(shape[1]), int(shape[2]))
        height = values.window(first, size) - np.float32(level)
        if capped:
            _close_at_walls(height, first, np.array(values.shape))
        height[(height >= 0) & (height < least)] = least
        height[(height < 0) & (height > -least)] = -least
        found = _window_surface(height)
        if found is not None:
            yield window, found[0] + first, found[1].astype(np.int64)


def _window_surface(height: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.int32]] | None:
    """Vertices in cells and faces, in cells whose nodes all have a value; None if there are none."""
    finite = ~np.isnan(height)
    whole = np.zeros(height.shape, dtype=bool)  # cells, at their last nodes
    inner = np.ones(tuple(n - 1 for n in height.shape), dtype=bool)
    some, every = np.zeros_like(inner), np.ones_like(inner)
    inside = height < 0
    for corner in np.ndindex(2, 2, 2):
        part = tuple(slice(c, n - 1 + c) for c, n in zip(corner, height.shape, strict=True))
        inner &= finite[part]
        some |= inside[part]
        every &= inside[part]
    inner &= some & ~every
    if not inner.any():
        return None
    whole[1:, 1:, 1:] = inner
    filled = np.where(finite, height, np.float32(1.0))
    vertices, faces, _, _ = measure.marching_cubes(filled, 0.0, gradient_direction="descent", mask=whole)
    return vertices.astype(np.float64), faces


def edges_of(vertices: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """(n,) whether vertices, in cells, lie on edges of the grid, and numbers that those on the same edge share."""
    base = np.floor(vertices)
    crossed = vertices > base
    on_edge = crossed.sum(axis=1) == 1
    a, b, c = base.astype(np.int64).T + 1  # −1 next to walls
    return on_edge, ((a << BITS | b) << BITS | c) * 4 + np.where(on_edge, crossed.argmax(axis=1), 3)


def _reaches_walls(values: BlockValues, level: float) -> bool:
    """Whether the level set leaves the grid: nodes on its walls lie on both sides."""
    signs: set[bool] = set()
    for axis, n in enumerate(values.shape):
        for node in (0, n - 1):
            rows = np.flatnonzero(values.blocks.places[:, axis] == node // SIDE)
            wall: NDArray[np.float32] = np.moveaxis(values.values[rows], axis + 1, 0)[node % SIDE]
            signs |= {bool(sign) for sign in np.unique(wall[~np.isnan(wall)] < level)}
    return len(signs) == 2


def _close_at_walls(height: NDArray[np.float32], first: NDArray[np.int64], limit: NDArray[np.int64]) -> None:
    """Values for the layer of nodes beyond the walls, outside, so that crossings lie `CAP` cells beyond the walls."""
    for axis in range(3):
        for beyond, wall in ((-1, 0), (int(limit[axis]), int(limit[axis]) - 1)):
            at, from_ = beyond - int(first[axis]), wall - int(first[axis])
            if 0 <= at < height.shape[axis] and 0 <= from_ < height.shape[axis]:
                layers: NDArray[np.float32] = np.moveaxis(height, axis, 0)
                layer = layers[from_]
                layers[at] = np.where(layer < 0, -layer * np.float32(1 / CAP - 1), layer)


Part = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices, (n, 3), and faces, (m, 3), which count the vertices of all parts before."""
_Seam = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Keys of the vertices on the walls of a window, ascending, and the numbers of these vertices."""


def contour_parts(
    values: BlockValues, spacing: NDArray[np.float64], level: float, refine: Refine | None = None
) -> Iterator[Part]:
    """The vertices and faces of `block_contour`, window by window: new vertices, and faces that use these and older.

    Only the vertices on walls between windows are kept, as long as neighboring windows are to come.
    """
    seams: dict[tuple[int, ...], _Seam] = {}
    count = 0
    for window, points, triangles in window_surfaces(values, spacing, level):
        on_edge, keys = edges_of(points)
        on_wall = (points % (WINDOW * SIDE) == 0).any(axis=1)
        shared = np.flatnonzero(on_edge & on_wall)
        numbers = np.full(len(points), -1, dtype=np.int64)
        for step in np.ndindex(3, 3, 3):
            if seam := seams.get(tuple((window + step - 1).tolist())):
                numbers[shared] = np.maximum(numbers[shared], _looked_up(seam, keys[shared]))
        new = numbers < 0
        numbers[new] = count + np.arange(int(new.sum()))
        count += int(new.sum())
        order = shared[np.argsort(keys[shared])]
        seams[tuple(window.tolist())] = keys[order], numbers[order]
        for passed in [place for place in seams if place[0] < window[0] - 1]:
            del seams[passed]
        yield points[new] if refine is None else refine(points[new]), numbers[triangles]
    if not count:
        raise OutsideError(
            f"the values of the band do not take level {level:g}", remedy="choose another level or a wider band"
        )


def _looked_up(seam: _Seam, keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) number of the vertex with each key, −1 where there is none."""
    held, numbers = seam
    if not len(held):
        return np.full(len(keys), -1, dtype=np.int64)
    at = np.minimum(np.searchsorted(held, keys), len(held) - 1)
    return np.where(held[at] == keys, numbers[at], -1)
