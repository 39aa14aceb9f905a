"""The nearest face of points, through a tree of boxes and discs.

A disc is flat: its plane is that of the faces below a node, its thickness what they deviate from it. Far from a surface
the boxes of many faces are as near as the nearest one's, since boxes stand askew to it; few discs are.

A candidate is a face that is near, not always the nearest. Over a surface without gaps it leads there: as long as the
foot lies on the rim of a face, faces on the other side of that rim may be nearer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.box_tree import LEAF, BoxTree
from ..parallel import in_chunks
from .face_features import FaceFeatures
from .nearest_triangles import foot_on_triangle, nearest_faces

RUN = 512
"""Points after which a search starts anew: a part of what a thread takes at a time."""
DISC_LEVELS = 8
"""Levels of the tree, from the leaves up, that have discs."""
FLAT = 0.5
"""Thickness over radius up to which a disc says more than a box."""
FAR = 1e7
"""Sizes of a surface beyond which a point is searched for where it would be at that distance: neither rounding, which
grows with distance, nor the other angle then moves the nearest place by more than 1e-7 of the size."""


@dataclass(frozen=True, eq=False)
class FaceTree:
    """Faces, and a tree of boxes around them."""

    features: FaceFeatures
    tree: BoxTree  # over their boxes

    @classmethod
    def of(cls, features: FaceFeatures) -> FaceTree:
        """The tree of some faces, of which there is at least one; their order is one along a curve through space."""
        triangles = features.corners.reshape(-1, 3, 3)
        lower, upper = triangles.min(axis=1), triangles.max(axis=1)
        return cls(features, BoxTree.in_order(lower, upper, np.arange(len(triangles))))

    @classmethod
    def of_triangles(cls, triangles: Floats, trusted: NDArray[np.float32] | None = None) -> FaceTree:
        """The tree of (m, 3, 3) triangles, of which one has area; corners at one position are one vertex."""
        return cls.of(FaceFeatures.of(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), trusted))

    @cached_property
    def discs(self) -> Floats:
        """(2 · leaves, 8) centre, normal, radius and half the thickness of what is below each node.

        Thickness is negative where there is no disc, or none that is flat.
        """
        return _discs(self.features.corners, self.tree.bounds, self.tree.items)

    def distances(self, points: Floats) -> Floats:
        """(n,) distance of each of (n, 3) points to the nearest face."""
        (distances,) = in_chunks(lambda chunk: (self._distances(chunk),), points)
        return distances

    def search(self, points: Floats) -> NearestFaces:
        """The nearest face of each of (n, 3) points: fast where those that follow each other are near each other.

        Each `RUN` of points is searched on its own: what comes before does not matter.
        """
        nearer = self._brought_near(points)
        faces, _ = self.nearest(nearer)
        found = search_from(self.features, nearer, faces[:, None])
        return found if nearer is points else replace(found, distances=np.linalg.norm(points - found.places, axis=1))

    def _distances(self, points: Floats) -> Floats:
        nearer = self._brought_near(points)
        if nearer is not points:
            return self.search(points).distances
        return np.sqrt(self.nearest(points)[1])

    def _brought_near(self, points: Floats) -> Floats:
        """The points; those farther than `FAR` sizes of the surface are moved towards its middle, to that distance."""
        lower, upper = self.tree.bounds[1, :3], self.tree.bounds[1, 3:]
        middle, limit = 0.5 * (lower + upper), FAR * float(np.linalg.norm(upper - lower))
        away = points - middle
        distances = np.linalg.norm(away, axis=1)
        far = (distances > limit) & (limit > 0)
        if not far.any():
            return points
        result: Floats = points.copy()
        result[far] = middle + away[far] * (limit / distances[far])[:, None]
        return result

    def nearest(self, points: Floats) -> tuple[NDArray[np.int32], Floats]:
        """Nearest faces of points, and the squares of their distances."""
        return nearest_faces(self.features.rows, self.tree, self.discs, points, RUN)


@compiled
def _discs(corners: Floats, bounds: Floats, items: Ints) -> Floats:
    """See `FaceTree.discs`. Discs are convex, so that it is enough to put the corners of the faces into them."""
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


STEPS = 24
"""Faces that a search goes on to at most."""


@dataclass(frozen=True, eq=False)
class NearestFaces:
    """The nearest face of each of some points."""

    faces: NDArray[np.int32]  # (n,) which one
    distances: Floats  # (n,) to it
    places: Floats  # (n, 3) the nearest place
    features: NDArray[np.int8]  # (n,) what it lies on, in the code of `foot_on_triangle`
    # (n,) of the angle between the way from the foot to the point and the normal there: positive in front of the face
    cosines: NDArray[np.float32]
    # (n,) whether that decides the side: the nearest place is inside a face, or on a regular edge or vertex
    regular: Bools


def search_from(features: FaceFeatures, points: Floats, candidates: NDArray[np.int32]) -> NearestFaces:
    """The nearest of (n, c) candidate faces of each of (n, 3) points, or one that it leads on to; −1 is none.

    Where a point has no candidate, there is no face, and distance is infinite.
    """
    n = len(points)
    faces, squares, places = np.empty(n, dtype=np.int32), np.empty(n), np.empty((n, 3))
    codes, cosines, regular = np.empty(n, dtype=np.int8), np.empty(n, dtype=np.float32), np.empty(n, dtype=np.bool_)
    nearest_of_candidates(features, points, candidates, faces, squares, codes, places, cosines, regular)
    return NearestFaces(faces, np.sqrt(squares), places, codes, cosines, regular)


@compiled
def nearest_of_candidates(
    features: FaceFeatures,
    points: Floats,
    candidates: NDArray[np.int32],
    out_faces: NDArray[np.int32],
    out_squares: Floats,
    out_features: NDArray[np.int8],
    out_places: Floats,
    out_cosines: NDArray[np.float32],
    out_regular: Bools,
) -> None:
    """From the nearest of some faces, and the nearest place on it, to faces that are nearer, across their rims.

    Over an edge lies what is nearer, if anything does, on the side of the point: the place is the nearest of the
    edge, so the point must be in front of the plane that the edge divides from the other face's apex. Around a vertex
    the side along which distance shrinks fastest leads on; where it grows along all of them no place is nearer.

    All points in one call, since a call costs more than the way of one point.
    """
    rows, places, faces, vertex_regular = features.rows, features.vertices, features.faces, features.vertex_regular
    across, apexes = features.across, features.apexes
    starts, around = features.vertex_starts, features.vertex_corners
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        face, square, feature, fx, fy, fz = np.int64(-1), np.inf, 0, x, y, z
        for c in range(candidates.shape[1]):
            other = np.int64(candidates[p, c])
            if other >= 0 and other != face and (c == 0 or other != candidates[p, c - 1]):
                s, which, u, v, w = foot_on_triangle(rows, other, x, y, z)
                if s < square:
                    face, square, feature, fx, fy, fz = other, s, which, u, v, w
        for _ in range(STEPS):
            if feature == 0:
                break
            other = np.int64(-1)
            if feature <= 3:
                vertex = np.int64(apexes[face, feature - 1])
                if vertex >= 0:
                    ax, ay, az = places[vertex, 0] - fx, places[vertex, 1] - fy, places[vertex, 2] - fz
                    if (x - fx) * ax + (y - fy) * ay + (z - fz) * az > 0.0:
                        other = np.int64(across[face, feature - 1])
            else:
                vertex = np.int64(faces[face, feature - 4])
                vx, vy, vz = places[vertex, 0], places[vertex, 1], places[vertex, 2]
                dx, dy, dz = x - vx, y - vy, z - vz
                steepest = 0.0
                turns = 1 if vertex_regular[vertex] else 2  # around a whole vertex every side is the first of a corner
                for k in range(starts[vertex], starts[vertex + 1]):
                    near = np.int64(around[k]) // 3
                    corner = np.int64(around[k]) - 3 * near
                    for _turn in range(turns):
                        corner = corner + 1 if corner < 2 else 0
                        end = np.int64(faces[near, corner])
                        ex, ey, ez = places[end, 0] - vx, places[end, 1] - vy, places[end, 2] - vz
                        gain = dx * ex + dy * ey + dz * ez
                        if gain > 0.0:
                            gain *= gain / (ex * ex + ey * ey + ez * ez)
                            if gain > steepest:
                                steepest, other = gain, near
            if other < 0:
                break
            s, which, u, v, w = foot_on_triangle(rows, other, x, y, z)
            if not s < square:
                break
            face, square, feature, fx, fy, fz = other, s, which, u, v, w
        out_faces[p], out_squares[p], out_features[p] = face, square, feature
        out_places[p, 0], out_places[p, 1], out_places[p, 2] = fx, fy, fz
        out_cosines[p], out_regular[p] = facing(features, face, feature, x - fx, y - fy, z - fz)


@compiled
def facing(features: FaceFeatures, face: int, feature: int, dx: float, dy: float, dz: float) -> tuple[float, bool]:
    """Cosine between the normal at a feature of a face and the way from there; and whether that decides the side."""
    if face < 0:
        return 0.0, False
    normals, at, regular = features.face_normals, np.int64(face), True
    if feature > 3:
        normals, at = features.vertex_normals, np.int64(features.faces[face, feature - 4])
        regular = features.vertex_regular[at]
    elif feature > 0:
        normals, at = features.edge_normals, np.int64(features.edges[face, feature - 1])
        regular = features.edge_regular[at]
    nx, ny, nz = normals[at, 0], normals[at, 1], normals[at, 2]
    lengths = np.sqrt((nx * nx + ny * ny + nz * nz) * (dx * dx + dy * dy + dz * dz))
    return (nx * dx + ny * dy + nz * dz) / lengths if lengths > 0.0 else 0.0, regular
