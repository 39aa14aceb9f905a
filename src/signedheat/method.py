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
    """Step 1: solve ``(M + tL) X = X₀`` (Eq. 12), the heat equation of Eq. 1 by one step of backward Euler."""
    return discretization.diffuse(source)


def diffuse_many(discretization: Discretization, sources: Sequence[SourceTerm]) -> Iterable[Any]:
    """Step 1 for several sources of the same τ, together where the discretisation can do that."""
    return discretization.diffuse_many(sources)


def normalize(discretization: Discretization, vectors: Any) -> NDArray[Any]:
    """Step 2: ``Y = X / |X|`` on every cell (Sec. 6). Cells that nothing reached keep Y = 0."""
    return unit(discretization.to_cells(vectors), overwrite=True)


def integrate(
    discretization: Discretization, directions: NDArray[Any], source: SourceTerm, constraint: Constraint
) -> Floats:
    """Step 3: solve ``C φ = b`` (Eq. 13), b the divergence of Y, under a constraint (Eq. 14). Minimises Eq. 2."""
    return constraint.integrate(discretization.integration, discretization.divergence(directions), source)


def integrate_many(
    discretization: Discretization,
    directions: Iterable[NDArray[Any]],
    sources: Sequence[SourceTerm],
    constraint: Constraint,
) -> Iterable[Floats]:
    """Step 3 for several sources, together where nothing is imposed and the discretisation can do that."""
    if isinstance(constraint, Free):
        divergences = (discretization.divergence(each) for each in directions)
        return discretization.integration.solve_many(divergences, sources)
    each = zip(directions, sources, strict=True)
    return (integrate(discretization, direction, source, constraint) for direction, source in each)
