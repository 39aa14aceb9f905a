"""``signedheat view``: a picture of a shape or a field."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..fields.vertex_field import VertexField
from ..io import FIELD_FORMATS, ensure_writable, load_field, read
from ..io.files import extension
from ..viewing import PICTURE_FORMATS, save_scene, save_slices
from .computing import naming
from .options import Summary, add_command


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "view",
        run=run,
        help="picture of a shape or a field",
        description="Slices through a field; a shape in perspective, outsides yellow, insides red.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape or a field")
    parser.add_argument("-o", "--output", required=True, metavar="PNG", help="picture: .png .pdf .svg .jpg")


def run(arguments: Namespace) -> Summary:
    """Draw."""
    ensure_writable(arguments.output, PICTURE_FORMATS, "a picture")
    is_field = extension(arguments.file) in FIELD_FORMATS
    thing = load_field(arguments.file) if is_field else read(arguments.file)
    with naming(arguments.file):
        if isinstance(thing, VertexField):
            from ..surface_pictures import save_surface

            save_surface(thing, arguments.output)
        else:
            (save_slices if is_field else save_scene)(thing, arguments.output)
    return {"input": arguments.file, "output": arguments.output}, arguments.output
