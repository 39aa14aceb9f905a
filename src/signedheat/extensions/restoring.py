"""Faces that an oriented mesh has lost between vertices which are there, put back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import FacesRestored
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.edges import edge_table
from ..geometry.lost_faces import lost_faces
from ..geometry.welding import roundoff, welded
from .mesh_faces import Mesh
from .orientation import Orientation


@dataclass(frozen=True, eq=False)
class Restored:
    """A mesh with the faces that it had lost.

    Attributes
    ----------
    shape : TriangleMesh or PolygonMesh
        The mesh itself where it has lost none, or else triangles, the restored ones last.
    walls : (m,) bool
        Faces of doubled walls.
    restored : (m,) bool, optional
        Faces that were put back.
    closed : bool
        Whether it bounds something without holes: all edges have as many faces one way as the other.
    note : FacesRestored, optional
        What there is to tell.
    """

    shape: Mesh
    walls: NDArray[np.bool_]
    restored: NDArray[np.bool_] | None
    closed: bool
    note: FacesRestored | None = None


def restored(found: Orientation) -> Restored:
    """Close the small holes of an oriented mesh by the faces it lost there (`lost_faces`).

    In sheets that bound nothing only single faces are put back, in doubled walls none: larger holes may be meant.
    """
    if found.closed_parts == found.n_parts:
        return as_found(found)
    shape, parents = _triangles(found.shape)
    places = welded(shape.vertices, roundoff(shape.vertices))[shape.faces]
    whole = (places != np.roll(places, 1, axis=1)).all(axis=1)
    kept = whole & ~found.walls[parents]
    faces = lost_faces(shape.vertices, places[kept], found.undecided[parents][kept])
    if not len(faces):
        return as_found(found)
    mesh = TriangleMesh(shape.vertices, np.concatenate([shape.faces, faces]))
    area = float(mesh.face_areas.sum())
    if not 0.0 < area < np.inf:  # lengths whose squares leave the range: refused where distance is measured
        return as_found(found)
    share = float(mesh.face_areas[-len(faces) :].sum()) / area
    added = np.arange(mesh.n_faces) >= shape.n_faces
    return Restored(
        mesh,
        np.concatenate([found.walls[parents], np.zeros(len(faces), dtype=bool)]),
        added,
        _all_decided(found) and _is_closed(np.concatenate([places[whole], faces])),
        FacesRestored(len(faces), share),
    )


def as_found(found: Orientation) -> Restored:
    """An oriented mesh with the faces that it has, and no others."""
    return Restored(found.shape, found.walls, None, found.closed_parts == found.n_parts and _all_decided(found))


def _all_decided(found: Orientation) -> bool:
    """Whether all faces have an inside."""
    return not (found.undecided_area or found.wall_area or found.nonorientable_parts)


def _triangles(shape: Mesh) -> tuple[TriangleMesh, NDArray[np.int64]]:
    """A mesh as triangles, and the face that each is part of."""
    if isinstance(shape, PolygonMesh):
        return shape.triangulation, shape.refinement.face_polygons
    return shape, np.arange(shape.n_faces)


def _is_closed(faces: NDArray[np.int64]) -> bool:
    """Whether faces run along every edge as often one way as the other."""
    table = edge_table(faces)
    return not np.bincount(table.face_edges.ravel(), np.where(table.forward.ravel(), 1, -1)).any()
