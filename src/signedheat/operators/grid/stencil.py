"""Laplacian of a regular grid, matrix free: divergence of node vectors, and the inverse by cosine transforms.

Everything is second order, in any dimension. For kernels on four axes, axes of one node are put in front of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...compiled import compiled
from ...parallel import n_threads
from .wavefront import SMALL, padded_shape

SLAB = 16
"""Rows of grid lines in one job of a thread."""


def divergence(directions: NDArray[np.floating], spacing: NDArray[np.float64]) -> NDArray[np.float64]:
    """(*shape) −∇·Y, which is b of Eq. 13. The flux between two nodes is the mean of theirs, that through walls zero.

    Examples
    --------
    >>> divergence(np.array([[1.0], [1.0], [1.0]]), np.array([0.5]))
    array([-2.,  0.,  2.])
    """
    shape = directions.shape[:-1]
    padded = padded_shape(shape)
    components = np.ascontiguousarray(np.moveaxis(directions, -1, 0)).reshape(-1, *padded)
    out = np.empty(padded)
    by_slabs(padded, _divergence, components, 0.5 / spacing, out)
    return out.reshape(shape)


def laplacian(values: NDArray[np.float64], spacing: NDArray[np.float64]) -> NDArray[np.float64]:
    """C φ, Eq. 10 on a grid: the positive semidefinite Laplacian of 2d + 1 points, with no flux through the walls."""
    result = np.zeros_like(values)
    for axis, h in enumerate(spacing):
        rise = np.diff(values, axis=axis) / h**2
        ahead, behind = [slice(None)] * values.ndim, [slice(None)] * values.ndim
        behind[axis], ahead[axis] = slice(None, -1), slice(1, None)
        result[tuple(behind)] -= rise
        result[tuple(ahead)] += rise
    return result


def solve_poisson(
    right_hand_side: NDArray[np.float64], spacing: NDArray[np.float64], overwrite: bool = False
) -> NDArray[np.float64]:
    """φ of mean zero with ``C φ = b`` (Eq. 13), by the cosine transform that diagonalises C.

    Examples
    --------
    >>> phi = np.array([[1.0, -2.0], [4.0, -3.0]])
    >>> h = np.array([0.5, 1.0])
    >>> np.allclose(solve_poisson(laplacian(phi, h), h), phi)
    True
    """
    workers = n_threads()
    transformed = scipy.fft.dctn(right_hand_side, type=2, overwrite_x=overwrite, workers=workers)
    eigenvalues = [
        (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) / h**2
        for n, h in zip(right_hand_side.shape, spacing, strict=True)
    ]
    padded = padded_shape(transformed.shape)
    eigenvalues = [np.zeros(1)] * (4 - len(eigenvalues)) + eigenvalues
    by_slabs(padded, _divide, *eigenvalues, transformed.reshape(padded))
    return np.asarray(scipy.fft.idctn(transformed, type=2, overwrite_x=True, workers=workers))


def interpolation_stencil(
    positions: NDArray[np.float64], shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(s, 2^k) nodes and weights of multilinear interpolation at positions in cells; k axes have more than one node."""
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
    """Run a kernel over slabs of the first long axis."""
    axis = 0 if shape[0] > 1 else 1
    n = shape[axis]
    if np.prod(shape) < SMALL:
        kernel(*arguments, axis, 0, n)
        return
    with ThreadPoolExecutor(n_threads()) as pool:
        jobs = [pool.submit(kernel, *arguments, axis, start, min(start + SLAB, n)) for start in range(0, n, SLAB)]
        for job in jobs:
            job.result()


@compiled
def _divide(
    values0: NDArray[np.float64],
    values1: NDArray[np.float64],
    values2: NDArray[np.float64],
    values3: NDArray[np.float64],
    transformed: NDArray[np.float64],
    axis: int,
    start: int,
    stop: int,
) -> None:
    """Divide by the eigenvalues of C, sums of one-dimensional ones; the quotient is zero where they are zero."""
    n0, n1, n2, n = transformed.shape
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = transformed[i, j, k]
                outer = values0[i] + values1[j] + values2[k]
                for m in range(n):
                    line[m] /= outer + values3[m]
                if outer == 0.0 and values3[0] == 0.0:
                    line[0] = 0.0


@compiled
def _divergence(
    components: NDArray[np.floating],
    scales: NDArray[np.float64],
    out: NDArray[np.float64],
    axis: int,
    start: int,
    stop: int,
) -> None:
    dimension = components.shape[0]
    n0, n1, n2, n = out.shape
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = out[i, j, k]
                flow = components[dimension - 1, i, j, k]
                scale = scales[dimension - 1]
                line[0] = -scale * (flow[0] + flow[1])
                for m in range(1, n - 1):
                    line[m] = scale * (flow[m - 1] - flow[m + 1])
                line[n - 1] = scale * (flow[n - 2] + flow[n - 1])
                for d in range(dimension - 1):
                    part = components[d]
                    scale = scales[d]
                    across = 3 - (dimension - 1 - d)
                    here = part[i, j, k]
                    a, b, c = i, j, k
                    if across == 0:
                        a = a - 1
                    elif across == 1:
                        b = b - 1
                    else:
                        c = c - 1
                    if a >= 0 and b >= 0 and c >= 0:
                        before = part[a, b, c]
                        for m in range(n):
                            line[m] += scale * (before[m] + here[m])
                    a, b, c = i, j, k
                    if across == 0:
                        a = a + 1
                    elif across == 1:
                        b = b + 1
                    else:
                        c = c + 1
                    if a < n0 and b < n1 and c < n2:
                        after = part[a, b, c]
                        for m in range(n):
                            line[m] -= scale * (here[m] + after[m])
