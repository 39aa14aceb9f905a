"""``signedheat surface``: signed distance to curves on a surface, at its vertices."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, Literal

import numpy as np

from ..constraints import Free, Soft, ZeroSet
from ..diagnostics import LargeAngles, SharpenedToCurves
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..extensions.curve_distance import curve_distance
from ..extensions.curve_pieces import CurvesTaken
from ..fields.vertex_field import VertexField
from ..io import ensure_writable, read, read_curves, write_curves
from ..io.globe import read_globe_curves
from ..io.surface_fields import VERTEX_FIELD_FORMATS
from ..lowering.surface.memory import refuse_too_many
from ..solver import SignedHeatSolver
from ..visualization import ensure_picture_writable, save_surface
from .computing import Summary, constraint_of, prefix_errors
from .progress import ProgressBar


def surface_and_curves(arguments: Namespace) -> tuple[Any, Any]:
    """The surface, and the curves on it."""
    surface = read_surface(arguments.mesh)
    if arguments.intrinsic and not isinstance(surface, TriangleMesh):
        raise SourceError(
            f"--intrinsic is for triangle meshes; this is a {type(surface).__name__}",
            remedy="leave it out",
            path=arguments.mesh,
        )
    return surface, curves_of(arguments, surface)


def measured(surface: Any, curves: Any, arguments: Namespace) -> VertexField:
    """The distance."""
    with prefix_errors(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        constraint = constraint_of(arguments.constraint)
        intrinsic: bool | Literal["auto"] = True if arguments.intrinsic else "auto"
        field: VertexField
        if arguments.plain or not isinstance(constraint, Free | ZeroSet | Soft):
            field = SignedHeatSolver(surface, arguments.diffusion, progress, intrinsic).distance(curves, constraint)
        else:
            field = curve_distance(
                surface,
                curves,
                constraint=constraint,
                diffusion=arguments.diffusion or 1.0,
                intrinsic=intrinsic,
                as_oriented=arguments.as_oriented,
                every_piece=arguments.every_piece,
                progress=progress,
            )
    return field


def curves_of(arguments: Namespace, surface: Any) -> list[Any]:
    """The curves; on a globe those in longitude and latitude."""
    if not arguments.globe:
        return read_curves(arguments.curves, surface)
    return list(read_globe_curves(arguments.curves, surface))


def advice(field: VertexField) -> str:
    """Advice on options that would make the result more accurate, or nothing."""
    note = None if field.diagnostics.note(SharpenedToCurves) else field.diagnostics.note(LargeAngles)
    return f"; {note}: --intrinsic is more accurate" if note else ""


def numbered(field: VertexField) -> dict[str, Any]:
    """Numbers of the curves that were turned, and of those that were left out, for the summary."""
    note = field.diagnostics.note(CurvesTaken)
    return {"turned": note.turned.tolist(), "left_out": note.left_out.tolist()} if note else {}


def pieces_told(field: VertexField) -> str:
    """The same in words, or nothing."""
    note = field.diagnostics.note(CurvesTaken)
    return f"; {note}" if note else ""


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute, write."""
    ensure_writable(arguments.output, VERTEX_FIELD_FORMATS, "a field on a surface")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    surface, curves = surface_and_curves(arguments)
    field = measured(surface, curves, arguments)
    (field.subdivided() if arguments.subdivide else field).save(arguments.output)
    low, high = float(np.nanmin(field.values)), float(np.nanmax(field.values))
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
    note = field.diagnostics.note(SharpenedToCurves)
    if note:
        summary["completed"] = note.completed_length
    if arguments.contours:
        summary["contours"] = f"{arguments.output}.contours.obj"
        levels = np.linspace(low, high, arguments.contours + 2)[1:-1]
        lines = [curve for level in levels for curve in field.contour(float(level))]
        write_curves(summary["contours"], lines, surface)
    if arguments.preview:
        save_surface(field, arguments.preview, curves, arguments.contours or 20, "xyz".index(arguments.up))
    text = f"{arguments.output}: {len(field.values)} vertices, φ from {low:.4g} to {high:.4g}"
    if summary["unreached"]:
        text += f", {summary['unreached']} vertices without any source"
    if note and note.completed_length > 0:
        text += f", {note.completed_length:.1%} of the curve completed"
    return summary | numbered(field), text + pieces_told(field) + advice(field)


def read_surface(path: str) -> Any:
    """Read a surface domain from a file."""
    surface = read(path)
    if not hasattr(surface, "triangulation"):
        raise SourceError(
            f"curves lie on meshes, points and voxels, and this is a {type(surface).__name__}",
            element="surface",
            path=path,
        )
    if isinstance(surface, TriangleMesh):  # before curves are looked for on it
        with prefix_errors(path):
            refuse_too_many(surface.n_faces, surface.n_faces, "triangles")
    return surface
