"""``signedheat volume``: signed distance to a broken shape on a grid."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..io import ensure_field_writable, save_field
from ..visualization import ensure_picture_writable, save_slices
from . import tets
from .computing import check_grid_options, compute, describe, grid_for, hint, prefix_errors, read_source
from .options import Parser, Summary, add_command, add_grid_options


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "volume",
        run=lambda arguments: run(parser, arguments),
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
    add_grid_options(parser)


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    if arguments.tets is not None:
        return tets.run(parser, arguments)
    check_grid_options(parser, arguments)
    ensure_field_writable(arguments.output)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments.shape)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments), arguments)
    save_field(field, arguments.output)
    if arguments.preview:
        save_slices(field, arguments.preview, shape)
    summary = {"input": arguments.shape, "output": arguments.output, **describe(field)}
    nodes = " × ".join(map(str, field.grid.shape))
    text = f"{arguments.output}: {nodes} nodes, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    text += hint(field)
    return summary, text
