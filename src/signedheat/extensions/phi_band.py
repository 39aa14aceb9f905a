"""The method's own φ in a band: all three steps on fine nodes near the sources, around a coarse solution.

Vectors are diffused among the nodes of the band; where none arrives, in the middle of large holes, they are the
gradients of the coarse φ. Poisson's equation has natural conditions at the rim of the band. Each connected part of it
gets the constant for which φ vanishes at its samples in the mean; that of the coarse field where it has none.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..constraints import Free
from ..domains.grid import Grid
from ..domains.kinds import Shapes
from ..domains.validation import positive_number
from ..errors import GeometryError, UnsupportedTypeError
from ..extrapolation import Diffusion
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..lowering.area_elements import AreaSamples, sample_on_grid
from ..lowering.grid.discretization import SAMPLE_SIZE
from ..operators.grid.block_method import BlockSources, SomeNodes
from ..operators.grid.blocks import SIDE, Blocks
from ..progress import Progress, within
from ..solver import SignedHeatSolver, as_list, band_of_phi
from .band_grids import LEAST, coarse_grid

COARSE = 0.6
"""Share of the progress that the coarse solution is."""


@band_of_phi.provide
def phi_in_band(
    source: Shapes, grid: Grid, band: float, diffusion: Diffusion | None, progress: Progress | None = None
) -> BandField:
    """`signed_distance` in a band; see there."""
    if grid.dimension != 3 or grid.mask is not None:
        raise UnsupportedTypeError("a band lies on a grid in space without walls", remedy="leave out the band")
    width = max(positive_number(band, "band"), LEAST * float(grid.spacing.max()))
    tau = 1.0 if diffusion is None else positive_number(diffusion, "diffusion")
    solver = SignedHeatSolver(coarse_grid(grid), tau, within(progress, 0.0, COARSE))
    coarse = solver.distance(source, Free())
    samples = sample_on_grid(as_list(source), grid, SAMPLE_SIZE)
    coarse = coarse.with_values(coarse.values - _mean_height(coarse, grid, samples))
    blocks = _blocks_near(coarse, grid, samples.positions, width)
    nodes = SomeNodes.of_blocks(blocks)
    rounds = int(np.ceil((width / float(grid.spacing.min())) + 2 * SIDE))
    sources = BlockSources(nodes, samples.positions, samples.vectors, grid.spacing, tau, rounds)
    directions, arrived = sources.directions()
    points = grid.origin + nodes.nodes * grid.spacing
    rest = np.flatnonzero(~arrived)
    if len(rest):
        slopes = coarse.gradient(points[rest])
        lengths = np.linalg.norm(slopes, axis=1, keepdims=True)
        directions[rest] = slopes / np.where(lengths > 0, lengths, 1.0)
    start = coarse(points)
    phi = nodes.integrate(directions, grid.spacing, start)
    phi -= _constants(nodes, phi, start, sources)
    if progress is not None:
        progress(1.0, "band")
    values = nodes.in_blocks(phi).astype(np.float32)
    return BandField(grid, blocks, values, coarse, width, coarse.diagnostics)


def _mean_height(coarse: GridField, grid: Grid, samples: AreaSamples) -> float:
    """Of the coarse φ at the samples, by area."""
    weights = np.linalg.norm(samples.vectors, axis=1)
    heights = coarse(grid.origin + samples.positions * grid.spacing)
    return float(weights @ heights / weights.sum())


def _blocks_near(coarse: GridField, grid: Grid, positions: NDArray[np.float64], width: float) -> Blocks:
    """Blocks with nodes that may be within the band: around samples, and around the coarse zero set."""
    limit = -(-np.array(grid.shape) // SIDE)
    reach = width + float(np.linalg.norm(grid.spacing))
    radius = 0.5 * float(np.linalg.norm((SIDE - 1) * grid.spacing))
    places = np.argwhere(np.ones(tuple(limit), dtype=bool)).astype(np.int32)
    near = np.zeros(len(places), dtype=bool)
    tree = scipy.spatial.cKDTree(positions * grid.spacing)
    centres = (places * SIDE + 0.5 * (SIDE - 1)) * grid.spacing
    inside = np.minimum(grid.origin + centres, grid.upper)
    near |= np.abs(coarse(inside)) <= reach + radius + float(coarse.grid.spacing.max())
    rest = np.flatnonzero(~near)
    near[rest] = tree.query(centres[rest], distance_upper_bound=reach + radius)[0] <= reach + radius
    if not near.any():
        raise GeometryError("no node lies in the band", remedy="widen it, or move the grid to the shape")
    return Blocks.of(places[near], grid.shape)


def _constants(
    nodes: SomeNodes, phi: NDArray[np.float64], start: NDArray[np.float64], sources: BlockSources
) -> NDArray[np.float64]:
    """(n,) by how much φ is off: in the mean at the samples of each connected part, else as it is from the start."""
    there = nodes.neighbors >= 0
    rows = np.broadcast_to(np.arange(len(phi))[:, None], there.shape)[there]
    links = scipy.sparse.coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, nodes.neighbors[there])))
    links.resize(len(phi), len(phi))
    count, part = scipy.sparse.csgraph.connected_components(links, directed=False)
    weights, sums = sources.heights(phi)
    weight = np.bincount(part, weights=weights, minlength=count)
    total = np.bincount(part, weights=sums, minlength=count)
    change = np.bincount(part, weights=phi - start, minlength=count) / np.bincount(part, minlength=count)
    result: NDArray[np.float64] = np.where(weight > 0, total / np.where(weight > 0, weight, 1.0), change)[part]
    return result
