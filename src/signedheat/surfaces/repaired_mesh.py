"""Triangle meshes without duplicate faces and oriented consistently, for distance on them; and the way back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..arrays import Ints
from ..diagnostics import Note
from ..fields.field import Field
from ..mesh.edges import orient_faces
from ..mesh.welding import copied_faces
from .surface_curves import Curve, SurfacePoints
from .surface_discretization import vertices_joined
from .triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False, repr=False)
class MeshRepaired(Note):
    """What was done to a mesh for distance on it: faces flipped, copies left out."""

    faces_turned: int
    copies: int
    text: ClassVar[str] = "faces flipped: {0.faces_turned}; copies of faces: {0.copies}"


@dataclass(frozen=True, eq=False)
class RepairedMesh:
    """A mesh before and after its repair: seams joined, duplicate faces left out, and faces oriented consistently."""

    given: TriangleMesh  # the mesh before the repair
    mesh: Any  # the mesh after it, a `TriangleMesh` on some of the same vertices
    places: Ints  # (n,) vertex of the repaired mesh for each vertex of the given mesh
    faces: Ints  # (m,) triangle of the repaired mesh for each one of the given mesh, on the same vertices
    corners: Ints  # (m, 3) corner of that triangle at each corner of the given one
    notes: tuple[Note, ...]  # what was done

    @classmethod
    def of(cls, given: object, agree: bool = True) -> RepairedMesh | None:
        """Repair a triangle mesh; None if there is nothing to repair, or the shape is no triangle mesh.

        Faces are flipped only if they are to `agree` with their neighbours.
        """
        if not isinstance(given, TriangleMesh):
            return None
        once, n = given.once, given.n_vertices  # beside a copy of its face, a rim looks like an edge of two faces
        if not agree and once is given:
            return None
        corners = once.places[given.faces]
        kept, targets = np.unique(copied_faces(corners, n), return_inverse=True)
        faces, areas = corners[kept], given.face_areas[kept]
        flipped = orient_faces(faces, areas, n).turned if agree else np.zeros(len(faces), dtype=bool)
        copies = given.n_faces - len(kept)
        if not (copies or flipped.any()):
            return None
        faces = np.where(flipped[:, None], faces[:, ::-1], faces)
        to = (corners[:, :, None] == faces[targets][:, None]).argmax(axis=2)
        notes = *vertices_joined(once), MeshRepaired(int(flipped.sum()), copies)
        return cls(given, TriangleMesh(given.vertices, faces), once.places, targets, to, notes)

    def on_it(self, source: Any) -> Any:
        """Move a curve, points, or a sequence of them from the given mesh to the repaired one; others are returned."""
        if isinstance(source, Sequence) and not isinstance(source, str):
            return [self.on_it(part) for part in source]
        if not isinstance(source, Curve | SurfacePoints):
            return source
        faces = source.faces
        if not ((faces >= 0) & (faces < len(self.faces))).all():
            return source  # it is refused later, with its number
        weights = np.zeros((len(faces), 3))  # added up, since corners that were welded are one
        np.add.at(weights, (np.arange(len(faces))[:, None], self.corners[faces]), source.barycentric)
        if isinstance(source, SurfacePoints):
            return SurfacePoints(self.faces[faces], weights)
        return Curve(self.faces[faces], weights, source.closed, source.oriented, source.normals)

    def on_given(self, field: Field[Any]) -> Field[Any]:
        """Return a field on the repaired mesh as one on the given mesh."""
        values = field.values[self.places]
        diagnostics = replace(field.diagnostics, unreached=np.flatnonzero(np.isnan(values))).noting(*self.notes)
        return Field(self.given, values, diagnostics)

    def curve_on_given(self, curve: Curve) -> Curve:
        """Return a curve on the repaired mesh as one on the given mesh, on the first of duplicate faces."""
        faces = np.unique(self.faces, return_index=True)[1][curve.faces]
        weights = np.take_along_axis(curve.barycentric, self.corners[faces], axis=1)
        return Curve(faces, weights, curve.closed, curve.oriented, curve.normals)
