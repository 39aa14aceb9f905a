"""What a field asks of its domain: how values lie on it, what is between them, and where they take a level."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..errors import GeometryError, UnsupportedTypeError
from ..validation import contiguous

if TYPE_CHECKING:
    from typing_extensions import Self

Exact: TypeAlias = Callable[[ArrayLike], Floats]
"""Distance at any points of space."""


class Interpolant(Protocol):
    """A function that has a field's values, and its gradient, at any points of the domain."""

    def __call__(self, points: Any) -> Floats: ...
    def gradient(self, points: Any) -> Floats: ...


class FieldDomain:
    """A domain on which a `Field` can have values: a grid, a band, tets or a surface."""

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """Shape of the values of a field."""
        raise NotImplementedError

    def _checked(self, values: object) -> NDArray[Any]:
        """Return the values of a field as an array; refuse any other shape."""
        array = contiguous(values, "values")
        if array.shape != self._values_shape:
            raise GeometryError(
                f"values have shape {array.shape}, and {self!r:.120} needs {self._values_shape}", element="values"
            )
        return array

    def _interpolant(self, values: NDArray[Any], beyond: Exact | None) -> Interpolant:
        """Interpolate values; `beyond` has those at points of space where the domain has none."""
        raise NotImplementedError

    def _clipped(self, points: ArrayLike) -> Any:
        """Return the nearest points of the domain."""
        return points

    def _level_set(self, values: NDArray[Any], level: float, exact: Exact | None) -> Any:
        """Extract a level set, moved onto that of the exact distance, if there is one."""
        raise NotImplementedError

    def _level_parts(self, values: NDArray[Any], level: float, exact: Exact | None) -> Iterator[tuple[Floats, Ints]]:
        """Yield vertices and faces of a level set in space, part by part."""
        surface = self._level_set(values, level, exact)
        if isinstance(surface, list):
            raise GeometryError(
                "the level set is made of lines", remedy="use contour, and sh.io.write_polylines or write_curves"
            )
        yield surface.vertices, surface.faces

    def _values_at_walls(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values where level sets leave the domain."""
        return np.empty(0)

    def _restricted(self) -> FieldDomain:
        """Return the domain in space whose unknowns are the first ones of this one."""
        return self

    def _expanded(self, values: NDArray[Any], beyond: Exact | None) -> tuple[FieldDomain, NDArray[Any]]:
        """Return the same function on a domain in space that has all its detail."""
        return self, values

    def _plain(self, values: NDArray[Any]) -> tuple[FieldDomain, NDArray[Any]]:
        """Return the function on a domain that files and viewers support."""
        return self, values

    def _stretched(self, factor: float) -> Self:
        """Return the domain of values that are multiplied by a number."""
        return self

    def _shared(self, other: FieldDomain) -> Self:
        """Return the domain of combinations of fields on this and on another; refuse one with other unknowns."""
        if self is other:
            return self
        if type(self) is not type(other):
            raise UnsupportedTypeError(
                f"a field on a {type(self).__name__} is not combined with one on a {type(other).__name__}",
                remedy="combine fields on one domain",
                element="second field",
            )
        names = [name for name in ("points", "vertices", "faces", "corners", "tets") if hasattr(self, name)]
        if not names or not all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names):
            raise different(self, other)
        return self


def different(one: object, other: object) -> GeometryError:
    """Return the error for fields on domains with different unknowns."""
    return GeometryError(
        f"the fields lie on different domains: {one!r} and {other!r}",
        remedy="compute both on one, such as a Grid.around the bounds of both",
        element="second field",
    )
