"""The solver: a domain and a diffusion time, held together with whatever has been factorised for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from operator import itemgetter
from typing import Any

from .constraints import Constraint, ZeroSet
from .discretization import Diagnostics, Discretization, discretize
from .domains.validation import positive_number
from .errors import SourceError
from .fields.to_field import to_field
from .lowering.area_elements import grid_around
from .lowering.surface.intrinsic import Retriangulated
from .method import diffuse, diffuse_many, integrate, integrate_many, normalize
from .progress import Progress, Stopwatch

_BATCH = 16  # sources diffused at a time


@dataclass(frozen=True, eq=False)
class SignedHeatSolver:
    """Generalized signed distance on one domain.

    What a domain needs factorised is factorised at first use and kept, so that a second distance is cheap.

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Grid
        What distance is measured on.
    diffusion : float
        τ in ``t = τ h²``, h the mean distance between unknowns. Larger values complete broken sources more roundly.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.
    intrinsic : bool
        Triangulate a triangle mesh anew, along its surface, for every set of sources: slower, since nothing is kept
        from one distance to the next, and far more accurate where triangles are bad or curves cross them. For control
        over it, or several distances, make the domain yourself with `intrinsic_delaunay`.

    Raises
    ------
    ValueError
        If `diffusion` is not positive and finite.
    """

    domain: Any
    diffusion: float = 1.0
    progress: Progress | None = field(default=None, repr=False)
    intrinsic: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "diffusion", positive_number(self.diffusion, "diffusion"))

    @cached_property
    def discretization(self) -> Discretization:
        """The domain as the method sees it."""
        if self.intrinsic:
            progress = self.progress
            report = None if progress is None else lambda share: progress((1 + share) / 5, "refine")
            return Retriangulated(self.domain, report)
        return discretize(self.domain)

    def with_diffusion(self, diffusion: float) -> SignedHeatSolver:
        """The same with another τ; keeps what does not depend on it, which is half of what is factorised.

        Examples
        --------
        >>> import signedheat as sh
        >>> solver = sh.SignedHeatSolver(sh.Grid((0, 0), 1.0, (8, 8)))
        >>> solver.with_diffusion(4.0).discretization is solver.discretization
        True
        """
        other = replace(self, diffusion=diffusion)
        other.__dict__["discretization"] = self.discretization
        return other

    def distance(self, sources: Any, constraint: Constraint | None = None) -> Any:
        """Signed distance to sources.

        Parameters
        ----------
        sources : one source or a sequence of them
            On surfaces: `Curve`, `SurfacePoints`. In space: `TriangleMesh`, `PolygonMesh`, `PointCloud`; in the plane:
            `Polyline`.
        constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
            What to impose on φ at the sources; `ZeroSet` by default.

        Returns
        -------
        VertexField, GridField or TetField
            φ > 0 on the side that the source normals point to (on a surface: to the left of a curve).

        Raises
        ------
        SourceError
            If there is no source, or one does not fit the domain.
        ConstraintError
            If the constraint does not fit the sources.
        """
        constraint = checked(constraint)
        stopwatch = Stopwatch(self.progress, steps=5)
        with stopwatch("prepare"):
            discretization = self.discretization
        with stopwatch("sources"):
            discretization, sources = discretization.adapt(as_list(sources))
            source = discretization.lower(sources, self.diffusion)
        with stopwatch("diffuse"):
            vectors = diffuse(discretization, source)
        with stopwatch("normalize"):
            directions = normalize(discretization, vectors)
            del vectors
        with stopwatch("integrate"):
            values = integrate(discretization, directions, source, constraint)
        diagnostics = Diagnostics(timings=dict(stopwatch.seconds), time=source.time)
        return to_field(discretization, values, source, diagnostics)

    def distance_many(self, sources: Sequence[Any], constraint: Constraint | None = None) -> list[Any]:
        """Signed distance to each of several sources on its own; cheaper than one after the other.

        Parameters
        ----------
        sources : sequence
            Each entry is what `distance` takes.
        constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
            Imposed on every one; `ZeroSet` by default. `Free` shares most work.

        Returns
        -------
        list of VertexField, GridField or TetField
            What `distance` gives for each, up to rounding. Timings are those of each source's share.
        """
        constraint = checked(constraint)
        fields: list[Any] = []
        for begin in range(0, len(sources), _BATCH):
            batch = []
            for entry in sources[begin : begin + _BATCH]:
                discretization, adapted = self.discretization.adapt(as_list(entry))
                batch.append((discretization, discretization.lower(adapted, self.diffusion)))
            for discretization, run in groupby(batch, key=itemgetter(0)):
                lowered = [source for _, source in run]
                stopwatch = Stopwatch(None, steps=1)
                with stopwatch("together"):
                    diffused = diffuse_many(discretization, lowered)
                    directions = (normalize(discretization, vectors) for vectors in diffused)
                    solved = list(integrate_many(discretization, directions, lowered, constraint))
                seconds = {step: total / len(lowered) for step, total in stopwatch.seconds.items()}
                for source, values in zip(lowered, solved, strict=True):
                    diagnostics = Diagnostics(timings=seconds, time=source.time)
                    fields.append(to_field(discretization, values, source, diagnostics))
        return fields


def checked(constraint: Constraint | None) -> Constraint:
    """The constraint, or the default for none."""
    if constraint is None:
        return ZeroSet()
    if isinstance(constraint, type) or not isinstance(constraint, Constraint):
        raise TypeError(
            f"{constraint!r} is not a constraint: pass Free(), ZeroSet(), EachComponent(), LevelValues(values) or "
            "Soft(weight)"
        )
    return constraint


def as_list(sources: Any) -> list[Any]:
    """One source or several, as a list."""
    listed = list(sources) if isinstance(sources, Sequence) else [sources]
    if not listed:
        raise SourceError("there is no source: pass at least one curve, point or shape")
    return listed


def signed_distance(
    source: Any,
    domain: Any = None,
    *,
    resolution: int = 128,
    padding: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    progress: Progress | None = None,
) -> Any:
    """Signed distance to a shape, however broken, in one call.

    Parameters
    ----------
    source : TriangleMesh, PolygonMesh, PointCloud with normals or Polyline, or a sequence of them
        The shape, in the plane a `Polyline`; any source of `SignedHeatSolver.distance` where a domain is given.
    domain : Grid, TetMesh, TriangleMesh, …, optional
        Where to measure; by default a grid of cubic cells around the shape.
    resolution : int
        Number of nodes along the longest side of that grid.
    padding : float, optional
        Room around the shape, in its units; by default a fifth of its longest side.
    constraint : Free, ZeroSet, EachComponent, LevelValues or Soft
        What to impose on φ at the source; `ZeroSet` by default.
    diffusion : float
        τ in ``t = τ h²``. Larger values complete broken shapes more roundly.
    progress : callable, optional
        Called as ``progress(fraction, step)``.

    Returns
    -------
    GridField, TetField or VertexField
        φ > 0 on the side that the normals point to: negative inside a shape whose normals point outwards.

    Raises
    ------
    GeometryError
        If resolution or padding make no grid.
    SourceError
        If the shape cannot be a source, for instance points without normals.
    MemoryLimitError
        If the grid cannot fit in memory; nothing has been allocated then.

    Examples
    --------
    >>> from signedheat import TriangleMesh
    >>> octahedron = TriangleMesh(
    ...     [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
    ...     [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    ... )
    >>> sdf = signed_distance(octahedron, resolution=24)
    >>> sdf([[0, 0, 0], [1.2, 0, 0]]) > 0
    array([False,  True])
    """
    if domain is None:
        domain = grid_around(as_list(source), resolution, padding)
    return SignedHeatSolver(domain, diffusion, progress).distance(source, constraint)
