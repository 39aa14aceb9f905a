"""The solver: a domain and a diffusion time, with the factorisations made for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import Any, Generic, Literal, NamedTuple, TypeVar, cast, overload

from .arrays import Floats, Frozen, Ints, LastUsed
from .constraints import Constraint, LevelValues, ZeroSet
from .diagnostics import Diagnostics, Note
from .discretization import Adaptable, Discretization, SourceTerm, discretize
from .errors import InexactWarning, SourceError, UnsupportedTypeError, warn_user
from .fields.field import Field
from .fields.solutions import to_field, warned
from .grids.grid import Dimension, Grid
from .jobs import Progress, Stopwatch, bound_progress, part_of_work, report, reporting
from .method import diffuse, diffuse_many, integrate, integrate_many, normalize
from .shapes.foreign import ForeignShape, as_list, converted
from .shapes.kinds import AnySurface, Domain, Shapes, Sources, SpaceSources
from .surfaces.extrapolation import Diffusion, Extrapolated, blended, default_diffusion, lowered_for_times
from .surfaces.intrinsic_discretization import Retriangulated, lowered_by_angles
from .surfaces.intrinsic_triangulation import triangle_mesh
from .surfaces.repaired_mesh import RepairedMesh
from .surfaces.source_segments import given_curves, numbers_kept, one_sided
from .surfaces.surface_curves import CurvesAndPoints
from .surfaces.surface_source import SurfaceSource
from .surfaces.triangle_mesh import TriangleMesh
from .tets.tet_mesh import TetMesh
from .validation import callback, chosen, positive_number, public_call, refuse_pair_apart

SOURCES_AT_ONCE = 16
"""Number of sources that `distance_many` diffuses at a time, which bounds its memory."""

AnyDomain = TypeVar("AnyDomain", bound=Domain | ForeignShape, covariant=True)


class _Prepared(NamedTuple):
    """Sources of one field, lowered to a discretisation, so that the three steps can run."""

    discretization: Discretization
    terms: Sequence[SourceTerm]  # one for each diffusion time
    notes: tuple[Note, ...]
    constraint: Constraint

    @property
    def times(self) -> list[float]:
        """Diffusion time t of each of the terms."""
        return [term.time for term in self.terms]


@dataclass(frozen=True, eq=False)
class SignedHeatSolver(Frozen, Generic[AnyDomain]):
    """Solver for generalized signed distance on one domain, by the signed heat method.

    Matrices are factorised at first use and kept, so that further distances are cheap.

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Grid
        Domain of the fields. Boundary vertices of a mesh that coincide, as along seams, are treated as one vertex.
    diffusion : float or Extrapolated, optional
        Factor τ of the time ``t = τ h²`` for which normals of the source are diffused like heat, with h the mean
        distance between unknowns. Larger values close gaps in broken sources along rounder lines. The paper uses 1. The
        default is 1 in space and `Extrapolated` on surfaces.
    progress : callable, optional
        Called as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of the step that
        begins. An exception that it raises cancels.
    intrinsic : "auto", True or False
        Whether the method runs on an intrinsic Delaunay refinement of a triangle mesh instead of its triangles.

        * "auto" refines the mesh once, if large angles or thin triangles would make distance inaccurate. All sources
          share the refinement and its factorised matrices.
        * True makes a refinement for every set of sources, with edges along them, for curves smaller than triangles.
          On CAD models its error is 0.3 to 0.9 times that of "auto", at the cost of a factorisation for every set.
        * False uses the triangles as they are.

        For more control, pass the result of `intrinsic_delaunay` as the domain.

    Raises
    ------
    ValueError
        If `diffusion` is not positive and finite.

    See Also
    --------
    signed_distance : Distance on a grid, on tets or along a surface.
    sharpen : Distance to the zero set of a field.
    piecewise_distance : Distance to curves that bound no region.
    methods.Extrapolated : Extrapolation in diffusion time.
    constraints.ZeroSet : Zero on the source.

    Examples
    --------
    A quarter of a circle from the equator of a ball to its pole:

    >>> from signedheat import SignedHeatSolver, samples
    >>> ball = samples.sphere(3)
    >>> solver = SignedHeatSolver(ball)
    >>> phi = solver.distance(ball.level_set(ball.vertices[:, 2], 0.01))
    >>> bool(abs(phi.values.max() - 1.57) < 0.05)
    True
    """

    domain: AnyDomain
    diffusion: Diffusion | None = None
    progress: Progress | None = field(default=None, repr=False)
    intrinsic: bool | Literal["auto"] = "auto"
    _made: LastUsed[None, Adaptable] = field(default_factory=LastUsed, init=False, repr=False)

    def __post_init__(self) -> None:
        refuse_pair_apart((self.domain, self.diffusion), "SignedHeatSolver")
        callback(self.progress, "progress(fraction, step)")
        object.__setattr__(self, "domain", converted(self.domain))
        if discretize.dispatch(type(self.domain)) is discretize.dispatch(object):
            discretize(self.domain)  # raises
        if not isinstance(self.diffusion, Extrapolated | None):
            object.__setattr__(self, "diffusion", positive_number(self.diffusion, "diffusion"))
        chosen(self.intrinsic, Literal["auto", True, False], "intrinsic")

    @property
    def discretization(self) -> Adaptable:
        """The discretisation of the domain, which is made at first use."""
        return self._made(None, self._discretized)

    def _discretized(self) -> Adaptable:
        """Make the discretisation, of the domain, of a refinement, or of a new refinement for every set of sources.

        The option `intrinsic` decides which.
        """
        with reporting(bound_progress() or self.progress):
            if self.intrinsic == "auto":
                return lowered_by_angles(self.domain)
            return Retriangulated(triangle_mesh(self.domain)) if self.intrinsic else discretize(self.domain)

    def with_diffusion(self, diffusion: Diffusion | None) -> SignedHeatSolver[AnyDomain]:
        """Return a solver on the same domain with another diffusion factor τ.

        It shares everything that does not depend on τ with this solver, such as the factorised Laplacian.

        Parameters
        ----------
        diffusion : float, Extrapolated or None
            Factor τ of the diffusion time ``t = τ h²``, with h the mean distance between unknowns, as for the class.
            None stands for its default.

        Returns
        -------
        SignedHeatSolver
            The new solver. This one does not change.

        See Also
        --------
        SignedHeatSolver.distance : Distance with this solver.

        Examples
        --------
        >>> import signedheat as sh
        >>> solver = sh.SignedHeatSolver(sh.Grid((0, 0), 1.0, (8, 8)))
        >>> solver.with_diffusion(4.0).discretization is solver.discretization
        True
        """
        return with_discretization(replace(self, diffusion=diffusion), self.discretization)

    @overload
    def distance(
        self: SignedHeatSolver[Grid[Dimension]], sources: SpaceSources, constraint: Constraint | None = None
    ) -> Field[Grid[Dimension]]: ...
    @overload
    def distance(
        self: SignedHeatSolver[TetMesh], sources: Shapes, constraint: Constraint | None = None
    ) -> Field[TetMesh]: ...
    @overload
    def distance(
        self: SignedHeatSolver[AnySurface], sources: CurvesAndPoints, constraint: Constraint | None = None
    ) -> Field[AnySurface]: ...
    @overload
    def distance(self, sources: Sources, constraint: Constraint | None = None) -> Field: ...
    @public_call
    def distance(self, sources: Sources, constraint: Constraint | None = None) -> Field:
        """Compute the signed distance to sources.

        Parameters
        ----------
        sources : one source or a sequence of them
            On surfaces `Curve`, `SurfacePoints`, or lists of (element, barycentric coordinates), as in potpourri3d. In
            space `TriangleMesh`, `PolygonMesh` or `PointCloud`. In the plane `Polyline`.
        constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
            Constraint on φ at the sources (`constraints`). By default `ZeroSet`, which makes φ zero on all of them.

        Returns
        -------
        Field
            Signed distance φ in the units of the domain. It is positive on the side that the source normals point to,
            so negative inside a shape. On a surface it is positive to the left of a curve.

        Raises
        ------
        SourceError
            If there is no source, or one does not fit the domain.
        ConstraintError
            If the constraint does not fit the sources.

        See Also
        --------
        SignedHeatSolver.distance_many : Several sources at once.
        signed_distance : Distance that is exact to the source.
        sharpen : Exact distance to the zero set of a field.

        Examples
        --------
        >>> import signedheat as sh
        >>> plane = sh.TriangleMesh([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> upwards = plane.polyline([[1, 0, 0], [1, 1, 0]])
        >>> sh.SignedHeatSolver(plane).distance(upwards).values.round(3).tolist()  # positive on its left
        [1.0, -1.0, -1.0, 1.0]
        """
        with reporting(self.progress):
            return warned(self._distance(sources, constraint))

    @cached_property
    def _repaired(self) -> tuple[RepairedMesh, SignedHeatSolver[Any]] | None:
        """The mesh without duplicate faces, and a solver on it; None if the domain has no duplicate faces."""
        repaired = RepairedMesh.of(self.domain, agree=False)
        return None if repaired is None else (repaired, replace(self, domain=repaired.mesh))

    def _distance(self, sources: Sources, constraint: Constraint | None) -> Field:
        """Compute the field of `distance` without warning of small curves."""
        if self._repaired is not None:
            repaired, solver = self._repaired
            return repaired.on_given(cast("Field[Any]", solver._distance(repaired.on_it(sources), constraint)))
        constraint = checked(constraint)
        stopwatch = Stopwatch(steps=5)
        with stopwatch("prepare"):
            _ = self.discretization  # made once, and kept
        with stopwatch("sources"):
            discretization, sources_by_time, notes, constraint = self._prepared(sources, constraint)
        with stopwatch("diffuse"):
            vectors = [diffuse(discretization, source) for source in sources_by_time]
        with stopwatch("normalize"):
            source = sources_by_time[0]
            directions = blended(sources_by_time, (normalize(discretization, diffused) for diffused in vectors))
            del vectors
        with stopwatch("integrate"):
            values = integrate(discretization, directions, source, constraint)
        diagnostics = Diagnostics(timings=dict(stopwatch.seconds), time=source.time, notes=notes)
        return to_field(discretization, values, source, diagnostics)

    def _prepared(self, sources: Sources, constraint: Constraint) -> _Prepared:
        """Adapt the discretisation to sources, and lower them to it for each diffusion time.

        Warns of curves that have one side only. Levels of sources that are left out are dropped from the constraint.
        """
        listed, left_out = given_curves(self.domain, as_list(sources))
        kept = numbers_kept(len(listed), left_out)
        _warn_of_one_sided_curves(self.domain, listed, kept)
        with part_of_work(0.0, 0.4):
            discretization, adapted = self.discretization.adapt(listed)
        times = default_diffusion(discretization) if self.diffusion is None else self.diffusion
        terms = lowered_for_times(discretization, adapted, times)
        if isinstance(constraint, LevelValues):
            if len(constraint.values) == len(kept) + (0 if left_out is None else len(left_out.without_length)):
                last = int(terms[0].source_ids.max())  # later sources lie outside the domain
                constraint = replace(constraint, values=[constraint.values[k] for k in kept[: last + 1]])
        return _Prepared(discretization, terms, () if left_out is None else (left_out,), constraint)

    @overload
    def distance_many(
        self: SignedHeatSolver[Grid[Dimension]], sources: Sequence[SpaceSources], constraint: Constraint | None = None
    ) -> list[Field[Grid[Dimension]]]: ...
    @overload
    def distance_many(
        self: SignedHeatSolver[TetMesh], sources: Sequence[Shapes], constraint: Constraint | None = None
    ) -> list[Field[TetMesh]]: ...
    @overload
    def distance_many(
        self: SignedHeatSolver[AnySurface], sources: Sequence[CurvesAndPoints], constraint: Constraint | None = None
    ) -> list[Field[AnySurface]]: ...
    @overload
    def distance_many(self, sources: Sequence[Sources], constraint: Constraint | None = None) -> Sequence[Field]: ...
    @public_call
    def distance_many(self, sources: Sequence[Sources], constraint: Constraint | None = None) -> Sequence[Field]:
        """Compute a field for each of several sources, which is faster than to call `distance` for each.

        Parameters
        ----------
        sources : sequence
            Each entry is one source or a sequence of them, to which one field is computed: on surfaces curves and
            points, in space meshes and point clouds, in the plane polylines.
        constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
            Constraint on every field at its source; `ZeroSet` by default. With `Free`, the sources share most of the
            work.

        Returns
        -------
        list of Field
            The result of `distance` for each entry, up to rounding, in the units of the domain. Timings are divided
            equally among the sources.

        Raises
        ------
        SourceError
            If an entry has no source, or one that does not fit the domain.
        ConstraintError
            If the constraint does not fit the sources.

        See Also
        --------
        SignedHeatSolver.distance : One source.

        Examples
        --------
        >>> import signedheat as sh
        >>> solver = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11)))
        >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
        >>> [round(phi([1.0, 0.5]).item(), 2) for phi in solver.distance_many(lines)]
        [-0.5, 0.5]
        """
        with reporting(self.progress):
            return self._distance_many(sources, constraint)

    def _distance_many(self, sources: Sequence[Sources], constraint: Constraint | None) -> Sequence[Field]:
        """Compute the fields of `distance_many`."""
        constraint = checked(constraint)
        try:
            listed = list(sources)
        except TypeError:
            kind = type(sources).__name__
            raise SourceError(
                f"distance is measured to each source of a list, and a {kind} is none", remedy="call distance instead"
            ) from None
        if self._repaired is not None:
            repaired, solver = self._repaired
            on_it = solver._distance_many([repaired.on_it(entry) for entry in listed], constraint)
            return [repaired.on_given(each) for each in on_it]
        fields: list[Field] = []
        for begin in range(0, len(listed), SOURCES_AT_ONCE):
            batch = (self._prepared(entry, constraint) for entry in listed[begin : begin + SOURCES_AT_ONCE])
            for (discretization, _, imposed), run in groupby(
                batch, lambda prepared: (prepared.discretization, prepared.times, prepared.constraint)
            ):
                alike = list(run)
                by_time = list(zip(*(prepared.terms for prepared in alike), strict=True))
                first = by_time[0]
                stopwatch = Stopwatch(steps=1)
                with reporting(None), stopwatch("together"):
                    diffused = [diffuse_many(discretization, terms) for terms in by_time]
                    directions = (
                        blended(prepared.terms, [normalize(discretization, vectors) for vectors in of_times])
                        for prepared, of_times in zip(alike, zip(*diffused, strict=True), strict=True)
                    )
                    solved = list(integrate_many(discretization, directions, first, imposed))
                seconds = {step: total / len(first) for step, total in stopwatch.seconds.items()}
                for source, values, prepared in zip(first, solved, alike, strict=True):
                    diagnostics = Diagnostics(timings=seconds, time=source.time, notes=prepared.notes)
                    fields.append(warned(to_field(discretization, values, source, diagnostics)))
            with part_of_work(0.4, 1.0):  # before, the domain is discretised
                report(len(fields) / len(listed), f"{len(fields)} of {len(listed)}")
        return fields


@overload
def distance_unwarned(
    solver: SignedHeatSolver[AnySurface], sources: CurvesAndPoints, constraint: Constraint | None
) -> Field[AnySurface]: ...
@overload
def distance_unwarned(solver: SignedHeatSolver[Any], sources: Sources, constraint: Constraint | None) -> Field: ...
def distance_unwarned(solver: SignedHeatSolver[Any], sources: Sources, constraint: Constraint | None) -> Field:
    """Compute `SignedHeatSolver.distance` without warning of small curves, for callers that then measure exactly."""
    return solver._distance(sources, constraint)


def with_discretization(solver: SignedHeatSolver[AnyDomain], made: Adaptable) -> SignedHeatSolver[AnyDomain]:
    """Return a copy of a solver that uses a discretisation made before."""
    copy = replace(solver)
    copy._made(None, lambda: made)
    return copy


def field_without_heat(
    solver: SignedHeatSolver[AnySurface],
    curves: CurvesAndPoints,
    measure: Callable[[SurfaceSource], tuple[Floats, tuple[Note, ...]] | None],
) -> Field[AnySurface] | None:
    """Make a field from values that ``measure(source)`` returns, without diffusion.

    The source has the curves lowered to the triangles of the solver. The function returns (n,) values at their vertices
    and notes for the diagnostics, or None. Then the result is None, too.
    """
    stopwatch = Stopwatch(steps=1)
    with stopwatch("distance"):
        discretization, terms, notes, _ = solver._prepared(curves, ZeroSet())
        source = cast("SurfaceSource", terms[0])
        measured = measure(source)
    if measured is None:
        return None
    values, more = measured
    return to_field(discretization, values, source, Diagnostics(dict(stopwatch.seconds), notes=(*notes, *more)))


def _warn_of_one_sided_curves(domain: object, curves: Sequence[Any], names: Ints) -> None:
    """Warn of curves on a mesh along which left and right are exchanged, as on a Möbius strip; `names` number them."""
    numbers = one_sided(curves, domain.intrinsic) if isinstance(domain, TriangleMesh) else []
    if numbers:
        warn_user(
            f"curve {names[numbers[0]]}{' and others have' if len(numbers) > 1 else ' has'} one side only: the surface "
            "around it has no outside, so that left and right are exchanged somewhere along it. Give it normals, or "
            "make it unoriented",
            InexactWarning,
        )


def checked(constraint: Constraint | None) -> Constraint:
    """Return the constraint, or ``ZeroSet()`` for None; raise an error for anything else."""
    if constraint is None:
        return ZeroSet()
    if isinstance(constraint, type) or not isinstance(constraint, Constraint):
        raise UnsupportedTypeError(
            f"{constraint!r} is not a constraint",
            remedy="pass Free(), ZeroSet(), EachComponent(), LevelValues(values) or Soft(weight)",
        )
    return constraint
