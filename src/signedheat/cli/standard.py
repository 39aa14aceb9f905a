"""``-`` as a file: standard input and standard output, through files of their own in a folder that is removed."""

from __future__ import annotations

import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import FileFormatError, SignedHeatError

INPUTS = ("shape", "mesh", "field", "file")
"""Arguments that may be standard input."""
STARTS: tuple[tuple[bytes, str], ...] = (
    (b"ply", ".ply"),
    (b"glTF", ".glb"),
    (b"PK\x03\x04", ".3mf"),
    (b"NRRD", ".nrrd"),
    (b"solid", ".stl"),
    (b"\x93NUMPY", ".npy"),
)
"""What files of a format begin with."""


@dataclass(frozen=True)
class StandardFiles:
    """What became of ``-`` among the arguments.

    Attributes
    ----------
    takes_output : bool
        Whether standard output is for what is made.
    names : dict
        By the path of a file that stands for it, what to call it.
    """

    takes_output: bool = False
    names: Mapping[str, str] = field(default_factory=dict)

    def named(self, text: str) -> str:
        """A text that calls standard input what it is."""
        for path, name in self.names.items():
            text = text.replace(path, name)
        return text


@contextmanager
def standard_files(arguments: Namespace) -> Iterator[StandardFiles]:
    """Put files in place of ``-`` among the arguments, and write what was made.

    Raises
    ------
    FileFormatError
        If what is on standard input is of no format that can be recognised from what it begins with.
    """
    inputs = [name for name in INPUTS if getattr(arguments, name, None) == "-"]
    output = getattr(arguments, "output", None) == "-"
    listed = getattr(arguments, "files", []) == ["-"]
    if not (inputs or listed or output):
        yield StandardFiles()
        return
    with tempfile.TemporaryDirectory(prefix="signedheat-") as folder:
        names = {}
        if inputs or listed:
            data = sys.stdin.buffer.read() if sys.stdin is not None else b""
            path = Path(folder) / f"input{sniffed(data)}"
            path.write_bytes(data)
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
            "there are several files", remedy="name a file instead of standard output", path="standard output"
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


def sniffed(data: bytes) -> str:
    """The extension of the format that data are in.

    Examples
    --------
    >>> sniffed(b"# a cube\\nv 0 0 0\\n"), sniffed(b"ply\\nformat ascii 1.0\\n"), sniffed(b"0 0 1\\n1 2 3\\n")
    ('.obj', '.ply', '.xyz')
    """
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return ".stl"
    for start, ending in STARTS:
        if data.startswith(start):
            return ending
    head = data[:4096].decode("utf-8", errors="replace")
    lines = [line.split() for line in head.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    first = lines[0][0] if lines else ""
    tests: tuple[tuple[Callable[[], bool], str], ...] = (
        (lambda: first.upper().endswith("OFF"), ".off"),
        (lambda: "<svg" in head, ".svg"),
        (lambda: 'type="PolyData"' in head, ".vtp"),
        (lambda: 'type="ImageData"' in head, ".vti"),
        (lambda: first in ("v", "vn", "vt", "f", "l", "o", "g", "s", "mtllib", "usemtl"), ".obj"),
        (lambda: _numbers(lines[0]) in (3, 6), ".xyz"),
        (lambda: _numbers(head.splitlines()[0].replace(",", " ").split()) == 2, ".csv"),
    )
    for test, ending in tests:
        if lines and test():
            return ending
    raise FileFormatError(
        "what is on standard input is of no format that can be recognised from its beginning"
        if data
        else "nothing is there",
        remedy="name a file",
        path="standard input",
    )


def _numbers(words: list[Any]) -> int:
    """How many words there are, if all are numbers, else 0."""
    try:
        return len([float(word) for word in words])
    except ValueError:
        return 0
