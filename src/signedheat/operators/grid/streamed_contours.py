"""Level sets on sparse grids part by part, in memory that does not grow with them: one mesh, its seams welded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .block_contours import WINDOW, Refine, edges_of, merged, no_level, window_surfaces
from .blocks import SIDE, Blocks

Part = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices, (n, 3), and faces, (m, 3), which count the vertices of all parts before."""
_Seam = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Keys of the vertices on the walls of a window, ascending, and the numbers of these vertices."""


def contour_parts(
    blocks: Blocks, values: NDArray[np.floating[Any]], spacing: NDArray[np.float64], level: float, refine: Refine
) -> Iterator[Part]:
    """The vertices and faces of `block_contour`, in another order, window by window.

    Faces use vertices of their own part and of those before. Only the vertices on walls between windows are kept, as
    long as windows beside them are to come.

    Parameters
    ----------
    blocks, values, spacing, level, refine
        See `block_contour`.

    Yields
    ------
    vertices, faces : (n, 3) float, (m, 3) int
        New vertices and new faces.

    Raises
    ------
    OutsideError
        If the values do not take the level.
    """
    seams: dict[tuple[int, ...], _Seam] = {}
    count = 0
    for window, points, triangles in window_surfaces(blocks, values, spacing, level):
        points, triangles = merged(points, triangles)
        on_edge, keys = edges_of(points)
        shared = np.flatnonzero(on_edge & _on_walls(points, window))
        numbers = np.full(len(points), -1, dtype=np.int64)
        for known in _seams_around(seams, window):
            numbers[shared] = np.maximum(numbers[shared], _looked_up(known, keys[shared]))
        new = numbers < 0
        numbers[new] = count + np.arange(int(new.sum()))
        count += int(new.sum())
        order = shared[np.argsort(keys[shared])]
        seams[tuple(window.tolist())] = keys[order], numbers[order]
        for passed in [place for place in seams if place[0] < window[0] - 1]:
            del seams[passed]
        yield refine(points[new]), numbers[triangles]
    if not count:
        raise no_level(level)


def _on_walls(points: NDArray[np.float64], window: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which points, in cells, lie on the walls of a window."""
    size = WINDOW * SIDE
    return np.asarray(((points == window * size) | (points == (window + 1) * size)).any(axis=1))


def _seams_around(seams: dict[tuple[int, ...], _Seam], window: NDArray[np.int64]) -> list[_Seam]:
    """Those of the windows that touch one."""
    around = (tuple((window + np.array(step) - 1).tolist()) for step in np.ndindex(3, 3, 3))
    return [seams[place] for place in around if place in seams]


def _looked_up(seam: _Seam, keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) number of the vertex with each key, −1 where there is none."""
    held, numbers = seam
    if not len(held):
        return np.full(len(keys), -1, dtype=np.int64)
    at = np.minimum(np.searchsorted(held, keys), len(held) - 1)
    return np.where(held[at] == keys, numbers[at], -1)
