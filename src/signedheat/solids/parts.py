"""Which parts of an oriented shape bound something: those at whose faces its winding number is high enough.

The winding number jumps by one across a face. The mean of its two sides, here a part's *level*, is ½ on a closed
surface and 0 on a flat sheet; between, it says how much of a body a part is: half a ball has .31, a quarter .20. Where
faces are missing everywhere, it is half of the share that is there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..geometry.components import connected_components, element_components
from ..geometry.directions import unit
from ..geometry.edges import edge_table
from ..geometry.winding_tree import WindingTree, solid_angle
from .rims import meeting_edges, open_edges

SHEET = 0.15
"""Level up to which a part is a sheet. Flat and wavy sheets have 0, one folded at a right angle .11, a seventh of a
ball .16, a quarter .20, three sides of a box .22."""
UPRIGHT = 0.45
"""Uprightness of the rims of a part from which on it is a body, however thin. Three sides of a cube at a corner have
.58, of a flat box .54, a tray 1; a half pipe .32, a shallow dome .34, a sheet folded at a right angle .24."""
PLACES = 4096
"""Faces of a large part that its level is the mean of."""
FEW = 256
"""Faces up to which those of a part are summed one by one."""


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


def own_levels(triangles: NDArray[np.float64], parts: NDArray[np.int64]) -> NDArray[np.float64]:
    """(p,) mean over the faces of each part of its own winding number, between the two sides of a face."""
    order = np.argsort(parts, kind="stable")
    counts = np.bincount(parts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    corners = np.ascontiguousarray(triangles[order]).reshape(-1, 9)
    areas = face_areas(triangles[order])
    total = np.bincount(parts[order], areas)
    levels = np.bincount(parts[order], areas * _among_few(corners, starts, FEW)) / np.maximum(
        total, np.finfo(float).tiny
    )
    for part in np.flatnonzero(counts > FEW):
        levels[part] = level(triangles[order[starts[part] : starts[part + 1]]])
    return levels


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
    a, b, c = triangles.transpose(1, 0, 2)
    normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)[alone]
    across = unit(np.cross(stop - start, normals)) * np.linalg.norm(stop - start, axis=1)[:, None]
    owners = owners[alone]
    opening = _sums(owners, -0.5 * np.cross(start, stop), n_parts)  # lids run along rims the other way
    length = np.linalg.norm(opening, axis=1)
    around = np.bincount(owners, np.linalg.norm(stop - start, axis=1), n_parts)
    flux = (_sums(owners, across, n_parts) * opening).sum(axis=1)
    return np.asarray(flux / np.maximum(length * around, 1e-300))


def _sums(owners: NDArray[np.int64], vectors: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    return np.stack([np.bincount(owners, column, n) for column in vectors.T], axis=1)


def level(triangles: NDArray[np.float64], faces: NDArray[np.int64] | None = None) -> float:
    """The mean over all faces, or some, of the winding number of all, between the two sides of a face."""
    some = np.arange(len(triangles)) if faces is None else faces
    some = some[:: max(1, len(some) // PLACES)]
    areas = face_areas(triangles[some])
    if not areas.any():
        return 0.0
    behind = WindingTree.of(triangles).behind(some, triangles[some].mean(axis=1))
    return float(np.average(behind, weights=areas)) - 0.5


def face_areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) areas."""
    a, b, c = triangles.transpose(1, 0, 2)
    areas: NDArray[np.float64] = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas


@compiled
def _among_few(corners: NDArray[np.float64], starts: NDArray[np.int64], few: int) -> NDArray[np.float64]:
    levels = np.zeros(len(corners))
    for p in range(len(starts) - 1):
        if starts[p + 1] - starts[p] > few:
            continue
        for i in range(starts[p], starts[p + 1]):
            x = (corners[i, 0] + corners[i, 3] + corners[i, 6]) / 3
            y = (corners[i, 1] + corners[i, 4] + corners[i, 7]) / 3
            z = (corners[i, 2] + corners[i, 5] + corners[i, 8]) / 3
            total = 0.0
            for j in range(starts[p], starts[p + 1]):
                if j != i:
                    rest, volume = solid_angle(corners, j, x, y, z)
                    total += 2.0 * np.arctan2(volume, rest)
            levels[i] = total / (4.0 * np.pi)
    return levels
