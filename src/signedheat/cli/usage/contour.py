"""``signedheat contour``: a level set of a saved field."""

from __future__ import annotations

from typing import Any

from .options import add_command, finite


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "contour",
        help="surface of equal distance in a field",
        description="The closed surface, the curves on a surface or the lines in the plane, on which a field takes a "
        "level.",
    )
    parser.add_argument("field", metavar="FIELD", help=".npz .vti .nrrd .npy .vdb")
    parser.add_argument("level", metavar="LEVEL", type=finite, help="in the units of the field")
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="OUT",
        help="surface: .stl .obj .ply .off .vtp; of a field on a surface, curves: .obj .txt .json; in the plane, "
        "lines: .svg .csv",
    )
