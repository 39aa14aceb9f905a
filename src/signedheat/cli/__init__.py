"""The command line. Each command is declared next to the function that runs it, in the modules ``*_commands``.

Every command ends here, with an exit status, and with one line on standard error if it failed.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path

from .. import __version__
from ..errors import SignedHeatError, printable, shortened
from .options import (
    Parser,
    parser_of,
    refuse_contradictions,
    refuse_output_over_input,
    refuse_unused_formats,
    without_exponents,
)
from .terminal import Signals, open_standard_streams, say, standard_files, write_out

EXIT_FAILED, EXIT_BUG = 1, 70


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command that the arguments name, and return the exit status."""
    open_standard_streams()
    with Signals() as signals, _warnings_in_lines():
        try:
            return _run(argv)
        except SystemExit as stop:  # from argparse, after help or an error of usage
            return int(stop.code or 0)
        except BaseException as error:
            if signals.caught or isinstance(error, KeyboardInterrupt):  # a library may have replaced `Stopped`
                say("signedheat: stopped; nothing half-written is left behind")
                return 128 + int(signals.caught or 2)
            if os.environ.get("SIGNEDHEAT_TRACEBACK"):
                raise
            say(f"signedheat: {_one_line(error)}")
            return EXIT_FAILED if _is_expected(error) else EXIT_BUG


def _run(argv: Sequence[str] | None) -> int:
    """Run the command that the arguments name, and return the exit status. Commands are imported only now.

    `main` handles errors of the import, too.
    """
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:  # set by argcomplete's shell function
        import_module("argcomplete").autocomplete(parser)
    arguments = parser.parse_args(without_exponents(sys.argv[1:] if argv is None else argv))
    if "command" not in arguments:
        parser.print_help()
        return 0
    command = arguments.command
    refuse_contradictions(arguments)
    if command.check is not None:
        command.check(arguments)
    refuse_unused_formats(arguments)
    refuse_output_over_input(arguments)
    public = import_module("signedheat.public")
    if arguments.preview is not None:
        public.view.ensure_picture_writable(arguments.preview)
    import_module("signedheat.jobs").Announcement.are_wanted = not (arguments.quiet or arguments.json)
    with standard_files(arguments) as standard:
        summary, text = command.run(arguments)
    if arguments.json and not standard.takes_output:
        write_out(standard.named(json.dumps(summary)))
    elif text and not (arguments.quiet or standard.takes_output):
        write_out(standard.named(text))
    return EXIT_FAILED if summary.get("failed") else 0  # some of many inputs failed


@cache
def _parser() -> Parser:
    """Return the parser of the whole command line, which is made once."""
    return parser_of(import_module(f"{__name__}.shell").COMMANDS)


def _say_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning on one line, as `warnings.showwarning`; deprecation warnings are not printed by default."""
    if sys.warnoptions or not issubclass(category, DeprecationWarning | PendingDeprecationWarning):
        say(printable(f"signedheat: {' '.join(str(message).split())}"))


@contextmanager
def _warnings_in_lines() -> Iterator[None]:
    """Within a ``with`` block, print each warning on one line, without its position in the code."""
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("default", UserWarning)
        warnings.showwarning = _say_warning
        yield


def _is_expected(error: BaseException) -> bool:
    """Whether an error is due to the input or the system, and not a bug of this package."""
    return isinstance(error, SignedHeatError | MemoryError | OSError | Warning)


def _one_line(error: BaseException) -> str:
    """Return a description of an error in one line. Unexpected errors are called bugs, with their position in code."""
    if isinstance(error, MemoryError):
        return "there is not enough memory: choose a lower resolution or a smaller shape"
    if _is_expected(error):
        return printable(str(error) if isinstance(error, SignedHeatError) else shortened(str(error)))
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    position = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else "nowhere"
    about = printable(" ".join(f"{type(error).__name__}: {error}".split()))
    return (
        f"this is a bug in signedheat {__version__} ({about:.200}; {position}), not your mistake: please report it, "
        "with the command and what it prints when SIGNEDHEAT_TRACEBACK=1 is set"
    )
