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
