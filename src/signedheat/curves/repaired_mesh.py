"""The mesh on which distance to curves is measured: seams closed, copies of faces left out, faces turned to agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..arrays import Ints
from ..diagnostics import Note
from ..mesh.edges import orient_faces, pair_halfedges
from ..mesh.welding import coincident_faces, joined_rims
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface_curves import Curve, SurfacePoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..surfaces.vertex_field import VertexField


@dataclass(frozen=True, eq=False, repr=False)
class MeshRepaired(Note):
    """What was done to a mesh for distance on it: vertices joined at seams, faces turned, copies left out."""

    vertices_joined: int
    faces_turned: int
    copies: int
    text: ClassVar[str] = (
        "vertices joined at seams: {0.vertices_joined}; faces turned: {0.faces_turned}; copies of faces: {0.copies}"
    )


@dataclass(frozen=True, eq=False)
class RepairedMesh:
    """A mesh on which vertices of rims at one place are one, and faces agree with their neighbours where they can.

    Attributes
    ----------
    given, mesh : TriangleMesh or PolygonMesh
        Before and after. Polygons are as they were.
    vertices : (n,) int
        Vertex of the repaired mesh at each one of the given mesh.
    faces : (m,) int
        Triangle of the repaired mesh for each one of the given mesh, on the same vertices.
    corners : (m, 3) int
        Corner of that triangle at each corner of the given one.
    note : MeshRepaired
        What was done.
    """

    given: Any
    mesh: Any
    vertices: Ints
    faces: Ints
    corners: Ints
    note: MeshRepaired

    @classmethod
    def of(cls, given: object) -> RepairedMesh | None:
        """Repair a mesh; None if there is nothing to do, or it is none."""
        if not isinstance(given, TriangleMesh | PolygonMesh):
            return None
        if isinstance(given, TriangleMesh):
            tails, heads = given.faces.ravel(), np.roll(given.faces, -1, axis=1).ravel()
        else:
            tails, heads = given.corners, given.next_corners
        places = joined_rims(given.vertices, tails, heads)
        used, vertices = np.unique(places, return_inverse=True)
        joined = given.n_vertices - len(used)
        if isinstance(given, PolygonMesh):
            if not joined:
                return None
            mesh = PolygonMesh(given.vertices[used], np.split(vertices[given.corners], given.offsets[1:-1]))
            n = given.triangulation.n_faces
            whole = np.arange(n), np.tile(np.arange(3), (n, 1))
            return cls(given, mesh, vertices, *whole, MeshRepaired(joined, 0, 0))
        corners = vertices[given.faces]
        first = copied_faces(corners, len(used))
        kept, targets = np.unique(first, return_inverse=True)
        faces, areas = corners[kept], given.face_areas[kept]
        turned = orient_faces(_pairs(faces, len(used)), faces.ravel(), np.repeat(np.arange(len(kept)), 3), areas).turned
        copies = given.n_faces - len(kept)
        if not (joined or copies or turned.any()):
            return None
        faces = np.where(turned[:, None], faces[:, ::-1], faces)
        to = (corners[:, :, None] == faces[targets][:, None]).argmax(axis=2)
        repaired = TriangleMesh(given.vertices[used], faces)
        return cls(given, repaired, vertices, targets, to, MeshRepaired(joined, int(turned.sum()), copies))

    def on_it(self, source: Any) -> Any:
        """Move a curve, points, or a sequence of them to the repaired mesh; what does not fit the given one stays."""
        if isinstance(source, Sequence):
            return [self.on_it(part) for part in source]
        if not isinstance(source, Curve | SurfacePoints):
            return source
        faces = source.faces
        if not ((faces >= 0) & (faces < len(self.faces))).all():
            return source
        weights = np.zeros((len(faces), 3))
        np.add.at(weights, (np.arange(len(faces))[:, None], self.corners[faces]), source.barycentric)
        if isinstance(source, SurfacePoints):
            return SurfacePoints(self.faces[faces], weights)
        return Curve(self.faces[faces], weights, source.closed, source.oriented, source.normals)

    def on_given(self, field: VertexField[Any]) -> VertexField[Any]:
        """Return a field on the repaired mesh, at the vertices of the given one."""
        values = field.values[self.vertices]
        diagnostics = replace(field.diagnostics, unreached=np.flatnonzero(np.isnan(values))).noting(self.note)
        return VertexField(self.given, values, diagnostics)


def copied_faces(faces: Ints, n_vertices: int) -> Ints:
    """(m,) first face on the vertices of each, where edges have more faces than two; elsewhere the face itself."""
    first = np.arange(len(faces))
    crowded = np.flatnonzero((_pairs(faces, n_vertices).around > 2).reshape(-1, 3).all(axis=1))
    if len(crowded):
        found, _ = coincident_faces(faces[crowded].ravel(), np.arange(0, 3 * len(crowded) + 1, 3))
        first[crowded] = np.where(found < 0, crowded, crowded[found])
    return first


def _pairs(faces: Ints, n_vertices: int) -> Any:
    return pair_halfedges(faces.ravel(), np.roll(faces, -1, axis=1).ravel(), n_vertices)
