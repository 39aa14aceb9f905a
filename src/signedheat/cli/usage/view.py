"""``signedheat view``: a picture of a shape or a field."""

from __future__ import annotations

from typing import Any

from .options import add_command, add_up_option


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "view",
        help="a shape or a field in a window, on a page, or as a picture",
        description="In a window where there is a display and PyVista; otherwise, or with --output NAME.html, on a "
        "page that any browser shows: turn, slice, choose a level. As a picture: slices through a field; a shape, "
        "outsides yellow, insides red.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape or a field")
    add_up_option(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="page: .html; picture: .png .pdf .svg .jpg (a window, or FILE.html here)"
    )
