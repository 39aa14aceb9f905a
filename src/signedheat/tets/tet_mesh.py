"""Tet meshes: volumes in space, convex or not, manifold or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Frozen, Ints
from ..errors import GeometryError, counted
from ..fields.field_domain import Exact, FieldDomain
from ..mesh.components import element_components
from ..mesh.tet_shapes import FaceTable, Tetrahedra, signed_volumes
from ..packages import lazy_module
from ..search.nearest_triangles import TriangleTree
from ..shapes.exchange import Displayed, shapes, tets_of_meshio, tets_of_pyvista
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import coordinates, element_ids, frozen, query_points, shaped, used_bounds
from .tet_clipping import Planes, barycentric, containing_tets
from .tet_levels import closed_level_set

if TYPE_CHECKING:
    import meshio
    import pyvista
else:
    meshio = lazy_module("meshio", "objects of meshio")
    pyvista = lazy_module("pyvista", "objects of PyVista")


@dataclass(frozen=True, eq=False)
class TetMesh(Displayed, Frozen, FieldDomain):
    """Tetrahedra in space.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions; vertices that no tet uses are allowed.
    tets : (m, 4) int
        Vertex ids of each tet. Seen from the first corner, the other three run clockwise if the volume is positive.
        Tets with negative volume are flipped, by swapping their last two corners, and listed in `reoriented`. Flat tets
        are allowed.

    Attributes
    ----------
    reoriented : (k,) int
        Tets that were given with negative volume.

    Raises
    ------
    GeometryError
        If there is no tet, a coordinate is NaN or infinite, a tet names a vertex that does not exist, or no tet has
        any volume.

    See Also
    --------
    tetrahedralize : Fill a shape with tets.
    Field : Values on a domain.

    Examples
    --------
    >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 3, 2]])
    >>> mesh.tets, mesh.reoriented
    (array([[0, 1, 2, 3]]), array([0]))
    >>> mesh.boundary.n_faces
    4
    """

    vertices: Floats
    tets: Ints
    reoriented: Ints

    def __init__(self, vertices: ArrayLike, tets: ArrayLike) -> None:
        positions = coordinates(vertices, "vertices", 3)
        ids = element_ids(tets, "tets", 4, len(positions))
        volumes = signed_volumes(positions, ids)
        if not volumes.any():
            raise GeometryError(
                f"none of the {counted(len(ids), 'tet')} has any volume: the vertices lie in one plane or point",
                element="vertices",
            )
        inside_out = np.flatnonzero(volumes < 0)
        if len(inside_out):
            ids = ids.copy()
            ids[inside_out] = ids[inside_out][:, [0, 1, 3, 2]]
        vars(self).update(vertices=positions, tets=frozen(ids), reoriented=frozen(inside_out))

    @property
    def n_vertices(self) -> int:
        """Number of vertices, used by a tet or not."""
        return len(self.vertices)

    @property
    def n_tets(self) -> int:
        """Number of tets."""
        return len(self.tets)

    @cached_property
    def geometry(self) -> Tetrahedra:
        """Areas, volumes and operators of the tets."""
        return Tetrahedra(self.vertices, self.tets)

    @property
    def faces(self) -> FaceTable:
        """The triangular faces of the tets."""
        return self.geometry.faces

    @property
    def tet_volumes(self) -> Floats:
        """(m,) volumes, in cubic units."""
        return self.geometry.volumes

    @cached_property
    def tet_barycenters(self) -> Floats:
        """(m, 3) barycentres."""
        return self.vertices[self.tets].mean(axis=1)

    @cached_property
    def boundary(self) -> TriangleMesh:
        """The faces with a single tet, facing outwards, on the vertices of this mesh."""
        return TriangleMesh(self.vertices, self.faces.vertices[self.faces.tet_counts == 1])

    @cached_property
    def parts(self) -> Ints:
        """(m,) connected component of each tet, connected by shared faces."""
        return element_components(self.faces.tet_faces)

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the bounding box of the tets, without unreferenced vertices."""
        return used_bounds(self.vertices, self.tets)

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension.

        Parameters
        ----------
        path : str or path
            ``.mesh``, ``.msh``, ``.vtu``, ``.vtk``, or ``.node``, beside which a ``.ele`` file is written.

        Raises
        ------
        FileFormatError
            If the format is another, or the file cannot be written.
        MissingPackageError
            If meshio is not installed.

        See Also
        --------
        read : Read a file.
        Field.save : Write a field on tets.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]).save(f"{folder}/one.vtu")
        ...     sh.read(f"{folder}/one.vtu").n_tets
        1
        """
        shapes.save(self, path)

    @classmethod
    def from_meshio(cls, mesh: meshio.Mesh) -> TetMesh:
        """Convert the tets of a mesh of meshio; its polygons, lines and vertex cells (single points) are left out.

        Parameters
        ----------
        mesh : meshio.Mesh
            A mesh with cells of the type ``"tetra"``.

        Returns
        -------
        TetMesh
            Its points, and its tets.

        Raises
        ------
        GeometryError
            If it has no tets, other cells with a volume, or tets of other than four corners.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> tet = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetMesh.from_meshio(tet.to_meshio()).n_tets
        1
        """
        return cls(mesh.points, tets_of_meshio(mesh))

    def to_meshio(self, point_data: Mapping[str, Floats] | None = None) -> meshio.Mesh:
        """Convert to meshio.

        Parameters
        ----------
        point_data : mapping, optional
            Arrays with one row for each vertex, by name.

        Returns
        -------
        meshio.Mesh
            The vertices, and cells of the type ``"tetra"``.

        Raises
        ------
        MissingPackageError
            If meshio is not installed.

        See Also
        --------
        TetMesh.from_meshio : The other way.

        Examples
        --------
        >>> TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]).to_meshio().cells[0].type
        'tetra'
        """
        return meshio.Mesh(self.vertices, [("tetra", self.tets)], point_data=point_data)

    @classmethod
    def from_pyvista(cls, grid: pyvista.UnstructuredGrid) -> TetMesh:
        """Convert the tets of a grid of PyVista; its polygons, lines and vertex cells (single points) are left out.

        Parameters
        ----------
        grid : pyvista.UnstructuredGrid
            A grid with cells of the type ``TETRA``.

        Returns
        -------
        TetMesh
            Its points, and its tets.

        Raises
        ------
        GeometryError
            If it has no tets, or other cells with a volume.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> tet = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetMesh.from_pyvista(tet.to_pyvista()).n_tets
        1
        """
        return cls(grid.points, tets_of_pyvista(grid))

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        return pyvista.UnstructuredGrid({10: np.array(self.tets)}, np.array(self.vertices))

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """A field has one value for each vertex."""
        return (self.n_vertices,)

    def _interpolant(self, values: Floats, beyond: Exact | None) -> TetInterpolant:
        """Return the function that interpolates (n,) values to second order."""
        return TetInterpolant(self, values)

    def _level_set(self, values: Floats, level: float, exact: Exact | None) -> TriangleMesh:
        """Extract a level set of (n,) values as a mesh that is closed along the boundary."""
        gradients = self.geometry.mean_gradients(values, self.tets, self.n_vertices)
        return TriangleMesh(*closed_level_set(self.geometry, values, gradients, level))

    def _values_at_walls(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values at the vertices of the boundary."""
        return values[np.unique(self.boundary.faces)]

    @cached_property
    def _planes(self) -> Planes:
        """The planes of the faces, by which points are located in tets."""
        return Planes.of(self.geometry)

    @cached_property
    def _wall_tree(self) -> TriangleTree:
        """Search tree over the faces of the boundary."""
        return TriangleTree.of(self.vertices[self.boundary.faces])

    def __repr__(self) -> str:
        return f"TetMesh({counted(self.n_vertices, 'vertex')}, {counted(self.n_tets, 'tet')})"


@dataclass(frozen=True, eq=False)
class TetInterpolant:
    """Interpolation of second order, from values and gradients at the corners of tets.

    Outside the mesh, values are extrapolated linearly from the nearest point of the boundary.
    """

    mesh: TetMesh
    values: Floats  # at the vertices, NaN where there are none

    def __call__(self, points: ArrayLike) -> Floats:
        """(...) values at (..., 3) points; NaN where the nearest tet has a vertex without a value."""
        queries, shape = query_points(points, 3)
        corners, weights, away = self._located(queries)
        steps = (queries - away)[:, None] - self.mesh.vertices[corners]
        tangents = self.values[corners] + np.einsum("pki,pki->pk", self._vertex_gradients[corners], steps) / 2
        values = np.einsum("pk,pk->p", weights, tangents)
        outside = np.flatnonzero(away.any(axis=1))
        if len(outside):
            slopes = np.einsum("pk,pki->pi", weights[outside], self._vertex_gradients[corners[outside]])
            values[outside] += np.einsum("pi,pi->p", slopes, away[outside])
        return shaped(values, shape)

    def gradient(self, points: ArrayLike) -> Floats:
        """(..., 3) volume-weighted means of gradients at the vertices, interpolated; outside, at the nearest point."""
        queries, shape = query_points(points, 3)
        corners, weights, _ = self._located(queries)
        return shaped(np.einsum("pk,pki->pi", weights, self._vertex_gradients[corners]), shape)

    @property
    def cell_gradients(self) -> Floats:
        """(m, 3) gradient of the linear interpolant in each tet."""
        return self.mesh.geometry.gradients(self.values[self.mesh.tets])

    @cached_property
    def _vertex_gradients(self) -> Floats:
        """(n, 3) volume-weighted means at the vertices of the gradients in tets."""
        return self.mesh.geometry.mean_gradients(self.values, self.mesh.tets, self.mesh.n_vertices)

    def _located(self, points: Floats) -> tuple[Ints, Floats, Floats]:
        """Find the closest points of the mesh to (k, 3) points, and the vectors from there.

        Return (k, 4) vertices around each closest point, (k, 4) their weights, and (k, 3) vectors, 0 for points inside.
        """
        mesh = self.mesh
        tets = containing_tets(mesh.geometry, mesh._planes, points)
        inside, outside = np.flatnonzero(tets >= 0), np.flatnonzero(tets < 0)
        corners = np.zeros((len(points), 4), dtype=np.int64)
        weights, away = np.zeros((len(points), 4)), np.zeros((len(points), 3))
        corners[inside] = mesh.tets[tets[inside]]
        weights[inside] = barycentric(mesh.geometry, tets[inside], points[inside])
        if len(outside):
            walls = mesh.boundary
            faces, coordinates = mesh._wall_tree.nearest(points[outside])
            corners[outside, :3], weights[outside, :3] = walls.faces[faces], coordinates
            corners[outside, 3] = corners[outside, 0]
            nearest = np.einsum("pk,pki->pi", coordinates, walls.vertices[walls.faces[faces]])
            away[outside] = points[outside] - nearest
        return corners, weights, away
