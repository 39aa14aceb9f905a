"""Strips between rims that run along each other: seams of patches whose vertices differ, and ends of walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.components import connected_components, next_in_groups
from ..mesh.edges import has_three_corners
from ..mesh.triangles import side_lengths
from ..mesh.unit_vectors import SAME_WAY, unit
from ..parallel import PointTree
from .lids import SmoothRim, area_vector
from .rims import ALONG_EDGE, corners_of, opposite_edges

NARROW = 0.3
"""A strip at right angles to the surface closes two rims if its area, relative to that of flat lids on both, is at most
this. A strip that continues the surface straight on closes them if its area is less than that of the lids. A bowl of
half a ball whose wall is a quarter of its radius has 0.28, a box without its lid, a tenth as thick as it is wide, 0.32,
two square sheets a quarter of their width apart 0.5."""
LARGE_OPENING = 0.1
"""Two rims are the end of a wall if the area of flat lids on both exceeds this share of their parts' area. Otherwise
each rim is closed by itself: holes two fifths as wide as a hollow ball have 0.04, a cup 0.2, a bowl 0.5."""


@dataclass(frozen=True, eq=False)
class Rim:
    """A closed loop where faces end."""

    ids: Ints  # (n,) its vertices
    corners: Floats  # (n, 3) their positions
    onward: Floats  # (n, 3) unit vectors at its edges, along the surface and away from it
    parts: Ints  # (n,) connected part that ends at each edge
    centre: Floats  # (3,) centre of a ball around it
    radius: float  # radius of the ball
    opening: Floats  # (3,) area vector of a lid
    smooth: Floats  # (k, 3) points of the rim without zigzags
    beside: Ints  # (k,) the edge at the middle between each of these points and the next one
    reach: float  # largest width of a gap to another rim that is narrow: a strip there is smaller than half of the lid

    @classmethod
    def of(cls, ids: Ints, corners: Floats, behind: Floats, parts: Ints) -> Rim:
        """Return the rim of a loop of (n,) vertices at the (n, 3) `corners`.

        `behind`, (n, 3), is the third corner of the face at each edge, and `parts`, (n,), the connected part that ends
        there.
        """
        along = np.roll(corners, -1, axis=0) - corners
        away = corners - behind
        away -= ((away * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-300))[:, None] * along
        centre = corners.mean(axis=0)
        radius = float(np.linalg.norm(corners - centre, axis=1).max())
        opening, rim = area_vector(corners), SmoothRim.of(corners)
        smooth, beside = rim.points, rim.edges_at(0.5 * (rim.shares[1:] + rim.shares[:-1]))
        reach = NARROW * 2.0 * float(np.linalg.norm(opening)) / max(float(side_lengths(smooth).sum()), 1e-300)
        return cls(ids, corners, unit(away), parts, centre, radius, opening, smooth, beside, reach)


def seams(rims: list[Rim]) -> list[Ints]:
    """Return strips of triangles between rims that run along each other across gaps, each (k, 3) vertices.

    A strip joins whole sides, which are the straight parts of a rim between its corners.
    """
    if not rims:
        return []
    # all sides of all rims: (n,) rim of each, next side, ends, outward vector and part at its first edge
    corners = [corners_of(rim.corners) for rim in rims]
    counts = np.array([len(places) for places in corners])
    first = np.cumsum(counts) - counts
    owners, n = np.repeat(np.arange(len(rims)), counts), int(counts.sum())
    following = next_in_groups(np.append(0, np.cumsum(counts)))
    starts = np.concatenate([rim.corners[places] for rim, places in zip(rims, corners, strict=True)])
    onward = np.concatenate([rim.onward[places] for rim, places in zip(rims, corners, strict=True)])
    parts = np.concatenate([rim.parts[places] for rim, places in zip(rims, corners, strict=True)])
    ends = np.stack([starts, starts[following]], axis=1)
    lengths, directions = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), unit(ends[:, 1] - ends[:, 0])
    longest = np.maximum.reduceat(lengths, first)
    reaches = np.maximum([rim.reach for rim in rims], ALONG_EDGE * longest)
    # (k,) pairs of sides that run along each other: how far apart, and how far that way is onward from each surface
    first_sides, second_sides = opposite_edges(ends, reaches[owners])
    across = ends.mean(axis=1)[second_sides] - ends.mean(axis=1)[first_sides]
    across -= (across * directions[first_sides]).sum(axis=1)[:, None] * directions[first_sides]
    width, ahead, back = (
        np.linalg.norm(across, axis=1),
        (across * onward[first_sides]).sum(axis=1),
        -(across * onward[second_sides]).sum(axis=1),
    )
    # a crack is narrower than the chords of arcs are apart; across a gap the surface goes on
    crack = width <= ALONG_EDGE * np.maximum(lengths[first_sides], lengths[second_sides])
    crack &= (parts[first_sides] != parts[second_sides]) | ((ahead >= 0) & (back >= 0))
    gap = crack | (np.minimum(ahead, back) >= SAME_WAY * width)
    first_sides, second_sides = first_sides[gap], second_sides[gap]
    # a strip for each stretch, the longest first, unless longer ones have used its sides
    strips, used = [], np.zeros(n, dtype=bool)
    for pairs in _stretches(
        np.concatenate([first_sides, second_sides]), np.concatenate([second_sides, first_sides]), following, lengths
    ):
        free = pairs[~used[pairs].any(axis=1)]
        runs = [_run(np.unique(sides), following) for sides in free.T]
        if min(len(run) for run in runs) == 0 or np.isin(runs[0], runs[1]).any():
            continue
        whole = [following[run[-1]] == run[0] for run in runs]
        if whole[0] != whole[1]:
            continue
        used[np.concatenate(runs)] = True
        along = [
            _along_sides(rims[owners[run[0]]], corners[owners[run[0]]], run - first[owners[run[0]]]) for run in runs
        ]
        pair = [rims[owners[run[0]]] for run in runs]
        if whole[0]:
            strips.append(strip(pair[0], pair[1]))
            continue
        points = [rim.corners[indices] for rim, indices in zip(pair, along, strict=True)]
        ids = [rim.ids[indices] for rim, indices in zip(pair, along, strict=True)]
        strips.append(_zipped(ids[0], points[0], ids[1][::-1], points[1][::-1]))
    return strips


def _stretches(first: Ints, second: Ints, following: Ints, lengths: Floats) -> list[Ints]:
    """Group pairs of sides that face each other into stretches, (k, 2) arrays of sides, the longest first.

    Successive sides of one rim that face the same or successive sides of the other are in one stretch. The pairs
    `first` and `second` are given in both orders; `following` is the next side around the rim, `lengths` that of sides.
    """
    if not len(first):
        return []
    n = len(following)
    preceding = np.empty(n, dtype=np.int64)
    preceding[following] = np.arange(n)
    keys = np.sort(first * n + second)
    first, second = np.divmod(keys, n)
    tails, heads = [], []
    # a pair is linked with those that are one side further on one of the rims or on both, which run opposite ways
    for e, f in ((following[first], second), (first, preceding[second]), (following[first], preceding[second])):
        rows = np.minimum(np.searchsorted(keys, e * n + f), len(keys) - 1)
        linked = (keys[rows] == e * n + f) & ((e != second) | (f != first))
        tails.append(np.flatnonzero(linked))
        heads.append(rows[linked])
    labels = connected_components(len(keys), np.concatenate(tails), np.concatenate(heads))
    order = np.argsort(labels, kind="stable")
    groups = np.split(np.stack([first, second], axis=1)[order], np.cumsum(np.bincount(labels))[:-1])
    return sorted(groups, key=lambda pairs: -float(lengths[np.unique(pairs[:, 0])].sum()))


def _run(sides: Ints, following: Ints) -> Ints:
    """Return (k,) sides in their order around the rim, or none if they are not connected.

    `following` is the next side of every side.
    """
    begins = sides[~np.isin(sides, following[sides])]
    if len(begins) > 1 or not len(sides):
        return sides[:0]
    run = [int(begins[0]) if len(begins) else int(sides[0])]
    chosen = set(sides.tolist())
    while len(run) < len(sides):
        chosen.discard(run[-1])
        if (onward := int(following[run[-1]])) not in chosen:  # a loop, with more sides elsewhere
            return sides[:0]
        run.append(onward)
    return np.array(run)


def _along_sides(rim: Rim, corners: Ints, sides: Ints) -> Ints:
    """(k,) indices around a rim of all vertices of some successive sides, including both ends.

    `corners` are the indices at which its sides begin.
    """
    begin, stop = corners[sides[0]], corners[(sides[-1] + 1) % len(corners)]
    count = (stop - begin) % len(rim.ids) or len(rim.ids)
    return (begin + np.arange(count + 1)) % len(rim.ids)


def facing(rims: list[Rim], areas: Floats) -> list[tuple[int, int]]:
    """Find pairs of rims that run opposite ways and are near enough for a strip, given the areas of their parts."""
    if len(rims) < 2:
        return []
    centres, widths = np.array([rim.centre for rim in rims]), []
    for i, near in enumerate(PointTree(centres).query_ball_point(centres, [rim.radius for rim in rims])):
        larger = rims[i]
        for j in near:
            smaller = rims[j]
            # each pair once, from the larger rim
            if (smaller.radius, j) >= (larger.radius, i) or larger.opening @ smaller.opening >= 0:
                continue
            lids = float(np.linalg.norm(larger.opening) + np.linalg.norm(smaller.opening))
            if lids > LARGE_OPENING * areas[np.unique(np.concatenate([larger.parts, smaller.parts]))].sum():
                # the area of the strip, estimated from both rims, and how straight it continues the surface, −1 to 1
                (area, onward), (other_area, back) = _strip_areas(larger, smaller), _strip_areas(smaller, larger)
                straight = (onward + back) / max(area + other_area, 1e-300)
                same_part = len(np.unique(np.concatenate([larger.parts, smaller.parts]))) == 1
                # rims of one part around each other, as of half a ring, have lids that would fill its hole
                if area + other_area <= 2 * lids * (1 + straight if same_part else NARROW + (1 - NARROW) * straight):
                    widths.append(((area + other_area) / lids, i, j))
    best: list[tuple[int, int]] = []
    paired: set[int] = set()
    for _, i, j in sorted(widths):
        if not {i, j} & paired:
            best.append((i, j))
            paired |= {i, j}
    return best


def _strip_areas(rim: Rim, other: Rim) -> tuple[float, float]:
    """Estimate two areas of a strip from a rim to another one: its own, and that by which it continues the surface.

    The own area is the sum over edges of the rim of length times distance to the other rim. The second takes instead
    the part of that way along `Rim.onward`, so it is negative if the strip leads back over the surface.
    """
    edges = np.roll(rim.smooth, -1, axis=0) - rim.smooth
    lengths, points = np.linalg.norm(edges, axis=1), other.smooth
    tangents = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    chords = np.linalg.norm(tangents, axis=1)
    tangents /= np.maximum(chords, 1e-300)[:, None]
    middles = rim.smooth + 0.5 * edges
    nearest = PointTree(points).query(middles)[1]
    # the way to the other rim leads to the nearest of its points, or to a place beside it along its tangent
    across = points[nearest] - middles
    beside = np.clip((across * tangents[nearest]).sum(axis=1), -chords[nearest], chords[nearest])
    across -= beside[:, None] * tangents[nearest]
    onward = (across * rim.onward[rim.beside]).sum(axis=1)
    return float(lengths @ np.linalg.norm(across, axis=1)), float(lengths @ onward)


def strip(first: Rim, second: Rim) -> Ints:
    """(k, 3) vertices of triangles that join two rims all around; they run opposite ways."""
    away, nearest = PointTree(second.corners).query(first.corners)
    start = int(np.argmin(away))
    i = (start + np.arange(len(first.ids) + 1)) % len(first.ids)
    j = (nearest[start] - np.arange(len(second.ids) + 1)) % len(second.ids)
    return _zipped(first.ids[i], first.corners[i], second.ids[j], second.corners[j])


def _zipped(first_ids: Ints, first_points: Floats, second_ids: Ints, second_points: Floats) -> Ints:
    """(k, 3) vertices of triangles between two chains of vertices, which use the shorter diagonal each time.

    Each chain has ids and positions. Faces run along the first chain, and against the second.
    """
    a, b, triangles = 0, 0, []
    while a < len(first_ids) - 1 or b < len(second_ids) - 1:
        if b == len(second_ids) - 1 or (
            a < len(first_ids) - 1
            and np.linalg.norm(first_points[a + 1] - second_points[b])
            <= np.linalg.norm(first_points[a] - second_points[b + 1])
        ):
            triangles.append((first_ids[a], first_ids[a + 1], second_ids[b]))
            a += 1
        else:
            triangles.append((first_ids[a], second_ids[b + 1], second_ids[b]))
            b += 1
    faces = np.array(triangles)
    return np.asarray(faces[has_three_corners(faces)])
