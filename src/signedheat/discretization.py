"""The protocols between domains and the method.

To lower a domain is to make the `Discretization` on which the method computes; `discretize` does it for every type of
domain. The method (`method.py`) is written once, for discretisations, and does not depend on any domain.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any, Protocol

from numpy.typing import NDArray

from .arrays import Floats, Ints
from .errors import UnsupportedTypeError
from .shapes.exchange import ACCEPTED_SHAPES


class SourceTerm(Protocol):
    """Sources lowered to one discretisation: in the form in which the method takes them."""

    @property
    def vectors(self) -> Any: ...  # X₀ of Eq. 12 (on surfaces Eq. 11, Eq. 19), in the discretisation's own layout
    @property
    def time(self) -> float: ...  # t of Eq. 12: ``diffusion · max(h_domain, h_source)²``
    @property
    def interpolation(self) -> Any: ...  # A of Eq. 14: sparse (s, n), row i interpolates φ at source sample i
    @property
    def weights(self) -> Floats: ...  # (s,) line or area element of each sample
    @property
    def components(self) -> Ints: ...  # (s,) connected component of the source that each sample lies on, from 0
    @property
    def source_ids(self) -> Ints: ...  # (s,) index of each sample's source among those passed to the solver


class Integration(Protocol):
    """Step 3 on one discretisation: solves ``C φ = b`` with and without constraints.

    Without absolute levels φ is determined up to a constant on each connected component of the domain; the φ returned
    has a weighted mean of zero over the source samples of each component. Components without samples are NaN.
    """

    @property
    def soft_weight(self) -> float:
        """λ of `Soft` where none is given, in 1/length."""

    def solve(self, divergence: Any, source: Any) -> Floats:
        """Minimise ∫|∇φ − Y|² (Eq. 2) with nothing imposed: ``C φ = b`` (Eq. 13)."""

    def solve_many(self, divergences: Iterable[Any], sources: Sequence[Any]) -> Iterable[Floats]:
        """Solve for several sources, together if that is faster, else as `SolvesEach` does."""

    def fit(self, divergence: Any, source: Any, levels: Levels) -> Floats:
        """Impose levels at the samples (Eq. 14), in the way that suits the domain best."""

    def fit_exactly(self, divergence: Any, source: Any, levels: Levels) -> Floats:
        """Impose levels at the samples exactly (Eq. 14), as far as the rows of A do not contradict each other."""

    def penalize(self, divergence: Any, source: Any, strength: float) -> Floats:
        """Minimise ∫|∇φ − Y|² + strength · Σ weight · φ(sample)² (Sec. 7.1, Fig. 11)."""


class Adaptable(Protocol):
    """Something that becomes a discretisation once the sources are known."""

    def adapt(self, sources: Sequence[Any]) -> tuple[Discretization, Sequence[Any]]:
        """Return a discretisation that can represent these sources, and the sources on it: usually ``(self, sources)``.

        Unoriented curves inside faces of a surface, for instance, need edges that run along them.
        """


class Discretization(Adaptable, Protocol):
    """A domain as the method needs it: it lowers sources, and performs each of the three steps for them."""

    @property
    def integration(self) -> Integration:
        """Step 3."""

    def lower(self, sources: Sequence[Any], diffusion: float) -> SourceTerm:
        """Lower sources to this discretisation; `diffusion` is τ in ``t = τ h²``."""

    def diffuse(self, source: Any) -> Any:
        """Solve ``(M + tL) X = X₀`` (Eq. 12); directions stay right however small X becomes."""

    def diffuse_many(self, sources: Sequence[SourceTerm]) -> Iterable[Any]:
        """Diffuse several sources of one τ, together if that is faster, else as `DiffusesEach` does."""

    def to_cells(self, vectors: Any) -> NDArray[Any]:
        """Return X at the cells in which ∇φ is computed: complex numbers on surfaces, rows of components in space."""

    def divergence(self, directions: NDArray[Any]) -> Any:
        """Return b, the right-hand side of ``C φ = b``."""


class DiffusesEach:
    """Mixin for discretisations that gain nothing by diffusing several sources at once."""

    def diffuse_many(self: Discretization, sources: Sequence[Any]) -> Iterable[Any]:
        """Diffuse one source after the other, each when its result is needed."""
        return (self.diffuse(source) for source in sources)


class SolvesEach:
    """Mixin for integrations that gain nothing by solving for several sources at once."""

    def solve_many(self: Integration, divergences: Iterable[Any], sources: Sequence[Any]) -> Iterable[Floats]:
        """Solve for one source after the other, each when its result is needed."""
        return (self.solve(divergence, source) for divergence, source in zip(divergences, sources, strict=True))


@dataclass(frozen=True)
class Levels:
    """The levels that a constraint imposes on φ at the source samples."""

    values: Floats  # (s,) absolute, or, with groups, up to an unknown constant per group
    groups: Ints | None = None  # (s,) group of each sample

    def at(self, places: Any) -> Levels:
        """Average levels by an (r, s) sparse matrix, each row of which weights samples of a single group."""
        return Levels(
            places @ self.values, None if self.groups is None else self.groups[places.indices[places.indptr[:-1]]]
        )


@singledispatch
def discretize(domain: Any) -> Discretization:
    """Lower a domain to its discretisation; every kind of domain registers a function of its own."""
    raise UnsupportedTypeError(
        f"{type(domain).__name__} is not a domain", remedy=f"use a Grid, or {ACCEPTED_SHAPES}", element="domain"
    )
