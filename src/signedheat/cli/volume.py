"""``signedheat volume``: signed distance to a broken shape on a grid."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .options import (
    LINES,
    Summary,
    add_command,
    add_format_option,
    add_grid_options,
    add_label_option,
    add_placing_options,
    add_shape,
    add_tile_options,
    check_grid_options,
    check_tile_options,
    refuse_together,
)
from .parts import computing, io, placing, tets, view


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "volume",
        run,
        check,
        help="signed distance on a grid",
        description="Signed distance to a shape, broken or not, at the nodes of a grid in space; or to polylines, "
        "positive to their left, in the plane.",
    )
    parser.usage = "%(prog)s SHAPE -o OUT [options]"
    add_shape(parser, LINES)
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
    add_format_option(parser, "npz")


def check(arguments: Namespace) -> None:
    """Reject options that contradict each other."""
    refuse_together(arguments, "--tets", "--spacing", "--origin", "--shape", "--mask", "--band")
    if arguments.tets:  # a mesh of one's own
        refuse_together(arguments, "--tets", "--resolution", "--padding")
    check_grid_options(arguments)
    check_tile_options(arguments)


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    if arguments.tets is not None:
        return tets.run(arguments)
    image = placing.image_of(arguments)
    if image is not None:
        image.ensure_writable(arguments.output)
    else:
        io.ensure_field_writable(arguments.output, in_band=arguments.band is not None)
    if arguments.preview:
        view.ensure_picture_writable(arguments.preview)
    with computing.prefix_errors(arguments.shape):
        if image is None:
            shape = placing.read_source(arguments)
            grid = computing.grid_for(shape, arguments)
        else:
            shape = image.surface(arguments.label)
            grid = placing.grid_of_image(image, shape, arguments)
        field = computing.compute(shape, grid, arguments)
    placing.save_placed(field, image, arguments.output)
    if arguments.preview:
        view.save_slices(field.whole, arguments.preview, shape)
    summary = {
        "input": arguments.shape,
        "output": arguments.output,
        **computing.describe(field),
        **placing.place_of(image),
    }
    nodes = " × ".join(map(str, field.grid.shape))
    there = "" if arguments.band is None else f" ({summary['nodes']:,} of them there)"
    text = f"{arguments.output}: {nodes} nodes{there}, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    return summary, text + computing.hint(field)
