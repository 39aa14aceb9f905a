"""Levels of parts: means over their faces of their own winding numbers.

The winding number jumps by one across a face. The mean of its two sides, here a part's *level*, is ½ on a closed
surface that faces outwards, −½ on one that faces inwards, and 0 on a flat sheet; between, it says how much of a body a
part is: half a ball has .31, a quarter .20. Where faces are missing everywhere, it is half of the share that is there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .meshes import face_areas
from .winding_tree import WindingTree, solid_angle

PLACES = 4096
"""Faces of a large part that its level is the mean of."""
FEW = 256
"""Faces up to which those of a part are summed one by one."""


def own_levels(triangles: NDArray[np.float64], parts: NDArray[np.int64]) -> NDArray[np.float64]:
    """(p,) mean over the faces of each part of its own winding number, between the two sides of a face."""
    order = np.argsort(parts, kind="stable")
    counts = np.bincount(parts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    corners = np.ascontiguousarray(triangles[order]).reshape(-1, 9)
    areas = face_areas(triangles[order])
    total = np.bincount(parts[order], areas)
    levels = np.bincount(parts[order], areas * _among_few(corners, starts, FEW)) / np.maximum(
        total, np.finfo(float).tiny
    )
    for part in np.flatnonzero(counts > FEW):
        levels[part] = level(triangles[order[starts[part] : starts[part + 1]]])
    return levels


def level(triangles: NDArray[np.float64], faces: NDArray[np.int64] | None = None) -> float:
    """The mean over all faces, or some, of the winding number of all, between the two sides of a face."""
    some = np.arange(len(triangles)) if faces is None else faces
    some = some[:: max(1, len(some) // PLACES)]
    areas = face_areas(triangles[some])
    if not areas.any():
        return 0.0
    behind = WindingTree.of(triangles).behind(some, triangles[some].mean(axis=1))
    return float(np.average(behind, weights=areas)) - 0.5


@compiled
def _among_few(corners: NDArray[np.float64], starts: NDArray[np.int64], few: int) -> NDArray[np.float64]:
    levels = np.zeros(len(corners))
    for p in range(len(starts) - 1):
        if starts[p + 1] - starts[p] > few:
            continue
        for i in range(starts[p], starts[p + 1]):
            x = (corners[i, 0] + corners[i, 3] + corners[i, 6]) / 3
            y = (corners[i, 1] + corners[i, 4] + corners[i, 7]) / 3
            z = (corners[i, 2] + corners[i, 5] + corners[i, 8]) / 3
            total = 0.0
            for j in range(starts[p], starts[p + 1]):
                if j != i:
                    rest, volume = solid_angle(corners, j, x, y, z)
                    total += 2.0 * np.arctan2(volume, rest)
            levels[i] = total / (4.0 * np.pi)
    return levels
