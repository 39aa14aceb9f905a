"""Ordered updates of the lines of a grid, on several threads.

Tiles of lines on one diagonal of a plane of lines do not depend on each other. Each line reads the same values as in
sequential order, so results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import numpy as np

from ..parallel import n_threads

SMALL = 100_000
"""Grids of fewer nodes are swept on one thread."""


def padded_shape(shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """The shape, preceded by axes of one node to make four."""
    return (1,) * (4 - len(shape)) + tuple(shape)  # type: ignore[return-value]


def sweep_lines(kernel: Callable[..., None], shape: tuple[int, ...], rounds: int, *arguments: Any) -> None:
    """Run ``kernel(*arguments, tiles)`` over all lines along the last axis, in every combination of directions.

    A tile is (begin, end, step) for each of the first three axes of `shape`; those of one call run in order.
    """
    steps = [(1, -1) if n > 1 else (1,) for n in shape[:3]]
    threads = 1 if np.prod(shape) < SMALL else n_threads()
    size = [
        -(-n // parts) for n, parts in zip(shape[1:3], (threads, 4 * threads) if threads > 1 else (1, 1), strict=True)
    ]
    with ThreadPoolExecutor(max(1, threads - 1)) as others:
        for direction in list(product(*steps)) * rounds:
            for plane in range(shape[0])[:: direction[0]]:
                for wave in wavefronts(shape[1:3], size, direction[1:]):
                    tiles = np.array([[plane, plane + direction[0], direction[0], *tile] for tile in wave])
                    jobs = [others.submit(kernel, *arguments, tiles[k::threads]) for k in range(1, threads)]
                    kernel(*arguments, tiles[::threads])
                    for job in jobs:
                        job.result()


def wavefronts(shape: tuple[int, ...], size: list[int], direction: tuple[int, ...]) -> list[list[list[int]]]:
    """Tiles of a plane of lines, in groups; the tiles of one group can run at the same time.

    Examples
    --------
    >>> wavefronts((4, 2), [2, 2], (1, -1))
    [[[0, 2, 1, 1, -1, -1]], [[2, 4, 1, 1, -1, -1]]]
    """
    starts = [range(0, n, s)[::step] for n, s, step in zip(shape, size, direction, strict=True)]
    waves: list[list[list[int]]] = [[] for _ in range(len(starts[0]) + len(starts[1]) - 1)]
    for a, first in enumerate(starts[0]):
        for b, second in enumerate(starts[1]):
            tile = []
            for start, n, s, step in zip((first, second), shape, size, direction, strict=True):
                stop = min(start + s, n)
                tile += [start, stop, 1] if step > 0 else [stop - 1, start - 1, -1]
            waves[a + b].append(tile)
    return waves
