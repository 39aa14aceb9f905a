"""Kernels: distance to faces and their sides, from candidates nearby.

A candidate is a face that is near, not always the nearest. Over a surface without gaps it leads there: as long as the
foot lies on the rim of a face, faces on the other side of that rim may be nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .face_features import FaceFeatures, Links, Normals
from .point_triangle import foot_on_triangle

STEPS = 24
"""Faces that a search goes on to at most."""


@dataclass(frozen=True, eq=False)
class NearestFaces:
    """The nearest face of each of some points.

    Attributes
    ----------
    faces : (n,) int
        Which one.
    distances : (n,) float
        To it.
    feet : (n, 3) float
        The nearest place.
    features : (n,) int
        What it lies on, in the code of `foot_on_triangle`.
    cosines : (n,) float
        Of the angle between the way from the foot to the point and the normal there: positive in front of the face.
    regular : (n,) bool
        Whether that tells the side: the foot is inside a face, or on a regular edge or vertex.
    """

    faces: NDArray[np.int32]
    distances: NDArray[np.float64]
    feet: NDArray[np.float64]
    features: NDArray[np.int8]
    cosines: NDArray[np.float32]
    regular: NDArray[np.bool_]


def search_from(
    features: FaceFeatures,
    points: NDArray[np.float64],
    candidates: NDArray[np.int32],
) -> NearestFaces:
    """The nearest of (n, c) candidate faces of each of (n, 3) points, or one that it leads on to; −1 is none.

    Where a point has no candidate, there is no face, and distance is infinite.
    """
    n = len(points)
    faces, squares, feet = np.empty(n, dtype=np.int32), np.empty(n), np.empty((n, 3))
    codes, cosines, regular = np.empty(n, dtype=np.int8), np.empty(n, dtype=np.float32), np.empty(n, dtype=np.bool_)
    nearest_of_candidates(features.links, points, candidates, faces, squares, codes, feet)
    facing(features.normals, points, faces, codes, feet, cosines, regular)
    return NearestFaces(faces, np.sqrt(squares), feet, codes, cosines, regular)


@compiled
def nearest_of_candidates(
    links: Links,
    points: NDArray[np.float64],
    candidates: NDArray[np.int32],
    out_faces: NDArray[np.int32],
    out_squares: NDArray[np.float64],
    out_features: NDArray[np.int8],
    out_feet: NDArray[np.float64],
) -> None:
    """From the nearest of some faces, and the foot of each point on it, to faces that are nearer, across their rims.

    Over an edge lies what is nearer, if anything does, on the side of the point: the foot is the nearest place of the
    edge, so the point must be in front of the plane that the edge divides from the other face's apex. Around a vertex
    the side along which distance shrinks fastest leads on; where it grows along all of them no place is nearer.

    All points in one call, since a call costs more than the way of one point.
    """
    rows, places, faces, across, apexes, starts, around, vertex_regular = links
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
        out_feet[p, 0], out_feet[p, 1], out_feet[p, 2] = fx, fy, fz


@compiled
def facing(
    normals: Normals,
    points: NDArray[np.float64],
    which: NDArray[np.int32],
    codes: NDArray[np.int8],
    feet: NDArray[np.float64],
    out_cosines: NDArray[np.float32],
    out_regular: NDArray[np.bool_],
) -> None:
    """Cosine between the way from each foot to its point and the normal there; and whether that tells the side."""
    faces, edges, face_normals, edge_normals, vertex_normals, edge_regular, vertex_regular = normals
    for p in range(len(points)):
        face, code = np.int64(which[p]), np.int64(codes[p])
        out_cosines[p], out_regular[p] = 0.0, False
        if face < 0:
            continue
        regular = True
        if code == 0:
            nx, ny, nz = face_normals[face, 0], face_normals[face, 1], face_normals[face, 2]
        elif code <= 3:
            e = edges[face, code - 1]
            nx, ny, nz = edge_normals[e, 0], edge_normals[e, 1], edge_normals[e, 2]
            regular = edge_regular[e]
        else:
            e = faces[face, code - 4]
            nx, ny, nz = vertex_normals[e, 0], vertex_normals[e, 1], vertex_normals[e, 2]
            regular = vertex_regular[e]
        dx, dy, dz = points[p, 0] - feet[p, 0], points[p, 1] - feet[p, 1], points[p, 2] - feet[p, 2]
        lengths = np.sqrt((nx * nx + ny * ny + nz * nz) * (dx * dx + dy * dy + dz * dz))
        if lengths > 0.0:
            out_cosines[p] = (nx * dx + ny * dy + nz * dz) / lengths
        out_regular[p] = regular
