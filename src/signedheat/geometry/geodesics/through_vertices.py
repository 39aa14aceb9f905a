"""Sources that all but pass a vertex or an edge are put there: windows between would be lost in rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..curve_segments import CurveSegments
from ..intrinsic_mesh import IntrinsicMesh
from ..surface_points import EDGE, FACE, barycentric_in, concatenated, locate_points, unique_points
from .sources import PlacedSegments

NEAR = 1e-6
"""Barycentric coordinates below which a point of a source is put on the edge or at the vertex."""


def through_vertices(triangles: IntrinsicMesh, placed: PlacedSegments) -> PlacedSegments:
    """Segments through the vertices that they all but pass, and along edges; without sides where any moves."""
    nodes = placed.nodes
    on_edge, inside = nodes.kinds == EDGE, nodes.kinds == FACE
    near = on_edge & (np.minimum(nodes.along, 1 - nodes.along) < NEAR) | inside & (nodes.barycentric < NEAR).any(axis=1)
    curve = as_curve(triangles, placed) if near.any() else None
    return placed if curve is None else PlacedSegments.of(triangles, [curve])


def as_curve(triangles: IntrinsicMesh, placed: PlacedSegments) -> CurveSegments | None:
    """Placed segments as a curve without sides, each once, and its points; None where a face is glued to itself."""
    once = np.unique(placed.given, return_index=True)[1]
    faces, nodes = placed.faces[once], placed.nodes
    at = np.stack([barycentric_in(triangles, faces, nodes[placed.ends[once, k]]) for k in range(2)])
    corners = triangles.corner_positions[faces]
    apart = np.abs((at * corners).sum(axis=2) - placed.positions[once].T)
    if (apart > NEAR * triangles.edge_lengths[faces].max(axis=1)).any():
        return None
    at = rounded(at)
    alone = np.setdiff1d(np.arange(len(nodes)), placed.ends)
    ends = locate_points(triangles, np.tile(faces, 2), at.reshape(-1, 3))
    points = locate_points(triangles, nodes.faces[alone], rounded(nodes.barycentric[alone]))
    located = concatenated([ends, points])
    first, who = unique_points(located)
    joined = who[: 2 * len(faces)].reshape(2, -1).T
    steps = ((at[1] - at[0]) * corners).sum(axis=1)
    empty = (at == 0).all(axis=0)
    sides = triangles.edges.face_edges[faces, (empty.argmax(axis=1) + 1) % 3]
    edges = np.where(empty.any(axis=1), sides, -1)
    normals = 1j * np.where(edges < 0, steps, np.abs(steps))  # in the layout of the face, or in the frame of the edge
    kept = (joined[:, 0] != joined[:, 1]) & (np.abs(steps) > 0)
    return CurveSegments(located[first], joined[kept], faces[kept], edges[kept], normals[kept], False)


def rounded(barycentric: NDArray[np.float64]) -> NDArray[np.float64]:
    kept = np.where(barycentric < NEAR, 0.0, barycentric)
    result: NDArray[np.float64] = kept / kept.sum(axis=-1, keepdims=True)
    return result
