"""Laplacian of a regular grid, matrix free: divergence of node vectors, and the inverse by cosine transforms.

Everything is second order, in any dimension. For kernels on four axes, axes of one node are put in front of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..jobs import interruptible
from ..parallel import in_threads, n_threads

FEW_NODES = 100_000
"""Grids with fewer nodes than this are processed by one thread."""
SLAB = 4
"""Number of layers of nodes that a thread processes at a time. With 16 the memory of 128³ nodes is a tenth larger."""


def padded_shape(shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Return a shape with four axes: the given one, preceded by axes of one node."""
    return (1,) * (4 - len(shape)) + tuple(shape)  # type: ignore[return-value]


def divergence(directions: NDArray[np.floating], spacing: Floats) -> Floats:
    """Return −∇·Y, b of Eq. 13, for (*shape, d) directions Y at nodes.

    The flux between two nodes is the mean of Y at both, and zero through the walls of the grid.
    """
    shape = directions.shape[:-1]
    components = np.moveaxis(directions, -1, 0).reshape(-1, *padded_shape(shape))
    out = np.empty(padded_shape(shape))
    by_slabs(out.shape, _divergence, components, 0.5 / spacing, out)
    return out.reshape(shape)


def laplacian(values: Floats, spacing: Floats) -> Floats:
    """Return C φ (Eq. 10), the positive semidefinite Laplacian of values at the nodes of a grid.

    It takes 2d + 1 nodes in d dimensions, and there is no flux through the walls.
    """
    result = np.zeros_like(values)
    for axis, h in enumerate(spacing):
        rise = np.diff(values, axis=axis) / h**2
        ahead, behind = [slice(None)] * values.ndim, [slice(None)] * values.ndim
        behind[axis], ahead[axis] = slice(None, -1), slice(1, None)
        result[tuple(behind)] -= rise
        result[tuple(ahead)] += rise
    return result


def solve_poisson(right_hand_side: Floats, spacing: Floats, overwrite: bool = False) -> Floats:
    """Return φ of mean zero at the nodes with ``C φ = b`` (Eq. 13), by the cosine transform, which diagonalises C.

    `right_hand_side` is b; with `overwrite`, its memory may be used.
    """
    workers = n_threads()
    transformed = interruptible(scipy.fft.dctn, right_hand_side, type=2, overwrite_x=overwrite, workers=workers)
    eigenvalues = [
        (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) / h**2
        for n, h in zip(right_hand_side.shape, spacing, strict=True)
    ]
    padded = padded_shape(transformed.shape)
    eigenvalues = [np.zeros(1)] * (4 - len(eigenvalues)) + eigenvalues
    by_slabs(padded, _divide, eigenvalues, transformed.reshape(padded))
    return interruptible(scipy.fft.idctn, transformed, type=2, overwrite_x=True, workers=workers)


def interpolation_stencil(positions: Floats, shape: tuple[int, ...]) -> tuple[Ints, Floats]:
    """(s, 2^k) nodes, numbered in C order, and weights of multilinear interpolation at (s, d) positions in cells.

    k is the number of axes with more than one node.
    """
    positions = np.clip(positions, 0, np.array(shape) - 1)  # rounding may put one outside
    cell = np.minimum(positions.astype(np.int64), np.array(shape) - 2)
    part = positions - cell
    nodes = np.zeros((len(positions), 1), dtype=np.int64)
    weights = np.ones((len(positions), 1))
    for axis, n in enumerate(shape):
        if n == 1:
            continue
        below = nodes * n + cell[:, axis, None]
        nodes = np.concatenate([below, below + 1], axis=1)
        f = part[:, axis, None]
        weights = np.concatenate([weights * (1 - f), weights * f], axis=1)
    return nodes, weights


def by_slabs(shape: tuple[int, ...], kernel: Callable[..., None], *arguments: Any) -> None:
    """Call ``kernel(*arguments, axis, start, stop)`` for slabs of a grid with four axes, in threads if it is large.

    A slab has the nodes from `start` to `stop` along `axis`.
    """
    axis = 0 if shape[0] > 1 else 1  # in the plane both axes have one node: its grids are one slab
    n = shape[axis]
    if np.prod(shape) < FEW_NODES:
        kernel(*arguments, axis, 0, n)
        return
    list(in_threads(lambda start: kernel(*arguments, axis, start, min(start + SLAB, n)), range(0, n, SLAB)))


def slab(axis: int, start: int, stop: int) -> tuple[slice, ...]:
    """Return the index of a slab in arrays with four axes: nodes from `start` to `stop` along `axis`."""
    return tuple(slice(start, stop) if axis == k else slice(None) for k in range(4))


def _divide(eigenvalues: list[Floats], transformed: Floats, axis: int, start: int, stop: int) -> None:
    """Divide a slab by the eigenvalues of C, in place; the quotient is zero where they are zero.

    They are sums of the one-dimensional eigenvalues along the four axes.
    """
    window = slab(axis, start, stop)
    total = np.zeros(())
    for values in np.ix_(*(values[part] for values, part in zip(eigenvalues, window, strict=True))):
        total = total + values
    total[total == 0.0] = np.inf
    transformed[window] /= total


def _divergence(
    components: NDArray[np.floating], scales: Floats, out: Floats, axis: int, start: int, stop: int
) -> None:
    """Write −∇·Y in a slab of `out`; `scales` are 1 / (2 h) along each axis of the grid.

    `components` are (d, *out.shape), those of Y. At a node that is at no wall, fluxes add up to a central difference.
    """
    low, high = max(start - 1, 0), min(stop + 1, out.shape[axis])  # with a layer of neighbours on both sides
    around = np.moveaxis(np.moveaxis(components, axis + 1, 0)[low:high], 0, axis + 1)
    sums = np.zeros(around.shape[1:])
    for component, scale, along in zip(around, scales, range(4 - len(scales), 4), strict=True):
        flow, lines = np.moveaxis(component, along, 0), np.moveaxis(sums, along, 0)
        lines[0] -= scale * (flow[0] + flow[1])
        lines[1:-1] += np.multiply(flow[:-2] - flow[2:], scale, dtype=np.float64)
        lines[-1] += scale * (flow[-2] + flow[-1])
    out[slab(axis, start, stop)] = sums[slab(axis, start - low, stop - low)]
