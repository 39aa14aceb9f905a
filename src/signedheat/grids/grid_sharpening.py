"""Sharpening on grids: distance to the zero set of the field, measured anew."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..arrays import Floats
from ..discretization import SourceTerm
from ..errors import GeometryError, UnsupportedTypeError
from ..jobs import run_cancellable
from ..progress import Progress
from ..sharpening_methods import Method, Nearest, distance_to_nearest, nearest, sharpen_field, timed
from .grid import Grid
from .grid_field import GridField
from .redistancing import redistance
from .solid_queries import Scaled


@sharpen_field.register
def _(field: GridField, source: object, method: Method | None, progress: Progress | None) -> GridField:
    """Distance of every node to the zero set, that of `redistance`; signs stay as they are.

    A field that holds its solid is that distance already, but for a factor.
    """
    if source is not None or method is not None:
        raise UnsupportedTypeError(
            "fields on grids are measured to their zero set", remedy="leave out source and method", element="method"
        )
    if not np.isfinite(field.values).all():
        raise GeometryError(
            "a field with values that are not finite cannot be sharpened",
            remedy="fill them in, or use it as it is",
            element="field",
        )
    if field.solid is not None:
        return field / (abs(field.solid.factor) if isinstance(field.solid, Scaled) else 1.0)
    run = partial(distance_to_nearest, field.grid, field.values, None, None, 0.0, progress)
    values, diagnostics = timed(run, field.diagnostics, progress)
    return GridField(field.grid, values, diagnostics)


@nearest.register
def _(
    grid: Grid,
    values: Floats,
    source: SourceTerm | None,
    given: None,
    tolerance: float,
    report: Callable[[], None] | None,
) -> Nearest:
    distances = run_cancellable(lambda: redistance(values, grid.spacing), report)
    return Nearest(np.abs(distances), np.sign(distances).astype(np.int64))
