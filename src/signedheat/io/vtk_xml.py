"""VTK's XML files: image data (``.vti``), polygonal data (``.vtp``) and cells (``.vtu``, which are only read).

Files are written with appended raw data, as VTK does by default, and read in every encoding that VTK writes. The only
library that reads all of these, VTK itself, takes more than half a gigabyte installed.
"""

from __future__ import annotations

import base64
import binascii
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..shapes.exchange import Elements
from .budgets import BYTES_PER_PLACED, XML, charge, charge_tree, charge_words
from .files import PathLike, contents, damaged
from .numerals import integer, integers, parsed_numbers, typed_numbers

VTK_TYPES = {f"{kind}{8 * size}": f"{kind[0].lower()}{size}" for kind in ("Int", "UInt") for size in (1, 2, 4, 8)}
VTK_TYPES |= {"Float32": "f4", "Float64": "f8"}
"""NumPy types by the names of types in VTK's files."""
VTK_NAMES = {code: name for name, code in VTK_TYPES.items()}
"""Names of types in VTK's files by NumPy types."""
CELL_NAMES = {
    1: "vertex",
    3: "line",
    5: "triangle",
    7: "polygon",
    9: "quad",
    10: "tetra",
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    24: "tetra10",
}
"""Names of the kinds of cells in meshio, by their numbers in VTK."""
CELL_GROUPS = ("Verts", "Polys", "Lines", "Strips")
"""Names of the groups of cells of polygonal data."""


def write_vti(origin: Floats, spacing: Floats, values: Mapping[str, NDArray[Any]], convention: str) -> bytes:
    """Return a ``.vti`` file as bytes.

    Parameters
    ----------
    origin, spacing : (d,) float
        Position of the first node, and steps along each axis.
    values : mapping of (n₁, …, n_d) arrays
        Values at the nodes by name, indexed [x, y, z]. ParaView shows the first.
    convention : str
        What the values mean, which becomes a comment.
    """
    name, first = next(iter(values.items()))
    missing = 3 - first.ndim
    extent = " ".join(f"0 {n - 1}" for n in first.shape + (1,) * missing)
    writer = _Writer()
    arrays = "".join(writer.array(key, numbers.ravel(order="F")) for key, numbers in values.items())
    attributes = (
        f'WholeExtent="{extent}" Origin="{_words([*origin, *[0.0] * missing])}" '
        f'Spacing="{_words([*spacing, *[1.0] * missing])}" Direction="1 0 0 0 1 0 0 0 1"'
    )
    body = (
        f"<!-- {convention} -->\n"
        f'<ImageData {attributes}><Piece Extent="{extent}">'
        f'<PointData Scalars="{name}">{arrays}</PointData></Piece></ImageData>'
    )
    return writer.file("ImageData", body)


def read_vti(path: PathLike, other: str = "") -> tuple[NDArray[Any], Floats, Floats, NDArray[Any] | None]:
    """Read values at the nodes of an image along x, y, z.

    Parameters
    ----------
    path : str or path
        The file.
    other : str
        Name of a further array to read.

    Returns
    -------
    values : (n₁, …, n_d) array
        The array that the file says to show, or else the first, indexed [x, y, z].
    origin, spacing : (d,) float
        Position of the first node, and steps along each axis.
    further : (n₁, …, n_d) array or None
        The array named `other`, or None if there is none.
    """
    root, arrays = parse(path, "ImageData")
    image, piece = root.find("ImageData"), root.find("ImageData/Piece")
    extent = integers(image.get("WholeExtent", "").split() if image is not None else [], "extent")
    if (
        image is None
        or piece is None
        or len(extent) != 6
        or piece.get("Extent", "").split() != image.get("WholeExtent", "").split()
    ):
        raise FileFormatError("the image is not in one piece", remedy="write it again as a single .vti file")
    direction = image.get("Direction", "1 0 0 0 1 0 0 0 1")
    if parsed_numbers(direction.split(), "direction").tolist() != np.eye(3).ravel().tolist():
        raise FileFormatError(f"the axes of the image are rotated ({direction})", remedy="resample it along x, y, z")
    shape = extent[1::2] - extent[::2] + 1
    n_nodes = math.prod(shape.tolist())
    if shape.min() < 1 or extent.max() >= 2**53 or extent.min() <= -(2**53):
        raise damaged(f"its extent is {' '.join(map(str, extent.tolist()))}: it is damaged")
    dimension = 3 if shape[2] > 1 else 2 if shape[1] > 1 else 1
    spacing = parsed_numbers(image.get("Spacing", "1 1 1").split(), "spacing")
    origin = parsed_numbers(image.get("Origin", "0 0 0").split(), "origin")
    if extent[::2].any():
        origin = origin + spacing * extent[::2]
    nodes = piece.find("PointData")
    listed = [] if nodes is None else nodes.findall("DataArray")
    if nodes is None or not listed:
        raise FileFormatError("there are no values at the nodes", remedy="save them as point data")
    images = []
    first = next((array for array in listed if array.get("Name") == nodes.get("Scalars")), listed[0])
    for element in [first, *(array for array in listed if array is not first and array.get("Name") == other)][:2]:
        n_components = arrays.n_components(element)
        if n_components > 1:
            cause = f"'{element.get('Name')}' has {n_components} numbers at each node"
            raise FileFormatError(cause, remedy="save a scalar")
        images.append(arrays.of(element, n_nodes).reshape(shape[:dimension], order="F"))
    return images[0], origin[:dimension], spacing[:dimension], images[1] if len(images) > 1 else None


def write_vtp(shape: Elements, path: PathLike) -> bytes:
    """Return a ``.vtp`` file of polygons, or of points with normals and areas. ParaView shows the first of `values`.

    All writers of shapes take a `path`, which text formats name in their messages; this one does not need it.
    """
    points, corners, counts = shape.points, shape.corners, shape.counts
    given = {"Normals": shape.normals, "area": shape.areas, **shape.values}
    group = "Polys" if len(counts) else "Verts"
    if not len(counts):
        corners, counts = np.arange(len(points)), np.ones(len(points), dtype=np.int64)
    writer = _Writer()
    arrays = "".join(writer.array(name, column) for name, column in given.items() if column is not None)
    shown = "".join(f' Scalars="{name}"' for name in [*shape.values][:1])
    data = f"<PointData{shown}>{arrays}</PointData>" if arrays else ""
    xyz = f"<Points>{writer.array('Points', points)}</Points>"
    ends = np.cumsum(counts)
    cells = f"<{group}>{writer.array('connectivity', corners)}{writer.array('offsets', ends)}</{group}>"
    sizes = dict.fromkeys(CELL_GROUPS, 0) | {group: len(counts)}
    numbered = " ".join(f'NumberOf{name}="{number}"' for name, number in sizes.items())
    piece = f'<Piece NumberOfPoints="{len(points)}" {numbered}>{data}{xyz}{cells}</Piece>'
    return writer.file("PolyData", f"<PolyData>{piece}</PolyData>")


def read_vtp(path: PathLike, names: Sequence[str] = ()) -> Elements:
    """Read the polygons of a ``.vtp`` file, or if it has none its points.

    `names` are values at the points to read; those that a part of the file lacks are left out.
    """
    root, arrays = parse(path, "PolyData")
    pieces = root.findall("PolyData/Piece")
    counted = [{name: arrays.count(piece, f"NumberOf{name}") for name in ("Points", *CELL_GROUPS)} for piece in pieces]
    made = sum(numbers["Points"] + numbers["Polys"] for numbers in counted)
    charge(BYTES_PER_PLACED * made, len(pieces), made)
    points, corners, counts, n_points = [], [], [], 0
    found: dict[str, list[NDArray[Any]]] = {name: [] for name in ("Normals", "area", *names)}
    for piece, numbers in zip(pieces, counted, strict=True):
        table = {(group.tag, element.get("Name")): element for group in piece for element in group.iter("DataArray")}
        if numbers["Strips"]:
            raise FileFormatError("there are triangle strips", remedy="convert them to triangles before saving")
        n_own, n_faces = numbers["Points"], numbers["Polys"]
        xyz = next((element for (tag, _), element in table.items() if tag == "Points"), None)
        offsets = integers(arrays.of(table.get(("Polys", "offsets")), n_faces), "offsets", 0)
        if n_faces == 0 and piece.get("NumberOfPolys") is None and piece.find("Polys/DataArray") is not None:
            raise FileFormatError("it does not announce NumberOfPolys", element="NumberOfPolys")
        steps = np.diff(offsets, prepend=0)
        if (steps < 0).any():
            raise damaged("its offsets decrease: it is damaged")
        n_corners = int(offsets[-1]) if n_faces else 0
        corners.append(
            integers(arrays.of(table.get(("Polys", "connectivity")), n_corners), "connectivity", 0) + n_points
        )
        counts.append(steps)
        for name, parts in found.items():  # normals and areas belong to points only
            element = None if n_faces and name not in names else table.get(("PointData", name))
            if element is not None:
                parts.append(arrays.of(element, (3 if name == "Normals" else 1) * n_own))
        points.append(arrays.of(xyz, 3 * n_own).astype(np.float64).reshape(-1, 3))
        n_points += n_own
    if not n_points:
        raise FileFormatError("there are no points: the file holds no shape")
    columns = {name: np.concatenate(parts) for name, parts in found.items() if len(parts) == len(points)}
    values = {name: columns[name] for name in names if name in columns}
    faces = np.concatenate(corners), np.concatenate(counts)
    if len(faces[1]):
        return Elements(np.concatenate(points), *faces, values=values)
    if any(numbers["Lines"] for numbers in counted):
        raise FileFormatError("there are lines and no faces", remedy="save the points alone, or a surface")
    normals = columns["Normals"].reshape(-1, 3) if "Normals" in columns else None
    return Elements(np.concatenate(points), normals=normals, areas=columns.get("area"), values=values)


@dataclass(frozen=True)
class Block:
    """Cells of the same kind."""

    type: str  # name of the kind in meshio, such as "tetra"
    data: Ints  # (m, k) ids of the k points of each cell


@dataclass(frozen=True)
class Cells:
    """Points, cells and values at the points, as attributes with the names of those of a `meshio.Mesh`."""

    points: Floats
    cells: list[Block]
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)


def read_vtu(path: PathLike, names: tuple[str, ...] = ()) -> Cells:
    """Read the points and cells of a ``.vtu`` file, and those values at the points that have the given names."""
    root, arrays = parse(path, "UnstructuredGrid")
    pieces = root.findall("UnstructuredGrid/Piece")
    if len(pieces) != 1:
        raise FileFormatError(f"it has {len(pieces)} pieces", remedy="write it again as one", path=path)
    [piece] = pieces
    n_points, n_cells = arrays.count(piece, "NumberOfPoints"), arrays.count(piece, "NumberOfCells")
    element = piece.find("Points/DataArray")
    if element is None or not n_points:
        raise FileFormatError("there are no points: the file holds no shape", path=path)
    points = arrays.of(element, 3 * n_points).astype(np.float64).reshape(-1, 3)
    columns = {element.get("Name"): element for element in piece.iterfind("Cells/DataArray")}
    if not {"connectivity", "offsets", "types"} <= columns.keys():
        raise FileFormatError("its cells have no connectivity, offsets and types", path=path)
    ends = integers(arrays.of(columns["offsets"], n_cells), "offsets", 0)
    kinds = integers(arrays.of(columns["types"], n_cells), "types", 0)
    starts = np.concatenate([[0], ends])[:-1]
    if (ends < starts).any():
        raise FileFormatError("its offsets decrease: it is damaged", remedy="write it again", path=path)
    corners = integers(arrays.of(columns["connectivity"], int(ends[-1]) if n_cells else 0), "connectivity", 0)
    alike = pairs_of(kinds, ends - starts)
    charge(elements=len(alike))
    blocks = []
    for chosen in alike:
        kind, first = int(kinds[chosen[0]]), starts[chosen[0]]
        rows = starts[chosen][:, None] + np.arange(ends[chosen[0]] - first)
        blocks.append(Block(CELL_NAMES.get(kind, f"type {kind}"), corners[rows]))
    data = {
        name: arrays.of(element, n_points)
        for element in piece.iterfind("PointData/DataArray")
        if (name := element.get("Name")) in names
    }
    return Cells(points, blocks, data)


def pairs_of(first: Ints, second: Ints) -> list[Ints]:
    """Return the indices of entries that have the same pair of numbers, for each pair in ascending order."""
    order = np.lexsort([second, first])
    changes = (np.diff(first[order]) != 0) | (np.diff(second[order]) != 0)
    return np.split(order, np.flatnonzero(changes) + 1) if len(order) else []


def _words(values: Any) -> str:
    """Write numbers as text that is read back exactly, with spaces between them."""
    return " ".join(repr(float(value)) for value in values)


class _Writer:
    """Builds a file of VTK; arrays are collected for its appended section."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._offset = 0

    def array(self, name: str, values: NDArray[Any]) -> str:
        """Return the XML element of an array, whose data are appended to the file."""
        values = np.ascontiguousarray(values)
        code = values.dtype.str[1:]
        data = values.astype("<" + code, copy=False).tobytes()
        element = (
            f'<DataArray type="{VTK_NAMES[code]}" Name="{name}" NumberOfComponents="{values[0].size}" '
            f'format="appended" offset="{self._offset}"/>'
        )
        self._blocks += [np.array(len(data), dtype="<u8").tobytes(), data]
        self._offset += 8 + len(data)
        return element

    def file(self, kind: str, body: str) -> bytes:
        """Return the bytes of a file of a kind, such as ``"ImageData"``, with its XML and the data of all arrays."""
        about = f'type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64"'
        head = f'<?xml version="1.0"?>\n<VTKFile {about}>\n'
        appended = '\n<AppendedData encoding="raw">_'
        return b"".join([(head + body + appended).encode(), *self._blocks, b"</AppendedData></VTKFile>\n"])


@dataclass(frozen=True)
class _Arrays:
    """Decodes the arrays of a file."""

    order: str  # byte order of the numbers in NumPy's notation, "<" or ">"
    header: np.dtype[Any]  # type of the sizes before the data of an array
    compressor: str | None  # name of the compression in VTK, or None if data are not compressed
    encoding: str  # of the appended section, "raw" or "base64"
    appended: bytes  # the appended section, which has the data of arrays

    def count(self, piece: ElementTree.Element, name: str) -> int:
        """Return a number such as ``NumberOfPoints`` that a part of the file announces, 0 by default."""
        return integer(piece.get(name, "0").strip(), name)

    def n_components(self, element: ElementTree.Element) -> int:
        """Return how many numbers each point or cell has in a DataArray element, 1 by default."""
        return integer(element.get("NumberOfComponents", "").strip() or "1", "NumberOfComponents", 1)

    def of(self, element: ElementTree.Element | None, count: int) -> NDArray[Any]:
        """Return the (count,) numbers of a DataArray element, and raise an error if there are more or fewer."""
        if element is None:
            return self._counted(np.empty(0), count)
        self.n_components(element)  # raises an error if it is no number
        code = VTK_TYPES.get(element.get("type", ""))
        if code is None:
            raise FileFormatError(f"arrays of type '{element.get('type')}' are not supported", remedy="use Float64")
        form = element.get("format")
        charge_words(element.text or "")
        inline = (element.text or "").split()
        if form == "ascii":
            return self._counted(typed_numbers(inline, code, "values"), count)
        size = count * np.dtype(code).itemsize
        charge(bytes=(1 if self.compressor is None else 3) * size)  # compressed blocks, joined
        try:
            if form == "binary":
                data = self._block("".join(inline).encode(), True, size)
            else:
                start = integer(element.get("offset", "0"), "offset")
                data = self._block(memoryview(self.appended)[start:], self.encoding == "base64", size)
            values = np.frombuffer(data, self.order + code)
        except (ValueError, IndexError, zlib.error, binascii.Error) as error:
            raise damaged(f"an array cannot be decoded ({error}): the file is truncated") from error
        return self._counted(values, count).astype(code, copy=False)

    def _counted(self, values: NDArray[Any], count: int) -> NDArray[Any]:
        """Return the values themselves, and raise an error unless their number is `count`."""
        if values.size != count:
            raise damaged(
                f"an array has {values.size} numbers, where {count} are announced: it is truncated or damaged"
            )
        return values

    def _block(self, data: bytes | memoryview, is_base64: bool, size: int) -> bytes | memoryview:
        """Return the bytes of an array, which follow a header with sizes; raise `ValueError` if they exceed `size`.

        In base 64, header and data are encoded together unless the data are compressed.
        """
        width = self.header.itemsize

        def take(start: int, length: int) -> tuple[bytes | memoryview, int]:
            """Return `length` decoded bytes that begin at `start` in the data, and where they end in the data."""
            if not is_base64:
                part: bytes | memoryview = data[start : start + length]
                end = start + length
            else:
                end = start + 4 * -(-length // 3)
                part = base64.b64decode(data[start:end])[:length]
            if len(part) < length:
                raise ValueError(f"{len(part)} of {length} bytes are there")
            return part, end

        def sizes(count: int) -> tuple[list[int], int]:
            """Return the first `count` numbers of the header, and where they end in the data."""
            part, end = take(0, count * width)
            return np.frombuffer(part, self.header).tolist(), end

        if self.compressor is None:
            (announced,), at = sizes(1)
            if announced != size:
                raise ValueError(f"it has {announced} bytes instead of {size}")
            return (take(0, width + size)[0])[width:] if is_base64 else take(at, size)[0]
        if "ZLib" not in self.compressor:
            raise FileFormatError(f"compressed by {self.compressor}", remedy="save it without compression")
        n_blocks = sizes(1)[0][0]
        if n_blocks * width > len(data):
            raise ValueError(f"{n_blocks} blocks are announced")
        packed, at = sizes(3 + n_blocks)
        ends = np.cumsum([0, *packed[3:]]).tolist()
        everything, _ = take(at, ends[-1])
        parts, left = [], size
        for begin, end in pairwise(ends):
            parts.append(zlib.decompressobj().decompress(everything[begin:end], left + 1))
            left -= len(parts[-1])
            if left < 0:
                raise ValueError(f"it has more than {size} bytes")
        return b"".join(parts)


def parse(path: PathLike, kind: str) -> tuple[ElementTree.Element, _Arrays]:
    """Parse a file of a kind, such as ``"ImageData"``, and return its root element and a decoder of its arrays."""
    data = contents(path)
    mark = data.find(b"<AppendedData")
    appended, encoding = b"", "raw"
    if mark >= 0:
        start = data.find(b"_", mark)
        encoding = "base64" if b"base64" in data[mark:start] else "raw"
        appended = data[start + 1 :]
        data = data[:mark] + b"</VTKFile>"
    charge_tree(data, XML)
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise damaged(f"it is not XML ({error}): the file is truncated or damaged") from error
    if root.tag != "VTKFile" or root.get("type") != kind:
        raise FileFormatError(f"it holds {root.get('type', root.tag)}, not {kind}", remedy="check the extension")
    order = {"LittleEndian": "<", "BigEndian": ">"}.get(root.get("byte_order", "LittleEndian"))
    if order is None:
        raise damaged(f"its byte_order '{root.get('byte_order')}' is unknown: it is damaged")
    width = {"UInt32": "u4", "UInt64": "u8"}.get(root.get("header_type", "UInt32"))
    if width is None:
        raise damaged(f"its header_type '{root.get('header_type')}' is unknown: it is damaged")
    header = np.dtype(order + width)
    return root, _Arrays(order, header, root.get("compressor"), encoding, appended)
