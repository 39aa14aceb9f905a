"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from argparse import Namespace

from ..extensions.close_curves import conforming_distance, refuse_without_sides
from ..extensions.zero_set import zero_set
from ..io import CURVE_FORMATS, ensure_writable, write_curves
from ..solver import SignedHeatSolver
from ..visualization import ensure_picture_writable, save_surface
from .computing import Summary, constraint_of, prefix_errors
from .progress import ProgressBar
from .surface import numbered, pieces_told, surface_and_curves


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, complete, write."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    surface, curves = surface_and_curves(arguments)
    with prefix_errors(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        refuse_without_sides(curves)
        constraint = constraint_of(arguments.constraint)
        if arguments.plain and not arguments.intrinsic:
            field = SignedHeatSolver(surface, arguments.diffusion, progress).distance(curves, constraint)
        else:
            field = conforming_distance(
                surface,
                curves,
                constraint,
                arguments.diffusion or 1.0,
                progress,
                arguments.as_oriented,
                arguments.every_piece,
            )
        found = zero_set(field, curves)
    write_curves(arguments.output, found, surface)
    if arguments.preview:
        save_surface(field, arguments.preview, found, up="xyz".index(arguments.up))
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
    return summary | numbered(field), text + pieces_told(field)
