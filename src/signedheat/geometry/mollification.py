"""Triangles made thick enough to compute with, by lengths alone (Sharp & Crane 2020)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def mollify(lengths: NDArray[np.float64], margin: float) -> tuple[NDArray[np.float64], float]:
    """Add one length to all edges, the smallest for which every triangle inequality holds with a margin.

    Parameters
    ----------
    lengths : (m, 3) float
        Edge lengths of every face.
    margin : float
        As a fraction of the mean length.

    Returns
    -------
    (m, 3) float
        The very same array if nothing had to be added.
    float
        What was added.

    Examples
    --------
    >>> mollify(np.array([[1.0, 1.0, 2.0]]), 0.09375)
    (array([[1.125, 1.125, 2.125]]), 0.125)
    """
    longest = lengths.max(axis=1)
    slack = float((lengths.sum(axis=1) - 2.0 * longest).min())
    added = margin * float(lengths.mean()) - slack
    return (lengths + added, added) if added > 0 else (lengths, 0.0)
