"""Sources on a grid with solid nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

from ...errors import SourceError
from .free_nodes import FreeNodes
from .source import GridSource


@dataclass(frozen=True, eq=False)
class MaskedSource:
    """Sources lowered to the free nodes of a grid.

    Attributes
    ----------
    whole : GridSource
        The same on the grid without solid nodes.
    interpolation : (s, n) sparse
        Interpolates at the samples, from the free ones among the nodes around each.
    kept : (s,) int
        Samples of `whole` with a free node around them.
    beside_solid : (s,) bool
        Samples with a solid node within a cell or two: a source that ends there ends at a wall.
    """

    whole: GridSource
    interpolation: sparse.csr_matrix
    kept: NDArray[np.int64]
    beside_solid: NDArray[np.bool_]

    @classmethod
    def of(cls, whole: GridSource, nodes: FreeNodes) -> MaskedSource:
        """Lower sources to free nodes.

        Raises
        ------
        SourceError
            If a source lies within solid nodes.
        """
        ids, weights = whole.stencil
        numbers = nodes.numbers[ids]
        weights = np.where(numbers >= 0, weights, 0.0)
        total = weights.sum(axis=1)
        kept = np.flatnonzero(total > 0)
        lost = np.setdiff1d(whole.source_ids, whole.source_ids[kept])
        if len(lost):
            raise SourceError(
                f"source {lost[0]} lies within solid nodes of the grid, where nothing reaches it",
                remedy="move it out of them",
                element=f"source {lost[0]}",
            )
        weights, numbers = weights[kept] / total[kept, None], numbers[kept]
        row, corner = np.nonzero(weights)
        shape = (len(kept), len(nodes.ids))
        rows = sparse.csr_matrix((weights[row, corner], (row, numbers[row, corner])), shape=shape)
        near_solid = scipy.ndimage.binary_dilation(nodes.grid.mask).ravel()
        return cls(whole, rows, kept, near_solid[ids[kept]].any(axis=1))

    @property
    def time(self) -> float:
        return self.whole.time

    @property
    def weights(self) -> NDArray[np.float64]:
        return self.whole.weights[self.kept]

    @property
    def components(self) -> NDArray[np.int64]:
        return self.whole.components[self.kept]

    @property
    def source_ids(self) -> NDArray[np.int64]:
        return self.whole.source_ids[self.kept]

    @property
    def normals(self) -> NDArray[np.float64]:
        """(s, d) area times unit normal of each sample."""
        return self.whole.samples.vectors[self.kept]

    @cached_property
    def vectors(self) -> NDArray[np.float64]:
        """(n, d + 1) X₀, and in the last column the scalar source: areas without their normals."""
        return self.interpolation.T @ np.concatenate([self.normals, self.weights[:, None]], axis=1)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(s, d) positions of the samples, in cells."""
        return self.whole.samples.positions[self.kept]
