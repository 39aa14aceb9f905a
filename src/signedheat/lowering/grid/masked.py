"""Grids with solid nodes as a discretisation: the stencil as a sparse matrix, and directions around corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

from ...cache import LastUsed
from ...discretization import DiffusesEach, Levels
from ...domains.grid import Grid
from ...errors import SourceError
from ...geometry.directions import unit
from ...geometry.surface_points import SNAP
from ...linear import upper_triangle
from ...linear.incomplete_cholesky import from_first
from ...linear.restarts import Stage
from ...operators.grid.walls import lines_are_clear
from ..area_elements import sample_on_grid
from ..direct_integration import DirectIntegration
from ..heat_system import HeatSystem, bend_around_corners
from .integration import STIFFNESS, deviation
from .source import GridSource

DIRECT_NODES = {1: 10_000_000, 2: 1_000_000, 3: 40_000, 4: 5_000}
"""Up to this number of free nodes both systems are factorised, by dimension: factors fill more in higher ones."""
DIRECTION_ERROR = 1e-4
"""Componentwise residual at which the conjugate gradients of step 1 stop."""
FACING = 1.5
"""Cells by which a node may lie past the end of a source at a wall and still count as in front of the source."""
REFLECTION = 3
"""Width, in nodes, of the layer along a wall in which reflected heat turns gradients by more than a degree."""


@dataclass(frozen=True, eq=False)
class MaskedGridDiscretization(DiffusesEach):
    """A grid with solid nodes, as the three steps see it."""

    grid: Grid
    _heats: LastUsed[float, HeatSystem] = field(default_factory=LastUsed, init=False, repr=False)

    @cached_property
    def nodes(self) -> FreeNodes:
        """The nodes that are not solid."""
        return FreeNodes(self.grid)

    @property
    def direct(self) -> bool:
        """Whether systems are factorised; otherwise they are solved by conjugate gradients."""
        return len(self.nodes.ids) <= DIRECT_NODES[self.grid.dimension]

    @cached_property
    def integration(self) -> MaskedIntegration:
        """Step 3."""
        matrix = upper_triangle(self.nodes.laplacian)
        if self.direct:
            return MaskedIntegration(matrix, diffusing=self)
        return MaskedIntegration(matrix, factorize=from_first, spring=100.0, diffusing=self)

    def adapt(self, sources: Sequence[Any]) -> tuple[MaskedGridDiscretization, Sequence[Any]]:
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> MaskedSource:
        whole = GridSource(sample_on_grid(sources, self.grid), self.grid, diffusion)
        return MaskedSource.of(whole, self.nodes)

    def diffuse(self, source: MaskedSource) -> NDArray[np.float64]:
        """Solve ``(1 − tΔ) X = X₀`` (Eq. 12) and turn X where the shortest way from the source is bent.

        That is where the straight line to the source passes solid nodes, or leads past the end of a source that a wall
        ends.
        """
        nodes, dimension = self.nodes, self.grid.dimension
        vectors = np.zeros((len(nodes.ids), dimension + 1))
        slopes, heights = np.zeros((len(nodes.ids), dimension)), np.full(len(nodes.ids), -np.inf)
        around = np.where(nodes.neighbors >= 0, nodes.neighbors, np.arange(len(nodes.ids))[:, None])
        for values, logarithm in self.solve_heat(source.time, source.vectors):
            missing = np.isnan(values[:, 0])
            settled = ~(missing | missing[around].any(axis=1))
            vectors[settled], slopes[settled] = values[settled], nodes.gradients(values[:, -1])[settled]
            with np.errstate(divide="ignore"):
                heights[settled] = np.log(np.maximum(values[settled, -1], 0.0)) + logarithm
        straight = self._straight(source)
        falling = nodes.remove_wall_reflection(-unit(slopes), ~straight)
        return bend_around_corners(vectors[:, :-1], falling, heights, nodes.neighbors, straight)

    def solve_heat(self, time: float, loads: NDArray[np.float64]) -> list[Stage]:
        """``(1 − tΔ)⁻¹`` (Eq. 12) of columns, in stages that each begin where the one before underflows."""
        return self._heats(time, lambda: self._heat_system(time)).solve(loads)

    def _heat_system(self, time: float) -> HeatSystem:
        matrix = self.nodes.laplacian
        matrix = sparse.csr_matrix(sparse.eye_array(matrix.shape[0]) + time * matrix)
        return HeatSystem(matrix, self.direct, DIRECTION_ERROR)

    def _straight(self, source: MaskedSource) -> NDArray[np.bool_]:
        """(n,) nodes that the source reaches along a straight line."""
        nodes, spacing = self.nodes, self.grid.spacing
        tree = scipy.spatial.cKDTree(source.samples.positions * spacing)
        nearest = tree.query(nodes.indices * spacing, workers=-1)[1]
        away = nodes.indices - source.samples.positions[nearest]
        normals = unit(source.samples.vectors * spacing)[nearest]
        along = away - np.einsum("ij,ij->i", away, normals)[:, None] * normals
        past_end = source.near_wall[nearest] & (np.linalg.norm(along, axis=1) > FACING)
        return nodes.see(source.samples.positions[nearest]) & ~past_end

    def to_cells(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """X at the free nodes, which are the cells here: as it is."""
        return vectors

    def divergence(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """b, the right-hand side of ``C φ = b`` (Eq. 13)."""
        return self.nodes.divergence(directions)


@dataclass(frozen=True, eq=False)
class MaskedIntegration(DirectIntegration):
    """Step 3 on free nodes; `fit` imposes levels by a smooth correction, as on grids without solid nodes."""

    diffusing: MaskedGridDiscretization | None = None

    @property
    def soft_weight(self) -> float:
        """λ of `Soft` where none is given, in 1/length."""
        assert self.diffusing is not None
        return STIFFNESS / float(self.diffusing.grid.spacing.mean())

    def fit(self, divergence: NDArray[np.float64], source: MaskedSource, levels: Levels) -> NDArray[np.float64]:
        """Subtract from φ the mean of its errors at the samples, weighted by area and heat (in place of Eq. 14)."""
        phi = self.solve(divergence, source)
        excess = deviation(source.interpolation @ phi, source, levels)
        if not excess.any():
            return phi
        loads = source.interpolation.T @ (source.weights[:, None] * np.stack([np.ones_like(excess), excess], axis=1))
        mean = np.zeros_like(phi)
        assert self.diffusing is not None
        for values, _ in self.diffusing.solve_heat(source.time, loads):
            reached = values[:, 0] > 0
            mean[reached] = values[reached, 1] / values[reached, 0]
        return phi - mean


@dataclass(frozen=True, eq=False)
class MaskedSource(GridSource):
    """Sources lowered to the free nodes of a grid: of their samples those with a free node around them.

    Attributes
    ----------
    rows : (s, n) sparse
        Interpolate at the samples, from the free ones among the nodes around each.
    near_wall : (s,) bool
        Samples with a solid node within a cell or two: a source that ends there ends at a wall.
    """

    rows: sparse.csr_matrix
    near_wall: NDArray[np.bool_]

    @classmethod
    def of(cls, whole: GridSource, nodes: FreeNodes) -> MaskedSource:
        """Lower sources to free nodes; what lies on solid ones, but for rounding, is lost."""
        ids, weights = whole.stencil
        numbers = nodes.numbers[ids]
        weights = np.where((numbers >= 0) & (weights > SNAP), weights, 0.0)
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
        near_walls = scipy.ndimage.binary_dilation(nodes.grid.mask).ravel()
        near_wall = near_walls[ids[kept]].any(axis=1)
        return cls(whole.samples.chosen(kept), whole.grid, whole.diffusion, rows, near_wall)

    @property
    def interpolation(self) -> sparse.csr_matrix:
        return self.rows

    @cached_property
    def vectors(self) -> Any:
        """(n, d + 1) X₀, and in the last column the scalar source: areas without their normals."""
        return self.interpolation.T @ np.concatenate([self.samples.vectors, self.weights[:, None]], axis=1)


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
    def solid(self) -> NDArray[np.bool_]:
        """(n_nodes,) which nodes of the grid are solid."""
        assert self.grid.mask is not None
        return self.grid.mask.ravel()

    @cached_property
    def ids(self) -> NDArray[np.int64]:
        """(n,) index of each free node among all nodes of the grid."""
        return np.flatnonzero(~self.solid)

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
        result: NDArray[np.float64] = directions.copy()
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
        return lines_are_clear(self.indices, targets, self.solid, counts, strides)
