"""Coincidence of points, exactly or up to rounding, of rows of numbers, and of faces with the same corners."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, mask_of, read_only
from ..compiled import compiled
from .components import boxes_of, connected_components
from .edges import find_edges, has_three_corners, pair_halfedges

ONE_PLACE = 4.0
"""Largest difference between coordinates of points that count as coinciding, in units of single precision of the size
of a part, or in last places of its coordinates."""
SEAM_UNITS, GAP_UNITS = 64.0, 1024.0
"""Largest difference between coordinates of vertices that are welded along a seam, and of those that are reported as a
gap, in units of single precision of the size of the surface. Halved, a vertex in a hundred is missed on two of twelve
seams; doubled, nothing changes (`benchmarks/deciding_numbers.py`)."""
SEAM_WIDTH = 0.25
"""Distance of vertices, relative to the shortest edge at them, above which they are not welded along a seam."""
MOST_REACHES = 32
"""Number of different reaches in `welded_within` above which reaches are rounded more coarsely."""
_LOW = 0xFFFFFFFF
"""Mask of the low 32 bits."""


def part_sizes(points: Floats, labels: Ints, tails: Ints, heads: Ints) -> Floats:
    """Return (p,) the size of each connected part, from the (n,) labels of points and the (h,) ends of halfedges.

    The size is the longest side of the part's box. It is at most √m times the geometric mean length of its edges if it
    has m faces, so that a single face that reaches far beyond all others does not count.
    """
    n = int(labels.max(initial=-1)) + 1
    lengths = np.zeros(len(tails))
    for along in points.T.copy():
        np.maximum(lengths, np.abs(along[heads] - along[tails]), out=lengths)
    proper = lengths > 0
    owners = labels[tails[proper]]
    counts = np.bincount(owners, minlength=n)
    logs = np.bincount(owners, np.log(lengths[proper]), n) / np.maximum(counts, 1)
    low, high = boxes_of(points, labels, n)
    return np.where(counts > 0, np.minimum((high - low).max(axis=1), np.sqrt(counts / 3.0) * np.exp(logs)), 0.0)


def parts_by_place(points: Floats, tails: Ints, heads: Ints) -> tuple[Ints, Floats]:
    """Return (h,) the connected part of each halfedge, and (p,) the diagonals of the boxes around the parts.

    Boundary vertices that coincide up to rounding connect parts.
    """
    ids = joined_rims(points, tails, heads, ONE_PLACE)
    labels = connected_components(len(points), ids[tails], ids[heads])[ids[tails]]
    names, parts = np.unique(labels, return_inverse=True)
    low, high = boxes_of(points[tails], parts, len(names))
    return parts, np.linalg.norm(high - low, axis=1)


def tolerances(points: Floats, faces: Ints, units: float) -> Floats:
    """Return (m,) distances below which points on each face count as coinciding.

    It is `units` times the size of the connected part of the face, and at least `ONE_PLACE` last places of the
    coordinates of the face.
    """
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    labels = connected_components(len(points), tails, heads)
    sizes = part_sizes(points, labels, tails, heads)
    largest = reduce(np.maximum, np.abs(points).T)
    last_places = ONE_PLACE * 2.0**-53 * reduce(np.maximum, largest[faces.T])
    return np.maximum(units * sizes[labels[faces[:, 0]]], last_places)


def joined_faces(points: Floats, faces: Ints) -> Ints:
    """Return (m, 3) faces between vertices that are one where they coincide, exactly or, on rims and copies, nearly."""
    faces = same_positions(points)[faces]
    faces = joined_copies(points, faces)[faces]
    once = faces[first_copies(faces)]  # since copies have their rims in common, too
    return joined_rims(points, once.ravel(), np.roll(once, -1, axis=1).ravel(), ONE_PLACE)[faces]


def first_copies(faces: Ints) -> Bools:
    """Return (m,) which of (m, 3) faces are the first on their vertices; none with fewer than three of these."""
    return np.asarray(coincident_faces(faces.ravel(), np.arange(0, 3 * len(faces) + 1, 3))[0] == np.arange(len(faces)))


def joined_rims(points: Floats, tails: Ints, heads: Ints, units: float) -> Ints:
    """Weld boundary vertices that coincide, as along seams.

    Returns (n,) the vertex into which each is merged, its own index for all others. Boundary edges are those with an
    odd number of halfedges, (h,) tails and heads. Two vertices coincide if they differ by `units` of single precision
    of the size of both their parts, or by `ONE_PLACE` last places if coordinates use all digits, but never so that an
    edge collapses. So vertices that rounding to single precision has separated are welded even after a move in double
    precision.
    """
    edges, _, counts, _, _ = find_edges(read_only(tails), read_only(heads), tails != heads, len(points))
    is_open = (edges >= 0) & (np.append(counts, 0)[edges] % 2 == 1)
    rims = np.unique([tails[is_open], heads[is_open]])
    places = np.arange(len(points))
    if not len(rims):
        return places
    first = rims[same_positions(points[rims])]
    places[rims] = first
    lengths, shortest = np.abs(points[heads] - points[tails]).max(axis=1), np.full(len(points), np.inf)
    for ends in (tails, heads):
        np.minimum.at(shortest, places[ends], np.where(lengths > 0, lengths, np.inf))
    while True:  # what is joined is a larger part
        parts = connected_components(len(points), places[tails], places[heads])[places]
        reaches = _reaches(points, parts, tails, heads, units)[parts[rims]]
        near = first[np.searchsorted(rims, rims[welded_within(points[rims], reaches)])]
        apart = np.abs(points[first] - points[near]).max(axis=1)
        joined = np.where(apart <= SEAM_WIDTH * np.minimum(shortest[first], shortest[near]), near, first)
        if len(np.unique(joined)) >= len(np.unique(places[rims])):
            return places
        places[rims] = joined


def joined_copies(points: Floats, faces: Ints) -> Ints:
    """Weld the vertices of duplicate faces in different connected parts, which only rounding separates.

    Returns (n,) the vertex into which each is merged, its own index for all others. Faces are duplicates if each corner
    of one coincides with a corner of the other. Parts stay apart if other points of them lie within `SEAM_UNITS` of
    each other, since then some of their vertices would be welded, and some not.
    """
    places, tails, heads = np.arange(len(points)), faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    parts = connected_components(len(points), tails, heads)
    owners = parts[faces[:, 0]]
    if not len(faces) or (owners == owners[0]).all():
        return places
    reaches = _reaches(points, parts, tails, heads, ONE_PLACE)[parts]
    # duplicates of faces of other parts, once points that only rounding separates are one
    near = welded_within(points, reaches)
    if (near == places).all():
        return places
    first, _ = coincident_faces(near[faces].ravel(), np.arange(0, 3 * len(faces) + 1, 3))
    copies = (first >= 0) & (owners[first] != owners)
    if not copies.any():
        return places
    # but not of parts with points that are near each other, yet farther apart than that
    used = np.unique(faces)
    wide, labels = welded_within(points, SEAM_UNITS / ONE_PLACE * reaches)[used], parts[used]
    firsts = distinct_rows(np.stack([wide, near[used]], axis=1))[1]
    several = np.bincount(wide[firsts], minlength=len(points))[wide] > 1  # at places farther apart than rounding
    rows = distinct_rows(np.stack([wide, labels], axis=1))[0]
    vague = mask_of(int(parts.max()) + 1, labels[several | (np.bincount(rows) > 1)[rows]])
    copies &= ~(vague[owners] | vague[owners[first]])
    return np.where(np.isin(near, near[faces[copies]]), near, places)


def _reaches(points: Floats, parts: Ints, tails: Ints, heads: Ints, units: float) -> Floats:
    """Return (p, 3) the distance along each axis up to which points of each part coincide.

    `parts` is the part of each point, (n,), and `tails` and `heads` are the ends of halfedges, (h,).
    """
    used = np.flatnonzero(mask_of(len(points), tails))
    sizes, digits = part_sizes(points, parts, tails, heads), 24 if _is_single(points[used]) else 53
    last_places = _rounding(points[used], parts[used], len(sizes), digits)
    return np.maximum(units * 2.0**-24 * sizes[:, None], ONE_PLACE * last_places)


def _is_single(points: Floats) -> bool:
    """Return whether single precision holds all coordinates without loss."""
    with np.errstate(over="ignore", under="ignore"):
        return bool((points.astype(np.float32) == points).all())


def _rounding(points: Floats, parts: Ints, n: int, digits: int) -> Floats:
    """Return (n, 3) the rounding of the coordinates of n parts: half to one last place of the largest.

    It is 0 along axes where no coordinate uses its last place, as on a lattice, since these are exact. `parts` are the
    part of each point, and coordinates have `digits` binary digits.
    """
    result = np.zeros((n, 3))
    for axis, coordinates in enumerate(points.T):
        largest = np.zeros(n)
        np.maximum.at(largest, parts, np.abs(coordinates))
        last_places = np.ldexp(1.0, np.frexp(largest)[1] - digits)
        if (np.fmod(coordinates, 2.0 * last_places[parts]) != 0).any():
            result[:, axis] = largest * 2.0**-digits  # which does not jump at powers of two, as last places do
    return result


def welded_within(points: Floats, reaches: Floats) -> Ints:
    """Weld (n, 3) points that are within both points' reaches, (n,) or (n, 3) along each axis.

    Returns (n,) the point into which each is merged, or its own index. Reaches are rounded to powers of four times the
    largest reach, or to powers of a larger number if that leaves more than `MOST_REACHES` different ones.
    """
    # a point of level k reaches 4⁻ᵏ of the largest reach, along each axis
    reaches = np.broadcast_to(reaches[:, None] if reaches.ndim == 1 else reaches, points.shape)
    largest = reaches.max(axis=0, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        levels = np.where(reaches > 0, np.rint(0.5 * np.log2(largest / reaches)), 512).astype(np.int64)
    step = 1
    while len(rows := np.unique(levels, axis=0)) > MOST_REACHES:
        step *= 2
        levels = -(-levels // 2)
    rows = np.unique(np.maximum(rows[:, None], rows[None]).reshape(-1, 3), axis=0)
    owners = np.arange(len(points))
    for row in rows[::-1]:  # the least reaches come first
        chosen, joined = np.flatnonzero((levels <= row).all(axis=1)), np.arange(len(points))
        joined[chosen] = chosen[welded(points[chosen], np.ldexp(largest, -2 * step * row))]
        owners = joined[owners]
    return owners


def welded(points: Floats, tolerance: float | Floats) -> Ints:
    """Return (n,) the first point within `tolerance` along each axis of each of (n, 3) points, or its own index.

    A point is compared only with points that are not merged into others themselves, so chains of points do not merge.
    """
    return _weld(np.ascontiguousarray(points), np.maximum(np.broadcast_to(tolerance, 3), 1e-300))


def same_positions(points: Floats) -> Ints:
    """Return (n,) the first point at exactly the same position as each of (n, d) points."""
    return same_rows((np.ascontiguousarray(points) + 0.0).view(np.uint64))  # −0 becomes 0


def indexed(triangles: Floats) -> tuple[Floats, Ints]:
    """Return the points of (m, 3, 3) triangles in order of first use, and (m, 3) triangles between them."""
    corners = triangles.reshape(-1, 3)
    used, faces = np.unique(same_positions(corners), return_inverse=True)
    return corners[used], faces.reshape(-1, 3)


def same_rows(rows: NDArray[np.integer]) -> Ints:
    """Return (n,) the first row that equals each of (n, k) rows, in O(n) time."""
    numbers = np.ascontiguousarray(rows)
    return _same_rows(numbers.view(np.int64) if numbers.itemsize == 8 else numbers.astype(np.int64))


def distinct_rows(rows: NDArray[np.integer]) -> tuple[Ints, Ints]:
    """Give numbers to the distinct rows of an (n, k) array, in order of first appearance.

    Returns (n,) the number of each row, and (u,) the index of the first row with each number.
    """
    first = same_rows(rows)
    is_first = first == np.arange(len(first))
    return (np.cumsum(is_first) - 1)[first], np.flatnonzero(is_first)


def coincident_faces(corners: Ints, offsets: Ints) -> tuple[Ints, Bools]:
    """Find faces with the same corners, in the same or the reverse cyclic order.

    Face f has the corners offsets[f] to offsets[f + 1] − 1. Returns (p,) the first such face of each, −1 for degenerate
    faces, and (p,) whether the order is the reverse of that of the first.
    """
    sizes = np.diff(offsets)
    first, reverse = np.arange(len(sizes)), np.zeros(len(sizes), dtype=bool)
    for size in np.unique(sizes).tolist():
        polygons = np.flatnonzero(sizes == size)
        faces = corners[offsets[polygons, None] + np.arange(size)]
        ordered = np.sort(faces, axis=1)
        distinct = 1 + np.count_nonzero(ordered[:, 1:] != ordered[:, :-1], axis=1)
        first[polygons[distinct < min(size, 3)]] = -1
        polygons, faces = polygons[distinct == size], faces[distinct == size]
        rows, least = np.arange(len(polygons)), faces.argmin(axis=1)
        backwards = faces[rows, least - 1] < faces[rows, (least + 1) % size]
        steps = np.where(backwards, -1, 1)[:, None] * np.arange(size)
        same = same_rows(np.take_along_axis(faces, (least[:, None] + steps) % size, axis=1))
        first[polygons], reverse[polygons] = polygons[same], backwards != backwards[same]
    return first, reverse


@compiled
def mixed(a: int, b: int, c: int) -> int:
    """Return a nonnegative hash of three integers.

    Their 32-bit halves are multiplied by odd numbers, so that products fit into 64 bits.
    """
    x = ((a & _LOW) * 0x1E3779B1) ^ ((b & _LOW) * 0x2545F491) ^ ((c & _LOW) * 0x165667B1)
    x ^= (((a >> 32) & _LOW) * 0x27D4EB2F) ^ (((b >> 32) & _LOW) * 0x1B873593) ^ (((c >> 32) & _LOW) * 0x0CC9E2D5)
    x = ((x ^ (x >> 29)) & _LOW) * 0x3C6EF373
    return (x ^ (x >> 27)) & 0x7FFFFFFFFFFFFFFF


@compiled
def _weld(points: Floats, tolerances: Floats) -> Ints:
    """Return (n,) the point into which each of (n, 3) points is merged, as `welded` does, for (3,) tolerances.

    It uses a hash table of cells 16 tolerances wide, each a linked list of the points that are not merged: `newest` is
    its last one, and `older` the one before each.
    """
    n = len(points)
    bits = 4
    while (1 << bits) < 2 * n:
        bits += 1
    mask = (1 << bits) - 1
    newest, older = np.full(1 << bits, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    owner = np.empty(n, dtype=np.int64)
    (near_x, near_y, near_z), (side_x, side_y, side_z) = tolerances, 16.0 * tolerances  # few points are near cell walls
    for p in range(n):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        low_x, own_x, high_x = _cells_near(x, near_x, side_x)
        low_y, own_y, high_y = _cells_near(y, near_y, side_y)
        low_z, own_z, high_z = _cells_near(z, near_z, side_z)
        first = np.int32(-1)
        for i in range(low_x, high_x + 1):
            for j in range(low_y, high_y + 1):
                for k in range(low_z, high_z + 1):
                    other = newest[mixed(i, j, k) & mask]
                    while other >= 0:
                        is_near = abs(points[other, 0] - x) <= near_x and abs(points[other, 1] - y) <= near_y
                        if is_near and abs(points[other, 2] - z) <= near_z and (first < 0 or other < first):
                            first = other
                        other = older[other]
        if first >= 0:
            owner[p] = first
            continue
        owner[p] = p
        home = mixed(own_x, own_y, own_z) & mask
        older[p] = newest[home]
        newest[home] = p
    return owner


@compiled
def _cells_near(x: float, near: float, side: float) -> tuple[int, int, int]:
    """Return the numbers of the cells, of the given side, that contain x − near, x and x + near.

    Beyond 2⁵² cells, coordinates closer than a cell are equal, and all three numbers are the same hash of x.
    """
    cell = x / side
    if abs(cell) < 2.0**52:
        return np.int64(np.floor((x - near) / side)), np.int64(np.floor(cell)), np.int64(np.floor((x + near) / side))
    own = np.int64(2.0**53 * math.frexp(cell)[0]) if abs(cell) < np.inf else np.int64(0)
    return own, own, own


@compiled
def _same_rows(rows: Ints) -> Ints:
    """Return (n,) the first row that equals each of (n, k) rows, by a hash table of rows with linear probing."""
    count, width = rows.shape
    size = 16
    while size < 2 * count:
        size *= 2
    mask = np.uint64(size - 1)
    table = np.full(size, -1, dtype=np.int32)
    result = np.empty(count, dtype=np.int64)
    for i in range(count):
        # hash the row, and look from there on for an equal row, or for an empty slot
        key = np.uint64(1469598103934665603)
        for d in range(width):
            key = (key ^ np.uint64(rows[i, d])) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(29)
        slot = key & mask
        while True:
            row = table[slot]
            same = row >= 0
            for d in range(width):
                same = same and rows[i, d] == rows[row, d]
            if same or row < 0:
                break
            slot = (slot + np.uint64(1)) & mask
        if row < 0:
            table[slot] = row = i
        result[i] = row
    return result


def copied_faces(faces: Ints, n_vertices: int) -> Ints:
    """Return (m,) the first face with the same vertices as each face, or the face itself.

    Only faces with an edge of more than two faces are compared. For a face that has a vertex twice, it is a face with
    all of its vertices, if there is one.
    """
    first = np.arange(len(faces))
    doubled = ~has_three_corners(faces)
    pairs = pair_halfedges(faces.ravel(), np.roll(faces, -1, axis=1).ravel(), n_vertices)
    crowded = np.flatnonzero((pairs.around > 2).reshape(-1, 3).any(axis=1))
    if len(crowded):
        copies, _ = coincident_faces(faces[crowded].ravel(), np.arange(0, 3 * len(crowded) + 1, 3))
        first[crowded] = np.where(copies < 0, crowded, crowded[copies])
    for face in np.flatnonzero(doubled).tolist():
        around = np.flatnonzero(np.isin(faces, faces[face]).sum(axis=1) >= len(set(faces[face].tolist())))
        others = around[~doubled[around]]
        first[face] = first[others[0]] if len(others) else face
    return first
