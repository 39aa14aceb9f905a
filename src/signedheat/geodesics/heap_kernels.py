"""A priority queue of numbered items for compiled kernels, in which each item is at most once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled


class Queue(NamedTuple):
    """A binary heap of items 0 to n − 1, the one with the smallest key first."""

    items: Ints  # (n,) the items in the heap, of which the first `size` count
    places: Ints  # (n,) index of each item in the heap, −1 if it is not in it
    keys: Floats  # (n,) key of each item
    size: Ints  # (1,) number of items in the heap

    @classmethod
    def empty(cls, n_items: int) -> Queue:
        """Make a queue for items 0 to n_items − 1."""
        return cls(np.empty(n_items, np.int64), np.full(n_items, -1), np.empty(n_items), np.zeros(1, np.int64))


@compiled
def before(keys: Floats, a: int, b: int) -> bool:
    """Return whether item a leaves the queue before item b; of equal keys, the lower item does."""
    return bool(keys[a] < keys[b] or (keys[a] == keys[b] and a < b))


@compiled
def push(queue: Queue, item: int, key: float) -> None:
    """Put an item into the queue with a key, or lower its key if it is in the queue with a larger one."""
    items, positions, keys, size = queue
    position = positions[item]
    if position < 0:
        position = size[0]
        size[0] += 1
    elif key >= keys[item]:
        return
    keys[item] = key
    while position > 0:
        above = items[(position - 1) // 2]
        if before(keys, above, item):
            break
        items[position], positions[above] = above, position
        position = (position - 1) // 2
    items[position], positions[item] = item, position


@compiled
def pop(queue: Queue) -> int:
    """Remove the item with the smallest key, and return it."""
    items, positions, keys, size = queue
    first = items[0]
    positions[first] = -1
    size[0] -= 1
    n = size[0]
    if n > 0:
        last, position = items[n], 0
        while 2 * position + 1 < n:
            below = 2 * position + 1
            if below + 1 < n and before(keys, items[below + 1], items[below]):
                below += 1
            if before(keys, last, items[below]):
                break
            items[position] = items[below]
            positions[items[position]] = position
            position = below
        items[position], positions[last] = last, position
    return int(first)
