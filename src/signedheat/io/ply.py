"""PLY, binary and text: meshes, triangle strips, oriented points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from .elements import SurfaceShape, assemble, faces_of, points_of
from .files import PathLike, contents, numbers

_TYPES = {
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


@dataclass
class _Element:
    """An element of the header; the type of a property is a code, or for a list the codes of its count and entries."""

    name: str
    count: int
    properties: dict[str, str | tuple[str, str]] = field(default_factory=dict)


def read_ply(path: PathLike) -> SurfaceShape:
    """The faces of a PLY file, including triangle strips; or its points, with ``nx ny nz`` and ``area`` if present."""
    data = contents(path)
    form, elements, body = _header(data, path)
    read_element = _text_reader(body, path) if form == "ascii" else _binary_reader(body, form, path)
    tables = {element.name: read_element(element) for element in elements}
    vertex = tables.get("vertex", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise FileFormatError(
            "there is no element 'vertex' with x, y and z: this holds no shape",
            path=path,
        )
    vertices = _columns(vertex, "xyz")
    face = tables.get("face", {})
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if lists is not None and len(lists[1]):
        return assemble(vertices, *lists)
    if "tristrips" in tables:
        faces = _unrolled(next(iter(tables["tristrips"].values()))[0])
        return assemble(vertices, faces.ravel(), np.full(len(faces), 3))
    normals = _columns(vertex, ["nx", "ny", "nz"]) if {"nx", "ny", "nz"} <= vertex.keys() else None
    return PointCloud(vertices, normals, vertex.get("area"))


def write_ply(shape: SurfaceShape, path: PathLike) -> bytes:
    """Binary PLY in double precision."""
    names, columns = ["x", "y", "z"], [points_of(shape)]
    if isinstance(shape, PointCloud) and shape.normals is not None:
        names, columns = [*names, "nx", "ny", "nz"], [*columns, shape.normals]
    if isinstance(shape, PointCloud) and shape.areas is not None:
        names, columns = [*names, "area"], [*columns, shape.areas[:, None]]
    vertices = np.hstack(columns).astype("<f8")
    corners, counts = faces_of(shape)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {name}" for name in names]
    if len(counts):
        header += [f"element face {len(counts)}", "property list int int vertex_indices"]
    starts = np.cumsum(counts) - counts
    listed = np.insert(corners, starts, counts).astype("<i4")
    return ("\n".join([*header, "end_header"]) + "\n").encode() + vertices.tobytes() + listed.tobytes()


def _columns(table: dict[str, Any], names: Any) -> NDArray[np.float64]:
    return np.stack([table[name] for name in names], axis=1).astype(np.float64)


def _unrolled(strip: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles of strips separated by −1; every second one has the opposite orientation."""
    windows = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    index = np.arange(len(strip))
    begin = np.maximum.accumulate(np.where(np.concatenate([[True], strip[:-1] < 0]), index, 0))
    odd = (index - begin)[: len(windows)] % 2 == 1
    windows[odd] = windows[odd][:, [1, 0, 2]]
    return windows[(windows >= 0).all(axis=1)]


def _header(data: bytes, path: PathLike) -> tuple[str, list[_Element], bytes]:
    if not data.startswith(b"ply"):
        raise FileFormatError(
            "it does not begin with 'ply': this is no PLY file",
            path=path,
        )
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise FileFormatError(
            "the header has no end: the file is truncated",
            remedy="write or download it again",
            path=path,
        )
    form, elements = "", []
    for line in data[:end].decode("ascii", errors="replace").splitlines()[1:]:
        words = line.split()
        try:
            match words[:1]:
                case ["format"]:
                    form = words[1]
                case ["element"]:
                    elements.append(_Element(words[1], int(words[2])))
                case ["property"] if words[1] == "list":
                    elements[-1].properties[words[4]] = (_TYPES[words[2]], _TYPES[words[3]])
                case ["property"]:
                    elements[-1].properties[words[2]] = _TYPES[words[1]]
        except (IndexError, KeyError, ValueError):
            raise FileFormatError(
                f"the header line '{line}' makes no sense: the file is damaged",
                remedy="write or download it again",
                path=path,
            ) from None
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise FileFormatError(
            f"the format '{form}' is none that PLY has: the file is damaged",
            remedy="write or download it again",
            path=path,
        )
    return form, elements, data[newline + 1 :]


def _truncated(path: PathLike, element: _Element) -> FileFormatError:
    return FileFormatError(
        f"the data end within the {element.count} announced of element '{element.name}': the file is truncated",
        remedy="write or download it again",
        path=path,
    )


def _binary_reader(body: bytes, form: str, path: PathLike) -> Any:
    order = "<" if form == "binary_little_endian" else ">"
    at = 0

    def read(element: _Element) -> dict[str, Any]:
        nonlocal at
        lengths = _first_lengths(at, element)
        row = np.dtype(
            [
                entry
                for name, kind in element.properties.items()
                for entry in (
                    [(name, order + kind)]
                    if isinstance(kind, str)
                    else [(f"{name} count", order + kind[0]), (name, order + kind[1], (lengths[name],))]
                )
            ]
        )
        if len(body) - at >= row.itemsize * element.count:  # try: all lists have the length of the first
            rows = np.frombuffer(body, row, element.count, at)
            if all((rows[f"{name} count"] == length).all() for name, length in lengths.items()):
                at += row.itemsize * element.count
                counted = {name: np.full(element.count, length) for name, length in lengths.items()}
                return {
                    name: (rows[name].astype(np.int64).ravel(), counted[name]) if name in counted else rows[name]
                    for name in element.properties
                }
        if not lengths:
            raise _truncated(path, element)
        return _row_by_row(element)

    def one(code: str, position: int, count: int = 1) -> NDArray[Any]:
        return np.frombuffer(body, order + code, count, position)

    def _first_lengths(position: int, element: _Element) -> dict[str, int]:
        lengths: dict[str, int] = {}
        for name, kind in element.properties.items():
            if isinstance(kind, str):
                position += int(kind[1])
                continue
            size = int(kind[0][1])
            enough = element.count > 0 and position + size <= len(body)
            lengths[name] = max(0, int(one(kind[0], position)[0])) if enough else 0
            position += size + lengths[name] * int(kind[1][1])
        return lengths

    def _row_by_row(element: _Element) -> dict[str, Any]:
        nonlocal at
        columns: dict[str, list[Any]] = {name: [] for name in element.properties}
        counts: dict[str, list[int]] = {name: [] for name in element.properties}
        try:
            for _ in range(element.count):
                for name, kind in element.properties.items():
                    length = 1
                    if not isinstance(kind, str):
                        length = int(one(kind[0], at)[0])
                        at += int(kind[0][1])
                        counts[name].append(length)
                    code = kind if isinstance(kind, str) else kind[1]
                    columns[name].append(one(code, at, length))
                    at += length * int(code[1])
        except ValueError:
            raise _truncated(path, element) from None
        return {
            name: np.concatenate(columns[name])
            if isinstance(kind, str)
            else (np.concatenate(columns[name]).astype(np.int64), np.array(counts[name]))
            for name, kind in element.properties.items()
        }

    return read


def _text_reader(body: bytes, path: PathLike) -> Any:
    lines = iter([line for line in body.decode("ascii", errors="replace").splitlines() if line.strip()])

    def read(element: _Element) -> dict[str, Any]:
        rows = [line.split() for _, line in zip(range(element.count), lines, strict=False)]
        if len(rows) < element.count:
            raise _truncated(path, element)
        table: dict[str, Any] = {}
        starts = [0] * len(rows)
        try:
            for name, kind in element.properties.items():
                if isinstance(kind, str):
                    table[name] = numbers([row[k] for row, k in zip(rows, starts, strict=True)], path, f"'{name}'")
                    starts = [k + 1 for k in starts]
                    continue
                counts = numbers([row[k] for row, k in zip(rows, starts, strict=True)], path, f"'{name}'", int)
                ends = [k + 1 + n for k, n in zip(starts, counts.tolist(), strict=True)]
                if any(len(row) < end for row, end in zip(rows, ends, strict=True)):
                    raise IndexError
                flat = [word for row, k, end in zip(rows, starts, ends, strict=True) for word in row[k + 1 : end]]
                entry = float if kind[1].startswith("f") else int
                table[name] = numbers(flat, path, f"'{name}'", entry), counts
                starts = ends
        except IndexError:
            raise _truncated(path, element) from None
        return table

    return read
