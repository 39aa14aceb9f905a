"""The ways to sharpen distance on surfaces and tets (Sec. 7.3).

The heat method errs by a smooth amount that shrinks slowly with the mesh. Two ways to take most of it away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import ConvexRounds, Note
from ..discretization import Discretization
from ..domains.validation import finite_number, positive_number
from ..errors import OutsideError, SignedHeatError, SourceError, UnsupportedTypeError
from ..lowering.direct_integration import DirectIntegration
from ..operators.linear_elements import LinearElements
from ..parallel import run_cancellable
from ..progress import Progress


@dataclass(frozen=True)
class Geodesic:
    """Distance along straight lines from the zero set of φ, with the signs of φ. The default.

    On surfaces the lines run across the faces, as on the polyhedral surface itself, whatever the shape of its
    triangles; sources without sides (unoriented curves, points) are measured from where they are, whether φ vanishes
    there or not, and where no source has sides, distance is positive everywhere. In tets the lines run through space,
    and bend where walls are in the way.

    Keeps the zero set of φ and its signs, and so its faults: where a long diffusion left a wrong sign, it stays. (In
    tets the zero set of φ is not that of its linear interpolant, but closer to that of a smooth one.)

    Parameters
    ----------
    tolerance : float
        On surfaces, neighbouring waves on an edge are made one where that changes distances by less than this fraction
        of the edge. 0 is exact, and takes time that grows like the number of faces to the power of 1.5.

    Examples
    --------
    >>> Geodesic()
    Geodesic(tolerance=0.0001)
    """

    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if not 0 <= finite_number(self.tolerance, "tolerance") < 0.1:
            raise SignedHeatError(f"tolerance must be at least 0 and below 0.1, not {self.tolerance}")

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: NDArray[np.float64],
        source: Any,
        progress: Progress | None,
    ) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
        """|φ| measured anew; parts without a zero set keep what they have."""
        distance, notes = run_cancellable(
            lambda: straight_distance(discretization, values, source, self.tolerance),
            None if progress is None else lambda: progress(0.0, "sharpen"),
        )
        if not np.isfinite(distance).any():
            raise OutsideError(
                "the field has one sign everywhere, hence no zero set to measure from",
                remedy="add an offset to its values, or use method=Convex(), which measures from the source "
                "that it was computed from",
            )
        distance = np.where(np.isfinite(distance), distance, np.abs(values))
        sides = values if getattr(source, "oriented", True) else np.ones_like(values)
        return np.where(np.isnan(values), np.nan, np.copysign(distance, sides)), notes


@singledispatch
def straight_distance(
    discretization: Any, values: NDArray[np.float64], source: Any, tolerance: float
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Distance of every unknown from where values vanish, inf where that is not connected; and notes."""
    raise UnsupportedTypeError(f"there are no straight lines on a {type(discretization).__name__}")


@dataclass(frozen=True)
class Convex:
    """``max Σ A_i sign(φ⁰_i) φ_i`` where ``|∇φ| ≤ 1`` in every cell and φ = 0 on the source, by ADMM (Eq. 17, Eq. 18).

    Repairs wrong signs that a long diffusion left. Biased low, since a slope of at most one in every triangle or tet is
    a lower bound on distance: on fine meshes `Geodesic` is far more accurate, and on tets the bias is greater than the
    error of the unsharpened field. The factor serves every round (Belyaev & Fayolle 2020).

    Parameters
    ----------
    tolerance : float
        Stop when the root mean squares of both residuals, which are slopes, are below this.
    max_rounds : int
        Stop in any case; the diagnostics tell the residuals.
    relaxation : float
        Over-relaxation, from 1 to below 2.

    Examples
    --------
    >>> Convex(tolerance=1e-3)
    Convex(tolerance=0.001, max_rounds=200, relaxation=1.6)
    """

    tolerance: float = 2e-3
    max_rounds: int = 200
    relaxation: float = 1.6

    def __post_init__(self) -> None:
        positive_number(self.tolerance, "tolerance")
        if positive_number(self.max_rounds, "max_rounds") % 1:
            raise SignedHeatError(f"max_rounds must be a whole number, not {self.max_rounds}")
        if not 1 <= finite_number(self.relaxation, "relaxation") < 2:
            raise SignedHeatError(f"relaxation must be at least 1 and below 2, not {self.relaxation}")

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: NDArray[np.float64],
        source: Any,
        progress: Progress | None,
    ) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
        """The maximiser, from φ⁰ on."""
        from threadpoolctl import threadpool_limits

        if source is None or source.interpolation.shape[1] != len(values):
            raise SourceError(
                "the convex method holds φ at the source, and this field comes without one, or from one "
                "that lies on other triangles",
                remedy="pass what SignedHeatSolver.distance returned for oriented curves or points, on "
                "intrinsic_delaunay(mesh) if need be instead of with intrinsic=True",
            )
        integration = discretization.integration
        assert isinstance(integration, DirectIntegration)  # of surfaces and tets, whose elements these are
        sizes, total = elements.sizes, elements.sizes.sum()
        with threadpool_limits(1, "blas"):  # threads cost a triangular solve of this size more than they bring
            factor = integration.anchored(source)
            phi = np.nan_to_num(values)
            pull = elements.masses * np.sign(phi) / (np.ptp(phi) or 1.0)
            relaxed = slopes = elements.slopes(phi)
            dual = np.zeros_like(slopes)
            limited = at_most_one(slopes)
            number, residual = 0, np.inf
            while number < self.max_rounds and residual > self.tolerance:
                before, limited = limited, at_most_one(relaxed + dual)
                dual += relaxed - limited
                phi = factor.solve(pull + elements.divergence(limited - dual))
                slopes = elements.slopes(phi)
                relaxed = self.relaxation * slopes + (1.0 - self.relaxation) * limited
                gaps = [((slopes - limited) ** 2).sum(axis=1), ((limited - before) ** 2).sum(axis=1)]
                residual = max(np.sqrt(sizes @ gap / total) for gap in gaps)
                number += 1
                if progress is not None:
                    progress(number / self.max_rounds, "sharpen")
        return np.where(np.isnan(values), np.nan, phi), (ConvexRounds(number, float(residual)),)


def at_most_one(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows longer than one cut to length one."""
    result: NDArray[np.float64] = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1.0)
    return result
