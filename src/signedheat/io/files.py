"""File names, contents, and atomic replacement of files."""

from __future__ import annotations

import os
import secrets
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError

PathLike = str | os.PathLike[str]


def extension(path: PathLike) -> str:
    """The extension of a file name in lower case, with the dot: ``".stl"``."""
    return Path(path).suffix.lower()


def unknown_extension(path: PathLike, known: Collection[str], purpose: str) -> FileFormatError:
    """The error for an extension that is not supported."""
    ending = extension(path)
    cause = f"'{ending}' is not a known format" if ending else "the name has no extension"
    return FileFormatError(
        f"{cause} for {purpose}",
        remedy=f"use one of {' '.join(sorted(known))}",
        path=path,
    )


def contents(path: PathLike) -> bytes:
    """The bytes of a file.

    Raises
    ------
    FileFormatError
        If it is missing, is not a regular file, cannot be read, or is empty.
    """
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise FileFormatError(
            "there is no such file",
            remedy="check the name",
            path=path,
        ) from None
    except IsADirectoryError:
        raise FileFormatError(
            "this is a folder",
            remedy="name a file in it",
            path=path,
        ) from None
    except OSError as error:
        raise FileFormatError(
            f"cannot be read ({error.strerror})",
            remedy="check its permissions",
            path=path,
        ) from error
    if not data:
        raise FileFormatError(
            "the file is empty",
            remedy="write or download it again",
            path=path,
        )
    return data


def text(path: PathLike) -> str:
    """A file as text; bytes that are not UTF-8, for instance in material names, become replacement characters."""
    return contents(path).decode("utf-8", errors="replace")


def ensure_writable(path: PathLike, known: Collection[str], purpose: str) -> None:
    """Check before a long computation that its result can be written.

    Parameters
    ----------
    path : path
        The file.
    known : collection of str
        Supported extensions, with the dot.
    purpose : str
        What is to be written, for the message.

    Raises
    ------
    FileFormatError
        If the extension is not supported, or the file cannot be created.
    """
    if extension(path) not in known:
        raise unknown_extension(path, known, purpose)
    if Path(path).is_dir():
        raise FileFormatError(
            "this is a folder",
            remedy="name a file in it",
            path=path,
        )
    with _writing(path):
        trial = _unused_name(path)
        trial.touch(exist_ok=False)
        trial.unlink()


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """A temporary file to write to, which is renamed to `path` on success and removed otherwise.

    Raises
    ------
    FileFormatError
        If the file cannot be written; an existing file is then left unchanged.
    """
    temporary = _unused_name(path)
    with _writing(path):
        try:
            yield temporary
            os.replace(temporary, os.path.realpath(path))
        finally:
            with suppress(OSError):
                temporary.unlink()


def _unused_name(path: PathLike) -> Path:
    real = Path(os.path.realpath(path))
    return real.with_name(f".{real.stem}.{secrets.token_hex(4)}{real.suffix}")


@contextmanager
def _writing(path: PathLike) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileFormatError(
            f"cannot be written ({reason})",
            remedy="choose a folder that exists, is yours and has room",
            path=path,
        ) from error


def numbers(tokens: list[Any], path: PathLike, what: str, kind: type = float) -> NDArray[Any]:
    """Words of a text file as an array of numbers."""
    try:
        return np.array(tokens, dtype=np.float64 if kind is float else np.int64)
    except (ValueError, OverflowError) as error:
        raise FileFormatError(
            f"{what} are not all numbers ({error}): the file is damaged",
            remedy="write or download it again",
            path=path,
        ) from error
