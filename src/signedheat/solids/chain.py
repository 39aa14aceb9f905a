"""Chains: the distinct triangles of a shape, how often each is there, and what hangs together and closes.

Triangles on the same corners are one. It is there as often as it is given one way, less how often the other way, and
that may be never. A chain whose directed edges all cancel is a *cycle*: it has an integer winding number off its faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..frozen import Frozen
from ..mesh.components import element_components
from ..mesh.edges import EdgeTable, FaceOrientation, edge_table, orient_faces, pair_halfedges
from ..mesh.triangles import area_vectors
from ..mesh.unit_vectors import unit
from ..mesh.welding import coincident_faces, welded_vertices
from ..surfaces.triangle_mesh import TriangleMesh
from .inner_walls import inner_walls


@dataclass(frozen=True, eq=False)
class Chain(Frozen):
    """Distinct triangles between welded vertices.

    Attributes
    ----------
    positions : (n, 3) float
        Of the vertices, about the middle of the shape and scaled so that no product leaves the range of numbers.
    faces : (m, 3) int
        Vertices of each distinct triangle, in the direction in which it was given first.
    firsts : (m,) int
        Triangle of the mesh that each was given by first.
    numbers : (k,) int
        Distinct triangle of each that was given; −1 of those on fewer than three places.
    reversed : (k,) bool
        Which of them run the other way.
    """

    positions: Floats
    faces: Ints
    firsts: Ints
    numbers: Ints
    reversed: Bools

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Chain:
        """Return that of a mesh."""
        tails, heads = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
        ids = welded_vertices(mesh.vertices, tails, heads)[mesh.faces]
        first, backwards = coincident_faces(ids.ravel(), np.arange(0, 3 * len(ids) + 1, 3))
        distinct = np.flatnonzero(first == np.arange(len(ids)))
        distinct = distinct[
            (np.sort(ids[distinct], axis=1)[:, 1:] != np.sort(ids[distinct], axis=1)[:, :-1]).all(axis=1)
        ]
        numbers = np.full(len(ids) + 1, -1)
        numbers[distinct] = np.arange(len(distinct))
        middle = mesh.bounds.mean(axis=0)
        exponent = int(np.frexp(max(float(np.ptp(mesh.bounds, axis=0).max()), 1e-300))[1])
        positions = np.ldexp(mesh.vertices - middle, -exponent)
        return cls(positions, ids[distinct], distinct, numbers[first], backwards)

    @cached_property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners."""
        return self.positions[self.faces]

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas."""
        return np.linalg.norm(area_vectors(self.triangles), axis=1)

    @cached_property
    def multiplicities(self) -> Ints:
        """(m,) how often each triangle is there as it is, less how often reversed."""
        there = self.numbers >= 0
        ways = np.where(self.reversed[there], -1, 1)
        return np.bincount(self.numbers[there], ways, len(self.faces)).astype(np.int64)

    @cached_property
    def edges(self) -> EdgeTable:
        """Of the triangles."""
        return edge_table(self.faces)

    @cached_property
    def complexes(self) -> Ints:
        """(m,) what hangs together by edges, however many faces these have."""
        return element_components(self.edges.face_edges) if len(self.faces) else np.zeros(0, dtype=np.int64)

    def unbalanced(self, weights: NDArray[np.integer], groups: Ints) -> Bools:
        """(g,) which groups of triangles, each there so often, have directed edges that do not cancel."""
        n = len(self.edges.vertices)
        keys = (groups[:, None] * n + self.edges.face_edges).ravel()
        sides, inverse = np.unique(keys, return_inverse=True)
        ways = (np.where(self.edges.forward, 1, -1) * weights[:, None]).ravel()
        open_sides = np.bincount(inverse, ways, len(sides)) != 0
        result = np.zeros(int(groups.max(initial=-1)) + 1, dtype=bool)
        result[sides[open_sides] // n] = True
        return result

    def walls(self) -> Bools:
        """(m,) walls between closed cells, which bound nothing: see `inner_walls`."""
        if not len(self.faces) or not (self.edges.face_counts > 2).any():
            return np.zeros(len(self.faces), dtype=bool)
        tails, heads = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        owners = np.repeat(np.arange(len(self.faces)), 3)
        a, b, c = self.triangles.transpose(1, 0, 2)
        volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
        pairs = pair_halfedges(tails, heads, len(self.positions))
        normals = unit(area_vectors(self.triangles))
        return inner_walls(self.positions, pairs, tails, heads, owners, normals, self.areas, volumes)

    def pieces(self, used: Bools) -> FaceOrientation:
        """Triangles that hang together across edges that two of those used have, and how they agree.

        Most of the area of each piece stays as it was given.
        """
        tails, heads = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        owners = np.repeat(np.arange(len(self.faces)), 3)
        pairs = pair_halfedges(tails, heads, len(self.positions), used[owners])
        return orient_faces(pairs, tails, owners, self.areas * np.sign(self.multiplicities))

    def pieces_as_given(self) -> FaceOrientation:
        """Triangles that hang together across edges of two that run along them in opposite directions."""
        table = edge_table(np.where((self.multiplicities < 0)[:, None], self.faces[:, ::-1], self.faces))
        joins = (table.face_counts == 2) & (table.balance == 0)
        alone = len(table.vertices) + np.arange(self.faces.size).reshape(-1, 3)
        parts = element_components(np.where(joins[table.face_edges], table.face_edges, alone))
        every = np.ones(int(parts.max(initial=-1)) + 1, dtype=bool)
        return FaceOrientation(parts, self.multiplicities < 0, every, every, 0)  # nothing is compared
