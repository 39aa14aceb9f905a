"""The same surface and the same sources in Delaunay triangles, in which exact distance takes few windows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..curve_segments import CurveSegments
from ..intrinsic.conforming_refinement import FaceCutter, MergedSources, affected_elements, flip_new_faces
from ..intrinsic_mesh import IntrinsicMesh
from .sources import PlacedSegments

FLIPPED = 0.05
"""Share of the edges that are not Delaunay from which other triangles are worth their making."""


def in_delaunay_triangles(
    triangles: IntrinsicMesh, placed: Sequence[PlacedSegments]
) -> tuple[IntrinsicMesh, list[PlacedSegments]] | None:
    """The surface in Delaunay triangles along whose edges the sources run; None if there is nothing to gain.

    The triangles are cut where segments cross them, and all edges that are no part of a source are flipped. Distances
    are those on the triangles given, whose vertices come first.
    """
    if not triangles.agree_on_lengths or share_to_flip(triangles) < FLIPPED:
        return None
    parts = [as_curve(triangles, each) for each in placed]
    finer, merged = triangles, MergedSources.of(parts)
    faces, edges = affected_elements(triangles, merged, [True] * len(parts))
    if faces or edges:
        finer, merged, _ = FaceCutter(triangles, merged, faces, edges).assemble()
    flipped, merged = flip_new_faces(finer, merged, np.ones(finer.n_faces, dtype=bool))
    return flipped, [PlacedSegments.of(flipped, merged.parts([False] * len(parts)))]


def share_to_flip(triangles: IntrinsicMesh) -> float:
    """Share of the edges that have two faces, with opposite angles that sum to more than π."""
    opposite = np.roll(triangles.corner_cotangents, 1, axis=1)  # the corner facing edge k is k + 2
    sums = np.bincount(triangles.edges.face_edges.ravel(), opposite.ravel(), triangles.n_edges)
    return float(((sums < -1e-9) & (triangles.edges.face_counts == 2)).mean())


def as_curve(triangles: IntrinsicMesh, placed: PlacedSegments) -> CurveSegments:
    """Placed segments as a curve without sides, each segment once."""
    first = np.unique(placed.given, return_index=True)[1]
    faces, along = placed.faces[first], placed.along_edge[first]
    starts, stops = placed.positions[first].T
    corners, sides = triangles.corner_positions[faces], triangles.edge_vectors[faces]
    off = sum(np.abs((np.conj(sides) * (ends[:, None] - corners)).imag) for ends in (starts, stops))
    lengths = np.abs(sides)
    nearest = np.where(lengths > 0, off / np.where(lengths > 0, lengths, 1.0), np.inf).argmin(axis=1)
    edges = np.where(along, triangles.edges.face_edges[faces, nearest], -1)
    normals = 1j * np.where(along, np.abs(stops - starts), stops - starts)  # in the frame of the edge, or of the face
    return CurveSegments(placed.nodes, placed.ends[first], faces, edges, normals, False)
