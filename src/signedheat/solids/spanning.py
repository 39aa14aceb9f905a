"""Planes in which closed loops are triangulated, and points within; and a disc where their projections cross."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats
from ..mesh.triangles import side_lengths
from ..parallel import PointTree

LAYER_GROWTH = 0.35
"""Growth of triangles with their distance from the rim, relative to that distance."""
MOST_TIES = 128
"""Maximum number of equally distant points of a loop that are compared, and number of places compared for each."""
Frame = tuple[Floats, Floats]
"""Origin and (3, 2) axes of a plane."""


def frame_of(rim: Floats) -> Frame | None:
    """Return the plane of a loop's area through its centre, with axes for which it is counterclockwise; or None."""
    normal = area_vector(rim)
    length = np.linalg.norm(normal)
    if not length > 1e-6 * np.linalg.norm(np.ptp(rim, axis=0)) ** 2:
        return None
    normal /= length
    lengths, middles = side_lengths(rim), 0.5 * (rim + np.roll(rim, -1, axis=0))
    centre = rim[0] + (lengths[:, None] * (middles - rim[0])).sum(axis=0) / lengths.sum()
    around = rim - rim.mean(axis=0)
    around -= np.outer(around @ normal, normal)
    reach = np.linalg.norm(around, axis=1)
    first = around[farthest(rim, reach)]  # this axis turns with the rim
    first = first / np.linalg.norm(first)
    return centre, np.stack([first, np.cross(normal, first)], axis=1)


def farthest(loop: Floats, away: Floats) -> int:
    """Find the point of a closed loop that is farthest away; of equal ones, that after which the loop stays farther."""
    ties = np.flatnonzero(away > (1 - 1e-9) * away.max())[:MOST_TIES]
    if len(ties) == 1:
        return int(ties[0])
    starts = shares_of(loop)[0]
    onward = (starts[ties, None] + np.arange(MOST_TIES) / MOST_TIES) % 1.0
    far = np.interp(onward, starts, np.append(away, away[0])) / max(float(away.max()), 1e-300)
    return int(ties[np.lexsort(np.rint(1e6 * far).T[::-1])[-1]])


def shares_of(loop: Floats) -> tuple[Floats, float]:
    """(n + 1,) share of the length of a closed loop at which each corner comes, and 1; and that length."""
    lengths = side_lengths(loop)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    return along / along[-1], float(along[-1])


def area_vector(loop: Floats) -> Floats:
    """(3,) the area that a closed loop encloses, along its normal."""
    around = loop - loop.mean(axis=0)
    return 0.5 * np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)


def points_inside(polygon: Floats) -> Floats:
    """Points within a polygon of few sides, as dense as its corners at its rim, and sparser away from it."""
    steps = side_lengths(polygon)
    size = float(np.quantile(steps, 0.9))
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    tree = PointTree(polygon)
    layers = [np.zeros((0, 2))]
    begin = 0.75 * size
    while begin < 0.5 * float((high - low).max()):
        step = size if len(layers) == 1 else LAYER_GROWTH * begin + size
        end = begin + 2.0 * step
        rows = np.arange(low[1], high[1] + step, step * 0.75**0.5)
        columns = np.arange(low[0], high[0] + step, step)
        shifted = np.add.outer(0.5 * step * (np.arange(len(rows)) % 2), columns)
        points = np.stack([shifted.ravel(), np.repeat(rows, len(columns))], axis=1)
        away = tree.query(points)[0]
        layers.append(points[(away >= begin) & (away < end)])
        begin = end + 0.5 * step
    points = np.concatenate(layers)
    return points[_inside(points, polygon)]


def _inside(points: Floats, polygon: Floats) -> Bools:
    """(k,) whether points lie inside a polygon: by the parity of crossings."""
    x, y = points.T
    (ax, ay), (bx, by) = polygon.T[..., None], np.roll(polygon, -1, axis=0).T[..., None]
    rise = np.where(by == ay, 1.0, by - ay)  # level sides are not crossed
    crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / rise)
    return np.logical_xor.reduce(crosses, axis=0)


def points_in_disc(n: int) -> Floats:
    """Points within the unit circle, as dense as n points around it at its rim, and sparser away from it."""
    rings, radius, step, turn = [np.zeros((1, 2))], 1.0, 2 * np.pi / n, 0.0
    while (radius := radius - step * 0.87) >= step:
        count = max(int(np.ceil(2 * np.pi * radius / step)), 5)
        turn += np.pi / count
        angles = turn + 2 * np.pi * np.arange(count) / count
        rings.append(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        step *= 1 + LAYER_GROWTH
    return np.concatenate(rings)
