"""Piecewise linear distance on a surface that may be discontinuous across edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..diagnostics import Diagnostics
from ..errors import GeometryError
from ..exchange import Displayed
from ..field_arithmetic import Arithmetic
from ..mesh.intrinsic_mesh import FacePairs, IntrinsicMesh, face_pairs, split_corners
from ..mesh.polylines import assemble_polylines
from ..mesh.surface_points import barycentric_in, locate_points
from ..mesh.triangles import gradients_along
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.subdivision import positions, subdivided
from ..surfaces.surface_curves import Curve, SurfacePoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..surfaces.vertex_field import VertexField
from ..words import counted

if TYPE_CHECKING:
    from os import PathLike

    import pyvista


@dataclass(frozen=True, eq=False)
class Cut(Frozen):
    """A polyline along edges of the surface across which a field is discontinuous.

    Attributes
    ----------
    vertices : (k,) int
        Vertices of `PiecewiseField.surface`, in order; the first is repeated at the end if the line is closed.
    points : (k, 3) float
        Their positions.
    jumps : (k - 1, 2) float
        Absolute difference of the field between the two sides of each edge, at the two ends of the edge.
    steps : (k - 1,) float
        Length of each edge, along the surface.
    """

    vertices: Ints
    points: Floats
    jumps: Floats
    steps: Floats

    @property
    def length(self) -> float:
        """Length of the cut."""
        return float(self.steps.sum())

    @property
    def height(self) -> float:
        """Mean jump along the cut."""
        return float(np.average(self.jumps.mean(axis=1), weights=self.steps))

    def __repr__(self) -> str:
        return f"Cut({counted(len(self.vertices), 'vertex')}, length {self.length:.4g}, mean jump {self.height:.4g})"


@dataclass(frozen=True, eq=False)
class PiecewiseField(Displayed, Arithmetic, Frozen):
    """Signed distance that is linear in every triangle and may be discontinuous across edges.

    Attributes
    ----------
    domain : TriangleMesh, PolygonMesh or IntrinsicTriangulation
        The domain.
    surface : TriangleMesh or IntrinsicTriangulation
        Its triangles: the domain itself, or the virtual refinement of its polygons.
    values : (m, 3) float
        φ at the corners of the triangles, in the units of the vertices; NaN where no source is connected.
    triangles : IntrinsicMesh
        The triangles as an intrinsic mesh.
    is_cut : (p,) bool
        Those of the `pairs` of triangles that the cut separates.
    diagnostics : Diagnostics
        Timings, diffusion time, and the notes described in `signedheat.piecewise_distance`.

    See Also
    --------
    piecewise_distance : Distance to curves that bound no region.
    VertexField : Values on a surface.

    Examples
    --------
    A step across the diagonal of a square:

    >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> triangles = IntrinsicMesh.from_lengths(mesh.faces, mesh.edge_lengths[mesh.edges.face_edges], 4)
    >>> phi = PiecewiseField(mesh, mesh, np.array([[1.0] * 3, [0.0] * 3]), triangles, np.array([True]))
    >>> phi.cut
    [Cut(2 vertices, length 1.414, mean jump 1)]
    """

    domain: TriangleMesh | PolygonMesh | IntrinsicTriangulation
    surface: TriangleMesh | IntrinsicTriangulation
    values: Floats
    triangles: IntrinsicMesh = field(repr=False)
    is_cut: Bools = field(repr=False)
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)

    def _mapped(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> PiecewiseField:
        """Return the field with changed values, without the diagnostics of this one."""
        return replace(self, values=change(self.values), diagnostics=Diagnostics())

    def gradient(self, points: SurfacePoints) -> Floats:
        """∇φ in the triangles that contain the points.

        Parameters
        ----------
        points : SurfacePoints
            As for calling the field.

        Returns
        -------
        (n, 3) float
            Gradients; of length about 1, since φ is a distance.

        Examples
        --------
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.piecewise_distance(ball.level_set(ball.vertices[:, 2]), ball)
        >>> phi.gradient(ball.points_at([0, 1])).shape
        (2, 3)
        """
        places = locate_points(self.triangles, points.faces, points.barycentric)
        return self.face_gradients[places.faces]

    @property
    def face_gradients(self) -> Floats:
        """(m, 3) ∇φ in each triangle, in space."""
        corners = self.surface.vertices[self.surface.faces]
        return gradients_along(corners[:, 1:] - corners[:, :1], self.values[:, 1:] - self.values[:, :1])

    def __call__(self, points: SurfacePoints) -> Floats:
        """φ at points of the surface; on edges and at vertices, the value in the face through which the point is given.

        Raises
        ------
        SourceError
            If the face of a point does not exist.
        """
        places = locate_points(self.triangles, points.faces, points.barycentric)
        return (self.values[places.faces] * places.barycentric).sum(axis=1)

    @cached_property
    def jumps(self) -> Floats:
        """(p, 2) jump at the two ends of the edge between the faces of each of the `pairs`."""
        return self.pairs.ends(self.values)

    @cached_property
    def pairs(self) -> FacePairs:
        """The pairs of triangles that share an edge."""
        return face_pairs(self.triangles)

    @cached_property
    def cut(self) -> list[Cut]:
        """The lines across which φ is discontinuous, longest first; empty if it is continuous."""
        pairs = np.flatnonzero(self.is_cut)
        edges = self.pairs.edges[pairs]
        height = np.abs(self.jumps[pairs])
        edges, first, numbers = np.unique(edges, return_index=True, return_inverse=True)
        largest = np.zeros((len(first), 2))
        np.maximum.at(largest, numbers, height)
        lengths = self.triangles.lengths_of_edges
        ids, lines = self.triangles.edges.vertices[edges], []
        for chain, backwards, _ in assemble_polylines(ids[:, 0], ids[:, 1], directed=False):
            ends, jumps = (
                np.where(backwards[:, None], pairs[chain][:, ::-1], pairs[chain]) for pairs in (ids, largest)
            )
            vertices = np.concatenate([ends[:, 0], ends[-1:, 1]])
            lines.append(Cut(vertices, self.surface.vertices[vertices], jumps, lengths[edges[chain]]))
        return sorted(lines, key=lambda line: -line.length)

    def split(self) -> VertexField[TriangleMesh | PolygonMesh]:
        """Return the same field on a mesh whose vertices are doubled along the cut, for viewers and for contours.

        Away from the cut, the values of all corners at a vertex are averaged. Faces keep their ids.

        Returns
        -------
        VertexField
            On that mesh.

        Examples
        --------
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.piecewise_distance(ball.level_set(ball.vertices[:, 2]), ball)
        >>> phi.split().domain.n_faces == ball.n_faces
        True
        """
        owner, vertices = self.split_vertices
        count = np.bincount(owner)
        values = np.bincount(owner, self.values.ravel()) / count
        mesh = TriangleMesh(self.surface.vertices[vertices], owner.reshape(-1, 3))
        return VertexField(mesh, values, self.diagnostics)

    @cached_property
    def split_vertices(self) -> tuple[Ints, Ints]:
        """(3m,) vertex of the split mesh at each corner, and the original vertex of each vertex of the split mesh."""
        owner = split_corners(self.triangles, self.pairs, self.is_cut)
        _, first = np.unique(owner, return_index=True)
        return owner, self.surface.faces.ravel()[first]

    def contour(self, level: float = 0.0) -> list[Curve]:
        """Level set as curves on the surface, with greater values to their left; they end at the cut.

        Parameters
        ----------
        level : float
            The value of φ on them, a length.

        Returns
        -------
        list of Curve
            On the mesh of `split`.

        Examples
        --------
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.piecewise_distance(ball.level_set(ball.vertices[:, 2]), ball)
        >>> len(phi.contour(0.2))
        1
        """
        return self.split().contour(level)

    def to_pyvista(self) -> pyvista.PolyData:
        # cut open, so that the jumps show
        return self.split().to_pyvista()

    def save(self, path: str | PathLike[str]) -> None:
        """Write the field on `split`, so that viewers show the jump, in the format given by the extension.

        Parameters
        ----------
        path : str or path
            As for `VertexField.save`.

        Raises
        ------
        FileFormatError
            If the format is none of these, or the file cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.piecewise_distance(ball.level_set(ball.vertices[:, 2]), ball)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     phi.save(f"{folder}/phi.ply")
        ...     sh.read_field(f"{folder}/phi.ply").domain.n_faces == ball.n_faces
        True
        """
        self.split().save(path)

    def __repr__(self) -> str:
        low, high = (float(f.reduce(self.values, axis=None)) for f in (np.fmin, np.fmax))
        return f"PiecewiseField({self.domain!r}, values from {low:.4g} to {high:.4g}, {counted(len(self.cut), 'cut')})"


class IntrinsicPiecewiseField(PiecewiseField):
    """A `PiecewiseField` on the triangles of an `IntrinsicTriangulation`; points are given on its mesh.

    `domain` and `surface` are the triangulation.
    """

    domain: IntrinsicTriangulation
    surface: IntrinsicTriangulation

    @property
    def face_gradients(self) -> Floats:
        """Not defined in space, since intrinsic triangles bend over the edges of the mesh: raises `GeometryError`."""
        raise GeometryError(
            "the triangles of an intrinsic triangulation are not flat in space, so φ has no one gradient in each",
            remedy="use gradient(points), or split().face_gradients",
        )

    def gradient(self, points: SurfacePoints) -> Floats:
        """(n, 3) ∇φ in space at points of the mesh, in the triangles on which φ is linear."""
        return self.domain.gradient(self.values, points.faces, points.barycentric)

    def __call__(self, points: SurfacePoints) -> Floats:
        """(n,) φ at points of the mesh."""
        faces, weights = self.domain.locate(points.faces, points.barycentric)
        return (self.values[faces] * weights).sum(axis=1)

    def split(self) -> VertexField[TriangleMesh | PolygonMesh]:
        """Move the field to the common subdivision of mesh and triangulation, with vertices doubled along the cut."""
        triangles, n = self.triangles, self.domain.n_vertices
        polygons, owners, where = subdivided(self.domain)
        sizes = [len(polygon) for polygon in polygons]
        node, face = np.concatenate(polygons), np.repeat(owners, sizes)
        at_vertices, on = np.flatnonzero(node < n), np.flatnonzero(node >= n)  # corners at vertices; where edges cross

        # values at all corners, and keys: corners with the same key become one vertex
        owner = self.split_vertices[0]
        means = np.bincount(owner, self.values.ravel()) / np.bincount(owner)
        at_corners = means[owner].reshape(-1, 3)
        corner = 3 * face[at_vertices] + (
            triangles.corner_vertices[face[at_vertices]] == node[at_vertices, None]
        ).argmax(axis=1)
        places = where[node[on] - n]
        on_cut = mask_of(triangles.n_edges, self.pairs.edges[self.is_cut])
        values, keys = np.empty(len(node)), np.zeros((len(node), 2), dtype=np.int64)
        values[at_vertices], keys[at_vertices, 1] = at_corners.ravel()[corner], owner[corner]
        values[on] = (at_corners[face[on]] * barycentric_in(triangles, face[on], places)).sum(axis=1)
        keys[on, 0], keys[on, 1] = 1 + node[on], np.where(on_cut[places.elements], face[on], -1)

        # a vertex for each key, and the polygons between these
        _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        space = np.concatenate([self.domain.vertices, positions(self.domain, where)])
        ends = np.cumsum([0, *sizes])
        mesh = PolygonMesh(space[node[first]], [vertex[a:b] for a, b in pairwise(ends)])
        return VertexField(mesh, values[first], self.diagnostics)
