"""Clipping of oriented triangles against the tets that they cross, and location of points in tets.

A source in space need not conform to the mesh. Every triangle is clipped to one convex polygon in each tet that it
crosses; the area vectors of the polygons add up to that of the triangle. A polygon that lies in a face of the mesh is
shared equally by the tets at that face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF
from .meshes import Tets

FLAT = 1e-10
"""Tets whose volume, over the cube of the longest edge, is below this contain no part of a source."""

TOUCHING = 1e-9
"""Distance, relative to the size of a face, within which a point counts as lying in its plane."""


@dataclass(frozen=True, eq=False)
class ClippedPolygons:
    """Convex polygons, each the part of a source in one tet.

    Attributes
    ----------
    tets : (p,) int
        Tet that each polygon lies in.
    parents : (p,) int
        Triangle or point of the source that it is part of.
    area_vectors : (p, 3) float
        Area times normal.
    areas : (p,) float
        Areas.
    barycentric : (p, 4) float
        Barycentric coordinates of its centroid in the tet.
    in_face : (p,) int
        Corner opposite to the face that it lies in, −1 in the interior of the tet.
    """

    tets: NDArray[np.int64]
    parents: NDArray[np.int64]
    area_vectors: NDArray[np.float64]
    areas: NDArray[np.float64]
    barycentric: NDArray[np.float64]
    in_face: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Planes:
    """The planes of the faces of a mesh, the same to the last bit for all tets that share a face.

    Attributes
    ----------
    normals : (f, 3) float
        Unit normals, out of the first tet; zero for faces without area.
    offsets : (f,) float
        Value of ``normal · x`` on the plane, with x relative to `center`.
    tolerances : (f,) float
        Distance within which a point counts as lying in the plane.
    signs : (m, 4) float
        +1 where the normal points out of the tet, −1 where into it.
    shares : (f,) float
        One over the number of tets at the face that are not flat.
    solid : (m,) bool
        Tets that are not flat, and can contain polygons.
    center : (3,) float
        Centre of the mesh; coordinates are taken relative to it to reduce rounding errors.
    """

    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    signs: NDArray[np.float64]
    shares: NDArray[np.float64]
    solid: NDArray[np.bool_]
    center: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Tets) -> Planes:
        """The planes of the faces of a tet mesh."""
        faces, geometry = mesh.faces, mesh.geometry
        center = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        points = mesh.vertices - center
        a, b, c = (points[faces.vertices[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        twice_area = np.linalg.norm(normals, axis=1)
        normals /= np.where(twice_area > 0, twice_area, 1)[:, None]
        signs = np.sign(np.einsum("mki,mki->mk", normals[faces.tet_faces], geometry.area_vectors))
        solid = geometry.thickness > FLAT
        counts = np.bincount(faces.tet_faces[solid].ravel(), minlength=len(normals))
        return cls(
            normals=normals,
            offsets=np.einsum("fi,fi->f", normals, (a + b + c) / 3),
            tolerances=TOUCHING * np.sqrt(twice_area) + 1e-15 * np.abs(points).max(),
            signs=signs,
            shares=1 / np.maximum(counts, 1),
            solid=solid,
            center=center,
        )


def clip_triangles(mesh: Tets, planes: Planes, triangles: NDArray[np.float64]) -> ClippedPolygons:
    """Clip (k, 3, 3) triangles against the tets that they cross; parts outside the mesh are dropped.

    Examples
    --------
    >>> from signedheat import TetMesh
    >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    >>> across = np.array([[[0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [0.0, 2.0, 0.5]]])
    >>> clip_triangles(mesh, Planes.of(mesh), across).area_vectors
    array([[0.   , 0.   , 0.125]])
    """
    tree = mesh.search_tree
    found = _clip(
        np.ascontiguousarray(triangles - planes.center),
        tree.bounds,
        tree.items,
        planes.center,
        mesh.faces.tet_faces,
        planes.normals,
        planes.offsets,
        planes.tolerances,
        planes.signs,
        planes.shares,
        planes.solid,
    )
    tets, parents, area_vectors, areas, centers, in_face = found
    return ClippedPolygons(
        tets, parents, area_vectors, areas, barycentric(mesh, tets, centers + planes.center), in_face
    )


def containing_tets(mesh: Tets, planes: Planes, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """(k,) a tet that contains each point, −1 outside the mesh.

    Examples
    --------
    >>> from signedheat import TetMesh
    >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    >>> containing_tets(mesh, Planes.of(mesh), np.array([[0.1, 0.1, 0.1], [1.0, 1.0, 1.0]]))
    array([ 0, -1])
    """
    tree = mesh.search_tree
    return _locate(
        np.ascontiguousarray(points - planes.center),
        tree.bounds,
        tree.items,
        planes.center,
        mesh.faces.tet_faces,
        planes.normals,
        planes.offsets,
        planes.tolerances,
        planes.signs,
        planes.solid,
    )


def barycentric(mesh: Tets, tets: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, 4) barycentric coordinates of points in given tets, clamped to be nonnegative, each row with sum one."""
    from_corner = points[:, None] - mesh.vertices[mesh.tets[tets][:, [1, 0, 0, 0]]]  # on the face opposite each corner
    inward = -np.einsum("pki,pki->pk", mesh.geometry.area_vectors[tets], from_corner)
    inward = np.maximum(inward / np.maximum(np.abs(inward).max(axis=1, keepdims=True), np.finfo(float).tiny), 0)
    total = inward.sum(axis=1, keepdims=True)
    return np.divide(inward, total, out=np.full_like(inward, 0.25), where=total > 0)  # flat tets: their middle


@compiled
def _locate(points, bounds, items, center, tet_faces, normals, offsets, tolerances, signs, solid):
    found = np.full(len(points), -1, dtype=np.int64)
    stack = np.empty(128, dtype=np.int64)
    leaves = len(bounds) // 2
    for p in range(len(points)):
        x, y, z = points[p] + center
        slack = 1e-9 * (bounds[1, 3] - bounds[1, 0])
        depth = 1
        stack[0] = 1
        deepest = -np.inf
        while depth > 0:
            depth -= 1
            node = stack[depth]
            box = bounds[node]
            if (
                x < box[0] - slack
                or y < box[1] - slack
                or z < box[2] - slack
                or x > box[3] + slack
                or y > box[4] + slack
                or z > box[5] + slack
            ):
                continue
            if node < leaves:
                stack[depth] = 2 * node + 1
                stack[depth + 1] = 2 * node
                depth += 2
                continue
            for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                t = items[k]
                if t < 0 or not solid[t]:
                    continue
                inside = np.inf
                for c in range(4):
                    f = tet_faces[t, c]
                    height = offsets[f] - (
                        normals[f, 0] * points[p, 0] + normals[f, 1] * points[p, 1] + normals[f, 2] * points[p, 2]
                    )
                    inside = min(inside, signs[t, c] * height + tolerances[f])
                if inside >= 0.0 and (inside > deepest or (inside == deepest and t < found[p])):
                    deepest = inside
                    found[p] = t
    return found


@compiled
def _clip(triangles, bounds, items, center, tet_faces, normals, offsets, tolerances, signs, shares, solid):
    size = 64 + 4 * len(triangles)
    tets, parents = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    area_vectors, centers = np.empty((size, 3)), np.empty((size, 3))
    areas, in_face = np.empty(size), np.empty(size, dtype=np.int64)
    count = 0
    polygon, other = np.empty((8, 3)), np.empty((8, 3))
    heights, normal = np.empty(8), np.empty(3)
    stack = np.empty(128, dtype=np.int64)
    leaves = len(bounds) // 2
    for p in range(len(triangles)):
        a, b, c = triangles[p, 0], triangles[p, 1], triangles[p, 2]
        u0, u1, u2, v0, v1, v2 = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        normal[0], normal[1], normal[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        whole = 0.5 * np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
        if whole == 0.0:
            continue
        lower = np.minimum(np.minimum(a, b), c) + center
        upper = np.maximum(np.maximum(a, b), c) + center
        level = (normal * (a + center)).sum()
        depth = 1
        stack[0] = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            box = bounds[node]
            apart = False
            middle = 0.0
            reach = 0.0
            for i in range(3):
                slack = 1e-9 * (bounds[1, 3 + i] - bounds[1, i])
                apart |= box[i] > upper[i] + slack or box[3 + i] < lower[i] - slack
                middle += normal[i] * 0.5 * (box[i] + box[3 + i])
                reach += abs(normal[i]) * (0.5 * (box[3 + i] - box[i]) + slack)
            if apart or abs(middle - level) > reach:
                continue
            if node < leaves:
                stack[depth] = 2 * node + 1
                stack[depth + 1] = 2 * node
                depth += 2
                continue
            for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                t = items[k]
                if t < 0 or not solid[t]:
                    continue
                if _beyond(a, b, c, tet_faces[t], normals, offsets, tolerances, signs[t]):
                    continue
                for i in range(3):
                    polygon[0, i], polygon[1, i], polygon[2, i] = a[i], b[i], c[i]
                n = 3
                on = -1
                for corner in range(4):
                    f = tet_faces[t, corner]
                    sign = signs[t, corner]
                    n, flat = _cut(polygon, n, other, heights, normals[f], offsets[f], tolerances[f], sign)
                    if flat:
                        on = corner
                    if n < 3:
                        break
                if n < 3:
                    continue
                if count == size:
                    size *= 2
                    tets = _longer(tets, size)
                    parents = _longer(parents, size)
                    areas = _longer(areas, size)
                    in_face = _longer(in_face, size)
                    area_vectors = _taller(area_vectors, size)
                    centers = _taller(centers, size)
                area = _measure(polygon, n, normal, area_vectors[count], centers[count])
                if area <= 0.0:
                    continue
                if on >= 0:
                    share = shares[tet_faces[t, on]]
                    area *= share
                    for axis in range(3):
                        area_vectors[count, axis] *= share
                tets[count] = t
                parents[count] = p
                areas[count] = area
                in_face[count] = on
                count += 1
    return (
        tets[:count].copy(),
        parents[:count].copy(),
        area_vectors[:count].copy(),
        areas[:count].copy(),
        centers[:count].copy(),
        in_face[:count].copy(),
    )


@compiled
def _beyond(a, b, c, faces, normals, offsets, tolerances, signs):
    """Whether a triangle lies entirely outside one of the faces."""
    for k in range(4):
        f, sign = faces[k], signs[k]
        x, y, z = normals[f, 0], normals[f, 1], normals[f, 2]
        level = sign * offsets[f] + tolerances[f]
        if (
            sign * (x * a[0] + y * a[1] + z * a[2]) > level
            and sign * (x * b[0] + y * b[1] + z * b[2]) > level
            and sign * (x * c[0] + y * c[1] + z * c[2]) > level
        ):
            return True
    return False


@compiled
def _cut(polygon, n, other, heights, normal, offset, tolerance, sign):
    """Clip a polygon to the inner side of a plane. Also whether the whole polygon lies in the plane.

    Heights and crossings are the same, to the last bit, for the tets on both sides of the plane.
    """
    most, least = 0.0, 0.0
    for i in range(n):
        height = normal[0] * polygon[i, 0] + normal[1] * polygon[i, 1] + normal[2] * polygon[i, 2] - offset
        heights[i] = 0.0 if abs(height) <= tolerance else sign * height
        most = max(most, heights[i])
        least = min(least, heights[i])
    if most <= 0.0:
        return n, least == 0.0
    kept = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        if heights[i] <= 0.0:
            for axis in range(3):
                other[kept, axis] = polygon[i, axis]
            kept += 1
        if (heights[i] < 0.0 < heights[j]) or (heights[j] < 0.0 < heights[i]):
            part = heights[i] / (heights[i] - heights[j])
            for axis in range(3):
                other[kept, axis] = polygon[i, axis] + part * (polygon[j, axis] - polygon[i, axis])
            kept += 1
    for i in range(kept):
        for axis in range(3):
            polygon[i, axis] = other[i, axis]
    return kept, False


@compiled
def _measure(polygon, n, normal, area_vector, center):
    """Area vector and centroid of a convex polygon; returns its area, negative if rounding has turned it over."""
    area_vector[:] = 0.0
    center[:] = 0.0
    total = 0.0
    size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for i in range(1, n - 1):
        u0, u1, u2 = polygon[i, 0] - polygon[0, 0], polygon[i, 1] - polygon[0, 1], polygon[i, 2] - polygon[0, 2]
        j = i + 1
        v0, v1, v2 = polygon[j, 0] - polygon[0, 0], polygon[j, 1] - polygon[0, 1], polygon[j, 2] - polygon[0, 2]
        w0, w1, w2 = 0.5 * (u1 * v2 - u2 * v1), 0.5 * (u2 * v0 - u0 * v2), 0.5 * (u0 * v1 - u1 * v0)
        part = (w0 * normal[0] + w1 * normal[1] + w2 * normal[2]) / size
        area_vector[0] += w0
        area_vector[1] += w1
        area_vector[2] += w2
        total += part
        for axis in range(3):
            center[axis] += part * (polygon[0, axis] + polygon[i, axis] + polygon[j, axis]) / 3.0
    if total > 0.0:
        for axis in range(3):
            center[axis] /= total
    return total


@compiled
def _longer(array, size):
    longer = np.empty(size, dtype=array.dtype)
    for i in range(len(array)):
        longer[i] = array[i]
    return longer


@compiled
def _taller(array, size):
    taller = np.empty((size, array.shape[1]), dtype=array.dtype)
    for i in range(len(array)):
        for axis in range(array.shape[1]):
            taller[i, axis] = array[i, axis]
    return taller
