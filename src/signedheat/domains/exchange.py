"""What all shapes share: files, and the objects of other packages."""

from __future__ import annotations

from os import PathLike
from typing import Any, TypeVar

Shape = TypeVar("Shape", bound="Exchangeable")


class Exchangeable:
    """A shape that can be saved, and turned into what trimesh, PyVista and meshio use.

    Vertices and faces keep their number and order. Each package is optional, imported when it is asked for.
    """

    def save(self, path: str | PathLike[str]) -> None:
        """Write to a file, in the format that its name ends with: see `signedheat.io.save`."""
        from ..io import save

        save(self, path)

    @classmethod
    def from_trimesh(cls: type[Shape], thing: Any) -> Shape:
        """From a `trimesh.Trimesh` or `trimesh.PointCloud`."""
        from ..io.interop import from_trimesh

        return from_trimesh(cls, thing)

    def to_trimesh(self) -> Any:
        """As a `trimesh.Trimesh`, not processed, or `trimesh.PointCloud`; polygons raise `GeometryError`."""
        from ..io.interop import to_trimesh

        return to_trimesh(self)

    @classmethod
    def from_pyvista(cls: type[Shape], thing: Any) -> Shape:
        """From a `pyvista.PolyData`; point data ``Normals`` are the normals of points."""
        from ..io.interop import from_pyvista

        return from_pyvista(cls, thing)

    def to_pyvista(self) -> Any:
        """As a `pyvista.PolyData`; the normals of points are point data ``Normals``."""
        from ..io.interop import to_pyvista

        return to_pyvista(self)

    @classmethod
    def from_meshio(cls: type[Shape], thing: Any) -> Shape:
        """From the triangles, quadrilaterals and polygons, or the points, of a `meshio.Mesh`."""
        from ..io.interop import from_meshio

        return from_meshio(cls, thing)

    def to_meshio(self) -> Any:
        """As a `meshio.Mesh`; the normals of points are point data ``nx``, ``ny``, ``nz``."""
        from ..io.interop import to_meshio

        return to_meshio(self)
