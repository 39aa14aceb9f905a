"""Intrinsic triangulations, given by the gluing of triangles and by edge lengths, and their edge flips to Delaunay.

Halfedge ``3 f + k`` runs from corner k to corner k + 1 of face f. Two halfedges of one edge may lie in one face, and
two edges may join the same two vertices, so nothing here is looked up by vertex ids.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, Number
from ..compiled import compiled
from .components import next_in_groups
from .edges import EdgeTable
from .intrinsic_mesh import IntrinsicMesh

FLIP_STEP, TURN_STEP, SPLIT_FACE, SPLIT_EDGE = 0, 1, 2, 3
"""Kinds of steps in the history of a triangulation: an edge is flipped, a face is reversed, and a vertex is inserted in
a face or on an edge."""
N_FACES, N_EDGES, N_VERTICES, N_STEPS, N_STACKED = range(5)
"""Indices in `Gluing.counts` of the numbers of faces, edges, vertices, steps of the history, and edges on the stack."""
MOST_FLIPS = 1000
"""Number of flips of an edge after which it is not flipped any more, since rounding makes it flip back and forth."""


class Gluing(NamedTuple):
    """An intrinsic triangulation under construction; arrays are longer than the part that is in use."""

    # (3 m,) tail vertex and edge of every halfedge
    tail: Ints
    edge: Ints
    forward: Bools  # (3 m,) whether the halfedge runs in the direction of its edge
    # (3 m,) on which of the two sides of its edge the halfedge is. It changes only when the edge is flipped, so that
    # the two sides of a source are kept apart
    front: Bools
    sibling: Ints  # (3 m,) next halfedge of the same edge, cyclically; the halfedge itself at a boundary
    start: Ints  # (e,) one halfedge of every edge
    length: Floats  # (e,) length of every edge, in multiples of `unit`
    fixed: Bools  # (e,) edges that must not be flipped
    flips: Ints  # (e,) how often each edge has been flipped
    counts: Ints  # (5,) numbers of faces and other elements, in the order of `N_FACES` and the following
    steps: Ints  # (s, 4) the history: kind of each step, two halfedges or faces, and the new vertex
    weights: Floats  # (s, 4) coefficients of the affine dependency of the points of each step
    scratch: Ints  # (4, 4) work array of `move`
    unit: float  # unit of length


@compiled
def following(h: int) -> int:
    """Return the next halfedge after h around its face."""
    return h + 1 if h % 3 < 2 else h - 2


@compiled
def preceding(h: int) -> int:
    """Return the previous halfedge before h around its face."""
    return h - 1 if h % 3 else h + 2


@compiled
def half_tangent(a: float, b: float, c: float) -> tuple[float, float]:
    """Return numerator and denominator of tan²(α/2) for the angle α opposite side a of a triangle (Kahan).

    Their product is 16 times the square of the area.
    """
    if b < c:
        b, c = c, b
    difference = a - b
    numerator = (a + (b - c)) * max(c + difference, 0.0)
    denominator = (a + (b + c)) * max(c - difference, 0.0)
    return numerator, denominator


@compiled
def tangent_at(g: Gluing, h: int) -> tuple[float, float]:
    """Return the `half_tangent` of the angle at the tail of halfedge h."""
    n = following(h)
    return half_tangent(g.length[g.edge[n]], g.length[g.edge[h]], g.length[g.edge[preceding(h)]])


@compiled
def move(g: Gluing, old: tuple[int, ...], new: tuple[int, ...]) -> None:
    """Renumber halfedges old[k] to new[k], all at once, with edges and siblings; tails are not moved."""
    # read what is moved, since old and new numbers overlap; −1 for siblings before that are moved themselves
    successors, predecessors, edges, flags = g.scratch[0], g.scratch[1], g.scratch[2], g.scratch[3]
    for k in range(len(old)):
        after = g.sibling[old[k]]
        before = after
        while g.sibling[before] != old[k]:
            before = g.sibling[before]
        for l in range(len(old)):
            if before == old[l]:
                before = -1
        for l in range(len(old)):
            if after == old[l]:
                after = new[l]
                break
        successors[k], predecessors[k], edges[k] = after, before, g.edge[old[k]]
        flags[k] = 2 * g.forward[old[k]] + g.front[old[k]]
    for k in range(len(old)):
        h = new[k]
        g.sibling[h], g.edge[h], g.forward[h], g.front[h] = successors[k], edges[k], flags[k] >= 2, flags[k] % 2 == 1
        g.start[edges[k]] = h
        if predecessors[k] >= 0:
            g.sibling[predecessors[k]] = h


@compiled
def record(g: Gluing, kind: int, first: int, second: int, vertex: int, a: float, b: float, c: float, d: float) -> None:
    """Append a step to the history, with its kind, two halfedges or faces, the new vertex, and four weights."""
    n = g.counts[N_STEPS]
    g.steps[n, 0], g.steps[n, 1], g.steps[n, 2], g.steps[n, 3] = kind, first, second, vertex
    g.weights[n, 0], g.weights[n, 1], g.weights[n, 2], g.weights[n, 3] = a, b, c, d
    g.counts[N_STEPS] = n + 1


@compiled
def faces_around(steps: Ints, n: int, around: Ints, start: Ints) -> None:
    """Write the up to three faces that step n changes or makes to `around`, −1 in place of missing ones.

    Also write the corner of each face at which the points of the step begin to `start`. `steps` are those of `Gluing`.
    The first face is given by a halfedge if the step flips or splits an edge, and the second if it flips one. A face
    that is split gives two new ones in succession.
    """
    kind = steps[n, 0]
    around[0], around[1], around[2] = steps[n, 1], steps[n, 2], steps[n, 2] + 1
    start[0] = start[1] = start[2] = 0
    if kind == TURN_STEP:
        around[1] = around[2] = -1
    elif kind != SPLIT_FACE:
        around[0], start[0], around[2] = steps[n, 1] // 3, steps[n, 1] % 3, -1
    if kind == FLIP_STEP:
        around[1], start[1] = steps[n, 2] // 3, steps[n, 2] % 3


@compiled
def turn_over(g: Gluing, face: int) -> None:
    """Reverse the orientation of a face, so that corners (0, 1, 2) become (0, 2, 1)."""
    h = 3 * face
    move(g, (h, h + 2), (h + 2, h))
    g.tail[h + 1], g.tail[h + 2] = g.tail[h + 2], g.tail[h + 1]
    for k in range(3):
        g.forward[h + k] = not g.forward[h + k]
    record(g, TURN_STEP, face, -1, -1, 0.0, 0.0, 0.0, 0.0)


@compiled
def diamond(g: Gluing, h: int) -> tuple[float, float, float, float, float]:
    """Unfold the two faces at an edge into one plane: that of ``h: i → j`` with apex a, that of its twin with apex b.

    Returns the areas of triangles jab, iab, of the twin's face and of the face of h, and the length |ab|. The areas
    are weights with area_jab·i + area_iab·j = area_twin·a + area_h·b. The first two are signed: one is negative or 0 if
    the two faces are no strictly convex quadrilateral. All are 0 if a face is degenerate.
    """
    t = g.sibling[h]
    # the twin runs j → i, or as h does if its face has the opposite orientation; at i and at j, these leave in its face
    mirrored = g.forward[h] == g.forward[t]
    at_i, at_j = (t, following(t)) if mirrored else (following(t), t)
    ai, ja = g.length[g.edge[preceding(h)]], g.length[g.edge[following(h)]]
    ib, bj = g.length[g.edge[preceding(t)]], g.length[g.edge[following(t)]]
    if not mirrored:
        ib, bj = bj, ib
    # tan²(α/2) = n / d of both angles at i, and m / e of those at j
    n1, d1 = tangent_at(g, h)
    n2, d2 = tangent_at(g, at_i)
    m1, e1 = tangent_at(g, following(h))
    m2, e2 = tangent_at(g, at_j)
    norm, norm_j = (n1 + d1) * (n2 + d2), (m1 + e1) * (m2 + e2)
    if not (norm > 0.0 and norm_j > 0.0):
        return 0.0, 0.0, 0.0, 0.0, 0.0
    # sine and cosine of half the whole angle at i and at j, times √norm; then |ab| by the law of cosines
    sine, cosine = np.sqrt(n1 * d2) + np.sqrt(n2 * d1), np.sqrt(d1 * d2) - np.sqrt(n1 * n2)
    sine_j, cosine_j = np.sqrt(m1 * e2) + np.sqrt(m2 * e1), np.sqrt(e1 * e2) - np.sqrt(m1 * m2)
    length = np.sqrt((ai - ib) ** 2 + 4.0 * ai * ib * sine * sine / norm)
    area_iab, area_jab = ai * ib * sine * cosine / norm, ja * bj * sine_j * cosine_j / norm_j
    return area_jab, area_iab, 0.25 * np.sqrt(n2 * d2), 0.25 * np.sqrt(n1 * d1), length


@compiled
def flip(g: Gluing, h: int) -> bool:
    """Flip the edge of h, so that h runs from apex b to apex a.

    Returns False, without a flip, unless the two faces form a strictly convex quadrilateral.
    """
    t = g.sibling[h]
    if g.forward[h] == g.forward[t]:
        turn_over(g, t // 3)
        t = g.sibling[h]
    h1, h2, t1, t2 = following(h), preceding(h), following(t), preceding(t)
    area_jab, area_iab, area_g, area_f, length = diamond(g, h)
    if not (length > 0.0 and area_iab > 0.0 and area_jab > 0.0):
        return False
    record(g, FLIP_STEP, h, t, -1, area_jab, area_iab, area_g, area_f)
    i, j, a, b = g.tail[h], g.tail[t], g.tail[h2], g.tail[t2]
    move(g, (h1, h2, t1, t2), (t2, h1, h2, t1))
    g.tail[h], g.tail[h1], g.tail[h2] = b, a, i
    g.tail[t], g.tail[t1], g.tail[t2] = a, b, j
    g.length[g.edge[h]] = length
    g.forward[h], g.forward[t] = True, False
    g.front[h], g.front[t] = True, False  # it is a different edge now
    return True


@compiled
def flip_until_delaunay(g: Gluing, stack: Ints, stacked: Bools) -> bool:
    """Flip edges on the stack until all edges that are not fixed are Delaunay; return False if the history is full.

    `stacked`, (e,), says which edges are on the stack.
    """
    while g.counts[N_STACKED] > 0:
        if g.counts[N_STEPS] + 2 > len(g.steps):
            return False
        g.counts[N_STACKED] -= 1
        e = stack[g.counts[N_STACKED]]
        stacked[e] = False
        h = g.start[e]
        t = g.sibling[h]
        if g.fixed[e] or g.flips[e] >= MOST_FLIPS or t == h or g.sibling[t] != h or t // 3 == h // 3:
            continue
        # Delaunay: the opposite angles sum to π at most, so that the product of their tan²(α/2) is at most 1
        n, d = tangent_at(g, preceding(h))
        m, c = tangent_at(g, preceding(t))
        if not n * m > d * c * (1.0 + 1e-10) or not flip(g, h):
            continue
        g.flips[e] += 1
        t = g.sibling[h]
        for side in (following(h), preceding(h), following(t), preceding(t)):
            push_edge(g, stack, stacked, g.edge[side])
    return True


@compiled
def push_edge(g: Gluing, stack: Ints, stacked: Bools, e: int) -> None:
    """Push an edge on the stack of edges that may have to be flipped, unless it is there already."""
    if not stacked[e]:
        stack[g.counts[N_STACKED]] = e
        stacked[e] = True
        g.counts[N_STACKED] += 1


@compiled
def new_edge(g: Gluing, length: float, fixed: bool) -> int:
    """Add an edge of a length, which is never flipped if it is `fixed`; return its id."""
    e: int = g.counts[N_EDGES]
    g.counts[N_EDGES] = e + 1
    g.length[e], g.fixed[e], g.flips[e] = length, fixed, 0
    return e


@compiled
def apex(g: Gluing, h: int) -> complex:
    """Return the third corner of the face of h, laid out with h on the positive real axis, its tail at the origin."""
    base, right, left = g.length[g.edge[h]], g.length[g.edge[following(h)]], g.length[g.edge[preceding(h)]]
    n, d = half_tangent(right, base, left)
    return complex(0.5 * (base + (left - right) * (left + right) / base), 0.5 * np.sqrt(n * d) / base)


@compiled
def cross(a: complex, b: complex) -> float:
    """Return the cross product of plane vectors, which is positive where b is counter-clockwise of a."""
    return a.real * b.imag - a.imag * b.real


@compiled
def split_face(g: Gluing, f: int, u: float, v: float, w: float) -> int:
    """Insert a vertex x with barycentric coordinates (u, v, w) into face f, and return its id.

    Face (a, b, c) becomes (a, b, x), and (b, c, x) and (c, a, x) are new.
    """
    h = 3 * f
    n: int = g.counts[N_FACES]
    x: int = g.counts[N_VERTICES]
    a, b, c = g.tail[h], g.tail[h + 1], g.tail[h + 2]
    base = g.length[g.edge[h]]
    # x in the plane of the face, in which a is at the origin, b at `base`, and c at `top`
    top = apex(g, h)
    position = v * base + w * top
    record(g, SPLIT_FACE, f, n, x, u, v, w, 1.0)
    to_a, to_b, to_c = (
        new_edge(g, abs(position), False),
        new_edge(g, abs(position - base), False),
        new_edge(g, abs(position - top), False),
    )
    g.counts[N_VERTICES], g.counts[N_FACES] = x + 1, n + 2
    # halfedges h: a → b, k: b → c and l: c → a begin the three faces
    k, l = 3 * n, 3 * n + 3
    move(g, (h + 1, h + 2), (k, l))
    g.tail[k], g.tail[l] = b, c
    pair(g, h + 2, x, l + 1, a, to_a)
    pair(g, k + 2, x, h + 1, b, to_b)
    pair(g, l + 2, x, k + 1, c, to_c)
    return x


@compiled
def split_edge(g: Gluing, h: int, fraction: float) -> int:
    """Insert a vertex x on the edge of h, at a `fraction` of the length from the tail of h, and return its id.

    Each face (tail, head, apex) at the edge becomes (tail, x, apex), and (x, head, apex) is new. No face may have the
    edge twice.
    """
    # all halfedges of the edge, and later those of its second half
    count = sibling_count(g, h)
    around, seconds = np.empty(count, np.int64), np.empty(count, np.int64)
    y = h
    for k in range(count):
        around[k] = y
        y = g.sibling[y]
    e: int = g.edge[h]
    x: int = g.counts[N_VERTICES]
    g.counts[N_VERTICES] = x + 1
    along = fraction if g.forward[h] else 1.0 - fraction
    whole = g.length[e]
    far_edge = new_edge(g, (1.0 - along) * whole, g.fixed[e])
    for k in range(count):  # cut each face from x to its apex
        y, n = around[k], g.counts[N_FACES]
        g.counts[N_FACES] = n + 1
        share = along if g.forward[y] else 1.0 - along
        record(g, SPLIT_EDGE, y, n, x, 1.0 - share, share, 0.0, 1.0)
        cut = new_edge(g, abs(apex(g, y) - share * whole), False)
        second, first = 3 * n, following(y)
        head, opposite = g.tail[first], g.tail[preceding(y)]
        move(g, (first,), (second + 1,))
        g.tail[second], g.tail[second + 1] = x, head
        g.forward[second], g.front[second] = g.forward[y], g.front[y]
        pair(g, first, x, second + 2, opposite, cut)
        seconds[k] = second
    # the half at the tail of the edge keeps its id
    g.length[e] = along * whole
    for k in range(count):
        l = (k + 1) % count
        near, far = (around[k], seconds[k]) if g.forward[around[k]] else (seconds[k], around[k])
        next_near, next_far = (around[l], seconds[l]) if g.forward[around[l]] else (seconds[l], around[l])
        g.edge[near], g.edge[far] = e, far_edge
        g.start[e], g.start[far_edge] = near, far
        g.sibling[near], g.sibling[far] = next_near, next_far
    return x


@compiled
def sibling_count(g: Gluing, h: int) -> int:
    """Return the number of halfedges of the edge of h."""
    count, y = 1, g.sibling[h]
    while y != h:
        count += 1
        y = g.sibling[y]
    return count


@compiled
def pair(g: Gluing, h: int, tail: int, t: int, head: int, e: int) -> None:
    """Make e the edge of halfedges h and t, which run in opposite directions from vertices `tail` and `head`."""
    g.tail[h], g.edge[h], g.forward[h], g.front[h], g.sibling[h] = tail, e, True, True, t
    g.tail[t], g.edge[t], g.forward[t], g.front[t], g.sibling[t] = head, e, False, False, h
    g.start[e] = h


def glue(triangles: IntrinsicMesh, fixed_edges: Bools | None = None) -> Gluing:
    """Copy an intrinsic mesh to a `Gluing` without history; edges with true `fixed_edges`, (e,), are never flipped."""
    edges, first = triangles.edges, triangles.first_halfedges
    edge, n_edges = edges.face_edges.ravel(), triangles.n_edges
    starts, order = edges.halfedges
    sibling = np.empty_like(edge)
    sibling[order] = order[next_in_groups(starts)]
    start, front = np.zeros(n_edges, dtype=np.int64), np.zeros(len(edge), dtype=bool)
    start[edge[first]], front[first] = first, True
    sums = np.bincount(edge, weights=triangles.edge_lengths.ravel(), minlength=n_edges)
    lengths = sums / np.maximum(edges.face_counts, 1)
    unit = float(lengths.mean()) or 1.0  # comparisons with powers of two do not depend on scale
    fixed = np.zeros(n_edges, dtype=bool) if fixed_edges is None else np.array(fixed_edges, dtype=bool)
    return Gluing(
        tail=triangles.corner_vertices.ravel().copy(),
        edge=edge.copy(),
        forward=edges.forward.ravel().copy(),
        front=front,
        sibling=sibling,
        start=start,
        length=lengths / unit,
        fixed=fixed,
        flips=np.zeros(n_edges, dtype=np.int64),
        counts=np.array([triangles.n_faces, n_edges, triangles.n_vertices, 0, 0]),
        steps=np.empty((2 * n_edges + 64, 4), dtype=np.int64),
        weights=np.empty((2 * n_edges + 64, 4)),
        scratch=np.empty((4, 4), dtype=np.int64),
        unit=unit,
    )


def flip_all(gluing: Gluing) -> Gluing:
    """Flip edges in place until all that are not fixed are Delaunay; return the gluing, with more room for history."""
    n_edges = int(gluing.counts[N_EDGES])
    gluing.counts[N_STACKED] = n_edges
    stack, stacked = np.arange(n_edges)[::-1].copy(), np.ones(n_edges, dtype=bool)
    while not flip_until_delaunay(gluing, stack, stacked):
        gluing = gluing._replace(steps=doubled(gluing.steps), weights=doubled(gluing.weights))
    return gluing


def lay_out(gluing: Gluing) -> IntrinsicMesh:
    """Return the current triangulation as an intrinsic mesh; edges keep their ids and their frames."""
    n_faces, n_edges, n_vertices = gluing.counts[:3].tolist()
    corners, edge = gluing.tail[: 3 * n_faces].reshape(-1, 3).copy(), gluing.edge[: 3 * n_faces].copy()
    front, heads = np.flatnonzero(gluing.front[: 3 * n_faces]), np.roll(corners, -1, axis=1).ravel()
    leading = np.full(n_edges, -1)
    leading[edge[front]] = front
    ends = np.stack([corners.ravel()[leading], heads[leading]])
    vertices = np.where(gluing.forward[leading], ends, ends[::-1]).T
    table = EdgeTable(vertices, edge.reshape(-1, 3), gluing.forward[: 3 * n_faces].reshape(-1, 3).copy())
    mesh = IntrinsicMesh.from_lengths(corners, gluing.length[table.face_edges] * gluing.unit, n_vertices, table)
    return replace(mesh, leading_sides=leading[leading >= 0])


def doubled(array: NDArray[Number]) -> NDArray[Number]:
    """Return an array of twice as many rows, with zeros appended."""
    return np.concatenate([array, np.zeros_like(array)])
