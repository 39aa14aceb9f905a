"""Methods of sharpening (Sec. 7.3), which make φ of the signed heat method closer to a distance.

The error of the heat method is smooth and decreases slowly under refinement. `Geodesic` and `Convex` remove most of it.
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
from .jobs import Progress, bound_progress, report
from .linear.direct_integration import DirectIntegration
from .linear.splitting import split_rounds
from .linear.threads import one_blas_thread
from .mesh.intrinsic_mesh import IntrinsicMesh
from .mesh.tet_shapes import Tetrahedra
from .surfaces.extrapolation import Extrapolated as Extrapolated
from .validation import finite_number, positive_number, public_call

__all__ = ["Convex", "Extrapolated", "Geodesic"]

ADDED_SLOPE_ERROR = 0.1
"""Increase of `LinearElements.bounded_slope_error` above which sharpening warns that the field became worse. On
triangles it is 0.08 at most."""


@dataclass(frozen=True, eq=False)
class LinearElements:
    """Linear finite elements on m triangles (d = 2) or tets (d = 3), with n unknowns at their corners."""

    corners: Ints  # (m, d + 1) unknown at each corner of each cell
    sizes: Floats  # (m,) areas or volumes of the cells
    slope_matrix: sparse.csr_matrix  # (m d, n) maps values at the unknowns to the components of ∇φ, cell after cell

    @classmethod
    def of(cls, corners: Ints, sizes: Floats, hats: Floats, n: int) -> LinearElements:
        """Make elements from the (m, d + 1, d) gradients of the hat functions at the corners of each cell."""
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
        """Make the elements of a tet mesh. Thin tets have a reduced weight, as in the matrix C, and flat ones none."""
        flat = tets.thickness < 1e-10
        hats = tets.area_vectors / np.where(flat, -np.inf, -3.0 * tets.volumes)[:, None, None]
        return cls.of(corners, np.where(flat, 0.0, tets.weights * tets.volumes), hats, n)

    @property
    def masses(self) -> Floats:
        """Integrals of the hat functions, (n,) float, which are A_i of Eq. 18."""
        share = np.repeat(self.sizes / self.corners.shape[1], self.corners.shape[1])
        return np.asarray(np.bincount(self.corners.ravel(), share, self.slope_matrix.shape[1]), np.float64)

    def slopes(self, values: Floats) -> Floats:
        """Return (m, d) gradients ∇φ in every cell for (n,) values at the unknowns; Eq. 17 bounds their length by 1."""
        return np.asarray(self.slope_matrix @ values).reshape(len(self.sizes), -1)

    def divergence(self, vectors: Floats) -> Floats:
        """Return b of Eq. 13, (n,), with ``b_i = ∫ ⟨∇λ_i, Y⟩``, for vectors Y in cells, (m, d)."""
        return self.slope_matrix.T @ (self.sizes[:, None] * vectors).ravel()

    def slope_error(self, values: Floats) -> float:
        """Return the root mean square of ``|∇φ| − 1`` over the cells in which the (n,) values are not NaN."""
        return float(np.sqrt(self._mean((np.linalg.norm(self.slopes(values), axis=1) - 1.0) ** 2)))

    def bounded_slope_error(self, values: Floats) -> float:
        """Return the mean of ``min(| |∇φ| − 1 |, 1)`` over these cells; flat cells and kinks change it little."""
        return self._mean(np.minimum(np.abs(np.linalg.norm(self.slopes(values), axis=1) - 1.0), 1.0))

    def _mean(self, errors: Floats) -> float:
        """Return the mean of (m,) errors in cells, weighted by size, over those that are finite; NaN if none is."""
        finite = np.isfinite(errors) & (self.sizes > 0)
        return float(np.average(errors[finite], weights=self.sizes[finite])) if finite.any() else float("nan")


@dataclass(frozen=True, eq=False)
class Nearest:
    """Distance from each of n unknowns to the nearer of a source and the zero set of φ."""

    distances: Floats  # (n,) unsigned; inf on connected components of the domain that have neither
    sides: Ints  # (n,) sign 1 or −1 where the source decides it; 0 where the sign of φ does
    notes: tuple[Note, ...] = ()  # for the diagnostics


@singledispatch
def nearest(domain: Any, values: Floats, source: SourceTerm | None, given: Any, tolerance: float) -> Nearest:
    """Measure distance to the nearer of a source and the zero set of φ, with `values` at the unknowns.

    Every type of domain registers a function of its own. `source` is the one that φ was computed from. `given`, if not
    None, are curves or shapes to which distance is exact, and whose gaps the zero set closes.
    """
    raise UnsupportedTypeError(f"there are no straight lines on a {type(domain).__name__}", element="method")


def distance_to_nearest(
    domain: Any, values: Floats, source: SourceTerm | None, given: Any, tolerance: float
) -> tuple[Floats, tuple[Note, ...]]:
    """Return (n,) signed distances to the nearer of a source and the zero set, and notes for the diagnostics.

    The arguments are those of `nearest`. Unknowns that neither reaches keep their values, and NaN stays NaN.
    """
    measured = nearest(domain, values, source, given, tolerance)
    reached = np.isfinite(measured.distances)
    if not reached.any():
        raise OutsideError(
            "the field has one sign everywhere, hence no zero set to measure from",
            remedy="add an offset to its values, or use method=Convex(), which measures from the source "
            "that it was computed from",
        )
    distances = np.where(reached, measured.distances, np.abs(values))
    signed = np.copysign(distances, np.where(measured.sides != 0, measured.sides, values))
    return np.where(np.isnan(values), np.nan, signed), measured.notes


@runtime_checkable
class Method(Protocol):
    """Protocol of methods of sharpening, for fields φ on surfaces and tets."""

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: Floats,
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[Floats, tuple[Note, ...]]:
        """Sharpen the values of a field φ, which is linear on triangles or tets. `sharpen` calls this.

        Parameters
        ----------
        discretization : Discretization
            The discretisation of the domain.
        elements : LinearElements
            Elements on which φ is linear.
        values : (n,) float
            φ at the unknowns of the elements, in the units of the domain.
        source : SourceTerm or None
            The source from which φ was computed, if it is known.
        progress : callable, optional
            Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
            begins. An exception that it raises cancels.

        Returns
        -------
        values : (n,) float
            Sharpened φ at the same unknowns.
        notes : tuple of Note
            Notes for the diagnostics.

        Raises
        ------
        SourceError
            If the method needs the source, as `Convex` does, and it is not known.

        See Also
        --------
        sharpen : Sharpen a field.

        Examples
        --------
        A method of one's own: geodesic distance without sign.

        >>> import signedheat as sh
        >>> class Unsigned(sh.methods.Geodesic):
        ...     def sharpened(self, *arguments):
        ...         values, notes = super().sharpened(*arguments)
        ...         return abs(values), notes
        >>> ball = sh.samples.sphere(2)
        >>> phi = sh.SignedHeatSolver(ball).distance(ball.level_set(ball.vertices[:, 2], 0.01))
        >>> bool(sh.sharpen(phi, method=Unsigned()).values.min() >= 0)
        True
        """


@dataclass(frozen=True)
class Geodesic(Method):
    """Sharpen a field φ to the geodesic distance from its zero set, with the signs of φ (Eq. 17), the default.

    On surfaces it is exact polyhedral distance, whatever the shape of the triangles. Distance to unoriented curves and
    to points is measured from these themselves, even if φ is not zero there. If no source is oriented, distance is
    positive everywhere. In tet meshes it is the length of straight lines, which bend around the boundary of the mesh.

    The zero set of φ and its signs are kept, including signs that a long diffusion has made wrong. In tets, the zero
    set is that of a quadratic correction of the linear interpolant, which is closer to a smooth surface.

    Parameters
    ----------
    tolerance : float
        Largest change of a distance, relative to the length of an edge, by which the algorithm on surfaces may merge
        neighbouring intervals (windows) on the edge. 0 is exact, and takes time proportional to n^1.5 for n faces.

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

    @public_call
    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: Floats,
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[Floats, tuple[Note, ...]]:
        return distance_to_nearest(discretization, values, source, None, self.tolerance)


SOURCE_TOLERANCE = 0.1 * Geodesic.tolerance
"""Tolerance of `Geodesic` for distance to given curves. The order of faces then changes distances by less than 1e-6 of
their range."""


@dataclass(frozen=True)
class Convex(Method):
    """Sharpen a field φ by a convex problem, whose solution has gradients of length at most 1 (Eq. 17, Eq. 18).

    It maximises ``Σ A_i sign(φ⁰_i) φ_i`` under ``|∇φ| ≤ 1`` in every cell and φ = 0 on the source, where φ⁰ is the
    given field and A_i the area or volume around vertex i. This can correct signs that a long diffusion has made wrong.
    But a function with such gradients is a lower bound of distance. On fine triangle meshes `Geodesic` is far more
    accurate, and on tets the bias is larger than the error of the unsharpened field. The solver is ADMM with one
    factorisation (Belyaev & Fayolle 2020).

    Parameters
    ----------
    tolerance : float
        Root mean square of the primal and the dual residual, without units, below which iterations end.
    max_rounds : int
        Largest number of iterations. The number needed and the residual are in the diagnostics.
    relaxation : float
        Factor of over-relaxation, at least 1 and below 2. It changes the number of iterations, not the solution.

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

    @public_call
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
        # ADMM for φ and z = ∇φ: minimise −Σ A_i sign(φ⁰_i) φ_i / reach, where z has lengths of at most 1
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
                report(number / self.max_rounds, "sharpen")
        return np.where(np.isnan(values), np.nan, phi), (ConvexRounds(number, float(residual)),)


def at_most_one(vectors: Floats) -> Floats:
    """Scale rows longer than 1 to length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1.0)


def typical_size(sizes: Floats, dimension: int) -> float:
    """Return a typical length of cells, from their (m,) areas or volumes and the dimension 2 or 3."""
    return float(sizes.mean() ** (1 / dimension))


@singledispatch
def sharpen_on(domain: object, field: Any, source: Any, method: Method | None) -> Field[Any]:
    """Sharpen a field on a domain. Every type of domain registers a function of its own for `sharpen` to call."""
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
) -> tuple[Floats, Diagnostics]:
    """Return the sharpened values of a field on a surface or on tets, and diagnostics with the slope errors.

    `values` are φ at the unknowns of the elements, (n,). With a `source`, distance is measured to it, else by the
    `method`. A warning says if sharpening made the field worse.
    """
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
        run = partial(method.sharpened, discretization, elements, values, field.source, bound_progress())
    else:
        run = partial(distance_to_nearest, discretization, values, field.source, source, SOURCE_TOLERANCE)
    new, diagnostics = timed(run, field.diagnostics)
    worse = elements.bounded_slope_error(new) > 1.5 * elements.bounded_slope_error(values) + ADDED_SLOPE_ERROR
    errors = SlopeErrors(elements.slope_error(values), elements.slope_error(new), worse)
    if worse:
        warn_user(f"sharpening made the field worse: {errors}", InexactWarning)
    return new, diagnostics.noting(errors)


def timed(run: Callable[[], tuple[Floats, tuple[Note, ...]]], before: Diagnostics) -> tuple[Floats, Diagnostics]:
    """Call ``run()``, which returns values and notes; return the values, and diagnostics with the notes and time."""
    begin = time.perf_counter()
    report(0.0, "sharpen")
    values, notes = run()
    timings = {**before.timings, "sharpen": time.perf_counter() - begin}
    return values, replace(before, timings=timings).noting(*notes)
