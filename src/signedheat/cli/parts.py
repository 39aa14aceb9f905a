"""Parts of the package that commands use, imported when one of them is first used.

So help and errors of usage come at once, without NumPy, although a command is declared beside what runs it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..packages import lazy_module

if TYPE_CHECKING:
    from .. import compiled as compiled
    from .. import io as io
    from .. import parallel as parallel
    from .. import samples as samples
    from .. import view as view
    from ..batches import pool as pool
    from ..batches import watertight as watertight
    from ..curves import close as close
    from ..domains import inspection as inspection
    from . import computing as computing
    from . import curves as curves
    from . import images as images
    from . import kernel_runs as kernel_runs
    from . import placing as placing
    from . import reports as reports
    from . import surfaces as surfaces
    from . import tets as tets
else:
    PARTS = (
        *("batches.pool", "batches.watertight", "compiled", "curves.close", "domains.inspection", "io"),
        *("parallel", "samples", "view", "cli.computing", "cli.curves", "cli.images", "cli.kernel_runs"),
        *("cli.placing", "cli.reports", "cli.surfaces", "cli.tets"),
    )
    globals().update({path.rpartition(".")[2]: lazy_module(f"signedheat.{path}", "commands") for path in PARTS})
