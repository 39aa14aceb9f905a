"""``signedheat volume``: signed distance to a broken shape on a grid."""

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
)


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "volume",
        help="signed distance on a grid",
        description="Signed distance to a shape, broken or not, at the nodes of a grid in space; or to polylines, "
        "positive to their left, in the plane.",
    )
    parser.usage = "%(prog)s SHAPE -o OUT [options]"
    parser.add_argument(
        "shape",
        metavar="SHAPE",
        help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc; in the plane, polylines: .svg .csv",
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="field: .npz .vti .nrrd .npy .vdb")
    parser.add_argument(
        "--tets",
        nargs="?",
        const="",
        metavar="MESH",
        help="measure on tets, of a .mesh .msh .vtu .vtk .ele file or around the shape; OUT: .vtu .vtk .msh",
    )
    add_label_option(parser)
    add_placing_options(parser)
    add_grid_options(parser)
    add_tile_options(parser)
    parser.set_defaults(check=check)


def check(arguments: Namespace) -> None:
    """Reject options that contradict each other."""
    if arguments.tets is None:
        return check_grid_options(arguments)
    if any(x is not None for x in (arguments.spacing, arguments.origin, arguments.grid_shape, arguments.mask)):
        arguments.parser.error("--spacing, --origin, --shape and --mask are for grids, and do not go with --tets")
    if arguments.tets and (arguments.resolution is not None or arguments.padding is not None):
        arguments.parser.error("--resolution and --padding do not go with a mesh of your own")
