"""Tet meshes, and fields on them, by meshio; VTK's XML is read by ourselves.

meshio reads in a process of its own: on some damaged files it does not end, and it allocates what they announce.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import warnings
from collections.abc import Iterator
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
from .files import PathLike, contents, damaged, extension, format_for, reading, replacing, writing
from .numerals import integers, refuse_odd_text
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
VTK_COUNTED = {"POINTS": 1, "CELLS": 2, "CELL_TYPES": 1, "POINT_DATA": 1, "CELL_DATA": 1}
"""Number of counts after the name of each section of a file of VTK's older format."""
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
        with reading(file):
            _refuse_wrong_numbers(file)
    parts = parsed("cells", path, "meshio", "tet meshes", module=MESHIO_MODULES[extension(path)])
    blocks = [Block(kind, integers(parts[f"cells {k}"], f"ids of {kind}")) for k, kind in enumerate(parts["kinds"])]
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


def _refuse_wrong_numbers(path: PathLike) -> None:
    """Raise `FileFormatError` if counts in a file are negative, or larger than the file, which would stall meshio.

    In text, numbers that only Python reads are refused, too, such as 1_0.
    """
    data, ending = contents(path), extension(path)
    version, form, size = _gmsh_format(data) if ending == ".msh" else (b"", b"", b"")
    if ending == ".msh" and form not in (b"0", b"1"):
        return  # meshio reports it
    if ending == ".msh" and size not in (b"4", b"8"):
        raise damaged("the size of its numbers is neither 4 nor 8 bytes", element="MeshFormat")
    is_text = b"BINARY" not in data.split(b"\n", 3)[2:3] if ending == ".vtk" else ending != ".meshb" and form != b"1"
    if is_text:
        refuse_odd_text(data, "words")
    if ending == ".msh":
        announced = _gmsh_counts(
            data, None if is_text or not version.startswith(b"4") else np.dtype(f"<u{size.decode()}")
        )
    else:
        announced = _tetgen_counts(data) if ending in TETGEN else _vtk_counts(data) if ending == ".vtk" else iter(())
    for name, counts in announced:
        if max(counts, default=0) > len(data):
            raise damaged(f"it has {len(data)} bytes, and announces {max(counts)} {name}", element=name)
    if is_text and version.startswith(b"2"):
        nodes = data.partition(b"$Nodes")[2].partition(b"$EndNodes")[0].split()[1:]
        integers(nodes[::4], "numbers of nodes", 0)


def _gmsh_format(data: bytes) -> tuple[bytes, bytes, bytes]:
    """Return the version of a Gmsh file, ``b"1"`` if it is binary, and the size of its counts in bytes, as words."""
    begin = data.find(b"$MeshFormat")
    version, form, size = (*data[max(begin, 0) : begin + LONGEST_LINE].split()[1:4], b"", b"", b"")[:3]
    return (version, form, size) if begin >= 0 else (b"", b"", b"")


def _gmsh_counts(data: bytes, kind: np.dtype[Any] | None) -> Iterator[tuple[str, list[int]]]:
    """Yield the name of each section of a Gmsh file with the counts at its beginning, binary ones of a type or text."""
    for section in re.finditer(rb"^\$(\w+)[ \t]*\r?\n", data, re.MULTILINE):
        name, begin = section[1].decode(), section.end()
        if kind is not None and name in COUNTED and name not in IN_TEXT:
            yield name, np.frombuffer(data, kind, COUNTED[name], begin).tolist()
        else:
            words = data[begin : begin + LONGEST_LINE].split(b"\n")[0].split()[: COUNTED.get(name, 0)]
            yield name, integers(words, f"counts of {name}", 0).tolist()


def _vtk_counts(data: bytes) -> Iterator[tuple[str, list[int]]]:
    """Yield the name of each section of a file of VTK's older format with the counts after it."""
    for name, n_counts in VTK_COUNTED.items():
        for section in data.split(f"\n{name} ".encode())[1:]:
            words = section[:LONGEST_LINE].split(b"\n")[0].split()[:n_counts]
            yield name, integers(words, f"counts of {name}", 0).tolist()


def _tetgen_counts(data: bytes) -> Iterator[tuple[str, list[int]]]:
    """Yield the counts on the first line of a TetGen file that is no comment."""
    for line in data.split(b"\n"):
        if words := line.partition(b"#")[0].split():
            yield "items", integers(words, "counts of the first line", 0).tolist()
            return
