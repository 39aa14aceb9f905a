"""Meshes that descriptions of robots refer to: URDF, the Unified Robot Description Format."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import FileFormatError, quoted
from .budgets import XML, charge_tree
from .files import PathLike, contents, reading
from .numerals import parsed_numbers

Scale = tuple[float, float, float]
"""Factors along x, y and z."""


def meshes_of(path: PathLike) -> list[tuple[Path, Scale]]:
    """Return the files and scales of all meshes in the description of a robot, without repetitions, in its order.

    Names that begin with ``package://`` are searched in the folder of the description and in those that contain it.
    """
    with reading(path):
        data = contents(path)
        charge_tree(data, XML)
        try:
            root = ElementTree.fromstring(data)
        except ElementTree.ParseError as error:
            raise FileFormatError(f"it is no XML ({error})", remedy="expand macros first: xacro robot.xacro") from error
        if root.tag != "robot":
            raise FileFormatError(f"its root is {quoted(root.tag)}, not robot", remedy="name a URDF file")
        meshes: dict[tuple[Path, Scale], None] = {}
        for mesh in root.iter("mesh"):
            name = mesh.get("filename", "")
            scale = parsed_numbers(mesh.get("scale", "1 1 1").split(), "a scale")
            if not name or "\0" in name or len(scale) != 3 or not (np.isfinite(scale) & (scale != 0)).all():
                raise FileFormatError(
                    f"a mesh has the name {quoted(name)} and the scale {quoted(mesh.get('scale'))}",
                    remedy="give a name, and three finite numbers that are not 0",
                )
            x, y, z = map(float, scale)
            meshes[_path_of_mesh(Path(path), name), (x, y, z)] = None
        if not meshes:
            raise FileFormatError("it refers to no mesh", remedy="name the meshes themselves")
    return list(meshes)


def _path_of_mesh(robot: Path, name: str) -> Path:
    """Return the path of a mesh that the description of a robot, a file, names by a path or a URL.

    After ``file://`` comes the path itself. ``package://name/rest`` is looked for, with and without `name`, in the
    folder of the description and in all folders that contain it. If there is no such file, it is a path relative to the
    folder of the description.
    """
    scheme, separator, rest = name.partition("://")
    if scheme == "file" and separator:
        return Path(rest)
    inner = rest if separator else name
    if Path(inner).is_absolute():
        return Path(inner)
    parts = Path(inner).parts
    names = [inner]
    if separator and len(parts) > 1:
        names.append(os.path.join(*parts[1:]))
    folders = [robot.absolute().parent, *(robot.absolute().parents if separator else ())]
    paths = [folder / relative for folder in folders for relative in names]
    return next((path for path in paths if path.is_file()), paths[0])
