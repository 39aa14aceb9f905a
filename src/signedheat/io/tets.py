"""Tet meshes, and fields on them, by meshio; VTK's XML is read by ourselves.

What meshio reads is parsed within a limit of time: on some damaged files it does not end by itself. What Gmsh's files
announce is checked before, since meshio allocates memory for it and counts to it.
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

from ..domains.exchange import NAME
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..packages import require
from .files import (
    PathLike,
    contents,
    damaged,
    ensure_fits,
    extension,
    format_for,
    parsed_by_others,
    replacing,
    writing,
)
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

TET_FIELD_FORMATS = frozenset({".msh", ".vtk", ".vtu"})

COUNTED = {
    "PhysicalNames": 1,
    "Entities": 4,
    "Nodes": 2,
    "Elements": 2,
    "Periodic": 1,
    "NodeData": 1,
    "ElementData": 1,
}
"""Sections, and how many numbers at the beginning of each count what is in it (in version 2 there is but one)."""
IN_TEXT = ("PhysicalNames", "NodeData", "ElementData")
"""Sections that begin with text in binary files, too."""
LARGE = rb"^(\d{9,})(?=[ \t]*\r?$|(?:[ \t]+\S+){3})"
"""Numbers of nodes with many digits, at the beginning of lines that are no coordinates."""


def read_tets(path: PathLike) -> TetMesh | TriangleMesh | PolygonMesh:
    """Read a `TetMesh`; or, from a file without tets, its surface."""
    mesh = load_cells(path)
    kinds = {block.type for block in mesh.cells}
    if "tetra" in kinds:
        return TetMesh.from_meshio(mesh)
    if kinds & {"tetra10", "hexahedron", "wedge", "hierarchy"} or not kinds & {"triangle", "quad"}:
        found = ", ".join(sorted(kinds)) or "no cells"
        raise GeometryError(f"{path} holds no tets, but {found}", remedy="convert it to linear tetrahedra first")
    return (TriangleMesh if "quad" not in kinds else PolygonMesh).from_meshio(mesh)


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


def refuse_announcements(path: PathLike) -> None:
    """Check that a Gmsh file can hold what it announces, and that a table up to its largest node number fits."""
    data = contents(path)
    form = re.search(rb"\$MeshFormat\s+(\S+)\s+([01])\s+([48])\s", data)
    if form is None:
        return  # meshio says so
    is_raw = form[2] == b"1" and form[1].startswith(b"4")
    kind = np.dtype(f"<u{form[3].decode()}")
    for section in re.finditer(rb"^\$(\w+)[ \t]*\r?\n", data, re.MULTILINE):
        name, begin = section[1].decode(), section.end()
        if name not in COUNTED:
            continue
        if is_raw and name not in IN_TEXT:
            counts = np.frombuffer(data, kind, COUNTED[name], begin).tolist()
        else:
            counts = [int(word) for word in data[begin : begin + 100].split(b"\n")[0].split()[: COUNTED[name]]]
        if max(counts, default=0) > len(data):
            raise damaged(f"it has {len(data)} bytes, and announces {max(counts)} {name}", element=name)
        if name == "Nodes":
            if is_raw and form[1] != b"4.0":
                largest = _largest_in_blocks(data, begin, counts[0], kind)
            else:
                rows = data[begin : data.find(b"$EndNodes", begin)]
                largest = max(map(int, re.findall(LARGE, rows, re.MULTILINE)), default=0)
            ensure_fits(8 * largest, path)


def _largest_in_blocks(data: bytes, at: int, n_blocks: int, kind: np.dtype[np.unsignedinteger]) -> int:
    """The largest number of a node in the blocks of a binary file of version 4.1."""
    largest, at = 0, at + 4 * kind.itemsize
    for _ in range(n_blocks):
        at += 12  # dimension and number of the entity, whether it is parametric
        count = int(np.frombuffer(data, kind, 1, at)[0])
        numbers = np.frombuffer(data, kind, count, at + kind.itemsize)
        largest = max(largest, int(numbers.max(initial=0)))
        at += kind.itemsize * (1 + count) + 24 * count
    return largest
