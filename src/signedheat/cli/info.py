"""``signedheat info``: contents and defects of a file, and the memory that a grid around it takes."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from typing import Any

from ..domains.grid import Grid
from ..domains.inspection import inspect
from ..errors import SourceError
from ..io import FIELD_FORMATS, load_field, read, read_curves, read_polylines
from ..io.files import extension
from ..io.obj import read_obj_lines
from ..lowering.area_elements import bounds_around
from ..lowering.grid.discretization import memory_estimate
from .computing import describe, is_planar
from .curve_report import as_text, curve_reports
from .options import Summary, add_command, whole_number


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "info",
        run=run,
        help="what a file holds and what is wrong with it",
        description="Counts, open, nonmanifold and inconsistent edges, degenerate and duplicate elements, bounds; "
        "the memory that grids around a shape take. Of a field: its grid and range.",
    )
    parser.add_argument("file", metavar="FILE", help="a shape, polylines in the plane or a field")
    parser.add_argument("curves", metavar="CURVES", nargs="?", help="curves on the shape: .txt .obj .json")
    parser.add_argument(
        "--resolution",
        type=whole_number(2),
        nargs="+",
        default=[64, 128, 256, 512],
        metavar="N",
        help="resolutions at which to estimate memory",
    )


def run(arguments: Namespace) -> Summary:
    """Inspect a shape or a field."""
    if extension(arguments.file) in FIELD_FORMATS:
        field = load_field(arguments.file)
        summary = {"file": arguments.file, "kind": type(field).__name__, **describe(field)}
        del summary["seconds"]
        return summary, _table(summary)
    if is_planar(arguments.file):
        return lines_report(arguments)
    shape = read(arguments.file)
    summary = {"file": arguments.file, "kind": type(shape).__name__, **asdict(inspect(shape))}
    if extension(arguments.file) == ".obj":
        summary["line_elements"] = len(read_obj_lines(arguments.file)[1])
    summary["memory_bytes"] = {str(n): _memory(shape, n) for n in arguments.resolution}
    text = _table(summary)
    if arguments.curves:
        if not hasattr(shape, "triangulation"):
            raise SourceError(
                f"curves lie on meshes and point clouds, not a {type(shape).__name__}",
                path=arguments.curves,
            )
        summary["curves"] = curve_reports(shape, read_curves(arguments.curves, shape))
        text += f"\n\n{arguments.curves}\n{as_text(summary['curves'])}"
    return summary, text


def lines_report(arguments: Namespace) -> Summary:
    """Inspect polylines in the plane."""
    lines = read_polylines(arguments.file)
    bounds = bounds_around(lines)
    summary = {
        "file": arguments.file,
        "kind": "Polyline",
        "n_polylines": len(lines),
        "n_closed": sum(line.closed for line in lines),
        "n_points": sum(line.n_points for line in lines),
        "length": float(sum(line.length for line in lines)),
        "lower": bounds[0].tolist(),
        "upper": bounds[1].tolist(),
    }
    return summary, _table(summary)


def _memory(shape: Any, resolution: int) -> int | None:
    """Estimate for a grid around the shape; nothing where the shape is a single place."""
    if not (shape.bounds[1] > shape.bounds[0]).any():
        return None
    return memory_estimate(Grid.around(shape.bounds, resolution))


def _table(summary: dict[str, Any]) -> str:
    rows = []
    for key, value in summary.items():
        if key == "memory_bytes":
            for resolution, size in value.items():
                rows.append((f"memory at {resolution}", "–" if size is None else f"{size / 1e9:.2f} GB"))
            continue
        if isinstance(value, (list, tuple)):
            value = " ".join(f"{entry:g}" for entry in value)
        elif isinstance(value, bool):
            value = "yes" if value else "no"
        elif isinstance(value, float):
            value = f"{value:g}"
        rows.append((key.removeprefix("n_").replace("_", " "), str(value)))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)
