"""Tet meshes, and fields on them, by meshio; VTK's XML is read by ourselves.

meshio reads in a process of its own: on some damaged files it does not end, and it allocates what they announce.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import warnings
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..packages import require
from ..shapes.exchange import FLAT_CELLS, VALUES_NAME
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .files import PathLike, contents, damaged, extension, format_for, replacing, writing
from .numerals import integers
from .sandbox import parsed
from .vtk_xml import Block, Cells, read_vtu

MESHIO_MODULES = {
    ".mesh": "medit",
    ".meshb": "medit",
    ".msh": "gmsh",
    ".vtk": "vtk",
    ".vtu": "vtu",
    ".ele": "tetgen",
    ".node": "tetgen",
}
"""Module of meshio for each extension."""
TETGEN = (".node", ".ele")
"""Extensions of TetGen files, which come in pairs."""
TET_FORMATS = frozenset(MESHIO_MODULES)

TET_FIELD_FORMATS = frozenset({".msh", ".vtk", ".vtu"})
COUNTED = {"PhysicalNames": 1, "Entities": 4, "Nodes": 2, "Elements": 2, "Periodic": 1, "NodeData": 1, "ElementData": 1}
"""Number of counts at the beginning of each section of a Gmsh file, by its name (one in version 2)."""
LONGEST_LINE = 200
"""Bytes of a line in which counts are looked for."""
IN_TEXT = ("PhysicalNames", "NodeData", "ElementData")
"""Sections of Gmsh files whose counts are text even in binary files."""


def read_tets(path: PathLike) -> TetMesh | TriangleMesh | PolygonMesh:
    """Read a tet mesh, or from a file with nothing but flat cells, which include triangles or quads, a mesh."""
    mesh = load_cells(path)
    kinds = {block.type for block in mesh.cells}
    if not kinds & {"triangle", "quad"} or not all(kind.startswith(FLAT_CELLS) for kind in kinds):
        return TetMesh.from_meshio(mesh)
    return (TriangleMesh if "quad" not in kinds else PolygonMesh).from_meshio(mesh)


def load_cells(path: PathLike) -> Any:
    """Read points, cells and values at the points; the result has the attributes of a `meshio.Mesh`."""
    if extension(path) == ".vtu":
        return read_vtu(path, (VALUES_NAME,))
    for file in _files(path):
        if all(line.startswith(b"#") for line in contents(file).split(b"\n") if line.strip()):  # meshio would never end
            raise FileFormatError("the file is empty", remedy="write it again", path=file)
    if extension(path) == ".msh":
        _refuse_announcements(path)
    parts = parsed("cells", path, "meshio", "tet meshes", module=MESHIO_MODULES[extension(path)])
    blocks = [Block(kind, parts[f"cells {k}"]) for k, kind in enumerate(parts["kinds"])]
    values = {name: parts[f"values {k}"] for k, name in enumerate(parts["names"])}
    return Cells(parts["points"], blocks, values)


def store_cells(mesh: Any, path: PathLike) -> None:
    """Write a `meshio.Mesh` in the format given by the extension."""
    module = require(f"meshio.{format_for(path, MESHIO_MODULES, 'a tet mesh')}", "tet meshes")
    with writing(path), tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), redirect_stderr(StringIO()):
        warnings.simplefilter("ignore")
        made = Path(folder, f"mesh{extension(path)}")
        module.write(str(made), mesh)
        for file in _files(path):
            with replacing(file) as temporary:
                shutil.copyfile(made.with_suffix(file.suffix.lower()), temporary)


def _files(path: PathLike) -> list[Path]:
    """Return the files to read for a path: for TetGen the other file of the pair and this one, otherwise this one."""
    named = Path(path)
    return [*(named.with_suffix(end) for end in TETGEN if extension(path) in TETGEN and end != extension(path)), named]


def _refuse_announcements(path: PathLike) -> None:
    """Raise `FileFormatError` if a Gmsh file announces more items than it has bytes, which would stall meshio."""
    data = contents(path)
    begin = data.find(b"$MeshFormat")
    version, form, size = (*data[max(begin, 0) : begin + LONGEST_LINE].split()[1:4], b"", b"", b"")[:3]
    if begin < 0 or form not in (b"0", b"1") or size not in (b"4", b"8"):
        return  # meshio reports it
    is_raw, kind = form == b"1" and version.startswith(b"4"), np.dtype(f"<u{size.decode()}")
    for section in re.finditer(rb"^\$(\w+)[ \t]*\r?\n", data, re.MULTILINE):
        name, begin = section[1].decode(), section.end()
        if is_raw and name in COUNTED and name not in IN_TEXT:
            counts = np.frombuffer(data, kind, COUNTED[name], begin).tolist()
        else:
            words = data[begin : begin + LONGEST_LINE].split(b"\n")[0].split()[: COUNTED.get(name, 0)]
            counts = integers(words, f"counts of {name}").tolist()
        if max(counts, default=0) > len(data):
            raise damaged(f"it has {len(data)} bytes, and announces {max(counts)} {name}", element=name)
