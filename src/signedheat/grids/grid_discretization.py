"""Regular grids as a discretisation: diffusion by sweeps, integration by cosine transforms (Sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..area_elements import sample_on_grid
from ..discretization import DiffusesEach, discretize
from ..errors import MemoryLimitError, SourceError
from ..memory import available_memory, libraries
from .grid import Grid
from .grid_integration import GridIntegration
from .grid_source import GridSource
from .multilevel import Level, collapse, diffuse_multilevel, unit_vectors
from .stencil import divergence
from .wavefront import padded_shape

BYTES_PER_NODE, BYTES_PER_AREA = {1: 42, 2: 42, 3: 25, 4: 42}, 930
"""Measured peak memory of a distance computation, by dimension; and what each square cell of surface adds in space."""
MOST_PER_NODE = 22
"""What surface adds for each node where it is everywhere."""
ROOM = 1.08
"""By how much the suggested spacing is larger than it must be: what is free changes from run to run."""


def memory_estimate(grid: Grid, per_node: float | None = None, extra: float = 0.0) -> int:
    """Estimated peak memory of a distance computation on the grid, in bytes; of others, if `per_node` is given.

    `extra` bytes, needed for neither nodes nor libraries, are added.

    Examples
    --------
    >>> memory_estimate(Grid((0, 0, 0), 1.0, (512, 512, 512))) < 10e9
    True
    """
    if per_node is None:
        per_node = BYTES_PER_NODE[grid.dimension]
    return int(per_node * grid.n_nodes + extra) + libraries()


def bytes_of_area(area: float, spacing: NDArray[np.float64], n_nodes: float) -> float:
    """What so much surface adds on a grid of this spacing, in space.

    Examples
    --------
    >>> bytes_of_area(0.5, np.full(3, 0.01), 10**6)
    4650000.0
    """
    if len(spacing) != 3:
        return 0.0
    cells = float(area / float(np.prod(spacing)) ** (2 / 3))
    return min(round(BYTES_PER_AREA * cells, 1), MOST_PER_NODE * n_nodes)


def refuse_large_grid(grid: Grid, per_node: float | None = None, extra: float = 0.0, area: float = 0.0) -> None:
    """Raise `MemoryLimitError` if a distance computation on the grid needs too much memory; allocates nothing.

    For φ alone, the area of the surface makes the estimate better.
    """
    available, needed = available_memory(), memory_estimate(grid, per_node, extra)
    needed += int(bytes_of_area(area, grid.spacing, grid.n_nodes))
    if available is None or needed <= available:
        return
    fitting = ROOM * fitting_spacing(grid, available, per_node, extra, area)
    spacing = " × ".join(dict.fromkeys(f"{step:.3g}" for step in fitting))
    coarser = f"choose a spacing of {spacing} or more, or a lower resolution"
    some_nodes = (fitting < grid.upper - grid.origin).all()
    raise MemoryLimitError(
        f"a grid of {' × '.join(map(str, grid.shape))} nodes needs about {needed / 1e9:.1f} GB, "
        f"and {available / 1e9:.1f} GB are free",
        remedy=coarser if some_nodes else "its source alone takes that much: coarsen it, or take it in parts",
    )


def fitting_spacing(
    grid: Grid, available: int, per_node: float | None = None, extra: float = 0.0, area: float = 0.0
) -> NDArray[np.float64]:
    """(d,) about the least spacing, in the proportions of the grid's own, at which its box fits into memory."""
    base = memory_estimate(grid, 0.0, extra)
    whole = memory_estimate(grid, per_node, extra) - base
    spacing: NDArray[np.float64] = grid.spacing * max((available - base) / whole, 1e-12) ** (-1.0 / grid.dimension)
    per_node = whole / grid.n_nodes

    def needed() -> float:
        nodes = float(np.prod(np.floor((grid.upper - grid.origin) / spacing) + 1))
        return per_node * nodes + bytes_of_area(area, spacing, nodes) + base

    while needed() > max(available, 2 * base):
        spacing *= 1.01
    return spacing


@dataclass(frozen=True, eq=False)
class GridDiscretization(DiffusesEach):
    """A grid, as the three steps see it."""

    grid: Grid

    @cached_property
    def integration(self) -> GridIntegration:
        return GridIntegration(self.grid)

    def adapt(self, sources: Sequence[Any]) -> tuple[GridDiscretization, Sequence[Any]]:
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> GridSource:
        """X₀ and the rows that interpolate φ on the source: Eq. 11 in space, area vectors spread to the nodes."""
        samples = sample_on_grid(sources, self.grid)
        refuse_large_grid(self.grid, area=float(samples.weights.sum()))
        return GridSource(samples, self.grid, diffusion)

    def diffuse(self, source: GridSource) -> list[Level]:
        """Solve ``(1 − tΔ) X = X₀`` (Eq. 12): in flat space each component of X diffuses by itself."""
        return diffuse_multilevel(source.vectors, source.time_on, source.finest)

    def to_cells(self, vectors: list[Level]) -> NDArray[np.float32]:
        dimension = self.grid.dimension
        directions = collapse(vectors, padded_shape(self.grid.shape), dimension, unit_vectors)
        return np.moveaxis(directions.reshape(dimension, *self.grid.shape), 0, -1)

    def divergence(self, directions: NDArray[np.floating]) -> NDArray[np.float64]:
        """b, the right-hand side of ``C φ = b`` (Eq. 13)."""
        return divergence(directions, self.grid.spacing)


@discretize.register
def _(domain: Grid) -> GridDiscretization:
    if domain.dimension > 4:
        raise SourceError(f"grids have up to 4 dimensions here, not {domain.dimension}", element="domain")
    refuse_large_grid(domain)
    return GridDiscretization(domain)
