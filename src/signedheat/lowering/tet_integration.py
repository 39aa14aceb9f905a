"""Step 3 on tets: levels are imposed by springs where the source cuts through tets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..discretization import Levels, SourceTerm
from .direct_integration import DirectIntegration

PIN = 1e6
"""Stiffness at vertices that the source passes through, times the largest diagonal entry of C."""


@dataclass(frozen=True, eq=False)
class TetIntegration(DirectIntegration):
    """As for surfaces, but for `fit`.

    A function that is linear on tets cannot be level on a curved surface that cuts through them, but by being flat
    around it. Springs of a strength that suits the tets leave less error on the source, and everywhere, than exact
    levels do. Vertices on the source are pinned.

    Parameters
    ----------
    strength : float
        Of the springs, in 1/length.
    """

    strength: float = 0.0

    def fit(self, divergence: NDArray[np.float64], source: SourceTerm, levels: Levels) -> NDArray[np.float64]:
        """Minimise ``½ φᵀ C φ − bᵀ φ + ½ (Aφ − l)ᵀ S (Aφ − l)``, also over the constants of groups."""
        rows, values = source.rows, levels.values
        at_vertex = np.diff(rows.indptr) == 1
        springs = np.where(at_vertex, PIN * self.stiffness.diagonal().max(), self.strength * source.weights)
        factor = self._pulled_factor(rows, springs)
        pull = sparse.csr_matrix(rows.T @ sparse.diags_array(springs))
        fitted = factor.solve(divergence + pull @ values)
        if levels.groups is None:
            return self._reached(fitted, rows)
        parts = self._part_of(rows)
        first = levels.groups[np.unique(parts, return_index=True)[1]]  # one group of each part keeps its level
        others = np.setdiff1d(levels.groups, first)
        if len(others):
            members = (levels.groups[:, None] == others).astype(np.float64)
            lifted = factor.solve(pull @ members)
            forces = (springs[:, None] * members).T
            balance = forces @ (members - rows @ lifted)
            fitted = fitted + lifted @ np.linalg.solve(balance, forces @ (rows @ fitted - values))
        return self._centered(fitted, source)
