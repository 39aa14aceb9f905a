"""Chains: the distinct triangles of a shape, how often each is there, and which are connected and closed.

Triangles on the same corners are one. Its multiplicity is how often it is given one way minus how often it is given
the other way, which may be 0. A chain whose directed edges all cancel is a *cycle*: it has an integer winding number
off its faces.

Walls of a complex of cells bound nothing where closed cells lie on both sides of them. Each face has two sides. Around
an edge, in order of angle, the sides of neighbouring faces that look at each other bound the same region of space; so
all sides fall into shells, each the whole boundary of a region. Which way the faces run does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..mesh.components import connected_components, element_components, next_in_groups
from ..mesh.edges import EdgeTable, FaceOrientation, edge_table, orient_faces
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.unit_vectors import ANGLE_ROUNDING, angles_around, unit
from ..mesh.welding import ONE_PLACE, coincident_faces, joined_rims, same_positions
from ..search.winding_tree import WindingTree
from ..surfaces.triangle_mesh import TriangleMesh
from .overlaps import OUTSIDE
from .winding import INSIDE_WINDING

CAVITY_SHARE = 0.9
"""A cell is a cavity if at least this share of its area faces into it, and this share of the outside faces outwards.
By chance all six walls of a cell face inwards once in 64 times."""


def inner_walls(chain: Chain) -> Bools:
    """(m,) whether a closed cell lies on both sides of each face, where some edges have three or more faces.

    A complex is a set of faces connected by edges; a cell that lacks a wall is part of the outside. In three cases
    faces with a cell on both sides are not inner: if along each edge of the complex as many faces run one way as the
    other, since it is then the boundary of a solid; if the outside of the complex faces outwards and the walls of one
    of the two cells face into it, since that cell is then a cavity; and if they go on beyond the walls of the cells.
    """
    n, table = len(chain.faces), chain.edges
    if not (table.face_counts > 2).any():
        return np.zeros(n, dtype=bool)
    # halfedges in order of angle around their edges, and the next one after each
    tails, heads = chain.faces.ravel(), np.roll(chain.faces, -1, axis=1).ravel()
    forward, normals = tails < heads, np.repeat(unit(area_vectors(chain.triangles)), 3, axis=0)
    angles = _angles(chain.positions, tails, heads, forward, normals)
    halfedges = np.lexsort((angles, table.face_edges.ravel()))
    forward, angles = forward[halfedges], angles[halfedges]
    edges, faces = table.face_edges.ravel()[halfedges], halfedges // 3
    following = next_in_groups(np.append(0, np.cumsum(table.face_counts)))
    last = following <= np.arange(len(edges))

    # complexes that can have inner walls
    complexes = chain.complexes
    gaps = np.where(last, 2 * np.pi, 0.0) + angles[following] - angles
    many = table.face_counts[edges] > 2
    unclear = many & ~(gaps > ANGLE_ROUNDING)  # also where an angle is NaN
    balance = np.bincount(edges, np.where(forward, 1, -1), len(table.vertices))
    nonmanifold, unbalanced = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    nonmanifold[complexes[faces[many]]] = unbalanced[complexes[faces[balance[edges] != 0]]] = True
    nonmanifold[complexes[faces[unclear]]] = False
    chosen = (nonmanifold & unbalanced)[complexes]

    # shells: sides of faces that bound the same region. Side 2 f is where the normal points to, 2 f + 1 the other
    ahead, behind = 2 * faces + ~forward, 2 * faces + forward
    shells = connected_components(2 * n, ahead, behind[following]).reshape(n, 2)
    front, back = shells.T
    a, b, c = chain.triangles.transpose(1, 0, 2)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volumes = np.where(front != back, volumes, 0.0)  # an open surface has one shell around it
    inside = np.bincount(shells.ravel(), np.stack([-volumes, volumes], axis=1).ravel()) > 0
    cavities = _cavities(shells, inside, np.where(chosen, chain.areas, 0.0))
    inner = chosen & inside[front] & inside[back] & (cavities[front] == cavities[back])
    return inner & ~_reaching_out(chain, inner, chosen & (inside[front] != inside[back]), inside[front])


def _reaching_out(chain: Chain, inner: Bools, outer: Bools, turned: Bools) -> Bools:
    """(m,) whether each face is in a component of inner faces of which more than `OUTSIDE` lies outside the cells.

    `outer`, (m,), are the faces around all cells; those that are `turned` face into them.
    """
    result, rows = np.zeros(len(inner), dtype=bool), np.flatnonzero(inner)
    if not len(rows):
        return result
    around = np.where((turned & outer)[:, None, None], chain.triangles[:, ::-1], chain.triangles)[outer]
    outside = WindingTree.of(around).numbers(chain.triangles[rows].mean(axis=1)) < INSIDE_WINDING
    parts = element_components(chain.edges.face_edges[rows])
    beyond, total = (np.bincount(parts, chain.areas[rows] * share) for share in (outside, 1.0))
    result[rows] = (beyond > OUTSIDE * total)[parts]
    return result


def _angles(positions: Floats, tails: Ints, heads: Ints, forward: Bools, normals: Floats) -> Floats:
    """Return angles of faces around their edges, right-handed from the lower vertex to the higher; NaN if undefined."""
    along = unit(positions[heads] - positions[tails])
    into = np.cross(normals, along)
    angles = angles_around(along * np.where(forward, 1.0, -1.0)[:, None], into)
    return np.where(into.any(axis=1), angles, np.nan)


def _cavities(shells: Ints, inside: Bools, areas: Floats) -> Bools:
    """Find the shells that are cavities: faces face into them, and the whole complex was given facing outwards."""
    front, back = shells.T
    outer = inside[front] != inside[back]
    if areas[outer & inside[back]].sum() < CAVITY_SHARE * areas[outer].sum():
        return np.zeros(len(inside), dtype=bool)
    facing_in = np.bincount(front, areas, len(inside))
    return inside & (facing_in >= CAVITY_SHARE * (facing_in + np.bincount(back, areas, len(inside))))


@dataclass(frozen=True, eq=False)
class Chain(Frozen):
    """Distinct triangles between welded vertices."""

    # (n, 3) of the vertices, relative to the middle of the shape and scaled so that products do not overflow
    positions: Floats
    faces: Ints  # (m, 3) vertices of each distinct triangle, in the direction in which it was given first
    firsts: Ints  # (m,) first triangle of the mesh on the same corners as each
    numbers: Ints  # (k,) distinct triangle of each given one; −1 for those on fewer than three places
    reversed: Bools  # (k,) which given triangles run the other way than their distinct one

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Chain:
        """Make the chain of a mesh."""
        tails, heads = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
        same = same_positions(mesh.vertices)
        ids = joined_rims(mesh.vertices, same[tails], same[heads], ONE_PLACE)[same[mesh.faces]]
        first, backwards = coincident_faces(ids.ravel(), np.arange(0, 3 * len(ids) + 1, 3))
        distinct = np.flatnonzero(first == np.arange(len(ids)))
        numbers = np.full(len(ids) + 1, -1)
        numbers[distinct] = np.arange(len(distinct))
        middle = mesh.bounds.mean(axis=0)
        exponent = int(np.frexp(max(float(np.ptp(mesh.bounds, axis=0).max()), 1e-300))[1])
        positions = np.ldexp(mesh.vertices - middle, -exponent)
        return cls(positions, ids[distinct], distinct, numbers[first], backwards)

    @cached_property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners."""
        return self.positions.take(self.faces, axis=0)

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas."""
        return face_areas(self.triangles)

    @cached_property
    def multiplicities(self) -> Ints:
        """(m,) number of times that each triangle is given as it is, minus the number of times reversed."""
        proper = self.numbers >= 0
        ways = np.where(self.reversed[proper], -1, 1)
        return np.bincount(self.numbers[proper], ways, len(self.faces)).astype(np.int64)

    @cached_property
    def edges(self) -> EdgeTable:
        """Edges of the triangles."""
        return edge_table(self.faces)

    @cached_property
    def complexes(self) -> Ints:
        """(m,) component of each triangle; edges connect any number of triangles."""
        return element_components(self.edges.face_edges) if len(self.faces) else np.zeros(0, dtype=np.int64)

    def unbalanced(self, weights: Ints, groups: Ints) -> Bools:
        """(g,) whether the directed edges of each group of triangles, counted with multiplicity, fail to cancel."""
        return mask_of(int(groups.max(initial=-1)) + 1, self.edges.unbalanced(groups, weights)[0])

    def pieces(self, used: Bools) -> FaceOrientation:
        """Join triangles across edges that two used triangles share; most of the area of each piece stays as given."""
        return orient_faces(self.faces, self.areas * np.sign(self.multiplicities), len(self.positions), used)

    def pieces_as_given(self) -> FaceOrientation:
        """Join triangles across edges along which two of them run in opposite directions."""
        table = edge_table(np.where((self.multiplicities < 0)[:, None], self.faces[:, ::-1], self.faces))
        opposite = table.forward.ravel()[table.pairs].sum(axis=1) == 1
        parts = connected_components(len(self.faces), *table.pairs[opposite].T // 3)
        every = np.ones(int(parts.max(initial=-1)) + 1, dtype=bool)
        return FaceOrientation(parts, self.multiplicities < 0, every, 0)  # nothing is compared
