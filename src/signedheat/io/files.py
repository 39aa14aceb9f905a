"""The one place where files are opened, sized and replaced.

Whatever is read is a regular file that fits into memory, and whatever goes wrong in a parser is an error that names the
file. Whatever is written is written next to it, with the permissions that it will have, and renamed when it is whole.
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
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MemoryLimitError, SignedHeatError
from ..memory import available_memory

PathLike = str | os.PathLike[str]
T = TypeVar("T")
PACKAGE = f"{__package__.partition('.')[0]}."
TAKEN = {".off": 14, ".stl": 5, ".xyz": 4, ".ply": 2}
"""Bytes that a shape takes while it is read for each byte of its file, measured with some hundred thousand faces; less
where files may hold more than positions and faces. Of other formats the parts that are read first say more."""
READING_MODULES = f"{__package__}.", f"{PACKAGE}packages"
"""Modules that read, and that by which they call other packages."""


def extension(path: PathLike) -> str:
    """The extension of a file name in lower case, with the dot: ``".stl"``; of packed files both, ``".nii.gz"``."""
    suffixes = [suffix.lower() for suffix in Path(path).suffixes[-2:]]
    return "".join(suffixes if suffixes[-1:] == [".gz"] else suffixes[-1:])


def format_for(path: PathLike, formats: Mapping[str, T], purpose: str) -> T:
    """What a table of formats has for the extension of a file; `FileFormatError` if that is not in it."""
    ending = extension(path)
    if ending not in formats:
        cause = f"'{ending}' is not a known format" if ending else "the name has no extension"
        raise FileFormatError(f"{cause} for {purpose}", remedy=f"use one of {' '.join(sorted(formats))}", path=path)
    return formats[ending]


def distinct_names(numbers: Sequence[float]) -> list[str]:
    """Numbers with their signs, for names of files: in six digits, or in as many as make them distinct.

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
    """The error for a file that is truncated or damaged; `reading` says which file it is."""
    return FileFormatError(cause, remedy="write or download it again", element=element)


def refuse_kind(kind: str, path: PathLike, holds: str, instead: str) -> FileFormatError:
    """The error for a format that does not support a kind of shape."""
    cause = f"{extension(path)} files hold {holds}, not a {kind}"
    return FileFormatError(cause, remedy=f"save it as {instead}", path=path)


@contextmanager
def reading(path: PathLike) -> Iterator[None]:
    """A context in which every exception of a parser, though none of our other code, becomes an error of the file."""
    try:
        with np.errstate(all="ignore"):  # values are looked at by the shapes and fields that are made of them
            yield
    except SignedHeatError as error:
        if error.path is not None:
            raise
        raise error.at(path) from error
    except MemoryError as error:
        raise MemoryLimitError(
            "what it announces does not fit into memory", remedy="check that it is not damaged", path=path
        ) from error
    except Exception as error:  # parsers, ours and those of others, meet damage with exceptions of any type
        if _is_ours(error):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileFormatError(
            f"it is damaged, or of another kind ({reason:.200})", remedy="write or download it again", path=path
        ) from error


def _is_ours(error: BaseException) -> bool:
    """Whether an exception comes from our code beyond the readers, or from what that calls."""
    names = [str(frame.f_globals.get("__name__")) for frame, _ in walk_tb(error.__traceback__)]
    ours = [name for name in names if name.startswith(PACKAGE)]
    return bool(ours) and not ours[-1].startswith(READING_MODULES)


def contents(path: PathLike) -> bytes:
    """The bytes of a file."""
    with _opened(path) as (file, size):
        ensure_fits(TAKEN.get(extension(path), 1) * size, path)
        data = file.read()
    if not data:
        raise FileFormatError("the file is empty", remedy="write or download it again", path=path)
    return data


def size_of(path: PathLike) -> int:
    """Bytes of a file that another package reads; what is missing, or no regular file, is refused as by `contents`."""
    with _opened(path) as (_, size):
        return size


@contextmanager
def _opened(path: PathLike) -> Iterator[tuple[BinaryIO, int]]:
    """A regular file, and its size."""
    try:
        # without waiting, as for the writer of a pipe, until it is known what it is
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise _no_file(path, status.st_mode)
            yield file, status.st_size
    except FileNotFoundError:
        raise FileFormatError("there is no such file", remedy="check the name", path=path) from None
    except IsADirectoryError:
        raise FileFormatError("this is a folder", remedy="name a file in it", path=path) from None
    except OSError as error:
        raise FileFormatError(
            f"cannot be read ({error.strerror})", remedy="check its permissions", path=path
        ) from error
    except ValueError as error:  # a name with a null character
        if isinstance(error, SignedHeatError):
            raise
        raise FileFormatError(f"this is no name of a file ({error})", remedy="check the name", path=path) from error


def companion_contents(path: PathLike, name: str) -> bytes:
    """The bytes of a file that another one names, which must lie in the same folder or below it."""
    folder = os.path.realpath(Path(path).parent)
    named = os.path.realpath(os.path.join(folder, name))
    if os.path.isabs(name) or os.path.commonpath([folder, named]) != folder:
        raise FileFormatError(
            f"it refers to {name!r}, outside its folder", remedy="put both into one folder", element=name, path=path
        )
    return contents(named)


def ensure_fits(size: int, path: PathLike, remedy: str = "check that it is not damaged, or free some memory") -> None:
    """Check before anything is allocated that so many bytes, which a file has or announces, are free."""
    free = available_memory()
    if free is not None and size > free:
        raise MemoryLimitError(
            f"what it holds takes about {size / 1e9:.3g} GB, and {free / 1e9:.3g} GB of memory are free",
            remedy=remedy,
            path=path,
        )


def unpacked(data: bytes | memoryview, machine: Any, size: int) -> bytes:
    """At most `size` bytes of what packed data become.

    Examples
    --------
    >>> import zlib
    >>> unpacked(zlib.compress(bytes(10**6)), zlib.decompressobj(), 3)
    b'\\x00\\x00\\x00'
    """
    return bytes(machine.decompress(data, size)) if size else b""


def _no_file(path: PathLike, mode: int) -> FileFormatError:
    kinds = ((stat.S_ISDIR, "folder"), (stat.S_ISFIFO, "pipe"), (stat.S_ISSOCK, "socket"))
    kind = next((name for test, name in kinds if test(mode)), "device")
    return FileFormatError(f"this is a {kind}", remedy="name a regular file", path=path)


def text(path: PathLike) -> str:
    """A file as text in lines that end in ``\\n``, without a byte order mark.

    Bytes that are not UTF-8, for instance in material names, become replacement characters; with its mark, UTF-16 is
    read, too. Other characters that end lines elsewhere, such as form feeds, do not end any.
    """
    data = contents(path)
    encoding = "utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    return data.decode(encoding, errors="replace").replace("\r\n", "\n").replace("\r", "\n")


def ensure_writable(path: PathLike, formats: Collection[str], purpose: str) -> None:
    """Check before a long computation that its result can be written."""
    format_for(path, dict.fromkeys(formats), purpose)
    with writing(path):
        os.unlink(_new_file(path))


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """A temporary file to write to, which is renamed to `path` on success and removed otherwise.

    It lies in the folder that `path` leads to, and has the permissions of the file there, or those that new files have.
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
    """Give a whole file its place: that of the file that `path` leads to, whose permissions stay, or a new one."""
    with replacing(path) as temporary:
        try:
            _permit(source, os.stat(temporary))
            os.replace(source, temporary)
        except OSError as error:
            if error.errno != errno.EXDEV:
                raise
            shutil.copyfile(source, temporary)  # the link leads to another disk


def replaceable(path: PathLike) -> os.stat_result | None:
    """Status of the file that would be replaced; None if there is none."""
    real = Path(os.path.realpath(path))
    status = os.stat(real) if real.exists() else None
    if status is not None and not stat.S_ISREG(status.st_mode):
        raise _no_file(path, status.st_mode)
    if status is not None and not os.access(real, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return status


def _new_file(path: PathLike) -> Path:
    """An empty file of a name that is not used, in the folder of what `path` leads to and with the same permissions."""
    status, real = replaceable(path), Path(os.path.realpath(path))
    new = real.with_name(f".signedheat-{secrets.token_hex(8)}{real.suffix}")
    # created for its owner alone, so that what is secret is so from the start
    os.close(os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600 if status is not None else 0o666))
    if status is not None:
        _permit(new, status)
    return new


def _permit(new: Path, status: os.stat_result) -> None:
    """Give a file the owner and the permissions of another one, as far as may be."""
    with suppress(OSError):
        os.chown(new, status.st_uid, status.st_gid)
    with suppress(OSError):
        os.chmod(new, stat.S_IMODE(status.st_mode))


@contextmanager
def writing(path: PathLike) -> Iterator[None]:
    """A context in which refusals of the system become errors that name the file: full disks, permissions, names."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileFormatError(
            f"cannot be written ({reason})", remedy="choose a folder that exists, is yours and has room", path=path
        ) from error


def parsed_numbers(tokens: list[Any], what: str, kind: type = float) -> NDArray[Any]:
    """Words of a text file as an array of numbers."""
    try:
        return np.array(tokens, dtype=np.float64 if kind is float else np.int64)
    except (ValueError, OverflowError) as error:
        raise damaged(f"{what} are not all numbers ({error}): the file is damaged") from error
