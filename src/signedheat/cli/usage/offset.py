"""``signedheat offset``: closed surfaces at given distances from a broken shape."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .options import (
    add_command,
    add_grid_options,
    add_label_option,
    add_placing_options,
    add_tile_options,
    check_grid_options,
    finite,
)


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "offset",
        help="closed surfaces at given distances",
        description="Closed surfaces at given distances from a shape, broken or not; in the plane, lines. Several "
        "distances make several files: OUT.stl becomes OUT_+0.2.stl, OUT_-0.1.stl.",
    )
    parser.usage = "%(prog)s SHAPE DISTANCE [DISTANCE ...] -o OUT [options]"
    parser.add_argument(
        "shape",
        metavar="SHAPE",
        help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc; in the plane, polylines: .svg .csv",
    )
    parser.add_argument(
        "distances",
        metavar="DISTANCE",
        type=finite,
        nargs="+",
        help="positive outside, negative inside, 0 the closed shape",
    )
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="surface: .stl .obj .ply .off .vtp; lines: .svg .csv"
    )
    add_label_option(parser)
    add_placing_options(parser)
    add_grid_options(parser)
    add_tile_options(parser)
    parser.set_defaults(check=check_offset_options)


def check_offset_options(arguments: Namespace) -> None:
    """Reject options that contradict each other, and distances beyond a band."""
    check_grid_options(arguments)
    if arguments.output == "-" and len(arguments.distances) > 1:
        arguments.parser.error("standard output takes one surface: name a file, or give one distance")
    reach = max(abs(distance) for distance in arguments.distances)
    if arguments.band is not None and reach > arguments.band:
        arguments.parser.error(f"the band reaches to {arguments.band:g}, and the distances to {reach:g}")
