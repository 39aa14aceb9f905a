"""Which shapes a batch has, and under what name the results of each are kept."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError
from ..io.files import extension
from ..io.shapes import READERS

MAGIC = frozenset("*?[")


@dataclass(frozen=True)
class Input:
    """A file, and the name of its results: a path without extension, relative to the folder of the results."""

    path: Path
    name: str


def expand(inputs: Iterable[str | os.PathLike[str]], without: Path) -> list[Input]:
    """Every shape among files, folders and patterns, once, in order.

    Folders, with those in them, give the files whose extensions are those of shapes; files that are named are taken
    whatever they are called. What lies in the folder `without`, that of the results, is left out of folders.

    Names follow the files: ``parts/a.stl`` in the folder ``.`` gives ``parts/a``. Two files that differ in extension
    alone keep it in their names.

    Raises
    ------
    FileFormatError
        If a name cannot be one, if there is no such file or folder, or none that matches a pattern, or no shape at all.
    """
    found: dict[Path, Path] = {}  # and what its name is relative to
    for each in inputs:
        try:
            for path, root in _files(named_path(each), without):
                found.setdefault(path, root)
        except OSError as error:
            raise FileFormatError(
                f"cannot be looked for ({error.strerror})", remedy="check the name", path=each
            ) from error
    if not found:
        raise FileFormatError("there is no shape among the inputs", remedy="name files, folders or patterns")
    return [Input(path, name) for path, name in zip(found, _names(found), strict=True)]


def named_path(name: str | os.PathLike[str]) -> Path:
    """A path that is named: an empty name, as of a variable that is not set, does not mean the folder that one is in.

    Raises
    ------
    FileFormatError
        If the name is empty, or none.
    """
    if not os.fspath(name) or "\0" in str(name):
        cause = "holds a null character" if os.fspath(name) else "is empty"
        raise FileFormatError(f"the name {cause}", remedy="name a file or a folder, or . for this one", path=name)
    return Path(name)


def _files(path: Path, without: Path) -> list[tuple[Path, Path]]:
    """Files, and the folder that the names of each are relative to."""
    text = str(path)
    if path.is_dir():
        inner = sorted(file for file in path.rglob("*") if extension(file) in READERS and _is_meant_for_a_file(file))
        avoided = without.resolve()
        return [(file, path) for file in inner if not file.resolve().is_relative_to(avoided)]
    if path.exists() or not MAGIC & set(text):
        return [(path, path.parent)]  # whether it can be read is for its worker to say
    root = Path(*[part for part in _before_magic(path)])
    matches = sorted(Path(match) for match in glob.glob(text, recursive=True))
    files = [(match, root) for match in matches if _is_meant_for_a_file(match)]
    if not files:
        raise FileFormatError("no file matches the pattern", remedy="check the pattern", path=path)
    return files


def _is_meant_for_a_file(path: Path) -> bool:
    """Links that lead nowhere are told as shapes that cannot be read, lest they be missed."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def _before_magic(path: Path) -> list[str]:
    parts: list[str] = []
    for part in path.parts:
        if MAGIC & set(part):
            break
        parts.append(part)
    return parts


def _names(found: dict[Path, Path]) -> list[str]:
    """A name for each file that no other has: without extension, with it, or with folders from further up."""
    names = [str(path.relative_to(root).with_suffix("")) for path, root in found.items()]
    for longer in (
        [str(path.relative_to(root)) for path, root in found.items()],
        [_from_above(path, list(found)) for path in found],
    ):
        count = Counter(name.lower() for name in names)  # file systems may not tell cases apart
        names = [name if count[name.lower()] == 1 else other for name, other in zip(names, longer, strict=True)]
    return names


def _from_above(path: Path, paths: list[Path]) -> str:
    """A file below what it has in common with all files of its name, its folders included."""
    alike = [other.absolute() for other in paths if other.name.lower() == path.name.lower()]
    common = Path(os.path.commonpath(alike))
    return str(path.absolute().relative_to(common if common != path.absolute() else common.parent))
