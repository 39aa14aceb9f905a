"""Surfaces at distances from a solid, round or mitred around edges, constant or varying; and solids around sheets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias, cast

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..errors import SignedHeatError, SourceError, counted
from ..grids.grid import Grid
from ..mesh.unit_vectors import SAME_WAY, unit
from ..mesh.welding import indexed
from ..parallel import in_chunks
from ..search.face_tree import FaceFeatures, FaceTree, NearestFaces
from ..search.nearest_triangles import TriangleTree, foot_on_triangle
from ..shapes.area_elements import area_elements
from ..shapes.foreign import as_list
from ..shapes.kinds import Shapes
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import numbers
from .mesh_orientation import agreeing_faces
from .tiles import Evaluated

Reach: TypeAlias = Callable[[Floats], Floats]
"""A function that returns the (n,) signed distances of the offset surface from (n, 3) points of the solid."""
MEETING_DISTANCE = 1e-7
"""Triangles meet at a point if they are at most this far from it, relative to the size of the solid."""
DIFFERENCE_STEP = 1e-6
"""Step of the differences that give the gradient of a varying distance, relative to the size of the solid."""
ALONG_AXES = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True, eq=False)
class Offset:
    """The surface at a distance from a solid, as the zero set of a function that grows outwards."""

    solid: Evaluated  # from which distance is measured
    reach: float | Reach  # the distance, negative inside; or a function of the nearest points
    # around edges and corners the surface follows the planes of the faces there up to this multiple of the distance;
    # where they meet farther out it is cut off by a ball. With 1 it is round: a level of the distance to the solid
    limit: float = 1.0

    @property
    def level(self) -> float | None:
        """The distance of which the surface is a level set; None if it varies or edges are mitred."""
        return None if callable(self.reach) or (self.limit > 1 and self.reach != 0) else self.reach

    @property
    def named(self) -> str:
        """Name of the surface in messages."""
        return "the distance that varies" if callable(self.reach) else f"level {self.reach:g}"

    def distance(self, points: Floats) -> Floats:
        """(n,) heights of (n, 3) points above the surface, negative inside; distances if `reach` is constant."""
        if self.level is not None:
            return self.solid.distance(points) - self.level
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
        """(n,) heights above the surface, and (n, 3) gradients that ignore how `reach` varies."""
        closest = self.solid.closest(points)
        heights, gradients = closest.distances, closest.gradients
        reach = self.reach(closest.points) if callable(self.reach) else np.full(len(points), self.reach)
        if self.limit > 1:
            heights, gradients = self._mitred(points - closest.points, closest.points, heights, gradients, reach)
        return heights - reach, gradients

    def planes(self, points: Floats) -> tuple[Floats, Floats]:
        """(n, 3) points on the surface near given ones, and (n, 3) normals there; at level 0 of nearest triangles."""
        if self.level == 0:
            tree = self.solid.tree
            nearest = tree.search(points)
            return nearest.places, tree.features.face_normals[nearest.faces]
        heights, gradients = self.slopes(points)
        return points - heights[:, None] * gradients, gradients

    def _mitred(
        self, away: Floats, nearest_points: Floats, heights: Floats, gradients: Floats, reach: Floats
    ) -> tuple[Floats, Floats]:
        """(n,) signed heights above the planes of the faces at the nearest points, up to the limit; (n, 3) gradients.

        `away` are (n, 3) vectors from the `nearest_points` to the points. `heights`, (n,), and `gradients`, (n, 3), are
        the distance to the solid and its gradient, and `reach` the (n,) distances of the surface. Only points at 1 to
        2 · `limit` times that distance get other heights. All others are on the same side of the surface either way.
        """
        distances = np.abs(heights)
        is_near = (distances >= np.abs(reach)) & (distances < 2 * self.limit * np.abs(reach))
        near = np.flatnonzero((heights * reach > 0) & is_near)
        if not len(near):
            return heights, gradients
        signs = np.sign(reach[near])
        features, tree = self.solid.tree.features, self.solid.tree.tree
        slack = MEETING_DISTANCE * float(np.ptp(tree.bounds[1].reshape(2, 3), axis=0).max())

        def highest(queries: Floats) -> tuple[Floats, Ints]:
            """(k,) heights and (k,) triangles of `_steepest` for (k, 6) nearest points and vectors from there."""
            starts, faces = tree.meeting(np.repeat(queries[:, None, :3], 3, axis=1), slack)
            return _steepest(features.rows, starts, faces, self._normals, queries, slack)

        queries = np.concatenate([nearest_points[near], signs[:, None] * away[near]], axis=1)
        above_planes, faces = in_chunks(highest, queries)
        above_ball = (1 - self.limit) * np.abs(reach[near]) + distances[near]  # of the ball that cuts off corners
        planar = (faces >= 0) & (above_planes > above_ball)
        heights, gradients = heights.copy(), gradients.copy()
        heights[near] = signs * np.where(faces >= 0, np.maximum(above_planes, above_ball), distances[near])
        gradients[near[planar]] = self._normals[faces[planar]]
        return heights, gradients

    @cached_property
    def _normals(self) -> Floats:
        """(m, 3) normals of the triangles; 0 for those that do not bound the inside."""
        features = self.solid.tree.features
        return np.where(self.solid.bounding[features.ids][:, None], features.face_normals, 0.0)

    def _variation(self, points: Floats) -> Floats:
        """(n, 3) gradients of `reach` at the nearest points of (n, 3) points, by central differences."""
        assert callable(self.reach)
        step = DIFFERENCE_STEP * float(np.ptp(self.solid.tree.tree.bounds[1].reshape(2, 3), axis=0).max())
        around = (points[:, None] + step * ALONG_AXES).reshape(-1, 3)
        reaches = self.reach(self.solid.tree.search(around).places).reshape(-1, 2, 3)
        return (reaches[:, 0] - reaches[:, 1]) / (2 * step)


def checked_reach(reach: Reach) -> Reach:
    """Wrap a function of (n, 3) points so that it raises unless it returns (n,) finite numbers."""

    def called(points: Floats) -> Floats:
        """(n,) values at (n, 3) points, checked."""
        values = numbers(reach(points), "distance", SignedHeatError)
        if values.shape != (len(points),) or not np.isfinite(values).all():
            raise SignedHeatError(
                f"the distance has shape {values.shape} at {counted(len(points), 'place')}, or is not finite",
                remedy="return a finite number for each of (n, 3) points",
                element="distance",
            )
        return values

    return called


@compiled
def _steepest(
    rows: Floats, starts: Ints, faces: Ints, normals: Floats, queries: Floats, slack: float
) -> tuple[Floats, Ints]:
    """(n,) heights of points above the plane, of the triangles that meet at a place, it is highest above; (n,) which.

    A row of `queries`, (n, 6), holds a place, and the vector from there to a point. Near place p are the triangles
    ``faces[starts[p]:starts[p + 1]]``; those with normals 0 do not count. Without any, they are −∞ and −1.
    """
    heights, steepest = np.full(len(queries), -np.inf), np.full(len(queries), -1, dtype=np.int64)
    for p in range(len(queries)):
        for k in range(starts[p], starts[p + 1]):
            f = faces[k]
            if normals[f, 0] == 0.0 and normals[f, 1] == 0.0 and normals[f, 2] == 0.0:
                continue
            if foot_on_triangle(rows, f, queries[p, 0], queries[p, 1], queries[p, 2])[0] <= slack * slack:
                height = normals[f, 0] * queries[p, 3] + normals[f, 1] * queries[p, 4] + normals[f, 2] * queries[p, 5]
                if height > heights[p]:
                    heights[p], steepest[p] = height, f
    return heights, steepest


OFF_SYMMETRY = 1e-7
"""Points are moved off planes of symmetry by this share of a cell before distance is measured."""


@dataclass(frozen=True, eq=False)
class SheetWall:
    """A solid around a surface, between two heights, whose sides stand upright on the rim of the surface."""

    tree: FaceTree
    origin: Floats  # (3,) point that becomes the origin of faces and points
    step: float  # by which points are moved off planes of symmetry, where a face and a rim are equally near
    above: float  # height of the solid in front of the surface
    below: float  # its height behind the surface
    rim: TriangleTree | None  # the r sides of the rim, as triangles without area; None if the surface is closed
    corners: Floats  # (r, 2, 3) begin and end of each side of the rim
    sides: Ints  # (m, 3) number in the rim of each side of each face; −1 if it is not on the rim
    at_vertices: Ints  # (n, 2) the sides of the rim that end and that begin at each vertex; −1 where there are none
    outward: Floats  # (r + 1, 2, 3) directions away from the surface at begin and end of each side; last 0, for −1

    @classmethod
    def around(cls, sheet: Shapes, grid: Grid[Literal[3]], above: float, below: float) -> SheetWall:
        """Make the wall around meshes of triangles or polygons, to be evaluated on a grid."""
        for part in as_list(sheet):
            if area_elements(part).corners.shape[1:] != (3, grid.dimension):
                raise SourceError(
                    f"a sheet has faces in the {grid.dimension} dimensions of the grid, and a "
                    f"{type(part).__name__} has none",
                    remedy="reconstruct a mesh first",
                )
        corners = np.concatenate([area_elements(part).corners for part in as_list(sheet)]) - grid.origin
        mesh = TriangleMesh(*indexed(corners))
        features = FaceFeatures.of(mesh.vertices, agreeing_faces(mesh))
        if not len(features.rows):
            raise SourceError("all faces of the sheet are degenerate", remedy="check its vertices")
        ends = np.stack([features.faces, np.roll(features.faces, -1, axis=1)], axis=-1)
        on_rim = (np.bincount(features.edges.ravel()) == 1)[features.edges]
        rim_corners = features.vertices[ends[on_rim]]
        along = unit(rim_corners[:, 1] - rim_corners[:, 0])
        outward = np.cross(along, np.repeat(features.face_normals, on_rim.sum(axis=1), axis=0))
        sides = np.full(features.faces.shape, -1)
        sides[on_rim] = np.arange(len(rim_corners))
        sides_at = np.full((len(features.vertices), 2), -1)  # the side that ends at each vertex, and that which begins
        sides_at[ends[on_rim][:, 1], 0] = sides_at[ends[on_rim][:, 0], 1] = np.arange(len(rim_corners))
        at_ends = np.stack([outward, outward], axis=1)
        for end, other in ((0, 0), (1, 1)):  # mean directions where the rim is smooth
            neighbours = sides_at[ends[on_rim][:, end], other]
            smooth = (neighbours >= 0) & (np.einsum("ni,ni->n", outward, outward[neighbours]) > SAME_WAY)
            at_ends[smooth, end] = unit(outward[smooth] + outward[neighbours[smooth]])
        rim = TriangleTree.of(rim_corners[:, [0, 1, 1]]) if len(rim_corners) else None
        outward = np.concatenate([at_ends, np.zeros((1, 2, 3))])
        step = OFF_SYMMETRY * float(grid.spacing.min())
        return cls(FaceTree.of(features), grid.origin, step, above, below, rim, rim_corners, sides, sides_at, outward)

    def depths(self, points: Floats) -> Floats:
        """(n,) heights of (n, 3) points outside the wall, negative inside; above and below the sheet, distances."""
        points = points - self.origin + self.step
        nearest = self.tree.search(points)
        if self.above == self.below:
            depths = nearest.distances - self.above
        else:
            heights = np.where(nearest.cosines < 0, -nearest.distances, nearest.distances)
            depths = np.maximum(heights - self.above, -self.below - heights)
        return depths if self.rim is None else np.maximum(depths, self._beyond(points, nearest))

    def _beyond(self, points: Floats, nearest_points: NearestFaces) -> Floats:
        """(n,) distances of (n, 3) points beyond the rim, negative over the surface, given their nearest points.

        If the nearest point is on the rim, it is the height above the plane that stands on the rim there, at a corner
        the higher of two. Otherwise it is the distance of the nearest point from the rim.
        """
        # features are 0 within a face, 1 to 3 on its sides, and 4 to 6 at its corners
        faces, features = nearest_points.faces, nearest_points.features
        rim_sides = np.full((len(points), 2), -1)  # the sides of the rim at the nearest point: one twice, two, or none
        on_side, at_corner = (features > 0) & (features < 4), features > 3
        rim_sides[on_side] = self.sides[faces[on_side], features[on_side] - 1][:, None]
        rim_sides[at_corner] = self.at_vertices[self.tree.features.faces[faces[at_corner], features[at_corner] - 4]]
        # at vertices, the end of the side that ends there, and the begin of the one that begins there
        shares = np.broadcast_to([1.0, 0.0], rim_sides.shape).copy()
        begin, end = self.corners[rim_sides[on_side, 0]].swapaxes(0, 1)
        from_begin = np.linalg.norm(nearest_points.places[on_side] - begin, axis=1)
        shares[on_side] = (from_begin / np.linalg.norm(end - begin, axis=1))[:, None]
        outward = self.outward[rim_sides]  # 0 in the last row, which −1 names
        outward = outward[:, :, 0] + shares[..., None] * (outward[:, :, 1] - outward[:, :, 0])
        beyond = np.einsum("nki,ni->nk", outward, points - nearest_points.places).max(axis=1)
        over = np.flatnonzero((rim_sides < 0).all(axis=1))  # points over the surface
        nearest, weights = cast("TriangleTree", self.rim).nearest(nearest_points.places[over])
        ends = self.corners[nearest]
        on_rim = ends[:, 0] + (1 - weights[:, :1]) * (ends[:, 1] - ends[:, 0])
        beyond[over] = -np.linalg.norm(nearest_points.places[over] - on_rim, axis=1)
        return beyond
