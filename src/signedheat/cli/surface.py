"""``signedheat surface``: signed distance to curves on a surface, at its vertices."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np

from ..constraints import LevelValues, ZeroSet
from ..diagnostics import LargeAngles
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..fields.vertex_field import VertexField
from ..io import ensure_writable, read, read_curves, write_curves
from ..io.surface_fields import VERTEX_FIELD_FORMATS
from ..solver import SignedHeatSolver
from ..visualization import ensure_picture_writable, save_surface
from .computing import prefix_errors
from .options import Parser, Summary, add_command, constraint, finite, positive, whole_number
from .progress import ProgressBar


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "surface",
        run=lambda arguments: run(parser, arguments),
        help="signed distance to curves on a surface",
        description="Signed distance on a mesh, a point cloud or the boundary of a set of voxels to curves, broken or "
        "not, and to points on it.",
    )
    add_curves_and_output(parser, "field: .ply .vtp .obj .npz")
    parser.add_argument(
        "--contours", type=whole_number(1), metavar="N", help="write N isolines beside the output, as OUT.contours.obj"
    )
    parser.add_argument("--preview", metavar="PNG", help="draw the result")


def add_curves_and_output(parser: Parser, output: str) -> None:
    """Add the arguments of a distance to curves on a surface, and of its output."""
    parser.add_argument(
        "mesh", metavar="MESH", help="surface, points or voxels: .obj .ply .stl .off .vtp .glb .pc .xyz .npy .nrrd .vti"
    )
    parser.add_argument("curves", metavar="CURVES", help="curves and points on it: .txt .obj .json .csv")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help=output)
    parser.add_argument(
        "--constraint",
        type=surface_constraint,
        default=ZeroSet(),
        metavar="C",
        help="free, zero-set (default), hard, each-component, soft:WEIGHT, or levels:V,V,…, one for each curve",
    )
    parser.add_argument(
        "--diffusion",
        type=positive,
        default=1.0,
        metavar="T",
        help="diffusion time in squared spacings (1); larger values close gaps more roundly",
    )
    parser.add_argument(
        "--intrinsic",
        action="store_true",
        help="measure on better triangles of the same surface: for meshes with large angles, curves across faces",
    )


def measured(arguments: Namespace) -> tuple[Any, Any, Any]:
    """The surface, the curves, and the distance."""
    surface = read_surface(arguments.mesh)
    if arguments.intrinsic and not isinstance(surface, TriangleMesh):
        raise SourceError(
            f"--intrinsic is for triangle meshes; this is a {type(surface).__name__}",
            remedy="leave it out",
            path=arguments.mesh,
        )
    curves = read_curves(arguments.curves, surface)
    with prefix_errors(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        solver = SignedHeatSolver(surface, arguments.diffusion, progress, arguments.intrinsic)
        field = solver.distance(curves, arguments.constraint)
    return surface, curves, field


def advice(field: VertexField) -> str:
    """Advice on options that would make the result more accurate, or nothing."""
    note = field.diagnostics.note(LargeAngles)
    return f"; {note}: --intrinsic is more accurate" if note else ""


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute, write."""
    ensure_writable(arguments.output, VERTEX_FIELD_FORMATS, "a field on a surface")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    surface, curves, field = measured(arguments)
    field.save(arguments.output)
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
    if arguments.contours:
        summary["contours"] = f"{arguments.output}.contours.obj"
        levels = np.linspace(low, high, arguments.contours + 2)[1:-1]
        lines = [curve for level in levels for curve in field.contour(float(level))]
        write_curves(summary["contours"], lines, surface)
    if arguments.preview:
        save_surface(field, arguments.preview, curves, arguments.contours or 20)
    text = f"{arguments.output}: {len(field.values)} vertices, φ from {low:.4g} to {high:.4g}"
    if summary["unreached"]:
        text += f", {summary['unreached']} vertices without any source"
    return summary, text + advice(field)


def read_surface(path: str) -> Any:
    """Read a surface domain from a file."""
    surface = read(path)
    if not hasattr(surface, "triangulation"):
        raise SourceError(
            f"curves lie on meshes, points and voxels, and this is a {type(surface).__name__}",
            element="surface",
            path=path,
        )
    return surface


def surface_constraint(word: str) -> Any:
    """A constraint from its name on the command line; on surfaces also given levels."""
    name, _, values = word.partition(":")
    if name == "levels":
        return LevelValues([finite(value) for value in values.split(",")])
    return constraint(word, with_numbers="soft:WEIGHT, levels:V,V,…")
