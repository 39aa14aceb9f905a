"""``signedheat info``: contents and defects of a file, and the memory that a grid around it takes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..errors import SignedHeatError
from .options import Summary, add_command, whole_number
from .parts import reports
from .streams import say

CURVES = (".txt", ".json")
"""Extensions of files that have curves, and nothing else."""


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "info",
        run,
        check,
        help="what a file holds and what is wrong with it",
        description="Counts, open, nonmanifold and inconsistent edges, degenerate and duplicate elements, bounds; "
        "which way the parts of a mesh face, doubled walls, bodies within others, sheets, the thinnest wall and gap; "
        "the memory that grids around a shape take. Of a field: its grid and range.",
    )
    parser.usage = "%(prog)s FILE [FILE ...] [--curves CURVES] [options]"
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="shapes, polylines in the plane or fields; a .txt or .json file after a shape has curves on it",
    )
    parser.add_argument("--curves", metavar="CURVES", help="curves on the shape: .txt .json .obj .csv")
    parser.add_argument(
        "--resolution",
        type=whole_number(2),
        nargs="+",
        default=[64, 128, 256, 512],
        metavar="N",
        help="resolutions at which to estimate memory",
    )


def check(arguments: Namespace) -> None:
    """Tell curves from files, and reject those of several shapes."""
    last = Path(arguments.files[-1]).suffix.lower()
    if len(arguments.files) == 2 and last in CURVES and arguments.curves is None:
        arguments.curves = arguments.files.pop()
    if arguments.curves is not None and len(arguments.files) > 1:
        arguments.parser.error(f"curves lie on one shape, and there are {len(arguments.files)}")


def run(arguments: Namespace) -> Summary:
    """Inspect files; of several, those that cannot be read do not stop the others."""
    if len(arguments.files) == 1:
        return reports.report(arguments.files[0], arguments)
    summaries, texts, failed = [], [], 0
    for file in arguments.files:
        try:
            summary, text = reports.report(file, arguments)
        except SignedHeatError as error:
            say(f"signedheat: {' '.join(str(error if error.path else error.at(file)).split())}")
            failed += 1
        else:
            summaries.append(summary)
            texts.append(text)
    return {"files": summaries, "failed": failed}, "\n\n".join(texts)
