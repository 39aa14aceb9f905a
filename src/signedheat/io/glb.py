"""GLB and glTF, read by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..packages import lazy_module
from .files import PathLike, contents, extension

trimesh = lazy_module("trimesh", ".glb and .gltf files")


def read_glb(path: PathLike) -> TriangleMesh:
    """All triangles of a scene, transformed by their nodes, one body after another."""
    contents(path)
    load_scene = trimesh.load_scene
    try:
        scene = load_scene(str(Path(path)), file_type=extension(path)[1:], process=False)
        bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh)]
    except Exception as error:
        raise FileFormatError(
            f"cannot be read as glTF ({error}): the file is damaged",
            remedy="write or download it again",
            path=path,
        ) from error
    if not bodies:
        raise FileFormatError(
            "the scene holds no triangles",
            remedy="export the shape as a mesh",
            path=path,
        )
    starts = np.cumsum([0] + [len(body.vertices) for body in bodies])
    faces = [np.asarray(body.faces) + start for body, start in zip(bodies, starts, strict=False)]
    return TriangleMesh(np.concatenate([body.vertices for body in bodies]), np.concatenate(faces))
