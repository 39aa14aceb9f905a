"""Bodies that overlap, or lie within others, among open pieces.

Gauss's formula asks for a level of ½ on all faces, so that what lies within a body must be a cavity of it. Parts of an
assembly overlap, however, and have bodies within them. What is a body by itself therefore does not see the others,
unless one of the two is a cavity in the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..mesh.box_tree import BoxTree
from ..search.winding_tree import WindingTree
from .gauss import Dipoles, Matrix, Pieces
from .part_levels import levels_of_pieces
from .winding import INSIDE

Nesting = Literal["given", "cavities", "bodies"]
SHEET = 0.146
"""Level up to which a piece bounds nothing: it explains less than half of what is to be explained, (½ − .146)² = ½ · ¼.
Flat and wavy sheets have 0, a seventh of a ball .16, half of one .31, all of it ½."""
HINT = 0.5
"""Share of the area of a piece that faces one way, less the rest, from which on it was given that way."""
APART = 0.05
"""Share of a body's area outside of another one from which on they overlap, and of its rims up to which it lies within.
The rims of a bowl's or a vase's inside lie half outside its outside."""


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
    levels : (b,) float
        Their levels by the signs of their pieces, negative of those that face inwards.
    as_given : (b,) bool
        Which were clearly given as bodies that face outwards.
    """

    numbers: Ints
    levels: Floats
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
        net = np.bincount(owners, given)[chosen] * np.sign(levels[chosen])
        return cls(numbers[owners], levels[chosen], net >= HINT * np.bincount(owners, pieces.areas)[chosen])


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
    """(n,) winding numbers, at the places of a system, of the bodies that each place ignores.

    It sees its own body, the body in which this is a cavity, and the cavities in it; bodies beside it, and those that
    overlap or contain it as bodies, it ignores. A piece of no body belongs to the nearest one. `nested` decides which
    bodies within others are cavities; as given, all but those whose faces clearly faced outwards (`HINT`). The system
    lacks what is closed, (k, 3, 3): its winding numbers are negative at places of cavities in it.

    Pieces have levels by themselves, first signs, and areas that face as given, less the rest, (p,) each.
    """
    directed = np.where((signs < 0)[pieces.labels, None, None], pieces.triangles[:, ::-1], pieces.triangles)
    bodies = Bodies.of(pieces, directed, groups, alone, signs * given)
    count, n = len(bodies.levels), len(system.places)
    if count < 2 and not (count and len(closed)):
        return np.zeros(n)
    numbers = bodies.numbers[pieces.labels]
    directed = np.where((bodies.levels < 0)[numbers, None, None], directed[:, ::-1], directed)
    places = np.concatenate([system.places, rims.middles])
    homes = bodies.numbers[np.concatenate([system.owners, rims.owners])]
    own = homes >= 0
    away = np.flatnonzero(~own)
    if len(away):
        homes[away] = homes[own][scipy.spatial.cKDTree(places[own]).query(places[away], workers=-1)[1]]
    normals = np.concatenate([system.normals, np.zeros(rims.middles.shape)])
    sizes = np.concatenate([system.areas, rims.lengths])
    parts = parts_of(directed[np.argsort(numbers, kind="stable")], np.sort(numbers), count, closed)
    rows, others, there = _windings(places, normals, sizes, parts)
    here = homes[rows]
    weights = np.where(own, sizes, 0.0)
    on_rim = np.arange(len(places)) >= n

    def mean(chosen: Bools, values: NDArray[Any], one: Ints, other: Ints) -> Floats:
        """Over the chosen places of one body, 0 where these are not in the box of the other, for each pair."""
        entries, shape = weights[rows] * chosen[rows] * values, (count + 1, count + 1)
        sums = sparse.coo_array((entries, (here, others)), shape=shape).tocsr()
        total = np.bincount(homes, weights * chosen, count + 1)
        return np.asarray(sums[one, other]).ravel() / np.maximum(total[one], np.finfo(float).tiny)

    full = 2 * np.abs(np.append(bodies.levels, 0.5))[others]
    share = np.clip(there / full, 0.0, 1.0)  # 1 as if nothing of the other body was gone
    surface_within = np.maximum(*(mean(~on_rim, share > INSIDE, *pair) for pair in ((here, others), (others, here))))
    not_nested, enclosed = surface_within < 1 - APART, mean(on_rim, share, here, others) >= 1 - APART
    every = np.ones(count, dtype=bool)
    stays = {"given": bodies.as_given, "cavities": ~every, "bodies": every}[nested][here]
    ignored = (here != others) & (not_nested | (enclosed & stays))
    subtracted = np.where(others == count, enclosed & ~stays, ~ignored) & (rows < n)
    everything = WindingTree.of(np.concatenate(parts[:count]))
    around = everything.levels(system.places, system.normals, system.areas)
    return around - np.bincount(rows[subtracted], there[subtracted], n)


def parts_of(triangles: Floats, numbers: Ints, count: int, closed: Floats) -> list[Floats]:
    """Triangles of each body, from ascending numbers of bodies of all; what is closed, if anything is, is one more."""
    parts = np.split(triangles, np.searchsorted(numbers, np.arange(count + 1)))[1:]
    return [*parts[:count], closed] if len(closed) else parts[:count]


def _windings(places: Floats, normals: Floats, sizes: Floats, parts: list[Floats]) -> tuple[Ints, Ints, Floats]:
    """Places, bodies whose box they lie in, and their winding numbers there: means of both sides of faces."""
    boxes = np.array([(corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for corners in parts])
    starts, others = BoxTree.of(boxes[:, 0], boxes[:, 1]).meeting(np.repeat(places[:, None], 3, axis=1))
    rows = np.repeat(np.arange(len(places)), np.diff(starts))
    inside_box = (places[rows] >= boxes[others, 0]) & (places[rows] <= boxes[others, 1])
    kept = np.flatnonzero(inside_box.all(axis=1))
    kept = kept[np.argsort(others[kept], kind="stable")]
    rows, others, there = rows[kept], others[kept], np.zeros(len(kept))
    for body, (begin, end) in enumerate(pairwise(np.searchsorted(others, np.arange(len(parts) + 1)))):
        if end > begin:
            some = rows[begin:end]
            there[begin:end] = WindingTree.of(parts[body]).levels(places[some], normals[some], sizes[some])
    return rows, others, there
