"""Find the shapes of a batch, and name the results of each."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError, refuse_deleted_folder
from ..io.files import extension
from ..io.shape_files import READERS
from ..io.urdf import meshes_of

ROBOT = ".urdf"
"""Extension of descriptions of robots."""
UNSCALED = (1.0, 1.0, 1.0)
"""Scale of a shape that is used as its file has it."""
WILDCARDS = frozenset("*?[")
"""Characters that make a name a pattern."""


@dataclass(frozen=True)
class Input:
    """The file of a shape in a batch."""

    path: Path
    name: str  # path of its results without extension, relative to the folder for results
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)  # factors along x, y, z, if the description of a robot has some


def expand(inputs: Iterable[str | os.PathLike[str]], results: Path | None = None) -> list[Input]:
    """List the shapes in files, folders and patterns, in order and without repetitions.

    Folders are searched recursively for files with the extension of a shape, except in `results`. Files that are named
    themselves are listed whatever their extension. The description of a robot (``.urdf``) stands for the meshes that it
    refers to. Results are named after the files, so that ``parts/a.stl`` in the folder ``.`` gives ``parts/a``. Files
    that differ only in extension keep it.
    """
    paths: dict[str, Path] = {}  # by a key: the resolved path, and the scale if a robot gives one
    below: dict[str, str] = {}  # path relative to the folder that was searched, by the same key
    scales: dict[str, tuple[float, float, float]] = {}  # by the same key
    for name in inputs:
        try:
            files, root = _files(named_path(name), results)
        except OSError as error:
            cause = f"cannot be searched ({error.strerror})"
            raise FileFormatError(cause, remedy="check the name", path=error.filename or name) from error
        for path in files:
            if extension(path) == ROBOT:
                for mesh, scale in meshes_of(path):
                    key = f"{os.path.realpath(mesh)}*{scale}"
                    paths.setdefault(key, mesh)
                    below.setdefault(key, _name_in_robot(path, root, mesh, scale))
                    scales[key] = scale
                continue
            key = os.path.join(os.path.realpath(path.parent), path.name)
            inner = path.relative_to(root)
            paths.setdefault(key, path)
            below.setdefault(key, path.name if ".." in inner.parts else str(inner))
    if not paths:
        raise FileFormatError("the inputs contain no shape", remedy="name files, folders or patterns")
    names = _names(below)
    return [
        Input(path, name, scales.get(key, UNSCALED)) for (key, path), name in zip(paths.items(), names, strict=True)
    ]


def _name_in_robot(robot: Path, root: Path, mesh: Path, scale: tuple[float, float, float]) -> str:
    """Return a path for a mesh of a robot: in a folder named like the robot's file, with the scale in its name.

    `root` is the folder to which the names of results are relative.
    """
    folder = robot.relative_to(root).with_suffix("")
    factors = scale[:1] if len({*scale}) == 1 else scale
    suffix = "" if scale == UNSCALED else "_x" + "_".join(f"{factor:g}" for factor in factors)
    return str(folder / f"{mesh.stem}{suffix}{mesh.suffix}")


def named_path(name: str | os.PathLike[str]) -> Path:
    """Convert a name to a path; refuse an empty one, as of an unset shell variable, and one of nothing that can exist.

    That is a name with a null character, or a relative one in a folder that has been deleted.
    """
    extension(name)  # refuses what is no name
    if not os.fspath(name) or "\0" in str(name):
        cause = "holds a null character" if os.fspath(name) else "is empty"
        raise FileFormatError(f"the name {cause}", remedy="name a file or a folder, or . for this one", path=name)
    refuse_deleted_folder(name)
    return Path(name)


def _files(path: Path, results: Path | None) -> tuple[list[Path], Path]:
    """Return the files of an input, which is a file, folder or pattern, and the folder to which names are relative.

    Files in the folder `results` are left out.
    """
    if path.is_dir():
        avoided = None if results is None else os.path.realpath(results)
        if avoided is not None and Path(os.path.realpath(path)).is_relative_to(avoided):
            raise FileFormatError(
                "results would be written among the shapes, and the next run would take them for shapes",
                remedy="name another folder for them, such as a subfolder",
                path=path,
            )
        inner = (Path(folder, name) for folder, _, names in os.walk(path, onerror=_fail) for name in names)
        shapes = sorted(
            file for file in inner if extension(file) in {*READERS, ROBOT} and _is_file_or_broken_link(file)
        )
        if avoided is not None:
            shapes = [file for file in shapes if not Path(os.path.realpath(file)).is_relative_to(avoided)]
        return shapes, path
    if path.exists() or not WILDCARDS & set(str(path)):
        return [path], path.parent  # the worker reports a file that cannot be read
    fixed = next(k for k, part in enumerate(path.parts) if WILDCARDS & set(part))
    root, pattern = Path(*path.parts[:fixed]), path.parts[fixed:]
    if pattern[-1] == "**":
        pattern = (*pattern, "*")
    shown = (file for file in root.glob(str(Path(*pattern))) if not _is_hidden(file.relative_to(root), pattern))
    files = sorted(file for file in shown if _is_file_or_broken_link(file))
    if not files:
        raise FileFormatError("no file matches the pattern", remedy="check the pattern", path=path)
    return files, root


def _fail(error: OSError) -> None:
    """Raise an error that `os.walk` would otherwise ignore."""
    raise error  # shapes in a folder that cannot be read must not be skipped silently


def _is_hidden(path: Path, pattern: tuple[str, ...]) -> bool:
    """Whether a pattern does not match a path as in shells, where names that begin with a dot must be asked for."""
    return any(name.startswith(".") and name != ".." for name in path.parts) and not any(
        part.startswith(".") and part != ".." for part in pattern
    )


def _is_file_or_broken_link(path: Path) -> bool:
    """Whether to list a path; broken links are listed, and reported as shapes that cannot be read."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def _names(below: dict[str, str]) -> list[str]:
    """Return a unique name for the results of each file.

    It is the relative path that `below` has for each resolved path, without extension. Files that would share it keep
    their extension, and if that is shared too, have more folders in the name.
    """
    folders: dict[str, list[str]] = {}  # by the name of the files in them
    for path in below:
        folders.setdefault(os.path.basename(path).lower(), []).append(os.path.dirname(path))
    above = [os.path.relpath(path, os.path.commonpath(folders[os.path.basename(path).lower()])) for path in below]
    names = [_without_extension(name) for name in below.values()]
    for longer in (list(below.values()), above):
        count = Counter(name.lower() for name in names)  # file systems may ignore case
        names = [name if count[name.lower()] == 1 else long for name, long in zip(names, longer, strict=True)]
    name, times = Counter(names).most_common(1)[0]
    if times > 1:
        raise FileFormatError("results of two shapes would have the same name", remedy="rename one", path=name)
    return names


def _without_extension(name: str) -> str:
    """Remove the extension of a name, unless only dots would be left, as of ``..stl``."""
    short = name.removesuffix(Path(name).suffix)
    return name if os.path.basename(short) in ("", ".", "..") else short
