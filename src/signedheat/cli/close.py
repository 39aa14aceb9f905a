"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import Summary, add_command, add_curves, add_format_option, add_up_option
from .parts import close, computing, curves, io, view
from .progress import ProgressBar


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "close",
        run,
        help="complete broken curves on a surface",
        description="The zero set of the signed distance to broken curves: closed, but for ends at the boundary of the "
        "surface.",
    )
    add_curves(parser, "completed curves: .txt .obj .json; on a globe .geojson")
    parser.add_argument("--preview", metavar="PNG", help="draw the distance, with the completed curves")
    add_up_option(parser)
    add_format_option(parser, "json")


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, complete, write."""
    io.ensure_writable(arguments.output, io.CURVE_FORMATS, "curves")
    if arguments.preview:
        view.ensure_picture_writable(arguments.preview)
    surface, sources = curves.surface_and_curves(arguments)
    with computing.prefix_errors(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        close.refuse_without_sides(sources)
        constraint = computing.constraint_of(arguments.constraint)
        if arguments.plain and not arguments.intrinsic:
            field = sh.SignedHeatSolver(surface, arguments.diffusion, progress).distance(sources, constraint)
        else:
            field = close.conforming_distance(
                surface,
                sources,
                constraint,
                arguments.diffusion or 1.0,
                progress,
                arguments.as_oriented,
                arguments.every_piece,
            )
        found = close.zero_set(field, sources)
    io.write_curves(arguments.output, found, surface)
    if arguments.preview:
        view.save_surface(field, arguments.preview, found, up="xyz".index(arguments.up))
    closed = sum(curve.closed for curve in found)
    summary = {
        "mesh": arguments.mesh,
        "curves": arguments.curves,
        "output": arguments.output,
        "n_curves": len(found),
        "n_closed": closed,
    }
    curve = "curve" if len(found) == 1 else "curves"
    text = f"{arguments.output}: {len(found)} {curve}, {closed} of them closed"
    return summary | curves.numbered(field), text + curves.pieces_told(field)
