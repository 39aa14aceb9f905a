"""Readings of a shape: which of its triangles count, how often, and which way they run.

A broken shape can be read in more than one way. *As given* changes nothing: triangles count as often as they are
there, and what is there once each way cancels. The indices of a mesh say more where bodies touch: *as given* is also
read once triangles agree that share an edge by index, and once what is connected by index faces outwards. *Once* looks
at places alone: it takes each triangle once, but for walls between closed cells, and turns those to agree that share an
edge with no third one.

A reading is judged by the share of the area that it leaves unexplained. The winding number is a whole number on both
sides of a face that bounds a solid, and at least 1 behind it; a face that does not count lies inside.
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
"""Number of places at which a reading is judged, besides one for each part."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Triangles of a chain that count, in pieces that face one way as a whole."""

    counts: Ints  # (m,) how often each triangle counts, negative if reversed; 0 for those that cancel, and for walls
    turned: Bools  # (m,) which run the other way than they were given first
    pieces: Ints  # (m,) piece of each triangle
    orientable: Bools  # (p,) pieces whose triangles can agree
    disagreeing: int  # number of pairs of neighbours that disagreed
    reversed: Bools  # (k,) which given triangles run the other way than their distinct one
    whole: Bools  # (m,) which are in complexes that close as given and face one way


def as_given(chain: Chain, reversed: Bools) -> Reading:
    """Read a chain as it was given, but for the (k,) given triangles that run the other way than their distinct one.

    Copies count as often as they are there, or once if that leaves no more edges open.
    """
    complexes, often = chain.complexes, chain.multiplicities_with(reversed)
    left_open, left_once = (chain.open_edges(counts, complexes) for counts in (often, np.sign(often)))
    counts = np.where((left_once <= left_open)[complexes], np.sign(often), often)
    closes = (np.minimum(left_open, left_once) == 0) & (np.bincount(complexes, counts != 0) > 0)
    whole = _one_way(chain, counts, closes)
    turned = np.zeros(len(counts), dtype=bool)
    if whole.all():
        every = np.ones(int(complexes.max(initial=-1)) + 1, dtype=bool)
        return Reading(counts, turned, complexes, every, 0, reversed, whole)
    used = (counts != 0) & ~whole
    one, other = chain.neighbors(used)
    forward = chain.edges.forward.ravel() != np.repeat(counts < 0, 3)
    opposite = forward[one] != forward[other]
    parts = connected_components(len(counts), one[opposite] // 3, other[opposite] // 3)
    pieces = np.unique(np.where(whole, len(parts) + complexes, parts), return_inverse=True)[1]
    every = np.ones(int(pieces.max()) + 1, dtype=bool)
    return Reading(counts, ~whole & (counts < 0), pieces, every, 0, reversed, whole)


def _one_way(chain: Chain, counts: Ints, closes: Bools) -> Bools:
    """(m,) whether each triangle is in one of the complexes that close and that face outwards, or inwards, as a whole.

    The winding numbers of a cycle are the same all over a piece, so that one triangle of each is enough.
    """
    if not closes.any():
        return np.zeros(len(counts), dtype=bool)
    chosen = np.flatnonzero(closes[chain.complexes] & (counts != 0))
    parts = chain.joined(counts != 0)[chosen]
    order = np.lexsort((-chain.areas[chosen], parts))
    largest = order[np.unique(parts[order], return_index=True)[1]]
    levels = levels_within(chain.triangles[chosen], chain.complexes[chosen], counts[chosen], largest)
    owners = chain.complexes[chosen[largest]]
    ahead, back = (np.bincount(owners, sign * levels < 0.25, len(closes)) == 0 for sign in (1, -1))
    return np.asarray((closes & (ahead | back))[chain.complexes])


def once(chain: Chain) -> Reading:
    """Read each triangle once, without walls between closed cells, turned to agree across edges of two of them."""
    used = ~walls(chain)
    agreed = chain.agreeing(used)
    counts = np.where(agreed.turned, -1, 1) * (agreed.orientable[agreed.parts] & used)
    nothing = np.zeros(len(counts), dtype=bool)
    turned = agreed.turned & used
    return Reading(counts, turned, agreed.parts, agreed.orientable, agreed.disagreeing, chain.reversed, nothing)


def walls(chain: Chain) -> Bools:
    """(m,) whether a closed cell lies on both sides of each triangle, where some edges have three or more triangles.

    Around an edge, in order of angle, the sides of neighbouring triangles that look at each other bound the same
    region of space; so all sides fall into shells, each the whole boundary of a region. Which way the triangles run
    does not matter. A cell that lacks a wall is part of the outside.
    """
    n = len(chain.faces)
    crowded = (chain.edges.face_counts > 2)[chain.edges.face_edges].any(axis=1)
    chosen = np.bincount(chain.complexes, crowded)[chain.complexes] > 0
    if not chosen.any():
        return chosen
    one, other, _ = chain.around_edges(chosen)
    unclear = np.repeat(chosen, 3)
    unclear[one] = False
    chosen &= np.bincount(chain.complexes, unclear.reshape(n, 3).any(axis=1))[chain.complexes] == 0
    # side 2 f is where the normal points to, 2 f + 1 the other one
    forward = (chain.faces < np.roll(chain.faces, -1, axis=1)).ravel()
    shells = connected_components(2 * n, 2 * (one // 3) + ~forward[one], 2 * (other // 3) + forward[other])
    front, back = shells.reshape(n, 2).T
    ways = np.where(front != back, np.array([[-1], [1]]), 0).ravel()  # an open surface has one shell around it
    inside = cone_volumes(np.concatenate([chain.triangles] * 2), ways, np.concatenate([front, back]), 2 * n) > 0
    return chosen & inside[front] & inside[back]


def mixed(chain: Chain, readings: Sequence[Reading], chosen: Ints) -> Reading:
    """Read each triangle of a chain by one of several readings, (m,) their indices."""
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
    ways = np.stack([reading.reversed for reading in readings])[given, np.arange(len(given))]
    return Reading(counts, turned, labels, orientable, disagreeing, ways, whole)


def unexplained(chain: Chain, counts: Ints, pieces: Ints) -> Floats:
    """(p,) share of the area of each piece that triangles with these counts leave unexplained; −1 is left out.

    The winding number is whole on both sides of a triangle that is explained: at least 1 behind it, and if it does not
    count also in front of it. The square of what is missing is averaged, up to half a turn.
    """
    rows = np.flatnonzero(pieces >= 0)
    faces, places = sampled(Pieces(chain.triangles[rows], pieces[rows]), LEVEL_SAMPLES)
    faces, count = rows[faces], int(pieces.max(initial=-1)) + 1
    own, counting = counts[faces], directed(chain.triangles, counts)
    if not len(counting):
        return np.ones(count)
    steps = steps_off(chain.triangles[faces], OFF_FACE) * np.where(own < 0, -1.0, 1.0)[:, None]
    tree = WindingTree.of(counting)
    behind, ahead = tree.numbers(places - steps), tree.numbers(places + steps)
    off = behind - np.maximum(np.round(behind), 1.0), ahead - np.maximum(np.round(ahead), np.where(own != 0, 0.0, 1.0))
    missing = 4.0 * np.maximum(*np.square(off))
    return means(np.minimum(missing, 1.0), pieces[faces], np.ones(len(faces)), count)
