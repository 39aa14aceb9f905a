"""The nearest face of points, through a tree of boxes and discs.

A disc is flat: its plane is that of the faces below a node, its thickness what they deviate from it. Far from a surface
the boxes of many faces are as near as the nearest one's, since boxes stand askew to it; few discs are.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import n_threads
from .box_tree import LEAF, BoxTree
from .face_features import FaceFeatures
from .nearest import descend
from .nearest_faces import NearestFaces, search_from

RUN = 512
"""Points after which a search starts anew."""
TOGETHER = 8 * RUN
"""Points that one thread takes at a time."""
DISC_LEVELS = 8
"""Levels of the tree, from the leaves up, that have discs."""
FLAT = 0.5
"""Thickness over radius up to which a disc says more than a box."""
FAR = 1e7
"""Sizes of a surface beyond which a point is searched for where it would be at that distance: neither rounding, which
grows with distance, nor the other angle then moves the nearest place by more than 1e-7 of the size."""


@dataclass(frozen=True, eq=False)
class FaceTree:
    """Faces, and a tree of boxes around them.

    Attributes
    ----------
    features : FaceFeatures
        The faces.
    tree : BoxTree
        Over their boxes.
    """

    features: FaceFeatures
    tree: BoxTree

    @classmethod
    def of(cls, features: FaceFeatures) -> FaceTree:
        """The tree of some faces, of which there is at least one; their order is one along a curve through space."""
        triangles = features.corners.reshape(-1, 3, 3)
        lower, upper = triangles.min(axis=1), triangles.max(axis=1)
        return cls(features, BoxTree.in_order(lower, upper, np.arange(len(triangles))))

    @cached_property
    def discs(self) -> NDArray[np.float64]:
        """(2 · leaves, 8) centre, normal, radius and half the thickness of what is below each node.

        Thickness is negative where there is no disc, or none that is flat.
        """
        discs: NDArray[np.float64] = _discs(self.features.corners, self.tree.bounds, self.tree.items)
        return discs

    def distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance of each of (n, 3) points to the nearest face."""
        distances = np.empty(len(points))

        def part(start: int) -> None:
            here = slice(start, start + TOGETHER)
            distances[here] = self._distances(points[here])

        _on_threads(part, range(0, len(points), TOGETHER))
        return distances

    def search(self, points: NDArray[np.float64]) -> NearestFaces:
        """The nearest face of each of (n, 3) points: fast where those that follow each other are near each other.

        Each `RUN` of points is searched on its own: what comes before does not matter.
        """
        nearer = self._brought_near(points)
        faces, _ = self.nearest(nearer)
        found = search_from(self.features, nearer, faces[:, None])
        return found if nearer is points else replace(found, distances=np.linalg.norm(points - found.feet, axis=1))

    def _distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        nearer = self._brought_near(points)
        if nearer is not points:
            return self.search(points).distances
        distances: NDArray[np.float64] = np.sqrt(self.nearest(points)[1])
        return distances

    def _brought_near(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The points; those beyond `FAR` sizes of the surface on the same ray from its middle, at that distance."""
        lower, upper = self.tree.bounds[1, :3], self.tree.bounds[1, 3:]
        middle, limit = 0.5 * (lower + upper), FAR * float(np.linalg.norm(upper - lower))
        away = points - middle
        distances = np.linalg.norm(away, axis=1)
        far = (distances > limit) & (limit > 0)
        if not far.any():
            return points
        result: NDArray[np.float64] = points.copy()
        result[far] = middle + away[far] * (limit / distances[far])[:, None]
        return result

    def nearest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Nearest faces of points, and the squares of their distances."""
        faces, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
        descend(self.features.rows, self.tree.bounds, self.discs, self.tree.items, points, RUN, faces, squares)
        return faces, squares


def _on_threads(part: Callable[[int], None], starts: range) -> None:
    with ThreadPoolExecutor(n_threads()) as pool:
        for job in [pool.submit(part, start) for start in starts]:
            job.result()


@compiled
def _discs(corners: NDArray[np.float64], bounds: NDArray[np.float64], items: NDArray[np.int64]) -> NDArray[np.float64]:
    """See `FaceTree.discs`; corners of faces stand for them, which is enough, since discs are convex."""
    leaves = len(bounds) // 2
    discs = np.full((2 * leaves, 8), -1.0)
    first = max(1, leaves >> (DISC_LEVELS - 1))
    below = LEAF * leaves // first
    for node in range(first, 2 * leaves):
        if node == 2 * first:
            first, below = node, below // 2
        begin = (node - first) * below
        nx, ny, nz = 0.0, 0.0, 0.0
        for at in range(begin, begin + below):
            if items[at] >= 0:
                f = items[at]
                ax, ay, az = corners[f, 3] - corners[f, 0], corners[f, 4] - corners[f, 1], corners[f, 5] - corners[f, 2]
                bx, by, bz = corners[f, 6] - corners[f, 0], corners[f, 7] - corners[f, 1], corners[f, 8] - corners[f, 2]
                nx, ny, nz = nx + ay * bz - az * by, ny + az * bx - ax * bz, nz + ax * by - ay * bx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not length > 0.0:
            continue
        nx, ny, nz = nx / length, ny / length, nz / length
        x, y = 0.5 * (bounds[node, 0] + bounds[node, 3]), 0.5 * (bounds[node, 1] + bounds[node, 4])
        z = 0.5 * (bounds[node, 2] + bounds[node, 5])
        square, low, high = 0.0, np.inf, -np.inf
        for at in range(begin, begin + below):
            if items[at] >= 0:
                for c in range(0, 9, 3):
                    ax, ay, az = corners[items[at], c] - x, corners[items[at], c + 1] - y, corners[items[at], c + 2] - z
                    along = ax * nx + ay * ny + az * nz
                    low, high = min(low, along), max(high, along)
                    square = max(square, ax * ax + ay * ay + az * az - along * along)
        radius, thickness, middle = np.sqrt(square), 0.5 * (high - low), 0.5 * (high + low)
        if thickness < FLAT * radius:
            slack = 1.0 + 1e-9  # lest rounding makes a disc too small
            discs[node, 0], discs[node, 1], discs[node, 2] = x + middle * nx, y + middle * ny, z + middle * nz
            discs[node, 3], discs[node, 4], discs[node, 5] = nx, ny, nz
            discs[node, 6], discs[node, 7] = radius * slack, thickness * slack + 1e-12 * radius
    return discs
