"""The same surface and the same sources in Delaunay triangles, in which exact distance takes few windows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..intrinsic.conforming_refinement import FaceCutter, MergedSources, affected_elements, flip_new_faces
from ..intrinsic_mesh import IntrinsicMesh
from .sources import PlacedSegments
from .through_vertices import as_curve

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
    if any(part is None for part in parts):
        return None
    finer, merged = triangles, MergedSources.of([part for part in parts if part is not None])
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
