"""Directions of strokes with the least energy, so that together they bound something, and the strokes to leave out."""

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
from ..validation import finite_number
from .resolution import flattened, on_resolving_triangles, surface_of, triangulated_once
from .strokes import EQUAL_COSTS, EXPLAINED, Inside, Strokes

TIE = 0.05
"""Share by which directions of strokes must cost less than earlier ones to be preferred. Halved or left out, none of 88
drawings changes; doubled, one does."""
MISSING = 2.0
"""Unexplained length, relative to the length of all strokes, above which the curves are said to bound nothing."""
TURNING_COST = 0.6
"""Cost of flipping a stroke, relative to its length. It is less than the cost 1 of leaving it out. At 0.5, one of three
loops side by side is flipped; from 0.7 on, of nine small circles those that contradict the others are not flipped."""
WEAK_TURNING_COST = 0.02
"""Cost of flipping a stroke of mean length in `smooth_signs`. For comparison, the energy is less by 0.05 if two strokes
follow each other with a gap of half their length. Halved and doubled, none of 46 drawings changes."""
TRIED_SINGLY = 16
"""Largest number of strokes, the longest first, that are tried one by one. It is limited for speed. Halved and doubled,
none of 46 drawings changes."""
HALF, TURNED = 0.45, 0.34
"""There is a warning if more than the first share of some loops is flipped, and these flipped strokes make up more than
the second share of the length. Of 600 drawings with flipped parts (`benchmarks/strokes.py`, seeds 20000 to 20200) 6 are
wrong without a warning and 29 right with one. With the first at 0.49 these are 7 and 25, at 0.4 4 and 37, at 0.37 4 and
48; with the second at 0.25 3 and 43, at 0.3 5 and 31. Above a half there would be no warning where a dot decides
between two halves of a circle that contradict each other."""
WORTH = 0.5
"""Worth of a stroke (`Decision.worth_little`), relative to its length, below which there is a warning if the inside
depends on it. At 0.4, 6 of these 600 drawings are wrong without a warning and 15 right with one; halved 8 and 15, at
0.6 5 and 22."""
CHANGED_AREA = 0.05
"""Share of the area above which the inside depends on a stroke, if so much changes sides without it. Halved, 5 of these
600 drawings are wrong without a warning and 23 right with one; doubled, 9 and 15."""


@dataclass(frozen=True, eq=False)
class CurvePieces:
    """Oriented curves on a surface, joined into k strokes.

    Curves that continue each other, head to tail, are one stroke. Strokes are sorted by position, so that nothing
    depends on the order of the curves.
    """

    numbers: Ints  # (j,) indices of the oriented curves among those given, sorted by position
    stroke: Ints  # (j,) the stroke that each of these is part of
    movable: Bools  # (k,) whether each stroke may be flipped
    is_piece: Bools  # (k,) whether each stroke ends inside the surface
    strokes: Strokes  # the strokes, and the energy of the sets that they may bound

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveOrPoints]) -> CurvePieces | None:
        """Join oriented curves into strokes.

        Returns None if no stroke may be flipped, or if there is a single one without free ends.
        """
        numbers = [k for k, c in enumerate(curves) if isinstance(c, Curve) and c.oriented]
        listed = [cast("Curve", curves[k]) for k in numbers]
        if not listed:
            return None
        domain = surface.domain.mesh if isinstance(surface.domain, IntrinsicTriangulation) else surface.domain
        places = [domain.positions(curve) for curve in listed]
        order = order_in_space(places)
        listed = [listed[k] for k in order]
        segments = [part for (part,) in surface.segments([[curve] for curve in listed])]
        # curves with normals are neither joined nor taken for copies, since their normals may disagree
        by_points = np.array([curve.normals is None for curve in listed])
        first, copy = without_copies(segments, by_points)  # of curve i, there is one copy: first[copy[i]]
        parts, stroke = joined_end_to_end([segments[k] for k in first], by_points[first])
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
        """Return the sorted indices of the given curves that make up the strokes chosen by (k,) bool."""
        return np.sort(self.numbers[chosen[self.stroke]])


@dataclass(frozen=True, eq=False)
class Decision:
    """Directions of strokes that cost least, with the questions whether they may be trusted."""

    pieces: CurvePieces  # the curves
    reading: Inside  # the directions of strokes, 0 where they are left out, and the sides of vertices by heat
    tied: bool = False  # whether other directions that cost as little have another inside

    @cached_property
    def best(self) -> Inside:
        """The inside with the shortest boundary for the same directions of strokes."""
        return self.pieces.strokes.inside(self.reading.signs)

    def turned(self, n: int) -> Bools:
        """Return (n,) bool, true for those of all n given curves that are flipped."""
        return mask_of(n, self.pieces.curves(self.reading.signs < 0))

    @property
    def loose(self) -> Bools:
        """Whether each stroke is left out, (k,) bool."""
        return np.asarray(self.reading.signs == 0)

    @property
    def bounds_nothing(self) -> bool:
        """Whether the unexplained length exceeds `MISSING` times the length of the strokes."""
        return self.pieces.strokes.unexplained(self.reading) > MISSING * float(self.pieces.strokes.lengths.sum())

    def loops_left_out(self) -> Ints:
        """Return the indices of given curves in loops that were left out, but would bound something on their own."""
        strokes = self.pieces.strokes
        bounding = np.zeros(len(self.loose), dtype=bool)
        for group in np.flatnonzero(strokes.whole_loops(self.loose)).tolist():
            in_loop = strokes.group == group
            alone = strokes.inside(np.where(in_loop, 1.0, 0.0))
            if (alone.explained[in_loop] >= EXPLAINED).any():
                bounding |= in_loop
        return self.pieces.curves(bounding)

    @property
    def all_bound(self) -> bool:
        """Whether every stroke that is not left out bounds the inside."""
        return not self.bounds_nothing and bool((self.best.explained[~self.loose] >= EXPLAINED).all())

    def turned_loops(self) -> Ints:
        """Return the indices of flipped curves in loops of which about half or more is flipped.

        None are returned if they are shorter than the share `TURNED` of themselves and the strokes that are not
        flipped.
        """
        strokes, best = self.pieces.strokes, self.best
        lengths = np.where(best.explained >= EXPLAINED, strokes.lengths, 0.0)
        turned, total = (np.bincount(strokes.group, lengths * way) for way in (best.signs < 0, 1))
        against = (turned > HALF * total)[strokes.group] & (best.signs < 0) & (lengths > 0)
        # other strokes that are flipped count for neither side, since they are no evidence of what is right
        few = lengths[against].sum() < TURNED * lengths[against | (best.signs > 0)].sum()
        return self.pieces.curves(against & (not few))

    def worth_little(self) -> Ints:
        """Return the sorted indices of given curves on which the inside depends, although they are worth little.

        The unexplained length is that of the boundary without strokes, and of strokes that do not bound the inside. The
        worth of a stroke is the increase of that length if the stroke is left out: little is less than `WORTH` times
        its own length. The inside depends on it if a share `CHANGED_AREA` of the area then changes sides.

        A stroke that continues others is worth its length and that of the gap it fills. A single arc is worth its
        length less that of its gap. A stray stroke is worth little, since the boundary has to make a detour to it.
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
    """Return (k,) indices that sort curves, each (j, 3) points, by their mean point and then by their first point.

    Coordinates that differ by rounding, relative to the size of all curves, count as equal.
    """
    keys = np.array([[*points.mean(axis=0), *points[0]] for points in places])
    low = np.minimum(keys[:, :3].min(axis=0), keys[:, 3:].min(axis=0))
    size = max(float((keys - np.tile(low, 2)).max()), np.finfo(float).tiny)
    return np.lexsort(np.rint((keys - np.tile(low, 2)) / (EQUAL_COSTS * size)).T[::-1])


def likely_curves(ends: Floats, stroke: Ints) -> tuple[Ints, Floats]:
    """Group k strokes to g likely curves, by joining each end of a curve to the nearest other end.

    `ends` are the first and last points of j curves in turn, (2 j, 3), and `stroke` is the stroke of each curve, (j,).
    Returns (k,) the likely curve of each stroke, and (g,) the total length of the gaps in each likely curve.
    """
    j, k = len(stroke), int(stroke.max()) + 1
    # a graph of j curves and k strokes: links between neighbouring curves, and between curves and their strokes
    links = np.concatenate([nearest_others(ends), np.stack([np.arange(j), j + stroke], axis=1)])
    stroke_components = connected_components(j + k, *links.T)[j:]
    group = np.unique(stroke_components, return_inverse=True)[1].ravel()
    # a gap is from the end of a curve to the nearest beginning: the nearest end may be that of a copy
    gaps = PointTree(ends[::2]).query(ends[1::2])[0]
    return group.astype(np.int64), np.bincount(group[stroke], gaps).astype(np.float64)


def is_whole(triangles: IntrinsicMesh, part: CurveSegments) -> bool:
    """Whether a stroke is closed, or has both ends on the boundary of the surface."""
    return is_closed(part) or _ends_on(triangles, part, triangles.edges.face_counts == 1)


def may_turn(triangles: IntrinsicMesh, part: CurveSegments) -> bool:
    """Whether a stroke may be flipped.

    One that goes from one edge of three or more faces to another may not, since in one of the faces its direction says
    nothing about the others.
    """
    return is_whole(triangles, part) or not _ends_on(triangles, part, triangles.edges.face_counts != 2)


def is_closed(part: CurveSegments) -> bool:
    """Whether a stroke ends where it begins."""
    return bool(part.ends[0, 0] == part.ends[-1, 1])


def _ends_on(triangles: IntrinsicMesh, part: CurveSegments, is_edge: Bools) -> bool:
    """Whether both ends of a stroke lie on edges for which `is_edge`, (e,), is true."""
    on = mask_of(triangles.n_vertices, triangles.edges.vertices[is_edge])
    ends = interpolation_at(triangles, part.nodes[part.ends[[0, -1], [0, 1]]])
    return all(bool(on[ends[end].indices].all()) for end in (0, 1))


def bound_as_given(pieces: CurvePieces) -> bool:
    """Whether strokes are all without free ends, and in their given directions separate left from right all along."""
    strokes = pieces.strokes
    if pieces.is_piece.any():
        return False
    triangles = strokes.surface.triangles
    sides = curve_sides(triangles, PlacedSegments.of(triangles, strokes.parts)).regions
    return bool((strokes.means @ sides >= 1.0 - EQUAL_COSTS).all())


def decide(pieces: CurvePieces, every_piece: bool = False) -> Decision:
    """Choose the directions of strokes: as given, with some flipped, or with some left out.

    Candidates are compared by their `cost`, with sides computed by heat. The given directions win unless another
    candidate costs less by more than the share `TIE`. If `every_piece`, no stroke is left out.
    """
    strokes, movable = pieces.strokes, pieces.movable
    given = strokes.by_heat(np.ones(len(movable)))
    if strokes.unexplained(given) <= EQUAL_COSTS * strokes.lengths.sum():
        return Decision(pieces, given)
    smooth = np.where(movable, smooth_signs(strokes, movable), 1.0)
    rivals = cheapest(strokes, movable, smooth)
    candidates = [rivals[0].signs, smooth]
    if not every_piece:
        candidates.append(without_loose(rivals[0], movable))
    others = {signs.tobytes(): signs for signs in candidates if signs.any() and not (signs == given.signs).all()}
    reading = least_of(strokes, [given, *map(strokes.by_heat, others.values())], TIE)
    if reading is given:
        return Decision(pieces, given)
    apart = [strokes.either_way(rivals[0]), *(strokes.changed_share(rival, rivals[0]) for rival in rivals)]
    return Decision(pieces, reading, tied=max(apart) > CHANGED_AREA)


def without_loose(inside: Inside, movable: Bools) -> Floats:
    """Return (k,) directions of strokes, with 0 for movable strokes that bound nothing of the inside."""
    return np.where(movable & (inside.explained < EXPLAINED), 0.0, inside.signs)


def cheapest(strokes: Strokes, movable: Bools, smooth: Floats) -> list[Inside]:
    """Search for directions of strokes that cost least, and return all insides of that cost.

    The search starts from the given and the `smooth` directions, (k,), and flips movable strokes only. The insides are
    sorted by the number of flipped strokes.
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
    """Return a copy of (k,) directions in which those at the indices `rows` are multiplied by a factor.

    The factor is −1 to flip strokes, and 0 to leave them out.
    """
    result: Floats = signs.copy()
    result[rows] *= factor
    return result


def cost(strokes: Strokes, inside: Inside) -> float:
    """Return the cost of an inside, as a length: its energy plus `TURNING_COST` for each length of flipped strokes.

    The energy is the length of the boundary where no stroke is, less the length of strokes that it explains.
    """
    return inside.energy + TURNING_COST * float(strokes.lengths[inside.signs < 0].sum())


def turnable(strokes: Strokes, inside: Inside, movable: Bools) -> list[list[int]]:
    """Return lists of the indices of strokes that may be flipped together to lower the cost.

    These are whole likely curves, all strokes that bound nothing, and single strokes among the longest.
    """
    explained = inside.explained >= EXPLAINED
    loose, bounding = np.flatnonzero(movable & ~explained), np.flatnonzero(movable & explained)
    longest = [longest_of(strokes, rows).tolist() for rows in (loose, bounding)]
    curves = strokes.group[longest[0] + longest[1]]
    together = [np.flatnonzero(movable & (strokes.group == k)).tolist() for k in dict.fromkeys(curves.tolist())]
    return [*together, loose.tolist(), *([k] for k in longest[0] + longest[1])] if len(loose) else together


def longest_of(strokes: Strokes, rows: Ints) -> Ints:
    """Return the indices in `rows` of the longest strokes, `TRIED_SINGLY` at most, the longest first."""
    return rows[np.argsort(-strokes.lengths[rows], kind="stable")[:TRIED_SINGLY]]


def settled_from(strokes: Strokes, starts: list[Floats], movable: Bools) -> list[Inside]:
    """Return the result of `settled` for each of the starting directions, computed on all cores."""
    return list(in_threads(lambda signs: settled(strokes, signs, movable), starts))


def settled(strokes: Strokes, signs: Floats, movable: Bools) -> Inside:
    """Improve the inside and the directions of strokes in turn until nothing changes; return the cheapest inside.

    For given directions, the inside of least energy is computed. Then strokes that bound it the wrong way are flipped.
    """
    best = inside = strokes.inside(signs)
    for _ in range(20):
        turn = movable & (inside.explained < 0)
        if not turn.any():
            break
        inside = strokes.inside(np.where(turn, -inside.signs, inside.signs))
        best = least_of(strokes, [best, inside])
    return best


def smooth_signs(strokes: Strokes, movable: Bools) -> Floats:
    """Return (k,) directions for which a function that jumps by 1 across all strokes is smoothest (`Strokes.agreed`).

    A small cost keeps given directions where the energy is about the same.
    """
    if len(movable) == 1:  # the direction given; no system need be solved for it
        return np.ones(1)
    agreed, given = strokes.agreed, np.where(movable, WEAK_TURNING_COST, 1e6) * strokes.lengths
    given = given / strokes.lengths.mean()
    weights = np.block([[agreed, given[:, None]], [given[None], np.zeros((1, 1))]])
    signs = best_signs(weights, np.ones(len(weights)))
    return signs[:-1] * signs[-1]


@dataclass(frozen=True, eq=False, repr=False)
class CurveOrientation(Frozen, ShortRepr):
    """Directions of the parts of a broken curve, chosen so that together they bound a region.

    Attributes
    ----------
    curves : list of Curve and SurfacePoints
        The given curves and points, in order, with some curves flipped.
    turned : (k,) bool
        True for curves that were flipped.
    agreement : (k,) float
        Fraction of the length of each curve that bounds the region, from 0 to 1. Spurious strokes often have 0. It is 1
        for points and for curves that are never flipped.

    See Also
    --------
    orientation : The same, and what was flipped.
    orient : Flip faces or curves so that they agree.

    Examples
    --------
    >>> from signedheat import orientation, samples
    >>> mesh = samples.sphere(3)
    >>> equator, = mesh.level_set(mesh.vertices[:, 2], 0.01)
    >>> orientation([equator], mesh).turned
    array([False])
    """

    curves: list[CurveOrPoints]
    turned: Bools
    agreement: Floats

    def agreeing(self, least: float) -> list[CurveOrPoints]:
        """Return the curves whose agreement with the others reaches a threshold.

        Parameters
        ----------
        least : float
            Least `agreement`, from 0 to 1.

        Returns
        -------
        list of Curve or SurfacePoints
            The entries of `curves` with at least this agreement, in order.

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
        threshold = finite_number(least, "least")
        return [curve for curve, agreement in zip(self.curves, self.agreement, strict=True) if agreement >= threshold]


def curve_orientation(
    curves: CurvesAndPoints | ElementList | Sequence[ElementList], domain: SurfaceDomain | ForeignShape
) -> CurveOrientation:
    """Flip pieces of broken curves so that together they bound a region.

    Given directions are kept unless others cost less. The cost is the length of the region's boundary where there is no
    piece, plus the length of the pieces that do not bound it, plus 0.6 of the length that is flipped. Where most of the
    length bounds nothing, as with a loop around the tube of a torus, pieces that follow each other get the same
    direction.

    Closed curves are flipped like others. Unoriented curves, points, and pieces between edges of three or more faces
    are never flipped.

    Parameters
    ----------
    curves : Curve, SurfacePoints, or a sequence of them
        The pieces, or lists of (element, barycentric coordinates), as for `signed_distance`. Groups are flattened.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that they lie on. Its faces are oriented consistently, or the curves have normals.

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
    """Return curves as strokes on the triangles of a solver with default options.

    So directions of strokes do not depend on the options of the caller.
    """

    def strokes_on(solver: SignedHeatSolver[SurfaceDomain]) -> CurvePieces | None:
        return CurvePieces.of(surface_of(triangulated_once(solver, curves)), curves)

    return on_resolving_triangles(strokes_on, SignedHeatSolver(domain), curves)


def with_turned(curves: Sequence[CurveOrPoints], turned: Bools) -> list[CurveOrPoints]:
    """Return the curves, flipped where `turned`, (k,), is true; curves with normals get opposite normals instead."""
    return [_turned(curve) if turn else curve for curve, turn in zip(curves, turned, strict=True)]


def _turned(curve: CurveOrPoints) -> CurveOrPoints:
    """Return a curve with the inside on its other side: reversed, or with opposite normals if it has normals."""
    assert isinstance(curve, Curve)
    if curve.normals is None:
        return curve.reversed()
    return Curve(curve.faces, curve.barycentric, curve.closed, curve.oriented, -curve.normals)
