"""GLB and glTF, read by trimesh."""

from __future__ import annotations

import io
import json
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..packages import lazy_module
from .files import PathLike, contents, contents_beside, damaged, ensure_fits, extension, parsed_by_others

trimesh = lazy_module("trimesh", ".glb and .gltf files")

BYTES = 80
"""Measured: what each position, index or the like takes while a scene is read."""


def read_glb(path: PathLike) -> TriangleMesh:
    """All triangles of a scene, transformed by their nodes, one body after another.

    Buffers that the file names must lie in the same folder or below it; pictures are not read.
    """
    data = contents(path)
    load_scene = trimesh.load_scene
    plain, files = _without_looks(data, path)

    def parse() -> list[tuple[NDArray[Any], NDArray[Any]]]:
        scene = load_scene(io.BytesIO(plain), file_type=extension(path)[1:], process=False, resolver=files)
        bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh)]
        return [(np.asarray(body.vertices), np.asarray(body.faces)) for body in bodies]

    bodies = parsed_by_others(parse, len(data))
    if not bodies:
        raise FileFormatError("the scene holds no triangles", remedy="export the shape as a mesh")
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in bodies])
    faces = [own + start for (_, own), start in zip(bodies, starts, strict=False)]
    return TriangleMesh(np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces))


def _without_looks(data: bytes, path: PathLike) -> tuple[bytes, dict[str, bytes]]:
    """The file without its materials and pictures, and the buffers that it names, by name.

    Numbers that would be made of nothing (an accessor without a view is zeros, as many as it says) are refused where
    they are more than the bytes of the file.
    """
    is_binary = data[:4] == b"glTF"
    length = int.from_bytes(data[12:16], "little") if is_binary else len(data)
    tree = json.loads(data[20 : 20 + length] if is_binary else data)
    files = {
        buffer["uri"]: contents_beside(path, unquote(buffer["uri"]))
        for buffer in tree.get("buffers", [])
        if "uri" in buffer and "base64," not in buffer["uri"]
    }
    most = len(data) + sum(map(len, files.values()))
    if any(not 0 <= accessor.get("count", 0) <= most for accessor in tree.get("accessors", [])):
        raise damaged("it announces more numbers than it has bytes: it is damaged")
    ensure_fits(BYTES * sum(accessor.get("count", 0) for accessor in tree.get("accessors", [])), path)
    for looks in ("materials", "textures", "images", "samplers"):
        tree.pop(looks, None)
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            primitive.pop("material", None)
    text = json.dumps(tree).encode()
    if not is_binary:
        return text, files
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = b"glTF" + data[4:8] + (20 + len(text) + len(rest)).to_bytes(4, "little")
    return head + len(text).to_bytes(4, "little") + data[16:20] + text + rest, files
