"""Which parts of an oriented shape bound something: those at whose faces its winding number is high enough.

The level of a part (`geometry.part_levels`) says how much of a body it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.components import connected_components, element_components, sums_of
from ..geometry.directions import unit
from ..geometry.edges import edge_table
from ..geometry.meshes import area_vectors
from ..geometry.part_levels import own_levels
from .rims import meeting_edges, open_edges

SHEET = 0.15
"""Level up to which a part is a sheet. Flat and wavy sheets have 0, one folded at a right angle .11, a seventh of a
ball .16, a quarter .20, three sides of a box .22."""
UPRIGHT = 0.45
"""Uprightness of the rims of a part from which on it is a body, however thin. Three sides of a cube at a corner have
.58, of a flat box .54, a tray 1; a half pipe .32, a shallow dome .34, a sheet folded at a right angle .24."""


def parts_of(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) the part that each face is of: faces that share an edge which two faces have, in opposite directions."""
    table = edge_table(faces)
    joins = (table.face_counts == 2) & (table.balance == 0)
    alone = len(table.vertices) + np.arange(3 * len(faces)).reshape(-1, 3)
    sides = np.where(joins[table.face_edges], table.face_edges, alone)
    return element_components(sides)


def bodies(triangles: NDArray[np.float64], ids: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(m,) the part that each face is of, and (p,) whether a part is a body; all others are sheets or fragments.

    A part is a body if it is closed, if its own winding number at its faces is high enough, or its rims are upright.
    """
    labels = _joined_along_rims(triangles, ids, parts_of(ids))
    n = int(labels.max(initial=-1)) + 1
    is_body = np.ones(n, dtype=bool)
    is_body[open_edges(ids, labels)[1]] = False
    opened = ~is_body[labels]
    if opened.any():
        names, inverse = np.unique(labels[opened], return_inverse=True)
        some = triangles[opened], ids[opened], inverse
        is_body[names] = np.abs(own_levels(some[0], inverse)) >= SHEET
        is_body[names] |= np.abs(uprightness(*some, len(names))) >= UPRIGHT
    return labels, is_body


def _joined_along_rims(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], labels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The part of each face; parts whose rims run along each other are one, unless they are single faces."""
    edges, owners = open_edges(ids, labels)
    counts = np.bincount(labels)
    kept = counts[owners] > 1
    edges, owners = edges[kept], owners[kept]
    if len(np.unique(owners)) < 2:
        return labels
    positions = np.empty((int(ids.max()) + 1, 3))
    positions[ids] = triangles
    one, other = meeting_edges(positions[edges])
    return connected_components(len(counts), owners[one], owners[other])[labels]


def uprightness(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], parts: NDArray[np.int64], n_parts: int
) -> NDArray[np.float64]:
    """(p,) mean over the rims of each part of the cosine between the surface and the normal of its opening.

    1 on a tray, however low its walls are, and on a tube cut open along its length; 0 on sheets, whose rims lie in the
    plane that they open to, and on tubes, whose ends have opposite normals.
    """
    tails, heads = ids.ravel(), np.roll(ids, -1, axis=1).ravel()
    owners = np.repeat(parts, 3)
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    order = np.lexsort((high, low, owners))
    same = (np.diff(owners[order]) == 0) & (np.diff(low[order]) == 0) & (np.diff(high[order]) == 0)
    alone = np.ones(len(order), dtype=bool)
    alone[order[1:][same]] = alone[order[:-1][same]] = False
    corners = triangles.reshape(-1, 3)
    start, stop = corners[alone], np.roll(triangles, -1, axis=1).reshape(-1, 3)[alone]
    normals = np.repeat(area_vectors(triangles), 3, axis=0)[alone]
    across = unit(np.cross(stop - start, normals)) * np.linalg.norm(stop - start, axis=1)[:, None]
    owners = owners[alone]
    opening = sums_of(-0.5 * np.cross(start, stop), owners, n_parts)  # lids run along rims the other way
    length = np.linalg.norm(opening, axis=1)
    around = np.bincount(owners, np.linalg.norm(stop - start, axis=1), n_parts)
    flux = (sums_of(across, owners, n_parts) * opening).sum(axis=1)
    return np.asarray(flux / np.maximum(length * around, 1e-300))
