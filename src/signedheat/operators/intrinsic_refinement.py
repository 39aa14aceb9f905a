"""Intrinsic Delaunay refinement: vertices put where they heal thin triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from .intrinsic_delaunay import doubled

if TYPE_CHECKING:
    from .intrinsic_kernels import Gluing

PER_FACE = ("tail", "edge", "forward", "front", "ring")
PER_EDGE = ("start", "length", "fixed")


def refine_all(
    gluing: Gluing, angle: float, needle: float, max_vertices: int
) -> tuple[Gluing, NDArray[np.int64], bool]:
    """Refine a Delaunay triangulation until every face that can be helped has no angle below `angle`.

    Fixed, boundary and nonmanifold edges may be split but stay. Small angles remain where fixed edges meet, or the
    surface closes up, at less than 60°; where vertices all but coincide; and where the limit on the number of vertices
    is reached first.

    Parameters
    ----------
    gluing : Gluing
        Delaunay, as `flip_all` returns it; changed.
    angle : float
        Radians.
    needle : float
        Radians. Faces with a smaller angle are left alone, unless another of their angles exceeds 150°: two vertices
        all but coincide there, and grading the faces towards them would take many more, for no gain in accuracy.
    max_vertices : int
        Stop when there are as many.

    Returns
    -------
    Gluing
        The refined triangulation.
    (e,) int
        The fixed edge before that each edge now is part of, or −1.
    bool
        Whether it was finished before the limit.
    """
    from .refinement_kernels import FULL, GROW, N_BINS, Agenda, Goal, list_all, refine

    n_faces, n_edges, n_vertices = gluing.counts[:3].tolist()
    counts = np.bincount(gluing.edge[: 3 * n_faces], minlength=n_edges)
    gluing.fixed[:n_edges] |= counts != 2
    segments = np.flatnonzero(gluing.fixed[:n_edges])
    segment = np.full(n_edges, -1, dtype=np.int64)
    segment[segments] = np.arange(len(segments))
    start = gluing.start[segments]
    ends = np.stack([gluing.tail[start], gluing.tail[3 * (start // 3) + (start + 1) % 3]], axis=1)
    agenda = Agenda(
        stack=np.empty(n_edges, dtype=np.int64),
        stacked=np.zeros(n_edges, dtype=bool),
        bins=np.full(N_BINS, -1, dtype=np.int64),
        next_face=np.full(n_faces, -1, dtype=np.int64),
        listed=np.zeros(n_faces, dtype=bool),
        segment=segment,
        segment_ends=ends.reshape(-1, 2),
        segment_length=gluing.length[segments],
        on_segment=np.full(n_vertices, -1, dtype=np.int64),
        narrow=narrow_vertices(gluing),
        seen=gluing.counts[3:4].copy(),
        room=np.empty((4096, 5)),
        halfedges=np.empty(4096, dtype=np.int64),
    )
    goal = Goal(np.tan(angle / 2) ** 2, np.tan(needle / 2) ** 2, max_vertices)
    list_all(gluing, agenda, goal)
    while True:
        status = refine(gluing, agenda, goal)
        if status != GROW:
            n_edges = int(gluing.counts[1])
            origin = np.full(n_edges, -1)
            fixed = np.flatnonzero(gluing.fixed[:n_edges])
            origin[fixed] = segments[agenda.segment[fixed]]
            return gluing, origin, status != FULL
        gluing = gluing._replace(**{k: doubled(getattr(gluing, k)) for k in (*PER_FACE, *PER_EDGE, "steps", "weights")})
        grown = ("stack", "stacked", "next_face", "listed", "segment", "on_segment", "narrow")
        agenda = agenda._replace(**{k: doubled(getattr(agenda, k)) for k in grown})


def narrow_vertices(gluing: Gluing) -> NDArray[np.bool_]:
    """(n,) vertices at which two fixed edges meet, or the surface closes up, at less than 60°."""
    from .refinement_kernels import NARROW

    corners, total = sectors(gluing)
    narrow = np.zeros(int(gluing.counts[2]), dtype=bool)
    narrow[gluing.tail[: len(corners)][total[corners] < NARROW]] = True
    return narrow


def sectors(gluing: Gluing) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Which sector every corner belongs to, and the angle of each: from fixed edge to fixed edge around a vertex."""
    from .intrinsic_delaunay import lay_out

    n = 3 * int(gluing.counts[0])
    h = np.flatnonzero(~gluing.fixed[gluing.edge[:n]])
    t = gluing.ring[h]
    following = 3 * (t // 3) + (t + 1) % 3
    other = np.where(gluing.forward[h] == gluing.forward[t], t, following)
    graph = csr_matrix((np.ones(len(h)), (h, other)), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    leaving = lay_out(gluing).edge_vectors
    angles = np.angle(-np.conj(leaving) * np.roll(leaving, 1, axis=1))
    return label, np.bincount(label, weights=angles.ravel())
