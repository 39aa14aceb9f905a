"""Which way strokes run, and which of them bound something: the directions of least energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints, ShortRepr, mask_of
from ..errors import UnsupportedTypeError
from ..geodesics.geodesic_sources import PlacedSegments
from ..mesh.components import connected_components
from ..mesh.curve_segments import CurveSegments, interpolation_at, joined_end_to_end, without_copies
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.signed_graph import best_signs
from ..parallel import PointTree, in_threads
from ..shapes.foreign import ForeignShape, as_list, converted
from ..shapes.kinds import SurfaceDomain
from ..solver import SignedHeatSolver
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.source_segments import NEARLY_CLOSED, as_curves, nearest_others
from ..surfaces.surface_curves import Curve, CurveOrPoints, CurvesAndPoints, ElementList
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..surfaces.surface_sharpening import curve_sides
from .resolution import flattened, on_resolving_triangles, surface_of, triangulated_once
from .strokes import EQUAL_COSTS, EXPLAINED, Inside, Strokes

TIE = 0.05
"""A later reading must cost less than an earlier one by more than this share. Halved or left out, none of 88 drawings
changes; doubled, one does."""
MISSING = 2.0
"""Share of the length of the strokes from which on what is unexplained makes the inside a guess."""
TURNING_COST = 0.6
"""Cost of turning a stroke, relative to its length: less than of leaving it out. At 0.5, of three loops side by side
one is turned; from 0.7 on, of nine small circles those are not turned that contradict the others."""
WEAK_TURNING_COST = 0.02
"""Cost of turning a stroke of mean length in `smooth_signs`. If two follow each other, with a gap of half of their
length, the energy is less by 0.05. Halved and doubled, none of 46 drawings changes."""
TRIED_SINGLY = 16
"""Number of strokes, the longest first, that are turned or left out one by one where they explain nothing; limited for
speed. Halved and doubled, none of 46 drawings changes."""
HALF, TURNED = 0.45, 0.34
"""The inside is a guess if more than the first share of some loops is turned, and that makes up the second share of the
length. Of 600 drawings with turned parts (`benchmarks/strokes.py`, seeds 20000 to 20200) 6 are wrong in silence and 29
right with a warning; the first at 0.49 7 and 25, at 0.4 4 and 37, at 0.37 4 and 48; the second at 0.25 3 and 43, at 0.3
5 and 31. Above a half, two halves of a circle that contradict each other would be no guess if a dot decides."""
WORTH = 0.5
"""The inside is a guess if it depends on a stroke worth less than this, relative to its length. At 0.4, 6 of these 600
drawings are wrong in silence and 15 right with a warning; halved 8 and 15, at 0.6 5 and 22."""
CHANGED_AREA = 0.05
"""The inside depends on a stroke if this share of the area changes sides without it. Halved, 5 of these 600 drawings
are wrong in silence and 23 right with a warning; doubled, 9 and 15."""


@dataclass(frozen=True, eq=False)
class CurvePieces:
    """Oriented curves on a surface, as strokes.

    Curves that go on in each other, head to tail, are one stroke. Strokes are ordered by place, so that nothing depends
    on how curves are numbered.
    """

    numbers: Ints  # (j,) which of the curves given are oriented, ordered by place
    stroke: Ints  # (j,) the stroke that each of these is part of
    movable: Bools  # (k,) whether each stroke may be turned
    is_piece: Bools  # (k,) whether it ends inside the surface
    strokes: Strokes  # the strokes, and the energy of the sets that they may bound

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveOrPoints]) -> CurvePieces | None:
        """Return the oriented curves as strokes; None if there is nothing to decide about them."""
        numbers = [k for k, c in enumerate(curves) if isinstance(c, Curve) and c.oriented]
        listed = [cast("Curve", curves[k]) for k in numbers]
        if not listed:
            return None
        domain = surface.domain.mesh if isinstance(surface.domain, IntrinsicTriangulation) else surface.domain
        places = [domain.positions(curve) for curve in listed]
        order = order_in_space(places)
        listed = [listed[k] for k in order]
        each = [part for (part,) in surface.segments([[curve] for curve in listed])]
        # curves with normals are neither joined nor taken for copies, since their normals may disagree
        by_points = np.array([curve.normals is None for curve in listed])
        first, copy = without_copies(each, by_points)
        parts, stroke = joined_end_to_end([each[k] for k in first], by_points[first])
        is_piece = np.array([not is_whole(surface.triangles, part) for part in parts])
        movable = np.array([may_turn(surface.triangles, part) for part in parts])
        if not movable.any() or (len(parts) == 1 and not is_piece[0]):
            return None
        group, gaps = likely_curves(np.concatenate([places[order[k]][[0, -1]] for k in first]), stroke)
        is_loop = gaps < NEARLY_CLOSED * np.bincount(group, [part.lengths.sum() for part in parts])
        # the longest sides of triangles that were made for the curves, where these are shorter than edges of the mesh
        longest = surface.triangles.edge_lengths[np.concatenate([part.faces for part in parts])].max(axis=1)
        edge = min(float(domain.triangulation.edge_lengths.mean()), float(longest.mean()))
        strokes = Strokes.of(surface, parts, edge, group, is_loop)
        return cls(np.array(numbers, dtype=np.int64)[order], stroke[copy], movable, is_piece, strokes)

    def curves(self, chosen: Bools) -> Ints:
        """Numbers of the curves that make up the strokes chosen by (k,) bool."""
        return np.sort(self.numbers[chosen[self.stroke]])


@dataclass(frozen=True, eq=False)
class Decision:
    """The reading of curves that leaves the least length unexplained."""

    pieces: CurvePieces  # the curves
    reading: Inside  # the directions of strokes, 0 where they are left out, and the sides by heat
    tied: bool = False  # whether another reading, which leaves as little unexplained, has something else inside

    @cached_property
    def best(self) -> Inside:
        """The sides of shortest boundary for the same directions."""
        return self.pieces.strokes.inside(self.reading.signs)

    def turned(self, n: int) -> Bools:
        """(n,) which of all curves given are turned."""
        return mask_of(n, self.pieces.curves(self.reading.signs < 0))

    @property
    def loose(self) -> Bools:
        """(k,) which strokes are left out."""
        return np.asarray(self.reading.signs == 0)

    @property
    def bounds_nothing(self) -> bool:
        """Whether far more of the curves is missing than there is."""
        return self.pieces.strokes.unexplained(self.reading) > MISSING * float(self.pieces.strokes.lengths.sum())

    def loops_left_out(self) -> Ints:
        """Return the numbers of curves of loops that bound nothing, but would bound something without the others."""
        strokes = self.pieces.strokes
        found = np.zeros(len(self.loose), dtype=bool)
        for group in np.flatnonzero(strokes.whole_loops(self.loose)).tolist():
            in_loop = strokes.group == group
            alone = strokes.inside(np.where(in_loop, 1.0, 0.0))
            if (alone.explained[in_loop] >= EXPLAINED).any():
                found |= in_loop
        return self.pieces.curves(found)

    @property
    def all_bound(self) -> bool:
        """Whether every stroke that is not left out bounds the inside."""
        return not self.bounds_nothing and bool((self.best.explained[~self.loose] >= EXPLAINED).all())

    def turned_loops(self) -> Ints:
        """Return the numbers of turned curves in loops of which about half or more is turned; none if these are few."""
        strokes, best = self.pieces.strokes, self.best
        lengths = np.where(best.explained >= EXPLAINED, strokes.lengths, 0.0)
        turned, total = (np.bincount(strokes.group, lengths * way) for way in (best.signs < 0, 1))
        against = (turned > HALF * total)[strokes.group] & (best.signs < 0) & (lengths > 0)
        # other strokes that are turned count for neither side: they are no evidence of what is right
        few = lengths[against].sum() < TURNED * lengths[against | (best.signs > 0)].sum()
        return self.pieces.curves(against & (not few))

    def worth_little(self) -> Ints:
        """Return the numbers of curves on which the inside depends, although they are worth little.

        A stroke is worth what more is unexplained without it: a piece of a curve, what it closes and its length; an arc
        alone, its length less that of its gap; a stray stroke little, because a line is added for it.
        """
        strokes, reading = self.pieces.strokes, self.reading
        missing = strokes.unexplained(reading)  # a stroke is worth its length less this, or more
        may_be = (reading.signs != 0) & ((1 - WORTH) * strokes.lengths < missing)
        little = np.zeros(len(may_be), dtype=bool)
        for k in longest_of(strokes, np.flatnonzero(may_be)).tolist():
            signs = altered(reading.signs, [k], 0.0)
            without = strokes.by_heat(signs) if signs.any() else None
            worth = (strokes.lengths.sum() if without is None else strokes.unexplained(without)) - missing
            changed = 1.0 if without is None else strokes.changed_share(reading, without)
            little[k] = worth < WORTH * strokes.lengths[k] and changed > CHANGED_AREA
        return self.pieces.curves(little)


def order_in_space(places: Sequence[Floats]) -> Ints:
    """Return (k,) the order of curves, each (j, 3) points, by mean and first point, however numbered and scaled."""
    keys = np.array([[*points.mean(axis=0), *points[0]] for points in places])
    low = np.minimum(keys[:, :3].min(axis=0), keys[:, 3:].min(axis=0))
    size = max(float((keys - np.tile(low, 2)).max()), np.finfo(float).tiny)
    return np.lexsort(np.rint((keys - np.tile(low, 2)) / (EQUAL_COSTS * size)).T[::-1])


def likely_curves(ends: Floats, stroke: Ints) -> tuple[Ints, Floats]:
    """Return (k,) the likely curve of each stroke, and (g,) lengths of their gaps; from (2 j, 3) ends of curves."""
    j = len(stroke)
    nearest = nearest_others(ends)
    tails, heads = np.concatenate([nearest, np.stack([np.arange(j), j + stroke], axis=1)]).T
    group = np.unique(connected_components(j + int(stroke.max()) + 1, tails, heads)[j:], return_inverse=True)[1].ravel()
    # a gap is from the end of a curve to the nearest beginning: the nearest end may be that of a copy
    away = PointTree(ends[::2]).query(ends[1::2])[0]
    return group.astype(np.int64), np.bincount(group[stroke], away).astype(np.float64)


def is_whole(triangles: IntrinsicMesh, part: CurveSegments) -> bool:
    """Whether a stroke is closed, or goes from boundary to boundary of the surface."""
    return is_closed(part) or _ends_on(triangles, part, triangles.edges.face_counts == 1)


def may_turn(triangles: IntrinsicMesh, part: CurveSegments) -> bool:
    """Whether a direction means something: at an edge of three faces one in one of them says nothing of the others."""
    return is_whole(triangles, part) or not _ends_on(triangles, part, triangles.edges.face_counts != 2)


def is_closed(part: CurveSegments) -> bool:
    """Whether a stroke ends where it begins."""
    return bool(part.ends[0, 0] == part.ends[-1, 1])


def _ends_on(triangles: IntrinsicMesh, part: CurveSegments, is_edge: Bools) -> bool:
    """Whether both ends of a stroke lie on some edges, (e,)."""
    on = mask_of(triangles.n_vertices, triangles.edges.vertices[is_edge])
    ends = interpolation_at(triangles, part.nodes[part.ends[[0, -1], [0, 1]]])
    return all(bool(on[ends[end].indices].all()) for end in (0, 1))


def bound_as_given(pieces: CurvePieces) -> bool:
    """Whether strokes without ends, as they are given, have one side each, and the other, all along."""
    strokes = pieces.strokes
    if pieces.is_piece.any():
        return False
    triangles = strokes.surface.triangles
    sides = curve_sides(triangles, PlacedSegments.of(triangles, strokes.parts)).regions
    return bool((strokes.means @ sides >= 1.0 - EQUAL_COSTS).all())


def decide(pieces: CurvePieces, every_piece: bool = False) -> Decision:
    """Return the reading of strokes that costs least by heat: as given, turned, or with some of them left out.

    As given is the first, and is taken if no other costs clearly less. One comparison is made between all of them, by
    the length that each leaves unexplained and the `cost` of turning. `every_piece` leaves none out.
    """
    strokes, movable = pieces.strokes, pieces.movable
    given = strokes.by_heat(np.ones(len(movable)))
    if strokes.unexplained(given) <= EQUAL_COSTS * strokes.lengths.sum():
        return Decision(pieces, given)
    smooth = np.where(movable, smooth_signs(strokes, movable), 1.0)
    rivals = cheapest(strokes, movable, smooth)
    tried = [rivals[0].signs, smooth]
    if not every_piece:
        tried.append(without_loose(rivals[0], movable))
    reading = least_of(strokes, [given, *(strokes.by_heat(signs) for signs in tried if signs.any())], TIE)
    if reading is given:
        return Decision(pieces, given)
    apart = [strokes.either_way(rivals[0]), *(strokes.changed_share(rival, rivals[0]) for rival in rivals)]
    return Decision(pieces, reading, tied=max(apart) > CHANGED_AREA)


def without_loose(inside: Inside, movable: Bools) -> Floats:
    """(k,) directions of strokes, 0 for those that bound nothing."""
    return np.where(movable & (inside.explained < EXPLAINED), 0.0, inside.signs)


def cheapest(strokes: Strokes, movable: Bools, smooth: Floats) -> list[Inside]:
    """Return all insides found that cost least, those for which fewer strokes are turned first.

    Cuts and directions are improved in turn, from the given and the `smooth` directions; only movable strokes turn.
    """
    best = least_of(strokes, settled_from(strokes, [np.ones(len(movable)), smooth], movable))
    while True:
        starts = [np.where(movable, -best.signs, best.signs)]
        starts += [altered(best.signs, rows, -1.0) for rows in turnable(strokes, best, movable)]
        better = least_of(strokes, [best, *settled_from(strokes, starts, movable)])
        if better is best:
            break
        best = better
    most = cost(strokes, best) + EQUAL_COSTS * strokes.lengths.sum()
    rivals = [inside for inside in strokes.seen if inside.signs.all() and cost(strokes, inside) <= most]
    return sorted(rivals, key=lambda inside: (int((inside.signs < 0).sum()), (inside.signs < 0).tolist()))


def least_of(strokes: Strokes, insides: list[Inside], share: float = 0.0) -> Inside:
    """Return the first of the insides that cost at most a `share` more than the cheapest, up to rounding."""
    costs = np.array([cost(strokes, inside) for inside in insides]) + strokes.lengths.sum()
    return insides[int(np.argmax(costs <= (1 + share) * costs.min() + EQUAL_COSTS * strokes.lengths.sum()))]


def altered(signs: Floats, rows: list[int], factor: float) -> Floats:
    """(k,) the directions of strokes with some of them turned (-1) or left out (0)."""
    result: Floats = signs.copy()
    result[rows] *= factor
    return result


def cost(strokes: Strokes, inside: Inside) -> float:
    """Return the energy and the cost of turning."""
    return inside.energy + TURNING_COST * float(strokes.lengths[inside.signs < 0].sum())


def turnable(strokes: Strokes, inside: Inside, movable: Bools) -> list[list[int]]:
    """Return lists of strokes to turn together: whole curves, all that bound nothing, and the longest one by one."""
    explained = inside.explained >= EXPLAINED
    loose, others = np.flatnonzero(movable & ~explained), np.flatnonzero(movable & explained)
    longest = [longest_of(strokes, rows).tolist() for rows in (loose, others)]
    curves = strokes.group[longest[0] + longest[1]]
    together = [np.flatnonzero(movable & (strokes.group == k)).tolist() for k in dict.fromkeys(curves.tolist())]
    return [*together, loose.tolist(), *([k] for k in longest[0] + longest[1])] if len(loose) else together


def longest_of(strokes: Strokes, rows: Ints) -> Ints:
    """Return the `TRIED_SINGLY` longest of some strokes, which are tried one by one."""
    return rows[np.argsort(-strokes.lengths[rows], kind="stable")[:TRIED_SINGLY]]


def settled_from(strokes: Strokes, starts: list[Floats], movable: Bools) -> list[Inside]:
    """Return what `settled` finds from each start, on all cores."""
    return list(in_threads(lambda signs: settled(strokes, signs, movable), starts))


def settled(strokes: Strokes, signs: Floats, movable: Bools) -> Inside:
    """Return sides and directions that fit each other: they are improved in turn until nothing changes."""
    best = inside = strokes.inside(signs)
    for _ in range(20):
        turn = movable & (inside.explained < 0)
        if not turn.any():
            break
        inside = strokes.inside(np.where(turn, -inside.signs, inside.signs))
        best = least_of(strokes, [best, inside])
    return best


def smooth_signs(strokes: Strokes, movable: Bools) -> Floats:
    """(k,) directions with which smooth sides that jump across the strokes have the least energy (`Strokes.agreed`)."""
    agreed, given = strokes.agreed, np.where(movable, WEAK_TURNING_COST, 1e6) * strokes.lengths
    given = given / strokes.lengths.mean()
    weights = np.block([[agreed, given[:, None]], [given[None], np.zeros((1, 1))]])
    signs = best_signs(weights, np.ones(len(weights)))
    return signs[:-1] * signs[-1]


@dataclass(frozen=True, eq=False, repr=False)
class CurveOrientation(Frozen, ShortRepr):
    """How the parts of a broken curve were oriented.

    Attributes
    ----------
    curves : list of Curve and SurfacePoints
        All that was given, in order, some curves flipped.
    turned : (k,) bool
        Which of them were flipped.
    agreement : (k,) float
        How much of each bounds what all of them bound together: 1 all of it, 0 nothing, as spurious strokes often do.
        It is 1 for curves and points that are never flipped.

    See Also
    --------
    orientation : The same, and what was flipped.
    orient : Flip faces or curves so that they agree.

    Examples
    --------
    >>> from signedheat import samples
    >>> mesh = samples.sphere(3)
    >>> equator, = mesh.level_set(mesh.vertices[:, 2], 0.01)
    >>> curve_orientation([equator], mesh).turned
    array([False])
    """

    curves: list[CurveOrPoints]
    turned: Bools
    agreement: Floats

    def agreeing(self, least: float) -> list[CurveOrPoints]:
        """Return the curves that agree with the others at least that well.

        Parameters
        ----------
        least : float
            Agreement, from 0 to 1.

        Returns
        -------
        list of Curve or SurfacePoints
            Those of `curves` with at least this `agreement`.

        See Also
        --------
        orientation : How well each curve agrees.
        orient : The curves, flipped to agree.

        Examples
        --------
        >>> import signedheat as sh
        >>> mesh = sh.samples.sphere(2)
        >>> equator = mesh.level_set(mesh.vertices[:, 2])
        >>> len(sh.orientation(equator, mesh).agreeing(0.5))
        1
        """
        return [curve for curve, agreement in zip(self.curves, self.agreement, strict=True) if agreement >= least]


def curve_orientation(
    curves: CurvesAndPoints | ElementList | Sequence[ElementList], domain: SurfaceDomain | ForeignShape
) -> CurveOrientation:
    """Turn the pieces of broken curves so that together they bound something.

    Directions are taken as given unless others cost less: the length of the boundary of the inside where no piece is,
    the length of the pieces that do not bound it, and 0.6 of the length that is turned. Where most of the length bounds
    nothing, as a loop round a torus does not, pieces that follow each other are made to face the same way.

    Closed curves are turned like others. Unoriented curves, points, and pieces between edges of three faces or more
    stay as they are.

    Parameters
    ----------
    curves : Curve, SurfacePoints, or a sequence of them
        The pieces, or lists of (element, coordinates), as for `signed_distance`. Those of a group count one by one.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that they lie on, its faces consistently oriented, or the curves with normals.

    Raises
    ------
    SourceError
        If a curve does not fit the surface.
    UnsupportedTypeError
        If the domain is no surface.

    Examples
    --------
    Quarters of a loop round a torus, of which one runs backwards.

    >>> from signedheat.samples import torus
    >>> mesh = torus(n_around=48, n_across=24)
    >>> pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    >>> pieces[1] = pieces[1].reversed()
    >>> curve_orientation(pieces, mesh).turned
    array([False,  True, False, False])
    """
    surface = converted(domain)
    if not isinstance(surface, SurfaceDomain):
        raise UnsupportedTypeError(
            f"curves are oriented on surfaces, not on a {type(domain).__name__}", element="domain"
        )
    listed = flattened(as_curves(surface, as_list(curves)))
    turned, agreement = np.zeros(len(listed), dtype=bool), np.ones(len(listed))
    pieces = pieces_for_all(surface, listed)
    if pieces is not None:
        decision = decide(pieces, every_piece=True)
        turned = decision.turned(len(listed))
        explained = np.where(pieces.movable, np.clip(decision.best.explained, 0.0, 1.0), 1.0)
        agreement[pieces.numbers] = explained[pieces.stroke]
    return CurveOrientation(with_turned(listed, turned), turned, agreement)


def pieces_for_all(domain: SurfaceDomain, curves: Sequence[CurveOrPoints]) -> CurvePieces | None:
    """Return the pieces of curves on the triangles of default options, so that options decide nothing about them."""

    def seen(solver: SignedHeatSolver[SurfaceDomain]) -> CurvePieces | None:
        return CurvePieces.of(surface_of(triangulated_once(solver, curves)), curves)

    return on_resolving_triangles(seen, SignedHeatSolver(domain), curves)


def with_turned(curves: Sequence[CurveOrPoints], turned: Bools) -> list[CurveOrPoints]:
    """Return the curves, some with their positive side negative."""
    return [_turned(curve) if turn else curve for curve, turn in zip(curves, turned, strict=True)]


def _turned(curve: CurveOrPoints) -> CurveOrPoints:
    assert isinstance(curve, Curve)
    if curve.normals is None:
        return curve.reversed()
    return Curve(curve.faces, curve.barycentric, curve.closed, curve.oriented, -curve.normals)
