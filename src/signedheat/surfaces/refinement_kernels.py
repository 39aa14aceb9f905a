"""Kernels of intrinsic Delaunay refinement: find thin and large triangles and insert vertices that remove them.

Circumcentres are inserted (Chew 1993; on surfaces Sharp, Soliman & Crane 2019); where one would lie beyond a segment
(an edge that must not be flipped) or in a segment's diametral circle, the segment is split instead (Ruppert 1995).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mesh.gluing_kernels import (
    Gluing,
    apex_position,
    faces_around,
    flip_until_delaunay,
    following,
    kernel,
    look_at,
    preceding,
    sibling_count,
    split_edge,
    split_face,
    tangent_at,
)
from .circumcenter_kernels import BLOCKED, LOST, cross, encroached, find_circumcenter
from .coincidence_kernels import NEARNESS

DONE, GROW, FULL, PAUSED = 0, 1, 2, 3
"""Why `refine` returned: no bad face is left; arrays are full; vertex limit reached; pause to report progress."""
NARROW = np.pi / 3
"""Where segments meet at less than this, or a vertex has a smaller total angle, small angles cannot be avoided."""
N_BINS = 256


class Agenda(NamedTuple):
    """Work lists of refinement, and what it needs to know of segments.

    `stack` and `stacked` are the edges to be checked for the Delaunay property. `bins` and `next_face` are linked lists
    of bad faces, by the binary logarithm of their circumradius; `listed` marks the faces that are in one. `segment` is
    the input segment of each fixed edge, `segment_ends` and `segment_length` describe the segments, and `on_segment` is
    the segment on which a new vertex was inserted. `narrow` marks input vertices at which two segments meet at less
    than 60°, or with a smaller total angle. `group` and `extent` describe the vertices that nearly coincide, as
    returned by `coinciding`. `seen` counts the steps of the history whose faces have been listed, and holds the list
    that the last face came from; `room` and `halfedges` are work arrays for the search around a new vertex.
    """

    stack: NDArray[np.int64]
    stacked: NDArray[np.bool_]
    bins: NDArray[np.int64]
    next_face: NDArray[np.int64]
    listed: NDArray[np.bool_]
    segment: NDArray[np.int64]
    segment_ends: NDArray[np.int64]
    segment_length: NDArray[np.float64]
    on_segment: NDArray[np.int64]
    narrow: NDArray[np.bool_]
    group: NDArray[np.int64]
    extent: NDArray[np.float64]
    seen: NDArray[np.int64]
    room: NDArray[np.float64]
    halfedges: NDArray[np.int64]


class Goal(NamedTuple):
    """When refinement is done: tan²(α/2) of the smallest angle α, largest circumradius, and limit on the vertices."""

    angle: float
    radius: float
    max_vertices: int


@kernel
def refine(g: Gluing, agenda: Agenda, goal: Goal, patience: int) -> int:
    """Insert vertices until every face meets the goal, where possible; pause after `patience` of them."""
    pause = g.counts[2] + patience
    around, start = np.empty(3, np.int64), np.empty(3, np.int64)
    while flip_until_delaunay(g, agenda.stack, agenda.stacked):
        for n in range(agenda.seen[0], g.counts[3]):
            faces_around(g.steps, n, around, start)
            for k in range(3):
                if around[k] >= 0:
                    list_face(g, agenda, around[k], goal)
        agenda.seen[0] = g.counts[3]
        f = next_bad(g, agenda, goal)
        if f < 0:
            return DONE
        if g.counts[2] >= goal.max_vertices:
            return FULL
        if g.counts[2] >= pause:
            list_face(g, agenda, f, goal)
            return PAUSED
        if not improve(g, agenda, f, goal):
            list_face(g, agenda, f, goal)
            return GROW
    return GROW


@kernel
def is_bad(g: Gluing, f: int, goal: Goal) -> tuple[bool, int]:
    """Whether a face is too thin (its smallest angle is opposite to its shortest side) or too large; and that side."""
    h = 3 * f
    for k in range(1, 3):
        if g.length[g.edge[3 * f + k]] < g.length[g.edge[h]]:
            h = 3 * f + k
    n, d = tangent_at(g, preceding(h))
    return n < goal.angle * d or g.length[g.edge[h]] * (n + d) > 4.0 * goal.radius * np.sqrt(n * d), h


@kernel
def list_face(g: Gluing, agenda: Agenda, f: int, goal: Goal) -> None:
    """Put a face on the lists, if it is bad."""
    bad, h = is_bad(g, f, goal)
    if agenda.listed[f] or not bad:
        return
    n, d = tangent_at(g, preceding(h))
    radius = g.length[g.edge[h]] * (n + d) / np.sqrt(n * d) if n > 0.0 and d > 0.0 else np.inf
    place = min(max(N_BINS // 2 + int(2.0 * np.log2(min(max(radius, 1e-30), 1e30))), 0), N_BINS - 1)
    agenda.next_face[f] = agenda.bins[place]
    agenda.bins[place] = f
    agenda.listed[f] = True


@kernel
def list_all(g: Gluing, agenda: Agenda, goal: Goal) -> None:
    """Put every bad face on the lists."""
    for f in range(g.counts[0]):
        list_face(g, agenda, f, goal)


@kernel
def next_bad(g: Gluing, agenda: Agenda, goal: Goal) -> int:
    """The bad face of (nearly) the largest circumradius, or −1."""
    for place in range(N_BINS - 1, -1, -1):
        while agenda.bins[place] >= 0:
            f: int = agenda.bins[place]
            agenda.bins[place] = agenda.next_face[f]
            agenda.listed[f] = False
            agenda.seen[1] = place
            if is_bad(g, f, goal)[0]:
                return f
    return -1


@kernel
def improve(g: Gluing, agenda: Agenda, f: int, goal: Goal) -> bool:
    """Insert one vertex to remove a bad face, where possible; returns False if the arrays have no room for it.

    A face at vertices that nearly coincide is left as it is, unless an angle above 150° makes its circumcircle large
    and no segment blocks its circumcentre: grading the faces towards such vertices would take hundreds of new vertices,
    for no gain in accuracy.
    """
    h = is_bad(g, f, goal)[1]
    close = coincide(g, agenda, h)
    if is_hopeless(g, agenda, h) or (close and not is_cap(g, agenda, f)):
        return True
    outcome, place, x, y = find_circumcenter(g, f)
    if outcome == LOST:
        return True
    segment = place if outcome == BLOCKED else encroached(g, place, x, y, agenda.room, agenda.halfedges)
    if segment < 0 and too_near(g, h, place, x, y):
        return True
    if segment >= 0:
        return close or coincide(g, agenda, segment) or split_segment(g, agenda, segment, f, goal)
    if not has_room(g, agenda, 2):
        return False
    insert(g, agenda, place, x, y)
    return True


@kernel
def too_near(g: Gluing, h: int, f: int, px: float, py: float) -> bool:
    """Whether p, the circumcentre of the face with shortest side h in the frame of face f, is too near a corner of f.

    In a Delaunay triangulation no vertex is nearer than the circumradius. Where rounding has made one so, the face is
    left as it is.
    """
    n, d = tangent_at(g, preceding(h))
    radius = 0.25 * g.length[g.edge[h]] * (n + d) / np.sqrt(n * d)
    x, y = apex_position(g, 3 * f)
    nearest = min(np.hypot(px, py), np.hypot(px - g.length[g.edge[3 * f]], py), np.hypot(px - x, py - y))
    return not nearest > 0.5 * radius


@kernel
def coincide(g: Gluing, agenda: Agenda, h: int) -> bool:
    """Whether the two ends of a halfedge nearly coincide."""
    group: int = agenda.group[g.tail[h]]
    other: int = agenda.group[g.tail[following(h)]]
    is_short: bool = g.length[g.edge[h]] <= agenda.extent[group]
    return group >= 0 and group == other and is_short


@kernel
def is_cap(g: Gluing, agenda: Agenda, f: int) -> bool:
    """Whether an angle of the face exceeds 150°, opposite to a side whose ends do not nearly coincide."""
    for h in range(3 * f, 3 * f + 3):
        n, d = tangent_at(g, preceding(h))
        if n > 13.9 * d:
            return not coincide(g, agenda, h)
    return False


@kernel
def is_hopeless(g: Gluing, agenda: Agenda, h: int) -> bool:
    """Whether the small angle opposite to h cannot be avoided: it is given by the surface or by its segments."""
    corner = preceding(h)
    if agenda.narrow[g.tail[corner]] and sector(g, corner) < NARROW:
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


@kernel
def sector(g: Gluing, corner: int) -> float:
    """Angle around the tail of a halfedge between two segments, or the total angle; counted up to π."""
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


@kernel
def narrow_vertices(g: Gluing) -> NDArray[np.bool_]:
    """(n,) vertices at which two segments meet at less than 60°, or with a total angle of less than 60°."""
    narrow = np.zeros(g.counts[2], dtype=np.bool_)
    for corner in range(3 * g.counts[0]):
        if not narrow[g.tail[corner]]:
            narrow[g.tail[corner]] = sector(g, corner) < NARROW
    return narrow


@kernel
def has_room(g: Gluing, agenda: Agenda, ring: int) -> bool:
    """Whether splitting an edge with so many faces fits into the arrays (splitting a face needs less)."""
    faces: int = g.counts[0]
    edges: int = g.counts[1]
    vertices: int = g.counts[2]
    steps: int = g.counts[3]
    return (
        3 * (faces + ring + 2) <= len(g.tail)
        and edges + ring + 4 <= len(g.length)
        and vertices + 1 <= len(agenda.on_segment)
        and steps + ring + 2 <= len(g.steps)
    )


@kernel
def look_around(g: Gluing, agenda: Agenda, step: int) -> None:
    """Push the edges of all faces that the steps from `step` on have changed on the stack."""
    around, start = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(step, g.counts[3]):
        faces_around(g.steps, n, around, start)
        for f in around:
            for k in range(3 if f >= 0 else 0):
                look_at(g, agenda.stack, agenda.stacked, g.edge[3 * f + k])


@kernel
def insert(g: Gluing, agenda: Agenda, f: int, px: float, py: float) -> None:
    """Insert a vertex at p (in the frame of face f), or on the edge of the face that p nearly lies on."""
    step = g.counts[3]
    x, y = np.zeros(3), np.zeros(3)
    x[1] = g.length[g.edge[3 * f]]
    x[2], y[2] = apex_position(g, 3 * f)
    area = x[1] * y[2]
    nearest = np.inf
    for k in range(3):
        nearest = min(nearest, np.hypot(px - x[k], py - y[k]))
    weights = np.empty(3)
    on_edge, fraction = -1, 0.0
    for k in range(3):
        l = (k + 1) % 3
        length = g.length[g.edge[3 * f + k]]
        above = cross(x[k], y[k], x[l], y[l], px, py)
        weights[(k + 2) % 3] = max(above / area, 0.0)
        t = g.sibling[3 * f + k]
        if above / length < min(0.01 * length, 0.25 * nearest) and t // 3 != f and not g.fixed[g.edge[3 * f + k]]:
            on_edge = k
            fraction = ((px - x[k]) * (x[l] - x[k]) + (py - y[k]) * (y[l] - y[k])) / length**2
    if on_edge >= 0 and 0.0 < fraction < 1.0:
        split_edge(g, 3 * f + on_edge, fraction)
    else:
        weights /= weights.sum()
        split_face(g, f, weights[0], weights[1], weights[2])
    new = g.counts[2] - 1
    agenda.on_segment[new] = agenda.group[new] = -1
    agenda.narrow[new] = False
    look_around(g, agenda, step)


@kernel
def folded_face(g: Gluing, h: int) -> int:
    """A face that has the edge of h twice, or −1."""
    y = h
    while True:
        if g.edge[following(y)] == g.edge[h] or g.edge[preceding(y)] == g.edge[h]:
            return y // 3
        y = g.sibling[y]
        if y == h:
            return -1


@kernel
def vertex_near_edge(g: Gluing, h: int) -> tuple[int, float, float]:
    """A vertex opposite to an edge that nearly lies on it, its height and its fraction along h; −1, 0, ½ if none."""
    nearby, height, fraction, length, y = -1, np.inf, 0.5, g.length[g.edge[h]], h
    while True:
        along, above = apex_position(g, y)
        along = along / length if g.forward[y] == g.forward[h] else 1.0 - along / length
        if above < min(height, NEARNESS * length * min(along, 1.0 - along)):
            nearby, height, fraction = g.tail[preceding(y)], above, along
        y = g.sibling[y]
        if y == h:
            return nearby, height, fraction


@kernel
def distance_to_opposite(g: Gluing, h: int, fraction: float) -> float:
    """Distance of the nearest vertex opposite to an edge from the point at `fraction` along h."""
    nearest: float = np.inf
    length, y = g.length[g.edge[h]], h
    while True:
        along, above = apex_position(g, y)
        here = fraction if g.forward[y] == g.forward[h] else 1.0 - fraction
        nearest = min(nearest, np.hypot(along - here * length, above))
        y = g.sibling[y]
        if y == h:
            return nearest


@kernel
def split_segment(g: Gluing, agenda: Agenda, h: int, f: int, goal: Goal) -> bool:
    """Split a segment that keeps face f from being removed; returns False if the arrays have no room for it.

    The segment is split in the middle, with two exceptions: next to a vertex that nearly lies on it; and, near an end
    where segments meet at a small angle, at a distance from that end that is a power of two, so that the parts of both
    segments have equal lengths and stop splitting each other (Ruppert 1995). Parts a billionth of their segment are not
    split.
    """
    e = g.edge[h]
    segment, length, step = agenda.segment[e], g.length[e], g.counts[3]
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
        for k in range(g.counts[1] - 1 - ring, g.counts[1]):
            agenda.segment[k] = segment
    agenda.narrow[new] = False
    look_around(g, agenda, step)
    list_face(g, agenda, f, goal)
    return True
