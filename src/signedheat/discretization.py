"""What the method needs to know of a domain, and how a domain comes to say it.

Every domain lowers to a `Discretization` through `discretize`, a function that dispatches on the domain's type.
The method (`method.py`) runs once, on discretisations, and never learns what the domain was.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import UnsupportedTypeError


class SourceTerm(Protocol):
    """Sources lowered to one discretisation."""

    @property
    def vectors(self) -> Any:
        """X₀, the right-hand side of Eq. 12 (on surfaces Eq. 11, Eq. 19), in the discretisation's own layout."""

    @property
    def time(self) -> float:
        """t of Eq. 12: ``diffusion · max(h_domain, h_source)²``."""

    @property
    def interpolation(self) -> Any:
        """A of Eq. 14: sparse (s, n), row i interpolates φ at source sample i."""

    @property
    def weights(self) -> NDArray[np.float64]:
        """(s,) line or area element of each sample."""

    @property
    def components(self) -> NDArray[np.int64]:
        """(s,) connected component of the source that each sample lies on, from 0."""

    @property
    def source_ids(self) -> NDArray[np.int64]:
        """(s,) which of the sources that were passed in each sample comes from, from 0."""


class Integration(Protocol):
    """Step 3 on one discretisation: C, and the ways to constrain it.

    Without given levels, φ is known up to a constant on each connected part of the domain; what comes back has a
    weighted mean of zero over the source samples of each part. A part without samples is NaN.
    """

    def solve(self, divergence: Any, source: Any) -> NDArray[np.float64]:
        """Minimise ∫|∇φ − Y|² (Eq. 2) with nothing imposed: ``C φ = b`` (Eq. 13)."""

    def solve_many(self, divergences: Iterable[Any], sources: Sequence[Any]) -> Iterable[NDArray[np.float64]]:
        """The same for several sources (see `SolvesEach`)."""

    def fit(self, divergence: Any, source: Any, levels: Levels) -> NDArray[np.float64]:
        """Impose levels at the samples (Eq. 14), in the way that suits the domain best."""

    def fit_exactly(self, divergence: Any, source: Any, levels: Levels) -> NDArray[np.float64]:
        """Impose levels at the samples exactly (Eq. 14), as far as the rows of A do not contradict each other."""

    def penalize(self, divergence: Any, source: Any, strength: float) -> NDArray[np.float64]:
        """Minimise ∫|∇φ − Y|² + strength · Σ weight · φ(sample)² (Sec. 7.1, Fig. 11)."""


class Adaptable(Protocol):
    """What becomes a discretisation when the sources are known."""

    def adapt(self, sources: Sequence[Any]) -> tuple[Discretization, Sequence[Any]]:
        """A discretisation that can hold these sources, and the sources as it knows them: most often itself and they.

        Isolated points and unoriented curves inside faces need edges and vertices of their own.
        """


class Discretization(Adaptable, Protocol):
    """A domain, as the three steps see it. Source terms that it is given are those that it has made itself."""

    @property
    def integration(self) -> Integration:
        """Step 3."""

    def lower(self, sources: Sequence[Any], diffusion: float) -> SourceTerm:
        """Bring sources into this discretisation."""

    def diffuse(self, source: Any) -> Any:
        """Solve ``(M + tL) X = X₀`` (Eq. 12); directions stay right however small X becomes."""

    def diffuse_many(self, sources: Sequence[SourceTerm]) -> Iterable[Any]:
        """The same for several sources of one τ (see `DiffusesEach`)."""

    def to_cells(self, vectors: Any) -> NDArray[Any]:
        """X at the cells on which ∇φ lives: complex numbers on surfaces, rows of components in space."""

    def divergence(self, directions: NDArray[Any]) -> Any:
        """b, the right-hand side of ``C φ = b``."""


class DiffusesEach:
    """For discretisations that have nothing to gain by diffusing several sources at once."""

    def diffuse_many(self: Discretization, sources: Sequence[Any]) -> Iterable[Any]:
        """One after the other, each when it is asked for."""
        return (self.diffuse(source) for source in sources)


class SolvesEach:
    """For step 3 that has nothing to gain by solving for several sources at once."""

    def solve_many(
        self: Integration, divergences: Iterable[Any], sources: Sequence[Any]
    ) -> Iterable[NDArray[np.float64]]:
        """One after the other, each when it is asked for."""
        return (self.solve(divergence, source) for divergence, source in zip(divergences, sources, strict=True))


@dataclass(frozen=True)
class Levels:
    """What a constraint says of φ at the source samples.

    Attributes
    ----------
    values : (s,) float
        Level of each sample: absolute, or up to its group's unknown constant where there are groups.
    groups : (s,) int, optional
        Samples of one group share one unknown constant.
    """

    values: NDArray[np.float64]
    groups: NDArray[np.int64] | None = None


@singledispatch
def discretize(domain: Any, **options: Any) -> Discretization:
    """Lower a domain to its discretisation; each kind of domain registers its own way."""
    raise UnsupportedTypeError(
        f"{type(domain).__name__} is not a domain",
        remedy="use TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Grid",
    )
