"""The parser of the whole command line. A command is a module: `add_to` declares what it takes, `run` does it."""

from __future__ import annotations

from .. import __version__
from . import (
    batch,
    close,
    completion,
    contour,
    demo,
    deviation,
    info,
    morph,
    offset,
    sample,
    surface,
    view,
    volume,
    warmup,
    watertight,
)
from .options import Parser

COMMANDS = (
    volume,
    surface,
    close,
    offset,
    watertight,
    contour,
    morph,
    sample,
    deviation,
    batch,
    info,
    view,
    demo,
    completion,
    warmup,
)


def parser() -> Parser:
    """The parser of the whole command line."""
    whole = Parser(
        prog="signedheat",
        description="Generalized signed distance to broken geometry: negative inside, positive outside, "
        "in the units of the file.",
    )
    whole.add_argument("--version", action="version", version=f"signedheat {__version__}")
    whole.set_defaults(whole=whole)
    commands = whole.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)
    for command in COMMANDS:
        command.add_to(commands)
    return whole
