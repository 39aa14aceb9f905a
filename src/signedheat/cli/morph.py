"""``signedheat morph``: morphological operations on a broken shape."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import (
    Summary,
    add_command,
    add_format_option,
    add_method_options,
    add_placing_options,
    add_room_options,
    add_shape,
    add_step_options,
    check_grid_options,
    finite,
)
from .parts import computing, io, placing, view

DISTANCES = {
    "dilate": (1, 1),
    "erode": (1, 1),
    "opening": (1, 1),
    "closing": (1, 1),
    "shell": (2, 2),
    "thicken": (1, 2),
}
"""The operations, functions of the package, with the least and the greatest number of distances that each takes."""


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "morph",
        run,
        check,
        help="grow, shrink, open, close, hollow or thicken a shape",
        description="Morphology by offsets of the completed signed distance. dilate, erode, opening, closing take one "
        "distance; shell takes the signed distances of its two sides; thicken takes its reach on the side of the "
        "normals and, if it differs, on the other side.",
    )
    parser.add_argument("operation", metavar="OPERATION", choices=DISTANCES, help=", ".join(DISTANCES))
    add_shape(parser)
    parser.add_argument("distances", metavar="DISTANCE", type=finite, nargs="+", help="in the units of the file")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="surface: .stl .obj .ply .off .vtp")
    add_placing_options(parser)
    add_room_options(parser)
    add_step_options(parser)
    add_method_options(parser)
    parser.add_argument("--preview", metavar="PNG", help="draw the distance to the shape in slices, with the offsets")
    parser.set_defaults(origin=None, grid_shape=None, mask=None, band=None)
    add_format_option(parser, "stl")


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


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    io.ensure_writable(arguments.output, io.SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    if arguments.preview:
        view.ensure_picture_writable(arguments.preview)
    shape = placing.read_source(arguments)
    fields: list[sh.GridField] = []

    def measure(part: Any, grid: sh.Grid) -> sh.GridField:
        fields.append(computing.compute(part, grid, arguments))
        return fields[-1]

    options = {} if arguments.operation == "thicken" else {"measure": measure}
    with computing.prefix_errors(arguments.shape):
        grid = computing.grid_for(shape, arguments, max(abs(distance) for distance in arguments.distances))
        surface = getattr(sh.morphology, arguments.operation)(shape, *arguments.distances, domain=grid, **options)
    io.save(surface, arguments.output)
    if arguments.preview and fields:
        view.save_slices(fields[0], arguments.preview, shape, levels(arguments))
    elif arguments.preview:
        view.save_scene(surface, arguments.preview)
    summary = {
        "input": arguments.shape,
        "operation": arguments.operation,
        "distances": arguments.distances,
        "output": arguments.output,
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
        **({"field": computing.describe(fields[0])} if fields else {}),
    }
    return summary, f"{arguments.output}: {arguments.operation}, closed surface of {surface.n_faces} faces"


def levels(arguments: Namespace) -> list[float]:
    """Where the first offsets lie: those of the distance to the shape itself."""
    inwards = arguments.operation in ("erode", "opening")
    return [-distance if inwards else distance for distance in arguments.distances]
