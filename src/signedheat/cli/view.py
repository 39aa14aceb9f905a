"""``signedheat view``: a shape or a field in a window, or as a picture."""

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

from .options import Summary, add_command, add_up_option
from .parts import computing, images, io, parallel, tets, view
from .streams import say

PATIENCE = 5.0
"""Seconds within which a display must answer."""


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "view",
        run,
        help="a shape or a field in a window, or as a picture",
        description="In a window where there is a display and PyVista; otherwise, or with --output, as a picture: "
        "slices through a field; a shape, outsides yellow, insides red.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape or a field")
    add_up_option(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="picture: .png .pdf .svg .jpg (a window, or FILE.png here)"
    )


def run(arguments: Namespace) -> Summary:
    """Draw."""
    output, up = arguments.output, "xyz".index(arguments.up)
    if output is None and has_window():
        with computing.prefix_errors(arguments.file):
            shape_or_field(arguments.file).plot()
        return {"input": arguments.file, "output": None}, ""
    if output is None:
        output = str(Path(Path(arguments.file).name).with_suffix(".png"))
    view.ensure_picture_writable(output)
    thing = shape_or_field(arguments.file)
    with computing.prefix_errors(arguments.file):
        if isinstance(thing, sh.VertexField):
            view.save_surface(thing, output, up=up)
        elif isinstance(thing, sh.GridField):
            view.save_slices(thing.whole, output)
        elif isinstance(thing, sh.TetField):
            view.save_slices(tets.on_grid(thing), output)
        else:
            view.save_scene(thing.boundary if isinstance(thing, sh.TetMesh) else thing, output, up)
    return {"input": arguments.file, "output": output}, output


def has_window() -> bool:
    """Whether there is a display, and PyVista to open a window on it."""
    if find_spec("pyvista") is None:
        return False
    return sys.platform in ("darwin", "win32") or display_answers()


def display_answers() -> bool:
    """Whether there is an X server: where there is none, VTK shows nothing and goes on."""
    name = os.environ.get("DISPLAY", "")
    if not name:
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
        library.XOpenDisplay.restype, library.XOpenDisplay.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        library.XCloseDisplay.argtypes = [ctypes.c_void_p]
        found = parallel.run_limited(lambda: library.XOpenDisplay(os.fsencode(name)), PATIENCE)
    except (OSError, TimeoutError):  # no such library, or a server that says nothing
        found = None
    if found:
        library.XCloseDisplay(found)
        return True
    say(f"signedheat: no window can be opened on the display {name}: a picture is written instead")
    return False


def shape_or_field(path: str) -> Any:
    """What a file holds; those of tets may hold either."""
    found = images.field_or_image(path)
    if isinstance(found, sh.io.LabelImage):
        with computing.prefix_errors(path):
            return images.thing_of(found)
    if found is not None:
        return found
    if io.files.extension(path) in io.VALUE_FORMATS:
        with suppress(sh.errors.FileFormatError):  # a shape without values
            return io.load_field(path)
    thing = io.read(path)
    if isinstance(thing, sh.TetMesh) and io.files.extension(path) in io.TET_FIELD_FORMATS:
        with suppress(sh.errors.FileFormatError):
            return io.load_field(path)
    return thing
