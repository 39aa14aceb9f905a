"""Lids of flat faces that meet in creases: what closes a rim whose surface does not bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.directions import unit
from .lids import Lid, area_vector, least_triangles

FLAT = 0.01
"""Distance from a plane, over their size, up to which points lie in it."""
FOLDED = -0.8
"""Cosine between the normals of a lid and of the surface at its rim up to which it is folded back over the surface."""
MOST_CORNERS = 128
"""Corners of a rim up to which planes are looked for."""


@dataclass(frozen=True, eq=False)
class _Side:
    """A straight part of a rim, (k, 3) points without its end, or a crease; sums of the lengths and unit normals of the
    surface there, over its edges."""

    points: NDArray[np.float64]
    normal: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Run:
    """Sides one after another that lie in a plane: the first, how many, and the unit normal of a lid in that plane."""

    first: int
    count: int
    normal: NDArray[np.float64]


def creased(loop: NDArray[np.float64], normals: NDArray[np.float64]) -> Lid | None:
    """The lid of flat faces that closes a rim, if there is one.

    Sides of the rim that lie in a plane are closed in that plane: by a straight crease, if what comes before them and
    after them lies in one plane with their ends; three such runs by creases to the place where their planes meet. So
    sides of a box come back with the edge or the corner where they met. No face is folded back over the surface. The
    unit normals are those of the surface at the edges that begin at each point; 0 where they are not clear.
    """
    sides = _sides(loop, normals)
    polygons: list[NDArray[np.float64]] = []
    while 2 < len(sides) <= MOST_CORNERS:
        points = np.concatenate([side.points for side in sides])
        if _is_flat(points):
            return _lid(loop, [*polygons, points])
        runs = _runs(sides)
        if peak := _peak(sides, runs):
            return _lid(loop, [*polygons, *peak])
        left = _without_one(sides, runs, polygons)
        if left is None:
            return None
        sides = left
    return None


def _sides(loop: NDArray[np.float64], normals: NDArray[np.float64]) -> list[_Side]:
    """Straight parts of a loop."""
    ways = np.roll(loop, -1, axis=0) - loop
    weighted = np.linalg.norm(ways, axis=1)[:, None] * normals
    ways = unit(ways)
    corners = np.flatnonzero(np.linalg.norm(ways - np.roll(ways, 1, axis=0), axis=1) > FLAT)
    if not len(corners):
        return []
    points, weighted = np.roll(loop, -corners[0], axis=0), np.roll(weighted, -corners[0], axis=0)
    cuts = corners[1:] - corners[0]
    return [_Side(p, n.sum(axis=0)) for p, n in zip(np.split(points, cuts), np.split(weighted, cuts), strict=True)]


def _is_flat(points: NDArray[np.float64]) -> bool:
    around = points - points.mean(axis=0)
    normal = np.linalg.eigh(around.T @ around)[1][:, 0]
    return bool(np.abs(around @ normal).max() <= FLAT * np.linalg.norm(np.ptp(points, axis=0)))


def _around(sides: list[_Side], first: int, count: int) -> NDArray[np.float64]:
    """Points of so many sides, with the end of the last."""
    some = [sides[(first + k) % len(sides)].points for k in range(count)]
    return np.concatenate([*some, sides[(first + count) % len(sides)].points[:1]])


def _runs(sides: list[_Side]) -> list[_Run]:
    """The longest runs of two or more sides that lie in a plane and whose lid is not folded back over the surface."""
    found = {}
    for corner in range(len(sides)):
        first, count = corner - 1, 2
        while count < len(sides) - 1 and _is_flat(_around(sides, first, count + 1)):
            count += 1
        while count < len(sides) - 1 and _is_flat(_around(sides, first - 1, count + 1)):
            first, count = first - 1, count + 1
        first %= len(sides)
        vector = area_vector(_around(sides, first, count))
        normal = vector / max(float(np.linalg.norm(vector)), 1e-300)
        surface = np.sum([sides[(first + k) % len(sides)].normal for k in range(count)], axis=0)
        if normal @ surface > FOLDED * np.linalg.norm(surface) or not surface.any():
            found[first, count] = _Run(first, count, normal)
    return list(found.values())


def _peak(sides: list[_Side], runs: list[_Run]) -> list[NDArray[np.float64]]:
    """Three polygons that close a loop of three runs, up to where their planes meet; none if it is no such loop."""
    n = len(sides)
    following = {run.first: run for run in runs}
    for one in runs:
        two = following.get((one.first + one.count) % n)
        three = following.get((two.first + two.count) % n) if two else None
        if two is None or three is None or one.count + two.count + three.count != n:
            continue
        planes = np.stack([run.normal for run in (one, two, three)])
        if abs(np.linalg.det(planes)) < FLAT:
            continue
        pieces = [_around(sides, run.first, run.count) for run in (one, two, three)]
        at = np.linalg.solve(
            planes, [normal @ piece.mean(axis=0) for normal, piece in zip(planes, pieces, strict=True)]
        )
        points = np.concatenate(pieces)
        if np.linalg.norm(at - points.mean(axis=0)) < np.linalg.norm(np.ptp(points, axis=0)):
            return [np.concatenate([piece, at[None]]) for piece in pieces]
    return []


def _without_one(sides: list[_Side], runs: list[_Run], polygons: list[NDArray[np.float64]]) -> list[_Side] | None:
    """The sides that are left when a run is closed by a crease; its polygon is added to others."""
    n = len(sides)
    for run in runs:
        if n - run.count < 2:
            continue
        piece = _around(sides, run.first, run.count)
        rest = [sides[(run.first + run.count + k) % n] for k in range(n - run.count)]
        ends = np.concatenate([rest[-1].points, piece[[0, -1]], rest[0].points, rest[1 % len(rest)].points[:1]])
        if _is_flat(ends):
            polygons.append(piece)
            return [_Side(piece[:1], np.zeros(3)), *rest]
    return None


def _lid(loop: NDArray[np.float64], polygons: list[NDArray[np.float64]]) -> Lid:
    """The points of a loop, and triangles of polygons."""
    vertices, faces, count = [loop], [], len(loop)
    for polygon in polygons:
        vertices.append(polygon)
        faces.append(count + least_triangles(polygon))
        count += len(polygon)
    return Lid(np.concatenate(vertices), np.concatenate(faces), len(loop))
