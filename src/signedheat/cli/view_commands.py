"""Commands that report and draw: `info`, `view`, `deviation`, `thickness` and `demo`."""

from __future__ import annotations

import ctypes
import os
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import signedheat as sh

from ..errors import FileFormatError, MissingPackageError, SignedHeatError, counted, percent, printable
from ..jobs import run_limited
from .late_imports import inputs, inspection, reports, samples, windows
from .late_imports import operands as shapes
from .options import (
    PLACE,
    REPAIR,
    UNITS_OPTION,
    UP,
    Option,
    Summary,
    command,
    is_planar,
    is_quiet,
    option,
    positive,
    whole_number,
)
from .terminal import ProgressBar, say, say_error

DISPLAY_SECONDS = 5.0
"""Seconds to wait for a display to answer. After that, a picture is written instead."""
DEMO_OFFSET = 0.15
"""Distance of the offset surface in the demo."""
CURVE_ENDINGS = (".json",)
"""Extensions of files that hold only curves."""


def check_files(arguments: Namespace) -> None:
    """Move a second file with curves to ``--curves``; exit with an error for curves with several shapes."""
    last = Path(arguments.files[-1]).suffix.lower()
    if len(arguments.files) == 2 and last in CURVE_ENDINGS and arguments.curves is None:
        arguments.curves = arguments.files.pop()
    if arguments.curves is not None and len(arguments.files) > 1:
        arguments.parser.error(f"curves lie on one shape, but {len(arguments.files)} are given")


@command(
    "info",
    "contents and defects of a file",
    "Counts, open, nonmanifold and inconsistent edges, degenerate and duplicate elements, bounds; which way the parts "
    "of a mesh face, doubled walls, bodies within others, sheets, the thinnest wall and gap; the memory that grids "
    "around a shape take. Of a field: its grid and range.",
    option(
        "files",
        metavar="FILE",
        nargs="+",
        help="shapes, polylines in the plane, fields, folders of shapes; a .json file after a shape has curves on it",
    ),
    option("--curves", metavar="CURVES", help="curves on the shape: .json .obj .csv"),
    option(
        "--resolution",
        type=whole_number(2),
        nargs="+",
        default=[64, 128, 256, 512],
        metavar="N",
        help="resolutions at which to estimate memory",
    ),
    check=check_files,
    usage="FILE [FILE ...] [--curves CURVES] [options]",
)
def info(arguments: Namespace) -> Summary:
    """Report the contents and defects of files. If a file cannot be read, the others are reported nevertheless."""
    arguments.files = list(_without_folders(arguments.files))
    if len(arguments.files) == 1:
        return reports.report(arguments.files[0], arguments)
    summaries, texts, failed = [], [], 0
    for file in arguments.files:
        try:
            summary, text = reports.report(file, arguments)
        except SignedHeatError as error:
            say_error(error if error.path else error.at(file))
            failed += 1
        else:
            summaries.append(summary)
            texts.append(text)
    return {"files": summaries, "failed": failed}, "\n\n".join(texts)


def _without_folders(names: list[str]) -> Iterator[str]:
    """Yield names of files, with each folder replaced by the files of shapes in it."""
    for name in names:
        if os.path.isdir(name):
            yield from (str(shape.path) for shape in inputs.expand([name]))
        else:
            yield name


@command(
    "view",
    "show a shape or a field in a window, or as a picture",
    "Opens a window if there is a display and PyVista. Otherwise, or with --output, writes a picture: slices through a "
    "field, a shape with yellow outsides and red insides, or the lines of a drawing.",
    option("file", metavar="FILE", help="a shape, a field, or a drawing (.svg .csv)"),
    UP,
    option("-o", "--output", metavar="FILE", help="picture: .png .pdf .svg .jpg (a window, or FILE.png here)"),
)
def view(arguments: Namespace) -> Summary:
    """Show the file in a window, or write a picture."""
    output, up = arguments.output, "xyz".index(arguments.up)
    if output is None and has_window():
        with shapes.prefix_errors(arguments.file):
            windows.plotter_of(shape_or_field(arguments.file)).show()
        return {"input": arguments.file, "output": None}, ""
    if output is None:
        output = str(Path(Path(arguments.file).name).with_suffix(".png"))
    sh.view.ensure_picture_writable(output)
    thing = shape_or_field(arguments.file)
    with shapes.prefix_errors(arguments.file):
        if isinstance(thing, sh.Field) and not isinstance(thing.domain, sh.Grid | sh.TetMesh):
            sh.view.save_surface(thing, output, up=up)
        elif isinstance(thing, sh.Field):
            sh.view.save_slices(thing, output)
        elif isinstance(thing, list):
            sh.view.save_row([(Path(arguments.file).name, thing)], output)
        else:
            sh.view.save_scene(thing, output, up)
    return {"input": arguments.file, "output": output}, output


def has_window() -> bool:
    """Whether PyVista is installed and there is a display on which it can open a window."""
    if find_spec("pyvista") is None:
        return False
    return sys.platform in ("darwin", "win32") or display_answers()


def display_answers() -> bool:
    """Whether an X server answers, without which VTK would show nothing. If one is named and does not, print a line."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
        library.XOpenDisplay.restype, library.XOpenDisplay.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        library.XCloseDisplay.argtypes = [ctypes.c_void_p]
        display = run_limited(lambda: library.XOpenDisplay(os.fsencode(name)), DISPLAY_SECONDS)
    except (OSError, TimeoutError):  # no such library, or a server that does not answer
        display = None
    if display:
        library.XCloseDisplay(display)
        return True
    say(f"signedheat: no window can be opened on the display {name}: a picture is written instead")
    return False


def shape_or_field(path: str) -> Any:
    """Read the shape, polylines, field or image in a file, for `view`."""
    if is_planar(path):
        return sh.io.read_polylines(path)
    field = shapes.field_or_image(path)
    if isinstance(field, sh.io.LabelImage):
        with shapes.prefix_errors(path):
            return shapes.field_or_boundary(field)
    if field is not None:
        return field
    ending = Path(path).suffix.lower()
    if ending in sh.io.VALUE_FORMATS:
        with suppress(FileFormatError):  # a shape without values
            return sh.read_field(path)
    shape = sh.read(path)
    if isinstance(shape, sh.TetMesh) and ending in sh.io.TET_FIELD_FORMATS:
        with suppress(FileFormatError):  # tets without values
            return sh.read_field(path)
    return shape


def outputs(help: str) -> Option:
    """Return the option ``-o`` that names any number of outputs, with its help."""
    return option("-o", "--output", metavar="OUT", nargs="+", action="extend", default=[], help=help)


def take_inputs(arguments: Namespace, *names: str) -> None:
    """Move inputs that follow ``-o`` from the end of the outputs to the arguments with these names.

    Exit with an error if some are missing.
    """
    given = [getattr(arguments, name) for name in names if getattr(arguments, name) is not None]
    missing = len(names) - len(given)
    if missing:
        given += arguments.output[-missing:]
        del arguments.output[-missing:]
    if len(given) != len(names):
        arguments.parser.error(f"the following arguments are required: {', '.join(names).upper()}")
    for name, path in zip(names, given, strict=True):
        setattr(arguments, name, path)


@command(
    "deviation",
    "deviation of a scan from a nominal part",
    "Signed distances of a scan's points to a nominal part, positive outside: percentiles, shares within tolerances, "
    "the worst points, and optionally the scan in colours, a picture with a histogram, or a table. The scan must be "
    "aligned with the part.",
    option(
        "scan", metavar="SCAN", nargs="?", help="mesh or points: .stl .obj .ply .off .vtp .glb .xyz .pcd .las .laz .e57"
    ),
    option("nominal", metavar="NOMINAL", nargs="?", help="the nominal part, broken or not, also .step"),
    outputs("any of: coloured .ply, picture .png .pdf .svg .jpg, table .csv"),
    option(
        "--tolerance",
        type=positive,
        metavar="T",
        action="append",
        default=[],
        help="report the share of points within; may be repeated",
    ),
    option(
        "--worst",
        type=whole_number(0),
        metavar="N",
        default=10,
        help="list the points with the largest deviations (10)",
    ),
    UNITS_OPTION,
    check=lambda arguments: take_inputs(arguments, "scan", "nominal"),
    usage="SCAN NOMINAL [-o OUT ...] [--tolerance T ...]",
)
def deviation(arguments: Namespace) -> Summary:
    """Report the distances of a scan to a nominal part, and write them to the files that are asked for."""
    for output in arguments.output:
        sh.io.ensure_writable(output, sh.view.DEVIATION_FORMATS, "deviations")
    unit = shapes.unit_in_use(arguments, arguments.scan, arguments.nominal)
    scan, nominal = (shapes.read_shape(arguments, path) for path in (arguments.scan, arguments.nominal))
    with shapes.prefix_errors(arguments.nominal), ProgressBar(is_quiet(arguments)) as progress:
        deviations = sh.deviation(scan, nominal, progress=progress)
    low, median, high = deviations.percentiles((1, 50, 99))
    worst = [
        {"deviation": float(deviations.distances[k]), "at": deviations.points[k].tolist()}
        for k in deviations.worst(arguments.worst)
    ]
    summary: dict[str, Any] = {"scan": arguments.scan, "nominal": arguments.nominal, **deviations.figures}
    summary |= {"units": unit, "within": {f"{t:g}": deviations.within(t) for t in arguments.tolerance}, "worst": worst}
    lines = [
        f"{printable(arguments.scan)}: {counted(len(deviations.of_surface), 'point')}, 98 % of them "
        f"{low:.4g} to {high:.4g}{shapes.unit_suffix(unit)} off {printable(arguments.nominal)}, median {median:.4g}, "
        f"root mean square {deviations.rms:.4g}"
    ]
    if deviations.beyond_rim.any():
        lines[0] += f"; {percent(summary['beyond_rim'])} beyond its rim"
    lines += [f"within ±{t}{shapes.unit_suffix(unit)}: {percent(share)}" for t, share in summary["within"].items()]
    lines += [
        f"{row['deviation']:+.4g}{shapes.unit_suffix(unit)} at {shapes.place(row['at'], scan.bounds)}" for row in worst
    ]
    for output in arguments.output:
        deviations.save(output)
    lines += [printable(output) for output in arguments.output]
    return summary | {"output": arguments.output}, "\n".join(lines)


@command(
    "thickness",
    "thickness of walls, and where they are thinnest",
    "The diameter of the largest ball behind each point of a shape, broken or not: the thickness of walls. Optionally "
    "the shape in colours, arrays, or a picture.",
    option("shape", metavar="SHAPE", nargs="?", help="surface or oriented points: .stl .obj .ply .off .vtp .glb .3mf"),
    outputs("any of: coloured .ply, arrays .npz, picture .png .pdf .svg .jpg"),
    option("--least", type=positive, metavar="T", help="report how much of the area has thinner walls"),
    option("--resolution", type=whole_number(1), metavar="N", help="values along the longest side (64)"),
    PLACE,
    REPAIR,
    check=lambda arguments: take_inputs(arguments, "shape"),
    usage="SHAPE [-o OUT ...] [--least T] [options]",
)
def thickness(arguments: Namespace) -> Summary:
    """Report the thickness of the walls of a shape, and write it to the files that are asked for."""
    for output in arguments.output:
        sh.io.ensure_writable(output, sh.view.THICKNESS_FORMATS, "thickness")
    solid, unit = shapes.solid_of(arguments, arguments.shape), shapes.unit_in_use(arguments, arguments.shape)
    with shapes.prefix_errors(arguments.shape):
        thicknesses = sh.wall_thickness(solid, resolution=arguments.resolution or 64)
        least, point = thicknesses.thinnest
    low, median, high = thicknesses.percentiles([5.0, 50.0, 95.0]).tolist()
    summary: dict[str, Any] = {"input": arguments.shape, "output": arguments.output, "units": unit}
    summary |= {"thinnest": least, "at": point.tolist(), "percentiles": {"5": low, "50": median, "95": high}}
    where = f"{shapes.unit_suffix(unit)} at {shapes.place(point, solid.bounds)}"
    text = f"{printable(arguments.shape)}: thinnest {least:.4g}{where}; "
    text += f"90 % of the area {low:.4g} to {high:.4g}, median {median:.4g}"
    if arguments.least is not None:
        summary["below"] = thicknesses.below(arguments.least)
        text += f"; {percent(summary['below'])} thinner than {arguments.least:g}"
    for output in arguments.output:
        thicknesses.save(output)
    return summary, "\n".join([text, *map(printable, arguments.output)])


@command(
    "demo",
    "try it on a broken duck",
    "Write a broken shape, its distance field, an offset surface and a picture.",
    option("-o", "--output", default="demo", metavar="FOLDER", help="folder for the results (demo)"),
    option("--resolution", type=whole_number(8), default=128, metavar="N", help="nodes along the longest side"),
)
def demo(arguments: Namespace) -> Summary:
    """Write a broken shape and all results to one folder."""
    folder = Path(arguments.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(
            f"cannot be made a folder ({error.strerror})", remedy="name another folder", path=folder
        ) from error
    files = {name: folder / name for name in ("duck.stl", "distance.vti", "offset.stl", "picture.png")}
    for path in files.values():
        sh.io.ensure_writable(path, {path.suffix}, "a file")
    try:
        sh.view.ensure_picture_writable(files["picture.png"])
    except MissingPackageError as error:  # still write the other files
        del files["picture.png"]
        if not arguments.quiet:
            say(f"signedheat: no picture is written: {error}")
    shape = samples.broken_duck()
    shape.save(files["duck.stl"])
    grid = sh.Grid.around(shape.bounds, arguments.resolution, padding=3 * DEMO_OFFSET)
    field = shapes.compute(shape, grid, arguments)
    surface: Any = field.offset(DEMO_OFFSET)
    field.save(files["distance.vti"])
    surface.save(files["offset.stl"])
    lines = [
        f"{files['duck.stl']}: the input: {_defects(shape)}",
        f"{files['distance.vti']}: its signed distance at {' × '.join(map(str, grid.shape))} nodes",
        f"{files['offset.stl']}: the surface {DEMO_OFFSET:g} outside: {_defects(surface)}",
    ]
    if "picture.png" in files:
        sh.view.save_row(
            [
                ("in: holes, noise, flipped and\nduplicate faces", shape),
                ("its signed distance", field, {"shape": shape, "levels": [DEMO_OFFSET], "across": (1,)}),
                (f"out: the closed surface at +{DEMO_OFFSET:g}", surface),
            ],
            files["picture.png"],
        )
        lines.append(f"{files['picture.png']}: a picture of them")
    names = [str(path) for path in files.values()]
    return {"files": names, "distance": DEMO_OFFSET, "field": shapes.describe(field)}, "\n".join(lines)


def _defects(shape: sh.TriangleMesh) -> str:
    """Return words on the open, nonmanifold and inconsistent edges of a mesh."""
    counts: Any = inspection.inspect(shape)
    return (
        f"{counts.open_edges} open edges, {counts.nonmanifold_edges} nonmanifold, "
        f"{counts.inconsistent_edges} inconsistent"
    )
