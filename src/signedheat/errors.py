"""Exceptions and warnings. Every message names the cause, the element and the remedy."""

from __future__ import annotations

import os
import sys
import warnings
from typing import TypeVar


class SignedHeatError(ValueError):
    """Base class of every error that signedheat raises for bad input.

    Attributes
    ----------
    cause : str
        What is wrong.
    remedy : str, optional
        What to do about it, where the cause does not say it already.
    element : str, optional
        The part of the input that it is about, such as ``face 3``.
    path : str, optional
        The file that it is about.

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
        super().__init__(cause)
        self.cause, self.remedy, self.element = cause, remedy, element
        self.path = None if path is None else str(path)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.path, self.cause, self.remedy) if part is not None)

    def at(self: AnyError, path: str | os.PathLike[str]) -> AnyError:
        """The same error, about a file."""
        return type(self)(self.cause, remedy=self.remedy, element=self.element, path=path)


AnyError = TypeVar("AnyError", bound=SignedHeatError)


class GeometryError(SignedHeatError):
    """A shape or domain that is not one: no elements, NaN coordinates, ids out of range, no area at all."""


class SourceError(SignedHeatError):
    """A source that cannot be used on this domain: off the domain, empty, without normals."""


class ConstraintError(SignedHeatError):
    """A constraint that does not fit the sources, for instance the wrong number of level values."""


class OutsideError(SignedHeatError):
    """A level or a point that leaves the domain on which the field is known."""


class MemoryLimitError(SignedHeatError):
    """A problem that cannot fit in memory, refused before anything is allocated."""


class FactorizationError(SignedHeatError):
    """A matrix that cannot be factorised: not positive definite, or too large for the memory."""


class FileFormatError(SignedHeatError):
    """A file that cannot be read or written: missing, truncated, of unknown kind, unwritable."""


class UnsupportedTypeError(SignedHeatError, TypeError):
    """An argument of a type that is not known here: no domain, no constraint, no field."""


class UnreachedWarning(UserWarning):
    """Parts of the domain hold no source; their distance is NaN."""


def warn_user(message: str, category: type[Warning]) -> None:
    """Warn at the line of the caller that called this package, however deep within it the reason was found."""
    package = __name__.partition(".")[0]
    depth, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, depth = frame.f_back, depth + 1
    warnings.warn(message, category, stacklevel=depth)
