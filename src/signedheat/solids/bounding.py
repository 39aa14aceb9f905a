"""Which triangles of a shape bound a solid, and which way they face.

The shape is read as it was given first, except for components that are closed as soon as neighbours agree: these are
read so. Each connected part that this leaves unexplained is read in other ways, too (`readings`). The reading that
leaves the least area unexplained is used; as given wins ties.

Closed pieces are kept whole, and flipped as a whole to face outwards. Within another body each keeps the orientation
it was given relative to that body. All other pieces are open. Gauss's formula (`gauss`) decides for all of them
together which of them bound something, and which way they face if that is not given. It takes bodies that overlap into
account (`overlaps`). Where many loose triangles are near each other, it decides about these last.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..mesh.components import boxes_of, connected_components, first_members, sums_of
from ..mesh.triangles import cone_volumes
from ..mesh.welding import same_rows
from ..parallel import PointTree
from ..search.winding_tree import WindingTree
from .chain import Chain
from .gauss import Dipoles, Matrix, Pieces, are_soups, elements, means, sampled
from .overlaps import HINT, SHEET, Nesting, Rims, bodies_around, directed, levels_of_pieces
from .readings import Reading, as_given, mixed, once, unexplained
from .rims import meeting_edges, open_edges

LEAST_GAIN = 0.1
"""Another reading replaces the present one if the area that it explains in addition exceeds this share of the area
that counts differently."""
WELL_EXPLAINED = 1e-3
"""Parts are kept as given if a smaller share of their area is unexplained, since winding numbers are no more exact."""
MOSTLY_WRONG = 0.5
"""Parts of which more than this share is unexplained may be flipped as a whole, or be cavities of the body around."""
COHERENT_LEVELS = 0.7
"""Loose pieces are the remains of a body if the squared mean of their levels over the mean square is at least this.
Bodies have 0.81 to 1, however little is left; leaves, cards and strips have 0.3 to 0.6, however many there are."""
CHANCE_LEVEL = 0.42
"""n loose pieces bound nothing if their level times √(n + 1) is below this: the choice of signs alone explains that.
Two sheets a quarter of their width apart have 0.38, three sides of a box 0.2, a side that four others lack 0.47, and a
ball that has lost 85 % of its faces 0.95."""
PARTLY_INSIDE = 0.25
"""Loose pieces lie along closed ones, as noisy copies do, if the mean winding number of these there differs from whole
numbers by more than this."""
MOST_EXACT = 3000
"""Largest number of pieces with exact solid angles, since their matrix must be solved."""
GAP_REACH = 1.5
"""Largest distance between faces of two pieces that belong together, relative to the size of the smaller piece."""


@dataclass(frozen=True, eq=False)
class Bounding(Frozen):
    """Decision which triangles of a chain bound something, and which way they face."""

    pieces: Ints  # (m,) piece that each triangle belongs to
    turned: Bools  # (m,) which must be flipped from the orientation in which they were given first
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
        """(k,) whether each given triangle must be flipped; never those on fewer than three vertices."""
        as_given, turned = (np.append(values, False)[chain.numbers] for values in (self.as_given, self.turned))
        reversed_as_read = np.where(as_given, chain.reversed != self.reversed, chain.reversed)
        return np.asarray((chain.numbers >= 0) & (reversed_as_read != turned))


@dataclass(frozen=True, eq=False)
class _Parts:
    """Connected parts of a chain that are not whole as given; loose triangles, which tell little, are one part."""

    chain: Chain  # the m triangles
    whole: Bools  # (m,) which triangles are in no part, since they are whole as given
    pieces: Ints  # (m,) piece, as given, of each triangle; −1 if it is in no part
    of_pieces: Ints  # (q,) part of each piece
    of_triangles: Ints  # (m,) part of each triangle; −1 if it is in none
    areas: Floats  # (p,) area of each part

    @classmethod
    def of(cls, chain: Chain, given: Reading) -> _Parts:
        """Find the parts of a chain, read as `given`."""
        whole, pieces = given.whole, np.full(len(given.whole), -1)
        names, pieces[~whole] = np.unique(given.pieces[~whole], return_inverse=True)
        loose = np.bincount(chain.complexes)[chain.complexes] == 1
        firsts = first_members(given.pieces, len(given.orientable))[names]
        of_pieces = np.unique(np.where(loose, -1, chain.complexes)[firsts], return_inverse=True)[1]
        of_triangles = np.where(whole, -1, of_pieces[pieces])
        areas = np.bincount(of_triangles[~whole], chain.areas[~whole]).astype(np.float64)
        return cls(chain, whole, pieces, of_pieces, of_triangles, areas)

    def judged(self, decided: Bounding) -> _Judged:
        """Measure how much of each piece, and of each part, a decision leaves unexplained."""
        areas = np.bincount(self.pieces[~self.whole], self.chain.areas[~self.whole]).astype(np.float64)
        of_pieces = unexplained(self.chain, decided.counts, self.pieces)
        return _Judged(decided, of_pieces, means(of_pieces, self.of_pieces, areas, len(self.areas)))

    def changed(self, first: Bounding, second: Bounding) -> Floats:
        """(p,) share of the area of each part that counts differently in two decisions."""
        rows = np.flatnonzero(~self.whole & (first.counts != second.counts))
        areas = np.bincount(self.of_triangles[rows], self.chain.areas[rows], len(self.areas))
        return np.asarray(areas / np.maximum(self.areas, 1e-300))

    def differ(self, first: Reading, second: Reading) -> Bools:
        """(p,) whether two readings count, or connect, triangles of each part in different ways."""
        firsts = [first_members(reading.pieces, len(reading.orientable))[reading.pieces] for reading in (first, second)]
        rows = np.flatnonzero(~self.whole & ((first.counts != second.counts) | (firsts[0] != firsts[1])))
        return mask_of(len(self.areas), self.of_triangles[rows])


class _Judged(NamedTuple):
    """A decision, and how much it leaves unexplained."""

    decided: Bounding
    of_pieces: Floats  # (q,) share of the area of each piece, as given, that is unexplained
    missing: Floats  # (p,) the same of each part


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
    """Decide which triangles of a chain bound something, and which way they face.

    With "given", a closed part within others is a body if it faces as the outermost of these does, and else a cavity.
    With "cavities", it is a cavity, and parts within it are bodies. With "bodies", all are bodies. With `as_oriented`,
    nothing is flipped, and the chain is read as given only.
    """
    given = as_given(chain, chain.reversed)
    if as_oriented or given.whole.all():
        return _decided(chain, given, ~given.whole & as_oriented, nested, as_oriented)
    agreeing = _agreeing(chain, given)
    given = mixed(chain, [given, agreeing], (agreeing.whole & ~given.whole).astype(np.int64))
    whole = given.whole
    held = ~whole & (nested == "given")  # these are not flipped if they are read as given
    decided = _decided(chain, given, held, nested)
    if whole.all():
        return decided
    parts = _Parts.of(chain, given)
    best = parts.judged(decided)
    readings, chosen, overlapping = [given], np.zeros(len(whole), dtype=np.int64), False
    # as given, but inside out
    if cone_volumes(chain.triangles, given.counts, parts.of_triangles + 1, len(parts.areas) + 1).sum() < 0:
        inside_out = _reversed(given)
        candidate = parts.judged(_decided(chain, inside_out, held, nested))
        if parts.areas @ candidate.missing < parts.areas @ best.missing - LEAST_GAIN * parts.areas.sum():
            readings, best = [inside_out], candidate
    # other readings, of which `chosen` is the one that each triangle is read by so far, as an index
    by_once = once(chain)
    for trial in _trials(chain, parts, given, agreeing, by_once, best.missing, nested):
        present, improvable = best, trial.parts & (best.missing >= trial.least)
        if not improvable.any() or (trial.overlaps and not overlapping):
            continue
        readings.append(trial.reading)
        least, best_choice = float(parts.areas @ present.missing), chosen
        for _ in range(2):  # first for all of these parts, then for those only that it explains better
            assignment = np.where(~whole & improvable[parts.of_triangles], len(readings) - 1, chosen)
            reading, fixed = mixed(chain, readings, assignment), held & (assignment == 0)
            candidate = parts.judged(_decided(chain, reading, fixed, trial.nested or nested, united=trial.united))
            overlapping |= candidate.decided.overlapping
            price = LEAST_GAIN * parts.changed(present.decided, candidate.decided)
            cost = float(parts.areas @ (candidate.missing + price))
            if cost < least:
                least, best, best_choice = cost, candidate, assignment
            better = improvable & (candidate.missing < present.missing - price)
            if (better == improvable).all() or not better.any():
                break
            improvable = better
        chosen = best_choice
    # triangles that do not count are inner ones in pieces of which little else is unexplained
    decided, inside = best.decided, best.of_pieces < MOSTLY_WRONG
    inner = decided.inner | (~whole & ~decided.as_given & (decided.counts == 0) & inside[parts.pieces])
    decided = replace(decided, inner=inner, turned=decided.turned & ~inner)
    return _with_sheets_agreeing(chain, decided, by_once, whole)


def _trials(
    chain: Chain,
    parts: _Parts,
    given: Reading,
    agreeing: Reading,
    by_once: Reading,
    missing: Floats,
    nested: Nesting,
) -> list[_Trial]:
    """List the readings to try after that as `given`, in order; it leaves the (p,) shares `missing` unexplained.

    `by_once` reads each triangle once, and `nested` is how closed pieces within others are asked to face.
    """
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
    """Orient the triangles of components that bound nothing as in the reading `agreeing`, like their neighbours.

    A component is one across edges of any number of triangles; `whole` ones, (m,), are left as they are.
    """
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


def _agreeing(chain: Chain, given: Reading) -> Reading:
    """Read a chain as `given`, but with triangles that share an edge by index oriented consistently."""
    agreed = chain.agreeing_as_indexed()
    return replace(_with_ways(chain, given, chain.reversed != agreed.turned), disagreeing=agreed.disagreeing)


def _with_ways(chain: Chain, reading: Reading, reversed: Bools) -> Reading:
    """Read a chain as given with (k,) triangles `reversed`; return `reading` itself if it reverses the same ones."""
    return reading if np.array_equal(reversed, reading.reversed) else as_given(chain, reversed)


def _reversed(reading: Reading) -> Reading:
    """Reverse all triangles but the `whole` ones, which `_decided` orients outwards anyway."""
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
    """Decide which pieces of a reading bound something and which way they face.

    Pieces with `fixed` triangles, (m,), are not flipped. Open bodies that overlap are `united`; without that, they are
    the outside and the inside of one body.
    """
    counts, pieces, orientable, whole = reading.counts, reading.pieces, reading.orientable, reading.whole
    # (p,) pieces with open edges or with triangles that do not count are open
    n = len(orientable)
    has_idle = np.bincount(pieces, counts == 0, n) > 0
    is_open = (chain.open_edges(counts, pieces) > 0) | (has_idle & (np.bincount(pieces, whole, n) == 0))
    closed = ~is_open & orientable
    flips, levels, loose, bounds = np.ones(n), np.full(n, 0.5), np.full(n, -1), closed.copy()
    open_faces, overlapping = np.flatnonzero((is_open & orientable)[pieces] & (counts != 0)), False
    if len(open_faces):
        around = np.zeros((0, 3, 3))
        if closed.any() and not as_oriented:
            facing = _nested(chain, pieces, counts * closed[pieces], closed, flips, nested)[0]
            around = directed(chain.triangles, counts * (closed * facing)[pieces])
        names, labels = np.unique(pieces[open_faces], return_inverse=True)
        open_pieces = _open_pieces(chain, counts, fixed, open_faces, labels)
        found = open_bounding(open_pieces, around, nested, united)
        bounds[names], loose[names], levels[names], overlapping = found.bounds, found.loose, found.levels, found.overlap
        flips[names] = np.where(bounds[names], found.signs, 1.0)
    # closed pieces once more, since they may lie within open ones
    bodies = inwards = 0
    if closed.any() and not as_oriented:
        flips, bodies, inwards = _nested(chain, pieces, counts * bounds[pieces], closed, flips, nested)
    if (loose >= 0).any() and closed.any():
        along = _along_closed(chain, pieces, loose, counts * flips[pieces] * closed[pieces])
        bounds &= ~along
        loose[along] = -1
    # from pieces to triangles
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


def _open_pieces(chain: Chain, counts: Ints, fixed: Bools, faces: Ints, labels: Ints) -> OpenPieces:
    """Gather what decides about open pieces, which consist of the (k,) `faces`; `labels`, (k,), are their pieces.

    `counts`, (m,), say how often triangles count, and `fixed`, (m,), which are not flipped.
    """
    pieces = Pieces(directed(chain.triangles[faces], np.sign(counts[faces])), labels)
    edges, owners = open_edges(chain.faces[faces], labels)
    ends = chain.positions[edges]
    rims = Rims(ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), owners)
    as_given = np.sign(counts[faces] * chain.multiplicities[faces]) * chain.areas[faces]
    return OpenPieces(
        pieces,
        clusters_of(pieces),
        connected_pieces(chain, faces, labels, edges, owners),
        rims,
        given=sums_of(as_given, labels, len(pieces.areas)),
        fixed=np.bincount(labels, fixed[faces]) > 0,
    )


def _nested(
    chain: Chain, pieces: Ints, counts: Ints, closed: Bools, flips: Floats, nested: Nesting
) -> tuple[Floats, int, int]:
    """Return (p,) signs, −1 for closed pieces to flip, and the numbers of bodies and of cavities within others.

    Outermost pieces face outwards. Those within others face as `nested` says: with "given" as they were given relative
    to the outermost body, or by depth if that is unclear. Pieces that are not `closed` keep their signs `flips`.
    """
    # all closed pieces outwards
    n = len(closed)
    counted = np.flatnonzero(counts != 0)
    triangles, owners = chain.triangles[counted], pieces[counted]
    volumes = cone_volumes(triangles, counts[counted], owners, n)
    outward = np.where(closed, np.where(volumes >= 0, 1.0, -1.0), flips)
    if len(np.unique(owners)) == 1:
        return outward, 0, 0
    # depth: the number of other pieces around a piece, the least at its sample points
    names, labels = np.unique(owners, return_inverse=True)
    faces, points = sampled(Pieces(triangles, labels), 16 * len(names))
    probes, own = owners[faces], np.abs(counts[counted[faces]])
    tree = WindingTree.of(directed(chain.triangles, counts * outward[pieces]))
    around = tree.levels(points) - 0.5 * own
    depth = np.full(n, np.inf)
    np.minimum.at(depth, probes, np.round(around - 0.25))  # a copy a rounding apart, at level ½, is not around
    depth = np.where(closed & np.isfinite(depth), depth, 0.0)
    inner = closed & (depth > 0)
    if not inner.any() or not (depth[owners] <= 0).any():  # of copies a rounding apart, each may lie within the other
        return outward, 0, 0
    # how each inner piece was given, relative to the outermost piece around it
    given = np.bincount(pieces, np.sign(counts) * np.sign(chain.multiplicities) * chain.areas, n)
    clear = np.abs(given) >= HINT * np.bincount(pieces, chain.areas, n)
    given_sign = np.where(given >= 0, 1.0, -1.0)
    rows, outermost = np.flatnonzero(inner[probes]), np.zeros(n)
    roots = WindingTree.of(directed(chain.triangles, counts * (given_sign * (depth <= 0))[pieces]))
    np.add.at(outermost, probes[rows], roots.numbers(points[rows]))
    by_depth = np.where(depth % 2 == 0, 1.0, -1.0)
    facing = np.where(clear, outward * given_sign * np.where(outermost >= 0, 1.0, -1.0), by_depth)
    facing = {"given": facing, "cavities": by_depth, "bodies": np.ones(n)}[nested]
    signs = np.where(inner, outward * facing, outward)
    return signs, int((inner & (facing > 0)).sum()), int((inner & (facing < 0)).sum())


class OpenPieces(NamedTuple):
    """Open pieces that are decided about together."""

    pieces: Pieces  # p pieces, directed as they count
    clusters: Ints  # (p,) cluster of pieces that are near each other (`clusters_of`)
    groups: Ints  # (p,) connected group of each
    rims: Rims  # their boundary edges
    given: Floats  # (p,) area of each that faces as given, less the rest
    fixed: Bools  # (p,) which are not flipped

    def chosen(self, kept: Bools) -> OpenPieces:
        """Restrict to some of the pieces, (p,) bool; these, their clusters and their groups are renumbered in order."""
        (triangles, labels), (middles, lengths, owners) = (self.pieces.triangles, self.pieces.labels), self.rims
        rows, edges, number = kept[labels], kept[owners], np.cumsum(kept) - 1
        clusters, groups = (np.unique(names[kept], return_inverse=True)[1] for names in (self.clusters, self.groups))
        pieces, rims = Pieces(triangles[rows], number[labels[rows]]), (middles[edges], lengths[edges])
        return OpenPieces(
            pieces, clusters, groups, Rims(*rims, number[owners[edges]]), self.given[kept], self.fixed[kept]
        )


class OpenBounding(NamedTuple):
    """Decision which open pieces bound something, and which way they face."""

    signs: Floats  # (p,) −1 for pieces to be flipped, 1 for others
    bounds: Bools  # (p,) which bound something
    # (p,) cluster of each, where it consists mostly of loose pieces: neither they nor their groups are bodies; else −1
    loose: Ints
    levels: Floats  # (p,) mean level of that cluster; ½ for all others
    overlap: bool  # whether there are bodies that ignore others


def open_bounding(given: OpenPieces, closed: Floats, nested: Nesting = "given", united: bool = True) -> OpenBounding:
    """Orient open pieces, and decide which of them bound something.

    `closed` are (k, 3, 3) triangles of closed pieces. `nested` decides which bodies within others are cavities, and
    `united` whether bodies that overlap ignore each other. Clusters of many loose triangles are decided about last,
    since they tell nothing that is exact about others.
    """
    soups = are_soups(given.pieces, given.clusters)
    if soups.all() or not soups.any():
        return _open_bounding(given, bool(soups.any()), closed, nested, united)
    signs, bounds = np.ones(len(soups)), np.zeros(len(soups), dtype=bool)
    loose, levels, overlap = np.full(len(soups), -1), np.full(len(soups), 0.5), False
    for is_soup in (False, True):
        kept = soups == is_soup
        part = given.chosen(kept)
        found = _open_bounding(part, is_soup, closed, nested, united)
        signs[kept], bounds[kept], levels[kept] = found.signs, found.bounds, found.levels
        firsts = given.clusters[kept][first_members(part.clusters, int(part.clusters.max()) + 1)]
        loose[kept] = np.where(found.loose >= 0, firsts[found.loose], -1)
        overlap |= found.overlap
        rows = np.where(found.bounds, found.signs, 0.0)[part.pieces.labels]
        closed = np.concatenate([closed, directed(part.pieces.triangles, rows)])
    return OpenBounding(signs, bounds, loose, levels, overlap)


def _open_bounding(open_pieces: OpenPieces, soup: bool, closed: Floats, nested: Nesting, united: bool) -> OpenBounding:
    """Decide about open pieces as `open_bounding` does; each triangle is a dipole if they are a `soup`, or too many.

    Weights orient the pieces, and levels tell which of them bound something. In each round, pieces whose level is too
    low are left out if they leave at least half as much unexplained as the worst one; then the weights are solved for
    again. How high a level must be depends on what a piece belongs to: a body by itself, or a cluster of loose pieces.
    """
    pieces, clusters, groups, rims, given, fixed = open_pieces
    n, areas = len(pieces.areas), pieces.areas
    in_groups = np.bincount(groups, minlength=n)[groups] > 1
    alone = np.abs(levels_of_pieces(pieces))
    whole = Dipoles.of_triangles(pieces) if soup or n > MOST_EXACT else Matrix.of(pieces)
    group_sizes = _effective_counts(areas, np.arange(n), groups)[groups]
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
        around = WindingTree.of(closed).levels(whole.points)
        whole = replace(whole, within=-around)
    while alive.any():
        names, system = np.flatnonzero(alive), whole.chosen(alive)
        signs, owners = signs_of(weights[names]), names[system.owners]  # (s,) piece of each sample
        # (s,) levels at samples, and (n,) of pieces; fixed ones within bodies have 1½, 2½, …, which count as ½, and so
        # do walls between touching bodies, of which one piece encloses both sides by itself
        values = system.levels(signs)
        within_body = fixed[owners] & (values > 0.5)
        if within_body.any():
            by_piece = system.levels_within(signs, np.arange(len(names)))[within_body]
            off = np.abs(values[within_body] - np.floor(values[within_body]) - 0.5)
            values[within_body] = np.maximum(0.5 - off, np.minimum(by_piece, 0.5))
        levels = np.zeros(n)
        levels[names] = means(values, system.owners, system.areas, len(names))
        # which pieces are bodies by themselves, alone or with their group
        in_group = system.levels_within(signs, groups[names])
        mean, square = (means(each, groups[owners], system.areas, n)[groups] for each in (in_group, in_group**2))
        of_group = np.where(in_groups & _is_body(mean, square, group_sizes), mean, 0.0)
        by_itself = np.maximum(alone, of_group)
        own = by_itself >= SHEET
        # all others are loose: which of their clusters are bodies
        loose = alive & ~own
        loose_areas = np.where(loose[owners], system.areas, 0.0)
        mean, square = (means(each, clusters[owners], loose_areas, n) for each in (values, values**2))
        body = _is_body(mean, square, _effective_counts(areas * loose, groups, clusters))
        # leave out those whose level is too low, the worst first
        thresholds = np.minimum(SHEET, 2 * SHEET * mean) if isinstance(system, Matrix) else -np.inf  # dipoles are noisy
        least = np.where(body, thresholds, np.inf)[clusters]
        wrong = alive & (levels < np.where(loose, least, SHEET * np.minimum(1.0, 2.0 * by_itself)))
        unexplained = np.where(wrong, areas * (0.5 - levels) ** 2, 0.0)
        if not wrong.any():
            break
        alive &= ~(wrong & (unexplained >= 0.5 * unexplained.max()))
        if alive.any() and not fixed[alive].all():
            weights[alive] = whole.chosen(alive).weights(fixed[alive], weights[alive])
    area_loose, area_own = (np.bincount(clusters, areas * (alive & mask), n) for mask in (~own, own))
    mostly_loose = alive & (area_loose > area_own)[clusters]
    levels = np.where(mostly_loose, mean[clusters], 0.5)
    return OpenBounding(signs_of(weights), alive, np.where(mostly_loose, clusters, -1), levels, overlapping)


def _is_body(mean: Floats, square: Floats, pieces: Floats) -> Bools:
    """(n,) whether levels are those of a body, given their means, mean squares and the numbers of pieces, (n,) each.

    The mean must exceed what chance explains, and the levels must be nearly the same.
    """
    return (mean * np.sqrt(pieces + 1) >= CHANCE_LEVEL) & (mean**2 >= COHERENT_LEVELS * square)


def signs_of(weights: Floats) -> Floats:
    """(k,) signs of the weights of pieces."""
    return np.where(weights >= 0, 1.0, -1.0)


def _effective_counts(areas: Floats, groups: Ints, clusters: Ints) -> Floats:
    """(p,) effective number of groups in the cluster with each index: (Σ a)² / Σ a², with a the areas of groups.

    All arguments are (p,), one value for each piece.
    """
    n = len(areas)
    keys, inverse = np.unique(clusters * n + groups, return_inverse=True)
    sums, owners = np.bincount(inverse, areas), keys // n
    squares = np.bincount(owners, sums**2, n)
    return np.bincount(owners, sums, n) ** 2 / np.maximum(squares, np.finfo(float).tiny)


def connected_pieces(chain: Chain, faces: Ints, labels: Ints, edges: Ints, owners: Ints) -> Ints:
    """(p,) component of each piece, connected by shared edges or by rims that run along each other.

    `labels` are the pieces of the (k,) faces, `edges` the (r, 2) open edges of pieces, and `owners` their pieces.
    """
    # nodes are the pieces, and a hub for each part that shared edges connect
    n = int(labels.max()) + 1
    hubs = np.unique(chain.complexes[faces[first_members(labels, n)]], return_inverse=True)[1]
    several = np.bincount(labels)[owners] > 1  # loose triangles are connected by clusters only
    # where two pieces share an edge, they are connected already
    on_rim = several & (np.bincount(same_rows(np.sort(edges, axis=1)), minlength=len(edges)) == 1)
    owners, (left, right) = owners[on_rim], meeting_edges(chain.positions[edges[on_rim]])
    return connected_components(
        n + int(hubs.max()) + 1,
        *(np.concatenate(ends) for ends in ((np.arange(n), owners[left]), (n + hubs, owners[right]))),
    )[:n]


def _along_closed(chain: Chain, pieces: Ints, clusters: Ints, counts: Floats | Ints) -> Bools:
    """(p,) whether pieces are in loose clusters along closed pieces, as noisy copies are: half inside, half outside.

    `pieces` are (m,), `clusters` (p,) or −1; `counts`, (m,), say how often each triangle is part of a closed piece.
    """
    chosen = np.flatnonzero(clusters[pieces] >= 0)
    around = WindingTree.of(directed(chain.triangles, counts)).numbers(chain.triangles[chosen].mean(axis=1))
    owners = clusters[pieces[chosen]]
    inside = means(around, owners, chain.areas[chosen], int(owners.max()) + 1)
    return (clusters >= 0) & (np.abs(inside - np.round(inside)) > PARTLY_INSIDE)[clusters]


def clusters_of(pieces: Pieces) -> Ints:
    """(p,) cluster of each piece: pieces are connected if within `GAP_REACH` sizes of the smaller one of each other."""
    n = len(pieces.areas)
    if n == 1:
        return np.zeros(1, dtype=np.int64)
    low, high = boxes_of(pieces.triangles.reshape(-1, 3), np.repeat(pieces.labels, 3), n)
    sizes = np.linalg.norm(high - low, axis=1)
    # distances are between centres of triangles that are not slender, and each is compared with the 8 nearest only:
    # what is farther away is connected through these, as a rule
    parts, faces = elements(pieces)
    owners, points = parts.labels[faces], parts.triangles[faces].mean(axis=1)
    away, near = PointTree(points).query(points, min(9, len(points)))  # itself and 8
    away, others = away.reshape(len(points), -1), owners[near].reshape(len(points), -1)
    joined = away < GAP_REACH * np.minimum(sizes[owners][:, None], sizes[others])
    return connected_components(n, np.repeat(owners, joined.sum(axis=1)), others[joined])
