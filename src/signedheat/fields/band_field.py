"""Distance in a narrow band around a surface, at fine nodes; and on a coarse grid everywhere else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import Diagnostics
from ..domains.display import Displayed, to_pyvista
from ..domains.grid import Grid
from ..domains.triangle_mesh import TriangleMesh
from ..domains.validation import finite_number, refuse_extreme
from ..errors import GeometryError, OutsideError
from ..geometry.edge_flips import flipped_along_creases
from ..operators.grid.block_contours import block_contour
from ..operators.grid.blocks import NODES, SIDE, Blocks
from ..operators.grid.exact_surface import ExactSurface
from ..operators.grid.streamed_contours import contour_parts
from ..parallel import in_chunks
from .booleans import Combinable
from .closest_points import ClosestPoints, closest_points
from .files import save_field, save_parts
from .grid_field import GridField

if TYPE_CHECKING:
    import pyvista

TOGETHER = 4096
"""Blocks that are looked at together."""


@dataclass(frozen=True, eq=False)
class BandField(Displayed, Combinable):
    """Signed distance at the nodes of a fine grid that are near a surface, and at those of a coarse grid elsewhere.

    Nodes come in blocks of 8³, where at least one node is within the band. Everything a `GridField` does works alike,
    fine in the band, coarse beyond; but bands are not combined by ``|``, ``&``, ``-`` and ``~``.

    Parameters
    ----------
    grid : Grid
        Of the fine nodes, of which only those in `blocks` have values.
    blocks : Blocks
        Which those are.
    values : (n, 8, 8, 8) float32
        φ at the nodes of the blocks, negative inside; NaN at nodes of the last blocks that lie beyond the grid.
    coarse : GridField
        φ on the whole box.
    width : float
        Distance up to which all fine nodes are there, on both sides, in units of length.
    diagnostics : Diagnostics
        Timings and notes.
    confidence : (n, 8, 8, 8) float16, optional
        See `GridField`.
    surface : ExactSurface, optional
        What the values are distances to, where that is known exactly: contours then lie on it exactly.

    Raises
    ------
    GeometryError
        If values and blocks do not match.

    Examples
    --------
    >>> from signedheat import samples
    >>> from signedheat.extensions.solid_distance import solid_distance
    >>> ball = solid_distance(samples.sphere(4), spacing=0.02, band=0.1)
    >>> ball.n_nodes < 0.3 * ball.grid.n_nodes
    True
    >>> bool(abs(ball([[0.95, 0.0, 0.0]])[0] + 0.05) < 0.002)
    True
    >>> ball.offset(0.05).n_faces > 0
    True
    """

    grid: Grid
    blocks: Blocks
    values: NDArray[np.float32]
    coarse: GridField
    width: float
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    confidence: NDArray[np.float16] | None = field(default=None, repr=False)
    surface: ExactSurface | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.blocks), SIDE, SIDE, SIDE) or self.blocks.shape != self.grid.shape:
            raise GeometryError(
                f"{len(self.blocks)} blocks of a grid of {self.blocks.shape} nodes have values of shape "
                f"{self.values.shape} on one of {self.grid.shape}",
                element="values",
            )

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """φ at points in space: linear between the fine nodes in the band, between the coarse ones beyond.

        Parameters
        ----------
        points : (n, 3) or (3,) float
            Positions, in the units of the grid.

        Returns
        -------
        (n,) float, or one float
            Signed distances.
        """
        given = np.asarray(points, dtype=np.float64)
        places = self._checked(given)
        values = in_chunks(self._values_of_chunk, places)[0]
        return values if given.ndim == 2 else values[0]

    def gradient(self, points: ArrayLike) -> NDArray[np.float64]:
        """∇φ at points in space: central differences of the fine nodes where they are, of the coarse ones elsewhere.

        Parameters
        ----------
        points : (n, 3) float
            Positions, in the units of the grid.

        Returns
        -------
        (n, 3) float
            Gradients; of length about 1, since φ is a distance.
        """
        return in_chunks(self._slopes_of_chunk, self._checked(points))[0]

    def closest_points(self, points: ArrayLike) -> ClosestPoints:
        """The nearest place of the surface itself for points in space, and exact distances to it.

        See `GridField.closest_points`; points may lie anywhere, in the band or beyond.

        Parameters
        ----------
        points : (n, 3) float
            Positions, in the units of the grid.

        Returns
        -------
        ClosestPoints
            Places, signed distances, gradients, and whether the place is one that had to be completed.

        Raises
        ------
        SourceError
            If the field does not know its surface: it was read from a file.
        """
        return closest_points(self.surface, self._checked(points), self)

    def confidence_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """How far the surface that is nearest was there (1), or had to be completed (less), interpolated.

        Parameters
        ----------
        points : (n, 3) float
            Positions, such as the vertices of an offset; beyond the band the coarse field tells.

        Returns
        -------
        (n,) float
            From 0 to 1; 1 if nothing is known of it.
        """
        places = self._checked(points)
        if self.confidence is None:
            return np.ones(len(places), dtype=np.float32)
        return in_chunks(self._confidence_of_chunk, places)[0]

    @property
    def surface_confidence(self) -> float | None:
        """Mean confidence at the nodes within a cell of the zero set, one number for the whole field; or None."""
        if self.confidence is None:
            return None
        total, count, cell = 0.0, 0, float(self.grid.spacing.max())
        for begin in range(0, len(self.blocks), TOGETHER):  # in bounded memory
            here = slice(begin, begin + TOGETHER)
            near = np.abs(self.values[here]) < cell
            total += float(self.confidence[here][near].sum(dtype=np.float64))
            count += int(near.sum())
        return total / count if count else None

    @property
    def domain(self) -> Grid:
        """The fine grid."""
        return self.grid

    @property
    def n_nodes(self) -> int:
        """Number of fine nodes that are there."""
        return NODES * len(self.blocks)

    def contour(self, level: float = 0.0) -> TriangleMesh:
        """The level set φ = level: closed, manifold, with normals pointing to greater φ.

        Where it leaves the grid it is closed along its box (1 % of a cell outside).

        Parameters
        ----------
        level : float
            The level, in units of length, within the band.

        Returns
        -------
        TriangleMesh
            The surface.

        Raises
        ------
        OutsideError
            If the level is not within the band, or φ does not take it.
        """
        level = finite_number(level, "level")
        self._refuse_beyond(level)
        vertices, faces = block_contour(self.blocks, self.values, self.grid.spacing, level, self._refined(level))
        return TriangleMesh(vertices, faces if self.surface is None else flipped_along_creases(vertices, faces))

    def save_contour(self, path: str | PathLike[str], level: float = 0.0) -> tuple[int, int]:
        """Write the level set φ = level to a file part by part: it may be larger than memory.

        Parameters
        ----------
        path : str or path
            A ``.ply`` file. An existing one survives a failure.
        level : float
            See `contour`. Creases are left as the cells cut them.

        Returns
        -------
        vertices, faces : int
            How many there are.

        Raises
        ------
        OutsideError
            As `contour`.
        FileFormatError
            If the file is of another kind, or cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> from signedheat import samples
        >>> ball = sh.solid_distance(samples.sphere(4), spacing=0.02, band=0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     vertices, faces = ball.save_contour(f"{folder}/ball.ply", 0.05)
        >>> 2 * vertices - faces  # closed, without handles
        4
        """
        level = finite_number(level, "level")
        self._refuse_beyond(level)
        refined = self._refined(level)
        return save_parts(contour_parts(self.blocks, self.values, self.grid.spacing, level, refined), path)

    def offset(self, distance: float) -> TriangleMesh:
        """The offset of the shape at a signed distance: `contour`, but refused if the grid is too small for it.

        Parameters
        ----------
        distance : float
            Signed distance, positive outward, within the band.

        Returns
        -------
        TriangleMesh
            As `contour`.

        Raises
        ------
        OutsideError
            If φ does not take the value in the band, or the offset leaves the grid although the shape does not.
        """
        self.coarse.refuse_beyond_walls(finite_number(distance, "distance"))
        return self.contour(distance)

    def dense(self) -> GridField:
        """The field at all nodes of the fine grid, those beyond the band interpolated from the coarse one."""
        index = [np.arange(n) * step for n, step in zip(self.grid.shape, self.grid.spacing, strict=True)]
        values = np.empty(self.grid.shape)
        for i, x in enumerate(index[0]):  # plane by plane, in bounded memory
            plane = np.stack(np.meshgrid([x], *index[1:], indexing="ij"), axis=-1).reshape(-1, 3)
            values[i] = self.coarse(self.grid.origin + plane).reshape(self.grid.shape[1:])
        for place, block in zip(self.blocks.places.astype(np.int64) * SIDE, self.values, strict=True):
            part = tuple(slice(p, min(p + SIDE, n)) for p, n in zip(place, self.grid.shape, strict=True))
            values[part] = block[tuple(slice(0, s.stop - s.start) for s in part)]
        return GridField(self.grid, values, self.diagnostics)

    def to_pyvista(self) -> pyvista.ImageData:
        """The coarse field as a `pyvista.ImageData`; ``dense().to_pyvista()`` has all nodes."""
        image: pyvista.ImageData = to_pyvista(self)
        return image

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension: ``.npz`` or ``.vdb``."""
        save_field(self, path)

    def _refuse_beyond(self, level: float) -> None:
        if abs(level) > self.width:
            raise OutsideError(
                f"level {level:g} lies outside the band, which reaches to {self.width:g}",
                remedy=f"use a band of at least {abs(level):g}",
                element=f"level {level:g}",
            )

    def _refined(self, level: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """Places of points in cells, on the level exactly where the surface is known."""
        values = _NodeValues(self)

        def refine(cells: NDArray[np.float64]) -> NDArray[np.float64]:
            points = self.grid.origin + cells * self.grid.spacing
            return points if self.surface is None else self.surface.on_level(points, values, level)

        return refine

    def _values_of_chunk(self, places: NDArray[np.float64]) -> tuple[NDArray[np.float64]]:
        values = self._fine(places)
        beyond = np.isnan(values)
        if beyond.any():
            values[beyond] = self.coarse(places[beyond])
        return (values,)

    def _slopes_of_chunk(self, places: NDArray[np.float64]) -> tuple[NDArray[np.float64]]:
        slopes = np.empty_like(places)
        for axis, step in enumerate(self.grid.spacing):
            ahead, behind = places.copy(), places.copy()
            ahead[:, axis] = np.minimum(ahead[:, axis] + step, self.grid.upper[axis])
            behind[:, axis] = np.maximum(behind[:, axis] - step, self.grid.origin[axis])
            span = ahead[:, axis] - behind[:, axis]
            rise = self._fine(ahead) - self._fine(behind)
            slopes[:, axis] = np.where(span > 0, rise / np.where(span > 0, span, 1.0), np.nan)
        beyond = np.isnan(slopes).any(axis=1)
        if beyond.any():
            slopes[beyond] = self.coarse.gradient(places[beyond])
        return (slopes,)

    def _confidence_of_chunk(self, places: NDArray[np.float64]) -> tuple[NDArray[np.float32]]:
        cells = (np.clip(places, self.grid.origin, self.grid.upper) - self.grid.origin) / self.grid.spacing
        base = np.minimum(cells.astype(np.int64), np.array(self.grid.shape) - 2)
        share, found = cells - base, np.zeros(len(places))
        assert self.confidence is not None
        for corner in np.ndindex(2, 2, 2):
            weight = np.where(np.array(corner, dtype=bool), share, 1.0 - share).prod(axis=1)
            found += np.where(weight > 0, weight * self.blocks.values_at(self.confidence, base + corner), 0.0)
        beyond = np.isnan(found)
        if beyond.any():
            found[beyond] = self.coarse.confidence_at(places[beyond])
        return (np.clip(found, 0.0, 1.0).astype(np.float32),)

    def _checked(self, points: ArrayLike) -> NDArray[np.float64]:
        places = np.atleast_2d(np.asarray(points, dtype=np.float64))
        if places.shape[-1] != 3 or not np.isfinite(places).all():
            raise GeometryError("points must be finite, with 3 coordinates each", element="points")
        if len(places):
            refuse_extreme(places.min(axis=0), places.max(axis=0), "points")
        return places

    def _fine(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.blocks.interpolated(self.values, (places - self.grid.origin) / self.grid.spacing)

    def __repr__(self) -> str:
        return f"BandField({self.grid!r}, {len(self.blocks)} blocks, {self.width:g} on either side)"


@dataclass(frozen=True, eq=False)
class _NodeValues:
    """The values of a band, indexed by nodes as those of a grid are."""

    band: BandField

    @property
    def shape(self) -> tuple[int, ...]:
        return self.band.grid.shape

    def __getitem__(self, nodes: tuple[NDArray[np.int64], ...]) -> NDArray[np.float64]:
        return self.band.blocks.values_at(self.band.values, np.stack(nodes, axis=1))
