"""Triangles in space: areas, volumes, gradients, division, and edge flips along creases.

Contouring cell by cell cuts across the creases of a level set and leaves teeth there, although every vertex lies on the
level. Of the two triangulations of a quadrilateral, the one that bends less, with ``Σ length · angle`` over its five
edges, has its diagonal along the crease.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Protocol

import numpy as np

from ..arrays import Bools, Floats, Ints, mask_of
from ..compiled import compiled
from .components import element_components, sums_of
from .edges import EdgeTable, edge_keys, edge_table
from .unit_vectors import unit


class Triangles(Protocol):
    """Protocol of triangle meshes in space."""

    @property
    def vertices(self) -> Floats: ...  # (n, 3) positions
    @property
    def faces(self) -> Ints: ...  # (m, 3) vertex ids
    @property
    def edges(self) -> EdgeTable: ...  # the edges of the faces
    @property
    def n_vertices(self) -> int: ...  # number of vertices
    @property
    def n_faces(self) -> int: ...  # number of faces
    @property
    def bounds(self) -> Floats: ...  # (2, 3) lower and upper corner of the box around the faces


def area_vectors(triangles: Floats) -> Floats:
    """Return (m, 3) normals of (m, 3, 3) triangles, whose lengths are the areas."""
    a, b, c = np.asarray(triangles).transpose(1, 2, 0)
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    return np.stack([0.5 * (uy * vz - uz * vy), 0.5 * (uz * vx - ux * vz), 0.5 * (ux * vy - uy * vx)], axis=1)


def side_lengths(polygons: Floats) -> Floats:
    """Return (..., k) lengths of the sides that begin at each corner of (..., k, d) closed polygons."""
    sides = np.roll(polygons, -1, axis=-2) - polygons
    return np.sqrt(np.einsum("...i,...i->...", sides, sides))


def face_areas(triangles: Floats) -> Floats:
    """Return (m,) areas of (m, 3, 3) triangles."""
    vectors = area_vectors(triangles)
    return np.sqrt(np.einsum("mi,mi->m", vectors, vectors))


def heights(triangles: Floats) -> Floats:
    """Return (m,) heights of (m, 3, 3) triangles above their longest sides."""
    return 2.0 * face_areas(triangles) / np.maximum(reduce(np.maximum, side_lengths(triangles).T), 1e-300)


def corner_normals(triangles: Floats) -> Floats:
    """Return (3 m, 3) the unit normal of (m, 3, 3) triangles times the angle at each corner.

    Their sums at vertices are angle-weighted vertex normals.
    """
    sides = unit(np.roll(triangles, -1, axis=1) - triangles)
    angles = np.arccos(np.clip(-np.einsum("mki,mki->mk", sides, np.roll(sides, 1, axis=1)), -1.0, 1.0))
    return angles.reshape(-1, 1) * np.repeat(unit(area_vectors(triangles)), 3, axis=0)


def cone_volumes(triangles: Floats, counts: Ints, groups: Ints, n: int) -> Floats:
    """Return (n,) signed volumes of the cones over (m, 3, 3) triangles, summed in each of n groups.

    The apex is the center of area of the group, and each triangle of groups[k] counts counts[k] times.
    """
    middles, areas = triangles.mean(axis=1), face_areas(triangles)
    centres = sums_of(middles * areas[:, None], groups, n)
    centres /= np.maximum(np.bincount(groups, areas, n), np.finfo(float).tiny)[:, None]
    heights = ((middles - centres[groups]) * area_vectors(triangles)).sum(axis=1)
    return np.bincount(groups, counts * heights / 3.0, n).astype(np.float64)


def part_volumes(vertices: Floats, faces: Ints) -> tuple[Ints, Floats]:
    """Return (m,) the connected part of each triangle, and (p,) the volume in each part, negative for cavities."""
    parts = element_components(faces)
    first = np.unique(parts, return_index=True)[1]  # a vertex of each part as origin, so that no digits cancel far away
    corners = vertices[faces] - vertices[faces[first, 0]][parts, None]
    return parts, np.bincount(parts, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6


def divided_at(faces: Ints, rows: Ints, corners: Ints, points: Ints) -> Ints:
    """Divide the faces with ids `rows`, (k,), at points on one side each; return all faces, the halves last.

    The divided side begins at the corner `corners`, (k,), of the face, and `points` are the ids of the points, (k,).
    """
    a, b, c = (faces[rows, (corners + k) % 3] for k in range(3))
    halves = np.concatenate([np.stack([a, points, c], axis=1), np.stack([points, b, c], axis=1)])
    return np.concatenate([np.delete(faces, rows, axis=0), halves])


def halved(triangles: Floats) -> Floats:
    """Halve (m, 3, 3) triangles at the middle of their longest sides; return (2 m, 3, 3), first halves first."""
    corners = (side_lengths(triangles).argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, corners[:, :, None], axis=1).swapaxes(0, 1)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def cut_small(triangles: Floats, small: Callable[[Floats], Bools]) -> tuple[Floats, Ints]:
    """Halve (m, 3, 3) triangles until all parts are small.

    ``small(triangles)`` returns a boolean for each triangle. Returns (k, 3, 3) parts and (k,) the triangle of each,
    ascending.
    """
    owners, small_parts, small_owners = np.arange(len(triangles)), [triangles[:0]], [np.arange(0)]
    while len(triangles):
        done = small(triangles)
        small_parts.append(triangles[done])
        small_owners.append(owners[done])
        triangles, owners = halved(triangles[~done]), np.tile(owners[~done], 2)
    order = np.argsort(np.concatenate(small_owners), kind="stable")
    return np.concatenate(small_parts)[order], np.concatenate(small_owners)[order]


def gradients_along(sides: Floats, rises: Floats) -> Floats:
    """Return (p, 3) gradients of linear functions in planes.

    Each plane is spanned by two vectors, (p, 2, 3), along which the function rises by `rises`, (p, 2). The gradient is
    0 if they are parallel.
    """
    normals = np.cross(sides[:, 0], sides[:, 1])
    square = np.einsum("pd,pd->p", normals, normals)
    across = rises[:, :1] * sides[:, 1] - rises[:, 1:] * sides[:, 0]
    return np.cross(across, normals) / np.where(square > 0, square, np.inf)[:, None]


@compiled
def areas_of_polygons(vertices: Floats, corners: Ints, offsets: Ints) -> tuple[Floats, Bools]:
    """Return (p,) areas of polygons, and (p,) whether they are degenerate.

    Polygon f has the corners offsets[f] to offsets[f + 1] − 1 of `corners`, ids of (n, 3) vertices. It is degenerate
    without area, up to rounding, or with a repeated vertex.
    """
    n = len(offsets) - 1
    areas, degenerate = np.empty(n), np.zeros(n, dtype=np.bool_)
    last_polygon = np.full(len(vertices), -1)  # that each vertex was found in
    middle, to_tail, to_head, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for f in range(n):
        middle[:], normal[:] = 0.0, 0.0
        largest, radius = 0.0, 0.0  # absolute coordinates, of the corners and relative to their middle
        for c in range(offsets[f], offsets[f + 1]):
            v = corners[c]
            degenerate[f] |= last_polygon[v] == f
            last_polygon[v] = f
            for d in range(3):
                middle[d] += vertices[v, d] / (offsets[f + 1] - offsets[f])
                largest = max(largest, abs(vertices[v, d]))
        # the area vector is half the sum of cross products over the sides
        for c in range(offsets[f], offsets[f + 1]):
            tail, head = corners[c], corners[c + 1 if c + 1 < offsets[f + 1] else offsets[f]]
            for d in range(3):
                to_tail[d], to_head[d] = vertices[tail, d] - middle[d], vertices[head, d] - middle[d]
                radius = max(radius, abs(to_tail[d]))
            for d in range(3):  # a cross product, cyclically
                normal[d] += to_tail[d - 2] * to_head[d - 1] - to_tail[d - 1] * to_head[d - 2]
        areas[f] = 0.5 * np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        degenerate[f] |= areas[f] <= 4.0 * 2.0**-52 * radius * largest  # 4 units in the last place
    return areas, degenerate


AREA_ROUNDING = 1e-9
"""Relative difference of areas up to which they count as equal. Larger ones are not due to rounding."""
CREASE_ANGLE = np.deg2rad(25.0)
"""Angle between two faces, in radians, above which the edge between them may be a crease. Below it the surface counts
as smooth there."""
MOST_CREASED_FACES = 4_000_000
"""Number of faces above which no edges are flipped along creases, since that would take more memory than the
surface."""


def flipped_along_creases(vertices: Floats, faces: Ints, held: Bools | None = None) -> Ints:
    """Flip edges of (m, 3) faces where the surface then bends less, and return the faces.

    Edges of pairs of faces with a vertex for which `held`, (n,), is true are not flipped.
    """
    if not 0 < len(faces) <= MOST_CREASED_FACES:
        return faces
    _, _, sharp = bent_edges(vertices, faces)
    if not len(sharp):
        return faces
    near = mask_of(len(vertices), faces[sharp // 3])
    result: Ints = faces.copy()
    for _ in range(12):  # nearly all flips are made in the first four rounds
        chosen = np.flatnonzero(near[result].any(axis=1))
        rows, replacements, hopeful = _flips(vertices, result[chosen], near, held)
        if not len(rows):
            break
        result[chosen[rows]] = replacements
        # all other pairs gain nothing by a flip, and nothing changes around them
        near = mask_of(len(vertices), result[mask_of(len(vertices), hopeful)[result].any(axis=1)])
    return result


def bent_edges(vertices: Floats, faces: Ints, angle: float = CREASE_ANGLE) -> tuple[EdgeTable, Floats, Ints]:
    """Return the edges of faces, (m, 3) unit normals, and (k, 2) both halfedges of edges with a larger angle.

    The `angle`, in radians, is the one between the normals of the two faces.
    """
    table, normals = edge_table(faces), unit(area_vectors(vertices[faces]))
    first, second = normals[table.pairs // 3].swapaxes(0, 1)
    return table, normals, table.pairs[np.einsum("ij,ij->i", first, second) < np.cos(angle)]


def _flips(vertices: Floats, faces: Ints, whole: Bools, held: Bools | None) -> tuple[Ints, Ints, Ints]:
    """Choose pairs of faces whose common edge ab is flipped to cd, because the surface then bends less.

    No two pairs are neighbours. An edge is not flipped if there is an edge cd already. The (m, 3) `faces` may be part
    of a surface. `whole`, (n,), is true for vertices all of whose faces are among them. It must be for a, b, and one of
    c and d, so that an edge cd would be seen. Pairs with a vertex for which `held`, (n,), is true are not flipped.
    Returns (k,) faces to replace, (k, 3) their replacements, and (j, 4) vertices of all pairs that gain by a flip.
    """
    table, normals, creases = bent_edges(vertices, faces)
    (first, second), (i, j) = (creases // 3).T, (creases % 3).T
    a, b = faces[first, i], faces[first, (i + 1) % 3]
    c, d = faces[first, (i + 2) % 3], faces[second, (j + 2) % 3]
    rim = (  # tail, head, side, its face, and the new face that it will belong to
        (b, c, (i + 1) % 3, first, 1),
        (c, a, (i + 2) % 3, first, 0),
        (a, d, (j + 1) % 3, second, 0),
        (d, b, (j + 2) % 3, second, 1),
    )
    # how much less the surface bends across the edge itself, and across the four edges around it
    new = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    new_normals = [unit(area_vectors(vertices[corners])) for corners in new]
    gain = _bend(vertices, a, b, normals[first], normals[second]) - _bend(vertices, c, d, *new_normals)
    reach = np.linalg.norm(vertices[c] - vertices[d], axis=1)
    faces_around = [first, second]
    for tail, head, side, owner, side_of_rim in rim:
        beyond = table.mates[3 * owner + side]
        neighbor = np.where(beyond >= 0, beyond // 3, owner)
        faces_around.append(neighbor)
        before = _bend(vertices, tail, head, normals[owner], normals[neighbor])
        after = _bend(vertices, tail, head, new_normals[side_of_rim], normals[neighbor])
        gain += np.where(beyond >= 0, before - after, 0.0)
    # which flips are allowed
    keys = edge_keys(c, d)
    present = np.isin(keys, edge_keys(*table.vertices.T))
    gain[~(whole[a] & whole[b] & (whole[c] | whole[d])) | (c == d)] = 0.0
    hopeful = np.stack([a, b, c, d], axis=1)[gain > 1e-9 * reach]
    gain[present] = 0.0
    if held is not None:
        gain[held[a] | held[b] | held[c] | held[d]] = 0.0
    # a flip is chosen if it gains more than all others with one of its six faces
    rank = 1 + np.argsort(np.argsort(gain, kind="stable"))
    rank[gain <= 1e-9 * reach] = 0  # less is rounding
    best = np.zeros(len(faces), dtype=np.int64)
    for face in faces_around:
        np.maximum.at(best, face, rank)
    won = np.flatnonzero((rank > 0) & np.all([best[face] == rank for face in faces_around], axis=0))
    won = won[np.unique(keys[won], return_index=True)[1]]  # two flips may make the same edge
    return np.concatenate([first[won], second[won]]), np.concatenate([new[0][won], new[1][won]]), hopeful


def _bend(vertices: Floats, tails: Ints, heads: Ints, first_normals: Floats, second_normals: Floats) -> Floats:
    """Return (k,) lengths of edges times the angles between the unit normals, (k, 3), of the faces on both sides."""
    lengths = np.linalg.norm(vertices[heads] - vertices[tails], axis=1)
    return lengths * np.arccos(np.clip(np.einsum("ij,ij->i", first_normals, second_normals), -1.0, 1.0))
