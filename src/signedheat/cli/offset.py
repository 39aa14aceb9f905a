"""``signedheat offset``: closed surfaces at given distances from a broken shape."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..io import POLYLINE_FORMATS, SHAPE_FORMATS, ensure_writable, save, write_polylines
from ..io.fields import CONFIDENCE
from ..io.files import extension, told_apart
from ..io.labels import LabelImage
from ..io.surface_fields import VALUE_FORMATS, save_with_values
from ..visualization import ensure_picture_writable, save_slices
from .computing import Summary, compute, describe, drawable, grid_for, hint, prefix_errors
from .placing import grid_of_image, image_of, place_of, read_source
from .usage.options import is_planar


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute once, contour and write each."""
    outputs = output_names(arguments.output, arguments.distances)
    planar = is_planar(arguments.shape)
    for output in outputs:
        ensure_offset_writable(output, planar)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    reach = max(abs(distance) for distance in arguments.distances)
    image = image_of(arguments)
    with prefix_errors(arguments.shape):
        shape = read_source(arguments) if image is None else image.surface(arguments.label)
        grid = grid_for(shape, arguments, reach) if image is None else grid_of_image(image, shape, arguments, reach)
        field = compute(shape, grid, arguments)
        found = [field.offset(distance) for distance in arguments.distances]
    for what, output in zip(found, outputs, strict=True):
        if planar:
            write_polylines(output, what)
        else:
            save_surface(field, what, output, image)
    if arguments.preview:
        save_slices(drawable(field), arguments.preview, shape, arguments.distances)
    written = [
        {"distance": distance, "output": output, **counts(what)}
        for distance, output, what in zip(arguments.distances, outputs, found, strict=True)
    ]
    kind = "{lines} lines ({closed} closed), length {length:.6g}" if planar else "closed surface, {faces} faces"
    text = "\n".join(f"{w['output']}: at {w['distance']:+g}, {kind.format(**w)}" for w in written) + hint(field)
    summary = {"input": arguments.shape, "lines" if planar else "surfaces": written, "field": describe(field)}
    return {**summary, **place_of(image)}, text


def save_surface(field: Any, surface: Any, output: str, image: LabelImage | None) -> None:
    """In its place, with the confidence at each vertex where the field knows it and the format has room for it."""
    placed = surface if image is None else image.to_world(surface)
    known = isinstance(field, GridField | BandField) and field.confidence is not None
    if known and extension(output) in VALUE_FORMATS:
        save_with_values(placed, output, CONFIDENCE, field.confidence_at(surface.vertices))
    else:
        save(placed, output)


def ensure_offset_writable(output: str, planar: bool) -> None:
    """Check before computing that a surface, or polylines in the plane, can be written."""
    if planar:
        ensure_writable(output, POLYLINE_FORMATS, "lines in the plane")
    else:
        ensure_writable(output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")


def counts(what: Any) -> dict[str, Any]:
    """Key figures of a surface, or of polylines in the plane."""
    if isinstance(what, list):
        closed = sum(line.closed for line in what)
        return {"lines": len(what), "closed": closed, "length": float(sum(line.length for line in what))}
    return {"vertices": what.n_vertices, "faces": what.n_faces}


def output_names(output: str, distances: list[float]) -> list[str]:
    """The given name for one distance; a name with the distance in it for each of several."""
    path = Path(output)
    if len(distances) == 1 or not path.name:  # a name that is none is refused as it is
        return [output]
    return [str(path.with_name(f"{path.stem}_{number}{path.suffix}")) for number in told_apart(distances)]
