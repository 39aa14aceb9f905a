"""``signedheat view``: a picture of a shape or a field."""

from __future__ import annotations

from argparse import Namespace
from contextlib import suppress
from typing import Any

from ..domains.tet_mesh import TetMesh
from ..errors import FileFormatError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..fields.vertex_field import VertexField
from ..io import FIELD_FORMATS, load_field, read
from ..io.files import extension
from ..io.tets import TET_FIELD_FORMATS
from ..visualization import ensure_picture_writable, save_scene, save_slices, save_surface
from .computing import Summary, drawable, prefix_errors
from .tets import on_grid


def run(arguments: Namespace) -> Summary:
    """Draw."""
    ensure_picture_writable(arguments.output)
    thing, up = shape_or_field(arguments.file), "xyz".index(arguments.up)
    with prefix_errors(arguments.file):
        if isinstance(thing, VertexField):
            save_surface(thing, arguments.output, up=up)
        elif isinstance(thing, GridField | BandField):
            save_slices(drawable(thing), arguments.output)
        elif isinstance(thing, TetField):
            save_slices(on_grid(thing), arguments.output)
        else:
            save_scene(thing.boundary if isinstance(thing, TetMesh) else thing, arguments.output, up)
    return {"input": arguments.file, "output": arguments.output}, arguments.output


def shape_or_field(path: str) -> Any:
    """What a file holds; those of tets may hold either."""
    if extension(path) in FIELD_FORMATS:
        return load_field(path)
    thing = read(path)
    if isinstance(thing, TetMesh) and extension(path) in TET_FIELD_FORMATS:
        with suppress(FileFormatError):
            return load_field(path)
    return thing
