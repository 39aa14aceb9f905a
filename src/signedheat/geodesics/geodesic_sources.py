"""Sources of exact distance on a polyhedral surface: beams from segments, and fans from their ends.

The waves that leave a segment are a parallel beam to each side, and circular waves at its ends. Of a circular wave only
the fan between the beams of neighbouring segments can be shortest, so that curves of many segments start few windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Complexes, Floats, Ints
from ..mesh.components import grouped, members_of
from ..mesh.curve_segments import CurveSegments, MergedSources
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import (
    EDGE,
    FACE,
    VERTEX,
    LocatedPoints,
    barycentric_in,
    barycentric_on_edges,
    concatenated,
    crossed_sides,
    edges_between,
    locate_points,
    unique_points,
)


class GeodesicSources(NamedTuple):
    """Points and segments from which distance is measured. Positions are in the layouts of their faces."""

    vertices: Ints  # (v,) vertices at which distance is zero, including those on curves
    # (b,) faces, starts and ends of segments from which a parallel beam leaves to the left
    beam_faces: Ints
    beam_starts: Complexes
    beam_stops: Complexes
    # (a,) faces and positions of points from which circular waves leave, in the directions that are more than 90° from
    # the first and the second direction, which may be 0
    fan_faces: Ints
    fan_points: Complexes
    fan_firsts: Complexes
    fan_seconds: Complexes


@dataclass(frozen=True, eq=False)
class PlacedSegments:
    """k segments with the positions of their ends in faces, which are clear even where a node is in a face twice."""

    nodes: LocatedPoints  # (s,) distinct points
    ends: Ints  # (k, 2) nodes at the start and the end of each segment
    faces: Ints  # (k,) the face of each; a segment along an edge is listed once for every face at the edge
    # (k, 2) positions of both ends in the layout of the face; along an edge in the direction with the face to its left
    positions: Complexes
    along_edge: Bools  # (k,) whether the segment runs along an edge of its face
    sides: Ints  # (k,) 1 where φ grows to the left of the segment, −1 where it grows to the right, 0 on both sides
    given: Ints  # (k,) index of the segment among those given

    @classmethod
    def of(cls, triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> PlacedSegments:
        """Place the segments of curves, which may cross faces and run along edges and through vertices."""
        merged = MergedSources.of(parts)
        oriented = np.array([part.oriented for part in parts])[merged.owners]
        both = cls._inside(triangles, merged, oriented), cls._adjacent(triangles, merged, oriented)
        return cls(merged.nodes, *(np.concatenate(arrays) for arrays in zip(*both, strict=True)))

    @staticmethod
    def _inside(
        triangles: IntrinsicMesh, merged: MergedSources, oriented: Bools
    ) -> tuple[Ints, Ints, Complexes, Bools, Ints, Ints]:
        """Place the segments inside faces; return the fields of the class from `ends` on."""
        nodes, rows = merged.nodes, np.flatnonzero(merged.edges < 0)
        ends, faces, vectors = merged.ends[rows], merged.faces[rows], merged.vectors[rows]
        corners = triangles.corner_positions[faces]
        positions = np.stack(
            [(barycentric_in(triangles, faces, nodes[ends[:, k]]) * corners).sum(axis=1) for k in range(2)], axis=1
        )
        steps = positions[:, 1] - positions[:, 0]
        # nodes that are in a face twice, as in faces glued to themselves: the length of the segment decides
        for i in np.flatnonzero(np.abs(np.abs(steps) - np.abs(vectors)) > 1e-6 * np.abs(corners).max(axis=1)).tolist():
            positions[i] = best_match(triangles, faces[i], nodes, ends[i], abs(vectors[i]))
            steps[i] = positions[i, 1] - positions[i, 0]
        sides = np.sign((np.conj(1j * steps) * vectors).real).astype(np.int64) * oriented[rows]
        return ends, faces, positions, np.zeros(len(rows), dtype=bool), sides, rows

    @staticmethod
    def _adjacent(
        triangles: IntrinsicMesh, merged: MergedSources, oriented: Bools
    ) -> tuple[Ints, Ints, Complexes, Bools, Ints, Ints]:
        """Place the segments along edges in all faces at the edge; return the fields of the class from `ends` on."""
        nodes, rows = merged.nodes, np.flatnonzero(merged.edges >= 0)
        ends, edges, vectors = merged.ends[rows], merged.edges[rows], merged.vectors[rows]
        # fractions of the edge at both ends; on a loop, whose ends are one vertex, the length of the segment decides
        along = np.stack([fractions_along_edges(triangles, nodes[ends[:, k]], edges) for k in range(2)], axis=1)
        loops = triangles.edges.vertices[edges, 0] == triangles.edges.vertices[edges, 1]
        vertex = nodes.kinds[ends] == VERTEX
        along[loops & vertex.all(axis=1)] = (0.0, 1.0)
        for k in range(2):
            i = np.flatnonzero(loops & vertex[:, k] & ~vertex[:, 1 - k])
            shares = np.abs(vectors[i]) / triangles.lengths_of_edges[edges[i]]
            along[i, k] = np.where(np.abs(along[i, 1 - k] - shares) < np.abs(1 - along[i, 1 - k] - shares), 0.0, 1.0)
        # one copy of the segment for each face at the edge
        owners, halfedges = halfedges_of(triangles, edges)
        faces, local_sides = halfedges // 3, halfedges % 3
        forward = triangles.edges.forward[faces, local_sides]
        along, ends = along[owners], ends[owners]
        # each segment runs in the direction of the side, with the face to its left
        swapped = (along[:, 1] < along[:, 0]) == forward
        along[swapped], ends[swapped] = along[swapped, ::-1], ends[swapped, ::-1]
        positions = on_sides(triangles, faces, local_sides, along)
        normals = triangles.from_edge_frames(vectors[owners], faces, local_sides)
        sides = np.sign((np.conj(1j * triangles.edge_vectors[faces, local_sides]) * normals).real).astype(np.int64)
        return ends, faces, positions, np.ones(len(faces), dtype=bool), sides * oriented[rows][owners], rows[owners]

    @cached_property
    def lengths(self) -> Floats:
        """Length of each segment, (k,) float."""
        return np.abs(self.positions[:, 1] - self.positions[:, 0])

    def joined(self, more: PlacedSegments) -> PlacedSegments:
        """Return these segments and more of them, none of whose nodes are shared."""
        nodes, given = len(self.nodes), int(self.given.max(initial=-1)) + 1
        return PlacedSegments(
            concatenated([self.nodes, more.nodes]),
            np.concatenate([self.ends, more.ends + nodes]),
            np.concatenate([self.faces, more.faces]),
            np.concatenate([self.positions, more.positions]),
            np.concatenate([self.along_edge, more.along_edge]),
            np.concatenate([self.sides, more.sides]),
            np.concatenate([self.given, more.given + given]),
        )

    def sources(self, triangles: IntrinsicMesh) -> GeodesicSources:
        """Return the beams and fans that leave the segments and the isolated points."""
        inside = np.flatnonzero(~self.along_edge)
        faces = np.concatenate([self.faces, self.faces[inside]])
        starts = np.concatenate([self.positions[:, 0], self.positions[inside, 1]])
        stops = np.concatenate([self.positions[:, 1], self.positions[inside, 0]])
        at_vertex = self.nodes.kinds == VERTEX
        return GeodesicSources(self.nodes.elements[at_vertex], faces, starts, stops, *self._fans(triangles))

    def _fans(self, triangles: IntrinsicMesh) -> tuple[Ints, Complexes, Complexes, Complexes]:
        """Return (f,) faces, (f,) points, and (f,) first and second directions of fans at nodes in faces and on edges.

        Points and directions are complex numbers, in the layouts of the faces. A node on an edge has a fan in every
        face at the edge.
        """
        nodes = self.nodes
        directions = self._directions(triangles)
        inside, on_edge = np.flatnonzero(nodes.kinds == FACE), np.flatnonzero(nodes.kinds == EDGE)
        owners, halfedges = halfedges_of(triangles, nodes.elements[on_edge])
        edge_faces, sides, edge_nodes = halfedges // 3, halfedges % 3, on_edge[owners]
        in_faces = (nodes.barycentric[inside] * triangles.corner_positions[nodes.faces[inside]]).sum(axis=1)
        on_edges = on_sides(triangles, edge_faces, sides, nodes.along[edge_nodes][:, None])[:, 0]
        firsts, seconds = (
            np.concatenate([d[inside], triangles.from_edge_frames(d[edge_nodes], edge_faces, sides)])
            for d in directions
        )
        faces = np.concatenate([nodes.elements[inside], edge_faces])
        return faces, np.concatenate([in_faces, on_edges]), firsts, seconds

    def _directions(self, triangles: IntrinsicMesh) -> tuple[Complexes, Complexes]:
        """Return (s,) unit vectors along the first segment at each node, and along the last, 0 if there is none.

        They are in the layout of the node's face or, for a node on an edge, in the frame of the edge.
        """
        nodes, kinds = self.nodes, self.nodes.kinds
        steps = self.positions[:, 1] - self.positions[:, 0]
        steps /= np.abs(steps)
        node, seg = self.ends.T.ravel(), np.tile(np.arange(len(self.ends)), 2)  # of both ends of all segments
        away = np.concatenate([steps, -steps])  # directions from there
        at_edge = np.flatnonzero(kinds[node] == EDGE)
        faces, edges = self.faces[seg[at_edge]], nodes.elements[node[at_edge]]
        along = np.repeat(nodes.along[node[at_edge]], 3)[:, None]
        on_each_side = on_sides(triangles, np.repeat(faces, 3), np.tile(np.arange(3), len(faces)), along)
        # of the sides that are this edge, the one on which the end lies
        gap = np.abs(on_each_side.reshape(-1, 3) - self.positions.T.ravel()[at_edge][:, None])
        k = np.where(triangles.edges.face_edges[faces] == edges[:, None], gap, np.inf).argmin(axis=1)
        away[at_edge] = triangles.in_edge_frames(away[at_edge], faces, k)
        # across edges of three or more faces there is no direction: the fan is whole
        branching = (triangles.edges.face_counts[edges] > 2) & ~self.along_edge[seg[at_edge]]
        away[at_edge[branching]] = 0
        away, node = away[away != 0], node[away != 0]
        starts, order = grouped(node, len(nodes))
        has = np.flatnonzero(np.diff(starts))  # both copies of a segment along an edge have the same direction
        directions = np.zeros((2, len(nodes)), dtype=np.complex128)
        directions[0, has], directions[1, has] = away[order[starts[has]]], away[order[starts[has + 1] - 1]]
        return directions[0], directions[1]


def zero_line(triangles: IntrinsicMesh, values: Floats, among: Bools | None = None) -> PlacedSegments:
    """Return the zero set of a function that is linear in faces, as segments with positive values to their left.

    `values` at vertices, (n,), are not 0, and NaN where unknown. With `among`, (m,), only faces for which it is true
    count.
    """
    corner_values = values[triangles.corner_vertices]
    faces, sides = crossed_sides(
        corner_values > 0, ~np.isnan(corner_values).any(axis=1) & (True if among is None else among)
    )
    edges = triangles.edges.face_edges[faces[:, None], sides]
    # a node on each crossed edge
    used, first, ends = np.unique(edges, return_index=True, return_inverse=True)
    tail, head = values[triangles.edges.vertices[used]].T
    along = tail / (tail - head)
    at_face, at_side = faces[first // 2], sides.ravel()[first]
    weights = barycentric_on_edges(triangles.edges, at_face, at_side, along)
    ends = ends.reshape(-1, 2)
    flat = on_sides(triangles, np.repeat(faces, 2), sides.ravel(), along[ends].reshape(-1, 1))
    keep = np.flatnonzero(np.abs(np.diff(flat.reshape(-1, 2), axis=1)[:, 0]) > 0)
    return PlacedSegments(
        LocatedPoints(at_face, weights, np.full(len(used), EDGE), used, along),
        ends[keep],
        faces[keep],
        flat.reshape(-1, 2)[keep],
        np.zeros(len(keep), dtype=bool),
        np.ones(len(keep), dtype=np.int64),
        np.arange(len(keep)),
    )


def nearest_shares(points: Complexes, steps: Complexes) -> tuple[Floats, Floats]:
    """Find the nearest points of segments from the origin, with vectors `steps`, to `points`.

    Returns the fractions of the segments, from 0 to 1, at which they are nearest, and the distances.
    """
    squares = np.abs(steps) ** 2
    shares = np.clip((points * np.conj(steps)).real / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
    return shares, np.abs(points - shares * steps)


def halfedges_of(triangles: IntrinsicMesh, edges: Ints) -> tuple[Ints, Ints]:
    """Return the halfedges ``3 face + side`` of (k,) edges: (j,) indices into `edges`, and (j,) halfedges."""
    return members_of(*triangles.edges.halfedges, edges)


def on_sides(triangles: IntrinsicMesh, faces: Ints, sides: Ints, along: Floats) -> Complexes:
    """Return (n, k) positions, in the layouts of (n,) faces, at fractions along edges that are sides of these faces.

    The fractions, (n, k), go from the tail of the edge to its head.
    """
    share = np.where(triangles.edges.forward[faces, sides][:, None], along, 1 - along)
    return triangles.corner_positions[faces, sides][:, None] + share * triangles.edge_vectors[faces, sides][:, None]


def fractions_along_edges(triangles: IntrinsicMesh, located: LocatedPoints, edges: Ints) -> Floats:
    """Return (n,) fractions, from tail to head, of (n,) edges at which the n points lie on them."""
    return np.where(
        located.kinds == EDGE, located.along, (triangles.edges.vertices[edges, 0] != located.elements).astype(float)
    )


def best_match(triangles: IntrinsicMesh, face: int, nodes: LocatedPoints, ends: Ints, length: float) -> Complexes:
    """Return (2,) positions of two nodes in a face.

    If a node is in the face at several positions, those are chosen whose distance is nearest to `length`.
    """
    candidates = []
    for node in ends:
        kind, element = nodes.kinds[node], nodes.elements[node]
        if kind == VERTEX:
            candidates.append(triangles.corner_positions[face, triangles.corner_vertices[face] == element])
        elif kind == EDGE:
            sides = np.flatnonzero(triangles.edges.face_edges[face] == element)
            along = np.full((len(sides), 1), nodes.along[node])
            candidates.append(on_sides(triangles, np.full(len(sides), face), sides, along)[:, 0])
        else:
            candidates.append((nodes.barycentric[[node]] * triangles.corner_positions[face]).sum(axis=1))
    gap = np.abs(np.abs(candidates[1][None] - candidates[0][:, None]) - length)
    i, j = np.unravel_index(int(gap.argmin()), gap.shape)
    return np.array([candidates[0][i], candidates[1][j]])


SNAP = 1e-6
"""Barycentric coordinate below which a point of a source is moved to the edge or to the vertex."""


def through_vertices(triangles: IntrinsicMesh, placed: PlacedSegments) -> PlacedSegments:
    """Move ends of segments to vertices and edges that are nearer than `SNAP`.

    If any is moved, all segments become unoriented. If none is near, or it fails, they are returned as they are.
    """
    nodes = placed.nodes
    on_edge, inside = nodes.kinds == EDGE, nodes.kinds == FACE
    near = on_edge & (np.minimum(nodes.along, 1 - nodes.along) < SNAP) | inside & (nodes.barycentric < SNAP).any(axis=1)
    curve = as_curve(triangles, placed) if near.any() else None
    return placed if curve is None else PlacedSegments.of(triangles, [curve])


def as_curve(triangles: IntrinsicMesh, placed: PlacedSegments) -> CurveSegments | None:
    """Return the segments, each once, and the isolated points as an unoriented curve.

    Returns None if barycentric coordinates do not give the positions, as in faces that are glued to themselves.
    """
    once = np.unique(placed.given, return_index=True)[1]
    faces, nodes = placed.faces[once], placed.nodes
    end_weights = np.stack([barycentric_in(triangles, faces, nodes[placed.ends[once, k]]) for k in range(2)])
    corners = triangles.corner_positions[faces]
    apart = np.abs((end_weights * corners).sum(axis=2) - placed.positions[once].T)
    if (apart > SNAP * triangles.edge_lengths[faces].max(axis=1)).any():
        return None
    end_weights = rounded(end_weights)
    alone = np.setdiff1d(np.arange(len(nodes)), placed.ends)
    ends = locate_points(triangles, np.tile(faces, 2), end_weights.reshape(-1, 3))
    points = locate_points(triangles, nodes.faces[alone], rounded(nodes.barycentric[alone]))
    located = concatenated([ends, points])
    first, numbers = unique_points(located)
    joined = numbers[: 2 * len(faces)].reshape(2, -1).T
    steps = ((end_weights[1] - end_weights[0]) * corners).sum(axis=1)
    edges, _ = edges_between(triangles, faces, *end_weights)
    normals = 1j * np.where(edges < 0, steps, np.abs(steps))  # in the layout of the face, or in the frame of the edge
    kept = (joined[:, 0] != joined[:, 1]) & (np.abs(steps) > 0)
    return CurveSegments(located[first], joined[kept], faces[kept], edges[kept], normals[kept], False)


def rounded(barycentric: Floats) -> Floats:
    """Set (..., 3) barycentric coordinates below `SNAP` to zero, and scale the others to sum 1."""
    kept = np.where(barycentric < SNAP, 0.0, barycentric)
    return kept / kept.sum(axis=-1, keepdims=True)
