"""Step 3 on tets, with levels imposed by springs where the source does not conform to the mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...discretization import Levels, SourceTerm
from ..direct_integration import STIFFEST
from ..spring_integration import SpringIntegration


@dataclass(frozen=True, eq=False)
class TetIntegration(SpringIntegration):
    """As `SpringIntegration`, and levels are corrected for the curvature of φ.

    The level at samples is corrected, because the linear interpolant of a curved function differs from it. The
    difference is known to second order from the gradients at the corners, once there is a first φ.

    Parameters
    ----------
    gradients : callable
        From φ at the unknowns to (n, 3) gradients there.
    """

    gradients: Callable[[NDArray[np.float64]], NDArray[np.float64]] = np.zeros_like

    def corrected(
        self,
        levels: NDArray[np.float64],
        solve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
        source: SourceTerm,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Levels less the quadratic correction of a first φ, and the φ with these."""
        values = levels - self._quadratic_correction(solve(levels), source)
        return values, solve(values)

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
