"""Which way the parts of a surface face: each out of the solid that all of them together bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .stabbing_lines import LineCrossings
from .votes import Votes, containers, votes

LEAST_VOTE = 0.1
"""A surface that bounds nothing gets no votes; of one of area A that a surface of area D would close, (A − D) / (A + D)
of the crossings vote. Below this share (D > .8 A) the surface counts as a sheet."""
LEAST_CLOSED = 0.5
"""From this share on (D < A / 3) a part with holes has an inside that others may lie in."""
HALF = 0.3
"""Level (`geometry.part_levels`) from which a part that few lines cross has an inside: half a ball has .31, three sides
of a box .22. Halved, it turns no other part of 125 shapes and 200 boxes on a sheet; without it 46 boxes are wrong."""
LEAST_AGREEMENT = 0.6
"""From this share of its area on, that given the same way round, a part's own orientation is a hint."""
CERTAIN = 20.0
"""Logarithm of the odds where a closed part's own volume decides."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Properties of the parts of a surface that do not need lines through them, (n_parts,) each.

    Attributes
    ----------
    areas : float
        Areas.
    volumes : float
        Signed volumes, as the parts are oriented now.
    closed : bool
        Whether every edge has two faces.
    levels : float
        Of open parts that few lines cross, as they are oriented now; 0 of others.
    agreement : float
        Share of the area that was given as it is oriented now, at least one half.
    fixed : bool
        Parts that cannot be oriented, or need not be.
    """

    areas: NDArray[np.float64]
    volumes: NDArray[np.float64]
    closed: NDArray[np.bool_]
    levels: NDArray[np.float64]
    agreement: NDArray[np.float64]
    fixed: NDArray[np.bool_]

    @property
    def halves(self) -> NDArray[np.bool_]:
        """(n_parts,) open parts that few lines cross, and whose level says that they have an inside."""
        halves: NDArray[np.bool_] = np.abs(self.levels) >= HALF
        return halves


@dataclass(frozen=True, eq=False)
class PartOrientation:
    """How parts are to face.

    Attributes
    ----------
    odds : (n_parts,) float
        Logarithms of the odds that a part faces the right way; negative for those that must turn.
    decided : (n_parts,) bool
        Whether lines decided. The others have only the orientation they were given.
    nested : (n_parts,) int
        Part in which each lies that is hidden in another; −1 for none.
    cavity : (n_parts,) bool
        Which of the nested parts are walls of cavities.
    """

    odds: NDArray[np.float64]
    decided: NDArray[np.bool_]
    nested: NDArray[np.int64]
    cavity: NDArray[np.bool_]


def orient_parts(parts: Parts, lines: LineCrossings, crossed: NDArray[np.int64]) -> PartOrientation:
    """Let each part face out of the solid, after the lines through them.

    Closed parts first face out of themselves, by the sign of their volume; so do open ones that few lines cross and
    that are at least half of a body, by their own winding numbers. Parts that are seen from outside, closed or open,
    then face to where they are seen from: lines enter a solid where they first meet it. A part hidden in another is a
    body inside a body if both were given the same way round, and the wall of a cavity if not, or if a part was given
    without a clear majority; whatever lies in a cavity is a body. Open parts that cannot be seen face so that lines
    enter and leave in turn. The orientation that was given is a hint as far as it is right for the other parts, or
    wrong for all of them; what bounds nothing follows it alone.
    """
    found = votes(lines.starts, crossed, lines.entering, len(parts.areas))
    outward, is_clear = _outward(parts, found)
    bounding = is_clear & (np.abs(found.own_votes) >= LEAST_CLOSED * found.own)
    bounding = ~parts.fixed & (parts.closed | parts.halves | bounding)
    if np.count_nonzero(found.crossings) > 1:
        within = containers(lines.starts, crossed, lines.entering == (outward[crossed] > 0), bounding)
    else:
        within = np.full(len(crossed), -1)
    nested = _nested(parts, found, bounding, crossed, within)
    cavity = _cavities(parts, outward, nested)
    odds, decided = _by_sight(found)
    hint = _hint(parts, found)
    odds = np.where(decided, odds, 0.0) + hint
    alone = ~parts.fixed & (parts.closed | parts.halves | (nested >= 0) | (~decided & is_clear))
    odds = np.where(alone, CERTAIN * outward * np.where(cavity, -1, 1), odds)
    odds[parts.fixed] = 0
    return PartOrientation(odds, (decided | alone) & ~parts.fixed, nested, cavity)


def _outward(parts: Parts, found: Votes) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The sign that turns each part out of itself, and whether that is clear."""
    flat = np.abs(parts.volumes) <= 1e-12 * parts.areas**1.5
    by_volume = parts.closed & ~flat
    alone = np.where(by_volume, parts.volumes, np.where(parts.halves, parts.levels, found.own_votes))
    return np.where(alone < 0, -1, 1), by_volume | parts.halves | clear(found.own_votes, found.own, LEAST_VOTE)


def clear(balance: NDArray[np.int64] | NDArray[np.float64], cast: NDArray[np.int64], share: float) -> NDArray[np.bool_]:
    """Whether a vote is clear: beyond the share, and beyond two standard deviations of votes at random."""
    return np.abs(balance) > share * cast + 2.0 * np.sqrt(cast)


def _by_sight(found: Votes) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """How clearly parts face to where they are seen from; hidden ones, so that lines enter and leave in turn.

    As logarithms of odds: 6 at most, where all crossings vote and there are many. For hidden parts half of that, and
    the less the fewer parts that are seen are entered and left in turn: overlapping and doubled ones are not.
    """
    seen = clear(found.seen_votes, found.seen, LEAST_VOTE)
    even = clear(found.even_votes, found.even, 2 * LEAST_VOTE) & (3 * found.even > found.crossings)
    in_turn = (np.sign(found.seen_votes) * found.even_votes)[seen].sum() / max(int(found.even[seen].sum()), 1)
    by_seen, by_even = found.seen_votes / (found.seen + 16.0), found.even_votes / (found.even + 16.0)
    return np.where(seen, 6.0 * by_seen, 3.0 * max(in_turn, 0.0) * by_even), seen | even


def _hint(parts: Parts, found: Votes) -> NDArray[np.float64]:
    """Evidence for the orientation as given, from the votes for all other parts, as logarithms of odds: 3 at most.

    Parts of which a tenth was given the other way round count less: so may a small part have been. Votes that are no
    more than chance are no evidence: those of a large sheet say nothing about the small boxes on it.
    """
    trust = np.where(parts.fixed, 0.0, 2 * parts.agreement - 1)
    balance = trust * found.seen_votes
    others, cast = balance.sum() - balance, found.seen.sum() - found.seen
    total = max(float(np.abs(found.seen_votes).sum()), 1.0)
    evident = (parts.agreement >= LEAST_AGREEMENT) & clear(others, cast, 0.0)
    return 3.0 * np.where(evident, others / total, 0.0)


def _nested(
    parts: Parts, found: Votes, bounding: NDArray[np.bool_], crossed: NDArray[np.int64], within: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Part in which each lies that is hidden in another. Whole parts in whole parts must be hidden altogether."""
    n = len(parts.areas)
    inside = within >= 0
    pairs, counts = np.unique(crossed[inside] * n + within[inside], return_counts=True)
    order = np.argsort(counts, kind="stable")  # the last written is the most frequent
    nested = np.full(n, -1, dtype=np.int64)
    nested[pairs[order] // n] = pairs[order] % n
    share = np.bincount(crossed[inside], minlength=n) / np.maximum(found.crossings, 1)
    exposed = found.seen / np.maximum(found.crossings, 1)
    whole = parts.closed & parts.closed[nested]
    hidden = np.where(whole, (exposed <= 0.02) & (share >= 0.9), (share >= 0.5) & (share > 2 * exposed))
    return np.where(hidden & bounding & (nested >= 0), nested, -1)


def _cavities(parts: Parts, outward: NDArray[np.int64], nested: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which nested parts are walls of cavities; from the outermost inwards."""
    hinting = parts.agreement >= LEAST_AGREEMENT
    alike = hinting & hinting[nested] & (outward == outward[nested])
    cavity = np.zeros(len(nested), dtype=bool)
    decided = nested < 0
    while True:
        ready = ~decided & decided[nested]
        if not ready.any():
            return cavity
        cavity[ready] = ~alike[ready] & ~cavity[nested[ready]]
        decided |= ready
