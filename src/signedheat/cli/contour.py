"""``signedheat contour``: a surface of equal distance from a field computed before."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..fields.vertex_field import VertexField
from ..io import CURVE_FORMATS, SHAPE_FORMATS, ensure_writable, load_field, save, write_curves
from .computing import naming
from .options import Summary, add_command, finite


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "contour",
        run=run,
        help="surface of equal distance in a field",
        description="The closed surface, or the curves on a surface, on which a field takes a level.",
    )
    parser.add_argument("field", metavar="FIELD", help=".npz .vti .nrrd .npy .vdb")
    parser.add_argument("level", metavar="LEVEL", type=finite, help="in the units of the field")
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="OUT",
        help="surface: .stl .obj .ply .off .vtp; of a field on a surface, curves: .obj .txt .json",
    )


def run(arguments: Namespace) -> Summary:
    """Load, contour, write."""
    ensure_writable(arguments.output, (SHAPE_FORMATS | CURVE_FORMATS) - {".xyz", ".pc"}, "a surface or curves")
    field = load_field(arguments.field)
    if isinstance(field, VertexField):
        return lines(field, arguments)
    ensure_writable(arguments.output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    with naming(arguments.field):
        surface = field.contour(arguments.level)
    save(surface, arguments.output)
    summary = {
        "input": arguments.field,
        "level": arguments.level,
        "output": arguments.output,
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
    }
    return summary, f"{arguments.output}: {surface.n_faces} faces"


def lines(field: VertexField, arguments: Namespace) -> Summary:
    """Curves on a surface."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    with naming(arguments.field):
        curves = field.contour(arguments.level)
    write_curves(arguments.output, curves, field.domain)
    summary = {"input": arguments.field, "level": arguments.level, "output": arguments.output, "curves": len(curves)}
    return summary, f"{arguments.output}: {len(curves)} curves"
