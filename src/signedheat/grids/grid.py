"""Regular grids of any dimension."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Frozen, place, short
from ..errors import GeometryError, MemoryLimitError
from ..fields.field_domain import Exact, FieldDomain, different
from ..mesh.box_tree import room_around
from ..mesh.triangles import flipped_along_creases
from ..packages import lazy_module
from ..parallel import in_chunks
from ..shapes.exchange import Displayed
from ..shapes.foreign import ForeignShape, Shape, as_shapes
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import (
    coordinates,
    finite_number,
    frozen,
    numbers,
    positive_steps,
    query_points,
    refuse_extreme,
    refuse_lost_spacing,
    shaped,
    whole_number,
    whole_numbers,
)
from .exact_levels import NodeValues, on_level
from .marching import closed_surface, level_lines, values_at_walls
from .polyline import Polyline

RESOLUTION = 128
"""Default number of nodes along the longest side of a grid."""
if TYPE_CHECKING:
    import pyvista
    from typing_extensions import Self, TypeVar

    Dimension = TypeVar("Dimension", bound=int, default=int, covariant=True)
else:
    from typing import TypeVar

    pyvista = lazy_module("pyvista", "objects of PyVista")
    Dimension = TypeVar("Dimension", bound=int, covariant=True)


@dataclass(frozen=True, eq=False)
class Grid(Displayed, Frozen, FieldDomain, Generic[Dimension]):
    """Nodes at ``origin + index * spacing``, in any number of dimensions.

    Parameters
    ----------
    origin : (d,) float
        Position of node ``(0, …, 0)``.
    spacing : (d,) float, or one float for all axes
        Distance between neighbouring nodes along each axis, in the units of the shape.
    shape : (d,) int
        Number of nodes along each axis. Arrays on the grid are indexed ``[i, j, k]`` ↔ x, y, z.

    Raises
    ------
    GeometryError
        If the spacing is not positive and finite, or an axis has fewer than two nodes.

    See Also
    --------
    Field : Values on a domain.
    signed_distance : Distance on a grid, on tets or along a surface.

    Examples
    --------
    >>> grid = Grid(origin=(0, 0, 0), spacing=0.5, shape=(3, 4, 5))
    >>> grid.n_nodes
    60
    >>> grid.upper
    array([1. , 1.5, 2. ])
    """

    origin: Floats
    spacing: Floats
    shape: tuple[int, ...]

    @overload
    def __init__(
        self: Grid[Literal[3]], origin: ArrayLike, spacing: ArrayLike, shape: tuple[int, int, int]
    ) -> None: ...
    @overload
    def __init__(self: Grid[Literal[2]], origin: ArrayLike, spacing: ArrayLike, shape: tuple[int, int]) -> None: ...
    @overload
    def __init__(self: Grid[int], origin: ArrayLike, spacing: ArrayLike, shape: ArrayLike) -> None: ...
    def __init__(self, origin: ArrayLike, spacing: ArrayLike, shape: ArrayLike) -> None:
        corner = np.atleast_1d(numbers(origin, "origin"))
        counts = np.atleast_1d(whole_numbers(shape, "shape"))
        if corner.ndim != 1 or not len(corner) or not np.isfinite(corner).all():
            raise GeometryError(f"grid origin must be a finite vector, not {corner.tolist()}", element="origin")
        if counts.shape != corner.shape:
            raise GeometryError(f"grid shape must be {len(corner)} integers, not {counts.tolist()}", element="shape")
        if (counts < 2).any():
            raise GeometryError(
                f"a grid needs at least 2 nodes along every axis, not {counts.tolist()}", element="shape"
            )
        steps = positive_steps(spacing, len(corner))
        last = corner + steps * (counts.astype(np.float64) - 1)
        refuse_extreme(np.minimum(corner, last), last, "nodes")
        refuse_lost_spacing(steps, corner, last)
        nodes = tuple(int(n) for n in counts)
        vars(self).update(origin=frozen(corner), spacing=steps, shape=nodes)

    @classmethod
    def around(
        cls: type[Grid[int]],
        bounds: ArrayLike | Shape | Polyline | ForeignShape | Sequence[Shape | Polyline | ForeignShape],
        resolution: int = RESOLUTION,
        padding: float | None = None,
        spacing: ArrayLike | None = None,
    ) -> Grid[int]:
        """Make a grid around a shape, several shapes or a box, with padding on every side.

        Parameters
        ----------
        bounds : shape, sequence of shapes, or (2, d) float
            A shape or several, or the lower and upper corner of a box.
        resolution : int
            Number of nodes along the longest side, 128 by default; all axes have the same spacing.
        padding : float, optional
            Least distance between the box and the boundary of the grid, in the units of the shape; a fifth of the
            longest side by default.
        spacing : (d,) float or float, optional
            Distance between nodes, in these units. If it is given, the resolution is ignored.

        Returns
        -------
        Grid
            A grid centred on the box.

        Raises
        ------
        GeometryError
            If the box is a single point and there is no padding, or resolution, padding or spacing are out of range.

        See Also
        --------
        signed_distance : Distance, by default on such a grid.

        Examples
        --------
        >>> Grid.around([[0, 0, 0], [1, 2, 4]], resolution=7, padding=1.0)
        Grid(origin=[-1, -1, -1], spacing=1, shape=(4, 5, 7))
        >>> from signedheat.samples import sphere
        >>> Grid.around(sphere(3), spacing=0.5).shape
        (7, 7, 7)
        """
        box = coordinates(_box(bounds), "bounds")
        if len(box) != 2 or not (box[0] <= box[1]).all():
            raise GeometryError(f"bounds must be a lower and an upper corner, not {box.tolist()}", element="bounds")
        lower, upper = box
        longest = float((upper - lower).max())
        if padding is not None:
            padding = finite_number(padding, "padding", 0, GeometryError)
        room = room_around(box) if padding is None else float(padding)
        if not longest + 2 * room > 0:
            raise GeometryError("the shape is a single point", remedy="give a padding or a grid")
        if spacing is None:
            spacing = (longest + 2 * room) / (whole_number(resolution, "resolution", 2) - 1)
        steps = positive_steps(spacing, len(lower))
        cells = np.maximum(1, np.ceil((upper - lower + 2 * room) / steps - 1e-9))
        if not (cells < 2**62).all():
            raise MemoryLimitError(
                f"a spacing of {steps.min():.3g} makes {cells.max():.3g} cells along one axis",
                remedy="choose a larger spacing",
            )
        return cls(0.5 * (lower + upper) - 0.5 * cells * steps, steps, cells.astype(np.int64) + 1)

    @property
    def dimension(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return math.prod(self.shape)

    @property
    def upper(self) -> Floats:
        """(d,) position of the last node."""
        return self.origin + self.spacing * (np.array(self.shape) - 1)

    @cached_property
    def axes(self) -> tuple[Floats, ...]:
        """Tuple of the coordinates of the nodes along each axis, one array (n,) for the n nodes of an axis."""
        return tuple(
            frozen(o + s * np.arange(n)) for o, s, n in zip(self.origin, self.spacing, self.shape, strict=True)
        )

    @property
    def points(self) -> Floats:
        """(..., d) positions of the nodes, in the shape of the grid; not cached, since they take much memory."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1)

    def contains(self, points: ArrayLike) -> Bools:
        """Return whether points lie within the bounding box of the nodes.

        Parameters
        ----------
        points : (..., d) float
            Positions, in the units of the grid.

        Returns
        -------
        (...) bool
            True on the boundary, too.

        See Also
        --------
        Grid.around : A grid that contains a shape.

        Examples
        --------
        >>> Grid((0, 0), 0.5, (3, 3)).contains([[1.0, 0.2], [1.1, 0.2]])
        array([ True, False])
        """
        queries, shape = query_points(points, self.dimension)
        return shaped(np.all((queries >= self.origin) & (queries <= self.upper), axis=1), shape)

    def to_pyvista(self) -> pyvista.ImageData:
        """Convert to an image of PyVista.

        Returns
        -------
        pyvista.ImageData
            A grid in the plane has z = 0.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.
        GeometryError
            If the grid has other than two or three axes.

        See Also
        --------
        Field.to_pyvista : A grid with the values of a field.

        Examples
        --------
        >>> Grid((0, 0, 0), 0.5, (3, 3, 2)).to_pyvista().dimensions
        (3, 3, 2)
        """
        if self.dimension not in (2, 3):
            raise GeometryError(
                f"PyVista has grids with 2 or 3 axes, and this one has {self.dimension}",
                remedy="take two or three of its axes",
                element="grid",
            )
        flat = (0,) * (3 - self.dimension)
        return pyvista.ImageData(
            dimensions=(*self.shape, *(1 for _ in flat)), spacing=(*self.spacing, *flat), origin=(*self.origin, *flat)
        )

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """A field has one value for each node."""
        return self.shape

    def _interpolant(self, values: Floats, beyond: Exact | None) -> GridInterpolant:
        """Return the function that interpolates values at the nodes; no other field lies beyond a whole grid."""
        return GridInterpolant(self, values)

    def _clipped(self, points: ArrayLike) -> Floats:
        """(..., d) the nearest point of the grid's box for each of (..., d) points."""
        queries, shape = query_points(points, self.dimension)
        return np.clip(queries, self.origin, self.upper).reshape(*shape, self.dimension)

    def _level_set(self, values: Floats, level: float, exact: Exact | None) -> TriangleMesh | list[Polyline]:
        """Extract a level set of values at nodes, as a closed mesh in space, or as lines in the plane."""
        if self.dimension == 2:
            lines = level_lines(values, self.spacing, level)
            return [Polyline(self._placed(points, values, level, exact), closed) for points, closed in lines]
        points, faces = closed_surface(values, self.spacing, level)
        vertices = self._placed(points, values, level, exact)
        if exact is not None:  # its level has creases, unlike what is interpolated
            faces = flipped_along_creases(vertices, faces)
        return TriangleMesh(vertices, faces)

    def _placed(self, points: Floats, values: NodeValues, level: float, exact: Exact | None) -> Floats:
        """(n, d) positions of points of a level set, given in cells; with the exact function, moved onto its level."""
        if exact is None:
            return self.origin + points * self.spacing
        return on_level(exact, points, values, self.origin, self.spacing, level)

    def _values_at_walls(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values at the nodes on the walls of the box."""
        return values_at_walls(values)

    def _shared(self, other: FieldDomain) -> Self:
        """Return this grid if the other one has the same nodes up to rounding; raise otherwise."""
        if not isinstance(other, Grid):
            return super()._shared(other)
        if type(self) is not type(other):
            raise other_nodes()
        if self.shape != other.shape or not np.allclose(self.spacing, other.spacing, rtol=1e-12, atol=0):
            raise different(self, other)
        if not (np.abs(self.origin - other.origin) <= 1e-9 * self.spacing).all():  # apart by more than rounding
            raise different(self, other)
        return self

    def __repr__(self) -> str:
        step = self.spacing[0] if np.ptp(self.spacing) <= 1e-12 * self.spacing[0] else self.spacing
        origin = place(self.origin, [self.origin, self.upper])[1:-1]
        return f"Grid(origin=[{origin}], spacing={short(step)}, shape={self.shape})"


def other_nodes() -> GeometryError:
    """Return the error for fields of which one has values at nodes where the other has none."""
    return GeometryError(
        "fields in bands have values at different nodes",
        remedy="compute both on one whole grid, or expand() them",
        element="second field",
    )


@dataclass(frozen=True, eq=False)
class GridInterpolant:
    """Multilinear interpolation between nodes; outside the grid, linear extrapolation from its nearest point."""

    grid: Grid
    values: NDArray[Any]  # at the nodes, NaN where there are none

    def __call__(self, points: ArrayLike) -> Floats:
        """(...) values at (..., d) points, from those nodes around them that have a value; NaN if none has one."""
        queries, shape = query_points(points, self.grid.dimension)
        (values,) = in_chunks(self._values_at, queries)
        return shaped(values, shape)

    def gradient(self, points: ArrayLike) -> Floats:
        """(..., d) central differences at (..., d) points; outside the grid, those at its nearest point."""
        queries, shape = query_points(points, self.grid.dimension)
        (slopes,) = in_chunks(lambda chunk: (self._slopes(self._into_box(chunk)),), queries)
        return shaped(slopes, shape)

    def _into_box(self, points: Floats) -> Floats:
        """(n, d) nearest points of the grid's box."""
        return np.clip(points, self.grid.origin, self.grid.upper)

    def _values_at(self, points: Floats) -> tuple[Floats]:
        """(n,) values at (n, d) points, within the box and outside of it."""
        inside = self._into_box(points)
        values = self._between(inside)
        away = points - inside
        outside = np.flatnonzero(away.any(axis=-1))
        if len(outside):
            slopes = self._slopes(inside[outside])
            values[outside] += np.einsum("ij,ij->i", slopes, away[outside])
        return (values,)

    def _between(self, points: Floats) -> Floats:
        """(n,) values at (n, d) points within the box."""
        index = ((points - self.grid.origin) / self.grid.spacing).T
        if self._defined is None:
            return scipy.ndimage.map_coordinates(self.values, index, order=1, mode="nearest")
        filled, defined = self._defined
        sums = scipy.ndimage.map_coordinates(filled, index, order=1, mode="nearest")
        weights = scipy.ndimage.map_coordinates(defined, index, order=1, mode="nearest")
        return np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), np.nan)

    @cached_property
    def _defined(self) -> tuple[Floats, Floats] | None:
        """The values with 0 in place of NaN, and 1 at nodes with a value, 0 at others; None if all nodes have one."""
        defined = ~np.isnan(self.values)
        return None if defined.all() else (np.where(defined, self.values, 0.0), defined.astype(np.float64))

    def _slopes(self, points: Floats) -> Floats:
        """(n, d) central differences of the interpolant, which equal those at the nodes, interpolated."""
        slopes = np.empty_like(points)
        for axis, step in enumerate(self.grid.spacing):
            ahead, behind = points.copy(), points.copy()
            ahead[:, axis] = np.minimum(ahead[:, axis] + step, self.grid.upper[axis])
            behind[:, axis] = np.maximum(behind[:, axis] - step, self.grid.origin[axis])
            rise = self._between(ahead) - self._between(behind)
            slopes[:, axis] = rise / (ahead[:, axis] - behind[:, axis])
        return slopes


def _box(bounds: Any) -> Any:
    """Return the box around a shape or several, and anything else as it is."""
    boxes = [getattr(shape, "bounds", None) for shape in as_shapes(bounds)]
    if not boxes or any(box is None for box in boxes):
        return bounds
    corners = np.stack([np.asarray(box, dtype=float) for box in boxes])
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
