"""Curves on surfaces, for the commands `surface` and `close`."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, Literal

import numpy as np

from ..constraints import Free, Soft, ZeroSet
from ..curves.distance import CurvesTaken, distance_to_curves
from ..diagnostics import LargeAngles, SharpenedToCurves
from ..domains.curves import Curve
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..fields.vertex_field import VertexField
from ..io import read, read_curves
from ..io.globe import read_globe_curves
from ..lowering.surface.discretization import refuse_too_many
from ..solver import SignedHeatSolver
from .computing import constraint_of, prefix_errors
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
            field = distance_to_curves(
                curves,
                surface,
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


def completed(field: VertexField) -> float | None:
    """The fraction of the length that no given curve stands for; None where distance is not to the curves."""
    note = field.diagnostics.note(SharpenedToCurves)
    return None if note is None else note.completed_length


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


def range_of(field: VertexField) -> tuple[float, float]:
    """The least and the greatest value."""
    return float(np.nanmin(field.values)), float(np.nanmax(field.values))


def isolines(field: VertexField, number: int) -> list[Curve]:
    """Contours of a field, equally far apart between its least and its greatest value."""
    levels = np.linspace(*range_of(field), number + 2)[1:-1]
    return [curve for level in levels for curve in field.contour(float(level))]


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
