"""A priority queue of numbered items, each in it at most once, so that its size is known beforehand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled


class Queue(NamedTuple):
    """A binary heap: items by position, the position of each item (−1 outside), their keys, and how many are in it."""

    items: Ints  # (n,) the first `size` are in the heap
    places: Ints  # (n,)
    keys: Floats  # (n,) by item
    size: Ints  # (1,)

    @classmethod
    def empty(cls, n_items: int) -> Queue:
        """Make a queue for items 0 to n_items − 1."""
        return cls(np.empty(n_items, np.int64), np.full(n_items, -1), np.empty(n_items), np.zeros(1, np.int64))


@compiled
def before(keys: Floats, a: int, b: int) -> bool:
    """Return whether item a leaves the queue before item b; equal keys go by number, for reproducible results."""
    return bool(keys[a] < keys[b] or (keys[a] == keys[b] and a < b))


@compiled
def push(queue: Queue, item: int, key: float) -> None:
    """Put an item into the queue, or move it forward if its key has become smaller."""
    items, places, keys, size = queue
    place = places[item]
    if place < 0:
        place = size[0]
        size[0] += 1
    elif key >= keys[item]:
        return
    keys[item] = key
    while place > 0:
        above = items[(place - 1) // 2]
        if before(keys, above, item):
            break
        items[place], places[above] = above, place
        place = (place - 1) // 2
    items[place], places[item] = item, place


@compiled
def pop(queue: Queue) -> int:
    """Remove the item with the smallest key, and return it."""
    items, places, keys, size = queue
    first = items[0]
    places[first] = -1
    size[0] -= 1
    n = size[0]
    if n > 0:
        last, place = items[n], 0
        while 2 * place + 1 < n:
            below = 2 * place + 1
            if below + 1 < n and before(keys, items[below + 1], items[below]):
                below += 1
            if before(keys, last, items[below]):
                break
            items[place] = items[below]
            places[items[place]] = place
            place = below
        items[place], places[last] = last, place
    return int(first)
