"""A surface near the nodes of a grid: faces where they are there, crossings of a zero set where they are missing.

Positions are in units of length from the grid's first node. Grids have three axes.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from threading import local

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ...errors import OutsideError
from ...geometry.face_band import nearest_in_band
from ...geometry.face_features import FaceFeatures, Links, Normals
from ...geometry.nearest_faces import NearestFaces, facing, feet_of_nodes, nearest_of_candidates, search_from
from ...geometry.point_triangle import foot_on_triangle
from ...parallel import n_threads
from .closest_points import circle_distance, nearest_tiles, seed_edge_ends
from .wavefront import SMALL, sweep_lines

BAND = 1.0
"""Half width, in cells, of the band in which every face near a node is looked at: at least half a cell's diagonal."""
NEAR = 2.0
"""Cells from a face within which it tells the side."""
PLANES = 16
"""Planes of nodes that one thread goes through, each after the one before."""
ROWS, ROW = 16, 64
"""Lines of a tile of nodes, and nodes of each, in which samples are asked one after the other."""
BEFORE = np.array(sorted(filter(lambda step: step < (0, 0, 0), product((-1, 0, 1), repeat=3)), key=np.linalg.norm))
"""(13, 3) ways to the neighbours of a node that come before it, the three along the axes first."""
CLOSE, APART = 4.0, 1.0
"""Cells from the surface within which neighbours across are asked as well as those along the axes; beyond, cells
between feet from which on a neighbour's is taken to be on another part of the surface: a walk came by the others."""
BESIDE, SLACK = 3.0, 0.1
"""Cells from the surface within which neighbours' faces lead on that are farther, by at most so many cells."""
ROUNDING = 1e-6
"""Of feet in single precision."""


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """What is nearest to each node.

    Attributes
    ----------
    features : FaceFeatures
        The faces.
    crossings : (c, 18) float
        Points of a zero set where there are no faces; see `crossings_at`.
    steps : (3,) float
        Distance between nodes along each axis.
    owners : (s,) int
        Which face each sample lies on, or −1 minus which crossing it is.
    nearest : (*shape) int
        The sample that is nearest to each node, or nearly; see `signed_distances`.
    squares : (*shape) float
        Of the distances to them.
    """

    features: FaceFeatures
    crossings: NDArray[np.float64]
    steps: NDArray[np.float64]
    owners: NDArray[np.int32]
    nearest: NDArray[np.int32]
    squares: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FaceBand:
    """Feet of the nodes near faces.

    Attributes
    ----------
    nearest, squares : (*shape)
        Nearest foot of each node that has a face near it, −1 elsewhere; and the square of its distance.
    feet : (s, 4) float
        Positions, 0 in front.
    faces : (s,) int
        Where they lie.
    """

    nearest: NDArray[np.int32]
    squares: NDArray[np.float32]
    feet: NDArray[np.float32]
    faces: NDArray[np.int32]

    @classmethod
    def of(cls, features: FaceFeatures, shape: tuple[int, ...], steps: NDArray[np.float64]) -> FaceBand:
        """The band of `BAND` cells around faces."""
        nearest, squares = nearest_in_band(features.rows, shape, steps, BAND * float(steps.max()))
        feet, faces = feet_of_nodes(features.rows, nearest, steps)
        return cls(nearest, squares, feet, faces)

    def leave(self, edges: NDArray[np.int32], field: NDArray[np.float64], ends: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which of some crossed edges of the grid may be crossed outside the band, or beside (m,) faces with an end.

        (e, 5) edges as `crossed_edges` gives them, of a field with four axes. A crossing lies at most half a cell from
        the nearer end of its edge; where that is in the band, so nearly is the crossing.
        """
        near, far = edges[:, :4], edges[:, :4].copy()
        far[np.arange(len(edges)), edges[:, 4]] += 1
        swap = np.abs(field[tuple(near.T)]) > np.abs(field[tuple(far.T)])
        nearer = np.where(swap[:, None], far, near)[:, 1:]
        feet: NDArray[np.int32] = self.nearest[tuple(nearer.T)]
        outside: NDArray[np.bool_] = feet < 0
        return outside | ends[self.faces[feet]] if len(ends) and not outside.all() else outside

    def search(self, features: FaceFeatures, points: NDArray[np.float64], steps: NDArray[np.float64]) -> NearestFaces:
        """Nearest face of each of (n, 3) points, among those near the nodes of its cell and one layer around; or −1."""
        candidates = np.empty((len(points), 64), dtype=np.int32)
        _faces_around_cells(points, steps, self.nearest, self.faces, candidates)
        return search_from(features, points, candidates)


def sampled_surface(
    features: FaceFeatures,
    band: FaceBand,
    edges: NDArray[np.int32],
    crossings: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> SampledSurface:
    """Carry the feet of a band, which is used up, and crossings of edges to all nodes (Danielsson 1980).

    Raises
    ------
    OutsideError
        If there is nothing to carry.
    """
    if not len(band.faces) and not len(crossings):
        raise OutsideError(
            "there is nothing to measure distance to: the shape has no faces, and the field one sign everywhere",
            element="shape",
        )
    nearest, squares = band.nearest[None], band.squares[None]
    owners = np.concatenate([band.faces, -1 - np.arange(len(crossings), dtype=np.int32)])
    samples = np.concatenate([band.feet, crossings[:, :4].astype(np.float32)])
    padded = np.array([1.0, *steps])
    if len(crossings):
        seed_edge_ends(nearest, squares, edges, samples, padded, len(band.feet))
    sweep_lines(nearest_tiles, nearest.shape, 1, nearest, squares, samples, padded)
    return SampledSurface(features, crossings, steps, owners, nearest[0], squares[0])


def signed_distances(
    surface: SampledSurface,
    inside: NDArray[np.bool_],
    trusted: NDArray[np.float32],
    telling: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Signed distance of every node to what is nearest to it or its neighbours; and how far that can be trusted.

    Near a face the face tells the side, where the surface is closed and consistent around the foot; elsewhere `inside`.
    ``surface.nearest`` then holds what is nearest itself, as `owners` name it, in place of samples, and
    ``surface.squares`` the confidence.

    Parameters
    ----------
    surface : SampledSurface
        What is near; its samples are used up.
    inside : (*shape) bool
        Sides where no face tells them.
    trusted : (c,) float
        From 0 to 1, for each crossing.
    telling : (s,) bool, optional
        Samples whose faces tell a side; those of open sheets do not.
    """
    shape, nearest, steps = surface.nearest.shape, surface.nearest, surface.steps
    values, confidence = np.empty(shape), surface.squares
    cell, reach = float(steps.max()), float(np.linalg.norm(steps))
    links, normals = surface.features.links, surface.features.normals

    rooms = local()  # memory for feet is taken once for each thread

    def planes(first: int) -> None:
        here = slice(first, first + PLANES)
        if not hasattr(rooms, "feet"):
            rooms.feet = np.empty((PLANES, *shape[1:], 3), dtype=np.float32)
        told = np.zeros((0, 0, 0), dtype=np.bool_) if telling is None else telling[nearest[here]]
        places = (nearest[here], values[here], rooms.feet[: len(nearest[here])])
        _nearest_to_samples(links, surface.owners, surface.crossings, steps, reach, first, *places)
        for way in (1, -1):
            _nearest_to_neighbours(links, steps, first, cell, way, *places)
        _confidences(surface.features.trusted, trusted, nearest[here], confidence[here])
        _signs(surface.features.rows, normals, told, steps, first, NEAR * cell, inside[here], *places[:2])

    threads = n_threads() if nearest.size >= SMALL else 1
    with ThreadPoolExecutor(threads) as pool:
        for job in [pool.submit(planes, first) for first in range(0, shape[0], PLANES)]:
            job.result()
    return values, confidence


@compiled
def _nearest_to_samples(
    links: Links,
    owners: NDArray[np.int32],
    crossings: NDArray[np.float64],
    steps: NDArray[np.float64],
    reach: float,
    first: int,
    nearest: NDArray[np.int32],
    values: NDArray[np.float64],
    feet: NDArray[np.float32],
) -> None:
    """Faces that the nearest samples of planes of nodes lead to, distances, and feet; or crossings, −1 minus which.

    In tiles, lest each line asks for faces that were just forgotten.
    """
    planes, n1, n2 = nearest.shape
    points, candidates = np.empty((ROW, 3)), np.empty((ROW, 1), dtype=np.int32)
    found, squares = np.empty(ROW, dtype=np.int32), np.empty(ROW)
    codes, places = np.empty(ROW, dtype=np.int8), np.empty((ROW, 3))
    away, side = np.zeros(4), np.empty(4)
    for j0 in range(0, n1, ROWS):
        for k0 in range(0, n2, ROW):
            count = min(ROW, n2 - k0)
            for i in range(planes):
                for j in range(j0, min(j0 + ROWS, n1)):
                    for q in range(count):
                        points[q, 0], points[q, 1] = (first + i) * steps[0], j * steps[1]
                        points[q, 2] = (k0 + q) * steps[2]
                        candidates[q, 0] = owners[nearest[i, j, k0 + q]]
                    nearest_of_candidates(links, points[:count], candidates[:count], found, squares, codes, places)
                    for q in range(count):
                        k = k0 + q
                        nearest[i, j, k], values[i, j, k] = found[q], np.sqrt(squares[q])
                        if candidates[q, 0] < 0:
                            c = -1 - np.int64(candidates[q, 0])
                            for d in range(3):
                                away[1 + d] = points[q, d] - crossings[c, 1 + d]
                            nearest[i, j, k] = candidates[q, 0]
                            values[i, j, k] = circle_distance(crossings[c], away, side, reach)
                        for d in range(3):
                            feet[i, j, k, d] = places[q, d]


@compiled
def _nearest_to_neighbours(
    links: Links,
    steps: NDArray[np.float64],
    first: int,
    cell: float,
    way: int,
    nearest: NDArray[np.int32],
    values: NDArray[np.float64],
    feet: NDArray[np.float32],
) -> None:
    """What is nearest to the nodes before, and from there, where that is nearer; upwards or downwards.

    The distance d to a triangle is convex, so at x it is at least ``d(y) + ∇d(y) · (x − y)``: most neighbours' faces
    need not be asked. Others are, before a walk begins from them, unless the node is nearest to a crossing.
    """
    rows, across = links[0], links[3]
    planes, n1, n2 = nearest.shape
    points, candidates = np.empty((len(BEFORE) * n2, 3)), np.empty((len(BEFORE) * n2, 1), dtype=np.int32)
    found, squares = np.empty(len(BEFORE) * n2, dtype=np.int32), np.empty(len(BEFORE) * n2)
    codes, places, nodes = (
        np.empty(len(BEFORE) * n2, dtype=np.int8),
        np.empty((len(BEFORE) * n2, 3)),
        np.empty(len(BEFORE) * n2, dtype=np.int64),
    )
    for line in range(planes * n1):
        at = line if way > 0 else planes * n1 - 1 - line
        i, j, count = at // n1, at % n1, 0
        for step in range(n2):
            k = step if way > 0 else n2 - 1 - step
            value = values[i, j, k]
            for m in range(len(BEFORE) if value < CLOSE * cell else 3):
                u, v, w = BEFORE[m]
                a, b, c = i + way * u, j + way * v, k + way * w
                if not (0 <= a < planes and 0 <= b < n1 and 0 <= c < n2):
                    continue
                other = nearest[a, b, c]
                if other < 0 or other == nearest[i, j, k]:
                    continue
                near = values[a, b, c]
                least = near * near - way * (
                    ((first + a) * steps[0] - feet[a, b, c, 0]) * u * steps[0]
                    + (b * steps[1] - feet[a, b, c, 1]) * v * steps[1]
                    + (c * steps[2] - feet[a, b, c, 2]) * w * steps[2]
                )
                if least >= near * value * (1.0 - ROUNDING):
                    continue
                if (
                    value >= CLOSE * cell
                    and nearest[i, j, k] >= 0
                    and across[other, 0] >= 0
                    and across[other, 1] >= 0
                    and across[other, 2] >= 0
                ):
                    square = (feet[a, b, c, 0] - feet[i, j, k, 0]) ** 2 + (feet[a, b, c, 1] - feet[i, j, k, 1]) ** 2
                    if square + (feet[a, b, c, 2] - feet[i, j, k, 2]) ** 2 < (APART * cell) ** 2:
                        continue
                x, y, z = (first + i) * steps[0], j * steps[1], k * steps[2]
                most = value + (SLACK * cell if value < BESIDE * cell else 0.0)
                if nearest[i, j, k] >= 0 and foot_on_triangle(rows, other, x, y, z)[0] >= most * most:
                    continue
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                candidates[count, 0], nodes[count] = other, k
                count += 1
        if count == 0:
            continue
        nearest_of_candidates(links, points[:count], candidates[:count], found, squares, codes, places)
        for q in range(count):
            k, distance = nodes[q], np.sqrt(squares[q])
            if distance < values[i, j, k]:
                nearest[i, j, k], values[i, j, k] = found[q], distance
                for d in range(3):
                    feet[i, j, k, d] = places[q, d]


@compiled
def _confidences(
    faces: NDArray[np.float32],
    crossings: NDArray[np.float32],
    nearest: NDArray[np.int32],
    confidence: NDArray[np.float32],
) -> None:
    planes, n1, n2 = nearest.shape
    for i in range(planes):
        for j in range(n1):
            for k in range(n2):
                which = np.int64(nearest[i, j, k])
                confidence[i, j, k] = crossings[-1 - which] if which < 0 else faces[which]


@compiled
def _signs(
    rows: NDArray[np.float64],
    normals: Normals,
    told: NDArray[np.bool_],
    steps: NDArray[np.float64],
    first: int,
    near: float,
    inside: NDArray[np.bool_],
    nearest: NDArray[np.int32],
    values: NDArray[np.float64],
) -> None:
    """Negative values where faces nearer than `near` tell so, else `inside`; where `told`, if it holds anything."""
    planes, n1, n2 = nearest.shape
    points, found = np.empty((n2, 3)), np.empty(n2, dtype=np.int32)
    codes, places, nodes = np.empty(n2, dtype=np.int8), np.empty((n2, 3)), np.empty(n2, dtype=np.int64)
    cosines, regular, behind = (
        np.empty(n2, dtype=np.float32),
        np.empty(n2, dtype=np.bool_),
        np.empty(n2, dtype=np.bool_),
    )
    for i in range(planes):
        for j in range(n1):
            count = 0
            for k in range(n2):
                behind[k] = inside[i, j, k]
                if nearest[i, j, k] >= 0 and values[i, j, k] < near and (len(told) == 0 or told[i, j, k]):
                    points[count, 0], points[count, 1] = (first + i) * steps[0], j * steps[1]
                    points[count, 2] = k * steps[2]
                    found[count], nodes[count] = nearest[i, j, k], k
                    count += 1
            if count > 0:
                for q in range(count):
                    _, codes[q], places[q, 0], places[q, 1], places[q, 2] = foot_on_triangle(
                        rows, found[q], points[q, 0], points[q, 1], points[q, 2]
                    )
                facing(normals, points[:count], found, codes, places, cosines, regular)
                for q in range(count):
                    if regular[q]:
                        behind[nodes[q]] = cosines[q] < 0.0
            for k in range(n2):
                if behind[k]:
                    values[i, j, k] = -values[i, j, k]


@compiled
def _faces_around_cells(
    points: NDArray[np.float64],
    steps: NDArray[np.float64],
    nearest: NDArray[np.int32],
    faces: NDArray[np.int32],
    candidates: NDArray[np.int32],
) -> None:
    """Faces near the 4³ nodes around each point; −1 where a node has none, or the one before has the same."""
    n0, n1, n2 = nearest.shape
    for p in range(len(points)):
        i0 = np.int64(np.floor(points[p, 0] / steps[0])) - 1
        j0 = np.int64(np.floor(points[p, 1] / steps[1])) - 1
        k0 = np.int64(np.floor(points[p, 2] / steps[2])) - 1
        at = 0
        for i in range(i0, i0 + 4):
            for j in range(j0, j0 + 4):
                for k in range(k0, k0 + 4):
                    candidates[p, at] = -1
                    if 0 <= i < n0 and 0 <= j < n1 and 0 <= k < n2 and nearest[i, j, k] >= 0:
                        candidates[p, at] = faces[nearest[i, j, k]]
                    at += 1
