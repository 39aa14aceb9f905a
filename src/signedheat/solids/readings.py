"""Readings of a shape: which of its triangles count, how often, and which way they run.

A broken shape can be read in more than one way. *As given* changes nothing: triangles count as often as they are
there, and opposite copies cancel. The indices of a mesh say more where bodies touch. So it is also read as given after
triangles that share an edge by index were oriented consistently, and after parts that are connected by index were
oriented outwards. *Once* uses positions alone: each triangle counts once, except for walls between closed cells, and
triangles are oriented consistently across edges that exactly two of them share.

A reading is judged by the share of the area that it leaves unexplained. The winding number is a whole number on both
sides of a face that bounds a solid, and at least 1 behind it. A face that does not count lies inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..mesh.components import connected_components
from ..mesh.triangles import cone_volumes
from ..search.winding_tree import OFF_FACE, WindingTree, steps_off
from .chain import Chain
from .gauss import Pieces, means, sampled
from .overlaps import directed, levels_within

LEVEL_SAMPLES = 10_000
"""Number of points at which a reading is judged, besides one for each part."""


@dataclass(frozen=True, eq=False)
class Reading:
    """How often the triangles of a chain count, in consistently oriented pieces."""

    counts: Ints  # (m,) how often each triangle counts, negative if reversed; 0 for those that cancel, and for walls
    turned: Bools  # (m,) which are flipped from the orientation in which they were given first
    pieces: Ints  # (m,) piece of each triangle
    orientable: Bools  # (p,) pieces whose triangles can be oriented consistently
    disagreeing: int  # number of pairs of neighbours that were oriented inconsistently
    reversed: Bools  # (k,) which given triangles run opposite to their distinct one
    whole: Bools  # (m,) which are in components that are closed as given and face outwards, or inwards, as a whole


def as_given(chain: Chain, reversed: Bools) -> Reading:
    """Read a chain as given; `reversed` tells which of the (k,) given triangles run opposite to their distinct one.

    Copies count as often as they are there, or once if that leaves no more edges open.
    """
    complexes, multiplicities = chain.complexes, chain.multiplicities_with(reversed)
    left_open, left_once = (chain.open_edges(counts, complexes) for counts in (multiplicities, np.sign(multiplicities)))
    counts = np.where((left_once <= left_open)[complexes], np.sign(multiplicities), multiplicities)
    closes = (np.minimum(left_open, left_once) == 0) & (np.bincount(complexes, counts != 0) > 0)
    whole = _closed_one_way(chain, counts, closes)
    turned = np.zeros(len(counts), dtype=bool)
    if whole.all():
        every = np.ones(int(complexes.max(initial=-1)) + 1, dtype=bool)
        return Reading(counts, turned, complexes, every, 0, reversed, whole)
    # pieces: whole complexes, and triangles that are connected where they run along an edge in opposite directions
    used = (counts != 0) & ~whole
    halfedges, next_halfedges = chain.neighbors(used)
    forward = chain.edges.forward.ravel() != np.repeat(counts < 0, 3)
    opposite = forward[halfedges] != forward[next_halfedges]
    parts = connected_components(len(counts), halfedges[opposite] // 3, next_halfedges[opposite] // 3)
    pieces = np.unique(np.where(whole, len(parts) + complexes, parts), return_inverse=True)[1]
    every = np.ones(int(pieces.max()) + 1, dtype=bool)
    return Reading(counts, ~whole & (counts < 0), pieces, every, 0, reversed, whole)


def _closed_one_way(chain: Chain, counts: Ints, closes: Bools) -> Bools:
    """(m,) whether the complex of each triangle is closed, (c,) `closes`, and faces outwards, or inwards, as a whole.

    Levels of a closed complex are the same all over a piece, so that one triangle of each piece is enough: the largest.
    On a complex that faces outwards they are at least ½, and at most −½ if it faces inwards.
    """
    if not closes.any():
        return np.zeros(len(counts), dtype=bool)
    chosen = np.flatnonzero(closes[chain.complexes] & (counts != 0))
    parts = chain.joined(counts != 0)[chosen]
    order = np.lexsort((-chain.areas[chosen], parts))
    largest = order[np.unique(parts[order], return_index=True)[1]]
    levels = levels_within(chain.triangles[chosen], chain.complexes[chosen], counts[chosen], largest)
    owners = chain.complexes[chosen[largest]]
    outwards, inwards = (np.bincount(owners, sign * levels < 0.25, len(closes)) == 0 for sign in (1, -1))
    return np.asarray((closes & (outwards | inwards))[chain.complexes])


def once(chain: Chain) -> Reading:
    """Read each triangle once, without walls between closed cells, consistently oriented across edges of two."""
    used = ~walls(chain)
    agreed = chain.agreeing(used)
    counts = np.where(agreed.turned, -1, 1) * (agreed.orientable[agreed.parts] & used)
    nothing = np.zeros(len(counts), dtype=bool)
    turned = agreed.turned & used
    return Reading(counts, turned, agreed.parts, agreed.orientable, agreed.disagreeing, chain.reversed, nothing)


def walls(chain: Chain) -> Bools:
    """(m,) whether each triangle is a wall between two closed cells; only meshes with edges of three or more have any.

    Around an edge, in order of angle, the sides of neighbouring triangles that face each other bound the same region
    of space. So all sides fall into shells, each the whole boundary of a region. The orientation of triangles does not
    matter. A cell that lacks a wall is part of the outside.
    """
    n = len(chain.faces)
    crowded = (chain.edges.face_counts > 2)[chain.edges.face_edges].any(axis=1)
    chosen = np.bincount(chain.complexes, crowded)[chain.complexes] > 0
    if not chosen.any():
        return chosen
    halfedges, next_halfedges, _ = chain.around_edges(chosen)
    unclear = np.repeat(chosen, 3)
    unclear[halfedges] = False
    chosen &= np.bincount(chain.complexes, unclear.reshape(n, 3).any(axis=1))[chain.complexes] == 0
    # side 2 f is where the normal points to, 2 f + 1 the other one
    forward = (chain.faces < np.roll(chain.faces, -1, axis=1)).ravel()
    shells = connected_components(
        2 * n, 2 * (halfedges // 3) + ~forward[halfedges], 2 * (next_halfedges // 3) + forward[next_halfedges]
    )
    front, back = shells.reshape(n, 2).T
    signs = np.where(front != back, np.array([[-1], [1]]), 0).ravel()  # an open surface has one shell around it
    inside = cone_volumes(np.concatenate([chain.triangles] * 2), signs, np.concatenate([front, back]), 2 * n) > 0
    return chosen & inside[front] & inside[back]


def mixed(chain: Chain, readings: Sequence[Reading], chosen: Ints) -> Reading:
    """Combine readings of a chain; `chosen`, (m,), are the indices of the readings to use for its triangles."""
    if (chosen == chosen[:1]).all():
        return readings[int(chosen[0])] if len(chosen) else readings[0]
    rows = np.arange(len(chosen))
    counts, turned, whole = (
        np.stack([getattr(reading, name) for reading in readings])[chosen, rows]
        for name in ("counts", "turned", "whole")
    )
    firsts = np.cumsum([0, *(len(reading.orientable) for reading in readings)])
    pieces = np.stack([reading.pieces + first for reading, first in zip(readings, firsts[:-1], strict=True)])
    used, labels = np.unique(pieces[chosen, rows], return_inverse=True)
    orientable = np.concatenate([reading.orientable for reading in readings])[used]
    disagreeing = max(reading.disagreeing for reading in readings)
    given = np.append(chosen, 0)[chain.numbers]
    reversed_triangles = np.stack([reading.reversed for reading in readings])[given, np.arange(len(given))]
    return Reading(counts, turned, labels, orientable, disagreeing, reversed_triangles, whole)


def unexplained(chain: Chain, counts: Ints, pieces: Ints) -> Floats:
    """(p,) share of the area of each piece that is not explained if triangles have (m,) counts.

    `pieces`, (m,), are −1 for triangles to leave out. The winding number is whole on both sides of a triangle that is
    explained. It is at least 1 behind it, and if the triangle does not count also in front of it. Four times the square
    of what is missing, at most 1, is averaged.
    """
    rows = np.flatnonzero(pieces >= 0)
    faces, points = sampled(Pieces(chain.triangles[rows], pieces[rows]), LEVEL_SAMPLES)
    faces, count = rows[faces], int(pieces.max(initial=-1)) + 1
    own, counted_triangles = counts[faces], directed(chain.triangles, counts)
    if not len(counted_triangles):
        return np.ones(count)
    steps = steps_off(chain.triangles[faces], OFF_FACE) * np.where(own < 0, -1.0, 1.0)[:, None]
    tree = WindingTree.of(counted_triangles)
    behind, ahead = tree.numbers(points - steps), tree.numbers(points + steps)
    off = behind - np.maximum(np.round(behind), 1.0), ahead - np.maximum(np.round(ahead), np.where(own != 0, 0.0, 1.0))
    missing = 4.0 * np.maximum(*np.square(off))
    return means(np.minimum(missing, 1.0), pieces[faces], np.ones(len(faces)), count)
