"""Interface that a `Field` needs of its domain: shape of the values, interpolation and level sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..errors import GeometryError, UnsupportedTypeError, quoted
from ..validation import contiguous

if TYPE_CHECKING:
    from typing_extensions import Self

Exact: TypeAlias = Callable[[ArrayLike], Floats]
"""Function that takes (..., d) points of space and returns (...) signed distances."""


class Interpolant(Protocol):
    """A field's function on the whole domain: a call returns its values at points, `gradient` its gradients."""

    def __call__(self, points: Any) -> Floats: ...
    def gradient(self, points: Any) -> Floats: ...


class FieldDomain:
    """A domain on which a `Field` can have values: a grid, a band, tets or a surface."""

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """Shape that the array of a field's values has on this domain, such as (n_vertices,)."""
        raise NotImplementedError

    def _checked(self, values: object) -> NDArray[Any]:
        """Return the values of a field as a contiguous array; raise an error if it is not of `_values_shape`."""
        array = contiguous(values, "values")
        if array.shape != self._values_shape:
            raise GeometryError(
                f"values have shape {array.shape}, and {quoted(self)} needs {self._values_shape}", element="values"
            )
        return array

    def _interpolant(self, values: NDArray[Any], beyond: Exact | None) -> Interpolant:
        """Return the function that interpolates values; `beyond`, if any, evaluates it at points off the domain."""
        raise NotImplementedError

    def _clipped(self, points: ArrayLike) -> Any:
        """Return the point of the domain nearest to each of (..., d) points; unchanged unless a domain overrides it."""
        return points

    def _level_set(self, values: NDArray[Any], level: float, exact: Exact | None) -> Any:
        """Extract the level set φ = level of values; its vertices are moved onto that of `exact`, if that is given."""
        raise NotImplementedError

    def _level_parts(self, values: NDArray[Any], level: float, exact: Exact | None) -> Iterator[tuple[Floats, Ints]]:
        """Yield (n, 3) vertices and (m, 3) faces of a level set in space, part by part."""
        surface = self._level_set(values, level, exact)
        if isinstance(surface, list):
            raise GeometryError(
                "the level set is made of lines", remedy="use contour, and sh.io.write_polylines or write_curves"
            )
        yield surface.vertices, surface.faces

    def _values_at_walls(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values at the walls of the domain, through which level sets leave it; none without walls."""
        return np.empty(0)

    def _restricted(self) -> FieldDomain:
        """Return the plainer domain, such as the mesh of a triangulation, whose values are the first of the values."""
        return self

    def _expanded(self, values: NDArray[Any], beyond: Exact | None) -> tuple[FieldDomain, NDArray[Any]]:
        """Return a plain grid or mesh that has all detail of this domain, and the values of the same function on it."""
        return self, values

    def _plain(self, values: NDArray[Any]) -> tuple[FieldDomain, NDArray[Any]]:
        """Return a domain that files and viewers support, and the values of the same function on it."""
        return self, values

    def _stretched(self, factor: float) -> Self:
        """Return the domain for values multiplied by a factor; it differs only if the domain depends on the values."""
        return self

    def _shared(self, other: FieldDomain) -> Self:
        """Return the domain for a combination of a field on this domain with one on another.

        Raises an error if the two differ in type, points, vertices or cells.
        """
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


def different(first: object, second: object) -> GeometryError:
    """Return the error that says that two fields lie on different domains."""
    return GeometryError(
        f"the fields lie on different domains: {first!r} and {second!r}",
        remedy="compute both on one, such as a Grid.around the bounds of both",
        element="second field",
    )
