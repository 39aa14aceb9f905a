"""Commands about curves on a surface: `surface` measures the distance to them, `close` completes them."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, Literal

import signedheat as sh

from ..errors import SourceError, counted, percent, printable
from ..jobs import reporting
from .late_imports import curve_completion as closing
from .late_imports import curve_distance as distance
from .late_imports import diagnostics, numpy
from .late_imports import operands as shapes
from .late_imports import surface_discretization as discretization
from .options import (
    UNSIGNED_OPTION,
    UP,
    WITHOUT_COMPLETION,
    Option,
    Summary,
    command,
    format_option,
    is_given,
    is_quiet,
    option,
    output,
    positive,
    refuse_together,
    surface_constraint,
    whole_number,
)
from .terminal import ProgressBar


def about_curves(written: str) -> tuple[Option, ...]:
    """Return the arguments and options of commands about curves on a surface; `written` is the help for the output."""
    return (
        option(
            "mesh",
            metavar="MESH",
            help="surface, points or voxels: .obj .ply .stl .off .vtp .glb .pc .xyz .npy .nrrd .vti",
        ),
        option("curves", metavar="CURVES", help="curves and points on it: .obj .json .csv"),
        output(written),
        option(
            "--constraint",
            type=surface_constraint,
            default="zero-set",
            metavar="C",
            help="free, zero-set (default), hard, each-component, soft, soft:WEIGHT, or levels:V,V,…, one for each "
            "curve",
        ),
        option(
            "--diffusion",
            type=positive,
            metavar="T",
            help="diffusion time in squared spacings (1; with --plain three, extrapolated, unless curves end); larger "
            "values close gaps more roundly",
        ),
        option(
            "--intrinsic",
            action="store_true",
            help="run the method on better triangles of the same surface, along whose edges the curves run; by default "
            "on better triangles where the mesh has large angles",
        ),
        option(
            "--plain",
            action="store_true",
            help="the method's own field, of the curves as they are given, not measured to the curves themselves",
        ),
        option("--as-oriented", action="store_true", help="flip no curves, and leave none out"),
        option("--every-piece", action="store_true", help="leave out no stroke, even if it belongs to no other"),
    )


def check_curves(arguments: Namespace) -> None:
    """Exit with an error if ``--as-oriented`` has no effect, or ``--contours`` is given with standard output."""
    refuse_together(arguments, "--as-oriented", WITHOUT_COMPLETION)
    if arguments.output == "-" and is_given(arguments, "--contours"):
        arguments.parser.error("--contours writes a file next to the output: name a file instead of standard output")


@command(
    "surface",
    "signed distance to curves on a surface",
    "Signed distance on a mesh, a point cloud or the boundary of a set of voxels to curves, broken or not, and to "
    "points on it.",
    *about_curves("field: .ply .vtp .obj .npz"),
    UNSIGNED_OPTION,
    option(
        "--contours",
        type=whole_number(1, 1000),
        metavar="N",
        help="write N isolines next to the output, as OUT.contours.obj",
    ),
    option(
        "--subdivide",
        action="store_true",
        help="write the flat polygons of the surface on which the field is linear, where it was computed on better "
        "triangles than those of the mesh, whose vertices come first",
    ),
    *(option("--preview", metavar="PNG", help="draw the result"), UP, format_option("ply")),
    check=check_curves,
)
def surface(arguments: Namespace) -> Summary:
    """Write the distance to curves on a surface, and with ``--contours`` its isolines."""
    sh.io.ensure_writable(arguments.output, sh.io.VERTEX_FIELD_FORMATS, "a field on a surface")
    domain, sources = surface_and_curves(arguments)
    field = distance_on_surface(domain, sources, arguments)
    (field.expand() if arguments.subdivide else field).save(arguments.output)
    low, high = float(numpy.nanmin(field.values)), float(numpy.nanmax(field.values))
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
    measured_to = field.diagnostics.note(diagnostics.SharpenedToCurves)
    if measured_to is not None:
        summary["completed"] = measured_to.completed_length
    if arguments.contours:
        summary["contours"] = f"{arguments.output}.contours.obj"
        levels = numpy.linspace(low, high, arguments.contours + 2)[1:-1].tolist()
        lines: Any = map(field.contour, levels)
        isolines = [curve for at_level in lines for curve in at_level]
        sh.io.write_curves(isolines, summary["contours"], domain)
    if arguments.preview:
        up = "xyz".index(arguments.up)
        sh.view.save_surface(field, arguments.preview, sources, arguments.contours or 20, up)
    text = f"{printable(arguments.output)}: {counted(len(field.values), 'vertex')}, φ from {low:.4g} to {high:.4g}"
    if summary["unreached"]:
        text += f", {counted(summary['unreached'], 'vertex')} without any source"
    if summary.get("completed"):
        text += f", {percent(summary['completed'])} of the curve completed"
    text = _with_curve_counts(field, summary, text)
    angles = None if measured_to is not None else field.diagnostics.note(diagnostics.LargeAngles)
    return summary, text + (f"; {angles}: --intrinsic is more accurate" if angles else "")


@command(
    "close",
    "complete broken curves on a surface",
    "The zero set of the signed distance to broken curves: closed, except for ends at the boundary of the surface.",
    *about_curves("completed curves: .obj .json"),
    option("--preview", metavar="PNG", help="draw the distance, with the completed curves"),
    *(UP, format_option("json")),
    check=check_curves,
)
def close(arguments: Namespace) -> Summary:
    """Write the completed curves on a surface."""
    sh.io.ensure_writable(arguments.output, sh.io.CURVE_FORMATS, "curves")
    domain, sources = surface_and_curves(arguments)
    with shapes.prefix_errors(arguments.curves), ProgressBar(is_quiet(arguments)) as progress:
        closing.refuse_without_sides(sources)
        constraint = shapes.constraint_of(arguments.constraint)
        if arguments.plain and not arguments.intrinsic:
            field = sh.SignedHeatSolver(domain, arguments.diffusion, progress).distance(sources, constraint)
            completed = closing.zero_set(field, sources)
        else:
            with reporting(progress):
                field, completed = closing.completion(
                    domain,
                    sources,
                    constraint,
                    arguments.diffusion or 1.0,
                    arguments.as_oriented or arguments.plain,
                    arguments.every_piece,
                )
    sh.io.write_curves(completed, arguments.output, domain)
    if arguments.preview:
        sh.view.save_surface(field, arguments.preview, completed, up="xyz".index(arguments.up))
    closed = sum(curve.closed for curve in completed)
    summary = {
        "mesh": arguments.mesh,
        "curves": arguments.curves,
        "output": arguments.output,
        "n_curves": len(completed),
        "n_closed": closed,
    }
    curve = "curve" if len(completed) == 1 else "curves"
    return summary, _with_curve_counts(
        field, summary, f"{printable(arguments.output)}: {len(completed)} {curve}, {closed} of them closed"
    )


def surface_and_curves(arguments: Namespace) -> tuple[Any, list[Any]]:
    """Read the surface of a command, and the curves and points on it."""
    domain: Any = sh.as_shape(sh.read(arguments.mesh))
    kind = type(domain).__name__
    if not hasattr(domain, "triangulation"):
        raise SourceError(
            f"curves lie on meshes, points and voxels, not on a {kind}", element="surface", path=arguments.mesh
        )
    if isinstance(domain, sh.TriangleMesh):  # refuse large meshes before curves are located on them
        with shapes.prefix_errors(arguments.mesh):
            discretization.refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    elif arguments.intrinsic:
        raise SourceError(
            f"--intrinsic is for triangle meshes; this is a {kind}", remedy="leave it out", path=arguments.mesh
        )
    return domain, sh.io.read_curves(arguments.curves, domain)


def distance_on_surface(domain: Any, sources: list[Any], arguments: Namespace) -> sh.Field[Any]:
    """Return the distance on a surface to curves and points, as the options say."""
    constraint = shapes.constraint_of(arguments.constraint)
    intrinsic: Literal[True, "auto"] = True if arguments.intrinsic else "auto"
    field: sh.Field[Any]
    with shapes.prefix_errors(arguments.curves), ProgressBar(is_quiet(arguments)) as progress:
        if arguments.unsigned:
            field = sh.signed_distance(sources, domain, completion="none", intrinsic=intrinsic, progress=progress)
        elif arguments.plain or not isinstance(
            constraint, sh.constraints.Free | sh.constraints.ZeroSet | sh.constraints.Soft
        ):
            field = sh.SignedHeatSolver(domain, arguments.diffusion, progress, intrinsic).distance(sources, constraint)
        else:
            with reporting(progress):
                field = distance.distance_to_curves(
                    sources,
                    domain,
                    constraint=constraint,
                    diffusion=arguments.diffusion or 1.0,
                    intrinsic=intrinsic,
                    as_oriented=arguments.as_oriented,
                    every_piece=arguments.every_piece,
                )
    return field


def _with_curve_counts(field: sh.Field[Any], summary: dict[str, Any], text: str) -> str:
    """Add the numbers of curves that were flipped or left out to a summary, and return `text` with them."""
    note = field.diagnostics.note(distance.CurvesTaken)
    if note is None:
        return text
    summary |= {"turned": note.turned, "left_out": note.left_out}
    return f"{text}; {note}"
