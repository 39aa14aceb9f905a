"""Standard output and standard error, whatever they are: closed, full, a pipe that nobody reads, without Unicode."""

from __future__ import annotations

import os
import sys
from typing import TextIO

from ..errors import FileFormatError

PLAIN = str.maketrans(
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
"""What is written instead of characters that a stream cannot hold."""


def open_standard_streams() -> None:
    """Give closed standard streams to the null device, so that no file of ours gets their numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def fitting(text: str, stream: TextIO) -> str:
    """Text that a stream can hold.

    Examples
    --------
    >>> import io
    >>> fitting("φ at 8 × 8 nodes of café.stl", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    'phi at 8 x 8 nodes of caf\\\\xe9.stl'
    """
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return text.translate(PLAIN).encode(encoding, "backslashreplace").decode(encoding)
    return text


def say(text: str, end: str = "\n") -> None:
    """Write to standard error, which may be closed or full: then there is nobody to tell."""
    stream = sys.stderr
    try:
        if stream is not None:
            stream.write(fitting(text, stream) + end)
            stream.flush()
    except (OSError, ValueError):
        _abandon(stream)


def tell(text: str) -> None:
    """Write to standard output.

    Raises
    ------
    FileFormatError
        If it is closed or full. That whoever was reading, such as ``head``, has read enough is no error.
    """
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
    """Let what is still in the buffer of a broken stream go nowhere, instead of failing once more at the end."""
    try:
        if stream is not None:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())
            os.close(null)
    except (OSError, ValueError):
        return
