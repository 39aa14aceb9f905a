"""Richardson extrapolation of directions in the diffusion time t: what a short t and a long t spoil cancels."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .domains.validation import positive_number
from .errors import SignedHeatError
from .geometry.directions import unit

EXPONENTS = (-1.0, 0.5)
"""Powers of τ in the error of Y: cells that do not resolve exp(−r/√t) give h²/t, smoothing gives √t."""


@dataclass(frozen=True)
class Extrapolated:
    """Directions extrapolated from three diffusion times, in the place of one τ.

    Heat falls by the factor e within √t. At τ = 1 that is about a cell, too little for the cells to resolve: the
    directions of step 1 keep an error of the size h²/t, which does not fall as the cells get smaller. A larger τ
    smooths the source, with an error of the size √t. Of the directions Y at three τ, the combination in which both
    cancel is taken. On triangles the error then falls about like their size, and is about half as large on fine
    meshes; on coarse ones there is little to gain, and step 1 takes three times as long.

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
    (1.0, 4.0, 16.0)
    >>> from signedheat.samples import sphere
    >>> ball = sphere(3)
    >>> solver = sh.SignedHeatSolver(ball, sh.Extrapolated())
    >>> equator = ball.level_set(ball.vertices[:, 2], 0.0)
    >>> bool(abs(solver.distance(equator).values - np.arcsin(ball.vertices[:, 2])).max() < 0.05)
    True
    """

    middle: float = 4.0
    ratio: float = 4.0

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


def times_of(diffusion: Diffusion) -> tuple[float, ...]:
    """All τ, the first one of which is the shortest."""
    return diffusion.times if isinstance(diffusion, Extrapolated) else (diffusion,)


def blended(diffusion: Diffusion, directions: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Y, from that at each of `times_of`."""
    first, *others = directions
    if not isinstance(diffusion, Extrapolated):
        return first
    weights = diffusion.weights
    total = weights[0] * first
    for weight, other in zip(weights[1:], others, strict=True):
        total += weight * other
    return unit(total)
