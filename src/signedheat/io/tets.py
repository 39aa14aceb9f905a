"""Reading and writing of tet meshes, and of fields on them, by meshio."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..fields.tet_field import TetField
from ..packages import require
from .files import PathLike, contents, extension, replacing, unknown_extension

NAME = "signed_distance"

MODULES = {
    ".ele": "tetgen",
    ".mesh": "medit",
    ".meshb": "medit",
    ".msh": "gmsh",
    ".node": "tetgen",
    ".vtk": "vtk",
    ".vtu": "vtu",
}
"""meshio's module for each extension. TetGen's ``.node`` and ``.ele`` files are read and written as a pair."""

TET_FIELD_FORMATS = frozenset({".msh", ".vtk", ".vtu"})


def read_tets(path: PathLike) -> TetMesh | TriangleMesh | PolygonMesh:
    """Read a `TetMesh`; or, from a file without tets, its surface.

    Raises
    ------
    FileFormatError
        If the file is missing, truncated or damaged.
    GeometryError
        If it has neither tets nor faces.
    """
    mesh = _load(path)
    kinds = {block.type for block in mesh.cells}
    if "tetra" in kinds:
        return TetMesh.from_meshio(mesh)
    if kinds & {"tetra10", "hexahedron", "wedge", "hierarchy"} or not kinds & {"triangle", "quad"}:
        found = ", ".join(sorted(kinds)) or "no cells"
        raise GeometryError(
            f"{path} holds no tets, but {found}",
            remedy="convert it to linear tetrahedra first",
        )
    return (TriangleMesh if "quad" not in kinds else PolygonMesh).from_meshio(mesh)


def write_tets(mesh: TetMesh, path: PathLike) -> None:
    """Write a tet mesh, in the format given by the extension."""
    _store(mesh.to_meshio(), path)


def save_tet_field(field: TetField, path: PathLike) -> None:
    """Write mesh and values; see `TetField.save`."""
    if extension(path) not in TET_FIELD_FORMATS:
        raise unknown_extension(path, TET_FIELD_FORMATS, "a field on tets")
    _store(field.mesh.to_meshio({NAME: field.values}), path)


def load_tet_field(path: PathLike) -> TetField:
    """Read what `save_tet_field` wrote.

    Raises
    ------
    FileFormatError
        If the file is missing or damaged, or has no tets with such values.
    """
    mesh = _load(path)
    if NAME not in mesh.point_data:
        raise FileFormatError(
            f"it has no point data '{NAME}': it was not written as a field",
            path=path,
        )
    try:
        return TetField(TetMesh.from_meshio(mesh), np.asarray(mesh.point_data[NAME], dtype=np.float64))
    except GeometryError as error:
        raise FileFormatError(error.cause, remedy=error.remedy, element=error.element, path=path) from error


def _load(path: PathLike) -> Any:
    module = _module(path)
    for part in _parts(path):
        contents(part)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about unclosed files
            return module.read(str(path))
    except Exception as error:  # meshio raises exceptions of any type
        reason = str(error) or type(error).__name__
        raise FileFormatError(
            f"the file is damaged, or is of another kind ({reason})",
            path=path,
        ) from error


def _store(mesh: Any, path: PathLike) -> None:
    module = _module(path)
    with replacing(path) as temporary:
        if module.__name__.endswith("tetgen"):
            with replacing(Path(path).with_suffix(".node")) as nodes, replacing(Path(path).with_suffix(".ele")) as tets:
                _write(module, temporary.with_suffix(".node"), mesh)
                temporary.with_suffix(".node").replace(nodes)
                temporary.with_suffix(".ele").replace(tets)
                temporary.write_bytes((nodes if extension(path) == ".node" else tets).read_bytes())
        else:
            _write(module, temporary, mesh)


def _write(module: Any, path: Path, mesh: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        module.write(str(path), mesh)


def _parts(path: PathLike) -> list[Path]:
    """The files that belong to a path: two for TetGen's formats."""
    if MODULES[extension(path)] == "tetgen":
        return [Path(path).with_suffix(".node"), Path(path).with_suffix(".ele")]
    return [Path(path)]


def _module(path: PathLike) -> Any:
    name = MODULES.get(extension(path))
    if name is None:
        raise unknown_extension(path, MODULES, "a tet mesh")
    return require(f"meshio.{name}", "tet meshes")
