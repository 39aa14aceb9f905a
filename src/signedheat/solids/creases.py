"""Lids of flat faces that meet in creases, for rims of surfaces that do not bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.unit_vectors import unit
from .lids import SmoothRim
from .rims import corners_of
from .spanning import area_vector, frame_of, points_inside, spanned

FLAT = 0.01
"""Distance from a plane, relative to their size, below which points lie in it."""
FOLDED = -0.8
"""Cosine between the normals of a lid and of the surface at its rim below which the lid is folded back."""
MANY = 256
"""Number of corners above which a flat lid gets inner points, to avoid slivers."""
MOST_RUNS = 16
"""Number of planar runs above which a rim has no creased lid."""


@dataclass(frozen=True, eq=False)
class _Side:
    """A straight part of a rim, or a crease."""

    points: Ints  # (k,) without its end
    normal: Floats  # (3,) sum over its edges of length times unit normal of the surface


@dataclass(frozen=True, eq=False)
class _Run:
    """Consecutive sides that lie in a plane."""

    first: int  # index of the first side
    count: int
    points: Ints  # (k,) with the end
    opening: Floats  # (3,) area vector of a lid in the plane


def is_flat(points: Floats) -> bool:
    """Whether points lie in a plane.

    Examples
    --------
    >>> is_flat(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.001]]))
    True
    """
    around = points - points.mean(axis=0)
    normal = np.linalg.eigh(around.T @ around)[1][:, 0]
    return bool(np.abs(around @ normal).max() <= FLAT * np.linalg.norm(np.ptp(points, axis=0)))


def flat_lid(loop: Floats) -> tuple[Floats, Ints] | None:
    """Return the lid of a planar loop, as added points and triangles; None if it crosses itself."""
    return _filled(loop, len(loop), [np.arange(len(loop))])


def creased(loop: Floats, normals: Floats) -> tuple[Floats, Ints] | None:
    """Return the lid of flat faces that closes a rim, as added points and triangles; None if there is none.

    Consecutive sides in a plane are closed in that plane by a straight crease, if the sides before and after them lie
    in a plane with their ends; three such runs, by creases to the point where their planes meet. This restores edges
    and corners of boxes. No face is folded back over the surface. `normals` are the (n, 3) unit normals of the surface
    at the edges that begin at each point, or 0 if unknown.
    """
    points, sides = loop, _sides(loop, normals)
    polygons: list[Ints] = []
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


def _sides(loop: Floats, normals: Floats) -> list[_Side]:
    """Straight parts of a loop."""
    corners = corners_of(loop)
    weighted = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)[:, None] * normals
    if not len(corners):
        return []
    order, cuts = np.roll(np.arange(len(loop)), -corners[0]), corners - corners[0]
    sums = np.add.reduceat(weighted[order], cuts, axis=0)
    return [_Side(places, total) for places, total in zip(np.split(order, cuts[1:]), sums, strict=True)]


def _runs(points: Floats, sides: list[_Side]) -> list[_Run]:
    """Return the longest runs of two or more sides in a plane, the largest first; none if there are too many.

    Those whose lid would be folded back over the surface are left out.
    """
    n = len(sides)
    starts = points[[side.points[0] for side in sides]]
    ways = unit(np.roll(starts, -1, axis=0) - starts)
    across = unit(np.cross(np.roll(ways, 1, axis=0), ways))
    goes_on = np.abs((across * np.roll(ways, -1, axis=0)).sum(axis=1)) <= FLAT  # the side after next is coplanar
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


def _peak(points: Floats, runs: list[_Run], n_sides: int) -> tuple[Floats, tuple[_Run, _Run, _Run]] | None:
    """Return the point near a loop of three runs where their planes meet, and the runs."""
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


def _closed_by_a_crease(points: Floats, sides: list[_Side], runs: list[_Run]) -> _Run | None:
    """Return the first run whose ends lie in a plane with the sides before and after it."""
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


def _filled(points: Floats, n_rim: int, polygons: list[Ints]) -> tuple[Floats, Ints] | None:
    """Points after those of a rim, and triangles of planar polygons; None if one crosses itself."""
    vertices, faces, count = [points], [], len(points)
    for polygon in polygons:
        corners = points[polygon]
        frame = frame_of(corners)
        if frame is None:
            return None
        plane, inner = (corners - frame[0]) @ frame[1], np.empty((0, 2))
        if len(corners) > MANY:
            inner = points_inside((SmoothRim.of(corners).points - frame[0]) @ frame[1])
        lid = spanned(plane, inner)
        if lid is None:
            return None
        added = np.concatenate([lid.rim(corners)[lid.shares > 0], frame[0] + inner[lid.inner] @ frame[1].T])
        vertices.append(added)
        faces.append(np.concatenate([polygon, count + np.arange(len(added))])[lid.balanced()])
        count += len(added)
    return np.concatenate(vertices)[n_rim:], np.concatenate(faces)
