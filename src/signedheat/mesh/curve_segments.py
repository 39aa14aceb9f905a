"""Curves on an intrinsic mesh as straight segments inside faces or along edges, and isolated points on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Bools, Complexes, Floats, Ints, mask_of
from ..errors import SourceError
from .components import connected_components
from .intrinsic_mesh import IntrinsicMesh, face_pairs
from .polylines import assemble_polylines
from .signed_graph import Links, signs_of
from .surface_points import (
    EDGE,
    VERTEX,
    ZERO_COORDINATE,
    LocatedPoints,
    barycentric_in,
    concatenated,
    incident_faces,
    unique_points,
)
from .unit_vectors import ANGLE_ROUNDING, unit


@dataclass(frozen=True, eq=False)
class CurveSegments:
    """A source as k straight segments between s nodes; each segment lies in one face or along one edge."""

    nodes: LocatedPoints  # (s,) distinct points of the source, in order of first appearance
    ends: Ints  # (k, 2) nodes at the start and the end of each segment; none for isolated points
    faces: Ints  # (k,) a face that contains the segment
    edges: Ints  # (k,) the edge that the segment runs along, or −1 for a segment inside its face
    # (k,) normal times length: the direction in which φ grows, in the layout of the face, or in the frame of the edge
    vectors: Complexes
    oriented: bool  # whether the curve has a positive and a negative side

    @classmethod
    def of_points(cls, nodes: LocatedPoints) -> CurveSegments:
        """Make a source of isolated points, without segments."""
        none = np.empty(0, dtype=np.int64)
        return cls(nodes, np.empty((0, 2), dtype=np.int64), none, none, np.empty(0, dtype=np.complex128), False)

    @cached_property
    def lengths(self) -> Floats:
        """Length of each segment, (k,) float."""
        return np.abs(self.vectors)

    @property
    def is_conforming(self) -> bool:
        """Whether triangles can represent the source without being cut; false for unoriented curves across faces."""
        return self.oriented or bool((self.nodes.kinds[self.ends] == VERTEX).all() and (self.edges >= 0).all())


@dataclass(frozen=True, eq=False)
class MergedSources:
    """The segments of several sources in one list, with coinciding points merged; see `CurveSegments`."""

    nodes: LocatedPoints  # (s,) distinct points of all sources
    ends: Ints  # (k, 2) nodes of each segment
    # (k,) face, edge or −1, and normal times length of each segment, as in `CurveSegments`
    faces: Ints
    edges: Ints
    vectors: Complexes
    owners: Ints  # (k,) the source of each segment
    samples: list[Ints]  # the nodes of each source

    @classmethod
    def of(cls, parts: Sequence[CurveSegments]) -> MergedSources:
        """Merge the segments and nodes of several sources, each discretized by itself."""
        located = concatenated([p.nodes for p in parts])
        first, ids = unique_points(located)
        offsets = np.cumsum([0] + [len(p.nodes) for p in parts])
        return cls(
            located[first],
            np.concatenate([ids[p.ends + o] for p, o in zip(parts, offsets, strict=False)]),
            np.concatenate([p.faces for p in parts]),
            np.concatenate([p.edges for p in parts]),
            np.concatenate([p.vectors for p in parts]),
            np.repeat(np.arange(len(parts)), [len(p.ends) for p in parts]),
            [ids[a:b] for a, b in pairwise(offsets)],
        )

    def parts(self, oriented: Sequence[bool]) -> list[CurveSegments]:
        """Return the sources as separate ones again; `oriented` says for each whether it has two sides."""
        order = np.argsort(self.owners, kind="stable")
        bounds = np.searchsorted(self.owners[order], np.arange(len(oriented) + 1))
        parts = []
        for (begin, end), samples, has_sides in zip(pairwise(bounds), self.samples, oriented, strict=True):
            own = order[begin:end]
            nodes = np.concatenate([samples, np.setdiff1d(self.ends[own], samples)]).astype(np.int64)
            parts.append(self.part(own, nodes, has_sides))
        return parts

    def part(self, own: Ints, nodes: Ints, oriented: bool) -> CurveSegments:
        """Return a source that consists of the segments with ids `own` and of the given nodes."""
        distinct, first = np.unique(nodes, return_index=True)
        ends = first[np.searchsorted(distinct, self.ends[own])]
        return CurveSegments(self.nodes[nodes], ends, self.faces[own], self.edges[own], self.vectors[own], oriented)


def without_copies(parts: Sequence[CurveSegments], by_points: Bools) -> tuple[Ints, Ints]:
    """Find curves that are copies of others.

    Returns (u,) the first curve of each set of copies, and (k,) for each curve the index among these. Only curves for
    which `by_points`, (k,), is true are copies, if they join the same points in the same directions.
    """
    merged = MergedSources.of(parts)
    bounds = np.cumsum([0, *(len(part.ends) for part in parts)])
    keys = [
        np.unique(merged.ends[begin:end], axis=0).tobytes() if may else str(begin).encode()
        for (begin, end), may in zip(pairwise(bounds), by_points.tolist(), strict=True)
    ]
    first = {key: k for k, key in reversed(list(enumerate(keys)))}
    kept = np.unique(list(first.values()))
    return kept, np.searchsorted(kept, [first[key] for key in keys])


def joined_end_to_end(parts: Sequence[CurveSegments], may_go_on: Bools) -> tuple[list[CurveSegments], Ints]:
    """Join curves that begin where another ends into lines, unless they run back along each other.

    Only curves for which `may_go_on`, (k,), is true are joined. Returns the lines, and (k,) the line of each curve.
    """
    merged = MergedSources.of(parts)
    bounds = np.cumsum([0, *(len(part.ends) for part in parts)])
    # the first two and the last two nodes of each curve
    (tails, second), (last, heads) = merged.ends[bounds[:-1]].T, merged.ends[bounds[1:] - 1].T
    arriving = np.zeros(len(merged.nodes), dtype=np.int64)
    arriving[heads] = np.arange(len(parts))
    turns_back = np.isin(tails, heads) & (last[arriving[tails]] == second)
    apart = len(merged.nodes) * (1 + np.arange(len(parts)))  # distinct nodes for each curve
    tails = tails + np.where(may_go_on & ~turns_back, 0, apart)
    lines = assemble_polylines(tails, heads + np.where(may_go_on, 0, apart))
    members = sorted((line for line, _, _ in lines), key=min)
    lines_of = np.empty(len(parts), dtype=np.int64)
    joined = []
    for number, line in enumerate(members):
        lines_of[line] = number
        if len(line) == 1:
            joined.append(parts[line[0]])
            continue
        own = np.concatenate([np.arange(bounds[k], bounds[k + 1]) for k in line])
        nodes = np.unique(np.concatenate([merged.samples[k] for k in line]))
        joined.append(merged.part(own, nodes, parts[line[0]].oriented))
    return joined, lines_of


def without_straight_nodes(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> list[CurveSegments]:
    """Leave out nodes at which a line runs straight within a face or along an edge.

    Nodes stay if other lines end or bend there, or if the normals of the line change there.
    """
    merged = MergedSources.of(parts)
    faces, vectors = merged.faces, merged.vectors
    # runs of segments in one face or along one edge, and how far nodes are from the line between the ends of the run
    node, before, after = _nodes_between(merged)
    run, first, last = _runs(len(faces), before, after)
    positions = np.stack([barycentric_in(triangles, faces, merged.nodes[end]) for end in merged.ends.T], axis=1)
    positions = (positions * triangles.corner_positions[faces, None]).sum(axis=2)
    begin, end = positions[first[run[before]], 0], positions[last[run[before]], 1]
    off = np.abs((np.conj(end - begin) * (positions[before, 1] - begin)).imag)
    bent = off > ZERO_COORDINATE * triangles.edge_lengths[faces[before]].max(axis=1) * np.abs(end - begin)
    bent &= merged.edges[before] < 0
    # nodes of runs that are straight all along, where nothing else is
    straight = np.bincount(run[before], bent, len(first))[run[before]] == 0
    ends_at = np.bincount(np.concatenate([merged.ends.ravel(), *merged.samples]), minlength=len(merged.nodes))
    # each passing line has two segment ends and one sample there
    passes = np.bincount(node[straight], minlength=len(merged.nodes))
    straight &= (3 * passes == ends_at)[node]
    node, before, after = node[straight], before[straight], after[straight]

    run, first, last = _runs(len(faces), before, after)
    sums = np.bincount(run, vectors.real, len(first)) + 1j * np.bincount(run, vectors.imag, len(first))
    ends = np.stack([merged.ends[first, 0], merged.ends[last, 1]], axis=1)
    samples = [sample[~np.isin(sample, node)] for sample in merged.samples]
    fewer = MergedSources(merged.nodes, ends, faces[first], merged.edges[first], sums, merged.owners[first], samples)
    return fewer.parts([part.oriented for part in parts])


def _nodes_between(merged: MergedSources) -> tuple[Ints, Ints, Ints]:
    """Return nodes at which two segments of a source have the same face or edge, and the same normal.

    Also returns the segments before and after each of these nodes. Closed runs of segments keep one node.
    """
    # places are nodes of one source each; the segments that arrive there and leave, if there is one of each
    k = len(merged.ends)
    of_source = merged.owners[:, None] * len(merged.nodes) + merged.ends
    places, index = np.unique(of_source, return_inverse=True)
    tails, heads = index.reshape(-1, 2).T
    into, out = np.full(len(places), -1), np.full(len(places), -1)
    into[heads], out[tails] = np.arange(k), np.arange(k)
    places_between = np.flatnonzero((np.bincount(index.ravel()) == 2) & (into >= 0) & (out >= 0))
    before, after = into[places_between], out[places_between]
    normals = merged.vectors / np.abs(merged.vectors)
    # short segments have rounded ends; `ZERO_COORDINATE` then decides, by how far all points are from the line between
    # the outer ones
    alike = np.abs(normals[before] - normals[after]) <= ANGLE_ROUNDING
    for elements in (merged.edges, np.where(merged.edges < 0, merged.faces, -1)):
        alike &= elements[before] == elements[after]
    places_between, before, after = places_between[alike], before[alike], after[alike]
    # loops that go straight on, as loops without area do, must begin somewhere
    run = connected_components(k, before, after)
    of_runs, link = np.unique(run[before], return_index=True)
    begins = link[np.bincount(run[before], minlength=k)[of_runs] == np.bincount(run)[of_runs]]
    places_between, before, after = (np.delete(column, begins) for column in (places_between, before, after))
    return places[places_between] % max(len(merged.nodes), 1), before, after


def _runs(k: int, before: Ints, after: Ints) -> tuple[Ints, Ints, Ints]:
    """Group k segments to runs, where segment ``after[i]`` follows segment ``before[i]``.

    Returns (k,) the run of each segment, and (r,) the first and (r,) the last segment of each run. Runs are sorted by
    their first segment.
    """
    is_first, is_last = np.ones(k, dtype=bool), np.ones(k, dtype=bool)
    is_first[after] = False
    is_last[before] = False
    run = connected_components(k, before, after)
    first = np.flatnonzero(is_first)
    order = np.empty(len(first), dtype=np.int64)
    order[run[first]] = np.arange(len(first))
    last = np.empty(len(first), dtype=np.int64)
    last[order[run[is_last]]] = np.flatnonzero(is_last)
    return order[run], first, last


def given_directions(
    triangles: IntrinsicMesh, positions: Floats, faces: Ints, edges: Ints, normals: Floats, name: str
) -> Complexes:
    """Project (k, 3) normals of segments onto the surface; return (k,) unit vectors as complex numbers.

    They are in the layout of the face, or, for segments along an edge, averages over the faces in the frame of the
    edge. Raises a `SourceError`, in which `name` names the curve, if a normal is perpendicular to the surface.
    """
    largest = np.abs(normals).max(axis=1, initial=0.0)
    extreme = (largest > 1e100) | ((largest > 0) & (largest < 1e-100))  # their squares overflow or underflow
    normals = normals / np.where(extreme, largest, 1.0)[:, None]
    inside = np.flatnonzero(edges < 0)
    directions = np.zeros(len(faces), dtype=np.complex128)
    directions[inside] = in_layout(triangles, positions, faces[inside], normals[inside])

    along = np.flatnonzero(edges >= 0)
    on_edges = LocatedPoints(
        faces[along], np.zeros((len(along), 3)), np.full(len(along), EDGE), edges[along], np.zeros(len(along))
    )
    if len(along):
        owners, around = incident_faces(triangles, on_edges)
        side = (triangles.edges.face_edges[around] == edges[along][owners, None]).argmax(axis=1)
        projected = in_layout(triangles, positions, around, normals[along[owners]])
        np.add.at(directions, along[owners], triangles.in_edge_frames(projected, around, side))
    length = np.abs(directions)
    scale = np.linalg.norm(normals, axis=1)
    flat = np.flatnonzero(length <= 1e-6 * scale)
    if len(flat):
        raise SourceError(
            f"{name}: the normal {normals[flat[0]].tolist()} at face {faces[flat[0]]} does not lie along the surface",
            remedy="give the direction, tangent to the surface, in which the distance grows",
            element=f"face {faces[flat[0]]}",
        )
    return directions / length


def carried_left(triangles: IntrinsicMesh, faces: Ints, edges: Ints, lengths: Floats) -> Floats:
    """Return (k,) signs, ±1, for k segments of a curve, that make their left sides agree on a nonoriented mesh.

    Segments have (k,) `lengths`, and lie in `faces`, (k,), along `edges`, (k,), or none where these are −1. The left
    side of a segment is that in the layout of its face, or of the first face of its edge. The sign is −1 where the
    orientation of this face differs from that of the faces along most of the curve's length.
    """
    deciding, links, nodes = _agreement_around(triangles, faces, edges)
    signs = signs_of(links, int(nodes.max(initial=-1)) + 1)[nodes[deciding]]
    sign_of_most = float(np.sign(signs @ lengths)) or signs[0]
    return signs * sign_of_most


def loses_orientation(triangles: IntrinsicMesh, faces: Ints, edges: Ints) -> bool:
    """Whether the faces around a curve cannot be oriented consistently, as along the middle of a Möbius strip."""
    _, links, nodes = _agreement_around(triangles, faces, edges)
    of_two = np.abs(links.weights) == 1  # of three faces around an edge two cannot agree
    links = Links(links.tails[of_two], links.heads[of_two], links.weights[of_two])
    signs = signs_of(links, int(nodes.max(initial=-1)) + 1)
    return bool((signs[links.tails] * signs[links.heads] * links.weights < 0).any())


def _agreement_around(triangles: IntrinsicMesh, faces: Ints, edges: Ints) -> tuple[Ints, Links, Ints]:
    """Return a graph of the orientations of the faces near a curve of k segments.

    `faces`, (k,), and `edges`, (k,), are the face of each segment and the edge that it runs along, or −1. Returns (k,)
    the face that decides which side of each segment is left, links between neighbouring faces, negative where their
    orientations disagree, and (m,) the node of each face in the graph, valid for faces that share a vertex with these.
    """
    first = triangles.first_halfedges
    first_faces = np.zeros(triangles.n_edges, dtype=np.int64)
    first_faces[triangles.edges.face_edges.ravel()[first]] = first // 3
    deciding = np.where(edges < 0, faces, first_faces[edges])
    corners = triangles.corner_vertices
    touched_vertices = mask_of(triangles.n_vertices, corners[np.append(faces, deciding)])
    is_near = np.asarray(touched_vertices[corners].any(axis=1))
    nodes = np.cumsum(is_near) - 1
    pairs = face_pairs(triangles)
    (first_of, second_of), sides = pairs.faces.T, pairs.sides
    # faces with the same orientation run along their common edge in opposite directions
    forward = triangles.edges.forward
    agree = np.where(forward[first_of, sides[:, 0]] != forward[second_of, sides[:, 1]], 1.0, -1.0)
    both = is_near[first_of] & is_near[second_of]
    links = Links(nodes[first_of[both]], nodes[second_of[both]], agree[both] * pairs.shares[both])
    return deciding, links, nodes


def in_layout(triangles: IntrinsicMesh, positions: Floats, faces: Ints, vectors: Floats) -> Complexes:
    """Project (k, 3) vectors in space into the planes of faces; return (k,) complex numbers in the faces' layouts.

    `positions` are those of vertices, (n, 3), or of the corners of faces, (m, 3, 3).
    """
    of_faces = positions[faces] if positions.ndim == 3 else positions[triangles.corner_vertices[faces]]
    a, b, c = of_faces.transpose(1, 0, 2)
    first = unit(b - a)
    normal = unit(np.cross(first, c - a))
    second = np.cross(normal, first)
    projected = np.einsum("ij,ij->i", vectors, first) + 1j * np.einsum("ij,ij->i", vectors, second)
    edge = triangles.edge_vectors[faces, 0]
    return projected * edge / np.abs(edge)


def interpolation_at(triangles: IntrinsicMesh, located: LocatedPoints) -> csr_matrix:
    """Return the sparse (n, n_vertices) matrix that interpolates values at vertices at n points (rows of A, Eq. 14)."""
    rows, corners = np.nonzero(located.barycentric > 0)
    entries = rows, triangles.corner_vertices[located.faces[rows], corners]
    return csr_matrix((located.barycentric[rows, corners], entries), shape=(len(located), triangles.n_vertices))
