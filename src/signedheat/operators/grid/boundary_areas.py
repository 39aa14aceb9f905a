"""Kernels: how much area the boundary of a region of a grid has, and how much of it lies far from any face.

Crossed edges of a level set along axis a are ``|n_a| / (area per edge)`` to the unit of area, n the unit normal; summed
over the axes, ``|n_a|`` times that area, once more weighted by ``|n_a|``, gives the area without bias. Grids have three
axes, those in front of one node in fewer dimensions.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ...parallel import n_threads
from .stencil import SLAB, by_slabs

DISK = 0.6
"""Radius, in cells, of the disk that a sample stands for."""
MARGIN = 0.05
"""Share of the nodes along the longest axis that is close to a wall."""
TOUCH = 3
"""Nodes between a hole and a body that still touch."""


def boundary_areas(
    labels: NDArray[np.int32],
    function: NDArray[np.float64],
    distance: NDArray[np.floating],
    steps: NDArray[np.float64],
    far: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Area of the boundary of each region, and how much of it is farther than `far` from any face.

    Parameters
    ----------
    labels : (n₀, n₁, n₂) int32
        Region of each node, from 1; 0 outside all.
    function : (n₀, n₁, n₂) float
        Smooth function whose level set the boundaries are.
    distance : (n₀, n₁, n₂) float
        Distance to the faces.
    steps : (3,) float
        Spacing, in units of length; anything along axes of one node.
    far : float
        The least distance of what was completed. Where regions reach the walls of the box, these count as completed.

    Returns
    -------
    total, completed : (l + 1,) float
        By label.
    """
    n_labels = int(labels.max(initial=0)) + 1
    axis = 0 if labels.shape[0] > 1 else 1
    total, completed = np.zeros(n_labels), np.zeros(n_labels)
    with ThreadPoolExecutor(n_threads()) as pool:
        starts = range(0, labels.shape[axis], SLAB)
        arguments = labels, function, distance, steps, far, n_labels, axis
        for job in [pool.submit(_boundary_areas, *arguments, start, start + SLAB) for start in starts]:
            more, completing = job.result()
            total += more
            completed += completing
    return total, completed


def completion_areas(
    holes: NDArray[np.int32],
    bodies: NDArray[np.int32],
    present: NDArray[np.float64],
    phi: NDArray[np.float64],
    winding: NDArray[np.float64],
    distance: NDArray[np.floating],
    steps: NDArray[np.float64],
    far: float,
    levels: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Area that closes bodies across each hole, if what lies beyond is filled down to a level of the winding number.

    Parameters
    ----------
    holes, bodies : (n₀, n₁, n₂) int32
        Labels of what may be filled, where φ < 0, and of what is inside anyhow; 0 elsewhere.
    present : (b + 1,) float
        Area of faces by body; of several that a hole touches, it belongs to the one with most.
    phi, winding, distance : (n₀, n₁, n₂) float
        What decides, and the distance to the faces.
    levels : (l,) float
        Levels of the winding number, ascending.

    Returns
    -------
    areas : (h + 1, l) float
        By hole and level.
    owners : (h + 1,) int
        Body that each hole belongs to, 0 for none.
    walls : (h + 1,) int
        Number of levels at which what fills a hole comes close to the walls of the box (`MARGIN`), or touches them.
    """
    n_holes = int(holes.max(initial=0)) + 1
    changes, owners, walls = _completion_areas(
        holes, bodies, present, phi, winding, distance, steps, far, levels, n_holes
    )
    return np.cumsum(changes, axis=1)[:, : len(levels)], owners, walls


@compiled(nogil=True)
def _slope(field: NDArray[np.float64], i: int, j: int, k: int, axis: int, steps: NDArray[np.float64]) -> float:
    """Difference of a grid function along an axis, one-sided at the walls."""
    n = field.shape[axis]
    if n == 1:
        return 0.0
    at = (i, j, k)[axis]
    low, high = max(at - 1, 0), min(at + 1, n - 1)
    if axis == 0:
        rise = field[high, j, k] - field[low, j, k]
    elif axis == 1:
        rise = field[i, high, k] - field[i, low, k]
    else:
        rise = field[i, j, high] - field[i, j, low]
    slope: float = rise / ((high - low) * steps[axis])
    return slope


@compiled(nogil=True)
def _edge_area(
    field: NDArray[np.float64], i: int, j: int, k: int, a: int, b: int, c: int, axis: int, steps: NDArray[np.float64]
) -> float:
    """Area that one crossed edge, between two nodes along an axis, stands for."""
    across, square = 0.0, 0.0
    volume = 1.0
    for d in range(3):
        slope = _slope(field, i, j, k, d, steps) + _slope(field, a, b, c, d, steps)
        square += slope * slope
        if d == axis:
            across = abs(slope)
        if field.shape[d] > 1:
            volume *= steps[d]
    area: float = volume / steps[axis] * (across / np.sqrt(square) if square > 0.0 else 1.0)
    return area


@compiled(nogil=True)
def _wall_area(shape: tuple[int, int, int], i: int, j: int, k: int, steps: NDArray[np.float64]) -> float:
    """Area of the walls of the box around a node."""
    result, volume = 0.0, 1.0
    for d in range(3):
        if shape[d] > 1:
            volume *= steps[d]
    for d in range(3):
        at = (i, j, k)[d]
        if shape[d] > 1 and (at == 0 or at == shape[d] - 1):
            result += volume / steps[d]
    return result


@compiled(nogil=True)
def _boundary_areas(
    labels: NDArray[np.int64],
    function: NDArray[np.float64],
    distance: NDArray[np.float64],
    steps: NDArray[np.float64],
    far: float,
    n_labels: int,
    axis: int,
    start: int,
    stop: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of the nodes from `start` to `stop` along an axis."""
    n0, n1, n2 = labels.shape
    total, completed = np.zeros(n_labels), np.zeros(n_labels)
    for i in range(start if axis == 0 else 0, min(stop, n0) if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, min(stop, n1) if axis == 1 else n1):
            for k in range(n2):
                label = labels[i, j, k]
                if label == 0:
                    continue
                if i == 0 or j == 0 or k == 0 or i == n0 - 1 or j == n1 - 1 or k == n2 - 1:
                    wall = _wall_area(labels.shape, i, j, k, steps)
                    total[label] += wall
                    completed[label] += wall
                for way in range(3):
                    for side in range(-1, 2, 2):
                        a, b, c = i + side * (way == 0), j + side * (way == 1), k + side * (way == 2)
                        if a < 0 or b < 0 or c < 0 or a >= n0 or b >= n1 or c >= n2 or labels[a, b, c] != 0:
                            continue
                        area = _edge_area(function, i, j, k, a, b, c, way, steps)
                        total[label] += area
                        if 0.5 * (distance[i, j, k] + distance[a, b, c]) > far:
                            completed[label] += area
    return total, completed


@compiled
def _levels_below(levels: NDArray[np.float64], value: float) -> int:
    """How many of rising levels are below a value; all if it is NaN. NumPy's own compiles slowly."""
    low, high = 0, len(levels)
    while low < high:
        middle = (low + high) // 2
        if levels[middle] >= value:
            high = middle
        else:
            low = middle + 1
    return low


@compiled(nogil=True)
def _completion_areas(
    holes: NDArray[np.int64],
    bodies: NDArray[np.int64],
    present: NDArray[np.bool_],
    phi: NDArray[np.float64],
    winding: NDArray[np.float64],
    distance: NDArray[np.float64],
    steps: NDArray[np.float64],
    far: float,
    levels: NDArray[np.float64],
    n_holes: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Each edge between two nodes is crossed at all levels at which one is filled and the other is not."""
    n0, n1, n2 = holes.shape
    changes = np.zeros((n_holes, len(levels) + 1))
    owners = np.zeros(n_holes, dtype=np.int64)
    walls = np.zeros(n_holes, dtype=np.int64)
    longest = max(n0, n1, n2)
    for i in range(n0):
        for j in range(n1):
            for k in range(n2):
                hole = holes[i, j, k]
                if hole == 0:
                    continue
                here = _levels_below(levels, winding[i, j, k])  # filled at the levels before this
                room = longest
                for n, at in ((n0, i), (n1, j), (n2, k)):
                    if n > 1:
                        room = min(room, at, n - 1 - at)
                if room <= MARGIN * longest:
                    walls[hole] = max(walls[hole], here)
                if i == 0 or j == 0 or k == 0 or i == n0 - 1 or j == n1 - 1 or k == n2 - 1:
                    wall = _wall_area(holes.shape, i, j, k, steps)
                    changes[hole, 0] += wall
                    changes[hole, here] -= wall
                for axis in range(3):
                    for side in range(-1, 2, 2):
                        a, b, c = i + side * (axis == 0), j + side * (axis == 1), k + side * (axis == 2)
                        if a < 0 or b < 0 or c < 0 or a >= n0 or b >= n1 or c >= n2:
                            continue
                        body = bodies[a, b, c]
                        for more in range(1, TOUCH + 1):  # between thin walls, nothing but what is near faces is there
                            p, q, r = i + more * (a - i), j + more * (b - j), k + more * (c - k)
                            if p < 0 or q < 0 or r < 0 or p >= n0 or q >= n1 or r >= n2 or phi[p, q, r] >= 0.0:
                                break
                            touched = bodies[p, q, r]
                            if touched > 0 and (owners[hole] == 0 or present[touched] > present[owners[hole]]):
                                owners[hole] = touched
                        if 0.5 * (distance[i, j, k] + distance[a, b, c]) <= far:
                            continue
                        if body > 0:
                            first, last = here, len(levels)
                        elif phi[a, b, c] >= 0.0:
                            first, last = 0, here
                        elif holes[a, b, c] != hole:
                            continue
                        else:
                            last = _levels_below(levels, winding[a, b, c])
                            first = here
                            if first >= last:  # the neighbour counts it
                                continue
                        field = phi if body == 0 and phi[a, b, c] >= 0.0 else winding
                        area = _edge_area(field, i, j, k, a, b, c, axis, steps)
                        changes[hole, first] += area
                        changes[hole, last] -= area
    return changes, owners, walls


def distances_to_samples(
    positions: NDArray[np.float64],
    vectors: NDArray[np.float64],
    shape: tuple[int, int, int],
    steps: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float32]:
    """(*shape) distance from each node to samples of a surface, as far as `reach`; which it is everywhere beyond.

    A sample stands for a disk of `DISK` cells around its place, (s, 3) in cells, across its vector.
    """
    result = np.full(shape, reach, dtype=np.float32)
    by_slabs(shape, _distances_to_samples, positions, vectors, steps, reach, DISK * float(steps.max()), result)
    return result


@compiled(nogil=True)
def _distances_to_samples(
    positions: NDArray[np.float64],
    vectors: NDArray[np.float64],
    steps: NDArray[np.float64],
    reach: float,
    disk: float,
    result: NDArray[np.float32],
    axis: int,
    start: int,
    stop: int,
) -> None:
    """To the nodes from `start` to `stop` along an axis."""
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for s in range(len(positions)):
        length = 0.0
        for d in range(3):
            length += vectors[s, d] ** 2
            span = (reach + disk) / steps[d]
            low[d] = max(0, int(np.ceil(positions[s, d] - span)))
            high[d] = min(result.shape[d] - 1, int(np.floor(positions[s, d] + span)))
        length = np.sqrt(length)
        low[axis], high[axis] = max(low[axis], start), min(high[axis], stop - 1)
        for i in range(low[0], high[0] + 1):
            x = (i - positions[s, 0]) * steps[0]
            for j in range(low[1], high[1] + 1):
                y = (j - positions[s, 1]) * steps[1]
                for k in range(low[2], high[2] + 1):
                    z = (k - positions[s, 2]) * steps[2]
                    square = x * x + y * y + z * z
                    height = (x * vectors[s, 0] + y * vectors[s, 1] + z * vectors[s, 2]) / length if length > 0 else 0.0
                    away = max(0.0, np.sqrt(max(0.0, square - height * height)) - disk)
                    distance = np.sqrt(height * height + away * away)
                    if distance < result[i, j, k]:
                        result[i, j, k] = distance
