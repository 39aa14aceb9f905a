"""The free nodes of a grid with solid ones: stencil without flux into solid nodes, gradients, visibility."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ...domains.grid import Grid
from ...operators.grid.walls import lines_are_clear

REFLECTION = 3
"""Width, in nodes, of the layer along a wall in which reflected heat turns gradients by more than a degree."""


@dataclass(frozen=True, eq=False)
class FreeNodes:
    """The nodes of a grid that are not solid, numbered in the order of the grid.

    Examples
    --------
    >>> import numpy as np
    >>> nodes = FreeNodes(Grid(0.0, 0.5, 4, mask=np.array([False, False, True, False])))
    >>> nodes.neighbors.tolist()
    [[-1, 1], [0, -1], [-1, -1]]
    >>> nodes.laplacian.toarray().tolist()
    [[4.0, -4.0, 0.0], [-4.0, 4.0, 0.0], [0.0, 0.0, 0.0]]
    """

    grid: Grid

    @cached_property
    def ids(self) -> NDArray[np.int64]:
        """(n,) index of each free node among all nodes of the grid."""
        return np.flatnonzero(~self.grid.mask.ravel())

    @cached_property
    def numbers(self) -> NDArray[np.int64]:
        """(n_nodes,) the inverse of `ids`; −1 for solid nodes."""
        numbers = np.full(self.grid.n_nodes, -1, dtype=np.int64)
        numbers[self.ids] = np.arange(len(self.ids))
        return numbers

    @cached_property
    def indices(self) -> NDArray[np.int64]:
        """(n, d) position of each free node, in cells."""
        return np.stack(np.unravel_index(self.ids, self.grid.shape), axis=1)

    @cached_property
    def neighbors(self) -> NDArray[np.int64]:
        """(n, 2d) free node before and after each free node along every axis; −1 where there is none."""
        padded = np.pad(self.numbers.reshape(self.grid.shape), 1, constant_values=-1)
        place = self.indices + 1
        around = []
        for axis in range(self.grid.dimension):
            for step in (-1, 1):
                there = place.copy()
                there[:, axis] += step
                around.append(padded[tuple(there.T)])
        return np.stack(around, axis=1)

    @cached_property
    def laplacian(self) -> sparse.csr_matrix:
        """C, Eq. 10 on a grid: positive semidefinite, with no flux through the box or into solid nodes."""
        n, weights = len(self.ids), np.repeat(self.grid.spacing**-2.0, 2)
        there = self.neighbors >= 0
        rows, sides = np.nonzero(there)
        parts = sparse.csr_matrix((weights[sides], (rows, self.neighbors[there])), shape=(n, n))
        return sparse.csr_matrix(sparse.diags_array(there @ weights) - parts)

    def divergence(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) −∇·Y, which is b of Eq. 13. The flux between two free nodes is the mean of theirs, any other zero."""
        result = np.zeros(len(directions))
        for axis, step in enumerate(self.grid.spacing):
            for side, sign in ((2 * axis, 1.0), (2 * axis + 1, -1.0)):
                neighbors, component = self.neighbors[:, side], directions[:, axis]
                result += np.where(neighbors >= 0, sign * (component + component[neighbors]) / (2 * step), 0.0)
        return result

    def gradients(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, d) central differences; a value beyond a wall is replaced by the one before it.

        For values that decay like the Green's function of ``1 − tΔ``, central differences have the exact direction of
        decay: they are the group velocity of the stencil, however few nodes √t spans.
        """
        slopes = np.empty((len(values), self.grid.dimension))
        for axis, step in enumerate(self.grid.spacing):
            before, after = self.neighbors[:, 2 * axis], self.neighbors[:, 2 * axis + 1]
            ahead = np.where(after >= 0, values[after], values)
            behind = np.where(before >= 0, values[before], values)
            slopes[:, axis] = (ahead - behind) / (2 * step)
        return slopes

    def remove_wall_reflection(self, directions: NDArray[np.float64], chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Directions at the chosen nodes; where one points into a wall nearby, it is taken from farther inside.

        Within a few √t (a few nodes) of a wall, heat that the wall reflects cancels the component of the gradient that
        points into the wall.
        """
        result = directions.copy()
        for axis in range(self.grid.dimension):
            for wall in (0, 1):
                inward, sign = self.neighbors[:, 2 * axis + 1 - wall], 2 * wall - 1
                chain = [np.flatnonzero(chosen & (self.neighbors[:, 2 * axis + wall] < 0))]
                for _ in range(REFLECTION):
                    chain = [ids[inward[chain[-1]] >= 0] for ids in chain]
                    chain.append(inward[chain[-1]])
                    chain = [ids[chosen[chain[-1]]] for ids in chain]
                leading = sign * directions[chain[-1], axis] > 0
                for ids in chain[:-1]:
                    result[ids[leading]] = directions[chain[-1][leading]]
        return result

    def see(self, targets: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether the line from each free node to its target (n, d), in cells, avoids the boxes of solid nodes."""
        counts = np.array(self.grid.shape)
        strides = np.append(np.cumprod(counts[:0:-1])[::-1], 1)
        return lines_are_clear(self.indices, targets, self.grid.mask.ravel(), counts, strides)
