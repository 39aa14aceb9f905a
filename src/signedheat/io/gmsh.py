"""Gmsh's ``.msh``, versions 2 and 4.1, in text and binary: points, cells by kind, and the values at the points.

What is announced is compared with what is there before anything is allocated, and tags may be any numbers.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .files import PathLike, contents, reading
from .vtu import Block, Cells

KINDS = {
    1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6),
    7: ("pyramid", 5), 8: ("line3", 3), 9: ("triangle6", 6), 10: ("quad9", 9), 11: ("tetra10", 10),
    12: ("hexahedron27", 27), 13: ("wedge18", 18), 14: ("pyramid14", 14), 15: ("vertex", 1), 16: ("quad8", 8),
    17: ("hexahedron20", 20), 18: ("wedge15", 15), 19: ("pyramid13", 13), 21: ("triangle10", 10), 26: ("line4", 4),
    29: ("tetra20", 20),
}  # fmt: skip
"""Names of Gmsh's types of elements, as meshio has them, and the number of their nodes."""


@dataclass
class Numbers:
    """Numbers of a section one after another, in text, where all are of one type, or in binary.

    Attributes
    ----------
    data : (n,) float or bytes
        All of them.
    order : str
        Of bytes: ``<`` or ``>``; nothing in text.
    at : int
        Where the next begins.
    """

    data: NDArray[np.float64] | bytes
    order: str
    at: int = 0

    def take(self, count: int, kind: str) -> NDArray[Any]:
        """The next `count` numbers of a type: ``i4``, ``u8`` or ``f8``; whole numbers become int64."""
        size = 1 if isinstance(self.data, np.ndarray) else int(kind[1])
        if not 0 <= count <= (len(self.data) - self.at) // size:
            raise ValueError(f"{count} numbers are announced, and not there")
        begin, self.at = self.at, self.at + size * count
        if isinstance(self.data, np.ndarray):
            found = self.data[begin : self.at]
            return found if kind[0] == "f" else _whole(found)
        return np.frombuffer(self.data[begin : self.at], self.order + kind).astype(_type(kind))

    def rows(self, count: int, kinds: list[str]) -> list[NDArray[Any]]:
        """The next `count` rows of numbers of these types, as an array for each of them."""
        if isinstance(self.data, np.ndarray):
            table = self.take(count * len(kinds), "f8").reshape(count, -1)
            return [column if kind[0] == "f" else _whole(column) for column, kind in zip(table.T, kinds, strict=True)]
        row = np.dtype([(str(k), self.order + kind) for k, kind in enumerate(kinds)])
        begin, end = self.at, self.at + row.itemsize * count
        if not begin <= end <= len(self.data):
            raise ValueError(f"{count} rows are announced, and not there")
        self.at, data = end, np.frombuffer(self.data[begin:end], row)
        return [data[str(k)].astype(_type(kind)) for k, kind in enumerate(kinds)]


def _type(kind: str) -> type:
    return np.float64 if kind[0] == "f" else np.int64


def read_gmsh(path: PathLike, names: tuple[str, ...] = ()) -> Cells:
    """Points, cells, and those point data that are named.

    Raises
    ------
    FileFormatError
        If the file is damaged, or of another version.
    """
    data = contents(path)
    with reading(path):
        version, order = _format(data, path)
        tags, points = (_nodes_4 if version == 4.1 else _nodes_2)(_section(data, b"Nodes", order))
        if not len(points):
            raise FileFormatError("there are no points: the file holds no shape", path=path)
        elements = (_elements_4 if version == 4.1 else _elements_2)(_section(data, b"Elements", order))
        corners: dict[int, list[NDArray[np.int64]]] = {}
        for kind, nodes in elements:
            corners.setdefault(kind, []).append(nodes)
        blocks = [Block(KINDS[kind][0], _rows_of(np.concatenate(parts), tags)) for kind, parts in corners.items()]
        values = dict(_values(data, order, tags, names))
    return Cells(points, blocks, values)


def _format(data: bytes, path: PathLike) -> tuple[float, str]:
    """The version, and the order of bytes; none in text."""
    words = _body(data, b"MeshFormat").split(None, 3)
    version, is_binary, size = float(words[0]), int(words[1]), int(words[2])
    if not (2.0 <= version < 3.0 or version == 4.1) or is_binary not in (0, 1) or size != 8:
        raise FileFormatError(
            f"version {version:g} of Gmsh's format is not known, with numbers of {size} bytes",
            remedy="save it as version 4.1 or 2.2 in Gmsh",
            path=path,
        )
    if not is_binary:
        return version, ""
    return version, {b"\1\0\0\0": "<", b"\0\0\0\1": ">"}[_body(data, b"MeshFormat").split(b"\n", 1)[1][:4]]


def _body(data: bytes, name: bytes, start: int = 0) -> bytes:
    begin, end = data.find(b"$" + name, start), data.find(b"$End" + name, start)
    if not 0 <= begin < end:
        raise ValueError(f"it has no section {name.decode()}")
    return data[data.index(b"\n", begin) + 1 : end]


def _section(data: bytes, name: bytes, order: str) -> Numbers:
    return _numbers(_body(data, name), order)


def _numbers(body: bytes, order: str) -> Numbers:
    if order:
        return Numbers(body, order)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # about words that are no numbers, where NumPy ends
        return Numbers(np.fromstring(body, sep=" "), order)


def _whole(values: NDArray[np.float64]) -> NDArray[np.int64]:
    if (values != np.rint(values)).any() or (np.abs(values) > 2.0**53).any():
        raise ValueError("an id is no whole number")
    return values.astype(np.int64)


def _announced(numbers: Numbers) -> int:
    """The number on the first line, which is text in binary files of version 2, too."""
    if isinstance(numbers.data, np.ndarray):
        return int(numbers.take(1, "u8")[0])
    line, _, _ = numbers.data.partition(b"\n")
    numbers.at = len(line) + 1
    return int(line)


def _nodes_2(numbers: Numbers) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    tags, *points = numbers.rows(_announced(numbers), ["i4", "f8", "f8", "f8"])
    return tags, np.stack(points, axis=1)


def _nodes_4(numbers: Numbers) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    blocks, *_ = numbers.take(4, "u8").tolist()
    tags, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        dimension, _, is_parametric = numbers.take(3, "i4").tolist()
        [count] = numbers.take(1, "u8").tolist()
        if not 0 <= dimension <= 3:
            raise ValueError(f"an entity of {dimension} dimensions")
        tags.append(numbers.take(count, "u8"))
        width = 3 + (dimension if is_parametric else 0)
        points.append(numbers.take(width * count, "f8").reshape(count, width)[:, :3])
    return np.concatenate(tags), np.concatenate(points)


def _elements_2(numbers: Numbers) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Runs of elements of one type, one after another."""
    left, in_text = _announced(numbers), isinstance(numbers.data, np.ndarray)
    while left > 0:
        if isinstance(numbers.data, np.ndarray):
            kind, n_tags = _whole(numbers.data[numbers.at + 1 : numbers.at + 3]).tolist()
            width = 3 + n_tags + _corners(kind)
            count = _run(numbers.data[numbers.at :], width, min(left, 1 << 16)) if n_tags >= 0 else 0
        else:
            kind, count, n_tags = numbers.take(3, "i4").tolist()
            width = 1 + n_tags + _corners(kind)
        if n_tags < 0 or count < 1:
            raise ValueError(f"{count} elements with {n_tags} tags")
        rows = numbers.take(count * width, "i4").reshape(count, width)
        yield kind, rows[:, (3 if in_text else 1) + n_tags :]
        left -= count


def _run(data: NDArray[np.float64], width: int, most: int) -> int:
    """How many rows of this width follow that have the type and the number of tags of the first."""
    rows = data[: min(len(data) // width, most) * width].reshape(-1, width)
    step = 1
    while step < len(rows) and (rows[step : 2 * step, 1:3] == rows[0, 1:3]).all():
        step *= 2
    others = np.flatnonzero((rows[: 2 * step, 1:3] != rows[0, 1:3]).any(axis=1))
    return int(others[0]) if len(others) else len(rows[: 2 * step])


def _elements_4(numbers: Numbers) -> Iterator[tuple[int, NDArray[np.int64]]]:
    blocks, *_ = numbers.take(4, "u8").tolist()
    for _ in range(blocks):
        kind = int(numbers.take(3, "i4")[2])
        [count] = numbers.take(1, "u8").tolist()
        width = 1 + _corners(kind)
        yield kind, numbers.take(count * width, "u8").reshape(count, width)[:, 1:]


def _corners(kind: int) -> int:
    if kind not in KINDS:
        raise ValueError(f"elements of type {kind} are not known")
    return KINDS[kind][1]


def _rows_of(nodes: NDArray[np.int64], tags: NDArray[np.int64]) -> NDArray[np.int64]:
    """Which points have these tags."""
    order = np.argsort(tags, kind="stable")
    found = order[np.searchsorted(tags[order], nodes).clip(0, len(tags) - 1)]
    if (tags[found] != nodes).any():
        raise ValueError(f"there is no node {int(nodes[tags[found] != nodes][0])}")
    return np.asarray(found, dtype=np.int64)


def _values(
    data: bytes, order: str, tags: NDArray[np.int64], names: tuple[str, ...]
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Those point data that are named: lists of strings, numbers and whole numbers, on lines, stand before the rows."""
    start = data.find(b"$NodeData")
    while start >= 0:
        rest, lists = _body(data, b"NodeData", start), []
        for _ in range(3):
            number, _, rest = rest.partition(b"\n")
            *lines, rest = rest.split(b"\n", int(number))
            lists.append(lines)
        _, width, count = (int(line) for line in lists[2][:3])
        name = lists[0][0].strip().strip(b'"').decode("utf-8", errors="replace")
        if name in names and width == 1:  # others are vectors
            at, values = _numbers(rest, order).rows(count, ["i4", "f8"])
            points = _rows_of(at, tags)
            if len(np.unique(points)) < len(tags):
                raise ValueError(f"{count} of {len(tags)} points have values")
            found = np.empty(len(tags))
            found[points] = values
            yield name, found
        start = data.find(b"$NodeData", start + 1)
