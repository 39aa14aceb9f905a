"""Commands about shapes in space, and drawings in the plane."""

from __future__ import annotations

import operator
from argparse import Namespace
from collections.abc import Callable
from functools import partial, reduce
from pathlib import Path
from typing import Any

import signedheat as sh

from ..errors import Sentence, counted, percent, printable
from ..packages import require
from .late_imports import operands as shapes
from .options import (
    COMPLETION_STEPS,
    FLAT_SHAPE,
    GRID,
    GRID_AROUND,
    LABEL,
    LIDS_OPTION,
    METHOD,
    PLACE,
    PLANE,
    REPAIR,
    SAMPLING,
    SLICES,
    SURFACES,
    TILES,
    UNITS_OPTION,
    UNSIGNED_OPTION,
    Command,
    Summary,
    command,
    finite,
    format_option,
    group,
    is_planar,
    option,
    output,
    positive,
    shape_option,
    whole_number,
)

DISTANCES = {
    "dilate": (1, 1),
    "erode": (1, 1),
    "opening": (1, 1),
    "closing": (1, 1),
    "shell": (2, 2),
    "thicken": (1, 2),
}
"""Least and greatest number of distances of each operation of `morph`, a function of `signedheat.morphology`."""


def check_volume(arguments: Namespace) -> None:
    """Exit with an error if ``--resolution`` or ``--padding`` are given and ``--tets`` names a file."""
    if arguments.tets and (arguments.resolution, arguments.padding) != (None, None):
        arguments.parser.error("--resolution and --padding are for tets around the shape, and --tets names others")


@command(
    "volume",
    "signed distance on a grid",
    "Signed distance to a shape, broken or not, at the nodes of a grid in space; or to polylines, positive to their "
    "left, in the plane.",
    FLAT_SHAPE,
    output("field: .npz .vti .nrrd .npy .vdb"),
    option(
        "--tets",
        nargs="?",
        const="",
        metavar="MESH",
        help="measure on tets, from a .mesh .msh .vtu .vtk .ele file or around the shape; OUT: .vtu .vtk .msh",
    ),
    *(LABEL, PLACE, GRID, COMPLETION_STEPS, METHOD, SLICES, TILES, format_option("npz")),
    check=check_volume,
    usage="SHAPE -o OUT [options]",
)
def volume(arguments: Namespace) -> Summary:
    """Write the distance to a shape on a grid or on tets; a file that cannot be written is refused at once."""
    if arguments.tets is not None:
        return _on_tets(arguments)
    image = shapes.image_of(arguments)
    if image is None:
        sh.io.ensure_field_writable(arguments.output, in_band=arguments.band is not None)
    else:
        image.ensure_writable(arguments.output)
    shape, field = shapes.shape_and_field(arguments, image)
    if image is None:
        field.save(arguments.output)
    else:
        image.save(field, arguments.output)
    if arguments.preview:
        sh.view.save_slices(field, arguments.preview, shape)
    unit = shapes.unit_in_use(arguments, arguments.shape)
    summary = {
        "input": arguments.shape,
        "output": arguments.output,
        **shapes.describe(field),
        **shapes.position_figures(image),
    }
    summary["units"] = unit
    nodes = " × ".join(map(str, field.domain.shape))
    within = "" if arguments.band is None else f" ({summary['nodes']:,} of them there)"
    text = f"{printable(arguments.output)}: {nodes} nodes{within}, {shapes.range_in_words(summary, unit)}"
    return summary, text + shapes.hint_of_doubled_faces(field)


def _on_tets(arguments: Namespace) -> Summary:
    """Write the distance to a shape on tets, for `volume`."""
    sh.io.ensure_writable(arguments.output, sh.io.TET_FIELD_FORMATS, "a field on tets")
    require("meshio", "fields on tets")
    shape, field = shapes.shape_and_field_on_tets(arguments)
    field.save(arguments.output)
    if arguments.preview:
        sh.view.save_slices(field, arguments.preview, shape)
    n_tets, unit = field.domain.n_tets, shapes.unit_in_use(arguments, arguments.shape)
    summary = {"input": arguments.shape, "output": arguments.output, **shapes.describe(field), "n_tets": n_tets}
    summary["units"] = unit
    return summary, f"{printable(arguments.output)}: {counted(n_tets, 'tet')}, {shapes.range_in_words(summary, unit)}"


def check_offset(arguments: Namespace) -> None:
    """Exit with an error for distances beyond a band, and for several surfaces on standard output."""
    if arguments.output == "-" and len(arguments.distances) > 1:
        arguments.parser.error("standard output takes one surface: name a file, or give one distance")
    reach = max(map(abs, arguments.distances))
    if arguments.band is not None and reach > arguments.band:
        arguments.parser.error(f"the band reaches to {arguments.band:g}, and the distances to {reach:g}")


@command(
    "offset",
    "closed surfaces at given distances",
    "Closed surfaces at given distances from a shape, broken or not; in the plane, lines. Several distances make "
    "several files: OUT.stl becomes OUT_+0.2.stl, OUT_-0.1.stl.",
    FLAT_SHAPE,
    option(
        "distances",
        metavar="DISTANCE",
        type=finite,
        nargs="+",
        help="positive outside, negative inside, 0 the closed shape",
    ),
    output(f"{SURFACES}; lines: .svg .csv"),
    *(LABEL, PLACE, GRID, COMPLETION_STEPS, METHOD, SLICES, TILES, format_option("stl")),
    check=check_offset,
    usage="SHAPE DISTANCE [DISTANCE ...] -o OUT [options]",
)
def offset(arguments: Namespace) -> Summary:
    """Write a surface, or lines in the plane, at each distance; the distance field is computed once for all."""
    outputs = shapes.output_names(arguments.output, arguments.distances)
    planar = is_planar(arguments.shape)
    for path in outputs:
        shapes.ensure_surface_writable(path, planar)
    image = shapes.image_of(arguments)
    shape, field = shapes.shape_and_field(arguments, image, max(map(abs, arguments.distances)))
    with shapes.prefix_errors(arguments.shape):
        surfaces = [field.offset(distance) for distance in arguments.distances]
    for surface, path in zip(surfaces, outputs, strict=True):
        shapes.save_level(surface, path, image, field)
    if arguments.preview:
        sh.view.save_slices(field, arguments.preview, shape, arguments.distances)
    written = [
        {"distance": distance, "output": path, **shapes.sizes_of(surface)}
        for distance, path, surface in zip(arguments.distances, outputs, surfaces, strict=True)
    ]
    unit = shapes.unit_in_use(arguments, arguments.shape)
    kind = f"{{lines:line}} ({{closed}} closed), length {{length:.6g}}{shapes.unit_suffix(unit)}"
    kind = kind if planar else "closed surface, {faces} faces"
    text = "\n".join(
        f"{w['output']}: at {w['distance']:+g}{shapes.unit_suffix(unit)}, {Sentence().format(kind, **w)}"
        for w in written
    )
    summary = {
        "units": unit,
        "input": arguments.shape,
        "lines" if planar else "surfaces": written,
        "field": shapes.describe(field),
    }
    return summary | shapes.position_figures(image), text + shapes.hint_of_doubled_faces(field)


def check_morph(arguments: Namespace) -> None:
    """Exit with an error for a wrong number of distances, and for options of other operations."""
    if arguments.operation != "shell" and (arguments.keep_outside or arguments.drain is not None):
        arguments.parser.error("--keep-outside and --drain are for shells")
    if arguments.operation != "thicken" and (arguments.side != "both" or arguments.faces):
        arguments.parser.error("--side and --faces are for sheets: morph thicken")
    fewest, most = DISTANCES[arguments.operation]
    if not fewest <= len(arguments.distances) <= most:
        needed = str(fewest) if fewest == most else f"{fewest} or {most}"
        cause = f"{arguments.operation} takes {needed}, not {len(arguments.distances)}"
        arguments.parser.error(f"argument DISTANCE: {cause}")


@command(
    "morph",
    "grow, shrink, open, close, hollow or thicken a shape",
    "Morphology by offsets of the completed signed distance. dilate, erode, opening, closing take one distance; shell "
    "takes the signed distances of its two sides; thicken takes its reach on the side of the normals and, if it "
    "differs, on the other side.",
    option("operation", metavar="OPERATION", choices=DISTANCES, help=", ".join(DISTANCES)),
    shape_option(),
    option("distances", metavar="DISTANCE", type=finite, nargs="+", help="in the units of the file"),
    output(SURFACES),
    *(PLACE, GRID_AROUND, COMPLETION_STEPS, METHOD),
    group(
        "shells",
        option("--keep-outside", action="store_true", help="keep the faces given, and make the inner side only (D 0)"),
        option("--drain", type=positive, metavar="DIAMETER", help="a hole straight down (-z) from the largest cavity"),
    ),
    group(
        "sheets",
        option(
            "--side", choices=("outside", "inside", "both"), default="both", help="side of the faces, if one D is given"
        ),
        option("--faces", type=whole_number(0), nargs="+", metavar="F", help="thicken these only, counted from 0"),
    ),
    option("--preview", metavar="PNG", help="draw the distance to the shape in slices, with the offsets"),
    format_option("stl"),
    check=check_morph,
)
def morph(arguments: Namespace) -> Summary:
    """Write the surface that an operation of morphology makes of a shape."""
    shapes.ensure_surface_writable(arguments.output)
    shape = shapes.read_shape(arguments, arguments.shape)
    fields: list[sh.Field[sh.Grid]] = []

    def measure(part: Any, grid: sh.Grid) -> sh.Field[sh.Grid]:
        fields.append(shapes.compute(part, grid, arguments))
        return fields[-1]

    sheets: dict[str, Any] = {"side": arguments.side, "faces": arguments.faces}
    options: dict[str, Any] = sheets if arguments.operation == "thicken" else {"measure": measure}
    if arguments.operation == "shell":
        options |= {"keep_outside": arguments.keep_outside, "drain": arguments.drain}
    with shapes.prefix_errors(arguments.shape):
        grid = shapes.grid_for(shape, arguments, max(map(abs, arguments.distances)))
        surface = getattr(sh.morphology, arguments.operation)(shape, *arguments.distances, domain=grid, **options)
    shapes.save_level(surface, arguments.output)
    if arguments.preview and fields:
        inwards = -1 if arguments.operation in ("erode", "opening") else 1
        first_offsets = [inwards * distance for distance in arguments.distances]
        sh.view.save_slices(fields[0], arguments.preview, shape, first_offsets)
    elif arguments.preview:
        sh.view.save_scene(surface, arguments.preview)
    summary = {"input": arguments.shape, "operation": arguments.operation, "distances": arguments.distances}
    summary |= {"output": arguments.output, **shapes.sizes_of(surface)}
    summary |= {"field": shapes.describe(fields[0])} if fields else {}
    return summary, f"{printable(arguments.output)}: {arguments.operation}, closed surface of {surface.n_faces} faces"


@command(
    "fill",
    "close holes of a mesh, and change nothing else",
    "Close holes of a mesh and leave everything else as it is: vertices and faces keep their order, new ones follow. "
    "Sheets stay sheets, with their outlines. `watertight` makes solids of broken shapes.",
    option("mesh", metavar="MESH", help="surface: .stl .obj .ply .off .vtp .glb .3mf"),
    output(SURFACES),
    option("--largest", type=positive, metavar="L", help="fill only holes whose boundary loop is at most this long"),
    option(
        "--rims",
        type=whole_number(0),
        nargs="+",
        metavar="V",
        help="fill only boundary loops through these vertices, counted from 0, including outlines of sheets",
    ),
    *(LIDS_OPTION, format_option("stl")),
    usage="MESH -o OUT [options]",
)
def fill(arguments: Namespace) -> Summary:
    """Write a mesh with its holes, or some of them, closed."""
    shapes.ensure_surface_writable(arguments.output)
    mesh: Any = sh.read(arguments.mesh)
    with shapes.prefix_errors(arguments.mesh):
        filled = sh.fill_holes(mesh, largest=arguments.largest, rims=arguments.rims, lids=arguments.lids)
    sh.save(filled, arguments.output)
    counts = {"filled": len(filled.filled), "left": len(filled.left), "new_faces": int((filled.origins < 0).sum())}
    text = "holes filled: {filled}, by {new_faces} faces; boundary loops left open: {left}".format(**counts)
    if counts["left"] and arguments.largest is None and not arguments.rims:
        text += ", which `signedheat watertight` closes if they bound a solid"
    summary = {"input": arguments.mesh, "output": arguments.output, **counts}
    return summary, f"{printable(arguments.output)}: {text}"


COMBINED = {
    "union": (operator.or_, "what lies in any of the shapes"),
    "intersect": (operator.and_, "what lies in all of the shapes"),
    "subtract": (operator.sub, "the first shape without the others"),
}
"""Commands that combine solids, with the operator of `Solid` and a line of help."""


def check_combined(arguments: Namespace) -> None:
    """Exit with an error if there is only one shape."""
    if len(arguments.files) < 2:
        arguments.parser.error("two shapes or more are combined, not one")


def combined(combine: Callable[[sh.Solid, sh.Solid], sh.Solid], arguments: Namespace) -> Summary:
    """Complete each shape, combine the solids from left to right, and write the result."""
    path = arguments.output
    sh.io.ensure_writable(path, (sh.io.SHAPE_FORMATS | {".npz"}) - {".xyz", ".pc"}, "a surface or a solid")
    unit = shapes.unit_in_use(arguments, *arguments.files)
    result = reduce(combine, [shapes.solid_of(arguments, file) for file in arguments.files])
    result.save(path)
    text = f"{printable(path)}: volume {result.volume:.6g}{shapes.unit_suffix(unit, '³')}"
    text += f", area {result.area:.6g}{shapes.unit_suffix(unit, '²')}"
    figures = {"volume": result.volume, "area": result.area, "units": unit}
    return {"inputs": arguments.files, "output": path, **figures}, text


def combining(name: str) -> Command:
    """Return the command with a name of `COMBINED`."""
    combine, help = COMBINED[name]
    return command(
        name,
        help,
        f"A closed surface around {help}, broken or not. Faces are kept, and cut where they cross.",
        option(
            "files",
            metavar="SHAPE",
            nargs="+",
            help="surfaces or oriented points, in the same coordinates; solids: .npz",
        ),
        output(f"{SURFACES}; solid: .npz"),
        UNITS_OPTION,
        REPAIR,
        format_option("stl"),
        check=check_combined,
        usage="SHAPE SHAPE [...] -o OUT [options]",
    )(partial(combined, combine))


union, intersect, subtract = map(combining, COMBINED)


def check_section(arguments: Namespace) -> None:
    """Exit with an error for several sections on standard output."""
    if arguments.output == "-" and len(arguments.heights) > 1:
        arguments.parser.error("standard output takes one section: name a file, or give one height")


@command(
    "section",
    "outlines where planes cut a shape",
    "Closed outlines where a plane, or parallel ones, cut a shape, broken or not. In the drawing, x and y are those of "
    "the shape if the normal is z; in other planes, the second direction points upwards. Several heights make several "
    "files: OUT.svg becomes OUT_+0.2.svg, OUT_+0.4.svg.",
    shape_option(),
    output("drawing: .svg .csv"),
    PLANE,
    option(
        "--heights",
        type=finite,
        nargs="+",
        default=[0.0],
        metavar="H",
        help="cut at these distances from the origin along the normal (0)",
    ),
    *(PLACE, REPAIR, METHOD, format_option("svg")),
    check=check_section,
    usage="SHAPE -o OUT.svg [options]",
)
def section(arguments: Namespace) -> Summary:
    """Write the outlines, and lines of sheets, in each plane that meets the shape."""
    outputs = shapes.output_names(arguments.output, arguments.heights)
    for path in outputs:
        shapes.ensure_surface_writable(path, planar=True)
    solid = shapes.solid_of(arguments, arguments.shape)
    with shapes.prefix_errors(arguments.shape):
        origin = solid.bounds.mean(axis=0) if arguments.origin is None else arguments.origin
        sections = solid.section(origin, arguments.normal, heights=arguments.heights)
        cut = [(path, part) for path, part in zip(outputs, sections, strict=True) if part.outlines or part.sheets]
        if not cut:
            low, high = (shapes.place(corner, solid.bounds) for corner in solid.bounds)
            raise sh.errors.OutsideError(
                f"no plane meets the shape, which reaches from {low} to {high}",
                remedy="choose another origin, or other heights",
                element="--origin",
            )
    unit = shapes.unit_in_use(arguments, arguments.shape)
    for path, part in cut:
        sh.io.write_polylines([*part.outlines, *part.sheets], path)
    written = [
        {"output": path, "outlines": len(part.outlines), "area": part.area, "lines_of_sheets": len(part.sheets)}
        for path, part in cut
    ]
    text = "\n".join(
        f"{printable(str(w['output']))}: {counted(int(w['outlines']), 'outline')}, area {w['area']:.6g}"
        f"{shapes.unit_suffix(unit, '²')}"
        for w in written
    )
    return {"input": arguments.shape, "units": unit, "sections": written}, text


@command(
    "cut",
    "a shape in two closed halves",
    "Both parts of a shape, broken or not, on the two sides of a plane, each closed by caps: OUT.stl becomes "
    "OUT_above.stl, the side that the normal points to, and OUT_below.stl.",
    shape_option(),
    output(f"{SURFACES}; solid: .npz"),
    *(PLANE, PLACE, REPAIR, METHOD),
    usage="SHAPE -o OUT.stl [options]",
)
def cut(arguments: Namespace) -> Summary:
    """Write both halves of a shape."""
    outputs = [shapes.named_after(arguments.output, side) for side in ("above", "below")]
    for name in outputs:
        sh.io.ensure_writable(name, (sh.io.SHAPE_FORMATS | {".npz"}) - {".xyz", ".pc"}, "a surface or a solid")
    solid = shapes.solid_of(arguments, arguments.shape)
    with shapes.prefix_errors(arguments.shape):
        origin = solid.bounds.mean(axis=0) if arguments.origin is None else arguments.origin
        halves = solid.cut(origin, arguments.normal)
    unit = shapes.unit_in_use(arguments, arguments.shape)
    written = []
    for half, name in zip(halves, outputs, strict=True):
        half.save(name)
        written.append({"output": name, "volume": half.volume, "area": half.area})
    text = "\n".join(
        f"{printable(w['output'])}: volume {w['volume']:.6g}{shapes.unit_suffix(unit, '³')}" for w in written
    )
    return {"input": arguments.shape, "units": unit, "halves": written}, text


@command(
    "sample",
    "points with distances, to learn from",
    "Points near a shape and around it, with exact signed distances and gradients: training data for networks that "
    "learn a distance.",
    shape_option(),
    output("samples: .npz"),
    option("-n", "--samples", type=whole_number(1), default=250_000, metavar="N", help="points (250000)"),
    *(SAMPLING, PLACE, REPAIR, UNSIGNED_OPTION, METHOD, format_option("npz")),
    usage="SHAPE -o OUT.npz [options]",
)
def sample(arguments: Namespace) -> Summary:
    """Complete a shape, and write samples of the distance to it."""
    sh.io.ensure_writable(arguments.output, sh.io.SAMPLE_FORMATS, "samples")
    solid = shapes.solid_of(arguments, arguments.shape)
    with shapes.prefix_errors(arguments.shape):
        samples = sh.sample_distances(
            solid, arguments.samples, near=arguments.near, widths=arguments.widths, seed=arguments.seed
        )
    (samples.normalized() if arguments.normalize else samples).save(arguments.output, arguments.layout)
    figures = samples.figures
    summary = {"input": arguments.shape, "output": arguments.output, **figures}
    inside = float(str(figures["inside_share"]))
    counts = f"{counted(len(samples.points), 'point')}, {figures['near']} near the surface, {percent(inside)} inside"
    return summary, f"{printable(arguments.output)}: {counts}"


@command(
    "contour",
    "surface of equal distance in a field",
    "The closed surface, the curves on a surface or the lines in the plane, on which a field takes a level.",
    option("field", metavar="FIELD", help=".npz .vti .nrrd .npy .nii .nii.gz .ply .vtp .vtu .vtk .msh"),
    option("level", metavar="LEVEL", type=finite, help="in the units of the field"),
    output(f"{SURFACES}; of a field on a surface, curves: .obj .json; in the plane, lines: .svg .csv"),
    format_option("stl"),
)
def contour(arguments: Namespace) -> Summary:
    """Write the surface, curves or lines on which a field takes a level."""
    path = arguments.output
    formats = (sh.io.SHAPE_FORMATS | sh.io.CURVE_FORMATS | sh.io.POLYLINE_FORMATS) - {".xyz", ".pc"}
    sh.io.ensure_writable(path, formats, "a surface, curves or lines")
    image: sh.io.LabelImage | None = None
    field = shapes.field_or_image(arguments.field)
    if field is None:  # a set of voxels or a field on tets; other files are refused
        field = (sh.io.read_labels if Path(arguments.field).suffix == ".npy" else sh.read_field)(arguments.field)
    if isinstance(field, sh.io.LabelImage):
        image = field
        field = shapes.field_of(field)
    on_grid = isinstance(field.domain, sh.Grid)
    on_surface = not on_grid and not isinstance(field.domain, sh.TetMesh)
    if on_surface:
        sh.io.ensure_writable(path, sh.io.CURVE_FORMATS, "curves")
    else:
        shapes.ensure_surface_writable(path, on_grid and field.domain.dimension == 2)
    with shapes.prefix_errors(arguments.field):
        surface = field.contour(arguments.level)
    if on_surface:
        sh.io.write_curves(surface, path, field.domain)
        numbers = {"curves": len(surface)}
    else:
        shapes.save_level(surface, path, image, field if on_grid else None)
        numbers = shapes.sizes_of(surface)
    kind = next(name for name in ("curve", "line", "face") if f"{name}s" in numbers)
    summary = {"input": arguments.field, "level": arguments.level, "output": path, **numbers}
    return summary, f"{printable(path)}: {counted(numbers[f'{kind}s'], kind)}"
