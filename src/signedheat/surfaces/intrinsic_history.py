"""The steps by which an intrinsic triangulation was made, and the transfer of points and lines through them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frozen import Frozen
from ..mesh.delaunay import glue
from ..mesh.gluing_kernels import Gluing
from ..mesh.intrinsic_mesh import IntrinsicMesh
from .transfer_kernels import find_successors, trace_both_ways, transfer_backward, transfer_forward


class Lines(NamedTuple):
    """Straight lines, one row for each face that one of them crosses, in order along each line.

    Attributes
    ----------
    owners : (r,) int
        Which line.
    faces : (r,) int
        The face crossed.
    starts, ends : (r, 3) float
        Barycentric coordinates of where the line enters and leaves the face.
    vectors : (r, k, 3) float
        Vectors transported along the line, as differences of barycentric coordinates.
    """

    owners: NDArray[np.int64]
    faces: NDArray[np.int64]
    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    vectors: NDArray[np.float64]

    def chosen(self, rows: NDArray[np.int64]) -> Lines:
        """Some of the rows, in this order."""
        return Lines(self.owners[rows], self.faces[rows], self.starts[rows], self.ends[rows], self.vectors[rows])


@dataclass(frozen=True, eq=False)
class History(Frozen):
    """Two triangulations of one surface and the steps from one to the other.

    Attributes
    ----------
    before, after : IntrinsicMesh
        Vertices of `before` keep their ids; new ones follow.
    steps, weights : (n, 4) int and float
        As `gluing_kernels.record` writes them.
    """

    before: IntrinsicMesh
    after: IntrinsicMesh
    steps: NDArray[np.int64]
    weights: NDArray[np.float64]

    def forward(
        self, faces: NDArray[np.int64], barycentric: NDArray[np.float64], vectors: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Points of `before`, and vectors (p, k, 3) at them, as points of `after`."""
        faces, barycentric, vectors = copied(faces, barycentric, vectors)
        transfer_forward(self.steps, self.weights, *self._successors, faces, barycentric, vectors)
        return faces, barycentric, vectors

    def backward(
        self, faces: NDArray[np.int64], barycentric: NDArray[np.float64], vectors: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Points of `after`, and vectors (p, k, 3) at them, as points of `before`."""
        faces, barycentric, vectors = copied(faces, barycentric, vectors)
        n_faces = max(self.before.n_faces, self.after.n_faces)
        transfer_backward(self.steps, self.weights, n_faces, faces, barycentric, vectors)
        return faces, barycentric, vectors

    @cached_property
    def _successors(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Which steps change each face, one after the other."""
        first, later = find_successors(self.steps, max(self.before.n_faces, self.after.n_faces))
        return first, later

    @cached_property
    def new_vertices(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Positions on `before` of the vertices that only `after` has: faces and barycentric coordinates."""
        count = self.after.n_vertices - self.before.n_vertices
        faces, barycentric, _ = self.backward(np.full(count, -1), np.zeros((count, 3)))
        return faces, barycentric

    @cached_property
    def gluing_before(self) -> Gluing:
        """How the triangles of `before` are glued, for lines across them."""
        return for_tracing(self.before)

    @cached_property
    def gluing_after(self) -> Gluing:
        """How the triangles of `after` are glued, for lines across them."""
        return for_tracing(self.after)

    def edges_before(self) -> Lines:
        """The edges of `after`, from tail to head, as lines on `before`."""
        return straight_lines(self.gluing_before, *self.backward(*edge_middles(self.after)))

    def edges_after(self) -> Lines:
        """The edges of `before`, from tail to head, as lines on `after`."""
        return straight_lines(self.gluing_after, *self.forward(*edge_middles(self.before)))


def copied(
    faces: NDArray[np.int64], barycentric: NDArray[np.float64], vectors: NDArray[np.float64] | None
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Points and vectors at them, none by default, as kernels may change them."""
    vectors = np.zeros((len(faces), 0, 3)) if vectors is None else np.array(vectors, dtype=np.float64)
    return np.array(faces, dtype=np.int64), np.array(barycentric, dtype=np.float64), vectors


def edge_middles(triangles: IntrinsicMesh) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Faces and barycentric coordinates of the edges' middle points, and (e, 1, 3) vectors from tail to head."""
    side = triangles.first_halfedges
    faces, k, rows = side // 3, side % 3, np.arange(len(side))
    middle, along = np.zeros((len(side), 3)), np.zeros((len(side), 1, 3))
    middle[rows, k] = middle[rows, (k + 1) % 3] = 0.5
    ahead = np.where(triangles.edges.forward[faces, k], 1.0, -1.0)
    along[rows, 0, k], along[rows, 0, (k + 1) % 3] = -ahead, ahead
    return faces, middle, along


def for_tracing(triangles: IntrinsicMesh) -> Gluing:
    """A gluing to trace lines on, without room for a history."""
    gluing = glue(triangles)
    return gluing._replace(steps=gluing.steps[:0].copy(), weights=gluing.weights[:0].copy())


def straight_lines(
    gluing: Gluing, faces: NDArray[np.int64], barycentric: NDArray[np.float64], vectors: NDArray[np.float64]
) -> Lines:
    """Straight lines given by their midpoints and vectors there, of which the first is the whole extent of the line."""
    halves = np.ascontiguousarray(vectors, dtype=np.float64).copy()
    halves[:, 0] *= 0.5
    room = 4 * len(faces) + 16
    while True:
        (owners, crossed), (starts, ends) = np.empty((2, room), np.int64), np.empty((2, room, 3))
        lines = Lines(owners, crossed, starts, ends, np.empty((room, vectors.shape[1], 3)))
        count = trace_both_ways(gluing, faces, barycentric, halves, *lines[1:], lines.owners)
        if count <= room:
            break
        room = count
    rows = np.arange(count)
    against = lines.owners[:count] < 0  # the half from the middle to the tail
    owners = np.where(against, -1 - lines.owners[:count], lines.owners[:count])
    order = np.lexsort([np.where(against, -1 - rows, rows), owners])
    lines, against = lines._replace(owners=owners).chosen(order), against[order]
    lines.vectors[:, 0] *= 2.0
    lines.starts[against], lines.ends[against] = lines.ends[against], lines.starts[against]
    middle = np.flatnonzero(against[:-1] & ~against[1:] & (lines.owners[:-1] == lines.owners[1:]))
    lines.ends[middle] = lines.ends[middle + 1]
    return lines.chosen(np.delete(rows, middle + 1))


def misplaced_lines(triangles: IntrinsicMesh, lines: Lines, lengths: NDArray[np.float64]) -> NDArray[np.int64]:
    """Ids of lines whose traces are wrong: somewhere not finite, or more than twice as long as they should be.

    Triangles that are as thin as rounding turn lines that are traced through them.
    """
    along, corners = lines.vectors[:, 0], triangles.corner_positions[lines.faces]
    with np.errstate(all="ignore"):  # they may have overflowed
        traced, rounding = np.abs((along * corners).sum(axis=1)), 1e-5 * (np.abs(along) * np.abs(corners)).sum(axis=1)
    finite = np.isfinite(lines.starts).all(axis=1) & np.isfinite(lines.ends).all(axis=1)
    return np.unique(lines.owners[~(finite & (traced <= 2 * lengths[lines.owners] + rounding))])
