"""Commands that report and draw: `info`, `view`, `deviation` and `demo`."""

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

from ..errors import FileFormatError, MissingPackageError, SignedHeatError, printable
from ..jobs import run_limited
from .late_imports import inputs, inspection, reports, samples
from .late_imports import operands as shapes
from .options import UP, Summary, command, is_quiet, option, positive, whole_number
from .terminal import ProgressBar, say, say_error

PATIENCE = 5.0
"""Seconds to wait for a display to answer."""
DISTANCE = 0.15
"""Offset of the surface in the demo."""
CURVES = (".json",)
"""Extensions of files that hold only curves."""


def check_files(arguments: Namespace) -> None:
    """Take a second file with curves as ``--curves``; reject curves with several shapes."""
    last = Path(arguments.files[-1]).suffix.lower()
    if len(arguments.files) == 2 and last in CURVES and arguments.curves is None:
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
    """Inspect files; one that cannot be read does not stop the others."""
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
    """The names of files, with each folder replaced by its shapes."""
    for name in names:
        if os.path.isdir(name):
            yield from (str(shape.path) for shape in inputs.expand([name]))
        else:
            yield name


@command(
    "view",
    "show a shape or a field in a window, or as a picture",
    "Opens a window if there is a display and PyVista. Otherwise, or with --output, writes a picture: slices through a "
    "field, or a shape with yellow outsides and red insides.",
    option("file", metavar="FILE", help="a shape or a field"),
    UP,
    option("-o", "--output", metavar="FILE", help="picture: .png .pdf .svg .jpg (a window, or FILE.png here)"),
)
def view(arguments: Namespace) -> Summary:
    """Show the file in a window, or write a picture."""
    output, up = arguments.output, "xyz".index(arguments.up)
    if output is None and has_window():
        with shapes.prefix_errors(arguments.file):
            shape_or_field(arguments.file).plot()
        return {"input": arguments.file, "output": None}, ""
    if output is None:
        output = str(Path(Path(arguments.file).name).with_suffix(".png"))
    sh.view.ensure_picture_writable(output)
    thing = shape_or_field(arguments.file)
    with shapes.prefix_errors(arguments.file):
        if isinstance(thing, sh.VertexField):
            sh.view.save_surface(thing, output, up=up)
        elif isinstance(thing, sh.GridField | sh.TetField):
            sh.view.save_slices(thing, output)
        else:
            sh.view.save_scene(thing, output, up)
    return {"input": arguments.file, "output": output}, output


def has_window() -> bool:
    """Whether there is a display, and PyVista to open a window on it."""
    if find_spec("pyvista") is None:
        return False
    return sys.platform in ("darwin", "win32") or display_answers()


def display_answers() -> bool:
    """Whether an X server answers; without one, VTK would silently show nothing."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
        library.XOpenDisplay.restype, library.XOpenDisplay.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        library.XCloseDisplay.argtypes = [ctypes.c_void_p]
        display = run_limited(lambda: library.XOpenDisplay(os.fsencode(name)), PATIENCE)
    except (OSError, TimeoutError):  # no such library, or a server that does not answer
        display = None
    if display:
        library.XCloseDisplay(display)
        return True
    say(f"signedheat: no window can be opened on the display {name}: a picture is written instead")
    return False


def shape_or_field(path: str) -> Any:
    """Read the shape or field in a file."""
    field = shapes.field_or_image(path)
    if isinstance(field, sh.io.LabelImage):
        with shapes.prefix_errors(path):
            return shapes.thing_of(field)
    if field is not None:
        return field
    ending = Path(path).suffix.lower()
    if ending in sh.io.VALUE_FORMATS:
        with suppress(FileFormatError):  # a shape without values
            return sh.load_field(path)
    shape = sh.read(path)
    if isinstance(shape, sh.TetMesh) and ending in sh.io.TET_FIELD_FORMATS:
        with suppress(FileFormatError):  # tets without values
            return sh.load_field(path)
    return shape


def check_deviation(arguments: Namespace) -> None:
    """Take SCAN and NOMINAL from the end of the outputs if they follow ``-o``; exit if they are missing."""
    shapes_named = [name for name in (arguments.scan, arguments.nominal) if name is not None]
    missing = 2 - len(shapes_named)
    if missing:
        shapes_named += arguments.output[-missing:]
        del arguments.output[-missing:]
    if len(shapes_named) != 2:
        arguments.parser.error("the following arguments are required: SCAN, NOMINAL")
    arguments.scan, arguments.nominal = shapes_named


@command(
    "deviation",
    "deviation of a scan from a nominal part",
    "Signed distances of a scan's points to a nominal part, positive outside: percentiles, and optionally the scan in "
    "colours, a picture with a histogram, or a table. The scan must be aligned with the part.",
    option(
        "scan", metavar="SCAN", nargs="?", help="mesh or points: .stl .obj .ply .off .vtp .glb .xyz .pcd .las .laz .e57"
    ),
    option("nominal", metavar="NOMINAL", nargs="?", help="the part as it should be, broken or not, also .step"),
    option(
        "-o",
        "--output",
        metavar="OUT",
        nargs="+",
        action="extend",
        default=[],
        help="any of: coloured .ply, picture .png .pdf .svg .jpg, table .csv",
    ),
    option("--tolerance", type=positive, metavar="T", help="report the share of points within this distance"),
    check=check_deviation,
    usage="SCAN NOMINAL [-o OUT ...] [--tolerance T]",
)
def deviation(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, measure, write."""
    for output in arguments.output:
        sh.io.ensure_writable(output, sh.view.DEVIATION_FORMATS, "deviations")
    scan, nominal = sh.read(arguments.scan), sh.read(arguments.nominal)
    with shapes.prefix_errors(arguments.nominal), ProgressBar(is_quiet(arguments)) as progress:
        deviations = sh.deviation(scan, nominal, progress)
    summary: dict[str, Any] = {"scan": arguments.scan, "nominal": arguments.nominal, **deviations.figures}
    low, median, high = deviations.percentiles((1, 50, 99))
    n_points = len(deviations.of_surface)
    text = f"{printable(arguments.scan)}: {n_points} points, 98 % of them {low:.4g} to {high:.4g} off "
    text += f"{arguments.nominal}, median {median:.4g}, root mean square {deviations.rms:.4g}"
    if arguments.tolerance is not None:
        share = deviations.within(arguments.tolerance)
        summary |= {"tolerance": arguments.tolerance, "within": share}
        text += f", {share:.2%} within {arguments.tolerance:g}"
    if deviations.beyond_rim.any():
        text += f"; {summary['beyond_rim']:.2%} beyond its rim"
    for output in arguments.output:
        deviations.save(output)
        text += f"; {output}"
    return summary | {"output": arguments.output}, text


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
            f"cannot be made a folder ({error.strerror})", remedy="name another", path=folder
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
    grid = sh.Grid.around(shape.bounds, arguments.resolution, padding=3 * DISTANCE)
    field = shapes.compute(shape, grid, arguments)
    surface: Any = field.offset(DISTANCE)
    field.save(files["distance.vti"])
    surface.save(files["offset.stl"])
    lines = [
        f"{files['duck.stl']}: the input: {_defects(shape)}",
        f"{files['distance.vti']}: its signed distance at {' × '.join(map(str, grid.shape))} nodes",
        f"{files['offset.stl']}: the surface {DISTANCE:g} outside: {_defects(surface)}",
    ]
    if "picture.png" in files:
        sh.view.save_row(
            files["picture.png"],
            ("in: holes, noise, flipped and\nduplicate faces", shape),
            ("its signed distance", field, {"shape": shape, "levels": [DISTANCE], "across": (1,)}),
            (f"out: the closed surface at +{DISTANCE:g}", surface),
        )
        lines.append(f"{files['picture.png']}: a picture of them")
    names = [str(path) for path in files.values()]
    return {"files": names, "distance": DISTANCE, "field": shapes.describe(field)}, "\n".join(lines)


def _defects(shape: sh.TriangleMesh) -> str:
    counts: Any = inspection.inspect(shape)
    return (
        f"{counts.open_edges} open edges, {counts.nonmanifold_edges} nonmanifold, "
        f"{counts.inconsistent_edges} inconsistent"
    )
