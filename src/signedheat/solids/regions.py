"""Regions on both sides of the faces of a solid's boundary.

The winding number differs on the two sides of a face by the number of times that the face is there; between two faces
that follow each other around an edge it does not change. This gives it on both sides of all connected faces, up to a
constant that samples determine. So the inside does not depend on samples between faces that nearly coincide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.arrangement import Arrangement
from ..mesh.components import next_in_groups, sums_of
from ..mesh.edges import EdgeTable, edge_table
from ..mesh.triangles import area_vectors, face_areas, heights
from ..mesh.unit_vectors import angles_around, unit
from ..mesh.welding import coincident_faces
from .winding import INSIDE_WINDING, Windings

TOLERANCES: tuple[float, ...] = (1.0, 10.0, 100.0, 1000.0)
"""Multiples of the tolerance for coinciding points, tried in this order until the faces that bound the inside close.
Of touching boxes with corners moved by 1e-11 to 1e-5 of their size, none is wrong; without the last multiple up to a
seventh are, with the first alone nine tenths (`benchmarks/deciding_numbers.py`)."""
PROBED_FACES = 3
"""Number of faces of each component on both sides of which winding numbers are computed; their median counts."""
PROBE_DISTANCE = 4.0
"""Distance from a face at which its sides are probed, relative to the tolerance for coinciding faces."""


@dataclass(frozen=True, eq=False)
class Regions:
    """Whether the inside lies behind and in front of each face."""

    behind: Bools  # (m,) whether the inside lies behind the face
    ahead: Bools  # (m,) whether it lies in front of the face
    doubled: Bools  # (m,) whether another face on the same corners stands for it
    contradictions: int  # number of pairs of facing sides whose winding numbers disagree

    @property
    def bounds(self) -> Bools:
        """(m,) which faces bound the inside, and face outwards."""
        return self.behind & ~self.ahead & ~self.doubled

    @classmethod
    def of(cls, pieces: Arrangement, windings: Windings, slacks: Floats) -> Regions:
        """Find on which sides of the faces of an arrangement the inside lies.

        `windings` gives the winding numbers of the closed surface that these faces contain; they are computed only
        near a few faces of each component. The (m,) `slacks` are distances within which points on the faces coincided
        when these were cut; winding numbers are computed farther than that from a face.
        """
        # copies of a triangle form a group: the first of them stands for all, counted with signs
        first, reverse = coincident_faces(pieces.faces.ravel(), np.arange(0, pieces.faces.size + 1, 3))
        first = np.where(first < 0, np.arange(len(first)), first)  # triangles on fewer than three points
        distinct, groups = np.unique(first, return_inverse=True)
        times = np.bincount(groups, np.where(reverse, -1, 1), len(distinct)).astype(np.int64)
        vectors = area_vectors(pieces.points.take(pieces.faces, axis=0))
        # parts of one face have its normal, which is more accurate than those of slivers
        parent_normals = unit(sums_of(vectors, pieces.origins, int(pieces.origins.max(initial=-1)) + 1))
        normals = parent_normals[pieces.origins[distinct]]
        steps = PROBE_DISTANCE * slacks[pieces.origins[distinct]]
        numbers, contradictions = _windings(pieces.points, pieces.faces[distinct], normals, times, windings, steps)
        behind, ahead = (numbers > INSIDE_WINDING).T
        behind, ahead = (
            np.where(reverse, *pair) for pair in ((ahead[groups], behind[groups]), (behind[groups], ahead[groups]))
        )
        # of copies, the first that has the inside only behind it stands for all; or else the first
        order = np.lexsort((~behind | ahead, groups))
        doubled = np.ones(len(groups), dtype=bool)
        doubled[order[np.unique(groups[order], return_index=True)[1]]] = False
        return cls(behind, ahead, doubled, contradictions)


def cut_and_sided(
    cut: Callable[[Floats], Arrangement], slacks: Floats, closing: Bools, windings: Windings
) -> tuple[Arrangement, Regions]:
    """Cut faces with the first tolerance for which those that bound the inside are closed, and find their regions.

    If corners that should coincide are about a tolerance apart, edges stay open or sides contradict each other. Then
    larger multiples of the (m,) `slacks` of faces are tried; if none works, that with the fewest faults is used.
    `cut` divides the faces where they meet, for (m,) tolerances; `closing` tells which faces count in winding numbers.
    """
    attempts: list[tuple[Arrangement, Regions]] = []
    faults: list[int] = []
    for touching in TOLERANCES:
        pieces = cut(touching * slacks)
        attempts.append((pieces, Regions.of(pieces, windings, touching * slacks)))
        faults.append(_faults(*attempts[-1], closing))
        if not faults[-1]:
            break
    return attempts[int(np.argmin(faults))]


def _faults(pieces: Arrangement, regions: Regions, closing: Bools) -> int:
    """Count contradictions, and open edges of the closing faces that bound the inside; 0 if no face was cut."""
    if np.array_equal(pieces.origins, np.arange(len(closing))):
        return 0
    bounds = pieces.faces[regions.bounds & closing[pieces.origins]]
    return regions.contradictions + int((edge_table(bounds).balance != 0).sum())


def _windings(
    points: Floats, faces: Ints, normals: Floats, times: Ints, windings: Windings, steps: Floats
) -> tuple[Floats, int]:
    """Return (m, 2) winding numbers behind and in front of each distinct face, and how many pairs of sides contradict.

    `normals`, (m, 3), are unit vectors, and `times`, (m,), says how often each face is there, opposite copies counted
    as −1. Across edges, numbers follow from each other, up to a constant for each connected part, which is sampled on
    its widest faces. Sides of wide faces are probed at least their (m,) steps away.
    """
    # (m, 2) numbers up to a constant for each part, and (m,) the part of each face
    n = len(faces)
    sides, facing_sides = _around_edges(points, faces, normals, times)
    levels, labels, contradictions = _levels(times, sides, facing_sides)
    levels, labels = levels.reshape(-1, 2), labels[::2]
    # the widest faces of each part
    thickness = heights(points.take(faces, axis=0))
    order = np.lexsort((-thickness, labels))
    starts = np.searchsorted(labels[order], np.arange(int(labels.max(initial=-1)) + 1))
    chosen = order[np.arange(n) - starts[labels[order]] < PROBED_FACES]
    corners = points[faces[chosen]]
    away = np.minimum(steps[chosen], 0.05 * thickness[chosen])
    away, centres = away[:, None] * normals[chosen], corners.mean(axis=1)
    sampled = windings.numbers_once(np.concatenate([centres - away, centres + away]))
    offsets, owners = sampled.reshape(2, -1) - levels[chosen].T, labels[chosen]
    # the constant is the median over the probed faces of a part, without those whose sides disagree about it, since
    # another face lies between the points
    order = np.lexsort((offsets[0], np.abs(offsets[0] - offsets[1]) > 0.5, owners))
    counts = np.bincount(owners)
    agree = np.bincount(owners, np.abs(offsets[0] - offsets[1]) <= 0.5).astype(np.int64)
    medians = offsets[0][order[np.cumsum(counts) - counts + np.where(agree > 0, agree, counts) // 2]]
    return levels + np.round(medians)[labels, None], contradictions


def _around_edges(points: Floats, faces: Ints, normals: Floats, times: Ints) -> tuple[Ints, Ints]:
    """Return two (k,) arrays: sides of faces that enclose the same space at an edge, the most certain pairs first.

    Side 2 f is behind face f, side 2 f + 1 in front of it. Boundary edges of open surfaces are left out, as nothing
    is known there. Directions across edges come from the planes of faces, so that thin triangles have them, too.
    """
    # edges of two faces, which must run opposite ways
    table = edge_table(faces)
    halfedges = table.pairs[(_directions(table, table.pairs) * times[table.pairs // 3]).sum(axis=1) == 0]
    sides, facing_sides = _facing(table, halfedges.ravel(), halfedges[:, ::-1].ravel())

    # edges of more faces, by their angles
    crowded = np.flatnonzero((table.face_counts > 2)[table.face_edges.ravel()])
    edges, around = np.unique(table.face_edges.ravel()[crowded], return_inverse=True)
    owners, ways, vertices = crowded // 3, _directions(table, crowded), table.vertices[edges]
    along = points[vertices[:, 1]] - points[vertices[:, 0]]
    lengths, along = np.linalg.norm(along, axis=1), unit(along)
    across = np.cross(normals[owners], ways[:, None] * along[around])
    angles = angles_around(along[around], across)
    # each face around the edge encloses the space up to the next one with its side towards it
    order = np.lexsort((angles, around))
    onward = next_in_groups(np.append(0, np.cumsum(table.face_counts[edges])))
    last, following = onward <= np.arange(len(order)), order[onward]
    heights = face_areas(points[faces[owners]]) / np.maximum(lengths[around], 1e-300)
    gaps = angles[following] - angles[order] + np.where(last, 2 * np.pi, 0.0)
    gaps *= np.minimum(lengths[around[order]], np.minimum(heights[order], heights[following]))  # wide ones are certain
    balanced = np.bincount(around, ways * times[owners], len(edges)) == 0
    clear = np.flatnonzero(balanced[around[order]] & (gaps > 0))
    clear = clear[np.argsort(-gaps[clear], kind="stable")]
    crowded_sides = _facing(table, crowded[order[clear]], crowded[following[clear]])
    return np.concatenate([sides, crowded_sides[0]]), np.concatenate([facing_sides, crowded_sides[1]])


def _directions(table: EdgeTable, halfedges: Ints) -> Ints:
    """(k,) 1 for each halfedge that runs in the direction of its edge, −1 for those that run against it."""
    return np.where(table.forward.ravel()[halfedges], 1, -1)


def _facing(table: EdgeTable, turning: Ints, reached: Ints) -> tuple[Ints, Ints]:
    """Return the two sides that enclose the space between each halfedge and the next counterclockwise around its edge.

    `turning` and `reached` are (k,) halfedges. Side 2 f is behind face f, side 2 f + 1 in front of it.
    """
    forward = table.forward.ravel()
    return 2 * (turning // 3) + forward[turning], 2 * (reached // 3) + ~forward[reached]


@compiled
def _levels(times: Ints, one: Ints, other: Ints) -> tuple[Ints, Ints, int]:
    """Return (2 m,) winding numbers up to a constant, (2 m,) components, and the number of contradictions.

    Side 2 f is behind face f, and side 2 f + 1, in front of it, has a winding number smaller by the multiplicity
    `times` of the face. The pairs of sides `one` and `other` have equal ones; a pair that contradicts earlier pairs is
    only counted. This is union–find in which each node knows how much higher it is than its parent.
    """
    n, contradictions = 2 * len(times), 0
    parents, rises = np.arange(n), np.zeros(n, dtype=np.int64)
    for face in range(len(times)):
        parents[2 * face + 1], rises[2 * face + 1] = 2 * face, -times[face]
    for k in range(len(one)):
        # find both roots, shortening the paths; `rise` becomes the level of root b less that of root a, by this pair
        a, b, rise = one[k], other[k], 0
        while parents[a] != a:
            rises[a] += rises[parents[a]]
            parents[a] = parents[parents[a]]
            rise -= rises[a]
            a = parents[a]
        while parents[b] != b:
            rises[b] += rises[parents[b]]
            parents[b] = parents[parents[b]]
            rise += rises[b]
            b = parents[b]
        if a < b:
            parents[b], rises[b] = a, -rise
        elif b < a:
            parents[a], rises[a] = b, rise
        elif rise != 0:
            contradictions += 1
    labels, count = np.empty(n, dtype=np.int64), 0
    for node in range(n):  # parents come first, and have their levels already
        if parents[node] == node:
            labels[node] = count
            count += 1
        else:
            rises[node] += rises[parents[node]]
            labels[node] = labels[parents[node]]
    return rises, labels, contradictions


def widest(pieces: Arrangement) -> Floats:
    """(p, 3) centroid of the widest triangle among those in the same cell of the arrangement as each triangle."""
    order = np.lexsort((-heights(pieces.points[pieces.faces]), pieces.cells))
    first = order[np.searchsorted(pieces.cells[order], np.arange(int(pieces.cells.max()) + 1))]
    middles: Floats = pieces.points[pieces.faces[first]].mean(axis=1)[pieces.cells]
    return middles
