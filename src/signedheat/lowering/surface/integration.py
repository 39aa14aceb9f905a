"""Step 3 on surfaces: exact where curves run along edges, by springs where they cross faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...discretization import Levels, SourceTerm
from ...errors import ConstraintError
from ...linear import Factor
from ..direct_integration import DirectIntegration
from ..spring_integration import SpringIntegration

STRENGTH = 100.0
"""Strength of the springs along curves that cross faces, in 1/h: measured on twenty meshes, good and bad."""

SOFT = 10.0
"""λ of `Soft` where none is given, in 1/h."""


@dataclass(frozen=True, eq=False)
class SurfaceIntegration(SpringIntegration):
    """Step 3 on the vertices of a surface: `fit` is exact for sources at vertices only, and uses springs for others."""

    @property
    def soft_weight(self) -> float:
        """λ of `Soft` where none is given, in 1/length."""
        return SOFT / STRENGTH * self.strength

    def anchored(self, source: SourceTerm) -> Factor:
        """Factor of C with φ held at zero along the source, as stiffly at every sample."""
        return self._pulled_factor(source.interpolation, DirectIntegration.springs(self, source))

    def fit(self, divergence: NDArray[np.float64], source: SourceTerm, levels: Levels) -> NDArray[np.float64]:
        """Impose levels: exactly along edges, to some hundredths of h across faces (Eq. 14)."""
        if (np.diff(source.interpolation.indptr) == 1).all():
            return self.fit_exactly(divergence, source, levels)
        fitted = super().fit(divergence, source, levels)
        if levels.groups is None:
            refuse_far_levels(source, levels.values, fitted)
        return fitted


def refuse_far_levels(source: SourceTerm, levels: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Refuse levels that contradict each other: some sample is then missed by half their difference."""
    different = np.unique(levels)
    if len(different) < 2:
        return
    rows = source.interpolation
    gap = np.abs(levels - rows @ values)
    worst = int(gap.argmax())
    if gap[worst] > 0.25 * np.diff(different).min():
        raise ConstraintError(
            f"the levels contradict each other near vertex {rows.indices[rows.indptr[worst]]}: "
            "sources that meet or cross need the same level",
            element=f"vertex {rows.indices[rows.indptr[worst]]}",
        )
