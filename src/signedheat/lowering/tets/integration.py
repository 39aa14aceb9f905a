"""Step 3 on tets, with levels imposed by springs where the source does not conform to the mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ...discretization import Levels, SourceTerm
from ..direct_integration import BATCH, STIFFEST, DirectIntegration

PIN = 1e6
"""Stiffness of the springs at vertices on the source, relative to the largest diagonal entry of C."""


@dataclass(frozen=True, eq=False)
class TetIntegration(DirectIntegration):
    """As `DirectIntegration`, but `fit` imposes levels by springs, and levels are corrected for the curvature of φ.

    A function that is linear on tets can be constant on a curved surface that crosses them only by being constant
    around it. Springs of a strength adapted to the tets leave a smaller error than exact constraints, on the source and
    everywhere. At vertices on the source the springs are stiff.

    The level at samples is corrected as well, because the linear interpolant of a curved function differs from it. The
    difference is known to second order from the gradients at the corners, once there is a first φ.

    Parameters
    ----------
    strength : float
        Strength of the springs, in 1/length.
    gradients : callable
        From φ at the unknowns to (n, 3) gradients there.
    """

    strength: float = 0.0
    gradients: Callable[[NDArray[np.float64]], NDArray[np.float64]] = np.zeros_like

    def fit(self, divergence: NDArray[np.float64], source: SourceTerm, levels: Levels) -> NDArray[np.float64]:
        """Minimise ``½ φᵀ C φ − bᵀ φ + ½ (Aφ − l)ᵀ S (Aφ − l)``, also over the constants of groups; see Eq. 14.

        S is the diagonal matrix of the `springs`, in place of the multipliers of Eq. 14.
        """
        rows = source.interpolation
        springs, factor = self.springs(source), self.anchored(source)
        pull = sparse.csr_matrix(rows.T @ sparse.diags_array(springs))
        fitted = factor.solve(divergence + pull @ levels.values)
        values = levels.values - self._quadratic_correction(fitted, source)
        fitted = factor.solve(divergence + pull @ values)
        if levels.groups is None:
            return self._reached(fitted, rows)
        parts = self._component_of(rows)
        first = levels.groups[np.unique(parts, return_index=True)[1]]  # one group of each part keeps its level
        others = np.setdiff1d(levels.groups, first)
        if len(others):
            chosen = np.flatnonzero(np.isin(levels.groups, others))
            entries = np.ones(len(chosen)), (chosen, np.searchsorted(others, levels.groups[chosen]))
            members = sparse.csr_matrix(entries, shape=(len(springs), len(others)))
            forces = sparse.csr_matrix(members.T @ sparse.diags_array(springs))
            balance = np.empty((len(others), len(others)))
            for begin in range(0, len(others), BATCH):
                lifted = members[:, begin : begin + BATCH].toarray()
                balance[:, begin : begin + BATCH] = forces @ (lifted - rows @ factor.solve(pull @ lifted))
            constants = np.linalg.solve(balance, forces @ (rows @ fitted - values))
            fitted = fitted + factor.solve(pull @ (members @ constants))
        return self._centered(fitted, source)

    def fit_exactly(self, divergence: NDArray[np.float64], source: SourceTerm, levels: Levels) -> NDArray[np.float64]:
        """Impose levels at the samples exactly (Eq. 14)."""
        correction = self._quadratic_correction(self.factor.solve(divergence), source)
        return super().fit_exactly(divergence, source, replace(levels, values=levels.values - correction))

    def penalize(self, divergence: NDArray[np.float64], source: SourceTerm, strength: float) -> NDArray[np.float64]:
        """Solve ``(C + λ Aᵀ W A) φ = b`` (Sec. 7.1, Fig. 11), where A φ is corrected for the curvature of φ."""
        strength = min(strength, STIFFEST * float(self.stiffness.diagonal().max()) / float(source.weights.max()))
        free = super().penalize(divergence, source, strength)
        pull = source.interpolation.T @ (strength * source.weights * self._quadratic_correction(free, source))
        return super().penalize(divergence - pull, source, strength)

    def _at_samples(self, values: NDArray[np.float64], source: SourceTerm) -> NDArray[np.float64]:
        return super()._at_samples(values, source) + self._quadratic_correction(values, source)

    def _quadratic_correction(self, values: NDArray[np.float64], source: SourceTerm) -> NDArray[np.float64]:
        """(s,) φ minus its linear interpolant, on the source."""
        return source.quadratic_correction @ self.gradients(np.nan_to_num(values)).ravel()

    def springs(self, source: SourceTerm) -> NDArray[np.float64]:
        """(s,) stiffness of the springs: stiff for samples at vertices, soft for those inside tets."""
        at_vertex = np.diff(source.interpolation.indptr) == 1
        return np.where(at_vertex, PIN * self.stiffness.diagonal().max(), self.strength * source.weights)
