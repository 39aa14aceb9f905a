"""A surface of faces and crossings, to which distance is exact anywhere; and points of its levels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...frozen import Frozen
from ...geometry.box_tree import BoxTree
from ...geometry.face_features import FaceFeatures
from ...geometry.nearest import nearest_on_triangles
from ...geometry.nearest_faces import search_from
from .closest_points import distances_to_crossings

CLOSE = 1e-3
"""Cells off a level that a point may be and stay as it is."""
ROUNDS = 10
"""Times a point is moved at most."""
CLEARANCE = 1e-3
"""Fraction of a cell that points of a level keep from the nodes."""


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
    """

    features: FaceFeatures
    crossings: NDArray[np.float64]
    origin: NDArray[np.float64]
    steps: NDArray[np.float64]
    telling: NDArray[np.bool_] | None = None

    @cached_property
    def _tree(self) -> BoxTree:
        triangles = self.features.corners.reshape(-1, 3, 3)
        return BoxTree.of(triangles.min(axis=1), triangles.max(axis=1))

    def distances(self, points: NDArray[np.float64], guess: float) -> NDArray[np.float64]:
        """(n,) signed distances of (n, 3) points around `origin`.

        Where no face tells the side they have the sign of `guess`, and are NaN where that is 0.
        """
        distances, signs = np.full(len(points), np.inf), np.full(len(points), np.sign(guess))
        if len(self.features.corners):
            near, _ = nearest_on_triangles(self.features.corners.reshape(-1, 3, 3), self._tree, points)
            found = search_from(self.features, points, near.astype(np.int32)[:, None])
            distances = found.distances
            told = found.regular if self.telling is None else found.regular & self.telling[found.faces]
            signs = np.where(told, np.where(found.cosines < 0, -1.0, 1.0), signs)
        if len(self.crossings):
            _, nearest = scipy.spatial.cKDTree(self.crossings[:, 1:4]).query(points)
            other = np.empty(len(points))
            reach = float(np.linalg.norm(self.steps))
            distances_to_crossings(points, nearest.astype(np.int32), self.crossings, reach, other)
            signs = np.where(other < distances, np.sign(guess), signs)
            distances = np.minimum(distances, other)
        return np.where(signs == 0, np.nan, np.where(signs < 0, -distances, distances))

    def on_level(self, points: NDArray[np.float64], values: NDArray[np.float64], level: float) -> NDArray[np.float64]:
        """Points on edges of the grid, where values of the nodes pass a level, moved along to where distance does.

        By regula falsi, halving the weight of an end that stays twice (Dowell & Jarratt 1971). The ends of an edge keep
        the sides that their values have, so that every point stays on its edge. Points inside cells stay, and so do
        those whose side nothing tells.

        Parameters
        ----------
        points : (n, 3) float
            Where linear interpolation passes the level.
        values : (*shape) float
            Of the nodes.
        level : float
            Which.
        """
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
        start, stop, last = np.zeros(len(movable)), np.ones(len(movable)), np.zeros(len(movable), dtype=np.int8)
        active = np.flatnonzero((low < 0) != (high < 0))
        step = float(self.steps.min())
        for _ in range(ROUNDS):
            if not len(active):
                break
            share = low[active] / (low[active] - high[active])
            share = np.clip(start[active] + share * (stop[active] - start[active]), CLEARANCE, 1 - CLEARANCE)
            at = base[active].astype(np.float64)
            at[np.arange(len(active)), axis[active]] += share
            at *= self.steps
            moved[movable[active]] = self.origin + at
            off = self.distances(at, level) - level
            same = (off < 0) == (low[active] < 0)
            ahead, behind = active[same], active[~same]
            start[ahead], low[ahead] = share[same], off[same]
            stop[behind], high[behind] = share[~same], off[~same]
            high[ahead] *= np.where(last[ahead] > 0, 0.5, 1.0)
            low[behind] *= np.where(last[behind] < 0, 0.5, 1.0)
            last[ahead], last[behind] = 1, -1
            active = active[np.abs(off) > CLOSE * step]  # not where it is NaN
        return moved
