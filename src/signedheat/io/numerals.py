"""Numbers in files: words of text, values of JSON, and arrays, checked where they are read.

Python and NumPy take ``1_0`` for 10, digits of any script, and round 1.7 to a vertex id. No format has any of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..validation import INT64_END
from .files import damaged


def parsed_numbers(words: Sequence[Any], name: str) -> Floats:
    """Convert words of a text, or rows of words, to an array of real numbers; `name` names them in messages."""
    _refuse_odd(words, name)
    try:
        return np.array(words, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise _no_numbers(name, "numbers", error) from error


def integers(values: object, name: str, least: int | None = None) -> Ints:
    """Convert words of a text, numbers of JSON or an array to integers; refuse fractions, and numbers below `least`."""
    if isinstance(values, np.ndarray):
        converted = _whole(values, name)
    else:
        converted = _parsed(values if isinstance(values, list | tuple) else [values], name)
    if least is not None and converted.size and converted.min() < least:
        k = int(np.argmax(converted < least))
        raise damaged(f"number {k} of {name} is {converted.flat[k]}, less than {least}", element=f"number {k}")
    return converted


def integer(value: object, name: str, least: int = 0) -> int:
    """Convert a word of a text or a number of JSON to an integer; refuse fractions, and numbers below `least`."""
    try:
        [number] = integers([value], name).tolist()
    except FileFormatError as error:
        raise damaged(f"{name} is {_shown(value)}, which is no integer", element=name) from error
    if number < least:
        raise damaged(f"{name} is {number}, less than {least}", element=name)
    return int(number)


def _whole(values: NDArray[Any], name: str) -> Ints:
    """Convert an array to integers; raise an error unless all its numbers are whole."""
    if values.dtype.kind == "f" and values.size:
        if not (np.abs(values) < INT64_END).all() or (values != np.rint(values)).any():
            raise damaged(f"{name} are not all integers")
    elif values.dtype.kind not in "iuf" or (values.dtype == np.uint64 and values.size and values.max() >= INT64_END):
        raise damaged(f"{name} are not all integers of at most 63 bits")
    return values.astype(np.int64)


def _parsed(values: Sequence[Any], name: str) -> Ints:
    """Convert words, or numbers of JSON, to integers; raise an error unless all are whole."""
    if all(isinstance(value, str) for value in values) or all(isinstance(value, bytes) for value in values):
        _refuse_odd(values, name)
    else:
        for value in values:
            if isinstance(value, bool) or not isinstance(value, int | float) or value % 1 != 0:
                raise damaged(f"{name} are not all integers: one is {_shown(value)}")
        values = [int(value) for value in values]
    try:
        return np.array(values, dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise _no_numbers(name, "integers", error) from error


def _refuse_odd(words: Sequence[Any], name: str) -> None:
    """Raise an error if words have digits or underscores that Python reads as numbers and no format allows."""
    if words and isinstance(words[0], list):
        words = [word for row in words for word in row]
    are_bytes = bool(words) and isinstance(words[0], bytes)
    joined = b"".join(words).decode("latin-1") if are_bytes else "".join(words)
    if not joined.isascii() or "_" in joined:
        odd = next(word for word in words if not word.isascii() or "_" in str(word))
        raise damaged(f"{name} are not all numbers: one is {_shown(odd)}")


def _no_numbers(name: str, kind: str, error: Exception) -> FileFormatError:
    """Return the error for values that are not all of a kind, such as ``"integers"``."""
    return damaged(f"{name} are not all {kind} ({error}): the file is damaged")


def _shown(value: object) -> str:
    """Return a short description of a value for messages."""
    return f"{value!r:.40}" if isinstance(value, str | bytes | int | float | None) else f"a {type(value).__name__}"
