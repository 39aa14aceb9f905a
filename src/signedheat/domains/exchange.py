"""Saving of shapes, and conversion from and to the objects of other packages."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..slots import Slot
from .display import Displayed

if TYPE_CHECKING:
    import meshio
    import open3d
    import pyvista

Kind = TypeVar("Kind", bound="Exchangeable[Any]")
Trimesh = TypeVar("Trimesh")
"""The type of trimesh that corresponds to a kind of shape."""

save_shape: Slot[[object, str | PathLike[str]], None] = Slot("save_shape")
"""Write a shape in the format given by the extension of the file."""
shape_from: Slot[[str, type[object] | None, object], Any] = Slot("shape_from")
"""Arguments: name of a package, type of a shape or None for that which fits, object of that package."""
shape_to: Slot[[str, object], Any] = Slot("shape_to")
"""Arguments: name of a package, shape. Returns an object of that package."""


class Exchangeable(Displayed, Generic[Trimesh]):
    """A shape that can be saved, and converted from and to objects of trimesh, PyVista, meshio and Open3D.

    Vertices and faces keep their number and order. Each package is optional, and imported when it is needed.
    """

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format given by its extension: see `signedheat.save`."""
        save_shape(self, path)

    @classmethod
    def from_trimesh(cls: type[Kind], thing: object) -> Kind:
        """From a `trimesh.Trimesh`, `trimesh.PointCloud` or the meshes of a `trimesh.Scene`, in their places.

        Raises
        ------
        SignedHeatError
            If it holds nothing of this kind, such as lines alone, or polygons for a mesh of triangles.
        """
        shape: Kind = shape_from("trimesh", cls, thing)
        return shape

    def to_trimesh(self) -> Trimesh:
        """As a `trimesh.Trimesh`, not processed, or `trimesh.PointCloud`; polygons raise `GeometryError`."""
        thing: Trimesh = shape_to("trimesh", self)
        return thing

    @classmethod
    def from_pyvista(cls: type[Kind], thing: object) -> Kind:
        """From a `pyvista.PolyData`, or the faces, or else the boundary of the tets, of a `pyvista.UnstructuredGrid`.

        Point data ``Normals`` are the normals of points; the parts of a `pyvista.MultiBlock` become one shape.

        Raises
        ------
        SignedHeatError
            If it holds nothing of this kind, such as cells of a volume other than tets.
        """
        shape: Kind = shape_from("pyvista", cls, thing)
        return shape

    def to_pyvista(self) -> pyvista.PolyData:
        """As a `pyvista.PolyData`; the normals of points are point data ``Normals``."""
        thing: pyvista.PolyData = shape_to("pyvista", self)
        return thing

    @classmethod
    def from_meshio(cls: type[Kind], thing: object) -> Kind:
        """From the triangles, quadrilaterals and polygons, or the points, of a `meshio.Mesh`."""
        shape: Kind = shape_from("meshio", cls, thing)
        return shape

    def to_meshio(self) -> meshio.Mesh:
        """As a `meshio.Mesh`; the normals of points are point data ``nx``, ``ny``, ``nz``."""
        return shape_to("meshio", self)

    @classmethod
    def from_open3d(cls: type[Kind], thing: object) -> Kind:
        """From a `TriangleMesh` or `PointCloud` of Open3D, of ``open3d.geometry`` or ``open3d.t.geometry``."""
        shape: Kind = shape_from("open3d", cls, thing)
        return shape

    def to_open3d(self) -> open3d.geometry.Geometry:
        """As a `TriangleMesh` or `PointCloud` of ``open3d.geometry``; polygons raise `GeometryError`."""
        thing: open3d.geometry.Geometry = shape_to("open3d", self)
        return thing
