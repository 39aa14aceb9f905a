"""What the command line takes: one module per command, each with `add_to(commands)`.

Nothing here imports NumPy or the rest of the package, so that help and errors of usage come at once. A command is run
by the module of the same name one folder up.
"""

from __future__ import annotations

from ... import __version__
from . import (
    batch,
    close,
    completion,
    contour,
    demo,
    info,
    morph,
    offset,
    sample,
    surface,
    view,
    volume,
    warmup,
)
from .options import Parser

COMMANDS = (
    volume,
    surface,
    close,
    offset,
    contour,
    morph,
    sample,
    batch,
    info,
    view,
    demo,
    completion,
    warmup,
)
STANDARD = {
    "volume": "npz",
    "offset": "stl",
    "morph": "stl",
    "sample": "npz",
    "contour": "stl",
    "surface": "ply",
    "close": "json",
}
"""Formats of what commands write to standard output, if nothing is said."""


def parser() -> Parser:
    """The parser of the whole command line."""
    whole = Parser(
        prog="signedheat",
        description="Generalized signed distance to broken geometry: negative inside, positive outside, "
        "in the units of the file.",
    )
    whole.add_argument("--version", action="version", version=f"signedheat {__version__}")
    commands = whole.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)
    for command in COMMANDS:
        command.add_to(commands)
    for name, ending in STANDARD.items():
        commands.choices[name].add_argument(
            "--format", default=ending, metavar="EXT", help=f"of standard output, with -o - ({ending})"
        )
    return whole
