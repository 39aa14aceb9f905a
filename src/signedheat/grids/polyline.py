"""Polylines in the plane: sources on two-dimensional grids."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen
from ..errors import GeometryError, counted
from ..packages import lazy_module
from ..shapes.exchange import Displayed
from ..validation import boolean, coordinates, flag, numbers, positive_steps
from .marching import level_lines

if TYPE_CHECKING:
    import pyvista
else:
    pyvista = lazy_module("pyvista", "objects of PyVista")


@dataclass(frozen=True, eq=False)
class Polyline(Displayed, Frozen):
    """Points in the plane, joined in order by straight segments.

    `signed_distance` is negative in regions that polylines bound, whichever way they run, and positive to the left of
    those that bound nothing. With ``as_oriented=True``, and by `SignedHeatSolver`, it is positive to the left of all
    polylines: inside a closed polyline that runs clockwise it is negative.

    Parameters
    ----------
    points : (n, 2) float
        Positions. Points may coincide and segments may cross one another.
    closed : bool
        Whether a last segment joins the last point to the first. A last point equal to the first is dropped.

    Raises
    ------
    GeometryError
        If a coordinate is NaN or infinite, or there are fewer than two distinct points.

    See Also
    --------
    io.read_polylines : Read lines in the plane.
    signed_distance : Distance on a grid, on tets or along a surface.
    Curve : A curve on a surface.

    Examples
    --------
    >>> square = Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    >>> square.length, square.signed_area
    (4.0, -1.0)
    """

    points: Floats
    closed: bool

    def __init__(self, points: ArrayLike, closed: bool = False) -> None:
        positions, closed = coordinates(points, "points", 2), flag(closed, "closed")
        if closed and len(positions) > 2 and (positions[0] == positions[-1]).all():
            positions = coordinates(positions[:-1], "points", 2)
        if len(positions) < 2:
            raise GeometryError(f"a polyline needs at least 2 points, not {len(positions)}", element="points")
        if (positions == positions[0]).all():
            raise GeometryError(
                f"the polyline has no length: its {counted(len(positions), 'point')} are the same", element="points"
            )
        vars(self).update(points=positions, closed=closed)

    @classmethod
    def from_mask(cls, mask: ArrayLike, origin: ArrayLike = (0.0, 0.0), spacing: ArrayLike = 1.0) -> list[Polyline]:
        """Trace the boundary of the True region of a boolean image, so that distance is negative inside.

        Lines pass halfway between pixels with different values. For an image whose rows run downwards, pass
        ``image[::-1].T``, which is in the order [x, y].

        Parameters
        ----------
        mask : (nx, ny) bool
            ``mask[i, j]`` is at ``origin + (i, j) * spacing``, as on a `Grid`; outside the image it counts as False.
        origin, spacing : (2,) float
            Position of the first pixel, and distance between pixels along each axis, in units of length; 0 and 1 by
            default.

        Returns
        -------
        list of Polyline
            Closed lines, with the region to their right.

        Raises
        ------
        GeometryError
            If the mask is not a boolean image, or nothing in it is True.

        See Also
        --------
        redistance : Distance to the boundary of a mask.
        DigitalSurface : Voxels.

        Examples
        --------
        >>> [dot] = Polyline.from_mask([[False, False], [False, True]])
        >>> dot.points.tolist(), dot.closed
        ([[1.0, 1.5], [1.5, 1.0], [1.0, 0.5], [0.5, 1.0]], True)
        """
        inside = boolean(mask, "mask")
        if inside.ndim != 2 or not inside.any():
            raise GeometryError(
                f"a mask is a boolean image with something True in it, not {inside.dtype} of shape {inside.shape}",
                remedy="compare the image with a threshold first",
            )
        steps = positive_steps(spacing, 2)
        start = coordinates(np.atleast_2d(numbers(origin, "origin")), "origin", 2)[0]
        padded = np.pad(inside, 1)
        lines = level_lines(np.float64(0.5) - padded.astype(np.float64), steps, 0.0)
        return [cls(start + (points - 1) * steps, closed) for points, closed in lines]

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def bounds(self) -> Floats:
        """(2, 2) lower and upper corner of the box around the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def segments(self) -> Floats:
        """(m, 2, 2) start and end of every segment."""
        ends = np.roll(self.points, -1, axis=0)
        count = self.n_points if self.closed else self.n_points - 1
        return np.stack([self.points[:count], ends[:count]], axis=1)

    @cached_property
    def segment_lengths(self) -> Floats:
        """(m,) lengths, in the units of the points."""
        return np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1)

    @property
    def length(self) -> float:
        """Sum of the lengths of all segments, in the units of the points."""
        return float(self.segment_lengths.sum())

    @property
    def signed_area(self) -> float:
        """Area in square units, positive if counter-clockwise; an open polyline is closed by a straight line."""
        x, y = np.moveaxis(self.segments - self.points[0], -1, 0)
        return float(0.5 * (x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum())

    def reversed(self) -> Polyline:
        """Return the polyline in the opposite direction, which exchanges left and right.

        Returns
        -------
        Polyline
            The same points, from last to first.

        See Also
        --------
        orient : Flip curves so that they agree.

        Examples
        --------
        >>> Polyline([[0, 0], [1, 0]]).reversed().points.tolist()
        [[1.0, 0.0], [0.0, 0.0]]
        """
        return Polyline(self.points[::-1], self.closed)

    def to_pyvista(self) -> pyvista.PolyData:
        points = np.column_stack([self.points, np.zeros(self.n_points)])
        return pyvista.lines_from_points(points, close=self.closed)

    def __repr__(self) -> str:
        return f"Polyline({counted(self.n_points, 'point')}, {'closed' if self.closed else 'open'})"
