"""Triangle meshes, as domains on which distance is measured, and as sources in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import GeometryError, counted
from ..mesh.edges import EdgeTable, edge_table, has_three_corners
from ..mesh.intrinsic_mesh import TRIANGLE_MARGIN, IntrinsicMesh, laid_out
from ..mesh.triangles import area_vectors
from ..mesh.welding import ONE_PLACE, SEAM_UNITS, copied_faces, joined_rims
from ..search.nearest_triangles import TriangleTree
from ..shapes.exchange import Elements, Exchangeable
from ..validation import coordinates, element_ids, used_bounds
from .surface import Surface

if TYPE_CHECKING:
    import trimesh  # noqa: F401  named in the base class


@dataclass(frozen=True, eq=False)
class TriangleMesh(Exchangeable["trimesh.Trimesh"], Surface):
    """Triangles in space: manifold or not, orientable or not, closed or not.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions; vertices that no face uses are allowed.
    faces : (m, 3) int
        Vertex ids of each face, counter-clockwise as seen from the side to which its normal points.

    Raises
    ------
    GeometryError
        If there is no face, a coordinate is NaN or infinite, or a face names a vertex that does not exist.

    See Also
    --------
    PolygonMesh : Polygons in space.
    PointCloud : Points, with normals or without.
    as_shape : Convert objects of other packages.
    complete : Make a solid of a broken shape.

    Examples
    --------
    >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh.face_areas
    array([0.5])
    """

    vertices: Floats
    faces: Ints

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        positions = coordinates(vertices, "vertices", 3)
        vars(self).update(vertices=positions, faces=element_ids(faces, "faces", 3, len(positions)))

    @classmethod
    def _of(cls, elements: Elements) -> TriangleMesh:
        """Make a mesh of the points and triangles of a converted shape; polygons have been triangulated."""
        return cls(elements.points, elements.triangles)

    @property
    def _elements(self) -> Elements:
        """The vertices and triangles in the form that files and other packages need."""
        return Elements.of_triangles(self.vertices, self.faces)

    @property
    def n_vertices(self) -> int:
        """Number of vertices, used by a face or not."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.faces)

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the bounding box of the faces, without unreferenced vertices."""
        return used_bounds(self.vertices, self.faces)

    @cached_property
    def edges(self) -> EdgeTable:
        """The edges, numbered by first appearance in the faces (corner 0–1, 1–2, 2–0, face after face)."""
        return edge_table(self.faces)

    @cached_property
    def face_area_vectors(self) -> Floats:
        """(m, 3) area times unit normal, in square units."""
        return area_vectors(self.vertices[self.faces])

    @cached_property
    def face_areas(self) -> Floats:
        """(m,) areas, in square units."""
        return np.linalg.norm(self.face_area_vectors, axis=1)

    @property
    def area(self) -> float:
        """Area of all faces, in square units.

        Examples
        --------
        >>> from signedheat import samples
        >>> ball = samples.sphere(5)
        >>> round(ball.area, 2), round(ball.volume, 2), ball.is_watertight
        (12.56, 4.19, True)
        """
        return float(self.face_areas.sum())

    @property
    def volume(self) -> float:
        """Volume within the faces, in cubic units; negative if they face inwards.

        Raises
        ------
        GeometryError
            If the faces do not close, or do not agree on which side is outside.

        See Also
        --------
        signedheat.Solid.volume : Of any shape, broken or not.
        """
        unbalanced = int((edge_table(self._welded_faces).balance != 0).sum())
        if unbalanced:
            raise GeometryError(
                f"the mesh is not closed: at {counted(unbalanced, 'edge')} a face is missing, or faces disagree",
                remedy="use sh.complete(mesh).volume",
                element="faces",
            )
        corners = self.vertices[self.faces] - self.bounds.mean(axis=0)
        return float(np.einsum("ij,ij->", corners[:, 0], self.face_area_vectors) / 3.0)

    @property
    def is_watertight(self) -> bool:
        """Whether each edge has exactly two faces, which run along it in opposite directions.

        Ends of open edges count as one vertex if only rounding separates them. *Closed* means the same in `signedheat
        info`, ``fill`` and ``watertight``. In files without vertex ids, such as STL, bodies that touch along an edge
        share it, and it then has four faces.

        Examples
        --------
        >>> from signedheat import complete, samples
        >>> broken = samples.without_faces(samples.sphere(3), 0.1)
        >>> broken.is_watertight, complete(broken).surface().is_watertight
        (False, True)
        """
        return not self.n_bad_edges

    @cached_property
    def n_bad_edges(self) -> int:
        """Number of edges without exactly two faces that run along it in opposite directions: see `is_watertight`."""
        table = edge_table(self._welded_faces)
        return int(((table.face_counts != 2) | (table.balance != 0)).sum())

    @cached_property
    def _welded_faces(self) -> Ints:
        """(k, 3) faces after vertices of open edges that differ by rounding were merged.

        Faces on fewer than three vertices are left out.
        """
        tails, heads = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        faces = joined_rims(self.vertices, tails, heads, ONE_PLACE)[self.faces]
        return faces[has_three_corners(faces)]

    @cached_property
    def edge_lengths(self) -> Floats:
        """(e,) lengths, in the units of the vertices and in the order of `edges`."""
        tail, head = self.edges.vertices.T
        return np.linalg.norm(self.vertices[head] - self.vertices[tail], axis=1)

    @cached_property
    def intrinsic(self) -> IntrinsicMesh:
        """The faces, joined at seams and laid out in the plane, with edges lengthened a bit so that all have area."""
        return laid_out(self.joined, TRIANGLE_MARGIN)[0]

    @cached_property
    def places(self) -> Ints:
        """(n,) id of the first boundary vertex at the position of each boundary vertex; others have their own id."""
        return joined_rims(self.vertices, self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel(), SEAM_UNITS)

    @cached_property
    def joined(self) -> TriangleMesh:
        """The same faces, in which boundary vertices at one position are one vertex, by `places`."""
        whole = (self.places == np.arange(self.n_vertices)).all()
        return self if whole else TriangleMesh(self.vertices, self.places[self.faces])

    @cached_property
    def first_copies(self) -> Ints:
        """(k,) ids of the faces that do not have the same three vertices as an earlier face, in any order."""
        return np.unique(copied_faces(self.faces, self.n_vertices))

    @cached_property
    def once(self) -> TriangleMesh:
        """The mesh without duplicate faces: only those of `first_copies`."""
        kept = self.first_copies
        return self if len(kept) == self.n_faces else TriangleMesh(self.vertices, self.faces[kept])

    @cached_property
    def search_tree(self) -> TriangleTree:
        """Search tree that finds the faces nearest to points."""
        return TriangleTree.of(self.vertices[self.faces])

    @property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to: the mesh itself."""
        return self

    def __repr__(self) -> str:
        return f"TriangleMesh({counted(self.n_vertices, 'vertex')}, {counted(self.n_faces, 'face')})"
