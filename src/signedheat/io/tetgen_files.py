"""TetGen's ``.node`` and ``.ele``: a table of points and a table of tets, which belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..domains.tet_mesh import TetMesh
from ..errors import FileFormatError
from .files import PathLike, extension, numbers, replacing, text


def read_tetgen(path: PathLike) -> TetMesh:
    """The mesh of a pair, named by either; ids count from the first in the table of points."""
    node, ele = Path(path).with_suffix(".node"), Path(path).with_suffix(".ele")
    points = _table(node, 3, counts=4)
    tets = _table(ele, 4, counts=3)
    ids = _whole(points[:, 0], node)
    if len(ids) and (ids != ids[0] + np.arange(len(ids))).any():
        raise FileFormatError("its points are not numbered in a row", remedy="number them from 0 or from 1", path=node)
    return TetMesh(points[:, 1:4], _whole(tets[:, 1:5], ele) - (ids[0] if len(ids) else 0))


def write_tetgen(mesh: TetMesh, path: PathLike) -> None:
    """Both files of a pair, named by either."""
    points = "".join(f"{k} {x!r} {y!r} {z!r}\n" for k, (x, y, z) in enumerate(mesh.vertices.tolist()))
    tets = "".join(f"{k} {a} {b} {c} {d}\n" for k, (a, b, c, d) in enumerate(mesh.tets.tolist()))
    endings = (".node", ".ele") if extension(path) == ".ele" else (".ele", ".node")  # the one that is named comes last
    content = {".node": f"{mesh.n_vertices} 3 0 0\n{points}", ".ele": f"{mesh.n_tets} 4 0\n{tets}"}
    first, last = (Path(path).with_suffix(ending) for ending in endings)
    with replacing(last) as end, replacing(first) as begin:
        begin.write_text(content[first.suffix])
        end.write_text(content[last.suffix])


def _table(path: Path, corners: int, counts: int) -> NDArray[np.float64]:
    """The rows after a line of counts: rows, numbers in each after its id, further numbers of each."""
    rows = [words for line in text(path).splitlines() if (words := line.partition("#")[0].split())]
    header = numbers(rows[0], path, "counts", int).tolist() if rows else []
    if len(header) < counts - 1 or min(header) < 0 or header[1] != corners:
        raise FileFormatError(
            f"its first line does not announce a number of rows with {corners} numbers",
            remedy="write or download it again",
            path=path,
        )
    n, found = header[0], rows[1:]
    if len(found) < n or any(len(row) <= corners for row in found[:n]):
        raise FileFormatError(
            f"{n} rows with {corners} numbers and more are announced, and not there: it is truncated",
            remedy="write or download it again",
            path=path,
        )
    return numbers([row[: corners + 1] for row in found[:n]], path, "rows").reshape(-1, corners + 1)


def _whole(values: NDArray[np.float64], path: Path) -> NDArray[np.int64]:
    if not (np.abs(values) < 2**53).all() or (values != np.rint(values)).any():
        raise FileFormatError("its ids are no whole numbers", remedy="write or download it again", path=path)
    return values.astype(np.int64)
