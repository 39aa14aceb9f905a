"""Bands: the nodes of a grid near a surface, in blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import GeometryError, OutsideError, counted
from ..fields.field_domain import Exact, FieldDomain
from ..mesh.triangles import flipped_along_creases
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import array_of, instance
from .blocks import BLOCK, Blocks, BlockValues
from .grid import Grid, GridInterpolant, other_nodes
from .marching import contour_parts

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass(frozen=True, eq=False, repr=False)
class Band(Grid[Literal[3]]):
    """The nodes of a grid near a surface, in blocks of 8³; the domain of fields of ``Solid.field(band=…)``.

    Values are (n, 8, 8, 8), in single or half precision, NaN at nodes of blocks beyond the grid.

    Parameters
    ----------
    grid : Grid
        The whole grid, whose `origin`, `spacing` and `shape` the band has.
    blocks : Blocks
        The n blocks that have values.
    width : float
        Half width, in the units of the grid: all nodes with values up to this on either side of 0 are in the band.

    Raises
    ------
    GeometryError
        If the blocks are those of a grid of another shape.

    See Also
    --------
    Solid.field : Distance at the nodes of a grid or a band.
    Field : Values on a domain.

    Examples
    --------
    >>> from signedheat import complete, samples
    >>> field = complete(samples.sphere(2)).field(resolution=48, band=0.2)
    >>> field.domain.width, field.values.size < field.domain.n_nodes
    (0.2, True)
    """

    blocks: Blocks
    width: float

    def __init__(self, grid: Grid[int], blocks: Blocks, width: float) -> None:
        instance(blocks, Blocks, "blocks")
        if blocks.shape != grid.shape:
            raise GeometryError(f"blocks of {blocks.shape} nodes on a grid of {grid.shape}", element="blocks")
        vars(self).update(origin=grid.origin, spacing=grid.spacing, shape=grid.shape, blocks=blocks, width=width)

    @property
    def grid(self) -> Grid[Literal[3]]:
        """The whole grid that the band is a part of."""
        return cast("Grid[Literal[3]]", Grid(self.origin, self.spacing, self.shape))

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """A field has (n, 8, 8, 8) values, those of the blocks."""
        return (len(self.blocks), BLOCK, BLOCK, BLOCK)

    def _checked(self, values: object) -> NDArray[Any]:
        # memory that is mapped to a file, and single precision, stay
        array = values if isinstance(values, np.ndarray) else array_of(values, "values")
        return array if array.shape == self._values_shape else super()._checked(values)

    def _interpolant(self, values: NDArray[Any], beyond: Exact | None) -> BandInterpolant:
        """Return the function that interpolates (n, 8, 8, 8) values, and calls `beyond` at points off the band."""
        return BandInterpolant(self, values, beyond)

    def _level_set(self, values: NDArray[Any], level: float, exact: Exact | None) -> TriangleMesh:
        """Extract a level set of (n, 8, 8, 8) values as a closed mesh; vertices are moved onto the level of `exact`."""
        vertices, faces = (np.concatenate(part) for part in zip(*self._level_parts(values, level, exact), strict=True))
        if exact is not None:
            faces = flipped_along_creases(vertices, faces)
        return TriangleMesh(vertices, faces)

    def _level_parts(self, values: NDArray[Any], level: float, exact: Exact | None) -> Iterator[tuple[Floats, Ints]]:
        """Yield (n, 3) vertices and (m, 3) faces of the level set, window by window."""
        if abs(level) > self.width:
            raise OutsideError(
                f"level {level:g} lies outside the band, which reaches to {self.width:g}",
                remedy=f"use a band of at least {abs(level):g}",
                element=f"level {level:g}",
            )
        nodes = BlockValues(self.blocks, values)
        parts = contour_parts(nodes, self.spacing, level)
        return ((self._placed(points, nodes, level, exact), faces) for points, faces in parts)

    def _expanded(self, values: NDArray[Any], beyond: Exact | None) -> tuple[FieldDomain, NDArray[Any]]:
        """Return the whole grid, and values on it: those of the band, and of `beyond` elsewhere."""
        assert beyond is not None
        whole = np.empty(self.shape)
        for i, x in enumerate(self.axes[0]):  # plane by plane, in bounded memory
            plane = np.stack(np.meshgrid([x], *self.axes[1:], indexing="ij"), axis=-1).reshape(-1, 3)
            whole[i] = beyond(plane).reshape(self.shape[1:])
        for place, block in zip(self.blocks.places.astype(np.int64) * BLOCK, values, strict=True):
            part = tuple(slice(p, min(p + BLOCK, n)) for p, n in zip(place, self.shape, strict=True))
            whole[part] = block[tuple(slice(0, s.stop - s.start) for s in part)]
        return self.grid, whole

    def _stretched(self, factor: float) -> Self:
        """Return the band for values multiplied by a factor, whose width is multiplied, too."""
        return self if abs(factor) == 1 else type(self)(self.grid, self.blocks, abs(factor) * self.width)

    def _shared(self, other: FieldDomain) -> Self:
        """Return the band of a combination of fields on this band and another one; raise if their nodes differ."""
        super()._shared(other)
        assert isinstance(other, Band)
        if not np.array_equal(self.blocks.places, other.blocks.places):
            raise other_nodes()
        return self if self.width <= other.width else type(self)(self.grid, self.blocks, other.width)

    def __repr__(self) -> str:
        return f"Band({self.grid!r}, {counted(len(self.blocks), 'block')}, within {self.width:g})"


@dataclass(frozen=True, eq=False)
class BandInterpolant(GridInterpolant):
    """Interpolation between the nodes of blocks, and beyond them by another function."""

    grid: Band
    beyond: Exact | None

    def _between(self, points: Floats) -> Floats:
        """(n,) values at (n, 3) points within the box; those of `beyond`, if any, where a node around has no value."""
        index = (points - self.grid.origin) / self.grid.spacing
        values = BlockValues(self.grid.blocks, self.values).interpolated(index)
        outside = np.isnan(values)
        if self.beyond is not None:
            values[outside] = self.beyond(points[outside])
        return values
