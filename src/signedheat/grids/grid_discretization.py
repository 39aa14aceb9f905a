"""Regular grids discretised for the signed heat method: diffusion by sweeps, integration by cosine transforms (Sec. 8).

C is inverted by the cosine transform, and constraints are corrections of that solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import lsqr

from ..arrays import Floats, Ints
from ..discretization import DiffusesEach, Levels, SolvesEach, discretize
from ..errors import MemoryLimitError, SourceError
from ..linear.conjugate_gradients import conjugate_gradients
from ..memory import REMEDY_MARGIN, available_memory, libraries, refuse_beyond_memory
from ..shapes.area_elements import AreaSamples, sample_on_grid
from .grid import Grid
from .multilevel import Level, collapse, diffuse_multilevel, quotients, skip_finest, unit_vectors
from .node_sources import NodeSources
from .stencil import divergence, interpolation_stencil, laplacian, padded_shape, solve_poisson

BYTES_PER_GRID_NODE, BYTES_PER_CELL = {1: 42, 2: 42, 3: 25, 4: 42}, 930
"""Measured peak memory of a distance computation per node, by dimension; and per square cell of surface in space."""
MOST_BYTES_PER_NODE = 30
"""Largest memory per node that a surface adds, if it fills the whole grid. With 22 the estimate for 64 balls on 128³
nodes was three quarters of what was measured."""


def memory_estimate(grid: Grid, per_node: float | None = None, extra: float = 0.0) -> int:
    """Return the estimated peak memory, in bytes, of distance on a grid, or of work that takes `per_node` bytes a node.

    `extra` bytes are added.
    """
    if per_node is None:
        per_node = BYTES_PER_GRID_NODE[grid.dimension]
    return int(per_node * grid.n_nodes + extra) + libraries()


def bytes_of_area(area: float, spacing: Floats, n_nodes: float) -> float:
    """Return the estimated bytes that a surface of this area adds on a grid in space; 0 in other dimensions."""
    if len(spacing) != 3:
        return 0.0
    cells = float(area / float(np.prod(spacing)) ** (2 / 3))
    return min(round(BYTES_PER_CELL * cells, 1), MOST_BYTES_PER_NODE * n_nodes)


def refuse_large_grid(grid: Grid, per_node: float | None = None, extra: float = 0.0, area: float = 0.0) -> None:
    """Raise `MemoryLimitError` if distance on the grid, to a surface of this area, does not fit into memory.

    `per_node` and `extra` are those of `memory_estimate`.
    """
    available, needed = available_memory(), memory_estimate(grid, per_node, extra)
    needed += int(bytes_of_area(area, grid.spacing, grid.n_nodes))
    if available is None or needed <= available:
        return
    fitting = REMEDY_MARGIN * fitting_spacing(grid, available, per_node, extra, area)
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
) -> Floats:
    """(d,) roughly the least spacing, in proportion to that of the grid, with which its box fits into memory.

    That is, into `available` bytes. The work takes `per_node` bytes for each node, by default those of a distance, and
    `extra` bytes. A surface of the given area, in the units of the grid, adds more in space.
    """
    without_nodes = memory_estimate(grid, 0.0, extra)
    of_nodes = memory_estimate(grid, per_node, extra) - without_nodes
    spacing: Floats = grid.spacing * max((available - without_nodes) / of_nodes, 1e-12) ** (-1.0 / grid.dimension)
    per_node = of_nodes / grid.n_nodes

    def needed() -> float:
        """Return the estimated bytes with the present spacing."""
        nodes = float(np.prod(np.floor((grid.upper - grid.origin) / spacing) + 1))
        return per_node * nodes + bytes_of_area(area, spacing, nodes) + without_nodes

    # ends even where no spacing fits, since all else takes more than there is
    while needed() > max(available, 2 * without_nodes):
        spacing *= 1.01
    return spacing


@dataclass(frozen=True, eq=False)
class GridSource:
    """Sources lowered to a grid: samples of their area elements, and X₀ at the nodes."""

    samples: AreaSamples  # area elements, merged in each cell and component, and X₀
    grid: Grid
    diffusion: float  # τ in ``t = τ max(h, h_source)²``

    def time_on(self, spacing: float) -> float:
        """Return t on a coarser grid with this mean spacing: as on this grid, but large enough that √t spans a cell."""
        return self.time if spacing <= self._step else max(self.time, spacing**2)

    @property
    def time(self) -> float:
        """t of Eq. 12."""
        return self.diffusion * max(self._step, self.samples.spacing) ** 2

    @property
    def finest(self) -> int:
        """How often the grid can be coarsened until √t spans one cell; finer grids would not be more accurate."""
        return max(0, int(np.log2(np.sqrt(self.time) / self._step) + 1e-6))

    @property
    def _step(self) -> float:
        """Mean spacing of the grid."""
        return float(self.grid.spacing.mean())

    @property
    def vectors(self) -> NodeSources:
        """X₀ at the nodes."""
        return self.samples.nodes

    @property
    def weights(self) -> Floats:
        """(s,) area that each sample stands for."""
        return self.samples.weights

    @property
    def components(self) -> Ints:
        """(s,) connected component of the sources that each sample belongs to."""
        return self.samples.components

    @property
    def source_ids(self) -> Ints:
        """(s,) source that each sample belongs to."""
        return self.samples.source_ids

    @cached_property
    def stencil(self) -> tuple[Ints, Floats]:
        """(s, 2^d) nodes and weights of multilinear interpolation at each sample."""
        return interpolation_stencil(self.samples.positions, self.grid.shape)

    @cached_property
    def interpolation(self) -> csr_matrix:
        """(s, n_nodes) matrix that interpolates node values at the samples."""
        nodes, weights = self.stencil
        starts = np.arange(len(nodes) + 1) * nodes.shape[1]
        size = (len(nodes), self.grid.n_nodes)
        return csr_matrix((weights.ravel(), nodes.ravel(), starts), shape=size)

    def at_samples(self, values: Floats) -> Floats:
        """(s,) values at the nodes, interpolated at the samples."""
        nodes, weights = self.stencil
        return np.einsum("ij,ij->i", values.ravel()[nodes], weights)


@dataclass(frozen=True, eq=False)
class GridDiscretization(DiffusesEach):
    """A grid discretised for the signed heat method; see `Discretization` for its methods."""

    grid: Grid

    @cached_property
    def integration(self) -> GridIntegration:
        """Step 3 of the method."""
        return GridIntegration(self.grid)

    def adapt(self, sources: Sequence[Any]) -> tuple[GridDiscretization, Sequence[Any]]:
        """Return this discretisation and the sources, since grids are not adapted to sources."""
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> GridSource:
        """Sample the sources, and spread their area vectors to the nodes as X₀ (Eq. 11 in space); `diffusion` is τ."""
        samples = sample_on_grid(sources, self.grid)
        refuse_large_grid(self.grid, area=float(samples.weights.sum()))
        return GridSource(samples, self.grid, diffusion)

    def diffuse(self, source: GridSource) -> list[Level]:
        """Solve ``(1 − tΔ) X = X₀`` (Eq. 12) on a hierarchy of grids; in flat space components diffuse separately."""
        return diffuse_multilevel(source.vectors, source.time_on, source.finest)

    def to_cells(self, vectors: list[Level]) -> NDArray[np.float32]:
        """(*shape, d) unit vectors along X at the nodes."""
        dimension = self.grid.dimension
        directions = collapse(vectors, padded_shape(self.grid.shape), dimension, unit_vectors)
        return np.moveaxis(directions.reshape(dimension, *self.grid.shape), 0, -1)

    def divergence(self, directions: NDArray[np.floating]) -> Floats:
        """Compute b, the right-hand side of ``C φ = b`` (Eq. 13), in the shape of the grid."""
        return divergence(directions, self.grid.spacing)


@discretize.register
def _(domain: Grid) -> GridDiscretization:
    """Discretise a grid, or raise `MemoryLimitError` if distance on it does not fit in memory."""
    if domain.dimension > 4:
        raise SourceError(f"grids have up to 4 dimensions here, not {domain.dimension}", element="domain")
    refuse_large_grid(domain)
    return GridDiscretization(domain)


PENALTY = 10.0
"""Default penalty for deviations from levels, in 1/h, also that of the augmented Lagrangian."""
LEAST_PENALTY, LARGEST_PENALTY = 1e-6, 30.0
"""Least penalty in the preconditioner, and largest penalty that does not count as infinite, relative to the default."""
EQUAL_ROWS = 1e-6
"""Interpolation rows of samples that differ by less than this count as equal, so that different levels contradict each
other."""


@dataclass(frozen=True, eq=False)
class GridIntegration(SolvesEach):
    """Step 3 on a grid: φ from the right-hand side b, the `divergence`; both have the shape of the grid."""

    grid: Grid

    @property
    def soft_weight(self) -> float:
        """Default λ of `Soft`, in 1/length."""
        return PENALTY / float(self.grid.spacing.mean())

    def solve(self, divergence: Floats, source: GridSource) -> Floats:
        """Return the φ that minimises ∫|∇φ − Y|², with mean zero at the samples: ``C φ = b`` (Eq. 13)."""
        phi = solve_poisson(divergence, self.grid.spacing, overwrite=True)
        phi -= np.average(source.at_samples(phi), weights=source.weights)
        return phi

    def fit(self, divergence: Floats, source: GridSource, levels: Levels) -> Floats:
        """Return φ near given levels at the samples, instead of Eq. 14.

        It is φ of `solve` minus its error at the samples, which is spread to the nodes by diffusion, as normals are.
        """
        phi = self.solve(divergence, source)
        excess = deviation(source.at_samples(phi), source, levels)
        phi -= diffused_mean(source, excess)
        return phi

    def penalize(self, divergence: Floats, source: GridSource, strength: float) -> Floats:
        """Solve ``(C + λ Aᵀ W A) φ = b`` for λ = `strength` (Sec. 7.1, Fig. 11), with W the areas of samples.

        λ beyond `LARGEST_PENALTY` counts as infinite.
        """
        levels = Levels(np.zeros(len(source.weights)))
        if strength < LEAST_PENALTY**2 * self.soft_weight:
            return self.solve(divergence, source)
        if strength > LARGEST_PENALTY * self.soft_weight:
            return self.fit_exactly(divergence, source, levels)
        zero = np.zeros(len(source.weights))
        return self._penalized(divergence, source, levels, strength, zero, np.zeros(self.grid.shape))

    def fit_exactly(self, divergence: Floats, source: GridSource, levels: Levels) -> Floats:
        """Return φ with exactly the given levels at the s samples, by an augmented Lagrangian for Eq. 14.

        φ and `divergence`, the right-hand side b, are in the shape of the grid. `levels` are (s,) values, or with
        groups of samples, values up to an unknown constant for each group. The error that remains is removed by changes
        at nodes near samples.
        """
        refuse_beyond_memory(
            f"the zero set imposed exactly on {self.grid.n_nodes:,} nodes",
            self.grid.n_nodes,
            lambda count: 83 * count,  # measured, beyond what is held already
            lambda count: f"leave out hard=True, or use at most {count:,} nodes",
        )
        strength = self.soft_weight
        phi = self.fit(divergence.copy(), source, levels)
        multipliers = np.zeros(len(source.weights))
        for _ in range(5):
            phi = self._penalized(divergence, source, levels, strength, multipliers, phi)
            multipliers += strength * deviation(source.at_samples(phi), source, levels)
        return phi - least_correction(deviation(source.at_samples(phi), source, levels), source).reshape(phi.shape)

    def _penalized(
        self,
        divergence: Floats,
        source: GridSource,
        levels: Levels,
        strength: float,
        multipliers: Floats,
        start: Floats,
    ) -> Floats:
        """Return the φ that minimises ∫|∇φ − Y|² + Σ w (strength · d² + 2 · multiplier · d), starting at `start`.

        The sum is over samples of weight w, and d is the `deviation` of φ from the levels there.
        """
        volume = float(np.prod(self.grid.spacing))
        rows, weights = source.interpolation, source.weights / volume
        free = Levels(np.zeros_like(levels.values), levels.groups)

        def spread(at_samples: Floats) -> Floats:
            """Return values at the samples, weighted, at the nodes: the transpose of interpolation."""
            at_nodes: Floats = rows.T @ (weights * at_samples)
            return at_nodes.reshape(self.grid.shape)

        def apply(phi: Floats) -> Floats:
            """Multiply the matrix of the minimisation by values at the nodes, flattened."""
            pull = strength * deviation(rows @ phi, source, free)
            return (laplacian(phi.reshape(self.grid.shape), self.grid.spacing) + spread(pull)).ravel()

        # constants are in the kernel of C; their cost is that of the penalty alone, and they are settled at the end
        constant = max(strength, LEAST_PENALTY * self.soft_weight) * float(weights.sum()) / self.grid.n_nodes

        def precondition(residual: Floats) -> Floats:
            """Multiply a residual by the inverse of C, and its mean by that of the penalty."""
            inverse = solve_poisson(residual.reshape(self.grid.shape), self.grid.spacing)
            result: Floats = inverse + residual.mean() / constant
            return result.ravel()

        wanted = strength * deviation(levels.values, source, free) - deviation(multipliers, source, free)
        right_hand_side = (divergence + spread(wanted)).ravel()
        phi = conjugate_gradients(apply, right_hand_side, precondition, start.ravel(), tolerance=1e-6)
        phi += np.average(wanted / strength - deviation(rows @ phi, source, free), weights=source.weights)
        return phi.reshape(self.grid.shape)


def deviation(values: Floats, source: GridSource, levels: Levels) -> Floats:
    """(s,) values at the samples minus their levels; with groups, also minus the weighted mean of the group."""
    excess = values - levels.values
    if levels.groups is not None:
        sums = np.bincount(levels.groups, source.weights * excess)
        sizes = np.bincount(levels.groups, source.weights)
        excess = excess - (sums / np.where(sizes > 0, sizes, 1))[levels.groups]
    return excess


def diffused_mean(source: GridSource, values: Floats) -> NDArray[np.float32]:
    """Return at each node the mean of (s,) values at samples, weighted by area and by how much heat comes from each.

    Heat and heat times value diffuse alike, as two components, and their quotient is the mean. It varies slowly, so
    that the finest grid is skipped. Both are scaled to at most 1, for single precision.
    """
    largest = np.abs(values).max()
    if largest == 0.0:
        return np.zeros(source.grid.shape, dtype=np.float32)
    vectors, axes = source.vectors, slice(-source.grid.dimension, None)
    left_out, shape, steps = skip_finest(vectors.shape, vectors.steps, max(1, source.finest))
    ratios = vectors.steps[axes] / np.where(steps[axes] > 0, steps[axes], np.inf)
    stencil = interpolation_stencil(source.samples.positions * ratios, shape[axes])
    weights = source.weights / source.weights.max()
    pairs = np.stack([weights, weights * values / largest], axis=1)
    nodes = NodeSources.scattered(shape, steps, *stencil, pairs)
    levels = left_out + diffuse_multilevel(nodes, source.time_on, rounds=1)
    mean = collapse(levels, vectors.shape, 1, quotients).reshape(source.grid.shape)
    mean *= np.float32(largest)
    return mean


def least_correction(values: Floats, source: GridSource) -> Floats:
    """(n_nodes,) grid function of least norm that interpolates (s,) values at the samples, by least squares."""
    touched = np.unique(source.interpolation.indices)
    change = np.zeros(source.grid.n_nodes)
    columns = source.interpolation[:, touched]
    change[touched] = lsqr(columns, values, damp=EQUAL_ROWS, atol=1e-10, btol=1e-10, iter_lim=20000)[0]
    return change
