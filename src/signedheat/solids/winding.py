"""Winding numbers of the boundary of a solid, which are above ½ inside."""

from __future__ import annotations

from dataclasses import InitVar, dataclass
from functools import cached_property

import numpy as np

from ..arrays import Bools, Floats, Frozen
from ..errors import GeometryError, counted
from ..mesh.edges import edge_table, has_three_corners
from ..mesh.welding import same_positions
from ..search.face_tree import NearestFaces
from ..search.winding_tree import OFF_FACE, WindingTree, steps_off, winding_sums

INSIDE_WINDING = 0.5
"""Winding number above which a point is inside; exact winding numbers are integers."""
CLEAR_COSINE = 1e-3
"""Cosine between a normal and the direction from the surface above which its sign is the side of a point."""
ON_SURFACE = 1e-12
"""A point is on the surface up to this distance, relative to its own largest coordinate. Its side is not computed."""
SUMMED_POINTS = 16
"""For this many points or fewer, sums over all triangles take less time and memory than a tree."""


@dataclass(frozen=True, eq=False)
class Windings(Frozen):
    """Winding numbers of triangles with balanced edges: integers, which change only across the triangles."""

    triangles: Floats  # (m, 3, 3) corners
    open_edges: InitVar[Floats | None] = None  # (n, 2, 3) ends of the edges that do not balance, if they are known

    def __post_init__(self, open_edges: Floats | None) -> None:
        ends = open_edges_of(self.triangles) if open_edges is None else open_edges
        if len(ends):
            x, y, z = ends[0].mean(axis=0)
            raise GeometryError(
                f"the boundary of the solid is not closed: {counted(len(ends), 'edge')} lack a face, the first around "
                f"({x:.4g}, {y:.4g}, {z:.4g})",
                remedy="use `complete` to make solids",
                element="triangles",
            )

    @cached_property
    def tree(self) -> WindingTree:
        """Search tree over the triangles, of which there is at least one."""
        return WindingTree.of(self.triangles)

    def numbers(self, points: Floats) -> Floats:
        """(n,) winding numbers of (n, 3) points."""
        return self.tree.numbers(points) if len(self.triangles) and len(points) else np.zeros(len(points))

    def numbers_once(self, points: Floats) -> Floats:
        """(n,) winding numbers of (n, 3) points, without making the tree if they are few; for single calls."""
        return winding_sums(self.triangles, points) if len(points) <= SUMMED_POINTS else self.numbers(points)

    def inside(self, points: Floats) -> Bools:
        """(n,) whether (n, 3) points are inside."""
        return self.numbers(points) > INSIDE_WINDING

    def inside_near(self, points: Floats, nearest: NearestFaces) -> Bools:
        """(n,) whether (n, 3) points are inside: by the normal at the nearest point, or by winding numbers if unclear.

        Points on the surface count as either, depending on rounding.
        """
        inside: Bools = nearest.cosines < 0
        on_surface = nearest.distances < ON_SURFACE * np.abs(points).max(axis=1, initial=0.0)
        unclear = np.flatnonzero(~(nearest.regular & ((np.abs(nearest.cosines) > CLEAR_COSINE) | on_surface)))
        if len(unclear):
            inside[unclear] = self.inside(points[unclear])
        return inside

    def sides(self, triangles: Floats) -> tuple[Bools, Bools]:
        """(n,) whether points just behind (n, 3, 3) triangles are inside, and (n,) the same just in front of them."""
        step, centres = steps_off(triangles, OFF_FACE), triangles.mean(axis=1)
        behind, ahead = np.split(self.numbers_once(np.concatenate([centres - step, centres + step])), 2)
        return behind > INSIDE_WINDING, ahead > INSIDE_WINDING


def open_edges_of(triangles: Floats) -> Floats:
    """(n, 2, 3) ends of edges of (m, 3, 3) triangles at which opposite directions do not balance."""
    corners = triangles.reshape(-1, 3)
    faces = same_positions(corners).reshape(-1, 3)
    table = edge_table(faces[has_three_corners(faces)])
    return corners[table.vertices[table.balance != 0]]
