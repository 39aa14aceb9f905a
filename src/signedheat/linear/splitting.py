"""The alternating direction method of multipliers, ADMM (Boyd et al. 2011), for ``min f(z) + g(x)  s.t.  z = K x``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Map = Callable[[NDArray[Any]], NDArray[Any]]
"""A function of one vector, as `split_rounds` describes."""


class Round(NamedTuple):
    """The state of ADMM after a round, for ``min f(z) + g(x)`` with ``z = K x``."""

    solution: NDArray[Any]  # x
    image: NDArray[Any]  # K x
    split: NDArray[Any]  # z
    before: NDArray[Any]  # z after the round before
    scaled_dual: NDArray[Any]  # multipliers over the penalty; changes made in place are used by the next round


def split_rounds(
    proximal: Map, solve: Map, apply: Map, image: NDArray[Any], split: NDArray[Any], relaxation: float = 1.6
) -> Iterator[Round]:
    """Yield the state of ADMM after each round, without end.

    ``proximal(v)`` returns the z that minimises f(z) + ρ/2 |z − v|², ``solve(v)`` the x that minimises g(x) + ρ/2
    |K x − v|², and ``apply(x)`` is K x. `image` and `split` are the initial K x and z. With a relaxation of 1.5 to 1.8
    the fewest rounds are needed.
    """
    relaxed, dual = image, np.zeros_like(image)
    while True:
        before, target = split, relaxed + dual
        split = proximal(target)
        dual = target - split
        solution = solve(split - dual)
        image = apply(solution)
        relaxed = relaxation * image + (1.0 - relaxation) * split
        yield Round(solution, image, split, before, dual)
