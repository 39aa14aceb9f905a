"""Lids: thin plates spanned by rims, clamped where the surface bends towards its rim, and hinged where it does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

from ..compiled import compiled
from ..geometry.components import sums_of
from ..geometry.directions import unit
from ..geometry.edges import edge_keys
from ..geometry.meshes import area_vectors, face_areas

PIECES = 128
"""Points of the loop that a lid spans. Half or twice as many change the volume under a lid by less than 1 %."""
SMOOTH = 1 / 48
"""Part of a rim over which its zigzags are averaged."""
GROWTH = 0.35
"""How fast triangles grow with their distance from the rim, over that distance."""
ROUNDS = 3
"""How often a film is solved for, each time with the lengths of the last."""
AT_REST, MOVES = 1e-3, 64
"""Share of the diagonal of its rim by which a plate moves when it has come to rest, and how often it moves at most.
Nearly all do in 5 to 20 moves."""
SPLITS = 8
"""How often edges of a rim are halved at most until all are edges of its triangulation."""
PLANE = 1e-12
"""How far a film moves, over its size, when it is at rest: rounding. One in a plane is from the first."""
AT_ONCE = 1 << 20
"""Pairs of a point and an edge that are looked at together."""
MOVED = 1e-9
"""Over the size of a lid, how far points are moved to choose among equal triangles: rounding moves them by 1e-15."""
Frame = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Origin and (3, 2) axes of a plane."""


@dataclass(frozen=True, eq=False)
class Lid:
    """Triangles that close a rim.

    Attributes
    ----------
    vertices : (n, 3) float
        The points of the rim first, in order.
    faces : (m, 3) int
        Counterclockwise from outside.
    n_rim : int
        How many points the rim has.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    n_rim: int


@dataclass(frozen=True, eq=False)
class Film(Lid):
    """A lid that was triangulated in a plane, or over a disc: (n, 2) its vertices there."""

    plane: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SmoothRim:
    """A closed loop without its zigzags, which does not depend on how many corners there are on straight parts.

    Attributes
    ----------
    length : float
        That of the loop.
    starts : (n + 1,) float
        Share of it at which each corner of the loop comes; the last is 1.
    points : (k, 3) float
        Means over parts of the loop of `SMOOTH` of its length.
    places : (k + 1,) float
        Share of its length at which the middle of each part comes, from the corner that is farthest from the loop's
        centre on, once around.
    """

    length: float
    starts: NDArray[np.float64]
    points: NDArray[np.float64]
    places: NDArray[np.float64]

    @classmethod
    def of(cls, corners: NDArray[np.float64]) -> SmoothRim:
        """That of a loop."""
        sides = np.roll(corners, -1, axis=0) - corners
        starts, length = _shares(corners)
        steps = np.diff(starts)[:, None]
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(steps * (corners + 0.5 * sides), axis=0)])

        def integral(shares: NDArray[np.float64]) -> NDArray[np.float64]:
            """That of positions along the loop, from its first corner."""
            turns, rest = np.divmod(shares, 1.0)
            k = _last_before(starts, rest)
            onward = (rest - starts[k])[:, None]
            onward = onward * (corners[k] + 0.5 * onward / np.maximum(steps[k], 1e-300) * sides[k])
            return np.asarray(turns[:, None] * sums[-1] + sums[k] + onward)

        away = np.linalg.norm(corners - sums[-1], axis=1)
        first = starts[np.argmax(away > (1 - 1e-9) * away.max())]
        places = first + np.arange(PIECES + 1) / PIECES
        ends = integral(places[:-1] + 0.5 * SMOOTH), integral(places[:-1] - 0.5 * SMOOTH)
        return cls(length, starts, (ends[0] - ends[1]) / SMOOTH, places)

    def places_of(self, rim: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m,) places of the points of the smooth loop and of others on its edges."""
        return np.asarray(np.interp(_shares(rim)[0][:-1], _shares(self.points)[0], self.places))

    def edges_at(self, rim: NDArray[np.float64]) -> NDArray[np.int64]:
        """(m,) corner that comes last before each of these points."""
        return _last_before(self.starts, self.places_of(rim) % 1.0)


def _shares(loop: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """(n + 1,) share of the length of a closed loop at which each corner comes, and 1; and that length."""
    lengths = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    return along / along[-1], float(along[-1])


def _last_before(starts: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.int64]:
    """(m,) number of the corner that comes last before shares of the length."""
    return np.minimum(np.searchsorted(starts, shares, side="right") - 1, len(starts) - 2)


def cut_to_pieces(loop: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, 3) the points of a closed loop, and more on its edges: none is longer than the whole over `PIECES`."""
    ways = np.roll(loop, -1, axis=0) - loop
    lengths = np.linalg.norm(ways, axis=1)
    counts = np.maximum(np.ceil(lengths * PIECES / lengths.sum() - 1e-9), 1).astype(np.int64)
    starts = np.repeat(np.arange(len(loop)), counts)
    along = (np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[starts]
    cut: NDArray[np.float64] = loop[starts] + along[:, None] * ways[starts]
    return cut


def area_vector(loop: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) the area that a closed loop encloses, along its normal."""
    around = loop - loop.mean(axis=0)
    vector: NDArray[np.float64] = 0.5 * np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
    return vector


def frame_of(rim: NDArray[np.float64]) -> Frame | None:
    """The plane of a loop's area, in which it runs counterclockwise; None if it has none."""
    normal = area_vector(rim)
    length = np.linalg.norm(normal)
    if not length > 1e-6 * np.linalg.norm(np.ptp(rim, axis=0)) ** 2:
        return None
    normal /= length
    around = rim - rim.mean(axis=0)
    around -= np.outer(around @ normal, normal)
    reach = np.linalg.norm(around, axis=1)
    first = around[np.argmax(reach > (1 - 1e-9) * reach.max())]  # turns with the rim
    first = first / np.linalg.norm(first)
    return rim[0], np.stack([first, np.cross(normal, first)], axis=1)


def pattern(rim: NDArray[np.float64], frame: Frame | None, begin: float = 0.0) -> Film | None:
    """A film before it is solved for; None if the loop's shadow in the plane crosses itself.

    It is flat inside its rim, or without a plane triangulated in a disc, around which the loop begins at a share of the
    circle.
    """
    if frame is None:
        plane, faces = _in_disc(rim, begin)
        return Film(np.concatenate([rim, np.zeros((len(plane) - len(rim), 3))]), faces, len(rim), plane)
    origin, axes = frame
    found = _in_polygon(rim, (rim - origin) @ axes)
    if found is None:
        return None
    rim, plane, faces = found
    return Film(np.concatenate([rim, origin + plane[len(rim) :] @ axes.T]), faces, len(rim), plane)


def film(pattern: Film) -> Film:
    """The lid of least area, near enough.

    The first shape is harmonic in the plane, and the lengths of each shape give the next (Pinkall & Polthier 1993). No
    weight is negative, so that the lid stays within the hull of its rim.
    """
    n, vertices, faces, plane = pattern.n_rim, pattern.vertices, pattern.faces, pattern.plane
    if n == len(vertices):
        return pattern
    edges, sides = np.unique(_sides(faces, len(plane)), return_inverse=True)
    ends = np.stack(np.divmod(edges, len(plane)))
    shape, size = np.c_[plane, np.zeros(len(plane))], np.ptp(vertices[:n], axis=0).max()
    for _ in range(1 + ROUNDS):
        weights = np.bincount(sides.ravel(), _cotangents(shape, faces).ravel())
        shape = _membrane(vertices, n, ends, np.maximum(weights, 1e-6))
        if np.abs(shape - vertices).max() <= PLANE * size:
            break
        vertices = shape
    return Film(vertices, faces, n, plane)


def draped(pattern: Film, over: Film) -> Lid:
    """A lid that follows another, triangulated in the same plane; what their rims differ by fades inside, harmonic."""
    n = pattern.n_rim
    found = scipy.interpolate.LinearNDInterpolator(_delaunay(over.plane), over.vertices)(pattern.plane)
    off = np.isnan(found).any(axis=1)
    found[off] = over.vertices[scipy.spatial.cKDTree(over.plane).query(pattern.plane[off])[1]]
    if n == len(found):
        return pattern
    flat = Lid(np.c_[pattern.plane, np.zeros(len(found))], pattern.faces, n)
    return Lid(found + _harmonic(flat, pattern.vertices[:n] - found[:n]), pattern.faces, n)


def _membrane(
    vertices: NDArray[np.float64], n: int, ends: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertices of which all but the first n are the weighted means of those that edges join them to."""
    here, there = np.concatenate([ends, ends[::-1]], axis=1)
    both = np.concatenate([weights, weights])
    inner, fixed = (here >= n) & (there >= n), (here >= n) & (there < n)
    size = len(vertices) - n
    rows = np.concatenate([np.arange(size), here[inner] - n])
    columns = np.concatenate([np.arange(size), there[inner] - n])
    entries = np.concatenate([np.bincount(here, both, len(vertices))[n:], -both[inner]])
    sums = sums_of(both[fixed, None] * vertices[there[fixed]], here[fixed] - n, size)
    matrix = sparse.csc_array((entries, (rows, columns)), shape=(size, size))
    return np.concatenate([vertices[:n], sparse.linalg.splu(matrix).solve(sums)])


def plate(
    lid: Film, normals: NDArray[np.float64], curvatures: NDArray[np.float64], held: NDArray[np.float64]
) -> Film | None:
    """A lid bent as a thin plate whose shape at rest is as curved as the surface behind its rim (Helfrich 1973).

    ``min Σ c_v |(L x)_v − m_v κ_v n_v − Σ_e ½ |e| g_e|² / m_v``, with c = 1 but at hinges of the rim. L is the
    cotangent Laplacian, m the areas of vertices, κ twice the mean curvature at the rim and harmonic inside, and g_e = e
    × n / |e × n| the direction across the edge e of the rim in the plane with the normal n: where the surface goes on
    smoothly, ∂x/∂g = g there. Spheres and cylinders go on as they are. Each round takes m, L and n from the last.
    Normals, curvatures and held, which is c at the rim, are those of `continuation`.

    None where it does not come to rest, as on rims in tatters, where nothing is smooth.
    """
    n = lid.n_rim
    if n == len(lid.vertices):
        return lid
    rim = lid.vertices[:n]
    rest, load = _harmonic(lid, held * curvatures), _load(rim, normals)
    size = float(np.linalg.norm(np.ptp(rim, axis=0)))
    for _ in range(MOVES):
        up = vertex_normals(lid)
        matrix = stiffness(lid)
        areas = np.bincount(lid.faces.ravel(), np.repeat(face_areas(lid.vertices[lid.faces]) / 3, 3))
        weights = 1.0 / np.maximum(areas, 1e-3 * np.median(areas[n:]))
        weights[:n] *= held
        given = matrix[:, :n] @ rim - (areas * rest)[:, None] * up
        given[:n] += load
        inner = matrix[:, n:]
        normal = (inner.T @ sparse.diags_array(weights) @ inner).tocsc()
        vertices = lid.vertices.copy()
        vertices[n:] = sparse.linalg.splu(normal).solve(-(inner.T @ (weights[:, None] * given)))
        rises = ((vertices - lid.vertices) * up).sum(axis=1)  # what slides along the surface does not change it
        lid = Film(lid.vertices + rises[:, None] * up, lid.faces, n, lid.plane)
        move = float(np.abs(rises).max())
        if move <= AT_REST * size:
            return lid
        if not move <= size:
            return None
    return None


def _load(rim: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) the sum over both edges at each point of a rim of half their length along −g, see `plate`."""
    sides = np.roll(rim, -1, axis=0) - rim
    lengths = np.linalg.norm(sides, axis=1)
    load = np.zeros((len(rim), 3))
    for side, length in ((sides, lengths), (np.roll(sides, 1, axis=0), np.roll(lengths, 1))):
        load -= 0.5 * length[:, None] * unit(np.cross(side, normals))
    return load


def _harmonic(lid: Lid, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values at the rim, one or several for each point, and between them harmonic on the lid."""
    n, matrix = lid.n_rim, stiffness(lid)
    inner = sparse.linalg.splu(matrix[n:, n:].tocsc()).solve(-(matrix[n:, :n] @ values))
    return np.concatenate([values, inner])


def _in_polygon(
    rim: NDArray[np.float64], plane: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]] | None:
    """Delaunay triangles of a polygon with points inside; its edges are halved until they are edges; or None.

    None if the polygon crosses itself.
    """
    inner = _points_inside(plane)
    for _ in range(SPLITS):
        n = len(plane)
        points = np.concatenate([plane, inner])
        faces, areas = _counterclockwise(points)
        faces = faces[areas > 1e-12 * areas.max()]
        ahead = np.arange(n), (np.arange(n) + 1) % n
        missing = ~np.isin(edge_keys(*ahead), edge_keys(faces.ravel(), np.roll(faces, -1, axis=1).ravel()))
        if not missing.any():
            kept = faces[_inside_polygon(points[faces].mean(axis=1), plane)]
            left = np.setdiff1d(_directed(kept, len(points)), _directed(kept[:, ::-1], len(points)))
            if len(left) != n or not np.isin(ahead[0] * len(points) + ahead[1], left).all():
                return None
            used = np.unique(np.concatenate([np.arange(n), kept.ravel()]))
            number = np.zeros(len(points), dtype=np.int64)
            number[used] = np.arange(len(used))
            return rim, points[used], number[kept]
        after = np.flatnonzero(missing)
        rim = np.insert(rim, after + 1, 0.5 * (rim[after] + rim[(after + 1) % n]), axis=0)
        plane = np.insert(plane, after + 1, 0.5 * (plane[after] + plane[(after + 1) % n]), axis=0)
    return None


def _delaunay(points: NDArray[np.float64]) -> scipy.spatial.Delaunay:
    """Delaunay triangles, of which, where four points lie on a circle, no rounding chooses: points are moved."""
    numbers = np.arange(len(points))[:, None]
    moves = (numbers * 0.5 * (5**0.5 - 1) * np.array([1.0, 2**0.5])) % 1.0 - 0.5
    size = float(np.ptp(points, axis=0).max())
    return scipy.spatial.Delaunay(points + MOVED * size * moves)


def _counterclockwise(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Delaunay triangles of points, and twice their areas."""
    faces = _delaunay(points).simplices.astype(np.int64)
    a, b, c = points[faces].transpose(1, 0, 2)
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[area < 0] = faces[area < 0][:, ::-1]
    return faces, np.abs(area)


def _sides(faces: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """(m, 3) numbers of the edges across from the corners of triangles."""
    one, other = np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)
    return np.minimum(one, other) * n + np.maximum(one, other)


def _directed(faces: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Numbers of the directed edges of triangles."""
    return (faces * n + np.roll(faces, -1, axis=1)).ravel()


def _points_inside(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points within a polygon, as dense as its corners at its rim, and the less dense the farther from it."""
    steps = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    size = float(np.quantile(steps, 0.9))
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    tree = scipy.spatial.cKDTree(polygon)
    found: list[NDArray[np.float64]] = []
    begin = 0.75 * size
    while begin < 0.5 * float((high - low).max()):
        step = size if not found else GROWTH * begin + size
        end = begin + 2.0 * step
        rows = np.arange(low[1], high[1] + step, step * 0.75**0.5)
        columns = np.arange(low[0], high[0] + step, step)
        shifted = np.add.outer(0.5 * step * (np.arange(len(rows)) % 2), columns)
        points = np.stack([shifted.ravel(), np.repeat(rows, len(columns))], axis=1)
        away = tree.query(points)[0]
        points = points[(away >= begin) & (away < end)]
        found.append(points[_inside_polygon(points, polygon)])
        begin = end + 0.5 * step
    return np.concatenate(found) if found else np.zeros((0, 2))


def _inside_polygon(points: NDArray[np.float64], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(k,) whether points lie inside a polygon: by the parity of crossings."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points.T
    together = max(1, AT_ONCE // max(len(points), 1))
    for begin in range(0, len(polygon), together):
        ax, ay = polygon[begin : begin + together].T[..., None]
        bx, by = np.roll(polygon, -1, axis=0)[begin : begin + together].T[..., None]
        rise = np.where(by == ay, 1.0, by - ay)  # what is level is not crossed
        crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / rise)
        inside ^= np.logical_xor.reduce(crosses, axis=0)
    return inside


def _in_disc(rim: NDArray[np.float64], begin: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles of the disc with points of the rim on its boundary, as far apart as they are, and others inside."""
    lengths = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
    angles = 2 * np.pi * (begin + (np.cumsum(lengths) - lengths) / lengths.sum())
    n = len(rim)
    rings, radius, step, turn = [np.stack([np.cos(angles), np.sin(angles)], axis=1)], 1.0, 2 * np.pi / n, 0.0
    while True:
        radius -= step * 0.87
        if radius < step:
            rings.append(np.zeros((1, 2)))
            break
        count = max(int(np.ceil(2 * np.pi * radius / step)), 5)
        turn += np.pi / count
        ring = turn + 2 * np.pi * np.arange(count) / count
        rings.append(radius * np.stack([np.cos(ring), np.sin(ring)], axis=1))
        step *= 1 + GROWTH
    points = np.concatenate(rings)
    return points, _counterclockwise(points)[0]


def _cotangents(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m, 3) half the cotangents of the corners of triangles, bounded where they are flat."""
    corners = vertices[faces]
    u, v = np.roll(corners, -1, axis=1) - corners, np.roll(corners, -2, axis=1) - corners
    cosine, sine = (u * v).sum(axis=2), np.linalg.norm(np.cross(u, v), axis=2)
    halves: NDArray[np.float64] = 0.5 * cosine / np.maximum(np.maximum(sine, np.abs(cosine) / 100.0), 1e-300)
    return halves


def stiffness(lid: Lid) -> sparse.csr_array:
    """(n, n) the positive semidefinite cotangent Laplacian; corners of flat triangles are bounded."""
    weights, n = _cotangents(lid.vertices, lid.faces).ravel(), len(lid.vertices)
    i, j = np.roll(lid.faces, -1, axis=1).ravel(), np.roll(lid.faces, -2, axis=1).ravel()
    entries = np.concatenate([-weights, -weights, weights, weights])
    places = np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j])
    return sparse.coo_array((entries, places), shape=(n, n)).tocsr()


def vertex_normals(lid: Lid) -> NDArray[np.float64]:
    """(n, 3) unit normals, means by area of those of the triangles around each vertex."""
    vectors = np.repeat(area_vectors(lid.vertices[lid.faces]), 3, axis=0)
    return unit(sums_of(vectors, lid.faces.ravel(), len(lid.vertices)))


def running_mean(values: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """(n,) values along a loop, each the mean of those up to so many places away."""
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    return np.convolve(np.concatenate([values[len(values) - reach :], values, values[:reach]]), window, mode="valid")


@compiled
def least_triangles(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n − 2, 3) triangles of least total area between (n, 3) points of a loop (Barequet & Sharir 1995).

    Time is cubic in n: it is for small holes.
    """
    n = len(points)
    cost, split = np.zeros((n, n)), np.zeros((n, n), dtype=np.int64)
    for gap in range(2, n):
        for i in range(n - gap):
            k = i + gap
            best = np.inf
            for j in range(i + 1, k):
                ux, uy, uz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                vx, vy, vz = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1], points[k, 2] - points[i, 2]
                x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                total = cost[i, j] + cost[j, k] + np.sqrt(x * x + y * y + z * z)
                if total < best * (1 - 1e-12):
                    best, split[i, k] = total, j
            cost[i, k] = best
    faces, stack, count, depth = np.empty((n - 2, 3), dtype=np.int64), np.empty((n + 2, 2), dtype=np.int64), 0, 1
    stack[0, 0], stack[0, 1] = 0, n - 1
    while depth > 0:
        depth -= 1
        i, k = stack[depth, 0], stack[depth, 1]
        if k - i < 2:
            continue
        j = split[i, k]
        faces[count, 0], faces[count, 1], faces[count, 2] = i, j, k
        count += 1
        stack[depth, 0], stack[depth, 1] = i, j
        stack[depth + 1, 0], stack[depth + 1, 1] = j, k
        depth += 2
    return faces
