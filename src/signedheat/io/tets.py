"""Reading and writing of tet meshes, and of fields on them; meshio reads Medit and legacy VTK, and writes.

What meshio reads is parsed within a limit of time: on some damaged files it does not end by itself.
"""

from __future__ import annotations

import warnings
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..fields.tet_field import TetField
from ..packages import require
from .files import PathLike, contents, extension, parsed_by_others, reading, replacing, unknown_extension
from .gmsh import read_gmsh
from .tetgen_files import read_tetgen, write_tetgen
from .vtu import read_vtu

NAME = "signed_distance"

MODULES = {
    ".mesh": "medit",
    ".meshb": "medit",
    ".msh": "gmsh",
    ".vtk": "vtk",
    ".vtu": "vtu",
}
"""meshio's module for each extension."""
READERS = {".vtu": read_vtu, ".msh": read_gmsh}
"""What is read without meshio."""
TETGEN = frozenset({".ele", ".node"})
"""Extensions of the files of TetGen, which are read and written as a pair."""
TET_FORMATS = frozenset(MODULES) | TETGEN

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
    if extension(path) in TETGEN:
        return read_tetgen(path)
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
    if extension(path) in TETGEN:
        return write_tetgen(mesh, path)
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
    if extension(path) not in TET_FIELD_FORMATS:
        raise unknown_extension(path, TET_FIELD_FORMATS, "a field on tets")
    with reading(path):
        mesh = _load(path)
        if NAME not in mesh.point_data:
            raise FileFormatError(
                f"it has no point data '{NAME}': it was not written as a field",
                path=path,
            )
        values = np.asarray(mesh.point_data[NAME], dtype=np.float64)
        try:
            return TetField(TetMesh.from_meshio(mesh), values)
        except GeometryError as error:
            raise FileFormatError(error.cause, remedy=error.remedy, element=error.element, path=path) from error


def _load(path: PathLike) -> Any:
    if (own := READERS.get(extension(path))) is not None:
        return own(path, (NAME,))
    module, size = _module(path), len(contents(path))
    return parsed_by_others(lambda: module.read(str(path)), size)


def _store(mesh: Any, path: PathLike) -> None:
    module = _module(path)
    with replacing(path) as temporary:
        _write(module, temporary, mesh)


def _write(module: Any, path: Path, mesh: Any) -> None:
    with warnings.catch_warnings(), redirect_stderr(StringIO()):
        warnings.simplefilter("ignore")
        module.write(str(path), mesh)


def _module(path: PathLike) -> Any:
    name = MODULES.get(extension(path))
    if name is None:
        raise unknown_extension(path, MODULES, "a tet mesh")
    return require(f"meshio.{name}", "tet meshes")
