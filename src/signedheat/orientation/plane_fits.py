"""Planes fitted to points on an unknown surface, and how large the neighbourhoods must be for that."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..parallel import n_threads
from .plane_fit_kernels import robust_planes

CLEAN_NEIGHBORS = 12
"""Neighbours that a plane is fitted to where there is no noise to average out."""
NOISY_NEIGHBORS = (12, 24, 48, 96, 192)
"""Sizes of neighbourhood that noise may call for."""
CLEAN_DEVIATION = 0.07
"""Deviation from robust planes, in reaches of neighbourhoods, above which points are noisy: curvature stays below .06,
thin sheets and edges too, where the points resolve them; noise as wide as the neighbourhood has .09 or more."""
ANGLE_ERROR = 0.13
"""Radians by which noise may turn planes, as estimated from their deviation, above which they tell nothing."""
CLEAN_HEIGHTS = (0.25, 0.15, 0.1)
"""Heights over the plane through a point, in reaches, beyond which a neighbour belongs to another sheet, one by one."""
NOISY_HEIGHTS = (0.5, 0.5, 0.5)
"""The same over planes that move from a noisy point to where its neighbours are densest."""
_TRIAL_HEIGHTS = (0.5, 0.5, 0.5)
_CHUNK = 4096
_TRIED = 2000


@dataclass(frozen=True, eq=False)
class PlaneFits:
    """Planes near points.

    Attributes
    ----------
    axes : (n, 3) float
        Unit normals, up to sign.
    places : (n, 3) float
        The points themselves; where they are noisy, their feet on the planes.
    reaches : (n,) float
        Distance to the last neighbour used.
    n_neighbors : int
        Size of the neighbourhoods.
    noisy : bool
        Whether the points lie around the surface rather than on it.
    """

    axes: NDArray[np.float64]
    places: NDArray[np.float64]
    reaches: NDArray[np.float64]
    n_neighbors: int
    noisy: bool


def fit_planes(points: NDArray[np.float64], n_neighbors: int | None = None) -> PlaneFits:
    """Fit a plane near each of (n, 3) distinct points.

    Without noise the neighbourhoods are small, and sheets that lie close together, or meet in an edge, are told apart:
    of several planes that explain the point, the one that explains most neighbours. `n_neighbors` says that there is
    noise, and how large neighbourhoods must be to average it out.

    Examples
    --------
    >>> xy = np.random.default_rng(0).random((400, 2))
    >>> sheets = np.concatenate([np.c_[xy[:200], np.zeros(200)], np.c_[xy[200:], np.full(200, 0.1)]])
    >>> bool(np.median(np.abs(fit_planes(sheets).axes[:, 2])) > 0.999)
    True
    """
    tree = scipy.spatial.cKDTree(points)
    noisy = n_neighbors is not None
    size = n_neighbors or min(CLEAN_NEIGHBORS, len(points) - 1)
    heights, starts = (NOISY_HEIGHTS, 1) if noisy else (CLEAN_HEIGHTS, 5)
    axes, places, reaches, _ = planes_near(points, tree, np.arange(len(points)), size, heights, starts)
    places = points - ((points - places) * axes).sum(axis=1, keepdims=True) * axes if noisy else points
    return PlaneFits(axes, places, reaches, size, noisy)


def noisy_sizes(points: NDArray[np.float64]) -> list[int]:
    """Sizes of neighbourhoods in which planes can be told in spite of noise, from the least; without noise none.

    Told from at most 2,000 of the points.

    Examples
    --------
    >>> points = np.random.default_rng(0).random((2000, 3)) * (1, 1, 0.1)
    >>> noisy_sizes(points)[-1], noisy_sizes(points * (1, 1, 0))
    (192, [])
    """
    largest = (len(points) - 1) // 4
    if largest < CLEAN_NEIGHBORS:
        return []
    tree = scipy.spatial.cKDTree(points)
    tried = np.arange(0, len(points), -(-len(points) // _TRIED))
    deviations = planes_near(points, tree, tried, CLEAN_NEIGHBORS, _TRIAL_HEIGHTS)[3]
    if np.median(deviations) < CLEAN_DEVIATION:
        return []
    sizes = [k for k in NOISY_NEIGHBORS if k <= largest]
    errors = [2 * float(np.median(planes_near(points, tree, tried, k, (np.inf,), 1)[3])) / k**0.5 for k in sizes]
    return [k for k, error in zip(sizes, errors, strict=True) if error < ANGLE_ERROR] or sizes[-1:]


def noise_scale(points: NDArray[np.float64]) -> int | None:
    """Size of neighbourhoods that noise calls for where the normals are known; without noise none."""
    sizes = noisy_sizes(points)
    return sizes[min(2, len(sizes) - 1)] if sizes else None


def planes_near(
    points: NDArray[np.float64],
    tree: scipy.spatial.cKDTree,
    chosen: NDArray[np.int64],
    n_neighbors: int,
    heights: tuple[float, ...],
    n_starts: int = 5,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Axes, centres, reaches and deviations of planes near chosen points."""
    n = len(chosen)
    axes, centers, deviations, reaches = np.zeros((n, 3)), points[chosen], np.zeros(n), np.zeros(n)

    def fit(begin: int) -> None:
        part = slice(begin, begin + _CHUNK)
        distances, neighbors = tree.query(points[chosen[part]], k=n_neighbors + 1)
        neighbors[:, 0] = chosen[part]
        kept = axes[part], centers[part], deviations[part]
        robust_planes(points, neighbors, distances, np.array(heights), n_starts > 1, n_starts, *kept)
        reaches[part] = distances[:, -1]

    with ThreadPoolExecutor(n_threads()) as pool:
        list(pool.map(fit, range(0, n, _CHUNK)))
    return axes, centers, reaches, deviations
