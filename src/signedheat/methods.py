"""Methods of sharpening (Sec. 7.3): distance to the nearer of a source and the zero set of φ, and a convex problem.

The error of the heat method is smooth and decreases slowly under refinement. Both methods remove most of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial, singledispatch
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from .arrays import Floats, Ints
from .diagnostics import ConvexRounds, Diagnostics, Note, SlopeErrors
from .discretization import Discretization, SourceTerm
from .errors import (
    GeometryError,
    InexactWarning,
    OutsideError,
    SignedHeatError,
    SourceError,
    UnsupportedTypeError,
    warn_user,
)
from .fields.field import Field
from .fields.field_domain import FieldDomain
from .geodesics.exact_distance import Report
from .jobs import Progress
from .linear.direct_integration import DirectIntegration
from .linear.splitting import split_rounds
from .linear.threads import one_blas_thread
from .mesh.intrinsic_mesh import IntrinsicMesh
from .mesh.tet_shapes import Tetrahedra
from .surfaces.extrapolation import Extrapolated as Extrapolated
from .validation import finite_number, positive_number

__all__ = ["Convex", "Extrapolated", "Geodesic"]

ADDED_SLOPE_ERROR = 0.1
"""Increase of `LinearElements.bounded_slope_error` that sharpening may cause without a warning; 0.08 on triangles."""


@dataclass(frozen=True, eq=False)
class LinearElements:
    """Linear finite elements on triangles or tets."""

    corners: Ints  # (m, d + 1) unknown at each corner of each cell
    sizes: Floats  # (m,) areas or volumes of the cells
    slope_matrix: sparse.csr_matrix  # (m d, n) maps values at the unknowns to the components of ∇φ, cell after cell

    @classmethod
    def of(cls, corners: Ints, sizes: Floats, hats: Floats, n: int) -> LinearElements:
        """Make elements from (m, d + 1, d) gradients, those of the hat functions of each cell."""
        m, k = corners.shape
        d = hats.shape[2]
        columns = np.repeat(corners[:, None], d, axis=1)
        entries = hats.transpose(0, 2, 1).ravel(), columns.ravel(), k * np.arange(m * d + 1)
        return cls(corners, sizes, sparse.csr_matrix(entries, shape=(m * d, n)))

    @classmethod
    def on_triangles(cls, triangles: IntrinsicMesh) -> LinearElements:
        """Make the elements of a surface, with the gradients of each face in the face's own planar layout."""
        slopes = 1j * np.roll(triangles.edge_vectors, -1, axis=1) / (2.0 * triangles.face_areas)[:, None]
        hats = np.stack([slopes.real, slopes.imag], axis=2)
        return cls.of(triangles.corner_vertices, triangles.face_areas, hats, triangles.n_vertices)

    @classmethod
    def on_tets(cls, tets: Tetrahedra, corners: Ints, n: int) -> LinearElements:
        """Make the elements of a tet mesh; thin tets have a reduced weight, as they have in C, and flat ones none."""
        flat = tets.thickness < 1e-10
        hats = tets.area_vectors / np.where(flat, -np.inf, -3.0 * tets.volumes)[:, None, None]
        return cls.of(corners, np.where(flat, 0.0, tets.weights * tets.volumes), hats, n)

    @property
    def masses(self) -> Floats:
        """(n,) integrals of the hat functions: A_i of Eq. 18."""
        share = np.repeat(self.sizes / self.corners.shape[1], self.corners.shape[1])
        return np.asarray(np.bincount(self.corners.ravel(), share, self.slope_matrix.shape[1]), np.float64)

    def slopes(self, values: Floats) -> Floats:
        """(m, d) ∇φ in every cell, whose length Eq. 17 bounds by one."""
        return np.asarray(self.slope_matrix @ values).reshape(len(self.sizes), -1)

    def divergence(self, vectors: Floats) -> Floats:
        """b of Eq. 13, ``b_i = ∫ ⟨∇λ_i, Y⟩``, for one vector per cell."""
        return self.slope_matrix.T @ (self.sizes[:, None] * vectors).ravel()

    def slope_error(self, values: Floats) -> float:
        """Root mean square of ``|∇φ| − 1`` over the cells in which φ is known."""
        return float(np.sqrt(self._mean((np.linalg.norm(self.slopes(values), axis=1) - 1.0) ** 2)))

    def bounded_slope_error(self, values: Floats) -> float:
        """Mean of ``min(| |∇φ| − 1 |, 1)``, which depends little on flat cells and on the kinks of a distance."""
        return self._mean(np.minimum(np.abs(np.linalg.norm(self.slopes(values), axis=1) - 1.0), 1.0))

    def _mean(self, errors: Floats) -> float:
        finite = np.isfinite(errors) & (self.sizes > 0)
        return float(np.average(errors[finite], weights=self.sizes[finite])) if finite.any() else float("nan")


@dataclass(frozen=True, eq=False)
class Nearest:
    """Distance from each unknown to the nearer of a source and the zero set of φ."""

    distances: Floats  # (n,) unsigned; inf where the component of the domain has neither
    sides: Ints  # (n,) 1 or −1 where the source decides the sign; 0 where φ does
    notes: tuple[Note, ...] = ()  # for the diagnostics


@singledispatch
def nearest(
    domain: Any, values: Floats, source: SourceTerm | None, given: Any, tolerance: float, report: Report | None
) -> Nearest:
    """Measure to the nearer of a source and the zero set of φ; every kind of domain registers a function of its own.

    `source` is what φ was computed from. `given`, if not None, are curves or shapes to which distance is exact, and
    which the zero set completes. `report` is called now and then, and may raise to cancel.
    """
    raise UnsupportedTypeError(f"there are no straight lines on a {type(domain).__name__}", element="method")


def distance_to_nearest(
    domain: Any, values: Floats, source: SourceTerm | None, given: Any, tolerance: float, progress: Progress | None
) -> tuple[Floats, tuple[Note, ...]]:
    """Measure signed distance to the nearer of a source and the zero set; also return notes for the diagnostics."""
    report = None if progress is None else lambda: progress(0.0, "sharpen")
    places = nearest(domain, values, source, given, tolerance, report)
    reached = np.isfinite(places.distances)
    if not reached.any():
        raise OutsideError(
            "the field has one sign everywhere, hence no zero set to measure from",
            remedy="add an offset to its values, or use method=Convex(), which measures from the source "
            "that it was computed from",
        )
    distances = np.where(reached, places.distances, np.abs(values))
    signed = np.copysign(distances, np.where(places.sides != 0, places.sides, values))
    return np.where(np.isnan(values), np.nan, signed), places.notes


@runtime_checkable
class Method(Protocol):
    """A method of sharpening, for fields on surfaces and tets."""

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: Floats,
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[Floats, tuple[Note, ...]]:
        """Sharpen the values of a field on linear elements.

        Parameters
        ----------
        discretization : Discretization
            The discretisation of the domain.
        elements : LinearElements
            Elements on which φ is linear.
        values : (n,) float
            φ at the vertices.
        source : SourceTerm, optional
            The source from which φ was computed.
        progress : callable, optional
            Called as ``progress(fraction, text)``.

        Returns
        -------
        values : (n,) float
            Sharpened values.
        notes : tuple of Note
            Notes for the diagnostics.

        Raises
        ------
        SourceError
            If the method is `Convex`, and the field comes without its source.

        See Also
        --------
        sharpen : Sharpen a field.

        Examples
        --------
        >>> import signedheat as sh
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.SignedHeatSolver(ball).distance(ball.points_at(0))
        >>> [len(sh.sharpen(phi, method=method).values) for method in (sh.methods.Geodesic(), sh.methods.Convex())]
        [162, 162]
        """


@dataclass(frozen=True)
class Geodesic(Method):
    """Geodesic distance from the zero set of φ, with the signs of φ: the solution of Eq. 17. The default.

    On surfaces this is exact polyhedral distance, whatever the shape of the triangles. Distance to unoriented sources
    (unoriented curves, points) is measured from these themselves, whether φ vanishes there or not; if no source is
    oriented, distance is positive everywhere. In tet meshes it is distance along straight lines, which bend around the
    boundary of the mesh.

    The zero set of φ and its signs are kept, including signs that a long diffusion has made wrong. (In tets, the zero
    set is that of a quadratic correction of the linear interpolant, which is closer to a smooth one.)

    Parameters
    ----------
    tolerance : float
        On surfaces, neighbouring windows on an edge are merged if that changes distances by less than this fraction of
        the edge. 0 is exact, and takes time proportional to the number of faces to the power of 1.5.

    See Also
    --------
    sharpen : Distance to the zero set of a field.
    methods.Convex : The paper's way to sharpen.

    Examples
    --------
    >>> Geodesic()
    Geodesic(tolerance=0.0001)
    """

    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if not 0 <= finite_number(self.tolerance, "tolerance") < 0.1:
            raise SignedHeatError(
                f"tolerance must be at least 0 and below 0.1, not {self.tolerance}", element="tolerance"
            )

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: Floats,
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[Floats, tuple[Note, ...]]:
        return distance_to_nearest(discretization, values, source, None, self.tolerance, progress)


SOURCE_TOLERANCE = 0.1 * Geodesic.tolerance
"""Tolerance of distance to curves: the order of faces then changes it by less than 1e-6 of its range."""


@dataclass(frozen=True)
class Convex(Method):
    """``max Σ A_i sign(φ⁰_i) φ_i`` where ``|∇φ| ≤ 1`` in every cell and φ = 0 on the source, by ADMM (Eq. 17, Eq. 18).

    This corrects signs that a long diffusion has made wrong. The result is too small, since a function with gradients
    of length at most one in every triangle or tet is a lower bound of distance: on fine meshes `Geodesic` is far more
    accurate, and on tets the bias is larger than the error of the unsharpened field. One factorisation serves all
    rounds (Belyaev & Fayolle 2020).

    Parameters
    ----------
    tolerance : float
        Stop when the root mean squares of the primal and the dual residual, both slopes, are below this.
    max_rounds : int
        Largest number of iterations; the residuals are in the diagnostics.
    relaxation : float
        Over-relaxation, from 1 to below 2.

    See Also
    --------
    sharpen : Distance to the zero set of a field.
    methods.Geodesic : Sharpening by exact geodesic distance.

    Examples
    --------
    >>> Convex(tolerance=1e-3)
    Convex(tolerance=0.001, max_rounds=200, relaxation=1.6)
    """

    tolerance: float = 2e-3
    max_rounds: int = 200
    relaxation: float = 1.6

    def __post_init__(self) -> None:
        positive_number(self.tolerance, "tolerance")
        if positive_number(self.max_rounds, "max_rounds") % 1:
            raise SignedHeatError(f"max_rounds must be a whole number, not {self.max_rounds}", element="max_rounds")
        if not 1 <= finite_number(self.relaxation, "relaxation") < 2:
            raise SignedHeatError(
                f"relaxation must be at least 1 and below 2, not {self.relaxation}", element="relaxation"
            )

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: Floats,
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[Floats, tuple[Note, ...]]:
        if source is None or source.interpolation.shape[1] != len(values):
            raise SourceError(
                "the convex method holds φ at the source, and this field comes without one, or from one "
                "that lies on other triangles",
                remedy="pass what SignedHeatSolver.distance returned for oriented curves or points, on "
                "intrinsic_delaunay(mesh) if need be instead of with intrinsic=True",
            )
        integration = discretization.integration
        assert isinstance(integration, DirectIntegration)  # as on surfaces and tets, which have linear elements
        sizes, total = elements.sizes, elements.sizes.sum()
        with one_blas_thread():  # threads cost a triangular solve of this size more than they gain
            factor = integration.anchored(source)
            phi = np.nan_to_num(values)
            reach = max(float(np.ptp(phi)), typical_size(sizes, elements.slopes(phi).shape[1]))
            pull = elements.masses * np.sign(phi) / reach
            start = at_most_one(elements.slopes(phi))  # not normalised, since they may be mere rounding errors

            def solve(target: Floats) -> Floats:
                return factor.solve(pull + elements.divergence(target))

            rounds = split_rounds(at_most_one, solve, elements.slopes, start, start, self.relaxation)
            number, residual = 0, np.inf
            while number < self.max_rounds and residual > self.tolerance:
                phi, slopes, limited, before, _ = next(rounds)
                gaps = [((slopes - limited) ** 2).sum(axis=1), ((limited - before) ** 2).sum(axis=1)]
                residual = max(np.sqrt(sizes @ gap / total) for gap in gaps)
                number += 1
                if progress is not None:
                    progress(number / self.max_rounds, "sharpen")
        return np.where(np.isnan(values), np.nan, phi), (ConvexRounds(number, float(residual)),)


def at_most_one(vectors: Floats) -> Floats:
    """Project rows on the unit ball: those longer than one are scaled to length one."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1.0)


def typical_size(sizes: Floats, dimension: int) -> float:
    """Return the typical size of cells as a length: a field that varies by less counts as constant."""
    return float(sizes.mean() ** (1 / dimension))


@singledispatch
def sharpen_on(domain: object, field: Any, source: Any, method: Method | None, progress: Progress | None) -> Field[Any]:
    """Sharpen a field; every kind of domain registers a function of its own. `sharpen` is the public function."""
    kind = type(field if domain is None else domain).__name__
    raise UnsupportedTypeError(
        f"what lies on a {kind} cannot be sharpened", remedy="pass a field that SignedHeatSolver.distance returned"
    )


def sharpened(
    field: Field[FieldDomain],
    discretization: Discretization,
    elements: LinearElements,
    values: Floats,
    source: Any,
    method: Method | None,
    progress: Progress | None,
) -> tuple[Floats, Diagnostics]:
    """Return the sharpened values of a field on a surface or on tets, and diagnostics with the slope errors."""
    if source is not None and method is not None:
        raise UnsupportedTypeError(
            "a method measures to the zero set alone", remedy="leave out the method or the source", element="method"
        )
    method = Geodesic() if method is None else method
    if isinstance(method, type) or not isinstance(method, Method):
        raise UnsupportedTypeError(f"{method!r} is not a method of sharpening", remedy="pass Geodesic() or Convex()")
    finite = np.isfinite(values)
    if not finite.any():
        raise OutsideError("the field has no value anywhere", remedy="pass one that a source reaches")
    if not (finite | np.isnan(values)).all():
        vertex = f"vertex {np.argmax(np.isinf(values))}"
        raise GeometryError(f"the field is infinite at {vertex}", remedy="compute it again", element=vertex)
    if source is None:
        run = partial(method.sharpened, discretization, elements, values, field.source, progress)
    else:
        run = partial(distance_to_nearest, discretization, values, field.source, source, SOURCE_TOLERANCE, progress)
    new, diagnostics = timed(run, field.diagnostics, progress)
    worse = elements.bounded_slope_error(new) > 1.5 * elements.bounded_slope_error(values) + ADDED_SLOPE_ERROR
    errors = SlopeErrors(elements.slope_error(values), elements.slope_error(new), worse)
    if worse:
        warn_user(f"sharpening made the field worse: {errors}", InexactWarning)
    return new, diagnostics.noting(errors)


def timed(
    run: Callable[[], tuple[Floats, tuple[Note, ...]]], before: Diagnostics, progress: Progress | None
) -> tuple[Floats, Diagnostics]:
    """Run a function that returns values and notes; return the values, and diagnostics with the notes and its time."""
    begin = time.perf_counter()
    if progress is not None:
        progress(0.0, "sharpen")
    values, notes = run()
    if progress is not None:
        progress(1.0, "done")
    timings = {**before.timings, "sharpen": time.perf_counter() - begin}
    return values, replace(before, timings=timings).noting(*notes)
