"""``signedheat offset``: closed surfaces at given distances from a broken shape."""

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
    finite,
    is_planar,
)
from .parts import computing, io, placing, surfaces, view


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "offset",
        run,
        check,
        help="closed surfaces at given distances",
        description="Closed surfaces at given distances from a shape, broken or not; in the plane, lines. Several "
        "distances make several files: OUT.stl becomes OUT_+0.2.stl, OUT_-0.1.stl.",
    )
    parser.usage = "%(prog)s SHAPE DISTANCE [DISTANCE ...] -o OUT [options]"
    add_shape(parser, LINES)
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
    add_format_option(parser, "stl")


def check(arguments: Namespace) -> None:
    """Reject options that contradict each other, and distances beyond a band."""
    check_grid_options(arguments)
    check_tile_options(arguments)
    if arguments.output == "-" and len(arguments.distances) > 1:
        arguments.parser.error("standard output takes one surface: name a file, or give one distance")
    reach = max(abs(distance) for distance in arguments.distances)
    if arguments.band is not None and reach > arguments.band:
        arguments.parser.error(f"the band reaches to {arguments.band:g}, and the distances to {reach:g}")


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute once, contour and write each."""
    outputs = surfaces.output_names(arguments.output, arguments.distances)
    planar = is_planar(arguments.shape)
    for output in outputs:
        surfaces.ensure_offset_writable(output, planar)
    if arguments.preview:
        view.ensure_picture_writable(arguments.preview)
    reach = max(abs(distance) for distance in arguments.distances)
    image = placing.image_of(arguments)
    with computing.prefix_errors(arguments.shape):
        if image is None:
            shape = placing.read_source(arguments)
            grid = computing.grid_for(shape, arguments, reach)
        else:
            shape = image.surface(arguments.label)
            grid = placing.grid_of_image(image, shape, arguments, reach)
        field = computing.compute(shape, grid, arguments)
        found = [field.offset(distance) for distance in arguments.distances]
    for what, output in zip(found, outputs, strict=True):
        if planar:
            io.write_polylines(output, what)
        else:
            surfaces.save_surface(field, what, output, image)
    if arguments.preview:
        view.save_slices(field.whole, arguments.preview, shape, arguments.distances)
    written = [
        {"distance": distance, "output": output, **surfaces.counts(what)}
        for distance, output, what in zip(arguments.distances, outputs, found, strict=True)
    ]
    kind = "{lines} lines ({closed} closed), length {length:.6g}" if planar else "closed surface, {faces} faces"
    text = "\n".join(f"{w['output']}: at {w['distance']:+g}, {kind.format(**w)}" for w in written)
    summary = {"input": arguments.shape, "lines" if planar else "surfaces": written, "field": computing.describe(field)}
    return summary | placing.place_of(image), text + computing.hint(field)
