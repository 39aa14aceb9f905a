"""Distance on a grid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Frozen
from ..calls import public_call
from ..diagnostics import Diagnostics
from ..errors import GeometryError, OutsideError, SourceError, UnsupportedTypeError
from ..exchange import Displayed, with_values
from ..field_arithmetic import Combinable, HasFields, Rule
from ..field_levels import on_level, refuse_beyond_walls
from ..mesh.triangles import flipped_along_creases
from ..packages import lazy_module
from ..parallel import in_chunks
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import array_of, contiguous, finite_number, instance, query_points, shaped
from ..words import counted
from .blocks import BLOCK, Blocks, BlockValues
from .grid import Dimension, Grid
from .marching import Part, closed_surface, contour_parts, level_lines, values_at_walls
from .polyline import Polyline
from .solid_queries import Closest, SolidQueries, scaled

ply: Any = lazy_module("signedheat.io.ply", "files")

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
        side that the source normals point to, so negative inside a shape with outward normals.
    diagnostics : Diagnostics
        Timings, diffusion time, and notes on the computation.
    confidence : (*grid.shape) float, optional
        From 0 to 1, for fields sharpened to a shape: 1 where the surface nearest to a node is given, less where it had
        to be completed, the farther from any face.
    solid : Solid, optional
        What the values are distances to: calls are exact then, and contours lie on their level exactly. ``.npz`` files,
        negation and multiplication keep it; ``repr`` says whether it is there.
    blocks : Blocks, optional
        The blocks of 8³ nodes in a band around the surface, if only these have values; by default all nodes do. Values
        and confidence are then (n, 8, 8, 8), in single and half precision, NaN at nodes of blocks beyond the grid.
    coarse : GridField, optional
        φ on the whole box, for points beyond the band; every field in a band has one.
    width : float
        Half width of the band: all nodes up to this distance from the surface have values.

    Raises
    ------
    GeometryError
        If the values do not have the shape of the grid, or that of the blocks.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    read_field : Read a field.
    Grid : A regular grid in space or in the plane.
    redistance : Distance from an array of values or signs.

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
    values: Floats
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    confidence: NDArray[np.float32] | None = field(default=None, repr=False)
    solid: SolidQueries | None = field(default=None, repr=False)
    blocks: Blocks | None = field(default=None, repr=False)
    coarse: GridField[Dimension] | None = field(default=None, repr=False)
    width: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.grid, Grid):
            raise UnsupportedTypeError(f"{self.grid!r:.80} is not a Grid", element="grid")
        instance(self.diagnostics, Diagnostics, "diagnostics")
        instance(self.blocks, Blocks, "blocks")
        instance(self.coarse, GridField, "coarse")
        if self.blocks is not None:
            self._check_blocks(self.blocks)
            return
        values = contiguous(self.values, "values")
        if values.shape != self.grid.shape:
            raise GeometryError(
                f"values have shape {values.shape}, but the grid has {self.grid.shape} nodes", element="values"
            )
        object.__setattr__(self, "values", values)
        if self.confidence is not None:
            confidence = array_of(self.confidence, "confidence")
            if confidence.dtype.kind not in "biuf":
                raise GeometryError(f"confidence is an array of {confidence.dtype}", element="confidence")
            confidence = confidence.astype(np.float32, copy=False)
            if confidence.shape != values.shape:
                raise GeometryError(
                    f"confidence has shape {confidence.shape}, and the values {values.shape}", element="confidence"
                )
            object.__setattr__(self, "confidence", confidence)

    def _check_blocks(self, blocks: Blocks) -> None:
        if self.values.shape != (len(blocks), BLOCK, BLOCK, BLOCK) or blocks.shape != self.grid.shape:
            raise GeometryError(
                f"{len(blocks)} blocks of a grid of {blocks.shape} nodes have values of shape {self.values.shape} on "
                f"one of {self.grid.shape}",
                element="values",
            )
        if self.coarse is None:
            raise GeometryError("a field in a band needs a coarse field for the nodes beyond it", element="coarse")

    def __call__(self, points: ArrayLike) -> Floats:
        """φ at points in space: exact where the field has its solid, else that of `interpolate`.

        Parameters
        ----------
        points : (..., d) float
            Positions, in the units of the grid.

        Returns
        -------
        (...) float
            Signed distances, in the shape of the points: one number for one point.
        """
        return self.interpolate(points) if self.solid is None else self.solid.distance(points)

    def interpolate(self, points: ArrayLike) -> Floats:
        """φ at points in space, by multilinear interpolation between nodes; beyond a band between the coarse ones.

        Outside the grid φ is extrapolated linearly from the nearest point of the bounding box of the grid, along the
        gradient there. This is continuous, and for a convex shape inside the box a lower bound of the distance.

        Parameters
        ----------
        points : (..., d) float
            Positions, in the units of the grid.

        Returns
        -------
        (...) float
            Signed distances, interpolated from the nodes around that have a value; NaN where none has one.

        Examples
        --------
        >>> line = GridField(Grid([0.0], 1.0, [3]), np.array([0.0, 1.0, 3.0]))
        >>> line.interpolate([[0.5], [2.5]])  # between nodes, and beyond the last one
        array([0.5, 4. ])
        """
        places, shape = query_points(points, self.grid.dimension)
        (values,) = in_chunks(self._values_at, places)
        return shaped(values, shape)

    def gradient(self, points: ArrayLike) -> Floats:
        """∇φ at points in space: exact where the field has its solid, else central differences, interpolated.

        Outside the grid these are the gradient at the nearest point of the bounding box of the grid.

        Parameters
        ----------
        points : (..., d) float
            Positions, in the units of the grid.

        Returns
        -------
        (..., d) float
            Gradients; of length about 1, since φ is a distance.

        Examples
        --------
        >>> line = GridField(Grid([0.0], 1.0, [3]), np.array([0.0, 1.0, 3.0]))
        >>> line.gradient([[0.0], [1.0]])  # one-sided at the end
        array([[1. ],
               [1.5]])
        """
        if self.solid is not None:
            return self.solid.closest(points).gradients
        places, shape = query_points(points, self.grid.dimension)
        (slopes,) = in_chunks(lambda chunk: (self._slopes(self._into_box(chunk)),), places)
        return shaped(slopes, shape)

    def closest(self, points: ArrayLike) -> Closest:
        """Find the nearest place of the solid's surface for points in space: `Solid.closest`.

        Parameters
        ----------
        points : (..., 3) float
            Positions, in the units of the grid; they may lie outside of it.

        Returns
        -------
        Closest
            Distances, places, faces and where in them, gradients, confidence.

        Raises
        ------
        SourceError
            If the field has no solid: it was computed otherwise, or read from a file without one.

        Examples
        --------
        >>> from signedheat import samples, signed_distance
        >>> phi = signed_distance(samples.sphere(2), resolution=16)
        >>> phi.closest([[0.0, 0.0, 3.0]]).points.round(3).tolist()
        [[0.0, 0.0, 1.0]]
        """
        if self.solid is None:
            raise SourceError(
                "the field holds no solid",
                remedy="take it from signed_distance or Solid.field; of files, only .npz keep it",
                element="field",
            )
        return self.solid.closest(points)

    @property
    def whole(self) -> GridField[Dimension]:
        """The field on the whole box: the coarse field if this one is in a band, else itself."""
        return self if self.coarse is None else self.coarse

    @property
    def n_nodes(self) -> int:
        """Number of stored nodes: all of the grid, or those of the blocks of a band."""
        return int(self.values.size)

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
    @public_call
    def contour(self, level: float = 0.0) -> TriangleMesh | list[Polyline]:
        """Extract the level set φ = level.

        In space, a surface: closed, manifold, with normals pointing to greater φ. Where it leaves the grid, as the
        completion of an open shape may do, it is closed along the box of the grid (1 % of a cell outside); where it
        meets nodes without a value, it is closed along the last nodes before them.

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
            If the grid has neither 2 nor 3 dimensions, values are infinite, or no node has one.

        Examples
        --------
        >>> grid = Grid((-1, -1), 0.1, (21, 21))
        >>> disk = GridField(grid, np.linalg.norm(grid.points, axis=-1) - 0.5)
        >>> [circle] = disk.contour(0.25)
        >>> circle.closed, round(circle.length / (2 * np.pi), 2)
        (True, 0.75)
        """
        grid, level = self.grid, finite_number(level, "level")
        if grid.dimension == 2:
            lines = level_lines(self.values, grid.spacing, level)
            return [Polyline(self._placed(points, level), closed) for points, closed in lines]
        vertices, faces = (np.concatenate(part) for part in zip(*self._parts(level), strict=True))
        if self.solid is not None:  # its level has creases, unlike what is interpolated
            faces = flipped_along_creases(vertices, faces)
        return TriangleMesh(vertices, faces)

    def _parts(self, level: float) -> Iterator[Part]:
        """Yield vertices and faces of a level in space, in a band window by window."""
        if self.blocks is None:
            pieces = iter([closed_surface(self.values, self.grid.spacing, level)])
        elif abs(level) > self.width:
            raise OutsideError(
                f"level {level:g} lies outside the band, which reaches to {self.width:g}",
                remedy=f"use a band of at least {abs(level):g}",
                element=f"level {level:g}",
            )
        else:
            pieces = contour_parts(BlockValues(self.blocks, self.values), self.grid.spacing, level)
        return ((self._placed(points, level), faces) for points, faces in pieces)

    def _placed(self, points: Floats, level: float) -> Floats:
        """Return the places in space of points of a level, which are given in cells; on it exactly if solid."""
        if self.solid is None:
            return self.grid.origin + points * self.grid.spacing
        values = self.values if self.blocks is None else BlockValues(self.blocks, self.values)
        return on_level(self.solid.distance, points, values, self.grid, level)

    def save_contour(self, path: str | PathLike[str], level: float = 0.0) -> tuple[int, int]:
        """Write the level set φ = level in space to a file; that of a band part by part, so that it may exceed memory.

        Parameters
        ----------
        path : str or path
            A ``.ply`` file. An existing one survives a failure.
        level : float
            See `contour`. In bands, creases are left as the cells cut them.

        Returns
        -------
        vertices, faces : int
            How many were written.

        Raises
        ------
        OutsideError, GeometryError
            As `contour`; also if the field lies in the plane.
        FileFormatError
            If the file is of another kind, or cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> from signedheat import complete, samples
        >>> ball = complete(samples.sphere(4)).field(spacing=0.02, band=0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     vertices, faces = ball.save_contour(f"{folder}/ball.ply", 0.05)
        >>> 2 * vertices - faces  # closed, without handles
        4
        """
        level = finite_number(level, "level")
        if self.blocks is None:
            surface = self.contour(level)
            if not isinstance(surface, TriangleMesh):
                raise GeometryError("a field in the plane has lines", remedy="use contour and sh.io.write_polylines")
            return ply.write_parts(iter([(surface.vertices, surface.faces)]), path)
        return ply.write_parts(self._parts(level), path)

    def dense(self) -> GridField[Dimension]:
        """Return the field at all nodes of its grid; nodes beyond a band are interpolated from the coarse field.

        Returns
        -------
        GridField
            Without a band; this field itself if it has none.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> band = complete(samples.sphere(2)).field(resolution=48, band=0.2)
        >>> band.n_nodes < band.dense().n_nodes == band.grid.n_nodes
        True
        """
        if self.blocks is None:
            return self
        values = np.empty(self.grid.shape)
        for i, x in enumerate(self.grid.axes[0]):  # plane by plane, in bounded memory
            plane = np.stack(np.meshgrid([x], *self.grid.axes[1:], indexing="ij"), axis=-1).reshape(-1, 3)
            values[i] = self.whole.interpolate(plane).reshape(self.grid.shape[1:])
        for place, block in zip(self.blocks.places.astype(np.int64) * BLOCK, self.values, strict=True):
            part = tuple(slice(p, min(p + BLOCK, n)) for p, n in zip(place, self.grid.shape, strict=True))
            values[part] = block[tuple(slice(0, s.stop - s.start) for s in part)]
        return GridField(self.grid, values, self.diagnostics, solid=self.solid)

    @overload
    def offset(self: GridField[Literal[3]], distance: float) -> TriangleMesh: ...
    @overload
    def offset(self: GridField[Literal[2]], distance: float) -> list[Polyline]: ...
    @overload
    def offset(self, distance: float) -> TriangleMesh | list[Polyline]: ...
    def offset(self, distance: float) -> TriangleMesh | list[Polyline]:
        """Offset the shape by a signed distance, and refuse that if the grid is too small for it.

        Parameters
        ----------
        distance : float
            Signed distance, positive outward, in the units of the grid.

        Returns
        -------
        TriangleMesh, or list of Polyline
            With the edges and corners of the offset if the field holds its solid and is no band; else as `contour`.

        Raises
        ------
        OutsideError
            If φ does not take the value on the grid, or the offset leaves the grid although the shape itself does not:
            the grid then needs more padding.

        Examples
        --------
        >>> grid = Grid((-1, -1), 0.1, (21, 21))
        >>> disk = GridField(grid, np.linalg.norm(grid.points, axis=-1) - 0.5)
        >>> disk.offset(-0.1)
        [Polyline(32 points, closed)]
        """
        distance = finite_number(distance, "distance")
        padding = f"use a padding of more than {abs(distance):g}, or a larger diffusion where wide gaps stay open"
        walls = values_at_walls(self.whole.values)
        if isinstance(self.solid, HasFields) and self.blocks is None:
            if np.nanmin(self.values) < distance < np.nanmin(walls):
                return self.solid._surface_on(self, distance)
        refuse_beyond_walls(walls, distance, "grid", padding)
        return self.contour(distance)

    def combined_with(self, other: GridField[Dimension], rule: Rule) -> GridField[Dimension]:
        if self.blocks is None and other.blocks is None:
            return self.with_values(rule(self.values, other.values))
        ours, theirs = (None if each.blocks is None else each.blocks.places for each in (self, other))
        if ours is None or theirs is None or not np.array_equal(ours, theirs):
            raise GeometryError(
                "fields in bands have values at different nodes",
                remedy="compute both on one whole grid",
                element="blocks",
            )
        coarse = self.whole.combined_with(other.whole, rule)
        values = np.asarray(rule(self.values, other.values), dtype=self.values.dtype)
        return GridField(self.grid, values, blocks=self.blocks, coarse=coarse, width=min(self.width, other.width))

    def _scaled(self, factor: float) -> GridField[Dimension]:
        """Return the field times a number; it is exact if this one is and the number is neither 0 nor infinite."""
        solid = None if self.solid is None or not factor or not math.isfinite(factor) else scaled(self.solid, factor)
        coarse = None if self.coarse is None else self.coarse._scaled(factor)
        return replace(
            self,
            values=self.values * factor,
            diagnostics=Diagnostics(),
            solid=solid,
            coarse=coarse,
            width=abs(factor) * self.width,
        )

    def to_pyvista(self) -> pyvista.ImageData:
        """Convert to an image of PyVista.

        A field in the plane has z = 0. Of a field in a band the coarse field is taken; ``dense()`` has all nodes.

        Returns
        -------
        pyvista.ImageData
            With point data ``signed_distance``, and ``confidence`` where there is one.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.

        Examples
        --------
        >>> GridField(Grid((0, 0), 1.0, (2, 2)), np.zeros((2, 2))).to_pyvista().array_names
        ['signed_distance']
        """
        if self.blocks is not None:
            return self.whole.to_pyvista()
        image: pyvista.ImageData = self.grid.to_pyvista()
        if self.confidence is not None:
            image.point_data["confidence"] = self.confidence.ravel(order="F")
        with_values(image, self.values.ravel(order="F"))
        return image

    def confidence_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """Return the confidence at points: 1 where the nearest surface is given, less where it had to be completed.

        Parameters
        ----------
        points : (..., d) float
            Positions, such as the vertices of an offset.

        Returns
        -------
        (...) float
            From 0 to 1. Outside the grid it is that of the nearest point of its box; it is 1 if the field has none.

        Examples
        --------
        >>> line = GridField(Grid([0.0], 1.0, [2]), np.array([0.0, 1.0]), confidence=np.array([1.0, 0.5]))
        >>> line.confidence_at([[0.5]]).tolist()
        [0.75]
        """
        if self.solid is not None:
            return self.solid.closest(points).confidence
        places, shape = query_points(points, self.grid.dimension)
        if self.confidence is None:
            return np.ones(shape, dtype=np.float32)[()]
        inside = self._into_box(places)
        index = (inside - self.grid.origin) / self.grid.spacing
        if self.blocks is None:
            values = scipy.ndimage.map_coordinates(self.confidence, index.T, np.float32, order=1, mode="nearest")
        else:
            values = BlockValues(self.blocks, self.confidence.astype(np.float32)).interpolated(index)
            beyond = np.isnan(values)
            values[beyond] = self.whole.confidence_at(inside[beyond])
        return shaped(np.clip(values, 0, 1).astype(np.float32), shape)

    @property
    def surface_confidence(self) -> float | None:
        """Mean confidence at the nodes within a cell of the zero set; None without confidence or such nodes."""
        cell = float(self.grid.spacing.max())
        near = (self.values < cell) & (self.values > -cell)
        if self.confidence is None or not near.any():
            return None
        return float(self.confidence[near].mean(dtype=np.float64))

    def _into_box(self, points: Floats) -> Floats:
        return np.clip(points, self.grid.origin, self.grid.upper)

    def _values_at(self, points: Floats) -> tuple[Floats]:
        """Return φ at (n, d) points, within the box and outside of it."""
        inside = self._into_box(points)
        values = self._interpolate(inside)
        away = points - inside
        outside = np.flatnonzero(away.any(axis=-1))
        if len(outside):
            slopes = self._slopes(inside[outside])
            values[outside] += np.einsum("ij,ij->i", slopes, away[outside])
        return (values,)

    def _interpolate(self, points: Floats) -> Floats:
        index = ((points - self.grid.origin) / self.grid.spacing).T
        if self.blocks is not None:
            values = BlockValues(self.blocks, self.values).interpolated(index.T)
            beyond = np.isnan(values)
            values[beyond] = self.whole.interpolate(points[beyond])
            return values
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
        """Return (n, d) central differences of the interpolant: they equal those at the nodes, interpolated."""
        slopes = np.empty_like(points)
        for axis, step in enumerate(self.grid.spacing):
            ahead, behind = points.copy(), points.copy()
            ahead[:, axis] = np.minimum(ahead[:, axis] + step, self.grid.upper[axis])
            behind[:, axis] = np.maximum(behind[:, axis] - step, self.grid.origin[axis])
            rise = self._interpolate(ahead) - self._interpolate(behind)
            slopes[:, axis] = rise / (ahead[:, axis] - behind[:, axis])
        return slopes

    def __repr__(self) -> str:
        how = "interpolated" if self.solid is None else "exact"
        if self.blocks is not None:
            band = f"{counted(len(self.blocks), 'block')}, {self.width:g} on either side"
            return f"GridField({how} between nodes, {self.grid!r}, {band})"
        low, high = (float(f.reduce(self.values, axis=None)) for f in (np.fmin, np.fmax))
        return f"GridField({how} between nodes, {self.grid!r}, values from {low:.4g} to {high:.4g})"
