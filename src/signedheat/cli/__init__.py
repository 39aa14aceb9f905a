"""The command line: one module per command, each with `add_to(commands)` and `run(arguments)`."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence

from .. import __version__
from ..errors import SignedHeatError
from . import close, contour, demo, info, morph, offset, surface, view, volume
from .options import Parser

COMMANDS = (volume, surface, close, offset, contour, morph, info, view, demo)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0: done; 1: failed, with one line on standard error; 2: bad usage.
    """
    try:
        arguments = _parser().parse_args(argv)
        summary, text = arguments.run(arguments)
    except SystemExit as stop:  # argparse: help was asked for, or the usage is wrong
        return int(stop.code or 0)
    except (SignedHeatError, MemoryError) as error:
        print(f"signedheat: {_one_line(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("signedheat: stopped; nothing half-written is left behind", file=sys.stderr)
        return 130
    try:
        if arguments.json:
            print(json.dumps(summary))
        elif text and not arguments.quiet:
            print(text)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever was reading, such as `head`, has read enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _parser() -> Parser:
    parser = Parser(
        prog="signedheat",
        description="Generalized signed distance to broken geometry: negative inside, positive outside, "
        "in the units of the file.",
    )
    parser.add_argument("--version", action="version", version=f"signedheat {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)
    for command in COMMANDS:
        command.add_to(commands)
    return parser


def _one_line(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "there is not enough memory: choose a lower --resolution"
    return " ".join(str(error).split())
