"""Faces of a mesh by what they share: corners, edges, parts; the same for triangles and polygons."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geometry.edges import (
    FaceOrientation,
    HalfedgePairs,
    following_corners,
    may_coincide,
    orient_faces,
    pair_halfedges,
)
from ..geometry.welding import coincident_faces, welded_vertices

ALMOST_ALL = 0.95
"""Share of a part's area from which a part that is there again elsewhere is a duplicate."""


@dataclass(frozen=True, eq=False)
class SurfaceParts:
    """Faces, those on the same corners taken as one, in parts that hang together across edges of two faces.

    Vertices count as one where they are at one place, to roundoff; but faces that share an edge by vertex ids belong
    together there, whatever else touches it. Faces on fewer than three places are left out.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions.
    corners, offsets : int arrays
        Vertex ids of all faces, and where those of each begin; one more offset than faces.
    areas : (p,) float
        Areas of the faces.
    apart : (p,) bool, optional
        Faces that hang together with none that they do not agree with as given.
    inner : (p,) bool, optional
        Faces that bound nothing, and are left out, too.
    """

    vertices: NDArray[np.float64]
    corners: NDArray[np.int64]
    offsets: NDArray[np.int64]
    areas: NDArray[np.float64]
    apart: NDArray[np.bool_] | None = None
    inner: NDArray[np.bool_] | None = None

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.offsets) - 1

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """(n,) first vertex at the place of each."""
        return welded_vertices(self.vertices, self.corners, self.corners[self._following])

    @cached_property
    def tails(self) -> NDArray[np.int64]:
        """(c,) place of each corner, where a halfedge begins."""
        if (self.places == np.arange(len(self.places))).all():
            return self.corners
        return self.places[self.corners]

    @property
    def heads(self) -> NDArray[np.int64]:
        """(c,) place of the next corner, where the halfedge ends."""
        return self.tails[self._following]

    @cached_property
    def owners(self) -> NDArray[np.int32]:
        """(c,) face of each corner."""
        return np.repeat(np.arange(self.n_faces, dtype=np.int32), np.diff(self.offsets))

    @cached_property
    def _following(self) -> NDArray[np.int32]:
        return following_corners(self.offsets)

    @cached_property
    def _is_welded(self) -> bool:
        """Whether any two corners are at one place but not at one vertex."""
        return self.tails is not self.corners and not bool((self.tails == self.corners).all())

    def _pairs_by_vertex(self, used: NDArray[np.bool_] | None) -> HalfedgePairs:
        return pair_halfedges(self.corners, self.corners[self._following], len(self.vertices), used)

    @cached_property
    def _all_pairs(self) -> HalfedgePairs:
        return self._pairs_by_vertex(None)

    @cached_property
    def _coincidence(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Faces on the same vertices are one; of those on the same places, whole parts that are there again."""
        proper = bool((self._all_pairs.edges >= 0).all())
        if proper and not may_coincide(self._all_pairs, self.corners, self._following):
            first, reverse = np.arange(self.n_faces), np.zeros(self.n_faces, dtype=bool)
        else:
            first, reverse = coincident_faces(self.corners, self.offsets)
        if not self._is_welded:
            return first, reverse
        at_place, reverse_there = coincident_faces(self.tails, self.offsets)
        first = np.where(at_place < 0, -1, first)
        alone = np.flatnonzero((first == np.arange(self.n_faces)) & (at_place != np.arange(self.n_faces)))
        if not len(alone):
            return first, reverse
        goal = first[at_place[alone]]
        pairs = self._pairs_by_vertex((first == np.arange(self.n_faces))[self.owners])
        parts = orient_faces(pairs, self.corners, self.owners, self.areas).parts
        again = _mostly_again(parts, alone, goal, self.areas, first == np.arange(self.n_faces))
        alone, goal = alone[again], goal[again]
        there = at_place[alone]
        reverse[alone] = reverse_there[alone] != reverse[there]
        first[alone] = goal
        on = np.flatnonzero(first >= 0)  # faces on the vertices of those that were merged now
        reverse[on] ^= np.where(first[on] == on, False, reverse[first[on]] & (first[first[on]] != first[on]))
        first[on] = first[first[on]]
        return first, reverse

    @property
    def first(self) -> NDArray[np.int64]:
        """(p,) first face on the same corners as each; −1 for faces on fewer than three places."""
        return self._coincidence[0]

    @property
    def reversed(self) -> NDArray[np.bool_]:
        """(p,) whether a face runs the other way round than the first on its corners."""
        return self._coincidence[1]

    @cached_property
    def is_first(self) -> NDArray[np.bool_]:
        """(p,) whether a face is the first on its corners, and not left out."""
        first = np.equal(self.first, np.arange(self.n_faces))
        return first if self.inner is None else first & ~self.inner

    @cached_property
    def copies(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(p,) numbers of faces on the corners of each first face: in the same order, itself included, and reversed.

        Zero, both, for a face that is not the first on its corners.
        """
        all_first = bool(self.is_first.all())
        if all_first:
            return np.ones(self.n_faces, dtype=np.int64), np.zeros(self.n_faces, dtype=np.int64)
        there = self.first >= 0
        alike = np.bincount(self.first[there & ~self.reversed], minlength=self.n_faces)
        return alike, np.bincount(self.first[there & self.reversed], minlength=self.n_faces)

    @cached_property
    def pairs(self) -> HalfedgePairs:
        """Halfedges of first faces by edge: first two that share both vertices, then what is left, by place."""
        if self.is_first.all() and not self._is_welded:
            return self._all_pairs
        used = self.is_first[self.owners]
        by_vertex = self._pairs_by_vertex(used)
        if not self._is_welded:
            return by_vertex
        joined = np.append(by_vertex.counts == 2, False)  # the last for halfedges that are left out
        paired = joined[by_vertex.edges]
        joined = joined[:-1]
        by_place = pair_halfedges(self.tails, self.heads, len(self.vertices), used & ~paired)
        numbers = np.append(np.cumsum(joined, dtype=np.int32) - np.int32(1), np.int32(-1))
        rest = np.where(by_place.edges >= 0, by_place.edges + np.int32(joined.sum()), np.int32(-1))
        return HalfedgePairs(
            np.where(paired, numbers[by_vertex.edges], rest),
            np.concatenate([by_vertex.counts[joined], by_place.counts]),
            np.concatenate([by_vertex.first[joined], by_place.first]),
            np.concatenate([by_vertex.second[joined], by_place.second]),
        )

    @cached_property
    def orientation(self) -> FaceOrientation:
        """Parts of first faces, and how they agree. Any other face is a part of its own, without meaning."""
        return self._oriented(np.zeros(self.n_faces, dtype=bool) if self.apart is None else self.apart)

    @cached_property
    def given(self) -> FaceOrientation:
        """The same where faces hang together only with those that they agree with as given."""
        return self._oriented(np.ones(self.n_faces, dtype=bool))

    def _oriented(self, apart: NDArray[np.bool_]) -> FaceOrientation:
        alike, opposite = self.copies
        pairs = self.pairs
        if apart.any():
            two, first, second = pairs.counts == 2, pairs.first, pairs.second
            severed = two & (self.tails[first] == self.tails[second])
            severed &= apart[self.owners[first]] | apart[self.owners[second]]
            pairs = replace(pairs, counts=np.where(severed, np.int32(1), pairs.counts))
        return orient_faces(pairs, self.tails, self.owners, self.areas * (alike - opposite))

    @property
    def n_parts(self) -> int:
        """Number of parts, those without meaning included."""
        return len(self.orientation.orientable)

    @cached_property
    def is_part(self) -> NDArray[np.bool_]:
        """(n_parts,) parts that have a meaning."""
        there = np.zeros(self.n_parts, dtype=bool)
        there[self.orientation.parts[self.is_first]] = True
        return there

    def part_sums(self, face_values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n_parts,) sums over first faces."""
        values = np.where(self.is_first, face_values, 0.0)
        return np.bincount(self.orientation.parts, values, self.n_parts).astype(np.float64)


def _mostly_again(
    parts: NDArray[np.int64],
    faces: NDArray[np.int64],
    others: NDArray[np.int64],
    areas: NDArray[np.float64],
    counts: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Which faces, each on the places of another, belong to parts that are almost entirely there again in another part.

    A part that shares but a wall with another is a body of its own.
    """
    n = int(parts.max()) + 1
    totals = np.bincount(parts[counts], areas[counts], n)
    ways, way = np.unique(parts[faces] * n + parts[others], return_inverse=True)
    shared = np.bincount(way, areas[faces])
    whole = (shared >= ALMOST_ALL * totals[ways // n]) & (ways // n != ways % n)
    return whole[way]
