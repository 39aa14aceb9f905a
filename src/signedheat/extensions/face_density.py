"""Surfaces of which a share is missing everywhere, such as faces at random: how much of them is there.

Across a surface of which the share ρ is there, in holes smaller than a few cells, the winding number rises by ρ only,
and is ρ inside. Divided by ρ it tells the sides as if nothing were missing. Across an open sheet it rises by 1, from as
far below 0 as it gets above.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..lowering.area_elements import AreaSamples
from ..operators.grid.face_values import values_at

REACHES = (1.25, 2.0, 3.0)
"""Cells before and behind a face at which winding numbers are compared: thin walls need few, large holes many."""
SPARSE, WHOLE = 0.5, 0.8
"""Shares up to which winding numbers are divided by them, and from which on by 1: thin walls look like that, too."""
THIN = 0.65
"""What winding numbers rise by at the least of `REACHES` across whole walls that are gone at the most of them."""
OPPOSED = (0.12, 0.25)
"""Shares of the area with as much that faces the other way beside it, up to which any density is believed, and from
which on those of `WALLS` are."""
WALLS = (0.25, 0.35)
"""Winding numbers rise across walls thinner than cells as little as where faces are missing. Divided by the upper of
these densities they find walls of most of a cell; by less than the lower they would fill what thinner walls enclose."""
BLOCK = 2.0
"""Cells along the blocks that are searched for it."""
LEAST = 0.05
"""Share that is not told from nothing."""
ONE_SIDED = 0.6
"""Sum of the winding numbers on both sides over their difference, 1 on solids and 0 on sheets, that is asked for."""


def as_if_whole(winding: NDArray[np.float64], samples: AreaSamples) -> tuple[NDArray[np.float64], AreaSamples, float]:
    """Winding numbers, and samples with the areas, that the whole surface would have; and the share that these are."""
    share = face_density(winding, samples.positions, samples.vectors)
    if share == 1.0:
        return winding, samples, share
    return winding / share, replace(samples, vectors=samples.vectors / share), share


def face_density(winding: NDArray[np.float64], positions: NDArray[np.float64], vectors: NDArray[np.float64]) -> float:
    """The share ρ of a surface that is there; 1 where it is no surface of a solid, or at least `WHOLE`.

    Parameters
    ----------
    winding : (nx, ny, nz) float
        Winding numbers at the nodes of a grid.
    positions, vectors : (s, 3) float
        Samples of the faces: places in cells from the first node, and area times normal.
    """
    areas = np.linalg.norm(vectors, axis=1)
    if not areas.any():
        return 1.0
    normals = vectors / np.where(areas > 0, areas, 1.0)[:, None]
    upper = np.array(winding.shape) - 1.0
    rises, sums = [], []
    for reach in REACHES:
        behind, before = (
            values_at(winding, np.clip(positions + side * reach * normals, 0.0, upper)) for side in (-1, 1)
        )
        rises.append(behind - before)
        sums.append(behind + before)
    best = np.argmax(rises, axis=0)[None]
    rise, both = (np.take_along_axis(np.array(each), best, axis=0)[0] for each in (rises, sums))
    if np.average(both, weights=areas) < ONE_SIDED * np.average(np.abs(rise), weights=areas):
        return 1.0
    if _quantile(rise, areas, 0.9) >= WHOLE:  # some places are whole: there are large holes elsewhere
        return 1.0
    close, far = (_quantile(rises[k], areas, 0.5) for k in (0, -1))
    thick = min(max(far / close, 0.0), 1.0) if close > 0 else 0.0
    share = _quantile(rise, areas, 0.5) / (THIN + (1.0 - THIN) * thick)
    believed = share + (1.0 - share) * _ramp(share, SPARSE, WHOLE)
    opposed = _ramp(opposed_share(positions, vectors), *OPPOSED)
    believed += (1.0 - believed) * opposed * (1.0 - _ramp(share, *WALLS))
    return min(max(believed, LEAST), 1.0)


def opposed_share(positions: NDArray[np.float64], vectors: NDArray[np.float64]) -> float:
    """Share of the area with as much that faces the other way in the same block of cells, along its main normal.

    Examples
    --------
    >>> places = np.array([[0.2, 0.5, 0.5], [0.9, 0.5, 0.5], [4.5, 0.5, 0.5]])
    >>> round(opposed_share(places, np.array([[-1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])), 3)
    0.667
    """
    block = np.unique(np.floor(positions / BLOCK).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    areas = np.linalg.norm(vectors, axis=1)
    moments = np.zeros((int(block.max()) + 1, 3, 3))
    np.add.at(moments, block, vectors[:, :, None] * vectors[:, None, :] / np.where(areas > 0, areas, 1)[:, None, None])
    main = np.linalg.eigh(moments)[1][:, :, -1]
    along = np.einsum("ij,ij->i", vectors, main[block])
    sides = [np.bincount(block, np.maximum(side * along, 0.0)) for side in (1, -1)]
    return float(2 * np.minimum(*sides).sum() / areas.sum())


def _ramp(value: float, low: float, high: float) -> float:
    """From 0 at `low` to 1 at `high`."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


def _quantile(values: NDArray[np.float64], areas: NDArray[np.float64], share: float) -> float:
    """The value below which a share of the area lies."""
    order = np.argsort(values)
    sums = np.cumsum(areas[order])
    return float(values[order[np.searchsorted(sums, share * sums[-1])]])
