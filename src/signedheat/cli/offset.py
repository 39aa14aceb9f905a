"""``signedheat offset``: closed surfaces at given distances from a broken shape."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..io import POLYLINE_FORMATS, SHAPE_FORMATS, ensure_writable, save, write_polylines
from ..visualization import ensure_picture_writable, save_slices
from .computing import check_grid_options, compute, describe, grid_for, hint, is_planar, prefix_errors, read_source
from .options import Parser, Summary, add_command, add_grid_options, finite


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "offset",
        run=lambda arguments: run(parser, arguments),
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
    add_grid_options(parser)


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the results can be written, compute once, contour and write each."""
    check_grid_options(parser, arguments)
    outputs = output_names(arguments.output, arguments.distances)
    planar = is_planar(arguments.shape)
    for output in outputs:
        ensure_offset_writable(output, planar)
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments.shape)
    reach = max(abs(distance) for distance in arguments.distances)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments, reach), arguments)
        found = [field.offset(distance) for distance in arguments.distances]
    for what, output in zip(found, outputs, strict=True):
        if planar:
            write_polylines(output, what)
        else:
            save(what, output)
    if arguments.preview:
        save_slices(field, arguments.preview, shape, arguments.distances)
    written = [
        {"distance": distance, "output": output, **counts(what)}
        for distance, output, what in zip(arguments.distances, outputs, found, strict=True)
    ]
    kind = "{lines} lines ({closed} closed), length {length:.6g}" if planar else "closed surface, {faces} faces"
    text = "\n".join(f"{w['output']}: at {w['distance']:+g}, {kind.format(**w)}" for w in written) + hint(field)
    return {"input": arguments.shape, "lines" if planar else "surfaces": written, "field": describe(field)}, text


def ensure_offset_writable(output: str, planar: bool) -> None:
    """Check before computing that a surface, or polylines in the plane, can be written."""
    if planar:
        ensure_writable(output, POLYLINE_FORMATS, "lines in the plane")
    else:
        ensure_writable(output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")


def counts(what: Any) -> dict[str, Any]:
    """Key figures of a surface, or of polylines in the plane."""
    if isinstance(what, list):
        closed = sum(line.closed for line in what)
        return {"lines": len(what), "closed": closed, "length": float(sum(line.length for line in what))}
    return {"vertices": what.n_vertices, "faces": what.n_faces}


def output_names(output: str, distances: list[float]) -> list[str]:
    """The given name for one distance; a name with the distance in it for each of several."""
    if len(distances) == 1:
        return [output]
    path = Path(output)
    return [str(path.with_name(f"{path.stem}_{distance:+g}{path.suffix}")) for distance in distances]
