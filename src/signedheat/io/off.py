"""OFF: counts, then vertices, then faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from .elements import SurfaceShape, assemble, face_lists, points_of
from .files import PathLike, damaged, numbers, text


def read_off(path: PathLike) -> SurfaceShape:
    """The faces of an OFF file (also COFF, NOFF, STOFF, …), or its points if it has none."""
    rows = [row for line in text(path).splitlines() if (row := line.partition("#")[0].split())]
    kind = rows[0][0].upper() if rows else ""
    if not kind.endswith("OFF") or "BINARY" in [word.upper() for word in rows[0]]:
        raise FileFormatError("it does not begin with OFF as text: this is no file that can be read as OFF")
    rows[0] = rows[0][1:]
    rows = rows if rows[0] else rows[1:]
    if not rows or len(rows[0]) < 2:
        raise FileFormatError(
            "the numbers of vertices and faces are missing", remedy="it may be truncated, so write or download it again"
        )
    n_vertices, n_faces = numbers(rows[0][:2], "counts", int).tolist()
    if n_vertices < 0 or n_faces < 0:
        raise damaged(f"{n_vertices} vertices and {n_faces} faces are announced: the file is damaged")
    lines = iter(rows[1:])
    vertex_rows = list(islice(records(lines, lambda row: 3), n_vertices))
    face_rows = list(islice(records(lines, lambda row: 1 + corner_count(row[0])), n_faces))
    if len(vertex_rows) < n_vertices or len(face_rows) < n_faces:
        raise damaged(
            f"{n_vertices} vertices and {n_faces} faces are announced, {len(vertex_rows)} and "
            f"{len(face_rows)} are there: the file is truncated"
        )
    if any(len(row) < 3 for row in vertex_rows):
        raise FileFormatError(
            "a vertex has fewer than 3 coordinates", remedy="it may be truncated, so write or download it again"
        )
    vertices = numbers([row[:3] for row in vertex_rows], "vertices").reshape(-1, 3)
    if not n_faces:
        has_normals = "N" in kind[:-3] and all(len(row) >= 6 for row in vertex_rows)
        return PointCloud(vertices, numbers([r[3:6] for r in vertex_rows], "normals") if has_normals else None)
    counts = numbers([row[0] for row in face_rows], "numbers of corners", int)
    if any(len(row) <= count for row, count in zip(face_rows, counts.tolist(), strict=True)):
        raise FileFormatError(
            "a face has fewer corners than it says", remedy="it may be truncated, so write or download it again"
        )
    corners = [word for row, count in zip(face_rows, counts.tolist(), strict=True) for word in row[1 : 1 + count]]
    return assemble(vertices, numbers(corners, "vertex ids", int), np.asarray(counts))


def records(lines: Iterator[list[str]], length: Callable[[list[str]], int]) -> Iterator[list[str]]:
    """Lines joined until each holds as many words as its beginning asks for; more words on its last line stay."""
    for row in lines:
        wanted = length(row)
        while len(row) < wanted and (more := next(lines, None)) is not None:
            row += more
        yield row


def corner_count(word: str) -> int:
    """Number of corners of a face; 0 for what is no number, which is refused later."""
    return int(word) if word.isdecimal() and len(word) < 19 else 0


def write_off(shape: SurfaceShape, path: PathLike) -> bytes:
    """OFF text; oriented points as NOFF."""
    points, faces = points_of(shape), face_lists(shape)
    normals = shape.normals if isinstance(shape, PointCloud) else None
    columns = points if normals is None else np.hstack([points, normals])
    rows = ["OFF" if normals is None else "NOFF", f"{len(points)} {len(faces)} 0"]
    rows += [" ".join(map(repr, row)) for row in columns.tolist()]
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    return ("\n".join(rows) + "\n").encode()
