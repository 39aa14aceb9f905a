"""Solids around sheets: what is within a distance of a surface, and not beyond its rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from ..area_elements import area_elements
from ..arrays import Floats, Ints
from ..errors import SourceError
from ..foreign import as_list
from ..grids.grid import Grid
from ..kinds import Shapes
from ..mesh.unit_vectors import unit
from ..mesh.welding import indexed
from ..search.face_tree import FaceFeatures, FaceTree, NearestFaces
from ..search.nearest_triangles import TriangleTree
from ..surfaces.triangle_mesh import TriangleMesh
from .facing import agreeing_faces

SMOOTH = np.cos(np.deg2rad(40.0))
"""Cosine between the directions away from two sides of a rim above which it is smooth where they meet."""
ASIDE = 1e-7
"""By how much of a cell places are moved from planes of symmetry before they are measured."""


@dataclass(frozen=True, eq=False)
class SheetWall:
    """A solid around a surface: its faces, moved to an origin, and the rim where it ends.

    Beyond a rim, what stands upright on it counts: places in the plane of a side of the rim and the normal there. Over
    the inside of the surface, the distance along it to the rim does, so that both are one function without a jump.
    """

    tree: FaceTree
    origin: Floats
    step: float  # by which places are moved from planes of symmetry, where a rim that stands on a face is as near
    above: float
    below: float
    rim: TriangleTree | None  # its sides, as triangles without area
    corners: Floats  # (r, 2, 3) their ends
    sides: Ints  # (m, 3) the one of the rim that each side of each face is, −1 of others
    at_vertices: Ints  # (n, 2) those that begin and end at each vertex, −1 where there is no rim
    outward: Floats  # (r + 1, 2, 3) directions away from the surface at both ends of each, and zeros for none

    @classmethod
    def around(cls, sheet: Shapes, grid: Grid[Literal[3]], above: float, below: float) -> SheetWall:
        """Return the wall around meshes of triangles or polygons."""
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
            raise SourceError("no face of the sheet has any extent", remedy="check its vertices")
        ends = np.stack([features.faces, np.roll(features.faces, -1, axis=1)], axis=-1)
        on_rim = (np.bincount(features.edges.ravel()) == 1)[features.edges]
        places = features.vertices[ends[on_rim]]
        along = unit(places[:, 1] - places[:, 0])
        outward = np.cross(along, np.repeat(features.face_normals, on_rim.sum(axis=1), axis=0))
        sides = np.full(features.faces.shape, -1)
        sides[on_rim] = np.arange(len(places))
        around = np.full((len(features.vertices), 2), -1)  # the side that ends at each vertex, and that which begins
        around[ends[on_rim][:, 1], 0] = around[ends[on_rim][:, 0], 1] = np.arange(len(places))
        at_ends = np.stack([outward, outward], axis=1)
        for end, other in ((0, 0), (1, 1)):  # mean directions where the rim is smooth
            mates = around[ends[on_rim][:, end], other]
            smooth = (mates >= 0) & (np.einsum("ni,ni->n", outward, outward[mates]) > SMOOTH)
            at_ends[smooth, end] = unit(outward[smooth] + outward[mates[smooth]])
        rim = TriangleTree.of(places[:, [0, 1, 1]]) if len(places) else None
        outward = np.concatenate([at_ends, np.zeros((1, 2, 3))])
        step = ASIDE * float(grid.spacing.min())
        return cls(FaceTree.of(features), grid.origin, step, above, below, rim, places, sides, around, outward)

    def depths(self, points: Floats) -> Floats:
        """(n,) how far (n, 3) points are outside of the wall, negative inside."""
        points = points - self.origin + self.step
        found = self.tree.search(points)
        if self.above == self.below:
            depths = found.distances - self.above
        else:
            heights = np.where(found.cosines < 0, -found.distances, found.distances)
            depths = np.maximum(heights - self.above, -self.below - heights)
        return depths if self.rim is None else np.maximum(depths, self._beyond(points, found))

    def _beyond(self, points: Floats, found: NearestFaces) -> Floats:
        """(n,) how far points are beyond the rim, negative over the surface."""
        faces, features = found.faces, found.features
        at = np.full((len(points), 2), -1)
        edges, vertices = (features > 0) & (features < 4), features > 3
        at[edges] = self.sides[faces[edges], features[edges] - 1][:, None]
        at[vertices] = self.at_vertices[self.tree.features.faces[faces[vertices], features[vertices] - 4]]
        shares = np.broadcast_to(
            [1.0, 0.0], at.shape
        ).copy()  # of what ends at a vertex, its end, and of the other its begin
        sides = at[edges, 0]
        begin, end = self.corners[sides].swapaxes(0, 1)
        along = np.linalg.norm(found.places[edges] - begin, axis=1) / np.linalg.norm(end - begin, axis=1)
        shares[edges] = along[:, None]
        outward = self.outward[at]
        outward = outward[:, :, 0] + shares[..., None] * (outward[:, :, 1] - outward[:, :, 0])
        beyond = np.einsum("nki,ni->nk", outward, points - found.places).max(axis=1)
        over = np.flatnonzero((at < 0).all(axis=1))
        nearest, weights = cast("TriangleTree", self.rim).nearest(found.places[over])
        ends = self.corners[nearest]
        on_rim = ends[:, 0] + (1 - weights[:, :1]) * (ends[:, 1] - ends[:, 0])
        beyond[over] = -np.linalg.norm(found.places[over] - on_rim, axis=1)
        return beyond
