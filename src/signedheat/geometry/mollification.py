"""Intrinsic mollification: degenerate triangles made slightly thicker, by edge lengths alone (Sharp & Crane 2020)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def mollify(lengths: NDArray[np.float64], margin: float) -> tuple[NDArray[np.float64], float]:
    """Add one length δ to all edges, the smallest for which every triangle inequality holds with a margin.

    Parameters
    ----------
    lengths : (m, 3) float
        Edge lengths of every face.
    margin : float
        Least ``a + b − c`` in every triangle, as a fraction of the mean length.

    Returns
    -------
    (m, 3) float
        The new lengths; the given array itself if δ is zero.
    float
        δ.

    Examples
    --------
    >>> mollify(np.array([[1.0, 1.0, 2.0]]), 0.09375)
    (array([[1.125, 1.125, 2.125]]), 0.125)
    """
    longest = lengths.max(axis=1)
    slack = float((lengths.sum(axis=1) - 2.0 * longest).min())
    added = margin * float(lengths.mean()) - slack
    return (lengths + added, added) if added > 0 else (lengths, 0.0)
