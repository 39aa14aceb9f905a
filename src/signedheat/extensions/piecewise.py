"""Signed distance to curves that bound no region: piecewise-continuous integration (Sec. 7.2, Eq. 16).

In every face φ is linear with gradient exactly Y, so it is known up to one constant per face. Where Y is integrable
the constants fit across edges; where it is not, φ jumps, and the jumps are gathered on a cut that is short and runs
where Y is not integrable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class JumpProblem:
    """Minimise ``Σ_e w_e (|c_f − c_g + d_e0| + |c_f − c_g + d_e1|)`` over one constant c per face.

    One term for every pair of faces that meet at an edge, with the jump at both ends of the edge.

    Attributes
    ----------
    faces : (p, 2) int
        The faces f and g of each pair.
    offsets : (p, 2) float
        d: the jump from g to f at the two ends of the edge, were all constants zero.
    weights : (p,) float
        w, positive.
    n_faces : int
        Number of constants.
    """

    faces: NDArray[np.int64]
    offsets: NDArray[np.float64]
    weights: NDArray[np.float64]
    n_faces: int

    def jumps(self, constants: NDArray[np.float64]) -> NDArray[np.float64]:
        """(p, 2) jump of φ from g to f at the two ends of every edge."""
        return self.offsets + (constants[self.faces[:, 0]] - constants[self.faces[:, 1]])[:, None]

    def objective(self, constants: NDArray[np.float64]) -> float:
        """Eq. 16."""
        return float(self.weights @ np.abs(self.jumps(constants)).sum(axis=1))
