"""Exceptions and warnings. Every message names the cause, the element and the remedy."""

from __future__ import annotations


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
