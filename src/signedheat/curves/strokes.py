"""Regions that strokes on a surface may bound: their energy, and the region of least energy by a minimum cut.

A region is the set of vertices with side 1, called the inside. It is to the left of the strokes that bound it. Strokes
are oriented curves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..constraints import ZeroSet
from ..errors import CancellingNormalsError
from ..geodesics.geodesic_sources import PlacedSegments, nearest_shares
from ..linear import factorize
from ..mesh.components import grouped, members_of, sums_of
from ..mesh.curve_segments import CurveSegments
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..method import diffuse, integrate, normalize
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..validation import SMALLEST_EXTENT

PULL_UNITS = 2.0**40
"""Sum of all pulls to one side after scaling. Pulls and costs are rounded to integers, so that the flow is exact."""


@dataclass(frozen=True, eq=False)
class CutGraph:
    """A graph for minimum cuts with different costs: n nodes, and two arcs for each of e edges, sorted by tail."""

    starts: Ints  # (n + 1,) the arcs that leave node i are those from starts[i] to starts[i + 1]
    heads: Ints  # (2 e,) the node that each arc leads to
    reverse: Ints  # (2 e,) index of the opposite arc
    order: Ints  # (2 e,) edge of each arc, plus e if the arc runs from the edge's second node to its first

    @classmethod
    def of(cls, edges: Ints, n: int) -> CutGraph:
        """Make the graph of n nodes and (e, 2) edges."""
        tails, heads = np.concatenate([edges, edges[:, ::-1]]).T
        starts, order = grouped(tails, n)
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return cls(starts, np.ascontiguousarray(heads[order]), rank[(order + len(edges)) % len(order)], order)

    def cut(self, falling: Floats, rising: Floats, pull: Floats, ties: Floats) -> Floats:
        """Return (n,) signs s = ±1 of nodes that minimise the cost of cut edges less Σ (pull + ties) s.

        An edge costs `falling`, (e,), if its first node is positive and its second negative, and `rising` in the
        opposite case. `pull` and `ties` are (n,); ties are small, and all of one sign. Of several minima, the one with
        the fewest positive signs is returned.
        """
        both = pull + ties
        total = 2 * max(float(both[both > 0].sum()), -float(both[both < 0].sum()))
        if total == 0:
            return np.ones(len(pull))
        costs = np.minimum(np.concatenate([falling, rising])[self.order], total)
        residual, pulls, small = (np.rint(PULL_UNITS / total * x).astype(np.int64) for x in (costs, 2 * pull, 2 * ties))
        source_side(self.starts, self.heads, self.reverse, residual, pulls)
        # All ties cannot separate nodes that arcs of greater capacity connect strongly: few parts are left to be cut.
        tied = (residual > np.abs(small).sum()).astype(np.int8)
        strong = sparse.csr_matrix((tied, self.heads, self.starts), shape=(len(pull), len(pull)))
        strong.eliminate_zeros()
        count, part = sparse.csgraph.connected_components(strong, connection="strong")
        tails = np.repeat(np.arange(len(pull)), np.diff(self.starts))
        between = np.flatnonzero((part[tails] != part[self.heads]) & (tails < self.heads))
        ends = np.stack([part[tails[between]], part[self.heads[between]]], axis=1)
        rest = CutGraph.of(ends.astype(np.int64), count)
        residual = np.concatenate([residual[between], residual[self.reverse[between]]])[rest.order]
        pulls = sums_of(pulls + small, part, count).astype(np.int64)
        return np.where(source_side(rest.starts, rest.heads, rest.reverse, residual, pulls)[part], 1.0, -1.0)


Ids = Ints

FREE, TERMINAL, ORPHAN = -1, -2, -3
"""Values of `parent` in place of the index of an arc: the node is in no tree, is next to a terminal (the source or the
sink), or has been cut off from its parent."""


@compiled
def source_side(starts: Ids, heads: Ids, reverse: Ids, residual: Ids, pull: Ids) -> Bools:
    """Compute a maximum flow, and return (n,) bool, true for nodes on the source's side of the minimum cut.

    This is the algorithm of Boykov & Kolmogorov (2004). The arrays are those of `CutGraph`. `residual` are the
    capacities of arcs, (2 e,). A positive `pull`, (n,), is the capacity from the source to a node, a negative one that
    from the node to the sink. `residual` and `pull` are overwritten.
    """
    n, now = len(pull), 1
    tree = np.sign(pull).astype(np.int8)  # 1 in the source's tree, −1 in the sink's, 0 in neither
    # of each node: the arc to its parent, its depth in the tree, and when that was last correct, by the clock `now`
    parent, far, stamp = np.full(n, FREE), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    queue, orphans, waiting = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    first = count = 0  # of the queue, which is a ring
    for i in range(n):
        if tree[i] != 0:
            parent[i], far[i], waiting[i], queue[count] = TERMINAL, 1, True, i
            count += 1
    while count > 0:
        i = queue[first]
        first = (first + 1) % n
        count -= 1
        waiting[i] = False
        arc = starts[i]
        while arc < starts[i + 1] and parent[i] != FREE:
            j = heads[arc]
            forth = arc if tree[i] > 0 else reverse[arc]
            if residual[forth] == 0:
                arc += 1
            elif parent[j] == FREE:
                tree[j], parent[j], stamp[j], far[j] = tree[i], reverse[arc], stamp[i], far[i] + 1
                if not waiting[j]:  # it may wait from when it was in a tree before
                    queue[(first + count) % n] = j
                    count += 1
                    waiting[j] = True
                arc += 1
            elif tree[j] == tree[i]:
                if stamp[j] <= stamp[i] and far[j] > far[i]:
                    parent[j], stamp[j], far[j] = reverse[arc], stamp[i], far[i] + 1
                arc += 1
            else:
                now += 1
                cut_off = _augment(heads, reverse, residual, pull, parent, forth, orphans)
                k = 0
                while k < cut_off:
                    p = orphans[k]
                    k += 1
                    if _adopted(starts, heads, reverse, residual, tree, parent, far, stamp, now, p):
                        continue
                    for a in range(starts[p], starts[p + 1]):
                        q = heads[a]
                        if tree[q] != tree[p] or parent[q] == FREE:
                            continue
                        if residual[reverse[a] if tree[p] > 0 else a] > 0 and not waiting[q]:
                            queue[(first + count) % n] = q
                            count += 1
                            waiting[q] = True
                        if parent[q] >= 0 and heads[parent[q]] == p:
                            parent[q] = ORPHAN
                            orphans[cut_off] = q
                            cut_off += 1
                    parent[p], tree[p], stamp[p] = FREE, 0, 0
    return tree > 0


@compiled
def _augment(heads: Ids, reverse: Ids, residual: Ids, pull: Ids, parent: Ids, meeting: int, orphans: Ids) -> int:
    """Push as much flow as possible along the path through `meeting`, an arc from the source's tree to the sink's.

    Nodes whose arc to the parent is saturated by it are marked as `ORPHAN` and written to `orphans`, (n,). Returns
    their number. `parent`, (n,), has the arc from each node to its parent in a tree; all other arrays are those of
    `source_side`, and `residual` and `pull` are reduced by the flow.
    """
    least = residual[meeting]
    for end in range(2):
        i = heads[reverse[meeting]] if end == 0 else heads[meeting]
        while parent[i] != TERMINAL:
            up = parent[i]
            least = min(least, residual[reverse[up] if end == 0 else up])
            i = heads[up]
        least = min(least, abs(pull[i]))
    residual[meeting] -= least
    residual[reverse[meeting]] += least
    count = 0
    for end in range(2):
        i = heads[reverse[meeting]] if end == 0 else heads[meeting]
        while parent[i] != TERMINAL:
            up = parent[i]
            forth = reverse[up] if end == 0 else up
            residual[forth] -= least
            residual[reverse[forth]] += least
            if residual[forth] == 0:
                parent[i] = ORPHAN
                orphans[count] = i
                count += 1
            i = heads[up]
        pull[i] -= least if end == 0 else -least
        if pull[i] == 0:
            parent[i] = ORPHAN
            orphans[count] = i
            count += 1
    return count


@compiled
def _adopted(
    starts: Ids,
    heads: Ids,
    reverse: Ids,
    residual: Ids,
    tree: NDArray[np.int8],
    parent: Ids,
    far: Ids,
    stamp: Ids,
    now: int,
    p: int,
) -> bool:
    """Find a new parent for the orphan p among its neighbours, and return whether there is one.

    A parent must be connected to the terminal of the same tree. Of several, the one nearest to the terminal is chosen.
    The arrays are those of `source_side`: depths `far` are correct for nodes with the `stamp` `now`.
    """
    best, nearest = ORPHAN, np.int64(1) << 60
    for a in range(starts[p], starts[p + 1]):
        if tree[heads[a]] != tree[p] or residual[reverse[a] if tree[p] > 0 else a] == 0:
            continue
        steps, j = 0, heads[a]
        while parent[j] >= 0 and stamp[j] != now:
            steps += 1
            j = heads[parent[j]]
        if parent[j] == ORPHAN or parent[j] == FREE:
            continue
        if stamp[j] != now:
            stamp[j], far[j] = now, 1
        steps += far[j]
        if steps < nearest:
            best, nearest = a, steps
        j = heads[a]
        while stamp[j] != now:
            stamp[j], far[j] = now, steps
            steps -= 1
            j = heads[parent[j]]
    parent[p] = best
    if best < 0:
        return False
    stamp[p], far[p] = now, nearest + 1
    return True


STROKE_WIDTH, WIDEST_STROKE = 2.0, 0.01
"""Distance from a stroke up to which vertices count as being beside it. It is the first number of mean edges, but at
most the second, a share of the length of all strokes. So a stroke drawn twice counts as one. Of 46 drawings none
changes if both are halved or the first is doubled; one does if the second is doubled."""
STAIRCASE_LENGTH = 0.92
"""Typical length of a line relative to that of the staircase of dual edges along it. Costs are multiplied by it."""
CORNER_ON_SEGMENT = 1e-6
"""Height of a corner above a segment, relative to the longest side of its face, up to which it lies on the segment."""
FOLLOWED = 0.25
"""|φ| at a vertex beside a stroke, in h, up to which the zero set of φ is taken to follow the stroke."""
EQUAL_COSTS = 1e-6
"""Difference of two costs, relative to the length of all strokes, below which they count as equal. Otherwise rounding
would choose between them."""
EXPLAINED = 0.5
"""Share of a stroke from which on it bounds the inside (`Inside.explained`). Halved, none of 46 drawings changes;
doubled, two change, and eleven more get a warning."""
STROKES_AT_ONCE = 64
"""Number of strokes for which `Strokes.agreed` solves a linear system at a time."""


@dataclass(frozen=True, eq=False)
class Inside:
    """An inside, chosen for strokes with given directions: a positive or negative side at every vertex of a surface."""

    signs: Floats  # (k,) directions of strokes: 1 as given, −1 if flipped, 0 if the stroke is left out
    sides: Floats  # (n,) 1 or −1 at every vertex: left or right of the strokes that bound the inside
    # (k,) how far each stroke bounds the inside: 1 all along, 0 nowhere, −1 all along but in the wrong direction
    explained: Floats
    # the length of the boundary of the inside where no stroke is, less the explained length of strokes. A larger reward
    # for strokes would pay for a boundary around a single stroke, which is twice as long
    energy: float


@dataclass(frozen=True, eq=False)
class Strokes:
    """k oriented curves on a surface with n vertices and e edges, and the energy of regions that they may bound."""

    surface: SurfaceDiscretization  # the surface that they lie on
    parts: Sequence[CurveSegments]  # the strokes
    lengths: Floats  # (k,) length of each stroke
    # (k, n) takes values at vertices to half the difference of their means left and right of each stroke
    means: sparse.csr_matrix
    # (k, e) 1 where the first vertex of an edge is left of a stroke that crosses it, −1 where the second is
    crossed: sparse.csr_matrix
    fluxes: sparse.csr_matrix  # (k, n) integrals along each stroke of the slopes of hat functions towards its left
    width: float  # distance up to which strokes next to each other count as one
    group: Ints  # (k,) label of the likely curve of each stroke, which joins strokes with nearest ends
    is_loop: Bools  # (g,) whether each likely curve is closed, with gaps that are short beside its strokes
    _insides: dict[bytes, Inside] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls, surface: SurfaceDiscretization, parts: Sequence[CurveSegments], edge: float, group: Ints, is_loop: Bools
    ) -> Strokes:
        """Find the vertices on both sides of each stroke; `edge` is the mean length of an edge of the mesh.

        `group` and `is_loop` are as in the result.
        """
        triangles = surface.triangles
        lengths = np.array([part.lengths.sum() for part in parts])
        seen = sides_seen(triangles, parts)
        tails, heads = triangles.edges.vertices.T
        columns = seen.tocsc()
        tail, head = columns[:, tails].tocsr(), columns[:, heads].tocsr()
        crossed = sparse.csr_matrix(tail.multiply(head.astype(bool)) - head.multiply(tail.astype(bool)))
        areas = triangles.vertex_areas
        width = min(STROKE_WIDTH * edge, WIDEST_STROKE * float(lengths.sum()))
        around = widened(triangles, seen, width)
        crossed.data = np.sign(np.rint(crossed.data))
        crossed.eliminate_zeros()
        left, right = (_means(around.multiply(around * side > 0), areas) for side in (1, -1))
        means = sparse.csr_matrix(0.5 * (left - right))
        return cls(surface, parts, lengths, means, crossed, fluxes_across(triangles, parts), width, group, is_loop)

    @property
    def areas(self) -> Floats:
        """Area of the part of the surface that belongs to each vertex, (n,) float."""
        return self.surface.triangles.vertex_areas

    @cached_property
    def graph(self) -> CutGraph:
        """Graph of the vertices and edges of the surface."""
        return CutGraph.of(self.surface.triangles.edges.vertices, self.surface.triangles.n_vertices)

    @cached_property
    def costs(self) -> Floats:
        """Length that the boundary of an inside has between the two vertices of each edge, (e,) float.

        It is the length of the dual edge between barycentres of faces, times `STAIRCASE_LENGTH`.
        """
        triangles = self.surface.triangles
        corners = triangles.corner_positions
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        halves = np.abs(corners.mean(axis=1, keepdims=True) - middles)
        total = np.bincount(triangles.edges.face_edges.ravel(), halves.ravel(), triangles.n_edges)
        return STAIRCASE_LENGTH * total.astype(np.float64)

    @cached_property
    def agreed(self) -> Floats:
        """Agreement of the directions of each two strokes, (k, k) float.

        It says by how much ∫ |∇u|² is less for a function u that jumps by 1 across both strokes than for two functions
        that each jump across one of them. It is large for strokes that follow each other, and for strokes within
        `width` of each other, such as copies.
        """
        surface, fluxes = self.surface, self.fluxes
        masses = sparse.diags(self.areas)
        alone = sparse.diags((self.areas == 0).astype(np.float64))  # points far from all others, which have no faces
        matrix = sparse.csr_matrix(masses + alone + self.width**2 * surface.stiffness)
        blur = factorize(matrix, order=surface.vertex_order)
        k = fluxes.shape[0]
        result = np.empty((k, k))
        for begin in range(0, k, STROKES_AT_ONCE):
            right = np.asfortranarray(fluxes[begin : begin + STROKES_AT_ONCE].T.toarray())
            sides = surface.integration.factor.solve(right)
            result[:, begin : begin + STROKES_AT_ONCE] = fluxes @ blur.solve(np.asfortranarray(masses @ sides))
        return 0.5 * (result + result.T)

    def unexplained(self, inside: Inside) -> float:
        """Return the length of the boundary without strokes plus the length of strokes that do not bound the inside.

        Strokes that are left out count in full, and strokes that bound it in the wrong direction count twice.
        """
        return inside.energy + float(self.lengths.sum())

    def whole_loops(self, chosen: Bools) -> Bools:
        """Return (g,) bool, true for closed likely curves all of whose strokes are `chosen`, (k,)."""
        whole: Bools = self.is_loop & (np.bincount(self.group, chosen) == np.bincount(self.group))
        return whole

    @property
    def seen(self) -> list[Inside]:
        """Every result of `inside` so far."""
        return list(self._insides.values())

    def by_heat(self, signs: Floats) -> Inside:
        """Return the inside by the signed heat method, for strokes with (k,) directions, 0 if left out.

        Sides are the signs of φ. Where φ is nearly 0 beside a stroke, the stroke decides the side.
        """
        sources = [[replace(p, vectors=s * p.vectors)] for p, s in zip(self.parts, signs.tolist(), strict=True) if s]
        try:
            source = self.surface.lower(sources, 1.0)
        except CancellingNormalsError:  # no side is positive, so that nothing is explained
            positive = np.ones(self.surface.triangles.n_vertices)
            return Inside(signs, positive, np.zeros(len(signs)), float(self.lengths.sum()))
        directions = normalize(self.surface, diffuse(self.surface, source))
        phi, beside = integrate(self.surface, directions, source, ZeroSet()), self.means.T @ signs
        is_near = np.abs(phi) <= FOLLOWED * self.surface.spacing
        sides = np.where(np.where(is_near & (beside != 0), beside, phi) < 0, -1.0, 1.0)
        # vertices on a stroke are on the side from which the boundary passes along the stroke
        (tails, heads), (falling, rising) = self.surface.triangles.edges.vertices.T, self._uncovered(signs)
        more = np.zeros(len(sides))  # cost of being inside, less that of being outside
        np.add.at(more, tails, np.where(sides[heads] < 0, falling, -rising))
        np.add.at(more, heads, np.where(sides[tails] < 0, rising, -falling))
        sides = np.where(is_near & (beside == 0) & (more != 0), -np.sign(more), sides)
        explained = signs * (self.means @ sides)
        boundary = self._zero_set_lengths(np.where(phi * sides > 0, phi, SMALLEST_EXTENT * sides))
        uncovered = self._cut_costs(signs, sides)[self.surface.triangles.edges.face_edges] > 0
        added = 0.5 * float(boundary @ uncovered.sum(axis=1))
        return Inside(signs, sides, explained, added - float(self.lengths @ explained))

    def _zero_set_lengths(self, phi: Floats) -> Floats:
        """Return (m,) lengths of the zero set of φ in each face, for φ linear in faces with values (n,) at vertices."""
        triangles = self.surface.triangles
        corners, values = triangles.corner_positions, phi[triangles.corner_vertices]
        following = np.roll(values, -1, axis=1)
        crosses = (values < 0) != (following < 0)
        shares = np.where(crosses, values / np.where(crosses, values - following, 1.0), 0.0)
        places = np.where(crosses, corners + shares * (np.roll(corners, -1, axis=1) - corners), 0.0)
        # of two edges, the ends of a segment: one less the other
        signs = np.where(crosses, np.where(np.cumsum(crosses, axis=1) == 1, 1.0, -1.0), 0.0)
        return np.abs((places * signs).sum(axis=1))

    def _between(self, signs: Floats, sides: Floats) -> Inside:
        """Return the inside with (n,) sides of vertices, for strokes with (k,) directions; its boundary is on edges."""
        explained = signs * (self.means @ sides)
        energy = float(self._cut_costs(signs, sides).sum()) - float(self.lengths @ explained)
        return Inside(signs, sides, explained, energy)

    def _cut_costs(self, signs: Floats, sides: Floats) -> Floats:
        """Return (e,) costs of the boundary between the (n,) sides of vertices at each edge.

        They are 0 at edges without a boundary, and where a stroke in its (k,) direction crosses the edge.
        """
        falling, rising = self._uncovered(signs)
        first, second = sides[self.surface.triangles.edges.vertices].T
        return np.where(first > second, falling, np.where(first < second, rising, 0.0))

    def inside(self, signs: Floats) -> Inside:
        """Return the inside of least energy, a minimum cut, for strokes with (k,) directions, 0 if left out."""
        key = signs.tobytes()
        if key not in self._insides:
            self._insides[key] = self._between(signs, self._cut(signs, -1.0))
        return self._insides[key]

    def changed_share(self, first: Inside, second: Inside) -> float:
        """Return the share of the area on which two insides have different sides."""
        return float(self.areas[first.sides != second.sides].sum() / self.areas.sum())

    def either_way(self, inside: Inside) -> float:
        """Return the share of the area between the smallest and the largest inside of least energy.

        It is 0 if the same strokes bound both.
        """
        labels = self.surface.triangles.face_components
        parts = np.zeros(self.surface.triangles.n_vertices, dtype=np.int64)
        parts[self.surface.triangles.corner_vertices] = labels[:, None]
        reached = np.isin(parts, parts[np.unique(self.means.indices)])
        largest = self._cut(inside.signs, 1.0)
        if np.abs(inside.signs * (self.means @ largest) - inside.explained).max() < EXPLAINED:
            return 0.0
        return float(self.areas[reached & (largest != inside.sides)].sum() / self.areas.sum())

    def _cut(self, signs: Floats, larger: float) -> Floats:
        """Return (n,) sides of least energy for strokes with (k,) directions.

        Of several, those with the largest positive area if `larger` is 1, or the smallest if it is −1.
        """
        pull = self.means.T @ (self.lengths * signs)
        ties = larger * EQUAL_COSTS * self.lengths.sum() / self.areas.sum() * self.areas
        return self.graph.cut(*self._uncovered(signs), pull, ties)

    def _uncovered(self, signs: Floats) -> tuple[Floats, Floats]:
        """Return (e,) costs of a boundary at each edge if its first vertex is positive, and if its second vertex is.

        They are 0 where a stroke, in its (k,) direction, crosses the edge with the positive vertex to its left.
        """
        along = self.crossed.multiply(signs[:, None]).tocsr()
        covered = [np.asarray((along * way > 0).sum(axis=0)).ravel() > 0 for way in (1, -1)]
        falling, rising = (np.where(mask, 0.0, self.costs) for mask in covered)
        return falling, rising


def fluxes_across(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> sparse.csr_matrix:
    """Return (k, n) integrals along each of k curves of the slope of each vertex's hat function towards the left.

    Along edges, the slope is the mean over the faces at the edge.
    """
    placed = PlacedSegments.of(triangles, parts)
    owners = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])[placed.given]
    grows = 1j * np.diff(placed.positions, axis=1) * placed.sides[:, None]
    corners, faces = triangles.corner_positions[placed.faces], placed.faces
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    slopes = (np.conj(1j * opposite) * grows).real / (2 * triangles.face_areas[faces, None])
    values = slopes / np.bincount(placed.given)[placed.given, None]
    at = np.repeat(owners, 3), triangles.corner_vertices[faces].ravel()
    return sparse.csr_matrix((values.ravel(), at), shape=(len(parts), triangles.n_vertices))


def sides_seen(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> sparse.csr_matrix:
    """Find the side on which the corners of the faces that a stroke crosses lie.

    Returns a sparse matrix, (k, n), with 3 at vertices left of a stroke, 1 at those right of it, and 2 at those on it.
    (The values are 2 + side, since a sparse matrix does not keep zeros.) The nearest segment of the stroke decides.
    """
    placed = PlacedSegments.of(triangles, parts)
    owners = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])[placed.given]
    steps = np.diff(placed.positions, axis=1)
    rows = np.flatnonzero((placed.sides != 0) & (np.abs(steps[:, 0]) > 0))
    start, step, faces = placed.positions[rows, :1], steps[rows], placed.faces[rows]
    corners = triangles.corner_positions[faces] - start
    _, gaps = nearest_shares(corners, step)
    heights = (np.conj(step) * corners).imag / np.abs(step) * placed.sides[rows, None]
    size = triangles.edge_lengths[faces].max(axis=1, keepdims=True)
    sines = np.abs(heights) / np.maximum(np.maximum(gaps, np.abs(heights)), np.finfo(float).tiny)
    steps_away = np.rint(gaps / (CORNER_ON_SEGMENT * size))  # rounding must not decide which of two segments is nearer
    sides = np.where(np.abs(heights) <= CORNER_ON_SEGMENT * size, 0.0, np.sign(heights))
    keys = (owners[rows, None] * triangles.n_vertices + triangles.corner_vertices[faces]).ravel()
    order = np.lexsort((-sines.ravel(), steps_away.ravel(), keys))
    first = order[np.concatenate([[True], np.diff(keys[order]) > 0])[: len(order)]]
    on = steps_away.ravel()[first] == 0
    clear = first[on | (sides.ravel()[first] != 0)]  # what lies straight ahead of an end is on no side
    values = np.where(steps_away.ravel()[clear] == 0, 0.0, sides.ravel()[clear]) + 2.0
    shape = (len(parts), triangles.n_vertices)
    return sparse.csr_matrix((values, np.divmod(keys[clear], triangles.n_vertices)), shape=shape)


def widened(triangles: IntrinsicMesh, seen: sparse.csr_matrix, width: float) -> sparse.csr_matrix:
    """Extend sides of strokes to vertices farther away.

    `seen` is the result of `sides_seen`. Returns a sparse matrix, (k, n), with 1 at vertices left and −1 at vertices
    right of a stroke, up to `width` along edges from the corners of the faces that the stroke crosses.
    """
    n = triangles.n_vertices
    tails, heads = triangles.edges.vertices.T
    starts, arcs = grouped(np.concatenate([tails, heads]), n)
    ends, lengths = np.concatenate([heads, tails]), np.tile(triangles.lengths_of_edges, 2)
    pairs = sparse.coo_matrix(seen)
    known = np.sort(pairs.row.astype(np.int64) * n + pairs.col)
    off = pairs.data != 2
    stroke, vertex, side = pairs.row[off].astype(np.int64), pairs.col[off], pairs.data[off] - 2
    far, chosen = np.zeros(len(stroke)), [(stroke, vertex, side)]
    while len(stroke):
        origins, links = members_of(starts, arcs, vertex)
        stroke, vertex, side, far = stroke[origins], ends[links], side[origins], far[origins] + lengths[links]
        keys = stroke * n + vertex
        near = (far <= width) & ~np.isin(keys, known)
        order = np.flatnonzero(near)[np.lexsort((far[near], keys[near]))]
        order = order[np.diff(keys[order], prepend=-1) > 0]
        stroke, vertex, side, far = stroke[order], vertex[order], side[order], far[order]
        known = np.union1d(known, keys[order])
        chosen.append((stroke, vertex, side))
    rows, columns, values = (np.concatenate(parts) for parts in zip(*chosen, strict=True))
    return sparse.csr_matrix((values, (rows, columns)), shape=seen.shape)


def _means(chosen: sparse.csr_matrix, areas: Floats) -> sparse.csr_matrix:
    """Return a (k, n) sparse matrix whose rows average values, weighted by area, over the vertices `chosen` in them."""
    weighted = sparse.csr_matrix(chosen.astype(bool).astype(float) @ sparse.diags(areas))
    total = np.asarray(weighted.sum(axis=1)).ravel()
    return sparse.csr_matrix(sparse.diags(1 / np.where(total > 0, total, 1.0)) @ weighted)
