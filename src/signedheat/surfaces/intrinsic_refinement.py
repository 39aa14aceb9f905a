"""Intrinsic Delaunay refinement: insert vertices until no triangle is thin, and none large next to the others.

Circumcentres of bad triangles are inserted (Chew 1993; on surfaces Sharp, Soliman & Crane 2019). They are located in
the plane of the triangle, into which its neighbours are unfolded one after the other. Where one would lie beyond a
segment (an edge that must not be flipped) or in its diametral circle, the segment is split instead (Ruppert 1995).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arrays import Bools, Complexes, Floats, Ints
from ..compiled import compiled
from ..jobs import report
from ..mesh.gluing import (
    N_EDGES,
    N_FACES,
    N_STEPS,
    N_VERTICES,
    Gluing,
    apex,
    cross,
    doubled,
    faces_around,
    flip_until_delaunay,
    following,
    lay_out,
    preceding,
    push_edge,
    sibling_count,
    split_edge,
    split_face,
    tangent_at,
)

PER_FACE = ("tail", "edge", "forward", "front", "sibling")
PER_EDGE = ("start", "length", "fixed", "flips")
TO_GROW = ("stack", "stacked", "next_face", "listed", "segment", "on_segment", "narrow", "group", "extent")
"""Names of the arrays that grow with the triangulation: of a `Gluing`, per face and per edge, and of an `Agenda`."""


def refine_all(gluing: Gluing, angle: float, coarsest: float, max_vertices: int) -> tuple[Gluing, Ints, Bools, bool]:
    """Refine a Delaunay triangulation, in place, until no face is thin, then none large: see `intrinsic_delaunay`.

    Return the triangulation, the (e,) fixed edges of the input that edges are part of, or −1, the result of
    `close_faces`, and whether refinement ended before the limit on the number of vertices. `angle` is in radians.
    """
    segments, agenda = agenda_of(gluing)
    goal = Goal(np.tan(angle / 2) ** 2, np.inf, max_vertices)
    gluing, agenda, status = refined(gluing, agenda, goal)
    if status == REFINED and coarsest < np.inf:
        mean_radius = float(np.sqrt(4 / 27**0.5 * lay_out(gluing).face_areas.mean())) / gluing.unit
        goal = goal._replace(radius=coarsest * mean_radius)
        gluing, agenda, status = refined(gluing, agenda, goal)
    n_edges = int(gluing.counts[N_EDGES])
    origin = np.full(n_edges, -1)
    fixed = np.flatnonzero(gluing.fixed[:n_edges])
    origin[fixed] = segments[agenda.segment[fixed]]
    return gluing, origin, close_faces(gluing, agenda), status != LIMIT_REACHED


def refined(gluing: Gluing, agenda: Agenda, goal: Goal) -> tuple[Gluing, Agenda, int]:
    """Refine until the goal or the vertex limit is reached; return both arguments, perhaps longer, and why it ended.

    That is one of the results of `refine`.
    """
    list_all(gluing, agenda, goal)
    listed = np.flatnonzero(agenda.bins >= 0)  # the largest faces come first, so the current list shows progress
    done = 0.0
    while True:
        status = refine(gluing, agenda, goal, 5000)  # vertices take some hundredths of a second
        if status == PAUSED:
            done = max(done, float(listed[-1] - agenda.seen[1]) / len(listed))
            report(min(done, 1.0), "refine")
        if status == ARRAYS_FULL:
            grown: dict[str, Any] = {k: doubled(getattr(gluing, k)) for k in (*PER_FACE, *PER_EDGE, "steps", "weights")}
            gluing = gluing._replace(**grown)
            agenda = agenda._replace(**{k: doubled(getattr(agenda, k)) for k in TO_GROW})
        if status not in (PAUSED, ARRAYS_FULL):
            return gluing, agenda, status


def close_faces(gluing: Gluing, agenda: Agenda) -> Bools:
    """(m,) whether the shortest side of each face joins vertices that nearly coincide."""
    n_faces = int(gluing.counts[N_FACES])
    faces = np.arange(n_faces)
    lengths = gluing.length[gluing.edge[: 3 * n_faces]].reshape(-1, 3)
    group = agenda.group[gluing.tail[: 3 * n_faces]].reshape(-1, 3)
    side = lengths.argmin(axis=1)
    tails, heads = group[faces, side], group[faces, (side + 1) % 3]
    return (tails >= 0) & (tails == heads) & (lengths[faces, side] <= agenda.extent[tails])


def agenda_of(gluing: Gluing) -> tuple[Ints, Agenda]:
    """Fix boundary and nonmanifold edges; return the (s,) ids of all fixed edges, and the work lists of refinement."""
    n_faces, n_edges, n_vertices = gluing.counts[:3].tolist()
    counts = np.bincount(gluing.edge[: 3 * n_faces], minlength=n_edges)
    gluing.fixed[:n_edges] |= counts != 2
    start = gluing.start[:n_edges]
    tail, head = gluing.tail[start], gluing.tail[3 * (start // 3) + (start + 1) % 3]
    lengths = gluing.length[:n_edges]
    order = np.argsort(lengths, kind="stable")
    order = order[counts[order] > 0]  # without edges that flips have left without faces
    group, extent = coinciding(tail, head, lengths, order, n_vertices)
    segments = np.flatnonzero(gluing.fixed[:n_edges])
    segment = np.full(n_edges, -1, dtype=np.int64)
    segment[segments] = np.arange(len(segments))
    return segments, Agenda(
        stack=np.empty(n_edges, dtype=np.int64),
        stacked=np.zeros(n_edges, dtype=bool),
        bins=np.full(BAD_FACE_LISTS, -1, dtype=np.int64),
        next_face=np.full(n_faces, -1, dtype=np.int64),
        listed=np.zeros(n_faces, dtype=bool),
        segment=segment,
        segment_ends=np.stack([tail[segments], head[segments]], axis=1),
        segment_length=gluing.length[segments],
        on_segment=np.full(n_vertices, -1, dtype=np.int64),
        narrow=narrow_vertices(gluing),
        group=group,
        extent=extent,
        seen=np.array([gluing.counts[N_STEPS], BAD_FACE_LISTS]),
        seen_sides=np.empty((MOST_VISITED, 2), dtype=np.complex128),
        halfedges=np.empty((MOST_VISITED, 2), dtype=np.int64),
    )


REFINED, ARRAYS_FULL, LIMIT_REACHED, PAUSED = 0, 1, 2, 3
"""Why `refine` returned, in this order: no bad face is left, arrays are full, the vertex limit is reached, or it pauses
so that progress is reported."""
NARROW_ANGLE = np.pi / 3
"""Where segments meet at less than this angle, or a vertex has less in total, small angles cannot be avoided."""
MOST_VISITED = 4096
"""Number of halfedges that `encroached` visits at most, so that slivers do not keep it busy."""
BAD_FACE_LISTS = 256
"""Number of lists of bad faces, by circumradius: two for each power of two."""


class Agenda(NamedTuple):
    """Work lists of refinement, and properties of segments."""

    stack: Ints  # edges to be checked for the Delaunay property
    stacked: Bools  # (e,) whether an edge is on the stack
    bins: Ints  # first bad face of each list; lists are by the binary logarithm of the circumradius
    next_face: Ints  # (m,) the next face in the same bin
    listed: Bools  # (m,) whether a face is in a bin
    segment: Ints  # (e,) the input segment of each fixed edge
    segment_ends: Ints  # (s, 2) vertices
    segment_length: Floats  # (s,)
    on_segment: Ints  # (n,) the segment on which a new vertex was inserted
    narrow: Bools  # (n,) input vertices at which two segments meet at less than 60°, or with a smaller total angle
    group: Ints  # (n,) first vertex of the group with which each nearly coincides, or −1: see `coinciding`
    extent: Floats  # (n,) extents of the groups, at their first vertices
    seen: Ints  # number of steps of the history whose faces have been listed, and the bin that the last face came from
    seen_sides: Complexes  # work array of `encroached`: (k, 2) ends of the halfedges still to be visited
    halfedges: Ints  # work array of `encroached`: (k, 2) these halfedges, and their sides, 1 or −1


class Goal(NamedTuple):
    """When refinement is done."""

    angle: float  # tan²(α/2) of the smallest angle α
    radius: float  # the largest circumradius
    max_vertices: int  # limit on the number of vertices


@compiled
def refine(g: Gluing, agenda: Agenda, goal: Goal, patience: int) -> int:
    """Insert vertices until all faces meet the goal, if possible, or `patience` of them; return why it stopped.

    That is `REFINED`, `ARRAYS_FULL`, `LIMIT_REACHED` or `PAUSED`.
    """
    pause = g.counts[N_VERTICES] + patience
    around, start = np.empty(3, np.int64), np.empty(3, np.int64)
    while flip_until_delaunay(g, agenda.stack, agenda.stacked):
        for n in range(agenda.seen[0], g.counts[N_STEPS]):
            faces_around(g.steps, n, around, start)
            for k in range(3):
                if around[k] >= 0:
                    list_face(g, agenda, around[k], goal)
        agenda.seen[0] = g.counts[N_STEPS]
        f = next_bad(g, agenda, goal)
        if f < 0:
            return REFINED
        if g.counts[N_VERTICES] >= goal.max_vertices:
            return LIMIT_REACHED
        if g.counts[N_VERTICES] >= pause:
            list_face(g, agenda, f, goal)
            return PAUSED
        if not improve(g, agenda, f, goal):
            list_face(g, agenda, f, goal)
            return ARRAYS_FULL
    return ARRAYS_FULL


@compiled
def is_bad(g: Gluing, f: int, goal: Goal) -> tuple[bool, int]:
    """Return whether face f is too thin or too large, and the halfedge of its shortest side, opposite its least angle.

    `goal` says how thin and how large it may be.
    """
    h = 3 * f
    for k in range(1, 3):
        if g.length[g.edge[3 * f + k]] < g.length[g.edge[h]]:
            h = 3 * f + k
    n, d = tangent_at(g, preceding(h))
    return n < goal.angle * d or g.length[g.edge[h]] * (n + d) > 4.0 * goal.radius * np.sqrt(n * d), h


@compiled
def list_face(g: Gluing, agenda: Agenda, f: int, goal: Goal) -> None:
    """Put face f on its list of bad faces, if it is bad and not listed yet."""
    bad, h = is_bad(g, f, goal)
    if agenda.listed[f] or not bad:
        return
    # n/d is tan²(α/2) of the angle α opposite side h; so this is 4 · circumradius, which is |h| / (2 sin α)
    n, d = tangent_at(g, preceding(h))
    size = g.length[g.edge[h]] * (n + d) / np.sqrt(n * d) if n > 0.0 and d > 0.0 else np.inf
    bin_index = min(max(BAD_FACE_LISTS // 2 + int(2.0 * np.log2(min(max(size, 1e-30), 1e30))), 0), BAD_FACE_LISTS - 1)
    agenda.next_face[f] = agenda.bins[bin_index]
    agenda.bins[bin_index] = f
    agenda.listed[f] = True


@compiled
def list_all(g: Gluing, agenda: Agenda, goal: Goal) -> None:
    """Put every bad face on the lists."""
    for f in range(g.counts[N_FACES]):
        list_face(g, agenda, f, goal)


@compiled
def next_bad(g: Gluing, agenda: Agenda, goal: Goal) -> int:
    """Remove a bad face of (nearly) the largest circumradius from the lists and return it; −1 if there is none."""
    for bin_index in range(BAD_FACE_LISTS - 1, -1, -1):
        while agenda.bins[bin_index] >= 0:
            f: int = agenda.bins[bin_index]
            agenda.bins[bin_index] = agenda.next_face[f]
            agenda.listed[f] = False
            agenda.seen[1] = bin_index
            if is_bad(g, f, goal)[0]:
                return f
    return -1


@compiled
def improve(g: Gluing, agenda: Agenda, f: int, goal: Goal) -> bool:
    """Insert a vertex at the circumcentre of bad face f, or on a segment in the way; return False if arrays are full.

    Nothing is inserted if the face cannot be improved, or if its shortest side joins vertices that nearly coincide,
    unless it is a cap with no segment in the way.
    """
    h = is_bad(g, f, goal)[1]
    close = coincide(g, agenda, h)
    if is_hopeless(g, agenda, h) or (close and not is_cap(g, agenda, f)):
        return True
    outcome, reached, center = find_circumcenter(g, f)  # a face, or the halfedge in the way
    if outcome == CENTER_LOST:
        return True
    segment = reached if outcome == CENTER_BLOCKED else encroached(g, agenda, reached, center)
    if segment >= 0:
        return close or coincide(g, agenda, segment) or split_segment(g, agenda, segment, f, goal)
    n, d = tangent_at(g, preceding(h))
    radius = 0.25 * g.length[g.edge[h]] * (n + d) / np.sqrt(n * d)
    if not np.abs(corners_of(g, reached) - center).min() > 0.5 * radius:  # near a corner, as only rounding puts it
        return True
    if not has_room(g, agenda, 2):
        return False
    insert(g, agenda, reached, center)
    return True


@compiled
def corners_of(g: Gluing, f: int) -> Complexes:
    """(3,) corners of face f in its frame: its first halfedge runs from the origin along the positive real axis."""
    corners = np.zeros(3, np.complex128)
    corners[1], corners[2] = g.length[g.edge[3 * f]], apex(g, 3 * f)
    return corners


@compiled
def coincide(g: Gluing, agenda: Agenda, h: int) -> bool:
    """Whether the two ends of halfedge h nearly coincide."""
    group: int = agenda.group[g.tail[h]]
    other: int = agenda.group[g.tail[following(h)]]
    is_short: bool = g.length[g.edge[h]] <= agenda.extent[group]
    return group >= 0 and group == other and is_short


@compiled
def is_cap(g: Gluing, agenda: Agenda, f: int) -> bool:
    """Whether an angle of face f exceeds 150°, and the ends of the opposite side do not nearly coincide."""
    for h in range(3 * f, 3 * f + 3):
        n, d = tangent_at(g, preceding(h))
        if n > 13.9 * d:
            return not coincide(g, agenda, h)
    return False


@compiled
def is_hopeless(g: Gluing, agenda: Agenda, h: int) -> bool:
    """Whether the small angle opposite halfedge h cannot be avoided, as the surface or its segments determine it."""
    corner = preceding(h)
    if agenda.narrow[g.tail[corner]] and sector(g, corner) < NARROW_ANGLE:
        return True
    a, b = agenda.on_segment[g.tail[h]], agenda.on_segment[g.tail[following(h)]]
    if a < 0 or b < 0 or a == b:
        return False
    for k in range(2):
        for l in range(2):
            shared = agenda.segment_ends[a, k]
            if shared == agenda.segment_ends[b, l] and agenda.narrow[shared]:
                return True
    return False


@compiled
def sector(g: Gluing, corner: int) -> float:
    """Angle at the tail of a halfedge between the next segments on either side, or the total angle; or π if larger."""
    n, d = tangent_at(g, corner)
    total: float = 2.0 * np.arctan2(np.sqrt(n), np.sqrt(d))
    for side in range(2):
        c, h = corner, (corner if side == 0 else preceding(corner))
        while not g.fixed[g.edge[h]] and total < np.pi:
            t = g.sibling[h]
            at_tail = (h == c) == (g.forward[t] == g.forward[h])  # is the vertex the tail of t?
            c, h = (t, preceding(t)) if at_tail else (following(t), following(t))
            if c == corner:
                return total
            n, d = tangent_at(g, c)
            total += 2.0 * np.arctan2(np.sqrt(n), np.sqrt(d))
    return total


@compiled
def narrow_vertices(g: Gluing) -> Bools:
    """(n,) which vertices have two segments that meet at less than 60°, or a total angle of less than 60°."""
    narrow = np.zeros(g.counts[N_VERTICES], dtype=np.bool_)
    for corner in range(3 * g.counts[N_FACES]):
        if not narrow[g.tail[corner]]:
            narrow[g.tail[corner]] = sector(g, corner) < NARROW_ANGLE
    return narrow


@compiled
def has_room(g: Gluing, agenda: Agenda, ring: int) -> bool:
    """Whether the arrays have room to split an edge with `ring` faces (splitting a face needs less)."""
    fits: bool = 3 * (g.counts[N_FACES] + ring + 2) <= len(g.tail) and g.counts[N_EDGES] + ring + 4 <= len(g.length)
    return fits and g.counts[N_VERTICES] + 1 <= len(agenda.on_segment) and g.counts[N_STEPS] + ring + 2 <= len(g.steps)


@compiled
def push_edges_of(g: Gluing, agenda: Agenda, step: int) -> None:
    """Push the edges of all faces that steps of the history, from number `step` on, have changed onto the stack."""
    around, start = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(step, g.counts[N_STEPS]):
        faces_around(g.steps, n, around, start)
        for f in around:
            if f >= 0:
                for k in range(3):
                    push_edge(g, agenda.stack, agenda.stacked, g.edge[3 * f + k])


@compiled
def insert(g: Gluing, agenda: Agenda, f: int, p: complex) -> None:
    """Insert a vertex into the triangulation at p, in the frame of face f, or on the edge that p nearly lies on."""
    step = g.counts[N_STEPS]
    corners = corners_of(g, f)
    area = corners[1].real * corners[2].imag
    nearest = np.abs(corners - p).min()
    weights = np.empty(3)
    on_edge, fraction = -1, 0.0
    for k in range(3):
        tail, head = corners[k], corners[(k + 1) % 3]
        edge = g.edge[3 * f + k]
        length = g.length[edge]
        above = cross(head - tail, p - tail)
        weights[(k + 2) % 3] = max(above / area, 0.0)
        t = g.sibling[3 * f + k]
        if above / length < min(0.01 * length, 0.25 * nearest) and t // 3 != f and not g.fixed[edge]:
            on_edge = k
            fraction = ((p - tail).conjugate() * (head - tail)).real / length**2
    if on_edge >= 0 and 0.0 < fraction < 1.0:
        split_edge(g, 3 * f + on_edge, fraction)
    else:
        weights /= weights.sum()
        split_face(g, f, weights[0], weights[1], weights[2])
    new = g.counts[N_VERTICES] - 1
    agenda.on_segment[new] = agenda.group[new] = -1
    agenda.narrow[new] = False
    push_edges_of(g, agenda, step)


@compiled
def folded_face(g: Gluing, h: int) -> int:
    """Return a face two of whose sides are the edge of halfedge h, which `split_edge` cannot split; −1 if none is."""
    y = h
    while True:
        if g.edge[following(y)] == g.edge[h] or g.edge[preceding(y)] == g.edge[h]:
            return y // 3
        y = g.sibling[y]
        if y == h:
            return -1


@compiled
def vertex_near_edge(g: Gluing, h: int) -> tuple[int, float, float]:
    """Find a vertex opposite the edge of halfedge h that nearly lies on it; return it, its height, and where along h.

    If there is none, −1, ∞ and ½ are returned.
    """
    nearby, height, fraction, length, y = -1, np.inf, 0.5, g.length[g.edge[h]], h
    while True:
        top = apex(g, y)
        along = top.real / length if g.forward[y] == g.forward[h] else 1.0 - top.real / length
        if top.imag < min(height, NEAR_GROUP * length * min(along, 1.0 - along)):
            nearby, height, fraction = g.tail[preceding(y)], top.imag, along
        y = g.sibling[y]
        if y == h:
            return nearby, height, fraction


@compiled
def distance_to_opposite(g: Gluing, h: int, fraction: float) -> float:
    """Distance of the nearest vertex opposite the edge of halfedge h from the point at `fraction` along h."""
    nearest: float = np.inf
    length, y = g.length[g.edge[h]], h
    while True:
        share = fraction if g.forward[y] == g.forward[h] else 1.0 - fraction
        nearest = min(nearest, abs(apex(g, y) - share * length))
        y = g.sibling[y]
        if y == h:
            return nearest


@compiled
def split_segment(g: Gluing, agenda: Agenda, h: int, f: int, goal: Goal) -> bool:
    """Split the segment of halfedge h, so that face f can be improved; return False if the arrays have no room for it.

    It is split in the middle, or beside a vertex that nearly lies on it. If segments meet at a small angle at one end,
    it is split at a power of two from that end (Ruppert 1995). A face with two sides on the segment is split instead.
    """
    e = g.edge[h]
    segment, length, step = agenda.segment[e], g.length[e], g.counts[N_STEPS]
    if length < 1e-9 * agenda.segment_length[segment]:
        return True
    ring = sibling_count(g, h)
    if not has_room(g, agenda, ring):
        return False
    folded = folded_face(g, h)
    if folded >= 0:
        new = split_face(g, folded, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)
        agenda.on_segment[new] = agenda.group[new] = -1
    else:
        nearby, height, fraction = vertex_near_edge(g, h)
        at_tail, at_head = agenda.narrow[g.tail[h]], agenda.narrow[g.tail[following(h)]]
        if nearby < 0 and at_tail != at_head:
            shell = 2.0 ** np.round(np.log2(0.5 * length)) / length
            fraction = shell if at_tail else 1.0 - shell
        if not distance_to_opposite(g, h, fraction) > 1e-13 * length:
            return True
        new = split_edge(g, h, fraction)
        agenda.on_segment[new], agenda.group[new] = segment, -1
        if nearby >= 0:
            if agenda.group[nearby] < 0:
                agenda.group[nearby], agenda.extent[nearby] = nearby, 0.0
            agenda.group[new] = agenda.group[nearby]
            agenda.extent[agenda.group[new]] += 1.01 * height
        for k in range(g.counts[N_EDGES] - 1 - ring, g.counts[N_EDGES]):
            agenda.segment[k] = segment
    agenda.narrow[new] = False
    push_edges_of(g, agenda, step)
    list_face(g, agenda, f, goal)
    return True


CENTER_INSIDE, CENTER_BLOCKED, CENTER_LOST = 0, 1, 2
"""Outcomes of `find_circumcenter`: it lies in the face reached, beyond a segment, or cannot be found."""


@compiled
def unfold(g: Gluing, h: int, side: int, tail: complex, head: complex) -> tuple[complex, int]:
    """Unfold the face beyond halfedge h, whose ends are at `tail` and `head`, into the plane.

    Return its apex, and 1 if its corners are then counter-clockwise, else −1. `side` is the same for the face of h.
    """
    t = g.sibling[h]
    if g.forward[t] == g.forward[h]:
        side = -side
    else:
        tail, head = head, tail
    top, unit = apex(g, t), (head - tail) / g.length[g.edge[t]]
    x, y = top.real, side * top.imag
    place = complex(tail.real + x * unit.real - y * unit.imag, tail.imag + x * unit.imag + y * unit.real)
    return place, side


@compiled
def find_circumcenter(g: Gluing, f: int) -> tuple[int, int, complex]:
    """Walk from the barycentre of face f to its circumcentre; return the outcome, and the face or halfedge reached.

    Also return the position of the circumcentre in the frame of the face reached, or 0.
    """
    corners = corners_of(g, f)
    base, x, y = corners[1].real, corners[2].real, corners[2].imag
    if not y > 0.0:
        return CENTER_LOST, f, 0j
    center = complex(0.5 * base, 0.5 * (x * (x - base) / y + y))
    if not np.isfinite(center.imag):
        return CENTER_LOST, f, 0j
    start = corners.sum() / 3.0
    side, entry = 1, -1
    for _ in range(100000):
        leaving, worst, outside = -1, 0.0, 0.0
        area = cross(corners[1] - corners[0], corners[2] - corners[0])
        for k in range(3):
            tail, head = corners[k], corners[(k + 1) % 3]
            beyond = -cross(head - tail, center - tail) / area
            left, right = cross(center - start, tail - start), cross(center - start, head - start)
            outside = max(outside, beyond)
            if k != entry and beyond > worst and left * right <= 0.0:
                leaving, worst = k, beyond
        if leaving < 0 and not outside < 1e-9:
            return CENTER_LOST, f, 0j
        if leaving < 0:
            break
        h = 3 * f + leaving
        if g.fixed[g.edge[h]]:
            return CENTER_BLOCKED, h, 0j
        t, tail, head = g.sibling[h], corners[leaving], corners[(leaving + 1) % 3]
        top, turned = unfold(g, h, side, tail, head)
        if turned == side:
            tail, head = head, tail
        f, side, entry = t // 3, turned, t % 3
        corners[entry], corners[(entry + 1) % 3], corners[(entry + 2) % 3] = tail, head, top
    unit = (corners[1] - corners[0]) / g.length[g.edge[3 * f]]
    place = (center - corners[0]) * unit.conjugate()
    return CENTER_INSIDE, f, complex(place.real, side * place.imag)


@compiled
def encroached(g: Gluing, agenda: Agenda, f: int, p: complex) -> int:
    """Return a halfedge of a segment whose diametral circle contains p; −1 if no such segment is visible from p.

    p is in the frame of face f.
    """
    ends, halfedges = agenda.seen_sides, agenda.halfedges
    corners = corners_of(g, f)
    for k in range(3):
        halfedges[k, 0], halfedges[k, 1] = 3 * f + k, 1
        ends[k, 0], ends[k, 1] = corners[k], corners[(k + 1) % 3]
    count, visited = 3, 0
    while count > 0:
        count -= 1
        h: int = halfedges[count, 0]
        side: int = halfedges[count, 1]
        tail, head = ends[count, 0], ends[count, 1]
        dot = ((tail - p).conjugate() * (head - p)).real
        if g.fixed[g.edge[h]]:
            if dot < 0.0:
                return h
            continue
        t = g.sibling[h]
        n, d = tangent_at(g, preceding(t))
        in_circle = dot * 2.0 * np.sqrt(n * d) + (d - n) * abs(cross(tail - p, head - p)) < 0.0
        visited += 1
        if not in_circle or count + 2 > len(ends) or visited > len(ends):
            continue
        top, turned = unfold(g, h, side, tail, head)
        if turned == side:
            tail, head = head, tail
        halfedges[count, 0], halfedges[count + 1, 0] = following(t), preceding(t)
        halfedges[count, 1] = halfedges[count + 1, 1] = turned
        ends[count, 0], ends[count, 1], ends[count + 1, 0], ends[count + 1, 1] = head, top, top, tail
        count += 2
    return -1


NEAR_GROUP = 0.01
"""Vertices of a group nearly coincide if the size of the group is less than this fraction of the distance to others."""


@compiled
def root(parent: Ints, a: int) -> int:
    """Return the representative of the group of vertex a (union–find with path halving)."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@compiled
def coinciding(tail: Ints, head: Ints, length: Floats, order: Ints, n_vertices: int) -> tuple[Ints, Floats]:
    """Group vertices that nearly coincide: (n,) first vertices of their groups, or −1, and (n,) extents at these.

    Edges have (e,) tails, heads and lengths. Vertices are joined along edges in the given `order`, from short to long
    (Kruskal). A group is kept if its extent, the sum of the lengths that made it, is less than `NEAR_GROUP` times the
    next edge that leaves it. Of nested groups only the largest is kept.
    """
    parent, node = np.arange(n_vertices), np.arange(n_vertices)
    first, second = np.full(2 * n_vertices, -1), np.full(2 * n_vertices, -1)
    extent, leaving = np.zeros(2 * n_vertices), np.full(2 * n_vertices, np.inf)
    count = n_vertices
    for e in order:
        a, b = root(parent, tail[e]), root(parent, head[e])
        if a == b:
            continue
        left, right = node[a], node[b]
        first[count], second[count] = left, right
        extent[count] = extent[left] + extent[right] + length[e]
        leaving[left] = leaving[right] = length[e]
        parent[b] = a
        node[a] = count
        count += 1
    inside, group, size = np.full(count, -1), np.full(n_vertices, -1), np.zeros(n_vertices)
    for joined in range(count - 1, n_vertices - 1, -1):
        if inside[joined] < 0 and leaving[joined] < np.inf and extent[joined] < NEAR_GROUP * leaving[joined]:
            inside[joined] = joined
        inside[first[joined]] = inside[second[joined]] = inside[joined]
    name = np.full(count, -1)
    for vertex in range(n_vertices):
        if inside[vertex] >= 0:
            if name[inside[vertex]] < 0:
                name[inside[vertex]] = vertex
            group[vertex] = name[inside[vertex]]
            size[group[vertex]] = extent[inside[vertex]]
    return group, size
