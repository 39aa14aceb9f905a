"""Sources on a grid: samples of their area elements, and X₀ at the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from ..area_elements import AreaSamples
from ..arrays import Floats, Ints
from .grid import Grid
from .node_sources import NodeSources
from .stencil import interpolation_stencil


@dataclass(frozen=True, eq=False)
class GridSource:
    """Sources lowered to a grid."""

    samples: AreaSamples  # area elements, merged per cell and component, and X₀
    grid: Grid
    diffusion: float  # τ in ``t = τ max(h, h_source)²``

    def time_on(self, spacing: float) -> float:
        """t on a coarser grid of this mean spacing: as on this grid, but at least such that √t spans a cell."""
        return self.time if spacing <= self._step else max(self.time, spacing**2)

    @property
    def time(self) -> float:
        return self.diffusion * max(self._step, self.samples.spacing) ** 2

    @property
    def finest(self) -> int:
        """How often the grid can be coarsened until √t spans a single cell: finer grids add no accuracy."""
        return max(0, int(np.log2(np.sqrt(self.time) / self._step) + 1e-6))

    @property
    def _step(self) -> float:
        return float(self.grid.spacing.mean())

    @property
    def vectors(self) -> NodeSources:
        return self.samples.nodes

    @property
    def weights(self) -> Floats:
        return self.samples.weights

    @property
    def components(self) -> Ints:
        return self.samples.components

    @property
    def source_ids(self) -> Ints:
        return self.samples.source_ids

    @cached_property
    def stencil(self) -> tuple[Ints, Floats]:
        """(s, 2^d) nodes and weights of multilinear interpolation at each sample."""
        return interpolation_stencil(self.samples.positions, self.grid.shape)

    @cached_property
    def interpolation(self) -> csr_matrix:
        nodes, weights = self.stencil
        starts = np.arange(len(nodes) + 1) * nodes.shape[1]
        size = (len(nodes), self.grid.n_nodes)
        return csr_matrix((weights.ravel(), nodes.ravel(), starts), shape=size)

    def at_samples(self, values: Floats) -> Floats:
        """(s,) node values interpolated at the samples."""
        nodes, weights = self.stencil
        return np.einsum("ij,ij->i", values.ravel()[nodes], weights)
