"""Which faces meet across which edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Bools, Floats, Ints
from .components import connected_components
from .intrinsic_mesh import IntrinsicMesh


@dataclass(frozen=True, eq=False)
class FacePairs:
    """Pairs of faces that meet at an edge.

    Around an edge with three or more faces each is paired with the next, cyclically, and each pair has weight ½:
    separating one face from all others then costs as much as separating two faces at a manifold edge.
    """

    faces: Ints  # (p, 2) the two faces
    # (p, 2) local index of the edge in each of the two faces; side k runs from corner k to corner k + 1
    sides: Ints
    edges: Ints  # (p,) the edge
    # (p, 2) in each face the corner at the edge's tail, and the one at its head, as an index into raveled (m, 3)
    # corners
    tails: Ints
    heads: Ints
    shares: Floats  # (p,) weight of each pair: 1, or ½ where three or more faces meet

    def ends(self, corner_values: Floats) -> Floats:
        """(p, 2) difference, first face less second, of (m, 3) corner values at the edge's tail and at its head.

        Of the values that a face field Y integrates to, the two differ by the edge's length times its curl (Eq. 15).
        """
        flat = corner_values.ravel()
        at_tail, at_head = flat[self.tails], flat[self.heads]
        return np.stack([at_tail[:, 0] - at_tail[:, 1], at_head[:, 0] - at_head[:, 1]], axis=1)


def face_pairs(triangles: IntrinsicMesh) -> FacePairs:
    """Pair the faces at every edge; boundary edges have no pair."""
    edge = triangles.edges.face_edges.ravel()
    starts, order = triangles.edges.halfedges
    count = np.diff(starts)
    following = np.arange(1, len(order) + 1)
    following[starts[1:][count > 0] - 1] = starts[:-1][count > 0]
    halfedges = np.stack([order, order[following]], axis=1)
    around = count[edge[order]]
    halfedges = halfedges[(around > 2) | ((around == 2) & (halfedges[:, 0] < halfedges[:, 1]))]

    faces, sides = halfedges // 3, halfedges % 3
    begin, end = halfedges, 3 * faces + (sides + 1) % 3
    forward = triangles.edges.forward.ravel()[halfedges]
    edges = edge[halfedges[:, 0]]
    return FacePairs(
        faces,
        sides,
        edges,
        tails=np.where(forward, begin, end),
        heads=np.where(forward, end, begin),
        shares=np.where(count[edges] > 2, 0.5, 1.0),
    )


def split_corners(triangles: IntrinsicMesh, pairs: FacePairs, cut: Bools) -> Ints:
    """(3m,) vertex of each corner, once the surface is cut open between some of the pairs (p,): ids from zero."""
    ends = np.concatenate([pairs.tails[~cut], pairs.heads[~cut]])
    return connected_components(triangles.corner_vertices.size, *ends.T)
