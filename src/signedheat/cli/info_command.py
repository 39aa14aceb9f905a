"""``signedheat info``: contents and defects of a file, and the memory that a grid around it takes."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from ..errors import SignedHeatError
from .late_imports import inputs, reports
from .options import Summary, command, option, whole_number
from .terminal import say_error

CURVES = (".json",)
"""Extensions of files that have curves, and nothing else."""


def check_files(arguments: Namespace) -> None:
    """Find a file of curves after that of a shape; reject curves with several shapes."""
    last = Path(arguments.files[-1]).suffix.lower()
    if len(arguments.files) == 2 and last in CURVES and arguments.curves is None:
        arguments.curves = arguments.files.pop()
    if arguments.curves is not None and len(arguments.files) > 1:
        arguments.parser.error(f"curves lie on one shape, and there are {len(arguments.files)}")


@command(
    "info",
    "what a file holds and what is wrong with it",
    "Counts, open, nonmanifold and inconsistent edges, degenerate and duplicate elements, bounds; which way the parts "
    "of a mesh face, doubled walls, bodies within others, sheets, the thinnest wall and gap; the memory that grids "
    "around a shape take. Of a field: its grid and range.",
    option(
        "files",
        metavar="FILE",
        nargs="+",
        help="shapes, polylines in the plane, fields, folders of shapes; a .json file after a shape has curves on it",
    ),
    option("--curves", metavar="CURVES", help="curves on the shape: .json .obj .csv"),
    option(
        "--resolution",
        type=whole_number(2),
        nargs="+",
        default=[64, 128, 256, 512],
        metavar="N",
        help="resolutions at which to estimate memory",
    ),
    check=check_files,
    usage="FILE [FILE ...] [--curves CURVES] [options]",
)
def info(arguments: Namespace) -> Summary:
    """Inspect files; of several, those that cannot be read do not stop the others."""
    arguments.files = list(_without_folders(arguments.files))
    if len(arguments.files) == 1:
        return reports.report(arguments.files[0], arguments)
    summaries, texts, failed = [], [], 0
    for file in arguments.files:
        try:
            summary, text = reports.report(file, arguments)
        except SignedHeatError as error:
            say_error(error if error.path else error.at(file))
            failed += 1
        else:
            summaries.append(summary)
            texts.append(text)
    return {"files": summaries, "failed": failed}, "\n\n".join(texts)


def _without_folders(names: list[str]) -> Iterator[str]:
    """The names, with the shapes in a folder in place of it."""
    for name in names:
        yield from (str(found.path) for found in inputs.expand([name])) if os.path.isdir(name) else (name,)
