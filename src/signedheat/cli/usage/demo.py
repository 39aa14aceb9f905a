"""``signedheat demo``: distance and offset of a bundled broken duck."""

from __future__ import annotations

from typing import Any

from .options import add_command, whole_number


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "demo",
        help="try it on a broken duck that comes along",
        description="Make a broken shape, its distance field, an offset surface and a picture.",
    )
    parser.add_argument("-o", "--output", default="demo", metavar="FOLDER", help="where to (demo)")
    parser.add_argument(
        "--resolution", type=whole_number(8), default=128, metavar="N", help="nodes along the longest side"
    )
