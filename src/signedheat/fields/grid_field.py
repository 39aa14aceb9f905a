"""Distance on a grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Generic, Literal, overload

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import Diagnostics
from ..domains.display import Displayed, to_pyvista
from ..domains.grid import Dimension, Grid
from ..domains.polyline import Polyline
from ..domains.triangle_mesh import TriangleMesh
from ..domains.validation import contiguous, finite_number
from ..errors import GeometryError, OutsideError, UnsupportedTypeError
from ..frozen import Frozen
from ..geometry.edge_flips import flipped_along_creases
from ..geometry.marching import closed_surface, level_lines
from ..operators.grid.exact_surface import ExactSurface
from ..parallel import in_chunks
from .booleans import Combinable
from .closest_points import ClosestPoints, closest_points
from .files import save_field

if TYPE_CHECKING:
    import pyvista


@dataclass(frozen=True, eq=False)
class GridField(Displayed, Combinable, Frozen, Generic[Dimension]):
    """Signed distance at the nodes of a grid.

    Parameters
    ----------
    grid : Grid
        Where the nodes are.
    values : (*grid.shape) float
        φ at the nodes, in the units of the grid: ``values[i, j, k]`` at ``grid.points[i, j, k]``. Positive on the
        side that the source normals point to, so negative inside a shape with outward normals. NaN at solid nodes, and
        on parts of the grid that solid nodes separate from every source.
    diagnostics : Diagnostics
        Timings, diffusion time, and notes on the computation.
    confidence : (*grid.shape) float, optional
        From 0 to 1: how far the surface that is nearest to each node was there (1), or had to be completed (less, the
        farther from any face), where the field was sharpened to a shape.
    surface : ExactSurface, optional
        What the values are distances to, where that is known exactly: contours then lie on it exactly.

    Raises
    ------
    GeometryError
        If the values do not have the shape of the grid.

    Examples
    --------
    >>> grid = Grid(origin=(-1, -1, -1), spacing=0.1, shape=(21, 21, 21))
    >>> phi = GridField(grid, np.linalg.norm(grid.points, axis=-1) - 0.5)
    >>> phi([[0.7, 0.0, 0.0]]).round(3)
    array([0.2])
    >>> phi.gradient([[0.7, 0.0, 0.0]]).round(2)
    array([[1., 0., 0.]])
    >>> phi.contour(0.0).n_faces > 0
    True
    """

    grid: Grid[Dimension]
    values: NDArray[np.float64]
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    confidence: NDArray[np.float32] | None = field(default=None, repr=False)
    surface: ExactSurface | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.grid, Grid):
            raise UnsupportedTypeError(f"{self.grid!r:.80} is not a Grid", element="grid")
        values = contiguous(self.values, "values")
        if values.shape != self.grid.shape:
            raise GeometryError(
                f"values have shape {values.shape}, but the grid has {self.grid.shape} nodes", element="values"
            )
        object.__setattr__(self, "values", values)
        if self.confidence is not None:
            confidence = np.asarray(self.confidence, dtype=np.float32)
            if confidence.shape != values.shape:
                raise GeometryError(
                    f"confidence has shape {confidence.shape}, and the values {values.shape}", element="confidence"
                )
            object.__setattr__(self, "confidence", confidence)

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """φ at points in space, by multilinear interpolation between nodes.

        Outside the grid φ is extrapolated linearly from the nearest point of the bounding box of the grid, along the
        gradient there. This is continuous, and for a convex shape inside the box a lower bound of the distance.

        Parameters
        ----------
        points : (n, d) or (d,) float
            Positions, in the units of the grid.

        Returns
        -------
        (n,) float, or one float
            Signed distances, interpolated from the nodes around that have a value; NaN where none has one.
        """
        points = self._checked(points)
        (values,) = in_chunks(self._values_at, points.reshape(-1, self.grid.dimension))
        return values.reshape(points.shape[:-1]) if points.ndim > 1 else values[0]

    def gradient(self, points: ArrayLike) -> NDArray[np.float64]:
        """∇φ at points in space: central differences of the nodes, interpolated.

        Outside the grid it is the gradient at the nearest point of the bounding box of the grid.

        Parameters
        ----------
        points : (n, d) float
            Positions, in the units of the grid.

        Returns
        -------
        (n, d) float
            Gradients; of length about 1, since φ is a distance.
        """
        points = np.atleast_2d(self._checked(points))
        (slopes,) = in_chunks(lambda chunk: (self._slopes(self._into_box(chunk)),), points)
        return slopes

    def closest_points(self, points: ArrayLike) -> ClosestPoints:
        """The nearest place of the surface itself for points in space, and exact distances to it.

        Unlike those of a call, distances are not interpolated between nodes. The surface is that which the field was
        sharpened to: the faces where they are there, φ's zero set where they are missing. Takes time O(n log m) for n
        points and m faces, on all threads, and little memory beside that of the result; what it needs to know of the
        surface is prepared at the first call.

        Parameters
        ----------
        points : (n, 3) float
            Positions, in the units of the grid; they may lie outside of it.

        Returns
        -------
        ClosestPoints
            Places, signed distances, gradients, and whether the place is one that had to be completed.

        Raises
        ------
        SourceError
            If the field does not know its surface: it was read from a file, or not sharpened to a shape.
        GeometryError
            If a point is not finite.

        Examples
        --------
        >>> from signedheat import TriangleMesh, solid_distance
        >>> faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
        >>> field = solid_distance(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces), resolution=16)
        >>> closest = field.closest_points([[0.3, 0.2, -0.5]])
        >>> closest.points.round(6).tolist(), closest.distances.tolist(), closest.gradients.tolist()
        ([[0.3, 0.2, 0.0]], [0.5], [[0.0, 0.0, -1.0]])
        """
        return closest_points(self.surface, np.atleast_2d(self._checked(points)), self)

    @property
    def domain(self) -> Grid[Dimension]:
        """The grid."""
        return self.grid

    @overload
    def contour(self: GridField[Literal[3]], level: float = 0.0) -> TriangleMesh: ...
    @overload
    def contour(self: GridField[Literal[2]], level: float = 0.0) -> list[Polyline]: ...
    @overload
    def contour(self, level: float = 0.0) -> TriangleMesh | list[Polyline]: ...
    def contour(self, level: float = 0.0) -> TriangleMesh | list[Polyline]:
        """The level set φ = level.

        In space, a surface: closed, manifold, with normals pointing to greater φ. Where it leaves the grid, as the
        completion of an open shape may do, it is closed along the box of the grid (1 % of a cell outside); where it
        meets solid nodes, or others without a value, it is closed along the last nodes before them.

        In the plane, polylines, one for each connected component, open or closed, with greater φ to their left. Open
        ones end at the box of the grid, and at nodes without a value.

        Parameters
        ----------
        level : float
            The level, in the units of the grid.

        Returns
        -------
        TriangleMesh, or list of Polyline
            The surface in space, or the polylines in the plane.

        Raises
        ------
        OutsideError
            If φ does not take the level anywhere on the grid.
        GeometryError
            If the grid has neither 2 nor 3 dimensions, or values are infinite.
        """
        grid, level = self.grid, finite_number(level, "level")
        if grid.dimension == 2:
            lines = level_lines(self.values, grid.origin, grid.spacing, level)
            return [Polyline(points, closed) for points, closed in lines]
        surface = self.surface
        refine = None if surface is None else lambda points: surface.on_level(points, self.values, level)
        vertices, faces = closed_surface(self.values, grid.origin, grid.spacing, level, refine)
        return TriangleMesh(vertices, faces if surface is None else flipped_along_creases(vertices, faces))

    @overload
    def offset(self: GridField[Literal[3]], distance: float) -> TriangleMesh: ...
    @overload
    def offset(self: GridField[Literal[2]], distance: float) -> list[Polyline]: ...
    @overload
    def offset(self, distance: float) -> TriangleMesh | list[Polyline]: ...
    def offset(self, distance: float) -> TriangleMesh | list[Polyline]:
        """The offset of the shape at a signed distance: `contour`, but refused if the grid is too small for it.

        Parameters
        ----------
        distance : float
            Signed distance, positive outward, in the units of the grid.

        Returns
        -------
        TriangleMesh, or list of Polyline
            As `contour`.

        Raises
        ------
        OutsideError
            If φ does not take the value on the grid, or the offset leaves the grid although the shape itself does not:
            the grid then needs more padding.
        """
        self.refuse_beyond_walls(finite_number(distance, "distance"))
        return self.contour(distance)

    def refuse_beyond_walls(self, distance: float) -> None:
        """Raise `OutsideError` if what lies at a distance leaves the grid although the shape itself does not."""
        walls = self._wall_range()
        bounded = walls[0] > 0 or walls[1] < 0
        if bounded and walls[0] < distance < walls[1]:
            limit = walls[0] if walls[0] > 0 else walls[1]
            raise OutsideError(
                f"what lies at distance {distance:g} leaves the grid, which holds distances up to {limit:g}",
                remedy=f"use a padding of more than {abs(distance):g}, or a larger diffusion where wide gaps stay open",
            )

    def with_values(self, values: NDArray[np.float64]) -> GridField[Dimension]:
        """Other values on the same grid, without the diagnostics, confidence and surface of these."""
        return GridField(self.grid, values)

    def to_pyvista(self) -> pyvista.ImageData:
        """As a `pyvista.ImageData` with point data ``signed_distance``, and ``confidence`` where there is one.

        A field in the plane has z = 0.
        """
        made: pyvista.ImageData = to_pyvista(self)
        return made

    def confidence_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """How far the surface that is nearest was there (1), or had to be completed (less), interpolated.

        Parameters
        ----------
        points : (n, d) float
            Positions, such as the vertices of an offset.

        Returns
        -------
        (n,) float
            From 0 to 1; at points outside the grid, that of the nearest point of its box. 1 if nothing is known of it.
        """
        inside = self._into_box(np.atleast_2d(self._checked(points)))
        if self.confidence is None:
            return np.ones(len(inside), dtype=np.float32)
        index = ((inside - self.grid.origin) / self.grid.spacing).T
        found = scipy.ndimage.map_coordinates(self.confidence, index, np.float32, order=1, mode="nearest")
        clipped: NDArray[np.float32] = np.clip(found, 0, 1)
        return clipped

    @property
    def surface_confidence(self) -> float | None:
        """Mean confidence at the nodes within a cell of the zero set, one number for the whole field; or None."""
        near = np.abs(self.values) < float(self.grid.spacing.max())
        if self.confidence is None or not near.any():
            return None
        return float(self.confidence[near].mean(dtype=np.float64))

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension; `signedheat.load_field` reads it."""
        save_field(self, path)

    def _wall_range(self) -> tuple[float, float]:
        """Least and greatest φ on the walls of the box."""
        values = np.concatenate([self._walls(axis).ravel() for axis in range(self.grid.dimension)])
        return float(np.fmin.reduce(values)), float(np.fmax.reduce(values))

    def _walls(self, axis: int) -> NDArray[np.float64]:
        return self.values.take([0, -1], axis=axis)

    def _checked(self, points: ArrayLike) -> NDArray[np.float64]:
        places = contiguous(points, "points")
        if places.shape[-1:] != (self.grid.dimension,) or not np.isfinite(places).all():
            raise GeometryError(f"points must be finite, with {self.grid.dimension} coordinates each", element="points")
        return places

    def _into_box(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.clip(points, self.grid.origin, self.grid.upper)

    def _values_at(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64]]:
        """φ at (n, d) points, within the box and outside of it."""
        inside = self._into_box(points)
        values = self._interpolate(inside)
        away = points - inside
        outside = np.flatnonzero(away.any(axis=-1))
        if len(outside):
            slopes = self._slopes(inside[outside])
            values[outside] += np.einsum("ij,ij->i", slopes, away[outside])
        return (values,)

    def _interpolate(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        index = ((points - self.grid.origin) / self.grid.spacing).T
        if self._known is None:
            result: NDArray[np.float64] = scipy.ndimage.map_coordinates(self.values, index, order=1, mode="nearest")
            return result
        filled, known = self._known
        sums = scipy.ndimage.map_coordinates(filled, index, order=1, mode="nearest")
        weights = scipy.ndimage.map_coordinates(known, index, order=1, mode="nearest")
        return np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), np.nan)

    @cached_property
    def _known(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Values with 0 where there is none, and 1 where there is one, else 0; or None if all nodes have one."""
        known = ~np.isnan(self.values)
        return None if known.all() else (np.where(known, self.values, 0.0), known.astype(np.float64))

    def _slopes(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Central differences of the interpolant, which are those at the nodes, interpolated."""
        slopes = np.empty_like(points)
        for axis, step in enumerate(self.grid.spacing):
            ahead, behind = points.copy(), points.copy()
            ahead[:, axis] = np.minimum(ahead[:, axis] + step, self.grid.upper[axis])
            behind[:, axis] = np.maximum(behind[:, axis] - step, self.grid.origin[axis])
            rise = self._interpolate(ahead) - self._interpolate(behind)
            slopes[:, axis] = rise / (ahead[:, axis] - behind[:, axis])
        return slopes

    def __repr__(self) -> str:
        low, high = (float(f.reduce(self.values, axis=None)) for f in (np.fmin, np.fmax))
        return f"GridField({self.grid!r}, values from {low:.4g} to {high:.4g})"
