"""``signedheat morph``: morphological operations on a broken shape."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..extensions.morphology import RESOLUTION, closing, dilate, erode, opening, shell, thicken
from ..io import SHAPE_FORMATS, ensure_writable, read, save
from .computing import prefix_errors
from .options import Parser, Summary, add_command, finite, whole_number

OPERATIONS = {
    "dilate": (dilate, 1, 1),
    "erode": (erode, 1, 1),
    "opening": (opening, 1, 1),
    "closing": (closing, 1, 1),
    "shell": (shell, 2, 2),
    "thicken": (thicken, 1, 2),
}
"""Function of each operation, and the least and greatest number of distances that it takes."""


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "morph",
        run=lambda arguments: run(parser, arguments),
        help="grow, shrink, open, close, hollow or thicken a shape",
        description="Morphology by offsets of the completed signed distance. dilate, erode, opening, closing take one "
        "distance; shell takes the signed distances of its two sides; thicken takes its reach on the side of the "
        "normals and, if it differs, on the other side.",
    )
    parser.add_argument("operation", metavar="OPERATION", choices=OPERATIONS, help=", ".join(OPERATIONS))
    parser.add_argument(
        "shape", metavar="SHAPE", help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc"
    )
    parser.add_argument("distances", metavar="DISTANCE", type=finite, nargs="+", help="in the units of the file")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="surface: .stl .obj .ply .off .vtp")
    parser.add_argument(
        "--resolution", type=whole_number(2), default=RESOLUTION, metavar="N", help="nodes along the longest side (128)"
    )


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    operation, fewest, most = OPERATIONS[arguments.operation]
    if not fewest <= len(arguments.distances) <= most:
        wanted = str(fewest) if fewest == most else f"{fewest} or {most}"
        parser.error(f"argument DISTANCE: {arguments.operation} takes {wanted}, not {len(arguments.distances)}")
    ensure_writable(arguments.output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    shape = read(arguments.shape)
    with prefix_errors(arguments.shape):
        surface = operation(shape, *arguments.distances, resolution=arguments.resolution)
    save(surface, arguments.output)
    summary = {
        "input": arguments.shape,
        "operation": arguments.operation,
        "distances": arguments.distances,
        "output": arguments.output,
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
    }
    return summary, f"{arguments.output}: {arguments.operation}, closed surface of {surface.n_faces} faces"
