"""Names for the types of arrays, so that signatures stay short."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Complexes: TypeAlias = NDArray[np.complex128]


def mask_of(n: int, ids: NDArray[np.integer] | list[int]) -> Bools:
    """(n,) array that is True at the ids."""
    mask = np.zeros(n, dtype=bool)
    mask[ids] = True
    return mask
