"""Checks of arguments that all domains share; arrays are returned read-only."""

from __future__ import annotations

from numbers import Real
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError, SignedHeatError

Scalar = TypeVar("Scalar", bound=np.generic)


def frozen(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """The array, contiguous and read-only, so that quantities derived from it stay valid."""
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array


def finite_rows(values: ArrayLike, name: str, columns: int | None = None) -> NDArray[np.float64]:
    """`values` as a read-only float64 array of shape (n, columns), without NaN or infinity."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != 2 or (columns is not None and array.shape[1] != columns):
        wanted = f"(n, {columns})" if columns is not None else "(n, d)"
        raise GeometryError(f"{name} must have shape {wanted}, not {array.shape}", element=name)
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise GeometryError(
            f"{len(bad)} of {len(array)} {name} hold NaN or infinity, first number {bad[0]}",
            remedy="remove or repair them",
            element=f"number {bad[0]}",
        )
    return frozen(array)


def finite_number(value: object, name: str, least: float = -np.inf) -> float:
    """`value` as a finite float, at least `least`.

    Examples
    --------
    >>> finite_number(2, "the distance", least=0)
    2.0
    """
    if isinstance(value, bool) or not isinstance(value, Real | np.ndarray) or np.ndim(value) != 0:  # type: ignore[arg-type]
        raise SignedHeatError(f"{name} must be a number, not {value!r}", element=name)
    number = float(value)
    if not (np.isfinite(number) and number >= least):
        wanted = "finite" if least == -np.inf else "finite and not negative" if least == 0 else f"at least {least:g}"
        raise SignedHeatError(f"{name} must be {wanted}, not {number:g}", element=name)
    return number


def positive_number(value: object, name: str) -> float:
    """`value` as a finite positive float."""
    number = finite_number(value, name)
    if number <= 0:
        raise SignedHeatError(f"{name} must be positive and finite, not {number:g}", element=name)
    return number


def element_ids(values: ArrayLike, name: str, corners: int, n_vertices: int) -> NDArray[np.int64]:
    """`values` as a read-only int64 array of shape (m, corners), with all ids within 0 … n_vertices − 1."""
    array = np.asarray(values)
    if array.size == 0:
        raise GeometryError(f"there are no {name}: the shape is empty", element=name)
    if array.ndim != 2 or array.shape[1] != corners:
        raise GeometryError(f"{name} must have shape (m, {corners}), not {array.shape}", element=name)
    if not np.issubdtype(array.dtype, np.integer):
        raise GeometryError(f"{name} must hold integer vertex ids, not {array.dtype}", element=name)
    ids = array.astype(np.int64)
    outside = np.flatnonzero(((ids < 0) | (ids >= n_vertices)).any(axis=1))
    if len(outside):
        first = outside[0]
        raise GeometryError(
            f"{len(outside)} {name} name a vertex that does not exist; number {first} is "
            f"{ids[first].tolist()}, but vertex ids go from 0 to {n_vertices - 1}",
            element=f"number {first}",
        )
    return frozen(ids)


def used_bounds(points: NDArray[np.float64], ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """(2, d) lower and upper corner of the box around the points that are named, column by column: that is fast.

    Examples
    --------
    >>> used_bounds(np.array([[0.0, 1.0], [2.0, 0.0], [9.0, 9.0]]), np.array([0, 1, 0])).tolist()
    [[0.0, 0.0], [2.0, 1.0]]
    """
    used = np.zeros(len(points), dtype=bool)
    used[ids.ravel()] = True
    columns = (points if used.all() else points[used]).T
    return np.array([[column.min() for column in columns], [column.max() for column in columns]])
