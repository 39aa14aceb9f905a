"""Transfer of sources from a mesh to an intrinsic triangulation of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Bools, Complexes, Floats, Frozen, Ints, mask_of
from ..errors import SourceError
from ..geodesics.exact_distance import cleared
from ..geodesics.geodesic_sources import zero_line
from ..mesh.components import by_first_use, grouped, members_of
from ..mesh.conforming_refinement import cut_along
from ..mesh.curve_segments import CurveSegments
from ..mesh.edges import EdgeTable
from ..mesh.intrinsic_mesh import LEAST_AREA, IntrinsicMesh
from ..mesh.polylines import assemble_polylines
from ..mesh.surface_points import (
    ZERO_COORDINATE,
    LocatedPoints,
    barycentric_in,
    concatenated,
    contain,
    edges_between,
    locate_points,
    unique_points,
)
from .intrinsic_history import History, misplaced_lines, straight_lines


@dataclass(frozen=True, eq=False)
class ConformingRefinement(Frozen):
    """Triangles that were cut so that some curves run along edges."""

    triangles: IntrinsicMesh  # after the cuts; old vertices first
    marked: Bools  # (e,) edges along which the curves run
    parents: Ints  # (m,) the face, before the cuts, that each face is part of
    corners: Floats  # (m, 3, 3) barycentric coordinates of the corners of each face in its parent

    @classmethod
    def of(cls, triangles: IntrinsicMesh, parts: Sequence[CurveSegments], heights: Floats) -> ConformingRefinement:
        """Cut faces along segments, put vertices at points, and sort the result by (n,) heights of the vertices.

        So it does not depend on the order of the given faces.
        """
        finer, parents, corners = triangles, np.arange(triangles.n_faces), np.eye(3)[None]
        along = np.empty(0, dtype=np.int64)
        if parts:
            begin = heights[triangles.corner_vertices].argmin(axis=1)
            finer, merged, is_new, parents = cut_along(triangles, parts, begin=begin)
            corners, new = np.where(is_new[:, None, None], 0.0, np.eye(3)), np.flatnonzero(is_new)
            corners[new] = barycentric_of(triangles, parents[new], finer.corner_positions[new])
            along = merged.edges[merged.edges >= 0]
        at_corners = np.einsum("mkl,ml->mk", corners, heights[triangles.corner_vertices[parents]])
        finer, edges, faces, turns = in_order(finer, at_corners)
        corners = np.take_along_axis(np.broadcast_to(corners, (len(faces), 3, 3))[faces], turns[:, :, None], axis=1)
        return cls(finer, np.isin(edges, along), parents[faces], corners)

    @cached_property
    def children(self) -> tuple[Ints, Ints]:
        """(f + 1,) starts and (m,) members: member faces, after the cuts, are grouped by the face they are part of."""
        return grouped(self.parents, int(self.parents.max()) + 1)

    def push_forward(self, faces: Ints, barycentric: Floats, vectors: Floats) -> tuple[Ints, Floats, Floats]:
        """Transfer points, and (p, k, 3) vectors at them, from the faces before the cuts to the faces after.

        Points are (p,) faces and (p, 3) barycentric coordinates, vectors differences of such. The same is returned.
        """
        segments, child = members_of(*self.children, faces)
        corners = self.corners[child]
        is_flat = np.linalg.det(corners) == 0  # parts without area contain a point only if no other part does
        to_child = np.empty_like(corners)
        to_child[~is_flat], to_child[is_flat] = np.linalg.inv(corners[~is_flat]), np.linalg.pinv(corners[is_flat])
        weights = np.einsum("pk,pkl->pl", barycentric[segments], to_child)
        best = np.lexsort([-weights.min(axis=1), is_flat, segments])[np.searchsorted(segments, np.arange(len(faces)))]
        return child[best], weights[best], np.einsum("pvk,pkl->pvl", vectors, to_child[best])

    def pull_back(self, faces: Ints, barycentric: Floats) -> tuple[Ints, Floats]:
        """Transfer points, (p,) faces and (p, 3) barycentric coordinates, from faces after the cuts to those before."""
        return self.parents[faces], np.einsum("pk,pkl->pl", barycentric, self.corners[faces])


def in_order(triangles: IntrinsicMesh, heights: Floats) -> tuple[IntrinsicMesh, Ints, Ints, Ints]:
    """Sort faces, their corners, and edges by (m, 3) heights of corners.

    Return the triangles, and the old ids of edges, (e,), faces, (m,), and corners in their face, (m, 3).
    """
    faces = np.argsort(heights.sum(axis=1), kind="stable")
    turns = (heights[faces].argmin(axis=1)[:, None] + np.arange(3)) % 3
    old = triangles.edges
    rows = faces[:, None]
    sides, forward = old.face_edges[rows, turns], old.forward[rows, turns]
    numbers, edges = by_first_use(sides.ravel(), triangles.n_edges)
    ahead = forward.ravel()[np.unique(numbers, return_index=True)[1]]
    vertices = np.where(ahead[:, None], old.vertices[edges], old.vertices[edges][:, ::-1])
    numbers = numbers.reshape(-1, 3)
    table = EdgeTable(vertices, numbers, forward == ahead[numbers])
    corners, positions = triangles.corner_vertices[rows, turns], triangles.corner_positions[rows, turns]
    return IntrinsicMesh(corners, positions, table, triangles.n_vertices), edges, faces, turns


def barycentric_of(triangles: IntrinsicMesh, faces: Ints, points: Complexes) -> Floats:
    """(n, k, 3) barycentric coordinates of (n, k) points in the planar layouts of (n,) faces."""
    return np.stack([np.ones_like(points.real), *(np.zeros_like(points.real),) * 2], axis=-1) + differences_of(
        triangles, faces, points - triangles.corner_positions[faces, :1]
    )


def differences_of(triangles: IntrinsicMesh, faces: Ints, vectors: Complexes) -> Floats:
    """(n, k, 3) differences of barycentric coordinates that stand for (n, k) vectors in the layouts of (n,) faces."""
    corners = triangles.corner_positions[faces]
    # the vector is second · u + third · v
    u, v = (corners[:, 1] - corners[:, 0])[:, None], (corners[:, 2] - corners[:, 0])[:, None]
    area = (np.conj(u) * v).imag
    flat = np.flatnonzero(area[:, 0] <= LEAST_AREA * (np.abs(u) ** 2 + np.abs(v) ** 2)[:, 0])
    area[flat] = 1.0
    second, third = (np.conj(vectors) * v).imag / area, (np.conj(u) * vectors).imag / area
    if len(flat):  # least-squares solutions of least norm
        sides = np.stack([u[flat], v[flat]], axis=-1)
        sides = np.stack([sides.real, sides.imag], axis=-2)
        parts = np.stack([vectors[flat].real, vectors[flat].imag], axis=-1)
        second[flat], third[flat] = np.moveaxis(np.einsum("fkij,fkj->fki", np.linalg.pinv(sides, 1e-7), parts), -1, 0)
    return np.stack([-second - third, second, third], axis=-1)


def transfer_segments(
    source: CurveSegments, refinement: ConformingRefinement, history: History, before: IntrinsicMesh
) -> CurveSegments:
    """Transfer segments from the triangles `before` the refinement to those at the end of the history.

    They are cut where they cross edges of the latter.
    """
    after = history.after
    no_vectors = np.zeros((len(source.nodes), 0, 3))
    at_nodes = _snapped(*refinement.push_forward(source.nodes.faces, source.nodes.barycentric, no_vectors))
    node_faces, node_weights, _ = history.forward(*at_nodes)
    nodes = locate_points(after, node_faces, node_weights)
    if len(source.ends) == 0:
        return CurveSegments(nodes, source.ends, source.faces, source.edges, source.vectors, source.oriented)

    # the midpoint of each segment is transferred, with the vectors of the segment and of its normal, and the segment is
    # traced from there
    faces, at_start, at_end, directions = in_faces(before, source)
    along = at_end - at_start
    normals = differences_of(before, faces, directions[:, None])[:, 0]
    in_layout = (along * before.corner_positions[faces]).sum(axis=1)
    vectors = np.stack([along, normals], axis=1)
    midpoints = history.forward(*_snapped(*refinement.push_forward(faces, 0.5 * (at_start + at_end), vectors)))
    lines = straight_lines(history.gluing_after, *midpoints)
    lost = misplaced_lines(after, lines, np.abs(in_layout))
    if len(lost):
        raise SourceError(
            f"segment {lost[0]} of the curves crosses triangles as thin as rounding, which flip it",
            remedy="merge the vertices that nearly coincide, or compute with intrinsic=False",
            element=f"segment {lost[0]}",
        )
    owners, faces, carried = lines.owners, lines.faces, lines.vectors
    starts, ends = locate_points(after, faces, lines.starts), locate_points(after, faces, lines.ends)
    located = concatenated([nodes, ends, starts])
    joined = _joined(after, located, faces, owners, source.ends)
    point_ids = unique_points(located)[1]
    keep = point_ids[joined[:, 0]] != point_ids[joined[:, 1]]
    owners, faces, carried, joined = owners[keep], faces[keep], carried[keep], joined[keep]
    starts, ends = starts[keep], ends[keep]

    # the angle between segment and normal is known; the transferred normal only gives the side, however thin the faces
    corners = after.corner_positions[faces]
    steps = ((ends.barycentric - starts.barycentric) * corners).sum(axis=1)
    carried = np.conj(steps) * (carried[:, 1] * corners).sum(axis=1)
    turn = (directions / (in_layout * np.abs(directions / in_layout)))[owners]
    segment_normals = steps * np.where(carried.imag * turn.imag < 0, np.conj(turn), turn)
    begin, finish = (barycentric_in(after, faces, located[end]) for end in joined.T)
    edges, side = edges_between(after, faces, begin, finish)
    used = np.union1d(np.arange(len(nodes)), joined)
    place = np.searchsorted(used, joined)
    chosen, point_ids = unique_points(located[used])
    return CurveSegments(
        located[used][chosen],
        point_ids[place],
        faces,
        edges,
        np.where(edges >= 0, after.in_edge_frames(segment_normals, faces, side), segment_normals),
        source.oriented,
    )


def _joined(triangles: IntrinsicMesh, points: LocatedPoints, faces: Ints, owners: Ints, nodes: Ints) -> Ints:
    """(r, 2) ids of the end points of r pieces of segments: each begins where the previous one ended, or at a node.

    `points` are the nodes of the segments, then the traced ends of all pieces, then their starts. Pieces have (r,)
    faces and segments `owners`; `nodes` are the (s, 2) ends of segments.
    """
    n = len(points) - 2 * len(faces)
    last = np.append(np.diff(owners) > 0, True)
    first = np.append(True, last[:-1])
    ends = np.where(last, nodes[owners, 1], n + np.arange(len(owners)))
    starts = np.where(first, nodes[owners, 0], np.roll(ends, 1))
    joined = np.stack([starts, ends], axis=1)
    for k, own in enumerate((n + len(faces), n)):  # pieces whose node rounding puts beyond the face keep their end
        beyond = np.flatnonzero(~contain(triangles, faces, points[joined[:, k]]))
        joined[beyond, k] = own + beyond
    return joined


def in_faces(triangles: IntrinsicMesh, source: CurveSegments) -> tuple[Ints, Floats, Floats, Complexes]:
    """Place the s segments of a source in faces, the larger one for those along an edge.

    Return (s,) faces, (s, 3) barycentric coordinates of both ends, and (s,) normals in the layouts of the faces.
    """
    faces = source.faces.copy()
    on_edge = np.flatnonzero(source.edges >= 0)
    flat = triangles.edges.face_edges.ravel()
    chosen = np.flatnonzero(mask_of(triangles.n_edges, source.edges[on_edge])[flat])
    order = chosen[np.lexsort([triangles.face_areas[chosen // 3], flat[chosen]])]
    fattest = np.empty(triangles.n_edges, dtype=np.int64)
    fattest[flat[order]] = order
    halfedge = fattest[source.edges[on_edge]]
    faces[on_edge] = halfedge // 3
    directions = source.vectors.copy()
    directions[on_edge] = triangles.from_edge_frames(directions[on_edge], halfedge // 3, halfedge % 3)
    starts = barycentric_in(triangles, faces, source.nodes[source.ends[:, 0]])
    return faces, starts, barycentric_in(triangles, faces, source.nodes[source.ends[:, 1]]), directions


def _snapped(faces: Ints, barycentric: Floats, vectors: Floats) -> tuple[Ints, Floats, Floats]:
    """Move points within rounding error of an edge onto it, and make their first vector parallel to it if it nearly is.

    Arguments and results are as in `ConformingRefinement.push_forward`.
    """
    near = barycentric < ZERO_COORDINATE
    weights = np.where(near, 0.0, barycentric)
    weights /= weights.sum(axis=1, keepdims=True)
    size = np.abs(vectors[:, :1]).max(axis=2, keepdims=True) if vectors.shape[1] else 0.0
    flat = np.zeros(vectors.shape, dtype=bool)
    flat[:, :1] = near[:, None] & (np.abs(vectors[:, :1]) < ZERO_COORDINATE * size)
    return faces, weights, np.where(flat, 0.0, vectors)


ZERO_VALUE = 1e-12
"""Values below this, relative to the largest, count as zero."""


def level_lines(history: History, refinement: ConformingRefinement, values: Floats) -> list[tuple[Ints, Floats, bool]]:
    """Trace, on the triangles before a history, the zero set of a function that is linear on those after it.

    The triangles must be consistently oriented. Return for each polyline (n,) faces and (n, 3) barycentric coordinates
    of its points, with larger values to its left, and whether it is closed.
    """
    least = ZERO_VALUE * max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300)
    line = zero_line(history.after, cleared(history.after, values, least))
    if not len(line.faces):
        return []
    spots = barycentric_of(history.after, line.faces, line.positions)
    lines = straight_lines(
        history.gluing_before, *history.backward(line.faces, spots.mean(axis=1), np.diff(spots, axis=1))
    )
    faces, starts = refinement.pull_back(lines.faces, lines.starts)
    ends = refinement.pull_back(lines.faces, lines.ends)[1]
    first = np.searchsorted(lines.owners, np.arange(len(line.faces) + 1))
    polylines = []
    for order, _, closed in assemble_polylines(*line.ends.T):
        rows = np.concatenate([np.arange(first[k], first[k + 1]) for k in order])
        if closed:
            polylines.append((faces[rows], starts[rows], True))
        elif len(rows):
            points = np.concatenate([starts[rows], ends[rows[-1:]]])
            polylines.append((np.append(faces[rows], faces[rows[-1]]), points, False))
    return polylines
