"""The terminal: text on standard output and error, ``-`` as a file name, a progress bar, and signals."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from argparse import Namespace
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

from ..errors import FileFormatError, SignedHeatError, printable
from ..jobs import CLEAR_LINE

REPLACED_CHARACTERS = str.maketrans(
    {
        "×": "x",
        "φ": "phi",
        "ε": "epsilon",
        "λ": "lambda",
        "−": "-",
        "–": "-",
        "…": "...",
        "≤": "<=",
        "≥": ">=",
        "→": "->",
        "²": "^2",
        "½": "1/2",
        "━": "#",
        "╌": "-",
    }
)
"""Replacements for characters in streams that cannot encode them."""
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that stop a command."""
SIGNAL_PAUSE = 1.0
"""Seconds after a signal. Signals that follow earlier are ignored."""


def open_standard_streams() -> None:
    """Open closed standard streams on the null device, so that no other file gets their numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def fitting(text: str, stream: TextIO) -> str:
    """Return a text that a stream can encode, without control characters other than the ends of lines.

    Examples
    --------
    >>> import io
    >>> fitting("φ at 8 × 8 nodes of café.stl", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    'phi at 8 x 8 nodes of caf\\\\xe9.stl'
    """
    text = "\n".join(map(printable, text.split("\n")))
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return text.translate(REPLACED_CHARACTERS).encode(encoding, "backslashreplace").decode(encoding)
    return text


def say(text: str) -> None:
    """Write a line to standard error, or do nothing if that is closed or full."""
    _write_error("", text, "\n")


def _write_error(before: str, text: str, after: str) -> None:
    """Write three texts to standard error; `before` and `after` may have control characters, as for clearing a line."""
    stream = sys.stderr
    try:
        if stream is not None:
            stream.write(before + fitting(text, stream) + after)
            stream.flush()
    except (OSError, ValueError):
        _abandon(stream)


def say_error(error: BaseException) -> None:
    """Write an error to standard error, in one line."""
    say(printable(f"signedheat: {error}"))


def write_out(text: str) -> None:
    """Write text and the end of a line to standard output; raise `FileFormatError` if that is closed or full."""
    stream = sys.stdout
    try:
        if stream is None:
            raise OSError(0, "it is closed")
        stream.write(fitting(text, stream) + "\n")
        stream.flush()
    except BrokenPipeError:
        _abandon(stream)
    except (OSError, ValueError) as error:
        _abandon(stream)
        raise FileFormatError(
            f"cannot be written ({getattr(error, 'strerror', None) or error}); what -o names is there",
            remedy="open it, or use --quiet",
            path="standard output",
        ) from error


def _abandon(stream: TextIO | None) -> None:
    """Discard the buffer of a broken stream, which would otherwise fail again at exit."""
    try:
        if stream is not None:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())
            os.close(null)
    except (OSError, ValueError):
        return


class ProgressBar:
    """A progress callback that draws a bar on standard error if this is a terminal."""

    def __init__(self, quiet: bool) -> None:
        self._is_shown = not quiet and sys.stderr is not None and sys.stderr.isatty()
        self._begin = time.perf_counter()

    def __call__(self, fraction: float, step: str) -> None:
        if not self._is_shown:
            return
        width = max(10, min(40, shutil.get_terminal_size().columns - 36))
        full = round(width * min(max(fraction, 0.0), 1.0))
        seconds = time.perf_counter() - self._begin
        _write_error(CLEAR_LINE, f"{'━' * full}{'╌' * (width - full)} {fraction:4.0%} {seconds:6.1f} s  {step}", "")

    def clear(self) -> None:
        """Clear the bar to make room for a line of text."""
        if self._is_shown:
            _write_error(CLEAR_LINE, "", "")

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, *_: Any) -> None:
        self.clear()


class Stopped(KeyboardInterrupt):
    """Raised by `Signals`. Python treats `KeyboardInterrupt` itself, but not this, specially in ``python -c``."""


class Signals:
    """A context in which signals raise `Stopped`, so that temporary files are removed.

    The attribute `caught` is the number of the last signal, or None. Signals that are ignored, as under ``nohup``, or
    have another handler keep it. Outside the main thread, signals are not caught.
    """

    def __init__(self) -> None:
        self.caught: int | None = None
        self._last = -SIGNAL_PAUSE
        self._before: dict[int, Any] = {}
        self._hook = sys.unraisablehook

    def __enter__(self) -> Signals:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                    self._before[number] = signal.signal(number, self._raise)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._again
        return self

    def __exit__(self, *_: object) -> None:
        sys.unraisablehook = self._hook
        for number, before in self._before.items():
            signal.signal(number, before)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        """Raise `Stopped`, as the handler of a signal."""
        now = time.monotonic()
        if self.caught is not None and now - self._last < SIGNAL_PAUSE:
            return
        self.caught, self._last = number, now
        raise Stopped

    def _again(self, lost: sys.UnraisableHookArgs) -> None:
        """Send a signal again if its exception was lost in a callback of a library, as `sys.unraisablehook`."""
        if self.caught is None or not isinstance(lost.exc_value, Stopped):
            return self._hook(lost)
        self._last = -SIGNAL_PAUSE
        threading.Timer(0.05, _send, [self.caught]).start()


def _send(number: int) -> None:
    """Send a signal to the main thread, which interrupts its waiting, or where that is impossible to this thread."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


STANDARD_INPUTS = ("shape", "mesh", "field", "file")
"""Arguments that may name standard input."""


@dataclass(frozen=True)
class StandardFiles:
    """What replaces ``-`` among the arguments."""

    takes_output: bool = False  # whether the result goes to standard output
    names: Mapping[str, str] = field(default_factory=dict)  # names to print in place of the paths of temporary files

    def named(self, text: str) -> str:
        """Return a text with the paths of temporary files replaced."""
        for path, name in self.names.items():
            text = text.replace(path, name)
        return text


@contextmanager
def standard_files(arguments: Namespace) -> Iterator[StandardFiles]:
    """Within a ``with`` block, replace ``-`` among the arguments by temporary files.

    At the beginning standard input is copied to such a file, and at the end the result to standard output.
    """
    inputs = [name for name in STANDARD_INPUTS if getattr(arguments, name, None) == "-"]
    output = getattr(arguments, "output", None) == "-"
    listed = getattr(arguments, "files", []) == ["-"]
    if not (inputs or listed or output):
        yield StandardFiles()
        return
    if output and "format" not in arguments:
        raise FileFormatError("this command writes files", remedy="name a file or a folder", path="standard output")
    with tempfile.TemporaryDirectory(prefix="signedheat-") as folder:
        names = {}
        if inputs or listed:
            if arguments.input_format is None:
                raise FileFormatError(
                    "its format is unknown", remedy="add --from, as in --from ply", path="standard input"
                )
            path = Path(folder, f"input.{arguments.input_format}")
            path.write_bytes(sys.stdin.buffer.read() if sys.stdin is not None else b"")
            names[str(path)] = "standard input"
            if listed:
                arguments.files = [str(path)]
            for name in inputs:
                setattr(arguments, name, str(path))
        target = Path(folder) / f"output.{arguments.format}" if output else None
        if target is not None:
            arguments.output, names[str(target)] = str(target), "standard output"
        try:
            yield StandardFiles(output, names)
        except SignedHeatError as error:
            if error.path in names:
                raise error.at(names[error.path]) from error
            raise
        if target is not None:
            _write(target)


def _write(path: Path) -> None:
    """Copy a file to standard output; raise an error if it does not exist, since then the result is several files."""
    if not path.is_file():
        raise FileFormatError(
            "the result is several files", remedy="name a file instead of standard output", path="standard output"
        )
    try:
        sys.stdout.buffer.write(path.read_bytes())
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        return
    except OSError as error:
        raise FileFormatError(
            f"cannot be written ({error.strerror})", remedy="name a file", path="standard output"
        ) from error
