"""Which shapes a batch has, and under what name the results of each are kept."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
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
    found: dict[str, str] = {}  # by where each is, links apart: its name below the folder that it was looked for in
    paths: dict[str, Path] = {}
    for each in inputs:
        try:
            files, root = _files(named_path(each), without)
        except OSError as error:
            cause, where = f"cannot be looked for ({error.strerror})", error.filename or each
            raise FileFormatError(cause, remedy="check the name", path=where) from error
        for path in files:
            place = os.path.join(os.path.realpath(path.parent), path.name)
            below = path.relative_to(root)
            paths.setdefault(place, path)
            found.setdefault(place, path.name if ".." in below.parts else str(below))
    if not found:
        raise FileFormatError("there is no shape among the inputs", remedy="name files, folders or patterns")
    return [Input(path, name) for path, name in zip(paths.values(), _names(found), strict=True)]


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


def _files(path: Path, without: Path) -> tuple[list[Path], Path]:
    """Files, and the folder that their names are relative to."""
    if path.is_dir():
        avoided = os.path.realpath(without)
        if Path(os.path.realpath(path)).is_relative_to(avoided):
            raise FileFormatError(
                "results would lie among the shapes, and be taken for some the next time",
                remedy="name another folder for them, such as one in this one",
                path=path,
            )
        inner = (Path(folder, name) for folder, names in _walk(path, links=False) for name in names)
        shapes = sorted(file for file in inner if extension(file) in READERS and _is_meant_for_a_file(file))
        return [file for file in shapes if not Path(os.path.realpath(file)).is_relative_to(avoided)], path
    if path.exists() or not MAGIC & set(str(path)):
        return [path], path.parent  # whether it can be read is for its worker to say
    fixed = next(k for k, part in enumerate(path.parts) if MAGIC & set(part))
    root = Path(*path.parts[:fixed])
    files = [match for match in sorted(_matching(root, path.parts[fixed:])) if _is_meant_for_a_file(match)]
    if not files:
        raise FileFormatError("no file matches the pattern", remedy="check the pattern", path=path)
    return files, root


def _walk(folder: Path, links: bool) -> Iterator[tuple[str, list[str]]]:
    """Folders below one, itself included, and the names of the files in each; every folder once, however links run.

    Raises
    ------
    OSError
        If one of them cannot be read: what is in it must not be missed.
    """

    def fail(error: OSError) -> None:
        raise error

    known: set[str] = set()
    for place, inner, names in os.walk(folder, followlinks=links, onerror=fail):
        real = os.path.realpath(place)
        if real in known:
            inner.clear()
            continue
        known.add(real)
        inner.sort()
        yield place, names


def _matching(root: Path, parts: Sequence[str]) -> set[Path]:
    """What matches a pattern below a folder, part by part; `glob` would follow links in circles."""
    found = {root}
    for part in [*parts, "*"] if parts[-1] == "**" else parts:
        if part == "**":
            below = {Path(place) for each in found if each.is_dir() for place, _ in _walk(each, links=True)}
            found = {place for place in below if not _is_hidden(place.relative_to(root))}
        else:
            found = {Path(match) for each in found for match in glob.glob(os.path.join(glob.escape(str(each)), part))}
    return found


def _is_hidden(path: Path) -> bool:
    return any(name.startswith(".") and name != ".." for name in path.parts)


def _is_meant_for_a_file(path: Path) -> bool:
    """Links that lead nowhere are told as shapes that cannot be read, lest they be missed."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def _names(found: dict[str, str]) -> list[str]:
    """A name for each file that no other has: without extension, with it, or with folders from further up."""
    alike: dict[str, list[str]] = {}
    for place in found:
        alike.setdefault(os.path.basename(place).lower(), []).append(os.path.dirname(place))
    common = {name: os.path.commonpath(folders) for name, folders in alike.items()}
    above = [os.path.relpath(place, common[os.path.basename(place).lower()]) for place in found]
    names = [_without_extension(name) for name in found.values()]
    for longer in (list(found.values()), above):
        count = Counter(name.lower() for name in names)  # file systems may not tell cases apart
        names = [name if count[name.lower()] == 1 else other for name, other in zip(names, longer, strict=True)]
    twice = next((name for name, times in Counter(names).items() if times > 1), None)
    if twice is not None:
        raise FileFormatError("the results of two shapes would have this name", remedy="rename one", path=twice)
    return names


def _without_extension(name: str) -> str:
    """A name without its extension, unless a folder would be left, as of ``..stl``.

    Examples
    --------
    >>> _without_extension("parts/a.stl"), _without_extension("..stl")
    ('parts/a', '..stl')
    """
    short = name.removesuffix(Path(name).suffix)
    return name if os.path.basename(short) in ("", ".", "..") else short
