"""A surface of faces and crossings, to which distance is exact anywhere; and points of its levels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from ...compiled import compiled
from ...frozen import Frozen
from ...geometry.box_tree import morton_codes
from ...geometry.face_features import FaceFeatures
from ...geometry.face_tree import FaceTree
from ...geometry.nearest_faces import NearestFaces, search_from
from ...parallel import in_chunks
from .closest_points import distances_to_crossings
from .sampled_surface import NEAR

CLOSE = 1e-3
"""Cells off a level that a point may be and stay as it is."""
ROUNDS = 10
"""Times a point is moved at most."""
PRESSES, FARTHEST = 2, 0.5
"""Times that a point is moved off its edge, and how many cells at most."""
CLEARANCE = 1e-3
"""Fraction of a cell that points of a level keep from the nodes."""
MANY = 1 << 18
"""Points that are ordered together."""
APART = 2.0
"""Cells between corners of the faces nearest to the nodes of an edge from which on more than these are asked."""
_BENDING = ((0, 0, 10), (1, 0, 12), (1, 1, 13), (2, 0, 15), (2, 1, 16), (2, 2, 17))
"""Row, column and place among the numbers of a crossing of its shape operator in space."""


class NodeValues(Protocol):
    """Values of nodes by their indices: an array, or what stands for one."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    def __getitem__(self, nodes: tuple[NDArray[np.int64], ...], /) -> NDArray[np.float64]: ...


@dataclass(frozen=True, eq=False)
class SurfacePlaces:
    """What of a surface is nearest to each of some points.

    Attributes
    ----------
    distances : (n,) float
        To it, without a sign.
    feet : (n, 3) float
        The nearest place, around the origin of the surface.
    directions : (n, 3) float
        Unit vectors from there to the point; where distance is 0, normals.
    sides : (n,) float
        −1 behind, 1 in front of a face that tells the side; 0 where none does within `NEAR` cells.
    completed : (n,) bool
        Whether the nearest place is on the zero set, where there are no faces.
    restored : (n,) bool
        Whether it is on a face that was put back.
    """

    distances: NDArray[np.float64]
    feet: NDArray[np.float64]
    directions: NDArray[np.float64]
    sides: NDArray[np.float64]
    completed: NDArray[np.bool_]
    restored: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ExactSurface(Frozen):
    """Faces, and crossings of a zero set where there are none.

    Attributes
    ----------
    features : FaceFeatures
        The faces, around `origin`.
    crossings : (c, 18) float
        See `crossings_at`; around `origin` likewise.
    origin, steps : (3,) float
        First node of the grid, and distance between its nodes.
    telling : (m,) bool, optional
        Faces that tell a side; those of open sheets do not.
    nodes : (*shape) int, optional
        What is nearest to each node of the grid: a face, or −1 minus a crossing.
    asked : (m,) bool, optional
        Faces beside which a winding number does, of the place itself.
    share : float
        Of the surface that is there, by which winding numbers are divided.
    closed : bool
        Whether winding numbers tell all sides, since the faces bound closed bodies, or their union.
    """

    features: FaceFeatures
    crossings: NDArray[np.float64]
    origin: NDArray[np.float64]
    steps: NDArray[np.float64]
    telling: NDArray[np.bool_] | None = None
    nodes: NDArray[np.int32] | None = None
    asked: NDArray[np.bool_] | None = None
    share: float = 1.0
    closed: bool = False

    @cached_property
    def tree(self) -> FaceTree:
        """Of the faces, of which there is at least one."""
        return FaceTree.of(self.features)

    @cached_property
    def _crossing_tree(self) -> scipy.spatial.cKDTree:
        return scipy.spatial.cKDTree(self.crossings[:, 1:4])

    def nearest(self, points: NDArray[np.float64]) -> SurfacePlaces:
        """The nearest place of each of (n, 3) points around `origin`, in time O(n log m), on all threads.

        Points are ordered along a curve through space: neighbours have nearly the same way through the tree.
        """
        results = _empty_places(len(points))
        for begin in range(0, len(points), MANY):
            here = slice(begin, begin + MANY)
            for result, part in zip(results, self._nearest_of_many(points[here]), strict=True):
                result[here] = part
        return SurfacePlaces(*results)

    def _nearest_of_many(self, points: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
        """The attributes of `SurfacePlaces`, for points of which there is memory for some more."""
        order = np.argsort(morton_codes(points), kind="stable") if len(points) else np.zeros(0, dtype=np.int64)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return tuple(part[back] for part in in_chunks(self._nearest_in_order, points[order]))

    def _nearest_in_order(self, points: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
        """The same for points that follow each other in space."""
        if not len(points):
            return _empty_places(0)
        found = self.tree.search(points) if len(self.features.corners) else None
        limits = np.full(len(points), np.inf) if found is None else found.distances + float(np.linalg.norm(self.steps))
        near, which = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        if len(self.crossings):
            near, which = self._nearest_crossings(points, limits)
        return self._nearer(points, found, near, which)

    def _nearest_to_nodes(self, points: NDArray[np.float64], labels: NDArray[np.int32]) -> tuple[NDArray[Any], ...]:
        """The same of what is nearest to some nodes around each point, (n, k) as `nodes` names it."""
        found = None
        if len(self.features.corners):
            found = search_from(self.features, points, np.where(labels < 0, -1, labels))
        near, which = np.flatnonzero((labels < 0).any(axis=1)), np.zeros(0, dtype=np.int64)
        if len(near):
            crossings = np.maximum(-1 - labels[near].astype(np.int64), 0)
            squares = ((self.crossings[crossings, 1:4] - points[near, None]) ** 2).sum(axis=2)
            chosen = np.where(labels[near] < 0, squares, np.inf).argmin(axis=1)
            which = crossings[np.arange(len(near)), chosen]
        return self._nearer(points, found, near, which)

    def _labels_around(
        self, base: NDArray[np.int64], axis: NDArray[np.int64]
    ) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """(n, 10) what is nearest to the nodes around edges, and whether that is not all on one part of the surface."""
        if self.nodes is None:
            return np.zeros((len(base), 0), dtype=np.int32), np.ones(len(base), dtype=bool)
        along = np.eye(3, dtype=np.int64)[axis]
        across = np.roll(along, 1, axis=1), np.roll(along, 2, axis=1)
        beside = np.stack([0 * along, across[0], -across[0], across[1], -across[1]], axis=1)
        places = base[:, None] + np.concatenate([beside, beside + along[:, None]], axis=1)
        places = np.clip(places, 0, np.array(self.nodes.shape) - 1)  # at the walls some of them twice
        labels = self.nodes[tuple(np.moveaxis(places, 2, 0))]
        return labels, _apart(self.features.rows, labels, (APART * float(self.steps.max())) ** 2)

    def _level_at(
        self, points: NDArray[np.float64], labels: NDArray[np.int32], doubtful: NDArray[np.bool_], guess: float
    ) -> NDArray[np.float64]:
        """(n,) signed distances of points between nodes; the side is that of `guess` where none is told, NaN if 0."""
        result = np.empty(len(points))
        for rows, found in (
            (doubtful, self._nearest_of_many(points[doubtful])),
            (~doubtful, self._nearest_to_nodes(points[~doubtful], labels[~doubtful])),
        ):
            result[rows] = self._signed(found, guess)
        return result

    @staticmethod
    def _signed(found: tuple[NDArray[Any], ...], guess: float) -> NDArray[np.float64]:
        """Distances with the sides that are told, or that of `guess`; NaN if that is 0."""
        distances, sides = found[0], found[3]
        signs = np.where(sides == 0, np.sign(guess), sides)
        return np.where(signs == 0, np.nan, np.where(signs < 0, -distances, distances))

    def _nearer(
        self,
        points: NDArray[np.float64],
        found: NearestFaces | None,
        near: NDArray[np.int64],
        which: NDArray[np.int64],
    ) -> tuple[NDArray[Any], ...]:
        """Of the face found for each point, and of the crossings `which` for those at `near`, what is nearer."""
        n = len(points)
        distances, feet, directions = np.full(n, np.inf), points.copy(), np.zeros((n, 3))
        sides, completed, restored = np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        if found is not None:
            distances, feet = found.distances, found.feet
            directions = self.features.face_normals[found.faces]
            restored = self.features.trusted[found.faces] < 1.0
            told = found.regular if self.telling is None else found.regular & self.telling[found.faces]
            told &= distances <= NEAR * float(self.steps.max())
            sides = np.where(told, np.where(found.cosines < 0, -1.0, 1.0), 0.0)
        if len(near):
            reach = float(np.linalg.norm(self.steps))
            there, rows = points[near], self.crossings[which]
            other = np.empty(len(near))
            distances_to_crossings(there, which.astype(np.int32), self.crossings, reach, other)
            touched = there - other[:, None] * away_from_circles(there, rows)
            straight = np.linalg.norm(there - rows[:, 1:4], axis=1)
            strayed = np.linalg.norm(touched - rows[:, 1:4], axis=1) > 0.5 * reach  # off the end of the zero set
            strayed |= other >= straight
            touched[strayed] = rows[strayed, 1:4]
            other = np.where(strayed, straight, other)
            nearer = other < distances[near]
            taken = near[nearer]
            completed[taken], restored[taken], sides[taken] = True, False, 0.0
            distances[taken], feet[taken], directions[taken] = other[nearer], touched[nearer], rows[nearer, 5:8]
        apart = points - feet
        lengths = np.linalg.norm(apart, axis=1)
        clear = lengths > 1e-12 * np.abs(points).max(initial=1e-290)
        directions = np.where(clear[:, None], apart / np.where(clear, lengths, 1.0)[:, None], directions)
        return np.where(clear, distances, 0.0), feet, directions, sides, completed, restored

    def _nearest_crossings(
        self, points: NDArray[np.float64], limits: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Those of (n, 3) points that may have a crossing within their limit, and the nearest for each.

        Points with limits of about the same size are asked for together: most are near a face, and far from any
        crossing, where a search without a limit is slow.
        """
        sizes = np.minimum(np.ceil(2 * np.log2(limits / float(self.steps.max()))), np.finfo(np.float64).maxexp)
        found, which = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for size in np.unique(sizes):
            rows = np.flatnonzero(sizes == size)
            limit = float(limits[rows].max()) * (1 + 1e-9)
            _, nearest = self._crossing_tree.query(points[rows], distance_upper_bound=limit)
            there = nearest < len(self.crossings)
            found.append(rows[there])
            which.append(nearest[there])
        return np.concatenate(found), np.concatenate(which)

    def on_level(self, points: NDArray[np.float64], values: NodeValues, level: float) -> NDArray[np.float64]:
        """Points on edges of the grid, where values of the nodes pass a level, moved along to where distance does.

        By regula falsi, halving the weight of an end that stays twice (Dowell & Jarratt 1971). The ends of an edge keep
        the sides that their values have, so that points stay on their edges, but for those whose node's value is wrong:
        they are moved onto the level beside it. Points inside cells stay, and so do those whose side nothing tells.
        Where `nodes` is known, what is nearest to those around an edge is asked first.

        Parameters
        ----------
        points : (n, 3) float
            Where linear interpolation passes the level.
        values : (*shape) float
            Of the nodes.
        level : float
            Which.
        """
        (moved,) = in_chunks(lambda chunk: (self._on_level(chunk, values, level),), points)
        return moved

    def _on_level(self, points: NDArray[np.float64], values: NodeValues, level: float) -> NDArray[np.float64]:
        cells = (points - self.origin) / self.steps
        near = np.rint(cells)
        cells = np.where(np.abs(cells - near) < 0.5 * CLEARANCE, near, cells)
        base = np.floor(cells).astype(np.int64)
        fraction = cells - base
        axis = fraction.argmax(axis=1)
        rows = np.arange(len(points))
        upper = base.copy()
        upper[rows, axis] += 1
        inside = (base >= 0).all(axis=1) & (upper < np.array(values.shape)).all(axis=1)
        movable = np.flatnonzero(inside & ((fraction > 0).sum(axis=1) == 1))
        base, upper, axis = base[movable], upper[movable], axis[movable]
        low, high = (values[tuple(at.T)] - level for at in (base, upper))
        moved = np.array(points, dtype=np.float64)
        if not len(movable):
            return moved
        crossed = np.flatnonzero((low < 0) != (high < 0))
        edges = base[crossed], axis[crossed], low[crossed], high[crossed]
        labels, doubtful = self._labels_around(*edges[:2])
        at, off = self._crossings_of(*edges, labels, doubtful, level)
        step = float(self.steps.min())
        wrong = np.flatnonzero(~doubtful & (labels[:, :1] < 0).any(axis=1))  # on completed surface no walk leads on
        wrong = wrong[np.abs(self._signed(self._nearest_of_many(at[wrong]), level) - level) > CLOSE * step]
        if len(wrong):
            again = edges[0][wrong], edges[1][wrong], edges[2][wrong], edges[3][wrong]
            at[wrong], off[wrong] = self._crossings_of(*again, labels[wrong], np.ones(len(wrong), dtype=bool), level)
        self._press_on(at, np.flatnonzero(np.abs(off) > CLOSE * step), level)
        moved[movable[crossed]] = self.origin + at
        return moved

    def _crossings_of(
        self,
        base: NDArray[np.int64],
        axis: NDArray[np.int64],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        labels: NDArray[np.int32],
        doubtful: NDArray[np.bool_],
        level: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(e, 3) where edges pass the level, and how far off it distance is there; by the values of their ends."""
        n = len(base)
        low, high = low.copy(), high.copy()
        start, stop, last = np.zeros(n), np.ones(n), np.zeros(n, dtype=np.int8)
        result, deviation = np.empty((n, 3)), np.zeros(n)
        active = np.arange(n)
        for _ in range(ROUNDS):
            if not len(active):
                break
            share = low[active] / (low[active] - high[active])
            share = np.clip(start[active] + share * (stop[active] - start[active]), CLEARANCE, 1 - CLEARANCE)
            at = base[active].astype(np.float64)
            at[np.arange(len(active)), axis[active]] += share
            at *= self.steps
            off = self._level_at(at, labels[active], doubtful[active], level) - level
            result[active], deviation[active] = at, off
            same = (off < 0) == (low[active] < 0)
            ahead, behind = active[same], active[~same]
            start[ahead], low[ahead] = share[same], off[same]
            stop[behind], high[behind] = share[~same], off[~same]
            high[ahead] *= np.where(last[ahead] > 0, 0.5, 1.0)
            low[behind] *= np.where(last[behind] < 0, 0.5, 1.0)
            last[ahead], last[behind] = 1, -1
            active = active[np.abs(off) > CLOSE * float(self.steps.min())]  # not where it is NaN
        return result, deviation

    def _press_on(self, at: NDArray[np.float64], rows: NDArray[np.int64], level: float) -> None:
        """Move, in place, points whose edge does not pass the level after all onto it, away from their nearest place.

        That is so where a node missed a nearer face by a fraction of a cell, and its value is that much too large.
        """
        cell = float(self.steps.min())
        for _ in range(PRESSES):
            if not len(rows):
                return
            found = self._nearest_of_many(at[rows])
            off = self._signed(found, level) - level
            near = np.abs(off) < FARTHEST * cell  # not where it is NaN
            rows, off, signs = rows[near], off[near], np.where(self._signed(found, level)[near] < 0, -1.0, 1.0)
            at[rows] -= (off * signs)[:, None] * found[2][near]
            rows = rows[np.abs(off) > CLOSE * cell]


def _empty_places(n: int) -> tuple[NDArray[Any], ...]:
    """Room for the attributes of `SurfacePlaces`."""
    flags = np.empty(n, dtype=bool), np.empty(n, dtype=bool)
    return np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n), *flags


@compiled(nogil=True)
def _apart(rows: NDArray[np.float64], labels: NDArray[np.int32], limit: float) -> NDArray[np.bool_]:
    """(n,) whether some of (n, k) labels are faces and others are not, or faces are farther apart than a limit."""
    result = np.zeros(len(labels), dtype=np.bool_)
    for p in range(len(labels)):
        first = np.int64(labels[p, 0])
        for c in range(1, labels.shape[1]):
            other = np.int64(labels[p, c])
            if (first < 0) != (other < 0):
                result[p] = True
            elif first >= 0 and other != first:
                square = (rows[other, 0] - rows[first, 0]) ** 2 + (rows[other, 1] - rows[first, 1]) ** 2
                result[p] |= square + (rows[other, 2] - rows[first, 2]) ** 2 > limit
    return result


def away_from_circles(points: NDArray[np.float64], crossings: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) unit vectors to points from the nearest place of the circle that touches at a crossing: `circle_distance`.

    With s along the normal n, r across it and bending k, they point along ``(1 + ks) n + kr``, from inside the circle
    the other way.
    """
    normals = crossings[:, 5:8]
    away = points - crossings[:, 1:4]
    along = np.einsum("ij,ij->i", away, normals)
    across = away - along[:, None] * normals
    bending = np.empty((len(crossings), 3, 3))
    for row, column, at in _BENDING:
        bending[:, row, column] = bending[:, column, row] = crossings[:, at]
    square = np.einsum("ij,ij->i", across, across)
    bend = np.einsum("ij,ijk,ik->i", across, bending, across) / np.where(square > 0, square, 1.0)
    slope = (1.0 + bend * along)[:, None] * normals + bend[:, None] * across
    lengths = np.linalg.norm(slope, axis=1, keepdims=True)
    slope = np.where(lengths > 0, slope / np.where(lengths > 0, lengths, 1.0), normals)
    in_front = 2.0 * along + bend * np.einsum("ij,ij->i", away, away) >= 0
    result: NDArray[np.float64] = np.where(in_front[:, None], slope, -slope)
    return result
