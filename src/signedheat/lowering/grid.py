"""Regular grids as a discretisation: diffusion by sweeps, integration by cosine transforms (Sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..discretization import Diagnostics, Levels, discretize
from ..domains.grid import Grid
from ..errors import MemoryLimitError, SourceError
from ..fields.grid_field import GridField
from ..sources.area_elements import AreaSamples, sample_on_grid

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from ..operators.pyramid import Level, NodeSources

SAMPLE_SIZE = 1.0
"""Longest edge, in cells, of the pieces into which faces are cut."""
BYTES_PER_NODE = 56
"""Peak of a distance computation, measured."""


def memory_estimate(grid: Grid) -> int:
    """Bytes that a distance computation on the grid takes at its peak.

    Examples
    --------
    >>> memory_estimate(Grid((0, 0, 0), 1.0, (512, 512, 512))) < 10e9
    True
    """
    return BYTES_PER_NODE * grid.n_nodes + 50_000_000


def refuse_beyond_memory(grid: Grid) -> None:
    """Raise `MemoryLimitError` if the grid cannot fit, before anything is allocated."""
    import os

    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else None
    needed = memory_estimate(grid)
    if available is not None and needed > available:
        raise MemoryLimitError(
            f"a grid of {' × '.join(map(str, grid.shape))} nodes needs about {needed / 1e9:.1f} GB, and this machine "
            f"has {available / 1e9:.1f} GB: choose a lower resolution"
        )


@dataclass(frozen=True, eq=False)
class GridSource:
    """Sources on a grid: samples, and how they act on its nodes."""

    samples: AreaSamples
    grid: Grid
    diffusion: float

    def time_on(self, spacing: float) -> float:
        """t on a grid of this mean spacing (MATH: the larger of both spacings, squared)."""
        return self.diffusion * max(spacing, self.samples.spacing) ** 2

    @property
    def time(self) -> float:
        return self.time_on(float(self.grid.spacing.mean()))

    @property
    def vectors(self) -> NodeSources:
        return self.samples.nodes

    @property
    def weights(self) -> NDArray[np.float64]:
        return self.samples.weights

    @property
    def components(self) -> NDArray[np.int64]:
        return self.samples.components

    @property
    def owners(self) -> NDArray[np.int64]:
        return self.samples.owners

    @cached_property
    def stencil(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Nodes and weights that interpolate at each sample."""
        from ..operators.stencil import interpolation_stencil

        return interpolation_stencil(self.samples.positions, self.grid.shape)

    @cached_property
    def rows(self) -> csr_matrix:
        from scipy.sparse import csr_matrix

        nodes, weights = self.stencil
        starts = np.arange(len(nodes) + 1) * nodes.shape[1]
        size = (len(nodes), self.grid.n_nodes)
        return csr_matrix((weights.ravel(), nodes.ravel(), starts), shape=size)

    def at_samples(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the nodes, interpolated."""
        nodes, weights = self.stencil
        return np.einsum("ij,ij->i", values.ravel()[nodes], weights)


@dataclass(frozen=True, eq=False)
class GridDiscretization:
    """A grid, as the three steps see it."""

    grid: Grid

    @cached_property
    def integration(self) -> GridIntegration:
        return GridIntegration(self.grid)

    def adapt(self, sources: Sequence[Any]) -> tuple[GridDiscretization, Sequence[Any]]:
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> GridSource:
        samples = sample_on_grid(sources, self.grid, SAMPLE_SIZE)
        return GridSource(samples, self.grid, diffusion)

    def diffuse(self, source: GridSource) -> list[Level]:
        from ..operators.pyramid import diffuse_on_pyramid

        return diffuse_on_pyramid(source.vectors, source.time_on)

    def to_cells(self, vectors: list[Level]) -> NDArray[np.float32]:
        from ..operators.extraction import unit_vectors
        from ..operators.pyramid import collapse
        from ..operators.wavefront import padded_shape

        dimension = self.grid.dimension
        directions = collapse(vectors, padded_shape(self.grid.shape), dimension, unit_vectors)
        return np.moveaxis(directions.reshape(dimension, *self.grid.shape), 0, -1)

    def divergence(self, directions: NDArray[np.floating]) -> NDArray[np.float64]:
        from ..operators.stencil import divergence

        return divergence(directions, self.grid.spacing)

    def field(self, values: NDArray[np.float64], source: GridSource, diagnostics: Diagnostics) -> GridField:
        notes = {"samples": len(source.weights), "area outside the grid": source.samples.outside}
        return GridField(self.grid, values, replace(diagnostics, notes={**diagnostics.notes, **notes}))


@dataclass(frozen=True, eq=False)
class GridIntegration:
    """Step 3 on a grid."""

    grid: Grid

    def solve(self, divergence: NDArray[np.float64], source: GridSource) -> NDArray[np.float64]:
        from ..operators.stencil import solve_poisson

        phi = solve_poisson(divergence, self.grid.spacing, overwrite=True)
        phi -= np.average(source.at_samples(phi), weights=source.weights)
        return phi

    def fit(self, divergence: NDArray[np.float64], source: GridSource, levels: Levels) -> NDArray[np.float64]:
        """Subtract from φ the mean of its error at the samples, weighted by how well each is seen from a node.

        The weights are the samples' areas, diffused as the normals are.
        """
        phi = self.solve(divergence, source)
        excess = excess_at_samples(source, phi, levels)
        phi -= diffused_mean(source, excess)
        return phi


def excess_at_samples(source: GridSource, phi: NDArray[np.float64], levels: Levels) -> NDArray[np.float64]:
    """φ − level at the samples; the unknown constant of a group is the group's mean."""
    excess = source.at_samples(phi) - levels.values
    if levels.groups is not None:
        sums = np.bincount(levels.groups, source.weights * excess)
        sizes = np.bincount(levels.groups, source.weights)
        excess -= (sums / np.where(sizes > 0, sizes, 1))[levels.groups]
    return excess


def diffused_mean(source: GridSource, values: NDArray[np.float64]) -> NDArray[np.float32]:
    """(*grid.shape) mean of values given at the samples, weighted by area and nearness: as the normals are diffused.

    It varies slowly, so the finest level of the pyramid is left out.
    """
    from ..operators.extraction import quotients
    from ..operators.pyramid import NodeSources, collapse, diffuse_on_pyramid, scatter

    weights = source.weights / source.weights.max()
    largest = np.abs(values).max()
    if largest == 0.0:
        return np.zeros(source.grid.shape, dtype=np.float32)
    nodes = NodeSources.empty(source.vectors.shape, source.vectors.steps)
    scatter(*source.stencil, np.stack([weights, weights * values / largest], axis=1), nodes)
    levels = diffuse_on_pyramid(nodes, source.time_on, finest=1)
    return collapse(levels, nodes.shape, 1, quotients).reshape(source.grid.shape) * np.float32(largest)


@discretize.register
def _(domain: Grid) -> GridDiscretization:
    if domain.dimension > 4:
        raise SourceError(f"grids have up to 4 dimensions here, not {domain.dimension}")
    refuse_beyond_memory(domain)
    return GridDiscretization(domain)
