"""Meshes and points as text and in STL: Wavefront OBJ (``.obj``, and ``.pc`` of the published demo), OFF, STL."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterator
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError, InexactWarning, quoted, warn_user
from ..mesh.unit_vectors import unit
from ..mesh.welding import distinct_rows, same_positions
from ..shapes.exchange import Elements
from ..surfaces.triangle_mesh import TriangleMesh
from .budgets import charge_words
from .files import PathLike, contents, damaged, reading, refuse_kind, text
from .numerals import integer, integers, parsed_numbers

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
KEYWORDS = frozenset(
    "v vt vn vp f fo l p o g s mg lod mtllib usemtl maplib usemap cstype deg bmat step curv curv2 surf parm trim hole "
    "scrv sp end con bevel c_interp d_interp shadow_obj trace_obj ctech stech call csh bsp bzp cdc cdp res".split()
)
"""Keywords of lines of OBJ files. Lines with other keywords are damaged if they match `NUMBER_LINE`."""
NUMBER_LINE = re.compile(r"[-+.eE0-9/ ]+")
"""Matches a line of numbers without its keyword."""
CORNER = re.compile(r"[-+]?[0-9]+(/([-+]?[0-9]+)?){0,2}")
"""Matches the ids of the vertex, the texture coordinates and the normal of a corner, of which the last two may lack."""
ANNOUNCED_ROUNDING = 1e-4
"""Rounding error, relative to the size of a shape, above which a warning is issued."""
_HEADER = 84  # bytes of the header of STL: 80 of comment, 4 that count the facets


def read_stl(path: PathLike) -> TriangleMesh:
    """Read all facets of all solids in an STL file, without normals; corners with equal coordinates are one vertex."""
    data = contents(path).removeprefix(codecs.BOM_UTF8)
    announced = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else 0
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000].lower()
    if is_text and len(data) != _HEADER + 50 * announced:
        corners = _text_corners(data)
    elif len(data) < _HEADER + 50 * announced or len(data) < _HEADER:
        raise FileFormatError(
            f"{announced} facets need {_HEADER + 50 * announced} bytes, the file has {len(data)}: it "
            "is truncated, or not an STL file"
        )
    else:
        corners = np.frombuffer(data, _FACET, announced, _HEADER)["corners"].astype(np.float32)
    return _indexed(corners.reshape(-1, 3))


def write_stl(shape: Elements, path: PathLike) -> bytes:
    """Return binary STL in single precision, with a warning if that is inaccurate for the shape."""
    if shape.kind != "TriangleMesh":
        kinds = ".obj, .ply, .off or .vtp" if len(shape.counts) else ".ply or .xyz"
        raise refuse_kind(shape.kind, path, "triangles", kinds)
    corners = shape.points[shape.triangles]
    facets = np.zeros(len(corners), dtype=_FACET)
    facets["corners"] = corners
    if not np.isfinite(facets["corners"]).all():
        raise FileFormatError(
            "coordinates are too large for the single precision of STL", remedy="save it as .ply", path=path
        )
    warn_of_rounding(shape.points, shape.points.astype(np.float32).astype(np.float64))
    facets["normal"] = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return b"signedheat".ljust(80) + len(facets).to_bytes(4, "little") + facets.tobytes()


def warn_of_rounding(points: Floats, rounded: Floats) -> None:
    """Warn if rounding joins vertices of a shape, or moves them by more than `ANNOUNCED_ROUNDING` of its size."""
    largest_move = float(np.abs(points - rounded).max())
    n_distinct, n_rounded = (np.count_nonzero(same_positions(p) == np.arange(len(p))) for p in (points, rounded))
    if n_distinct > n_rounded or largest_move > ANNOUNCED_ROUNDING * float(np.ptp(points, axis=0).max()):
        joined = f" and joins {n_distinct - n_rounded:,} of them to others" if n_distinct > n_rounded else ""
        warn_user(
            f"the single precision of STL moves vertices by up to {largest_move:.2g}{joined}: save it as .ply, or move "
            "it to the origin first",
            InexactWarning,
        )


def _text_corners(data: bytes) -> Floats:
    """Return the corners, (3 m, 3), of the m facets of all solids in STL text; each facet must have three."""
    ends = len(re.findall(rb"(?mi)^[ \t]*endsolid\b", data))
    charge_words(data)
    words = re.sub(rb"(?mi)^[ \t]*(end)?solid\b[^\r\n]*", b"", data).lower().split()  # names may hold keywords
    indices: dict[bytes, list[int]] = {b"facet": [], b"endfacet": [], b"vertex": []}
    for index, word in enumerate(words):
        if word in indices:
            indices[word].append(index)
    begins, stops, corners = indices.values()
    if not ends or len(begins) != len(stops):
        raise damaged(
            f"{len(begins)} facets begin, {len(stops)} and {ends} solids end: the file is truncated or damaged"
        )
    counts = np.searchsorted(corners, stops) - np.searchsorted(corners, begins)
    rooms = np.array(stops) - np.array(begins)
    wrong = np.flatnonzero((counts != 3) | (rooms < 15))  # 15 words: a loop of three vertices of three numbers
    if len(wrong) or len(corners) != 3 * len(begins):
        number = int(wrong[0]) if len(wrong) else len(begins)
        cause = f"facet {number} has {counts[number] if len(wrong) else 'other'} corners, and facets of STL have 3"
        raise FileFormatError(cause, remedy="export it again, as triangles", element=f"facet {number}")
    return parsed_numbers([words[k + 1 : k + 4] for k in corners], "vertices").reshape(-1, 3)


def _indexed(corners: NDArray[np.floating]) -> TriangleMesh:
    """Return the mesh of m triangles with these corners, (3 m, 3); equal corners become one vertex."""
    if not len(corners):
        return TriangleMesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    corners = corners + corners.dtype.type(0)  # turns −0 into 0
    ids, firsts = distinct_rows(corners.view(f"u{corners.itemsize}"))
    return TriangleMesh(corners[firsts].astype(np.float64), ids.reshape(-1, 3))


def _rows_of_words(words: list[str], counts: Ints) -> Iterator[str]:
    """Join the words to one line for each of the counts, which say how many words it has."""
    return (" ".join(islice(left, count)) for left in [iter(words)] for count in counts.tolist())


def read_obj(path: PathLike) -> Elements:
    """Read the faces of an OBJ file, or its points if there are none; texture and face normals are ignored."""
    lines = _lines_by_keyword(path)
    vertices = _coordinates(lines.get("v", []), "vertices")
    if "f" in lines:
        return Elements(vertices, *_elements(lines["f"]))
    if "l" in lines:
        raise FileFormatError(
            f"there are {len(lines['l'])} line elements and no face",
            remedy="read them with sh.io.read_curves(path, mesh)",
        )
    normals = _coordinates(lines["vn"], "normals") if "vn" in lines else None
    return Elements(vertices, normals=normals)


def read_obj_elements(path: PathLike) -> tuple[Floats, list[list[int]], list[list[int]]]:
    """Read all vertices of an OBJ file, and the vertex ids, from 0, of its lines and sets of points."""
    with reading(path):
        lines = _lines_by_keyword(path)
        elements: dict[str, list[list[int]]] = {}
        for keyword in ("l", "p"):
            corners, counts = _elements(lines.get(keyword, []))
            ids = iter(corners.tolist())
            elements[keyword] = [list(islice(ids, count)) for count in counts.tolist()]
        return _coordinates(lines["v"], "vertices"), elements["l"], elements["p"]


def write_obj(shape: Elements, path: PathLike) -> bytes:
    """Return OBJ text of vertices, faces and normals of points. Of values, the first become texture coordinates."""
    rows = ["v {!r} {!r} {!r}".format(*p) for p in shape.points.tolist()]
    if shape.normals is not None:
        rows += ["vn {!r} {!r} {!r}".format(*n) for n in shape.normals.tolist()]
    values = next(iter(shape.values.values()), None)
    words = list(map(str, (shape.corners + 1).tolist()))
    if values is not None:
        rows += [f"vt {value!r} 0" for value in values.tolist()]
        words = [f"{word}/{word}" for word in words]
    rows += [f"f {row}" for row in _rows_of_words(words, shape.counts)]
    return ("\n".join(rows) + "\n").encode()


def write_pc(shape: Elements, path: PathLike) -> bytes:
    """Return OBJ text of a point cloud with its normals; other shapes are refused."""
    if shape.kind != "PointCloud":
        raise refuse_kind(shape.kind, path, "points", ".obj or .ply")
    return write_obj(shape, path)


def _lines_by_keyword(path: PathLike) -> dict[str, list[list[Any]]]:
    """Return the lines with vertices, normals and elements as lists of words, by keyword.

    The first entry of each list is not the keyword but the number of vertices on lines before, from which negative
    vertex ids count back.
    """
    lines: dict[str, list[list[Any]]] = {"v": [], "vn": [], "f": [], "l": [], "p": []}
    content = text(path)
    charge_words(content)
    for number, line in enumerate(re.sub(r"\\[ \t]*\n", " ", content).split("\n"), start=1):
        words: list[Any] = line.partition("#")[0].split()
        if words and words[0] in lines:
            lines[words[0]].append(words)
            words[0] = len(lines["v"])
        elif words and words[0] not in KEYWORDS and NUMBER_LINE.fullmatch(" ".join(words[1:])):
            raise FileFormatError(
                f"line {number} begins with {quoted(words[0])}, which is not an OBJ keyword",
                remedy="correct or remove it",
                element=f"line {number}",
            )
    if not lines["v"]:
        raise FileFormatError("there is no line 'v x y z', so it holds no shape in OBJ format")
    return {keyword: rest for keyword, rest in lines.items() if rest}


def _coordinates(rows: list[list[Any]], name: str) -> Floats:
    """Return (n, 3) coordinates on n lines of `_lines_by_keyword`; weights and colours after them are ignored.

    `name` names them in messages.
    """
    short = next((k for k, row in enumerate(rows) if len(row) < 4), None)
    if short is not None:
        cause = f"number {short} of the {name} has {len(rows[short]) - 1} coordinates instead of 3: it may be truncated"
        raise damaged(cause, element=f"number {short}")
    return parsed_numbers([row[1:4] for row in rows], name).reshape(-1, 3)


def _elements(words: list[list[Any]]) -> tuple[Ints, Ints]:
    """Return the vertex ids of all elements, one after another and counted from 0, and how many ids each element has.

    The elements are lines of `_lines_by_keyword`. In the file, ids count from 1, and −1 is the last vertex before the
    element.
    """
    counts = np.array([len(element) - 1 for element in words], dtype=np.int64)
    flat = [word for element in words for word in element[1:]]
    if any("/" in word for word in flat):
        # most files need no pattern, which would take a quarter of the time to read them
        is_plain = not "".join(flat).encode().translate(None, b"0123456789/") and max(w.count("/") for w in flat) < 3
        wrong = None if is_plain else next((word for word in flat if not CORNER.fullmatch(word)), None)
        if wrong is not None:
            raise damaged(
                f"{quoted(wrong)} is no corner, such as 1, 1/2, 1//3 or 1/2/3", element=f"corner {quoted(wrong)}"
            )
        flat = [word.partition("/")[0] for word in flat]
    ids = integers(flat, "vertex ids")
    if (ids == 0).any():
        raise damaged("a face names vertex 0, but OBJ counts from 1: the file is damaged")
    before = np.array([element[0] for element in words], dtype=np.int64)
    return np.where(ids > 0, ids - 1, ids + np.repeat(before, counts)), counts


def read_off(path: PathLike) -> Elements:
    """Read the faces of an OFF file (also COFF, NOFF, STOFF, …), or its points if there are none."""
    content = text(path)
    charge_words(content)
    rows = [row for line in content.split("\n") if (row := line.partition("#")[0].split())]
    kind = rows[0][0].upper() if rows else ""
    if not kind.endswith("OFF") or "BINARY" in [word.upper() for word in rows[0]]:
        raise FileFormatError("it does not begin with OFF, so it is not an OFF file in text form")
    if "4" in kind:
        raise FileFormatError(
            "its vertices have four coordinates each", remedy="divide by the fourth, and save it as OFF"
        )
    rows[0] = rows[0][1:]
    rows = rows if rows[0] else rows[1:]
    if not rows or len(rows[0]) < 2:
        raise damaged("the numbers of vertices and faces are missing: it may be truncated")
    n_vertices, n_faces, *_ = (
        integer(word, f"number of {noun}") for word, noun in zip(rows[0], ("vertices", "faces", "edges"), strict=False)
    )
    lines, n_corners = iter(rows[1:]), cache(lambda word: integer(word, "number of corners of a face"))
    vertex_rows = list(islice(_records(lines, lambda row: 3), n_vertices))
    face_rows = list(islice(_records(lines, lambda row: 1 + n_corners(row[0])), n_faces))
    if len(vertex_rows) < n_vertices or len(face_rows) < n_faces:
        raise damaged(
            f"{n_vertices} vertices and {n_faces} faces are announced, {len(vertex_rows)} and "
            f"{len(face_rows)} are there: the file is truncated"
        )
    if any(len(row) < 3 for row in vertex_rows):
        raise damaged("a vertex has fewer than 3 coordinates: it may be truncated")
    vertices = parsed_numbers([row[:3] for row in vertex_rows], "vertices").reshape(-1, 3)
    if not n_faces:
        has_normals = "N" in kind[:-3] and all(len(row) >= 6 for row in vertex_rows)
        normals = parsed_numbers([row[3:6] for row in vertex_rows], "normals") if has_normals else None
        return Elements(vertices, normals=normals)
    counts = integers([row[0] for row in face_rows], "numbers of corners", 0)
    if any(len(row) <= count for row, count in zip(face_rows, counts.tolist(), strict=True)):
        raise damaged("a face has fewer corners than announced: it may be truncated")
    corners = [word for row, count in zip(face_rows, counts.tolist(), strict=True) for word in row[1 : 1 + count]]
    return Elements(vertices, integers(corners, "vertex ids", 0), counts)


def _records(lines: Iterator[list[str]], length: Callable[[list[str]], int]) -> Iterator[list[str]]:
    """Yield records that may span several lines: `length` tells from the first line how many words they have."""
    for row in lines:
        n_words = length(row)
        while len(row) < n_words and (more := next(lines, None)) is not None:
            row += more
        yield row


def write_off(shape: Elements, path: PathLike) -> bytes:
    """Return OFF text, or NOFF text if there are normals."""
    columns = shape.points if shape.normals is None else np.hstack([shape.points, shape.normals])
    rows = ["OFF" if shape.normals is None else "NOFF", f"{len(columns)} {len(shape.counts)} 0"]
    rows += [" ".join(map(repr, row)) for row in columns.tolist()]
    corners = _rows_of_words(list(map(str, shape.corners.tolist())), shape.counts)
    rows += [f"{count} {row}" for count, row in zip(shape.counts.tolist(), corners, strict=True)]
    return ("\n".join(rows) + "\n").encode()
