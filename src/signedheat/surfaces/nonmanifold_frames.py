"""Frames at nonmanifold edges, chosen so that heat enters the edge from its first face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..geodesics.exact_distance import distances_along_edges
from ..mesh.curve_segments import CurveSegments
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import concatenated


def nonmanifold_frames(
    triangles: IntrinsicMesh, groups: Sequence[Sequence[CurveSegments]]
) -> tuple[IntrinsicMesh, Sequence[Sequence[CurveSegments]]]:
    """Make the face that is nearest to the sources the first face of every edge with more than two faces.

    Heat that leaves one face through such an edge enters all the others. The frame of the edge distinguishes its first
    face from the others, so the first must be the face that heat comes from: vectors that pass between two of the
    others would be reflected. Edges whose ends are nearer than every opposite corner, which heat passes or runs along,
    keep their first face. Where none changes, the same triangles are returned.

    Examples
    --------
    >>> from signedheat.surfaces.surface_curves import Curve
    >>> from signedheat.surfaces.source_segments import segments_of_each
    >>> three = IntrinsicMesh.from_lengths(np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]]), np.ones((3, 3)), 5)
    >>> on_the_last = segments_of_each([Curve([2, 2], [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])], three)
    >>> nonmanifold_frames(three, on_the_last)[0].first_halfedges.tolist()
    [6, 1, 2, 4, 5, 7, 8]
    """
    table = triangles.edges
    if table.face_counts.max(initial=0) <= 2:
        return triangles, groups
    parts = [part for group in groups for part in group]
    if not parts:
        return triangles, groups
    distance = _distances(triangles, parts)
    holds = np.zeros(triangles.n_faces, dtype=bool)
    holds[np.concatenate([part.faces[part.edges < 0] for part in parts])] = True
    side = np.flatnonzero(table.face_counts[table.face_edges].ravel() > 2)
    edge = table.face_edges.ravel()[side]
    opposite = np.roll(triangles.corner_vertices, -2, axis=1).ravel()[side]
    ends = distance[table.vertices[edge]].mean(axis=1)
    first = np.full(triangles.n_edges, -1)
    first[table.face_edges.ravel()[triangles.first_halfedges]] = triangles.first_halfedges
    away = np.where(holds[side // 3], -1.0, distance[opposite])
    order = np.lexsort([side != first[edge], away, edge])  # among equally near faces the first stays first
    nearest = order[np.append(True, np.diff(edge[order]) > 0)]
    nearest = nearest[(away[nearest] < ends[nearest]) & (side[nearest] != first[edge[nearest]])]
    if not len(nearest):
        return triangles, groups
    changed = np.zeros(triangles.n_edges, dtype=bool)
    changed[edge[nearest]] = True
    first[edge[nearest]] = side[nearest]
    turned = replace(triangles, leading_sides=first[first >= 0])
    return turned, [[mirrored(part, changed) for part in group] for group in groups]


def mirrored(part: CurveSegments, changed: NDArray[np.bool_]) -> CurveSegments:
    """The segments, with the vectors on edges whose frames have changed reflected."""
    here = (part.edges >= 0) & changed[part.edges]
    return replace(part, vectors=np.where(here, np.conj(part.vectors), part.vectors)) if here.any() else part


def _distances(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> NDArray[np.float64]:
    """(n_vertices,) distance of every vertex from the sources along edges, from the corners of their faces on."""
    nodes = concatenated([part.nodes for part in parts])
    corners = triangles.corner_positions[nodes.faces]
    at = np.einsum("nk,nk->n", nodes.barycentric, corners)
    vertices = triangles.corner_vertices[nodes.faces].ravel()
    return distances_along_edges(triangles, vertices, np.abs(corners - at[:, None]).ravel())
