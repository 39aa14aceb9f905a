"""``signedheat contour``: a level set of a saved field."""

from __future__ import annotations

from argparse import Namespace

from ..fields.grid_field import GridField
from ..fields.vertex_field import VertexField
from ..io import (
    CURVE_FORMATS,
    POLYLINE_FORMATS,
    SHAPE_FORMATS,
    ensure_writable,
    load_field,
    save,
    write_curves,
    write_polylines,
)
from ..io.labels import LabelImage
from .computing import Summary, prefix_errors
from .images import field_of, field_or_image
from .offset import counts, ensure_offset_writable


def run(arguments: Namespace) -> Summary:
    """Load, contour, write."""
    known = (SHAPE_FORMATS | CURVE_FORMATS | POLYLINE_FORMATS) - {".xyz", ".pc"}
    ensure_writable(arguments.output, known, "a surface, curves or lines")
    field, image = field_or_image(arguments.field), None
    if field is None:
        field = load_field(arguments.field)  # on tets, or refused
    if isinstance(field, LabelImage):
        field, image = field_of(field), field
    if isinstance(field, VertexField):
        return lines(field, arguments)
    planar = isinstance(field, GridField) and field.grid.dimension == 2
    ensure_offset_writable(arguments.output, planar)
    with prefix_errors(arguments.field):
        found = field.contour(arguments.level)
    if image is not None:
        found = image.to_world(found)
    if planar:
        write_polylines(arguments.output, found)
    else:
        save(found, arguments.output)
    numbers = counts(found)
    summary = {"input": arguments.field, "level": arguments.level, "output": arguments.output, **numbers}
    size = f"{numbers['lines']} lines" if planar else f"{numbers['faces']} faces"
    return summary, f"{arguments.output}: {size}"


def lines(field: VertexField, arguments: Namespace) -> Summary:
    """Curves on a surface."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    with prefix_errors(arguments.field):
        curves = field.contour(arguments.level)
    write_curves(arguments.output, curves, field.domain)
    summary = {"input": arguments.field, "level": arguments.level, "output": arguments.output, "curves": len(curves)}
    return summary, f"{arguments.output}: {len(curves)} curves"
