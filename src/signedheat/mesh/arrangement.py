"""Division of triangles that intersect others or lie in their planes, so that the pieces meet in whole edges.

Faces meet in points: where an edge passes through a face, where two edges touch, and where three faces cross. Points
closer than rounding are merged, and the faces are divided between these points alone. So neighbouring pieces share
whole edges, whatever rounding does, and a closed mesh stays closed. The time grows with the number of these points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints, read_only
from ..compiled import compiled
from .box_tree import BoxTree
from .components import connected_components, grouped, members_of, numbered, sums_of
from .edges import EdgeTable, edge_table, has_three_corners
from .planar_triangulation import triangulate_faces
from .self_intersections import overlapping_faces
from .triangles import face_areas, heights
from .welding import distinct_rows, tolerances, welded_within

SAME_POINT = 1e-8
"""Distance below which points are merged, relative to the size of the parts that meet. It allows for rounding."""
ON_LINE = 4.0
"""Distance from a line up to which the common points of two faces count as lying on it, in multiples of the distance
below which points are merged. Farther away, the faces lie in one plane."""
PARALLEL_EDGES = 1e-9
"""Sine of the angle between edges below which they count as parallel, and do not cross."""
COVERING_CELLS = 1e-4
"""Relative difference in area and centroid up to which cells with the same outline count as covering each other."""
ON_EDGE, IN_FACE, TWO_EDGES, EDGE_AND_FACE = range(4)
"""Kinds of meetings of two faces: a vertex of one lies on an edge of the other, or in it, an edge of one touches an
edge of the other, or passes through it."""


class Arrangement(NamedTuple):
    """p triangles, the pieces of given faces, which meet in whole edges."""

    points: Floats  # (n, 3) the given points, followed by the points in which faces meet
    faces: Ints  # (p, 3) pieces, in order of the faces
    origins: Ints  # (p,) the face of which each is a piece, ascending
    cells: Ints  # (p,) cell of each piece: pieces of a face are in one cell unless an intersection separates them


class Incidence(NamedTuple):
    """Points that lie on lines or in faces, as sorted pairs of owner (line or face) and point, without duplicates."""

    owners: Ints  # (k,) ids of lines or of faces, ascending
    points: Ints  # (k,) ids of points

    @classmethod
    def of(cls, *pairs: tuple[Ints, Ints]) -> Incidence:
        """Merge several lists of pairs, each given by two arrays of owners and points."""
        owners, points = (np.concatenate(column).astype(np.int64) for column in zip(*pairs, strict=True))
        order = np.lexsort((points, owners))
        owners, points = owners[order], points[order]
        new = np.append(True, (owners[1:] != owners[:-1]) | (points[1:] != points[:-1]))[: len(owners)]
        return cls(owners[new], points[new])

    def starts(self, n: int) -> Ints:
        """Return (n + 1,) offsets: the pairs of owner i are those from starts[i] to starts[i + 1]."""
        return np.searchsorted(self.owners, np.arange(n + 1))

    def without(self, *others: tuple[Ints, Ints]) -> Incidence:
        """Return the pairs that are in none of several lists of owners and points."""
        owners, points = (np.concatenate(column) for column in zip(*others, strict=True))
        shift = 1 + max(int(self.points.max(initial=0)), int(points.max(initial=0)))
        return self.select(~np.isin(self.owners * shift + self.points, owners * shift + points))

    def select(self, chosen: Bools) -> Incidence:
        """Return the pairs for which a boolean array is true."""
        return Incidence(self.owners[chosen], self.points[chosen])

    def along(self, points: Floats, ends: Ints) -> Incidence:
        """Sort the points of each line from its first end to its second; `ends` are the ends of lines, (l, 2)."""
        tails, heads = points[ends[self.owners, 0]], points[ends[self.owners, 1]]
        ahead = ((points[self.points] - tails) * (heads - tails)).sum(axis=1)
        order = np.lexsort((ahead, self.owners))
        return Incidence(self.owners, self.points[order])


def meeting_faces(points: Floats, faces: Ints, slacks: Floats | None = None) -> Ints:
    """Return (k, 2) pairs of faces that cross, overlap in one plane, or touch without a common vertex.

    `slacks`, (m,), are the distances at which each face counts as touching others, by default those of rounding.
    """
    return overlapping_faces(points, faces, tolerances(points, faces, SAME_POINT) if slacks is None else slacks)


def arranged(points: Floats, faces: Ints, pairs: Ints | None = None, slacks: Floats | None = None) -> Arrangement:
    """Divide (m, 3) faces on (n, 3) points where they meet, and unbalanced edges where others of them end.

    `pairs`, (k, 2), are the faces that may meet, by default all. Points are merged if they are closer than the
    `slacks`, (m,), of the faces on which they lie. Triangles thinner than their slack are dropped.
    """
    slacks = tolerances(points, faces, SAME_POINT) if slacks is None else slacks
    pairs = meeting_faces(points, faces, slacks) if pairs is None else pairs
    # weld the corners of faces that may meet, and drop those faces that are thin
    busy = np.unique(faces[pairs.ravel()])
    reaches = _reaches(len(points), faces, slacks)
    faces = _welded(points, busy, reaches)[faces]
    proper = np.flatnonzero(has_three_corners(faces))
    proper = proper[heights(points[faces[proper]]) > slacks[proper]]
    number = np.full(int(faces.size), -1)
    number[proper] = np.arange(len(proper))
    faces, slacks, pairs = faces[proper], slacks[proper], number[pairs]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    table = edge_table(faces)
    on_open = _on_open_edges(points, table, reaches)

    # the points in which faces meet, on lines and in faces; then the lines along which they do, and where these cross
    meetings, positions, meeting_slacks = _meetings(
        read_only(np.ascontiguousarray(points)), faces, table.vertices, table.face_edges, pairs, slacks
    )
    kinds, first, second = meetings.T  # the second element is the vertex where no point is new: see `_meetings`
    new = kinds >= TWO_EDGES
    points, reaches, ids = _with_new(points, reaches, meetings, positions, meeting_slacks, new, second)
    in_face, two_edges, pierced = kinds == IN_FACE, kinds == TWO_EDGES, kinds == EDGE_AND_FACE
    lines = Lines(
        table.vertices,
        Incidence.of(on_open, (first[~in_face], ids[~in_face]), (second[two_edges], ids[two_edges])),
        Incidence.of((first[in_face], ids[in_face]), (second[pierced], ids[pierced])),
    )
    lines = lines.renamed(_welded(points, np.concatenate([busy, np.unique(ids)]), reaches))
    lines, records = _with_segments(points, faces, table, pairs, lines, slacks)
    points, lines, records = _with_crossings(points, lines, records, reaches, slacks, busy)
    return _with_copies_alike(_divided(points, faces, proper, table, lines, records))


def _reaches(n: int, faces: Ints, slacks: Floats) -> Floats:
    """Return (n,) the least slack of the faces at each point, infinity at points without a face."""
    reaches = np.full(n, np.inf)
    for corners in faces.T:
        np.minimum.at(reaches, corners, slacks)
    return reaches


class Lines(NamedTuple):
    """l lines: the edges of all faces, followed by the s segments along which two faces meet."""

    ends: Ints  # (l, 2) points at which each line begins and ends
    on: Incidence  # points on lines, without their ends
    within: Incidence  # points in faces, without those on their edges
    sides: Ints = np.zeros((0, 2), dtype=np.int64)  # (s, 2) the two faces of each segment

    def renamed(self, rename: Ints) -> Lines:
        """Replace each point by the one into which it was merged, which `rename`, (n,), contains."""
        ends = rename[self.ends]
        on = Incidence.of((self.on.owners, rename[self.on.points]))
        on = on.select((on.points[:, None] != ends[on.owners]).all(axis=1))
        return self._replace(ends=ends, on=on, within=Incidence.of((self.within.owners, rename[self.within.points])))


def _welded(points: Floats, chosen: Ints, reaches: Floats) -> Ints:
    """Return (n,) the point into which each is merged.

    Points whose ids are `chosen` are merged into the first of them within their `reaches`, (n,); others stay as they
    are.
    """
    rename = np.arange(len(points))
    chosen = np.unique(chosen)
    rename[chosen] = chosen[welded_within(points[chosen], reaches[chosen])]
    return rename


def _with_new(
    points: Floats, reaches: Floats, names: Ints, positions: Floats, slacks: Floats, new: Bools, ids: Ints
) -> tuple[Floats, Floats, Ints]:
    """Append points in which faces meet; return all points, their reaches, and the point of each meeting.

    Row k of `names`, `positions` and `slacks` describes a meeting. Where ``new[k]`` is true, a point is appended, once
    for meetings with the same name. Elsewhere ``ids[k]`` is the id of a given point.
    """
    numbers, first = distinct_rows(names[new])
    ids = ids.copy()
    ids[new] = len(points) + numbers
    return np.concatenate([points, positions[new][first]]), np.concatenate([reaches, slacks[new][first]]), ids


def _on_open_edges(points: Floats, table: EdgeTable, reaches: Floats) -> tuple[Ints, Ints]:
    """Return (k,) unbalanced edges, and (k,) vertices on them that are ends of other unbalanced edges.

    An edge is unbalanced if not as many faces run along it in one direction as in the other. `reaches`, (n,), are the
    distances up to which the (n,) points lie on edges.
    """
    edges = np.flatnonzero(table.balance != 0)
    if not len(edges):
        return edges, edges
    ends = table.vertices[edges]
    tails, heads = points[ends].swapaxes(0, 1)
    tree = BoxTree.of(np.minimum(tails, heads), np.maximum(tails, heads))
    rim = np.unique(ends)
    starts, near = tree.meeting(np.repeat(points[rim][:, None], 3, axis=1), reaches[rim])
    vertex = np.repeat(rim, np.diff(starts))
    from_tail, edge_vectors = points[vertex] - tails[near], (heads - tails)[near]
    share = (from_tail * edge_vectors).sum(axis=1) / np.maximum((edge_vectors * edge_vectors).sum(axis=1), 1e-300)
    slacks = np.minimum(reaches[vertex], reaches[ends[near]].min(axis=1))
    heights = np.linalg.norm(from_tail - share[:, None] * edge_vectors, axis=1)
    is_on = (heights <= slacks) & (share > 0) & (share < 1) & (vertex[:, None] != ends[near]).all(axis=1)
    return edges[near[is_on]], vertex[is_on]


def _members(faces: Ints, table: EdgeTable, lines: Lines, chosen: Ints) -> Incidence:
    """Return all points of the faces with ids `chosen`, which are corners, points on edges, and points inside."""
    sides, points = members_of(lines.on.starts(len(lines.ends)), lines.on.points, table.face_edges[chosen].ravel())
    return Incidence.of((np.repeat(chosen, 3), faces[chosen].ravel()), (chosen[sides // 3], points), lines.within)


class Records(NamedTuple):
    """r parts of lines that lie in faces."""

    faces: Ints  # (r,) the face
    lines: Ints  # (r,) the line
    # (r,) the points at both ends of the part
    tails: Ints
    heads: Ints


def _with_segments(
    points: Floats, faces: Ints, table: EdgeTable, pairs: Ints, lines: Lines, slacks: Floats
) -> tuple[Lines, Records]:
    """Add the segments along which `pairs`, (k, 2), of faces meet, found from the points that both have in common.

    `slacks`, (m,), are those of the faces. Also return where lines lie in faces.
    """
    members = _members(faces, table, lines, np.unique(pairs))
    chains = Chains(lines.ends, lines.on.starts(len(lines.ends)), lines.on.points)
    starts = members.starts(len(faces))
    rows, sides = _segments(
        read_only(points), starts, members.points, table.face_edges, chains, pairs, ON_LINE * slacks
    )
    on_segment = rows[:, 1] >= len(lines.ends)
    ends = np.zeros((len(sides), 2), dtype=np.int64)
    ends[rows[on_segment, 1] - len(lines.ends)] = rows[on_segment, 2:]
    return lines._replace(ends=np.concatenate([lines.ends, ends]), sides=sides), Records(*rows.T)


def _with_crossings(
    points: Floats, lines: Lines, records: Records, reaches: Floats, slacks: Floats, busy: Ints
) -> tuple[Floats, Lines, Records]:
    """Add the points in which lines cross or touch within faces.

    `reaches`, (n,), and `slacks`, (m,), are the distances within which points, and what lies on faces, are merged; the
    points with ids `busy` may have others near them. Return all points, lines and records.
    """
    if not len(records.faces):
        return points, lines, records
    # parts of lines as thin boxes, to find those near each other
    ends = np.stack([records.tails, records.heads], axis=1)
    corners = points[ends[:, [0, 1, 1]]]
    tree = BoxTree.around(corners)
    record_slacks = slacks[records.faces]
    starts, near = tree.meeting(corners, record_slacks)
    touching, crossing, positions = _cross(
        read_only(points), records.faces, records.lines, ends, starts, near, record_slacks
    )
    new_slacks = record_slacks[crossing[:, 0]]
    first, second = records.lines[crossing].T
    # a crossing is named by its lines, so that it is one point in all faces in which it is found. Two segments cross
    # where three faces do: one face is a side of both, and the three name the point
    n_edges = len(lines.ends) - len(lines.sides)
    names = np.stack([np.minimum(first, second), np.maximum(first, second), np.full(len(first), -1)], axis=1)
    of_segments = names[:, 0] >= n_edges
    sides = np.sort(lines.sides[names[of_segments][:, :2] - n_edges].reshape(-1, 4), axis=1)
    is_repeated = np.append(sides[:, 1:] == sides[:, :-1], np.zeros((len(sides), 1), dtype=bool), axis=1)
    of_three = is_repeated.sum(axis=1) == 1
    three_faces = sides[of_three][~is_repeated[of_three]].reshape(-1, 3)
    names[np.flatnonzero(of_segments)[of_three]] = three_faces + len(lines.ends)
    all_new = np.ones(len(names), dtype=bool)
    points, reaches, ids = _with_new(points, reaches, names, positions, new_slacks, all_new, first)
    lines = lines._replace(on=Incidence.of(lines.on, tuple(touching.T), (first, ids), (second, ids)))
    rename = _welded(points, np.concatenate([busy, lines.on.points, lines.within.points, lines.ends.ravel()]), reaches)
    records = records._replace(tails=rename[records.tails], heads=rename[records.heads])
    return points, lines.renamed(rename), records


def _divided(
    points: Floats, faces: Ints, origins: Ints, table: EdgeTable, lines: Lines, records: Records
) -> Arrangement:
    """Triangulate all faces that have points on their edges, or points or lines inside; others stay undivided.

    `origins`, (m,), are the given faces that the (m, 3) faces stand for, and `records` the parts of lines in faces.
    """
    n = len(points)
    starts, along = _points_along(points, lines)
    face, begins_at, ends_at = _split(records, starts, along, n)
    busy: Bools = np.asarray((np.diff(starts) > 2)[table.face_edges].any(axis=1))
    busy[face] = True
    busy[lines.within.owners] = True
    chosen = np.flatnonzero(busy)
    if not len(chosen):
        return Arrangement(points, faces, origins, np.arange(len(faces)))
    owner, rim, corner = _rims(table, chosen, starts, along)

    # points and segments inside faces, without those on the boundary
    inner = Incidence.of(lines.within, (face, begins_at), (face, ends_at)).without((owner, rim))
    segments = Incidence.of((face * n + np.minimum(begins_at, ends_at), np.maximum(begins_at, ends_at)))
    following = np.empty_like(rim)
    following[:-1] = rim[1:]
    ends = np.append(owner[1:] != owner[:-1], True)
    begins = np.append(True, ends[:-1])
    following[ends] = rim[begins]
    segments = segments.without((owner * n + np.minimum(rim, following), np.maximum(rim, following)))
    segment_faces, segment_tails = np.divmod(segments.owners, n)

    # what `triangulate_faces` takes: all points of each face, the rim first, and segments between their local numbers
    members_owner = np.concatenate([owner, inner.owners])
    members = np.concatenate([rim, inner.points])
    order = np.argsort(members_owner, kind="stable")
    members_owner, members = members_owner[order], members[order]
    member_starts = np.searchsorted(members_owner, np.append(chosen, len(faces)))
    rims = np.bincount(np.searchsorted(chosen, owner), minlength=len(chosen))
    corners = np.flatnonzero(corner).reshape(-1, 3) - np.flatnonzero(begins)[:, None]
    corners = np.stack([corners[:, 1], corners[:, 2], rims], axis=1)
    _, local = numbered(np.diff(member_starts))
    keys = members_owner * n + members
    order = np.argsort(keys, kind="stable")
    corner_ends = [
        local[order[np.searchsorted(keys[order], segment_faces * n + end)]] for end in (segment_tails, segments.points)
    ]
    pieces, owners, across = triangulate_faces(
        read_only(points),
        member_starts,
        members,
        corners,
        np.searchsorted(segment_faces, np.append(chosen, len(faces))),
        np.stack(corner_ends, axis=1),
    )
    # pieces are in one cell if they are connected across edges that are no segments
    rows, sides = np.nonzero(across >= 0)
    cells = connected_components(len(pieces), rows, across[rows, sides])
    kept = np.flatnonzero(~busy)
    all_faces = np.concatenate([faces[kept], pieces])
    all_origins = np.concatenate([kept, chosen[owners]])
    order = np.argsort(all_origins, kind="stable")
    all_cells = np.concatenate([np.arange(len(kept)), len(kept) + cells])
    return Arrangement(points, all_faces[order], origins[all_origins[order]], all_cells[order])


def _points_along(points: Floats, lines: Lines) -> tuple[Ints, Ints]:
    """Return (l + 1,) offsets, and the points of each line in order, from its first end to its last."""
    on = lines.on.along(points, lines.ends)
    starts = np.append(0, np.cumsum(np.bincount(on.owners, minlength=len(lines.ends)) + 2))
    along = np.empty(starts[-1], dtype=np.int64)
    along[starts[:-1]], along[starts[1:] - 1] = lines.ends.T
    between = np.ones(len(along), dtype=bool)
    between[starts[:-1]] = between[starts[1:] - 1] = False
    along[between] = on.points
    return starts, along


def _split(records: Records, starts: Ints, along: Ints, n: int) -> tuple[Ints, Ints, Ints]:
    """Split parts of lines in faces at every point: (k,) faces, and (k,) points at the beginning and end of each.

    `starts` and `along` are those of `_points_along`, on n points.
    """
    # where in `along` each part has its ends, found by line and point; it may run against its line
    keys = np.repeat(np.arange(len(starts) - 1), np.diff(starts)) * n + along
    order = np.argsort(keys, kind="stable")
    one_end, other_end = (
        order[np.searchsorted(keys[order], records.lines * n + end)] for end in (records.tails, records.heads)
    )
    first, last = np.minimum(one_end, other_end), np.maximum(one_end, other_end)
    row, place = numbered(last - first)
    place += first[row]
    return records.faces[row], along[place], along[place + 1]


def _rims(table: EdgeTable, chosen: Ints, starts: Ints, along: Ints) -> tuple[Ints, Ints, Bools]:
    """Return the points around the `chosen` faces in order: (k,) faces, (k,) points, and (k,) which are corners.

    `starts` and `along` are those of `_points_along`; a side that runs against its edge takes them backwards.
    """
    edges, forward = table.face_edges[chosen].ravel(), table.forward[chosen].ravel()
    side, place = members_of(starts, np.arange(starts[-1]), edges)
    place = np.where(~forward[side], starts[edges[side]] + starts[edges[side] + 1] - 1 - place, place)
    last = np.append(side[1:] != side[:-1], True)  # the next side begins with this point
    side, rim = side[~last], along[place][~last]
    return chosen[side // 3], rim, np.append(True, side[1:] != side[:-1])


def _with_copies_alike(pieces: Arrangement) -> Arrangement:
    """Give cells of different faces that cover each other the same triangles, those of the first cell.

    Triangles are reversed where a face has the opposite orientation.
    """
    # the outline of each cell: the sides that it has once
    points, faces, origins, cells = pieces
    table = edge_table(faces)
    n = int(cells.max(initial=-1)) + 1
    edges, owners = table.face_edges.ravel(), np.repeat(cells, 3)
    order = np.lexsort((edges, owners))
    twice = np.zeros(len(order), dtype=bool)
    same = (edges[order][1:] == edges[order][:-1]) & (owners[order][1:] == owners[order][:-1])
    twice[1:] |= same
    twice[:-1] |= same
    outline = order[~twice]
    edges, owners = edges[outline], owners[outline]
    # equal outlines have equal sums of the random codes of their edges (Zobrist 1970); the first such cell is the model
    codes = np.random.default_rng(0).integers(0, 2**63, len(table.vertices), dtype=np.int64).astype(np.uint64)
    sums, counts = np.zeros(n, dtype=np.uint64), np.bincount(owners, minlength=n)
    np.add.at(sums, owners, codes[edges])
    forward = np.zeros(n, dtype=bool)
    with_outline = np.flatnonzero(counts)
    forward[with_outline] = table.forward.ravel()[outline[np.searchsorted(owners, with_outline)]]
    alone = np.where(counts > 0, -1, np.arange(n))
    kinds, first = distinct_rows(np.stack([sums.view(np.int64), counts, alone], axis=1))
    models = first[kinds]
    if (models == np.arange(n)).all():
        return pieces
    # cells cover each other if areas and centroids are equal, too
    areas, middles = face_areas(points[faces]), points[faces].mean(axis=1)
    totals = np.bincount(cells, areas, n)
    middles = sums_of(areas[:, None] * middles, cells, n) / np.maximum(totals, 1e-300)[:, None]
    covers = (models != np.arange(n)) & (np.abs(totals - totals[models]) <= COVERING_CELLS * totals)
    covers &= np.linalg.norm(middles - middles[models], axis=1) <= COVERING_CELLS * np.sqrt(totals)
    copies = np.flatnonzero(covers)
    # replace the triangles of copies by those of their models
    origin_of = np.empty(n, dtype=np.int64)
    origin_of[cells] = origins
    rows, members = members_of(*grouped(cells, n), models[copies])
    reverse = (forward[copies] != forward[models[copies]])[rows]
    kept = ~covers[cells]
    faces = np.concatenate([faces[kept], np.where(reverse[:, None], faces[members, ::-1], faces[members])])
    cells = np.concatenate([cells[kept], copies[rows]])
    order = np.argsort(origin_of[cells], kind="stable")
    return Arrangement(points, faces[order], origin_of[cells[order]], cells[order])


@compiled
def _product(points: Floats, a: int, b: int, c: int, d: int) -> float:
    """Return the scalar product of the ways from point a to b and from c to d."""
    product = 0.0
    for k in range(3):
        product += (points[b, k] - points[a, k]) * (points[d, k] - points[c, k])
    return product


@compiled
def _is_on(points: Floats, v: int, a: int, b: int, slack: float) -> bool:
    """Return whether point v lies between the ends of edge ab, and at most `slack` from it."""
    square, ahead = 0.0, 0.0
    for d in range(3):
        way = points[b, d] - points[a, d]
        square += way * way
        ahead += way * (points[v, d] - points[a, d])
    if not (0.0 < ahead < square):
        return False
    share, off = ahead / square, 0.0
    for d in range(3):
        off += (points[v, d] - points[a, d] - share * (points[b, d] - points[a, d])) ** 2
    return off <= slack * slack


@compiled
def _closest(points: Floats, a: int, b: int, c: int, d: int, middle: Floats) -> float:
    """Return the distance of edges ab and cd where they pass each other, and write the point in the middle, (3,).

    The distance is infinite if the edges are parallel, or nearest to each other at an end. Edges ``a + s u`` and
    ``c + t v`` pass each other at ``s = n · (w × v) / |n|²`` and ``t = n · (w × u) / |n|²``, with n = u × v, w = c − a.
    """
    u, v, w, n, square, s, t = np.empty(3), np.empty(3), np.empty(3), np.empty(3), 0.0, 0.0, 0.0
    for k in range(3):
        u[k], v[k], w[k] = points[b, k] - points[a, k], points[d, k] - points[c, k], points[c, k] - points[a, k]
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        n[k] = u[p] * v[q] - u[q] * v[p]
        square += n[k] * n[k]
    if not square > PARALLEL_EDGES**2 * _product(points, a, b, a, b) * _product(points, c, d, c, d):
        return np.inf
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        s += n[k] * (w[p] * v[q] - w[q] * v[p]) / square
        t += n[k] * (w[p] * u[q] - w[q] * u[p]) / square
    if not (0.0 < s < 1.0 and 0.0 < t < 1.0):
        return np.inf
    off = 0.0
    for k in range(3):
        x, y = points[a, k] + s * u[k], points[c, k] + t * v[k]
        off += (x - y) ** 2
        middle[k] = 0.5 * (x + y)
    return np.sqrt(off)


@compiled
def _normal(points: Floats, face: Ints) -> tuple[float, float, float]:
    """Return the unit normal of a face, (3,) vertex ids."""
    a, b, c = face[0], face[1], face[2]
    ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@compiled
def _is_over(points: Floats, x: Floats, face: Ints, n: Floats) -> bool:
    """Return whether the projection of x, (3,), on a face, (3,) point ids, along its normal n, (3,), is inside it."""
    for k in range(3):  # x is on the left of each side: n · ((b − a) × (x − a)) > 0
        a, b = face[k], face[(k + 1) % 3]
        turn = 0.0
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            turn += n[d] * (
                (points[b, p] - points[a, p]) * (x[q] - points[a, q])
                - (points[b, q] - points[a, q]) * (x[p] - points[a, p])
            )
        if not turn > 0.0:
            return False
    return True


@compiled
def _meetings(
    points: Floats, faces: Ints, edges: Ints, face_edges: Ints, pairs: Ints, slacks: Floats
) -> tuple[Ints, Floats, Floats]:
    """Find the points in which pairs of faces, (k, 2), meet; `edges`, (e, 2), are all, `face_edges`, (m, 3), of faces.

    Returns (e, 3) meetings, (e, 3) their positions, which are zero where the point is a vertex, and (e,) their slacks.
    A meeting is a row of its kind and the ids of two elements: ON_EDGE, edge and vertex; IN_FACE, face and vertex;
    TWO_EDGES and both edges, the smaller id first; EDGE_AND_FACE, edge and face.
    """
    meetings, positions, within = [(0, 0, 0)], [(0.0, 0.0, 0.0)], [0.0]  # the first entries tell types, and are dropped
    # of both faces of a pair: whether corner i lies on edge k of the other face, or anywhere on that face; whether edge
    # k meets the boundary of the other face; and the heights of corners above it
    touch, on = np.empty((2, 3, 3), np.bool_), np.empty((2, 3), np.bool_)
    hit, heights = np.empty((2, 3), np.bool_), np.empty((2, 3))
    normals, position = np.empty((2, 3)), np.empty(3)
    for r in range(len(pairs)):
        slack = min(slacks[pairs[r, 0]], slacks[pairs[r, 1]])
        touch[:], on[:], hit[:], heights[:] = False, False, False, 0.0
        for s in range(2):
            normals[s, 0], normals[s, 1], normals[s, 2] = _normal(points, faces[pairs[r, s]])
        for s in range(2):  # corners of one face on the other
            corners, g = faces[pairs[r, s]], pairs[r, 1 - s]
            for i in range(3):
                v = corners[i]
                if v == faces[g, 0] or v == faces[g, 1] or v == faces[g, 2]:
                    on[s, i] = True
                    continue
                for k in range(3):
                    if _is_on(points, v, faces[g, k], faces[g, (k + 1) % 3], slack):
                        meetings.append((ON_EDGE, face_edges[g, k], v))
                        positions.append((0.0, 0.0, 0.0))
                        touch[s, i, k], on[s, i], hit[1 - s, k] = True, True, True
                for d in range(3):
                    heights[s, i] += normals[1 - s, d] * (points[v, d] - points[faces[g, 0], d])
                    position[d] = points[v, d]
                flat = not on[s, i] and abs(heights[s, i]) <= slack
                if flat and _is_over(points, position, faces[g], normals[1 - s]):
                    meetings.append((IN_FACE, g, v))
                    positions.append((0.0, 0.0, 0.0))
                    on[s, i] = True
        f, g = pairs[r, 0], pairs[r, 1]
        for i in range(3):  # edges that cross
            e = face_edges[f, i]
            a, b = edges[e, 0], edges[e, 1]
            for k in range(3):
                h = face_edges[g, k]
                c, d = edges[h, 0], edges[h, 1]
                if a == c or a == d or b == c or b == d:
                    continue
                if touch[0, i, k] or touch[0, (i + 1) % 3, k] or touch[1, k, i] or touch[1, (k + 1) % 3, i]:
                    continue
                off = _closest(points, a, b, c, d, position) if e < h else _closest(points, c, d, a, b, position)
                if off <= slack:
                    meetings.append((TWO_EDGES, min(e, h), max(e, h)))
                    positions.append((position[0], position[1], position[2]))
                    hit[0, i], hit[1, k] = True, True
        for s in range(2):  # edges of one face that pierce the other
            g = pairs[r, 1 - s]
            for i in range(3):
                k = (i + 1) % 3
                low, high = heights[s, i], heights[s, k]
                if on[s, i] or on[s, k] or hit[s, i] or not low * high < 0.0:
                    continue
                v, w = faces[pairs[r, s], i], faces[pairs[r, s], k]
                for d in range(3):
                    position[d] = points[v, d] + low / (low - high) * (points[w, d] - points[v, d])
                if _is_over(points, position, faces[g], normals[1 - s]):
                    meetings.append((EDGE_AND_FACE, face_edges[pairs[r, s], i], g))
                    positions.append((position[0], position[1], position[2]))
        for _ in range(len(meetings) - len(within)):
            within.append(slack)
    return np.array(meetings)[1:], np.array(positions)[1:], np.array(within)[1:]


class Chains(NamedTuple):
    """l lines with the ids of the points on them."""

    ends: Ints  # (l, 2) points at both ends
    # (l + 1,) offsets of the points on each line in `points`, and these, for each line in ascending order
    starts: Ints
    points: Ints


@compiled
def _shared_edge(face_edges: Ints, chains: Chains, f: int, a: int, b: int) -> int:
    """Return the edge of face f on which both points a and b lie, or −1."""
    for k in range(3):
        e = face_edges[f, k]
        if _is_along(chains, e, a) and _is_along(chains, e, b):
            return e
    return -1


@compiled
def _is_along(chains: Chains, line: int, p: int) -> bool:
    """Return whether point p is an end of a line or one of the points on it."""
    if p == chains.ends[line, 0] or p == chains.ends[line, 1]:
        return True
    low, end = chains.starts[line], chains.starts[line + 1]
    high = end
    while low < high:
        middle = (low + high) // 2
        if chains.points[middle] < p:
            low = middle + 1
        else:
            high = middle
    return bool(low < end and chains.points[low] == p)


@compiled
def _sort(ids: list[int], keys: Floats) -> None:
    """Sort ids in place by their keys, and the keys with them (Shell 1959); compiling NumPy's sort takes a second."""
    gap = 1
    while 3 * gap < len(ids):
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(ids)):
            item, key, k = ids[i], keys[i], i
            while k >= gap and keys[k - gap] > key:
                ids[k], keys[k] = ids[k - gap], keys[k - gap]
                k -= gap
            ids[k], keys[k] = item, key
        gap //= 3


@compiled
def _common(members: Ints, starts: Ints, f: int, g: int) -> list[int]:
    """List the points that are in both of two faces, whose points ``members[starts[f] : starts[f + 1]]`` ascend."""
    common = [np.int64(0)]
    common.pop()
    i, j = starts[f], starts[g]
    while i < starts[f + 1] and j < starts[g + 1]:
        if members[i] == members[j]:
            common.append(members[i])
            i += 1
            j += 1
        elif members[i] < members[j]:
            i += 1
        else:
            j += 1
    return common


@compiled
def _segments(
    points: Floats, starts: Ints, members: Ints, face_edges: Ints, chains: Chains, pairs: Ints, straight: Floats
) -> tuple[Ints, Ints]:
    """Find the lines along which pairs of faces, (k, 2), meet, from the points that both faces have in common.

    Points of face f are ``members[starts[f] : starts[f + 1]]``, ascending. If the common points of two faces are within
    `straight`, (m,), of a line, the faces meet along that line. Otherwise they lie in one plane, and meet along the
    edges of one that lie in the other. `chains` are the edges, and `face_edges`, (m, 3), those of faces. Returns (r, 4)
    parts of lines in faces, as rows of face, line and two ends, and (s, 2) the two faces of each line that is no edge.
    """
    records, sides = [(0, 0, 0, 0)], [(0, 0)]
    ends = chains.ends
    for r in range(len(pairs)):
        f, g = pairs[r, 0], pairs[r, 1]
        common = _common(members, starts, f, g)
        if len(common) < 2:
            continue
        # p and q are far apart: q is farthest from p, which is farthest from the first
        p, q = common[0], common[0]
        for _ in range(2):
            most = -1.0
            for c in common:
                square = _product(points, p, c, p, c)
                if square > most:
                    q, most = c, square
            p, q = q, p
        p, q = q, p
        square, widest = _product(points, p, q, p, q), 0.0
        shares = np.empty(len(common))  # of the way from p to q
        for c in range(len(common)):
            shares[c], off = _product(points, p, common[c], p, q) / square, 0.0
            for d in range(3):
                way = points[q, d] - points[p, d]
                off += (points[common[c], d] - points[p, d] - shares[c] * way) ** 2
            widest = max(widest, np.sqrt(off))
        if widest <= min(straight[f], straight[g]):
            # along the line, each stretch between points is an edge of one face, of both, or else a new line
            _sort(common, shares)
            for c in range(len(common) - 1):
                a, b = common[c], common[c + 1]
                e = _shared_edge(face_edges, chains, f, a, b)
                h = _shared_edge(face_edges, chains, g, a, b)
                if e < 0 and h < 0:
                    line = len(ends) + len(sides) - 1
                    sides.append((f, g))
                    records.append((f, line, a, b))
                    records.append((g, line, a, b))
                elif h < 0:
                    records.append((g, e, a, b))
                elif e < 0:
                    records.append((f, h, a, b))
            continue
        for s in range(2):
            inner, outer = (f, g) if s == 0 else (g, f)
            for k in range(3):  # edges of one face that lie in the other
                e = face_edges[inner, k]
                first, last = np.int64(-1), np.int64(-1)
                for c in common:
                    if _is_along(chains, e, c):
                        if first < 0:
                            first = last = c
                            continue
                        if _product(points, first, c, ends[e, 0], ends[e, 1]) < 0.0:
                            first = c
                        elif _product(points, last, c, ends[e, 0], ends[e, 1]) > 0.0:
                            last = c
                if first == last or _shared_edge(face_edges, chains, outer, first, last) >= 0:
                    continue
                records.append((outer, e, first, last))
    return np.array(records)[1:], np.array(sides)[1:]


@compiled
def _cross(
    points: Floats, faces: Ints, lines: Ints, ends: Ints, starts: Ints, near: Ints, slacks: Floats
) -> tuple[Ints, Ints, Floats]:
    """Find where parts of lines touch or cross each other within a face.

    The arrays `faces`, `lines` and `ends` are those of `Records`, and ``near[starts[r] : starts[r + 1]]`` are the parts
    that may meet part r. Returns (t, 2) pairs of a line and a point on it, (c, 2) pairs of parts that cross, and (c, 3)
    positions of the crossings.
    """
    touching, crossing, positions = [(0, 0)], [(0, 0)], [(0.0, 0.0, 0.0)]
    position = np.empty(3)
    for r in range(len(faces)):
        for s in near[starts[r] : starts[r + 1]]:
            if s <= r or faces[s] != faces[r] or lines[s] == lines[r]:
                continue
            met = False
            for first, second in ((r, s), (s, r)):
                for k in range(2):
                    v, a, b = ends[first, k], ends[second, 0], ends[second, 1]
                    if v == a or v == b:
                        met = True
                    elif _is_on(points, v, a, b, slacks[r]):
                        touching.append((lines[second], v))
                        met = True
            if not met and _closest(points, ends[r, 0], ends[r, 1], ends[s, 0], ends[s, 1], position) < np.inf:
                crossing.append((r, s))
                positions.append((position[0], position[1], position[2]))
    return np.array(touching)[1:], np.array(crossing)[1:], np.array(positions)[1:]
