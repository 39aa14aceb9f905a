"""Signed distance to curves that bound no region: piecewise-continuous integration (Sec. 7.2, Eq. 15, Eq. 16).

In Eq. 16 φ is linear in every face with gradient exactly Y, so it is known up to one constant per face. Where Y is
integrable, the constants make φ continuous across edges. Elsewhere φ jumps, and the weighted L1 norm concentrates the
jumps on a short cut. On the surface cut open there, step 3 integrates Y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from ..arrays import Bools, Complexes, Floats
from ..diagnostics import Diagnostics, Jumps
from ..errors import (
    GeometryError,
    InexactWarning,
    SourceError,
    UnreachedWarning,
    UnsupportedTypeError,
    counted,
    warn_user,
)
from ..fields.field import Field
from ..jobs import Progress, Stopwatch
from ..linear import chosen_backend
from ..memory import refuse_beyond_memory
from ..mesh.curve_segments import CurveSegments
from ..mesh.intrinsic_mesh import FacePairs, IntrinsicMesh, face_pairs
from ..mesh.surface_points import VERTEX, barycentric_in
from ..method import diffuse, normalize
from ..shapes.foreign import ForeignShape, as_list, converted
from ..surfaces.intrinsic_discretization import AUTO_ANGLE, COARSEST_TRIANGLE, is_spoiled, lowered
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay, triangle_mesh
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.source_segments import given_curves
from ..surfaces.surface_curves import CurveOrPoints, CurvesAndPoints
from ..surfaces.surface_discretization import SurfaceDiscretization, lowered_mesh, lowered_polygons
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import chosen, flag, positive_number, public_call
from .cut_surface import CutSurface
from .jumps import JumpProblem, JumpSolution, high_jumps, integration_error, is_continuous, minimize, smoothed

ROUGH_INTEGRATION = 1.0
"""Root mean square of ∇φ − Y above which there is a warning. The length of Y is 1, too."""

SOURCE_CUT = 100.0
"""Factor by which a cut along or across the source is more expensive than elsewhere."""
BYTES_WITH_JUMPS = {"pardiso": (2600, 0), "superlu": (525, 182)}
"""Measured peak memory in bytes per triangle, for each back end: a constant, and an amount for each doubling of the
number of triangles."""


@public_call
def piecewise_distance(
    sources: CurvesAndPoints,
    domain: TriangleMesh | PolygonMesh | IntrinsicTriangulation | ForeignShape,
    *,
    diffusion: float = 1.0,
    intrinsic: bool | Literal["auto"] = "auto",
    smooth: bool = True,
    progress: Progress | None = None,
) -> Field[CutSurface]:
    """Compute a signed distance to curves that need not bound a region; it jumps where no continuous one exists.

    A loop around the tube of a torus has no inside, since its left and right sides are connected. No continuous
    function is a signed distance to it. The field φ returned here is positive to the left of curves and negative to
    their right. It jumps along lines away from the curves, called its *cut*. Of all cuts it has the one with the least
    total of jump times length, with the weights below.

    The surface may have any topology, orientable or not. Curves that bound a region get no cut. Curves whose parts run
    in opposite directions get a cut that joins the points where the direction changes.

    Notes
    -----
    Let Y be the diffused and normalised source normals. First, φ is the function with gradient Y in every triangle
    that minimises ``Σ_e |e| exp(−κ_e) (|jump at one end of e| + |jump at the other|)`` over all edges e, where κ_e is
    the difference between the components of Y along e in the two faces at e (Eq. 15, Eq. 16). The length of e is
    ``|e|``. Edges at the source have 100 times the weight, which keeps the cut away from the source. Second, the
    surface is cut open along the lines of large jumps, and step 3 of the method (Eq. 13) makes φ continuous on it, with
    gradients near Y.

    Without a cut, φ differs from `SignedHeatSolver.distance` by at most ``integration_error / √λ`` in the root mean
    square, where the note `diagnostics.Jumps` has the ``integration_error``, and λ is the least positive eigenvalue of
    the Laplacian.

    Parameters
    ----------
    sources : Curve, SurfacePoints, or a sequence of them
        The curves and points. If unoriented curves do not run along edges, the surface is retriangulated so that they
        do. The field then lies on ``intrinsic_delaunay(surface, keep=sources)``, which can also be passed as `domain`.
    domain : TriangleMesh, PolygonMesh or IntrinsicTriangulation
        The surface.
    diffusion : float
        Factor τ of ``t = τ h²``, the time for which normals of the curves are diffused like heat, with h half the mean
        length of edges. Larger values close gaps along rounder lines.
    intrinsic : "auto", True or False
        Whether φ is computed on an intrinsic triangulation, as for `SignedHeatSolver`. "auto" refines a triangle mesh
        intrinsically if large angles or thin triangles would spoil directions. The field then lies on the refinement.
    smooth : bool
        Whether φ is made continuous away from its cut, as it is by default. If false, the second step is left out, so
        that small jumps remain and the gradient is Y in every triangle. That is better where halves of a curve face
        each other.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.

    Returns
    -------
    Field
        φ in the units of the surface, with median zero over the source. ``diagnostics.note(Jumps)`` has the objective
        of the minimisation, a lower bound of it, and the size of the jumps. The objective is within 0.2 % of the
        least, or within 15 % if φ has no cut. For 300 thousand faces that takes minutes. There is an `InexactWarning`
        if triangles are so large or thin that gradients of φ differ much from Y.

    Raises
    ------
    SourceError
        If a source does not fit the surface, or an unoriented curve was not kept by an intrinsic triangulation.
    UnsupportedTypeError
        If the domain is no such surface.
    GeometryError
        If ``intrinsic=True``, and the domain is no triangle mesh.
    MemoryLimitError
        If the field does not fit into memory; nothing has been allocated then.
    ValueError
        If `diffusion` is not positive and finite.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    close_curves : Close the gaps of curves on a surface.
    results.CutSurface : The domain of the result.

    Examples
    --------
    >>> from signedheat.diagnostics import Jumps
    >>> from signedheat.samples import torus
    >>> mesh = torus(n_around=48, n_across=24)
    >>> phi = piecewise_distance(mesh.path(range(24), closed=True), mesh)  # round the tube: bounds nothing
    >>> [cut] = phi.domain.cuts(phi.values)
    >>> bool(4 < cut.height < 2 * np.pi), phi.diagnostics.note(Jumps).gap < 0.002  # nearly the length of the way round
    (True, True)
    """
    domain = converted(domain)
    if not isinstance(domain, TriangleMesh | PolygonMesh | IntrinsicTriangulation):
        raise UnsupportedTypeError(
            "piecewise distance needs a TriangleMesh, a PolygonMesh or an IntrinsicTriangulation, not a "
            f"{type(domain).__name__}",
            remedy="pass the curves first, then the surface",
            element="domain",
        )
    smooth = flag(smooth, "smooth")
    chosen(intrinsic, Literal["auto", True, False], "intrinsic")
    if intrinsic is True:
        triangle_mesh(domain)  # refuses others
    listed, left_out = given_curves(domain, as_list(sources))
    stopwatch = Stopwatch(steps=5)
    with stopwatch("prepare"):
        diffusion = positive_number(diffusion, "diffusion")
        domain, discretization = _retriangulated(domain, listed, intrinsic)
    with stopwatch("diffuse"):
        discretization, groups = discretization.adapt(listed)
        triangles = discretization.triangles
        source = discretization.lower(groups, diffusion)
        directions = normalize(discretization, diffuse(discretization, source))
    with stopwatch("integrate"):
        parts = [part for group in groups for part in group]
        pairs = face_pairs(triangles)
        slopes = corner_slopes(triangles, directions)
        problem = jump_problem(triangles, pairs, slopes, guarded_edges(triangles, parts))
        continuous = partial(is_continuous, triangles, pairs, slopes, directions)
        solution = minimize(problem, enough=continuous)
        values = slopes + solution.constants[:, None]
    with stopwatch("cut"):
        cut = high_jumps(triangles, pairs, values)
        if smooth:
            values = smoothed(triangles, pairs, directions, values, cut)
    with stopwatch("finish"):
        phi = Field(CutSurface(domain, triangles, cut), centered(triangles, values, parts))
        error = integration_error(phi, directions)
    unreached = np.flatnonzero(np.isnan(phi.values[:, 0]))
    if len(unreached):
        warn_user(f"{counted(len(unreached), 'face')} are connected to no source: NaN there", UnreachedWarning)
    if error > ROUGH_INTEGRATION:
        warn_user(
            f"slopes of φ are off by {error:.3g} on average: on triangles so large or thin neither they nor cuts mean "
            "anything. Pass intrinsic=True",
            InexactWarning,
        )
    notes = (jumps_of(phi, solution, error), *discretization.notes, *([left_out] if left_out else []))
    return replace(phi, diagnostics=Diagnostics(dict(stopwatch.seconds), source.time, unreached, notes))


def jumps_of(phi: Field[CutSurface], solution: JumpSolution, error: float) -> Jumps:
    """Return the note for the diagnostics of a field on its jumps, its objective and its integration error."""
    return Jumps(
        objective=solution.objective,
        bound=solution.bound,
        gap=solution.gap,
        rounds=solution.rounds,
        continuous=not phi.domain.is_cut.any(),
        largest_jump=float(np.nanmax(np.abs(phi.domain.jumps(phi.values)), initial=0.0)),
        cut_length=float(sum(line.length for line in phi.domain.cuts(phi.values))),
        integration_error=error,
    )


def memory_estimate(n_triangles: int) -> float:
    """Estimate the peak memory, in bytes, that a field on `n_triangles` triangles needs besides libraries."""
    per_triangle, per_doubling = BYTES_WITH_JUMPS[chosen_backend()]
    return n_triangles * (per_triangle + per_doubling * math.log2(max(n_triangles, 2)))


def _retriangulated(
    domain: TriangleMesh | PolygonMesh | IntrinsicTriangulation,
    sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]],
    intrinsic: bool | Literal["auto"],
) -> tuple[TriangleMesh | PolygonMesh | IntrinsicTriangulation, SurfaceDiscretization]:
    """Return the domain on which the field will lie, and its discretisation.

    It is the given domain, or an intrinsic triangulation of it if bad triangles or unoriented curves need one.
    """
    discretization = _lowered(domain)
    if isinstance(domain, IntrinsicTriangulation):
        return domain, conforming(discretization, sources)
    fits = conforms(discretization, sources)
    if isinstance(domain, TriangleMesh) and (intrinsic is True or (intrinsic == "auto" and is_spoiled(domain))):
        angle = 28.0 if intrinsic is True else AUTO_ANGLE
        ways = (sources,) if intrinsic is True else ((), sources)  # unoriented curves along edges may need these kept
        try:
            for keep in ways:
                refined = intrinsic_delaunay(domain, keep, refine=True, angle=angle, coarsest=COARSEST_TRIANGLE)
                if conforms(surface := _lowered(refined), sources):
                    return refined, surface
        except GeometryError:  # faces too thin
            if intrinsic is True:
                raise
        if intrinsic is True:
            return refined, conforming(surface, sources)
    if fits:
        return domain, discretization
    domain = intrinsic_delaunay(domain.triangulation, keep=sources)
    return domain, conforming(_lowered(domain), sources)


def _lowered(domain: TriangleMesh | PolygonMesh | IntrinsicTriangulation) -> SurfaceDiscretization:
    """Return the discretisation of a domain; raise `MemoryLimitError` if there is not enough memory for the field."""
    n = len(domain.corners) if isinstance(domain, PolygonMesh) else domain.n_faces
    refuse_beyond_memory(
        f"piecewise distance on {n:,} triangles", n, memory_estimate, lambda number: f"use at most {number:,} triangles"
    )
    if isinstance(domain, IntrinsicTriangulation):
        return lowered(domain)
    return lowered_polygons(domain) if isinstance(domain, PolygonMesh) else lowered_mesh(domain)


def conforms(discretization: SurfaceDiscretization, sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]]) -> bool:
    """Whether unoriented curves run along edges of the triangles, so that `adapt` does not refine these."""
    adapted = discretization.adapt(sources)[0].triangles
    return adapted.corner_vertices is discretization.triangles.corner_vertices


def conforming(
    discretization: SurfaceDiscretization, sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]]
) -> SurfaceDiscretization:
    """Return the discretisation itself; raise `SourceError` if unoriented curves do not run along its edges."""
    if conforms(discretization, sources):
        return discretization
    raise SourceError(
        "an unoriented curve runs across faces of the intrinsic triangulation",
        remedy="make it with intrinsic_delaunay(mesh, keep=curve), or orient the curve",
    )


def corner_slopes(triangles: IntrinsicMesh, directions: Complexes) -> Floats:
    """Return (m, 3) values at the corners of faces of functions with gradient Y that are zero at centroids (Eq. 16).

    `directions` are Y as complex numbers in the planar layout of each face, (m,).
    """
    centroid = triangles.corner_positions.mean(axis=1, keepdims=True)
    return (np.conj(directions)[:, None] * (triangles.corner_positions - centroid)).real


def jump_problem(triangles: IntrinsicMesh, pairs: FacePairs, slopes: Floats, guarded: Bools) -> JumpProblem:
    """Return the minimisation problem of Eq. 16, with one unknown constant per face and the weights of Eq. 15.

    `slopes`, (m, 3), are the values at corners of functions with gradient Y that are zero at centroids. Edges where
    `guarded`, (e,), is true get `SOURCE_CUT` times the weight.

    With s and t the differences of `slopes` across an edge at its ends, and x that of the constants, the jumps at the
    ends are ``|x + s| + |x + t| = |s − t| + 2 dist(x, [−max(s, t), −min(s, t)])``. The first term is in the `floor`.
    """
    offsets = pairs.ends(slopes)  # (p, 2) s and t
    length = triangles.edge_lengths[pairs.faces[:, 0], pairs.sides[:, 0]]
    spread = np.abs(offsets[:, 1] - offsets[:, 0])  # κ |e|, whatever the constants are
    weights = length * np.exp(-spread / length) * pairs.shares
    factors = np.where(guarded[pairs.edges], SOURCE_CUT, 1.0)
    return JumpProblem(
        pairs.faces,
        low=-offsets.max(axis=1),
        high=-offsets.min(axis=1),
        weights=factors * weights,
        n_faces=triangles.n_faces,
        floor=float(weights @ spread),
    )


def guarded_edges(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> Bools:
    """Return (e,) bool, true for edges with an end on the source or on a face that the source crosses."""
    touched = np.zeros(triangles.n_vertices, dtype=bool)
    for part in parts:
        touched[part.nodes.elements[part.nodes.kinds == VERTEX]] = True
        along = part.edges >= 0
        touched[triangles.edges.vertices[part.edges[along]]] = True
        touched[triangles.corner_vertices[part.faces[~along]]] = True
    return np.any(touched[triangles.edges.vertices], axis=1)


def centered(triangles: IntrinsicMesh, values: Floats, parts: Sequence[CurveSegments]) -> Floats:
    """Shift (m, 3) values so that their median over the source is zero on each connected component of the surface.

    The median is weighted by length. Values are NaN on components without a source.
    """
    label = triangles.face_components
    faces, heights, weights = [], [], []
    for part in parts:
        if len(part.ends) == 0:
            face, places, weight = part.nodes.faces, [part.nodes], np.ones(len(part.nodes))
        else:
            face, places, weight = part.faces, [part.nodes[end] for end in part.ends.T], part.lengths
        for place in places:
            faces.append(face)
            heights.append((values[face] * barycentric_in(triangles, face, place)).sum(axis=1))
            weights.append(weight)
    face, height, weight = (np.concatenate(a) for a in (faces, heights, weights))
    shift = np.full(label.max() + 1, np.nan)
    order = np.lexsort([height, label[face]])
    for piece in np.split(order, 1 + np.flatnonzero(np.diff(label[face[order]]))):
        total = np.cumsum(weight[piece])
        shift[label[face[piece[0]]]] = height[piece[np.searchsorted(total, 0.5 * total[-1])]]
    return values - shift[label][:, None]
