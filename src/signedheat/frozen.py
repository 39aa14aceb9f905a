"""Copies and pickles of frozen objects, without cached properties."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


class Frozen:
    """A frozen dataclass whose copies and pickles hold only its fields; read-only arrays stay read-only.

    Cached properties are computed anew, since they are often larger than the fields, or in memory of other libraries.
    """

    def __getstate__(self) -> tuple[dict[str, object], frozenset[str]]:
        names = {entry.name for entry in fields(self)} if is_dataclass(self) else self.__dict__.keys()
        held = {name: value for name, value in self.__dict__.items() if name in names}
        arrays = {name: value for name, value in held.items() if isinstance(value, np.ndarray)}
        return held, frozenset(name for name, array in arrays.items() if not array.flags.writeable)

    def __setstate__(self, state: tuple[dict[str, object], frozenset[str]]) -> None:
        held, read_only = state
        self.__dict__.update(held)
        for name in read_only:
            cast("NDArray[np.generic]", held[name]).flags.writeable = False


def read_only(array: NDArray[Number]) -> NDArray[Number]:
    """Return a read-only view, since kernels would be compiled again for writable arrays."""
    view: NDArray[Number] = array.view()
    view.flags.writeable = False
    return view
