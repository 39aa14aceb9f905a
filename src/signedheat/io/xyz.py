"""XYZ: one point per line, with or without its normal."""

from __future__ import annotations

import numpy as np

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from .elements import SurfaceShape, refuse
from .files import PathLike, numbers, text


def read_xyz(path: PathLike) -> PointCloud:
    """Lines of 3 numbers (positions) or 6 (positions and normals), separated by spaces or commas."""
    rows = [row for line in text(path).splitlines() if (row := line.partition("#")[0].replace(",", " ").split())]
    if not rows:
        raise FileFormatError("there is no line of numbers: the file holds no points")
    columns = len(rows[0])
    odd = next((k for k, row in enumerate(rows) if len(row) != columns), None)
    if odd is not None:
        raise FileFormatError(
            f"line {odd} of the points has {len(rows[odd])} numbers, the first has {columns}",
            remedy="it may be truncated, so write or download it again",
            element=f"line {odd}",
        )
    if columns not in (3, 6):
        raise FileFormatError(f"{columns} numbers a line", remedy="write 3 (x y z) or 6 (x y z nx ny nz)")
    table = numbers(rows, "coordinates")
    return PointCloud(table[:, :3], table[:, 3:] if columns == 6 else None)


def write_xyz(shape: SurfaceShape, path: PathLike) -> bytes:
    """One line per point."""
    if not isinstance(shape, PointCloud):
        raise refuse(shape, path, "points", ".obj or .ply")
    table = shape.points if shape.normals is None else np.hstack([shape.points, shape.normals])
    return "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist()).encode()
