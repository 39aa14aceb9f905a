"""Which way strokes run, and which of them bound something: the directions of least energy."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..mesh.components import connected_components
from ..mesh.curve_segments import CurveSegments, interpolation_at, joined_end_to_end
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.signed_graph import best_signs
from ..parallel import n_threads
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.surface_curves import Curve, CurveOrPoints
from ..surfaces.surface_discretization import SurfaceDiscretization
from .strokes import Inside, Strokes

AS_GIVEN = 0.5
"""What turning a stroke costs, relative to its length. Halved or doubled, one of 46 drawings changes, that is, on more
than 2 % of the area."""
WEAKLY = 0.02
"""The same if sides are smooth, for a stroke of mean length. Of two that follow each other, with a gap of half of their
length, the energy is less by 0.05. Halved and doubled, none of 46 drawings changes."""
MOST = 0.5
"""Share of the length of all strokes that bounds nothing where none is left out: the greater part. Halved and doubled,
none of 46 drawings changes."""
EXPLAINED = 0.5
"""How far a stroke is explained that bounds the inside: the greater part. Halved, none of 46 drawings changes, doubled
two, and eleven more are announced."""
ROUNDS = 20
"""Most cuts until the directions agree with the sides."""
SINGLY = 16
"""Strokes, the longest first, that are turned one by one where they explain nothing, or left out one by one: for speed.
Halved and doubled, none of 46 drawings changes by what is turned."""
TURNED = 0.36
"""Share of the length of a loop, and of all strokes, from which turning it is a guess: less for three of ten circles.
Of 320 drawings with turned strokes none is wrong in silence and 16 are right with a warning; halved 0 and 28, doubled
9 and 0."""
WORTH = 0.5
"""What a stroke on which the inside hangs is worth, relative to its length, below which that is a guess. Of 350
drawings, 140 of them with long strays, 9 are wrong in silence and 10 right with a warning; halved 15 and 5, doubled 4
and 56."""
OTHERWISE = 0.05
"""Share of the area that is on the other side without a stroke on which the inside hangs. Halved, 5 and 20 of the same
drawings; doubled, 15 and 6."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Oriented curves on a surface, as strokes; those that end inside the surface may be turned.

    Curves that go on in each other, head to tail, are one stroke: a line may be given in as many bits as one likes.

    Attributes
    ----------
    numbers : (j,) int
        Which of the curves given are oriented.
    stroke : (j,) int
        The stroke that each of these is part of.
    movable : (k,) bool
        Whether each stroke is a piece: open, and not from boundary to boundary of the surface.
    strokes : Strokes
        The energy of the sets that they may bound.
    """

    numbers: NDArray[np.int64]
    stroke: NDArray[np.int64]
    movable: NDArray[np.bool_]
    strokes: Strokes

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveOrPoints]) -> Pieces | None:
        """The pieces; None if there are none."""
        listed = {k: c for k, c in enumerate(curves) if isinstance(c, Curve) and c.oriented}
        if not listed:
            return None
        each = [part for (part,) in surface.segments([[curve] for curve in listed.values()])]
        by_points = np.array([curve.normals is None for curve in listed.values()])  # not by normals: they may disagree
        parts, stroke = joined_end_to_end(each, by_points)
        movable = np.array([is_piece(surface.triangles, part) for part in parts])
        if not movable.any():
            return None
        strokes = Strokes.of(surface, parts, drawn_edge(surface))
        return cls(np.array(list(listed), dtype=np.int64), stroke, movable, strokes)

    def curves(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers of the curves that make up the strokes chosen by (k,) bool."""
        return self.numbers[chosen[self.stroke]]


@dataclass(frozen=True, eq=False)
class Decision:
    """The directions of the pieces of curves.

    Attributes
    ----------
    pieces : Pieces
        The curves.
    best : Inside
        The best directions that were found, and what is inside then.
    bounds_nothing : bool
        Whether most of the length bounds nothing in the least energy, so that sides were taken to be smooth.
    """

    pieces: Pieces
    best: Inside
    bounds_nothing: bool = False

    def turned(self, n: int) -> NDArray[np.bool_]:
        """(n,) which of all curves given are turned."""
        result = np.zeros(n, dtype=bool)
        result[self.pieces.curves(self.best.signs < 0)] = True
        return result

    @property
    def loose(self) -> NDArray[np.bool_]:
        """(k,) which strokes bound nothing, where others do."""
        movable, explained = self.pieces.movable, self.best.explained >= EXPLAINED
        return movable & ~explained & (movable & explained).any()

    @property
    def all_bound(self) -> bool:
        """Whether every stroke that is not left out bounds the inside."""
        return not self.bounds_nothing and bool((self.best.explained[~self.loose] >= EXPLAINED).all())

    def turned_loops(self) -> NDArray[np.int64]:
        """Numbers of the pieces turned of loops of which nearly half of the length is turned, or more.

        None if these pieces are a smaller share of all strokes; or if a complete curve is in another loop: that curve
        shows how the others face.
        """
        strokes, best = self.pieces.strokes, self.best
        triangles = strokes.surface.triangles
        signs = best.sides[triangles.corner_vertices]
        crossed = triangles.corner_vertices[signs.min(axis=1) != signs.max(axis=1)]
        loop = connected_components(triangles.n_vertices, *crossed[:, [0, 1, 1, 2]].reshape(-1, 2).T)
        at_loop = np.zeros(triangles.n_vertices, dtype=bool)
        at_loop[crossed] = True
        nearby = strokes.means.tocoo()
        chosen = at_loop[nearby.col]
        at = nearby.row[chosen], loop[nearby.col[chosen]]
        count = sparse.csr_matrix((np.ones(len(at[0])), at), shape=(len(best.signs), triangles.n_vertices))
        own = np.asarray(count.argmax(axis=1)).ravel()
        explained = np.where(best.explained >= EXPLAINED, strokes.lengths, 0.0)
        total = np.bincount(own, explained, triangles.n_vertices)
        turned = np.bincount(own, explained * (best.signs < 0), triangles.n_vertices)
        mostly = turned[own] > TURNED * total[own]
        complete = (~self.pieces.movable & (explained > 0) & ~mostly).any()
        found = mostly & (best.signs < 0) & (explained > 0)
        few = explained[found].sum() < TURNED * explained.sum()
        return self.pieces.curves(found & (not few) & (not complete))

    def worth_little(self) -> NDArray[np.int64]:
        """Numbers of the curves on which the inside hangs, and that are worth less than half of their length.

        What a stroke is worth is by how much the least energy rises without it. An arc alone is worth its length less
        that of its gap, a stroke that fills a gap of others more than its length, and a stray one little, because lines
        are added for it, or others ignored. On a stroke that was drawn again nothing hangs.
        """
        strokes, best, areas = self.pieces.strokes, self.best, self.pieces.strokes.areas
        missing = cost(strokes, best) + strokes.lengths.sum()  # a stroke is worth its length less this, or more
        chosen = longest_of(strokes, np.flatnonzero((1 - WORTH) * strokes.lengths < missing))
        without = settled_from(strokes, [altered(best.signs, [k], 0.0) for k in chosen.tolist()], self.pieces.movable)
        worth = np.array([cost(strokes, other) - cost(strokes, best) for other in without])
        changed = np.array([areas[other.sides != best.sides].sum() for other in without])
        little = (worth < WORTH * strokes.lengths[chosen]) & (changed > OTHERWISE * areas.sum())
        found = np.zeros(len(best.signs), dtype=bool)
        found[chosen[little]] = True
        return self.pieces.curves(found)


def drawn_edge(surface: SurfaceDiscretization) -> float:
    """Mean length of the edges of the surface as it was given."""
    domain = surface.domain
    mesh = domain.mesh if isinstance(domain, IntrinsicTriangulation) else domain.triangulation
    return float(mesh.edge_lengths.mean())


def is_piece(triangles: IntrinsicMesh, part: CurveSegments) -> bool:
    """Whether a stroke has an end away from the boundary of the surface, and from nonmanifold edges."""
    if part.ends[0, 0] == part.ends[-1, 1]:
        return False
    edges = triangles.edges
    at_boundary = np.zeros(triangles.n_vertices, dtype=bool)
    at_boundary[edges.vertices[edges.face_counts != 2]] = True  # across three faces no direction goes on to the others
    ends = interpolation_at(triangles, part.nodes[part.ends[[0, -1], [0, 1]]])
    return not all(at_boundary[ends[end].indices].all() for end in (0, 1))


def decide(pieces: Pieces) -> Decision:
    """The directions of strokes for which the inside costs least; only some strokes may be turned.

    A cut gives the sides for directions, and sides give directions: from several starts both are improved in turn, then
    by turning strokes one by one. Where more of the curves is gone than there is, only ends that are near each other
    are evidence, and sides are taken to be smooth.
    """
    strokes, movable = pieces.strokes, pieces.movable
    k = len(movable)
    smooth = np.where(movable, smooth_signs(strokes, movable), 1.0)
    started = settled_from(strokes, [np.ones(k), smooth], movable)
    best = min(started, key=lambda inside: cost(strokes, inside))
    while True:
        starts = [np.where(movable, -best.signs, best.signs)]
        starts += [altered(best.signs, rows, -1.0) for rows in turnable(strokes, best, movable)]
        better = min(settled_from(strokes, starts, movable), key=lambda inside: cost(strokes, inside))
        if cost(strokes, better) >= cost(strokes, best) - 1e-9 * strokes.lengths.sum():
            break
        best = better
    if mostly_loose(strokes, best):
        return Decision(pieces, strokes.inside(smooth), bounds_nothing=True)
    return Decision(pieces, best)


def altered(signs: NDArray[np.float64], rows: list[int], factor: float) -> NDArray[np.float64]:
    """(k,) the directions of strokes with some of them turned (-1) or left out (0)."""
    result: NDArray[np.float64] = signs.copy()
    result[rows] *= factor
    return result


def mostly_loose(strokes: Strokes, inside: Inside) -> bool:
    """Whether most of the length bounds nothing: more of it is gone than there is."""
    lengths = strokes.lengths
    return bool(lengths[inside.explained < EXPLAINED].sum() > MOST * lengths.sum())


def cost(strokes: Strokes, inside: Inside) -> float:
    """The energy, and what turning costs."""
    return inside.energy + AS_GIVEN * float(strokes.lengths[inside.signs < 0].sum())


def turnable(strokes: Strokes, inside: Inside, movable: NDArray[np.bool_]) -> list[list[int]]:
    """Strokes that could bound more if turned: those that bound nothing, and others that may be the reason for it."""
    explained = inside.explained >= EXPLAINED
    loose, others = np.flatnonzero(movable & ~explained), np.flatnonzero(movable & explained)
    if not len(loose):
        return []
    longest = [longest_of(strokes, rows) for rows in (loose, others)]
    return [loose.tolist(), *([k] for k in np.concatenate(longest).tolist())]


def longest_of(strokes: Strokes, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The `SINGLY` longest of some strokes, which are tried one by one."""
    return rows[np.argsort(-strokes.lengths[rows], kind="stable")[:SINGLY]]


def settled_from(strokes: Strokes, starts: list[NDArray[np.float64]], movable: NDArray[np.bool_]) -> list[Inside]:
    """What `settled` finds from each start, on all cores."""
    with ThreadPoolExecutor(n_threads()) as pool:
        return list(pool.map(lambda signs: settled(strokes, signs, movable), starts))


def settled(strokes: Strokes, signs: NDArray[np.float64], movable: NDArray[np.bool_]) -> Inside:
    """Sides and directions that fit each other, improved in turn until nothing changes."""
    best = inside = strokes.inside(signs)
    for _ in range(ROUNDS):
        turn = movable & (inside.explained < 0)
        if not turn.any():
            break
        inside = strokes.inside(np.where(turn, -inside.signs, inside.signs))
        if cost(strokes, inside) < cost(strokes, best):
            best = inside
    return best


def smooth_signs(strokes: Strokes, movable: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(k,) directions of least energy if sides are smooth."""
    agreed, given = strokes.agreed, np.where(movable, WEAKLY, 1e6) * strokes.lengths
    given = given / strokes.lengths.mean()
    weights = np.block([[agreed, given[:, None]], [given[None], np.zeros((1, 1))]])
    signs = best_signs(weights, np.ones(len(weights)))
    return signs[:-1] * signs[-1]
