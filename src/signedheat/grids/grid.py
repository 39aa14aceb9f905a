"""Regular grids of any dimension."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Frozen, short
from ..errors import GeometryError, MemoryLimitError
from ..exchange import Displayed
from ..foreign import ForeignShape, Shape, as_shapes
from ..packages import lazy_module
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
from .polyline import Polyline

RESOLUTION = 128
"""Default number of nodes along the longest side of a grid."""
if TYPE_CHECKING:
    import pyvista
    from typing_extensions import TypeVar

    Dimension = TypeVar("Dimension", bound=int, default=int, covariant=True)
else:
    from typing import TypeVar

    pyvista = lazy_module("pyvista", "objects of PyVista")
    Dimension = TypeVar("Dimension", bound=int, covariant=True)


@dataclass(frozen=True, eq=False)
class Grid(Displayed, Frozen, Generic[Dimension]):
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
    GridField : Values on a grid.
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
        """Make a grid centred on a shape, on several or on a box, with padding on every side.

        Parameters
        ----------
        bounds : shape, sequence of shapes, or (2, d) float
            A shape or several, or the lower and upper corner of a box.
        resolution : int
            Number of nodes along the longest side; all axes have the same spacing.
        padding : float, optional
            Least distance between the box and the boundary of the grid; a fifth of the longest side by default.
        spacing : (d,) float or float, optional
            Distance between nodes; if given, the resolution is ignored.

        Returns
        -------
        Grid
            With nodes on every side of the box.

        Raises
        ------
        GeometryError
            If the box has no extent and there is no padding, or resolution, padding or spacing are out of range.

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
        """Coordinates of the nodes along each axis."""
        return tuple(
            frozen(o + s * np.arange(n)) for o, s, n in zip(self.origin, self.spacing, self.shape, strict=True)
        )

    @property
    def points(self) -> Floats:
        """Positions of the nodes, coordinates last; not cached, since they take d times the memory of a field."""
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

        Examples
        --------
        >>> Grid((0, 0), 0.5, (3, 3)).contains([[1.0, 0.2], [1.1, 0.2]])
        array([ True, False])
        """
        places, shape = query_points(points, self.dimension)
        return shaped(np.all((places >= self.origin) & (places <= self.upper), axis=1), shape)

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

    def __repr__(self) -> str:
        step = self.spacing[0] if np.ptp(self.spacing) <= 1e-12 * self.spacing[0] else self.spacing
        return f"Grid(origin={short(self.origin)}, spacing={short(step)}, shape={self.shape})"


def room_around(bounds: ArrayLike, reach: float = 0.0, share: float = 0.2) -> float:
    """Return the padding of a box: a share of its longest side for its completion, and room for offsets to `reach`."""
    lower, upper = np.asarray(bounds, dtype=np.float64)
    return share * float((upper - lower).max()) + 1.05 * reach


def _box(bounds: Any) -> Any:
    """Return the box around a shape or several, and anything else as it is."""
    boxes = [getattr(shape, "bounds", None) for shape in as_shapes(bounds)]
    if not boxes or any(box is None for box in boxes):
        return bounds
    corners = np.stack([np.asarray(box, dtype=float) for box in boxes])
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
