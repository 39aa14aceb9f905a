"""Faces of triangle and polygon meshes alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.components import sums_of
from ..geometry.directions import unit
from ..geometry.meshes import area_vectors
from ..geometry.triangle_kernels import areas_and_volumes
from .surface_parts import SurfaceParts

Mesh = TriangleMesh | PolygonMesh


@dataclass(frozen=True, eq=False)
class MeshFaces:
    """Faces of triangle and polygon meshes alike, and the triangles that they are made of.

    Those that stand apart hang together with none that they do not agree with as given; inner ones bound nothing.
    """

    positions: NDArray[np.float64]
    corners: NDArray[np.int64]
    offsets: NDArray[np.int64]
    triangles: NDArray[np.int64]
    triangle_faces: NDArray[np.int64]
    bounds: NDArray[np.float64]
    unit: float
    apart: NDArray[np.bool_] | None = None
    inner: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, shape: Mesh) -> MeshFaces:
        bounds, exponent = shape.bounds, int(np.frexp(np.abs(shape.bounds).max())[1])
        if isinstance(shape, TriangleMesh):
            positions, triangles, count = shape.vertices, shape.faces, shape.n_faces
            corners, offsets, owners = triangles.ravel(), np.arange(0, 3 * count + 1, 3), np.arange(count)
        else:
            cut = shape.refinement
            positions = np.concatenate([shape.vertices, cut.virtual_vertices])
            triangles, owners = cut.faces, cut.face_polygons
            corners, offsets = shape.corners, shape.offsets
        if abs(exponent) > 200:  # products of three lengths would leave the range of numbers
            positions, bounds = np.ldexp(positions, -exponent), np.ldexp(bounds, -exponent)
        else:
            exponent = 0
        return cls(positions, corners, offsets, triangles, owners, bounds, float(np.ldexp(1.0, exponent)))

    @cached_property
    def measures(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(p,) areas, and volumes of the cones to the center of the shape."""
        areas, volumes = areas_and_volumes(self.positions, self.triangles, self.bounds.mean(axis=0))
        if len(areas) == len(self.offsets) - 1:
            return areas, volumes
        n = len(self.offsets) - 1
        areas, volumes = sums_of(np.stack([areas, volumes], axis=1), self.triangle_faces, n).T
        return areas, volumes

    @cached_property
    def surface(self) -> SurfaceParts:
        """The faces' parts."""
        return SurfaceParts(self.positions, self.corners, self.offsets, self.measures[0], self.apart, self.inner)

    def normals(self, turned: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(p, 3) unit normals of the faces, some of them turned; zero without area."""
        vectors = area_vectors(self.positions[self.triangles])
        if len(vectors) != len(turned):
            vectors = sums_of(vectors, self.triangle_faces, len(turned))
        return unit(vectors) * np.where(turned, -1, 1)[:, None]

    @property
    def centroids(self) -> NDArray[np.float64]:
        """(p, 3) means of the faces' corners."""
        sums = np.add.reduceat(self.positions[self.corners], self.offsets[:-1], axis=0)
        return sums / np.diff(self.offsets)[:, None]
