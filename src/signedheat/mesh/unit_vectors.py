"""Unit vectors, without underflow or overflow, and axes across vectors."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..parallel import n_threads


def unit(vectors: NDArray[Any], overwrite: bool = False) -> NDArray[Any]:
    """Scale vectors to length one: complex numbers as vectors in the plane, rows of a real array as vectors in space.

    Divides by the largest component first, because X falls like exp(−r/√t), and its square underflows long before it.
    With `overwrite` the memory of a real array is used for the result.

    Examples
    --------
    >>> unit(np.array([[3e-300, 4e-300], [0.0, 0.0]]))
    array([[0.6, 0.8],
           [0. , 0. ]])
    >>> unit(np.array([3e-300 + 4e-300j]))
    array([0.6+0.8j])
    """
    if np.iscomplexobj(vectors):
        length = np.abs(vectors)  # np.abs of complex numbers neither overflows nor underflows
        return vectors / np.where(length > 0, length, 1)
    result = vectors if overwrite else np.empty_like(vectors)

    def scale(block: Any) -> None:
        part = vectors[block]
        largest = np.abs(part).max(axis=-1, keepdims=True)
        scaled = part / np.where(largest > 0, largest, 1)
        length = np.sqrt(np.einsum("...i,...i->...", scaled, scaled))[..., None]
        np.divide(scaled, np.where(length > 0, length, 1), out=result[block])

    blocks = _blocks(vectors.shape)
    if len(blocks) == 1:
        scale(blocks[0])
    else:
        with ThreadPoolExecutor(n_threads()) as pool:
            list(pool.map(scale, blocks))
    return result


def axes_across(vectors: Floats) -> tuple[Floats, Floats]:
    """Return two (n, 3) unit vectors perpendicular to each vector and to each other, right-handed in this order."""
    first = unit(np.cross(vectors, np.eye(3)[np.abs(vectors).argmin(axis=1)]))
    return first, unit(np.cross(vectors, first))


def _blocks(shape: tuple[int, ...], size: int = 2**16) -> list[Any]:
    """Return slices of the first axes that make blocks of about `size` vectors, which fit the processor's cache."""
    if len(shape) == 1 or np.prod(shape[:-1]) <= size:
        return [...]
    inner = int(np.prod(shape[1:-1], dtype=np.int64))
    if inner <= size:
        rows = max(1, size // inner)
        return [(slice(start, start + rows),) for start in range(0, shape[0], rows)]
    return [(slice(i, i + 1), *(() if b is ... else b)) for i in range(shape[0]) for b in _blocks(shape[1:], size)]
