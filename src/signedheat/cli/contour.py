"""``signedheat contour``: a level set of a saved field."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import Summary, add_command, add_format_option, finite
from .parts import computing, images, io, surfaces


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "contour",
        run,
        help="surface of equal distance in a field",
        description="The closed surface, the curves on a surface or the lines in the plane, on which a field takes a "
        "level.",
    )
    parser.add_argument("field", metavar="FIELD", help=".npz .vti .nrrd .npy .vdb")
    parser.add_argument("level", metavar="LEVEL", type=finite, help="in the units of the field")
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="OUT",
        help="surface: .stl .obj .ply .off .vtp; of a field on a surface, curves: .obj .txt .json; in the plane, "
        "lines: .svg .csv",
    )
    add_format_option(parser, "stl")


def run(arguments: Namespace) -> Summary:
    """Load, contour, write."""
    known = (io.SHAPE_FORMATS | io.CURVE_FORMATS | io.POLYLINE_FORMATS) - {".xyz", ".pc"}
    io.ensure_writable(arguments.output, known, "a surface, curves or lines")
    field, image = images.field_or_image(arguments.field), None
    if field is None:
        field = io.load_field(arguments.field)  # on tets, or refused
    if isinstance(field, sh.io.LabelImage):
        field, image = images.field_of(field), field
    if isinstance(field, sh.VertexField):
        return lines(field, arguments)
    planar = isinstance(field, sh.GridField) and field.grid.dimension == 2
    surfaces.ensure_offset_writable(arguments.output, planar)
    with computing.prefix_errors(arguments.field):
        found = field.contour(arguments.level)
    if image is not None:
        found = image.to_world(found)
    if planar:
        io.write_polylines(arguments.output, found)
    else:
        io.save(found, arguments.output)
    numbers = surfaces.counts(found)
    summary = {"input": arguments.field, "level": arguments.level, "output": arguments.output, **numbers}
    size = f"{numbers['lines']} lines" if planar else f"{numbers['faces']} faces"
    return summary, f"{arguments.output}: {size}"


def lines(field: sh.VertexField, arguments: Namespace) -> Summary:
    """Curves on a surface."""
    io.ensure_writable(arguments.output, io.CURVE_FORMATS, "curves")
    with computing.prefix_errors(arguments.field):
        curves = field.contour(arguments.level)
    io.write_curves(arguments.output, curves, field.domain)
    summary = {"input": arguments.field, "level": arguments.level, "output": arguments.output, "curves": len(curves)}
    return summary, f"{arguments.output}: {len(curves)} curves"
