"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from argparse import Namespace

from ..extensions.close_curves import refuse_without_sides
from ..io import CURVE_FORMATS, ensure_writable, write_curves
from ..visualization import ensure_picture_writable, save_surface
from .computing import Summary, prefix_errors
from .surface import advice, measured


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, complete, write."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    surface, curves, field = measured(arguments)
    with prefix_errors(arguments.curves):
        refuse_without_sides(curves)
        found = field.contour(0.0)
    write_curves(arguments.output, found, surface)
    if arguments.preview:
        save_surface(field, arguments.preview, found)
    closed = sum(curve.closed for curve in found)
    summary = {
        "mesh": arguments.mesh,
        "curves": arguments.curves,
        "output": arguments.output,
        "n_curves": len(found),
        "n_closed": closed,
    }
    curve = "curve" if len(found) == 1 else "curves"
    return summary, f"{arguments.output}: {len(found)} {curve}, {closed} of them closed{advice(field)}"
