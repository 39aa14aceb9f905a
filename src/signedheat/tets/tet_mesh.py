"""Tet meshes: volumes in space, convex or not, manifold or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen, Ints
from ..errors import GeometryError
from ..exchange import Displayed, shapes, tets_of_meshio, tets_of_pyvista
from ..mesh.components import element_components
from ..mesh.tet_shapes import FaceTable, Tetrahedra, signed_volumes
from ..packages import lazy_module
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import coordinates, element_ids, frozen, used_bounds
from ..words import counted

if TYPE_CHECKING:
    import meshio
    import pyvista
else:
    meshio = lazy_module("meshio", "objects of meshio")
    pyvista = lazy_module("pyvista", "objects of PyVista")


@dataclass(frozen=True, eq=False)
class TetMesh(Displayed, Frozen):
    """Tetrahedra in space.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions; vertices that no tet uses are allowed.
    tets : (m, 4) int
        Vertex ids. As seen from the first corner the other three run clockwise if the volume is positive; tets with
        negative volume are turned (their last two corners swapped) and listed in `reoriented`. Flat tets are allowed.

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
    TetField : Values on tets.

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
        """(m,) volumes."""
        return self.geometry.volumes

    @cached_property
    def tet_barycenters(self) -> Floats:
        """(m, 3) barycentres."""
        return self.vertices[self.tets].mean(axis=1)

    @cached_property
    def boundary(self) -> TriangleMesh:
        """The faces with a single tet, oriented outward, on the vertices of this mesh."""
        return TriangleMesh(self.vertices, self.faces.vertices[self.faces.tet_counts == 1])

    @cached_property
    def parts(self) -> Ints:
        """(m,) connected component of each tet, through shared faces."""
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
        """Convert the tets of a mesh of meshio; its faces, lines and vertices are left out.

        Parameters
        ----------
        mesh : meshio.Mesh
            With cells ``"tetra"``.

        Returns
        -------
        TetMesh
            Its points, and its tets.

        Raises
        ------
        GeometryError
            If it has no tets, other cells with a volume, or tets of other than four corners.

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
            Arrays at the vertices, by name.

        Returns
        -------
        meshio.Mesh
            With cells ``"tetra"``.

        Raises
        ------
        MissingPackageError
            If meshio is not installed.

        Examples
        --------
        >>> TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]).to_meshio().cells[0].type
        'tetra'
        """
        return meshio.Mesh(self.vertices, [("tetra", self.tets)], point_data=point_data)

    @classmethod
    def from_pyvista(cls, grid: pyvista.UnstructuredGrid) -> TetMesh:
        """Convert the tets of a grid of PyVista; its faces, lines and vertices are left out.

        Parameters
        ----------
        grid : pyvista.UnstructuredGrid
            With cells of the type ``TETRA``.

        Returns
        -------
        TetMesh
            Its points, and its tets.

        Raises
        ------
        GeometryError
            If it has no tets, or other cells with a volume.

        Examples
        --------
        >>> tet = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> TetMesh.from_pyvista(tet.to_pyvista()).n_tets
        1
        """
        return cls(grid.points, tets_of_pyvista(grid))

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        return pyvista.UnstructuredGrid({10: np.array(self.tets)}, np.array(self.vertices))

    def __repr__(self) -> str:
        return f"TetMesh({counted(self.n_vertices, 'vertex')}, {counted(self.n_tets, 'tet')})"
