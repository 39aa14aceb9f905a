"""Conversion of arguments to shapes, from objects of other packages (`exchange`), solids, and pairs of arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from types import MappingProxyType
from typing import Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SourceError, UnsupportedTypeError
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import is_pair, like_array, other_layout, public_call
from .exchange import ACCEPTED_SHAPES, ELEMENTS_OF, Elements
from .geometries import geometry_of, polylines_of

One = TypeVar("One")

Thing = TypeVar("Thing")

PACKAGES = frozenset({"meshio", "open3d", "pyvista", "trimesh"})
"""Packages whose objects are accepted, by their names in imports."""


class Represented(ABC):
    """Base class of objects that are accepted as a shape because of their surface, such as solids and label images."""

    @property
    @abstractmethod
    def boundary(self) -> TriangleMesh:
        """The surface by which this object is represented."""


class HasVertices(Protocol):
    """Protocol for type checkers that `trimesh.Trimesh` and `trimesh.PointCloud` satisfy."""

    @property
    def vertices(self) -> object: ...
    @property
    def metadata(self) -> object: ...


class HasGeometry(Protocol):
    """Protocol for type checkers that `trimesh.Scene` satisfies."""

    @property
    def geometry(self) -> object: ...
    @property
    def graph(self) -> object: ...


class HasPointData(Protocol):
    """Protocol for type checkers that `meshio.Mesh` and the data sets of PyVista satisfy."""

    @property
    def points(self) -> object: ...
    @property
    def point_data(self) -> object: ...


class HasTriangles(Protocol):
    """Protocol for type checkers that `open3d.geometry.TriangleMesh` satisfies."""

    @property
    def vertices(self) -> object: ...
    @property
    def triangles(self) -> object: ...


SurfaceShape: TypeAlias = TriangleMesh | PolygonMesh | PointCloud
"""The kinds of shapes that most file formats support."""
Shape: TypeAlias = TriangleMesh | PolygonMesh | PointCloud | DigitalSurface | TetMesh
"""All kinds of shapes that files hold."""
ForeignShape: TypeAlias = (
    Represented | HasVertices | HasGeometry | HasPointData | HasTriangles | tuple[ArrayLike, ArrayLike]
)
"""Solids, images, objects of trimesh, PyVista, meshio and Open3D, and pairs (vertices, faces)."""


def what_to_pass(thing: object) -> str:
    """Return the remedy of an error for an object that is no shape, which says what to pass instead."""
    if isinstance(thing, str | PathLike):
        return f'pass sh.read("{fspath(thing)!s}")'
    if isinstance(thing, DigitalSurface):
        return "pass its smooth_surface, or its squares"
    if isinstance(thing, np.ndarray) and thing.ndim == 2:
        return f"for points alone pass sh.PointCloud(points), otherwise {ACCEPTED_SHAPES}"
    return f"pass {ACCEPTED_SHAPES}"


def package_of(thing: object) -> str | None:
    """Return the package among `PACKAGES` that defines the class of an object or one of its base classes, or None."""
    roots = (kind.__module__.partition(".")[0] for kind in type(thing).__mro__)
    return next((root for root in roots if root in PACKAGES), None)


@public_call
def as_shape(thing: Shape | ForeignShape) -> Shape:
    """Convert an object of another package, a pair of arrays, a solid or an image to a shape.

    Functions that take a shape call this themselves. An object with triangles only becomes a `TriangleMesh`, one with
    other faces a `PolygonMesh`, one with tets a `TetMesh`, and one without any of these a `PointCloud`. Faces keep
    their number, order and defects. A `Solid` becomes its ``boundary``. A shape is returned as it is.

    Parameters
    ----------
    thing : shape, Solid, LabelImage, object of trimesh, PyVista, meshio or Open3D, or (vertices, faces)
        The object. In a pair, vertices are (n, 3) float, and faces (m, 3) int or rows of ids of any length.

    Returns
    -------
    TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or TetMesh
        The shape, with the same coordinates.

    Raises
    ------
    UnsupportedTypeError
        If the object is not a shape (lines, for instance), or comes from a package other than these.
    GeometryError
        If the shape is invalid.

    See Also
    --------
    read : Read a shape or a solid.
    transform : Move a shape by a matrix.
    TriangleMesh : Triangles in space.

    Examples
    --------
    >>> import signedheat as sh
    >>> as_shape(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    TriangleMesh(3 vertices, 1 face)
    """
    shape = converted(thing)
    if not isinstance(shape, TriangleMesh | PolygonMesh | PointCloud | DigitalSurface | TetMesh):
        if isinstance(thing, tuple | list):
            refuse_arrays(thing)
        raise UnsupportedTypeError(f"a {type(thing).__name__} is not a shape", remedy=what_to_pass(thing))
    return shape


def converted(thing: Thing) -> Thing:
    """Convert a shape of another package, a solid, an image or a pair of arrays; return other objects as they are."""
    if isinstance(thing, Represented):
        return cast("Thing", thing.boundary)
    package = "numpy" if is_pair(thing) else package_of(thing)
    return thing if package is None else cast("Thing", shape_of(ELEMENTS_OF[package](thing)))


def shape_of(elements: Elements) -> TriangleMesh | PolygonMesh | PointCloud | TetMesh:
    """Make a shape from elements, of the class that fits them."""
    if elements.tets is not None:
        return TetMesh(elements.points, elements.tets)
    kinds = {kind.__name__: kind for kind in (TriangleMesh, PolygonMesh, PointCloud)}
    return kinds[elements.kind]._of(elements)


def refuse_arrays(things: Sequence[object]) -> None:
    """Raise an error if arguments are numeric arrays that were meant as a shape, and say what is wrong with them."""
    arrays = [np.asarray(thing) for thing in things if like_array(thing)]
    if not arrays or len(arrays) < len(things) or any(array.dtype.kind not in "biuf" for array in arrays):
        return
    if len(arrays) != 2 or any(array.ndim != 2 for array in arrays):
        rows = other_layout(arrays[1], "faces", 3) if len(arrays) == 2 and arrays[1].ndim == 1 else None
        raise UnsupportedTypeError(
            "arrays of numbers alone are not a shape" if rows is None else "faces are not rows of vertex numbers",
            remedy=rows or "pass sh.PointCloud(points), or a pair (vertices, faces)",
            element="shape",
        )
    vertices, faces = arrays
    if vertices.dtype.kind in "iu" and faces.dtype.kind == "f" and vertices.max(initial=-1) < len(faces):
        cause, remedy = "the faces come before the vertices", "pass (vertices, faces)"
    elif vertices.shape[1] != 3:
        cause = f"vertices have {vertices.shape[1]} coordinates each, and lie in space with 3"
        other = "pass vertices.T" if len(vertices) == 3 else "give 3 for each"
        in_plane = "add z = 0; for drawings in the plane pass sh.Polyline"
        remedy = in_plane if vertices.shape[1] == 2 else other
    else:
        cause, remedy = f"faces are rows of vertex numbers, not of {faces.dtype}", "pass faces.astype(int)"
    raise UnsupportedTypeError(cause, remedy=remedy, element="shape")


def as_shapes(things: Thing | Sequence[Thing]) -> list[Thing]:
    """Return an argument, or a sequence of several, as a list in which shapes of other packages are converted.

    Geometries of shapely, GeoPandas and GeoJSON become polylines.
    """
    several = isinstance(things, Sequence) and not isinstance(things, str)
    if is_pair(things) or package_of(things) is not None or geometry_of(things) is not None:
        several = False
    shapes: list[Thing] = []
    for thing in list(cast("Sequence[Thing]", things)) if several else [things]:
        geometry = geometry_of(thing)
        if geometry is None:
            shapes.append(converted(cast("Thing", thing)))
        else:
            shapes += cast("list[Thing]", polylines_of(geometry))
    return shapes


def elements(shape: SurfaceShape, values: Mapping[str, NDArray[np.floating]] = MappingProxyType({})) -> Elements:
    """Return the elements of a shape, with named values at the points."""
    return replace(shape._elements, values=values)


def as_list(sources: One | Sequence[One]) -> list[One]:
    """Return the list of `as_shapes` for a source or a sequence of sources; raise an error if it is empty."""
    listed: list[One] = as_shapes(sources)
    if not listed:
        raise SourceError("no source was given", remedy="pass at least one curve, point or shape")
    return listed
