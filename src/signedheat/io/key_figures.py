"""Key figures of fields and shapes, as dictionaries that JSON can hold."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Any

import numpy as np

from ..diagnostics import SampledSource
from ..fields.field import Field
from ..grids.band import Band
from ..grids.grid import Grid
from ..mesh.welding import indexed
from ..shapes.foreign import as_shape
from ..shapes.inspection import CloudReport, SurfaceReport, TetReport, inspect
from ..solids.mesh_orientation import Orientation, orientation
from ..solids.solid import Solid
from ..solids.thickness import Widths, widths
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh

Report = SurfaceReport | CloudReport | TetReport


def describe(field: Any) -> dict[str, Any]:
    """Return key figures of a field by name, as ``--json`` prints them."""
    if isinstance(field.domain, Grid):
        note = field.diagnostics.note(SampledSource)
        where = {
            "origin": field.domain.origin.tolist(),
            "spacing": field.domain.spacing.tolist(),
            "shape": list(field.domain.shape),
            "area_outside": note.area_outside if note else 0.0,
            "area_cancelled": note.area_cancelled if note else 0.0,
            "confidence": surface_confidence(field),
        }
        if isinstance(field.domain, Band):
            where |= {"band": field.domain.width, "blocks": len(field.domain.blocks), "nodes": field.values.size}
    else:
        where = {"n_vertices": len(field.values)}
    return {
        **where,
        "minimum": float(np.nanmin(field.values)),
        "maximum": float(np.nanmax(field.values)),
        "notes": {snake(type(note).__name__): note.as_dict() for note in field.diagnostics.notes},
        "seconds": {step: round(seconds, 4) for step, seconds in field.diagnostics.timings.items()},
    }


def surface_confidence(field: Field[Grid]) -> float | None:
    """Return the mean confidence at nodes nearer to the surface than a cell; None without confidence or such nodes."""
    cell = float(field.domain.spacing.max())
    near = (field.values < cell) & (field.values > -cell)
    if field.confidence is None or not near.any():
        return None
    return float(field.confidence[near].mean(dtype=np.float64))


def snake(name: str) -> str:
    """Convert a class name to a key of JSON.

    Examples
    --------
    >>> snake("BoundsNothing")
    'bounds_nothing'
    """
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def inspected(thing: Any) -> tuple[Report, Orientation | None, Widths | None]:
    """Return a report on a shape or solid, the orientation of a mesh, and the widths of walls and gaps.

    Only meshes have an orientation, and only meshes and solids have widths; otherwise these are None.
    """
    shape, oriented = as_shape(thing), None
    outwards: TriangleMesh | PolygonMesh | None = None
    if isinstance(thing, Solid):  # there is nothing left to orient, and its completion is no defect
        outwards = TriangleMesh(*indexed(thing.outward)) if thing.bounding.any() else None
    elif isinstance(shape, TriangleMesh | PolygonMesh):
        oriented = orientation(shape)
        outwards = oriented.shape
    return inspect(shape), oriented, None if outwards is None else widths(outwards)


def shape_figures(thing: Any, counts: Report, oriented: Orientation | None, measured: Widths | None) -> dict[str, Any]:
    """Return key figures of a shape or solid by name, from the three results of `inspected`."""
    figures = {"kind": type(thing).__name__, **asdict(counts)}
    if oriented is not None:
        figures["orientation"] = oriented.summary
    if measured is not None:
        figures["thickness"] = {**asdict(measured), "spacing": measured.spacing}
    return figures
