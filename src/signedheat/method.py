"""The signed heat method (Feng & Crane, ACM TOG 43(4) 92, 2024), written once for all domains.

Diffuse the source normals for a short time; normalise; integrate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from numpy.typing import NDArray

from .arrays import Floats
from .constraints import Constraint, Free
from .discretization import Discretization, SourceTerm
from .mesh.unit_vectors import unit


def diffuse(discretization: Discretization, source: SourceTerm) -> Any:
    """Step 1: return X with ``(M + tL) X = X₀`` (Eq. 12), one backward Euler step of the heat equation (Eq. 1)."""
    return discretization.diffuse(source)


def diffuse_many(discretization: Discretization, sources: Sequence[SourceTerm]) -> Iterable[Any]:
    """Step 1 for several sources of the same τ; the discretisation may solve for them together."""
    return discretization.diffuse_many(sources)


def normalize(discretization: Discretization, vectors: Any) -> NDArray[Any]:
    """Step 2: return ``Y = X / |X|`` on every cell (Sec. 6), and 0 where X is 0."""
    return unit(discretization.to_cells(vectors), overwrite=True)


def integrate(
    discretization: Discretization, directions: NDArray[Any], source: SourceTerm, constraint: Constraint
) -> Floats:
    """Step 3: return (n,) φ that minimises Eq. 2, by solving ``C φ = b`` (Eq. 13) under a constraint (Eq. 14).

    b is the divergence of the unit vectors Y on cells, `directions`.
    """
    return constraint.integrate(discretization.integration, discretization.divergence(directions), source)


def integrate_many(
    discretization: Discretization,
    directions: Iterable[NDArray[Any]],
    sources: Sequence[SourceTerm],
    constraint: Constraint,
) -> Iterable[Floats]:
    """Step 3 for several sources; without constraint, the discretisation may solve for them together."""
    if isinstance(constraint, Free):
        divergences = (discretization.divergence(vectors) for vectors in directions)
        return discretization.integration.solve_many(divergences, sources)
    pairs = zip(directions, sources, strict=True)
    return (integrate(discretization, vectors, source, constraint) for vectors, source in pairs)
