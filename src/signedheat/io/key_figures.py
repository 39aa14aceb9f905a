"""Key figures of fields and shapes, ready for JSON."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Any

import numpy as np

from ..diagnostics import SampledSource
from ..grids.grid_field import GridField
from ..inspection import inspect
from ..kinds import Shape
from ..solids.mesh_orientation import orientation
from ..solids.thickness import widths
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh


def describe(field: Any) -> dict[str, Any]:
    """Return key figures of a field, for ``--json``."""
    if isinstance(field, GridField):
        note = field.diagnostics.note(SampledSource)
        where = {
            "origin": field.grid.origin.tolist(),
            "spacing": field.grid.spacing.tolist(),
            "shape": list(field.grid.shape),
            "area_outside": note.area_outside if note else 0.0,
            "area_cancelled": note.area_cancelled if note else 0.0,
            "confidence": field.surface_confidence,
        }
        if field.blocks is not None:
            where |= {"band": field.width, "blocks": len(field.blocks), "nodes": field.n_nodes}
    else:
        where = {"n_vertices": len(field.values)}
    return {
        **where,
        "minimum": float(np.nanmin(field.values)),
        "maximum": float(np.nanmax(field.values)),
        "notes": {snake(type(note).__name__): note.as_dict() for note in field.diagnostics.notes},
        "seconds": {step: round(seconds, 4) for step, seconds in field.diagnostics.timings.items()},
    }


def snake(name: str) -> str:
    """Convert a class name to a key of JSON.

    Examples
    --------
    >>> snake("BoundsNothing")
    'bounds_nothing'
    """
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def shape_figures(shape: Shape) -> dict[str, object]:
    """Return counts and defects of a shape; for meshes also their orientation, walls and gaps."""
    figures: dict[str, object] = {"kind": type(shape).__name__, **asdict(inspect(shape))}
    if isinstance(shape, TriangleMesh | PolygonMesh):
        oriented = orientation(shape)
        found_widths = widths(oriented.shape)
        figures["orientation"] = oriented.summary
        figures["thickness"] = {**asdict(found_widths), "spacing": found_widths.spacing}
    return figures
