"""Distance at the vertices of a surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen, Ints
from ..diagnostics import Diagnostics
from ..discretization import SourceTerm
from ..errors import GeometryError, OutsideError, UnsupportedTypeError
from ..exchange import Displayed, with_values
from ..field_arithmetic import Combinable, Rule
from ..foreign import SurfaceShape
from ..kinds import EmbeddedSurface, SurfaceDomain
from ..mesh.surface_points import refuse_missing
from ..mesh.triangles import gradients_along
from ..packages import lazy_module
from ..validation import contiguous, finite_number, query_points, shaped
from .intrinsic_triangulation import IntrinsicTriangulation
from .point_cloud import PointCloud
from .polygon_mesh import PolygonMesh
from .subdivision import common_subdivision
from .surface import Surface as AnySurface
from .surface import closest_points
from .surface_curves import Curve, SurfacePoints
from .triangle_mesh import TriangleMesh

files: Any = lazy_module("signedheat.io.field_files", "files")

if TYPE_CHECKING:
    import pyvista
    from typing_extensions import TypeVar

    Surface = TypeVar("Surface", bound=SurfaceDomain, default=SurfaceDomain, covariant=True)
else:
    from typing import TypeVar

    Surface = TypeVar("Surface", bound=SurfaceDomain, covariant=True)

Embedded = TypeVar("Embedded", bound=EmbeddedSurface)


@dataclass(frozen=True, eq=False)
class VertexField(Displayed, Combinable, Frozen, Generic[Surface]):
    """Signed distance at the vertices of a surface, linear on its triangles.

    Attributes
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface.
    values : (n_vertices,) float
        φ, in the units of the vertices; NaN where no source is connected.
    diagnostics : Diagnostics
        Timings, diffusion time, and notes on the computation.
    source : SourceTerm, optional
        The lowered source, which `sharpen` needs.
    finer : VertexField, optional
        φ on an intrinsic triangulation of the mesh, at whose vertices it was computed: contours, values at points and
        sharpening use these too.

    Raises
    ------
    UnsupportedTypeError
        If the domain is not a surface.
    GeometryError
        If there is not one number for each vertex.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    SignedHeatSolver : The signed heat method alone.
    PiecewiseField : Values that may jump on a surface.

    Examples
    --------
    >>> import signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> phi = VertexField(mesh, np.array([-0.5, 0.5, 0.5, -0.5]))
    >>> phi([[0.75, 0.5, 0.0]]).round(3)
    array([0.25])
    >>> phi.face_gradients.tolist()
    [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    >>> phi.contour(0.0)
    [Curve(3 points, open, oriented)]
    """

    domain: Surface
    values: Floats
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    source: SourceTerm | None = field(default=None, repr=False)
    finer: VertexField[IntrinsicTriangulation] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.domain, AnySurface | IntrinsicTriangulation):
            raise UnsupportedTypeError(f"{self.domain!r:.80} is not a surface", element="domain")
        values = contiguous(self.values, "values")
        if values.shape != (self.domain.n_vertices,):
            raise GeometryError(
                f"values have shape {values.shape}, but the surface has {self.domain.n_vertices} vertices",
                element="values",
            )
        object.__setattr__(self, "values", values)

    def __call__(self, points: Curve | SurfacePoints | ArrayLike) -> Floats:
        """Evaluate φ at points of the surface, linearly between vertices.

        Parameters
        ----------
        points : SurfacePoints, Curve or (..., 3) float
            Points on the surface, or positions in space, for which the closest points of the surface are taken.

        Returns
        -------
        (...) float
            Signed distances, in the shape of the points.
        """
        finest = self.finest
        faces, weights, shape = self._at(points)
        if isinstance(finest.domain, IntrinsicTriangulation):
            faces, weights = finest.domain.locate(faces, weights)
            values, triangles = finest.values, finest.domain.faces
        else:
            values, triangles = finest.domain.on_triangulation(finest.values), finest.domain.triangulation.faces
        return shaped(np.einsum("ik,ik->i", weights, values[triangles[faces]]), shape)

    @property
    def finest(self) -> VertexField[SurfaceDomain]:
        """The field where φ was computed: `finer`, if its values are still the same, or the field itself."""
        finer = self.finer
        if finer is None or not np.array_equal(finer.values[: len(self.values)], self.values, equal_nan=True):
            return cast("VertexField[SurfaceDomain]", self)
        return cast("VertexField[SurfaceDomain]", finer)

    def gradient(self, points: Curve | SurfacePoints | ArrayLike) -> Floats:
        """Evaluate ∇φ in space at points, in the triangles on which φ is linear.

        Parameters
        ----------
        points : Curve, SurfacePoints, or (..., 3) float
            As for calling the field: on the surface, or positions that are projected onto it.

        Returns
        -------
        (..., 3) float
            Gradients; of length about 1, since φ is a distance.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> phi = VertexField(mesh, np.array([-0.5, 0.5, 0.5, -0.5]))
        >>> phi.gradient([[0.75, 0.5, 0.0]]).tolist()
        [[1.0, 0.0, 0.0]]
        """
        finest = self.finest
        faces, weights, shape = self._at(points)
        if isinstance(finest.domain, IntrinsicTriangulation):
            return shaped(finest.domain.gradient(finest.values, faces, weights), shape)
        return shaped(self.face_gradients[faces], shape)

    @cached_property
    def face_gradients(self) -> Floats:
        """(m, 3) ∇φ on the faces of the domain's triangulation, in space; of length about 1, since φ is a distance.

        φ is interpolated between the vertices of the domain; where it was computed on finer triangles, `gradient` is
        more accurate. Gradients are zero on degenerate faces.
        """
        field = self._embedded
        mesh = field.domain.triangulation
        values, corners = field.domain.on_triangulation(field.values)[mesh.faces], mesh.vertices[mesh.faces]
        return gradients_along(corners[:, 1:] - corners[:, :1], values[:, 1:] - values[:, :1])

    def contour(self, level: float = 0.0) -> list[Curve]:
        """Find the level set φ = level, as curves on the surface.

        Parameters
        ----------
        level : float
            The level, in the units of the vertices.

        Returns
        -------
        list of Curve
            One for each connected component, open or closed; greater φ is to its left.

        Raises
        ------
        OutsideError
            If φ does not take the level.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> phi = VertexField(mesh, np.array([-0.5, 0.5, 0.5, -0.5]))
        >>> [line] = phi.contour(0.25)
        >>> mesh.positions(line)[:, 0].tolist()
        [0.75, 0.75, 0.75]
        """
        field, level = self.finest, finite_number(level, "level")
        finite = field.values[np.isfinite(field.values)]
        low, high = (float(finite.min()), float(finite.max())) if len(finite) else (np.nan, np.nan)
        least = 1e-12 * max(high - low, 0.0)
        if not low - least <= level <= high + least:
            raise OutsideError(
                f"φ does not reach level {level:g}: it goes from {low:g} to {high:g}",
                remedy="choose a level in between",
                element=f"level {level:g}",
            )
        return field.domain.level_set(field.values, level)

    def combined_with(self, other: VertexField[Surface], rule: Rule) -> VertexField[Surface]:
        # combine φ on the finer triangles of either field, too
        result = self.with_values(rule(self.values, other.values))
        finer = [field.finer for field in (self, other) if field.finest is field.finer]
        if not finer:
            return result
        domain = max((field.domain for field in finer if field), key=lambda triangulation: triangulation.n_vertices)
        values = rule(self._at_vertices_of(domain), other._at_vertices_of(domain))
        values[: len(result.values)] = result.values
        return replace(result, finer=VertexField(domain, values))

    def _at_vertices_of(self, domain: IntrinsicTriangulation) -> Floats:
        """φ at the vertices of an intrinsic triangulation of the mesh; NaN at vertices without a face."""
        if self.finest.domain is domain:
            return self.finest.values
        faces, weights = domain.vertex_places
        used = np.flatnonzero(faces >= 0)
        values = np.full(len(faces), np.nan)
        values[used] = self(SurfacePoints(faces[used], weights[used]))
        return values

    def to_pyvista(self) -> pyvista.PolyData:
        simple = on_simple_surface(self)
        return with_values(simple.domain.to_pyvista(), simple.values)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the surface with φ at its vertices, in the format given by the extension.

        ``.ply`` and ``.vtp`` have a property ``signed_distance`` per vertex, ``.obj`` a texture coordinate,
        ``.npz`` the arrays ``values``, ``vertices`` and ``faces``.

        Parameters
        ----------
        path : str or path
            The file. It is written under a temporary name and renamed, so that an existing file survives a failure.

        Raises
        ------
        FileFormatError
            If the format is unknown or the file cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> phi = VertexField(mesh, np.array([0.0, 1.0, 0.0]))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     phi.save(f"{folder}/phi.ply")
        ...     sh.read_field(f"{folder}/phi.ply").values.tolist()
        [0.0, 1.0, 0.0]
        """
        files.write_field(self._embedded, path)

    @overload
    def restrict(self: VertexField[IntrinsicTriangulation]) -> VertexField[TriangleMesh]: ...
    @overload
    def restrict(self: VertexField[Embedded]) -> VertexField[Embedded]: ...
    def restrict(self) -> VertexField[EmbeddedSurface]:
        """Restrict φ to the vertices of the mesh, if the domain is an intrinsic triangulation of one.

        On any other domain this is the field itself.

        Returns
        -------
        VertexField
            On the mesh.

        Examples
        --------
        >>> import signedheat as sh
        >>> strip = sh.TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = sh.intrinsic_delaunay(strip, refine=True)
        >>> phi = sh.SignedHeatSolver(better).distance(strip.points_at(0))
        >>> len(phi.values) == better.n_vertices, len(phi.restrict().values)
        (True, 4)
        """
        return self._embedded

    def subdivided(self) -> VertexField[EmbeddedSurface]:
        """Subdivide the surface into flat pieces on which φ is linear, to draw, save or measure in space.

        Where φ was computed on an intrinsic triangulation of the mesh (the domain, or `finer`), these are the polygons
        into which edges of the mesh cut its triangles (`common_subdivision`); their first vertices are those of the
        mesh, and φ is NaN at vertices of no face. Elsewhere the field is returned as it is.

        Returns
        -------
        VertexField
            On triangles or polygons in space.

        Examples
        --------
        >>> import signedheat as sh
        >>> strip = sh.TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> phi = sh.SignedHeatSolver(strip, intrinsic=True).distance(strip.polyline([[4, 0, 0], [4, 1, 0]]))
        >>> len(phi.subdivided().values) > len(phi.values)
        True
        """
        fine = self.finest
        if not isinstance(fine.domain, IntrinsicTriangulation):
            return self._embedded
        polygons, interpolate = common_subdivision(fine.domain)
        no_face = np.diff(interpolate.indptr) == 0  # rows that interpolate from nothing
        return VertexField(polygons, np.where(no_face, np.nan, interpolate @ fine.values), self.diagnostics)

    def __repr__(self) -> str:
        low, high = (float(f.reduce(self.values)) for f in (np.fmin, np.fmax))
        return f"VertexField({self.domain!r}, values from {low:.4g} to {high:.4g})"

    @property
    def _embedded(self) -> VertexField[EmbeddedSurface]:
        if isinstance(self.domain, IntrinsicTriangulation):
            mesh = self.domain.mesh
            return VertexField(mesh, self.values[: mesh.n_vertices], self.diagnostics, self.source)
        return cast("VertexField[EmbeddedSurface]", self)

    def _at(self, points: Curve | SurfacePoints | ArrayLike) -> tuple[Ints, Floats, tuple[int, ...]]:
        """(n,) faces of points and (n, 3) barycentric coordinates in them, and the shape that the points have."""
        mesh = self._embedded.domain.triangulation
        if isinstance(points, (Curve, SurfacePoints)):
            refuse_missing("face", points.faces, mesh.n_faces)
            return points.faces, points.barycentric, points.faces.shape
        places, shape = query_points(points, 3)
        faces, weights, _ = closest_points(mesh, places)
        return faces, weights, shape


def on_simple_surface(field: VertexField) -> VertexField[SurfaceShape]:
    """Put a field on a surface that files support: a triangulation's own mesh; triangles in place of voxel faces."""
    embedded = field._embedded
    domain = embedded.domain
    if isinstance(domain, TriangleMesh | PolygonMesh | PointCloud):
        return VertexField(domain, embedded.values)
    return VertexField(domain.triangulation, domain.on_triangulation(embedded.values))
