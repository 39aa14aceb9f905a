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
    """Protocol of constraints, which finish step 3.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    SignedHeatSolver : The signed heat method alone.
    """

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        """Solve step 3 for φ under the constraint.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 13 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side b: the integrated divergence of the unit vectors Y.
        source : SourceTerm
            Points where φ is constrained, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        See Also
        --------
        SignedHeatSolver.distance : All three steps.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.constraints.Soft(1.0))([0.5, 0.5]).item(), 2)
        0.5
        """


@dataclass(frozen=True)
class Free(Constraint):
    """No constraint: φ solves Eq. 13 and is shifted so that its weighted mean over the source is zero.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    constraints.Soft : A penalty on the source.

    Examples
    --------
    >>> Free()
    Free()
    """

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        return integration.solve(divergence, source)


@dataclass(frozen=True)
class ZeroSet(Constraint):
    """φ = 0 on the source (Eq. 14). This is the default.

    Parameters
    ----------
    hard : bool
        Impose φ = 0 at every sample of the source. By default, φ is zero on surfaces along curves that follow edges;
        where a curve crosses faces, springs keep it within some hundredths of h, since a linear function that is zero
        there would be constant around the curve. On grids a smooth function, and on tets springs, correct φ to about
        zero along the source, which is cheaper and, on broken input, more accurate.

    See Also
    --------
    constraints.Free : No constraint.
    constraints.EachComponent : Constant on each component.
    constraints.Soft : A penalty on the source.

    Examples
    --------
    >>> ZeroSet(hard=True)
    ZeroSet(hard=True)
    """

    hard: bool = False

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        levels = Levels(np.zeros(len(source.weights)))
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True)
class EachComponent(Constraint):
    """φ is constant on each connected component of the source, at an unknown level (Eq. 14, Fig. 10).

    Parameters
    ----------
    hard : bool
        Impose the levels at every sample; by default, they are imposed as exactly as by `ZeroSet`.

    See Also
    --------
    constraints.ZeroSet : Zero on the source.
    constraints.LevelValues : Given levels.

    Examples
    --------
    >>> EachComponent()
    EachComponent(hard=False)
    """

    hard: bool = False

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        levels = Levels(np.zeros(len(source.weights)), source.components)
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True, repr=False)
class LevelValues(ShortRepr, Constraint):
    """Given levels: φ = ``values[k]`` on the k-th source, as for the contour lines of a map (Eq. 14 with ``A φ = c``).

    Parameters
    ----------
    values : sequence of float
        One level for each source passed to the solver; or one for each connected component of the sources, components
        of the first source first.
    hard : bool
        Impose the levels at every sample; by default, as exactly as `ZeroSet`.

    Raises
    ------
    ConstraintError
        If a value is not finite, or beyond 1e40; or, when solving, if the number of values is neither that of the
        sources nor that of the components.

    See Also
    --------
    constraints.EachComponent : Constant on each component.
    constraints.ZeroSet : Zero on the source.

    Examples
    --------
    >>> LevelValues([0.0, 1.0]).values
    (0.0, 1.0)
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
    """A penalty pulls φ to zero on the source: zero weight is `Free`, infinite weight ``ZeroSet(hard=True)`` (Fig. 11).

    Parameters
    ----------
    weight : float, optional
        λ, in 1/length; by default 10/h on surfaces and grids with spacing h, and according to the mesh on tets. φ
        differs from the free solution within a distance of about 1/λ of the source.

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
    >>> Soft(10.0)
    Soft(weight=10.0)
    """

    weight: float | None = None

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", positive_number(self.weight, "weight", ConstraintError))

    def integrate(self, integration: Integration, divergence: Floats, source: SourceTerm) -> Floats:
        weight = integration.soft_weight if self.weight is None else self.weight
        return integration.penalize(divergence, source, weight)
