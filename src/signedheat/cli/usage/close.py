"""``signedheat close``: completes broken curves on a surface."""

from __future__ import annotations

from typing import Any

from .options import add_command, add_up_option
from .surface import add_curves_and_output


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "close",
        help="complete broken curves on a surface",
        description="The zero set of the signed distance to broken curves: closed, but for ends at the boundary of the "
        "surface.",
    )
    add_curves_and_output(parser, "completed curves: .txt .obj .json")
    parser.add_argument("--preview", metavar="PNG", help="draw the distance, with the completed curves")
    add_up_option(parser)
