"""Which triangles of a shape bound a solid, and which way they face.

The shape is read as it was given first. Each connected part that this leaves unexplained is read in other ways, too
(`readings`), and the reading that leaves the least area unexplained is taken; as given wins ties.

Closed pieces are kept whole, and turned outwards as a whole; within another body each keeps the orientation it was
given relative to that body. All other pieces are open, and Gauss's formula (`gauss`) decides for all of them together
which of them bound something, and which way they face if that is not given; it takes bodies that overlap into account
(`overlaps`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..mesh.components import connected_components, first_members, sums_of
from ..mesh.triangles import area_vectors, cone_volumes
from ..mesh.unit_vectors import unit
from ..parallel import PointTree
from ..search.winding_tree import WindingTree
from .chain import Chain
from .gauss import Matrix, Pieces, means, sampled, system_of, without_slender
from .overlaps import HINT, SHEET, Nesting, Rims, bodies_around, directed, levels_of_pieces
from .readings import Reading, as_given, mixed, once, unexplained
from .rims import meeting_edges, open_edges

LEAST_GAIN = 0.1
"""Another reading must explain more than that as given, by this share of the area that counts in another way."""
WELL_EXPLAINED = 1e-3
"""A part of which less than this share is unexplained is taken as given: winding numbers are as inexact as that."""
MOSTLY_WRONG = 0.5
"""A part of which more than this share is unexplained may be turned as a whole, or be a cavity of what is around it."""
COHERENT_LEVELS = 0.7
"""Loose pieces are the remains of a body if the squared mean of their levels over the mean square is at least this.
Bodies have 0.81 to 1, however little is left; leaves, cards and strips have 0.3 to 0.6, however many there are."""
CHANCE_LEVEL = 0.42
"""n loose pieces bound nothing if their level times √(n + 1) is below this: the choice of signs alone explains that.
Two sheets a quarter of their width apart have 0.38, three sides of a box 0.2, a side that four others lack 0.47, and a
ball that has lost 85 % of its faces 0.95."""
PARTLY_INSIDE = 0.25
"""Loose pieces lie along closed ones if the mean winding number of these there is not this near to a whole number."""
GAP_REACH = 1.5
"""Largest distance between faces of two pieces that belong together, relative to the size of the smaller piece."""


@dataclass(frozen=True, eq=False)
class Bounding(Frozen):
    """Decision which triangles of a chain bound something, and which way they face."""

    pieces: Ints  # (m,) piece that each triangle is of
    turned: Bools  # (m,) which must turn from the way in which they were given first
    counts: Ints  # (m,) how often each bounds, negative if reversed; 0 for sheets, inner walls and faces that cancel
    closed: Bools  # (m,) which belong to closed pieces
    # (m,) cluster, where it consists mostly of loose pieces, which bound only together; −1 for all other triangles
    loose: Ints
    # (m,) mean level of the cluster, which is half of the share of the body that is left; ½ for all other triangles
    levels: Floats
    as_given: Bools  # (m,) which count as often as they were given, with all copies
    reversed: Bools  # (k,) which given triangles run the other way than their distinct one, where they are as given
    inner: Bools  # (m,) walls between closed cells
    orientable: Bools  # (p,) pieces whose faces can be oriented consistently
    disagreeing: int  # number of pairs of neighbours that disagreed
    bodies: int  # number of closed pieces within others that face outwards
    cavities: int  # number of those that face inwards
    overlapping: bool  # whether there are open bodies that ignore others, since they overlap or lie within them

    def to_turn(self, chain: Chain) -> Bools:
        """(k,) whether each given triangle must turn; triangles on fewer than three places need not."""
        as_given, turned = (np.append(values, False)[chain.numbers] for values in (self.as_given, self.turned))
        ways = np.where(as_given, chain.reversed != self.reversed, chain.reversed)
        return np.asarray((chain.numbers >= 0) & (ways != turned))


@dataclass(frozen=True, eq=False)
class _Parts:
    """Connected parts of a chain that are not whole as given; loose triangles, which tell little, are one part."""

    chain: Chain
    whole: Bools  # (m,) which triangles are in none
    pieces: Ints  # (m,) piece, as given, of each triangle; −1 where it is in none
    of_pieces: Ints  # (q,) part of each piece
    of_triangles: Ints  # (m,) part of each triangle, or −1
    areas: Floats  # (p,) areas

    @classmethod
    def of(cls, chain: Chain, given: Reading) -> _Parts:
        """Find the parts of a chain as it was given."""
        whole, pieces = given.whole, np.full(len(given.whole), -1)
        names, pieces[~whole] = np.unique(given.pieces[~whole], return_inverse=True)
        loose = np.bincount(chain.complexes)[chain.complexes] == 1
        firsts = first_members(given.pieces, len(given.orientable))[names]
        of_pieces = np.unique(np.where(loose, -1, chain.complexes)[firsts], return_inverse=True)[1]
        of_triangles = np.where(whole, -1, of_pieces[pieces])
        areas = np.bincount(of_triangles[~whole], chain.areas[~whole]).astype(np.float64)
        return cls(chain, whole, pieces, of_pieces, of_triangles, areas)

    def missing(self, decided: Bounding) -> Floats:
        """(p,) share of the area of each part that is unexplained."""
        areas = np.bincount(self.pieces[~self.whole], self.chain.areas[~self.whole]).astype(np.float64)
        return means(unexplained(self.chain, decided.counts, self.pieces), self.of_pieces, areas, len(self.areas))

    def changed(self, decided: Bounding, other: Bounding) -> Floats:
        """(p,) share of the area of each part that counts in another way."""
        rows = np.flatnonzero(~self.whole & (decided.counts != other.counts))
        areas = np.bincount(self.of_triangles[rows], self.chain.areas[rows], len(self.areas))
        return np.asarray(areas / np.maximum(self.areas, 1e-300))

    def differ(self, one: Reading, other: Reading) -> Bools:
        """(p,) whether two readings count, or connect, triangles of each part in different ways."""
        firsts = [first_members(reading.pieces, len(reading.orientable))[reading.pieces] for reading in (one, other)]
        rows = np.flatnonzero(~self.whole & ((one.counts != other.counts) | (firsts[0] != firsts[1])))
        return mask_of(len(self.areas), self.of_triangles[rows])


@dataclass(frozen=True, eq=False)
class _Trial:
    """A reading to try, for some parts."""

    reading: Reading
    parts: Bools  # (p,) parts that it may explain
    least: float = WELL_EXPLAINED  # share of a part that must be unexplained for it to be tried
    united: bool = True  # whether open bodies that overlap are united; else they are one body's outside and inside
    nested: Nesting | None = None  # how closed pieces within others face, if not as asked for
    overlaps: bool = False  # whether it is tried only where open bodies overlap


def bounding(chain: Chain, nested: Nesting = "given", as_oriented: bool = False) -> Bounding:
    """Decide which triangles bound something and which way they face, or take them as oriented."""
    given = as_given(chain, chain.reversed)
    whole = given.whole
    held = ~whole & (as_oriented or nested == "given")  # what does not turn if it is read as given
    decided = _decided(chain, given, held, nested, as_oriented)
    if as_oriented or whole.all():
        return decided
    parts = _Parts.of(chain, given)
    missing = parts.missing(decided)
    readings, chosen, overlapping = [given], np.zeros(len(whole), dtype=np.int64), False
    if cone_volumes(chain.triangles, given.counts, parts.of_triangles + 1, len(parts.areas) + 1).sum() < 0:
        inside_out = _reversed(given)
        other = _decided(chain, inside_out, held, nested)
        left = parts.missing(other)
        if parts.areas @ left < parts.areas @ missing - LEAST_GAIN * parts.areas.sum():
            readings, decided, missing = [inside_out], other, left
    by_once = once(chain)
    for trial in _trials(chain, parts, given, by_once, missing, nested):
        todo = trial.parts & (missing >= trial.least)
        if not todo.any() or (trial.overlaps and not overlapping):
            continue
        readings.append(trial.reading)
        best = float(parts.areas @ missing), decided, chosen, missing
        for _ in range(2):  # first for all of these parts, then for those only that it explains better
            tried = np.where(~whole & todo[parts.of_triangles], len(readings) - 1, chosen)
            reading, fixed = mixed(chain, readings, tried), held & (tried == 0)
            other = _decided(chain, reading, fixed, trial.nested or nested, united=trial.united)
            overlapping |= other.overlapping
            left, price = parts.missing(other), LEAST_GAIN * parts.changed(decided, other)
            cost = float(parts.areas @ (left + price))
            if cost < best[0]:
                best = cost, other, tried, left
            better = todo & (left < missing - price)
            if (better == todo).all() or not better.any():
                break
            todo = better
        _, decided, chosen, missing = best
    inside = unexplained(chain, decided.counts, parts.pieces) < MOSTLY_WRONG
    inner = decided.inner | (~whole & ~decided.as_given & (decided.counts == 0) & inside[parts.pieces])
    decided = replace(decided, inner=inner, turned=decided.turned & ~inner)
    return _with_sheets_agreeing(chain, decided, by_once, whole)


def _trials(
    chain: Chain, parts: _Parts, given: Reading, by_once: Reading, missing: Floats, nested: Nesting
) -> list[_Trial]:
    """List the readings to try after that as given, which leaves the (p,) shares `missing` of the parts."""
    agreed = chain.agreeing_as_indexed()
    agreeing = _with_ways(chain, given, chain.reversed != agreed.turned)
    agreeing = replace(agreeing, disagreeing=agreed.disagreeing)
    outwards = _with_ways(chain, agreeing, chain.outwards_as_indexed(agreeing.reversed))
    # a single piece that agrees can only be turned, which costs `LEAST_GAIN`
    doubtful = (np.bincount(parts.of_pieces) > 1) | (missing > LEAST_GAIN)
    as_cavities: Nesting = "cavities" if nested == "given" else nested
    return [
        _Trial(agreeing, parts.differ(agreeing, given)),
        _Trial(by_once, doubtful),
        _Trial(outwards, parts.differ(outwards, agreeing)),
        _Trial(by_once, doubtful, united=False, overlaps=True),
        _Trial(by_once, doubtful, least=MOSTLY_WRONG, nested=as_cavities, overlaps=True),
    ]


def _with_sheets_agreeing(chain: Chain, decided: Bounding, agreeing: Reading, whole: Bools) -> Bounding:
    """Turn the triangles of complexes that bound nothing so that they agree with their neighbours."""
    sheets = ~whole & (np.bincount(chain.complexes, decided.counts != 0) == 0)[chain.complexes]
    if not sheets.any():
        return decided
    n = len(decided.orientable)
    return replace(
        decided,
        pieces=np.where(sheets, n + agreeing.pieces, decided.pieces),
        turned=np.where(sheets, agreeing.turned, decided.turned),
        inner=decided.inner & ~sheets,
        orientable=np.concatenate([decided.orientable, agreeing.orientable]),
        disagreeing=agreeing.disagreeing,
    )


def _with_ways(chain: Chain, reading: Reading, reversed: Bools) -> Reading:
    """Read a chain as given but for triangles that are reversed; a reading for which these are the same is kept."""
    return reading if np.array_equal(reversed, reading.reversed) else as_given(chain, reversed)


def _reversed(reading: Reading) -> Reading:
    """Turn all triangles that are not in whole complexes, which are turned anyway if they face inwards."""
    counts, turned = np.where(reading.whole, 1, -1) * reading.counts, reading.turned != ~reading.whole
    return replace(reading, counts=counts, turned=turned)


def _decided(
    chain: Chain,
    reading: Reading,
    fixed: Bools,
    nested: Nesting,
    as_oriented: bool = False,
    united: bool = True,
) -> Bounding:
    """Decide which pieces of a reading bound something and which way they face; those that are `fixed` do not turn.

    Open bodies that overlap are `united`, or else they are one body's outside and inside.
    """
    counts, pieces, orientable, whole = reading.counts, reading.pieces, reading.orientable, reading.whole
    n = len(orientable)
    idle = np.bincount(pieces, counts == 0, n) > 0
    open_pieces = (chain.open_edges(counts, pieces) > 0) | (idle & (np.bincount(pieces, whole, n) == 0))
    closed = ~open_pieces & orientable
    flips, levels, loose, bounds = np.ones(n), np.full(n, 0.5), np.full(n, -1), closed.copy()
    rest, overlapping = np.flatnonzero((open_pieces & orientable)[pieces] & (counts != 0)), False
    if len(rest):
        names, labels = np.unique(pieces[rest], return_inverse=True)
        triangles = directed(chain.triangles[rest], np.sign(counts[rest]))
        edges, owners = open_edges(chain.faces[rest], labels)
        groups = connected_pieces(chain, rest, labels, edges, owners)
        ends = chain.positions[edges]
        rims = Rims(ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), owners)
        around = np.zeros((0, 3, 3))
        if closed.any() and not as_oriented:
            facing = _nested(chain, pieces, counts * closed[pieces], closed, flips, nested)[0]
            around = directed(chain.triangles, counts * (closed * facing)[pieces])
        given = sums_of(np.sign(counts[rest] * chain.multiplicities[rest]) * chain.areas[rest], labels, len(names))
        held = np.bincount(labels, fixed[rest]) > 0
        signs, bounds[names], loose[names], levels[names], overlapping = open_bounding(
            Pieces(triangles, labels), groups, rims, given, around, held, nested, united
        )
        flips[names] = np.where(bounds[names], signs, 1.0)
    bodies = inwards = 0
    if closed.any() and not as_oriented:
        flips, bodies, inwards = _nested(chain, pieces, counts * bounds[pieces], closed, flips, nested)
    if (loose >= 0).any() and closed.any():
        along = _along(chain, pieces, loose, counts * flips[pieces] * closed[pieces])
        bounds &= ~along
        loose[along] = -1
    turned = reading.turned != (flips[pieces] < 0)
    final = (counts * flips[pieces] * bounds[pieces]).astype(np.int64)
    with_copies = (
        (whole | fixed)
        & (np.abs(counts) == np.abs(chain.multiplicities_with(reading.reversed)))
        & ((counts == 0) | bounds[pieces])
    )
    with_copies &= (np.bincount(chain.complexes, final != 0) > 0)[chain.complexes]
    inner = (counts == 0) & orientable[pieces] & ~whole & ~fixed
    return Bounding(
        pieces=pieces,
        turned=turned & ~inner,
        counts=final,
        closed=closed[pieces],
        loose=loose[pieces],
        levels=levels[pieces],
        as_given=with_copies,
        reversed=reading.reversed,
        inner=inner,
        orientable=orientable,
        disagreeing=reading.disagreeing,
        bodies=bodies,
        cavities=inwards,
        overlapping=overlapping,
    )


def _nested(
    chain: Chain, pieces: Ints, counts: Ints, closed: Bools, flips: Floats, nested: Nesting
) -> tuple[Floats, int, int]:
    """Return (p,) signs that turn closed pieces outwards, and the numbers of bodies and of cavities within others.

    Those within others face as `nested` says: with "given" as they were given relative to the
    outermost body, or by depth if that is unclear.
    """
    n = len(closed)
    counted = np.flatnonzero(counts != 0)
    triangles, owners = chain.triangles[counted], pieces[counted]
    volumes = cone_volumes(triangles, counts[counted], owners, n)
    outward = np.where(closed, np.where(volumes >= 0, 1.0, -1.0), flips)
    if len(np.unique(owners)) == 1:
        return outward, 0, 0
    names, labels = np.unique(owners, return_inverse=True)
    faces, places = sampled(Pieces(triangles, labels), 16 * len(names))
    probes, own = owners[faces], np.abs(counts[counted[faces]])
    normals = unit(area_vectors(triangles[faces]))
    tree = WindingTree.of(directed(chain.triangles, counts * outward[pieces]))
    around = tree.levels(places, normals, chain.areas[counted[faces]]) - 0.5 * own
    depth = np.full(n, np.inf)
    np.minimum.at(depth, probes, np.round(around - 0.25))  # a copy a rounding apart, at level ½, is not around
    depth = np.where(closed & np.isfinite(depth), depth, 0.0)
    inner = closed & (depth > 0)
    if not inner.any() or not (depth[owners] <= 0).any():  # of copies a rounding apart, each may lie within the other
        return outward, 0, 0
    given = np.bincount(pieces, np.sign(counts) * np.sign(chain.multiplicities) * chain.areas, n)
    clear = np.abs(given) >= HINT * np.bincount(pieces, chain.areas, n)
    way = np.where(given >= 0, 1.0, -1.0)
    rows, outermost = np.flatnonzero(inner[probes]), np.zeros(n)
    roots = WindingTree.of(directed(chain.triangles, counts * (way * (depth <= 0))[pieces]))
    np.add.at(outermost, probes[rows], roots.numbers(places[rows]))
    by_depth = np.where(depth % 2 == 0, 1.0, -1.0)
    facing = np.where(clear, outward * way * np.where(outermost >= 0, 1.0, -1.0), by_depth)
    facing = {"given": facing, "cavities": by_depth, "bodies": np.ones(n)}[nested]
    signs = np.where(inner, outward * facing, outward)
    return signs, int((inner & (facing > 0)).sum()), int((inner & (facing < 0)).sum())


def open_bounding(
    pieces: Pieces,
    groups: Ints,
    rims: Rims,
    given: Floats,
    closed: Floats,
    fixed: Bools,
    nested: Nesting = "given",
    united: bool = True,
) -> tuple[Floats, Bools, Ints, Floats, bool]:
    """Find for open pieces, (p,) each: signs, whether they bound something, clusters of loose ones or −1, and levels.

    Also say whether bodies were found that ignore others.

    A piece is loose if neither it nor its group is a body by itself. Pieces that are `fixed`, (p,), have the sign 1. In
    each round, pieces whose level is too low are left out if they leave at least half as much unexplained as the worst
    one.
    """
    n, areas = len(pieces.areas), pieces.areas
    shared = np.bincount(groups, minlength=n)[groups] > 1
    alone = np.abs(levels_of_pieces(pieces))
    clusters, whole = clusters_of(pieces), system_of(pieces)
    members = _counted(areas, np.arange(n), groups)[groups]
    overlapping = False
    alive, weights = np.ones(n, dtype=bool), np.ones(n)  # the signs of the weights are those of the pieces
    if not fixed.all():
        weights = whole.weights(fixed)
        within = bodies_around(whole, pieces, rims, groups, alone, signs_of(weights), given, closed, nested, united)
        overlapping = bool(within.any())
        if overlapping:
            whole = replace(whole, within=within)
            weights = whole.weights(fixed, weights)
    elif len(closed):
        around = WindingTree.of(closed).levels(whole.places, whole.normals, whole.areas)
        whole = replace(whole, within=-around)
    while alive.any():
        names, system = np.flatnonzero(alive), whole.chosen(alive)
        signs = signs_of(weights[names])
        values = system.levels(signs)
        held = fixed[names[system.owners]] & (values > 0.5)  # as given, what lies within a body bounds as little
        values[held] = 0.5 - np.abs(values[held] - np.floor(values[held]) - 0.5)
        rows, levels = names[system.owners], np.zeros(n)
        levels[names] = means(values, system.owners, system.areas, len(names))
        # whether groups are bodies by themselves; loose pieces are judged cluster by cluster
        within = system.levels_within(signs, groups[names])
        together, spread = (means(each, groups[rows], system.areas, n)[groups] for each in (within, within**2))
        together = np.where(shared & _is_body(together, spread, members), together, 0.0)
        by_itself = np.maximum(alone, together)
        own = by_itself >= SHEET
        loose = alive & ~own
        shares = np.where(loose[rows], system.areas, 0.0)
        mean = means(values, clusters[rows], shares, n)
        square = means(values**2, clusters[rows], shares, n)
        amount = _counted(areas * loose, groups, clusters)
        body = _is_body(mean, square, amount)
        thresholds = np.minimum(SHEET, 2 * SHEET * mean) if isinstance(system, Matrix) else -np.inf  # dipoles are noisy
        least = np.where(body, thresholds, np.inf)[clusters]
        wrong = alive & (levels < np.where(loose, least, SHEET * np.minimum(1.0, 2.0 * by_itself)))
        unexplained = np.where(wrong, areas * (0.5 - levels) ** 2, 0.0)
        if not wrong.any():
            break
        alive &= ~(wrong & (unexplained >= 0.5 * unexplained.max()))
        if alive.any() and not fixed[alive].all():
            weights[alive] = whole.chosen(alive).weights(fixed[alive], weights[alive])
    of_loose, of_bodies = (np.bincount(clusters, areas * (alive & mask), n) for mask in (~own, own))
    mostly = alive & (of_loose > of_bodies)[clusters]
    levels = np.where(mostly, mean[clusters], 0.5)
    return signs_of(weights), alive, np.where(mostly, clusters, -1), levels, overlapping


def _is_body(mean: Floats, square: Floats, pieces: Floats) -> Bools:
    """Whether levels, given their means, their mean squares and the number of pieces, are those of a body."""
    return (mean * np.sqrt(pieces + 1) >= CHANCE_LEVEL) & (mean**2 >= COHERENT_LEVELS * square)


def signs_of(weights: Floats) -> Floats:
    """(k,) signs of the weights of pieces."""
    return np.where(weights >= 0, 1.0, -1.0)


def _counted(areas: Floats, groups: Ints, clusters: Ints) -> Floats:
    """(p,) effective number of groups in each piece's cluster: (Σ a)² / Σ a², with a the areas of groups."""
    n = len(areas)
    keys, inverse = np.unique(clusters * n + groups, return_inverse=True)
    sums, owners = np.bincount(inverse, areas), keys // n
    squares = np.bincount(owners, sums**2, n)
    return np.bincount(owners, sums, n) ** 2 / np.maximum(squares, np.finfo(float).tiny)


def connected_pieces(chain: Chain, faces: Ints, labels: Ints, edges: Ints, owners: Ints) -> Ints:
    """(p,) component of each piece; pieces are joined by shared edges or by rims that run along each other."""
    n = int(labels.max()) + 1
    hubs = np.unique(chain.complexes[faces[first_members(labels, n)]], return_inverse=True)[1]
    several = np.bincount(labels)[owners] > 1
    owners, (left, right) = owners[several], meeting_edges(chain.positions[edges[several]])
    return connected_components(
        n + int(hubs.max()) + 1,
        *(np.concatenate(ends) for ends in ((np.arange(n), owners[left]), (n + hubs, owners[right]))),
    )[:n]


def _along(chain: Chain, pieces: Ints, clusters: Ints, counts: Floats | Ints) -> Bools:
    """(p,) whether pieces are in loose clusters along closed pieces, as noisy copies are: half inside, half outside."""
    chosen = np.flatnonzero(clusters[pieces] >= 0)
    around = WindingTree.of(directed(chain.triangles, counts)).numbers(chain.triangles[chosen].mean(axis=1))
    owners = clusters[pieces[chosen]]
    inside = means(around, owners, chain.areas[chosen], int(owners.max()) + 1)
    return (clusters >= 0) & (np.abs(inside - np.round(inside)) > PARTLY_INSIDE)[clusters]


def clusters_of(pieces: Pieces) -> Ints:
    """(p,) cluster of each piece. Two pieces are joined if they are within `GAP_REACH` sizes of the smaller one."""
    n = len(pieces.areas)
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, pieces.labels, pieces.triangles.min(axis=1))
    np.maximum.at(high, pieces.labels, pieces.triangles.max(axis=1))
    radii = 0.5 * np.linalg.norm(high - low, axis=1)
    elements = without_slender(pieces)
    faces, places = sampled(elements, min(len(elements.labels), 100_000))
    owners = elements.labels[faces]
    away, near = PointTree(places).query(places, min(9, len(places)))  # itself and 8
    away, others = away.reshape(len(places), -1), owners[near].reshape(len(places), -1)
    joined = away < 2 * GAP_REACH * np.minimum(radii[owners][:, None], radii[others])
    return connected_components(n, np.repeat(owners, joined.sum(axis=1)), others[joined])
