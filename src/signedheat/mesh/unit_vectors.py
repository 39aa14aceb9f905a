"""Unit vectors without underflow or overflow, axes perpendicular to vectors, and angles around them."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..parallel import in_threads

ANGLE_ROUNDING = 1e-6
"""Angle, in radians, or difference of unit vectors, up to which it counts as rounding error."""
SAME_WAY = 0.75
"""Cosine of the angle between two directions above which they count as the same; it is 41°. Below the negative of it
they count as opposite, and in between as neither."""


def unit(vectors: NDArray[Any], overwrite: bool = False) -> NDArray[Any]:
    """Scale (..., d) vectors, or complex numbers, to length 1; vectors of length 0 stay 0.

    Squares neither overflow nor underflow. With `overwrite`, the result of real vectors is written to the argument.
    """
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
    """Return two unit vectors, (n, 3) each, so that (vector, first, second) is a right-handed orthogonal frame."""
    first = unit(np.cross(vectors, np.eye(3)[np.abs(vectors).argmin(axis=1)]))
    return first, unit(np.cross(vectors, first))


def angles_around(vectors: Floats, directions: Floats) -> Floats:
    """Return (n,) angles, from −π to π, of (n, 3) directions around (n, 3) vectors as axes.

    They are counter-clockwise as seen from the tip of the axis. Equal axes have the same direction of angle 0.
    """
    first, second = axes_across(vectors)
    return np.arctan2((directions * second).sum(axis=1), (directions * first).sum(axis=1))
