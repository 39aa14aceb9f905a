"""Surfaces cut along edges, across which a field that is linear in every triangle may jump."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..errors import GeometryError, counted
from ..fields.field_domain import Exact
from ..mesh.intrinsic_mesh import FacePairs, IntrinsicMesh, face_pairs, split_corners
from ..mesh.polylines import assemble_polylines
from ..mesh.surface_points import barycentric_in, locate_points
from ..mesh.triangles import gradients_along
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.subdivision import positions, subdivided
from ..surfaces.surface import LinearDomain, placed
from ..surfaces.surface_curves import Curve
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import shaped


@dataclass(frozen=True, eq=False)
class Cut(Frozen):
    """A polyline along edges of the surface across which a field is discontinuous.

    Attributes
    ----------
    vertices : (k,) int
        Ids of vertices of `CutSurface.triangulation`, in order along the line. A closed line repeats the first at the
        end.
    points : (k, 3) float
        Positions of these vertices, in the units of the surface.
    jumps : (k - 1, 2) float
        Absolute difference of the field between the two sides of each edge, at the two ends of the edge, in the units
        of the field.
    steps : (k - 1,) float
        Length of each edge, along the surface and in its units.

    See Also
    --------
    results.CutSurface : The surface, and its cuts.
    """

    vertices: Ints
    points: Floats
    jumps: Floats
    steps: Floats

    @property
    def length(self) -> float:
        """Length of the cut, in the units of the surface."""
        return float(self.steps.sum())

    @property
    def height(self) -> float:
        """Mean jump of the field along the cut, weighted by length, in the units of the field."""
        return float(np.average(self.jumps.mean(axis=1), weights=self.steps))

    def __repr__(self) -> str:
        return f"Cut({counted(len(self.vertices), 'vertex')}, length {self.length:.4g}, mean jump {self.height:.4g})"


@dataclass(frozen=True, eq=False)
class CutSurface(LinearDomain, Frozen):
    """A surface cut along edges, across which the fields of `piecewise_distance` may jump.

    Fields on it have (m, 3) values, at the three corners of each of its m triangles, and NaN where no source is
    connected.

    Attributes
    ----------
    surface : TriangleMesh, PolygonMesh or IntrinsicTriangulation
        The surface before it is cut.
    triangles : IntrinsicMesh
        Its triangles, or those into which its polygons are divided, with their edge lengths.
    is_cut : (p,) bool
        True for each pair of neighbouring triangles in `pairs` that the cut separates.

    See Also
    --------
    piecewise_distance : Distance to curves that bound no region.
    Field : Values on a domain.

    Examples
    --------
    A step across the diagonal of a square:

    >>> from signedheat.fields.field import Field
    >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> square = CutSurface(mesh, mesh.intrinsic, np.array([True]))
    >>> phi = Field(square, [[1.0] * 3, [0.0] * 3])
    >>> phi.domain.cuts(phi.values)
    [Cut(2 vertices, length 1.414, mean jump 1)]
    """

    surface: TriangleMesh | PolygonMesh | IntrinsicTriangulation
    triangles: IntrinsicMesh
    is_cut: Bools

    @property
    def triangulation(self) -> TriangleMesh | IntrinsicTriangulation:
        """Triangulation at whose corners fields have values: the surface, or the triangles that divide its polygons."""
        return self.surface if isinstance(self.surface, IntrinsicTriangulation) else self.surface.triangulation

    @property
    def n_vertices(self) -> int:
        """Number of vertices of the triangles before the surface is cut."""
        return self.triangulation.n_vertices

    @cached_property
    def pairs(self) -> FacePairs:
        """The p pairs of triangles that share an edge, with the corners at the ends of that edge."""
        return face_pairs(self.triangles)

    def jumps(self, values: Floats) -> Floats:
        """Compute the jumps of a field across the edges between neighbouring triangles.

        Parameters
        ----------
        values : (m, 3) float
            Values of the field at the corners of the triangles, as in `Field.values`.

        Returns
        -------
        (p, 2) float
            Value in the first triangle of each of the `pairs` less that in the second, at the two ends of their edge.

        See Also
        --------
        results.CutSurface.cuts : Where it jumps.

        Examples
        --------
        >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> np.abs(CutSurface(mesh, mesh.intrinsic, np.array([True])).jumps(np.array([[1.0] * 3, [0.0] * 3]))).tolist()
        [[1.0, 1.0]]
        """
        return self.pairs.ends(values)

    def cuts(self, values: Floats) -> list[Cut]:
        """Return the lines along which the surface is cut, longest first, with the jumps of a field.

        Parameters
        ----------
        values : (m, 3) float
            Values of the field at the corners of the triangles, as in `Field.values`.

        Returns
        -------
        list of Cut
            A `Cut` for each line, in the units of the surface. The list is empty if the surface is not cut.

        See Also
        --------
        piecewise_distance : A field on a cut surface.
        results.CutSurface.jumps : How much it jumps.

        Examples
        --------
        >>> import signedheat as sh
        >>> torus = sh.samples.torus(n_around=48, n_across=24)
        >>> phi = sh.piecewise_distance(torus.path(range(24), closed=True), torus)  # round the tube: bounds nothing
        >>> len(phi.domain.cuts(phi.values))
        1
        """
        pairs = np.flatnonzero(self.is_cut)
        height = np.abs(self.jumps(values)[pairs])
        edges, first, numbers = np.unique(self.pairs.edges[pairs], return_index=True, return_inverse=True)
        largest = np.zeros((len(first), 2))
        np.maximum.at(largest, numbers, height)
        lengths = self.triangles.lengths_of_edges
        ids, lines = self.triangles.edges.vertices[edges], []
        for chain, backwards, _ in assemble_polylines(ids[:, 0], ids[:, 1], directed=False):
            ends, jumps = (
                np.where(backwards[:, None], pairs[chain][:, ::-1], pairs[chain]) for pairs in (ids, largest)
            )
            vertices = np.concatenate([ends[:, 0], ends[-1:, 1]])
            lines.append(Cut(vertices, self.triangulation.vertices[vertices], jumps, lengths[edges[chain]]))
        return sorted(lines, key=lambda line: -line.length)

    @cached_property
    def split_vertices(self) -> tuple[Ints, Ints]:
        """Vertices of the surface cut open: (3m,) the vertex at each corner, and (n,) the original of each vertex."""
        owner = split_corners(self.triangles, self.pairs, self.is_cut)
        _, first = np.unique(owner, return_index=True)
        return owner, self.triangulation.faces.ravel()[first]

    def means(self, values: Floats) -> Floats:
        """Average the values of a field over the corners at each vertex of the surface cut open.

        Parameters
        ----------
        values : (m, 3) float
            Values of the field at the corners of the triangles, as in `Field.values`.

        Returns
        -------
        (n,) float
            Mean value at each vertex of `split_vertices`.

        See Also
        --------
        results.CutSurface.jumps : How far the averaged values are apart.

        Examples
        --------
        >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> CutSurface(mesh, mesh.intrinsic, np.array([True])).means(np.array([[1.0] * 3, [0.0] * 3])).tolist()
        [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
        """
        owner, _ = self.split_vertices
        return np.bincount(owner, values.ravel()) / np.bincount(owner)

    @property
    def _values_shape(self) -> tuple[int, ...]:
        return (self.triangles.n_faces, 3)

    def _interpolant(self, values: Floats, beyond: Exact | None) -> CutInterpolant:
        """Return the interpolant of (m, 3) values at the corners of faces, which is linear in faces."""
        return CutInterpolant(self, values)

    def _level_set(self, values: Floats, level: float, exact: Exact | None) -> list[Curve]:
        """Return a level set of (m, 3) values at the corners of faces, as curves on a mesh doubled along the cut."""
        mesh, at_vertices = self._plain(values)
        return mesh._level_set(at_vertices, level, exact)

    def _expanded(self, values: Floats, beyond: Exact | None) -> tuple[TriangleMesh | PolygonMesh, Floats]:
        """Return a mesh that is doubled along the cut, and (n,) values at its vertices."""
        return self._plain(values)

    def _plain(self, values: Floats) -> tuple[TriangleMesh | PolygonMesh, Floats]:
        """Return a mesh whose vertices are doubled along the cut, and the (n,) mean values at its vertices."""
        if isinstance(self.surface, IntrinsicTriangulation):
            return self._in_space(self.surface, values)
        owner, vertices = self.split_vertices
        mesh = TriangleMesh(self.triangulation.vertices[vertices], owner.reshape(-1, 3))
        return mesh, self.means(values)

    def _in_space(self, surface: IntrinsicTriangulation, phi: Floats) -> tuple[PolygonMesh, Floats]:
        """Move a field to the common subdivision of a triangulation and its mesh, with vertices doubled along the cut.

        `phi` are values at the corners of the triangles, (m, 3). Returns the polygons and the values at their vertices.
        """
        triangles, n = self.triangles, surface.n_vertices
        polygons, owners, edge_crossings = subdivided(surface)
        sizes = [len(polygon) for polygon in polygons]
        node, face = np.concatenate(polygons), np.repeat(owners, sizes)
        at_vertices, at_crossings = np.flatnonzero(node < n), np.flatnonzero(node >= n)  # corners of polygons

        # values at all corners, and keys: corners with the same key become one vertex
        owner = self.split_vertices[0]
        at_corners = self.means(phi)[owner].reshape(-1, 3)
        corner = 3 * face[at_vertices] + (
            triangles.corner_vertices[face[at_vertices]] == node[at_vertices, None]
        ).argmax(axis=1)
        places = edge_crossings[node[at_crossings] - n]
        on_cut = mask_of(triangles.n_edges, self.pairs.edges[self.is_cut])
        values, keys = np.empty(len(node)), np.zeros((len(node), 2), dtype=np.int64)
        values[at_vertices], keys[at_vertices, 1] = at_corners.ravel()[corner], owner[corner]
        weights = barycentric_in(triangles, face[at_crossings], places)
        values[at_crossings] = (at_corners[face[at_crossings]] * weights).sum(axis=1)
        keys[at_crossings, 0] = 1 + node[at_crossings]
        keys[at_crossings, 1] = np.where(on_cut[places.elements], face[at_crossings], -1)

        # a vertex for each key, and the polygons between these
        _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        space = np.concatenate([surface.vertices, positions(surface, edge_crossings)])
        ends = np.cumsum([0, *sizes])
        mesh = PolygonMesh(space[node[first]], [vertex[a:b] for a, b in pairwise(ends)])
        return mesh, values[first]

    def __repr__(self) -> str:
        lines = len(self.cuts(np.zeros((self.triangles.n_faces, 3))))
        return f"CutSurface({self.surface!r}, {counted(lines, 'cut')})"


@dataclass(frozen=True, eq=False)
class CutInterpolant:
    """Linear interpolation in each triangle of a cut surface.

    A point on an edge gets the value of the triangle in which it is given, since values may jump there.
    """

    domain: CutSurface
    values: Floats  # (m, 3) at the corners of the triangles

    def __call__(self, points: Any) -> Floats:
        """Return (...) values at (..., 3) points, a `Curve` or `SurfacePoints`."""
        faces, weights, shape = placed(self._mesh, points)
        if isinstance(self.domain.surface, IntrinsicTriangulation):
            faces, weights = self.domain.surface.locate(faces, weights)
            return shaped((self.values[faces] * weights).sum(axis=1), shape)
        places = locate_points(self.domain.triangles, faces, weights)
        return shaped((self.values[places.faces] * places.barycentric).sum(axis=1), shape)

    def gradient(self, points: Any) -> Floats:
        """Return (..., 3) gradients, as vectors in space, at (..., 3) points, or those of a `Curve` or `SurfacePoints`.

        Triangles of an intrinsic triangulation are not flat in space: it finds the gradients itself.
        """
        faces, weights, shape = placed(self._mesh, points)
        if isinstance(self.domain.surface, IntrinsicTriangulation):
            return shaped(self.domain.surface.gradient(self.values, faces, weights), shape)
        places = locate_points(self.domain.triangles, faces, weights)
        return shaped(self.cell_gradients[places.faces], shape)

    @property
    def _mesh(self) -> TriangleMesh:
        """The triangle mesh in space in which points are located."""
        surface = self.domain.surface
        return surface.mesh if isinstance(surface, IntrinsicTriangulation) else surface.triangulation

    @cached_property
    def cell_gradients(self) -> Floats:
        """Constant gradient in each of the m triangles, a vector in space, (m, 3) float."""
        surface = self.domain.triangulation
        if isinstance(surface, IntrinsicTriangulation):
            raise GeometryError(
                "the triangles of an intrinsic triangulation are not flat in space, so φ has no one gradient in each",
                remedy="use gradient(points), or expand().cell_gradients",
            )
        corners = surface.vertices[surface.faces]
        return gradients_along(corners[:, 1:] - corners[:, :1], self.values[:, 1:] - self.values[:, :1])
