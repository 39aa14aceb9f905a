"""Jumps gathered on few lines: reweighted least absolute values (Candès, Wakin & Boyd 2008).

Where Y turns, its curl is spread over an area. The least sum of absolute jumps leads it to the cut on as many parallel
lines as there are triangles beside each other, because each jump costs what it is high, together or apart. A cost that
rises less and less with the height of a jump leads it on one line. Each round minimises the tangent of such a cost,
``s log(1 + jump / s)``, at the jumps of the round before: edges that jump become cheap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .jumps import JumpProblem, minimize_fast

HEIGHT = 3.0
"""s, in sides of a typical triangle: jumps below it cost as before. What is higher is a cut (`cut_lines.FAR`)."""

REWEIGHTINGS = 2
"""More of them move cuts without an end, towards the shortest instead of the lowest ones."""

_TOLERANCE, _MAX_ROUNDS = 0.02, 200  # the same lines, to a vertex, as with .005 and 600 on nine shapes of eleven


def concentrated(
    problem: JumpProblem,
    constants: NDArray[np.float64],
    side: float,
    progress: Callable[[float], None] | None = None,
) -> Iterator[NDArray[np.float64]]:
    """Constants of the faces whose jumps lie on fewer and fewer lines.

    Parameters
    ----------
    problem : JumpProblem
        The problem.
    constants : (n_faces,) float
        Constants that minimise its objective.
    side : float
        The longest side of a typical triangle.
    progress : callable, optional
        Called with a fraction from 0 to 1 in each round.
    """
    for _ in range(REWEIGHTINGS):
        difference = problem.differences(constants)
        jump = np.abs(difference - np.clip(difference, problem.low, problem.high))
        tangent = replace(problem, weights=problem.weights / (1.0 + jump / (HEIGHT * side)))
        constants = minimize_fast(tangent, _TOLERANCE, _MAX_ROUNDS, progress).constants
        yield constants
