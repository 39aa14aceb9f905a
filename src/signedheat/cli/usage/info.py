"""``signedheat info``: contents and defects of a file, and the memory that a grid around it takes."""

from __future__ import annotations

from typing import Any

from .options import add_command, whole_number


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "info",
        help="what a file holds and what is wrong with it",
        description="Counts, open, nonmanifold and inconsistent edges, degenerate and duplicate elements, bounds; "
        "which way the parts of a mesh face, doubled walls, bodies within others, sheets, the thinnest wall and gap; "
        "the memory that grids around a shape take. Of a field: its grid and range.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape, polylines in the plane or a field")
    parser.add_argument("curves", metavar="CURVES", nargs="?", help="curves on the shape: .txt .obj .json")
    parser.add_argument(
        "--resolution",
        type=whole_number(2),
        nargs="+",
        default=[64, 128, 256, 512],
        metavar="N",
        help="resolutions at which to estimate memory",
    )
