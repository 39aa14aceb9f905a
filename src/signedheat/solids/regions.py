"""Regions of faces within which the sides do not change, and on which side of each the inside is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..mesh.arrangement import TOUCHING, Arrangement
from ..mesh.components import connected_components, sums_of
from ..mesh.edges import EdgeTable, edge_table
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.unit_vectors import unit
from ..mesh.welding import coincident_faces, distinct_rows
from .winding import DEPTH, Windings

SAMPLES = 3
"""Faces of a region that are looked at. If they do not agree, all are."""
ALIKE = 1e-4
"""Difference in area and middle, over their size, up to which regions with one outline are one."""
NEAR = 4.0
"""Distance from a face at which its sides are looked at, over that up to which faces that coincide may be apart."""


@dataclass(frozen=True, eq=False)
class Regions:
    """What is known of each face from the region that it is in.

    Attributes
    ----------
    behind, ahead : (m,) bool
        Whether it is inside behind the face, and in front of it.
    doubled : (m,) bool
        Whether a face or a region before covers the same place and faces the same way.
    """

    behind: NDArray[np.bool_]
    ahead: NDArray[np.bool_]
    doubled: NDArray[np.bool_]

    @classmethod
    def of(cls, pieces: Arrangement, windings: Windings) -> Regions:
        """Of pieces that meet in whole edges: a region goes on across edges of two faces that run along it both ways.

        Where surfaces cross or cover each other, edges have more.
        """
        table = edge_table(pieces.faces)
        across = table.pairs[table.balance[table.face_edges.ravel()[table.pairs[:, 0]]] == 0]
        labels = connected_components(len(pieces.faces), *(across // 3).T)
        triangles = pieces.points[pieces.faces]
        vectors = area_vectors(triangles)
        behind, ahead = _sides(triangles, vectors, labels, windings)
        doubled = _doubled(table, pieces.cells, triangles, vectors)
        # cells may overlap in part: of copies with the inside on the same side of them the first stays
        first, backwards = coincident_faces(pieces.faces.ravel(), np.arange(0, pieces.faces.size + 1, 3))
        walls = np.flatnonzero((behind != ahead) & ~doubled & (first >= 0))
        stays = np.unique(2 * first[walls] + (backwards != ahead)[walls], return_index=True)[1]
        doubled[np.delete(walls, stays)] = True
        return cls(behind, ahead, doubled)


def _sides(
    triangles: NDArray[np.float64], vectors: NDArray[np.float64], labels: NDArray[np.int64], windings: Windings
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(m,) whether places behind and in front of each triangle are inside, from the widest ones of each region."""
    areas = np.linalg.norm(vectors, axis=1)
    widths = _widths(triangles)
    slack = TOUCHING * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    order = np.lexsort((-widths, labels))
    starts = np.searchsorted(labels[order], np.arange(labels.max() + 1))
    rank = np.arange(len(order)) - starts[labels[order]]
    chosen = order[rank < SAMPLES]

    def sides(faces: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        steps = np.minimum(np.maximum(DEPTH * np.sqrt(areas[faces]), NEAR * slack), 0.1 * widths[faces])
        steps = steps[:, None] * unit(vectors[faces])
        centres = triangles[faces].mean(axis=1)
        return windings.inside(centres - steps), windings.inside(centres + steps)

    behind, ahead = np.empty(len(triangles), dtype=bool), np.empty(len(triangles), dtype=bool)
    behind[chosen], ahead[chosen] = sides(chosen)
    first = order[starts]
    agree = np.ones(len(starts), dtype=bool)
    agree[labels[chosen[behind[chosen] != behind[first][labels[chosen]]]]] = False
    agree[labels[chosen[ahead[chosen] != ahead[first][labels[chosen]]]]] = False
    behind[:], ahead[:] = behind[first][labels], ahead[first][labels]
    apart = np.flatnonzero(~agree[labels])
    behind[apart], ahead[apart] = sides(apart)
    return behind, ahead


def _doubled(
    table: EdgeTable, cells: NDArray[np.int64], triangles: NDArray[np.float64], vectors: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(m,) which triangles are in cells that have the outline of one before, its area and its middle."""
    n = int(cells.max()) + 1
    edges, owners = table.face_edges.ravel(), np.repeat(cells, 3)
    order = np.lexsort((edges, owners))
    twice = np.zeros(len(order), dtype=bool)
    same = (edges[order][1:] == edges[order][:-1]) & (owners[order][1:] == owners[order][:-1])
    twice[1:] |= same
    twice[:-1] |= same
    sides = order[~twice]
    edges, regions, labels = edges[sides], owners[sides], cells
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 2**63, len(table.vertices), dtype=np.int64).astype(np.uint64)
    sums, counts = np.zeros(n, dtype=np.uint64), np.bincount(regions, minlength=n)
    np.add.at(sums, regions, codes[edges])
    least = np.searchsorted(regions, np.flatnonzero(counts))
    ahead = np.zeros(n, dtype=np.int64)
    ahead[regions[least]] = table.forward.ravel()[sides[least]]
    alone = np.where(counts > 0, -1, np.arange(n))
    kinds, first = distinct_rows(np.stack([sums.view(np.int64), counts, ahead, alone], axis=1))
    areas = np.linalg.norm(vectors, axis=1)
    totals = np.bincount(labels, areas, n)
    middles = sums_of(areas[:, None] * triangles.mean(axis=1), labels, n) / np.maximum(totals, 1e-300)[:, None]
    model = first[kinds]
    size = np.sqrt(totals)
    same = (model != np.arange(n)) & (np.abs(totals - totals[model]) <= ALIKE * totals)
    same &= np.linalg.norm(middles - middles[model], axis=1) <= ALIKE * size
    result: NDArray[np.bool_] = same[labels]
    return result


def widest(pieces: Arrangement) -> NDArray[np.float64]:
    """(p, 3) for each piece the middle of the widest one in its cell."""
    triangles = pieces.points[pieces.faces]
    order = np.lexsort((-_widths(triangles), pieces.cells))
    first = order[np.searchsorted(pieces.cells[order], np.arange(int(pieces.cells.max()) + 1))]
    middles: NDArray[np.float64] = triangles[first].mean(axis=1)[pieces.cells]
    return middles


def _widths(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) areas of triangles over their longest sides."""
    longest = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    widths: NDArray[np.float64] = face_areas(triangles) / np.maximum(longest, 1e-300)
    return widths
