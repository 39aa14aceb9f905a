"""The folder of a batch: made, held by one batch at a time, with a place for what is not finished."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import FileFormatError, SignedHeatError

try:
    import fcntl
except ImportError:  # where folders cannot be held, two batches at once are not told
    fcntl = None  # type: ignore[assignment]

SCRATCH = ".unfinished-"
"""Begin of the name of the folder in which results are made; the number of the process that runs the batch follows."""


def make(folder: Path) -> None:
    """Make the folder, unless it is there.

    Raises
    ------
    FileFormatError
        If it cannot be.
    """
    refuse_file(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(
            f"the folder cannot be made ({error.strerror})", remedy="choose another one", path=folder
        ) from error


def refuse_file(folder: Path) -> None:
    """Raise `FileFormatError` if there is something else of that name."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise FileFormatError("this is no folder", remedy="choose another one", path=folder)


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep other batches out of a folder: each would leave the lines of the other out of the manifest.

    The system lets go of it when the process ends, however it does.

    Raises
    ------
    SignedHeatError
        If there is another batch in it.
    """
    if fcntl is None:
        yield
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):  # and not that this file system holds nothing
                raise SignedHeatError(
                    "another batch is writing into this folder",
                    remedy="wait for it, or choose another folder",
                    path=folder,
                ) from error
        yield
    finally:
        os.close(number)


@contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A folder for what is not finished, removed at the end; those of batches that were killed are removed first."""
    for old in folder.glob(f"{SCRATCH}*"):
        number = old.name.removeprefix(SCRATCH)
        if not number.isdigit() or not _is_running(int(number)):
            shutil.rmtree(old, ignore_errors=True)
    own = folder.absolute() / f"{SCRATCH}{os.getpid()}"
    try:
        yield own
    finally:
        shutil.rmtree(own, ignore_errors=True)


def _is_running(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    except OverflowError:  # no number of a process
        return False
    return number != os.getpid()
