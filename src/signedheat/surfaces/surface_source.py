"""Sources on surfaces, *lowered* to X₀ of Eq. 12 (Eq. 11, Eq. 19) and to the rows A of Eq. 14 that interpolate φ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array, csr_matrix, vstack

from ..arrays import Bools, Complexes, Floats, Frozen, Ints, mask_of
from ..errors import CancellingNormalsError, SourceError
from ..mesh.components import connected_components, grouped
from ..mesh.curve_segments import CurveSegments, interpolation_at
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import (
    EDGE,
    VERTEX,
    LocatedPoints,
    concatenated,
    incident_faces,
    points_at_vertices,
    unique_points,
)
from .source_segments import segments_of_each


@dataclass(frozen=True, eq=False)
class SurfaceSource(Frozen):
    """Curves and points, lowered to an intrinsic mesh: what the signed heat method needs of them."""

    vectors: csr_array  # (1, e) X₀, in the frames of the edges
    time: float  # t of Eq. 12
    interpolation: csr_matrix  # (s, n_vertices) interpolates φ at the samples, the distinct points of every source
    weights: Floats  # (s,) length of curve that belongs to each sample; h for isolated points
    components: Ints  # (s,) connected component of the union of all sources, numbered by first appearance
    source_ids: Ints  # (s,) source that each sample belongs to
    oriented: bool  # whether any source is oriented; if none is, φ is an unsigned distance
    triangles: IntrinsicMesh  # whose first vertices are those of the domain's own triangles
    parts: Sequence[CurveSegments]  # the sources on these triangles
    extrapolated: bool = False  # whether directions are to be extrapolated in t

    @cached_property
    def ending(self) -> Bools:
        """(m,) whether an oriented curve ends in the same connected part as each face, off its boundary.

        Nonmanifold edges count as boundary, too.
        """
        triangles = self.triangles
        oriented = [part for part in self.parts if part.oriented]
        if not oriented:
            return np.zeros(triangles.n_faces, dtype=bool)
        nodes, ends = joined(oriented)
        free = nodes[np.flatnonzero(np.bincount(ends.ravel(), minlength=len(nodes)) % 2)]
        outer = lie_along(triangles, free, triangles.edges.face_counts != 2)
        parts = triangles.face_components
        return np.isin(parts, parts[incident_faces(triangles, free[np.flatnonzero(~outer)])[1]])


def lie_along(triangles: IntrinsicMesh, points: LocatedPoints, edges: Bools) -> Bools:
    """(p,) whether p points lie on one of the chosen `edges`, (e,) bool, or at a vertex of one."""
    vertices = mask_of(triangles.n_vertices, triangles.edges.vertices[edges])
    return ((points.kinds == VERTEX) & vertices[points.elements % triangles.n_vertices]) | (
        (points.kinds == EDGE) & edges[points.elements % triangles.n_edges]
    )


def surface_source(triangles: IntrinsicMesh, sources: Sequence[Any], diffusion: float, spacing: float) -> SurfaceSource:
    """Lower sources to an intrinsic mesh, whose faces they refer to; ``t = diffusion · spacing²``.

    A sequence within `sources` counts as one source. A point weighs as much as a curve of length `spacing`. Unoriented
    curves must run along edges (`refine_to_conform`).
    """
    groups = segments_of_each(sources, triangles)
    parts = [part for group in groups for part in group]
    if not parts or not all(groups):
        raise SourceError("no source was given", remedy="pass at least one curve or point, and no empty lists")
    if not all(part.is_conforming for part in parts):
        raise SourceError("unoriented curves inside faces must be embedded in the triangles first", element="curves")
    vectors = oriented_vectors(triangles, [p for p in parts if p.oriented])
    vectors = vectors + unoriented_vectors(triangles, parts, spacing)
    points = [p.nodes for p in parts if len(p.ends) == 0]
    if points:
        nodes = concatenated(points)
        at_vertex = nodes.kinds == VERTEX
        vectors = vectors + spacing * vertex_point_vectors(triangles, nodes.elements[at_vertex])
        vectors = vectors + np.sqrt(3) * spacing**2 * inner_point_vectors(triangles, nodes[~at_vertex])
    elif np.abs(vectors.data).max(initial=0.0) <= 1e-12 * max(part.lengths.max() for part in parts):
        raise CancellingNormalsError(
            "the curves cancel: all of them run both ways, or close inside single faces, so that no side is positive",
            remedy="make them unoriented (oriented=False), or the faces smaller, as intrinsic=True does",
            element="curves",
        )

    components = connected(parts)
    sizes = [sum(len(p.nodes) for p in group) for group in groups]
    return SurfaceSource(
        vectors=vectors,
        time=diffusion * spacing**2,
        interpolation=vstack([interpolation_at(triangles, p.nodes) for p in parts], format="csr"),
        weights=np.concatenate([line_elements(p, spacing) for p in parts]),
        components=components,
        source_ids=np.repeat(np.arange(len(groups)), sizes),
        oriented=any(p.oriented for p in parts),
        triangles=triangles,
        parts=parts,
    )


def oriented_vectors(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> csr_array:
    """(1, e) sums of i(b − a) over segments ab (Eq. 11): on the edge along which one runs, or a third on each edge.

    ψ_e(m) is replaced by its mean, ⅓. (The published code adds the whole vector to each of the three edges.)
    """
    edges, faces = (
        np.concatenate([np.empty(0, dtype=np.int64), *of_each])
        for of_each in ([part.edges for part in parts], [part.faces for part in parts])
    )
    vectors: Complexes = np.concatenate([np.empty(0, dtype=np.complex128), *(part.vectors for part in parts)])
    along, inside = edges >= 0, edges < 0
    on_edges = scatter(triangles.n_edges, edges[along], vectors[along])
    return on_edges + from_faces(triangles, faces[inside], vectors[inside] / 3)


def unoriented_vectors(triangles: IntrinsicMesh, parts: Sequence[CurveSegments], spacing: float) -> csr_array:
    """(1, e) vectors away from unoriented curves, which run along edges, and from their free ends (App. A.2).

    A face beside an edge jk adds p_k − p_j, rotated by 90 degrees into the face, to its other edges. On the edge itself
    the two sides cancel (Eq. 11, Eq. 19). A vertex is a free end if a single such edge ends there.
    """
    curves = [p for p in parts if len(p.ends) and not p.oriented]
    if not curves:
        return csr_array((1, triangles.n_edges), dtype=np.complex128)
    edges = np.unique(np.concatenate([p.edges for p in curves]))
    faces, sides = np.nonzero(mask_of(triangles.n_edges, edges)[triangles.edges.face_edges])
    inward = 1j * triangles.edge_vectors[faces, sides]
    on_edges = triangles.in_edge_frames(inward[:, None], faces)
    on_edges[np.arange(len(faces)), sides] = 0
    sums = scatter(triangles.n_edges, triangles.edges.face_edges[faces], on_edges)

    touched = np.bincount(triangles.edges.vertices[edges].ravel(), minlength=triangles.n_vertices)
    for part in parts:  # an end at a vertex of another source is not free
        if len(part.ends) and part.oriented:
            at_vertex = part.nodes.kinds == VERTEX
            touched[part.nodes.elements[at_vertex]] += 2
    ends_free = touched[triangles.edges.vertices[edges]] == 1
    rows, end = np.nonzero(ends_free)
    faces, arcs = free_end_arcs(triangles, edges[rows], triangles.edges.vertices[edges[rows], end], spacing)
    return sums + from_faces(triangles, faces, arcs)


def vertex_point_vectors(triangles: IntrinsicMesh, vertices: Ints) -> csr_array:
    """(1, e) X₀ of points at vertices (Eq. 19).

    A corner that begins at direction d and has angle α adds i d (1 − e^{iα}) / Θ, with Θ the total angle of the vertex.
    """
    faces, corners = np.nonzero(mask_of(triangles.n_vertices, vertices)[triangles.corner_vertices])
    leaving = triangles.edge_vectors[faces, corners]
    arriving = -triangles.edge_vectors[faces, (corners + 2) % 3]
    angles = np.angle(arriving * np.conj(leaving))
    owners = triangles.corner_vertices[faces, corners]
    total = np.bincount(owners, weights=angles, minlength=triangles.n_vertices)[owners]
    round_corner = 1j * (leaving / np.abs(leaving)) * (1 - np.exp(1j * angles)) / total
    return from_faces(triangles, faces, round_corner)


def inner_point_vectors(triangles: IntrinsicMesh, located: LocatedPoints) -> csr_array:
    """(1, e) X₀ of points on edges and in faces: −∇δ_p tested with ψ_e, ``⟨−∇δ_p, ψ_e⟩ = ∇ψ_e(p)``.

    It gives the gradient of the heat kernel. At vertices of equilateral triangles it would be Eq. 19 divided by √3 h,
    by which `surface_source` therefore multiplies it.
    """
    corner = np.argwhere(located.barycentric > 0)
    vertices = triangles.corner_vertices[located.faces[corner[:, 0]], corner[:, 1]]
    owners, faces = incident_faces(triangles, points_at_vertices(triangles, vertices))
    area = np.bincount(owners, triangles.face_areas[faces], len(vertices))
    share = located.barycentric[corner[:, 0], corner[:, 1]] / np.where(area > 0, area, np.inf)
    outward = -1j * triangles.edge_vectors[faces] * share[owners][:, None]
    in_frames = triangles.in_edge_frames(outward, faces)
    return scatter(triangles.n_edges, triangles.edges.face_edges[faces], in_frames)


def from_faces(triangles: IntrinsicMesh, faces: Ints, vectors: Complexes) -> csr_array:
    """(1, e) sums of (k,) vectors in (k,) faces over the faces at each edge, in the frames of edges."""
    in_frames = triangles.in_edge_frames(vectors[:, None], faces)
    return scatter(triangles.n_edges, triangles.edges.face_edges[faces], in_frames)


def scatter(n: int, index: Ints, values: Complexes) -> csr_array:
    """(1, n) sparse sums of values with the same index from 0 to n − 1; both arrays have the same shape."""
    flat = index.ravel()
    return csr_array((values.ravel(), (np.zeros(len(flat), dtype=np.int64), flat)), shape=(1, n), dtype=np.complex128)


def line_elements(part: CurveSegments, spacing: float) -> Floats:
    """(s,) half the length of the segments that meet at each node of a source; `spacing` for isolated points."""
    if len(part.ends) == 0:
        return np.full(len(part.nodes), spacing)
    return np.bincount(part.ends.ravel(), np.repeat(0.5 * part.lengths, 2), len(part.nodes)).astype(np.float64)


def joined(parts: Sequence[CurveSegments]) -> tuple[LocatedPoints, Ints]:
    """Return the distinct nodes of all sources, and the (k, 2) ids of those at the ends of all segments."""
    nodes = concatenated([p.nodes for p in parts])
    first, point_ids = unique_points(nodes)
    return nodes[first], ends_among(parts, point_ids)


def ends_among(parts: Sequence[CurveSegments], point_ids: Ints) -> Ints:
    """(k, 2) point ids at the ends of all segments of all parts; `point_ids` are the (s,) point ids of all nodes."""
    offsets = np.cumsum([0] + [len(p.nodes) for p in parts[:-1]])
    ends: Ints = np.concatenate([p.ends + offset for p, offset in zip(parts, offsets, strict=True)])
    return point_ids[ends]


def connected(parts: Sequence[CurveSegments]) -> Ints:
    """(s,) connected component, of the union of all sources, of each node; numbered by first appearance."""
    first, point_ids = unique_points(concatenated([p.nodes for p in parts]))
    return connected_components(len(first), *ends_among(parts, point_ids).T)[point_ids]


def free_end_arcs(triangles: IntrinsicMesh, edges: Ints, vertices: Ints, least: float) -> tuple[Ints, Complexes]:
    """Make vectors away from the free ends of curves, over the half disk behind each end: (j,) faces, (j,) vectors.

    An end is the last of the (k,) `edges` and its vertex. Behind means at least a quarter of the total angle away from
    the curve; at boundary and nonmanifold vertices, a right angle. The vectors of an end weigh as much as its edge, but
    at least `least`, so that they do not vanish at short edges. (The published code has no such minimum.)
    """
    faces, vectors = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.complex128)]
    starts, members = grouped(triangles.corner_vertices.ravel(), triangles.n_vertices)
    for edge, vertex in zip(edges, vertices, strict=True):
        face, corner = np.divmod(members[starts[vertex] : starts[vertex + 1]], 3)
        leaving = triangles.edge_vectors[face, corner]
        arriving = -triangles.edge_vectors[face, (corner + 2) % 3]
        angle = np.angle(arriving * np.conj(leaving))
        spokes, ends = np.unique(
            np.stack([triangles.edges.face_edges[face, corner], triangles.edges.face_edges[face, (corner + 2) % 3]]),
            return_inverse=True,
        )
        right, left = ends.reshape(2, -1)
        last = np.searchsorted(spokes, edge)
        away = angles_from(last, right, left, angle, len(spokes))

        ring = np.isfinite(away[right])
        closed = bool((np.bincount(np.concatenate([right[ring], left[ring]]))[np.unique(right[ring])] == 2).all())
        quarter = angle[ring].sum() / 4 if closed else np.pi / 2
        start = np.clip(quarter - away[right], 0, angle)
        end = np.clip(angle + away[left] - quarter, 0, angle)
        behind = end > start
        arc = -1j * (leaving / np.abs(leaving)) * (np.exp(1j * end) - np.exp(1j * start))
        length = np.abs(np.concatenate([leaving[right == last], arriving[left == last]]))[0]
        faces.append(face[behind])
        vectors.append(arc[behind] * max(length, least) / (end - start)[behind].sum())
    return np.concatenate(faces), np.concatenate(vectors)


def angles_from(spoke: int, right: Ints, left: Ints, angle: Floats, n_spokes: int) -> Floats:
    """(n_spokes,) angles from one spoke, an edge at a vertex, to all spokes, the shortest way around, in radians.

    Corner k lies between spokes ``right[k]`` and ``left[k]``, and has the angle ``angle[k]``. Spokes that are not
    connected to the first by corners have ∞.
    """
    away = np.full(n_spokes, np.inf)
    away[spoke] = 0.0
    for _ in range(n_spokes):
        before = away.copy()
        np.minimum.at(away, left, away[right] + angle)
        np.minimum.at(away, right, away[left] + angle)
        if (away == before).all():
            break
    return away
