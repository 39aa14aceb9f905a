"""Flips of edges of a triangulated level set, after which they run along its creases.

Marching from cell to cell cuts across the creases of a level set and leaves teeth there, although every vertex lies on
the level. Of the two triangulations of a quadrilateral the one that bends less, ``Σ length · angle`` over its five
edges, has its diagonal along the crease.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from .edges import EdgeTable, edge_keys, edge_table
from .triangles import area_vectors
from .unit_vectors import unit

SHARP = np.deg2rad(25.0)
"""Angle between two faces above which the edge between them is a candidate."""
MOST = 4_000_000
"""Number of faces above which creases stay as they are: the search for them would take more memory than the surface."""


def flipped_along_creases(vertices: Floats, faces: Ints, held: Bools | None = None) -> Ints:
    """Return (m, 3) faces on the same vertices, with edges flipped wherever that makes the surface bend less.

    No edge may have more than two faces, and these agree. Nothing is flipped around vertices that are `held`, (n,).
    """
    if not 0 < len(faces) <= MOST:
        return faces
    _, _, sharp = _creases(vertices, faces)
    if not len(sharp):
        return faces
    near = np.zeros(len(vertices), dtype=bool)
    near[faces[sharp // 3]] = True
    chosen = np.flatnonzero(near[faces].any(axis=1))
    result: Ints = faces.copy()
    for _ in range(12):  # nearly all flips are made in the first four rounds
        first, second, new_first, new_second = _flips(vertices, result[chosen], near, held)
        if not len(first):
            break
        result[chosen[first]], result[chosen[second]] = new_first, new_second
    return result


def _creases(vertices: Floats, faces: Ints) -> tuple[EdgeTable, Floats, Ints]:
    """Return edges and unit normals of faces, and both halfedges of the edges with an angle above `SHARP`."""
    table, normals = edge_table(faces), unit(area_vectors(vertices[faces]))
    first, second = normals[table.pairs // 3].swapaxes(0, 1)
    return table, normals, table.pairs[np.einsum("ij,ij->i", first, second) < np.cos(SHARP)]


def _flips(vertices: Floats, faces: Ints, whole: Bools, held: Bools | None) -> tuple[Ints, Ints, Ints, Ints]:
    """Return pairs of faces to replace, (k,) each, no two pairs neighbours, and their replacements, (k, 3) each.

    The edge from a to b has c and d across; it is replaced by the edge from c to d, unless there is one already. One of
    these must be `whole`: a vertex all of whose faces are given.
    """
    table, normals, creases = _creases(vertices, faces)
    (first, second), (i, j) = (creases // 3).T, (creases % 3).T
    a, b = faces[first, i], faces[first, (i + 1) % 3]
    c, d = faces[first, (i + 2) % 3], faces[second, (j + 2) % 3]
    rim = (  # tail, head, side, its face, and the new face that it will belong to
        (b, c, (i + 1) % 3, first, 1),
        (c, a, (i + 2) % 3, first, 0),
        (a, d, (j + 1) % 3, second, 0),
        (d, b, (j + 2) % 3, second, 1),
    )
    new = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    new_normals = [unit(area_vectors(vertices[corners])) for corners in new]
    gain = _bend(vertices, a, b, normals[first], normals[second]) - _bend(vertices, c, d, *new_normals)
    reach = np.linalg.norm(vertices[c] - vertices[d], axis=1)
    faces_around = [first, second]
    for tail, head, side, owner, which in rim:
        beyond = table.mates[3 * owner + side]
        neighbor = np.where(beyond >= 0, beyond // 3, owner)
        faces_around.append(neighbor)
        before = _bend(vertices, tail, head, normals[owner], normals[neighbor])
        after = _bend(vertices, tail, head, new_normals[which], normals[neighbor])
        gain += np.where(beyond >= 0, before - after, 0.0)
    keys = edge_keys(c, d)
    present = np.isin(keys, edge_keys(*table.vertices.T))
    gain[present | ~(whole[c] | whole[d]) | (c == d)] = 0.0
    if held is not None:
        gain[held[a] | held[b] | held[c] | held[d]] = 0.0
    order = np.argsort(gain, kind="stable")
    rank = np.empty(len(gain), dtype=np.int64)
    rank[order] = np.arange(1, len(gain) + 1)
    rank[gain <= 1e-9 * reach] = 0  # less is rounding
    best = np.zeros(len(faces), dtype=np.int64)
    for face in faces_around:
        np.maximum.at(best, face, rank)
    won = np.flatnonzero((rank > 0) & np.all([best[face] == rank for face in faces_around], axis=0))
    won = won[np.unique(keys[won], return_index=True)[1]]  # two flips may make the same edge
    return first[won], second[won], new[0][won], new[1][won]


def _bend(vertices: Floats, tails: Ints, heads: Ints, first_normals: Floats, second_normals: Floats) -> Floats:
    """Return (k,) length times the angle between the unit normals on both sides of edges."""
    lengths = np.linalg.norm(vertices[heads] - vertices[tails], axis=1)
    return lengths * np.arccos(np.clip(np.einsum("ij,ij->i", first_normals, second_normals), -1.0, 1.0))
