"""The base class of surface domains, which place curves and points, and extract level sets and boundaries as curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Frozen, Ints
from ..errors import OutsideError, SourceError
from ..fields.field_domain import Exact, FieldDomain
from ..geodesics.shortest_paths import join
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.polylines import assemble_polylines, leaving
from ..mesh.surface_points import (
    ZERO_COORDINATE,
    barycentric_on_edges,
    corners_at,
    crossed_sides,
    locate_points,
    refuse_missing,
)
from ..mesh.triangles import Triangles, area_vectors, gradients_along
from ..packages import lazy_module
from ..search.nearest_triangles import TriangleTree
from ..validation import array_of, coordinates, finite_number, flag, numbers, public_call, query_points, shaped
from .surface_curves import Curve, CurveOrPoints, SurfacePoints

surface_paths: Any = lazy_module("signedheat.surfaces.surface_paths", "shortest paths")
Place: TypeAlias = int | ArrayLike | CurveOrPoints | Sequence[CurveOrPoints]
"""A vertex, points in space, or curves and points on a surface."""

ONE_CROSSING = 2e-5
"""Consecutive points of a curve count as one up to this distance, relative to a face's least height. Where rounding
moves a line off a vertex, it crosses the edges there at points up to 1e-5 apart. Of 22,000 steps of completed curves on
spheres none is between 3e-6 and 3e-5, and 15 are between 3e-5 and 1e-3."""


def level_set(mesh: Triangles, values: Floats, level: float) -> list[Curve]:
    """Extract a level set of (n,) values at vertices, linear in faces, as curves with greater values to their left.

    Values equal to the level count as greater. Faces with a NaN corner are skipped. If the faces are not consistently
    oriented, the curves get normals.
    """
    faces, edges = mesh.faces, mesh.edges
    values = snapped(values, edges.vertices, level)
    finite = np.asarray(np.isfinite(values)[faces].all(axis=1))
    crossed, sides = crossed_sides((values >= level)[faces], finite)
    on_edges = edges.face_edges[crossed[:, None], sides]

    tail, head = (values[edges.vertices[:, k]] for k in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = np.clip((level - tail) / (head - tail), 0.0, 1.0)
    oriented = is_consistent(mesh)
    normals = None if oriented else gradient_directions(mesh, values, crossed)
    curves = []
    for order, backwards, closed in assemble_polylines(on_edges[:, 0], on_edges[:, 1], directed=oriented):
        first = np.where(backwards, sides[order, 1], sides[order, 0])
        last = np.where(backwards, sides[order, 0], sides[order, 1])[-1:]
        face = crossed[order]
        if not closed:
            face, first = np.append(face, face[-1]), np.append(first, last)
        weights = barycentric_on_edges(edges, face, first, along[edges.face_edges[face, first]])
        own = None if normals is None else normals[order]
        curves.append(Curve(face, weights, closed=closed, normals=own))
    return without_repeats(mesh, curves)


def checked_levels(values: ArrayLike, level: float, n_vertices: int) -> tuple[Floats, float]:
    """Return (n_vertices,) values and a level as floats; raise `SourceError` if there is not one value per vertex."""
    at_vertices, height = numbers(values, "values", SourceError), finite_number(level, "level")
    if at_vertices.shape != (n_vertices,):
        raise SourceError(
            f"a level set needs one value per vertex: {n_vertices}, not an array {at_vertices.shape}", element="values"
        )
    return at_vertices, height


def without_repeats(mesh: Triangles, curves: Sequence[Curve]) -> list[Curve]:
    """Drop points of curves that nearly coincide with the next one (see `ONE_CROSSING`), and curves of one point."""
    kept_curves = []
    for curve in curves:
        corners = mesh.vertices[mesh.faces[curve.faces]]
        points = np.einsum("ik,ikd->id", curve.barycentric, corners)
        sides = np.roll(corners, -1, axis=1) - corners
        longest = np.linalg.norm(sides, axis=2).max(axis=1)
        twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        room = ONE_CROSSING * twice / np.where(longest > 0, longest, 1.0)
        kept = leaving(points, curve.closed, room)
        if len(kept) > 1:
            leaves = kept if curve.closed else kept[:-1]
            normals = None if curve.normals is None else curve.normals[leaves]
            kept_curves.append(Curve(curve.faces[kept], curve.barycentric[kept], curve.closed, curve.oriented, normals))
    return kept_curves


def snapped(values: Floats, ends: Ints, level: float) -> Floats:
    """(n,) values, set to the level where they differ from it by rounding only; `ends` are the (e, 2) edges."""
    with np.errstate(invalid="ignore"):  # values may be infinite
        steps = np.abs(values[ends[:, 0]] - values[ends[:, 1]])
    steps[~np.isfinite(steps)] = 0.0
    steepest = np.zeros(len(values))
    np.maximum.at(steepest, ends, steps[:, None])
    return np.where(np.abs(values - level) <= ZERO_COORDINATE * steepest, level, values)


def gradient_directions(mesh: Triangles, values: Floats, faces: Ints) -> Floats:
    """(k, 3) gradients on (k,) faces of (n,) values at vertices, each up to a positive factor."""
    corners = mesh.vertices[mesh.faces[faces]]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    of_corners = np.cross(area_vectors(corners)[:, None], opposite)
    rise = values[mesh.faces[faces]]
    most = np.abs(rise).max(axis=1, keepdims=True, initial=0.0)
    rise = rise / np.where(most > 0, most, 1.0)  # so that their sum does not overflow
    return np.einsum("ik,ikj->ij", rise - rise.mean(axis=1, keepdims=True), of_corners)


def along_sides(mesh: Triangles, chosen: Bools) -> list[Curve]:
    """Assemble curves along the sides of faces that are `chosen`, (m, 3) bool, with these faces to their left."""
    faces, sides = np.nonzero(chosen)
    following = (sides + 1) % 3
    tails, heads = mesh.faces[faces, sides], mesh.faces[faces, following]
    oriented = is_consistent(mesh)
    curves = []
    for order, backwards, closed in assemble_polylines(tails, heads, directed=oriented):
        face = faces[order]
        corner = np.where(backwards, following[order], sides[order])
        if not closed:
            face = np.append(face, face[-1])
            corner = np.append(corner, sides[order[-1]] if backwards[-1] else following[order[-1]])
        normals = None if oriented else inward(mesh, faces[order], sides[order])
        curves.append(Curve(face, np.eye(3)[corner], closed=closed, normals=normals))
    return curves


def inward(mesh: Triangles, faces: Ints, sides: Ints) -> Floats:
    """(k, 3) directions in the planes of (k,) faces, orthogonal to one side of each, (k,), and pointing inwards."""
    corners = mesh.vertices[mesh.faces[faces]]
    row = np.arange(len(faces))
    along = corners[row, (sides + 1) % 3] - corners[row, sides]
    return np.cross(area_vectors(corners), along)


def is_consistent(mesh: Triangles) -> bool:
    """Whether the faces are consistently oriented: no two run along an edge in the same direction."""
    edges = mesh.edges
    return bool((edges.face_counts + np.abs(edges.balance) <= 2).all())


class LinearDomain(FieldDomain):
    """A surface on which fields are linear in each triangle, and level sets are curves."""

    level_set: Callable[[Floats, float], list[Curve]]

    @property
    def n_vertices(self) -> int:
        """Number of values that a field on the surface has."""
        raise NotImplementedError

    @property
    def _values_shape(self) -> tuple[int, ...]:
        """A field has one value for each vertex."""
        return (self.n_vertices,)

    def _level_set(self, values: Floats, level: float, exact: Exact | None) -> list[Curve]:
        """Extract a level set of (n,) values as curves; raise `OutsideError` if no value reaches the level."""
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if len(finite) else (np.nan, np.nan)
        least = 1e-12 * max(high - low, 0.0)
        if not low - least <= level <= high + least:
            raise OutsideError(
                f"φ does not reach level {level:g}: it goes from {low:g} to {high:g}",
                remedy="choose a level in between",
                element=f"level {level:g}",
            )
        return self.level_set(values, level)


class Surface(Frozen, LinearDomain):
    """A domain on which curves and points can be placed.

    Face ids of curves and points refer to `triangulation`, vertex ids to the domain.
    """

    @property
    def triangulation(self) -> PlaceableTriangles:
        """The triangles that curves refer to."""
        raise NotImplementedError

    @property
    def n_vertices(self) -> int:
        """Number of values that a field on the surface has."""
        return self.triangulation.n_vertices

    def _interpolant(self, values: Floats, beyond: Exact | None) -> SurfaceInterpolant:
        """Return the function that interpolates (n,) values linearly in the triangles."""
        return SurfaceInterpolant(self.triangulation, self.on_triangulation(values))

    def on_triangulation(self, values: Floats) -> Floats:
        """Extend values at the vertices of the surface to its `triangulation`, the same surface in triangles.

        Parameters
        ----------
        values : (n,) float
            One for each vertex of the surface, in any units.

        Returns
        -------
        (m,) float
            One for each vertex of the triangulation, in the same units. At vertices added within polygons, values are
            interpolated.

        See Also
        --------
        Field.expand : A field on the vertices of the triangulation.

        Examples
        --------
        >>> import signedheat as sh
        >>> square = sh.PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
        >>> square.on_triangulation(np.array([0.0, 1.0, 1.0, 0.0])).tolist()
        [0.0, 1.0, 1.0, 0.0, 0.5]
        """
        return values

    def path(self, vertices: ArrayLike, closed: bool = False, oriented: bool = True) -> Curve:
        """Join vertices, in order, by a curve.

        Parameters
        ----------
        vertices : (n,) int
            Vertex ids. Consecutive vertices that share no face are joined by a geodesic path.
        closed : bool
            Whether the last vertex is joined to the first.
        oriented : bool
            Whether the curve has a positive side, to its left, and a negative side.

        Returns
        -------
        Curve
            A curve on this surface.

        Raises
        ------
        SourceError
            If there are fewer than two vertices, or one does not exist or has no face.

        See Also
        --------
        TriangleMesh.polyline : Points in space, joined by geodesics.
        TriangleMesh.shortest_path : The shortest curve between two vertices.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).path([0, 1])
        Curve(2 points, open, oriented)
        """
        faces, weights = self._at_vertices(vertices, "point of the path")
        return Curve(faces, weights, closed=closed, oriented=oriented)

    @public_call
    def shortest_path(self, start: Place, end: Place) -> Curve:
        """Find the shortest path along the surface, exactly: it is straight in faces, and may bend at vertices.

        Parameters
        ----------
        start : int, (3,) float, Curve or SurfacePoints; or several of these two
            The id of a vertex, a point in space, which stands for the nearest point of the surface, or curves and
            points. Of these, the path begins at the nearest. With ``field.contour()``, it begins at the zero set of a
            field.
        end : int, (3,) or (n, 3) float, or SurfacePoints
            The id of a vertex, or points, in space in the units of the surface. Of several, the path leads to the
            nearest.

        Returns
        -------
        Curve
            An unoriented curve from start to end. Its length is the geodesic distance.

        Raises
        ------
        SourceError
            If the two lie on different connected components or coincide, or a vertex or point does not exist.

        See Also
        --------
        signed_distance : Distance of all vertices from curves and points.
        Curve : What is returned.

        Examples
        --------
        Over two sides of a cube, between opposite corners:

        >>> import signedheat as sh
        >>> cube = sh.DigitalSurface([[[True]]]).squares
        >>> path = cube.shortest_path([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])
        >>> steps = np.diff(cube.positions(path), axis=0)
        >>> round(float(np.linalg.norm(steps, axis=1).sum() ** 2), 6)
        5.0
        """
        return surface_paths.shortest_path(self, start, end)

    def points_at(self, vertices: ArrayLike) -> SurfacePoints:
        """Return vertices as isolated point sources, from which distance grows in all directions.

        Parameters
        ----------
        vertices : int or (n,) int
            Vertex ids.

        Returns
        -------
        SurfacePoints
            Points on this surface.

        Raises
        ------
        SourceError
            If there is no vertex, or one does not exist or has no face.

        See Also
        --------
        TriangleMesh.path : Vertices joined by a curve.
        signed_distance : Distance to points and curves.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).points_at(2)
        SurfacePoints(1 point)
        """
        return SurfacePoints(*self._at_vertices(vertices, "point"))

    def positions(self, points: Curve | SurfacePoints) -> Floats:
        """Return the positions in space of the points of a curve, or of isolated points.

        Parameters
        ----------
        points : Curve or SurfacePoints
            A curve or points on this surface.

        Returns
        -------
        (n, 3) float
            Positions, in the units of the surface.

        Raises
        ------
        SourceError
            If one lies in a face that does not exist.

        See Also
        --------
        TriangleMesh.polyline : From positions in space to a curve.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> mesh.positions(mesh.level_set([0.0, 1.0, 1.0], 0.5)[0]).tolist()
        [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0]]
        """
        triangles = self.triangulation
        refuse_missing("face", points.faces, triangles.n_faces)
        corners = triangles.vertices[triangles.faces[points.faces]]
        return np.einsum("nk,nkd->nd", points.barycentric, corners)

    def polyline(
        self, points: ArrayLike, closed: bool = False, oriented: bool = True, max_distance: float | None = None
    ) -> Curve:
        """Project the points of a polyline in space on the surface, and join them by geodesic paths.

        Parameters
        ----------
        points : (n, 3) float
            Positions in order, in the units of the surface.
        closed : bool
            Whether the last point is joined to the first.
        oriented : bool
            Whether the curve has a positive side, to its left, and a negative side.
        max_distance : float, optional
            Largest distance of a point from the surface, in its units; 5 % of the diagonal of its bounding box by
            default.

        Returns
        -------
        Curve
            A curve on this surface, with a segment for each face that it crosses.

        Raises
        ------
        SourceError
            If a point is too far away, or two consecutive points are not connected on the surface.

        See Also
        --------
        TriangleMesh.path : A curve along vertices.
        TriangleMesh.shortest_path : The shortest curve between two vertices.
        close_curves : Complete broken curves.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> mesh.polyline([[0.8, 0.2, 0.01], [0.2, 0.8, 0.01]]).barycentric.round(3).tolist()
        [[0.2, 0.6, 0.2], [0.5, 0.0, 0.5], [0.2, 0.2, 0.6]]
        """
        closed, oriented = flag(closed, "closed"), flag(oriented, "oriented")
        return projected_curve(self.triangulation, points, closed, oriented, max_distance)

    def level_set(self, values: ArrayLike, level: float = 0.0) -> list[Curve]:
        """Find the curves on which a function equals a level, with greater values to their left.

        Parameters
        ----------
        values : (n_vertices,) float
            The function at the vertices, linear in each triangle. Faces with a NaN corner are skipped.
        level : float
            The level, in the units of the function; 0 by default.

        Returns
        -------
        list of Curve
            One for each connected component, open or closed; none if the function does not take the value. Curves cross
            seams, which are edges whose vertices are given twice, if the values agree on both sides of all seams.

        Raises
        ------
        SourceError
            If there is not one value per vertex.
        SignedHeatError
            If the level is not finite.

        See Also
        --------
        TriangleMesh.region_boundary : The boundary of some of the faces.
        Field.contour : The level set of a distance.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).level_set([0.0, 1.0, 1.0], 0.5)
        [Curve(2 points, open, oriented)]
        """
        at_vertices, height = checked_levels(values, level, self.n_vertices)
        mesh, at_corners = self.triangulation, self.on_triangulation(at_vertices)
        seams_agree = np.array_equal(at_corners[mesh.places], at_corners, equal_nan=True)
        return level_set(mesh.joined if seams_agree else mesh, at_corners, height)

    def region_boundary(self, face_mask: ArrayLike) -> list[Curve]:
        """Find the boundary of a region of faces, with the region to its left.

        Parameters
        ----------
        face_mask : (n_faces,) bool
            True for the faces of the region.

        Returns
        -------
        list of Curve
            Curves along edges between the region and other faces; the boundary of the surface does not count.

        Raises
        ------
        SourceError
            If there is not one boolean per face.

        See Also
        --------
        TriangleMesh.boundary_curves : The boundary of the whole surface.
        TriangleMesh.level_set : Where a function has a value.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> mesh.region_boundary([True, False])
        [Curve(2 points, open, oriented)]
        """
        mask = self._triangle_mask(array_of(face_mask, "face_mask", SourceError))
        edges = self.triangulation.edges
        inside = np.bincount(edges.face_edges.ravel(), np.repeat(mask, 3), len(edges.vertices))
        between = (inside > 0) & (inside < edges.face_counts)
        return along_sides(self.triangulation, between[edges.face_edges] & mask[:, None])

    def boundary_curves(self) -> list[Curve]:
        """Find the boundary of the surface, with the surface to its left.

        Returns
        -------
        list of Curve
            Closed loops, split at vertices where they touch each other.

        See Also
        --------
        TriangleMesh.region_boundary : The boundary of some of the faces.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).boundary_curves()
        [Curve(3 points, closed, oriented)]
        """
        edges = self.triangulation.edges
        return along_sides(self.triangulation, (edges.face_counts == 1)[edges.face_edges])

    def _at_vertices(self, vertices: ArrayLike, name: str) -> tuple[Ints, Floats]:
        """Return (n,) faces of `triangulation` at vertices, and (n, 3) barycentric coordinates of these vertices."""
        ids = self._triangulation_vertices(np.atleast_1d(array_of(vertices, f"vertex ids of a {name}", SourceError)))
        corners = corners_at(self.triangulation.faces, ids, self.n_vertices, name)
        return corners // 3, np.eye(3)[corners % 3]

    def _triangulation_vertices(self, vertices: Ints) -> Ints:
        """(n,) vertices of `triangulation` that correspond to (n,) vertices of the domain."""
        return vertices

    def _triangle_mask(self, face_mask: Bools) -> Bools:
        """Convert a mask of the domain's faces to one of the faces of `triangulation`; raise if it does not fit."""
        check_mask(face_mask, self.triangulation.n_faces)
        return face_mask


def check_mask(face_mask: Bools, n_faces: int) -> None:
    """Raise `SourceError` unless there is one boolean per face."""
    if face_mask.shape != (n_faces,) or face_mask.dtype != bool:
        raise SourceError(
            f"a region needs one boolean per face, {n_faces} in all, not {face_mask.dtype} of shape {face_mask.shape}",
            element="face_mask",
        )


class PlaceableTriangles(Triangles, Protocol):
    """Triangles on which points in space are placed and joined; see `TriangleMesh` for what the properties mean."""

    @property
    def places(self) -> Ints: ...
    @property
    def joined(self) -> Triangles: ...
    @property
    def intrinsic(self) -> IntrinsicMesh: ...
    @property
    def first_copies(self) -> Ints: ...
    @property
    def once(self) -> PlaceableTriangles: ...  # without faces on the same three vertices as an earlier face
    @property
    def edge_lengths(self) -> Floats: ...
    @property
    def search_tree(self) -> TriangleTree: ...


def projected_curve(
    mesh: PlaceableTriangles, points: ArrayLike, closed: bool, oriented: bool, max_distance: float | None
) -> Curve:
    """Make the curve of `Surface.polyline`, on a mesh."""
    points = coordinates(points, "points of the polyline", 3, SourceError)
    if len(points) < 2:
        raise SourceError(
            f"a polyline needs at least two points, not {len(points)}", remedy="for isolated points use points_at"
        )
    once = mesh.once  # no path leads from a face to its neighbours' copies
    faces, weights, distances = closest_points(once, points)
    if max_distance is None:
        max_distance = 0.05 * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    far = int(distances.argmax())
    if distances[far] > finite_number(max_distance, "max_distance", least=0):
        raise SourceError(
            f"the polyline leaves the mesh: point {far}, {points[far].tolist()}, is "
            f"{distances[far]:.6g} away from it, and at most {max_distance:.6g} is allowed",
            remedy="check units and placement, or raise max_distance",
            element=f"point {far}",
        )
    triangles = once.intrinsic
    start = np.arange(len(points) if closed else len(points) - 1)
    located, starts, ends, _ = join(
        triangles, locate_points(triangles, faces, weights), start, (start + 1) % len(points), "polyline"
    )
    order = starts if closed else np.append(starts, ends[-1])
    return Curve(mesh.first_copies[located.faces[order]], located.barycentric[order], closed, oriented)


def closest_points(mesh: PlaceableTriangles, points: Floats) -> tuple[Ints, Floats, Floats]:
    """(n,) faces and (n, 3) barycentric coordinates of the closest points of a mesh, and (n,) distances to them."""
    faces, weights = mesh.search_tree.nearest(points)
    closest = np.einsum("ik,ikj->ij", weights, mesh.vertices[mesh.faces[faces]])
    return faces, weights, np.linalg.norm(points - closest, axis=1)


def placed(mesh: PlaceableTriangles, points: object) -> tuple[Ints, Floats, tuple[int, ...]]:
    """Place points on a mesh: (n,) faces, (n, 3) barycentric coordinates, and the leading shape of the given points.

    These are the points of a curve, `SurfacePoints`, or (..., 3) positions in space, which stand for the closest points
    of the mesh.
    """
    if isinstance(points, Curve | SurfacePoints):
        refuse_missing("face", points.faces, mesh.n_faces)
        return points.faces, points.barycentric, points.faces.shape
    queries, shape = query_points(points, 3)
    faces, weights, _ = closest_points(mesh, queries)
    return faces, weights, shape


@dataclass(frozen=True, eq=False)
class SurfaceInterpolant:
    """Linear interpolation in the triangles of a surface."""

    mesh: PlaceableTriangles
    values: NDArray[Any]  # at the vertices of the triangles

    def __call__(self, points: object) -> Floats:
        """Return (...) values at the points of a curve, `SurfacePoints`, or (..., 3) positions."""
        faces, weights, shape = placed(self.mesh, points)
        return shaped(np.einsum("ik,ik->i", weights, self.values[self.mesh.faces[faces]]), shape)

    def gradient(self, points: object) -> Floats:
        """(..., 3) gradients in space at such points."""
        faces, _, shape = placed(self.mesh, points)
        return shaped(self.cell_gradients[faces], shape)

    @cached_property
    def cell_gradients(self) -> Floats:
        """(m, 3) gradients in the triangles, in space; zero in those without area."""
        corners, values = self.mesh.vertices[self.mesh.faces], self.values[self.mesh.faces]
        return gradients_along(corners[:, 1:] - corners[:, :1], values[:, 1:] - values[:, :1])
