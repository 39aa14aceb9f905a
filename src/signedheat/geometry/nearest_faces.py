"""Kernels: distance to faces and their sides, from candidates nearby.

A candidate is a face that is near, not always the nearest. Over a surface without gaps it leads there: as long as the
foot lies on the rim of a face, faces on the other side of that rim may be nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .face_features import FaceFeatures
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

    def replaced(self, rows: NDArray[np.int64], others: NearestFaces) -> NearestFaces:
        """What was found anew for some of the points, written over what is there."""
        for name, values in vars(self).items():
            values[rows] = getattr(others, name)
        return self


def search_from(
    features: FaceFeatures,
    points: NDArray[np.float64],
    candidates: NDArray[np.int32],
) -> NearestFaces:
    """The nearest of (n, c) candidate faces of each of (n, 3) points, or one that leads on from it; −1 is none.

    What is nearest to the point before is a candidate, too: where points are in order, it is often the right one. As
    long as there is no candidate, there is no face, and distance is infinite.
    """
    n = len(points)
    found = NearestFaces(
        np.empty(n, dtype=np.int32),
        np.empty(n),
        np.empty((n, 3)),
        np.empty(n, dtype=np.int8),
        np.empty(n, dtype=np.float32),
        np.empty(n, dtype=np.bool_),
    )
    _search(
        features.rows,
        features.vertices,
        features.faces,
        features.across,
        features.vertex_starts,
        features.vertex_corners,
        features.spokes,
        features.edges,
        features.face_normals,
        features.edge_normals,
        features.vertex_normals,
        features.edge_regular,
        features.vertex_regular,
        points,
        candidates,
        found.faces,
        found.distances,
        found.feet,
        found.features,
        found.cosines,
        found.regular,
    )
    return found


@compiled(nogil=True, error_model="numpy")
def _search(
    rows: NDArray[np.float64],
    places: NDArray[np.float64],
    faces: NDArray[np.int32],
    across: NDArray[np.int32],
    starts: NDArray[np.int64],
    around: NDArray[np.int32],
    spokes: NDArray[np.float32],
    edges: NDArray[np.int32],
    face_normals: NDArray[np.float64],
    edge_normals: NDArray[np.float64],
    vertex_normals: NDArray[np.float64],
    edge_regular: NDArray[np.bool_],
    vertex_regular: NDArray[np.bool_],
    points: NDArray[np.float64],
    candidates: NDArray[np.int32],
    out_faces: NDArray[np.int32],
    out_distances: NDArray[np.float64],
    out_feet: NDArray[np.float64],
    out_features: NDArray[np.int8],
    out_cosines: NDArray[np.float32],
    out_regular: NDArray[np.bool_],
) -> None:
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        face, square, feature, fx, fy, fz = -1, np.inf, 0, x, y, z
        for c in range(-1, candidates.shape[1]):
            if c >= 0:
                other = np.int64(candidates[p, c])
            else:
                other = np.int64(out_faces[p - 1]) if p > 0 else -1
            if other >= 0 and other != face and (c <= 0 or other != candidates[p, c - 1]):
                s, which, u, v, w = foot_on_triangle(rows, other, x, y, z)
                if s < square:
                    face, square, feature, fx, fy, fz = other, s, which, u, v, w
        if feature != 0:
            face, square, feature, fx, fy, fz = walk_to_nearest(
                rows,
                places,
                faces,
                across,
                starts,
                around,
                spokes,
                vertex_regular,
                x,
                y,
                z,
                face,
                square,
                feature,
                fx,
                fy,
                fz,
            )
        out_faces[p], out_features[p], out_distances[p] = face, feature, np.sqrt(square)
        out_feet[p, 0], out_feet[p, 1], out_feet[p, 2] = fx, fy, fz
        out_cosines[p], out_regular[p] = facing(
            faces,
            edges,
            face_normals,
            edge_normals,
            vertex_normals,
            edge_regular,
            vertex_regular,
            face,
            feature,
            x - fx,
            y - fy,
            z - fz,
            square,
        )


@compiled(nogil=True, error_model="numpy")
def walk_to_nearest(
    rows: NDArray[np.float64],
    places: NDArray[np.float64],
    faces: NDArray[np.int32],
    across: NDArray[np.int32],
    starts: NDArray[np.int64],
    around: NDArray[np.int32],
    spokes: NDArray[np.float32],
    vertex_regular: NDArray[np.bool_],
    x: float,
    y: float,
    z: float,
    face: int,
    square: float,
    feature: int,
    fx: float,
    fy: float,
    fz: float,
) -> tuple[int, float, int, float, float, float]:
    """From a face and the foot of (x, y, z) on it to faces that are nearer, across their rims."""
    for _ in range(STEPS):
        before = face
        if feature == 0:
            break
        if feature <= 3:
            other = np.int64(across[face, feature - 1])
        else:
            vertex = np.int64(faces[face, feature - 4])
            vx, vy, vz = places[vertex, 0], places[vertex, 1], places[vertex, 2]
            dx, dy, dz = x - vx, y - vy, z - vz
            steepest, other = 0.0, -1  # the side along which distance shrinks fastest; if none, no place is nearer
            turns = 1 if vertex_regular[vertex] else 2  # around a whole vertex every side is the first of one corner
            for k in range(starts[vertex], starts[vertex + 1]):
                for turn in range(turns):
                    gain = dx * spokes[k, 3 * turn] + dy * spokes[k, 3 * turn + 1] + dz * spokes[k, 3 * turn + 2]
                    if gain > steepest:
                        steepest, other = gain, np.int64(around[k]) // 3
        if other >= 0:
            s, which, u, v, w = foot_on_triangle(rows, other, x, y, z)
            if s < square:
                face, square, feature, fx, fy, fz = other, s, which, u, v, w
        if face == before:
            break
    return face, square, feature, fx, fy, fz


@compiled(nogil=True, error_model="numpy")
def facing(
    faces: NDArray[np.int32],
    edges: NDArray[np.int32],
    face_normals: NDArray[np.float64],
    edge_normals: NDArray[np.float64],
    vertex_normals: NDArray[np.float64],
    edge_regular: NDArray[np.bool_],
    vertex_regular: NDArray[np.bool_],
    face: int,
    feature: int,
    dx: float,
    dy: float,
    dz: float,
    square: float,
) -> tuple[float, bool]:
    """Cosine between (dx, dy, dz), away from a foot, and the normal there; and whether that tells the side."""
    if face < 0:
        return 0.0, False
    regular = True
    if feature == 0:
        nx, ny, nz = face_normals[face, 0], face_normals[face, 1], face_normals[face, 2]
    elif feature <= 3:
        e = edges[face, feature - 1]
        nx, ny, nz = edge_normals[e, 0], edge_normals[e, 1], edge_normals[e, 2]
        regular = edge_regular[e]
    else:
        e = faces[face, feature - 4]
        nx, ny, nz = vertex_normals[e, 0], vertex_normals[e, 1], vertex_normals[e, 2]
        regular = vertex_regular[e]
    lengths = np.sqrt((nx * nx + ny * ny + nz * nz) * square)
    return (nx * dx + ny * dy + nz * dz) / lengths if lengths > 0.0 else 0.0, regular


@compiled(nogil=True)
def feet_of_nodes(
    rows: NDArray[np.float64], nearest: NDArray[np.int32], steps: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Turn the nearest face of each node, in place, into the nearest of (s, 4) feet, 0 in front; and their faces."""
    n0, n1, n2 = nearest.shape
    count = 0
    for i in range(n0):
        for j in range(n1):
            for k in range(n2):
                count += nearest[i, j, k] >= 0
    feet = np.zeros((count, 4), dtype=np.float32)
    faces = np.empty(count, dtype=np.int32)
    count = 0
    for i in range(n0):
        for j in range(n1):
            for k in range(n2):
                f = np.int64(nearest[i, j, k])
                if f >= 0:
                    _, _, x, y, z = foot_on_triangle(rows, f, i * steps[0], j * steps[1], k * steps[2])
                    feet[count, 1], feet[count, 2], feet[count, 3] = x, y, z
                    faces[count] = f
                    nearest[i, j, k] = count
                    count += 1
    return feet, faces
