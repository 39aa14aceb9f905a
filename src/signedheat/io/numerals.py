"""Numbers in files: words of text, values of JSON, and arrays, checked where they are read.

Python and NumPy take ``1_0`` for 10, digits of any script, and round 1.7 to a vertex id. No format has any of these.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError, quoted
from ..validation import INT64_END, json_numbers
from .budgets import JSON, charge_tree
from .files import damaged

QUOTED = re.compile(rb'"[^"\n]*"')
"""Matches a name in quotes."""
BEFORE_UNDERSCORE = tuple(b"%c" % character for character in b"0123456789.")
"""Characters before the underscore of words that `WITH_UNDERSCORE` matches."""
WITH_UNDERSCORE = re.compile(rb"(?<!\S)[-+.]*[0-9][0-9.]*_")
"""Matches the beginning of a word like a number with an underscore."""
OF_OTHER_SCRIPT = re.compile(r"(?<!\S)[-+.0-9]*(?![0-9])\d")
"""Matches the beginning of a word like a number with digits of other scripts."""


def parsed_numbers(words: Sequence[Any], name: str) -> Floats:
    """Convert words of a text, or rows of words, to an array of real numbers; `name` names them in messages."""
    _refuse_odd(words, name)
    try:
        return np.array(words, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise _no_numbers(name, "numbers", error) from error


def json_of(content: str | bytes) -> Any:
    """Parse JSON, after its memory has been charged to the budget of the file."""
    charge_tree(content, JSON)
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise damaged(f"it is not JSON ({error})") from error


def vector(values: object, name: str, count: int) -> Floats:
    """Convert numbers of JSON to a (count,) array; refuse texts, true and false, NaN and infinity."""
    array = json_numbers(values, name, FileFormatError)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise damaged(f"{name} must be {count} finite numbers", element=name)
    return array


def finite_numbers(words: Sequence[str], name: str) -> Floats:
    """Convert words of a text to real numbers; refuse NaN and infinity."""
    array = parsed_numbers(words, name)
    wrong = ~np.isfinite(array)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise damaged(f"number {k} of {name} is not finite, but {quoted(words[k])}", element=f"number {k}")
    return array


def refuse_odd_text(content: bytes, name: str) -> None:
    """Raise an error if a text has words like numbers with digits or underscores that no format allows.

    This is for texts that other packages parse. Names within quotes may hold them.
    """
    has_underscore = any(part.endswith(BEFORE_UNDERSCORE) for part in content.split(b"_")[:-1])
    if content.isascii() and not has_underscore:
        return
    unquoted = QUOTED.sub(b"", content)
    odd = WITH_UNDERSCORE.search(unquoted) or OF_OTHER_SCRIPT.search(unquoted.decode("utf-8", errors="replace"))
    if odd is not None:
        raise damaged(f"{name} are not all numbers: one begins with {_shown(odd[0])}")


def row_of_numbers(line: str, words: Sequence[str]) -> list[float]:
    """Convert the words of a line to real numbers; return an empty list if one of them is none."""
    try:
        return [float(word) for word in words] if line.isascii() and "_" not in line else []
    except ValueError:
        return []


def like_number(word: str) -> bool:
    """Whether a word begins like a number, in digits of any script."""
    return word.lstrip("+-.")[:1].isdigit()


def typed_numbers(words: Sequence[str] | Sequence[bytes], dtype: DTypeLike, name: str) -> NDArray[Any]:
    """Convert words of a text to an array of a NumPy type; refuse numbers that an integer type does not have."""
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return parsed_numbers(words, name).astype(kind)
    values, limits = integers(words, name), np.iinfo(kind)
    wrong = (values < limits.min) | (values > min(limits.max, INT64_END - 1))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise damaged(f"number {k} of {name} is {values[k]}, which {kind.name} does not hold", element=f"number {k}")
    return values.astype(kind)


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
    return quoted(value) if isinstance(value, str | bytes | int | float | None) else f"a {type(value).__name__}"
