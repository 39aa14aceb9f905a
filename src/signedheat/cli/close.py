"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from argparse import Namespace
from typing import Literal

from ..domains.triangle_mesh import TriangleMesh
from ..extensions.close_curves import refuse_without_sides
from ..io import CURVE_FORMATS, ensure_writable, write_curves
from ..solver import SignedHeatSolver
from ..visualization import ensure_picture_writable, save_surface
from .computing import Summary, constraint_of, prefix_errors
from .progress import ProgressBar
from .surface import surface_and_curves


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, complete, write."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    surface, curves = surface_and_curves(arguments)
    conforming = arguments.intrinsic or (isinstance(surface, TriangleMesh) and not arguments.plain)
    intrinsic: bool | Literal["auto"] = True if conforming else "auto"
    with prefix_errors(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        refuse_without_sides(curves)
        solver = SignedHeatSolver(surface, arguments.diffusion, progress, intrinsic)
        field = solver.distance(curves, constraint_of(arguments.constraint))
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
    return summary, f"{arguments.output}: {len(found)} {curve}, {closed} of them closed"
