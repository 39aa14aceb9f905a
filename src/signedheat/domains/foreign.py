"""Shapes of other packages, and pairs of arrays, taken wherever a shape is, and made of ours: the one place for both.

Vertices and faces keep their number and order in both directions. Each package is imported only where it is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike, fspath
from typing import Any, Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError, UnsupportedTypeError
from ..geometry.components import members_of
from ..packages import lazy_module
from .digital_surface import DigitalSurface
from .exchange import shape_from, shape_to
from .point_cloud import PointCloud
from .polygon_mesh import PolygonMesh
from .tet_mesh import TetMesh
from .triangle_mesh import TriangleMesh
from .validation import array_of

meshio = lazy_module("meshio", "objects of meshio")
open3d = lazy_module("open3d", "objects of Open3D")
pyvista = lazy_module("pyvista", "objects of PyVista")
trimesh = lazy_module("trimesh", "objects of trimesh")

Thing = TypeVar("Thing")

PACKAGES = {"meshio": "meshio", "open3d": "open3d", "pyvista": "pyvista", "trimesh": "trimesh"}
"""Packages whose objects are taken, by the name with which the modules of their classes begin."""


class HasVertices(Protocol):
    """A `trimesh.Trimesh` or `trimesh.PointCloud`, seen by a type checker."""

    @property
    def vertices(self) -> object:
        """Positions."""

    @property
    def metadata(self) -> object:
        """Whatever belongs to it."""


class HasGeometry(Protocol):
    """A `trimesh.Scene`, seen by a type checker."""

    @property
    def geometry(self) -> object:
        """Its meshes, by name."""

    @property
    def graph(self) -> object:
        """Where they are."""


class HasPointData(Protocol):
    """A `meshio.Mesh` or an object of PyVista, seen by a type checker."""

    @property
    def points(self) -> object:
        """Positions."""

    @property
    def point_data(self) -> object:
        """Arrays at the points, by name."""


class HasTriangles(Protocol):
    """An `open3d.geometry.TriangleMesh`, seen by a type checker."""

    @property
    def vertices(self) -> object:
        """Positions."""

    @property
    def triangles(self) -> object:
        """Vertex ids."""


SurfaceShape: TypeAlias = TriangleMesh | PolygonMesh | PointCloud
"""The kinds of shapes that most file formats support."""


Shape: TypeAlias = TriangleMesh | PolygonMesh | PointCloud | DigitalSurface | TetMesh
"""What a file of a shape may hold. In space points need normals, and volumes are refused: give their boundary."""

ForeignShape: TypeAlias = HasVertices | HasGeometry | HasPointData | HasTriangles | tuple[ArrayLike, ArrayLike]
"""Objects of trimesh, PyVista, meshio and Open3D, and pairs (vertices, faces)."""

TAKEN = "a shape of signedheat, trimesh, PyVista, meshio or Open3D, or a pair (vertices, faces)"
"""What is taken for a shape, for messages."""


def what_to_pass(thing: object) -> str:
    """The remedy where something is no shape: files are read first, and bare points are a cloud.

    Examples
    --------
    >>> what_to_pass("part.stl")
    'pass sh.read("part.stl")'
    """
    if isinstance(thing, str | PathLike):
        return f'pass sh.read("{fspath(thing)!s}")'
    if isinstance(thing, np.ndarray) and thing.ndim == 2:
        return f"for points alone pass sh.PointCloud(points), otherwise {TAKEN}"
    return f"pass {TAKEN}"


def package_of(thing: object) -> str | None:
    """The package that made an object, among those whose objects are taken; classes derived from theirs count.

    Examples
    --------
    >>> package_of([1, 2]) is None
    True
    """
    roots = (kind.__module__.partition(".")[0] for kind in type(thing).__mro__)
    return next((PACKAGES[root] for root in roots if root in PACKAGES), None)


def is_pair(thing: object) -> bool:
    """Whether something is a pair of arrays (vertices, faces), and not two sources or two numbers.

    Examples
    --------
    >>> is_pair(([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])), is_pair(([0.0, 1], [0.0, 1]))
    (True, False)
    """
    if not (isinstance(thing, tuple | list) and len(thing) == 2 and all(_like_array(part) for part in thing)):
        return False
    points, faces = thing
    try:
        positions = np.asanyarray(points, dtype=np.float64)
    except (TypeError, ValueError, RuntimeError):
        return False
    return positions.ndim == 2 and positions.shape[1] == 3 and _like_ids(faces)


def as_shape(thing: Shape | ForeignShape) -> Shape:
    """The shape that an object of another package, or a pair of arrays, stands for; a shape as it is.

    Every function that takes a shape does this by itself.

    Faces keep their number, order and defects. A shape without faces becomes a `PointCloud`, one of triangles alone a
    `TriangleMesh`, any other a `PolygonMesh`; tets become a `TetMesh`.

    Parameters
    ----------
    thing : shape, object of trimesh, PyVista, meshio or Open3D, or (vertices, faces)
        Vertices are (n, 3) float, faces (m, 3) int or rows of ids of any length.

    Returns
    -------
    TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or TetMesh
        The shape.

    Raises
    ------
    UnsupportedTypeError
        If it is no shape, such as lines, or an object of another package.
    GeometryError
        If the shape is invalid.

    Examples
    --------
    >>> import signedheat as sh
    >>> as_shape(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    TriangleMesh(3 vertices, 1 faces)
    """
    shape = converted(thing)
    if not isinstance(shape, TriangleMesh | PolygonMesh | PointCloud | DigitalSurface | TetMesh):
        raise UnsupportedTypeError(f"a {type(thing).__name__} is no shape", remedy=what_to_pass(thing))
    return shape


def converted(thing: Thing) -> Thing:
    """A shape of another package as one of ours; everything else, such as curves, as it is."""
    package = "numpy" if is_pair(thing) else package_of(thing)
    return thing if package is None else cast("Thing", shape_from(package, None, thing))


def as_shapes(things: Thing | Sequence[Thing]) -> list[Thing]:
    """One thing or several, as a list, with every shape of another package among them converted (see `as_shape`)."""
    several = isinstance(things, Sequence) and not isinstance(things, str)
    if is_pair(things) or package_of(things) is not None:
        several = False
    listed = list(cast("Sequence[Thing]", things)) if several else [things]
    return [converted(cast("Thing", thing)) for thing in listed]


def _like_array(part: object) -> bool:
    return isinstance(part, list | tuple) or hasattr(part, "__array__")


def _like_ids(faces: object) -> bool:
    """Whether something is rows of whole numbers, of equal length or not."""
    rows = faces if hasattr(faces, "__array__") else list(cast("Sequence[object]", faces))
    if isinstance(rows, list):
        return bool(rows) and all(
            isinstance(row, list | tuple | np.ndarray) and _whole(np.asarray(row), 1) for row in rows
        )
    return _whole(np.asarray(rows), 2)


def _whole(ids: NDArray[np.generic], axes: int) -> bool:
    return ids.ndim == axes and bool(np.issubdtype(ids.dtype, np.integer))


def assemble(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], counts: NDArray[np.int64]
) -> TriangleMesh | PolygonMesh:
    """A triangle mesh if all faces are triangles, else a polygon mesh; from all corners and their number per face."""
    if (counts == 3).all():
        return TriangleMesh(vertices, corners.reshape(-1, 3))
    return PolygonMesh(vertices, np.split(corners, np.cumsum(counts)[:-1]))


def faces_of(shape: SurfaceShape) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The inverse of `assemble`: corners of all faces, and the number of corners of each; empty for point clouds."""
    if isinstance(shape, TriangleMesh):
        return shape.faces.ravel(), np.full(shape.n_faces, 3)
    if isinstance(shape, PolygonMesh):
        return shape.corners, np.diff(shape.offsets)
    return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)


def points_of(shape: SurfaceShape) -> NDArray[np.float64]:
    """(n, 3) vertices of a mesh, or points of a cloud."""
    return shape.points if isinstance(shape, PointCloud) else shape.vertices


_SIDES = {"triangle": 3, "quad": 4}
_VTK_FACES = {5: "triangle", 7: "polygon", 9: "quad"}
_VTK_TETRA = 10


def from_trimesh(kind: type | None, thing: Any) -> Any:
    """From a `trimesh.Trimesh`, `trimesh.PointCloud`, or all meshes of a `trimesh.Scene`, each in its place."""
    if hasattr(thing, "geometry") and hasattr(thing, "graph"):
        thing = thing.to_mesh()
        if not len(thing.faces):
            raise GeometryError("the scene holds no mesh", remedy="add one, or pass its geometry itself")
    if not hasattr(thing, "vertices") or hasattr(thing, "entities"):
        raise _no_shape(thing, "a Trimesh, PointCloud or Scene", "lines in the plane are a signedheat.Polyline")
    faces = getattr(thing, "faces", np.empty((0, 3), dtype=np.int64))
    corners = np.asarray(faces, dtype=np.int64)
    return _build(kind, np.asarray(thing.vertices), corners.ravel(), np.full(len(corners), 3))


def to_trimesh(shape: SurfaceShape) -> Any:
    """As a `trimesh.Trimesh` (not processed: nothing is merged) or `trimesh.PointCloud`."""
    if isinstance(shape, PointCloud):
        return trimesh.PointCloud(np.array(shape.points))
    mesh = _triangles_only(shape, "trimesh")
    return trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)


def from_pyvista(kind: type | None, thing: Any) -> Any:
    """From a `pyvista.PolyData`, `pyvista.UnstructuredGrid` or `pyvista.MultiBlock`."""
    if hasattr(thing, "n_blocks") and hasattr(thing, "combine"):
        thing = thing.combine()
    if hasattr(thing, "celltypes"):
        return _from_cells(kind, thing)
    if not hasattr(thing, "faces") or not hasattr(thing, "points"):
        raise _no_shape(thing, "a PolyData or UnstructuredGrid", "call its extract_surface() or contour() first")
    if thing.n_lines and not len(thing.faces):
        raise _no_shape(thing, "one with faces or points", "lines on a surface are its polyline(points)")
    if getattr(thing, "n_strips", 0):
        raise GeometryError(
            "the mesh holds triangle strips",
            remedy="call its triangulate() first",
        )
    faces = np.asarray(thing.faces, dtype=np.int64)
    starts, at = [], 0
    while at < len(faces):
        starts.append(at)
        at += 1 + int(faces[at])
    counts = faces[np.array(starts, dtype=np.int64)]
    return _build(kind, np.asarray(thing.points), np.delete(faces, starts), counts, thing.point_data.get("Normals"))


def _from_cells(kind: type | None, thing: Any) -> Any:
    """The faces of an unstructured grid; if there is none, its tets or their boundary; else its points."""
    types = np.asarray(thing.celltypes)
    offsets = np.asarray(thing.cell_offsets if hasattr(thing, "cell_offsets") else thing.offset, dtype=np.int64)
    corners = np.asarray(thing.cell_connectivity, dtype=np.int64)
    faces = np.flatnonzero(np.isin(types, list(_VTK_FACES)))
    normals = thing.point_data.get("Normals")
    if not len(faces) and (types == _VTK_TETRA).any():
        tets = TetMesh.from_pyvista(thing)
        return tets if kind is None or kind is TetMesh else _of_kind(kind, tets.boundary)
    if not len(faces) and not (types <= 2).all():
        raise GeometryError(
            f"the grid holds neither faces nor tets among its {len(types)} cells",
            remedy="call its extract_surface() or triangulate() first",
        )
    counts = np.diff(offsets)[faces]
    _, taken = members_of(offsets, np.arange(len(corners)), faces)
    return _build(kind, np.asarray(thing.points), corners[taken], counts, normals)


def to_pyvista(shape: SurfaceShape) -> Any:
    """As a `pyvista.PolyData`; normals of points are point data ``Normals``."""
    points, (corners, counts) = np.array(points_of(shape)), faces_of(shape)
    if isinstance(shape, PointCloud):
        cloud = pyvista.PolyData(points)
        if shape.normals is not None:
            cloud.point_data["Normals"] = np.array(shape.normals)
        return cloud
    return pyvista.PolyData(points, np.insert(corners, np.cumsum(counts) - counts, counts))


def from_meshio(kind: type | None, thing: Any) -> Any:
    """From a `meshio.Mesh`: its triangles, quadrilaterals and polygons, block after block; or else its tets."""
    if not hasattr(thing, "cells") or not hasattr(thing, "points"):
        raise _no_shape(thing, "a Mesh", "read it with meshio.read")
    blocks = [block.data for block in thing.cells if block.type in _SIDES or block.type.startswith("polygon")]
    if not blocks and any(block.type == "tetra" for block in thing.cells):
        tets = TetMesh.from_meshio(thing)
        return tets if kind is None or kind is TetMesh else _of_kind(kind, tets.boundary)
    others = [block.type for block in thing.cells if block.type != "vertex"]
    if not blocks and others and kind is not PointCloud:
        raise _no_shape(thing, "one of faces, tets or points", f"extract the surface of its cells of type {others[0]}")
    corners = [np.asarray(face, dtype=np.int64) for block in blocks for face in block]
    counts = np.array([len(face) for face in corners], dtype=np.int64)
    flat = np.concatenate(corners) if corners else np.empty(0, dtype=np.int64)
    data = thing.point_data
    normals = np.stack([data[name] for name in ("nx", "ny", "nz")], axis=1) if "nx" in data else data.get("Normals")
    return _build(kind, thing.points, flat, counts, normals)


def to_meshio(shape: SurfaceShape) -> Any:
    """As a `meshio.Mesh`; normals of points are point data ``nx``, ``ny``, ``nz``."""
    if isinstance(shape, PointCloud):
        normals = {} if shape.normals is None else dict(zip(("nx", "ny", "nz"), shape.normals.T.copy(), strict=True))
        return meshio.Mesh(np.array(shape.points), [("vertex", np.arange(shape.n_points)[:, None])], point_data=normals)
    corners, counts = faces_of(shape)
    starts = np.cumsum(counts) - counts
    change = np.flatnonzero(np.diff(counts, prepend=-1))  # a block has faces of one kind; the order is kept
    cells = []
    for first, last in zip(change, [*change[1:], len(counts)], strict=True):
        sides = int(counts[first])
        name = next((name for name, n in _SIDES.items() if n == sides), "polygon")
        cells.append((name, corners[starts[first] : starts[first] + sides * (last - first)].reshape(-1, sides)))
    return meshio.Mesh(np.array(points_of(shape)), cells)


def from_open3d(kind: type | None, thing: Any) -> Any:
    """From a `TriangleMesh` or `PointCloud` of ``open3d.geometry`` or ``open3d.t.geometry``."""
    tensors = getattr(thing, "vertex", None) or getattr(thing, "point", None)
    if tensors is not None:
        points = tensors.positions.numpy()
        normals = tensors.normals.numpy() if "normals" in tensors else None
        faces = thing.triangle.indices.numpy() if hasattr(thing, "triangle") else ()
    elif hasattr(thing, "triangles") or (hasattr(thing, "points") and hasattr(thing, "normals")):
        faces = np.asarray(getattr(thing, "triangles", ()))
        points = np.asarray(thing.vertices if hasattr(thing, "triangles") else thing.points)
        normals = np.asarray(thing.normals) if hasattr(thing, "normals") and thing.has_normals() else None
    else:
        raise _no_shape(thing, "a TriangleMesh or PointCloud", "sample points from it, or extract a mesh first")
    corners = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    return _build(kind, points, corners.ravel(), np.full(len(corners), 3), normals)


def to_open3d(shape: SurfaceShape) -> Any:
    """As a `TriangleMesh` or `PointCloud` of ``open3d.geometry``, with the normals of points."""
    vector = open3d.utility.Vector3dVector
    if isinstance(shape, PointCloud):
        cloud = open3d.geometry.PointCloud(vector(np.array(shape.points)))
        if shape.normals is not None:
            cloud.normals = vector(np.array(shape.normals))
        return cloud
    mesh = _triangles_only(shape, "Open3D")
    triangles = open3d.utility.Vector3iVector(np.array(mesh.faces, dtype=np.int32))
    return open3d.geometry.TriangleMesh(vector(np.array(mesh.vertices)), triangles)


def from_arrays(kind: type | None, pair: Any) -> Any:
    """From a pair (vertices, faces): rows of positions, and rows of vertex ids of equal length or not."""
    points, faces = (array_of(part, "vertices and faces") if np.ma.isMaskedArray(part) else part for part in pair)
    rows = faces if isinstance(faces, list | tuple) else list(np.asarray(faces))
    counts = np.array([len(row) for row in rows], dtype=np.int64)
    flat = np.concatenate([np.asarray(row, dtype=np.int64) for row in rows]) if len(rows) else np.empty(0, np.int64)
    return _build(kind, np.asarray(points), flat, counts)


def _build(
    kind: type | None,
    points: NDArray[Any],
    corners: NDArray[np.int64],
    counts: NDArray[np.int64],
    normals: NDArray[Any] | None = None,
) -> Any:
    if kind is PointCloud or (kind is None and not len(counts)):
        return PointCloud(points, normals)
    if kind is None:
        return assemble(points, corners, counts)
    if kind is PolygonMesh:
        return PolygonMesh(points, np.split(corners, np.cumsum(counts)[:-1]) if len(counts) else [])
    wrong = np.flatnonzero(counts != 3)
    if len(wrong):
        raise GeometryError(
            f"face {wrong[0]} has {counts[wrong[0]]} corners, not 3",
            remedy="use PolygonMesh instead",
            element=f"face {wrong[0]}",
        )
    return TriangleMesh(points, corners.reshape(-1, 3))


def _of_kind(kind: type, mesh: TriangleMesh) -> Any:
    return _build(kind, mesh.vertices, mesh.faces.ravel(), np.full(mesh.n_faces, 3))


def _triangles_only(shape: SurfaceShape, package: str) -> TriangleMesh:
    if not isinstance(shape, TriangleMesh):
        raise GeometryError(
            f"{package} holds triangles only, and this is a {type(shape).__name__}",
            remedy="use to_pyvista or to_meshio",
        )
    return shape


def _no_shape(thing: object, taken: str, remedy: str) -> UnsupportedTypeError:
    kind = type(thing)
    return UnsupportedTypeError(
        f"{kind.__module__}.{kind.__name__} is no shape: {taken} is", remedy=remedy, element=kind.__name__
    )


_FROM = {
    "meshio": from_meshio,
    "numpy": from_arrays,
    "open3d": from_open3d,
    "pyvista": from_pyvista,
    "trimesh": from_trimesh,
}
_TO = {"meshio": to_meshio, "open3d": to_open3d, "pyvista": to_pyvista, "trimesh": to_trimesh}


@shape_from.provide
def _(package: str, kind: type | None, thing: Any) -> Any:
    return _FROM[package](kind, thing)


@shape_to.provide
def _(package: str, shape: Any) -> Any:
    return _TO[package](shape)
