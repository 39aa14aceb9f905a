"""Inside: where the winding number of all that bounds a solid is above a half."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..frozen import Frozen
from ..geometry.winding_tree import WindingTree

INSIDE = 0.5
"""Winding number above which a point is inside; it is near 0 or 1 but beside slits."""
DEPTH = 1e-6
"""Size of a face by which places in front of it and behind it are off it."""


@dataclass(frozen=True, eq=False)
class Windings(Frozen):
    """Oriented triangles, those of each set counted with a weight.

    Attributes
    ----------
    sets : tuple of (m, 3, 3) float
        Corners.
    weights : tuple of float
        1 for what closes; more for fragments, since some of their faces are missing.
    """

    sets: tuple[NDArray[np.float64], ...]
    weights: tuple[float, ...]

    @property
    def closed(self) -> bool:
        """Whether the sides change across triangles only: fragments have gaps across which they do, too."""
        return all(weight == 1.0 for weight in self.weights)

    @cached_property
    def trees(self) -> tuple[WindingTree, ...]:
        """One for each set."""
        return tuple(WindingTree.of(triangles) for triangles in self.sets if len(triangles))

    def numbers(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) weighted sum of winding numbers."""
        total = np.zeros(len(points))
        weights = (weight for triangles, weight in zip(self.sets, self.weights, strict=True) if len(triangles))
        for tree, weight in zip(self.trees, weights, strict=True):
            total += weight * tree.numbers(points)
        return total

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether points are inside."""
        result: NDArray[np.bool_] = self.numbers(points) > INSIDE
        return result

    def beside(self, triangles: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(n,) whether it is inside just behind the centres of (n, 3, 3) triangles, and just in front of them."""
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        step = DEPTH * normals * (np.sqrt(areas) / np.where(areas > 0, areas, 1.0))[:, None]
        centres = triangles.mean(axis=1)
        return self.inside(centres - step), self.inside(centres + step)
