"""Step 3 with levels imposed by springs, where a linear function cannot take them exactly without becoming flat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .arrays import Floats
from .direct_integration import BATCH, DirectIntegration
from .discretization import Levels, SourceTerm
from .linear import Factor

PIN = 1e6
"""Stiffness of the springs at vertices on the source, relative to the largest diagonal entry of C."""
ANCHOR = 10.0
"""Least stiffness of all springs together that hold φ, relative to the same."""


@dataclass(frozen=True, eq=False)
class SpringIntegration(DirectIntegration):
    """`DirectIntegration` with a `fit` that imposes levels by springs.

    Where a source crosses cells, a function that is linear on them is constant along it only if it is constant around
    it. Springs of a strength adapted to the cells leave a smaller error than exact constraints, on the source and
    everywhere. At vertices on the source the springs are stiff.
    """

    strength: float = 0.0  # of the springs, in 1/length

    @property
    def soft_weight(self) -> float:
        """λ of `Soft` where none is given, in 1/length."""
        return self.strength

    def fit(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Minimise ``½ φᵀ C φ − bᵀ φ + ½ (Aφ − l)ᵀ S (Aφ − l)``, also over the constants of groups; see Eq. 14.

        S is the diagonal matrix of the `springs`, in place of the multipliers of Eq. 14. A group of one sample, whose
        constant may be anything, has no spring.
        """
        places, springs = self.held(source)
        rows, levels = sparse.csr_matrix(places @ source.interpolation), levels.at(places)
        if levels.groups is not None:
            springs = np.where(np.bincount(levels.groups)[levels.groups] > 1, springs, 0.0)
        factor = self._pulled_factor(rows, springs)
        pull = sparse.csr_matrix(rows.T @ sparse.diags_array(springs))
        values, fitted = self.corrected(levels.values, lambda at: factor.solve(divergence + pull @ at), source)
        if levels.groups is None:
            return self._reached(fitted, rows)
        held = springs > 0
        groups, parts = levels.groups[held], self._component_of(rows[held])
        first = groups[np.unique(parts, return_index=True)[1]]  # one group of each part keeps its level
        others = np.setdiff1d(groups, first)
        if len(others):
            chosen = np.flatnonzero(np.isin(levels.groups, others))
            entries = np.ones(len(chosen)), (chosen, np.searchsorted(others, levels.groups[chosen]))
            members = sparse.csr_matrix(entries, shape=(len(springs), len(others)))
            forces = sparse.csr_matrix(members.T @ sparse.diags_array(springs))
            balance = np.empty((len(others), len(others)))
            for begin in range(0, len(others), BATCH):
                lifted = members[:, begin : begin + BATCH].toarray()
                balance[:, begin : begin + BATCH] = forces @ (lifted - rows @ factor.solve(pull @ lifted))
            constants = np.linalg.lstsq(balance, forces @ (rows @ fitted - values), rcond=None)[0]
            fitted = fitted + factor.solve(pull @ (members @ constants))
        return self._centered(fitted, source)

    def anchored(self, source: SourceTerm) -> Factor:
        """Factor of C with φ held at zero along the source, however small a part of it lies in the domain."""
        springs, least = self.springs(source), ANCHOR * float(self.stiffness.diagonal().max())
        return self._pulled_factor(source.interpolation, springs * max(1.0, least / float(springs.sum())))

    def held(self, source: SourceTerm) -> tuple[sparse.csr_matrix, Floats]:
        """(r, s) where springs of `fit` hold φ, as means of samples, and (r,) their stiffness."""
        return sparse.eye_array(len(source.weights), format="csr"), self.springs(source)

    def springs(self, source: SourceTerm) -> Floats:
        """(s,) stiffness of the springs: stiff for samples at vertices, soft for those inside cells."""
        at_vertex = np.diff(source.interpolation.indptr) == 1
        return np.where(at_vertex, PIN * self.stiffness.diagonal().max(), self.strength * source.weights)

    def corrected(self, levels: Floats, solve: Callable[[Floats], Floats], source: SourceTerm) -> tuple[Floats, Floats]:
        """Return the levels that the linear interpolant of φ is given, and φ."""
        return levels, solve(levels)
