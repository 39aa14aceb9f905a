"""Parts of the package that commands use, imported when one of them is first used.

So help and errors of usage come at once, without NumPy, although a command is declared next to what runs it.
"""

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
    from ..curves import close as close
    from ..curves import distance as distance
    from ..domains import inspection as inspection
    from ..io import files as files
    from ..lowering.surface import discretization as discretization
    from . import kernel_runs as kernel_runs
    from . import reports as reports
    from . import shapes as shapes
else:
    numpy = lazy_module("numpy", "commands")
    PARTS = {
        **{"compiled": "compiled", "diagnostics": "diagnostics", "parallel": "parallel", "samples": "samples"},
        **{"inputs": "batches.inputs", "pool": "batches.pool"},
        **{"inspection": "domains.inspection", "files": "io.files"},
        **{"close": "curves.close", "distance": "curves.distance"},
        **{"discretization": "lowering.surface.discretization"},
        **{"kernel_runs": "cli.kernel_runs", "reports": "cli.reports", "shapes": "cli.shapes"},
    }
    globals().update({name: lazy_module(f"signedheat.{path}", "commands") for name, path in PARTS.items()})
