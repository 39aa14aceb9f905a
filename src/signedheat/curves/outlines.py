"""Closed outlines in the plane, made of lines that join end to end, and the regions that they fill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..diagnostics import Note
from ..grids.polyline import Polyline
from ..mesh.components import connected_components, grouped
from ..mesh.polylines import FillRule, assemble_polylines, filled_outlines, rounding_in_plane
from ..mesh.triangles import AREA_ROUNDING
from ..mesh.welding import ONE_PLACE

# of each of these three numbers, halved or doubled, none of 40 random drawings changes
WHOLE = 1 / 1024
"""Width of a gap, relative to the length of the shorter line at it or of the chain, up to which lines count as joined
and as closed."""
MOST_MEETING = 12
"""Number of ends of lines that are searched for around each other; more meet if each is near some of the others."""
PROBES = 8
"""Number of points of a line that tell whether it lies inside another."""


@dataclass(frozen=True, eq=False, repr=False)
class OutlinesFilled(Note):
    """Note on filled outlines: the rule, their number, and the fraction of their length that lies inside the region."""

    rule: str
    outlines: int
    length_inside: float
    text: ClassVar[str] = (
        "closed outlines: {0.outlines}, filled by the rule {0.rule}; {0.length_inside:%} of their length lies inside"
    )

    @property
    def important(self) -> bool:
        return self.length_inside > AREA_ROUNDING


def outlines_filled(
    lines: Sequence[Polyline], rule: FillRule, narrow: float
) -> tuple[list[Polyline], list[int], OutlinesFilled | None, Floats]:
    """Replace closed lines by the outlines of the region that they fill; return these first, then the open lines.

    Open lines that close together (`closed_together`), with gaps of up to `narrow`, count as a closed line. Where gaps
    are wider than `WHOLE`, directions do not matter, and an outline inside an odd number of others is a hole.

    The second result has a number for each line, for messages: open lines keep theirs, and outlines get those of closed
    lines, or higher ones if there are more outlines. The third is a note, None if no outline is filled. The last are
    the straight segments that closed gaps wider than rounding, (k, 2, 2).
    """
    outlines = {k: line for k, line in enumerate(lines) if line.closed}
    strokes = distinct({k: line for k, line in enumerate(lines) if not line.closed})
    whole = closed_together(strokes, WHOLE)
    outlines |= {min(chain.members): chain.outline for chain in whole}
    strokes = without_members(strokes, whole)
    nearly = closed_together(strokes, narrow)
    # what lies inside the same rings with gaps is filled by itself: directions say nothing about anything else
    closed = [outlines[k] for k in sorted(outlines)]
    around = np.stack([np.zeros(len(closed), dtype=bool), *(lie_inside(closed, [c.outline]) for c in nearly)], axis=1)
    around, group = np.unique(around, axis=0, return_inverse=True)
    regions = [region_of([closed[k] for k in np.flatnonzero(group.ravel() == g)], rule) for g in range(len(around))]
    filled = [line for region in regions for line in region]
    if nearly:
        turns, holes = turned_by_depth(nearly, regions)
        rings = [c.outline.reversed() if turn else c.outline for c, turn in zip(nearly, turns, strict=True)]
        inner = [line.reversed() if hole else line for line, hole in zip(filled, holes, strict=True)]
        filled = region_of([*rings, *inner], rule)
    outlines |= {min(chain.members): chain.outline for chain in nearly}
    if not filled:
        return list(lines), list(range(len(lines))), None, np.empty((0, 2, 2))
    strokes = without_members(strokes, nearly)
    inner = [lines[k] for chain in (*whole, *nearly) for k in chain.within]
    given, left = (sum(line.length for line in drawn) for drawn in ([*outlines.values(), *inner], filled))
    note = OutlinesFilled(rule, len(outlines), max(0.0, 1.0 - left / given))
    numbers = [*sorted(outlines), *range(len(lines), len(lines) + len(filled))][: len(filled)]
    closing = [c.closing[c.gaps > AREA_ROUNDING * c.outline.length] for c in (*whole, *nearly)]
    across = np.concatenate([np.empty((0, 2, 2)), *closing])
    return [*filled, *strokes.values()], [*numbers, *strokes], note, across


def region_of(outlines: Sequence[Polyline], rule: FillRule) -> list[Polyline]:
    """Return the outlines of the region that closed lines fill by a rule (`filled_outlines`)."""
    return [Polyline(points, closed=True) for points in filled_outlines([line.points for line in outlines], rule)]


def lie_inside(lines: Sequence[Polyline], body: Sequence[Polyline]) -> Bools:
    """Return (n,) whether each of n closed lines lies inside the closed lines of a body, which it may touch.

    Of `PROBES` corners and middles of its segments, those that lie on the body, up to rounding, do not count.
    """
    around = segments_of_lines(body)
    if not len(lines) or not len(around):
        return np.zeros(len(lines), dtype=bool)
    rows = [np.stack([s[:, 0], s.mean(axis=1)], axis=1).reshape(-1, 2) for s in (line.segments for line in lines)]
    rows = [points[np.linspace(0, len(points) - 1, PROBES).astype(np.int64)] for points in rows]
    points = np.concatenate(rows)
    counts = away_from(around, points) > rounding_in_plane(np.concatenate([around, points[:, None].repeat(2, axis=1)]))
    inside, counts = (values.reshape(-1, PROBES) for values in (enclosed(around, points), counts))
    return np.asarray((inside | ~counts).all(axis=1) & counts.any(axis=1))


def turned_by_depth(nearly: Sequence[Chain], regions: Sequence[Sequence[Polyline]]) -> tuple[list[bool], list[bool]]:
    """Say which of k chains, and which outlines of regions, must be reversed to bound something together.

    A chain bounds a filled region inside an even number of others and of regions, and a hole inside an odd number. A
    region, the inside of its outlines, is a hole inside an odd number. The second result has a value for each outline
    of each region, in order.
    """
    bodies = [*([chain.outline] for chain in nearly), *regions]
    owner = np.repeat(np.arange(len(bodies)), [len(body) for body in bodies])
    lines = [line for body in bodies for line in body]
    depths = np.zeros(len(owner), dtype=np.int64)
    for number, body in enumerate(bodies):
        depths += lie_inside(lines, body) & (owner != number)
    is_hole = (depths % 2 == 1).tolist()
    turns = [(chain.outline.signed_area > 0) != hole for chain, hole in zip(nearly, is_hole, strict=False)]
    return turns, is_hole[len(nearly) :]


def without_members(strokes: dict[int, Polyline], joined: Sequence[Chain]) -> dict[int, Polyline]:
    """Return strokes, keyed by number, without those in some chains."""
    members = {k for chain in joined for k in (*chain.members, *chain.within)}
    return {k: line for k, line in strokes.items() if k not in members}


def distinct(strokes: dict[int, Polyline]) -> dict[int, Polyline]:
    """Return strokes, keyed by number, without those that have the same points as an earlier one in either order."""
    first: dict[bytes, int] = {}
    for k, line in strokes.items():
        first.setdefault(min((line.points + 0.0).tobytes(), (line.points[::-1] + 0.0).tobytes()), k)
    return {k: strokes[k] for k in sorted(first.values())}


@dataclass(frozen=True, eq=False)
class Chain:
    """Open lines that join end to end, whatever their directions."""

    members: list[int]  # the k numbers of the lines, in order
    backwards: Bools  # (k,) whether each line runs against the outline
    outline: Polyline  # the lines, closed by a straight segment; it runs as most of their length does
    closing: Floats  # (k, 2, 2) the segment from the end of each line to the beginning of the next
    within: list[int]  # the numbers of lines inside, which end on others on both sides

    @property
    def gaps(self) -> Floats:
        """Lengths of the k gaps; the last is that from the end of the chain to its beginning."""
        return np.linalg.norm(self.closing[:, 1] - self.closing[:, 0], axis=1)

    def encloses(self, width: float) -> bool:
        """Whether the outline encloses more than a line drawn there and back does, that far apart."""
        area = sum(abs(line.signed_area) for line in region_of([self.outline], "nonzero"))
        return area > self.outline.length * max(width, AREA_ROUNDING * self.outline.length)


def closed_together(strokes: dict[int, Polyline], narrow: float) -> list[Chain]:
    """Join open lines to `chains`, and return those whose ends are at most `narrow` times their length apart.

    Those that enclose no more than a line drawn there and back, with gaps as wide as theirs, are left out.
    """
    return [
        chain
        for chain in chains(strokes, narrow)
        if chain.gaps[-1] <= narrow * chain.outline.length and chain.encloses(float(chain.gaps.max()))
    ]


Run: TypeAlias = tuple[Ints, Bools]
"""Indices of lines that follow each other, and whether each runs backwards."""


def reverse(run: Run) -> Run:
    """Return the same lines from last to first."""
    return run[0][::-1], ~run[1][::-1]


def chains(strokes: dict[int, Polyline], narrow: float) -> list[Chain]:
    """Join open lines, keyed by number, end to end; every line is in one chain.

    Two lines meet if the distance between their ends is due to rounding or below `narrow` times the length of the
    shorter line. A chain goes on where two ends meet. Chains that form a network with junctions of more ends are one
    chain, the way round the network; those that lead nowhere stay chains of their own. A chain gets the direction of
    most of its length, or runs counter-clockwise if half of it has either direction.
    """
    numbers, lines = list(strokes), list(strokes.values())
    if not lines:
        return []
    ends = np.concatenate([line.points[[0, -1]] for line in lines])
    lengths = np.repeat([line.length for line in lines], 2)
    rounding = ONE_PLACE * np.spacing(np.abs(ends).max(axis=1))
    room = np.maximum(rounding, narrow * lengths)
    nodes = meeting_places(ends, room).reshape(-1, 2)
    runs = [(k, back) for k, back, _ in assemble_polylines(nodes[:, 0], nodes[:, 1], directed=False)]
    between = np.array([[nodes[k[0], int(back[0])], nodes[k[-1], 1 - int(back[-1])]] for k, back in runs])

    def chain(halfedges: list[int], inner: list[int]) -> Chain:
        """Return the chain of runs, numbered twice, the second number for the way back, with others inside."""
        ways = [reverse(runs[h // 2]) if h % 2 else runs[h // 2] for h in halfedges]
        order, backwards = (np.concatenate(columns) for columns in zip(*ways, strict=True))
        parts = [lines[k].points[:: -1 if back else 1] for k, back in zip(order, backwards, strict=True)]
        outline = Polyline(np.concatenate(parts), closed=True)
        against = float((np.array([lines[k].length for k in order]) * np.where(backwards, 1, -1)).sum())
        is_tie = abs(against) <= AREA_ROUNDING * outline.length
        if outline.signed_area < 0 if is_tie else against > 0:
            order, backwards, outline = order[::-1], ~backwards[::-1], outline.reversed()
            parts = [part[::-1] for part in parts[::-1]]
        closing = np.stack([[part[-1] for part in parts], [part[0] for part in (*parts[1:], parts[0])]], axis=1)
        within = [numbers[k] for run in inner for k in runs[run][0]]
        return Chain([numbers[k] for k in order], backwards, outline, closing, within)

    angles = np.array([_departure(lines, k, back, room) for run in runs for k, back in (run, reverse(run))])
    middle = ends.mean(axis=0)
    swept = np.array(
        [sum(_swept(lines[i].points[:: -1 if b else 1] - middle) for i, b in zip(*run, strict=True)) for run in runs]
    )
    networks = ways_round(between, angles, swept)
    in_network = {run for around, inner in networks for run in (*(h // 2 for h in around), *inner)}
    alone: list[tuple[list[int], list[int]]] = [([2 * k], []) for k in range(len(runs)) if k not in in_network]
    return [chain(around, inner) for around, inner in (*networks, *alone)]


def _swept(points: Floats) -> float:
    """Return twice the area that the ray from the origin to a point sweeps, counter-clockwise, along (n, 2) points."""
    (x, y), (u, v) = points[:-1].T, points[1:].T
    return float(x @ v - y @ u)


def _departure(lines: Sequence[Polyline], order: Ints, backwards: Bools, room: Floats) -> float:
    """Return the angle at which a run of lines departs, farther from its end than the room, (n,), of ends there."""
    points = lines[order[0]].points[:: -1 if backwards[0] else 1]
    steps = points - points[0]
    far = np.linalg.norm(steps, axis=1) > room[2 * order[0]]
    x, y = steps[int(far.argmax())] if far.any() else steps[-1]
    return float(np.arctan2(y, x))


def ways_round(between: Ints, angles: Floats, swept: Floats) -> list[tuple[list[int], list[int]]]:
    """Find the way round each network of e edges in the plane that bounds something.

    `between` are the nodes at both ends of each edge, (e, 2), `angles` the directions in which it leaves its first node
    and its last one, (2 e,), and `swept` twice the area that a ray from the origin to it sweeps, (e,). Edges that lead
    nowhere, and loops, belong to no network. Returns for each network the halfedges on the way round it, 2 i for edge i
    and 2 i + 1 for its way back, and the edges inside.
    """
    used = between[:, 0] != between[:, 1]
    while True:
        degrees = np.bincount(between[used].ravel(), minlength=int(between.max()) + 1)
        leads_on = used & (degrees[between] > 1).all(axis=1)
        if (leads_on == used).all():
            break
        used = leads_on
    tails = between.ravel()
    halfedges = np.flatnonzero(np.repeat(used, 2))
    order = halfedges[np.lexsort([angles[halfedges], tails[halfedges]])]
    starts, members = grouped(tails[order], len(degrees))
    following = np.full(len(tails), -1)
    for node in np.flatnonzero(np.diff(starts)).tolist():
        leaving = order[members[starts[node] : starts[node + 1]]]
        following[leaving ^ 1] = np.roll(leaving, 1)  # the region between these two is to the left of both
    network = connected_components(len(degrees), *between[used].T)[between[:, 0]]
    areas = np.stack([swept, -swept], axis=1).ravel()
    seen = np.zeros(len(tails), dtype=bool)
    best: dict[int, tuple[float, list[int]]] = {}
    for first in halfedges.tolist():
        way, h = [], first
        while not seen[h]:
            seen[h] = True
            way.append(h)
            h = int(following[h])
        area, key = float(areas[way].sum()), int(network[first // 2])
        if way and area < best.get(key, (0.0, []))[0]:  # what lies around all runs clockwise
            best[key] = area, way
    edges = np.flatnonzero(used)
    return [
        (way, np.setdiff1d(edges[network[edges] == key], np.array(way) // 2).tolist()) for key, (_, way) in best.items()
    ]


def meeting_places(ends: Floats, room: Floats) -> Ints:
    """Return (n,) the number of the place of each of (n, 2) ends; two meet if they are within the `room` of both."""
    n = len(ends)
    distances, near = scipy.spatial.cKDTree(ends).query(ends, k=min(MOST_MEETING, n))
    distances, near = distances.reshape(n, -1), near.reshape(n, -1)
    meets = distances <= np.minimum(room[:, None], room[near])
    first, column = np.nonzero(meets)
    return connected_components(n, first, near[first, column])


def segments_of_lines(lines: Sequence[Polyline]) -> Floats:
    """Return the ends of all segments of lines in the plane, line after line, as (m, 2, 2) coordinates."""
    return np.concatenate([np.empty((0, 2, 2)), *(line.segments for line in lines)])


def enclosed(outlines: Floats, points: Floats) -> Bools:
    """Return (n,) bool, true for (n, 2) points from which a ray meets an odd number of (m, 2, 2) segments.

    These points are inside if the segments form closed outlines that do not cross.
    """
    inside = np.zeros(len(points), dtype=bool)
    a, b = outlines.transpose(1, 0, 2)
    step = max(1, 10**6 // max(len(outlines), 1))  # a million pairs at a time
    for begin in range(0, len(points), step):
        x, y = points[begin : begin + step, None].transpose(2, 0, 1)
        spans = (a[:, 1] <= y) != (b[:, 1] <= y)
        turn = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])
        crossed = spans & ((turn > 0) == (b[:, 1] > a[:, 1])) & (turn != 0)
        inside[begin : begin + step] = crossed.sum(axis=1) % 2 == 1
    return inside


def away_from(segments: Floats, points: Floats) -> Floats:
    """Return (n,) distances of (n, 2) points from the nearest of (m, 2, 2) segments."""
    a, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    away = np.full(len(points), np.inf)
    step = max(1, 10**6 // max(len(segments), 1))  # a million pairs at a time
    for begin in range(0, len(points), step):
        off = points[begin : begin + step, None] - a
        off -= np.clip((off * along).sum(axis=2) / squares, 0.0, 1.0)[..., None] * along
        away[begin : begin + step] = np.sqrt((off**2).sum(axis=2).min(axis=1))
    return away
