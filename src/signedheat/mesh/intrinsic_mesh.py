"""Intrinsic meshes, on which the signed heat method for surfaces computes.

A face has three vertex ids, three edge ids, and its corners laid out in the plane as complex numbers.
Triangle meshes, polygon meshes after virtual refinement, digital surfaces with corrected normals, intrinsic
triangulations and the local triangulations of point clouds are all represented in this way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..arrays import Bools, Complexes, Floats, Frozen, Ints, mask_of
from ..errors import GeometryError
from .components import connected_components, element_components, next_in_groups
from .edges import EdgeTable, edge_table
from .triangles import Triangles

Index = Ints | slice
LEAST_AREA = 1e-18
"""Least area of a face, relative to the square of its longest edge, by which is divided. It replaces smaller areas."""


@dataclass(frozen=True, eq=False)
class IntrinsicMesh(Frozen):
    """m triangles given by their vertices, their edges and their shapes, without positions in space."""

    corner_vertices: Ints  # (m, 3) vertex ids
    corner_positions: Complexes  # (m, 3) corners in the plane of the face, counter-clockwise
    edges: EdgeTable  # edge k of a face runs from corner k to corner k + 1. Two edges may join the same two vertices.
    n_vertices: int  # number of vertices, used or not
    # (e,) halfedge 3 f + k of each edge, with f the face that counts as its first one; by default that of lowest id
    leading_sides: Ints | None = None

    @classmethod
    def from_lengths(
        cls, corner_vertices: Ints, lengths: Floats, n_vertices: int, edges: EdgeTable | None = None
    ) -> IntrinsicMesh:
        """Make a mesh of triangles with (m, 3) lengths of edges, number k from corner k to corner k + 1.

        Corner 0 is at the origin. Kahan's stable form of Heron's formula gives the areas.
        """
        base, right, left = lengths.T
        a, b, c = np.sort(lengths, axis=1)[:, ::-1].T
        product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
        twice_area = 0.5 * np.sqrt(np.maximum(product, 0.0))
        divisor = np.where(base > 0, base, 1.0)  # rounding leaves some edges no length
        apex_x = 0.5 * (base + (left - right) * (left + right) / divisor)
        positions = np.zeros((len(lengths), 3), dtype=np.complex128)
        positions[:, 1] = base
        positions[:, 2] = apex_x + 1j * np.where(base > 0, twice_area / divisor, left)
        return cls(corner_vertices, positions, edge_table(corner_vertices) if edges is None else edges, n_vertices)

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.corner_vertices)

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.edges.vertices)

    @cached_property
    def edge_vectors(self) -> Complexes:
        """Vector from corner k to corner k + 1 in the face's layout, (m, 3) complex."""
        return np.roll(self.corner_positions, -1, axis=1) - self.corner_positions

    @cached_property
    def edge_lengths(self) -> Floats:
        """Length of the edge from corner k to corner k + 1 of each face, (m, 3) float."""
        return np.abs(self.edge_vectors)

    @cached_property
    def lengths_of_edges(self) -> Floats:
        """Length of each edge in one of its faces, (e,) float."""
        lengths = np.zeros(self.n_edges)
        lengths[self.edges.face_edges] = self.edge_lengths
        return lengths

    @property
    def agree_on_lengths(self) -> bool:
        """Whether an edge has the same length in all of its faces, which is not so for flattened voxel faces."""
        of_edges = self.lengths_of_edges[self.edges.face_edges]
        return bool(np.allclose(of_edges, self.edge_lengths, rtol=1e-6, atol=0))

    @cached_property
    def face_areas(self) -> Floats:
        """Area of each face, (m,) float; 0 where rounding would make it negative."""
        first, _, last = self.edge_vectors.T
        return np.maximum(-0.5 * (np.conj(first) * last).imag, 0.0)

    @property
    def areas_as_divisors(self) -> Floats:
        """Area of each face, (m,) float, at least `LEAST_AREA` times the square of its longest edge."""
        squares: Floats = (np.abs(self.edge_vectors) ** 2).max(axis=1)
        return np.maximum(self.face_areas, LEAST_AREA * squares)

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area of the faces at each vertex, (n_vertices,) float."""
        thirds = np.repeat(self.face_areas / 3, 3)
        return np.bincount(self.corner_vertices.ravel(), thirds, self.n_vertices).astype(np.float64)

    @cached_property
    def corner_cotangents(self) -> Floats:
        """Cotangent of the angle at each corner, (m, 3) float."""
        leaving = self.edge_vectors
        arriving = -np.roll(leaving, 1, axis=1)
        return (np.conj(leaving) * arriving).real / (2.0 * self.areas_as_divisors)[:, None]

    @cached_property
    def edge_directions(self) -> Complexes:
        """Unit vector of edge k from its tail to its head, in the face's layout, (m, 3) complex: z_fe of Eq. 8."""
        lengths = np.where(self.edge_lengths > 0, self.edge_lengths, 1.0)  # edges without length have no direction
        return np.where(self.edges.forward, 1.0, -1.0) * self.edge_vectors / lengths

    @cached_property
    def reflected(self) -> Bools:
        """Whether the frame of edge k is a reflection of the face's layout, (m, 3) bool; vectors are then conjugated.

        The second axis of an edge's frame points into its first face, and out of all other faces, whichever direction
        along the edge these have.
        """
        return self.edges.forward != mask_of(3 * self.n_faces, self.first_halfedges).reshape(-1, 3)

    @cached_property
    def first_halfedges(self) -> Ints:
        """Halfedge 3 f + j of each edge with a face, in the first face of the edge, (k,) int."""
        if self.leading_sides is not None:
            return self.leading_sides
        starts, halfedges = self.edges.halfedges
        return halfedges[starts[:-1][np.diff(starts) > 0]]

    @cached_property
    def is_consistently_oriented(self) -> bool:
        """Whether no frame is reflected; the connection Laplacian is then complex Hermitian."""
        return not self.reflected.any()

    @cached_property
    def face_components(self) -> Ints:
        """Label of the part of the surface of each face, (m,) int; faces with a common edge are in the same part."""
        return element_components(self.edges.face_edges)

    def in_edge_frames(self, vectors: Complexes, faces: Index = slice(None), sides: Index = slice(None)) -> Complexes:
        """Express vectors, given in layouts of faces, in the frames of the edges at sides of these faces.

        They are (k, 1) or (k, 3) for all sides of k faces, or (k,) if `sides` has one side for each face.
        """
        in_frames = np.conj(self.edge_directions[faces, sides]) * vectors
        return np.where(self.reflected[faces, sides], np.conj(in_frames), in_frames)

    def from_edge_frames(self, vectors: Complexes, faces: Index, sides: Index = slice(None)) -> Complexes:
        """Express vectors, given in the frames of edges at sides of faces, in the layouts of these faces.

        Their shape is that of ``edge_directions[faces, sides]``.
        """
        return self.edge_directions[faces, sides] * np.where(self.reflected[faces, sides], np.conj(vectors), vectors)

    def sums_in_faces(self, vectors: Complexes) -> Complexes:
        """Return (m, c) sums of (e, c) vectors over the edges of each face, in the face's layout.

        This is three times the mean of Sec. 6.
        """
        straight, mirrored = self._face_sums
        sums = np.empty((self.n_faces, vectors.shape[1]), dtype=np.complex128, order="F")
        for k, column in enumerate(vectors.T):
            sums[:, k] = straight @ column
            if mirrored.nnz:
                sums[:, k] += mirrored @ np.conj(column)
        return sums

    @cached_property
    def _face_sums(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """The (m, e) matrices by which `sums_in_faces` multiplies (e,) vectors, and those conjugated, and adds both."""
        shape = self.n_faces, self.n_edges
        starts, edges, directions = np.arange(0, 3 * self.n_faces + 1, 3), self.edges.face_edges, self.edge_directions
        if self.is_consistently_oriented:
            return sparse.csr_array((directions.ravel(), edges.ravel(), starts), shape), sparse.csr_array(shape)
        parts = np.where(self.reflected, 0, directions), np.where(self.reflected, directions, 0)
        straight, mirrored = (sparse.csr_array((part.ravel(), edges.ravel(), starts), shape) for part in parts)
        return straight, mirrored


TRIANGLE_MARGIN = 1e-14
"""Margin of the triangle inequality, relative to the mean length, below which all edges are lengthened until every
triangle has it (`mollify`)."""


def mollify(lengths: Floats, margin: float) -> tuple[Floats, float]:
    """Add one amount to all (m, 3) lengths, the least for which ``a + b − c ≥ margin · mean``; also return it."""
    longest = lengths.max(axis=1)
    slack = float((lengths.sum(axis=1) - 2.0 * longest).min())
    added = margin * float(lengths.mean()) - slack
    return (lengths + added, added) if added > 0 else (lengths, 0.0)


def laid_out(mesh: Triangles, margin: float) -> tuple[IntrinsicMesh, float]:
    """Return the intrinsic mesh of a triangle mesh, and the length that `mollify` added to all edges."""
    corners = mesh.vertices[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    area = 0.5 * float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())
    if not area > 2 * np.finfo(np.float64).eps * float(np.abs(mesh.bounds).max()) * float(lengths.sum()):
        raise GeometryError(
            f"all {mesh.n_faces} faces have no area, or none beyond rounding: there is nothing to measure distance on",
            remedy="check the coordinates; move shapes that are far away to the origin",
            element="faces",
        )
    lengths, added = mollify(lengths, margin)
    return IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, mesh.edges), added


@dataclass(frozen=True, eq=False)
class FacePairs:
    """p pairs of faces that meet at an edge; of three or more, each is paired with the next, with weight ½."""

    faces: Ints  # (p, 2) ids of the two faces
    sides: Ints  # (p, 2) the side of each face that is the edge; side k runs from corner k to corner k + 1
    edges: Ints  # (p,) id of the edge
    # (p, 2) the corner of each face at the edge's tail, and at its head, as indices into raveled (m, 3) corners
    tails: Ints
    heads: Ints
    shares: Floats  # (p,) weight of each pair: 1, or ½ where three or more faces meet

    def ends(self, corner_values: Floats) -> Floats:
        """Return (p, 2) differences of (m, 3) corner values across edges, at their tail and at their head (Eq. 15).

        They are values in the first face less those in the second.
        """
        flat = corner_values.ravel()
        at_tail, at_head = flat[self.tails], flat[self.heads]
        return np.stack([at_tail[:, 0] - at_tail[:, 1], at_head[:, 0] - at_head[:, 1]], axis=1)


def face_pairs(triangles: IntrinsicMesh) -> FacePairs:
    """Pair the faces at each edge; boundary edges have no pair."""
    edge = triangles.edges.face_edges.ravel()
    starts, order = triangles.edges.halfedges
    count = np.diff(starts)
    # each halfedge with the next one of its edge; of two, one pair is enough
    halfedges = np.stack([order, order[next_in_groups(starts)]], axis=1)
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
    """Cut a surface open between pairs of faces for which `cut`, (p,), is true.

    Returns (3m,) the vertex at each corner of the surface cut open, numbered from 0.
    """
    ends = np.concatenate([pairs.tails[~cut], pairs.heads[~cut]])
    return connected_components(triangles.corner_vertices.size, *ends.T)
