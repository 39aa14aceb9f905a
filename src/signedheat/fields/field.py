"""Fields: values on a domain, what is between them, their level sets and their arithmetic."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeAlias, cast, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ..arrays import Bools, Floats, Frozen
from ..diagnostics import Diagnostics
from ..discretization import SourceTerm
from ..errors import GeometryError, OutsideError, SourceError, UnsupportedTypeError, quoted
from ..grids.band import Band
from ..grids.grid import Grid
from ..grids.polyline import Polyline
from ..packages import lazy_module
from ..shapes.exchange import Displayed, with_values
from ..shapes.kinds import EmbeddedSurface
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.subdivision import common_subdivision
from ..surfaces.surface import LinearDomain
from ..surfaces.surface_curves import Curve, SurfacePoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import array_of, finite_number, instance, public_call
from .field_domain import FieldDomain, Interpolant
from .solid_queries import Closest, MakesFields, SolidQueries, scaled

files: Any = lazy_module("signedheat.io.field_files", "files")
ply: Any = lazy_module("signedheat.io.ply", "files")

if TYPE_CHECKING:
    import pyvista
    from typing_extensions import TypeVar

    Domain = TypeVar("Domain", bound=FieldDomain, default=FieldDomain, covariant=True)
else:
    from typing import TypeVar

    Domain = TypeVar("Domain", bound=FieldDomain, covariant=True)

Embedded = TypeVar("Embedded", bound=EmbeddedSurface)
Rule: TypeAlias = Callable[[Floats, Floats], Floats]
"""Takes the values of two fields, in arrays of the same shape, and returns the values of their combination."""

Number: TypeAlias = float | np.number[Any]
NUMBER_TYPES = (int, float, np.number)


def finite(number: Number) -> float:
    """Convert a number to a float; raise an error for NaN and infinity."""
    return finite_number(number, "number")


@dataclass(frozen=True, eq=False)
class Field(Displayed, Frozen, Generic[Domain]):
    """Signed distance, or any other scalar function φ, given by its values on a domain.

    ``field(points)`` evaluates φ at any points, `contour` extracts level sets, and `save` writes a file. ``-field``,
    ``2 * field`` and ``field + 1`` are fields, and ``field - 0.1`` is the field of the shape offset by 0.1. NumPy's
    functions treat a field as the array of its values. ``a | b``, ``a & b``, ``a - b`` and ``~a`` are the union,
    intersection, difference and complement of the solids in which the fields are negative.

    A field that holds its solid is exact at all points, not only on the domain. It stays exact when it is negated,
    multiplied by a number, saved as ``.npz``, or combined with another field that holds its solid. After a number is
    added, it is interpolated. Combinations of fields without solids have the right sign and zero set, but on one side
    of the boundary their values are only a bound of the distance. `sharpen` computes the distance then.

    Parameters
    ----------
    domain : Grid, Band, TetMesh, TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, IntrinsicTriangulation
        Grid, mesh or point cloud that carries the values. `piecewise_distance` returns fields on a
        `results.CutSurface`.
    values : array
        φ, in the units of the domain: ``values[i, j, k]`` at ``grid.points[i, j, k]`` of a grid, (n_vertices,) on tets
        and surfaces, (n, 8, 8, 8) in the blocks of a band. Positive on the side that the normals of the source point
        to, so negative inside a shape with outward normals. NaN where no source is connected.
    diagnostics : Diagnostics, optional
        Timings, diffusion time, and notes on the computation; empty by default.
    confidence : array, optional
        Numbers from 0 to 1 in the shape of the values. They are 1 where the nearest surface point is given, and
        smaller where it was completed, the farther it is from the given faces. By default the field has none.
    solid : Solid, optional
        The solid that the values are distances to. With it, calls, gradients and contours are exact. By default points
        between the nodes get interpolated values.
    source : SourceTerm, optional
        The source that a solver computed the field from; `sharpen` uses it. By default it is not known.
    coarse : Field, optional
        φ on a coarse grid of the whole box, for points beyond a band. Every field in a band needs one, and by default
        there is none.
    finer : Field, optional
        φ on the intrinsic triangulation of a mesh on which it was computed. Values at points and contours use it. By
        default the values of this field are used.

    Raises
    ------
    GeometryError
        If the values do not have the shape that the domain needs.
    UnsupportedTypeError
        If the domain is no grid, band, tet mesh, surface or point cloud.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    read_field : Read a field.
    sharpen : Distance to the zero set of a field.

    Examples
    --------
    >>> import signedheat as sh
    >>> grid = sh.Grid(origin=(-1, -1, -1), spacing=0.1, shape=(21, 21, 21))
    >>> phi = Field(grid, np.linalg.norm(grid.points, axis=-1) - 0.5)
    >>> phi([[0.7, 0.0, 0.0]]).round(3)
    array([0.2])
    >>> phi.contour(0.1).n_faces > 0, float(np.max(-phi))
    (True, 0.5)
    >>> left, right = (Field(grid, np.linalg.norm(grid.points - [x, 0, 0], axis=-1) - 0.5) for x in (-0.2, 0.2))
    >>> [round(float(both([0.0, 0.0, 0.0])), 2) for both in (left | right, left - right)]
    [-0.3, 0.3]
    """

    domain: Domain
    values: Floats
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    confidence: NDArray[np.float32] | None = field(default=None, repr=False, kw_only=True)
    solid: SolidQueries | None = field(default=None, repr=False, kw_only=True)
    source: SourceTerm | None = field(default=None, repr=False, kw_only=True)
    coarse: Field[Grid] | None = field(default=None, repr=False, kw_only=True)
    finer: Field[IntrinsicTriangulation] | None = field(default=None, repr=False, kw_only=True)

    __array_priority__ = 1000.0  # so that NumPy's numbers leave operators to the field

    def __post_init__(self) -> None:
        if not isinstance(self.domain, FieldDomain):
            raise UnsupportedTypeError(
                f"{quoted(self.domain)} is no domain of fields",
                remedy="pass a grid, tets or a surface",
                element="domain",
            )
        instance(self.diagnostics, Diagnostics, "diagnostics")
        instance(self.coarse, Field, "coarse")
        instance(self.finer, Field, "finer")
        values = self.domain._checked(self.values)
        object.__setattr__(self, "values", values)
        if isinstance(self.domain, Band) and self.coarse is None:
            raise GeometryError("a field in a band needs a coarse field for the nodes beyond it", element="coarse")
        if self.confidence is not None:
            confidence = array_of(self.confidence, "confidence")
            if confidence.dtype.kind not in "biuf" or confidence.shape != values.shape:
                raise GeometryError(
                    f"confidence is an array of {confidence.dtype} of shape {confidence.shape}",
                    remedy=f"give numbers of shape {values.shape}",
                    element="confidence",
                )
            if not isinstance(self.domain, Band):  # those of bands are in half precision
                object.__setattr__(self, "confidence", confidence.astype(np.float32, copy=False))

    def __call__(self, points: Curve | SurfacePoints | ArrayLike) -> Floats:
        """Evaluate φ at points, exactly if the field holds its solid, else by `interpolate`.

        Parameters
        ----------
        points : (..., d) float, Curve or SurfacePoints
            Positions, in the units of the domain. For a field on a surface, positions are first projected to the
            nearest point of the surface; a `Curve` or `SurfacePoints` is evaluated in the faces that it names.

        Returns
        -------
        (...) float
            Signed distances in the units of the domain, one for each point.
        """
        return self.interpolate(points) if self.solid is None else self.solid.distance(cast("ArrayLike", points))

    def interpolate(self, points: Curve | SurfacePoints | ArrayLike) -> Floats:
        """Interpolate the values of the field at points, without its solid. ``field(points)`` uses the solid.

        Between the nodes of a grid, φ is linear along each axis. Beyond a band, which has fine nodes near the surface
        only, the nodes of a coarse grid are used. In triangles φ is linear. In tets it is quadratic, from values and
        gradients at the vertices. Outside a grid or tets, φ continues linearly from the nearest point of the domain,
        along the gradient there. If the shape is convex and lies in the grid, that is never more than the distance.

        Parameters
        ----------
        points : (..., d) float, Curve or SurfacePoints
            Positions with d coordinates, in the units of the domain. For a field on a surface, positions are first
            projected to the nearest point of the surface; a `Curve` or `SurfacePoints` is evaluated in the faces that
            it names.

        Returns
        -------
        (...) float
            Signed distances in the units of the domain, negative inside, and NaN where the values around a point are.

        Raises
        ------
        GeometryError
            If points are not finite, or do not have d coordinates each.

        See Also
        --------
        Field.gradient : The direction in which φ grows.

        Examples
        --------
        >>> import signedheat as sh
        >>> line = Field(sh.Grid([0.0], 1.0, [3]), [0.0, 1.0, 3.0])
        >>> line.interpolate([[0.5], [2.5]])  # between nodes, and beyond the last one
        array([0.5, 4. ])
        """
        return self.finest._interpolant(points)

    def gradient(self, points: Curve | SurfacePoints | ArrayLike) -> Floats:
        """Compute the gradient ∇φ of the field φ at points, exactly if it holds its solid, else from its values.

        On grids, central differences at the nodes are interpolated. On tets, volume-weighted means at the vertices are
        interpolated. On surfaces it is the constant gradient in the triangle. Outside a grid or tets, it is the
        gradient at the nearest point of the domain.

        Parameters
        ----------
        points : (..., d) float, Curve or SurfacePoints
            Positions with d coordinates in the units of the domain, or points on a surface, as for `interpolate`.

        Returns
        -------
        (..., d) float
            Vectors ∇φ, without units. They point to where φ grows, and have length about 1 if φ is a distance.

        Raises
        ------
        GeometryError
            If points are not finite, or do not have d coordinates each.

        See Also
        --------
        Field.closest : Nearest points, gradients and confidence together.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> Field(mesh, [-0.5, 0.5, 0.5, -0.5]).gradient([[0.75, 0.5, 0.0]]).tolist()
        [[1.0, 0.0, 0.0]]
        """
        if self.solid is not None:
            return self.solid.closest(cast("ArrayLike", points)).gradients
        return self.finest._interpolant.gradient(points)

    @property
    def cell_gradients(self) -> Floats:
        """(m, 3) gradients of the field φ in each tet or triangle, with φ linear in it; 0 in degenerate triangles.

        They are in the order of the tets of the domain, or of the faces of its ``triangulation``. Where φ was
        computed on finer triangles, `gradient` is more accurate. Fields on grids have no such cells.
        """
        gradients = getattr(self.restrict()._interpolant, "cell_gradients", None)
        if gradients is None:
            raise UnsupportedTypeError("φ is linear in no cell of a grid", remedy="use gradient", element="domain")
        return cast("Floats", gradients)

    @cached_property
    def _interpolant(self) -> Interpolant:
        return self.domain._interpolant(self.values, None if self.coarse is None else self.coarse.interpolate)

    def closest(self, points: ArrayLike) -> Closest:
        """Find the nearest points on the surface of the solid that the field holds, as `Solid.closest` does.

        Parameters
        ----------
        points : (..., 3) float
            Positions in the units of the domain, inside or outside of it.

        Returns
        -------
        Closest
            Signed distances, nearest points, gradients and confidence, in arrays of shape (...) or (..., 3). Also the
            faces of the given shape on which the nearest points lie, −1 on the completion, and barycentric coordinates
            there, NaN on the completion and in faces other than triangles.

        Raises
        ------
        SourceError
            If the field holds no solid, because a solver computed it or a file without a solid held it.

        See Also
        --------
        Field.gradient : The direction of the distance alone.
        Solid.closest : The same of a solid.

        Examples
        --------
        >>> from signedheat import samples, signed_distance
        >>> phi = signed_distance(samples.sphere(2), resolution=16)
        >>> phi.closest([[0.0, 0.0, 3.0]]).points.round(3).tolist()
        [[0.0, 0.0, 1.0]]
        """
        if self.solid is None:
            raise SourceError(
                "the field holds no solid",
                remedy="take it from signed_distance or Solid.field; of files, only .npz keep it",
                element="field",
            )
        return self.solid.closest(points)

    def confidence_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """Return the confidence at points, which is 1 where the nearest surface point is given, not completed.

        Parameters
        ----------
        points : (..., d) float
            Positions, such as the vertices of an offset.

        Returns
        -------
        (...) float
            Numbers from 0 to 1. A field that holds its solid asks the solid. Otherwise values are interpolated, outside
            the domain at its nearest point, and all are 1 if the field has no confidence.

        See Also
        --------
        Solid.closest : Confidence of points without a grid.

        Examples
        --------
        >>> import signedheat as sh
        >>> line = Field(sh.Grid([0.0], 1.0, [2]), [0.0, 1.0], confidence=np.array([1.0, 0.5]))
        >>> line.confidence_at([[0.5]]).tolist()
        [0.75]
        """
        if self.solid is not None:
            return self.solid.closest(points).confidence
        clipped = self.domain._clipped(points)
        if self.confidence is None:
            return np.ones(np.shape(self._interpolant(clipped)), dtype=np.float32)[()]
        beyond: Any = None if self.coarse is None else self.coarse.confidence_at
        confidence = self.domain._interpolant(self.confidence.astype(np.float32), beyond)(clipped)
        return np.clip(confidence, 0, 1).astype(np.float32)

    @property
    def finest(self) -> Field[FieldDomain]:
        """The field on the domain on which its values were computed.

        This is `finer` if there is one with the same values at the vertices of this field, otherwise the field itself.
        """
        finer = self.finer
        if finer is None or not np.array_equal(finer.values[: len(self.values)], self.values, equal_nan=True):
            return self
        return finer

    @overload
    def restrict(self: Field[IntrinsicTriangulation]) -> Field[TriangleMesh]: ...
    @overload
    def restrict(self: Field[Embedded]) -> Field[Embedded]: ...
    @overload
    def restrict(self) -> Field[FieldDomain]: ...
    def restrict(self) -> Field[FieldDomain]:
        """Restrict the field to a plainer domain: a band to its coarse grid, or an intrinsic triangulation to its mesh.

        Returns
        -------
        Field
            Its values on the coarse grid or on the mesh. A field on any other domain returns itself.

        See Also
        --------
        Field.expand : The same with all detail.

        Examples
        --------
        >>> import signedheat as sh
        >>> strip = sh.TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = sh.intrinsic_delaunay(strip, refine=True)
        >>> phi = sh.SignedHeatSolver(better).distance(strip.points_at(0))
        >>> len(phi.values) == better.n_vertices, len(phi.restrict().values)
        (True, 4)
        """
        if self.coarse is not None:
            return self.coarse
        domain = self.domain._restricted()
        if domain is self.domain:
            return self
        return Field(domain, self.values[: domain._values_shape[0]], self.diagnostics, source=self.source)

    def expand(self) -> Field[FieldDomain]:
        """Convert to a field on a plain grid or mesh that keeps all detail, to draw, save or measure it.

        A band of nodes near the surface becomes its whole grid, with values from the coarse field at the other nodes.
        An intrinsic triangulation, also that of `finer`, has edges that cross faces of its mesh. It becomes a mesh of
        flat polygons, its `common_subdivision` with the mesh. On the cut surface of `piecewise_distance`, the vertices
        along the cut are doubled, so that values can jump.

        Returns
        -------
        Field
            Its values on that grid or mesh, in the same units. A field on any other domain returns itself.

        See Also
        --------
        Field.restrict : The same with less detail.

        Examples
        --------
        >>> import signedheat as sh
        >>> band = sh.complete(sh.samples.sphere(2)).field(resolution=48, band=0.2)
        >>> band.values.size < band.expand().values.size == band.domain.n_nodes
        True
        """
        fine = self.finest
        if isinstance(fine.domain, IntrinsicTriangulation):
            polygons, interpolate = common_subdivision(fine.domain)
            no_face = np.diff(interpolate.indptr) == 0  # rows that interpolate from nothing
            return Field(polygons, np.where(no_face, np.nan, interpolate @ fine.values), self.diagnostics)
        domain, values = self.domain._expanded(self.values, None if self.coarse is None else self.coarse.interpolate)
        return self if domain is self.domain else Field(domain, values, self.diagnostics, solid=self.solid)

    def plain(self) -> Field[FieldDomain]:
        """Convert to a field on a domain that files and viewers support, such as the faces of voxels or a full grid.

        Returns
        -------
        Field
            The converted field, or this field itself if its domain is supported already.

        See Also
        --------
        Field.save : Write a field.

        Examples
        --------
        >>> import signedheat as sh
        >>> cube = sh.DigitalSurface([[[True]]])
        >>> Field(cube, np.zeros(cube.n_vertices)).plain().domain
        TriangleMesh(14 vertices, 24 faces)
        """
        domain, values = self.domain._plain(self.values)
        return self if domain is self.domain else Field(domain, values, self.diagnostics)

    @overload
    def contour(self: Field[Grid[Literal[3]]] | Field[TetMesh], level: float = 0.0) -> TriangleMesh: ...
    @overload
    def contour(self: Field[Grid[Literal[2]]], level: float = 0.0) -> list[Polyline]: ...
    @overload
    def contour(self: Field[Grid], level: float = 0.0) -> TriangleMesh | list[Polyline]: ...
    @overload
    def contour(self: Field[LinearDomain], level: float = 0.0) -> list[Curve]: ...
    @overload
    def contour(self, level: float = 0.0) -> TriangleMesh | list[Polyline] | list[Curve]: ...
    @public_call
    def contour(self, level: float = 0.0) -> TriangleMesh | list[Polyline] | list[Curve]:
        """Extract the level set φ = level of the field φ.

        In space, the level set is a closed manifold mesh whose normals point to greater φ. Where it would leave the
        domain, as the completion of an open shape may do, it is closed along the box of the grid (1 % of a cell
        outside) or the boundary of the tets. Where values are NaN, it is closed along the last nodes with a value.

        In the plane and on surfaces, the level set is one open or closed line for each connected component, with
        greater φ to its left. Open lines end where the domain ends, where values are NaN, and at cuts.

        Parameters
        ----------
        level : float
            The value of φ on the level set, in the units of the domain; by default 0, the surface itself.

        Returns
        -------
        TriangleMesh, list of Polyline or list of Curve
            A mesh in space, polylines in the plane, or curves on a surface.

        Raises
        ------
        OutsideError
            If φ does not take the level anywhere on the domain.
        GeometryError
            If the grid has neither 2 nor 3 dimensions, values are infinite, or there is no cell with values.

        See Also
        --------
        Field.offset : The same, refused where the domain cuts it off.
        offset : Offsets with sharp corners, without a grid.
        contour : A level set of any function or array.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid = sh.Grid((-1, -1), 0.1, (21, 21))
        >>> disk = Field(grid, np.linalg.norm(grid.points, axis=-1) - 0.5)
        >>> [circle] = disk.contour(0.25)
        >>> circle.closed, round(circle.length / (2 * np.pi), 2)
        (True, 0.75)
        """
        level, fine = finite_number(level, "level"), self.finest
        exact = None if self.solid is None else self.solid.distance
        contour: TriangleMesh | list[Polyline] | list[Curve] = fine.domain._level_set(fine.values, level, exact)
        return contour

    @overload
    def offset(self: Field[Grid[Literal[3]]] | Field[TetMesh], distance: float) -> TriangleMesh: ...
    @overload
    def offset(self: Field[Grid[Literal[2]]], distance: float) -> list[Polyline]: ...
    @overload
    def offset(self: Field[Grid], distance: float) -> TriangleMesh | list[Polyline]: ...
    @overload
    def offset(self: Field[LinearDomain], distance: float) -> list[Curve]: ...
    @overload
    def offset(self, distance: float) -> TriangleMesh | list[Polyline] | list[Curve]: ...
    def offset(self, distance: float) -> TriangleMesh | list[Polyline] | list[Curve]:
        """Offset the shape by a signed distance; raise an error if the grid or tets are too small for the result.

        Parameters
        ----------
        distance : float
            Signed distance, positive outward, in the units of the domain.

        Returns
        -------
        TriangleMesh, list of Polyline or list of Curve
            The level set φ = distance: a mesh in space, polylines in the plane, or curves on a surface. If the field
            holds its solid and is not in a band, sharp edges and corners of the offset are kept. Otherwise it is the
            result of `contour`.

        Raises
        ------
        OutsideError
            If φ takes the distance nowhere, or if the offset leaves the grid or the tets and the shape does not.

        See Also
        --------
        Field.contour : The level set, cut off or not.
        offset : Offsets with sharp corners, without a grid.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid = sh.Grid((-1, -1), 0.1, (21, 21))
        >>> Field(grid, np.linalg.norm(grid.points, axis=-1) - 0.5).offset(-0.1)
        [Polyline(32 points, closed)]
        """
        distance, whole = finite_number(distance, "distance"), self.coarse or self
        walls = whole.domain._values_at_walls(whole.values)
        if isinstance(self.solid, MakesFields) and self.coarse is None:
            if np.nanmin(self.values) < distance < np.nanmin(walls):
                return cast("TriangleMesh", self.solid._surface_on(self, distance))
        refuse_beyond_walls(walls, distance)
        return self.contour(distance)

    def save_contour(self, path: str | PathLike[str], level: float = 0.0) -> tuple[int, int]:
        """Write the level set φ = level of the field φ in space to a file.

        The level set of a field in a band is computed and written part by part, so that it may be larger than memory.

        Parameters
        ----------
        path : str or path
            A ``.ply`` file. An existing file is replaced only after the new one is complete.
        level : float
            The value of φ on the level set, in the units of the domain; by default 0, the surface itself. In bands,
            sharp creases are chamfered by the cells.

        Returns
        -------
        vertices, faces : int
            Number of vertices and faces in the file.

        Raises
        ------
        OutsideError
            If φ does not take the level anywhere on the domain.
        GeometryError
            If the level set consists of lines, values are infinite, or there is no cell with values.
        FileFormatError
            If the file name does not end in ``.ply``, or the file cannot be written.

        See Also
        --------
        Field.contour : The level set itself.

        Examples
        --------
        >>> import tempfile
        >>> from signedheat import complete, samples
        >>> ball = complete(samples.sphere(4)).field(spacing=0.02, band=0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     vertices, faces = ball.save_contour(f"{folder}/ball.ply", 0.05)
        >>> 2 * vertices - faces  # closed, without handles
        4
        """
        exact = None if self.solid is None else self.solid.distance
        parts = self.domain._level_parts(self.values, finite_number(level, "level"), exact)
        return cast("tuple[int, int]", ply.write_parts(parts, path))

    def to_pyvista(self) -> pyvista.DataSet:
        """Convert the domain and the values of the field φ to a PyVista data set.

        Returns
        -------
        pyvista.DataSet
            `pyvista.ImageData` for a grid (with z = 0 in the plane), `pyvista.UnstructuredGrid` for tets, and
            `pyvista.PolyData` for a surface, cut open where φ jumps. A field in a band gives that of its coarse field.
            The point data ``signed_distance`` holds φ. If the field has a confidence, ``confidence`` holds it.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed.

        See Also
        --------
        Field.plot : Show the field.

        Examples
        --------
        >>> import signedheat as sh
        >>> Field(sh.Grid((0, 0), 1.0, (2, 2)), np.zeros((2, 2))).to_pyvista().array_names
        ['signed_distance']
        """
        plain = (self.coarse or self).plain()
        drawn: pyvista.DataSet = cast("Displayed", plain.domain).to_pyvista()
        if plain.confidence is not None:
            drawn.point_data["confidence"] = plain.confidence.ravel(order="F")
        with_values(drawn, plain.values.ravel(order="F"))
        return drawn

    def save(self, path: str | PathLike[str]) -> None:
        """Write the field φ to a file in the format given by its extension.

        Parameters
        ----------
        path : str or path
            For grids ``.npz``, ``.vti``, ``.nrrd``, ``.npy`` or ``.vdb``. For bands ``.npz``, ``.vdb`` or, with
            all nodes of the grid, ``.vti``. For tets ``.vtu``, ``.vtk`` or ``.msh``. For surfaces ``.ply`` or ``.vtp``
            with a property ``signed_distance`` per vertex, ``.obj`` with φ as a texture coordinate, or ``.npz``.
            `read_field` reads all of these but ``.vdb`` and ``.obj``. An existing file is replaced only after the new
            one is complete.

        Raises
        ------
        FileFormatError
            If the format is not one of these, or the file cannot be written.
        MissingPackageError
            If the format needs meshio, and it is not installed.

        See Also
        --------
        read_field : Read what was written.
        Field.save_contour : Write a level set.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> line = Field(sh.Grid(0.0, 1.0, 2), [0.0, 1.0])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     line.save(f"{folder}/line.npz")
        ...     sh.read_field(f"{folder}/line.npz").values.tolist()
        [0.0, 1.0]
        """
        files.write_field(self, path)

    def with_values(self, values: ArrayLike) -> Field[Domain]:
        """Return a field with new values on the same domain.

        Parameters
        ----------
        values : array
            The new values, in the shape of ``field.values``.

        Returns
        -------
        Field
            The new field. It has no diagnostics, source, confidence or solid.

        See Also
        --------
        Field.combined_with : A rule for the values of two fields.

        Examples
        --------
        >>> import signedheat as sh
        >>> line = Field(sh.Grid(0.0, 1.0, 3), [-1.0, 0.0, 1.0])
        >>> line.with_values(line.values**2).values.tolist()
        [1.0, 0.0, 1.0]
        """
        return Field(self.domain, cast("NDArray[Any]", values))

    def combined_with(self, other: Field[FieldDomain], rule: Rule) -> Field[Domain]:
        """Combine the values of two fields on the same domain by a function of two arrays.

        Parameters
        ----------
        other : Field
            A field on the same domain.
        rule : callable
            Elementwise function, such as `np.minimum`, of two arrays of the same shape: values of this field, and of
            the other at the same points. It returns an array of that shape. It is called again where the fields have
            values elsewhere, on the coarse grid of a band or on finer triangles.

        Returns
        -------
        Field
            The field of the values that the rule returns, without diagnostics, source, confidence and solid.

        Raises
        ------
        GeometryError
            If the fields lie on different domains of the same type.
        UnsupportedTypeError
            If their domains have different types.

        See Also
        --------
        morphology.smooth_union : A union with a rounded seam.

        Examples
        --------
        >>> import signedheat as sh
        >>> tet = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
        >>> phi = Field(tet, [0.0, 1.0, 2.0, 3.0])
        >>> phi.combined_with(3.0 - phi, np.minimum).values.tolist()
        [0.0, 1.0, 1.0, 0.0]
        """
        domain = self.domain._shared(other.domain)
        values = rule(self.values, other.values)
        if self.coarse is not None and other.coarse is not None:
            coarse = self.coarse.combined_with(other.coarse, rule)
            return Field(domain, np.asarray(values, dtype=self.values.dtype), coarse=coarse)
        triangulations = [f.finer.domain for f in (self, other) if f.finer is not None and f.finest is f.finer]
        if not triangulations:
            return Field(domain, values)
        finest = max(triangulations, key=lambda triangulation: triangulation.n_vertices)
        fine_values = rule(self._at_vertices_of(finest), other._at_vertices_of(finest))
        fine_values[: len(values)] = values  # the vertices of the mesh come first, and are not interpolated
        return Field(domain, values, finer=Field(finest, fine_values))

    def _at_vertices_of(self, triangulation: IntrinsicTriangulation) -> Floats:
        """Return (n_vertices,) φ at the vertices of an intrinsic triangulation, NaN at vertices without a face."""
        if self.finest.domain is triangulation:
            return self.finest.values
        faces, weights = triangulation.vertex_places
        used = np.flatnonzero(faces >= 0)
        values = np.full(len(faces), np.nan)
        values[used] = self(SurfacePoints(faces[used], weights[used]))
        return values

    def _mapped(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Field[Domain]:
        """Return the field of ``change(values)``, without diagnostics, source, confidence and solid."""
        return self.combined_with(self, lambda phi, _: change(phi))

    def _scaled(self, factor: float) -> Field[Domain]:
        """Return the field times a number, with the scaled solid if there is one and the number is finite and not 0."""
        exact = self.solid is not None and factor != 0 and math.isfinite(factor)
        result = self._mapped(lambda phi: phi * factor)
        coarse = None if self.coarse is None else self.coarse._scaled(factor)
        return replace(
            result,
            domain=self.domain._stretched(factor),
            confidence=self.confidence,
            solid=scaled(self.solid, factor) if exact and self.solid is not None else None,
            coarse=coarse,
        )

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __neg__(self) -> Field[Domain]:
        return self._scaled(-1.0)

    def __abs__(self) -> Field[Domain]:
        return self._mapped(np.abs)

    def __mul__(self, factor: Number) -> Field[Domain]:
        return self._scaled(finite(factor)) if isinstance(factor, NUMBER_TYPES) else NotImplemented

    def __truediv__(self, divisor: Number) -> Field[Domain]:
        if not isinstance(divisor, NUMBER_TYPES):
            return NotImplemented
        return self._scaled(finite(1.0 / finite(divisor) if divisor else np.inf))

    def __add__(self, summand: Number) -> Field[Domain]:
        if not isinstance(summand, NUMBER_TYPES):
            return NotImplemented
        level = finite(summand)
        return self._mapped(lambda phi: phi + level) if level else self._scaled(1.0)

    def __rsub__(self, level: Number) -> Field[Domain]:
        if not isinstance(level, NUMBER_TYPES):
            return NotImplemented
        number = finite(level)
        return self._mapped(lambda phi: number - phi)

    __radd__ = __add__
    __rmul__ = __mul__

    def __or__(self, other: Field[FieldDomain] | MakesFields) -> Field[Domain]:
        """Return the union of two solids, which is negative where at least one of the two fields is."""
        return self._of_solids(other, operator.or_) or combined(self, other, np.less_equal, 0.0)

    def __and__(self, other: Field[FieldDomain] | MakesFields) -> Field[Domain]:
        """Return the intersection of two solids, which is negative where both fields are."""
        return self._of_solids(other, operator.and_) or combined(self, other, np.greater_equal, 0.0)

    def __sub__(self, other: Field[FieldDomain] | MakesFields | Number) -> Field[Domain]:
        """Return the difference of two solids, negative where only this field is; subtract a number from the values."""
        if isinstance(other, NUMBER_TYPES):
            return self + -finite(other)
        exact = self._of_solids(other, operator.sub)
        return exact or combined(self, checked(self, other)._mapped(np.negative), np.greater_equal, 0.0)

    def __invert__(self) -> Field[Domain]:
        """Return the complement of the solid, with inside and outside exchanged."""
        return self._scaled(-1.0)

    def _of_solids(self, other: object, operation: Callable[[Any, Any], Any]) -> Field[Domain] | None:
        """Combine the solids that two fields hold, and compute the field of the result on this domain.

        `operation` combines two solids, as `operator.or_` does. Returns None if one of the fields holds no solid, or
        nothing is inside the result.
        """
        other_solid = other if isinstance(other, MakesFields) else getattr(other, "solid", None)
        if not isinstance(self.solid, MakesFields) or not isinstance(other_solid, MakesFields):
            return None
        if not isinstance(other, MakesFields):
            checked(self, other)
        try:
            solid = operation(self.solid, other_solid)
        except SourceError:
            return None
        return cast("Field[Domain]", solid.field_on(self))

    def __repr__(self) -> str:
        low, high = (float(f.reduce((self.coarse or self).values, axis=None)) for f in (np.fmin, np.fmax))
        between = "exact" if self.solid is not None else "interpolated"
        return f"Field({self.domain!r}, values from {low:.4g} to {high:.4g}, {between})"


def refuse_beyond_walls(walls: NDArray[Any], distance: float) -> None:
    """Raise `OutsideError` if the level set φ = distance leaves a domain that the zero set does not leave.

    `walls` has the values on the walls of the domain, and is empty for domains without walls. The zero set does not
    leave the domain if they all have the same sign.
    """
    if not walls.size:
        return
    low, high = float(np.fmin.reduce(walls)), float(np.fmax.reduce(walls))
    if (low > 0 or high < 0) and low < distance < high:
        raise OutsideError(
            f"the surface at distance {distance:g} leaves the domain, which holds distances up to "
            f"{low if low > 0 else high:g}",
            remedy=f"use a domain that reaches more than {abs(distance):g} beyond the shape (for a grid, padding), or "
            "a larger diffusion where wide gaps stay open",
        )


def combined(
    a: Field[Domain],
    b: Field[FieldDomain] | MakesFields,
    takes_first: Callable[[Floats, Floats], Bools],
    bulge: float,
) -> Field[Domain]:
    """Return the field with the values of `a` where ``takes_first(a, b)``, else of `b`, and a rounded seam between.

    Where the two differ by less than w = |bulge|, (w − |a − b|)² / 4w is added, or subtracted if `bulge` is negative.
    Values are NaN where one of the two is.
    """

    def rule(first: Floats, second: Floats) -> Floats:
        """Combine values of both fields at the same places, in arrays of any one shape."""
        values = np.where(takes_first(first, second), first, second)
        if bulge:
            overlap = np.maximum(abs(bulge) - np.abs(first - second), 0.0)
            values = values + overlap**2 / (4 * bulge)
        values[np.isnan(first) | np.isnan(second)] = np.nan
        return values

    return a.combined_with(checked(a, b), rule)


def checked(a: object, b: object) -> Field[FieldDomain]:
    """Return the second operand `b` as a field on the domain of the field `a`.

    A solid becomes its field on that domain. Anything but a field or a solid, and a field on another domain, raises an
    error.
    """
    if isinstance(a, Field) and isinstance(b, MakesFields):
        b = b.field_on(a)
    if not isinstance(a, Field) or not isinstance(b, Field):
        name = type(a if isinstance(b, Field) else b).__name__
        raise UnsupportedTypeError(
            f"a field is not combined with a {name}", remedy="pass a field on the same domain", element=name
        )
    a.domain._shared(b.domain)
    return b
