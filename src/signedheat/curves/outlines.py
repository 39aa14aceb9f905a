"""Closed outlines in the plane, made of lines that join end to end, and the regions that they fill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..diagnostics import Note
from ..grids.polyline import Polyline
from ..mesh.polylines import FillRule, assemble_polylines, filled_outlines
from ..mesh.triangles import AREA_ROUNDING
from ..mesh.welding import ONE_PLACE

WHOLE = 1 / 1024
"""Width of a gap, relative to the length of the shorter line at it or of the chain, up to which lines count as joined
and as closed."""

PROBES = 8
"""Number of points of a line that must lie inside another for the line to count as inside."""


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
    filled = region_of([outlines[k] for k in sorted(outlines)], rule)
    strokes = without_members(strokes, whole)
    nearly = closed_together(strokes, narrow)
    outlines |= {min(chain.members): chain.outline for chain in nearly}
    if nearly:
        turns, holes = turned_by_depth(nearly, filled)
        around = [c.outline.reversed() if turn else c.outline for c, turn in zip(nearly, turns, strict=True)]
        inner = [line.reversed() if hole else line for line, hole in zip(filled, holes, strict=True)]
        filled = region_of([*around, *inner], rule)
    if not filled:
        return list(lines), list(range(len(lines))), None, np.empty((0, 2, 2))
    strokes = without_members(strokes, nearly)
    given, left = sum(line.length for line in outlines.values()), sum(line.length for line in filled)
    note = OutlinesFilled(rule, len(outlines), max(0.0, 1.0 - left / given))
    numbers = [*sorted(outlines), *range(len(lines), len(lines) + len(filled))][: len(filled)]
    closing = [c.closing[c.gaps > AREA_ROUNDING * c.outline.length] for c in (*whole, *nearly)]
    across = np.concatenate([np.empty((0, 2, 2)), *closing])
    return [*filled, *strokes.values()], [*numbers, *strokes], note, across


def region_of(outlines: Sequence[Polyline], rule: FillRule) -> list[Polyline]:
    """Return the outlines of the region that closed lines fill by a rule (`filled_outlines`)."""
    return [Polyline(points, closed=True) for points in filled_outlines([line.points for line in outlines], rule)]


def turned_by_depth(nearly: Sequence[Chain], filled: Sequence[Polyline]) -> tuple[list[bool], list[bool]]:
    """Say which of k chains, and which of m outlines of a region, must be reversed to bound something together.

    A chain bounds a filled region inside an even number of others, and a hole inside an odd number. `filled` bound a
    region already; inside an odd number of chains, that is a hole. `PROBES` points of a line decide what is around it.
    """
    lines = [*(chain.outline for chain in nearly), *filled]
    places = [line.points[np.linspace(0, line.n_points - 1, PROBES).astype(np.int64)] for line in lines]
    points = np.concatenate([np.empty((0, 2)), *places])
    depths = enclosed(segments_of_lines(filled), points).reshape(-1, PROBES).all(axis=1).astype(np.int64)
    depths[len(nearly) :] = 0
    for number, chain in enumerate(nearly):
        within = enclosed(chain.outline.segments, points).reshape(-1, PROBES).all(axis=1)
        within[number] = False
        depths += within
    is_hole = (depths % 2 == 1).tolist()
    turns = [(chain.outline.signed_area > 0) != hole for chain, hole in zip(nearly, is_hole, strict=False)]
    return turns, is_hole[len(nearly) :]


def without_members(strokes: dict[int, Polyline], joined: Sequence[Chain]) -> dict[int, Polyline]:
    """Return strokes, keyed by number, without those in some chains."""
    members = {k for chain in joined for k in chain.members}
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


def chains(strokes: dict[int, Polyline], narrow: float) -> list[Chain]:
    """Join open lines, keyed by number, end to end; every line is in one chain.

    Two lines join if no third line ends there and the distance between their ends is due to rounding or below `narrow`
    times the length of the shorter line. A chain gets the direction of most of its length, or runs counter-clockwise
    if half of it has either direction.
    """
    numbers, lines = list(strokes), list(strokes.values())
    if not lines:
        return []
    ends = np.concatenate([line.points[[0, -1]] for line in lines])
    lengths = np.repeat([line.length for line in lines], 2)
    rounding = ONE_PLACE * np.spacing(np.abs(ends).max(axis=1))
    partner = partners(ends, np.maximum(rounding, narrow * lengths))
    node = np.minimum(np.arange(len(ends)), partner)
    found = []
    for order, backwards, _ in assemble_polylines(node[::2], node[1::2], directed=False):
        parts = [lines[k].points[:: -1 if back else 1] for k, back in zip(order, backwards, strict=True)]
        outline = Polyline(np.concatenate(parts), closed=True)
        against = float((np.array([lines[k].length for k in order]) * np.where(backwards, 1, -1)).sum())
        is_tie = abs(against) <= AREA_ROUNDING * outline.length
        if outline.signed_area < 0 if is_tie else against > 0:
            order, backwards, outline = order[::-1], ~backwards[::-1], outline.reversed()
            parts = [part[::-1] for part in parts[::-1]]
        closing = np.stack([[part[-1] for part in parts], [part[0] for part in (*parts[1:], parts[0])]], axis=1)
        found.append(Chain([numbers[k] for k in order], backwards, outline, closing))
    return found


def partners(ends: Floats, room: Floats) -> Ints:
    """Pair the ends of lines that meet, and return (n,) the index of each end's partner.

    Two of the (n, 2) ends meet if their distance is at most the `room`, (n,), of both. An end that meets none or
    several others is its own partner.
    """
    n = len(ends)
    distances, near = scipy.spatial.cKDTree(ends).query(ends, k=min(3, n))
    others = np.where(near == np.arange(n)[:, None], np.inf, distances)
    if n > 2:  # at a place of several ends, an end itself may not be among the first
        others[~np.isinf(others).any(axis=1), 2] = np.inf
    meets = others <= np.minimum(room[:, None], room[near])
    first = np.where(meets.sum(axis=1) == 1, near[np.arange(n), meets.argmax(axis=1)], np.arange(n))
    mutual = first[first] == np.arange(n)
    return np.where(mutual, first, np.arange(n))


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
