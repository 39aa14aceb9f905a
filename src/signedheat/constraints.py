"""Constraints on φ at the source (Sec. 7.1): values that determine how step 3 is solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .discretization import Integration, Levels, SourceTerm
from .errors import ConstraintError
from .reprs import ShortRepr
from .validation import LARGEST, numbers, positive_number


@runtime_checkable
class Constraint(Protocol):
    """The protocol of constraints: they finish step 3."""

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """φ at the unknowns, from b, the divergence of Y."""


@dataclass(frozen=True)
class Free:
    """No constraint: φ solves Eq. 13 and is shifted so that its weighted mean over the source is zero.

    Examples
    --------
    >>> Free()
    Free()
    """

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """Integrate without a constraint; φ is shifted to mean 0 on the source.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 7 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side: the integrated divergence of the unit vectors.
        source : SourceTerm
            Where φ is known, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.Free())([0.5, 0.5]).item(), 2)
        0.5
        """
        return integration.solve(divergence, source)


@dataclass(frozen=True)
class ZeroSet:
    """φ = 0 on the source: the default.

    Imposed as in Eq. 14.

    Parameters
    ----------
    hard : bool
        Impose φ = 0 at every point at which the source is sampled. By default φ is zero, up to rounding, on surfaces
        along curves that follow edges; where a curve crosses faces, a linear function could follow it only by being
        constant next to it, so that springs hold φ to within some hundredths of h. On grids and tets φ is corrected to
        zero along the source by a smooth function or by springs, which is cheaper and, on broken input, more accurate.

    Examples
    --------
    >>> ZeroSet(hard=True)
    ZeroSet(hard=True)
    """

    hard: bool = False

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """Integrate with φ constant on the source, and 0 there.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 7 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side: the integrated divergence of the unit vectors.
        source : SourceTerm
            Where φ is known, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.ZeroSet())([0.5, 0.5]).item(), 2)
        0.5
        """
        levels = Levels(np.zeros(len(source.weights)))
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True)
class EachComponent:
    """φ is level on every connected component of the source, each at its own unknown level.

    Imposed as in Eq. 14; Fig. 10 shows it.

    Parameters
    ----------
    hard : bool
        Exactly so at every sample; by default as exactly as `ZeroSet`.

    Examples
    --------
    >>> EachComponent()
    EachComponent(hard=False)
    """

    hard: bool = False

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """Integrate with φ constant on each connected component of the source.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 7 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side: the integrated divergence of the unit vectors.
        source : SourceTerm
            Where φ is known, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.EachComponent())([0.5, 0.5]).item(), 2)
        0.5
        """
        levels = Levels(np.zeros(len(source.weights)), source.components)
        return (integration.fit_exactly if self.hard else integration.fit)(divergence, source, levels)


@dataclass(frozen=True, repr=False)
class LevelValues(ShortRepr):
    """Given levels: φ = ``values[k]`` on the k-th source, as for the contour lines of a map (Eq. 14 with ``A φ = c``).

    Parameters
    ----------
    values : sequence of float
        One level for each source passed to the solver; or one for each connected component of the sources, components
        of the first source first.
    hard : bool
        Exactly so at every sample; by default as exactly as `ZeroSet`.

    Raises
    ------
    ConstraintError
        If a value is not finite, or beyond 1e40; when solving, if their number is neither that of the sources nor
        of the components.

    Examples
    --------
    >>> LevelValues([0.0, 1.0]).values
    (0.0, 1.0)
    """

    values: Sequence[float]
    hard: bool = False

    def __post_init__(self) -> None:
        values = np.atleast_1d(numbers(self.values, "values", ConstraintError))
        if values.ndim != 1 or not (np.abs(values) <= LARGEST).all():
            raise ConstraintError(f"level values must be numbers up to {LARGEST:g}, not {values}", element="values")
        object.__setattr__(self, "values", tuple(values.tolist()))

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """Integrate with the given value of φ on each source or component.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 7 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side: the integrated divergence of the unit vectors.
        source : SourceTerm
            Where φ is known, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        Raises
        ------
        ConstraintError
            If there are neither as many levels as sources nor as many as connected components.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.LevelValues([2.0]))([0.5, 0.5]).item(), 2)
        2.5
        """
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
class Soft:
    """A penalty pulls φ to zero on the source: zero weight is `Free`, infinite weight ``ZeroSet(hard=True)`` (Fig. 11).

    Parameters
    ----------
    weight : float, optional
        λ, in 1/length; by default 10/h on surfaces and grids, h the spacing, and what suits the mesh on tets: φ
        differs from the free solution up to a distance of about 1/λ from the source.

    Raises
    ------
    ConstraintError
        If the weight is not positive and finite.

    Examples
    --------
    >>> Soft(10.0)
    Soft(weight=10.0)
    """

    weight: float | None = None

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", positive_number(self.weight, "weight", ConstraintError))

    def integrate(
        self, integration: Integration, divergence: NDArray[np.float64], source: SourceTerm
    ) -> NDArray[np.float64]:
        """Integrate with a penalty on φ² along the source.

        Parameters
        ----------
        integration : Integration
            Solves Eq. 7 of the paper with constraints, on one domain.
        divergence : (n,) float
            Right-hand side: the integrated divergence of the unit vectors.
        source : SourceTerm
            Where φ is known, with weights and components.

        Returns
        -------
        (n,) float
            φ, a length.

        Examples
        --------
        >>> import signedheat as sh
        >>> grid, line = sh.Grid((0, 0), 0.1, (21, 11)), sh.Polyline([[1, -1], [1, 2]])
        >>> round(sh.SignedHeatSolver(grid).distance(line, constraint=sh.Soft(1.0))([0.5, 0.5]).item(), 2)
        0.5
        """
        weight = integration.soft_weight if self.weight is None else self.weight
        return integration.penalize(divergence, source, weight)
