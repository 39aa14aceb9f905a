"""Faces with normals at their edges and vertices, and a tree of boxes and discs to find the nearest face of points.

A node's disc contains all faces below it. Its plane is the mean plane of these faces, and its thickness their deviation
from it. Far from a surface, boxes of many faces are as near as that of the nearest face, since boxes are not aligned
with the surface. Of the discs only few are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, read_only
from ..compiled import compiled
from ..errors import SourceError
from ..mesh.box_tree import BOXES_PER_LEAF, BoxTree, boxes_around, order_along_curve
from ..mesh.components import by_first_use, connected_components, sums_of
from ..mesh.edges import EdgeTable, edge_table, has_three_corners
from ..mesh.unit_vectors import unit
from ..mesh.welding import coincident_faces, same_positions, same_rows
from ..parallel import in_chunks
from .nearest_triangles import foot_on_triangle, nearest_faces, triangle_rows

EQUALLY_NEAR = 1e-9
"""Relative difference of distances, or of sines, up to which two faces or segments count as equally near."""
FOLDED_EDGE = 0.02
"""Length of the sum of the unit normals of two faces up to which their common edge is a fold. Its normal is then too
inaccurate to tell the side of a point."""
DISC_THICKNESS = 0.5
"""Half thickness of a disc, relative to its radius, below which it is used besides the box."""
FARTHEST_SEARCH = 1e7
"""Distance, in sizes of a surface, to which farther points are moved before a search, since rounding grows with
distance. Rounding and the changed angle then move the nearest point by at most 1e-7 of the size."""


class FaceFeatures(NamedTuple):
    """Triangles with the normals of their features (Bærentzen & Aanæs 2005).

    An edge is regular if exactly two faces share it, run along it in opposite directions and do not lie on each other.
    A vertex is regular if all its edges are and its faces form one fan. Faces that bound nothing are not regular, nor
    are their edges and vertices. If y is the nearest point of the surface to x, and lies on a regular feature, the sign
    of ``(x − y) · normal`` tells on which side of the surface x is.
    """

    corners: Floats  # (m, 9) corners of the faces, each face once, in the order of a space-filling curve
    rows: Floats  # (m, 16) the faces in the form of `triangle_rows`, for `foot_on_triangle`
    vertices: Floats  # (n, 3) positions
    faces: NDArray[np.int32]  # (m, 3) vertices; equal positions have equal ids
    edges: NDArray[np.int32]  # (m, 3) edges, from corner k to corner k + 1
    face_normals: Floats  # (m, 3) unit normals
    edge_normals: Floats  # (e, 3) sums of the unit normals of the faces at each edge
    vertex_normals: Floats  # (n, 3) sums of the unit normals of the faces at each vertex, weighted by angles
    # (m,), (e,) and (n,) whether each face, edge and vertex is regular
    face_regular: Bools
    edge_regular: Bools
    vertex_regular: Bools
    trusted: NDArray[np.float32]  # (m,) confidence in each face: 1 for given faces, less for completed ones
    ids: Ints  # (m,) index of each face among the given triangles

    @classmethod
    def of(
        cls,
        vertices: Floats,
        faces: Ints,
        trusted: NDArray[np.float32] | None = None,
        bounding: Bools | None = None,
    ) -> FaceFeatures:
        """Compute the features of (m, 3) faces, after merging coincident vertices.

        Copies of faces, and faces with two corners at one position, are dropped. `trusted`, (m,), is the confidence in
        each face, by default 1. `bounding`, (m,), says whether each face bounds the inside, by default all do.
        """
        faces = same_positions(vertices)[faces]
        trusted = np.ones(len(faces), dtype=np.float32) if trusted is None else trusted
        ids = np.arange(len(faces))
        proper = has_three_corners(faces)
        if not proper.all():
            faces, trusted, ids = faces[proper], trusted[proper], ids[proper]
        if len(faces):  # faces near each other in space should be so in memory
            middles = reduce(np.add, vertices.take(faces, axis=0).swapaxes(0, 1))  # three times as far from the origin
            order = order_along_curve(middles)
            trusted, ids = trusted[order], ids[order]
            numbers, used = by_first_use(faces[order].ravel(), len(vertices))
            faces, vertices = numbers.reshape(-1, 3), vertices[used]
        table = edge_table(faces)
        copies = _copies(faces, table)
        if copies.any():
            faces, trusted, ids = faces[~copies], trusted[~copies], ids[~copies]
            table = edge_table(faces)
        places = vertices.take(faces, axis=0)
        corners = np.ascontiguousarray(places.reshape(-1, 9))
        sides = np.roll(places, -1, axis=1) - places
        face_normals = unit(np.cross(sides[:, 0], sides[:, 1]))
        lengths = np.sqrt(np.einsum("mki,mki->mk", sides, sides))
        products = np.maximum(lengths * np.roll(lengths, 1, axis=1), 1e-300)
        cosines = np.einsum("mki,mki->mk", sides, np.roll(sides, 1, axis=1)) / -products
        angles = np.arccos(np.clip(cosines, -1.0, 1.0)).ravel()
        thrice = np.repeat(face_normals, 3, axis=0)
        edge_normals = sums_of(thrice, table.face_edges.ravel(), len(table.vertices))
        vertex_normals = sums_of(angles[:, None] * thrice, faces.ravel(), len(vertices))
        bound = np.ones(len(ids), dtype=np.bool_) if bounding is None else bounding[ids]
        positions = corners, triangle_rows(corners), vertices
        ids_of_faces = faces.astype(np.int32), table.face_edges.astype(np.int32)
        normals = face_normals, edge_normals, vertex_normals
        regular = _regular(faces, table, edge_normals, bound, len(vertices))
        return cls(*positions, *ids_of_faces, *normals, bound, *regular, trusted, ids)


def _regular(faces: Ints, table: EdgeTable, edge_normals: Floats, bound: Bools, n_vertices: int) -> tuple[Bools, Bools]:
    """Return (e,) whether each edge is regular, and (n,) whether each vertex is, as `FaceFeatures` says.

    `bound`, (m,), says whether each face is. `edge_normals`, (e, 3), are sums of the unit normals of faces.
    """
    edges = (
        (table.face_counts == 2)
        & (table.balance == 0)
        & (np.einsum("ei,ei->e", edge_normals, edge_normals) > FOLDED_EDGE**2)
    )
    edges[table.face_edges[~bound]] = False
    # a fan is connected by halfedges that leave the same vertex: each, and the one after its mate in the next face
    mates = np.where(edges[table.face_edges].ravel(), table.mates, -1)
    paired = np.flatnonzero(mates >= 0)
    opposite = mates[paired]
    following = np.where(opposite % 3 < 2, opposite + 1, opposite - 2)
    fans = connected_components(len(mates), paired, following)
    corners, some_fan = faces.ravel(), np.empty(n_vertices, dtype=np.int64)
    some_fan[corners] = fans
    vertices = np.ones(n_vertices, dtype=bool)
    vertices[corners[fans != some_fan[corners]]] = False  # several fans touch at these
    vertices[table.vertices[~edges]] = False
    return edges, vertices


def _copies(faces: Ints, table: EdgeTable) -> Bools:
    """Return (m,) bool, true for faces with the same corners, in the same cyclic order, as an earlier face."""
    copies, ahead = np.zeros(len(faces), dtype=bool), (table.face_counts + table.balance) // 2  # (e,) halfedges ahead
    alike = np.where(table.forward, ahead[table.face_edges], (table.face_counts - ahead)[table.face_edges])
    beside_others = np.flatnonzero((alike > 1).all(axis=1))  # other faces run along all edges of these as they do
    if len(beside_others):
        first, reverse = coincident_faces(faces[beside_others].ravel(), np.arange(0, 3 * len(beside_others) + 1, 3))
        copies[beside_others] = same_rows(np.column_stack([first, reverse])) != np.arange(len(beside_others))
    return copies


@dataclass(frozen=True, eq=False)
class FaceTree:
    """Faces in a tree of boxes and discs, for finding the face nearest to a point."""

    features: FaceFeatures  # the faces, with normals
    tree: BoxTree  # the tree of their boxes

    @classmethod
    def of(cls, features: FaceFeatures) -> FaceTree:
        """Build the tree of faces; raise `SourceError` if there is no face."""
        if not len(features.corners):
            raise SourceError("no face of the shape has an extent", element="shape")
        triangles = features.corners.reshape(-1, 3, 3)
        return cls(features, BoxTree.in_order(*boxes_around(triangles), np.arange(len(triangles))))

    @classmethod
    def of_triangles(
        cls, triangles: Floats, trusted: NDArray[np.float32] | None = None, bounding: Bools | None = None
    ) -> FaceTree:
        """Build the tree of (m, 3, 3) triangles.

        `trusted`, (m,), is the confidence in each, by default 1. `bounding`, (m,), says whether each bounds the inside,
        by default all do.
        """
        faces = np.arange(3 * len(triangles)).reshape(-1, 3)
        return cls.of(FaceFeatures.of(triangles.reshape(-1, 3), faces, trusted, bounding))

    @cached_property
    def discs(self) -> Floats:
        """Centre, normal, radius and half thickness of each node's disc, (2 · leaves, 8) float; −1 for no disc."""
        return _discs(self.features.corners, self.tree)

    def distances(self, points: Floats) -> Floats:
        """Return (n,) distances of (n, 3) points to the nearest face."""
        (distances,) = in_chunks(lambda chunk: (self._distances(chunk),), points)
        return distances

    def search(self, points: Floats) -> NearestFaces:
        """Return the nearest face of each of (n, 3) points, with distances and nearest points on the faces.

        The search is fastest if successive points are near each other.
        """
        nearer = self._brought_near(points)
        faces, _ = self.nearest(nearer)
        result = feet_on(self.features, faces, nearer)
        return result if nearer is points else replace(result, distances=np.linalg.norm(points - result.places, axis=1))

    def _distances(self, points: Floats) -> Floats:
        """Return (n,) distances of (n, 3) points to the nearest face, without parallel threads."""
        nearer = self._brought_near(points)
        if nearer is not points:
            return self.search(points).distances
        return np.sqrt(self.nearest(points)[1])

    def _brought_near(self, points: Floats) -> Floats:
        """Return the points, those farther than `FARTHEST_SEARCH` sizes of the surface moved towards its middle.

        If none is that far, the same array is returned.
        """
        lower, upper = self.tree.bounds[1, :3], self.tree.bounds[1, 3:]
        middle, limit = 0.5 * (lower + upper), FARTHEST_SEARCH * float(np.linalg.norm(upper - lower))
        away = points - middle
        distances = np.linalg.norm(away, axis=1)
        far = (distances > limit) & (limit > 0)
        if not far.any():
            return points
        result: Floats = points.copy()
        result[far] = middle + away[far] * (limit / distances[far])[:, None]
        return result

    def nearest(self, points: Floats) -> tuple[NDArray[np.int32], Floats]:
        """Return (n,) the nearest face of each of (n, 3) points, and (n,) the squares of their distances."""
        # a search starts afresh after 512 points, which divides what a thread takes at a time
        return nearest_faces(self.features.rows, self.tree, self.discs, points, 512)


@compiled
def _discs(corners: Floats, tree: BoxTree) -> Floats:
    """Compute `FaceTree.discs`, (2 · leaves, 8): for each node of the tree, a flat disc that contains all its faces.

    Discs are convex, so it is enough that they contain the corners, (m, 9). The normal is that of the sum of area
    vectors, and the middle that of the box, moved along the normal until it is halfway between the outermost corners.
    """
    bounds, items = tree.bounds, tree.items
    leaves = len(bounds) // 2
    discs = np.full((2 * leaves, 8), -1.0)
    first_node = max(1, leaves >> 7)  # eight levels: higher nodes are not flat
    n_items = BOXES_PER_LEAF * leaves // first_node  # below each node of a level, which begins with `first_node`
    for node in range(first_node, 2 * leaves):
        if node == 2 * first_node:
            first_node, n_items = node, n_items // 2
        begin = (node - first_node) * n_items
        nx, ny, nz = 0.0, 0.0, 0.0
        for at in range(begin, begin + n_items):
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
        square, low, high = 0.0, np.inf, -np.inf  # squared radius, and lowest and highest corner along the normal
        for at in range(begin, begin + n_items):
            if items[at] >= 0:
                for c in range(0, 9, 3):
                    ax, ay, az = corners[items[at], c] - x, corners[items[at], c + 1] - y, corners[items[at], c + 2] - z
                    along = ax * nx + ay * ny + az * nz
                    low, high = min(low, along), max(high, along)
                    square = max(square, ax * ax + ay * ay + az * az - along * along)
        radius, thickness, middle = np.sqrt(square), 0.5 * (high - low), 0.5 * (high + low)
        if thickness < DISC_THICKNESS * radius:
            slack = 1.0 + 1e-9  # against rounding
            discs[node, 0], discs[node, 1], discs[node, 2] = x + middle * nx, y + middle * ny, z + middle * nz
            discs[node, 3], discs[node, 4], discs[node, 5] = nx, ny, nz
            discs[node, 6], discs[node, 7] = radius * slack, thickness * slack + 1e-12 * radius
    return discs


@dataclass(frozen=True, eq=False)
class NearestFaces:
    """The nearest face of each of n points."""

    faces: NDArray[np.int32]  # (n,) id of the face
    distances: Floats  # (n,) unsigned distance
    places: Floats  # (n, 3) the nearest point of the face
    # (n,) feature on which the nearest point lies: 0 inside the face, 1 to 3 on its edges, 4 to 6 at its corners
    features: NDArray[np.int8]
    # (n,) cosine of the angle between the normal of the feature and the vector from the nearest point to the point,
    # positive in front of the face
    cosines: NDArray[np.float32]
    regular: Bools  # (n,) whether the feature is regular, so that the sign of the cosine tells the side


def feet_on(features: FaceFeatures, faces: NDArray[np.int32], points: Floats) -> NearestFaces:
    """Find the nearest point of face faces[k] to points[k], for n faces and (n, 3) points."""
    return NearestFaces(faces, *_feet(features, faces, read_only(points)))


@compiled
def _feet(
    features: FaceFeatures, faces: NDArray[np.int32], points: Floats
) -> tuple[Floats, Floats, NDArray[np.int8], NDArray[np.float32], Bools]:
    """Compute the fields of `NearestFaces` from `distances` on, for the nearest face of each of (n, 3) points."""
    n = len(points)
    distances, feet, kinds = np.empty(n), np.empty((n, 3)), np.empty(n, dtype=np.int8)
    cosines, regular = np.empty(n, dtype=np.float32), np.empty(n, dtype=np.bool_)
    for p in range(n):
        face, x, y, z = np.int64(faces[p]), points[p, 0], points[p, 1], points[p, 2]
        square, kinds[p], fx, fy, fz = foot_on_triangle(features.rows, face, x, y, z)
        distances[p], feet[p, 0], feet[p, 1], feet[p, 2] = np.sqrt(square), fx, fy, fz
        cosines[p], regular[p] = _cosine_to_normal(features, face, kinds[p], x - fx, y - fy, z - fz)
    return distances, feet, kinds, cosines, regular


@compiled
def _cosine_to_normal(
    features: FaceFeatures, face: int, feature: int, dx: float, dy: float, dz: float
) -> tuple[float, bool]:
    """Return the cosine of the angle between a feature's normal and (dx, dy, dz), and whether the feature is regular.

    The feature is that of a face: 0 for the face itself, 1 to 3 for its edges, 4 to 6 for its corners.
    """
    normals, row = features.face_normals, np.int64(face)
    regular = features.face_regular[row]
    if feature > 3:
        normals, row = features.vertex_normals, np.int64(features.faces[face, feature - 4])
        regular = features.vertex_regular[row]
    elif feature > 0:
        normals, row = features.edge_normals, np.int64(features.edges[face, feature - 1])
        regular = features.edge_regular[row]
    nx, ny, nz = normals[row, 0], normals[row, 1], normals[row, 2]
    lengths = np.sqrt((nx * nx + ny * ny + nz * nz) * (dx * dx + dy * dy + dz * dz))
    return (nx * dx + ny * dy + nz * dz) / lengths if lengths > 0.0 else 0.0, regular
