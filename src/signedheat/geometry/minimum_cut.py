"""The cheapest way to cut a graph in two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cut_kernels import source_side
from .lists import grouped

UNITS = 2.0**40
"""What all pulls to one side count together, as integers, so that a flow that ends ends exactly."""


@dataclass(frozen=True, eq=False)
class CutGraph:
    """A graph that is cut again and again, with other costs.

    Attributes
    ----------
    starts : (n + 1,) int
        Where the arcs of each node begin.
    heads : (2 e,) int
        Where each arc leads.
    reverse : (2 e,) int
        The arc back.
    order : (2 e,) int
        Edge of each arc, plus e if it runs backwards.
    """

    starts: NDArray[np.int64]
    heads: NDArray[np.int64]
    reverse: NDArray[np.int64]
    order: NDArray[np.int64]

    @classmethod
    def of(cls, edges: NDArray[np.int64], n: int) -> CutGraph:
        """The graph of n nodes and these (e, 2) edges."""
        tails, heads = np.concatenate([edges, edges[:, ::-1]]).T
        starts, order = grouped(tails, n)
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        return cls(starts, np.ascontiguousarray(heads[order]), place[(order + len(edges)) % len(order)], order)

    def cut(
        self, falling: NDArray[np.float64], rising: NDArray[np.float64], pull: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,) signs s = ±1 of nodes with the least cost of edges that are cut, less Σ pull s.

        Of several such signs, those with the fewest positive.

        Parameters
        ----------
        falling, rising : (e,) float
            Cost of an edge whose first node is positive and whose second is negative; and of the reverse.
        pull : (n,) float
            How much each node gains by being positive rather than neither.

        Examples
        --------
        >>> chain = CutGraph.of(np.array([[0, 1], [1, 2], [2, 3]]), 4)
        >>> chain.cut(np.array([1.0, 0.2, 1.0]), np.ones(3), np.array([3.0, 0, 0, -3.0]))
        array([ 1.,  1., -1., -1.])
        """
        total = 2 * max(float(pull[pull > 0].sum()), -float(pull[pull < 0].sum()))
        if total == 0:
            return np.ones(len(pull))
        costs = np.minimum(np.concatenate([falling, rising])[self.order] / total, 1.0)
        residual, pulls = (np.rint(UNITS * each).astype(np.int64) for each in (costs, 2 * pull / total))
        return np.where(source_side(self.starts, self.heads, self.reverse, residual, pulls), 1.0, -1.0)
