"""Open, check and replace files, for all readers and writers.

Only regular files that fit in memory are read, and any exception of a parser becomes an error that names the file.
Files are written atomically: to a temporary file with the final permissions, which is then renamed.
"""

from __future__ import annotations

import codecs
import errno
import os
import secrets
import shutil
import stat
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from traceback import walk_tb
from typing import BinaryIO, TypeVar

import numpy as np

from ..errors import FileFormatError, MemoryLimitError, SignedHeatError, UnsupportedTypeError, refuse_deleted_folder
from .budgets import account, charge

PathLike = str | os.PathLike[str]
T = TypeVar("T")
PACKAGE = f"{__package__.partition('.')[0]}."
"""Prefix of the names of all modules of this package."""
BYTES_PER_FILE_BYTE = {".stl": 5, ".ply": 2}
"""Measured memory to read a shape per byte of its file, reduced for formats that hold more than positions and faces.
For other formats, readers estimate memory from the first parts of the file."""
READING_MODULES = f"{__package__}.", f"{PACKAGE}packages"
"""Prefixes of the modules that read files or call other packages to do so."""


def extension(path: PathLike) -> str:
    """Return the extension of a file name in lower case, such as ``".stl"`` or ``".nii.gz"``."""
    try:
        suffixes = [suffix.lower() for suffix in Path(path).suffixes[-2:]]
    except TypeError:
        kind = type(path).__name__
        raise UnsupportedTypeError(f"a {kind} is not the name of a file", remedy="pass a str or a path") from None
    return "".join(suffixes if suffixes[-1:] == [".gz"] else suffixes[-1:])


def format_for(path: PathLike, formats: Mapping[str, T], purpose: str) -> T:
    """Return the entry of a table of formats for the extension of a file; raise `FileFormatError` if it has none."""
    ending = extension(path)
    if ending not in formats:
        cause = f"'{ending}' is not a known format" if ending else "the name has no extension"
        raise FileFormatError(f"{cause} for {purpose}", remedy=f"use one of {' '.join(sorted(formats))}", path=path)
    return formats[ending]


def distinct_names(numbers: Sequence[float]) -> list[str]:
    """Format numbers with signs for names of files, with at least six digits and enough to be distinct.

    Examples
    --------
    >>> distinct_names([0.1, -2.0]), distinct_names([0.12345678, 0.12345679])
    (['+0.1', '-2'], ['+0.12345678', '+0.12345679'])
    """
    for digits in range(6, 18):
        names = [f"{number:+.{digits}g}" for number in numbers]
        if len(set(names)) >= len(set(numbers)):
            break
    return names


def damaged(cause: str, element: str | None = None) -> FileFormatError:
    """Return the error for a truncated or damaged file; `reading` adds the name of the file."""
    return FileFormatError(cause, remedy="write or download it again", element=element)


def refuse_kind(kind: str, path: PathLike, holds: str, instead: str) -> FileFormatError:
    """Return the error for a format that does not support a kind of shape."""
    cause = f"{extension(path)} files hold {holds}, not a {kind}"
    return FileFormatError(cause, remedy=f"save it as {instead}", path=path)


@contextmanager
def reading(path: PathLike) -> Iterator[None]:
    """Convert exceptions of parsers within a ``with`` block to errors that name the file.

    Unexpected exceptions of code of this package outside its readers are raised unchanged. Whatever is read within the
    block is charged to the budget of the file.
    """
    try:
        with account(path), np.errstate(all="ignore"):  # no warnings: shapes and fields check their values themselves
            yield
    except SignedHeatError as error:
        if error.path is not None:
            raise
        raise error.at(path) from error
    except MemoryError as error:
        raise MemoryLimitError(
            "its announced contents do not fit in memory", remedy="check that it is not damaged", path=path
        ) from error
    except Exception as error:  # damaged files make parsers raise exceptions of any type
        if _is_ours(error):
            raise
        if isinstance(error, FileNotFoundError):  # a package that is imported now may look for the current folder
            refuse_deleted_folder(os.curdir)
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileFormatError(
            f"it is damaged or of another kind ({reason:.200})", remedy="write or download it again", path=path
        ) from error


def _is_ours(error: BaseException) -> bool:
    """Whether code of this package outside its readers raised an exception, by the last such frame of its traceback."""
    names = [str(frame.f_globals.get("__name__")) for frame, _ in walk_tb(error.__traceback__)]
    ours = [name for name in names if name.startswith(PACKAGE)]
    return bool(ours) and not ours[-1].startswith(READING_MODULES)


def contents(path: PathLike) -> bytes:
    """Read a regular file; an empty one is refused."""
    with _opened(path) as (file, size), account(path):
        charge(bytes=BYTES_PER_FILE_BYTE.get(extension(path), 1) * size)
        data = file.read()
    if not data:
        raise FileFormatError("the file is empty", remedy="write or download it again", path=path)
    return data


def size_of(path: PathLike) -> int:
    """Return the size in bytes of a file that another package reads; raise an error unless it is a regular file."""
    with _opened(path) as (_, size):
        return size


@contextmanager
def _opened(path: PathLike) -> Iterator[tuple[BinaryIO, int]]:
    """Open a regular file, and yield it with its size in bytes; errors, also of the `with` block, name the file."""
    extension(path)  # refuses numbers, which `open` takes for files that the process has open already
    try:
        # O_NONBLOCK, so that opening a pipe does not wait for its writer
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise _no_file(path, status.st_mode)
            yield file, status.st_size
    except SignedHeatError:
        raise
    except FileNotFoundError:
        refuse_deleted_folder(path)
        raise FileFormatError("there is no such file", remedy="check the name", path=path) from None
    except IsADirectoryError:
        raise FileFormatError("this is a folder", remedy="name a file in it", path=path) from None
    except OSError as error:
        raise FileFormatError(
            f"cannot be read ({error.strerror})", remedy="check its permissions", path=path
        ) from error
    except ValueError as error:  # the name holds a null character
        raise FileFormatError(f"this is not a valid file name ({error})", remedy="check the name", path=path) from error


def companion_contents(path: PathLike, name: str) -> bytes:
    """Return the bytes of a file that another file names, which must lie in the same folder or below it."""
    folder = os.path.realpath(Path(path).parent)
    named = os.path.realpath(os.path.join(folder, name))
    if os.path.isabs(name) or os.path.commonpath([folder, named]) != folder:
        raise FileFormatError(
            f"it refers to {name!r}, outside its folder",
            remedy="put both files into one folder",
            element=name,
            path=path,
        )
    return contents(named)


def _no_file(path: PathLike, mode: int) -> FileFormatError:
    """Return the error for a path to something other than a regular file, as its mode tells."""
    kinds = ((stat.S_ISDIR, "folder"), (stat.S_ISFIFO, "pipe"), (stat.S_ISSOCK, "socket"))
    kind = next((name for test, name in kinds if test(mode)), "device")
    return FileFormatError(f"this is a {kind}", remedy="name a regular file", path=path)


def text(path: PathLike) -> str:
    r"""Read a file as UTF-8, or UTF-16 with a byte order mark, with lines that end in ``\n``."""
    data = contents(path)
    charge(bytes=3 * len(data))  # decoded, and with other ends of lines
    encoding = "utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    return data.decode(encoding, errors="replace").replace("\r\n", "\n").replace("\r", "\n")


def ensure_writable(path: PathLike, formats: Collection[str], purpose: str) -> None:
    """Raise an error if a result cannot be written to a file, before a long computation.

    Parameters
    ----------
    path : str or path
        The file.
    formats : collection of str
        Extensions that it may have.
    purpose : str
        What is written, such as ``"a shape"``, for the message.

    Raises
    ------
    FileFormatError
        If it has another extension, or its folder is not writable.
    """
    format_for(path, dict.fromkeys(formats), purpose)
    with writing(path):
        os.unlink(_new_file(path))


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary file, which is renamed to `path` on success and removed otherwise.

    It lies in the same folder after links are resolved, and has the permissions of the file it replaces.
    """
    with writing(path):
        temporary = _new_file(path)
        try:
            yield temporary
            os.replace(temporary, os.path.realpath(path))
        finally:
            with suppress(OSError):
                temporary.unlink()


def move_into_place(source: Path, path: PathLike) -> None:
    """Move a complete file to `path`, keeping the permissions of a file that it replaces."""
    with replacing(path) as temporary:
        try:
            _permit(source, os.stat(temporary))
            os.replace(source, temporary)
        except OSError as error:
            if error.errno != errno.EXDEV:
                raise
            shutil.copyfile(source, temporary)  # `path` is a link to another disk


def replaceable(path: PathLike) -> os.stat_result | None:
    """Return the status of the file that writing would replace, or None if there is none.

    Raise an error if it is not a regular file or not writable.
    """
    real = Path(os.path.realpath(path))
    status = os.stat(real) if real.exists() else None
    if status is not None and not stat.S_ISREG(status.st_mode):
        raise _no_file(path, status.st_mode)
    if status is not None and not os.access(real, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return status


def _new_file(path: PathLike) -> Path:
    """Make an empty file with a new name, in the folder and with the permissions of the file that `path` leads to."""
    status, real = replaceable(path), Path(os.path.realpath(path))
    new = real.with_name(f".signedheat-{secrets.token_hex(8)}{real.suffix}")
    # readable by its owner only, until the permissions are copied
    os.close(os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600 if status is not None else 0o666))
    if status is not None:
        _permit(new, status)
    return new


def _permit(new: Path, status: os.stat_result) -> None:
    """Give a file the owner and permissions of another one, whose status is given, as far as the system permits."""
    with suppress(OSError):
        os.chown(new, status.st_uid, status.st_gid)
    with suppress(OSError):
        os.chmod(new, stat.S_IMODE(status.st_mode))


@contextmanager
def writing(path: PathLike) -> Iterator[None]:
    """Convert errors of the system, such as full disks, to errors that name the file."""
    try:
        yield
    except OSError as error:
        refuse_deleted_folder(path)
        reason = error.strerror or str(error)
        raise FileFormatError(
            f"cannot be written ({reason})",
            remedy="choose an existing folder that is writable and has free space",
            path=path,
        ) from error
