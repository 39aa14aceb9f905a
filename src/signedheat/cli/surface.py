"""``signedheat surface``: signed distance to curves on a surface, at its vertices."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .options import Summary, add_command, add_curves, add_format_option, add_up_option, whole_number
from .parts import curves, io, view


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "surface",
        run,
        help="signed distance to curves on a surface",
        description="Signed distance on a mesh, a point cloud or the boundary of a set of voxels to curves, broken or "
        "not, and to points on it.",
    )
    add_curves(parser, "field: .ply .vtp .obj .npz")
    parser.add_argument(
        "--contours",
        type=whole_number(1, 1000),
        metavar="N",
        help="write N isolines beside the output, as OUT.contours.obj",
    )
    parser.add_argument(
        "--subdivide",
        action="store_true",
        help="write the flat pieces of the surface on which the field is linear, where it was computed on better "
        "triangles than those of the mesh, whose vertices come first",
    )
    parser.add_argument("--preview", metavar="PNG", help="draw the result")
    add_up_option(parser)
    add_format_option(parser, "ply")


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute, write."""
    io.ensure_writable(arguments.output, io.VERTEX_FIELD_FORMATS, "a field on a surface")
    if arguments.preview:
        view.ensure_picture_writable(arguments.preview)
    surface, sources = curves.surface_and_curves(arguments)
    field = curves.measured(surface, sources, arguments)
    (field.subdivided() if arguments.subdivide else field).save(arguments.output)
    low, high = curves.range_of(field)
    summary = {
        "mesh": arguments.mesh,
        "curves": arguments.curves,
        "output": arguments.output,
        "n_vertices": len(field.values),
        "minimum": low,
        "maximum": high,
        "unreached": len(field.diagnostics.unreached),
        "seconds": {step: round(seconds, 4) for step, seconds in field.diagnostics.timings.items()},
    }
    completed = curves.completed(field)
    if completed is not None:
        summary["completed"] = completed
    if arguments.contours:
        summary["contours"] = f"{arguments.output}.contours.obj"
        io.write_curves(summary["contours"], curves.isolines(field, arguments.contours), surface)
    if arguments.preview:
        up = "xyz".index(arguments.up)
        view.save_surface(field, arguments.preview, sources, arguments.contours or 20, up)
    text = f"{arguments.output}: {len(field.values)} vertices, φ from {low:.4g} to {high:.4g}"
    if summary["unreached"]:
        text += f", {summary['unreached']} vertices without any source"
    if completed:
        text += f", {completed:.1%} of the curve completed"
    return summary | curves.numbered(field), text + curves.pieces_told(field) + curves.advice(field)
