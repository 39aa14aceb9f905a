"""Paths from point to neighbouring point of a cloud."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

NEAREST = 8
"""Nearest points that a point is joined to, if it is among theirs: on a surface about six lie round a point."""


def spread(points: NDArray[np.float64], values: NDArray[np.float64], used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n,) signed distances that go on from point to neighbouring point where they are NaN.

    The shortest way to a point with a value adds to its absolute value; the sign stays. Points that are not used, and
    those that no way leads to, stay NaN.
    """
    lacking = np.isnan(values) & used
    ids = np.flatnonzero(used)
    if not lacking.any() or len(ids) <= NEAREST:
        return values
    far, near = scipy.spatial.cKDTree(points[ids]).query(points[ids], k=NEAREST + 1)
    rows = np.repeat(np.arange(len(ids)), NEAREST)
    graph = sparse.csr_matrix(
        (np.maximum(far[:, 1:].ravel(), 1e-300), (rows, near[:, 1:].ravel())), shape=(len(ids),) * 2
    )
    graph = sparse.csr_matrix(graph.minimum(graph.T))  # joined from both sides
    known = np.flatnonzero(~lacking[ids])
    start = np.abs(values[ids[known]])
    tail, head = known, np.full(len(known), len(ids))
    coo = graph.tocoo()
    whole = sparse.csr_matrix(
        (
            np.concatenate([coo.data, start + 1e-300, start + 1e-300]),
            (np.concatenate([coo.row, tail, head]), np.concatenate([coo.col, head, tail])),
        ),
        shape=(len(ids) + 1,) * 2,
    )
    away, before = sparse.csgraph.dijkstra(whole, indices=len(ids), return_predecessors=True)
    result: NDArray[np.float64] = values.copy()
    sign = np.where(values[ids] < 0, -1.0, 1.0)
    for k in np.argsort(away, kind="stable").tolist():
        if k == len(ids) or not lacking[ids[k]] or not np.isfinite(away[k]):
            continue
        sign[k] = sign[before[k]]
        result[ids[k]] = sign[k] * away[k]
    return result
