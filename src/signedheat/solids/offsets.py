"""Surfaces at distances from a solid: round or mitred around edges, at one distance or at one that varies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..errors import SignedHeatError
from ..mesh.box_tree import LEAF
from ..parallel import in_chunks
from ..search.nearest_triangles import foot_on_triangle
from .tiles import Evaluated

Reach: TypeAlias = Callable[[Floats], Floats]
"""Signed distance of the surface from each of (n, 3) places of the solid."""
TOGETHER = 1e-7
"""Distance, over the size of a solid, up to which triangles meet at a place: `keeping.TOGETHER`."""
STEP = 1e-6
"""Step, over the size of a solid, of the differences that say how a distance varies."""
ALONG_AXES = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True, eq=False)
class Offset:
    """The surface at a distance from a solid, as the zero set of a function that grows outwards.

    Attributes
    ----------
    solid : Solid
        What distance is to.
    reach : float or callable
        The distance, negative inside; or one for each nearest place.
    limit : float
        Around edges and corners the surface follows the planes of the faces there up to this many distances; where
        these meet farther out it is cut off by a ball. With 1 it is round: the level of the distance itself.
    """

    solid: Evaluated
    reach: float | Reach
    limit: float = 1.0

    @property
    def level(self) -> float | None:
        """The level of the distance that this is, if it is one."""
        return None if callable(self.reach) or (self.limit > 1 and self.reach != 0) else self.reach

    @property
    def named(self) -> str:
        """What it is, for messages."""
        return "the distance that varies" if callable(self.reach) else f"level {self.reach:g}"

    def distance(self, points: Floats) -> Floats:
        """(n,) heights of (n, 3) points above the surface, negative inside; distances, unless these vary."""
        if self.level is not None:
            heights: Floats = self.solid.distance(points) - self.level
            return heights
        return self._heights(points)[0]

    def slopes(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) distances from the surface, negative inside, and (n, 3) unit vectors along which they grow."""
        heights, gradients = self._heights(points)
        if callable(self.reach):
            gradients = gradients - self._variation(points)
            lengths = np.maximum(np.linalg.norm(gradients, axis=1), 1e-300)
            heights, gradients = heights / lengths, gradients / lengths[:, None]
        return heights, gradients

    def _heights(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) heights, and their (n, 3) gradients as if the distance did not vary."""
        closest = self.solid.closest(points)
        heights, gradients = closest.distances, closest.gradients
        reach = self.reach(closest.points) if callable(self.reach) else np.full(len(points), self.reach)
        if self.limit > 1:
            heights, gradients = self._mitred(points - closest.points, closest.points, heights, gradients, reach)
        return heights - reach, gradients

    def planes(self, points: Floats) -> tuple[Floats, Floats]:
        """(n, 3) places on the surface near points, and its normals there; at level 0 those of nearest triangles."""
        if self.level == 0:
            tree = self.solid.tree
            found = tree.search(points)
            return found.places, tree.features.face_normals[found.faces]
        heights, gradients = self.slopes(points)
        return points - heights[:, None] * gradients, gradients

    def _mitred(
        self, away: Floats, places: Floats, heights: Floats, gradients: Floats, reach: Floats
    ) -> tuple[Floats, Floats]:
        """Distance from the planes around the nearest places in place of that from these, and its gradients."""
        far = np.abs(heights)
        near = np.flatnonzero((heights * reach > 0) & (far >= np.abs(reach)) & (far < 2 * self.limit * np.abs(reach)))
        if not len(near):
            return heights, gradients
        sides = np.sign(reach[near])
        features, tree = self.solid.tree.features, self.solid.tree.tree
        slack = TOGETHER * float(np.ptp(tree.bounds[1].reshape(2, 3), axis=0).max())

        def part(rows: Floats) -> tuple[Floats, Ints]:
            found: tuple[Floats, Ints] = _steepest(features.rows, tree.bounds, tree.items, self._normals, rows, slack)
            return found

        above, faces = in_chunks(part, np.concatenate([places[near], sides[:, None] * away[near]], axis=1))
        beyond = (1 - self.limit) * np.abs(reach[near]) + far[near]  # of the ball that cuts off
        planar = (faces >= 0) & (above > beyond)
        heights, gradients = heights.copy(), gradients.copy()
        heights[near] = sides * np.where(faces >= 0, np.maximum(above, beyond), far[near])
        gradients[near[planar]] = self._normals[faces[planar]]
        return heights, gradients

    @cached_property
    def _normals(self) -> Floats:
        """Of the triangles of the tree; 0 where they do not have the inside behind them only."""
        features = self.solid.tree.features
        return np.where(self.solid.bounding[features.ids][:, None], features.face_normals, 0.0)

    def _variation(self, points: Floats) -> Floats:
        """(n, 3) gradients of the distance of the surface, at the nearest places of points."""
        assert callable(self.reach)
        step = STEP * float(np.ptp(self.solid.tree.tree.bounds[1].reshape(2, 3), axis=0).max())
        around = (points[:, None] + step * ALONG_AXES).reshape(-1, 3)
        found = self.reach(self.solid.tree.search(around).places).reshape(-1, 2, 3)
        result: Floats = (found[:, 0] - found[:, 1]) / (2 * step)
        return result


def checked_reach(reach: Reach) -> Reach:
    """Return the function, refused where it does not give a finite number for each place."""

    def called(places: Floats) -> Floats:
        values = np.asarray(reach(places), dtype=np.float64)
        if values.shape != (len(places),) or not np.isfinite(values).all():
            raise SignedHeatError(
                f"the distance has shape {values.shape} at {len(places)} places, or is not finite",
                remedy="return a finite number for each of (n, 3) places",
                element="distance",
            )
        return values

    return called


@compiled
def _steepest(
    rows: Floats, bounds: Floats, items: Ints, normals: Floats, places: Floats, slack: float
) -> tuple[Floats, Ints]:
    """Of the triangles at each place the one above which a point is the highest, and this height; −1 if there is none.

    Places are given with the ways from them to the points, (n, 6).
    """
    heights, faces = np.full(len(places), -np.inf), np.full(len(places), -1, dtype=np.int64)
    leaves, stack = len(bounds) // 2, np.empty(64, dtype=np.int64)
    for p in range(len(places)):
        x, y, z = places[p, 0], places[p, 1], places[p, 2]
        stack[0], depth = 1, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            apart = False
            for d in range(3):
                apart |= bounds[node, d] > places[p, d] + slack or bounds[node, 3 + d] < places[p, d] - slack
            if apart:
                continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
                continue
            for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                f = items[k]
                if f < 0 or (normals[f, 0] == 0.0 and normals[f, 1] == 0.0 and normals[f, 2] == 0.0):
                    continue
                if foot_on_triangle(rows, f, x, y, z)[0] <= slack * slack:
                    height = normals[f, 0] * places[p, 3] + normals[f, 1] * places[p, 4] + normals[f, 2] * places[p, 5]
                    if height > heights[p]:
                        heights[p], faces[p] = height, f
    return heights, faces
