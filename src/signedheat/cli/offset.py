"""``signedheat offset``: closed surfaces at chosen distances from a broken shape."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..io import SHAPE_FORMATS, ensure_writable, read, save
from ..viewing import PICTURE_FORMATS, save_slices
from .computing import check_grid_options, compute, describe, grid_for, naming
from .options import Parser, Summary, add_command, add_grid_options, finite


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "offset",
        run=lambda arguments: run(parser, arguments),
        help="closed surfaces at given distances",
        description="Closed surfaces at given distances from a shape, broken or not. Several distances make several "
        "files: OUT.stl becomes OUT_+0.2.stl, OUT_-0.1.stl.",
    )
    parser.usage = "%(prog)s SHAPE DISTANCE [DISTANCE ...] -o OUT [options]"
    parser.add_argument(
        "shape", metavar="SHAPE", help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc"
    )
    parser.add_argument(
        "distances",
        metavar="DISTANCE",
        type=finite,
        nargs="+",
        help="positive outside, negative inside, 0 the closed shape",
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="surface: .stl .obj .ply .off .vtp")
    add_grid_options(parser)


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute once, contour and write each."""
    check_grid_options(parser, arguments)
    outputs = output_names(arguments.output, arguments.distances)
    for output in outputs:
        ensure_writable(output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    if arguments.preview:
        ensure_writable(arguments.preview, PICTURE_FORMATS, "a picture")
    shape = read(arguments.shape)
    reach = max(abs(distance) for distance in arguments.distances)
    with naming(arguments.shape):
        field = compute(shape, grid_for(shape, arguments, reach), arguments)
        surfaces = [field.offset(distance) for distance in arguments.distances]
    for surface, output in zip(surfaces, outputs, strict=True):
        save(surface, output)
    if arguments.preview:
        save_slices(field, arguments.preview, shape, arguments.distances)
    written = [
        {"distance": distance, "output": output, "vertices": surface.n_vertices, "faces": surface.n_faces}
        for distance, output, surface in zip(arguments.distances, outputs, surfaces, strict=True)
    ]
    text = "\n".join(f"{w['output']}: closed surface at {w['distance']:+g}, {w['faces']} faces" for w in written)
    return {"input": arguments.shape, "surfaces": written, "field": describe(field)}, text


def output_names(output: str, distances: list[float]) -> list[str]:
    """The name itself for one distance, one name for each of several."""
    if len(distances) == 1:
        return [output]
    path = Path(output)
    return [str(path.with_name(f"{path.stem}_{distance:+g}{path.suffix}")) for distance in distances]
