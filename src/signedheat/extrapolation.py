"""Diffusion times: one, or Richardson's extrapolation from three, in which what short and long ones spoil cancels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .discretization import Discretization, SourceTerm
from .domains.validation import positive_number
from .errors import SignedHeatError
from .geometry.directions import unit
from .lowering.surface.discretization import SurfaceDiscretization
from .lowering.surface.source import SurfaceSource

EXPONENTS = (-1.0, 0.5)
"""Powers of τ in the error of Y: cells that do not resolve exp(−r/√t) give h²/t, smoothing gives √t."""

FINE = 263.0
"""Extent of a surface, in h, from which longer times pay: that of 20,000 vertices in equilateral triangles."""


@dataclass(frozen=True)
class Extrapolated:
    """Directions extrapolated from three diffusion times, in the place of one τ: the default on surfaces.

    Heat falls by the factor e within √t. At τ = 1 that is about a cell, too little for the cells to resolve: the
    directions of step 1 keep an error of the size h²/t, which does not fall as the cells get smaller. A larger τ
    smooths the source, with an error of the size √t. Of the directions Y at three τ, the combination in which both
    cancel is taken. On triangles the error then falls about like their size, and is less than half as large on fine
    meshes; on the coarsest there is little to gain. Step 1 takes three times as long, but for the order of unknowns.
    By default the three τ are 1, 3 and 9 up to about 20,000 vertices, and beyond grow with the fifth root of their
    number.

    Where an oriented curve on a surface ends, away from its boundary, heat completes what is missing, and Y depends on
    t by more than an error: in that connected part of the surface the first τ is taken alone.

    Parameters
    ----------
    middle : float
        The second of the three τ.
    ratio : float
        That of each τ to the one before. A smaller one adds more of the single errors.

    Raises
    ------
    SignedHeatError
        If `middle` is not positive and finite, or `ratio` not greater than 1 and finite.

    Examples
    --------
    >>> import signedheat as sh
    >>> sh.Extrapolated().times
    (1.0, 3.0, 9.0)
    >>> from signedheat.samples import sphere
    >>> ball = sphere(3)
    >>> solver = sh.SignedHeatSolver(ball, sh.Extrapolated(middle=4, ratio=2))
    >>> equator = ball.level_set(ball.vertices[:, 2], 0.0)
    >>> bool(abs(solver.distance(equator).values - np.arcsin(ball.vertices[:, 2])).max() < 0.05)
    True
    """

    middle: float = 3.0
    ratio: float = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "middle", positive_number(self.middle, "middle"))
        object.__setattr__(self, "ratio", positive_number(self.ratio, "ratio"))
        if self.ratio < 1.01:
            raise SignedHeatError(
                f"times in the ratio {self.ratio:g} do not tell the errors apart",
                remedy="use a ratio of 2 or more",
                element="ratio",
            )

    @property
    def times(self) -> tuple[float, float, float]:
        """The three τ."""
        return self.middle / self.ratio, self.middle, self.middle * self.ratio

    @property
    def weights(self) -> NDArray[np.float64]:
        """(3,) what each counts: their sum is 1, and errors like the `EXPONENTS` of τ cancel."""
        powers = np.asarray(self.times)[None, :] ** np.array([0.0, *EXPONENTS])[:, None]
        result: NDArray[np.float64] = np.linalg.solve(powers, [1.0, 0.0, 0.0])
        return result


Diffusion = float | Extrapolated
"""τ in ``t = τ h²``, or several."""


def default_diffusion(discretization: Discretization) -> Diffusion:
    """`Extrapolated` on surfaces, where directions limit the accuracy; 1 in space.

    What extrapolation leaves of h²/t, about 1/τ², does not fall with h. What it cannot take away is the smoothing of Y
    where it turns back, at equal distance from two parts of the source, over a width of √t = h √τ. On fine surfaces the
    times therefore grow such that both stay alike, τ like h to the power −2/5: the sum falls like h to the power 4/5.
    On scans, whose distance has many such places, the second outweighs the first up to 100,000 vertices and more.
    """
    if not isinstance(discretization, SurfaceDiscretization):
        return 1.0
    fineness = max(discretization.extent / FINE, 1.0)
    return Extrapolated(middle=Extrapolated.middle * fineness ** (2 / 5))


def lowered_for_times(discretization: Discretization, sources: Sequence[Any], diffusion: Diffusion) -> list[SourceTerm]:
    """The sources lowered for each τ that is to be used, the shortest first: see `Extrapolated`."""
    if not isinstance(diffusion, Extrapolated):
        return [discretization.lower(sources, diffusion)]
    first, *others = diffusion.times
    source = discretization.lower(sources, first)
    if isinstance(source, SurfaceSource) and source.ends_everywhere:
        return [source]
    return [source, *(discretization.lower(sources, tau) for tau in others)]


def blended(diffusion: Diffusion, directions: Iterable[NDArray[Any]], source: SourceTerm) -> NDArray[Any]:
    """Y, from that at each τ; that at the first one in parts of a surface where curves of the source end."""
    first, *others = directions
    if not isinstance(diffusion, Extrapolated) or not others:
        return first
    weights = diffusion.weights
    total = weights[0] * first
    for weight, other in zip(weights[1:], others, strict=True):
        total += weight * other
    total = unit(total)
    if isinstance(source, SurfaceSource) and source.ending.any():
        total[source.ending] = first[source.ending]
    return total
