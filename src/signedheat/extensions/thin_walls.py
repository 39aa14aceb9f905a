"""Which faces tell inside from outside; and walls that a coarse grid misses, beside which winding numbers tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..geometry.winding_tree import WindingTree
from ..operators.grid.exact_surface import ExactSurface
from ..operators.grid.face_values import values_at

BOUNDING = 0.22
"""Mean winding number of a face's two sides from which it tells inside from outside: 0 on a sheet, ½ on a solid, ¼ on
one half a cell thick, where it is known at nodes only."""
ENCLOSED = 0.95
"""Winding number behind faces beside what the coarse grid takes for open sheets, from which they bound something."""
PROBES = np.array([[1.0, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]])
"""Barycentric coordinates, times their sum, of the places of a face that are asked."""


def telling_at(
    winding: NDArray[np.float64], refused: NDArray[np.bool_]
) -> Callable[[NDArray[np.float64]], NDArray[np.bool_]]:
    """Whether faces tell sides at (s, 3) places on them, in cells: winding numbers say so, and no node is refused."""
    upper = np.array(refused.shape) - 1

    def tells(feet: NDArray[np.float64]) -> NDArray[np.bool_]:
        nodes = tuple(np.clip(np.rint(feet).astype(np.int64), 0, upper).T)
        told: NDArray[np.bool_] = (values_at(winding, feet) > BOUNDING) & ~refused[nodes]
        return told

    return tells


def with_thin_walls(surface: ExactSurface, refused: NDArray[np.bool_], share: float) -> ExactSurface:
    """A surface that knows which of the faces that tell no side bound something all the same.

    Parameters
    ----------
    surface : ExactSurface
        Of a coarse grid.
    refused : (*shape) bool
        Nodes beside open sheets: see `Sides`.
    share : float
        Of the surface that is there: see `face_density`.
    """
    if surface.telling is None:
        return surface
    silent = np.flatnonzero(~surface.telling)
    triangles = surface.features.corners.reshape(-1, 3, 3)
    asked = np.zeros(len(triangles), dtype=bool)
    if len(silent):
        nodes = np.rint(triangles[silent].mean(axis=1) / surface.steps).astype(np.int64)
        open_there = refused[tuple(np.clip(nodes, 0, np.array(refused.shape) - 1).T)]
        level = np.where(open_there, ENCLOSED, 0.5 + BOUNDING * share)  # ½ more than the mean of both sides
        tree = WindingTree(triangles, surface.tree.tree)
        for weights in PROBES / PROBES.sum(axis=1, keepdims=True):
            behind = tree.behind(silent, np.einsum("c,fcd->fd", weights, triangles[silent]))
            asked[silent] |= behind > level
    return replace(surface, asked=asked, share=share)
