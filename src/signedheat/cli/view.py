"""``signedheat view``: a shape or a field in a window, on a page, or as a picture."""

from __future__ import annotations

import ctypes
import os
import sys
from argparse import Namespace
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..domains.tet_mesh import TetMesh
from ..errors import FileFormatError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..fields.vertex_field import VertexField
from ..io import load_field, read
from ..io.files import ensure_writable, extension
from ..io.labels import LabelImage
from ..io.surface_fields import VALUE_FORMATS
from ..io.tets import TET_FIELD_FORMATS
from ..parallel import run_limited
from ..visualization import (
    PAGE_FORMATS,
    PICTURE_FORMATS,
    ensure_picture_writable,
    save_page,
    save_scene,
    save_slices,
    save_surface,
)
from .computing import Summary, drawable, prefix_errors
from .images import field_or_image, thing_of
from .streams import say
from .tets import on_grid

PATIENCE = 5.0
"""Seconds within which a display must answer."""


def run(arguments: Namespace) -> Summary:
    """Draw."""
    output, up = arguments.output, "xyz".index(arguments.up)
    if output is None and has_window():
        with prefix_errors(arguments.file):
            shape_or_field(arguments.file).plot()
        return {"input": arguments.file, "output": None}, ""
    if output is None:
        output = str(Path(Path(arguments.file).name).with_suffix(".html"))
    ensure_output_writable(output)
    thing = shape_or_field(arguments.file)
    with prefix_errors(arguments.file):
        if extension(output) in PAGE_FORMATS:
            save_page(thing, output, Path(arguments.file).name, up)
        elif isinstance(thing, VertexField):
            save_surface(thing, output, up=up)
        elif isinstance(thing, GridField | BandField):
            save_slices(drawable(thing), output)
        elif isinstance(thing, TetField):
            save_slices(on_grid(thing), output)
        else:
            save_scene(thing.boundary if isinstance(thing, TetMesh) else thing, output, up)
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
        found = run_limited(lambda: library.XOpenDisplay(os.fsencode(name)), PATIENCE)
    except (OSError, TimeoutError):  # no such library, or a server that says nothing
        found = None
    if found:
        library.XCloseDisplay(found)
        return True
    say(f"signedheat: no window can be opened on the display {name}: a page is written instead")
    return False


def ensure_output_writable(output: str) -> None:
    """Find out before reading whether the page or the picture can be written."""
    if extension(output) in PICTURE_FORMATS:
        ensure_picture_writable(output)
    else:
        ensure_writable(output, PAGE_FORMATS | PICTURE_FORMATS, "a page or a picture")


def shape_or_field(path: str) -> Any:
    """What a file holds; those of tets may hold either."""
    found = field_or_image(path)
    if isinstance(found, LabelImage):
        with prefix_errors(path):
            return thing_of(found)
    if found is not None:
        return found
    if extension(path) in VALUE_FORMATS:
        with suppress(FileFormatError):  # a shape without values
            return load_field(path)
    thing = read(path)
    if isinstance(thing, TetMesh) and extension(path) in TET_FIELD_FORMATS:
        with suppress(FileFormatError):
            return load_field(path)
    return thing
