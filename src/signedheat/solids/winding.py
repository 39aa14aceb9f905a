"""Inside: where the winding number of all that bounds a solid is above a half."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ..frozen import Frozen
from ..geometry.directions import axes_across
from ..geometry.edges import edge_table
from ..geometry.meshes import area_vectors
from ..geometry.welding import same_positions
from ..geometry.winding_tree import WindingTree

INSIDE = 0.5
"""Winding number above which a point is inside; it is near 0 or 1, except close to slits."""
DEPTH = 1e-6
"""Size of a face by which places in front of it and behind it are off it."""
TUBES = 1e-4 * 2.0 ** np.arange(11)
"""Radii of tubes around open edges on which winding numbers are computed, over the size of all triangles. The first
is enough where a lid has more vertices than the face next to it; seams of what φ completes need one of .003 to .02."""
SIDED = 0.4
"""How far winding numbers there may be from integers: a half, less twice the largest error of the tree."""
SPOTS = np.array([0.1, 0.5, 0.9])
"""Places along each edge; not its ends, where it may meet a face at a right angle."""
AT_ONCE = 256
"""Open edges that are dealt with together."""


@dataclass(frozen=True, eq=False)
class Windings(Frozen):
    """Winding numbers of oriented triangles that together close.

    Attributes
    ----------
    triangles : (m, 3, 3) float
        Corners.
    """

    triangles: NDArray[np.float64]

    @cached_property
    def tree(self) -> WindingTree:
        """Over the triangles, of which there is at least one."""
        return WindingTree.of(self.triangles)

    @cached_property
    def sided_beyond(self) -> float:
        """Distance to all triangles from which on sides change across them only.

        It is 0 if as many triangles run along each edge in one direction as in the other. Otherwise there are gaps:
        slits as wide as rounding where a lid has more vertices on an edge than the face next to it, and wider ones
        where φ completes. Winding numbers are harmonic, so that outside of tubes around the open edges they are nowhere
        farther from integers than on these tubes. The result is the least radius at which they are near integers there;
        infinity if there is none.
        """
        if not len(self.triangles):
            return 0.0
        ends = _open_edges(self.triangles)
        size = float(np.ptp(self.triangles.reshape(-1, 3), axis=0).max())
        spots = ends[:, :1] + SPOTS[:, None] * (ends[:, 1:] - ends[:, :1])
        others = scipy.spatial.cKDTree(spots.reshape(-1, 3)) if len(ends) else None
        rung = 0
        for begin in range(0, len(ends), AT_ONCE):
            here = slice(begin, begin + AT_ONCE)
            while not self._sided(_around(ends[here], spots[here], size * TUBES[rung]), others, size * TUBES[rung]):
                rung += 1
                if rung == len(TUBES):
                    return np.inf
        return size * float(TUBES[rung]) if len(ends) else 0.0

    def _sided(self, points: NDArray[np.float64], spots: scipy.spatial.cKDTree, radius: float) -> bool:
        """Whether points that are not within a radius of any spot are clearly inside or clearly outside."""
        within = 0.999 * radius
        off = spots.query(points, distance_upper_bound=within)[0] > within
        numbers = self.numbers(points[off])
        return bool((np.abs(numbers - np.round(numbers)) < SIDED).all())

    def numbers(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) winding numbers."""
        return self.tree.numbers(points) if len(self.triangles) else np.zeros(len(points))

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether points are inside."""
        result: NDArray[np.bool_] = self.numbers(points) > INSIDE
        return result

    def sides(self, triangles: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(n,) whether places just behind (n, 3, 3) triangles are inside; and the same just in front of them."""
        vectors = 2.0 * area_vectors(triangles)
        areas = np.linalg.norm(vectors, axis=1)
        step = DEPTH * vectors * (np.sqrt(areas) / np.where(areas > 0, areas, 1.0))[:, None]
        centres = triangles.mean(axis=1)
        return self.inside(centres - step), self.inside(centres + step)


def _open_edges(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) ends of edges along which more triangles run in one direction than in the other."""
    corners = triangles.reshape(-1, 3)
    faces = same_positions(corners)[np.arange(len(corners)).reshape(-1, 3)]
    a, b, c = faces.T
    table = edge_table(faces[(a != b) & (b != c) & (c != a)])
    ends: NDArray[np.float64] = corners[table.vertices[table.balance != 0]]
    return ends


def _around(ends: NDArray[np.float64], spots: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """(k, 3) places at a distance from edges, on six sides of each spot."""
    first, second = axes_across(ends[:, 1] - ends[:, 0])
    angles = 0.3 + np.pi / 3 * np.arange(6)[:, None, None, None]
    ring = radius * (np.cos(angles) * first[:, None] + np.sin(angles) * second[:, None])
    return np.asarray((spots + ring).reshape(-1, 3))
