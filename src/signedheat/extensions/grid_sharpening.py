"""Sharpening on grids: distance to the zero set of the field, or to a shape, measured anew."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import SharpenedToShape
from ..domains.foreign import as_shapes
from ..domains.kinds import Shapes
from ..errors import GeometryError, SignedHeatError, SourceError
from ..fields.grid_field import GridField
from ..operators.grid.closest_points import distance_to_zero_set
from ..parallel import run_cancellable
from ..progress import Progress
from .shape_sharpening import Fit, Shape, assemble
from .sharpening import sharpen_field


@sharpen_field.register
def _(
    field: GridField,
    shape: Shapes | None = None,
    *,
    fit: Fit = "auto",
    sides: ArrayLike | None = None,
    progress: Progress | None = None,
) -> GridField:
    """Distance of every node to the zero set, or to a shape and to the zero set where that is missing.

    Without a shape signs stay as they are, and distance is second order on smooth zero sets.
    """
    if not np.isfinite(field.values).all():
        raise GeometryError(
            "a field around solid nodes, or with parts that no source reaches, cannot be sharpened: straight lines to "
            "its zero set would pass through what is solid",
            remedy="use it as it is",
            element="field",
        )
    if fit not in get_args(Fit):
        raise SignedHeatError(f"fit must be one of {', '.join(map(repr, get_args(Fit)))}, not {fit!r}", element="fit")
    if shape is None and sides is not None:
        raise SourceError("sides are for sharpening to a shape", remedy="pass the shape, or a field with those signs")
    report = None if progress is None else lambda: progress(0.0, "sharpen")
    if report is not None:
        report()
    begin = time.perf_counter()
    if shape is None:
        values = run_cancellable(lambda: distance_to_zero_set(field.values, field.grid.spacing), report)
        sharpened = GridField(field.grid, values, field.diagnostics)
    else:
        known = _checked_sides(field, sides)
        sharpened = run_cancellable(lambda: _sharpen_to(field, shape, known, fit), report)
    if progress is not None:
        progress(1.0, "done")
    timings = {**field.diagnostics.timings, "sharpen": time.perf_counter() - begin}
    return replace(sharpened, diagnostics=replace(sharpened.diagnostics, timings=timings))


def _sharpen_to(field: GridField, shape: Shapes, sides: NDArray[np.float64], fit: Fit) -> GridField:
    grid = field.grid
    if grid.dimension != 3:
        raise SourceError(
            f"fields in space are sharpened to shapes, and this one has {grid.dimension} dimensions",
            remedy="leave the shape out",
        )
    parts = cast("list[Shape]", as_shapes(shape))
    made = assemble(parts, grid, sides, fit)
    diagnostics = field.diagnostics.noting(SharpenedToShape(made.layered, made.completed))
    return GridField(grid, made.values, diagnostics, made.confidence, made.surface)


def _checked_sides(field: GridField, sides: ArrayLike | None) -> NDArray[np.float64]:
    """A function that is negative inside; φ by default."""
    known = field.values if sides is None else np.ascontiguousarray(sides, dtype=np.float64)
    if known.shape != field.grid.shape or not np.isfinite(known).all():
        raise GeometryError(
            f"sides must be finite, one for each of the {field.grid.shape} nodes, not {known.shape}", element="sides"
        )
    return known
