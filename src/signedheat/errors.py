"""Exceptions and warnings. Every message names the cause, the element concerned and the remedy."""

from __future__ import annotations

import inspect
import os
import warnings
from string import Formatter
from typing import Any, TypeVar

__all__ = [
    "CancellingNormalsError", "ConstraintError", "FactorizationError", "FileFormatError", "GeometryError",
    "InexactWarning", "MemoryLimitError", "MissingPackageError", "OutsideError", "SignedHeatError", "SourceError",
    "UnreachedWarning", "UnsupportedTypeError",
]  # fmt: skip

LONGEST_TEXT = 600
"""Number of characters up to which causes, remedies, elements and warnings are kept; longer ones are cut off. They may
quote names and contents of files."""

LONGEST_QUOTE = 60
"""Number of characters up to which messages quote a value or a word of a file."""


ENDINGS = {"ex": "ices", "y": "ies", "sh": "shes", "x": "xes"}
"""Plural endings of nouns by the endings of their singulars, as in "vertex" and "vertices". Others get an s."""


def counted(n: int, noun: str) -> str:
    """Return a text of a count and a noun, in the plural unless the count is 1.

    Examples
    --------
    >>> counted(1, "line"), counted(0, "vertex"), counted(1024, "body")
    ('1 line', '0 vertices', '1024 bodies')
    """
    if n == 1:
        return f"1 {noun}"
    ending = next((ending for ending in ENDINGS if noun.endswith(ending)), "")
    return f"{n} {noun.removesuffix(ending)}{ENDINGS.get(ending, 's')}"


def percent(share: float, digits: int = 3) -> str:
    """Return a text for a share, from 0 to 1, in percent, with at most `digits` significant digits.

    Examples
    --------
    >>> percent(0.999999), percent(0.12345), percent(1e-5)
    ('100 %', '12.3 %', '0.001 %')
    """
    return f"{float(f'{100 * share:.{digits}g}'):.{max(digits, 15)}g} %"  # rounded, and without an exponent


class Sentence(Formatter):
    """Formatter of messages, with ``{:%}`` for shares in percent, and a noun as in ``{:face}`` for counts."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return the text for a value. The specification is ``%``, a noun, or one of Python's."""
        if format_spec == "%":
            return percent(value)
        return (
            counted(value, format_spec)
            if len(format_spec) > 1 and format_spec.isalpha()
            else format(value, format_spec)
        )


def shortened(text: str) -> str:
    """Put a text on one line, and cut it at `LONGEST_TEXT` characters.

    Examples
    --------
    >>> len(shortened("no such\\nname: " + 10_000 * "a"))
    600
    """
    line = " ".join(text[: 2 * LONGEST_TEXT].split())
    return line if len(line) <= LONGEST_TEXT and len(text) <= 2 * LONGEST_TEXT else f"{line[: LONGEST_TEXT - 1]}…"


def shortened_name(name: str) -> str:
    """Cut the beginning of the name of a file, of which the end says more, so that `LONGEST_TEXT` characters are left.

    Examples
    --------
    >>> shortened_name("part.stl"), len(shortened_name(10_000 * "part/" + "a.stl"))
    ('part.stl', 600)
    """
    return name if len(name) <= LONGEST_TEXT else f"…{name[1 - LONGEST_TEXT :]}"


def quoted(value: object) -> str:
    """Return the `repr` of a value on one line, cut at `LONGEST_QUOTE` characters, for messages.

    Examples
    --------
    >>> quoted("round"), len(quoted(10_000 * "a")), quoted(10**10_000)
    ("'round'", 60, 'an int')
    """
    try:
        line = " ".join(repr(value)[: 2 * LONGEST_TEXT].split())
    except Exception:  # integers of too many digits have none, nor have some objects of users
        kind = type(value).__name__
        return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"
    return line if len(line) <= LONGEST_QUOTE else f"{line[: LONGEST_QUOTE - 1]}…"


def printable(text: str) -> str:
    """Escape control characters, so that names and contents of files cannot control a terminal.

    Examples
    --------
    >>> print(printable("two\\nlines, café"))
    two\\nlines, café
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


class SignedHeatError(ValueError):
    """Base class of every error that signedheat raises for bad input.

    Attributes
    ----------
    cause : str
        What is wrong.
    remedy : str, optional
        What to do about it; None by default, if the cause says so.
    element : str, optional
        The part of the input concerned, such as ``face 3``; None by default.
    path : str, optional
        The file concerned; None by default.

    See Also
    --------
    errors.GeometryError : An invalid shape.
    errors.SourceError : A source that cannot be used.
    errors.FileFormatError : A file that cannot be read or written.

    Examples
    --------
    >>> error = GeometryError("polygon 3 has 2 corners", remedy="remove it", element="polygon 3")
    >>> print(error.at("broken.obj"))
    broken.obj: polygon 3 has 2 corners: remove it
    >>> error.at("broken.obj").element
    'polygon 3'
    """

    def __init__(
        self,
        cause: str,
        *,
        remedy: str | None = None,
        element: str | None = None,
        path: str | os.PathLike[str] | None = None,
    ) -> None:
        cause = printable(shortened(cause))  # which may quote several lines
        super().__init__(cause)
        self.cause: str = cause
        self.remedy: str | None = None if remedy is None else shortened(remedy)
        self.element: str | None = None if element is None else shortened(element)
        self.path: str | None = None if path is None else str(path)

    def __str__(self) -> str:
        name = None if self.path is None else shortened_name(self.path)
        return ": ".join(printable(part) for part in (name, self.cause, self.remedy) if part is not None)

    def at(self: AnyError, path: str | os.PathLike[str]) -> AnyError:
        """Copy the error, and name the file it concerns.

        Parameters
        ----------
        path : str or path
            The file.

        Returns
        -------
        SignedHeatError
            An error of the same class, with this `path`.

        See Also
        --------
        errors.FileFormatError : A file that cannot be read or written.

        Examples
        --------
        >>> str(SignedHeatError("no face has an area").at("part.stl"))
        'part.stl: no face has an area'
        """
        return type(self)(self.cause, remedy=self.remedy, element=self.element, path=path)


AnyError = TypeVar("AnyError", bound=SignedHeatError)


class GeometryError(SignedHeatError):
    """An invalid shape or domain: no elements, NaN coordinates, ids out of range, zero area.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    """


class SourceError(SignedHeatError):
    """A source that cannot be used on this domain: off the domain, empty, without normals.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    errors.CancellingNormalsError : A source whose normals cancel.
    """


class CancellingNormalsError(SourceError):
    """A source whose normals cancel each other everywhere: doubled walls, loops inside single faces.

    See Also
    --------
    errors.SourceError : A source that cannot be used.
    orient : Flip faces or curves so that they agree.
    """


class ConstraintError(SignedHeatError):
    """A constraint does not fit the sources, for instance because of the wrong number of level values.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    constraints.ZeroSet : Zero on the source.
    """


class OutsideError(SignedHeatError):
    """A level or a point outside the range or the domain of a field.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    """


class MemoryLimitError(SignedHeatError):
    """A problem that does not fit in memory, or a result that does not fit on disk.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    """


class FactorizationError(SignedHeatError):
    """A matrix that cannot be factorised: not positive definite, or its factor does not fit in memory.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    """


class FileFormatError(SignedHeatError):
    """A file that cannot be read or written: missing, truncated, of unknown format, not writable.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    read : Read a shape or a solid.
    """


class UnsupportedTypeError(SignedHeatError, TypeError):
    """An argument of an unsupported type, such as an object that is not a domain, a constraint or a field.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    as_shape : Convert objects of other packages.
    """


class MissingPackageError(SignedHeatError, ImportError):
    """An optional package that a format or function needs is not installed.

    See Also
    --------
    SignedHeatError : The base class of all errors.
    """


class UnreachedWarning(UserWarning):
    """A connected component of the domain has no source; the distance there is NaN.

    See Also
    --------
    errors.InexactWarning : Less exact than promised.
    """


class InexactWarning(UserWarning):
    """The result misses its stated accuracy; its diagnostics give details.

    See Also
    --------
    errors.UnreachedWarning : A part without a source.
    results.Diagnostics : What was done, and how long it took.
    """


def refuse_deleted_folder(path: str | os.PathLike[str]) -> None:
    """Raise `FileFormatError` if a path is relative and the current folder has been deleted."""
    try:
        if not os.path.isabs(path):
            os.getcwd()
    except FileNotFoundError:
        cause = "the folder that it is in, the current one, has been deleted"
        raise FileFormatError(cause, remedy="change to another folder", path=path) from None


def warn_user(message: str, category: type[Warning]) -> None:
    """Issue a warning attributed to the line of user code that called this package."""
    within = {__name__.partition(".")[0], "functools", "contextlib"}  # the last two call functions that they decorate
    depth, frame = 1, inspect.currentframe()
    while frame and frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in within:
        frame, depth = frame.f_back, depth + 1
    warnings.warn(printable(shortened(message)), category, stacklevel=depth)
