"""``signedheat morph``: morphological operations on a broken shape."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .options import (
    add_command,
    add_method_options,
    add_placing_options,
    add_room_options,
    add_step_options,
    check_grid_options,
    finite,
)

DISTANCES = {
    "dilate": (1, 1),
    "erode": (1, 1),
    "opening": (1, 1),
    "closing": (1, 1),
    "shell": (2, 2),
    "thicken": (1, 2),
}
"""The least and the greatest number of distances that each operation takes."""


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "morph",
        help="grow, shrink, open, close, hollow or thicken a shape",
        description="Morphology by offsets of the completed signed distance. dilate, erode, opening, closing take one "
        "distance; shell takes the signed distances of its two sides; thicken takes its reach on the side of the "
        "normals and, if it differs, on the other side.",
    )
    parser.add_argument("operation", metavar="OPERATION", choices=DISTANCES, help=", ".join(DISTANCES))
    parser.add_argument(
        "shape", metavar="SHAPE", help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc"
    )
    parser.add_argument("distances", metavar="DISTANCE", type=finite, nargs="+", help="in the units of the file")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="surface: .stl .obj .ply .off .vtp")
    add_placing_options(parser)
    add_room_options(parser)
    add_step_options(parser)
    add_method_options(parser)
    parser.add_argument("--preview", metavar="PNG", help="draw the distance to the shape in slices, with the offsets")
    parser.set_defaults(origin=None, grid_shape=None, mask=None, band=None)
    parser.set_defaults(check=check)


def check(arguments: Namespace) -> None:
    """Reject a wrong number of distances, and options that contradict each other."""
    check_grid_options(arguments)
    if arguments.operation == "thicken" and (arguments.as_oriented or arguments.keep_overlaps or arguments.plain):
        arguments.parser.error("--as-oriented, --keep-overlaps and --plain are for solids, and thicken takes sheets")
    fewest, most = DISTANCES[arguments.operation]
    if not fewest <= len(arguments.distances) <= most:
        wanted = str(fewest) if fewest == most else f"{fewest} or {most}"
        given = f"{arguments.operation} takes {wanted}, not {len(arguments.distances)}"
        arguments.parser.error(f"argument DISTANCE: {given}")
