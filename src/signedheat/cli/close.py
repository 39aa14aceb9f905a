"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..extensions.close_curves import refuse_without_sides
from ..io import CURVE_FORMATS, ensure_writable, write_curves
from ..visualization import ensure_picture_writable, save_surface
from .computing import prefix_errors
from .options import Summary, add_command
from .surface import add_curves_and_output, advice, measured


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "close",
        run=run,
        help="complete broken curves on a surface",
        description="The zero set of the signed distance to broken curves: closed, but for ends at the boundary of the "
        "surface.",
    )
    add_curves_and_output(parser, "completed curves: .txt .obj .json")
    parser.add_argument("--preview", metavar="PNG", help="draw the distance, with the completed curves")


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
