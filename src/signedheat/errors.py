"""Exceptions and warnings. Every message names the cause, the element and the remedy."""

from __future__ import annotations

import sys
import warnings


class SignedHeatError(ValueError):
    """Base class of every error that signedheat raises for bad input."""


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


class UnreachedWarning(UserWarning):
    """Parts of the domain hold no source; their distance is NaN."""


def warn_user(message: str, category: type[Warning]) -> None:
    """Warn at the line of the caller that called this package, however deep within it the reason was found."""
    package = __name__.partition(".")[0]
    depth, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, depth = frame.f_back, depth + 1
    warnings.warn(message, category, stacklevel=depth)
