"""Bodies that overlap, or lie within others, among open pieces.

Gauss's formula asks for a level of ½ on all faces, so that what lies within a body must be a cavity of it. Parts of an
assembly overlap, however, and have bodies within them: there the level is higher by one for each body around.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import scipy
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..search.winding_tree import WindingTree
from .gauss import Dipoles, Matrix, Pieces
from .part_levels import levels_of_pieces

Nesting = Literal["given", "cavities", "bodies"]
SHEET = 0.146
"""Level up to which a piece bounds nothing: it explains less than half of what is to be explained, (½ − .146)² = ½ · ¼.
Flat and wavy sheets have 0, a seventh of a ball .16, half of one .31, all of it ½."""
HINT = 0.5
"""Share of the area of a piece that faces one way, less the rest, from which on it was given that way."""
APART = 0.1
"""Share of a body's area that lies outside of another one from which on they overlap, and of its rims up to which it
lies within."""


class Rims(NamedTuple):
    """Edges where pieces end: their middles (k, 3), lengths (k,) and pieces (k,)."""

    middles: Floats
    lengths: Floats
    owners: Ints


@dataclass(frozen=True, eq=False)
class Bodies:
    """Pieces, and groups of others, that are bodies by themselves.

    Attributes
    ----------
    numbers : (p,) int
        The body that each piece is of, or −1.
    facing : (b,) float
        1 of bodies that face outwards by the signs of their pieces, −1 of others.
    as_given : (b,) bool
        Which were clearly given as bodies that face outwards.
    """

    numbers: Ints
    facing: Floats
    as_given: Bools

    @classmethod
    def of(cls, pieces: Pieces, directed: Floats, groups: Ints, alone: Floats, given: Floats) -> Bodies:
        """Those of directed pieces, of whose area so much faces as it was given."""
        n = len(groups)
        itself = np.abs(alone) >= SHEET
        names, owners = np.unique(np.where(itself, n + np.arange(n), groups), return_inverse=True)
        levels = levels_of_pieces(Pieces(directed, owners[pieces.labels]))
        chosen = np.flatnonzero(np.abs(levels) >= SHEET)
        numbers = np.full(len(names), -1)
        numbers[chosen] = np.arange(len(chosen))
        facing = np.sign(levels[chosen])
        net = np.bincount(owners, given)[chosen] * facing
        return cls(numbers[owners], facing, net >= HINT * np.bincount(owners, pieces.areas)[chosen])


def bodies_around(
    system: Matrix | Dipoles,
    pieces: Pieces,
    rims: Rims,
    groups: Ints,
    alone: Floats,
    signs: Floats,
    given: Floats,
    closed: Floats,
    nested: Nesting,
) -> Floats:
    """(n,) how many open bodies lie around each place of a system, as bodies and not as what it is a cavity in.

    `closed` are triangles of closed bodies, (k, 3, 3), which are not in the system: if a place is of a cavity in one
    of them, they count as −1. A body within others bounds a cavity unless it was clearly given as a body.
    """
    directed = np.where((signs < 0)[pieces.labels, None, None], pieces.triangles[:, ::-1], pieces.triangles)
    bodies = Bodies.of(pieces, directed, groups, alone, signs * given)
    count, n = len(bodies.facing), len(system.places)
    if count < 2 and not (count and len(closed)):
        return np.zeros(n)
    places = np.concatenate([system.places, rims.middles])
    homes = bodies.numbers[np.concatenate([system.owners, rims.owners])]
    own = homes >= 0
    away = np.flatnonzero(~own)
    if len(away):  # what is no body belongs to the nearest one
        homes[away] = homes[own][scipy.spatial.cKDTree(places[own]).query(places[away], workers=-1)[1]]
    rows, others, there = _windings(places, homes, directed, bodies.numbers[pieces.labels], bodies.facing, closed)
    here = homes[rows]
    weights = np.where(own, np.concatenate([system.areas, rims.lengths]), 0.0)
    on_rim = np.arange(len(places)) >= n

    def share(chosen: Bools, level: float, one: Ints, other: Ints) -> Floats:
        """Of the chosen places of one body, how much has this winding number in the other, for each pair."""
        shape = (count + 1, count + 1)
        sums = sparse.coo_array(
            (weights[rows] * (chosen[rows] & (there >= level)), (here, others)), shape=shape
        ).tocsr()
        total = np.bincount(homes, weights * chosen, count + 1)
        return np.asarray(sums[one, other]).ravel() / np.maximum(total[one], np.finfo(float).tiny)

    overlap = np.maximum(share(~on_rim, 0.25, here, others), share(~on_rim, 0.25, others, here)) < 1 - APART
    enclosed = share(on_rim, 0.75, here, others) >= 1 - APART
    every = np.ones(count, dtype=bool)
    stays = {"given": bodies.as_given, "cavities": ~every, "bodies": every}[nested][here]
    among_closed = others == count
    counted = (there > 0.5) & np.where(among_closed, enclosed & ~stays, overlap | (enclosed & stays))
    amount = np.where(among_closed, -np.round(there), 1.0) * counted
    return np.bincount(rows, amount, len(places))[:n].astype(np.float64)


def _windings(
    places: Floats, homes: Ints, triangles: Floats, bodies: Ints, facing: Floats, closed: Floats
) -> tuple[Ints, Ints, Floats]:
    """Places, other bodies whose box they lie in, and their winding numbers; what is closed is one more body."""
    count = len(facing)
    order = np.argsort(bodies, kind="stable")
    cuts = np.searchsorted(bodies[order], np.arange(count + 1))
    rows, others, there = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for body in range(count + 1):
        corners = closed if body == count else triangles[order[cuts[body] : cuts[body + 1]]]
        if not len(corners):
            continue
        inside_box = (places >= corners.min(axis=(0, 1))) & (places <= corners.max(axis=(0, 1)))
        near = np.flatnonzero(inside_box.all(axis=1) & (homes != body))
        if len(near):
            rows.append(near)
            others.append(np.full(len(near), body))
            sign = 1.0 if body == count else facing[body]
            there.append(sign * WindingTree.of(corners).numbers(places[near]))
    return np.concatenate(rows), np.concatenate(others), np.concatenate(there)
