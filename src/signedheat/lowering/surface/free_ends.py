"""The round end of an unoriented curve (App. A.2, arcs of type C; Eq. 19 over a part of the circle)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...geometry.intrinsic_mesh import IntrinsicMesh


def free_end_arcs(
    triangles: IntrinsicMesh, edges: NDArray[np.int64], vertices: NDArray[np.int64], least: float
) -> tuple[NDArray[np.int64], NDArray[np.complex128]]:
    """Vectors that point away from the free ends of curves, integrated over the half disk of directions behind each.

    Directions are given by their angle from the curve, measured the shortest way around the vertex. Behind the end are
    those at a quarter of the total angle or more; at boundary and nonmanifold vertices, at a right angle or more.

    Parameters
    ----------
    triangles : IntrinsicMesh
        The surface.
    edges, vertices : (k,) int
        Last edge of each curve, and the vertex at which it ends.
    least : float
        The weight of an end is the length of its last edge, but at least this: subdividing a curve into short edges
        must not make its ends vanish. (The published code has no least weight.)

    Returns
    -------
    faces : (j,) int
        Faces behind the ends.
    vectors : (j,) complex
        ``∫ e^{iθ} dθ`` over the part of the corner that lies behind the end, in the layout of the face, times the
        weight of the end and divided by the angle of the whole arc.
    """
    faces, vectors = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.complex128)]
    marked = np.zeros(triangles.n_vertices, dtype=bool)
    marked[vertices] = True
    all_faces, all_corners = np.nonzero(marked[triangles.corner_vertices])
    owner = triangles.corner_vertices[all_faces, all_corners]
    order = np.argsort(owner, kind="stable")
    all_faces, all_corners, owner = all_faces[order], all_corners[order], owner[order]
    begin, stop = np.searchsorted(owner, vertices), np.searchsorted(owner, vertices, side="right")
    for edge, lo, hi in zip(edges, begin, stop, strict=True):
        face, corner = all_faces[lo:hi], all_corners[lo:hi]
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


def angles_from(
    spoke: int, right: NDArray[np.int64], left: NDArray[np.int64], angle: NDArray[np.float64], n_spokes: int
) -> NDArray[np.float64]:
    """(n_spokes,) angle from one spoke (edge at a vertex) to all others, the shortest way around; inf if not connected.

    Corner k lies between spokes ``right[k]`` and ``left[k]``, and has the angle ``angle[k]``.
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
