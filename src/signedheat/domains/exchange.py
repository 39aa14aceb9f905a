"""What all shapes share: files, and the objects of other packages."""

from __future__ import annotations

from os import PathLike
from typing import Any, TypeVar

from ..slots import Slot

Shape = TypeVar("Shape", bound="Exchangeable")

save_shape: Slot[[Any, str | PathLike[str]], None] = Slot("save_shape")
"""Write a shape in the format that the file's name ends with."""
shape_from: Slot[[str, type, Any], Any] = Slot("shape_from")
"""A shape of a given type from an object of a package, named first."""
shape_to: Slot[[str, Any], Any] = Slot("shape_to")
"""An object of a package, named first, from a shape."""


class Exchangeable:
    """A shape that can be saved, and turned into what trimesh, PyVista and meshio use.

    Vertices and faces keep their number and order. Each package is optional, imported when it is asked for.
    """

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format that its name ends with: see `signedheat.save`."""
        save_shape(self, path)

    @classmethod
    def from_trimesh(cls: type[Shape], thing: Any) -> Shape:
        """From a `trimesh.Trimesh` or `trimesh.PointCloud`."""
        return shape_from("trimesh", cls, thing)

    def to_trimesh(self) -> Any:
        """As a `trimesh.Trimesh`, not processed, or `trimesh.PointCloud`; polygons raise `GeometryError`."""
        return shape_to("trimesh", self)

    @classmethod
    def from_pyvista(cls: type[Shape], thing: Any) -> Shape:
        """From a `pyvista.PolyData`; point data ``Normals`` are the normals of points."""
        return shape_from("pyvista", cls, thing)

    def to_pyvista(self) -> Any:
        """As a `pyvista.PolyData`; the normals of points are point data ``Normals``."""
        return shape_to("pyvista", self)

    @classmethod
    def from_meshio(cls: type[Shape], thing: Any) -> Shape:
        """From the triangles, quadrilaterals and polygons, or the points, of a `meshio.Mesh`."""
        return shape_from("meshio", cls, thing)

    def to_meshio(self) -> Any:
        """As a `meshio.Mesh`; the normals of points are point data ``nx``, ``ny``, ``nz``."""
        return shape_to("meshio", self)
