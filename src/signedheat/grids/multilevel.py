"""Diffusion from sources on a grid, on a hierarchy of coarser grids.

Each level is solved by line Gauss–Seidel sweeps: ``(1 − tΔ) X = B``, with accurate directions however small X becomes.
The matrix has no positive off-diagonal entry, so neither the elimination within a line nor the sweeps subtract: X
decays over many decades and keeps its relative accuracy. Lines along the last axis are solved exactly; along all other
axes lines are updated in order, in every combination of directions.

X falls by a factor of e over the length √t. Farther than a few √t from the source its direction varies slowly, and a
grid of twice the spacing, with the diffusion time of its own spacing (``t = τ max(h, h_source)²``, as on the finest
grid), continues it at an eighth of the cost in space. So every level is swept only within `BAND` of its sources, and
the coarsest level everywhere.

A coarser level starts from the values that the finer one found within its band: the directions of X, with lengths
raised to the power that converts the decay rate of the finer level into its own, so that a path from the source to a
node has the same weight wherever it leaves the band. If a level is skipped, its sources are restricted to the next by
the transpose of linear interpolation. This keeps sums and first moments, so that the two sides of a sheet thinner than
a coarse cell do not cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..memory import untouched_zeros
from ..parallel import n_threads
from .node_sources import STRETCH, NodeSources
from .stencil import FEW_NODES, by_slabs, slab

BAND = 14.0
"""Half width, in √t, of the band around the source in which a level is swept."""
RIM_WIDTH = 3
"""Width, in nodes, of the outer part of the band whose values are replaced by those of the coarser level."""
SMALL_BAND = 0.125
"""A band of less than this share of the grid, without values of a finer level, is swept twice as often, which costs
little."""
COARSEST_NODES = 32
"""Grids with at most this number of nodes along every axis are not coarsened."""
UNHALVED_NODES = 4
"""Axes with at most this number of nodes are not halved."""
COARSEST_ROUNDS = 12
"""Number of rounds of sweeps on the coarsest grid, where paths from the source are longer, and sweeps are cheap."""


@dataclass(frozen=True, eq=False)
class Level:
    """The diffused vectors on one grid of the hierarchy."""

    vectors: NDArray[np.float32] | None  # (l₀, l₁, l₂, n, 4) X within the band; None if skipped
    inside: Bools | None  # (l₀, l₁, l₂, stretches) where these values are used, and not those of the coarser level
    factors: Ints  # (4,) cells of this grid per cell of the next coarser one: see `coarsening`


Held = tuple[NDArray[np.float32], Bools]
"""(l₀, l₁, l₂, n, 4) X on a level, from a finer one, and (l₀, l₁, l₂, stretches) where it is known and not swept."""


def diffuse_multilevel(
    sources: NodeSources, time: Callable[[float], float], finest: int = 0, rounds: int = 2
) -> list[Level]:
    """Solve ``(1 − tΔ) X = B``, Eq. 12, on all levels, the finest first; the first `finest` levels are skipped.

    `time` returns t for a mean spacing. A coarser level takes over values of the finer one inside of its band, holds
    them as boundary values, and has no sources of its own. Each level is swept in all combinations of directions:
    `rounds` times, twice as often if it has such values, and `COARSEST_ROUNDS` times if it is the coarsest.
    """
    levels: list[Level] = []
    held = None
    while True:
        factors = coarsening(sources.shape, sources.steps)
        last = not (factors > 1).any()
        if len(levels) >= finest or last:
            often = COARSEST_ROUNDS if last else rounds if held is None else 2 * rounds
            levels.append(_diffuse_level(sources, held, time, factors, often, last))
        else:
            levels.append(Level(None, None, factors))
        if last:
            return levels
        shape, steps = _coarser(sources.shape, sources.steps)
        held = None
        if levels[-1].vectors is not None:
            power = np.sqrt(time(_mean_step(sources.steps)) / time(_mean_step(steps)))
            held = _carried(levels[-1], shape, power)
        sources = sources.restricted(factors, shape, steps) if held is None else NodeSources.empty(shape, steps)


def coarsening(shape: tuple[int, ...], steps: Floats) -> Ints:
    """(4,) numbers of cells of a grid per cell of the next coarser one, 1 along axes that are not coarsened.

    The grid has four axes, with the spacings `steps`, (4,). Axes that are no longer than the spacing along others are
    reduced to one node.
    """
    counts = np.array(shape)
    factors = np.ones(4, dtype=np.int64)
    wide = counts > UNHALVED_NODES
    if counts.max() > COARSEST_NODES:
        least = steps[wide].min()
        factors[wide & (steps < 1.5 * least)] = 2
        short = (counts > 1) & ~wide & ((counts - 1) * steps <= least)
        factors[short] = counts[short] + 1
    return factors


def skip_finest(shape: tuple[int, ...], steps: Floats, finest: int) -> tuple[list[Level], tuple[int, ...], Floats]:
    """Return the first `finest` levels of the hierarchy, without vectors, and the next grid's shape and (4,) steps."""
    levels: list[Level] = []
    while len(levels) < finest and ((factors := coarsening(shape, steps)) > 1).any():
        levels.append(Level(None, None, factors))
        shape, steps = _coarser(shape, steps)
    return levels, shape, steps


def _diffuse_level(
    sources: NodeSources, held: Held | None, time: Callable[[float], float], factors: Ints, rounds: int, last: bool
) -> Level:
    """Solve on one level, within the band around its sources or known values, or everywhere if it is the last.

    `factors` are those of `coarsening`, and `rounds` of `diffuse_multilevel`.
    """
    t = time(_mean_step(sources.steps))
    is_long = sources.steps > 0
    ratios = np.where(is_long, t / np.where(is_long, sources.steps, 1) ** 2, 0.0)
    given_vectors, known = (None, None) if held is None else held
    start = sources.places >= 0 if known is None else known
    if last:
        active = inside = np.ones_like(start)
    else:
        width = np.ceil(BAND * np.sqrt(ratios)).astype(int)
        active = _dilated(start, width)
        inside = _dilated(start, np.maximum(width - RIM_WIDTH, 0))
    if known is not None:
        active = active & ~known
    elif not last and active.mean() < SMALL_BAND:
        rounds *= 2
    vectors = diffuse_by_sweeps(sources, active, ratios, rounds, given_vectors)
    return Level(vectors, inside, factors)


def _mean_step(steps: Floats) -> float:
    """Return the mean spacing over the axes that have more than one node."""
    return float(steps[steps > 0].mean())


def _dilated(mask: Bools, width: Ints) -> Bools:
    """Dilate a mask of stretches, (l₀, l₁, l₂, stretches), by a box of half `width`, (4,), in nodes."""
    grown = mask.astype(np.uint8)
    for axis, reach in enumerate((*width[:3], -(-int(width[3]) // STRETCH))):
        size = 2 * min(int(reach), mask.shape[axis]) + 1
        grown = scipy.ndimage.maximum_filter1d(grown, size, axis, mode="constant")
    return grown.astype(np.bool_)


def _coarser(shape: tuple[int, ...], steps: Floats) -> tuple[tuple[int, ...], Floats]:
    """Return the shape and the (4,) spacing of the next coarser grid; spacing is 0 along axes of one node."""
    factors = coarsening(shape, steps)
    coarse = _coarse_shape(shape, factors)
    return coarse, np.where(np.array(coarse) > 1, steps * factors, 0.0)


def _coarse_shape(shape: tuple[int, ...], factors: Ints) -> tuple[int, ...]:
    """Return the number of nodes along each axis of the next coarser grid."""
    return tuple(n if f == 1 else n // 2 + 1 if f == 2 else 1 for n, f in zip(shape, factors.tolist(), strict=True))


def _carried(level: Level, shape: tuple[int, ...], power: float) -> Held | None:
    """Return the values of a level at the nodes of the next coarser one, and where stretches are complete, or None.

    Lengths are raised to `power`.
    """
    assert level.vectors is not None and level.inside is not None
    vectors = untouched_zeros((*shape, 4), np.float32)
    counts = np.zeros((*shape[:3], -(-shape[3] // STRETCH)), dtype=np.int64)
    _carry(level.vectors, level.inside, level.factors, np.float32(power), vectors, counts)
    full = np.full(counts.shape[3], STRETCH)
    full[-1] = shape[3] - STRETCH * (len(full) - 1)
    where = counts >= full
    return (vectors, where) if where.any() else None


def collapse(
    levels: list[Level], shape: tuple[int, ...], components: int, extract: Callable[..., None]
) -> NDArray[np.float32]:
    """Return (components, *shape) values on the finest grid, from the finest level that is used at each node.

    ``extract(vectors, inside, out, axis, start, stop)`` computes them from X in a slab of a level, see `unit_vectors`.
    Between the nodes of coarser levels they are interpolated.
    """
    shapes = [tuple(shape)]
    for level in levels[:-1]:
        shapes.append(_coarse_shape(shapes[-1], level.factors))
    result: NDArray[np.float32] = np.empty((components, 1, 1, 1, 1), dtype=np.float32)
    for depth in range(len(levels) - 1, -1, -1):
        level = levels[depth]
        fine_shape = shapes[depth]
        coarsest = depth == len(levels) - 1
        out = (np.zeros if coarsest else np.empty)((components, *fine_shape), dtype=np.float32)
        if not coarsest:
            by_slabs(fine_shape, _interpolate, result, level.factors, out)
        if level.vectors is not None:
            by_slabs(fine_shape, extract, level.vectors, level.inside, out)
        result = out
    return result


LEAST_KNOWN = np.float32(1e-34)
"""Vectors smaller than this count as unknown, and are replaced by those of a coarser level."""


@compiled
def _carry(
    vectors: NDArray[np.float32],
    inside: Bools,
    factors: Ints,
    power: np.float32,
    coarse: NDArray[np.float32],
    counts: NDArray[np.integer],
) -> None:
    """Copy vectors at nodes that the coarse grid shares to `coarse`, with lengths raised to a power.

    `vectors` are (a, b, c, d, 4), known in the stretches of lines along the last axis where `inside` is true, and
    `coarse` has a node for every `factors`, (4,), nodes of these. The number of nodes known in each stretch of the
    coarse grid is added to `counts`. Lengths are largest components.
    """
    n0, n1, n2, n3 = vectors.shape[:4]
    # odd nodes are left out along axes that were halved
    for i in range(0, n0, 2 if factors[0] == 2 else 1):
        for j in range(0, n1, 2 if factors[1] == 2 else 1):
            for k in range(0, n2, 2 if factors[2] == 2 else 1):
                coarse_i, coarse_j, coarse_k = i // factors[0], j // factors[1], k // factors[2]
                for stretch in range(inside.shape[3]):
                    if not inside[i, j, k, stretch]:
                        continue
                    for m in range(STRETCH * stretch, min(STRETCH * (stretch + 1), n3)):
                        vector, coarse_m = vectors[i, j, k, m], m // factors[3]
                        size = max(max(abs(vector[0]), abs(vector[1])), max(abs(vector[2]), abs(vector[3])))
                        if (m % 2 and factors[3] == 2) or size < LEAST_KNOWN:
                            continue
                        scale = size ** (power - np.float32(1))
                        for component in range(4):
                            coarse[coarse_i, coarse_j, coarse_k, coarse_m, component] = scale * vector[component]
                        counts[coarse_i, coarse_j, coarse_k, coarse_m // STRETCH] += 1


@compiled
def _interpolate(
    coarse: NDArray[np.float32], factors: Ints, out: NDArray[np.float32], axis: int, start: int, stop: int
) -> None:
    """Interpolate values of a coarser grid, (q, a, b, c, d), to the nodes of a slab of `out`, the finer grid.

    The slab has the nodes `start` to `stop` along an axis, 0 or 1. `factors`, (4,), are the spacings of the coarser
    grid, relative to the finer. It is linear along axes that were halved, and constant along those that were reduced to
    one node.
    """
    _, n0, n1, n2, n = out.shape
    mean = np.empty(coarse.shape[4], dtype=np.float32)
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        coarse_i = i // factors[0]
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            coarse_j = j // factors[1]
            for k in range(n2):
                coarse_k = k // factors[2]
                n_i = 1 + (1 if factors[0] == 2 and i % 2 else 0)
                n_j = 1 + (1 if factors[1] == 2 and j % 2 else 0)
                n_k = 1 + (1 if factors[2] == 2 and k % 2 else 0)
                share = np.float32(1.0 / (n_i * n_j * n_k))
                # the mean of the one to eight coarse lines around this line, and then interpolation along it
                for component in range(out.shape[0]):
                    for m in range(mean.shape[0]):
                        mean[m] = np.float32(0)
                    for x in range(n_i):
                        for y in range(n_j):
                            for z in range(n_k):
                                line = coarse[component, coarse_i + x, coarse_j + y, coarse_k + z]
                                for m in range(mean.shape[0]):
                                    mean[m] += share * line[m]
                    into = out[component, i, j, k]
                    if factors[3] != 2:
                        for m in range(n):
                            into[m] = mean[m // factors[3]]
                    else:
                        for m in range((n + 1) // 2):
                            into[2 * m] = mean[m]
                        for m in range(n // 2):
                            into[2 * m + 1] = np.float32(0.5) * (mean[m] + mean[m + 1])


def unit_vectors(
    vectors: NDArray[np.float32], inside: Bools, out: NDArray[np.float32], axis: int, start: int, stop: int
) -> None:
    """Write the vectors of a slab, scaled to length 1, to `out`; where they have underflowed, it keeps its values.

    Those are of a coarser level. `vectors` are (a, b, c, n, 4), known in the stretches of lines where `inside` is true,
    and `out` is (d, a, b, c, n). The slab has the nodes `start` to `stop` along an axis.
    """
    window = slab(axis, start, stop)
    components = np.moveaxis(vectors[window], -1, 0)
    sizes = np.abs(components[0])
    for component in components[1:]:
        np.maximum(sizes, np.abs(component), out=sizes)
    known = _nodes_of(inside[window], sizes.shape[3]) & (sizes >= LEAST_KNOWN)
    factors = np.float32(1) / np.where(known, sizes, np.float32(1))  # without these, squares would underflow
    squares = sum((factors * component) ** 2 for component in components[: len(out)])
    factors /= np.sqrt(np.where(known, squares, np.float32(1)))
    for component, into in zip(components, out, strict=False):
        np.copyto(into[window], factors * component, where=known)


def quotients(
    vectors: NDArray[np.float32], inside: Bools, out: NDArray[np.float32], axis: int, start: int, stop: int
) -> None:
    """Write weighted means, second components (weight · value) over first ones (weight), to ``out[0]`` in a slab.

    Where the weight has underflowed, `out`, (1, a, b, c, n), keeps its values. The arguments are those of
    `unit_vectors`.
    """
    window = slab(axis, start, stop)
    first, second = vectors[window][..., 0], vectors[window][..., 1]
    known = _nodes_of(inside[window], first.shape[3]) & (first > LEAST_KNOWN)
    np.divide(second, first, out=out[0][window], where=known)


def _nodes_of(stretches: Bools, n: int) -> Bools:
    """(…, n) values of the nodes along lines, from those of their stretches, (…, stretches)."""
    return np.repeat(stretches, STRETCH, axis=3)[..., :n]


def diffuse_by_sweeps(
    sources: NodeSources, active: Bools, ratios: Floats, rounds: int, given: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Solve ``(1 + Σ_axes a · neighbours) X_i = B_i + Σ_axes a Σ X_j``, Eq. 12, in `active` stretches, a = t / h².

    Return (l₀, l₁, l₂, n, 4) X. Elsewhere it is as in `given`, which is overwritten, and by default zero, in memory
    that is never touched. `ratios` are the (4,) values of a.
    """
    shape = sources.shape
    vectors = untouched_zeros((*shape, 4), np.float32) if given is None else given
    ratios = np.minimum(ratios, 1e30)
    lines = shape[0] * shape[1] * shape[2]
    by_line = vectors.reshape(lines, 4 * shape[3]), sources.sums.reshape(-1, 4 * STRETCH)
    stretches = sources.places.reshape(lines, -1), active.reshape(lines, -1)
    grid = np.array(shape), ratios.astype(np.float32), line_pivots(shape, ratios)
    sweep_lines(_sweep_tiles, shape, rounds, *by_line, *stretches, *grid)
    return vectors


def sweep_lines(kernel: Callable[..., None], shape: tuple[int, ...], rounds: int, *arguments: Any) -> None:
    """Run ``kernel(*arguments, tiles)`` over all lines of a grid, in all combinations of directions, `rounds` times.

    Tiles on a diagonal are independent of each other, and run in threads.
    """
    ways = [(1, -1) if n > 1 else (1,) for n in shape[:3]]
    threads = 1 if np.prod(shape) < FEW_NODES else n_threads()
    size = [
        -(-n // parts) for n, parts in zip(shape[1:3], (threads, 4 * threads) if threads > 1 else (1, 1), strict=True)
    ]
    with ThreadPoolExecutor(max(1, threads - 1)) as others:
        for direction in list(product(*ways)) * rounds:
            for plane in range(shape[0])[:: direction[0]]:
                for wave in wavefronts(shape[1:3], size, direction[1:]):
                    tiles = np.array([[plane, plane + direction[0], direction[0], *tile] for tile in wave])
                    jobs = [others.submit(kernel, *arguments, tiles[k::threads]) for k in range(1, threads)]
                    kernel(*arguments, tiles[::threads])
                    for job in jobs:
                        job.result()


def wavefronts(shape: tuple[int, ...], size: list[int], direction: tuple[int, ...]) -> list[list[list[int]]]:
    """Divide a plane of lines into tiles of `size`, in groups whose tiles can run at the same time, in order.

    A tile is a list of start, stop and step along both axes; `direction` is 1 or −1 along each.
    """
    starts = [range(0, n, s)[::step] for n, s, step in zip(shape, size, direction, strict=True)]
    waves: list[list[list[int]]] = [[] for _ in range(len(starts[0]) + len(starts[1]) - 1)]
    for a, first in enumerate(starts[0]):
        for b, second in enumerate(starts[1]):
            tile = []
            for start, n, s, step in zip((first, second), shape, size, direction, strict=True):
                stop = min(start + s, n)
                tile += [start, stop, 1] if step > 0 else [stop - 1, start - 1, -1]
            waves[a + b].append(tile)
    return waves


def line_pivots(shape: tuple[int, ...], ratios: Floats) -> NDArray[np.float32]:
    """(8, n) reciprocal pivots of the tridiagonal matrices of lines along the last axis.

    Bit k of the row is set for lines at a wall of axis k. `ratios` are (4,) values of t / h².
    """
    n = shape[3]
    along = np.full(n, 2.0)  # numbers of neighbours
    along[0] = along[-1] = 1.0
    table = np.empty((8, n))
    for walls in range(8):
        across = sum(ratios[k] * (2 - (walls >> k & 1)) for k in range(3) if shape[k] > 1)
        previous = 0.0
        for k in range(n):
            previous = 1.0 / (1.0 + across + ratios[3] * along[k] - ratios[3] ** 2 * previous)
            table[walls, k] = previous
    return table.astype(np.float32)


@compiled
def _sweep_tiles(
    vectors: NDArray[np.float32],
    sums: NDArray[np.float32],
    places: NDArray[np.int32],
    active: Bools,
    shape: tuple[int, int, int, int],
    ratios: tuple[np.float32, np.float32, np.float32, np.float32],
    pivots: NDArray[np.float32],
    tiles: Ints,
) -> None:
    """Solve for the vectors on the lines of tiles, one line after the other, given those on neighbouring lines.

    Lines run along the last of the four axes, with n nodes in stretches of `STRETCH`. `vectors`, (lines, 4 n), are X,
    which is solved for in stretches that are `active`, (lines, stretches). `places`, (lines, stretches), are the row of
    the source vectors of each stretch in `sums`, (r, 4 · `STRETCH`), or −1. `ratios` are a along the four axes,
    `pivots` those of `line_pivots`, and rows of `tiles`, (t, 9), start, stop and step along the first three axes.

    Active stretches that follow each other on a line are a tridiagonal system, which is solved by the Thomas algorithm
    for all four components at once. Slices of lines help the compiler to vectorise.
    """
    n0, n1, n2, n = shape
    ratio0, ratio1, ratio2, along = ratios
    scratch = np.empty(4 * n, dtype=np.float32)
    beyond = np.zeros(4 * n, dtype=np.float32)  # neighbours beyond the walls
    stretches = active.shape[1]
    for tile in tiles:
        for i in range(tile[0], tile[1], tile[2]):
            for j in range(tile[3], tile[4], tile[5]):
                for k in range(tile[6], tile[7], tile[8]):
                    line_id = (i * n1 + j) * n2 + k
                    walls = (i == 0 or i == n0 - 1) + 2 * (j == 0 or j == n1 - 1) + 4 * (k == 0 or k == n2 - 1)
                    end_stretch = 0
                    while end_stretch < stretches:
                        if not active[line_id, end_stretch]:
                            end_stretch += 1
                            continue
                        first_stretch = end_stretch
                        while end_stretch < stretches and active[line_id, end_stretch]:
                            end_stretch += 1
                        begin, end = first_stretch * STRETCH, min(end_stretch * STRETCH, n)
                        window = slice(4 * begin, 4 * end)
                        values, line = scratch[: 4 * (end - begin)], vectors[line_id, window]
                        pivots_here = pivots[walls, begin:end]
                        # right side: the neighbouring lines, the source, and fixed values on the line itself
                        before_j = vectors[line_id - n2, window] if j > 0 else beyond[window]
                        after_j = vectors[line_id + n2, window] if j < n1 - 1 else beyond[window]
                        before_k = vectors[line_id - 1, window] if k > 0 else beyond[window]
                        after_k = vectors[line_id + 1, window] if k < n2 - 1 else beyond[window]
                        for m in range(len(values)):
                            values[m] = ratio1 * (before_j[m] + after_j[m]) + ratio2 * (before_k[m] + after_k[m])
                        if n0 > 1:
                            before_i = vectors[line_id - n1 * n2, window] if i > 0 else beyond[window]
                            after_i = vectors[line_id + n1 * n2, window] if i < n0 - 1 else beyond[window]
                            for m in range(len(values)):
                                values[m] += ratio0 * (before_i[m] + after_i[m])
                        for stretch in range(first_stretch, end_stretch):
                            row = places[line_id, stretch]
                            if row >= 0:
                                into = values[4 * STRETCH * (stretch - first_stretch) :]
                                for m in range(min(len(into), 4 * STRETCH)):
                                    into[m] += sums[row, m]
                        x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                        if begin > 0:  # the previous node has been eliminated: its value is x + q · (value here)
                            previous = vectors[line_id, 4 * begin - 4 : 4 * begin]
                            q = along * pivots[walls, begin - 1]
                            x, y = previous[0] - q * line[0], previous[1] - q * line[1]
                            z, w = previous[2] - q * line[2], previous[3] - q * line[3]
                        if end < n:
                            for c in range(4):
                                values[4 * (end - begin) - 4 + c] += along * vectors[line_id, 4 * end + c]
                        # forward elimination, which leaves the values of each node without those after it
                        for m in range(end - begin):
                            pivot = pivots_here[m]
                            q = along * pivot
                            x = pivot * values[4 * m] + q * x
                            y = pivot * values[4 * m + 1] + q * y
                            z = pivot * values[4 * m + 2] + q * z
                            w = pivot * values[4 * m + 3] + q * w
                            values[4 * m] = x
                            values[4 * m + 1] = y
                            values[4 * m + 2] = z
                            values[4 * m + 3] = w
                        # back substitution
                        x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                        for back in range(end - begin):
                            m = end - begin - 1 - back
                            q = along * pivots_here[m]
                            x = values[4 * m] + q * x
                            y = values[4 * m + 1] + q * y
                            z = values[4 * m + 2] + q * z
                            w = values[4 * m + 3] + q * w
                            line[4 * m] = x
                            line[4 * m + 1] = y
                            line[4 * m + 2] = z
                            line[4 * m + 3] = w
