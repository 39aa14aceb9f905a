"""The sides of curves on a surface, found from the curves alone: where they are closed, no heat is needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geodesics.geodesic_sources import PlacedSegments
from ..mesh.components import connected_components
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import EDGE, VERTEX, incident_faces

TIE = 1e-9
"""Relative difference of distances, or of sines, below which two segments are equally near."""


@dataclass(frozen=True, eq=False)
class CurveSides:
    """The sides of the vertices of a surface, as far as oriented curves decide them."""

    # (n,) 1 or −1 in regions that the curves bound from one side only, without a free end in it; 0 elsewhere
    regions: NDArray[np.int64]
    # (n,) the side of the nearest segment among those in the faces at a vertex; 0 where there is none, and near free
    # ends
    nearby: NDArray[np.int64]
    reach: NDArray[np.float64]  # (n,) distance to that segment; inf where there is none
    # (k,) nodes at which curves end, away from the boundary of the surface, or run head to head
    free_ends: NDArray[np.int64]


def curve_sides(triangles: IntrinsicMesh, placed: PlacedSegments) -> CurveSides:
    """Find the sides of curves, from their segments.

    The regions are those of vertices joined by edges that no curve crosses. A region is on one side if all segments
    seen from its vertices show them the same side; free ends connect both, and make every region around them unknown.
    """
    ends = free_ends(triangles, placed)
    nearby, reach = nearest_sides(triangles, placed, ends)
    oriented = placed.sides != 0
    nodes = placed.nodes[np.unique(placed.ends[oriented])]
    on_curve = np.zeros(triangles.n_vertices, dtype=bool)
    on_curve[nodes.elements[nodes.kinds == VERTEX]] = True
    tail, head = triangles.edges.vertices.T
    is_open = ~(on_curve[tail] | on_curve[head])
    is_open[nodes.elements[nodes.kinds == EDGE]] = False
    region = connected_components(triangles.n_vertices, tail[is_open], head[is_open])
    reached = np.zeros((2, region.max(initial=-1) + 1), dtype=bool)
    reached[0, region[nearby > 0]] = reached[1, region[nearby < 0]] = True
    if len(ends):
        around = triangles.corner_vertices[incident_faces(triangles, placed.nodes[ends])[1]]
        reached[:, region[around]] = True
    side = reached[0].astype(np.int64) - reached[1]
    return CurveSides(np.where(on_curve, 0, side[region]), np.where(on_curve, 0, nearby), reach, ends)


def free_ends(triangles: IntrinsicMesh, placed: PlacedSegments) -> NDArray[np.int64]:
    """Nodes at which more segments of oriented curves begin than end, or fewer: the boundary of the chain of segments.

    Ends at the boundary of the surface do not count.
    """
    _, once = np.unique(placed.given, return_index=True)
    sides, ends = placed.sides[once], placed.ends[once]
    n = len(placed.nodes)
    surplus = np.bincount(ends[:, 1], sides, n) - np.bincount(ends[:, 0], sides, n)
    at_boundary = np.zeros(triangles.n_vertices, dtype=bool)
    rim = triangles.edges.face_counts == 1
    at_boundary[triangles.edges.vertices[rim]] = True
    kinds, elements = placed.nodes.kinds, placed.nodes.elements
    outer = np.zeros(n, dtype=bool)
    outer[kinds == VERTEX] = at_boundary[elements[kinds == VERTEX]]
    outer[kinds == EDGE] = rim[elements[kinds == EDGE]]
    return np.flatnonzero((surplus != 0) & ~outer)


def nearest_sides(
    triangles: IntrinsicMesh, placed: PlacedSegments, ends: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Side of the nearest oriented segment in the faces at each vertex, and the distance to it.

    Of segments that meet at the nearest point, the one that is seen most from the front decides the side.
    """
    n = triangles.n_vertices
    rows = np.flatnonzero(placed.sides != 0)
    start, step = placed.positions[rows, :1], np.diff(placed.positions[rows], axis=1)
    faces, sides = placed.faces[rows], placed.sides[rows]
    corner = triangles.corner_positions[faces] - start
    share = np.clip((corner * np.conj(step)).real / np.abs(step) ** 2, 0.0, 1.0)
    gap = np.abs(corner - share * step)
    height = (np.conj(step) * corner).imag / np.abs(step)
    height[np.abs(height) <= TIE * np.abs(step)] = 0.0
    is_end = np.zeros(len(placed.nodes), dtype=bool)
    is_end[ends] = True
    bare = ((share == 0) & is_end[placed.ends[rows, 0], None]) | ((share == 1) & is_end[placed.ends[rows, 1], None])
    vertex = triangles.corner_vertices[faces]
    reach = np.full(n, np.inf)
    np.minimum.at(reach, vertex, gap)
    nearest = gap <= reach[vertex] * (1 + TIE)
    sine = np.abs(height) / np.maximum(gap, 1e-300)
    front = np.zeros(n)
    np.maximum.at(front, vertex[nearest], sine[nearest])
    chosen = nearest & (sine >= front[vertex] - TIE)
    shown = np.where(bare, 0, np.sign(height) * sides[:, None])
    left, right, bare_end = (
        np.bincount(vertex[chosen & test], minlength=n) > 0 for test in (shown > 0, shown < 0, bare)
    )
    return np.where(bare_end, 0, left.astype(np.int64) - right), reach
