"""Fields as arrays, arithmetic of fields and numbers, and unions, intersections and differences of fields of solids."""

from __future__ import annotations

import operator
from collections.abc import Callable
from os import PathLike
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .arrays import Bools, Floats
from .errors import GeometryError, SourceError, UnsupportedTypeError
from .grids.grid import Grid
from .packages import lazy_module
from .validation import finite_number

files: Any = lazy_module("signedheat.io.field_files", "files")

Change = Callable[[NDArray[Any]], NDArray[Any]]
Rule = Callable[[Floats, Floats], Floats]
Number = float | np.number[Any]
NUMBER_TYPES = (int, float, np.number)


class HasValues(Protocol):
    """A field with values, as arithmetic with numbers needs it."""

    @property
    def values(self) -> NDArray[Any]: ...
    def _mapped(self: AnyField, change: Change) -> AnyField: ...
    def _scaled(self: AnyField, factor: float) -> AnyField: ...


class SolidField(HasValues, Protocol):
    """A field whose solid can be combined with others: a `GridField`, `TetField` or `VertexField`."""

    @property
    def domain(self) -> object: ...
    def with_values(self: Solid, values: Floats) -> Solid: ...
    def combined_with(self: Solid, other: Solid, rule: Rule) -> Solid: ...


@runtime_checkable
class HasFields(Protocol):
    """Something to which distance can be computed on a given grid, such as a `Solid`."""

    def field_on(self, field: Any) -> Any:
        """Compute distance at the nodes of a field."""

    def _surface_on(self, field: Any, level: float) -> Any:
        """Extract the surface at a level of its field, with edges and corners, in the cells of the field's grid."""


AnyField = TypeVar("AnyField", bound=HasValues)
Solid = TypeVar("Solid", bound=SolidField)


def _finite(number: Number) -> float:
    """Return a number as a float; refuse NaN and infinity, which would leave no distance."""
    return finite_number(number, "number")


class Arithmetic:
    """A field with arithmetic: ``-field``, ``abs(field)``, ``2 * field``, ``field / 2`` and ``field + 1`` are fields.

    So ``field - 0.1`` is the offset by 0.1, and ``-field`` the field of the other side. NumPy's functions treat a field
    as the array of its values. A `GridField` that is exact between its nodes, since it holds its solid, stays so when
    it is negated or multiplied, and when 0 is added; sums with other numbers are interpolated.

    Examples
    --------
    >>> import signedheat as sh
    >>> field = sh.GridField(sh.Grid(0.0, 1.0, 3), [-1.0, 0.0, 1.0])
    >>> (1 - 2 * field).values
    array([ 3.,  1., -1.])
    >>> np.asarray(-field), float(np.max(field)), np.abs(field)
    (array([ 1., -0., -1.]), 1.0, array([1., 0., 1.]))
    """

    __array_priority__: float = 1000.0  # so that NumPy's numbers leave operators to the field

    def __array__(self: HasValues, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __neg__(self: AnyField) -> AnyField:
        return self._scaled(-1.0)

    def __abs__(self: AnyField) -> AnyField:
        return self._mapped(np.abs)

    def __mul__(self: AnyField, factor: Number) -> AnyField:
        return self._scaled(_finite(factor)) if isinstance(factor, NUMBER_TYPES) else NotImplemented

    def __truediv__(self: AnyField, divisor: Number) -> AnyField:
        if not isinstance(divisor, NUMBER_TYPES):
            return NotImplemented
        return self._scaled(_finite(1.0 / _finite(divisor) if divisor else np.inf))

    def __add__(self: AnyField, summand: Number) -> AnyField:
        if not isinstance(summand, NUMBER_TYPES):
            return NotImplemented
        level = _finite(summand)
        return self._mapped(lambda phi: phi + level) if level else self._scaled(1.0)

    def __sub__(self: AnyField, level: Number) -> AnyField:
        return Arithmetic.__add__(self, -_finite(level)) if isinstance(level, NUMBER_TYPES) else NotImplemented

    def __rsub__(self: AnyField, level: Number) -> AnyField:
        if not isinstance(level, NUMBER_TYPES):
            return NotImplemented
        number = _finite(level)
        return self._mapped(lambda phi: number - phi)

    def _scaled(self: AnyField, factor: float) -> AnyField:
        return self._mapped(lambda phi: phi * factor)

    __radd__ = __add__
    __rmul__ = __mul__


class Combinable(Arithmetic):
    """A field that is negative inside a solid or a region: ``a | b``, ``a & b``, ``a - b`` and ``~a`` are fields again.

    If both fields hold their solids, the result is the exact distance to the combined solid. Otherwise it has the right
    sign and zero set, but on one side of the boundary (inside a union, outside an intersection or a difference) it is
    a bound of the distance, not distance itself; `sharpen` turns it into distance. The result does not have the
    confidence of fields that were sharpened to a shape.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> left, right = (sh.GridField(grid, np.linalg.norm(grid.points - [x, 0], axis=-1) - 1) for x in (-0.5, 0.5))
    >>> both, common, bite = left | right, left & right, left - right
    >>> [float(field([0.75, 0.0]).round(2)) for field in (both, common, bite, ~both)]
    [-0.75, 0.25, 0.75, 0.75]
    """

    def __or__(self: Solid, other: Solid) -> Solid:
        """Union: inside where at least one of the two fields is."""
        exact = _of_solids(self, other, operator.or_)
        return combined(self, other, np.less_equal, 0.0) if exact is None else exact

    def __and__(self: Solid, other: Solid) -> Solid:
        """Intersection: inside where both fields are."""
        exact = _of_solids(self, other, operator.and_)
        return combined(self, other, np.greater_equal, 0.0) if exact is None else exact

    def __sub__(self: Solid, other: Solid | Number) -> Solid:
        """Difference: inside where this field is and the other is not; a number is subtracted from the values."""
        if isinstance(other, NUMBER_TYPES):
            return Arithmetic.__sub__(self, other)
        exact = _of_solids(self, other, operator.sub)
        if exact is not None:
            return exact
        return combined(self, _checked(self, other)._mapped(np.negative), np.greater_equal, 0.0)

    def __invert__(self: Solid) -> Solid:
        """Complement: inside and outside exchanged."""
        return self._scaled(-1.0)

    def with_values(self: Solid, values: Floats) -> Solid:
        """Return a field of other values on the same domain.

        Parameters
        ----------
        values : array
            In the shape of `values`.

        Returns
        -------
        GridField, TetField or VertexField
            Without diagnostics, source, confidence and solid.

        Examples
        --------
        >>> import signedheat as sh
        >>> line = sh.GridField(sh.Grid(0.0, 1.0, 3), [-1.0, 0.0, 1.0])
        >>> line.with_values(line.values**2).values.tolist()
        [1.0, 0.0, 1.0]
        """
        return type(self)(self.domain, values)  # type: ignore[call-arg]

    def combined_with(self: Solid, other: Solid, rule: Rule) -> Solid:
        """Combine the values of two fields on one domain by a rule.

        Parameters
        ----------
        other : GridField, TetField or VertexField
            On the same domain.
        rule : callable
            Takes two arrays of values and returns one, such as `np.minimum`.

        Returns
        -------
        GridField, TetField or VertexField
            A field with the values that the rule returns.

        Raises
        ------
        GeometryError
            If the fields lie in different bands.

        Examples
        --------
        >>> import signedheat as sh
        >>> tet = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> phi = sh.TetField(tet, [0.0, 1.0, 2.0, 3.0])
        >>> phi.combined_with(3.0 - phi, np.minimum).values.tolist()
        [0.0, 1.0, 1.0, 0.0]
        """
        return self.with_values(rule(self.values, other.values))

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension; `signedheat.read_field` reads all but ``.vdb``.

        Parameters
        ----------
        path : str or path
            On grids ``.npz``, ``.vti``, ``.nrrd``, ``.npy`` or ``.vdb``, in a band ``.npz``, ``.vdb`` or, with
            all nodes of the grid, ``.vti``; on tets ``.vtu``, ``.vtk`` or ``.msh``.

        Raises
        ------
        FileFormatError
            If the format is not one of these, or the file cannot be written.
        MissingPackageError
            If the format needs meshio, and it is not installed.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> line = sh.GridField(sh.Grid(0.0, 1.0, 2), [0.0, 1.0])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     line.save(f"{folder}/line.npz")
        ...     sh.read_field(f"{folder}/line.npz").values.tolist()
        [0.0, 1.0]
        """
        files.write_field(self, path)

    def _mapped(self: Solid, change: Change) -> Solid:
        """Return a field of changed values, without the diagnostics."""
        return self.combined_with(self, lambda phi, _: change(phi))


def smooth_union(a: Solid, b: Solid, width: float) -> Solid:
    """Unite two solids, with a round transition where they meet.

    Where the two fields differ by less than the width w, φ is the polynomial smooth minimum
    ``min(a, b) − (w − |a − b|)² / 4w``; elsewhere it is the smaller of the two. The concave edge where the solids meet
    becomes a fillet of about that width.

    Parameters
    ----------
    a, b : GridField, TetField or VertexField
        On the same domain.
    width : float
        Width of the transition, in the units of the domain; 0 gives the smaller of the two everywhere.

    Returns
    -------
    GridField, TetField or VertexField
        A field whose sign and zero set are those of the blend. `sharpen` turns it into distance.

    Raises
    ------
    GeometryError
        If the fields lie on different domains.
    SignedHeatError
        If the width is negative or not finite.

    See Also
    --------
    morphology.smooth_intersection : Intersection with a rounded seam.
    morphology.smooth_difference : Difference with a rounded seam.
    GridField : Values on a grid.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> left, right = (sh.GridField(grid, np.linalg.norm(grid.points - [x, 0], axis=-1) - 1) for x in (-1, 1))
    >>> float((left | right)([0.0, 0.5]).round(3)), float(smooth_union(left, right, 0.4)([0.0, 0.5]).round(3))
    (0.118, 0.018)
    """
    return combined(a, b, np.less_equal, -finite_number(width, "the width of the blend", least=0))


def smooth_intersection(a: Solid, b: Solid, width: float) -> Solid:
    """Intersect two solids, with a rounded edge where they meet; see `smooth_union`.

    Parameters
    ----------
    a, b : GridField, TetField or VertexField
        On the same domain.
    width : float
        Width of the transition, in the units of the domain.

    Returns
    -------
    GridField, TetField or VertexField
        A field whose sign and zero set are those of the blend.

    See Also
    --------
    morphology.smooth_union : Union with a rounded seam.
    morphology.smooth_difference : Difference with a rounded seam.
    GridField : Values on a grid.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> left, right = (sh.GridField(grid, np.linalg.norm(grid.points - [x, 0], axis=-1) - 1) for x in (-0.5, 0.5))
    >>> float((left & right)([0.0, 0.5]).round(3)), float(smooth_intersection(left, right, 0.4)([0.0, 0.5]).round(3))
    (-0.293, -0.193)
    """
    return combined(a, b, np.greater_equal, finite_number(width, "the width of the blend", least=0))


def smooth_difference(a: Solid, b: Solid, width: float) -> Solid:
    """Subtract the second solid from the first, with a rounded edge where they meet; see `smooth_union`.

    Parameters
    ----------
    a, b : GridField, TetField or VertexField
        On the same domain.
    width : float
        Width of the transition, in the units of the domain.

    Returns
    -------
    GridField, TetField or VertexField
        A field whose sign and zero set are those of the blend.

    See Also
    --------
    morphology.smooth_union : Union with a rounded seam.
    morphology.smooth_intersection : Intersection with a rounded seam.
    GridField : Values on a grid.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid((-2, -2), 0.5, (9, 9))
    >>> disk = sh.GridField(grid, np.linalg.norm(grid.points, axis=-1) - 1)
    >>> half = smooth_difference(disk, sh.GridField(grid, grid.points[..., 0]), 0.2)  # without the left side
    >>> half([[0.5, 0.0], [-0.5, 0.0]]).round(2)
    array([-0.45,  0.5 ])
    """
    return smooth_intersection(a, _checked(a, b)._mapped(np.negative), width)


def combined(a: Solid, b: Solid, takes_first: Callable[[Floats, Floats], Bools], bulge: float) -> Solid:
    """Take `a` where `takes_first(a, b)`, else `b`; a blend of width |bulge| raises φ, or lowers it if `bulge` < 0."""
    b = _checked(a, b)

    def rule(one: Floats, other: Floats) -> Floats:
        values = np.where(takes_first(one, other), one, other)
        if bulge:
            near = np.maximum(abs(bulge) - np.abs(one - other), 0.0)
            values = values + near**2 / (4 * bulge)
        values[np.isnan(one) | np.isnan(other)] = np.nan
        return values

    return a.combined_with(b, rule)


def _of_solids(a: Solid, b: Solid, operation: Callable[[Any, Any], Any]) -> Any:
    """Compute the field of two fields' combined solids; None if one has no solid, or nothing is inside the result."""
    solids = [field if isinstance(field, HasFields) else getattr(field, "solid", None) for field in (a, b)]
    if not all(isinstance(solid, HasFields) for solid in solids):
        return None
    if not isinstance(b, HasFields):
        _checked(a, b)
    try:
        solid = operation(*solids)
    except SourceError:
        return None
    return solid.field_on(a)


def _checked(a: Solid, b: Solid) -> Solid:
    """Return the second field, computed on the domain of the first if it is a solid; refuse what does not fit."""
    if not (hasattr(a, "with_values") and hasattr(a, "domain")):
        raise UnsupportedTypeError(
            f"fields of type {type(a).__name__} are not combined",
            remedy="compute both on one whole grid, without a band",
            element=type(a).__name__,
        )
    if isinstance(b, HasFields) and isinstance(a.domain, Grid):
        b = b.field_on(a)
    if type(a) is not type(b):
        raise UnsupportedTypeError(
            f"a field of type {type(a).__name__} cannot be combined with {type(b).__name__}",
            remedy="combine fields on one domain",
            element=type(b).__name__,
        )
    if not _same_domain(a.domain, b.domain):
        raise GeometryError(
            f"the fields lie on different domains: {a.domain!r} and {b.domain!r}",
            remedy="compute both on one, such as a Grid.around the bounds of both",
            element="second field",
        )
    return b


def _same_domain(one: object, other: object) -> bool:
    """Whether two domains have the same unknowns at the same places, which on grids may differ by rounding."""
    if one is other:
        return True
    if isinstance(one, Grid) and isinstance(other, Grid):
        if one.shape != other.shape or not np.allclose(one.spacing, other.spacing, rtol=1e-12, atol=0):
            return False
        return bool((np.abs(one.origin - other.origin) <= 1e-9 * one.spacing).all())
    names = [name for name in ("points", "vertices", "faces", "corners", "tets") if hasattr(one, name)]
    return type(one) is type(other) and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
