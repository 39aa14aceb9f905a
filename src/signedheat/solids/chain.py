"""Chains: the distinct triangles of a shape, how often each is there, and which are connected and closed.

Triangles on the same corners are one. Its multiplicity is how often it is given one way minus how often it is given
the other way, which may be 0. A chain whose directed edges all cancel is a *cycle*: it has an integer winding number
off its faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints
from ..mesh.components import connected_components, element_components, next_in_groups
from ..mesh.edges import EdgeTable, FaceOrientation, edge_table, orient_faces, pair_halfedges
from ..mesh.triangles import area_vectors, face_areas, part_volumes
from ..mesh.unit_vectors import ANGLE_ROUNDING, angles_around, unit
from ..mesh.welding import coincident_faces, joined_faces
from ..surfaces.triangle_mesh import TriangleMesh

EQUAL_AREAS = 1e-9
"""Differences of areas up to this share are rounding."""
ANY_DIRECTION = np.array([0.48, 0.62, 0.62079])
"""A direction that the planes of triangles hardly contain, which tells both sides of a plane apart."""


@dataclass(frozen=True, eq=False)
class Chain(Frozen):
    """Distinct triangles between welded vertices."""

    positions: Floats  # (n, 3) of the vertices, scaled by a power of two so that products do not overflow
    faces: Ints  # (m, 3) vertices of each distinct triangle, in the direction in which it was given first
    firsts: Ints  # (m,) first triangle of the mesh on the same corners as each
    numbers: Ints  # (k,) distinct triangle of each given one; −1 for those on fewer than three vertices
    reversed: Bools  # (k,) which given triangles run the other way than their distinct one
    given: Ints  # (k, 3) vertices of each given triangle, by the indices of the mesh

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Chain:
        """Make the chain of a mesh."""
        ids = joined_faces(mesh.vertices, mesh.faces)
        first, backwards = coincident_faces(ids.ravel(), np.arange(0, 3 * len(ids) + 1, 3))
        distinct = np.flatnonzero(first == np.arange(len(ids)))
        numbers = np.full(len(ids) + 1, -1)
        numbers[distinct] = np.arange(len(distinct))
        exponent = int(np.frexp(max(float(np.ptp(mesh.bounds, axis=0).max()), 1e-300))[1])
        return cls(np.ldexp(mesh.vertices, -exponent), ids[distinct], distinct, numbers[first], backwards, mesh.faces)

    @cached_property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners."""
        return self.positions.take(self.faces, axis=0)

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas."""
        return face_areas(self.triangles)

    @cached_property
    def copies(self) -> Ints:
        """(m,) number of times that each triangle is given, one way or the other."""
        return np.bincount(self.numbers[self.numbers >= 0], minlength=len(self.faces))

    @cached_property
    def multiplicities(self) -> Ints:
        """(m,) number of times that each triangle is given as it is, minus the number of times reversed."""
        return self.multiplicities_with(self.reversed)

    def multiplicities_with(self, reversed: Bools) -> Ints:
        """(m,) multiplicities if `reversed`, (k,), are the given triangles that run opposite to their distinct ones."""
        proper = self.numbers >= 0
        signs = np.where(reversed[proper], -1, 1)
        return np.bincount(self.numbers[proper], signs, len(self.faces)).astype(np.int64)

    @cached_property
    def edges(self) -> EdgeTable:
        """Edges of the triangles."""
        return edge_table(self.faces)

    @cached_property
    def complexes(self) -> Ints:
        """(m,) component of each triangle, connected by edges of any number of triangles."""
        return element_components(self.edges.face_edges) if len(self.faces) else np.zeros(0, dtype=np.int64)

    def open_edges(self, counts: Ints, groups: Ints) -> Ints:
        """(g,) number of directed edges that do not cancel in each group, if triangles are there `counts` times.

        Both `counts` and `groups` are (m,).
        """
        owners, _, excess = self.edges.unbalanced(groups, counts)
        return np.bincount(owners, np.abs(excess), int(groups.max(initial=-1)) + 1).astype(np.int64)

    def joined(self, used: Bools) -> Ints:
        """(m,) component of each triangle, connected by edges that exactly two `used` triangles share."""
        heads = np.roll(self.faces, -1, axis=1).ravel()
        pairs = pair_halfedges(self.faces.ravel(), heads, len(self.positions), np.repeat(used, 3))
        two = pairs.counts == 2
        return connected_components(len(self.faces), pairs.first[two] // 3, pairs.second[two] // 3)

    def around_edges(self, used: Bools) -> tuple[Ints, Ints, Ints]:
        """Find (k,) halfedges 3 f + c of used triangles, the next one around the edge of each, and the edge's number.

        A boundary halfedge is followed by itself. Triangles at the same angle are ordered by component, in the same
        order at all of their edges. Edges of triangles without area are left out.
        """
        tails, heads = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        pairs = pair_halfedges(tails, heads, len(self.positions), np.repeat(used, 3))
        one, two = (np.flatnonzero(pairs.counts == count) for count in (1, 2))
        alone, first, second = pairs.first[one], pairs.first[two], pairs.second[two]
        # at edges of more than two, by the angle around the edge at which each triangle lies
        crowded = np.flatnonzero(pairs.around > 2)
        along = unit(self.positions[heads[crowded]] - self.positions[tails[crowded]])
        along *= np.where(tails < heads, 1.0, -1.0)[crowded, None]  # from the lower vertex to the higher
        normals = unit(area_vectors(self.triangles[crowded // 3]))
        into = np.cross(normals, along) * np.where(tails < heads, 1.0, -1.0)[crowded, None]
        angles = np.where(into.any(axis=1), angles_around(along, into), np.nan)
        order = np.lexsort((angles, pairs.edges[crowded]))
        crowded, edges, angles = crowded[order], pairs.edges[crowded][order], angles[order]
        starts = np.append(0, np.cumsum(np.bincount(edges, minlength=len(pairs.counts))))
        onward = next_in_groups(starts)
        gaps = np.where(onward <= np.arange(len(onward)), 2 * np.pi, 0.0) + angles[onward] - angles
        # where angles are equal, by component, and in the opposite order on the other side of the plane
        if (gaps <= ANGLE_ROUNDING).any():
            levels = _levels(gaps, onward, edges)
            upwards = (np.cross(along, into)[order] @ ANY_DIRECTION > 0) * 2 - 1
            parts = self.joined(used)  # by size, whatever the order of the triangles
            sizes = np.rint(np.bincount(parts, self.areas) / (EQUAL_AREAS * self.areas.max()))[parts]
            owners = crowded // 3
            crowded = crowded[np.lexsort((upwards * (1 + parts[owners]), upwards * sizes[owners], levels, edges))]
        clear = ~np.isin(edges, edges[np.isnan(gaps)])
        return (
            np.concatenate([alone, first, second, crowded[clear]]),
            np.concatenate([alone, second, first, crowded[onward][clear]]),
            np.concatenate([one, two, two, edges[clear]]),
        )

    def neighbors(self, used: Bools) -> tuple[Ints, Ints]:
        """(k,) halfedges and (k,) the next ones around their edges, for edges of two, four, ... used triangles.

        Only at those can all successive triangles face opposite ways, since the changes of the winding number around
        an edge add up to 0.
        """
        one, other, edges = self.around_edges(used)
        even = (np.bincount(edges, one != other) % 2 == 0)[edges] & (one != other)
        return one[even], other[even]

    def agreeing_as_indexed(self) -> FaceOrientation:
        """Orient given triangles consistently across edges that exactly two share, with the vertices as indexed.

        Bodies that touch often have vertices of their own where they meet, so that each is oriented by itself.
        """
        return orient_faces(self.given, np.append(self.areas, 0.0)[self.numbers], len(self.positions))

    def outwards_as_indexed(self, reversed: Bools) -> Bools:
        """(k,) `reversed`, negated in each part, connected by index, that encloses a negative volume with it."""
        flipped = (reversed != self.reversed)[:, None]
        parts, volumes = part_volumes(self.positions, np.where(flipped, self.given[:, ::-1], self.given))
        return np.asarray(reversed != (volumes < 0)[parts])

    def agreeing(self, used: Bools) -> FaceOrientation:
        """Orient distinct triangles consistently across edges that exactly two `used` ones share."""
        return orient_faces(self.faces, self.areas * np.sign(self.multiplicities), len(self.positions), used)


def _levels(gaps: Floats, onward: Ints, edges: Ints) -> Ints:
    """(k,) number of the angle of each halfedge around its edge, the same for angles that differ by rounding only.

    `gaps` are the angles to the next halfedge, `onward` its index, and `edges` the edge of each, in sorted order.
    """
    begins = np.empty(len(gaps), dtype=bool)  # whether a new level begins with this halfedge
    begins[onward] = gaps > ANGLE_ROUNDING
    levels = np.cumsum(begins)
    is_first = np.append(True, edges[1:] != edges[:-1])
    before = np.maximum.accumulate(np.where(is_first, levels - begins, 0))  # last level of the edge before
    last = levels[np.append(np.flatnonzero(is_first)[1:], len(levels)) - 1]
    # the first of an edge that begin no level are at the angle of the last ones, across 2π
    return np.where(levels == before, last[np.cumsum(is_first) - 1], levels)
