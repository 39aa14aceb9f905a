"""A small cache for values that depend on an object and a key."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable
from threading import RLock
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class LastUsed(Generic[K, V]):
    """A few values by key, the least recently used of which makes room before the next is made.

    It holds what a frozen object derives from itself and an argument; what depends on the object alone is a
    `functools.cached_property`. Copies and pickles of it are empty.
    """

    def __init__(self, size: int = 1) -> None:
        self.size = size
        self._values: dict[K, V] = {}
        self._lock = RLock()

    def __call__(self, key: K, make: Callable[[], V]) -> V:
        """Return the value for a key, and make it unless it is kept."""
        with self._lock:
            if key in self._values:
                value = self._values.pop(key)
            else:
                while len(self._values) >= self.size:
                    del self._values[next(iter(self._values))]
                value = make()
            self._values[key] = value
            return value

    def __reduce__(self) -> tuple[type[LastUsed[K, V]], tuple[int]]:
        return type(self), (self.size,)


def fingerprint(*arrays: NDArray[Any]) -> bytes:
    """Make a key of arrays, which only arrays with equal types, shapes and bits share."""
    digest = hashlib.blake2b(digest_size=32)
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()
