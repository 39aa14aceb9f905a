"""Which walls of a complex of cells bound nothing, since closed cells lie on both sides of them.

Each face has two sides. Around an edge, in order of angle, the sides of neighbouring faces that look at each other
bound the same region of space; so all sides fall into shells, the whole boundary of a region each. Which way the faces
run does not matter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..mesh.components import connected_components
from ..mesh.edges import HalfedgePairs
from ..mesh.unit_vectors import axes_across, unit

SAME_ANGLE = 1e-6
"""Radians between faces around an edge up to which their order is unknown: they lie on each other, but for rounding."""
MOSTLY = 0.9
"""Share of its area that must face into a cell to make it a cavity, if as much of the outside faces outwards: chance
turns all six walls of a cell inwards, and so all of that, once in 64 times."""


def inner_walls(
    positions: Floats,
    pairs: HalfedgePairs,
    tails: Ints,
    heads: Ints,
    owners: NDArray[np.integer],
    normals: Floats,
    areas: Floats,
    volumes: Floats,
) -> Bools:
    """(p,) which faces have a closed cell on both sides, in complexes where some edges have three or more faces.

    A complex is what is connected by edges; a cell that lacks a wall is part of the outside. In two cases faces with a
    cell on both sides are not inner: if along each edge of the complex as many faces run one way as the other, since it
    is then the boundary of a solid as it is; and if the outside of the complex faces outwards and the walls of one of
    the two cells face into it, since that cell is then a cavity.

    Halfedges have tails, heads and owners, faces unit normals (zero without area), areas, and signed volumes of cones
    to one point.
    """
    # halfedges in order of angle around their edges, and the next one after each
    n = len(normals)
    used = np.flatnonzero(pairs.edges >= 0)
    forward = tails[used] < heads[used]
    angles = _angles(positions, tails[used], heads[used], forward, normals[owners[used]])
    order = np.lexsort((angles, pairs.edges[used]))
    halfedges, forward, angles = used[order], forward[order], angles[order]
    edges, faces = pairs.edges[halfedges], owners[halfedges]
    last = np.append(edges[1:] != edges[:-1], True)
    first = np.append(True, last[:-1])
    following = np.arange(1, len(edges) + 1)
    following[last] = np.flatnonzero(first)

    # complexes that have inner walls at all
    complexes = connected_components(n, faces, faces[following])
    gaps = np.where(last, 2 * np.pi, 0.0) + angles[following] - angles
    many = pairs.counts[edges] > 2
    unclear = many & ~(gaps > SAME_ANGLE)  # also where an angle is no number
    balance = np.bincount(edges, np.where(forward, 1, -1), len(pairs.counts))
    nonmanifold, unbalanced = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    nonmanifold[complexes[faces[many]]] = unbalanced[complexes[faces[balance[edges] != 0]]] = True
    nonmanifold[complexes[faces[unclear]]] = False
    chosen = (nonmanifold & unbalanced)[complexes]

    # shells: sides of faces that bound the same region. Side 2 f is where the normal points to, 2 f + 1 the other
    ahead, behind = 2 * faces + ~forward, 2 * faces + forward
    shells = connected_components(2 * n, ahead, behind[following]).reshape(n, 2)
    front, back = shells.T
    volumes = np.where(front != back, volumes, 0.0)  # surface that is open has one shell around it
    inside = np.bincount(shells.ravel(), np.stack([-volumes, volumes], axis=1).ravel()) > 0
    cavities = _cavities(shells, inside, np.where(chosen, areas, 0.0))
    return chosen & inside[front] & inside[back] & (cavities[front] == cavities[back])


def _angles(positions: Floats, tails: Ints, heads: Ints, forward: Bools, normals: Floats) -> Floats:
    """Angles of faces around their edges, right-handed about the direction from the lower vertex to the higher."""
    along = unit(positions[heads] - positions[tails])
    into = np.cross(normals, along)
    aside, across = axes_across(along * np.where(forward, 1.0, -1.0)[:, None])
    x, y = (into * aside).sum(axis=1), (into * across).sum(axis=1)
    return np.where((x != 0) | (y != 0), np.arctan2(y, x), np.nan)


def _cavities(shells: Ints, inside: Bools, areas: Floats) -> Bools:
    """Which shells are those of cavities: faces face into them, where the whole complex was given facing outwards."""
    front, back = shells.T
    outer = inside[front] != inside[back]
    if areas[outer & inside[back]].sum() < MOSTLY * areas[outer].sum():
        return np.zeros(len(inside), dtype=bool)
    facing_in = np.bincount(front, areas, len(inside))
    return inside & (facing_in >= MOSTLY * (facing_in + np.bincount(back, areas, len(inside))))
