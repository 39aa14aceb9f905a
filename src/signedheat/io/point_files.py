"""Lists of points: text with one on each line (XYZ, CSV), PCD of the Point Cloud Library, scans (LAS, LAZ, E57)."""

from __future__ import annotations

import codecs
import re
import struct
from collections.abc import Sequence
from xml.parsers import expat

import numpy as np

from ..arrays import Floats
from ..errors import FileFormatError
from ..packages import ensure_installed
from ..shapes.exchange import Elements
from ..surfaces.point_cloud import PointCloud
from .budgets import charge, charge_words
from .files import PathLike, contents, damaged, extension, reading, refuse_kind, text
from .numerals import integer, like_number, parsed_numbers, row_of_numbers
from .sandbox import parsed

SEPARATORS, DECIMAL_COMMAS = str.maketrans(",;", "  "), str.maketrans(",;", ". ")
"""Tables for `str.translate` that make separators spaces: commas and semicolons, or with decimal commas semicolons."""
WITH_COMMA = re.compile(r"[-+]?[0-9]+(,[0-9]+)?([eE][-+]?[0-9]+)?")
"""Matches a number that has a decimal comma or is whole."""
FIELD_TYPES = {"F": "f", "I": "i", "U": "u"}
"""Letters of the types of fields in NumPy, by those in PCD files."""
FIELD_CODES = frozenset("f4 f8 i1 i2 i4 i8 u1 u2 u4 u8".split())
"""Types of fields, as NumPy names them without a byte order."""
SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance "
"""Namespace of the attributes by which XML names schemas."""


def read_rows(path: PathLike, widths: tuple[int, ...]) -> list[Floats]:
    """Read blocks of lines, which empty lines separate, as (n, k) arrays, where k is one of `widths` and common to all.

    Numbers are separated by commas, semicolons, tabs or spaces. Commas are decimal where they all stand between digits
    and something else separates the numbers. Text after ``#`` is skipped, and so are lines before the first point
    unless they hold something like numbers.
    """
    blocks: list[list[list[float]]] = [[]]
    columns = 0
    content = text(path)
    charge_words(content)
    meaning = DECIMAL_COMMAS if _has_decimal_commas(content) else SEPARATORS
    for number, line in enumerate(content.split("\n"), start=1):
        words = line.partition("#")[0].translate(meaning).split()
        if not words:
            if not line.strip():
                blocks.append([])
            continue
        values = row_of_numbers(line, words)
        if values and len(values) == (columns or len(values)) and len(values) in widths:
            columns = len(values)
            blocks[-1].append(values)
        elif values or columns or any(map(like_number, words[:1] if len(words) not in widths else words)):
            counts = " or ".join(map(str, [columns] if columns else widths))
            raise FileFormatError(
                f"line {number}, '{line.strip()[:60]}', does not hold {counts} numbers",
                remedy="give one point per line",
                element=f"line {number}",
            )
    if not columns:
        raise FileFormatError("it contains no points", remedy=f"give {' or '.join(map(str, widths))} numbers per line")
    return [np.array(block) for block in blocks if block]


def _has_decimal_commas(content: str) -> bool:
    """Whether a text has decimal commas: each line has several numbers that semicolons or spaces separate."""
    if "," not in content:
        return False
    lines = (line.partition("#")[0].replace(";", " ").split() for line in content.split("\n"))
    rows = [words for words in lines if words and words[0][0] in "+-0123456789,."]
    return bool(rows) and all(len(words) > 1 and all(map(WITH_COMMA.fullmatch, words)) for words in rows)


def read_point_lists(path: PathLike, dimension: int) -> list[tuple[Floats, bool]]:
    """Return the (n, dimension) points of each polyline, and whether it is closed.

    It is closed if its last point equals its first, which is then left out.
    """
    lists = read_rows(path, (dimension,))
    closed = [len(points) > 2 and bool((points[0] == points[-1]).all()) for points in lists]
    return [(points[:-1] if end else points, end) for points, end in zip(lists, closed, strict=True)]


def write_point_lists(lists: Sequence[tuple[Floats, bool]]) -> str:
    """Return the text that `read_point_lists` reads."""
    blocks = []
    for points, closed in lists:
        rows = [*points.tolist(), *([points[0].tolist()] if closed else [])]
        blocks.append("".join(",".join(map(repr, row)) + "\n" for row in rows))
    return "\n".join(blocks)


def read_xyz(path: PathLike) -> Elements:
    """Read points with 3 numbers on each line, or 6, of which the last are normals or colours, which are ignored."""
    table = np.concatenate(read_rows(path, (3, 6)))
    last = table[:, 3:]
    are_colors = (last >= 0).all() and (last == np.rint(last)).all() and last.max(initial=0.0) > 1
    return Elements(table[:, :3], normals=last if last.size and not are_colors else None)


def write_xyz(shape: Elements, path: PathLike) -> bytes:
    """Return text with the position and normal of a point on each line."""
    if shape.kind != "PointCloud":
        raise refuse_kind(shape.kind, path, "points", ".obj or .ply")
    table = shape.points if shape.normals is None else np.hstack([shape.points, shape.normals])
    return "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist()).encode()


def read_pcd(path: PathLike) -> Elements:
    """Read points with ascii, binary or binary_compressed data; points without a position (NaN) are left out."""
    content = contents(path).removeprefix(codecs.BOM_UTF8)
    header: dict[str, list[str]] = {}
    position = 0
    while "DATA" not in header:
        end = content.find(b"\n", position)
        if end < 0:
            raise damaged("there is no line DATA: this is not a PCD file, or it is truncated", element="DATA")
        words = content[position:end].decode("ascii", "replace").partition("#")[0].split()
        if words:
            header[words[0].upper()] = words[1:]
        position = end + 1
    table = _table(header, content[position:])
    if not {"x", "y", "z"} <= table.keys():
        raise damaged(f"the fields are {', '.join(table)}, without x, y and z", element="FIELDS")
    points = np.column_stack([table[axis] for axis in "xyz"])
    finite = np.isfinite(points).all(axis=1)
    names = [f"normal_{axis}" for axis in "xyz"]
    normals = np.column_stack([table[name] for name in names]) if set(names) <= table.keys() else None
    whole = normals is not None and np.isfinite(normals[finite]).all()
    return Elements(points[finite], normals=normals[finite] if normals is not None and whole else None)


def _table(header: dict[str, list[str]], body: bytes) -> dict[str, Floats]:
    """Return the first number of each field at the n points of a PCD file, (n,), by the name of the field."""
    names, counts, types, n = _described(header)
    row = np.dtype([(f"{k}", f"<{code}", (count,)) for k, (code, count) in enumerate(zip(types, counts, strict=True))])
    kind = header["DATA"][0].lower() if header["DATA"] else ""
    if kind == "binary":
        if len(body) < n * row.itemsize:
            raise damaged(f"{n} points take {n * row.itemsize} bytes, and {len(body)} follow")
        rows = np.frombuffer(body, row, n)
        return {name: rows[f"{k}"][:, 0].astype(np.float64) for k, name in enumerate(names)}
    charge(bytes=2 * n * row.itemsize)
    if kind == "binary_compressed":  # all values of a field come before those of the next
        body, position = _unpacked(body, n * row.itemsize), 0
        table = {}
        for name, code, count in zip(names, types, counts, strict=True):
            table[name] = (
                np.frombuffer(body, f"<{code}", n * count, position).reshape(n, count)[:, 0].astype(np.float64)
            )
            position += n * count * np.dtype(code).itemsize
        return table
    if kind != "ascii":
        raise FileFormatError(f"data are {kind}", remedy="write them as ascii, binary or binary_compressed")
    charge_words(body)
    try:
        lines = [line.decode("ascii").split() for line in body.splitlines() if line.strip()]
        numbers = parsed_numbers(lines, "points").reshape(n, sum(counts))
    except (ValueError, UnicodeDecodeError) as error:
        cause = f" ({error.cause})" if isinstance(error, FileFormatError) else ""
        raise damaged(f"there are no {n} lines of {sum(counts)} numbers{cause}") from None
    begins = np.concatenate([[0], np.cumsum(counts)])
    return {name: numbers[:, begins[k]] for k, name in enumerate(names)}


def _described(header: dict[str, list[str]]) -> tuple[list[str], list[int], list[str], int]:
    """Return the names of the fields of a PCD file, how many numbers each has, their types, and the number of points.

    The types are those of NumPy, without a byte order.
    """
    try:
        names, letters = header["FIELDS"], header["TYPE"]
        sizes = [integer(word, "SIZE", 1) for word in header["SIZE"]]
        counts = [integer(word, "COUNT", 1) for word in header.get("COUNT", ["1"] * len(names))]
        types = [f"{FIELD_TYPES[letter]}{size}" for letter, size in zip(letters, sizes, strict=True)]
        if not len(names) == len(types) == len(counts) or not {*types} <= FIELD_CODES:
            raise ValueError
        announced = {key: integer(header[key][0], key) for key in ("WIDTH", "HEIGHT", "POINTS") if key in header}
        n = announced["POINTS"] if "POINTS" in announced else announced["WIDTH"] * announced["HEIGHT"]
    except (KeyError, ValueError, IndexError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise damaged("the header of the PCD file is not complete, or contradicts itself", element="header") from None
    if announced.get("WIDTH", n) * announced.get("HEIGHT", 1) != n and len(announced) == 3:
        raise damaged(f"POINTS is {n}, and WIDTH times HEIGHT something else", element="POINTS")
    return names, counts, types, n


def read_las(path: PathLike) -> PointCloud:
    """Read the points of a LAS or LAZ file, in the coordinates of the scan; such files have no normals."""
    parts = parsed("las", path, "laspy", f"{extension(path)} files", bytes_per_byte=1000)
    return _cloud(parts["points"], path)


def read_e57(path: PathLike) -> PointCloud:
    """Read the points of all scans of an E57 file, in their common coordinates, without points marked invalid."""
    ensure_installed("pye57", ".e57 files")
    with reading(path):
        _refuse_references(_e57_description(contents(path)))
        return _cloud(parsed("e57", path, "pye57", ".e57 files")["points"], path)


def _e57_description(data: bytes) -> bytes:
    """Return the XML of an E57 file, whose pages each end with a checksum of four bytes."""
    if data[:8] != b"ASTM-E57" or len(data) < 48:
        raise damaged("it does not begin like an E57 file")
    offset, length, page = struct.unpack_from("<QQQ", data, 24)
    if not 4 < page <= len(data) or max(offset, length) > len(data):
        raise damaged(f"it announces {length} bytes of description at {offset}, and has {len(data)} bytes")
    payload = page - 4
    first, begin = divmod(offset, page)
    n_pages = -(-(begin + length) // payload)
    pages = (data[k * page : k * page + payload] for k in range(first, first + n_pages))
    return b"".join(pages)[begin : begin + length]


def _refuse_references(description: bytes) -> None:
    """Raise `FileFormatError` if XML refers to anything outside itself, or is not in UTF-8 as E57 requires."""

    def refuse(*_: object) -> None:
        raise FileFormatError("its description defines entities or names a schema", remedy="export the scan again")

    def begin(version: str, encoding: str | None, standalone: int) -> None:
        if (encoding or "utf-8").lower() != "utf-8":
            raise FileFormatError(f"its description is in {encoding}", remedy="export the scan again, in UTF-8")

    def element(name: str, attributes: dict[str, str]) -> None:
        if any(attribute.startswith(SCHEMA_INSTANCE) for attribute in attributes):
            refuse()

    parser = expat.ParserCreate("utf-8", " ")
    parser.XmlDeclHandler, parser.StartDoctypeDeclHandler, parser.StartElementHandler = begin, refuse, element
    try:
        parser.Parse(description, True)
    except expat.ExpatError as error:
        raise damaged(f"its description is not XML ({error})") from error


def _cloud(points: Floats, path: PathLike) -> PointCloud:
    """Make a point cloud of those points that have finite coordinates."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise FileFormatError("it has no points", path=path)
    return PointCloud(points)


def _unpacked(body: bytes, size: int) -> bytes:
    """Unpack LZF data of `size` bytes, which follow two four-byte numbers, their packed and unpacked lengths.

    A control byte c < 32 is followed by c + 1 bytes to copy. Any other one repeats a part of the result: its upper
    three bits are the length less two (if they are 7, the next byte is added); its lower five bits and the next byte
    tell how far back the part begins, less one.
    """
    ends = struct.unpack_from("<II", body) if len(body) >= 8 else (0, -1)
    if ends[1] != size or len(body) < 8 + ends[0]:
        raise FileFormatError(f"{size} bytes were to be unpacked from {ends[0]}: it is damaged or truncated")
    packed, result, position = body[8 : 8 + ends[0]], bytearray(), 0
    try:
        while position < len(packed) and len(result) <= size:
            control = packed[position]
            position += 1
            if control < 32:
                result += packed[position : position + control + 1]
                position += control + 1
                continue
            length = 2 + (control >> 5)
            if length == 9:
                length += packed[position]
                position += 1
            back = ((control & 31) << 8) + packed[position] + 1
            position += 1
            if back > len(result):
                raise IndexError
            part = bytes(result[len(result) - back : len(result) - back + length])
            result += (part * (length // len(part) + 1))[:length]  # a part may overlap its own repetition
    except IndexError:
        raise FileFormatError("the compressed data are damaged") from None
    if len(result) != size:
        raise FileFormatError(f"{len(result)} bytes were unpacked, not {size}: it is damaged")
    return bytes(result)
