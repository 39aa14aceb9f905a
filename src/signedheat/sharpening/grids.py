"""Sharpening on grids: distance to the zero set of the field, measured anew."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ..errors import GeometryError
from ..fields.grid_field import GridField
from ..fields.redistancing import redistance
from ..jobs import run_cancellable
from ..progress import Progress
from .sharpen import sharpen_field


@sharpen_field.register
def _(field: GridField, *, progress: Progress | None = None) -> GridField:
    """Distance of every node to the zero set, that of `redistance`; signs stay as they are."""
    if not np.isfinite(field.values).all():
        raise GeometryError(
            "a field around solid nodes, or with parts that no source reaches, cannot be sharpened: straight lines to "
            "its zero set would pass through what is solid",
            remedy="use it as it is",
            element="field",
        )
    report = None if progress is None else lambda: progress(0.0, "sharpen")
    if report is not None:
        report()
    begin = time.perf_counter()
    values = run_cancellable(lambda: redistance(field.values, field.grid.spacing), report)
    if progress is not None:
        progress(1.0, "done")
    timings = {**field.diagnostics.timings, "sharpen": time.perf_counter() - begin}
    return GridField(field.grid, values, replace(field.diagnostics, timings=timings))
