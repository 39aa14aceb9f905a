"""Protocols between domains and the signed heat method.

To lower a domain means to make the `Discretization` on which the method computes. `discretize` does that for every type
of domain. The method (`method.py`) is written once, for discretisations, and does not depend on any domain.
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
    """Sources lowered to one discretisation with n unknowns, as s samples with their normals."""

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
    """Step 3 of the method on one discretisation, which solves ``C φ = b`` with and without constraints.

    All methods return φ at the unknowns, (n,), and take b, the divergence of Y. Without absolute levels, φ is
    determined up to a constant on each connected component of the domain. It is then shifted so that its weighted mean
    over the source samples of each component is zero. φ is NaN on components without samples.
    """

    @property
    def soft_weight(self) -> float:
        """Default weight λ of the constraint `Soft`, in 1/length."""

    def solve(self, divergence: Any, source: Any) -> Floats:
        """Minimise ∫|∇φ − Y|² (Eq. 2) without constraint, by solving ``C φ = b`` (Eq. 13)."""

    def solve_many(self, divergences: Iterable[Any], sources: Sequence[Any]) -> Iterable[Floats]:
        """Yield `solve` for several sources, computed together if that is faster."""

    def fit(self, divergence: Any, source: Any, levels: Levels) -> Floats:
        """Solve step 3 with levels imposed at the samples (Eq. 14), only approximately where that suits the domain."""

    def fit_exactly(self, divergence: Any, source: Any, levels: Levels) -> Floats:
        """Solve step 3 with levels imposed exactly (Eq. 14), as far as the rows of A do not contradict each other."""

    def penalize(self, divergence: Any, source: Any, strength: float) -> Floats:
        """Minimise ∫|∇φ − Y|² + strength · Σ weight · φ(sample)² (Sec. 7.1, Fig. 11)."""


class Adaptable(Protocol):
    """An object that becomes a discretisation once the sources are known."""

    def adapt(self, sources: Sequence[Any]) -> tuple[Discretization, Sequence[Any]]:
        """Return a discretisation that can represent these sources, and the sources on it.

        Usually that is ``(self, sources)``. But unoriented curves inside faces of a surface, for instance, need edges
        that run along them.
        """


class Discretization(Adaptable, Protocol):
    """A domain as the method needs it, which lowers sources and performs the three steps for them."""

    @property
    def integration(self) -> Integration:
        """The object that solves step 3."""

    def lower(self, sources: Sequence[Any], diffusion: float) -> SourceTerm:
        """Lower sources to this discretisation, for the diffusion time ``t = τ h²`` with τ the `diffusion`."""

    def diffuse(self, source: Any) -> Any:
        """Return X with ``(M + tL) X = X₀`` (Eq. 12). Its directions are accurate however small it is far away."""

    def diffuse_many(self, sources: Sequence[SourceTerm]) -> Iterable[Any]:
        """Yield `diffuse` of several sources with the same τ, computed together if that is faster."""

    def to_cells(self, vectors: Any) -> NDArray[Any]:
        """Return X at the cells in which ∇φ is computed, from X as `diffuse` returns it; only directions matter.

        On surfaces these are (m,) complex numbers in the layouts of the faces, in tets (m, 3) vectors, and on grids,
        whose nodes are the cells, (*shape, d).
        """

    def divergence(self, directions: NDArray[Any]) -> Any:
        """Return b, the right-hand side of ``C φ = b``, for unit vectors Y at the cells."""


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

    values: Floats  # (s,) φ at each sample; with groups, up to an unknown constant for each group
    groups: Ints | None = None  # (s,) group of each sample

    def at(self, averages: Any) -> Levels:
        """Return levels at r averages of samples, given by an (r, s) sparse matrix.

        Each row of the matrix averages samples of a single group, to which the average then belongs.
        """
        return Levels(
            averages @ self.values,
            None if self.groups is None else self.groups[averages.indices[averages.indptr[:-1]]],
        )


@singledispatch
def discretize(domain: Any) -> Discretization:
    """Make the discretisation of a domain. Every type of domain registers a function of its own."""
    raise UnsupportedTypeError(
        f"{type(domain).__name__} is not a domain", remedy=f"use a Grid, or {ACCEPTED_SHAPES}", element="domain"
    )
