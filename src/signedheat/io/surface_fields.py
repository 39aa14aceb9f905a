"""Reading and writing of surfaces with φ at their vertices.

PLY is written here because trimesh writes single precision, VTP because VTK is a large dependency for one format.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.display import NAME
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..fields.vertex_field import VertexField, on_simple_surface
from .arrays import names_in_npz, read_npz
from .elements import SurfaceShape, faces_of, points_of
from .files import PathLike, extension, reading, replacing, unknown_extension
from .ply import read_ply, read_ply_values
from .vtk_xml import _Writer, read_vtp, read_vtp_values


def save_vertex_field(field: VertexField, path: PathLike) -> None:
    """Write a surface with φ at its vertices; see `VertexField.save`."""
    writer = WRITERS.get(extension(path))
    if writer is None:
        raise unknown_extension(path, WRITERS, "a field on a surface")
    content = writer(on_simple_surface(field))
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def load_vertex_field(path: PathLike) -> VertexField:
    """Read what `save_vertex_field` wrote, except as ``.obj``."""
    if extension(path) in _READERS:
        return _shape_with_values(path)
    arrays = read_npz(path, ("vertices", "values", "faces", "offsets", "normals"))
    with reading(path):
        vertices, values = arrays["vertices"], arrays["values"]
        if "offsets" in arrays:
            domain: SurfaceShape = PolygonMesh(vertices, np.split(arrays["faces"], arrays["offsets"][1:-1]))
        elif "faces" in arrays:
            domain = TriangleMesh(vertices, arrays["faces"])
        else:
            domain = PointCloud(vertices, arrays.get("normals"))
    if values.shape != (len(vertices),):
        raise FileFormatError(
            f"{values.shape} values for {len(vertices)} vertices: the file is damaged",
            remedy="write or download it again",
            path=path,
        )
    return VertexField(domain, values)


def _shape_with_values(path: PathLike) -> VertexField:
    """A mesh or points, with φ at the vertices."""
    read_shape, read_values = _READERS[extension(path)]
    with reading(path):
        values = read_values(path, NAME)
        if values is None:
            raise FileFormatError(f"its vertices have no {NAME}: it holds a shape, and no field", path=path)
        return VertexField(read_shape(path), values)


def is_vertex_field(path: PathLike) -> bool:
    """Whether `load_vertex_field` is to read a file."""
    if extension(path) in _READERS:
        return True
    return extension(path) == ".npz" and {"values", "vertices"} <= names_in_npz(path)


def write_npz(field: VertexField[SurfaceShape]) -> bytes:
    """NumPy arrays, exact to the last bit."""
    domain, buffer = field.domain, io.BytesIO()
    arrays: dict[str, Any] = {"values": field.values, "vertices": points_of(domain)}
    if isinstance(domain, TriangleMesh):
        arrays["faces"] = domain.faces
    elif isinstance(domain, PolygonMesh):
        arrays |= {"faces": domain.corners, "offsets": domain.offsets}
    elif domain.normals is not None:
        arrays["normals"] = domain.normals
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def write_ply(field: VertexField[SurfaceShape]) -> bytes:
    return ply_of(field.domain, NAME, field.values)


def write_vtp(field: VertexField[SurfaceShape]) -> bytes:
    return vtp_of(field.domain, NAME, field.values)


def ply_of(
    shape: SurfaceShape, name: str, values: NDArray[np.floating], colors: NDArray[np.uint8] | None = None
) -> bytes:
    """Binary PLY in double precision, with one named value at each vertex, and its colour."""
    corners, counts = faces_of(shape)
    shown = [] if colors is None else ["red", "green", "blue"]
    table = np.zeros(len(values), dtype=[("numbers", "<f8", 4), ("color", "u1", len(shown))])
    table["numbers"] = np.column_stack([points_of(shape), values])
    if colors is not None:
        table["color"] = colors
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    lines += [f"property double {column}" for column in ("x", "y", "z", name)]
    lines += [f"property uchar {channel}" for channel in shown]
    lines += [f"element face {len(counts)}", "property list int int vertex_indices"] * (len(counts) > 0)
    listed = np.insert(corners, np.cumsum(counts) - counts, counts).astype("<i4")
    return ("\n".join([*lines, "end_header"]) + "\n").encode() + table.tobytes() + listed.tobytes()


def vtp_of(shape: SurfaceShape, name: str, values: NDArray[np.floating]) -> bytes:
    """VTK polygonal data, for ParaView, with one named value at each vertex."""
    points, (corners, counts) = points_of(shape), faces_of(shape)
    group = "Polys" if len(counts) else "Verts"
    if not len(counts):
        corners, counts = np.arange(len(points)), np.ones(len(points), dtype=np.int64)
    writer = _Writer()
    data = f'<PointData Scalars="{name}">{writer.array(name, values)}</PointData>'
    xyz = f"<Points>{writer.array('Points', points)}</Points>"
    ends = np.cumsum(counts)
    cells = f"<{group}>{writer.array('connectivity', corners)}{writer.array('offsets', ends)}</{group}>"
    sizes = f'NumberOfPoints="{len(points)}" NumberOf{group}="{len(counts)}"'
    return writer.file("PolyData", f"<PolyData><Piece {sizes}>{data}{xyz}{cells}</Piece></PolyData>")


def save_with_values(shape: SurfaceShape, path: PathLike, name: str, values: NDArray[np.floating]) -> None:
    """Write a surface with a named value at each vertex, in a format of `VALUE_FORMATS`."""
    with replacing(path) as temporary:
        temporary.write_bytes(VALUE_FORMATS[extension(path)](shape, name, values))


VALUE_FORMATS: dict[str, Callable[[SurfaceShape, str, NDArray[np.floating]], bytes]] = {".ply": ply_of, ".vtp": vtp_of}


def write_obj(field: VertexField[SurfaceShape]) -> bytes:
    """OBJ with φ as the first texture coordinate, in the units of the surface."""
    corners, counts = faces_of(field.domain)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points_of(field.domain).tolist()]
    lines += [f"vt {value!r} 0" for value in field.values.tolist()]
    words = [f"{v}/{v}" for v in (corners + 1).tolist()]
    ends = np.cumsum(counts).tolist()
    lines += ["f " + " ".join(words[end - count : end]) for end, count in zip(ends, counts.tolist(), strict=True)]
    return ("\n".join(lines) + "\n").encode()


WRITERS: dict[str, Callable[[VertexField[SurfaceShape]], bytes]] = {
    ".npz": write_npz,
    ".obj": write_obj,
    ".ply": write_ply,
    ".vtp": write_vtp,
}
_READERS = {".ply": (read_ply, read_ply_values), ".vtp": (read_vtp, read_vtp_values)}
VERTEX_FIELD_FORMATS = frozenset(WRITERS)
