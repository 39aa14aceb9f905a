"""Tet meshes from TetGen and fTetWild, which are optional dependencies.

Unlike lattices, unstructured tets have no preferred directions: at the same size the unsharpened error is half as
large, or less (``benchmarks/tets.py``).

* TetGen (``pip install tetgen pyvista``) is under the AGPL-3 or a commercial licence, whatever its wheel says.
* fTetWild (``pip install pytetwild``) is under the MPL-2.0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..area_elements import area_elements, bounds_around
from ..arrays import Floats, Ints
from ..errors import GeometryError
from ..grids.grid import room_around
from ..packages import lazy_module
from ..surfaces.point_cloud import PointCloud
from .tet_mesh import TetMesh

pytetwild: Any = lazy_module("pytetwild", "tets of fTetWild")
tetgen: Any = lazy_module("tetgen", "tets of TetGen")


def tetrahedralize_with_tetgen(shape: Any, *, resolution: int = 32, padding: float | None = None) -> TetMesh:
    """Fill a box around a shape with tets of about the same size, by TetGen, which is given the box alone."""
    lower, upper, spacing = _box_around(shape, resolution, padding)
    volume = 1.64 * spacing**3 / (6 * np.sqrt(2))  # an upper bound for TetGen that gives this mean edge length
    mesher = tetgen.TetGen(*box_walls(lower, upper, np.ceil((upper - lower) / (1.4 * spacing)).astype(np.int64)))
    options = {"mindihedral": 10, "minratio": 1.4, "nobisect": True, "maxvolume": volume, "fixedvolume": True}
    return TetMesh(*mesher.tetrahedralize(order=1, **options)[:2])


def tetrahedralize_with_tetwild(shape: Any, *, resolution: int = 32, padding: float | None = None) -> TetMesh:
    """Fill a box around a shape with tets that approximately conform to its faces, by fTetWild."""
    if isinstance(shape, PointCloud):
        raise GeometryError("fTetWild follows faces, and a point cloud has none", remedy="use tetrahedralize")
    lower, upper, spacing = _box_around(shape, resolution, padding)
    corners, faces = box_walls(lower, upper, np.ones(3, dtype=np.int64))
    triangles = area_elements(shape).corners
    vertices, ids = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    leftover = Path("__tracked_surface.stl")  # fTetWild leaves it in the working directory
    keep = leftover.exists()
    vertices, tets = pytetwild.tetrahedralize(
        np.concatenate([corners, vertices]),
        np.concatenate([faces, ids.reshape(-1, 3) + len(corners)]).astype(np.int32),
        edge_length_abs=spacing,
    )[:2]
    if not keep:
        leftover.unlink(missing_ok=True)
    return TetMesh(vertices, tets[:, [0, 1, 3, 2]])  # fTetWild's own order has negative volumes


def _box_around(shape: Any, resolution: int, padding: float | None) -> tuple[Floats, Floats, float]:
    """Return the corners of the padded bounding box of a shape, and the target edge length."""
    lower, upper = bounds_around([shape])
    longest = float((upper - lower).max())
    if len(lower) != 3 or not longest > 0:
        raise GeometryError(
            f"{shape!r} has no extent in space of three dimensions to put a mesh around", element="shape"
        )
    padding = room_around((lower, upper)) if padding is None else padding
    return lower - padding, upper + padding, longest / resolution


def box_walls(lower: Floats, upper: Floats, counts: Ints) -> tuple[Floats, NDArray[np.int32]]:
    """Return vertices and triangles of a box, from `counts` rectangles along x, y and z, each cut in two."""
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        i, j = (a.ravel() for a in np.meshgrid(np.arange(counts[u]), np.arange(counts[v]), indexing="ij"))
        first = i * stride[u] + j * stride[v]
        quads = np.stack([first, first + stride[u], first + stride[u] + stride[v], first + stride[v]], axis=1)
        faces += [quads[:, [0, 3, 2, 1]], quads + counts[axis] * stride[axis]]
    quads = np.concatenate(faces)
    ids, triangles = np.unique(np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), return_inverse=True)
    places = np.stack([ids // stride[0], ids % stride[0] // stride[1], ids % stride[1]], axis=1)
    return lower + places * (upper - lower) / counts, triangles.reshape(-1, 3).astype(np.int32)
