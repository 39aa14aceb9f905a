"""The steps by which an intrinsic triangulation was made, and the transfer of points and lines through them.

Every step (an edge flip, or a split of a face or an edge) exchanges triangles on four points that have one affine
dependency ``Σ c_k p_k = 0``. The weights of a point in an old triangle are moved along c until another weight vanishes.
Then they are nonnegative in a new triangle. No angle is measured and no line is traced, so that the transfer cannot
fail, and a point on an edge that both triangulations have stays exactly on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Frozen, Ints
from ..compiled import compiled
from ..mesh.gluing import (
    FLIP_STEP,
    SPLIT_EDGE,
    SPLIT_FACE,
    TURN_STEP,
    Gluing,
    apex,
    diamond,
    faces_around,
    following,
    glue,
)
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import ZERO_COORDINATE
from ..mesh.unit_vectors import ANGLE_ROUNDING


class Lines(NamedTuple):
    """Straight lines, one row for each face that one of them crosses, in order along each line."""

    owners: Ints  # (r,) id of the line
    faces: Ints  # (r,) the face crossed
    starts: Floats  # (r, 3) barycentric coordinates of where the line enters the face
    ends: Floats  # (r, 3) barycentric coordinates of where it leaves the face
    vectors: Floats  # (r, k, 3) vectors transported along the line, as differences of barycentric coordinates

    def chosen(self, rows: Ints) -> Lines:
        """Return the lines with these rows only, in this order."""
        return Lines(self.owners[rows], self.faces[rows], self.starts[rows], self.ends[rows], self.vectors[rows])


@dataclass(frozen=True, eq=False)
class History(Frozen):
    """Two triangulations of one surface and the steps from one to the other."""

    before: IntrinsicMesh
    after: IntrinsicMesh  # its first vertices are those of `before`
    # (n, 4) kind; what it changes, a halfedge (flip, split of an edge) or a face; the other one; new vertex or −1
    steps: Ints
    # (n, 4) affine dependency of the step's four points; of a split, the new vertex in the old triangle, and 1
    weights: Floats

    def forward(self, faces: Ints, barycentric: Floats, vectors: Floats | None = None) -> tuple[Ints, Floats, Floats]:
        """Transfer points of `before`, and (p, k, 3) vectors at them, to `after`.

        Points are (p,) faces and (p, 3) barycentric coordinates; vectors are differences of such. The same is returned.
        """
        return self._transferred(self._later, faces, rows_of(barycentric, vectors))

    def backward(self, faces: Ints, barycentric: Floats, vectors: Floats | None = None) -> tuple[Ints, Floats, Floats]:
        """Transfer points of `after`, and (p, k, 3) vectors at them, to `before`.

        Points are (p,) faces and (p, 3) barycentric coordinates; vectors are differences of such. The same is returned.
        """
        return self._transferred(self._earlier, faces, rows_of(barycentric, vectors))

    def inserted(self) -> tuple[Ints, Floats]:
        """Locate the inserted vertices, in order, on `before`: (k,) faces, and (k, 3) barycentric coordinates."""
        vertex = self.steps[:, 3]
        # each face at an edge is split by a step of its own: the first of them is enough
        rows = np.flatnonzero((vertex >= 0) & (np.diff(vertex, prepend=-1) != 0))
        # the face that was split, and its corners from the tail of the split halfedge on
        is_edge = self.steps[rows, 0] == SPLIT_EDGE
        faces = np.where(is_edge, self.steps[rows, 1] // 3, self.steps[rows, 1])
        corners = (np.where(is_edge, self.steps[rows, 1] % 3, 0)[:, None] + np.arange(3)) % 3
        weights = np.empty((len(rows), 1, 3))
        np.put_along_axis(weights[:, 0], corners, self.weights[rows, :3], axis=1)
        last_change = self._earlier.next_of_face[rows, 0]  # the step before the split that changed this face last
        return self._transferred(self._earlier, faces, weights, last_change)[:2]

    def _transferred(
        self, links: Links, faces: Ints, rows: Floats, begin: NDArray[np.int32] | None = None
    ) -> tuple[Ints, Floats, Floats]:
        """Carry (p,) points through the steps from (p,) `begin` on, by default through all that change their faces.

        `rows`, (p, 1 + k, 3), are barycentric coordinates and vectors.
        """
        faces = np.array(faces, dtype=np.int64)
        transfer(self.steps, self.weights, links, links.first[faces] if begin is None else begin, faces, rows)
        return faces, rows[:, 0].copy(), rows[:, 1:].copy()

    @cached_property
    def _later(self) -> Links:
        """For each face of `before`, the steps that change it, from the first to the last."""
        return Links(True, *linked_steps(self.steps, self._most_faces, True))

    @cached_property
    def _earlier(self) -> Links:
        """For each face of `after`, the steps that changed it, from the last to the first."""
        return Links(False, *linked_steps(self.steps, self._most_faces, False))

    @property
    def _most_faces(self) -> int:
        """Upper bound of the ids of faces in both triangulations."""
        return max(self.before.n_faces, self.after.n_faces)

    @cached_property
    def gluing_before(self) -> Gluing:
        """The gluing of `before`, to trace lines on."""
        return for_tracing(self.before)

    @cached_property
    def gluing_after(self) -> Gluing:
        """The gluing of `after`, to trace lines on."""
        return for_tracing(self.after)

    def edges_before(self) -> Lines:
        """Trace the edges of `after`, from tail to head, as lines on `before`."""
        return straight_lines(self.gluing_before, *self.backward(*edge_middles(self.after)))

    def edges_after(self) -> Lines:
        """Trace the edges of `before`, from tail to head, as lines on `after`."""
        return straight_lines(self.gluing_after, *self.forward(*edge_middles(self.before)))


class Links(NamedTuple):
    """The steps that change each face, as linked lists, so that a point visits only those that change its face."""

    forward: bool  # whether lists lead from the first step to the last, or back
    first: NDArray[np.int32]  # (m,) first step in the list of each face, −1 if there is none
    next_of_face: NDArray[np.int32]  # (n, 3) the next step in the list, for each face of a step


def rows_of(barycentric: Floats, vectors: Floats | None) -> Floats:
    """(p, 1 + k, 3) barycentric coordinates of p points, each followed by its (k, 3) vectors, as `transfer` needs."""
    points = np.asarray(barycentric, dtype=np.float64)[:, None]
    return points.copy() if vectors is None else np.concatenate([points, vectors], axis=1)


def edge_middles(triangles: IntrinsicMesh) -> tuple[Ints, Floats, Floats]:
    """Midpoints of edges, as (e,) faces and (e, 3) barycentric coordinates, and (e, 1, 3) vectors from tail to head."""
    side = triangles.first_halfedges
    faces, k, rows = side // 3, side % 3, np.arange(len(side))
    middle, along = np.zeros((len(side), 3)), np.zeros((len(side), 1, 3))
    middle[rows, k] = middle[rows, (k + 1) % 3] = 0.5
    ahead = np.where(triangles.edges.forward[faces, k], 1.0, -1.0)
    along[rows, 0, k], along[rows, 0, (k + 1) % 3] = -ahead, ahead
    return faces, middle, along


def for_tracing(triangles: IntrinsicMesh) -> Gluing:
    """Make a gluing of triangles to trace lines on, without room for a history."""
    gluing = glue(triangles)
    return gluing._replace(steps=gluing.steps[:0].copy(), weights=gluing.weights[:0].copy())


def straight_lines(gluing: Gluing, faces: Ints, barycentric: Floats, vectors: Floats) -> Lines:
    """Trace p straight lines, given by (p,) faces and (p, 3) barycentric coordinates of midpoints, and vectors there.

    The (p, k, 3) vectors are differences of barycentric coordinates. The first of them is the whole line; the others
    are carried along it. Returns a row for each face that a line crosses, line after line, from tail to head. It has
    the index of the line, the face, where the line enters and leaves it, and the k vectors there.
    """
    halves = np.ascontiguousarray(vectors, dtype=np.float64).copy()
    halves[:, 0] *= 0.5
    room = 4 * len(faces) + 16
    while True:
        (owners, crossed), (starts, ends) = np.empty((2, room), np.int64), np.empty((2, room, 3))
        lines = Lines(owners, crossed, starts, ends, np.empty((room, vectors.shape[1], 3)))
        count = trace_both_ways(gluing, faces, barycentric, halves, lines)
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


def misplaced_lines(triangles: IntrinsicMesh, lines: Lines, lengths: Floats) -> Ints:
    """(k,) ids of lines whose traces, through nearly flat triangles, are not finite, or twice as long as `lengths`."""
    along, corners = lines.vectors[:, 0], triangles.corner_positions[lines.faces]
    with np.errstate(all="ignore"):  # they may have overflowed
        traced, rounding = np.abs((along * corners).sum(axis=1)), 1e-5 * (np.abs(along) * np.abs(corners)).sum(axis=1)
    finite = np.isfinite(lines.starts).all(axis=1) & np.isfinite(lines.ends).all(axis=1)
    return np.unique(lines.owners[~(finite & (traced <= 2 * lengths[lines.owners] + rounding))])


BEFORE_STEP = np.full((4, 3, 3), -1)
"""(4, 3, 3) by kind of step, face and corner: which of the four points is at that corner before the step, or after it
in `AFTER_STEP`."""
AFTER_STEP = np.full((4, 3, 3), -1)
BEFORE_STEP[TURN_STEP, 0], AFTER_STEP[TURN_STEP, 0] = [0, 1, 2], [0, 2, 1]
BEFORE_STEP[FLIP_STEP, :2], AFTER_STEP[FLIP_STEP, :2] = [[0, 1, 2], [1, 0, 3]], [[3, 2, 0], [2, 3, 1]]
BEFORE_STEP[SPLIT_EDGE, 0], AFTER_STEP[SPLIT_EDGE, :2] = [0, 1, 2], [[0, 3, 2], [3, 1, 2]]
BEFORE_STEP[SPLIT_FACE, 0], AFTER_STEP[SPLIT_FACE] = [0, 1, 2], [[0, 1, 3], [1, 2, 3], [2, 0, 3]]

SQUARE_LENGTH_ROUNDING = 1e-10
"""Rounding error of squared lengths, relative to the size of their terms."""


@compiled
def linked_steps(steps: Ints, n_faces: int, forward: bool) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the arrays `first`, (n_faces,), and `next_of_face`, (n, 3), of the `Links` of n steps."""
    first = np.full(n_faces, -1, np.int32)
    following_step = np.full((len(steps), 3), -1, np.int32)
    around, start = np.empty(3, np.int64), np.empty(3, np.int64)
    for m in range(len(steps)):
        n = len(steps) - 1 - m if forward else m
        faces_around(steps, n, around, start)
        for k in range(3):
            if around[k] >= 0:
                following_step[n, k] = first[around[k]]
        for k in range(3):
            if around[k] >= 0:
                first[around[k]] = n
    return first, following_step


@compiled
def transfer(steps: Ints, weights: Floats, links: Links, begin: NDArray[np.int32], faces: Ints, rows: Floats) -> None:
    """Carry points and vectors through the steps that change their faces, in place.

    `begin` is the first step for each point, or −1. Points have (p,) faces, and (p, 1 + k, 3) rows: their barycentric
    coordinates, followed by vectors. `links` lead from each step to the next one that changes the new face.
    """
    around, start = np.empty(3, np.int64), np.zeros(3, np.int64)
    for p in range(len(faces)):
        n = np.int64(begin[p])
        while n >= 0:
            faces_around(steps, n, around, start)
            kind, side = steps[n, 0], 0
            while around[side] != faces[p]:
                side += 1
            old, new = (BEFORE_STEP[kind], AFTER_STEP[kind]) if links.forward else (AFTER_STEP[kind], BEFORE_STEP[kind])
            new_face = exchange(kind, weights[n], links.forward, old[side], start[side], new, start, rows[p])
            faces[p] = around[new_face]
            n = np.int64(links.next_of_face[n, new_face])


@compiled
def exchange(
    kind: int, c: Floats, forward: bool, corners: Ints, start: int, new_corners: Ints, new_start: Ints, rows: Floats
) -> int:
    """Transfer a point, the first row, and vectors over one step, in place; return which new face contains the point.

    `rows`, (k, 3), are barycentric coordinates, and differences of such. `c`, (4,), are the weights of the step's
    affine dependency ``Σ ± c_l x_l = 0`` of four points, of which the old face has three. `corners`, (3,), are the
    indices of its corners among them, and `new_corners` those of all new faces; `start` and `new_start` are their first
    sides. Adding a multiple of the dependency leaves a point where it is. So the multiple is taken for which the
    coordinate of one point vanishes and none becomes negative: the new face is the one without this point.
    """
    lead = 3 if kind == SPLIT_FACE else 2  # points with a smaller index are on one side of the dependency
    x = np.zeros(4)
    gone, new_face = -1, 0
    for r in range(len(rows)):
        x[:] = 0.0
        for k in range(3):
            x[corners[k]] = rows[r, (start + k) % 3]
        if r == 0:
            least = np.inf
            for l in range(4):
                if (l < lead) == forward and c[l] > 0.0 and x[l] / c[l] < least:
                    gone, least = l, x[l] / c[l]
            while gone >= 0 and (new_corners[new_face] == gone).any():
                new_face += 1
        if gone >= 0:  # no point is left out where a face is only turned over
            amount = x[gone] / c[gone] if forward else -x[gone] / c[gone]
            for l in range(4):
                x[l] += -amount * c[l] if l < lead else amount * c[l]
            x[gone] = 0.0
        for k in range(3):
            rows[r, (new_start[new_face] + k) % 3] = x[new_corners[new_face, k]]
    return new_face


@compiled
def squared_length(g: Gluing, f: int, v: Floats) -> tuple[float, float]:
    """Squared length of a vector in face f, a difference of barycentric coordinates; and the sum of absolute terms."""
    square, size = 0.0, 0.0
    for k in range(3):
        term = v[k] * v[(k + 1) % 3] * g.length[g.edge[3 * f + k]] ** 2
        square -= term
        size += abs(term)
    return square, size


@compiled
def trace_geodesic(g: Gluing, face: int, barycentric: Floats, vectors: Floats, sign: float, out: Lines, n: int) -> int:
    """Trace a geodesic from a point along its first vector, times ±1, over its length; carry the other vectors.

    The point has (3,) barycentric coordinates in a face, and (k, 3) vectors are differences of such. Write a row to
    `out` for each face crossed, from row n on, as far as there is room; return the next row. A line ends early where
    rounding in nearly flat faces has made it longer.
    """
    f, left, slides = face, 1.0, 0  # the share still to go, and how often it turned along the boundary since it moved
    w, v = barycentric.copy(), vectors.copy()
    square, rounding = squared_length(g, f, v[0])
    longest = 4.0 * (abs(square) + SQUARE_LENGTH_ROUNDING * rounding)
    for _ in range(1000000):
        largest = max(abs(v[0, 0]), abs(v[0, 1]), abs(v[0, 2]))
        for k in range(3):  # a line that only rounding separates from an edge may cross to its other side midway
            if w[k] < ZERO_COORDINATE and abs(v[0, k]) < ZERO_COORDINATE * largest:  # lines drift by 1e-15 a face
                w[k] = v[0, k] = 0.0
        step, leaving = left, -1
        for k in range(3):
            slope = sign * v[0, k]
            if slope < 0.0 and w[k] < -slope * step:
                step, leaving = w[k] / -slope, k
        if n < len(out.faces):
            out.faces[n] = f
            for k in range(3):
                out.starts[n, k] = w[k]
                for m in range(len(v)):
                    out.vectors[n, m, k] = v[m, k]
        for k in range(3):
            w[k] = max(w[k] + sign * step * v[0, k], 0.0)
        if leaving >= 0:
            w[leaving] = 0.0
        total = w[0] + w[1] + w[2]
        for k in range(3):
            w[k] /= total
            if n < len(out.faces):
                out.ends[n, k] = w[k]
        n += 1
        left -= step
        square, rounding = squared_length(g, f, v[0])
        if leaving < 0 or left < 1e-12 or not square <= longest + SQUARE_LENGTH_ROUNDING * rounding:
            break
        h = 3 * f + (leaving + 1) % 3
        t = g.sibling[h]
        i, j, a = h % 3, following(h) % 3, leaving
        slides = 0 if step > 0.0 else slides
        if t == h or g.sibling[t] != h:  # no single face follows, and only rounding leads out: go along the edge
            top, base = apex(g, h), g.length[g.edge[h]]
            x, y = top.real, top.imag
            # at a smaller angle the line runs along the boundary
            if slides == 2 or y * abs(v[0, a]) > ANGLE_ROUNDING * abs(base * v[0, j] + x * v[0, a]):
                break
            slides += 1
            v[0, i] += v[0, a] * (1.0 - x / base)
            v[0, j] += v[0, a] * x / base
            v[0, a] = 0.0
            continue
        ti, tj = (t % 3, following(t) % 3) if g.forward[h] == g.forward[t] else (following(t) % 3, t % 3)
        tb = 3 - ti - tj
        c_i, c_j, c_a, c_b, _ = diamond(g, h)
        if not c_a > 0.0:
            break
        w_i, w_j = w[i], w[j]
        w[ti], w[tj], w[tb] = w_i, w_j, 0.0
        for k in range(len(v)):
            v_i, v_j, v_a = v[k, i], v[k, j], v[k, a] / c_a
            v[k, ti], v[k, tj], v[k, tb] = v_i + v_a * c_i, v_j + v_a * c_j, -v_a * c_b
        f = t // 3
    return n


@compiled
def trace_both_ways(g: Gluing, faces: Ints, barycentric: Floats, vectors: Floats, out: Lines) -> int:
    """Trace half of the first vector both ways from every point p; rows of the backward half have owner −1 − p."""
    n = 0
    for p in range(len(faces)):
        for owner, sign in ((p, 1.0), (-1 - p, -1.0)):
            begin = n
            n = trace_geodesic(g, faces[p], barycentric[p], vectors[p], sign, out, n)
            out.owners[begin : min(n, len(out.owners))] = owner
    return n
