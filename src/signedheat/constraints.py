"""Constraints on φ at the source (Sec. 7.1), which determine how step 3 is solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from .arrays import Floats, ShortRepr
from .discretization import Integration, Levels, SourceTerm
from .errors import ConstraintError
from .validation import LARGEST_COORDINATE, numbers, positive_number

__all__ = ["Constraint", "EachComponent", "Free", "LevelValues", "Soft", "ZeroSet"]


@runtime_checkable
class Constraint(Protocol):
    """Protocol of constraints on the signed distance φ. They solve step 3 of the method, which integrates unit vectors.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    SignedHeatSolver : The signed heat method alone.
    """

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        """Find φ, the signed distance at the unknowns, whose gradient is nearest to Y (step 3 of the method).

        Y are the unit vectors of step 2, which point to where φ grows. A constraint calls one of the methods of
        `integration` and returns its result.

        Parameters
        ----------
        integration : Integration
            Solves the linear system of Eq. 13 on one domain with n unknowns, with and without constraints.
        divergence : (n,) float
            Right-hand side of Eq. 13, one number for each unknown: ``b_i = ∫⟨∇λ_i, Y⟩``, with λ_i the hat function
            that is 1 at unknown i and 0 at all others. On grids it is −∇·Y at the nodes, in the shape of the grid.
        source : SourceTerm
            Samples of the source, at which φ is constrained, with their weights and the connected component that each
            is on.

        Returns
        -------
        (n,) float
            φ at the unknowns, in the units of the domain; on grids in the shape of the grid.

        See Also
        --------
        SignedHeatSolver.distance : All three steps.

        Examples
        --------
        A constraint of one's own, for which a solver calls `integrate`.

        >>> import signedheat as sh
        >>> class MeanZero(sh.constraints.Constraint):
        ...     def integrate(self, integration, divergence, source):
        ...         phi = integration.solve(divergence, source)
        ...         return phi - np.mean(phi)
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[0.5, -1], [0.5, 2]])
        >>> phi = sh.SignedHeatSolver(grid).distance(line, constraint=MeanZero())
        >>> bool(abs(phi.values.mean()) < 1e-9)
        True
        """


@dataclass(frozen=True)
class Free(Constraint):
    """No constraint on the signed distance φ: it solves Eq. 13, shifted so that its mean over the source is zero.

    The mean is weighted by the length or area of the source.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    constraints.Soft : A penalty on the source.

    Examples
    --------
    Of two lines that both face left, neither is at zero, and their mean is.

    >>> import signedheat as sh
    >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
    >>> phi = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11))).distance(lines, constraint=Free())
    >>> np.abs(phi([[0.5, 0.5], [1.5, 0.5]])).round(1).tolist()
    [0.5, 0.5]
    """

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        return integration.solve(divergence, source)


@dataclass(frozen=True)
class ZeroSet(Constraint):
    """Impose that the signed distance φ is 0 on the source, so that it lies in the zero set (Eq. 14), the default.

    Parameters
    ----------
    hard : bool
        If true, φ is exactly zero at every sample of the source. By default this holds only for curves along edges of a
        surface. Where a curve crosses faces, a penalty keeps φ within some hundredths of h, the mean distance between
        unknowns, because a function that is linear in a face and zero along the curve would be constant around it.
        On grids a smooth function is subtracted from φ, and on tets there is a penalty, so that φ is about zero on the
        source. That is cheaper than ``hard=True`` and, on broken input, more accurate.

    See Also
    --------
    constraints.Free : No constraint.
    constraints.EachComponent : Constant on each component.
    constraints.Soft : A penalty on the source.

    Examples
    --------
    Two lines that both face left, but are zero both.

    >>> import signedheat as sh
    >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
    >>> phi = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11))).distance(lines, constraint=ZeroSet())
    >>> np.abs(phi([[0.5, 0.5], [1.5, 0.5]])).round(1).tolist()
    [0.0, 0.0]
    """

    hard: bool = False

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        levels = Levels(np.zeros(len(source.weights)))
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True)
class EachComponent(Constraint):
    """Impose that the signed distance φ is constant on each component of the source (Eq. 14, Fig. 10).

    Components are connected parts of the source. Their levels are unknown.

    Parameters
    ----------
    hard : bool
        If true, φ is exactly constant at all samples of a component. By default it is as exact as with `ZeroSet`.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    constraints.LevelValues : Given levels.

    Examples
    --------
    Two lines that both face left, at levels that differ by their distance.

    >>> import signedheat as sh
    >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
    >>> phi = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11))).distance(lines, constraint=EachComponent())
    >>> np.abs(phi([[0.5, 0.5], [1.5, 0.5]])).round(1).tolist()
    [0.5, 0.5]
    """

    hard: bool = False

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        levels = Levels(np.zeros(len(source.weights)), source.components)
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True, repr=False)
class LevelValues(ShortRepr, Constraint):
    """Impose that the signed distance φ is ``values[k]`` on the k-th source, as for contour lines of a map.

    This is Eq. 14 with ``A φ = c``, where A interpolates φ at samples of the source, and c are their levels.

    Parameters
    ----------
    values : sequence of float
        Levels in the units of the domain, one for each source passed to the solver, or one for each connected component
        of the sources, with the components of the first source first.
    hard : bool
        If true, φ takes the levels exactly at every sample. By default it is as exact as with `ZeroSet`.

    Raises
    ------
    ConstraintError
        If a value is not finite, or its absolute value exceeds 1e40. Also when solving, if the number of values is
        neither that of the sources nor that of the components.

    See Also
    --------
    constraints.EachComponent : Constant on each component.
    constraints.ZeroSet : Zero on the source.

    Examples
    --------
    Two contour lines.

    >>> import signedheat as sh
    >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
    >>> phi = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11))).distance(lines, constraint=LevelValues([0.0, -2.0]))
    >>> np.abs(phi([[0.5, 0.5], [1.5, 0.5]])).round(1).tolist()
    [0.0, 2.0]
    """

    values: Sequence[float]
    hard: bool = False

    def __post_init__(self) -> None:
        values = np.atleast_1d(numbers(self.values, "values", ConstraintError))
        if values.ndim != 1 or not (np.abs(values) <= LARGEST_COORDINATE).all():
            raise ConstraintError(
                f"level values must be numbers up to {LARGEST_COORDINATE:g}, not {values}", element="values"
            )
        object.__setattr__(self, "values", tuple(values.tolist()))

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        n_sources, n_components = int(source.source_ids.max()) + 1, int(source.components.max()) + 1
        if len(self.values) == n_sources:
            index = source.source_ids
        elif len(self.values) == n_components:
            index = source.components
        else:
            raise ConstraintError(
                f"{len(self.values)} level values were given for {n_sources} sources with {n_components} "
                "connected components in all",
                remedy="give one value for each source, or one for each component",
            )
        levels = Levels(np.array(self.values)[index])
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True)
class Soft(Constraint):
    """Add a penalty on the square of the signed distance φ at the source (Fig. 11).

    The result lies between those of `Free` and ``ZeroSet(hard=True)``.

    Parameters
    ----------
    weight : float, optional
        Weight λ of the penalty, in 1/length. A small weight approaches `Free`, a large one ``ZeroSet(hard=True)``. φ
        differs from the free solution within a distance of about 1/λ of the source. By default λ is 10/h on surfaces
        and grids with spacing h. On tets it depends on the mesh.

    Raises
    ------
    ConstraintError
        If the weight is not positive and finite.

    See Also
    --------
    constraints.Free : No constraint.
    constraints.ZeroSet : Zero on the source.

    Examples
    --------
    Two lines that both face left, and are nearly at zero.

    >>> import signedheat as sh
    >>> lines = [sh.Polyline([[x, -1], [x, 2]]) for x in (0.5, 1.5)]
    >>> phi = sh.SignedHeatSolver(sh.Grid((0, 0), 0.1, (21, 11))).distance(lines, constraint=Soft(10.0))
    >>> np.abs(phi([[0.5, 0.5], [1.5, 0.5]])).round(1).tolist()
    [0.1, 0.1]
    """

    weight: float | None = None

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", positive_number(self.weight, "weight", ConstraintError))

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        weight = integration.soft_weight if self.weight is None else self.weight
        return integration.penalize(divergence, source, weight)
