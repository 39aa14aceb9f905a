"""Conversion of shapes to and from objects of trimesh, PyVista, meshio and Open3D, and pictures of shapes and fields.

All conversions go through `Elements`, with positions, faces, normals of points, or tets. Vertices and faces keep their
number and order in both directions. Each package is imported only when it is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..errors import GeometryError, UnsupportedTypeError
from ..mesh.components import members_of
from ..mesh.tet_shapes import face_table, signed_volumes
from ..packages import lazy_module
from ..validation import array_of, coordinates, element_ids, refuse_other_layout

ACCEPTED_SHAPES = "a shape of signedheat, trimesh, PyVista, meshio or Open3D, or a pair (vertices, faces)"
"""Description, for error messages, of the objects that functions accept as a shape."""

if TYPE_CHECKING:
    import meshio
    import open3d
    import pyvista
else:
    meshio = lazy_module("meshio", "objects of meshio")
    open3d = lazy_module("open3d", "objects of Open3D")
    pyvista = lazy_module("pyvista", "objects of PyVista")
trimesh: Any = lazy_module("trimesh", "objects of trimesh")
shapes: Any = lazy_module("signedheat.io.shape_files", "files")
drawing: Any = lazy_module("signedheat.view.drawing", "pictures")
windows: Any = lazy_module("signedheat.view.windows", "windows")

Kind = TypeVar("Kind", bound="Exchangeable[Any]")
Trimesh = TypeVar("Trimesh")
"""The type of trimesh that corresponds to a kind of shape."""
VALUES_NAME = "signed_distance"
"""Name of the values of a field in objects of PyVista and in files."""
CELL_SIDES = {"triangle": 3, "quad": 4}
"""Number of sides of faces by meshio's type of cell; other polygons have the type ``polygon``."""
_VTK_FACES = (5, 7, 9)
"""VTK's types of cells that are faces: triangle, polygon and quadrilateral; `_VTK_TETRA` is its type of tets."""
_VTK_TETRA = 10
FLAT_CELLS = ("vertex", "line", "triangle", "quad", "polygon")
"""Prefixes of meshio's names for cells without volume. A mesh of tets may hold such cells, which are left out."""


def with_values(thing: Any, values: NDArray[np.floating]) -> Any:
    """Set the values of a field at the points of an object of PyVista, as its active scalars, and return the object."""
    thing.point_data[VALUES_NAME] = np.array(values)
    thing.set_active_scalars(VALUES_NAME)
    return thing


class Displayed:
    """Base class of shapes and fields, which can be converted to PyVista and shown."""

    def to_pyvista(self) -> pyvista.DataSet:
        """Convert this object to a PyVista data set.

        Returns
        -------
        pyvista.DataSet
            `pyvista.PolyData` for triangles, polygons, lines or points, `pyvista.ImageData` for grids, and
            `pyvista.UnstructuredGrid` for tets. The point data ``signed_distance`` holds values of a field, and
            ``Normals`` the normals of points. Lines and grids in the plane have z = 0. A solid is converted by its
            boundary, voxels by their faces, an intrinsic triangulation by its mesh, and a cut surface by the mesh of
            `Field.expand`, on which jumps are visible.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.

        See Also
        --------
        Solid.plotter : A picture of it, to which more can be added.

        Examples
        --------
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(1)
        >>> ball.to_pyvista().n_cells
        80
        >>> sh.SignedHeatSolver(ball).distance(ball.points_at(0)).to_pyvista().array_names
        ['signed_distance']
        """
        raise NotImplementedError

    def plotter(self) -> pyvista.Plotter:
        """Draw this object into a new `pyvista.Plotter`, which can be shown, extended, or saved as a picture.

        Fields are blue where distance is negative, orange where it is positive, and light at zero. The surface or line
        of distance zero is drawn, too. Outer sides of shapes are light, and inner sides are red.

        Returns
        -------
        pyvista.Plotter
            The plotter, which has not been shown yet.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed (``pip install pyvista``).

        See Also
        --------
        Solid.plot : Show it at once.

        Examples
        --------
        >>> from signedheat import samples
        >>> samples.sphere(1).plotter().export_html("ball.html")  # doctest: +SKIP
        """
        return windows.plotter_of(self)

    def plot(self) -> object:
        """Show this object in a window or a notebook, with PyVista.

        In a notebook, the view can be rotated if trame is installed.

        Returns
        -------
        object
            The result of `pyvista.Plotter.show`, which is None for a window, and the displayed object in a notebook.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed (``pip install pyvista``).

        See Also
        --------
        Solid.plotter : The same, as a plotter to add to.

        Examples
        --------
        >>> from signedheat import samples
        >>> samples.broken_duck().plot()  # doctest: +SKIP
        """
        return self.plotter().show()

    def _repr_html_(self) -> str:
        """Return the HTML that notebooks show for this object."""
        return drawing.html_of(self)


def _no_ids() -> Ints:
    """Return an empty array of ids."""
    return np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Elements:
    """A shape as plain arrays, the form in which it is passed from one package to another."""

    points: NDArray[Any]  # (n, 3) vertices, or the points of a cloud
    corners: Ints = field(default_factory=_no_ids)  # vertex ids of all faces, one face after another
    counts: Ints = field(default_factory=_no_ids)  # (m,) number of corners of each face; a cloud and tets have no faces
    normals: NDArray[Any] | None = None  # (n, 3) normals of points
    tets: Ints | None = None  # (t, 4) vertex ids
    areas: NDArray[Any] | None = None  # (n,) areas of points
    values: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # further numbers at the points, by name

    @classmethod
    def of_triangles(cls, points: NDArray[Any], faces: Any, normals: NDArray[Any] | None = None) -> Elements:
        """Make the elements of a mesh with faces of three vertex ids, or of a cloud if there are no faces."""
        rows = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
        return cls(points, rows.ravel(), np.full(len(rows), 3), normals)

    @property
    def kind(self) -> str:
        """Name of the class of shapes that fits these elements, such as "TriangleMesh"."""
        if self.tets is not None:
            return "TetMesh"
        if not len(self.counts):
            return "PointCloud"
        return "TriangleMesh" if (self.counts == 3).all() else "PolygonMesh"

    @property
    def faces(self) -> list[Ints]:
        """Vertex ids of each face; for tets, of each outer face."""
        if self.tets is not None:
            return list(outer_faces(self.points, self.tets))
        return np.split(self.corners, np.cumsum(self.counts)[:-1]) if len(self.counts) else []

    @property
    def triangles(self) -> Ints:
        """Vertex ids of the faces, which must be triangles, or of the outer faces of tets, (m, 3) int."""
        if self.tets is not None:
            return outer_faces(self.points, self.tets)
        wrong = np.flatnonzero(self.counts != 3)
        if len(wrong):
            raise GeometryError(
                f"face {wrong[0]} has {self.counts[wrong[0]]} corners, not 3",
                remedy="use PolygonMesh instead",
                element=f"face {wrong[0]}",
            )
        return self.corners.reshape(-1, 3)


def outer_faces(points: NDArray[Any], tets: Ints) -> Ints:
    """Return the (m, 3) vertex ids of the faces that belong to one tet only, oriented outward."""
    ids = element_ids(tets, "tets", 4, len(points))
    oriented = np.where(signed_volumes(coordinates(points, "vertices", 3), ids)[:, None] < 0, ids[:, [0, 1, 3, 2]], ids)
    table = face_table(oriented)
    return table.vertices[table.tet_counts == 1]


class Exchangeable(Displayed, Generic[Trimesh]):
    """Base class of shapes that can be saved, and converted from and to objects of trimesh, PyVista, meshio and Open3D.

    Vertices and faces keep their number and order. Each package is optional, and imported when it is needed.

    Raises
    ------
    MissingPackageError
        If the package of a conversion is not installed.
    GeometryError, UnsupportedTypeError
        If an object holds nothing of this kind, such as lines alone, or polygons for a mesh of triangles; or if a shape
        with polygons is converted to trimesh or Open3D, which have triangles only.
    """

    _has_faces = True

    @classmethod
    def _of(cls: type[Kind], elements: Elements) -> Kind:
        """Make the shape with these elements."""
        raise NotImplementedError

    @property
    def _elements(self) -> Elements:
        """The arrays of this shape."""
        raise NotImplementedError

    def save(self, path: str | PathLike[str]) -> None:
        """Write this shape to a file, in the format given by its extension, as `signedheat.save` does.

        Parameters
        ----------
        path : str or path
            A file with the extension ``.stl``, ``.obj``, ``.ply``, ``.off`` or ``.vtp``, or for points also ``.xyz`` or
            ``.pc``.

        Raises
        ------
        FileFormatError
            If the format is not one of these, or cannot hold such a shape, or the file cannot be written.

        See Also
        --------
        save : Formats, and what each keeps.
        read : Read a file.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     sh.samples.sphere(1).save(f"{folder}/ball.ply")
        ...     sh.read(f"{folder}/ball.ply")
        TriangleMesh(42 vertices, 80 faces)
        """
        shapes.save(self, path)

    @classmethod
    def from_trimesh(cls: type[Kind], thing: object) -> Kind:
        """Convert a mesh, a cloud or a scene of trimesh to a shape.

        Parameters
        ----------
        thing : object
            A `trimesh.Trimesh`, a `trimesh.PointCloud`, or a `trimesh.Scene`, all meshes of which are joined at their
            positions in the scene.

        Returns
        -------
        TriangleMesh, PolygonMesh or PointCloud
            A shape of the class on which this was called, with the same coordinates.

        Raises
        ------
        UnsupportedTypeError
            If `thing` is no such object of trimesh.
        GeometryError
            If it has no faces and the class needs them, or a coordinate is not finite.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> import trimesh
        >>> import signedheat as sh
        >>> sh.TriangleMesh.from_trimesh(trimesh.creation.box())
        TriangleMesh(8 vertices, 12 faces)
        """
        return cls._of(from_trimesh(thing))

    def to_trimesh(self) -> Trimesh:
        """Convert this shape to an object of trimesh.

        Returns
        -------
        trimesh.Trimesh or trimesh.PointCloud
            A mesh, or a cloud if there are no faces, with the same vertices and faces in the same order.

        Raises
        ------
        MissingPackageError
            If trimesh is not installed.
        GeometryError
            If faces have more than three corners.

        See Also
        --------
        as_shape : The other way.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.samples.sphere(1).to_trimesh().is_watertight
        True
        """
        shape = self._elements
        if not len(shape.counts):
            return trimesh.PointCloud(np.array(shape.points))
        return trimesh.Trimesh(np.array(shape.points), _triangles_only(shape, "trimesh"), process=False)

    @classmethod
    def from_pyvista(cls: type[Kind], thing: object) -> Kind:
        """Convert a surface, points, or the boundary of tets of PyVista to a shape.

        The point data ``Normals`` become normals of points.

        Parameters
        ----------
        thing : object
            A `pyvista.PolyData`, a `pyvista.UnstructuredGrid`, or a `pyvista.MultiBlock`, whose parts become one shape.

        Returns
        -------
        TriangleMesh, PolygonMesh or PointCloud
            A shape of the class on which this was called, with the same coordinates.

        Raises
        ------
        UnsupportedTypeError
            If `thing` is no such object of PyVista.
        GeometryError
            If it has no faces and the class needs them, or a coordinate is not finite.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> import pyvista
        >>> import signedheat as sh
        >>> sh.PolygonMesh.from_pyvista(pyvista.Cube())
        PolygonMesh(8 vertices, 6 polygons)
        """
        return cls._of(from_pyvista(thing))

    def to_pyvista(self) -> pyvista.PolyData:
        shape = self._elements
        points, corners, counts = np.array(shape.points), shape.corners, shape.counts
        if len(counts):
            return pyvista.PolyData(points, np.insert(corners, np.cumsum(counts) - counts, counts))
        cloud = pyvista.PolyData(points)
        if shape.normals is not None:
            cloud.point_data["Normals"] = np.array(shape.normals)
        return cloud

    @classmethod
    def from_meshio(cls: type[Kind], thing: object) -> Kind:
        """Convert the triangles, quadrilaterals and polygons, or the points, of a mesh of meshio to a shape.

        Parameters
        ----------
        thing : object
            A `meshio.Mesh`.

        Returns
        -------
        TriangleMesh, PolygonMesh or PointCloud
            A shape of the class on which this was called, with the same coordinates.

        Raises
        ------
        UnsupportedTypeError
            If `thing` is no `meshio.Mesh`.
        GeometryError
            If it has no faces and the class needs them, or a coordinate is not finite.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> import meshio
        >>> import signedheat as sh
        >>> cells = [("triangle", [[0, 1, 2]])]
        >>> sh.TriangleMesh.from_meshio(meshio.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], cells))
        TriangleMesh(3 vertices, 1 face)
        """
        return cls._of(from_meshio(thing, as_points=not cls._has_faces))

    def to_meshio(self) -> meshio.Mesh:
        """Convert this shape to a mesh of meshio.

        Returns
        -------
        meshio.Mesh
            A mesh with the same vertices and faces in the same order. The point data ``nx``, ``ny`` and ``nz`` hold
            normals of points.

        Raises
        ------
        MissingPackageError
            If meshio is not installed.

        See Also
        --------
        as_shape : The other way.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.samples.sphere(1).to_meshio().cells[0].type
        'triangle'
        """
        shape = self._elements
        points, corners, counts = np.array(shape.points), shape.corners, shape.counts
        if not len(counts):
            normals = (
                {} if shape.normals is None else dict(zip(("nx", "ny", "nz"), shape.normals.T.copy(), strict=True))
            )
            return meshio.Mesh(points, [("vertex", np.arange(len(points))[:, None])], point_data=normals)
        starts = np.cumsum(counts) - counts
        change = np.flatnonzero(np.diff(counts, prepend=-1))  # one block for each run of equal faces keeps the order
        cells = []
        for first, last in zip(change, [*change[1:], len(counts)], strict=True):
            sides = int(counts[first])
            name = next((name for name, n in CELL_SIDES.items() if n == sides), "polygon")
            cells.append((name, corners[starts[first] : starts[first] + sides * (last - first)].reshape(-1, sides)))
        return meshio.Mesh(points, cells)

    @classmethod
    def from_open3d(cls: type[Kind], thing: object) -> Kind:
        """Convert a mesh or a cloud of Open3D to a shape.

        Parameters
        ----------
        thing : object
            A `TriangleMesh` or `PointCloud` of ``open3d.geometry`` or ``open3d.t.geometry``.

        Returns
        -------
        TriangleMesh, PolygonMesh or PointCloud
            A shape of the class on which this was called, with the same coordinates.

        Raises
        ------
        UnsupportedTypeError
            If `thing` is no such object of Open3D.
        GeometryError
            If it has no faces and the class needs them, or a coordinate is not finite.

        See Also
        --------
        as_shape : A shape of any package's object.

        Examples
        --------
        >>> import open3d  # doctest: +SKIP
        >>> sh.TriangleMesh.from_open3d(open3d.io.read_triangle_mesh("scan.ply"))  # doctest: +SKIP
        """
        return cls._of(from_open3d(thing))

    def to_open3d(self) -> open3d.geometry.Geometry:
        """Convert this shape to an object of Open3D.

        Returns
        -------
        open3d.geometry.TriangleMesh or open3d.geometry.PointCloud
            A mesh, or a cloud if there are no faces, with the same coordinates in double precision, and with normals of
            points.

        Raises
        ------
        MissingPackageError
            If Open3D is not installed.
        GeometryError
            If faces have more than three corners.

        See Also
        --------
        as_shape : The other way.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.samples.sphere(1).to_open3d()  # doctest: +SKIP
        """
        shape = self._elements
        points = open3d.utility.Vector3dVector(np.array(shape.points))
        if not len(shape.counts):
            cloud = open3d.geometry.PointCloud(points)
            if shape.normals is not None:
                cloud.normals = open3d.utility.Vector3dVector(np.array(shape.normals))
            return cloud
        faces = open3d.utility.Vector3iVector(_triangles_only(shape, "Open3D").astype(np.int32))
        return open3d.geometry.TriangleMesh(points, faces)


def from_trimesh(thing: Any) -> Elements:
    """Convert a `trimesh.Trimesh`, a `trimesh.PointCloud`, or all meshes of a `trimesh.Scene` at their positions."""
    if hasattr(thing, "geometry") and hasattr(thing, "graph"):
        thing = thing.to_mesh()
        if not len(thing.faces):
            raise GeometryError("the scene holds no mesh", remedy="add one, or pass its geometry itself")
    if not hasattr(thing, "vertices") or hasattr(thing, "entities"):
        raise _no_shape(thing, "a Trimesh, PointCloud or Scene", "lines in the plane are a signedheat.Polyline")
    return Elements.of_triangles(np.asarray(thing.vertices), getattr(thing, "faces", ()))


def from_pyvista(thing: Any) -> Elements:
    """Convert a `pyvista.PolyData`, `pyvista.UnstructuredGrid` or `pyvista.MultiBlock`."""
    if hasattr(thing, "n_blocks") and hasattr(thing, "combine"):
        thing = thing.combine()
    if hasattr(thing, "celltypes"):
        return _from_cells(thing)
    if not hasattr(thing, "faces") or not hasattr(thing, "points"):
        raise _no_shape(thing, "a PolyData or UnstructuredGrid", "call its extract_surface() or contour() first")
    if thing.n_lines and not len(thing.faces):
        raise _no_shape(thing, "one with faces or points", "lines on a surface are its polyline(points)")
    if getattr(thing, "n_strips", 0):
        raise GeometryError("the mesh holds triangle strips", remedy="call its triangulate() first")
    faces = np.asarray(thing.faces, dtype=np.int64)
    starts, start = [], 0
    while start < len(faces):
        starts.append(start)
        start += 1 + int(faces[start])
    counts = faces[np.array(starts, dtype=np.int64)]
    return Elements(np.asarray(thing.points), np.delete(faces, starts), counts, thing.point_data.get("Normals"))


def _from_cells(thing: Any) -> Elements:
    """Convert the faces of a `pyvista.UnstructuredGrid`, or its tets if it has no faces, or else its points."""
    types = np.asarray(thing.celltypes)
    offsets = np.asarray(thing.cell_offsets if hasattr(thing, "cell_offsets") else thing.offset, dtype=np.int64)
    corners = np.asarray(thing.cell_connectivity, dtype=np.int64)
    faces = np.flatnonzero(np.isin(types, _VTK_FACES))
    if not len(faces) and (types == _VTK_TETRA).any():
        return Elements(np.asarray(thing.points), tets=tets_of_pyvista(thing))
    if not len(faces) and not (types <= 2).all():
        raise GeometryError(
            f"the grid holds neither faces nor tets among its {len(types)} cells",
            remedy="call its extract_surface() or triangulate() first",
        )
    _, of_faces = members_of(offsets, np.arange(len(corners)), faces)
    normals = thing.point_data.get("Normals")
    return Elements(np.asarray(thing.points), corners[of_faces], np.diff(offsets)[faces], normals)


def tets_of_pyvista(grid: Any) -> Ints:
    """Return the (t, 4) tets of a `pyvista.UnstructuredGrid`; raise an error if it has other cells with volume."""
    cells = {int(kind): ids for kind, ids in grid.cells_dict.items()}
    if _VTK_TETRA not in cells or max(cells) > _VTK_TETRA:
        kinds = ", ".join(map(str, sorted(cells))) or "none"
        raise GeometryError(f"its types of cells are {kinds}, not tets alone (10)", remedy="triangulate it first")
    return np.asarray(cells[_VTK_TETRA], dtype=np.int64)


def from_meshio(thing: Any, as_points: bool = False) -> Elements:
    """Convert the polygons of a `meshio.Mesh`, or its tets if it has no polygons, or else its points.

    Without polygons and tets, cells of other types than points raise an error, unless `as_points`.
    """
    if not hasattr(thing, "cells") or not hasattr(thing, "points"):
        raise _no_shape(thing, "a Mesh", "read it with meshio.read")
    blocks = [block.data for block in thing.cells if block.type in CELL_SIDES or block.type.startswith("polygon")]
    if not blocks and any(block.type == "tetra" for block in thing.cells):
        return Elements(thing.points, tets=tets_of_meshio(thing))
    others = [block.type for block in thing.cells if block.type != "vertex"]
    if not blocks and others and not as_points:
        raise _no_shape(thing, "one of faces, tets or points", f"extract the surface of its cells of type {others[0]}")
    corners = [np.asarray(face, dtype=np.int64) for block in blocks for face in block]
    counts = np.array([len(face) for face in corners], dtype=np.int64)
    data = thing.point_data
    normals = np.stack([data[name] for name in ("nx", "ny", "nz")], axis=1) if "nx" in data else data.get("Normals")
    return Elements(thing.points, np.concatenate(corners) if corners else _no_ids(), counts, normals)


def tets_of_meshio(mesh: Any) -> Ints:
    """Return the (t, 4) tets of a `meshio.Mesh`; raise an error if it has other cells with volume."""
    kinds = sorted({block.type for block in mesh.cells})
    if "tetra" not in kinds or not all(kind == "tetra" or kind.startswith(FLAT_CELLS) for kind in kinds):
        listed = ", ".join(kinds) or "no cells"
        raise GeometryError(f"it holds {listed}, not tets alone", remedy="convert it to linear tetrahedra first")
    blocks = [block.data for block in mesh.cells if block.type == "tetra"]
    for block in blocks:
        if block.ndim != 2 or block.shape[1] != 4:
            raise GeometryError(f"tets are rows of four vertices, not an array of {block.shape}", element="tets")
    return np.concatenate(blocks)


def from_open3d(thing: Any) -> Elements:
    """Convert a `TriangleMesh` or `PointCloud` of ``open3d.geometry`` or ``open3d.t.geometry``."""
    tensors = getattr(thing, "vertex", None) or getattr(thing, "point", None)
    if tensors is not None:
        normals = tensors.normals.numpy() if "normals" in tensors else None
        faces = thing.triangle.indices.numpy() if hasattr(thing, "triangle") else ()
        return Elements.of_triangles(tensors.positions.numpy(), faces, normals)
    if not (hasattr(thing, "triangles") or (hasattr(thing, "points") and hasattr(thing, "normals"))):
        raise _no_shape(thing, "a TriangleMesh or PointCloud", "sample points from it, or extract a mesh first")
    points = np.asarray(thing.vertices if hasattr(thing, "triangles") else thing.points)
    normals = np.asarray(thing.normals) if hasattr(thing, "normals") and thing.has_normals() else None
    return Elements.of_triangles(points, np.asarray(getattr(thing, "triangles", ())), normals)


def from_arrays(pair: Any) -> Elements:
    """Convert a pair (vertices, faces) of rows of positions and rows of vertex ids, which may differ in length."""
    points, faces = (array_of(part, "vertices and faces") if np.ma.isMaskedArray(part) else part for part in pair)
    if getattr(faces, "ndim", 0) == 2 and faces.dtype != object:
        refuse_other_layout(np.asarray(faces))
        flat = np.asarray(faces).astype(np.int64).ravel()
        return Elements(np.asarray(points), flat, np.full(faces.shape[0], faces.shape[1]))
    rows = faces if isinstance(faces, list | tuple) else list(np.asarray(faces))
    counts = np.array([len(row) for row in rows], dtype=np.int64)
    flat = np.concatenate([np.asarray(row, dtype=np.int64) for row in rows]) if len(rows) else _no_ids()
    return Elements(np.asarray(points), flat, counts)


def _triangles_only(shape: Elements, package: str) -> Ints:
    """Return (m, 3) faces; raise an error that names the package if some are no triangles."""
    if (shape.counts != 3).any():
        raise GeometryError(
            f"{package} holds triangles only, and this has polygons", remedy="use to_pyvista or to_meshio"
        )
    return np.array(shape.corners.reshape(-1, 3))


def _no_shape(thing: object, accepted: str, remedy: str) -> UnsupportedTypeError:
    """Return the error for an object of another package that is no shape; `accepted` says which objects are."""
    kind = type(thing)
    return UnsupportedTypeError(
        f"{kind.__module__}.{kind.__name__} is not a shape: {accepted} is", remedy=remedy, element=kind.__name__
    )


ELEMENTS_OF: dict[str, Callable[[Any], Elements]] = {
    "meshio": from_meshio,
    "numpy": from_arrays,
    "open3d": from_open3d,
    "pyvista": from_pyvista,
    "trimesh": from_trimesh,
}
"""Functions that convert objects to `Elements`, by the package of the object. That of NumPy converts pairs (vertices,
faces)."""
