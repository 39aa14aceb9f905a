"""Tet meshes, and fields on them, by meshio; VTK's XML is read by ourselves.

What meshio reads is parsed within a limit of time: on some damaged files it does not end by itself.
"""

from __future__ import annotations

import shutil
import tempfile
import warnings
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

from ..domains.exchange import NAME
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..packages import require
from .files import PathLike, contents, extension, format_for, parsed_by_others, replacing, writing
from .gmsh import refuse_announcements
from .vtk_xml import read_vtu

MODULES = {
    ".mesh": "medit",
    ".meshb": "medit",
    ".msh": "gmsh",
    ".vtk": "vtk",
    ".vtu": "vtu",
    ".ele": "tetgen",
    ".node": "tetgen",
}
"""meshio's module for each extension."""
TETGEN = (".node", ".ele")
"""Extensions of the files of TetGen, which are read and written as a pair."""
TET_FORMATS = frozenset(MODULES)

TET_FIELD_FORMATS = frozenset({".msh", ".vtk", ".vtkhdf", ".vtu"})


def read_tets(path: PathLike) -> TetMesh | TriangleMesh | PolygonMesh:
    """Read a `TetMesh`; or, from a file without tets, its surface.

    Raises
    ------
    FileFormatError
        If the file is missing, truncated or damaged.
    GeometryError
        If it has neither tets nor faces.
    """
    mesh = load_cells(path)
    kinds = {block.type for block in mesh.cells}
    if "tetra" in kinds:
        return TetMesh.from_meshio(mesh)
    if kinds & {"tetra10", "hexahedron", "wedge", "hierarchy"} or not kinds & {"triangle", "quad"}:
        found = ", ".join(sorted(kinds)) or "no cells"
        raise GeometryError(f"{path} holds no tets, but {found}", remedy="convert it to linear tetrahedra first")
    return (TriangleMesh if "quad" not in kinds else PolygonMesh).from_meshio(mesh)


def write_tets(mesh: TetMesh, path: PathLike) -> None:
    """Write a tet mesh, in the format given by the extension."""
    store_cells(mesh.to_meshio(), path)


def load_cells(path: PathLike) -> Any:
    """Points, cells and values at the points, as a `meshio.Mesh` has them."""
    if extension(path) == ".vtu":
        return read_vtu(path, (NAME,))
    module, files = _module(path), _files(path)
    for file in files:
        if all(line.startswith(b"#") for line in contents(file).split(b"\n") if line.strip()):  # meshio would look on
            raise FileFormatError("there is nothing in it", remedy="write it again", path=file)
    if extension(path) == ".msh":
        refuse_announcements(path)
    return parsed_by_others(lambda: module.read(str(path)), sum(len(contents(file)) for file in files))


def store_cells(mesh: Any, path: PathLike) -> None:
    """Write a `meshio.Mesh`."""
    module = _module(path)
    with writing(path), tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), redirect_stderr(StringIO()):
        warnings.simplefilter("ignore")
        made = Path(folder, f"mesh{extension(path)}")
        module.write(str(made), mesh)
        for file in _files(path):
            with replacing(file) as temporary:
                shutil.copyfile(made.with_suffix(file.suffix.lower()), temporary)


def _files(path: PathLike) -> list[Path]:
    """The file that is named, after the other one of a pair."""
    named = Path(path)
    return [*(named.with_suffix(end) for end in TETGEN if extension(path) in TETGEN and end != extension(path)), named]


def _module(path: PathLike) -> Any:
    return require(f"meshio.{format_for(path, MODULES, 'a tet mesh')}", "tet meshes")
