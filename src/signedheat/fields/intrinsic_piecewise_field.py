"""Piecewise linear distance on an intrinsic triangulation that may be discontinuous across edges."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..domains.common_subdivision import positions, subdivided
from ..domains.curves import SurfacePoints
from ..domains.intrinsic_triangulation import IntrinsicTriangulation
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..geometry.surface_points import barycentric_in
from .piecewise_field import PiecewiseField
from .vertex_field import VertexField


class IntrinsicPiecewiseField(PiecewiseField):
    """A `PiecewiseField` on the triangles of an `IntrinsicTriangulation`; points refer to the mesh of that.

    `domain` and `surface` are the triangulation.
    """

    domain: IntrinsicTriangulation
    surface: IntrinsicTriangulation

    @property
    def face_gradients(self) -> NDArray[np.float64]:
        """Not defined in space, since intrinsic triangles bend over the edges of the mesh: raises `GeometryError`."""
        raise GeometryError(
            "the triangles of an intrinsic triangulation are not flat in space, so φ has no one gradient in each",
            remedy="use gradient(points), or split().face_gradients",
        )

    def gradient(self, points: SurfacePoints) -> NDArray[np.float64]:
        """(n, 3) ∇φ in space at points of the mesh, in the triangles on which φ is linear."""
        return self.domain.gradient_of_corners(self.values, points.faces, points.barycentric)

    def __call__(self, points: SurfacePoints) -> NDArray[np.float64]:
        """(n,) φ at points of the mesh."""
        faces, weights = self.domain.locate(points.faces, points.barycentric)
        result: NDArray[np.float64] = (self.values[faces] * weights).sum(axis=1)
        return result

    def split(self) -> VertexField[TriangleMesh | PolygonMesh]:
        """The same field on the common subdivision of mesh and triangulation, with vertices doubled along the cut."""
        triangles, n = self.triangles, self.domain.n_vertices
        polygons, owners, where = subdivided(self.domain)
        sizes = [len(polygon) for polygon in polygons]
        node, face = np.concatenate(polygons), np.repeat(owners, sizes)
        crossing = node >= n
        at, on = np.flatnonzero(~crossing), np.flatnonzero(crossing)

        owner = self.split_vertices[0]
        means = np.bincount(owner, self.values.ravel()) / np.bincount(owner)
        at_corners = means[owner].reshape(-1, 3)
        corner = 3 * face[at] + (triangles.corner_vertices[face[at]] == node[at, None]).argmax(axis=1)
        places = where[node[on] - n]
        on_cut = np.zeros(triangles.n_edges, dtype=bool)
        on_cut[self.pairs.edges[self.is_cut]] = True
        values, keys = np.empty(len(node)), np.zeros((len(node), 2), dtype=np.int64)
        values[at], keys[at, 1] = at_corners.ravel()[corner], owner[corner]
        values[on] = (at_corners[face[on]] * barycentric_in(triangles, face[on], places)).sum(axis=1)
        keys[on, 0], keys[on, 1] = 1 + node[on], np.where(on_cut[places.elements], face[on], -1)

        _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        space = np.concatenate([self.domain.vertices, positions(self.domain, where)])
        ends = np.cumsum([0, *sizes])
        mesh = PolygonMesh(space[node[first]], [vertex[a:b] for a, b in pairwise(ends)])
        return VertexField(mesh, values[first], self.diagnostics)
