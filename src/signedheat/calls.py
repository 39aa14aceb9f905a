"""What every public function checks of its call, before it does anything: arguments that were meant otherwise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from .errors import SignedHeatError, UnsupportedTypeError
from .memory import within_memory

P = ParamSpec("P")
T = TypeVar("T")


def public_call(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function: it refuses what was meant otherwise, and says so if memory runs out."""
    guarded = within_memory(function)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        refuse_pair_apart(args, function.__name__)
        refuse_uncallable(kwargs.get("progress"))
        return guarded(*args, **kwargs)

    return checked


def refuse_pair_apart(arguments: Sequence[object], name: str) -> None:
    """Raise if arrays of vertices and of faces are given as two arguments."""
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


def refuse_uncallable(progress: object) -> None:
    """Raise if something other than a function is given to report progress."""
    if progress is not None and not callable(progress):
        raise SignedHeatError(
            f"progress must be a function, not {progress!r:.50}",
            remedy="pass a function that takes the fraction done and the name of the step",
            element="progress",
        )


def are_points(thing: object) -> bool:
    """Whether something is an (n, 3) array or list of coordinates."""
    try:
        points = np.asarray(thing)
    except ValueError:
        return False
    return points.ndim == 2 and points.shape[1] == 3 and points.dtype.kind in "fi"


def is_pair(thing: object) -> bool:
    """Whether something is a pair of arrays (vertices, faces), and not two sources or two numbers."""
    if not (isinstance(thing, tuple | list) and len(thing) == 2 and all(like_array(part) for part in thing)):
        return False
    points, faces = thing
    try:
        positions = np.asanyarray(points, dtype=np.float64)
    except (TypeError, ValueError, RuntimeError):
        return False
    return positions.ndim == 2 and positions.shape[1] == 3 and _like_ids(faces)


def like_array(part: object) -> bool:
    """Whether something is an array, or rows of something."""
    return isinstance(part, list | tuple) or hasattr(part, "__array__")


def _like_ids(faces: object) -> bool:
    """Whether something is rows of whole numbers, of equal length or not."""
    rows = faces if hasattr(faces, "__array__") else list(cast("Sequence[object]", faces))
    if isinstance(rows, list):
        return bool(rows) and all(
            isinstance(row, list | tuple | np.ndarray) and _whole(np.asarray(row), 1) for row in rows
        )
    return _whole(np.asarray(rows), 2)


def _whole(ids: NDArray[np.generic], axes: int) -> bool:
    return ids.ndim == axes and bool(np.issubdtype(ids.dtype, np.integer))
