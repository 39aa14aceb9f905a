"""Clipping of oriented triangles against the tets that they cross, location of points in tets, and lines of sight.

A source in space need not conform to the mesh. Every triangle is clipped to one convex polygon in each tet that it
crosses; the area vectors of the polygons add up to that of the triangle. A polygon that lies in a face of the mesh is
shared equally by the tets at that face.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.tet_shapes import TetShapes, inside_out
from ..parallel import ROWS_PER_TASK, in_chunks

SOURCELESS_TET = 1e-10
"""Tets with less volume than this, relative to the cube of their longest edge, contain no part of a source."""
IN_FACE_PLANE = 1e-9
"""A point lies in the plane of a face up to this distance, relative to the size of the face."""
SIGHT_OUTSIDE = 1e-6
"""A line of sight may lie outside the mesh by this length, relative to the size of the tets."""


@dataclass(frozen=True, eq=False)
class ClippedPolygons:
    """Convex polygons, each the part of a triangle or point of a source that lies in one tet."""

    tets: Ints  # (p,) the tet that each polygon lies in
    parents: Ints  # (p,) the triangle or point of the source that each is part of
    area_vectors: Floats  # (p, 3) area times normal
    areas: Floats  # (p,)
    barycentric: Floats  # (p, 4) barycentric coordinates of each centroid in its tet
    in_face: Ints  # (p,) the corner of the tet opposite the face that it lies in; −1 for those in no face


class Planes(NamedTuple):
    """The planes of the faces of a mesh, the same to the last bit for all tets that share a face."""

    tet_faces: Ints  # (m, 4) the face opposite each corner of each tet
    normals: Floats  # (f, 3) unit normals, out of the first tet; zero for faces without area
    offsets: Floats  # (f,) value of ``normal · x`` on the plane, with x relative to `center`
    tolerances: Floats  # (f,) distance within which a point counts as lying in the plane
    signs: Floats  # (m, 4) +1 where the normal points out of the tet, −1 where it points into it
    shares: Floats  # (f,) one over the number of tets at the face that are not flat
    solid: Bools  # (m,) whether each tet has a volume, and can contain polygons
    center: Floats  # (3,) centre of the mesh: coordinates relative to it have smaller rounding errors

    @classmethod
    def of(cls, mesh: TetShapes) -> Planes:
        """Compute the planes of the faces of a tet mesh."""
        faces = mesh.faces
        center = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        points = mesh.vertices - center
        a, b, c = (points[faces.vertices[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        twice_area = np.linalg.norm(normals, axis=1)
        normals /= np.where(twice_area > 0, twice_area, 1)[:, None]
        signs = np.sign(np.einsum("mki,mki->mk", normals[faces.tet_faces], mesh.area_vectors))
        flipped = inside_out(mesh)
        signs[flipped] *= -1  # so that lines of sight pass through these tets
        solid = (mesh.thickness > SOURCELESS_TET) & ~flipped
        counts = np.bincount(faces.tet_faces[solid].ravel(), minlength=len(normals))
        return cls(
            tet_faces=np.ascontiguousarray(faces.tet_faces),
            normals=normals,
            offsets=np.einsum("fi,fi->f", normals, (a + b + c) / 3),
            tolerances=IN_FACE_PLANE * np.sqrt(twice_area) + 1e-15 * np.abs(points).max(),
            signs=signs,
            shares=1 / np.maximum(counts, 1),
            solid=solid,
            center=center,
        )


def clip_triangles(mesh: TetShapes, planes: Planes, triangles: Floats) -> ClippedPolygons:
    """Clip (k, 3, 3) triangles against the tets of a mesh, whose faces have the given planes.

    Returns a convex polygon for each tet and triangle that overlap, with its area vector and its centroid. Parts
    outside the mesh are dropped.
    """
    parts = []
    for begin in range(0, max(len(triangles), 1), ROWS_PER_TASK):  # most tets near a triangle contain no part of it
        chunk = triangles[begin : begin + ROWS_PER_TASK]
        starts, tets = mesh.search_tree.meeting(chunk, _slack(mesh))
        parents = np.repeat(np.arange(len(chunk)), np.diff(starts))
        vectors, areas, centers, in_face = _clip(planes, chunk - planes.center, parents, tets)
        kept = areas > 0
        parts.append([column[kept] for column in (tets, parents + begin, vectors, areas, centers, in_face)])
    tets, parents, vectors, areas, centers, in_face = (np.concatenate(column) for column in zip(*parts, strict=True))
    return ClippedPolygons(tets, parents, vectors, areas, barycentric(mesh, tets, centers + planes.center), in_face)


def containing_tets(mesh: TetShapes, planes: Planes, points: Floats) -> Ints:
    """(k,) a tet that contains each of (k, 3) points; −1 outside the mesh."""

    def located(chunk: Floats) -> tuple[Ints]:
        """(k,) tets that contain (k, 3) points."""
        near = mesh.search_tree.meeting(np.repeat(chunk[:, None], 3, axis=1), slack)
        return (_locate(planes, chunk - planes.center, *near),)

    slack = _slack(mesh)
    return in_chunks(located, points)[0]


def _slack(mesh: TetShapes) -> float:
    """Return the length by which boxes of tets are enlarged in a search, since rounding may put a point outside."""
    lower, upper = mesh.search_tree.bounds[1].reshape(2, 3)
    return 1e-9 * float((upper - lower).max())


def barycentric(mesh: TetShapes, tets: Ints, points: Floats) -> Floats:
    """(k, 4) barycentric coordinates of (k, 3) points in (k,) tets, clamped to at least 0, with sum 1."""
    from_corner = points[:, None] - mesh.vertices[mesh.tets[tets][:, [1, 0, 0, 0]]]  # on the face opposite each corner
    inward = -np.einsum("pki,pki->pk", mesh.area_vectors[tets], from_corner)
    inward = np.maximum(inward / np.maximum(np.abs(inward).max(axis=1, keepdims=True), np.finfo(float).tiny), 0)
    total = inward.sum(axis=1, keepdims=True)
    middle = np.full_like(inward, 0.25)  # for flat tets
    return np.divide(inward, total, out=middle, where=total > 0)


@compiled
def beyond(planes: Planes, tet: int, k: int, x: float, y: float, z: float) -> float:
    """Return the distance by which a point is outside of the face opposite corner k of a tet, negative inside.

    The point is relative to the centre of the mesh.
    """
    f = planes.tet_faces[tet, k]
    height = planes.normals[f, 0] * x + planes.normals[f, 1] * y + planes.normals[f, 2] * z - planes.offsets[f]
    return planes.signs[tet, k] * height


@compiled
def _locate(planes: Planes, points: Floats, starts: Ints, near: Ints) -> Ints:
    """(k,) the tet in which each of (k, 3) points lies deepest, of those in ``near[starts[p]:starts[p + 1]]``; or −1.

    Points are relative to the centre of the mesh.
    """
    tets = np.full(len(points), -1, dtype=np.int64)
    for p in range(len(points)):
        deepest = -np.inf
        for t in near[starts[p] : starts[p + 1]]:
            if not planes.solid[t]:
                continue
            inside = np.inf
            for c in range(4):
                out = beyond(planes, t, c, points[p, 0], points[p, 1], points[p, 2])
                inside = min(inside, planes.tolerances[planes.tet_faces[t, c]] - out)
            if inside >= 0.0 and (inside > deepest or (inside == deepest and t < tets[p])):
                deepest = inside
                tets[p] = t
    return tets


@compiled
def _clip(planes: Planes, triangles: Floats, parents: Ints, tets: Ints) -> tuple[Floats, Floats, Floats, Ints]:
    """Clip triangle `parents[k]` to tet `tets[k]`, for p pairs of both.

    Return (p, 3) area vectors, (p,) areas, 0 if there is no common part, (p, 3) centroids, and (p,) the corners
    opposite the faces that parts lie in, or −1. Parts in a face are shared equally by its tets.
    """
    area_vectors, centers = np.zeros((len(tets), 3)), np.zeros((len(tets), 3))
    areas, in_face = np.zeros(len(tets)), np.full(len(tets), -1)
    polygon, other, heights, normal = np.empty((8, 3)), np.empty((8, 3)), np.empty(8), np.empty(3)
    for k in range(len(tets)):
        if not planes.solid[tets[k]]:
            continue
        a, b, c = triangles[parents[k], 0], triangles[parents[k], 1], triangles[parents[k], 2]
        u0, u1, u2, v0, v1, v2 = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        normal[0], normal[1], normal[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        if not (normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2 > 0.0):
            continue
        for i in range(3):
            polygon[0, i], polygon[1, i], polygon[2, i] = a[i], b[i], c[i]
        n = 3
        for corner in range(4):
            n, flat = _cut(planes, tets[k], corner, polygon, n, other, heights)
            if flat:
                in_face[k] = corner
            if n < 3:
                break
        if n < 3:
            continue
        areas[k] = _measure(polygon, n, normal, area_vectors[k], centers[k])
        if in_face[k] >= 0:
            share = planes.shares[planes.tet_faces[tets[k], in_face[k]]]
            areas[k] *= share
            for axis in range(3):
                area_vectors[k, axis] *= share
    return area_vectors, areas, centers, in_face


@compiled
def _cut(
    planes: Planes, tet: int, corner: int, polygon: Floats, n: int, other: Floats, heights: Floats
) -> tuple[int, bool]:
    """Clip the first n points of a polygon to the inner side of the face of a tet opposite `corner`, in place.

    Return the new number of points, and whether the polygon lies in the plane of the face. `other` and `heights` are
    working memory.
    """
    most, least = 0.0, 0.0
    for i in range(n):  # heights and crossings are the same, to the last bit, for the tets on both sides
        height = beyond(planes, tet, corner, polygon[i, 0], polygon[i, 1], polygon[i, 2])
        heights[i] = 0.0 if abs(height) <= planes.tolerances[planes.tet_faces[tet, corner]] else height
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
def _measure(polygon: Floats, n: int, normal: Floats, area_vector: Floats, center: Floats) -> float:
    """Return the area of a convex polygon of n points, negative if rounding has flipped it over from its `normal`.

    Write its area vector and centroid to `area_vector` and `center`.
    """
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
def stays_inside(
    planes: Planes, neighbors: Ints, tet: int, x: float, y: float, z: float, u: float, w: float, t: float, slack: float
) -> bool:
    """Whether the segment from (x, y, z), in tet `tet`, to (u, w, t) lies in the mesh, up to `slack`.

    `neighbors` are the (m, 4) tets beyond faces, or −1.
    """
    for _ in range(len(neighbors)):
        leave, crossing = -1, np.inf
        for k in range(4):
            there = beyond(planes, tet, k, u, w, t)
            if there > slack:
                here = beyond(planes, tet, k, x, y, z)
                if there > here and -here / (there - here) < crossing:
                    leave, crossing = k, -here / (there - here)
        if leave < 0:
            return True
        tet = neighbors[tet, leave]
        if tet < 0:
            return False
    return False


@compiled
def visible(planes: Planes, neighbors: Ints, starts: Floats, targets: Floats, slack: float) -> Bools:
    """(m,) whether segments from (m, 3) starts, one in each tet, to (m, 3) targets lie in the mesh, up to `slack`."""
    seen = np.empty(len(starts), dtype=np.bool_)
    for tet in range(len(starts)):
        x, y, z = starts[tet]
        u, w, t = targets[tet]
        seen[tet] = stays_inside(planes, neighbors, tet, x, y, z, u, w, t, slack)
    return seen
