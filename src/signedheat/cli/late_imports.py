"""Modules that commands use, imported at first use, so that help and errors of usage need not wait for NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..packages import lazy_module

if TYPE_CHECKING:
    import numpy as numpy

    from .. import compiled as compiled
    from .. import diagnostics as diagnostics
    from .. import parallel as parallel
    from .. import samples as samples
    from ..batches import inputs as inputs
    from ..batches import pool as pool
    from ..curves import curve_completion as curve_completion
    from ..curves import curve_distance as curve_distance
    from ..io import files as files
    from ..io import shape_files as shape_files
    from ..shapes import inspection as inspection
    from ..surfaces import surface_discretization as surface_discretization
    from ..view import windows as windows
    from . import kernel_runs as kernel_runs
    from . import operands as operands
    from . import reports as reports
else:
    numpy = lazy_module("numpy", "commands")
    for path in (
        *("compiled", "diagnostics", "parallel", "samples", "batches.inputs", "batches.pool", "io.files"),
        *("cli.kernel_runs", "cli.operands", "cli.reports", "curves.curve_completion", "curves.curve_distance"),
        *("io.shape_files", "shapes.inspection", "surfaces.surface_discretization", "view.windows"),
    ):
        globals()[path.rpartition(".")[2]] = lazy_module(f"signedheat.{path}", "commands")
