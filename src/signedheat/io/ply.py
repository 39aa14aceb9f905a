"""PLY, binary and text: meshes, triangle strips, oriented points, values at vertices; meshes larger than memory."""

from __future__ import annotations

import codecs
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..shapes.exchange import Elements
from .budgets import charge_words
from .files import PathLike, contents, damaged, ensure_writable, replacing
from .numerals import integer, integers, parsed_numbers

PLY_TYPES = {
    name: code
    for names, code in [
        ("char int8", "i1"),
        ("uchar uint8", "u1"),
        ("short int16", "i2"),
        ("ushort uint16", "u2"),
        ("int int32", "i4"),
        ("uint uint32", "u4"),
        ("float float32", "f4"),
        ("double float64", "f8"),
    ]
    for name in names.split()
}
PLY_INTEGERS = {name: code for name, code in PLY_TYPES.items() if code[0] != "f"}
"""NumPy types by their names in PLY; and those of integers, which may count the entries of a list."""
PLY_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


@dataclass
class _Element:
    """An element of the header, such as ``vertex``."""

    name: str
    count: int  # number of its rows
    properties: dict[str, str | tuple[str, str]] = field(default_factory=dict)
    """NumPy type of each property by name, or for a list the types of its count and of its entries."""

    def add(self, name: str, kind: str | tuple[str, str]) -> None:
        """Append a property, whose name must be new."""
        if name in self.properties:
            raise ValueError(name)
        self.properties[name] = kind


def read_ply(path: PathLike, names: Sequence[str] = ()) -> Elements:
    """Read the faces of a PLY file, or without faces the triangles of its strips, or without these its points.

    Points have normals and areas if the file has ``nx ny nz`` and ``area``; faces have neither. `names` are further
    properties of the vertices to read as `values`; those that the file lacks are left out.
    """
    tables = _tables(path)
    # properties that are lists are left out
    vertex = {name: column for name, column in tables.get("vertex", {}).items() if not isinstance(column, tuple)}
    if not {"x", "y", "z"} <= vertex.keys():
        raise FileFormatError("there is no element 'vertex' with x, y and z: this is not a shape")
    vertices = _columns(vertex, "xyz")
    values = {name: vertex[name] for name in names if name in vertex}
    face = tables.get("face", {})
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if lists is not None and not isinstance(lists, tuple):
        raise damaged("the vertex ids of faces are not lists")
    if lists is not None and len(lists[1]):
        return Elements(vertices, corners=integers(lists[0], "vertex ids"), counts=lists[1], values=values)
    strips = next((column for column in tables.get("tristrips", {}).values() if isinstance(column, tuple)), None)
    if strips is not None and len(strips[0]) >= 3:
        faces = _unrolled(integers(strips[0], "vertex ids of strips", -1))
        return Elements(vertices, faces.ravel(), np.full(len(faces), 3), values=values)
    normals = _columns(vertex, ["nx", "ny", "nz"]) if {"nx", "ny", "nz"} <= vertex.keys() else None
    return Elements(vertices, normals=normals, areas=vertex.get("area"), values=values)


def write_ply(shape: Elements, path: PathLike, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Return binary PLY in double precision. Normals, areas, values and (n, 3) colours are properties of vertices."""
    given: list[tuple[list[str], NDArray[Any] | None]] = [
        (["x", "y", "z"], shape.points),
        (["nx", "ny", "nz"], shape.normals),
        (["area"], shape.areas),
        *(([name], values) for name, values in shape.values.items()),
    ]
    corners, counts, channels = shape.corners, shape.counts, 0 if colors is None else 3
    names = [name for own, values in given for name in own if values is not None]
    columns = np.column_stack([values for _, values in given if values is not None])
    table = np.zeros(len(columns), dtype=[("numbers", "<f8", len(names)), ("color", "u1", channels)])
    table["numbers"] = columns
    if colors is not None:
        table["color"] = colors
    listed = np.insert(corners, np.cumsum(counts) - counts, counts).astype("<i4")
    header = _header_of(len(table), names, len(counts), channels=("red", "green", "blue")[:channels])
    return header + table.tobytes() + listed.tobytes()


def _header_of(
    n_vertices: int,
    names: Sequence[str],
    n_faces: int,
    channels: Sequence[str] = (),
    count_type: str = "int",
    comment: str | None = None,
) -> bytes:
    """Return the header of binary PLY.

    Parameters
    ----------
    n_vertices : int
        Number of vertices.
    names : sequence of str
        Names of the properties of vertices that are doubles.
    n_faces : int
        Number of faces, which the header leaves out if it is 0 and there is no comment.
    channels : sequence of str
        Names of the properties of vertices that are bytes, such as ``"red"``.
    count_type : str
        PLY type of the number of corners of a face.
    comment : str, optional
        A comment.
    """
    lines = ["ply", "format binary_little_endian 1.0", *([] if comment is None else [f"comment {comment}"])]
    lines += [f"element vertex {n_vertices}", *(f"property double {name}" for name in names)]
    lines += [f"property uchar {channel}" for channel in channels]
    if n_faces or comment is not None:
        lines += [f"element face {n_faces}", f"property list {count_type} int vertex_indices"]
    return ("\n".join([*lines, "end_header"]) + "\n").encode()


def write_parts(parts: Iterator[tuple[Floats, Ints]], path: PathLike) -> tuple[int, int]:
    """Write a mesh larger than memory to binary PLY, part by part, and return its numbers of vertices and faces.

    Each part has (n, 3) vertices and (m, 3) triangles, whose vertex ids are those in the whole mesh.
    """
    ensure_writable(path, {".ply"}, "a mesh part by part")
    n_vertices = n_faces = 0

    def header() -> bytes:
        """Return a header of the same length for all numbers: spaces in a comment make up for their digits."""
        free = " " * (24 - len(str(n_vertices)) - len(str(n_faces)))  # twelve digits each
        return _header_of(n_vertices, "xyz", n_faces, count_type="uchar", comment=f"signedheat{free}")

    with (
        replacing(path) as temporary,
        open(temporary, "wb") as file,
        tempfile.TemporaryFile(dir=temporary.parent) as faces,
    ):
        file.write(header())
        for vertices, triangles in parts:
            file.write(np.ascontiguousarray(vertices, dtype="<f8").tobytes())
            rows = np.empty(len(triangles), dtype=PLY_FACE)
            rows["count"], rows["corners"] = 3, triangles
            faces.write(rows.tobytes())
            n_vertices, n_faces = n_vertices + len(vertices), n_faces + len(triangles)
        faces.seek(0)
        shutil.copyfileobj(faces, file, 1 << 24)
        file.seek(0)
        file.write(header())
    return n_vertices, n_faces


def _tables(path: PathLike) -> dict[str, dict[str, Any]]:
    """Return the columns of a PLY file, by the names of element and property.

    The column of a list consists of two arrays: the entries of all rows one after another, and the (n,) number of
    entries in each row.
    """
    form, elements, body = _header(contents(path).removeprefix(codecs.BOM_UTF8))
    read_element = _text_reader(body) if form == "ascii" else _BinaryReader(body, form).read
    return {element.name: read_element(element) for element in elements}


def _columns(table: dict[str, Any], names: Any) -> Floats:
    """Return columns of a table side by side, such as (n, 3) for the names x, y and z."""
    return np.stack([table[name] for name in names], axis=1).astype(np.float64)


def _unrolled(strip: Ints) -> Ints:
    """Return the (m, 3) triangles of strips that −1 separates, with the corners of every second one swapped."""
    windows = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    index = np.arange(len(strip))
    begin = np.maximum.accumulate(np.where(np.concatenate([[True], strip[:-1] < 0]), index, 0))
    odd = (index - begin)[: len(windows)] % 2 == 1
    windows[odd] = windows[odd][:, [1, 0, 2]]
    return windows[(windows >= 0).all(axis=1)]


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Parse the header of a PLY file; return its format, its elements, and the data after it."""
    if not data.startswith(b"ply"):
        raise FileFormatError("it does not begin with 'ply': this is not a PLY file")
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise damaged("the header has no end: the file is truncated")
    form, elements = "", []
    for line in data[:end].splitlines()[1:]:
        words = line.decode("ascii", errors="replace").split()
        try:
            match words[:1]:
                case ["format"]:
                    form = words[1]
                case ["element"]:
                    elements.append(_Element(words[1], integer(words[2], f"number of {words[1]}")))
                case ["property"] if words[1] == "list":
                    elements[-1].add(words[4], (PLY_INTEGERS[words[2]], PLY_TYPES[words[3]]))
                case ["property"]:
                    elements[-1].add(words[2], PLY_TYPES[words[1]])
        except (IndexError, KeyError, ValueError):
            raise damaged(f"the header line '{' '.join(words)}' makes no sense: the file is damaged") from None
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise damaged(f"the format '{form}' does not exist in PLY: the file is damaged")
    return form, elements, data[newline + 1 :]


def _truncated(element: _Element) -> FileFormatError:
    """Return the error for data that end before the announced number of rows of an element."""
    return damaged(
        f"the data end within the {element.count} announced of element '{element.name}': the file is truncated"
    )


@dataclass
class _BinaryReader:
    """Reads the elements of a binary file, one after another."""

    body: bytes  # the data after the header
    form: str  # "binary_little_endian" or "binary_big_endian"
    at: int = 0  # number of bytes read so far

    def __post_init__(self) -> None:
        self.order = "<" if self.form == "binary_little_endian" else ">"

    def read(self, element: _Element) -> dict[str, Any]:
        """Read the columns of the next element by name, as `_tables` returns them."""
        if not element.properties:
            return {}
        lists = {name: kind for name, kind in element.properties.items() if isinstance(kind, tuple)}
        smallest = sum(
            int(kind[1]) if isinstance(kind, str) else int(kind[0][1]) for kind in element.properties.values()
        )
        if element.count * smallest > len(self.body) - self.at:
            raise _truncated(element)
        table = self._read_equal_rows(element, lists)
        return self._row_by_row(element) if table is None else table

    def _read_equal_rows(self, element: _Element, lists: dict[str, tuple[str, str]]) -> dict[str, Any] | None:
        """Read all rows of an element at once, which is quick, or return None if its lists differ in length.

        `lists` are its properties that are lists.
        """
        lengths = dict.fromkeys(lists, 0)
        if element.count:
            start, first = self.at, self._row_by_row(replace(element, count=1))
            self.at, lengths = start, {name: int(first[name][1][0]) for name in lists}
        entries: list[Any] = []
        for number, (name, kind) in enumerate(element.properties.items()):
            if isinstance(kind, str):
                entries.append((f"value {number}", self.order + kind))
            else:
                entries.append((f"count {number}", self.order + kind[0]))
                entries.append((f"value {number}", self.order + kind[1], (lengths[name],)))
        row = np.dtype(entries)
        if len(self.body) - self.at < row.itemsize * element.count:
            return None
        rows = np.frombuffer(self.body, row, element.count, self.at)
        columns = {name: f"value {number}" for number, name in enumerate(element.properties)}
        if any((rows[columns[name].replace("value", "count")] != lengths[name]).any() for name in lists):
            return None
        self.at += row.itemsize * element.count
        return {
            name: (rows[column].ravel(), np.full(element.count, lengths[name])) if name in lists else rows[column]
            for name, column in columns.items()
        }

    def _row_by_row(self, element: _Element) -> dict[str, Any]:
        """Read the columns of an element whose lists may differ in length, as `_tables` returns them."""
        columns: dict[str, list[Any]] = {name: [] for name in element.properties}
        counts: dict[str, list[int]] = {name: [] for name in element.properties}
        for _ in range(element.count):
            for name, kind in element.properties.items():
                length, code = 1, kind if isinstance(kind, str) else kind[1]
                if not isinstance(kind, str):
                    length = int(self._next(kind[0], 1, element)[0])
                    counts[name].append(length)
                columns[name].append(self._next(code, length, element))
        return {
            name: np.concatenate(columns[name])
            if isinstance(kind, str)
            else (np.concatenate(columns[name]), np.array(counts[name]))
            for name, kind in element.properties.items()
        }

    def _next(self, code: str, length: int, element: _Element) -> NDArray[Any]:
        """Read the next `length` numbers, of the NumPy type `code`."""
        size = length * int(code[1])
        if length < 0 or self.at + size > len(self.body):
            raise _truncated(element)
        self.at += size
        return np.frombuffer(self.body, self.order + code, length, self.at - size)


def _text_reader(body: bytes) -> Any:
    """Return a function that reads the columns of the next element from text, as `_BinaryReader.read` does."""
    charge_words(body)
    lines = iter([line.decode("ascii", errors="replace") for line in body.splitlines() if line.strip()])

    def read(element: _Element) -> dict[str, Any]:
        """Read the columns of the next element by name."""
        if not element.properties:
            return {}
        rows = [line.split() for _, line in zip(range(element.count), lines, strict=False)]
        if len(rows) < element.count:
            raise _truncated(element)
        table: dict[str, Any] = {}
        starts = [0] * len(rows)
        try:
            for name, kind in element.properties.items():
                if isinstance(kind, str):
                    table[name] = parsed_numbers([row[k] for row, k in zip(rows, starts, strict=True)], f"'{name}'")
                    starts = [k + 1 for k in starts]
                    continue
                counts = integers([row[k] for row, k in zip(rows, starts, strict=True)], f"lengths of '{name}'", 0)
                ends = [k + 1 + n for k, n in zip(starts, counts.tolist(), strict=True)]
                if any(len(row) < end for row, end in zip(rows, ends, strict=True)):
                    raise IndexError
                flat = [word for row, k, end in zip(rows, starts, ends, strict=True) for word in row[k + 1 : end]]
                table[name] = (parsed_numbers if kind[1].startswith("f") else integers)(flat, f"'{name}'"), counts
                starts = ends
        except IndexError:
            raise _truncated(element) from None
        return table

    return read
