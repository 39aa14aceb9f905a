"""glTF 2.0 scenes, as text with separate buffers (``.gltf``) or binary (``.glb``)."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..shapes.transforms import Body, placed
from .budgets import BYTES_PER_PLACED, charge
from .files import PathLike, companion_contents, contents, damaged
from .numerals import integer, integers, json_of, vector

COMPONENT_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy types of the numbers of an accessor, by its code ``componentType``."""
COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers in each entry of an accessor, by its ``type``."""
SUPPORTED = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_xmp", "EXT_texture_")
"""Prefixes of extensions that are supported or do not affect shapes."""
INSTANCES = "EXT_mesh_gpu_instancing"
"""Extension by which a node repeats a mesh, which is refused."""
TRIANGLE_MODE, FAN_MODE = 4, 6
"""Codes of primitives with lists and fans of triangles; 5 means strips, and 0 to 3 points and lines."""


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
    instances = list(_instances(scene.tree))
    meshes = {mesh: _named(scene.tree, "meshes", mesh)["primitives"] for mesh in dict.fromkeys(m for m, _ in instances)}
    sizes = {mesh: sum(scene.size(primitive) for primitive in primitives) for mesh, primitives in meshes.items()}
    made = sum(sizes.values()) + sum(sizes[mesh] for mesh, _ in instances)
    charge(BYTES_PER_PLACED * made, sum(len(meshes[mesh]) for mesh, _ in instances), made)
    bodies = {mesh: [scene.body(primitive) for primitive in primitives] for mesh, primitives in meshes.items()}
    return [placed(body, matrix) for mesh, matrix in instances for body in bodies[mesh] if len(body[1])]


@dataclass(frozen=True)
class _Scene:
    """The description of a scene, parsed from JSON, and its buffers."""

    tree: dict[str, Any]
    buffers: list[bytes]

    def size(self, primitive: dict[str, Any]) -> int:
        """Return an upper bound of the number of vertices plus triangles of a primitive, from its accessors."""
        named = primitive["attributes"].get("POSITION"), primitive.get("indices")
        counts = [self.count(index) for index in named if index is not None]
        per_triangle = 3 if _mode(primitive) == TRIANGLE_MODE else 1
        return counts[0] + counts[-1] // per_triangle if counts else 0

    def body(self, primitive: dict[str, Any]) -> Body:
        """Return the vertices and triangles of a primitive, without unused vertices; points and lines have none."""
        mode = _mode(primitive)
        if mode < TRIANGLE_MODE or "POSITION" not in primitive["attributes"]:
            return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        points = self.numbers(primitive["attributes"]["POSITION"]).astype(np.float64)
        if points.shape[1] != 3:
            raise damaged(f"positions have {points.shape[1]} coordinates")
        accessor = primitive.get("indices")
        corners = np.arange(len(points)) if accessor is None else integers(self.numbers(accessor), "indices", 0).ravel()
        faces = _triangles(corners, mode)
        if len(faces) and faces.max() >= len(points):
            raise damaged(f"a face names vertex {faces.max()}, and there are {len(points)}")
        used = np.unique(faces)
        return points[used], np.searchsorted(used, faces)

    def count(self, index: object) -> int:
        """Return how many numbers or vectors an accessor announces; raise if there are more than bytes in the file."""
        count = integer(_named(self.tree, "accessors", index)["count"], "count", 1)
        if count > sum(map(len, self.buffers)):
            raise damaged(f"accessor {index} announces {count} numbers, which the file does not have")
        return count

    def numbers(self, index: object) -> NDArray[Any]:
        """Return the (count, width) numbers of an accessor; normalized integers become fractions."""
        accessor, count = _named(self.tree, "accessors", index), self.count(index)
        width, dtype = COMPONENT_COUNTS[accessor["type"]], np.dtype(COMPONENT_TYPES[accessor["componentType"]])
        if "bufferView" in accessor:
            values = self._viewed(accessor, dtype, count, width)
        else:
            values = np.zeros((count, width), dtype=dtype)
        if "sparse" in accessor:
            sparse, values = accessor["sparse"], values.copy()
            code = np.dtype(COMPONENT_TYPES[sparse["indices"]["componentType"]])
            changed = integer(sparse["count"], "count", 1)
            rows = integers(self._viewed(sparse["indices"], code, changed, 1), "sparse indices", 0).ravel()
            values[rows] = self._viewed(sparse["values"], dtype, changed, width)
        if accessor.get("normalized") and dtype.kind in "iu":
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values

    def _viewed(self, part: dict[str, Any], dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Return the (count, width) numbers of a type in the view of a buffer that a part of the scene names."""
        view = _named(self.tree, "bufferViews", part["bufferView"])
        number, row = integer(view["buffer"], "buffer"), width * dtype.itemsize
        if number >= len(self.buffers):
            raise damaged(f"there is no buffer {number}", element=f"buffer {number}")
        buffer, begin, length = self.buffers[number], _integer(view, "byteOffset", 0), _integer(view, "byteLength")
        start, stride = begin + _integer(part, "byteOffset", 0), _integer(view, "byteStride", row)
        end = start + (count - 1) * stride + row
        if stride < row or end > begin + length:
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
    tree = json_of(text)
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if not version.startswith("2."):
        raise FileFormatError(
            f"it is glTF {version}, and only glTF 2 can be read", remedy="export it as glTF 2.0", element="version"
        )
    buffers: dict[str | None, bytes] = {None: embedded}
    uris = [buffer.get("uri") for buffer in tree.get("buffers", [])]
    for uri in dict.fromkeys(uris):  # several buffers may be one file
        if uri is not None:
            named = uri.startswith("data:")
            buffers[uri] = base64.b64decode(uri.partition(",")[2]) if named else companion_contents(path, unquote(uri))
    for number, (buffer, uri) in enumerate(zip(tree.get("buffers", []), uris, strict=True)):
        length = _integer(buffer, "byteLength", len(buffers[uri]))
        if length > len(buffers[uri]):
            raise damaged(f"buffer {number} has {len(buffers[uri])} of {length} bytes: it may be truncated")
    return _Scene(tree, [buffers[uri] for uri in uris])


def _named(tree: dict[str, Any], kind: str, index: object) -> dict[str, Any]:
    """Return entry `index` of the list `kind` of the scene, such as "meshes"; raise if there is none."""
    entries, number = tree.get(kind, []), integer(index, f"index of {kind}")
    if number >= len(entries):
        raise damaged(f"it names number {number} of its {len(entries)} {kind}", element=f"{kind} {number}")
    return entries[number]


def _mode(primitive: dict[str, Any]) -> int:
    """Return the code that says how the corners of a primitive form points (0), lines (1–3) or triangles (4–6)."""
    mode = integer(primitive.get("mode", TRIANGLE_MODE), "mode")
    if mode > FAN_MODE:
        raise damaged(f"primitives have the mode {mode}, which is not defined in glTF")
    return mode


def _integer(part: dict[str, Any], name: str, default: int | None = None) -> int:
    """Return the entry `name` of a part of the scene, an integer that must not be negative."""
    return integer(part.get(name, default), name)


def _triangles(corners: Ints, mode: int) -> Ints:
    """Return the (m, 3) triangles of a list, strip or fan of corners, depending on the mode (4, 5 or 6)."""
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


def _instances(tree: dict[str, Any]) -> Iterator[tuple[int, Floats]]:
    """Yield the number of a mesh and its (4, 3) transform for each node of the scene that has one.

    Rows (x, y, z, 1) are multiplied by the transform from the right. Each node must occur only once.
    """
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    if not nodes:
        yield from ((mesh, np.eye(4, 3)) for mesh in range(len(tree.get("meshes", []))))
        return
    below = [integers(node["children"], "children", 0).tolist() if "children" in node else [] for node in nodes]
    roots = set(range(len(nodes))).difference(*below)
    if scenes:
        roots = set(integers(_named(tree, "scenes", tree.get("scene", 0)).get("nodes", []), "nodes", 0).tolist())
    stack = [(index, np.eye(4)) for index in sorted(roots)]
    visited = set()
    while stack:
        index, outer = stack.pop()
        if index in visited or index >= len(nodes):
            raise damaged(f"node {index} is part of two others or does not exist", element=f"node {index}")
        visited.add(index)
        matrix = outer @ _matrix(nodes[index])
        if "mesh" in nodes[index]:
            yield integer(nodes[index]["mesh"], "mesh"), matrix.T[:, :3]
        stack += [(child, matrix) for child in reversed(below[index])]


def _matrix(node: dict[str, Any]) -> Floats:
    """Return the (4, 4) transform from a node to its parent."""
    if "matrix" in node:
        return vector(node["matrix"], "matrix", 16).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = vector(node.get("rotation", (0, 0, 0, 1)), "rotation", 4).tolist()
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] = np.array(turn) * vector(node.get("scale", (1, 1, 1)), "scale", 3)
    matrix[:3, 3] = vector(node.get("translation", (0, 0, 0)), "translation", 3)
    return matrix
