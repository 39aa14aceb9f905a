"""Unit vectors, without underflow or overflow; axes across vectors, and angles around them."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..parallel import in_threads

ANGLE_ROUNDING = 1e-6
"""Angles up to this, in radians, and differences of unit vectors, are rounding errors."""
SAME_WAY = 0.75
"""Cosine above which two directions count as the same, 41° apart, and below whose negative as opposite ones."""


def unit(vectors: NDArray[Any], overwrite: bool = False) -> NDArray[Any]:
    """Scale vectors to length one, first by the largest component, so that squares neither overflow nor underflow."""
    if np.iscomplexobj(vectors):
        length = np.abs(vectors)  # np.abs of complex numbers neither overflows nor underflows
        return vectors / np.where(length > 0, length, 1)
    result = vectors if overwrite else np.empty_like(vectors)

    def scale(rows: slice) -> None:
        part = vectors[rows]
        largest = reduce(np.maximum, np.moveaxis(np.abs(part), -1, 0))[..., None]  # NumPy is slow along short axes
        scaled = part / np.where(largest > 0, largest, 1)
        length = np.sqrt(np.einsum("...i,...i->...", scaled, scaled))[..., None]
        np.divide(scaled, np.where(length > 0, length, 1), out=result[rows])

    count = max(1, (1 << 16) // max(1, math.prod(vectors.shape[1:-1])))  # 65,536 vectors fit into the cache
    if vectors.ndim == 1 or len(vectors) <= count:
        scale(slice(None))
    else:
        list(in_threads(scale, (slice(begin, begin + count) for begin in range(0, len(vectors), count))))
    return result


def axes_across(vectors: Floats) -> tuple[Floats, Floats]:
    """Return two (n, 3) unit vectors perpendicular to each vector and to each other, right-handed in this order."""
    first = unit(np.cross(vectors, np.eye(3)[np.abs(vectors).argmin(axis=1)]))
    return first, unit(np.cross(vectors, first))


def angles_around(vectors: Floats, directions: Floats) -> Floats:
    """Return (n,) angles of directions around vectors, right-handed; equal vectors have the same origin of angles."""
    first, second = axes_across(vectors)
    return np.arctan2((directions * second).sum(axis=1), (directions * first).sum(axis=1))
