"""glTF 2.0 scenes, as text with separate buffers (``.gltf``) or binary (``.glb``)."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..transforms import Body, placed
from .files import PathLike, companion_contents, contents, damaged, ensure_fits

COMPONENT_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of the components of accessors."""
COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
SUPPORTED = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_xmp", "EXT_texture_")
"""Prefixes of extensions that are supported or do not affect shapes."""
INSTANCES = "EXT_mesh_gpu_instancing"
TRIANGLE_MODE, FAN_MODE = 4, 6
"""Modes of lists and fans of triangles; between them is that of strips, below them are points and lines."""


def read_bodies(path: PathLike) -> list[Body]:
    """Read vertices and triangles of the default scene, placed by its nodes; it may name files in its folder tree."""
    scene = _read_scene(path)
    missing = [name for name in scene.tree.get("extensionsRequired", []) if not name.startswith(SUPPORTED)]
    if any(INSTANCES in node.get("extensions", {}) for node in scene.tree.get("nodes", [])):
        missing.append(INSTANCES)
    if missing:
        raise FileFormatError(
            f"it needs the extension {missing[0]}, which is not supported",
            remedy="export it without compression and extensions",
            element=missing[0],
        )
    places = list(_places(scene.tree))
    meshes = scene.tree.get("meshes", [])
    sizes = {mesh: _size(scene.tree, meshes[mesh]) for mesh in {mesh for mesh, _ in places}}
    ensure_fits(sum(sizes[mesh] for mesh, _ in places), path)
    bodies = {mesh: [scene.body(primitive) for primitive in meshes[mesh]["primitives"]] for mesh in sizes}
    return [placed(body, matrix) for mesh, matrix in places for body in bodies[mesh] if len(body[1])]


@dataclass(frozen=True)
class _Scene:
    """The description of a scene, parsed from JSON, and its buffers."""

    tree: dict[str, Any]
    buffers: list[bytes]

    def body(self, primitive: dict[str, Any]) -> Body:
        """Return the vertices and triangles of a primitive, without unused vertices; points and lines have none."""
        mode = primitive.get("mode", TRIANGLE_MODE)
        if mode not in range(FAN_MODE + 1):
            raise damaged(f"primitives have the mode {mode}, which is not defined in glTF")
        if mode < TRIANGLE_MODE or "POSITION" not in primitive["attributes"]:
            return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        points = self.numbers(primitive["attributes"]["POSITION"]).astype(np.float64)
        if points.shape[1] != 3:
            raise damaged(f"positions have {points.shape[1]} coordinates")
        accessor = primitive.get("indices")
        corners = np.arange(len(points)) if accessor is None else self.numbers(accessor).ravel().astype(np.int64)
        faces = _triangles(corners, mode)
        if len(faces) and faces.max() >= len(points):
            raise damaged(f"a face names vertex {faces.max()}, and there are {len(points)}")
        used = np.unique(faces)
        return points[used], np.searchsorted(used, faces)

    def numbers(self, index: int) -> NDArray[Any]:
        """Return the (count, width) numbers of an accessor; normalized integers become fractions."""
        accessor = self.tree["accessors"][index]
        count, width = int(accessor["count"]), COMPONENT_COUNTS[accessor["type"]]
        dtype = np.dtype(COMPONENT_TYPES[accessor["componentType"]])
        if not 0 < count <= sum(map(len, self.buffers)):
            raise damaged(f"accessor {index} announces {count} numbers, which the file does not have")
        if "bufferView" in accessor:
            values = self._viewed(accessor, dtype, count, width)
        else:
            values = np.zeros((count, width), dtype=dtype)
        if "sparse" in accessor:
            sparse, values = accessor["sparse"], values.copy()
            code = np.dtype(COMPONENT_TYPES[sparse["indices"]["componentType"]])
            places = self._viewed(sparse["indices"], code, sparse["count"], 1).ravel()
            values[places] = self._viewed(sparse["values"], dtype, sparse["count"], width)
        if accessor.get("normalized") and dtype.kind in "iu":
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values

    def _viewed(self, part: dict[str, Any], dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Return (count, width) numbers in a view of a buffer."""
        view = self.tree["bufferViews"][part["bufferView"]]
        buffer, begin, length = self.buffers[view["buffer"]], view.get("byteOffset", 0), view["byteLength"]
        start, row = begin + part.get("byteOffset", 0), width * dtype.itemsize
        stride = view.get("byteStride", row)
        end = start + (count - 1) * stride + row
        if min(begin, length, part.get("byteOffset", 0), count - 1) < 0 or stride < row or end > begin + length:
            raise damaged(f"{count} numbers go beyond their part of the buffer")
        if end > len(buffer):
            raise damaged(f"{end} bytes of a buffer are needed, and there are {len(buffer)}: it may be truncated")
        return np.ndarray((count, width), dtype, buffer, start, (stride, dtype.itemsize))


def _read_scene(path: PathLike) -> _Scene:
    """Read the description of a scene, and its buffers: embedded in a ``.glb`` file, in data URIs, or in other files.

    A ``.glb`` file has a header of 12 bytes, of which the last four hold its size, the JSON, and at most one buffer.
    Before the JSON and the buffer stand 8 bytes with their size and type.
    """
    data, embedded = contents(path), b""
    text = data
    if data[:4] == b"glTF":
        if int.from_bytes(data[8:12], "little") > len(data):
            raise damaged("it is shorter than it says: it is truncated")
        json_end = 20 + int.from_bytes(data[12:16], "little")
        text = data[20:json_end]
        embedded = data[json_end + 8 : json_end + 8 + int.from_bytes(data[json_end : json_end + 4], "little")]
    tree = json.loads(text.decode("utf-8-sig"))
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if not version.startswith("2."):
        raise FileFormatError(
            f"it is glTF {version}, and only glTF 2 can be read", remedy="export it as glTF 2.0", element="version"
        )
    buffers = []
    for buffer in tree.get("buffers", []):
        uri = buffer.get("uri")
        if uri is None:
            buffers.append(embedded)
        elif uri.startswith("data:"):
            buffers.append(base64.b64decode(uri.partition(",")[2]))
        else:
            buffers.append(companion_contents(path, unquote(uri)))
    return _Scene(tree, buffers)


def _triangles(corners: Ints, mode: int) -> Ints:
    """Return the triangles, (m, 3), of a list, strip or fan of corners."""
    if mode == TRIANGLE_MODE:
        if len(corners) % 3:
            raise damaged(f"{len(corners)} corners do not form triangles")
        return corners.reshape(-1, 3)
    second, third = corners[1:-1], corners[2:]
    if mode == FAN_MODE:
        return np.stack([np.full(len(third), corners[0]), second, third], axis=1)
    faces = np.stack([corners[:-2], second, third], axis=1)
    faces[1::2] = faces[1::2, [1, 0, 2]]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return faces[distinct]  # strips are joined by triangles with equal corners


def _size(tree: dict[str, Any], mesh: dict[str, Any]) -> int:
    """Estimate the bytes that a mesh takes while it is read, from the numbers that its accessors announce."""
    size = 0
    for part in mesh["primitives"]:
        points = part["attributes"].get("POSITION")
        counts = [tree["accessors"][index]["count"] for index in (points, part.get("indices")) if index is not None]
        corners = counts[-1] if counts else 0
        per_triangle = 3 if part.get("mode", TRIANGLE_MODE) == TRIANGLE_MODE else 1
        size += 60 * min(counts, default=0) + 70 * (corners // per_triangle)  # measured, for a vertex and a triangle
    return size


def _places(tree: dict[str, Any]) -> Iterator[tuple[int, Floats]]:
    """Yield the number of each mesh and the (4, 3) transform of rows that places it; each node must occur only once."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    if not nodes:
        yield from ((mesh, np.eye(4, 3)) for mesh in range(len(tree.get("meshes", []))))
        return
    children = {child for node in nodes for child in node.get("children", [])}
    roots = scenes[tree.get("scene", 0)].get("nodes", []) if scenes else set(range(len(nodes))) - children
    stack = [(index, np.eye(4)) for index in sorted(roots)]
    visited = set()
    while stack:
        index, outer = stack.pop()
        if index in visited or not 0 <= index < len(nodes):
            raise damaged(f"node {index} is part of two others or does not exist", element=f"node {index}")
        visited.add(index)
        matrix = outer @ _matrix(nodes[index])
        if "mesh" in nodes[index]:
            yield nodes[index]["mesh"], matrix.T[:, :3]
        stack += [(child, matrix) for child in reversed(nodes[index].get("children", []))]


def _matrix(node: dict[str, Any]) -> Floats:
    """Return the (4, 4) transform from a node to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = (float(number) for number in node.get("rotation", (0, 0, 0, 1)))
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] = np.array(turn) * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    return matrix
