"""STL, binary and text."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..geometry.welding import distinct_rows
from .elements import SurfaceShape, refuse
from .files import PathLike, contents, damaged, numbers

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes: 80 of comment, 4 that count the facets


def read_stl(path: PathLike) -> TriangleMesh:
    """All facets of an STL file, of all its solids; stored normals are ignored.

    Corners with exactly the same coordinates become one vertex: STL has no other way to express that facets meet.
    """
    data = contents(path)
    announced = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else 0
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000].lower()
    if is_text and len(data) != _HEADER + 50 * announced:
        corners = _text_corners(data)
    elif len(data) < _HEADER + 50 * announced or len(data) < _HEADER:
        raise FileFormatError(
            f"{announced} facets need {_HEADER + 50 * announced} bytes, the file has {len(data)}: it "
            "is truncated, or no STL file"
        )
    else:
        corners = np.frombuffer(data, _FACET, announced, _HEADER)["corners"].astype(np.float32)
    return _indexed(corners.reshape(-1, 3))


def write_stl(shape: SurfaceShape, path: PathLike) -> bytes:
    """Binary STL, in single precision."""
    if not isinstance(shape, TriangleMesh):
        kinds = ".ply or .xyz" if isinstance(shape, PointCloud) else ".obj, .ply, .off or .vtp"
        raise refuse(shape, path, "triangles", kinds)
    facets = np.zeros(shape.n_faces, dtype=_FACET)
    facets["corners"] = shape.vertices[shape.faces]
    if not np.isfinite(facets["corners"]).all():
        raise FileFormatError(
            "coordinates are too large for the single precision of STL", remedy="save it as .ply", path=path
        )
    lengths = np.maximum(2 * shape.face_areas, np.finfo(float).tiny)
    facets["normal"] = 2 * shape.face_area_vectors / lengths[:, None]
    result: bytes = b"signedheat".ljust(80) + np.uint32(shape.n_faces).astype("<u4").tobytes() + facets.tobytes()
    return result


def _text_corners(data: bytes) -> NDArray[np.float64]:
    words = data.lower().split()
    if words.count(b"solid") and b"endsolid" not in words[-40:]:
        raise damaged("the last solid has no end: the file is truncated")
    at = [k for k, word in enumerate(words) if word == b"vertex"]
    if len(at) % 3 or (at and at[-1] + 3 >= len(words)):
        raise damaged("a facet has fewer than 3 vertices: the file is truncated or damaged")
    return numbers([words[k + 1 : k + 4] for k in at], "vertices").reshape(-1, 3)


def _indexed(corners: NDArray[np.floating]) -> TriangleMesh:
    if not len(corners):
        return TriangleMesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    corners = corners + corners.dtype.type(0)  # adding zero turns −0 into 0
    ids, firsts = distinct_rows(corners.view(f"u{corners.itemsize}"))
    return TriangleMesh(corners[firsts].astype(np.float64), ids.reshape(-1, 3))
