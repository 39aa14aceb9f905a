"""Lids: thin plates that close rims, clamped where the surface bends towards its rim and hinged where it does not.

Rims of surfaces that do not bend get lids of flat faces that meet in creases.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..mesh.components import numbered, sums_of
from ..mesh.planar_triangulation import triangulate_polygon
from ..mesh.triangles import area_vectors, face_areas, side_lengths
from ..mesh.unit_vectors import SAME_WAY, unit
from ..parallel import PointTree
from .rims import corners_of

LOOP_POINTS = 128
"""Number of points of the smoothed rim that a lid spans. Half or twice as many change the volume by less than 1 %."""
RIM_SMOOTHING = 1 / 48
"""Rims are smoothed by averages over this share of their length."""
FILM_ROUNDS = 3
"""Number of times that the surface of least area is solved for again, with the cotangents of the previous solution."""
PLATE_AT_REST, PLATE_MOVES = 1e-3, 64
"""The iteration of a plate ends once further moves are expected to sum to at most this share of the diagonal of its
rim, or after this number of moves. Nearly all plates need 5 to 40 moves."""
RIM_CLEARANCE = 0.5
"""Points of the smooth lid nearer to the rim than this are left out, relative to the mean distance of rim points."""
LAYER_GROWTH = 0.35
"""Growth of triangles with their distance from the rim, relative to that distance."""
MOST_TIES = 128
"""Largest number of equally distant points of a loop that are compared, and number of positions compared for each."""
Frame = tuple[Floats, Floats]
"""Origin and (3, 2) axes of a plane."""


@dataclass(frozen=True, eq=False)
class Lid:
    """Triangles that close a rim."""

    vertices: Floats  # (n, 3) the points of the rim first, in order
    faces: Ints  # (m, 3) counterclockwise from outside
    n_rim: int  # how many points the rim has
    plane: Floats  # (n, 2) its vertices in the plane or disc in which it was triangulated
    shares: Floats  # (n_rim,) share of the loop's length at which each point of its rim lies


def frame_of(rim: Floats) -> Frame | None:
    """Return the plane through the centre of a loop, (n, 3), normal to its area vector; None if its area is near 0.

    In the axes of the plane, the loop runs counterclockwise.
    """
    normal = area_vector(rim)
    length = np.linalg.norm(normal)
    if not length > 1e-6 * np.linalg.norm(np.ptp(rim, axis=0)) ** 2:
        return None
    normal /= length
    lengths, middles = side_lengths(rim), 0.5 * (rim + np.roll(rim, -1, axis=0))
    centre = rim[0] + (lengths[:, None] * (middles - rim[0])).sum(axis=0) / lengths.sum()
    around = rim - rim.mean(axis=0)
    around -= np.outer(around @ normal, normal)
    reach = np.linalg.norm(around, axis=1)
    first = around[farthest(rim, reach)]  # this axis turns with the rim
    first = first / np.linalg.norm(first)
    return centre, np.stack([first, np.cross(normal, first)], axis=1)


def farthest(loop: Floats, away: Floats) -> int:
    """Return the index of the point of a closed loop, (n, 3), with the largest distance `away`, (n,).

    Of up to `MOST_TIES` equal ones, it is that after which distances stay larger, so that it does not depend on the
    first point.
    """
    ties = np.flatnonzero(away > (1 - 1e-9) * away.max())[:MOST_TIES]
    if len(ties) == 1:
        return int(ties[0])
    starts = shares_of(loop)[0]  # (n + 1,) positions along the loop, from 0 to 1
    onward = (starts[ties, None] + np.arange(MOST_TIES) / MOST_TIES) % 1.0
    far = np.interp(onward, starts, np.append(away, away[0])) / max(float(away.max()), 1e-300)
    # the last row in lexicographic order has the largest distance where rows first differ
    return int(ties[np.lexsort(np.rint(1e6 * far).T[::-1])[-1]])


def shares_of(loop: Floats) -> tuple[Floats, float]:
    """(n + 1,) shares of the length of a closed loop at which its n corners lie, and 1; and the length."""
    lengths = side_lengths(loop)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    return along / along[-1], float(along[-1])


def area_vector(loop: Floats) -> Floats:
    """(3,) area vector of a closed loop of (n, 3) points: along its normal, as long as the area that it encloses."""
    around = loop - loop.mean(axis=0)
    return 0.5 * np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)


@dataclass(frozen=True, eq=False)
class SmoothRim:
    """A closed loop without zigzags, whatever the number of corners on its straight parts."""

    length: float  # length of the loop
    starts: Floats  # (n + 1,) share of the length at which each corner of the loop lies; the last is 1
    points: Floats  # (k, 3) means over parts of the loop of `RIM_SMOOTHING` of its length
    # (k + 1,) shares of the length at which the middles of these parts lie: once around the loop, from the corner
    # farthest from its centre
    shares: Floats

    @classmethod
    def of(cls, corners: Floats) -> SmoothRim:
        """Smooth a closed loop of (n, 3) corners."""
        sides = np.roll(corners, -1, axis=0) - corners
        starts, length = shares_of(corners)
        steps = np.diff(starts)[:, None]
        # integral of the position along the loop, from the first corner to each corner
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(steps * (corners + 0.5 * sides), axis=0)])

        def integral(shares: Floats) -> Floats:
            """(k, 3) integrals of the position along the loop, from its first corner to (k,) shares of its length."""
            turns, rest = np.divmod(shares, 1.0)
            k = np.minimum(np.searchsorted(starts, rest, side="right") - 1, len(starts) - 2)
            onward = (rest - starts[k])[:, None]
            onward = onward * (corners[k] + 0.5 * onward / np.maximum(steps[k], 1e-300) * sides[k])
            return np.asarray(turns[:, None] * sums[-1] + sums[k] + onward)

        away = np.linalg.norm(corners - sums[-1], axis=1)
        first = starts[farthest(corners, away)]
        shares = first + np.arange(LOOP_POINTS + 1) / LOOP_POINTS
        ends = integral(shares[:-1] + 0.5 * RIM_SMOOTHING), integral(shares[:-1] - 0.5 * RIM_SMOOTHING)
        return cls(length, starts, (ends[0] - ends[1]) / RIM_SMOOTHING, shares)

    def edges_at(self, shares: Floats) -> Ints:
        """(m,) edges of the loop, numbered by their first corners, on which points at (m,) shares of its length lie."""
        return np.minimum(np.searchsorted(self.starts, shares % 1.0, side="right") - 1, len(self.starts) - 2)


def cut_to_pieces(loop: Floats) -> tuple[Ints, Floats]:
    """Divide a closed loop into parts of at most 1 / `LOOP_POINTS` of its length, between its corners.

    Return the (k,) edge of each point of division, corners included, and its (k,) share of the edge.
    """
    lengths = side_lengths(loop)
    counts = np.maximum(np.ceil(lengths * LOOP_POINTS / lengths.sum() - 1e-9), 1).astype(np.int64)
    edges, number = numbered(counts)
    return edges, number / counts[edges]


def pattern(rim: SmoothRim, frame: Frame | None) -> Lid | None:
    """Triangulate a smooth rim in a plane, or in a disc without a frame; None if it crosses itself in the plane.

    Inner vertices of the lid lie in the plane, or at the origin.
    """
    if frame is None:
        flat = _around_disc(rim.shares[:-1])
        inner = points_in_disc(len(flat))
    else:
        flat = (rim.points - frame[0]) @ frame[1]
        inner = points_inside(flat)
    n, faces = len(flat), triangulate_polygon(np.concatenate([flat, inner]), len(flat))
    if faces is None:
        return None
    faces, inner = _without_unused(faces, n, inner)
    first = np.zeros((len(inner), 3)) if frame is None else frame[0] + inner @ frame[1].T
    return Lid(np.concatenate([rim.points, first]), faces, n, np.concatenate([flat, inner]), rim.shares[:-1])


def _without_unused(faces: Ints, n: int, inner: Floats) -> tuple[Ints, Floats]:
    """Renumber (m, 3) faces of n rim points and the (k, 2) `inner` points, and drop inner points that none uses."""
    used = np.unique(faces[faces >= n])
    return np.where(faces < n, faces, n + np.searchsorted(used, faces)), inner[used - n]


def points_inside(polygon: Floats) -> Floats:
    """(k, 2) points within a polygon of few sides, as dense as its corners near them, and sparser farther inside."""
    steps = side_lengths(polygon)
    size = float(np.quantile(steps, 0.9))
    # layers of triangular grids, each coarser than the one before
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    tree = PointTree(polygon)
    layers = [np.zeros((0, 2))]
    begin = 0.75 * size
    while begin < 0.5 * float((high - low).max()):
        step = size if len(layers) == 1 else LAYER_GROWTH * begin + size
        end = begin + 2.0 * step
        rows = np.arange(low[1], high[1] + step, step * 0.75**0.5)
        columns = np.arange(low[0], high[0] + step, step)
        shifted = np.add.outer(0.5 * step * (np.arange(len(rows)) % 2), columns)
        points = np.stack([shifted.ravel(), np.repeat(rows, len(columns))], axis=1)
        away = tree.query(points)[0]
        layers.append(points[(away >= begin) & (away < end)])
        begin = end + 0.5 * step
    points = np.concatenate(layers)
    return points[_inside(points, polygon)]


def _inside(points: Floats, polygon: Floats) -> Bools:
    """(k,) whether (k, 2) points lie inside a polygon, by the parity of crossings."""
    x, y = points.T
    (ax, ay), (bx, by) = polygon.T[..., None], np.roll(polygon, -1, axis=0).T[..., None]
    rise = np.where(by == ay, 1.0, by - ay)  # level sides are not crossed
    crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / rise)
    return np.logical_xor.reduce(crosses, axis=0)


def points_in_disc(n: int) -> Floats:
    """(k, 2) points within the unit circle, near it as dense as n points around it, and sparser farther inside."""
    rings, radius, step, turn = [np.zeros((1, 2))], 1.0, 2 * np.pi / n, 0.0
    while (radius := radius - step * 0.87) >= step:
        count = max(int(np.ceil(2 * np.pi * radius / step)), 5)
        turn += np.pi / count
        angles = turn + 2 * np.pi * np.arange(count) / count
        rings.append(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        step *= 1 + LAYER_GROWTH
    return np.concatenate(rings)


EVEN_SHARE = 1e-3
"""Points around a disc are spaced by length along the loop, and to this share evenly, so that none coincide."""


def _around_disc(shares: Floats) -> Floats:
    """(n, 2) points on the unit circle at (n,) shares of its circumference."""
    return np.stack([np.cos(2 * np.pi * shares), np.sin(2 * np.pi * shares)], axis=1)


def draped(loop: Floats, starts: Floats, frame: Frame | None, over: Lid) -> tuple[Floats, Ints] | None:
    """Span a loop by inner points of a lid of its smoothed version: (k, 3) added points, and (m, 3) triangles.

    `starts` are the shares of its length at which corners lie, see `shares_of`. It is triangulated in the plane of
    `frame`, or in a disc without one; None if it crosses itself there.
    """
    n, inner = len(loop), over.plane[over.n_rim :]
    kept = np.ones(len(inner), dtype=bool)
    if frame is None:
        even = np.arange(n) / n  # keeps points apart where sides are as short as rounding
        shares = (1 - EVEN_SHARE) * starts[:-1] + EVEN_SHARE * even
        flat, inner = _around_disc(shares), _in_polygon(shares, inner)
    else:
        edges, shares = cut_to_pieces(loop)
        sides = np.roll(loop, -1, axis=0) - loop
        rim = (loop[edges] + shares[:, None] * sides[edges] - frame[0]) @ frame[1]
        kept = PointTree(rim).query(inner)[0] > RIM_CLEARANCE * float(side_lengths(loop).sum()) / LOOP_POINTS
        flat = (loop - frame[0]) @ frame[1]
    faces = triangulate_polygon(np.concatenate([flat, inner[kept]]), n)
    if faces is None:
        return None
    faces, points = _without_unused(faces, n, over.vertices[over.n_rim :][kept])
    return points, faces


def _in_polygon(shares: Floats, points: Floats) -> Floats:
    """Move (n, 2) points of the unit disc into the polygon with corners at `shares` of its circumference.

    They move towards the centre, which lies within, since no side of a closed loop is longer than all others together.
    """
    place = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1.0
    corners = np.append(shares, shares[0] + 1.0)
    turns = (place - shares[0]) % 1.0 + shares[0]
    # a side is a chord of the circle: at its middle, it is cos(π · its share) from the centre
    side = np.clip(np.searchsorted(corners, turns, side="right") - 1, 0, len(shares) - 1)
    half, middle = 0.5 * (corners[side + 1] - corners[side]), 0.5 * (corners[side] + corners[side + 1])
    return points * (np.cos(2 * np.pi * half) / np.cos(2 * np.pi * (turns - middle)))[:, None]


def film(pattern: Lid) -> Lid:
    """Return a lid with vertices moved so that its area is nearly least (Pinkall & Polthier 1993); the rim stays.

    Each round extends the rim harmonically over the surface of the round before; the first, over the plane.
    """
    n_rim, vertices, faces, n = pattern.n_rim, pattern.vertices, pattern.faces, len(pattern.vertices)
    if n_rim == n:
        return pattern
    edge_keys, edge_of_side = np.unique(_sides(faces, n), return_inverse=True)
    domain, size = np.c_[pattern.plane, np.zeros(n)], np.ptp(vertices[:n_rim], axis=0).max()
    for _ in range(1 + FILM_ROUNDS):
        weights = np.bincount(edge_of_side.ravel(), _cotangents(domain, faces).ravel())
        matrix = _laplacian(*np.divmod(edge_keys, n), np.maximum(weights, 1e-6), n)
        domain = _extended(matrix, vertices[:n_rim])
        if np.abs(domain - vertices).max() <= 1e-12 * size:  # at rest, as a film in a plane is from the start
            break
        vertices = domain
    return replace(pattern, vertices=vertices)


def _laplacian(tails: Ints, heads: Ints, weights: Floats, n: int) -> sparse.csr_array:
    """(n, n) Laplacian of a graph with weighted edges, which are added if repeated."""
    entries = np.concatenate([-weights, -weights, weights, weights])
    rows_and_columns = np.concatenate([tails, heads, tails, heads]), np.concatenate([heads, tails, tails, heads])
    return sparse.coo_array((entries, rows_and_columns), shape=(n, n)).tocsr()


def _extended(matrix: sparse.csr_array, values: Floats) -> Floats:
    """Extend values at the rim, the first vertices of a lid, harmonically to all n, with this (n, n) Laplacian."""
    n = len(values)
    return np.concatenate([values, sparse.linalg.splu(matrix[n:, n:].tocsc()).solve(-(matrix[n:, :n] @ values))])


def plate(lid: Lid, normals: Floats, curvatures: Floats, held: Floats, width: float) -> Lid | None:
    """Bend a lid as a thin plate whose rest shape is as curved as the surface behind its rim (Helfrich 1973).

    ``min Σ |(L x)_v − m_v κ_v n_v − Σ_e ½ |e| g_e|² / (m_v + s_v)``. L is the cotangent Laplacian, m the areas of
    vertices, κ twice the mean curvature times h at the rim and harmonic inside, and g_e = e × n / |e × n| the direction
    across the edge e of the rim in the plane with the normal n: where the surface goes on smoothly, ∂x/∂g = g there.
    Springs hold the lid to this. Their compliance s is 0 where it is clamped, and s_v = (1 / h_v − 1) ¼ W Σ_e ½ |e|
    where it is held by h_v: for h = ½ they are half as stiff as a disc of width W. Spheres and cylinders are
    continued as such. Each round takes m, L and n from the one before; when a move exceeds the last one, all later
    moves are halved, so that the plate comes to rest. Normals, curvatures and held are those of `continuation`.

    Return None if the lid moves farther than its rim is wide, as on very ragged rims.
    """
    n = lid.n_rim
    if n == len(lid.vertices):
        return lid
    rim = lid.vertices[:n]
    # κ of all vertices, and the terms with −g_e
    rest, load = _extended(stiffness(lid), held * curvatures), _load(rim, normals)
    lengths = side_lengths(rim)
    springs = (1.0 / np.maximum(held, 1e-9) - 1.0) * 0.25 * width * 0.5 * (lengths + np.roll(lengths, 1))
    size = float(np.linalg.norm(np.ptp(rim, axis=0)))
    moves, share = [size], 1.0
    for _ in range(PLATE_MOVES):
        up = vertex_normals(lid)
        matrix = stiffness(lid)
        areas = np.bincount(lid.faces.ravel(), np.repeat(face_areas(lid.vertices[lid.faces]) / 3, 3))
        weights = np.maximum(areas, 1e-3 * np.median(areas[n:]))
        weights[:n] += springs
        weights = 1.0 / weights
        # weighted least squares for the inner vertices x: the residual is inner · x + known
        known = matrix[:, :n] @ rim - (areas * rest)[:, None] * up
        known[:n] += load
        inner = matrix[:, n:]
        normal_matrix = (inner.T @ sparse.diags_array(weights) @ inner).tocsc()
        vertices = lid.vertices.copy()
        vertices[n:] = sparse.linalg.splu(normal_matrix).solve(-(inner.T @ (weights[:, None] * known)))
        rises = ((vertices - lid.vertices) * up).sum(axis=1)  # moves along the surface do not change its shape
        moves.append(float(np.abs(rises).max()))
        if moves[-1] > moves[-2]:  # the moves oscillate
            share *= 0.5
        lid = replace(lid, vertices=lid.vertices + share * rises[:, None] * up)
        if not moves[-1] <= size:
            return None
        slowed = moves[-1] / moves[-2]
        if slowed < 1 and moves[-1] * slowed / (1 - slowed) <= PLATE_AT_REST * size:
            break
    return lid


def _load(rim: Floats, normals: Floats) -> Floats:
    """(n, 3) load of `plate` at each rim point: the sum over both edges of half their length times −g."""
    sides = np.roll(rim, -1, axis=0) - rim
    lengths = np.linalg.norm(sides, axis=1)
    load = np.zeros((len(rim), 3))
    for side, length in ((sides, lengths), (np.roll(sides, 1, axis=0), np.roll(lengths, 1))):
        load -= 0.5 * length[:, None] * unit(np.cross(side, normals))
    return load


def _sides(faces: Ints, n: int) -> Ints:
    """(m, 3) keys, low · n + high, of the edges opposite the corners of triangles on n vertices."""
    tails, heads = np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)
    return np.minimum(tails, heads) * n + np.maximum(tails, heads)


def _cotangents(vertices: Floats, faces: Ints) -> Floats:
    """(m, 3) half the cotangents of the angles of triangles, bounded in triangles that are nearly flat."""
    corners = vertices[faces]
    u, v = np.roll(corners, -1, axis=1) - corners, np.roll(corners, -2, axis=1) - corners
    cosine, sine = (u * v).sum(axis=2), np.linalg.norm(np.cross(u, v), axis=2)
    return 0.5 * cosine / np.maximum(np.maximum(sine, np.abs(cosine) / 100.0), 1e-300)


def stiffness(lid: Lid) -> sparse.csr_array:
    """(n, n) positive semidefinite cotangent Laplacian of a lid, with bounded cotangents in flat triangles."""
    tails, heads = np.roll(lid.faces, -1, axis=1).ravel(), np.roll(lid.faces, -2, axis=1).ravel()
    return _laplacian(tails, heads, _cotangents(lid.vertices, lid.faces).ravel(), len(lid.vertices))


def vertex_normals(lid: Lid) -> Floats:
    """(n, 3) unit normals at vertices: area-weighted means over the triangles around them."""
    vectors = np.repeat(area_vectors(lid.vertices[lid.faces]), 3, axis=0)
    return unit(sums_of(vectors, lid.faces.ravel(), len(lid.vertices)))


def running_mean(values: Floats, reach: int) -> Floats:
    """(n,) means of (n,) values along a closed loop, each over 2 · `reach` + 1 successive values."""
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    return np.convolve(np.concatenate([values[len(values) - reach :], values, values[:reach]]), window, mode="valid")


COPLANAR = 1e-3
"""Points count as coplanar if their heights over a plane are at most this, relative to their extent. Unit vectors count
as coplanar if the component of one across the others is at most this."""
FLAT_LID_CORNERS = 256
"""Flat faces with more corners than this get inner points, to avoid slivers."""
MOST_PLANAR_RUNS = 16
"""Rims with more planar runs than this get no creased lid."""


@dataclass(frozen=True, eq=False)
class _Side:
    """A straight part of a rim, or a crease."""

    points: Ints  # (k,) its points, without the last, which begins the next side
    normal: Floats  # (3,) sum over its edges of length times unit normal of the surface


@dataclass(frozen=True, eq=False)
class _Run:
    """Consecutive sides that lie in a plane."""

    first: int  # index of the first side
    count: int  # number of sides
    points: Ints  # (k,) their points, including the last
    opening: Floats  # (3,) area vector of a lid in the plane


def is_flat(points: Floats) -> bool:
    """Whether (n, 3) points lie in a plane, up to `COPLANAR`."""
    around = points - points.mean(axis=0)
    normal = np.linalg.eigh(around.T @ around)[1][:, 0]
    return bool(np.abs(around @ normal).max() <= COPLANAR * np.linalg.norm(np.ptp(points, axis=0)))


def creased(loop: Floats, normals: Floats) -> tuple[Floats, Ints] | None:
    """Make a lid of flat faces that close a loop, as (k, 3) added points and (m, 3) triangles; None if there is none.

    A run of sides in one plane is closed by a flat face that ends at a crease. Three runs that make up the whole loop
    are closed by faces to the point where their planes meet. No face folds back over the surface, whose (n, 3)
    `normals` are 0 where unknown.
    """
    points, sides = loop, _straight_sides(loop, normals)
    polygons: list[Ints] = []
    while len(sides) > 2:
        rest = np.concatenate([side.points for side in sides])
        if is_flat(points[rest]):
            return _filled(points, len(loop), [*polygons, rest])
        runs = _runs(points, sides)
        peak = _peak(points, runs, len(sides))
        if peak is not None:
            pieces = [np.append(run.points, len(points)) for run in peak[1]]
            return _filled(np.concatenate([points, peak[0][None]]), len(loop), [*polygons, *pieces])
        run = _closed_by_a_crease(points, sides, runs)
        if run is None:
            return None
        polygons.append(run.points)
        remaining = [sides[(run.first + run.count + k) % len(sides)] for k in range(len(sides) - run.count)]
        sides = [_Side(run.points[:1], np.zeros(3)), *remaining]
    return None


def _straight_sides(loop: Floats, normals: Floats) -> list[_Side]:
    """Split a loop of (n, 3) points at its corners into straight sides; none if it has no corners.

    `normals` are the (n, 3) unit normals of the surface at its edges.
    """
    corners = corners_of(loop)
    weighted = side_lengths(loop)[:, None] * normals
    if not len(corners):
        return []
    order, cuts = np.roll(np.arange(len(loop)), -corners[0]), corners - corners[0]
    sums = np.add.reduceat(weighted[order], cuts, axis=0)
    return [_Side(points, total) for points, total in zip(np.split(order, cuts[1:]), sums, strict=True)]


def _runs(points: Floats, sides: list[_Side]) -> list[_Run]:
    """Find the maximal runs of two or more coplanar sides whose lids are not folded back, by area, largest first."""
    n = len(sides)
    starts = points[[side.points[0] for side in sides]]
    directions = unit(np.roll(starts, -1, axis=0) - starts)
    # at corner i: the normal of the plane of sides i − 1 and i, and whether side i + 1 lies in it, too
    across = unit(np.cross(np.roll(directions, 1, axis=0), directions))
    goes_on = np.abs((across * np.roll(directions, -1, axis=0)).sum(axis=1)) <= COPLANAR
    begins = np.flatnonzero(~np.roll(goes_on, 1))  # corners whose plane is a new one: a run begins a side earlier
    if not 0 < len(begins) <= MOST_PLANAR_RUNS:
        return []
    runs = []
    for corner, after in zip(begins, np.append(begins[1:], begins[0] + n), strict=True):
        # neighbouring runs share a side; at least one side is left
        first, count = (int(corner) - 1) % n, min(int(after - corner) + 1, n - 1)
        chosen = [sides[(first + k) % n] for k in range(count)]
        indices = np.concatenate([*(side.points for side in chosen), sides[(first + count) % n].points[:1]])
        opening = area_vector(points[indices])
        surface = np.sum([side.normal for side in chosen], axis=0)
        folded = opening @ surface <= -SAME_WAY * np.linalg.norm(opening) * np.linalg.norm(surface)
        # sides that are coplanar with their neighbours may still turn out of one plane, bit by bit
        if is_flat(points[indices]) and not (folded and surface.any()):
            runs.append(_Run(first, count, indices, opening))
    return sorted(runs, key=lambda run: -float(np.linalg.norm(run.opening)))


def _peak(points: Floats, runs: list[_Run], n_sides: int) -> tuple[Floats, tuple[_Run, _Run, _Run]] | None:
    """Find three runs that make up a loop of `n_sides` sides and whose planes meet near it.

    `points` are the (n, 3) points of the loop. Return the (3,) point where the planes meet, and the runs; None if there
    are no such runs.
    """
    following = {run.first: run for run in runs}
    for first in runs:
        second = following.get((first.first + first.count) % n_sides)
        third = following.get((second.first + second.count) % n_sides) if second else None
        if second is None or third is None or first.count + second.count + third.count != n_sides:
            continue
        around = (first, second, third)
        normals = unit(np.stack([run.opening for run in around]))
        if abs(np.linalg.det(normals)) < COPLANAR:
            continue
        middles = np.stack([points[run.points].mean(axis=0) for run in around])
        peak = np.linalg.solve(normals, (normals * middles).sum(axis=1))
        corners = points[np.concatenate([run.points for run in around])]
        if np.linalg.norm(peak - corners.mean(axis=0)) < np.linalg.norm(np.ptp(corners, axis=0)):
            return peak, around
    return None


def _closed_by_a_crease(points: Floats, sides: list[_Side], runs: list[_Run]) -> _Run | None:
    """Find the first run whose ends lie in one plane with the sides before and after it; None if there is none."""
    n = len(sides)
    for run in runs:
        if n - run.count < 2:
            continue
        before, after = sides[(run.first - 1) % n], sides[(run.first + run.count) % n]
        beyond = sides[(run.first + run.count + 1) % n]
        ends = np.concatenate([before.points, run.points[[0, -1]], after.points, beyond.points[:1]])
        if is_flat(points[ends]):
            return run
    return None


def _filled(points: Floats, n_rim: int, polygons: list[Ints]) -> tuple[Floats, Ints] | None:
    """Triangulate planar polygons, given by indices of (n, 3) points: points from `n_rim` on, and triangles.

    None if a polygon crosses itself.
    """
    vertices, faces, count = [points], [], len(points)
    for polygon in polygons:
        corners = points[polygon]
        frame = frame_of(corners)
        if frame is None:
            return None
        plane, inner = (corners - frame[0]) @ frame[1], np.empty((0, 2))
        if len(corners) > FLAT_LID_CORNERS:
            inner = points_inside((SmoothRim.of(corners).points - frame[0]) @ frame[1])
        lid = triangulate_polygon(np.concatenate([plane, inner]), len(plane))
        if lid is None:
            return None
        lid, inner = _without_unused(lid, len(plane), inner)
        vertices.append(frame[0] + inner @ frame[1].T)
        faces.append(np.concatenate([polygon, count + np.arange(len(inner))])[lid])
        count += len(inner)
    return np.concatenate(vertices)[n_rim:], np.concatenate(faces)
