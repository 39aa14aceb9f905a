"""``signedheat view``: a picture of a shape or a field."""

from __future__ import annotations

from typing import Any

from .options import add_command


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "view",
        help="picture of a shape or a field",
        description="Slices through a field; a shape in perspective, outsides yellow, insides red.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape or a field")
    parser.add_argument("--up", choices="xyz", default="z", help="axis that points upwards (default: z)")
    parser.add_argument("-o", "--output", required=True, metavar="PNG", help="picture: .png .pdf .svg .jpg")
