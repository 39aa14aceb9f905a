"""The nearest face of points, through a tree of boxes and discs.

A disc is flat: its plane is that of the faces below a node, its thickness what they deviate from it. Far from a surface
the boxes of many faces are as near as the nearest one's, since boxes stand askew to it; few discs are.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
        """The tree of some faces, of which there is at least one."""
        triangles = features.corners.reshape(-1, 3, 3)
        return cls(features, BoxTree.of(triangles.min(axis=1), triangles.max(axis=1)))

    @cached_property
    def discs(self) -> NDArray[np.float64]:
        """(2 · leaves, 8) centre, normal, radius and half the thickness of what is below each node.

        Thickness is negative where there is no disc, or none that is flat.
        """
        return _discs(self.features.corners.reshape(-1, 3, 3), self.tree)

    def distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance of each of (n, 3) points to the nearest face."""
        faces, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))

        def part(start: int) -> None:
            here = slice(start, start + TOGETHER)
            self._nearest(points[here], faces[here], squares[here])

        _on_threads(part, range(0, len(points), TOGETHER))
        return np.sqrt(squares)

    def search(self, points: NDArray[np.float64]) -> NearestFaces:
        """The nearest face of each of (n, 3) points: fast where those that follow each other are near each other.

        Each `RUN` of points is searched on its own: what comes before does not matter.
        """
        faces, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
        self._nearest(points, faces, squares)
        return search_from(self.features, points, faces[:, None])

    def _nearest(self, points: NDArray[np.float64], faces: NDArray[np.int32], squares: NDArray[np.float64]) -> None:
        descend(self.features.rows, self.tree.bounds, self.discs, self.tree.items, points, RUN, faces, squares)


def _on_threads(part: Callable[[int], None], starts: range) -> None:
    with ThreadPoolExecutor(n_threads()) as pool:
        for job in [pool.submit(part, start) for start in starts]:
            job.result()


def _discs(triangles: NDArray[np.float64], tree: BoxTree) -> NDArray[np.float64]:
    """See `FaceTree.discs`; corners of faces stand for them, which is enough, since discs are convex."""
    leaves = len(tree.bounds) // 2
    discs = np.full((2 * leaves, 8), -1.0)
    grouped = tree.items.reshape(leaves, LEAF)
    filled = np.where(grouped < 0, np.maximum(grouped[:, :1], 0), grouped)  # an empty place repeats the first
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.cross(sides[:, 0], sides[:, 1])
    areas = np.where((grouped < 0)[..., None], 0.0, areas[filled])
    level = leaves
    for _ in range(DISC_LEVELS):
        below = len(filled) // level
        normals = areas.reshape(level, -1, 3).sum(axis=1)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals /= np.where(lengths > 0, lengths, 1.0)
        with np.errstate(invalid="ignore"):  # of nothing
            centres = 0.5 * (tree.bounds[level : 2 * level, :3] + tree.bounds[level : 2 * level, 3:])
        some = np.isfinite(centres).all(axis=1)
        radius, low, high = np.zeros(level), np.full(level, np.inf), np.full(level, -np.inf)
        for k in range(below):
            for each in range(LEAF):
                for corner in range(3):
                    away = triangles[filled.reshape(level, below, LEAF)[:, k, each], corner] - centres
                    along = np.einsum("ij,ij->i", away, normals)
                    np.maximum(high, along, out=high)
                    np.minimum(low, along, out=low)
                    square = np.einsum("ij,ij->i", away, away) - along**2
                    np.maximum(radius, square, out=radius, where=some)
        radius, thickness = np.sqrt(np.maximum(radius, 0.0)), 0.5 * (high - low)
        centres += 0.5 * (high + low)[:, None] * normals
        flat = some & (lengths[:, 0] > 0) & (thickness < FLAT * radius)
        rows = level + np.flatnonzero(flat)
        slack = 1.0 + 1e-9  # lest rounding makes a disc too small
        discs[rows, :3], discs[rows, 3:6] = centres[flat], normals[flat]
        discs[rows, 6] = radius[flat] * slack
        discs[rows, 7] = thickness[flat] * slack + 1e-12 * radius[flat]
        level //= 2
        if level == 0:
            break
    return discs
