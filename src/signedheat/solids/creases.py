"""Lids of flat faces that meet in creases: what closes a rim whose surface does not bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..mesh.unit_vectors import unit
from .lids import SmoothRim
from .rims import corners_of
from .spanning import area_vector, frame_of, points_inside, spanned

FLAT = 0.01
"""Distance from a plane, over their size, up to which points lie in it."""
FOLDED = -0.8
"""Cosine between the normals of a lid and of the surface at its rim up to which it is folded back over the surface."""
MANY = 256
"""Corners of a flat lid from which on points inside keep its triangles from being many slivers, slow to find."""
MOST_RUNS = 16
"""Stretches of a rim in one plane each from which on it has no flat lid."""


@dataclass(frozen=True, eq=False)
class _Side:
    """A straight part of a rim, or a crease.

    Attributes
    ----------
    points : (k,) int
        Its points, without its end.
    normal : (3,) float
        Sum over its edges of length times unit normal of the surface there.
    """

    points: NDArray[np.int64]
    normal: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Run:
    """Sides one after another that lie in a plane.

    Attributes
    ----------
    first, count : int
        The first side, and how many there are.
    points : (k,) int
        Their points, with the end.
    opening : (3,) float
        Area vector of a lid in that plane.
    """

    first: int
    count: int
    points: NDArray[np.int64]
    opening: NDArray[np.float64]


def is_flat(points: NDArray[np.float64]) -> bool:
    """Whether points lie in a plane.

    Examples
    --------
    >>> is_flat(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.001]]))
    True
    """
    around = points - points.mean(axis=0)
    normal = np.linalg.eigh(around.T @ around)[1][:, 0]
    return bool(np.abs(around @ normal).max() <= FLAT * np.linalg.norm(np.ptp(points, axis=0)))


def flat_lid(loop: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """The lid of a loop in a plane: the points that it adds to the loop's, and triangles; None if it crosses itself."""
    return _filled(loop, len(loop), [np.arange(len(loop))])


def creased(
    loop: NDArray[np.float64], normals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """The lid of flat faces that closes a rim, if there is one: the points that it adds to the rim's, and triangles.

    Sides of the rim that lie in a plane are closed in that plane: by a straight crease, if what comes before them and
    after them lies in one plane with their ends; three such runs by creases to the place where their planes meet. So
    sides of a box come back with the edge or the corner where they met. No face is folded back over the surface. The
    (n, 3) unit normals are those of the surface at the edges that begin at each point; 0 where they are not clear.
    """
    points, sides = loop, _sides(loop, normals)
    polygons: list[NDArray[np.int64]] = []
    while len(sides) > 2:
        rest = np.concatenate([side.points for side in sides])
        if is_flat(points[rest]):
            return _filled(points, len(loop), [*polygons, rest])
        runs = _runs(points, sides)
        peak = _peak(points, runs, len(sides))
        if peak is not None:
            pieces = [np.append(run.points, len(points)) for run in peak[1]]
            return _filled(np.concatenate([points, peak[0][None]]), len(loop), [*polygons, *pieces])
        run = _closed_by_a_crease(points, sides, runs)
        if run is None:
            return None
        polygons.append(run.points)
        kept = [sides[(run.first + run.count + k) % len(sides)] for k in range(len(sides) - run.count)]
        sides = [_Side(run.points[:1], np.zeros(3)), *kept]
    return None


def _sides(loop: NDArray[np.float64], normals: NDArray[np.float64]) -> list[_Side]:
    """Straight parts of a loop."""
    corners = corners_of(loop)
    weighted = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)[:, None] * normals
    if not len(corners):
        return []
    order, cuts = np.roll(np.arange(len(loop)), -corners[0]), corners - corners[0]
    sums = np.add.reduceat(weighted[order], cuts, axis=0)
    return [_Side(places, total) for places, total in zip(np.split(order, cuts[1:]), sums, strict=True)]


def _runs(points: NDArray[np.float64], sides: list[_Side]) -> list[_Run]:
    """The longest runs of two or more sides that lie in a plane, the largest first; none if there are too many.

    Those whose lid would be folded back over the surface are left out.
    """
    n = len(sides)
    starts = points[[side.points[0] for side in sides]]
    ways = unit(np.roll(starts, -1, axis=0) - starts)
    across = unit(np.cross(np.roll(ways, 1, axis=0), ways))
    goes_on = np.abs((across * np.roll(ways, -1, axis=0)).sum(axis=1)) <= FLAT  # the side after next is in that plane
    begins = np.flatnonzero(~np.roll(goes_on, 1))
    if not 0 < len(begins) <= MOST_RUNS:
        return []
    runs = []
    for corner, after in zip(begins, np.append(begins[1:], begins[0] + n), strict=True):
        first, count = (int(corner) - 1) % n, min(int(after - corner) + 1, n - 1)
        chosen = [sides[(first + k) % n] for k in range(count)]
        places = np.concatenate([*(side.points for side in chosen), sides[(first + count) % n].points[:1]])
        opening = area_vector(points[places])
        surface = np.sum([side.normal for side in chosen], axis=0)
        folded = opening @ surface <= FOLDED * np.linalg.norm(opening) * np.linalg.norm(surface)
        if is_flat(points[places]) and not (folded and surface.any()):
            runs.append(_Run(first, count, places, opening))
    return sorted(runs, key=lambda run: -float(np.linalg.norm(run.opening)))


def _peak(
    points: NDArray[np.float64], runs: list[_Run], n_sides: int
) -> tuple[NDArray[np.float64], tuple[_Run, _Run, _Run]] | None:
    """Where the planes of three runs that make up a loop meet, near it, and the runs."""
    following = {run.first: run for run in runs}
    for one in runs:
        two = following.get((one.first + one.count) % n_sides)
        three = following.get((two.first + two.count) % n_sides) if two else None
        if two is None or three is None or one.count + two.count + three.count != n_sides:
            continue
        around = (one, two, three)
        planes = unit(np.stack([run.opening for run in around]))
        if abs(np.linalg.det(planes)) < FLAT:
            continue
        middles = np.stack([points[run.points].mean(axis=0) for run in around])
        peak = np.linalg.solve(planes, (planes * middles).sum(axis=1))
        corners = points[np.concatenate([run.points for run in around])]
        if np.linalg.norm(peak - corners.mean(axis=0)) < np.linalg.norm(np.ptp(corners, axis=0)):
            return peak, around
    return None


def _closed_by_a_crease(points: NDArray[np.float64], sides: list[_Side], runs: list[_Run]) -> _Run | None:
    """The first run whose ends lie in a plane with the sides before and after it."""
    n = len(sides)
    for run in runs:
        if n - run.count < 2:
            continue
        before, after = sides[(run.first - 1) % n], sides[(run.first + run.count) % n]
        beyond = sides[(run.first + run.count + 1) % n]
        ends = np.concatenate([before.points, run.points[[0, -1]], after.points, beyond.points[:1]])
        if is_flat(points[ends]):
            return run
    return None


def _filled(
    points: NDArray[np.float64], n_rim: int, polygons: list[NDArray[np.int64]]
) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """Points after those of a rim, and the triangles of plane polygons; None if one crosses itself."""
    vertices, faces, count = [points], [], len(points)
    for polygon in polygons:
        corners = points[polygon]
        frame = frame_of(corners)
        if frame is None:
            return None
        plane, inner = (corners - frame[0]) @ frame[1], np.empty((0, 2))
        if len(corners) > MANY:
            inner = points_inside((SmoothRim.of(corners).points - frame[0]) @ frame[1])
        found = spanned(plane, inner)
        if found is None:
            return None
        added = np.concatenate([found.rim(corners)[found.shares > 0], frame[0] + inner[found.inner] @ frame[1].T])
        vertices.append(added)
        faces.append(np.concatenate([polygon, count + np.arange(len(added))])[found.balanced()])
        count += len(added)
    return np.concatenate(vertices)[n_rim:], np.concatenate(faces)
