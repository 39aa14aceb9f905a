"""Conversion between shapes and flat arrays of faces, common to all formats."""

from __future__ import annotations

from collections.abc import Sequence

from ..domains.foreign import SurfaceShape as SurfaceShape
from ..domains.foreign import assemble as assemble
from ..domains.foreign import faces_of as faces_of
from ..domains.foreign import points_of as points_of
from ..domains.point_cloud import PointCloud
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from .files import PathLike, extension


def face_lists(shape: SurfaceShape) -> Sequence[Sequence[int]]:
    """Corners of each face, as lists; empty for point clouds."""
    if isinstance(shape, TriangleMesh):
        result: Sequence[Sequence[int]] = shape.faces.tolist()
        return result
    return [] if isinstance(shape, PointCloud) else [polygon.tolist() for polygon in shape.polygons]


def refuse(shape: object, path: PathLike, holds: str, instead: str) -> FileFormatError:
    """The error for a format that does not support a kind of shape."""
    return FileFormatError(
        f"{extension(path)} files hold {holds}, not a {type(shape).__name__}", remedy=f"save it as {instead}", path=path
    )
