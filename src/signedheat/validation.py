"""Checks of arguments of public functions, and their conversion to arrays and numbers.

A function here returns the converted value, or raises an error in which `name` names the argument.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from inspect import signature
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar, cast, get_args

import numpy as np
from numpy.typing import NDArray

from .arrays import Bools, Floats, Ints, mask_of
from .errors import GeometryError, SignedHeatError, UnsupportedTypeError, counted, quoted
from .jobs import reporting
from .memory import within_memory

Scalar = TypeVar("Scalar", bound=np.generic)

LARGEST_COORDINATE = 1e40
"""Largest absolute value of a coordinate that is accepted. Squared volumes, the largest powers of lengths that are
computed, then stay finite."""
SMALLEST_EXTENT = 1e-40
"""Smallest extent that is accepted, except 0. Powers of smaller lengths would vanish."""
INT64_END = 2**63
NO_NUMBERS = (type(None), str, bytes, np.datetime64, np.timedelta64)
"""Types that NumPy converts to numbers, and that are none."""


def frozen(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return the array contiguous and read-only, so that quantities derived from it stay valid.

    An array that is contiguous already is made read-only itself.
    """
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array


@within_memory
def numbers(values: object, name: str, error: type[SignedHeatError] = GeometryError) -> Floats:
    """Return `values` as a new float64 array of any shape; raise an error unless they are real numbers."""
    array = array_of(values, name, error)
    try:
        if array.dtype.kind not in "biufO" or (array.dtype.kind == "b" and array.ndim == 0):
            raise TypeError
        if array.dtype.kind == "O" and any(isinstance(value, NO_NUMBERS) for value in array.flat):
            raise TypeError  # NumPy would convert None to NaN, dates to nanoseconds, and parse text
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # refuse what would lose something in the conversion
            return np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RuntimeWarning):
        raise error(f"{name} must be real numbers, not {_described(array)}", element=name) from None


def json_numbers(values: object, name: str, error: type[SignedHeatError] = GeometryError) -> Floats:
    """Return numbers of JSON, in lists of any depth, as a float64 array; refuse texts, true and false."""
    array = numbers(values, name, error)
    if any(isinstance(value, bool) for value in np.array(values, dtype=object).flat):
        raise error(f"{name} must be real numbers, and one is true or false", element=name)
    return array


@within_memory
def contiguous(values: object, name: str) -> Floats:
    """Return `values` as a contiguous float64 array of any shape, copied only if necessary."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and not np.ma.isMaskedArray(values):
        return np.ascontiguousarray(values)
    return numbers(values, name)


@within_memory
def whole_numbers(values: object, name: str, error: type[SignedHeatError] = GeometryError) -> Ints:
    """Return `values` as a new int64 array of any shape; raise an error unless they are integers."""
    array = array_of(values, name, error)
    if array.dtype.kind == "O" and array.size and all(isinstance(value, Integral) for value in array.ravel()):
        array = array.astype(np.int64) if all(abs(int(value)) < INT64_END for value in array.ravel()) else array
    if array.dtype.kind not in "iu" or (array.size and array.dtype == np.uint64 and array.max() >= INT64_END):
        raise error(f"{name} must be integers of at most 63 bits, not {_described(array)}", element=name)
    return array.astype(np.int64)


def _rows_instead(array: NDArray[Any], columns: int | None, name: str) -> str | None:
    """Return a remedy for an array that has no rows of so many numbers, or None if there is none."""
    if columns is None or array.ndim != 2:
        return None
    if array.shape[1] in (2, 3):  # points in the plane or in space, even if there are two or three
        return f"give {columns} coordinates for each point" if columns in (2, 3) else None
    return f"pass {name}.T" if array.shape[0] == columns else None


def array_of(values: object, name: str, error: type[SignedHeatError] = GeometryError) -> NDArray[Any]:
    """Return `values` as a NumPy array of any type, not copied if possible; raise an error if rows differ in length.

    `values` may be nested sequences, or an array of a library that NumPy can convert or that supports DLPack.
    """
    if np.ma.isMaskedArray(values):
        raise error(f"{name} are a masked array", remedy="drop what is masked, or fill it in", element=name)
    try:
        dlpack = hasattr(values, "__dlpack__") and not hasattr(values, "__array__")
        return np.from_dlpack(values) if dlpack else np.asarray(values)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise error(f"{name} do not form an array: rows differ in length or kind", element=name) from None


def _described(array: NDArray[Any]) -> str:
    """Return a text for error messages: the value of a 0-d array, and the type of others."""
    return f"an array of {array.dtype}" if array.ndim else quoted(array[()])


def finite_rows(
    values: object, name: str, columns: int | None = None, error: type[SignedHeatError] = GeometryError
) -> Floats:
    """Return `values` as a read-only float64 array of shape (n, columns); raise an error for NaN and infinity."""
    array = numbers(values, name, error)
    if array.ndim != 2 or (columns is not None and array.shape[1] != columns) or array.shape[1] == 0:
        wanted = f"(n, {columns})" if columns is not None else "(n, d)"
        remedy = _rows_instead(array, columns, name)
        raise error(f"{name} must have shape {wanted}, not {array.shape}", remedy=remedy, element=name)
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise error(
            f"{len(bad)} of {len(array)} {name} hold NaN or infinity, first number {bad[0]}",
            remedy="remove or repair them",
            element=f"number {bad[0]}",
        )
    return frozen(array)


def coordinates(
    values: object, name: str, columns: int | None = None, error: type[SignedHeatError] = GeometryError
) -> Floats:
    """Return `finite_rows`, but raise an error if `refuse_extreme` does for the box around the rows."""
    array = finite_rows(values, name, columns, error)
    if len(array):
        refuse_extreme(array.min(axis=0), array.max(axis=0), name, error)
    return array


def refuse_extreme(lower: Floats, upper: Floats, name: str, error: type[SignedHeatError] = GeometryError) -> None:
    """Raise an error for a box beyond `LARGEST_COORDINATE`, or smaller than `SMALLEST_EXTENT` but not a point.

    `lower` and `upper` are its corners, (d,).
    """
    with np.errstate(over="ignore"):  # the extent overflows if the box spans most of the range of floats
        farthest, extent = float(max(-lower.min(), upper.max())), float((upper - lower).max())
    if farthest > LARGEST_COORDINATE or 0 < extent < SMALLEST_EXTENT:
        fault = f"reach as far as {farthest:.3g}" if farthest > LARGEST_COORDINATE else f"extend over {extent:.3g} only"
        raise error(
            f"{name} {fault}, and lengths from {SMALLEST_EXTENT:g} to {LARGEST_COORDINATE:g} can be computed with",
            remedy="scale and move the shape, for instance to a size of 1 around the origin",
            element=name,
        )


def query_points(values: object, columns: int) -> tuple[Floats, tuple[int, ...]]:
    """Return points of shape (..., columns) as rows, (n, columns), and the leading shape.

    Raises an error for coordinates that are not finite or exceed `LARGEST_COORDINATE`. `shaped` gives results the
    leading shape.
    """
    points = contiguous(values, "points")
    if points.shape[-1:] != (columns,):
        raise GeometryError(
            f"points must have shape (..., {columns}), not {points.shape}",
            remedy=f"give {columns} coordinates for each point",
            element="points",
        )
    if not np.isfinite(points).all():
        raise GeometryError("points must be finite", remedy="leave out NaN and infinity", element="points")
    farthest = float(np.abs(points).max(initial=0.0))
    if farthest > LARGEST_COORDINATE:
        raise GeometryError(
            f"points reach as far as {farthest:.3g}: the squares of such lengths overflow",
            remedy=f"evaluate at points up to {LARGEST_COORDINATE:g}",
            element="points",
        )
    return points.reshape(-1, columns), points.shape[:-1]


def shaped(values: NDArray[Scalar], shape: tuple[int, ...]) -> NDArray[Scalar]:
    """Reshape the first axis of (n, ...) values to the leading shape of their n points; a number for shape ()."""
    return values.reshape((*shape, *values.shape[1:]))[()]


def refuse_lost_spacing(steps: Floats, first: Floats, last: Floats) -> None:
    """Raise an error if the spacing of a lattice from `first` to `last` is lost in the rounding of coordinates.

    The corners and the spacing, `steps`, are (d,).
    """
    if (steps < 1e-13 * np.maximum(np.abs(first), np.abs(last))).any():
        raise GeometryError(
            f"the spacing {steps.tolist()} is lost in the rounding of coordinates from {first.tolist()} on",
            remedy="move the shape to the origin, or choose a larger spacing",
            element="spacing",
        )


def finite_number(
    value: object, name: str, least: float = -np.inf, error: type[SignedHeatError] = SignedHeatError
) -> float:
    """Return `value` as a finite float; raise an error for anything else, and for numbers below `least`."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, Real):
        described = _described(value) if isinstance(value, np.ndarray) else quoted(value)
        raise error(f"{name} must be a number, not {described}", element=name)
    try:
        number = float(value)
    except (OverflowError, TypeError, ValueError):
        number = math.nan
    if not (np.isfinite(number) and number >= least):
        wanted = "finite" if least == -np.inf else "finite and not negative" if least == 0 else f"at least {least:g}"
        raise error(f"{name} must be {wanted}, not {number:g}", element=name)
    return number


def positive_number(value: object, name: str, error: type[SignedHeatError] = SignedHeatError) -> float:
    """Return `value` as a finite positive float; raise an error for anything else."""
    number = finite_number(value, name, error=error)
    if number <= 0:
        raise error(f"{name} must be positive and finite, not {number:g}", element=name)
    return number


def whole_number(value: object, name: str, least: int, error: type[SignedHeatError] = GeometryError) -> int:
    """Return `value` as an integer; raise an error for anything else, and for numbers below `least`."""
    number = finite_number(value, name, error=error)
    if number % 1 or number < least:
        raise error(f"{name} must be a whole number of at least {least}, not {number:g}", element=name)
    return int(value)  # type: ignore[call-overload]  # exact, however large


def boolean(values: object, name: str, error: type[SignedHeatError] = GeometryError) -> Bools:
    """Return `values` as a boolean array of any shape, not copied; raise an error for other types."""
    array = array_of(values, name, error)
    if array.dtype != np.bool_:
        raise error(
            f"{name} must be boolean, not {_described(array)}", remedy="compare it with a threshold first", element=name
        )
    return array


def flag(value: object, name: str) -> bool:
    """Return `value` as a bool; raise an error for anything but True and False."""
    if not isinstance(value, bool | np.bool_):
        raise SignedHeatError(f"{name} must be True or False, not {quoted(value)}", element=name)
    return bool(value)


def callback(function: object, call: str) -> None:
    """Raise an error unless `function` is None or can be called as in the text `call`, "progress(fraction, step)"."""
    if function is None:
        return
    name, _, rest = call.partition("(")
    try:
        signature(cast("Callable[..., object]", function)).bind(*rest.split(","))
    except ValueError:  # compiled functions may have no signature
        return
    except TypeError:
        kind = "takes other arguments" if callable(function) else f"is a {type(function).__name__}"
        remedy = f"pass a function that is called as {call}"
        raise UnsupportedTypeError(f"{name} {kind}", remedy=remedy, element=name) from None


def instance(value: object, kind: type, name: str) -> None:
    """Raise an error unless `value` is None or an object of the class `kind`."""
    if value is not None and not isinstance(value, kind):
        raise UnsupportedTypeError(f"{name} is a {type(value).__name__}, not a {kind.__name__}", element=name)


def chosen(value: object, choices: object, name: str) -> None:
    """Raise an error unless `value` is one of the texts of the ``Literal`` type `choices`, or of its True and False."""
    allowed = get_args(choices)
    if not isinstance(value, str | bool) or value not in allowed:
        listed = " or ".join(f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in allowed)
        raise SignedHeatError(f"{name} must be {listed}, not {quoted(value)}", element=name)


def refuse_beside(given: str, **options: object) -> None:
    """Raise an error for options that are not None, since they have no effect beside the argument named by `given`."""
    for name, value in options.items():
        if value is not None:
            raise UnsupportedTypeError(
                f"{name} has no effect beside {given}", remedy="leave out one of the two", element=name
            )


def percentages(values: object) -> Floats:
    """Return `values` as an array of numbers from 0 to 100; raise an error for others."""
    percents = numbers(values, "percents", SignedHeatError)
    if not ((percents >= 0) & (percents <= 100)).all():
        raise SignedHeatError("percents must be from 0 to 100", element="percents")
    return percents


def positive_steps(values: object, count: int) -> Floats:
    """Return a spacing, given as one positive number or as one for each axis, as a read-only (count,) array."""
    steps = numbers(values, "spacing")
    if steps.shape not in ((), (count,)) or not (np.isfinite(steps).all() and (steps > 0).all()):
        raise GeometryError(
            f"spacing must be positive and finite, one number or {count}, not {steps.tolist()}", element="spacing"
        )
    refuse_extreme(0 * steps, steps, "spacing")
    return frozen(np.broadcast_to(steps, count).copy())


def element_ids(values: object, name: str, corners: int, n_vertices: int) -> Ints:
    """Return ids of vertices as a read-only int64 array of shape (m, corners), m ≥ 1.

    Raises an error for other shapes, and for ids outside 0 … n_vertices − 1.
    """
    array = array_of(values, name, GeometryError)
    if array.size == 0:
        raise GeometryError(f"there are no {name}: the shape is empty", element=name)
    if array.ndim != 2 or array.shape[1] != corners:
        raise GeometryError(
            f"{name} must have shape (m, {corners}), not {array.shape}",
            remedy=other_layout(array, name, corners),
            element=name,
        )
    if array.dtype.kind not in "iuO":
        raise GeometryError(
            f"{name} must hold integer vertex ids, not {array.dtype}",
            remedy=f"pass {name}.astype(int)" if _whole(array) else f"pass the vertices first, then the {name}",
            element=name,
        )
    ids = whole_numbers(array, name)
    outside = np.flatnonzero(((ids < 0) | (ids >= n_vertices)).any(axis=1))
    if len(outside):
        first = outside[0]
        raise GeometryError(
            f"a vertex that does not exist is named by {counted(len(outside), name.removesuffix('s'))}; number {first} "
            f"is {ids[first].tolist()}, but vertex ids go from 0 to {n_vertices - 1}",
            remedy=from_zero(ids, n_vertices, name),
            element=f"number {first}",
        )
    return frozen(ids)


def _whole(array: NDArray[Any]) -> bool:
    """Whether an array has a floating-point type, but whole numbers only."""
    return array.dtype.kind == "f" and bool((array == np.round(array)).all())


def from_zero(ids: Ints, n_vertices: int, name: str) -> str | None:
    """Return a remedy for ids of vertices that are counted from 1, or None if these do not seem to be."""
    return f"they are counted from 1, so pass {name} - 1" if ids.min() == 1 and ids.max() == n_vertices else None


def other_layout(array: NDArray[Any], name: str, corners: int) -> str | None:
    """Return a remedy for faces or tets in a layout that other packages use, or None if this is none of them."""
    if array.ndim == 2 and array.shape[1] == corners + 1 and (array[:, 0] == corners).all():
        return f"pass {name}[:, 1:], without the numbers of corners"
    if array.ndim == 1 and len(array) % (corners + 1) == 0 and (array[:: corners + 1] == corners).all():
        return f"pass {name}.reshape(-1, {corners + 1})[:, 1:], without the numbers of corners"
    if array.ndim == 2 and array.shape[0] == corners:
        return f"pass {name}.T"
    if array.ndim == 2 and array.shape[1] > corners == 3:
        return "pass quads and other polygons to sh.PolygonMesh(vertices, polygons)"
    return None


def refuse_other_layout(faces: NDArray[Any]) -> None:
    """Raise an error if (m, k) faces are in a layout of other packages, in which they would name vertices twice.

    Either each begins with the number of its corners, or they are columns.
    """
    if faces.ndim != 2 or faces.shape[1] < 4:
        return
    corners = faces.shape[1] - 1
    if (faces[:, 0] == corners).all() and (faces[:, 1:] == corners).any():
        cause = f"every face begins with {corners}, which some name again: that is the number of their corners"
        raise GeometryError(cause, remedy=other_layout(faces, "faces", corners), element="faces")
    if len(faces) in (3, 4) and corners >= 4 and (np.diff(np.sort(faces, axis=1), axis=1) == 0).any(axis=1).all():
        cause = f"every one of {len(faces)} faces with {corners + 1} corners names a vertex twice: they are columns"
        raise GeometryError(cause, remedy="pass faces.T", element="faces")


def used_bounds(points: Floats, ids: Ints) -> Floats:
    """Return the (2, d) lower and upper corner of the box around those of (n, d) points that `ids` name."""
    used = mask_of(len(points), ids.ravel())
    columns = (points if used.all() else points[used]).T
    return np.array([[column.min() for column in columns], [column.max() for column in columns]])


P = ParamSpec("P")
T = TypeVar("T")


def public_call(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function, so that common mistakes in its arguments raise errors with a remedy.

    These are vertices and faces as two arguments, and a `progress` that cannot be called. A lack of memory raises
    `MemoryLimitError`. If the function has a parameter `progress`, what it is given is bound (`jobs.reporting`), so
    that its body need not mention it.
    """
    guarded = within_memory(function)
    parameters = signature(function).parameters
    named = [name for name, each in parameters.items() if each.kind is not each.KEYWORD_ONLY]

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        refuse_pair_apart(args, function.__name__)
        if "progress" not in parameters:
            return guarded(*args, **kwargs)
        given: dict[str, Any] = {**dict(zip(named, args, strict=False)), **kwargs}
        callback(given.get("progress"), "progress(fraction, step)")
        with reporting(given.get("progress")):
            return guarded(*args, **kwargs)

    return checked


def refuse_pair_apart(arguments: Sequence[object], name: str) -> None:
    """Raise an error if an array of vertices and one of faces are two successive arguments of the function `name`."""
    for index in range(len(arguments) - 1):
        points, rows = arguments[index : index + 2]
        if not is_pair((points, rows)) or min(len(row) for row in cast("Sequence[Sequence[int]]", rows)) < 3:
            continue
        remedy = f"pass the pair {name}((vertices, faces))"
        if name == "signed_distance" and any(
            are_points(thing) for thing in arguments[index + 2 :] or arguments[:index]
        ):
            remedy = "for points use sh.complete((vertices, faces)).distance(points)"
        raise UnsupportedTypeError("vertices and faces are one argument", remedy=remedy, element=f"argument {index}")


def are_points(thing: object) -> bool:
    """Whether an object is an (n, 3) array or list of numbers."""
    try:
        points = np.asarray(thing)
    except ValueError:
        return False
    return points.ndim == 2 and points.shape[1] == 3 and points.dtype.kind in "fi"


def is_pair(thing: object) -> bool:
    """Whether an object is a pair of arrays (vertices, faces), and not two sources or two numbers."""
    if not (isinstance(thing, tuple | list) and len(thing) == 2 and all(like_array(part) for part in thing)):
        return False
    points, faces = thing
    try:
        positions = np.asanyarray(points, dtype=np.float64)
    except (TypeError, ValueError, RuntimeError, OverflowError):
        return False
    return positions.ndim == 2 and positions.shape[1] == 3 and _like_ids(faces)


def like_array(part: object) -> bool:
    """Whether an object is a list or tuple, or can be converted to an array."""
    return isinstance(part, list | tuple) or hasattr(part, "__array__")


def _like_ids(faces: object) -> bool:
    """Whether an object is an array or a list of rows of integers, which may differ in length."""
    rows = faces if hasattr(faces, "__array__") else list(cast("Sequence[object]", faces))
    if isinstance(rows, list):
        return bool(rows) and all(
            isinstance(row, list | tuple | np.ndarray) and _are_whole(np.asarray(row), 1) for row in rows
        )
    return _are_whole(np.asarray(rows), 2)


def _are_whole(ids: NDArray[np.generic], axes: int) -> bool:
    """Whether an array has an integer type and this number of axes."""
    return ids.ndim == axes and bool(np.issubdtype(ids.dtype, np.integer))
