"""Commands that show: `view` a file, `deviation` of a scan, and the `demo`."""

from __future__ import annotations

import ctypes
import os
import sys
from argparse import Namespace
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import signedheat as sh

from ..errors import FileFormatError, MissingPackageError, printable
from ..jobs import run_limited
from .late_imports import inspection, samples
from .late_imports import operands as shapes
from .options import UP, Summary, command, is_quiet, option, positive, whole_number
from .terminal import ProgressBar, say

PATIENCE = 5.0
"""Seconds within which a display must answer."""
DISTANCE = 0.15
"""Of the surface around the duck of the demo."""


@command(
    "view",
    "a shape or a field in a window, or as a picture",
    "In a window where there is a display and PyVista; otherwise, or with --output, as a picture: slices through a "
    "field; a shape, outsides yellow, insides red.",
    option("file", metavar="FILE", help="a shape or a field"),
    UP,
    option("-o", "--output", metavar="FILE", help="picture: .png .pdf .svg .jpg (a window, or FILE.png here)"),
)
def view(arguments: Namespace) -> Summary:
    """Draw."""
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
    """Whether there is an X server: where there is none, VTK shows nothing, and says so in no way."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
        library.XOpenDisplay.restype, library.XOpenDisplay.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        library.XCloseDisplay.argtypes = [ctypes.c_void_p]
        found = run_limited(lambda: library.XOpenDisplay(os.fsencode(name)), PATIENCE)
    except (OSError, TimeoutError):  # no such library, or a server that says nothing
        found = None
    if found:
        library.XCloseDisplay(found)
        return True
    say(f"signedheat: no window can be opened on the display {name}: a picture is written instead")
    return False


def shape_or_field(path: str) -> Any:
    """What a file holds; those of tets may hold either."""
    found = shapes.field_or_image(path)
    if isinstance(found, sh.io.LabelImage):
        with shapes.prefix_errors(path):
            return shapes.thing_of(found)
    if found is not None:
        return found
    ending = Path(path).suffix.lower()
    if ending in sh.io.VALUE_FORMATS:
        with suppress(FileFormatError):  # a shape without values
            return sh.load_field(path)
    thing = sh.read(path)
    if isinstance(thing, sh.TetMesh) and ending in sh.io.TET_FIELD_FORMATS:
        with suppress(FileFormatError):
            return sh.load_field(path)
    return thing


def check_deviation(arguments: Namespace) -> None:
    """Take SCAN and NOMINAL from behind the outputs, if those came first; reject a line without them."""
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
    "how far a scan is off a nominal part",
    "Signed distances of a scan's points to a nominal part, positive outside of it: percentiles; the scan in colours, "
    "a picture with the histogram, or a table. Both must be in one place: nothing is aligned.",
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
    option("--tolerance", type=positive, metavar="T", help="say which share of the points is within it"),
    check=check_deviation,
    usage="SCAN NOMINAL [-o OUT ...] [--tolerance T]",
)
def deviation(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, measure, write."""
    for output in arguments.output:
        sh.io.ensure_writable(output, sh.view.DEVIATION_FORMATS, "deviations")
    scan, nominal = sh.read(arguments.scan), sh.read(arguments.nominal)
    with shapes.prefix_errors(arguments.nominal), ProgressBar(is_quiet(arguments)) as progress:
        found = sh.deviation(scan, nominal, progress)
    summary: dict[str, Any] = {"scan": arguments.scan, "nominal": arguments.nominal, **found.figures}
    low, middle, high = found.percentiles((1, 50, 99))
    text = f"{printable(arguments.scan)}: {len(found.of_surface)} points, 98 % of them {low:.4g} to {high:.4g} off "
    text += f"{arguments.nominal}, median {middle:.4g}, root mean square {found.rms:.4g}"
    if arguments.tolerance is not None:
        share = found.within(arguments.tolerance)
        summary |= {"tolerance": arguments.tolerance, "within": share}
        text += f", {share:.2%} within {arguments.tolerance:g}"
    if found.beyond_rim.any():
        text += f"; {summary['beyond_rim']:.2%} beyond the rim of it"
    for output in arguments.output:
        found.save(output)
        text += f"; {output}"
    return summary | {"output": arguments.output}, text


@command(
    "demo",
    "try it on a broken duck that comes along",
    "Make a broken shape, its distance field, an offset surface and a picture.",
    option("-o", "--output", default="demo", metavar="FOLDER", help="where to (demo)"),
    option("--resolution", type=whole_number(8), default=128, metavar="N", help="nodes along the longest side"),
)
def demo(arguments: Namespace) -> Summary:
    """Write everything to one folder."""
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
    except MissingPackageError as error:  # the rest is worth having
        del files["picture.png"]
        if not arguments.quiet:
            say(f"signedheat: no picture is made: {error}")
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
    found: Any = inspection.inspect(shape)
    return (
        f"{found.open_edges} open edges, {found.nonmanifold_edges} nonmanifold, {found.inconsistent_edges} inconsistent"
    )
