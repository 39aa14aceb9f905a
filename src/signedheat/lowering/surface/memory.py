"""How much memory distance on surfaces takes, estimated before any of it is allocated."""

from __future__ import annotations

import math

from ...linear import chosen_backend
from ...memory import refuse_beyond_memory

BYTES = {"pardiso": (2050, 60), "cholmod": (1150, 150), "superlu": (0, 565)}
"""Peak for each triangle, and what every doubling of their number adds, since the fill of factors grows; by back end.
Measured, with factors for three diffusion times; SuperLU keeps both triangles of a matrix, and fills them more."""


def memory_estimate(n_triangles: int) -> float:
    """Bytes that a first distance on so many triangles takes at the most.

    Examples
    --------
    >>> memory_estimate(640_000) > 2 * memory_estimate(320_000)
    True
    """
    each, per_doubling = BYTES[chosen_backend()]
    return n_triangles * (each + per_doubling * math.log2(max(n_triangles, 2)))


def refuse_too_many(triangles: int, count: int, elements: str, beside: float = 0.0) -> None:
    """Raise `MemoryLimitError` if distance on so many triangles does not fit into memory.

    Parameters
    ----------
    triangles : int
        Their number.
    count : int
        The number of elements of the domain that they stand for: triangles, polygons, points, faces of voxels.
    elements : str
        What these are called.
    beside : float
        Bytes that are needed besides.
    """
    each = triangles / max(count, 1)
    refuse_beyond_memory(
        f"distance on {count:,} {elements}",
        count,
        lambda number: memory_estimate(math.ceil(each * number)) + beside * number / count,
        lambda number: f"use at most {number:,} {elements}, coarsened or in parts",
    )
