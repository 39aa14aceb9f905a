"""``-`` as a file name: standard input and standard output, passed through temporary files."""

from __future__ import annotations

import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import FileFormatError, SignedHeatError

INPUTS = ("shape", "mesh", "field", "file")
"""Arguments that may name standard input."""


@dataclass(frozen=True)
class StandardFiles:
    """Replacements for ``-`` among the arguments.

    Attributes
    ----------
    takes_output : bool
        Whether the result goes to standard output.
    names : dict
        Names to print in place of the paths of temporary files.
    """

    takes_output: bool = False
    names: Mapping[str, str] = field(default_factory=dict)

    def named(self, text: str) -> str:
        """Return a text with the paths of temporary files replaced."""
        for path, name in self.names.items():
            text = text.replace(path, name)
        return text


@contextmanager
def standard_files(arguments: Namespace) -> Iterator[StandardFiles]:
    """Replace ``-`` among the arguments by temporary files, and write the result to standard output."""
    inputs = [name for name in INPUTS if getattr(arguments, name, None) == "-"]
    output = getattr(arguments, "output", None) == "-"
    listed = getattr(arguments, "files", []) == ["-"]
    if not (inputs or listed or output):
        yield StandardFiles()
        return
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
