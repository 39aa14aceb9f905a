"""Levels of pieces, and bodies among open pieces that overlap, or lie within others.

The winding number jumps by one across a face. Its mean on both sides, the level, is ½ on a closed surface that faces
outwards, −½ on one that faces inwards, and 0 on a flat sheet; values between tell how much of a body triangles are.

Gauss's formula asks for a level of ½ on all faces, so that what lies within a body must be a cavity of it. Parts of an
assembly overlap, however, and have bodies within them. What is a body by itself therefore ignores every other body,
unless one of the two is a cavity in the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.box_tree import BoxTree
from ..mesh.components import grouped
from ..parallel import PointTree
from ..search.winding_tree import WindingTree, mean_angle
from .gauss import TREE_FACES, Dipoles, Matrix, Pieces, sampled
from .winding import INSIDE_WINDING, SUMMED_POINTS


def directed(triangles: Floats, counts: Floats | Ints) -> Floats:
    """(k, 3, 3) triangles: each of (m, 3, 3) repeated by its count, and reversed where the count is negative."""
    copies = np.repeat(np.arange(len(counts)), np.abs(counts).astype(np.int64))
    return np.where((counts[copies] < 0)[:, None, None], triangles[copies, ::-1], triangles[copies])


def levels_within(triangles: Floats, groups: Ints, counts: Ints, faces: Ints) -> Floats:
    """(n,) levels at the centres of the (n,) `faces`, each due to the triangles of its own group only.

    Triangles are (m, 3, 3), their `groups` and `counts`, how often each is there, (m,).
    """
    unique_groups, labels = np.unique(groups, return_inverse=True)
    starts, order = grouped(labels, len(unique_groups))
    rank = np.argsort(order)
    corners = np.ascontiguousarray(triangles[order]).reshape(-1, 9)
    # sums over all triangles where points or triangles are few, and else a tree for each group
    owners = labels[faces]
    summed = (np.bincount(owners)[owners] <= SUMMED_POINTS) | (np.diff(starts)[owners] <= TREE_FACES)
    levels, few = np.zeros(len(faces)), np.flatnonzero(summed)
    levels[few] = _among_few(corners, starts, counts[order], rank[faces[few]], owners[few])
    for group in np.unique(owners[~summed]):
        chosen = np.flatnonzero(owners == group)
        members = order[starts[group] : starts[group + 1]]
        tree = WindingTree.of(directed(triangles[members], counts[members]))
        levels[chosen] = tree.levels(triangles[faces[chosen]].mean(axis=1))
    return levels


def levels_of_pieces(pieces: Pieces) -> Floats:
    """(p,) mean level on each piece, due to this piece only."""
    faces, _ = sampled(pieces, 4096)
    levels = levels_within(pieces.triangles, pieces.labels, np.ones(len(pieces.labels), dtype=np.int64), faces)
    owners = pieces.labels[faces]
    return np.bincount(owners, levels, len(pieces.areas)) / np.bincount(owners, minlength=len(pieces.areas))


@compiled
def _among_few(corners: Floats, starts: Ints, counts: Ints, faces: Ints, groups: Ints) -> Floats:
    """(n,) levels at the centres of `faces`, summed over the triangles of their `groups`, (n,) both.

    Triangles have (m, 9) `corners`, group by group from `starts` on, and (m,) `counts`.
    """
    levels = np.zeros(len(faces))
    for row in range(len(faces)):  # without the face itself, whose level at its own centre is 0
        i, group = faces[row], groups[row]
        x = (corners[i, 0] + corners[i, 3] + corners[i, 6]) / 3
        y = (corners[i, 1] + corners[i, 4] + corners[i, 7]) / 3
        z = (corners[i, 2] + corners[i, 5] + corners[i, 8]) / 3
        total = 0.0
        for j in range(starts[group], starts[group + 1]):
            if j != i:
                total += counts[j] * mean_angle(corners, j, x, y, z)
        levels[row] = total / (4.0 * np.pi)
    return levels


Nesting = Literal["given", "cavities", "bodies"]
SHEET = 0.146
"""Level below which a piece bounds nothing: its squared distance from ½ is more than half of that of a flat sheet,
(½ − 0.146)² = ½ · ¼. Flat and wavy sheets have 0, a seventh of a ball 0.16, half of one 0.31, all of it ½."""
HINT = 0.25
"""The given orientation of a piece is trusted if the area that faces one way exceeds the rest by this share of all.
Half of it changes nothing; with twice as much, hidden bodies with a fifth of their faces flipped become cavities in 8
of 12 scenes."""
OUTSIDE = 0.05
"""Two bodies overlap if a larger share of the area of one lies outside the other; a body lies within another one if at
most this share of its rims is outside. Half of the rims of the inside of a bowl or a vase lie outside its outside."""


class Rims(NamedTuple):
    """Boundary edges of pieces."""

    middles: Floats  # (k, 3) midpoints
    lengths: Floats  # (k,)
    owners: Ints  # (k,) piece of each edge


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies: single pieces that are bodies by themselves, and groups of other pieces that are."""

    numbers: Ints  # (p,) the body that each piece belongs to, or −1
    levels: Floats  # (b,) levels of the bodies as their pieces are directed, negative if they face inwards
    as_given: Bools  # (b,) which were clearly given as bodies that face outwards

    @classmethod
    def of(cls, pieces: Pieces, corners: Floats, groups: Ints, alone: Floats, given: Floats) -> Bodies:
        """Find the bodies among oriented pieces; `corners` are (m, 3, 3), and `groups` (p,) those that are connected.

        `alone` are the (p,) levels of pieces by themselves, `given` the (p,) area that faces as given, less the rest.
        """
        # candidates: each piece that is a body by itself, and the rest of each group
        n = len(groups)
        by_itself = np.abs(alone) >= SHEET
        names, candidates = np.unique(np.where(by_itself, n + np.arange(n), groups), return_inverse=True)
        levels = levels_of_pieces(Pieces(corners, candidates[pieces.labels]))
        chosen = np.flatnonzero(np.abs(levels) >= SHEET)
        numbers = np.full(len(names), -1)
        numbers[chosen] = np.arange(len(chosen))
        # area that was given as it must be to face outwards, less the rest
        net = np.bincount(candidates, given)[chosen] * np.sign(levels[chosen])
        return cls(numbers[candidates], levels[chosen], net >= HINT * np.bincount(candidates, pieces.areas)[chosen])


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
    united: bool,
) -> Floats:
    """(n,) winding number, at each sample of a system, of the bodies that this sample ignores.

    A sample counts its own body, the body in which this is a cavity, and cavities in it. It ignores all others.
    `nested` decides which bodies within others are cavities. Bodies that overlap ignore each other if they are to be
    `united`. For each of p pieces, (p,), there are its connected group in `groups`, its mean level without the others
    in `alone`, its sign, and in `given` its area that faces as given, less the rest. `rims` are the boundary edges of
    pieces, and `closed` the (k, 3, 3) triangles of closed pieces.
    """
    triangles = directed(pieces.triangles, signs[pieces.labels])
    bodies = Bodies.of(pieces, triangles, groups, alone, signs * given)
    count, n = len(bodies.levels), len(system.points)
    if count < 2 and not (count and len(closed)):
        return np.zeros(n)
    numbers = bodies.numbers[pieces.labels]
    triangles = directed(triangles, np.sign(bodies.levels)[numbers])
    # samples and points on rims, each at home in a body: its own, or that of the nearest point that has one
    points = np.concatenate([system.points, rims.middles])
    homes = bodies.numbers[np.concatenate([system.owners, rims.owners])]
    has_own = homes >= 0
    homeless = np.flatnonzero(~has_own)
    if len(homeless):
        homes[homeless] = homes[has_own][PointTree(points[has_own]).query(points[homeless])[1]]
    sizes = np.concatenate([system.areas, rims.lengths])
    # all pairs of a point and a body in whose box it lies: indices of both, winding number, and home of the point
    order = np.argsort(numbers, kind="stable")
    parts = np.split(triangles[order], np.searchsorted(numbers[order], np.arange(count)))[1:]
    parts += [closed] * (len(closed) > 0)  # closed surfaces count as one more body
    rows, others, numbers_there = _windings(points, parts)
    homes_there = homes[rows]
    weights = np.where(has_own, sizes, 0.0)
    on_rim = np.arange(len(points)) >= n

    def mean(chosen: Bools, values: NDArray[Any], one: Ints, other: Ints) -> Floats:
        """Average values over chosen points of body `one`, counting 0 outside the box of `other`, for pairs of both."""
        entries, shape = weights[rows] * chosen[rows] * values, (count + 1, count + 1)
        sums = sparse.coo_array((entries, (homes_there, others)), shape=shape).tocsr()
        total = np.bincount(homes, weights * chosen, count + 1)
        return np.asarray(sums[one, other]).ravel() / np.maximum(total[one], np.finfo(float).tiny)

    # how much of one body of each pair lies within the other decides whether they ignore each other
    full = 2 * np.abs(np.append(bodies.levels, 0.5))[others]
    share = np.clip(numbers_there / full, 0.0, 1.0)  # 1 inside, as if no part of the other body were missing
    surface_within = np.maximum(
        *(mean(~on_rim, share > INSIDE_WINDING, *pair) for pair in ((homes_there, others), (others, homes_there)))
    )
    not_nested, enclosed = surface_within < 1 - OUTSIDE, mean(on_rim, share, homes_there, others) >= 1 - OUTSIDE
    every = np.ones(count, dtype=bool)
    stays = {"given": bodies.as_given, "cavities": ~every, "bodies": every}[nested][homes_there]
    ignored = (homes_there != others) & ((united & not_nested) | (enclosed & stays))
    subtracted = np.where(others == count, enclosed & ~stays, ~ignored) & (rows < n)
    # all bodies, without those that are not ignored
    everything = WindingTree.of(np.concatenate(parts[:count]))
    around = everything.levels(system.points)
    return around - np.bincount(rows[subtracted], numbers_there[subtracted], n)


def _windings(points: Floats, parts: list[Floats]) -> tuple[Ints, Ints, Floats]:
    """Pair (n, 3) points with the bodies in whose boxes they lie: (k,) points, (k,) bodies, (k,) winding numbers.

    A body is (m, 3, 3) triangles of `parts`. On its surface, its winding number is the mean of both sides.
    """
    boxes = np.array([(corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for corners in parts])
    # a point is a triangle whose corners are equal
    starts, bodies = BoxTree.of(boxes[:, 0], boxes[:, 1]).meeting(np.repeat(points[:, None], 3, axis=1))
    rows = np.repeat(np.arange(len(points)), np.diff(starts))
    inside_box = (points[rows] >= boxes[bodies, 0]) & (points[rows] <= boxes[bodies, 1])
    kept = np.flatnonzero(inside_box.all(axis=1))
    kept = kept[np.argsort(bodies[kept], kind="stable")]
    rows, bodies, windings = rows[kept], bodies[kept], np.zeros(len(kept))
    for body, (begin, end) in enumerate(pairwise(np.searchsorted(bodies, np.arange(len(parts) + 1)))):
        if end > begin:
            batch = rows[begin:end]
            windings[begin:end] = WindingTree.of(parts[body]).levels(points[batch])
    return rows, bodies, windings
