"""Which triangles of a shape bound a solid, and which way they face.

Closed parts are kept whole: complexes whose directed edges cancel as given, and pieces whose edges cancel once their
faces agree. Each is turned outwards as a whole; within another body it keeps the orientation it was given relative to
that body. All other pieces are open, and Gauss's formula (`gauss`) decides for all of them together; it takes bodies
that overlap into account (`overlaps`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..arrays import Bools, Floats, Frozen, Ints
from ..mesh.components import connected_components, first_members, sums_of
from ..mesh.triangles import area_vectors
from ..mesh.unit_vectors import unit
from ..search.winding_tree import WindingTree
from .chain import Chain, inner_walls
from .gauss import Matrix, Pieces, means, sampled, system_of, without_slender
from .overlaps import HINT, SHEET, Nesting, Rims, bodies_around, directed, levels_of_pieces, levels_within
from .rims import meeting_edges, open_edges

COHERENT_LEVELS = 0.7
"""Loose pieces are the remains of a body if the squared mean of their levels over the mean square is at least this.
Bodies have .81 to 1, however little is left; leaves, cards and strips have .3 to .6, however many there are."""
CHANCE_LEVEL = 0.42
"""n loose pieces bound nothing if their level times √(n + 1) is below this: the choice of signs alone explains that.
Two sheets a quarter of their width apart have .38, three sides of a box .2, a side that four others lack .47, and a
ball that has lost 85 % of its faces .95."""
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
    as_given: Bools  # (m,) which are in complexes that close as given, with all copies
    inner: Bools  # (m,) walls between closed cells
    orientable: Bools  # (p,) pieces whose faces can be oriented consistently
    disagreeing: int  # number of edges across which two faces disagreed
    bodies: int  # number of closed pieces within others that face outwards
    cavities: int  # number of those that face inwards

    def to_turn(self, chain: Chain) -> Bools:
        """(k,) whether each given triangle must turn; triangles on fewer than three places need not."""
        as_given, turned = (np.append(values, False)[chain.numbers] for values in (self.as_given, self.turned))
        return np.asarray((chain.numbers >= 0) & ((~as_given & chain.reversed) != turned))


def bounding(chain: Chain, nested: Nesting = "given", as_oriented: bool = False) -> Bounding:
    """Decide which triangles bound something and which way they face, or take them as oriented."""
    counts, whole = whole_complexes(chain)
    inner = inner_walls(chain) & ~whole
    agreed = chain.pieces_as_given() if as_oriented else chain.pieces(~inner)
    # a whole complex is one piece; other complexes are divided into pieces
    pieces = np.where(whole, len(agreed.orientable) + chain.complexes, agreed.parts)
    pieces = np.unique(pieces, return_inverse=True)[1]
    orientable = np.ones(int(pieces.max(initial=-1)) + 1, dtype=bool)
    orientable[pieces[~whole]] = agreed.orientable[agreed.parts[~whole]]
    turned = (chain.multiplicities < 0) if as_oriented else np.where(whole, False, agreed.turned)
    counts = np.where(whole, counts, np.where(turned, -1, 1) * (orientable[pieces] & ~inner))
    open_pieces = chain.unbalanced(counts, pieces)
    open_pieces[pieces[inner]] = True
    n = len(open_pieces)
    closed = ~open_pieces & orientable
    flips, levels, loose, bounds = np.ones(n), np.full(n, 0.5), np.full(n, -1), closed.copy()
    rest = np.flatnonzero((open_pieces & orientable)[pieces] & ~inner)
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
        signs, bounds[names], loose[names], levels[names] = open_bounding(
            Pieces(triangles, labels), groups, rims, given, around, nested, as_oriented
        )
        flips[names] = np.where(bounds[names], signs, 1.0)
    bodies = cavities = 0
    if closed.any() and not as_oriented:
        flips, bodies, cavities = _nested(chain, pieces, counts * bounds[pieces], closed, flips, nested)
    if (loose >= 0).any() and closed.any():
        along = _along(chain, pieces, loose, counts * flips[pieces] * closed[pieces])
        bounds &= ~along
        loose[along] = -1
    turned = np.where(whole, False, turned) != (flips[pieces] < 0)
    as_given = whole & (np.abs(counts) == np.abs(chain.multiplicities))
    counts = (counts * flips[pieces] * bounds[pieces]).astype(np.int64)
    return Bounding(
        pieces=pieces,
        turned=turned & ~inner,
        counts=counts,
        closed=closed[pieces],
        loose=loose[pieces],
        levels=levels[pieces],
        as_given=as_given,
        inner=inner,
        orientable=orientable,
        disagreeing=agreed.disagreeing,
        bodies=bodies,
        cavities=cavities,
    )


def whole_complexes(chain: Chain) -> tuple[Ints, Bools]:
    """Find complexes that close as given and face one way; return how often triangles count, and which are in them.

    If the directed edges of a complex cancel only without copies, its triangles count once. Both results are (m,).
    """
    counts, complexes = chain.multiplicities, chain.complexes
    once = np.sign(counts)
    off = chain.unbalanced(counts, complexes)
    single = off & ~chain.unbalanced(once, complexes)
    counts = np.where(single[complexes], once, counts)
    filled = np.bincount(complexes, counts != 0) > 0
    balanced = (~off | single) & filled
    if not balanced.any():
        return counts, np.zeros(len(counts), dtype=bool)
    chosen = np.flatnonzero(balanced[complexes] & (counts != 0))
    # the largest triangle of each piece
    parts = chain.pieces(counts != 0).parts[chosen]
    order = np.lexsort((-chain.areas[chosen], parts))
    largest = order[np.unique(parts[order], return_index=True)[1]]
    levels = levels_within(chain.triangles[chosen], complexes[chosen], counts[chosen], largest)
    owners = complexes[chosen[largest]]
    ahead, back = (np.bincount(owners, sign * levels < 0.25, len(balanced)) == 0 for sign in (1, -1))
    return counts, (balanced & (ahead | back))[complexes]


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
    a, b, c = triangles.transpose(1, 0, 2)
    cones = counts[counted] * np.einsum("ij,ij->i", a, np.cross(b, c))
    outward = np.where(closed, np.where(np.bincount(owners, cones, n) >= 0, 1.0, -1.0), flips)
    if len(np.unique(owners)) == 1:
        return outward, 0, 0
    names, labels = np.unique(owners, return_inverse=True)
    faces, places = sampled(Pieces(triangles, labels), 16 * len(names))
    probes, own = owners[faces], np.abs(counts[counted[faces]])
    normals = unit(area_vectors(triangles[faces]))
    tree = WindingTree.of(directed(chain.triangles, counts * outward[pieces]))
    around = tree.levels(places, normals, chain.areas[counted[faces]]) - 0.5 * own
    depth = np.full(n, np.inf)
    np.minimum.at(depth, probes, np.round(around))
    depth = np.where(closed & np.isfinite(depth), depth, 0.0)
    inner = closed & (depth > 0)
    if not inner.any():
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
    nested: Nesting = "given",
    as_oriented: bool = False,
) -> tuple[Floats, Bools, Ints, Floats]:
    """Find for open pieces, (p,) each: signs, whether they bound something, clusters of loose ones or −1, and levels.

    A piece is loose if neither it nor its group is a body by itself. In each round, pieces whose level is too low are
    left out if they leave at least half as much unexplained as the worst one.
    """
    n, areas = len(pieces.areas), pieces.areas
    shared = np.bincount(groups, minlength=n)[groups] > 1
    alone = np.abs(levels_of_pieces(pieces))
    clusters, whole = clusters_of(pieces), system_of(pieces)
    alive, weights = np.ones(n, dtype=bool), np.ones(n)  # the signs of the weights are those of the pieces
    if not as_oriented:
        weights = whole.weights()
        within = bodies_around(whole, pieces, rims, groups, alone, signs_of(weights), given, closed, nested)
        if within.any():
            whole = replace(whole, within=within)
            weights = whole.weights(weights)
    while alive.any():
        names, system = np.flatnonzero(alive), whole.chosen(alive)
        signs = signs_of(weights[names])
        values = system.levels(signs)
        rows, levels = names[system.owners], np.zeros(n)
        levels[names] = means(values, system.owners, system.areas, len(names))
        # whether groups are bodies by themselves; loose pieces are judged cluster by cluster
        together = means(system.levels_within(signs, groups[names]), groups[rows], system.areas, n)[groups]
        by_itself = np.where(shared, together, alone)
        own = by_itself >= SHEET
        loose = alive & ~own
        shares = np.where(loose[rows], system.areas, 0.0)
        mean = means(values, clusters[rows], shares, n)
        square = means(values**2, clusters[rows], shares, n)
        amount = _counted(areas * loose, groups, clusters)
        body = (mean * np.sqrt(amount + 1) >= CHANCE_LEVEL) & (mean**2 >= COHERENT_LEVELS * square)
        thresholds = np.minimum(SHEET, 2 * SHEET * mean) if isinstance(system, Matrix) else -np.inf  # dipoles are noisy
        least = np.where(body, thresholds, np.inf)[clusters]
        wrong = alive & (levels < np.where(loose, least, SHEET * np.minimum(1.0, 2.0 * by_itself)))
        unexplained = np.where(wrong, areas * (0.5 - levels) ** 2, 0.0)
        if not wrong.any():
            break
        alive &= ~(wrong & (unexplained >= 0.5 * unexplained.max()))
        if not as_oriented and alive.any():
            weights[alive] = whole.chosen(alive).weights(weights[alive])
    of_loose, of_bodies = (np.bincount(clusters, areas * (alive & mask), n) for mask in (~own, own))
    mostly = alive & (of_loose > of_bodies)[clusters]
    return signs_of(weights), alive, np.where(mostly, clusters, -1), np.where(mostly, mean[clusters], 0.5)


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
    owners, (left, right, _) = owners[several], meeting_edges(chain.positions[edges[several]])
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
    away, near = scipy.spatial.cKDTree(places).query(places, min(9, len(places)), workers=-1)  # itself and 8
    away, others = away.reshape(len(places), -1), owners[near].reshape(len(places), -1)
    joined = away < 2 * GAP_REACH * np.minimum(radii[owners][:, None], radii[others])
    return connected_components(n, np.repeat(owners, joined.sum(axis=1)), others[joined])
