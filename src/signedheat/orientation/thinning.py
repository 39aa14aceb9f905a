"""Points that stand for many."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..compiled import compiled

_CHUNK = 4096


def spread_out(points: NDArray[np.float64], radii: NDArray[np.float64]) -> NDArray[np.int64]:
    """Ids of points, none within the radius of an earlier one, and every point within that of one of them.

    Examples
    --------
    >>> spread_out(np.array([[0.0, 0, 0], [0.4, 0, 0], [0.8, 0, 0]]), np.full(3, 0.5)).tolist()
    [0, 2]
    """
    tree = scipy.spatial.cKDTree(points)
    free = np.ones(len(points), dtype=bool)
    for begin in range(0, len(points), _CHUNK):
        part = np.arange(begin, min(begin + _CHUNK, len(points)))
        part = part[free[part]]
        near = tree.query_ball_point(points[part], radii[part], workers=-1)
        ends = np.cumsum([0, *map(len, near)])
        _keep_first(part, ends, np.concatenate([*map(np.asarray, near), np.zeros(0)]).astype(np.int64), free)
    return np.flatnonzero(free)


@compiled
def _keep_first(
    ids: NDArray[np.int64], ends: NDArray[np.int64], near: NDArray[np.int64], free: NDArray[np.bool_]
) -> None:
    for i in range(len(ids)):
        if free[ids[i]]:
            for k in range(ends[i], ends[i + 1]):
                if near[k] > ids[i]:
                    free[near[k]] = False
