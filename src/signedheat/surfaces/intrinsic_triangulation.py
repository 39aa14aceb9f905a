"""Intrinsic triangulations of a mesh: the same surface with better triangles (Sec. 9.4, Fig. 22).

Edges are geodesics along the surface instead of segments in space, so that triangles can be chosen for their angles
alone, without changing the surface. Edge flips give the intrinsic Delaunay triangulation (Bobenko & Springborn 2007),
whose Laplacian has a maximum principle; inserted vertices give a minimum angle (Sharp, Soliman & Crane 2019).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Frozen, Ints
from ..errors import GeometryError, counted
from ..fields.field_domain import Exact
from ..jobs import Progress, Stopwatch
from ..mesh.curve_segments import CurveSegments, without_straight_nodes
from ..mesh.gluing import N_STEPS, flip_all, glue, lay_out
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import refuse_missing
from ..mesh.triangles import gradients_along
from ..shapes.exchange import Displayed
from ..shapes.foreign import ForeignShape, converted
from ..validation import (
    finite_number,
    finite_rows,
    flag,
    frozen,
    positive_number,
    public_call,
    shaped,
    whole_number,
    whole_numbers,
)
from .intrinsic_history import History
from .intrinsic_refinement import refine_all
from .intrinsic_transfer import ConformingRefinement, level_lines, transfer_segments
from .source_segments import curve_of_elements, given_curves, is_element_list, segments_of, segments_of_each
from .surface import LinearDomain, checked_levels, is_consistent, level_set, placed, without_repeats
from .surface_curves import Curve, CurveOrPoints, CurvesAndPoints, ElementList
from .triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    import pyvista

LARGEST_ANGLE = 30.0
"""Largest minimum angle that may be asked for, in degrees; for larger ones refinement need not terminate."""
GENERIC_DIRECTION = (np.pi / 4) ** np.arange(3)
"""Direction along which no two points with algebraic coordinates have the same height."""


@dataclass(frozen=True, eq=False)
class IntrinsicTriangulation(Displayed, Frozen, LinearDomain):
    """An intrinsic triangulation of a mesh, made by `intrinsic_delaunay`; a domain like the mesh itself.

    The first vertices are those of the mesh, with the same ids. Sources are given on the mesh; fields have values at
    all vertices, and `Field.restrict` returns those at the vertices of the mesh.

    Attributes
    ----------
    mesh : TriangleMesh
        The surface.
    triangles : IntrinsicMesh
        The triangles. Two edges may join the same two vertices, or an edge may join a vertex with itself.
    marked : (e,) bool
        Edges along which the kept curves run.
    goal : float
        The minimum angle of refinement, in degrees; 0 for flips only.
    complete : bool
        Whether refinement ended before the limit on the number of vertices.
    close : (m,) bool
        Faces at vertices that nearly coincide, which refinement leaves thin.

    See Also
    --------
    intrinsic_delaunay : Make an intrinsic triangulation.
    common_subdivision : Cut a mesh along an intrinsic triangulation.

    Examples
    --------
    >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> better = intrinsic_delaunay(strip, refine=True)
    >>> better.n_vertices > strip.n_vertices, bool(np.isclose(better.triangles.face_areas.sum(), 9.0))
    (True, True)
    """

    mesh: TriangleMesh
    triangles: IntrinsicMesh
    marked: Bools
    goal: float
    complete: bool
    close: Bools = field(repr=False)
    base: IntrinsicMesh = field(repr=False)
    refinement: ConformingRefinement = field(repr=False)
    history: History = field(repr=False)

    @property
    def n_vertices(self) -> int:
        """Number of vertices; those of the mesh come first."""
        return self.triangles.n_vertices

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return self.triangles.n_faces

    @property
    def faces(self) -> Ints:
        """(m, 3) vertex ids. These do not determine the edges of a face: see `triangles`."""
        return self.triangles.corner_vertices

    @cached_property
    def vertices(self) -> Floats:
        """(n, 3) positions in space of the vertices, all of which lie on the mesh."""
        faces, weights = self.vertex_places
        positions = np.concatenate([self.mesh.vertices, np.empty((len(faces) - self.mesh.n_vertices, 3))])
        used = faces >= 0  # only vertices of the mesh can be unused
        positions[used] = self.in_space(faces[used], weights[used])
        return frozen(positions)

    @cached_property
    def vertex_places(self) -> tuple[Ints, Floats]:
        """(n,) face of the mesh in which each vertex lies, −1 if unused, and (n, 3) barycentric coordinates in it.

        Barycentric coordinates are the weights, with sum 1, of the corners of a face.
        """
        mesh_faces, n = self.mesh.faces, self.mesh.n_vertices
        faces, weights = np.full(n, -1), np.zeros((n, 3))
        for k in range(3):
            faces[mesh_faces[:, k]], weights[mesh_faces[:, k]] = np.arange(len(mesh_faces)), np.eye(3)[k]
        # then the vertices where curves cut faces, each at some corner of the cut faces, and those of the refinement
        vertices, corners = np.unique(self.refinement.triangles.corner_vertices.ravel(), return_index=True)
        corners = corners[vertices >= n]
        at_cuts = self.refinement.pull_back(corners // 3, np.eye(3)[corners % 3])
        inserted = self.refinement.pull_back(*self.history.inserted())
        return np.concatenate([faces, at_cuts[0], inserted[0]]), np.concatenate([weights, at_cuts[1], inserted[1]])

    @cached_property
    def corner_angles(self) -> Floats:
        """(m, 3) angles at the corners, in radians."""
        leaving = self.triangles.edge_vectors
        return np.angle(-np.conj(leaving) * np.roll(leaving, 1, axis=1))

    @cached_property
    def thin_faces(self) -> Ints:
        """(k,) faces with an angle smaller than that which `intrinsic_delaunay` was asked for."""
        return np.flatnonzero(self.corner_angles.min(axis=1) < np.radians(self.goal) - 1e-9)

    @property
    def summary(self) -> str:
        """The smallest angle reached, and the reasons for smaller ones than the goal, in words."""
        if not self.goal:
            return f"Delaunay; the smallest angle is {np.degrees(self.corner_angles.min()):.3g}°"
        if not len(self.thin_faces):
            return f"no angle below {self.goal:g}°"
        n_close = int(self.close[self.thin_faces].sum())
        rest = len(self.thin_faces) - n_close
        reasons = [f"{n_close} where vertices all but coincide"] if n_close else []
        if rest and self.complete:
            reasons.append(f"{rest} where the surface, its boundary or the kept curves close in at less than 60°")
        elif rest:
            reasons.append(f"{rest} because the limit of {self.n_vertices} vertices was reached: raise max_vertices")
        return (
            f"no angle below {self.goal:g}° but in {len(self.thin_faces)} of {self.n_faces} faces: {', '.join(reasons)}"
        )

    def in_space(self, faces: ArrayLike, barycentric: Floats) -> Floats:
        """Compute the positions of points that are given on the mesh.

        Parameters
        ----------
        faces : (p,) int
            Faces of the mesh.
        barycentric : (p, 3) float
            Barycentric coordinates of the points in these faces: weights of the three corners, with sum 1.

        Returns
        -------
        (p, 3) float
            Positions, in the units of the mesh.

        Raises
        ------
        SourceError
            If a face does not exist.

        See Also
        --------
        IntrinsicTriangulation.locate : Points of the mesh on the triangulation.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> better.in_space(np.array([0]), np.array([[0.0, 0.5, 0.5]])).tolist()
        [[9.0, 0.5, 0.0]]
        """
        return np.einsum("pk,pkd->pd", barycentric, self.mesh.vertices[self.mesh.faces[self._existing(faces)]])

    def locate(self, faces: ArrayLike, barycentric: ArrayLike) -> tuple[Ints, Floats]:
        """Convert points given in faces of the mesh to points in faces of the triangulation.

        Parameters
        ----------
        faces : (p,) int
            Faces of the mesh.
        barycentric : (p, 3) float
            Barycentric coordinates of the points in these faces: weights of the three corners, with sum 1.

        Returns
        -------
        faces : (p,) int
            Faces of the triangulation.
        barycentric : (p, 3) float
            Barycentric coordinates in them.

        Raises
        ------
        SourceError
            If a face does not exist.
        GeometryError
            If a coordinate is NaN or infinite.

        See Also
        --------
        IntrinsicTriangulation.in_space : Positions of points in space.
        IntrinsicTriangulation.transfer : The same for curves.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> faces, barycentric = better.locate([0], [[0.5, 0.25, 0.25]])
        >>> faces.shape, float(barycentric.sum().round(9))
        ((1,), 1.0)
        """
        ids, weights = self._existing(faces), finite_rows(barycentric, "barycentric coordinates", 3)
        return self._forward(ids, weights, np.zeros((len(ids), 0, 3)))[:2]

    def gradient(self, values: Floats, faces: Ints, barycentric: Floats) -> Floats:
        """Compute gradients in space of a function that is linear on these triangles, and may jump between them.

        Parameters
        ----------
        values : (n_vertices,) or (n_faces, 3) float
            The function at the vertices of the triangulation, or at the corners of each triangle.
        faces : (p,) int
            Faces of the mesh.
        barycentric : (p, 3) float
            Barycentric coordinates of the points in these faces.

        Returns
        -------
        (p, 3) float
            Gradients at the points, in units of the values over a length.

        See Also
        --------
        Field.gradient : The gradient of a field at points.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> better.gradient(better.vertices[:, 0], np.array([0]), np.array([[0.2, 0.3, 0.5]])).round(9)[:, :2].tolist()
        [[1.0, 0.0]]
        """
        corners = values[self.faces] if values.ndim == 1 else values
        ids = self._existing(faces)
        sides = np.broadcast_to([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]], (len(ids), 2, 3))
        located_faces, _, moves = self._forward(ids, barycentric, sides)
        rises = np.einsum("psk,pk->ps", moves, corners[located_faces])
        return gradients_along(np.einsum("psk,pkd->psd", sides, self.mesh.vertices[self.mesh.faces[ids]]), rises)

    def _existing(self, faces: ArrayLike) -> Ints:
        """(p,) ids of faces of the mesh as integers; raise `SourceError` if one does not exist."""
        ids = whole_numbers(faces, "faces")
        refuse_missing("face", ids, self.mesh.n_faces)
        return ids

    def _forward(self, faces: Ints, barycentric: Floats, vectors: Floats) -> tuple[Ints, Floats, Floats]:
        """Transfer points of the mesh, and (p, k, 3) vectors at them, to the triangulation.

        Points are (p,) faces and (p, 3) barycentric coordinates, vectors differences of such. The same is returned.
        """
        faces, barycentric, vectors = self.refinement.push_forward(faces, barycentric, vectors)
        faces, barycentric, vectors = self.history.forward(faces, np.maximum(barycentric, 0.0), vectors)
        return faces, barycentric / barycentric.sum(axis=1, keepdims=True), vectors

    def level_set(self, values: ArrayLike, level: float = 0.0) -> list[Curve]:
        """Find a level set of a function that is linear on these triangles, as curves on the mesh.

        Greater values are to the left of curves; values equal to the level count as greater. On meshes that are not
        consistently oriented, only the values at the vertices of the mesh are used.

        Parameters
        ----------
        values : (n_vertices,) float
            The function at the vertices of the triangulation.
        level : float
            The level, in the units of the function; 0 by default.

        Returns
        -------
        list of Curve
            Curves on the mesh, one for each connected component.

        Raises
        ------
        SourceError
            If there is not one value per vertex.

        See Also
        --------
        Field.contour : The level set of a field.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> [line] = better.level_set(better.vertices[:, 0], 4.5)
        >>> strip.positions(line)[:, 0].round(9).min().item()
        4.5
        """
        at_vertices, height = checked_levels(values, level, self.n_vertices)
        if not is_consistent(self.mesh):
            return level_set(self.mesh, at_vertices[: self.mesh.n_vertices], height)
        lines = level_lines(self.history, self.refinement, at_vertices - height)
        curves = [Curve(faces, np.maximum(weights, 0.0), closed=closed) for faces, weights, closed in lines]
        return without_repeats(self.mesh, curves)

    def edge_lines(self) -> tuple[Ints, Floats, Floats]:
        """Trace the edges as polylines on the mesh.

        Returns
        -------
        edges : (s,) int
            The edge that each straight part belongs to.
        starts, ends : (s, 3) float
            Positions in space where the parts start and end, in the units of the mesh.

        See Also
        --------
        common_subdivision : The polygons between the edges of both triangulations.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> edges, starts, ends = better.edge_lines()
        >>> starts.shape == ends.shape == (len(edges), 3)
        True
        """
        lines = self.history.edges_before()
        starts = self.in_space(*self.refinement.pull_back(lines.faces, lines.starts))
        return lines.owners, starts, self.in_space(*self.refinement.pull_back(lines.faces, lines.ends))

    @overload
    def transfer(self, source: CurveOrPoints | CurveSegments | ElementList) -> CurveSegments: ...
    @overload
    def transfer(self, source: Sequence[CurveOrPoints | CurveSegments | ElementList]) -> list[CurveSegments]: ...
    def transfer(
        self,
        source: CurveOrPoints | CurveSegments | ElementList | Sequence[CurveOrPoints | CurveSegments | ElementList],
    ) -> CurveSegments | list[CurveSegments]:
        """Transfer a source that is given on the mesh to these triangles.

        Parameters
        ----------
        source : Curve, SurfacePoints, CurveSegments, or sequence of them
            Curves or points on the mesh. Or lists of (element, coordinates), as for `signed_distance`.

        Returns
        -------
        CurveSegments or list of CurveSegments
            Segments, each within one triangle of the triangulation: one `CurveSegments` for a single curve, points or
            a list of (element, coordinates), and a list of them for a sequence.

        See Also
        --------
        IntrinsicTriangulation.locate : The same for single points.

        Examples
        --------
        >>> strip = TriangleMesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> better = intrinsic_delaunay(strip, refine=True)
        >>> line = strip.polyline([[4.0, 0.0, 0.0], [4.0, 1.0, 0.0]])
        >>> len(better.transfer([line]))
        1
        """
        given: Any = curve_of_elements(self.mesh, source) if is_element_list(source) else source
        if isinstance(given, Sequence):
            return [self.transfer(part) for part in given]
        seen = segments_of(given, self.base, self.mesh.vertices)
        if isinstance(given, CurveSegments):
            return seen
        return transfer_segments(seen, self.refinement, self.history, self.base)

    def _interpolant(self, values: Floats, beyond: Exact | None) -> IntrinsicInterpolant:
        """Return the function that interpolates (n,) values linearly in the intrinsic triangles."""
        return IntrinsicInterpolant(self, values)

    def _restricted(self) -> TriangleMesh:
        """Return the mesh, whose vertices come first."""
        return self.mesh

    def _plain(self, values: Floats) -> tuple[TriangleMesh, Floats]:
        """Return the mesh, and the values at its vertices."""
        return self.mesh, values[: self.mesh.n_vertices]

    def to_pyvista(self) -> pyvista.PolyData:
        return self.mesh.to_pyvista()

    def __repr__(self) -> str:
        size = f"{counted(self.n_vertices, 'vertex')}, {counted(self.n_faces, 'face')}"
        return f"IntrinsicTriangulation({size}: {self.summary})"


@dataclass(frozen=True, eq=False)
class IntrinsicInterpolant:
    """Linear interpolation in the triangles of an intrinsic triangulation; points are given on its mesh."""

    triangulation: IntrinsicTriangulation
    values: Floats  # at its vertices

    def __call__(self, points: object) -> Floats:
        """Return (...) values at the points of a curve, `SurfacePoints`, or (..., 3) positions."""
        faces, weights, shape = placed(self.triangulation.mesh, points)
        faces, weights = self.triangulation.locate(faces, weights)
        return shaped(np.einsum("ik,ik->i", weights, self.values[self.triangulation.faces[faces]]), shape)

    def gradient(self, points: object) -> Floats:
        """(..., 3) gradients in space at such points."""
        faces, weights, shape = placed(self.triangulation.mesh, points)
        return shaped(self.triangulation.gradient(self.values, faces, weights), shape)


@public_call
def intrinsic_delaunay(
    mesh: TriangleMesh | ForeignShape,
    keep: CurvesAndPoints | ElementList | Sequence[ElementList] = (),
    refine: bool = False,
    angle: float = 28.0,
    max_vertices: int | None = None,
    coarsest: float = np.inf,
    progress: Progress | None = None,
) -> IntrinsicTriangulation:
    """Triangulate the same surface again with better angles, for accurate distance along it.

    The new edges are straight lines on the surface, which may run over several faces of the mesh: they are known by
    their lengths alone, hence *intrinsic*. Edges are flipped until the two angles opposite each one sum to at most
    180°, which is the *Delaunay* condition and avoids needles. The surface does not change, nor do its vertices move.
    Boundary and nonmanifold edges are not flipped, and neither are the edges of kept curves; refinement may split them.
    The mesh may be nonmanifold, nonorientable, inconsistently oriented, and have nearly degenerate faces.

    Parameters
    ----------
    mesh : TriangleMesh
        The surface.
    keep : Curve, SurfacePoints or a sequence of them, optional
        Curves that are to run along edges, and points that are to be vertices. Points of curves become vertices where
        curves bend, end or meet. Or lists of (element, barycentric coordinates), as for `signed_distance`. Curves
        without length are left out if there are others. Distance can be measured to other sources as well.
    refine : bool
        Whether to insert vertices until no angle is smaller than `angle`. By default edges are only flipped. Smaller
        ones remain where boundaries or kept curves meet at less than 60°, at vertices with a total angle of less than
        60°, and at groups of vertices that nearly coincide (of a size less than a hundredth of the distance to any
        other vertex), since grading the triangles towards them takes hundreds of vertices and gains no accuracy.
        `IntrinsicTriangulation.summary` reports them.
    angle : float
        Minimum angle of refinement in degrees, at most 30; 28 by default.
    max_vertices : int, optional
        Limit on the number of vertices; by default 20 for every vertex of the mesh and the kept curves, plus 10,000.
    coarsest : float
        Circumradius above which refinement splits triangles; infinite by default, so that their size does not matter.
        It is relative to that of an equilateral triangle with the mean area that there would be otherwise, and at least
        1. Flat parts of CAD meshes, which have no small angles, then become about as fine as the rest.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    IntrinsicTriangulation
        The same surface in other triangles, a domain for distance. Time and memory are proportional to the numbers of
        flips and new vertices, which on all but contrived meshes are proportional to the size of the mesh.

    Raises
    ------
    GeometryError
        If the domain is not a triangle mesh, has no area or faces so thin that lengths of edges do not determine it to
        four digits, or `angle`, `max_vertices` or `coarsest` is out of range.
    SourceError
        If a curve to be kept does not lie on the mesh.

    See Also
    --------
    IntrinsicTriangulation : Better triangles on the same surface.
    common_subdivision : Cut a mesh along an intrinsic triangulation.
    SignedHeatSolver : The signed heat method alone.

    Examples
    --------
    >>> import signedheat as sh
    >>> vertices = [[0, 0, 0], [10, 0, 0], [10, 1, 0], [0, 1, 0]]
    >>> strip = sh.TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3]])
    >>> better = sh.intrinsic_delaunay(strip, refine=True)
    >>> better.summary
    'no angle below 28°'
    >>> bool(abs(better.triangles.face_areas.sum() - 10) < 1e-12)
    True
    """
    mesh, refine = triangle_mesh(mesh), flag(refine, "refine")
    angle = positive_number(angle, "angle", GeometryError)
    if angle > LARGEST_ANGLE:
        raise GeometryError(f"angle must be at most {LARGEST_ANGLE:g} degrees, not {angle:g}", element="angle")
    if max_vertices is not None:
        max_vertices = whole_number(max_vertices, "max_vertices", 1)
    if not (isinstance(coarsest, float) and coarsest == np.inf):
        coarsest = finite_number(coarsest, "coarsest", 1, GeometryError)
    stopwatch = Stopwatch(steps=3)
    with stopwatch("embed curves"):
        base = mesh.intrinsic
        refuse_other_area(mesh, base)
        listed, _ = given_curves(mesh, list(keep) if isinstance(keep, Sequence) else [keep])
        parts = list(chain.from_iterable(segments_of_each(listed, base, mesh.vertices)))
        parts = without_straight_nodes(base, parts) if parts else []
        refinement = ConformingRefinement.of(base, parts, (mesh.vertices - mesh.bounds[0]) @ GENERIC_DIRECTION)
        marked, complete = refinement.marked, True
    with stopwatch("flip"):
        gluing = flip_all(glue(refinement.triangles, marked))
        close = np.zeros(refinement.triangles.n_faces, dtype=bool)
    with stopwatch("refine"):
        if refine:
            limit = 20 * refinement.triangles.n_vertices + 10_000 if max_vertices is None else max_vertices
            gluing, origin, close, complete = refine_all(gluing, np.radians(angle), coarsest, limit)
            marked = np.append(marked, False)[origin]
    n = int(gluing.counts[N_STEPS])
    triangles = lay_out(gluing)
    refuse_other_area(mesh, triangles)
    history = History(refinement.triangles, triangles, gluing.steps[:n].copy(), gluing.weights[:n].copy())
    goal = angle if refine else 0.0
    return IntrinsicTriangulation(mesh, triangles, marked, goal, complete, close, base, refinement, history)


def refuse_other_area(mesh: TriangleMesh, triangles: IntrinsicMesh) -> None:
    """Raise `GeometryError` if faces are so thin that the triangles, known by edge lengths, have another area."""
    before, after = float(mesh.face_areas.sum()), float(triangles.face_areas.sum())
    longest, most = float(triangles.lengths_of_edges.max(initial=0.0)), float(mesh.edge_lengths.sum())
    # where some faces are degenerate, the area changes by 1e-7 at most
    lost = "" if abs(after - before) <= 1e-4 * before else f"area would be {after:.6g}, and it is {before:.6g}"
    if not longest <= most:
        lost = f"longest edge would be {longest:.6g}, and all edges together are {most:.6g}"
    if lost:
        raise GeometryError(
            f"the faces are too thin for another triangulation: their {lost}",
            remedy="remove nearly degenerate faces, or scale the shape along axes in which it is squashed",
            element="faces",
        )


def triangle_mesh(domain: object) -> TriangleMesh:
    """Return the domain, converted if it is from another package, if it is a triangle mesh; raise otherwise."""
    domain = converted(domain)
    if not isinstance(domain, TriangleMesh):
        raise GeometryError(
            f"an intrinsic triangulation is made from a TriangleMesh, not from a {type(domain).__name__}",
            element="domain",
        )
    return domain
