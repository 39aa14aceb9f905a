"""Boxes, distance to them, sheets of few faces, and shapes turned inside out or cut finer."""

import numpy as np

from signedheat import TriangleMesh
from signedheat.mesh.edges import edge_table


def turned(mesh):
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def box(lower, upper):
    """Twelve faces, outward."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    lower = np.asarray(lower, dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)]
    return TriangleMesh(lower + corners * (np.asarray(upper) - lower), faces)


def distance_to_box(points, lower, upper):
    """Signed distance to the box between two corners, in any dimension."""
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    beyond = np.maximum(lower - points, points - upper)
    return np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0)


def sheet(corners):
    """Two faces on four corners."""
    return TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]])


def finer(vertices, faces):
    """The same surface with each triangle cut in four."""
    table = edge_table(faces)
    (a, b, c), (ab, bc, ca) = faces.T, (len(vertices) + table.face_edges).T
    quarters = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([vertices, vertices[table.vertices].mean(axis=1)]), np.concatenate(quarters)
