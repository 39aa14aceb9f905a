"""VTK's XML files of cells (``.vtu``): the cells by kind, and the values at their points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .files import PathLike
from .vtk_xml import parse

KINDS = {
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
"""Names of VTK's types of cells, as meshio has them."""


@dataclass(frozen=True)
class Block:
    """Cells of one kind, as rows of point ids."""

    type: str
    data: NDArray[np.int64]


@dataclass(frozen=True)
class Cells:
    """Points, cells and values at the points, under the names that they have in a `meshio.Mesh`."""

    points: NDArray[np.float64]
    cells: list[Block]
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)


def read_vtu(path: PathLike, names: tuple[str, ...] = ()) -> Cells:
    """Points, cells, and those point data that are named."""
    root, arrays = parse(path, "UnstructuredGrid")
    pieces = root.findall("UnstructuredGrid/Piece")
    if len(pieces) != 1:
        raise FileFormatError(f"it has {len(pieces)} pieces", remedy="write it anew as one", path=path)
    [piece] = pieces
    n_points, n_cells = arrays.count(piece, "NumberOfPoints"), arrays.count(piece, "NumberOfCells")
    element = piece.find("Points/DataArray")
    if element is None or not n_points:
        raise FileFormatError("there are no points: the file holds no shape", path=path)
    points = arrays.of(element, 3 * n_points).astype(np.float64).reshape(-1, 3)
    columns = {element.get("Name"): element for element in piece.iterfind("Cells/DataArray")}
    if not {"connectivity", "offsets", "types"} <= columns.keys():
        raise FileFormatError("its cells have no connectivity, offsets and types", path=path)
    ends = arrays.of(columns["offsets"], n_cells).astype(np.int64)
    kinds = arrays.of(columns["types"], n_cells).astype(np.int64)
    starts = np.concatenate([[0], ends])[:-1]
    if (ends < starts).any():
        raise FileFormatError("its offsets decrease: it is damaged", remedy="write it again", path=path)
    corners = arrays.of(columns["connectivity"], int(ends[-1]) if n_cells else 0).astype(np.int64)
    blocks = []
    for kind in np.unique(kinds).tolist():
        chosen = np.flatnonzero(kinds == kind)
        counts = (ends - starts)[chosen]
        for count in np.unique(counts).tolist():
            rows = starts[chosen[counts == count]]
            blocks.append(Block(KINDS.get(kind, f"type {kind}"), corners[rows[:, None] + np.arange(count)]))
    data = {
        name: arrays.of(element, n_points)
        for element in piece.iterfind("PointData/DataArray")
        if (name := element.get("Name")) in names
    }
    return Cells(points, blocks, data)
