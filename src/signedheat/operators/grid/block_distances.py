"""Kernels: the exact distance of the nodes of blocks to faces, each block on its own.

Blocks do not know of each other: the result does not depend on which of them are computed together, nor where.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ...geometry.box_tree import LEAF, BoxTree
from ...geometry.face_features import FaceFeatures
from ...geometry.nearest_faces import NearestFaces, search_from
from ...geometry.point_triangle import foot_on_triangle
from ...parallel import n_threads
from .blocks import SIDE

NODES = SIDE**3
"""Nodes of a block."""
TOGETHER = 512
"""Blocks that one thread takes at a time."""


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

    def distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance of each of (n, 3) points to the nearest face."""
        faces, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))

        def part(start: int) -> None:
            here = slice(start, start + TOGETHER * SIDE)
            _nearest(
                self.features.rows, self.tree.bounds, self.tree.items, points[here], NODES, faces[here], squares[here]
            )

        _on_threads(part, range(0, len(points), TOGETHER * SIDE))
        return np.sqrt(squares)

    def search(self, points: NDArray[np.float64]) -> NearestFaces:
        """The nearest face of each of (n, 3) points, which stand together in sequences of `NODES`."""
        faces, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
        _nearest(self.features.rows, self.tree.bounds, self.tree.items, points, NODES, faces, squares)
        return search_from(self.features, points, faces[:, None])


def block_points(places: NDArray[np.int32], steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n · 512, 3) positions of the nodes of blocks, in units of length from the first node of the grid."""
    inner = np.stack(np.meshgrid(*(np.arange(SIDE),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    nodes = places.astype(np.int64)[:, None] * SIDE + inner
    return nodes.reshape(-1, 3) * steps


def _on_threads(part: Callable[[int], None], starts: range) -> None:
    with ThreadPoolExecutor(n_threads()) as pool:
        for job in [pool.submit(part, start) for start in starts]:
            job.result()


@compiled(nogil=True, error_model="numpy")
def _nearest(
    rows: NDArray[np.float64],
    bounds: NDArray[np.float64],
    items: NDArray[np.int64],
    points: NDArray[np.float64],
    run: int,
    out_faces: NDArray[np.int32],
    out_squares: NDArray[np.float64],
) -> None:
    """Nearest face of each point. Every `run` points the search starts anew, in between from the face before."""
    leaves = len(bounds) // 2
    stack, gaps = np.empty(64, dtype=np.int64), np.empty(64)
    before = 0
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        if p % run == 0:
            before = _leaf_near(bounds, items, x, y, z)
        face = before
        best, _, _, _, _ = foot_on_triangle(rows, face, x, y, z)
        depth, stack[0], gaps[0] = 1, 1, 0.0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if gaps[depth] >= best:
                continue
            while node < leaves:
                near = 2 * node
                gap = _gap(bounds, near, x, y, z)
                other = _gap(bounds, near + 1, x, y, z)
                far = near + 1
                if other < gap:
                    near, far, gap, other = far, near, other, gap
                if gap >= best:
                    break
                if other < best:
                    stack[depth], gaps[depth] = far, other
                    depth += 1
                node = near
            if node >= leaves:
                for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                    if items[k] >= 0:
                        square, _, _, _, _ = foot_on_triangle(rows, items[k], x, y, z)
                        if square < best:
                            best, face = square, items[k]
        before = face
        out_faces[p], out_squares[p] = face, best


@compiled(nogil=True, error_model="numpy")
def _leaf_near(bounds: NDArray[np.float64], items: NDArray[np.int64], x: float, y: float, z: float) -> np.int64:
    """Some face near a point: the way down the tree along the nearer box."""
    node, leaves = 1, len(bounds) // 2
    while node < leaves:
        node *= 2
        if _gap(bounds, node + 1, x, y, z) < _gap(bounds, node, x, y, z):
            node += 1
    first: np.int64 = max(items[(node - leaves) * LEAF], np.int64(0))
    return first


@compiled(nogil=True, error_model="numpy")
def _gap(bounds: NDArray[np.float64], node: int, x: float, y: float, z: float) -> float:
    """Squared distance of a point to a box; infinite if there is nothing in it."""
    a = max(bounds[node, 0] - x, x - bounds[node, 3], 0.0)
    b = max(bounds[node, 1] - y, y - bounds[node, 4], 0.0)
    c = max(bounds[node, 2] - z, z - bounds[node, 5], 0.0)
    return float(a * a + b * b + c * c)
