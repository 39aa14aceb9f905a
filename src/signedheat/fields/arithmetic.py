"""Fields as arrays, and arithmetic of fields with numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

if TYPE_CHECKING:
    from typing import Protocol

    class HasValues(Protocol):
        """What arithmetic needs of a field."""

        @property
        def values(self) -> NDArray[Any]:
            """φ at the unknowns."""

        def _mapped(self: AnyField, change: Callable[[NDArray[Any]], NDArray[Any]]) -> AnyField:
            """The field with changed values."""


AnyField = TypeVar("AnyField", bound="HasValues")
Number = float | np.number[Any]
NUMBERS = (int, float, np.number)


class Arithmetic:
    """A field of which ``-field``, ``2 * field``, ``field / 2`` and ``field + 1`` are fields, and ``numpy.asarray`` φ.

    So ``field - 0.1`` is the offset by 0.1, and ``-field`` the field of the other side. NumPy's functions take fields
    for arrays of their values.

    Examples
    --------
    >>> import signedheat as sh
    >>> field = sh.GridField(sh.Grid(0.0, 1.0, 3), [-1.0, 0.0, 1.0])
    >>> (1 - 2 * field).values
    array([ 3.,  1., -1.])
    >>> np.asarray(-field), float(np.max(field)), np.abs(field)
    (array([ 1., -0., -1.]), 1.0, array([1., 0., 1.]))
    """

    __array_priority__ = 1000.0  # numbers of NumPy leave operators to the field

    def __array__(self: HasValues, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __neg__(self: AnyField) -> AnyField:
        return self._mapped(np.negative)

    def __mul__(self: AnyField, factor: Number) -> AnyField:
        return self._mapped(lambda phi: phi * factor) if isinstance(factor, NUMBERS) else NotImplemented

    def __truediv__(self: AnyField, divisor: Number) -> AnyField:
        return self._mapped(lambda phi: phi / divisor) if isinstance(divisor, NUMBERS) else NotImplemented

    def __add__(self: AnyField, summand: Number) -> AnyField:
        return self._mapped(lambda phi: phi + summand) if isinstance(summand, NUMBERS) else NotImplemented

    def __sub__(self: AnyField, level: Number) -> AnyField:
        return self._mapped(lambda phi: phi - level) if isinstance(level, NUMBERS) else NotImplemented

    def __rsub__(self: AnyField, level: Number) -> AnyField:
        return self._mapped(lambda phi: level - phi) if isinstance(level, NUMBERS) else NotImplemented

    __radd__ = __add__
    __rmul__ = __mul__
