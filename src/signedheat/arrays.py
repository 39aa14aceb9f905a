"""Types of arrays, frozen dataclasses that hold them, short representations of both, and a small cache."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Hashable
from dataclasses import fields, is_dataclass
from threading import RLock
from typing import Any, Generic, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Complexes: TypeAlias = NDArray[np.complex128]


def mask_of(n: int, ids: NDArray[np.integer] | list[int]) -> Bools:
    """Return an (n,) boolean array that is true at the given ids."""
    mask = np.zeros(n, dtype=bool)
    mask[ids] = True
    return mask


Number = TypeVar("Number", bound=np.generic)
MOST_WRITTEN_OUT = 6
"""Number of entries of an array or a sequence up to which `short` writes all of them. Above it writes the size only."""


class Frozen:
    """Base class of frozen dataclasses whose copies and pickles hold only their fields, and keep arrays read-only.

    Cached properties are left out and computed again, since they are often larger than the fields, or lie in memory of
    other libraries.
    """

    def __getstate__(self) -> tuple[dict[str, object], frozenset[str]]:
        """Return the values of fields by name, and the names of those that are read-only arrays."""
        names = {entry.name for entry in fields(self)} if is_dataclass(self) else self.__dict__.keys()
        values = {name: value for name, value in self.__dict__.items() if name in names}
        arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
        return values, frozenset(name for name, array in arrays.items() if not array.flags.writeable)

    def __setstate__(self, state: tuple[dict[str, object], frozenset[str]]) -> None:
        values, read_only = state
        self.__dict__.update(values)
        for name in read_only:
            cast("NDArray[np.generic]", values[name]).flags.writeable = False


def read_only(array: NDArray[Number]) -> NDArray[Number]:
    """Return a read-only view of an array. Numba compiles a kernel for read-only and for writable arrays separately."""
    view: NDArray[Number] = array.view()
    view.flags.writeable = False
    return view


class ShortRepr:
    """Base class of dataclasses, made with ``repr=False``, whose ``repr`` shows large arrays by their shape only."""

    def __repr__(self) -> str:
        assert is_dataclass(self)
        parts = (f"{entry.name}={short(getattr(self, entry.name))}" for entry in fields(self) if entry.repr)
        return f"{type(self).__name__}({', '.join(parts)})"


def short(value: object) -> str:
    """Return a short text for a value, with four digits of numbers, and the shape of large arrays."""
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= MOST_WRITTEN_OUT and value.dtype.kind in "biuf":
            return f"[{', '.join(short(entry) for entry in value.tolist())}]"
        noun = {"b": "booleans", "f": "numbers", "i": "numbers", "u": "numbers"}.get(value.dtype.kind, "entries")
        return f"{' × '.join(map(str, value.shape))} {noun}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name}: {short(entry)}' for name, entry in value.items())}}}"
    if type(value) in (tuple, list) and isinstance(value, tuple | list):
        if len(value) > MOST_WRITTEN_OUT:
            return f"{len(value)} entries"
        inner = ", ".join(short(entry) for entry in value)
        return f"({inner})" if isinstance(value, tuple) else f"[{inner}]"
    return repr(value)


def place(point: ArrayLike, bounds: ArrayLike) -> str:
    """Return the coordinates of a point, (d,), as text, to four digits of the size of what it is part of.

    `bounds` are corners or points, (n, d), between which that lies, near the origin or far from it.

    Examples
    --------
    >>> place([500123.25, -0.5, 3.0], [[500120.0, -5.0, 0.0], [500140.0, 5.0, 10.0]])
    '(500123.25, -0.5, 3)'
    """
    coordinates = np.asarray(point, dtype=np.float64).tolist()
    size = float(np.ptp(np.asarray(bounds, dtype=np.float64), axis=0).max())
    scale = size if 0.0 < size < np.inf else np.inf
    digits = [4 + max(0, math.ceil(math.log10(max(abs(x) / scale, 1.0)))) for x in coordinates]
    return f"({', '.join(f'{x:.{min(n, 17)}g}' for x, n in zip(coordinates, digits, strict=True))})"


K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class LastUsed(Generic[K, V]):
    """A cache of the `size` values that were last used, by key, for a frozen object. Copies and pickles are empty."""

    def __init__(self, size: int = 1) -> None:
        self.size = size
        self._values: dict[K, V] = {}
        self._lock = RLock()

    def __call__(self, key: K, make: Callable[[], V]) -> V:
        """Return the cached value for a key, or that of ``make()``, which is then cached."""
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
    """Return a digest of arrays, which is the same only for arrays of equal types, shapes and bits."""
    digest = hashlib.blake2b(digest_size=32)
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()
