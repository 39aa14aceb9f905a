"""Intrinsic Delaunay refinement: insert vertices until no triangle is thin, and none large next to the others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh.delaunay import doubled, lay_out
from ..mesh.gluing_kernels import Gluing
from .coincidence_kernels import coinciding
from .refinement_kernels import DONE, FULL, GROW, N_BINS, PAUSED, Agenda, Goal, list_all, narrow_vertices, refine

PER_FACE = ("tail", "edge", "forward", "front", "sibling")
PER_EDGE = ("start", "length", "fixed", "flips")
TO_GROW = ("stack", "stacked", "next_face", "listed", "segment", "on_segment", "narrow", "group", "extent")

PATIENCE = 5000
"""New vertices between two progress reports: some hundredths of a second."""


def refine_all(
    gluing: Gluing, angle: float, coarsest: float, max_vertices: int, progress: Callable[[float], None] | None = None
) -> tuple[Gluing, NDArray[np.int64], NDArray[np.bool_], bool]:
    """Refine a Delaunay triangulation until no face is thin and then none is large, where that is possible.

    Fixed, boundary and nonmanifold edges may be split but are not flipped. Small angles remain where fixed edges meet
    at less than 60°, at vertices with a total angle of less than 60°, at vertices that nearly coincide, and where the
    limit on the number of vertices is reached first.

    Parameters
    ----------
    gluing : Gluing
        Delaunay, as `flip_all` returns it; changed in place.
    angle : float
        Smallest angle, in radians.
    coarsest : float
        Largest circumradius, in multiples of that of an equilateral triangle of the mean area once no face is thin.
    max_vertices : int
        Stop when there are as many.
    progress : callable, optional
        Called now and then with an estimate of the fraction done; an exception that it raises cancels.

    Returns
    -------
    Gluing
        The refined triangulation.
    (e,) int
        The fixed edge of the input that each edge is part of, or −1.
    (m,) bool
        Faces at vertices that nearly coincide, which may be thin.
    bool
        Whether refinement ended before the limit on the number of vertices.
    """
    segments, agenda = agenda_of(gluing)
    goal = Goal(np.tan(angle / 2) ** 2, np.inf, max_vertices)
    gluing, agenda, status = refined(gluing, agenda, goal, progress)
    if status == DONE and coarsest < np.inf:
        goal = goal._replace(radius=coarsest * mean_radius(gluing))
        report = None if progress is None else lambda _: progress(1.0)  # it may cancel
        gluing, agenda, status = refined(gluing, agenda, goal, report)
    n_edges = int(gluing.counts[1])
    origin = np.full(n_edges, -1)
    fixed = np.flatnonzero(gluing.fixed[:n_edges])
    origin[fixed] = segments[agenda.segment[fixed]]
    return gluing, origin, close_faces(gluing, agenda), status != FULL


def refined(
    gluing: Gluing, agenda: Agenda, goal: Goal, progress: Callable[[float], None] | None
) -> tuple[Gluing, Agenda, int]:
    """Refine until the goal is met or no vertex is left; the arrays, longer where they were full, and why it ended."""
    list_all(gluing, agenda, goal)
    listed = np.flatnonzero(agenda.bins >= 0)  # by size: the largest come first, so that their list says how far it is
    done = 0.0
    while True:
        status = refine(gluing, agenda, goal, PATIENCE)
        if status == PAUSED and progress is not None:
            done = max(done, float(listed[-1] - agenda.seen[1]) / len(listed))
            progress(min(done, 1.0))
        if status == GROW:
            grown: dict[str, Any] = {k: doubled(getattr(gluing, k)) for k in (*PER_FACE, *PER_EDGE, "steps", "weights")}
            gluing = gluing._replace(**grown)
            agenda = agenda._replace(**{k: doubled(getattr(agenda, k)) for k in TO_GROW})
        if status not in (PAUSED, GROW):
            return gluing, agenda, status


def mean_radius(gluing: Gluing) -> float:
    """Circumradius of an equilateral triangle of the mean area of the faces, in the unit of the gluing."""
    return float(np.sqrt(4 / 27**0.5 * lay_out(gluing).face_areas.mean())) / gluing.unit


def close_faces(gluing: Gluing, agenda: Agenda) -> NDArray[np.bool_]:
    """(m,) faces whose shortest side joins vertices that nearly coincide."""
    n_faces = int(gluing.counts[0])
    faces = np.arange(n_faces)
    lengths = gluing.length[gluing.edge[: 3 * n_faces]].reshape(-1, 3)
    group = agenda.group[gluing.tail[: 3 * n_faces]].reshape(-1, 3)
    side = lengths.argmin(axis=1)
    one, other = group[faces, side], group[faces, (side + 1) % 3]
    return (one >= 0) & (one == other) & (lengths[faces, side] <= agenda.extent[one])


def agenda_of(gluing: Gluing) -> tuple[NDArray[np.int64], Agenda]:
    """The fixed edges, and the work lists of refinement; boundary and nonmanifold edges become fixed."""
    n_faces, n_edges, n_vertices = gluing.counts[:3].tolist()
    counts = np.bincount(gluing.edge[: 3 * n_faces], minlength=n_edges)
    gluing.fixed[:n_edges] |= counts != 2
    start = gluing.start[:n_edges]
    tail, head = gluing.tail[start], gluing.tail[3 * (start // 3) + (start + 1) % 3]
    lengths = gluing.length[:n_edges]
    order = np.argsort(lengths, kind="stable")
    group, extent = coinciding(tail, head, lengths, order[counts[order] > 0], n_vertices)
    segments = np.flatnonzero(gluing.fixed[:n_edges])
    segment = np.full(n_edges, -1, dtype=np.int64)
    segment[segments] = np.arange(len(segments))
    return segments, Agenda(
        stack=np.empty(n_edges, dtype=np.int64),
        stacked=np.zeros(n_edges, dtype=bool),
        bins=np.full(N_BINS, -1, dtype=np.int64),
        next_face=np.full(n_faces, -1, dtype=np.int64),
        listed=np.zeros(n_faces, dtype=bool),
        segment=segment,
        segment_ends=np.stack([tail[segments], head[segments]], axis=1),
        segment_length=gluing.length[segments],
        on_segment=np.full(n_vertices, -1, dtype=np.int64),
        narrow=narrow_vertices(gluing),
        group=group,
        extent=extent,
        seen=np.array([gluing.counts[3], N_BINS]),
        room=np.empty((4096, 5)),
        halfedges=np.empty(4096, dtype=np.int64),
    )
