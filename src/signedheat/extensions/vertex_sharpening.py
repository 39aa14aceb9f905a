"""Sharpening of distance on the vertices of a surface (Sec. 7.3, Eqs. 17–18).

The heat method errs by a smooth amount that shrinks slowly with the mesh. Two ways to take most of it away, both of
which trust only the zero set and the sign of φ.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Convex:
    """``max Σ A_i sign(φ⁰_i) φ_i`` subject to ``|∇φ| ≤ 1`` in every face and φ = 0 on the source, by ADMM (Eq. 18).

    Repairs wrong signs that a long diffusion left; on coarse meshes it is biased low, since a slope of at most one
    in every face is a lower bound on distance.

    Attributes
    ----------
    tolerance : float
        Stop when the primal and the dual residual fall below this fraction of their scales.
    iterations : int
        Stop after so many in any case; the diagnostics tell.
    relaxation : float
        Over-relaxation, between 1 and 2.
    """

    tolerance: float = 1e-3
    iterations: int = 200
    relaxation: float = 1.6
