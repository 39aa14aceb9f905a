"""Features of triangles: normals of their edges and vertices, and the faces across their edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..mesh.box_tree import morton_codes
from ..mesh.components import by_first_use, connected_components, grouped, sums_of
from ..mesh.edges import EdgeTable, edge_table
from ..mesh.unit_vectors import unit
from ..mesh.welding import coincident_faces, same_positions, same_rows
from .nearest_triangles import triangle_rows

FOLD = 0.02
"""Length of the sum of two unit normals below which the edge between them is a fold, and decides no side."""


class FaceFeatures(NamedTuple):
    """Triangles with the normals of their features (Bærentzen & Aanæs 2005).

    An edge is regular if exactly two faces share it, run along it in opposite directions and do not lie on each other;
    a vertex is regular if all edges around it are and its faces make one fan. There the sign of ``(x − y) · normal`` is
    the side of a point x whose nearest place is y.
    """

    corners: Floats  # (m, 9) corners of the faces, each face once, in the order of a space-filling curve
    rows: Floats  # (m, 16) the same as `foot_on_triangle` wants it
    vertices: Floats  # (n, 3) their positions
    faces: NDArray[np.int32]  # (m, 3) vertices; equal positions have equal ids
    edges: NDArray[np.int32]  # (m, 3) edges, from corner k to corner k + 1
    face_normals: Floats  # (m, 3) unit normals
    edge_normals: Floats  # (e, 3) sums of the unit normals of the faces at each edge
    vertex_normals: Floats  # (n, 3) sums of these weighted by the angles of the faces
    # (e,) and (n,) whether the surface is closed and consistent there
    edge_regular: Bools
    vertex_regular: Bools
    # (m, 3) the face across each edge, and its vertex opposite the edge; −1 where the edge is not regular
    across: NDArray[np.int32]
    apexes: NDArray[np.int32]
    # (n + 1,) and (3 m,): where the corners at each vertex begin in the second, and these as 3 × face + corner
    vertex_starts: Ints
    vertex_corners: NDArray[np.int32]
    trusted: NDArray[np.float32]  # (m,) confidence in each face: 1 for given faces, less for completed ones
    ids: Ints  # (m,) which of the given triangles each is

    @classmethod
    def of(cls, vertices: Floats, faces: Ints, trusted: NDArray[np.float32] | None = None) -> FaceFeatures:
        """Compute the features of (m, 3) faces; coincident vertices are one, and faces without extent and copies go."""
        faces = same_positions(vertices)[faces]
        trusted = np.ones(len(faces), dtype=np.float32) if trusted is None else trusted
        ids = np.arange(len(faces))
        a, b, c = faces.T
        proper = (a != b) & (b != c) & (c != a)
        if not proper.all():
            faces, trusted, ids = faces[proper], trusted[proper], ids[proper]
        if len(faces):  # what is near in space had better be near in memory
            order = np.argsort(morton_codes(vertices[faces].mean(axis=1)), kind="stable")
            trusted, ids = trusted[order], ids[order]
            numbers, used = by_first_use(faces[order].ravel(), len(vertices))
            faces, vertices = numbers.reshape(-1, 3), vertices[used]
        table = edge_table(faces)
        copies = _copies(faces, table)
        if copies.any():
            faces, trusted, ids = faces[~copies], trusted[~copies], ids[~copies]
            table = edge_table(faces)
        places = vertices[faces]
        corners = np.ascontiguousarray(places.reshape(-1, 9))
        starts, around = grouped(faces.ravel(), len(vertices))
        sides = np.roll(places, -1, axis=1) - places
        face_normals = unit(np.cross(sides[:, 0], sides[:, 1]))
        lengths = np.sqrt(np.einsum("mki,mki->mk", sides, sides))
        products = np.maximum(lengths * np.roll(lengths, 1, axis=1), 1e-300)
        cosines = np.einsum("mki,mki->mk", sides, np.roll(sides, 1, axis=1)) / -products
        angles = np.arccos(np.clip(cosines, -1.0, 1.0)).ravel()
        thrice = np.repeat(face_normals, 3, axis=0)
        edge_normals = sums_of(thrice, table.face_edges.ravel(), len(table.vertices))
        vertex_normals = sums_of(angles[:, None] * thrice, faces.ravel(), len(vertices))

        edge_regular, vertex_regular, mates = _regular(faces, table, edge_normals, len(vertices))
        across = np.where(mates < 0, -1, mates // 3).reshape(-1, 3).astype(np.int32)
        return cls(
            corners,
            triangle_rows(corners),
            vertices,
            faces.astype(np.int32),
            table.face_edges.astype(np.int32),
            face_normals,
            edge_normals,
            vertex_normals,
            edge_regular,
            vertex_regular,
            across,
            np.where(across < 0, -1, faces[across].sum(axis=2) - faces - np.roll(faces, -1, axis=1)).astype(np.int32),
            starts,
            around.astype(np.int32),
            trusted,
            ids,
        )


def _regular(faces: Ints, table: EdgeTable, edge_normals: Floats, n_vertices: int) -> tuple[Bools, Bools, Ints]:
    """Return which edges and vertices are regular; and (3 m,) the other halfedge of each at a regular edge, or −1."""
    edges = (table.face_counts == 2) & (table.balance == 0) & ((edge_normals**2).sum(axis=1) > FOLD**2)
    mates = np.where(edges[table.face_edges].ravel(), table.mates, -1)
    mated = np.flatnonzero(mates >= 0)
    following = np.roll(np.arange(len(mates)).reshape(-1, 3), -1, axis=1).ravel()
    fans = connected_components(len(mates), mated, following[mates[mated]])  # both leave the same vertex
    corners, fan = faces.ravel(), np.empty(n_vertices, dtype=np.int64)
    fan[corners] = fans
    vertices = np.ones(n_vertices, dtype=bool)
    vertices[corners[fans != fan[corners]]] = False  # cones that touch are several
    vertices[table.vertices[~edges]] = False
    return edges, vertices, mates


def _copies(faces: Ints, table: EdgeTable) -> Bools:
    """Return which faces repeat earlier ones, with the same corners in the same order of rotation."""
    copies = np.zeros(len(faces), dtype=bool)
    crowded = np.flatnonzero((table.face_counts > 2)[table.face_edges].all(axis=1))
    if len(crowded):
        first, reverse = coincident_faces(faces[crowded].ravel(), np.arange(0, 3 * len(crowded) + 1, 3))
        copies[crowded] = same_rows(np.column_stack([first, reverse])) != np.arange(len(crowded))
    return copies
