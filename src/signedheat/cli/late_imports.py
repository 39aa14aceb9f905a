"""Modules that commands use, imported at first use, so that help and errors of usage need not wait for NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..packages import lazy_module

if TYPE_CHECKING:
    import numpy as numpy

    from .. import compiled as compiled
    from .. import diagnostics as diagnostics
    from .. import inspection as inspection
    from .. import parallel as parallel
    from .. import samples as samples
    from ..batches import inputs as inputs
    from ..batches import pool as pool
    from ..curves import curve_completion as curve_completion
    from ..curves import curve_distance as curve_distance
    from ..io import files as files
    from ..surfaces import surface_discretization as surface_discretization
    from ..view import windows as windows
    from . import kernel_runs as kernel_runs
    from . import operands as operands
    from . import reports as reports
else:
    numpy = lazy_module("numpy", "commands")
    PARTS = {
        **{"compiled": "compiled", "diagnostics": "diagnostics", "parallel": "parallel", "samples": "samples"},
        **{"inputs": "batches.inputs", "pool": "batches.pool"},
        **{"inspection": "inspection", "files": "io.files"},
        **{"curve_completion": "curves.curve_completion", "curve_distance": "curves.curve_distance"},
        **{"surface_discretization": "surfaces.surface_discretization", "windows": "view.windows"},
        **{"kernel_runs": "cli.kernel_runs", "reports": "cli.reports", "operands": "cli.operands"},
    }
    globals().update({name: lazy_module(f"signedheat.{path}", "commands") for name, path in PARTS.items()})
