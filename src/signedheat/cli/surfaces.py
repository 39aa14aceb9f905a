"""Surfaces and lines of equal distance as files, for the commands `offset` and `contour`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..fields.grid_field import GridField
from ..io import POLYLINE_FORMATS, SHAPE_FORMATS, ensure_writable, save
from ..io.fields import CONFIDENCE
from ..io.files import extension, told_apart
from ..io.labels import LabelImage
from ..io.surface_fields import VALUE_FORMATS, save_with_values


def save_surface(field: Any, surface: Any, output: str, image: LabelImage | None) -> None:
    """In its place, with the confidence at each vertex where the field knows it and the format has room for it."""
    placed = surface if image is None else image.to_world(surface)
    known = isinstance(field, GridField) and field.confidence is not None
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
