"""Polylines assembled from segments, and the regions that closed outlines in the plane fill."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..packages import lazy_module
from ..validation import chosen
from .box_tree import BoxTree
from .triangles import AREA_ROUNDING
from .welding import ONE_PLACE, welded

manifold3d: Any = lazy_module("manifold3d", "drawings of closed outlines")

FillRule: TypeAlias = Literal["nonzero", "evenodd"]
"""Rule for the region that outlines fill, the points whose winding number is not zero, or is odd."""


def assemble_polylines(tails: Ints, heads: Ints, directed: bool = True) -> list[tuple[Ints, Bools, bool]]:
    """Join segments, given by their tails and heads, end to end into polylines.

    They end at nodes at which not exactly two segments meet. If `directed`, one of the two must arrive and the other
    leave. Returns for each polyline its segments in order, for each of these whether it runs from head to tail, and
    whether the polyline is closed.
    """
    nodes, ends = np.unique(np.concatenate([tails, heads]), return_inverse=True)
    (tails, heads), n = ends.reshape(2, -1), len(nodes)
    leaving, arriving = np.bincount(tails, minlength=n), np.bincount(heads, minlength=n)
    through = (leaving == 1) & (arriving == 1) if directed else leaving + arriving == 2
    segments_at: list[list[int]] = [[] for _ in range(n)]
    for segment, (tail, head) in enumerate(zip(tails.tolist(), heads.tolist(), strict=True)):
        segments_at[tail].append(segment)
        if not directed:
            segments_at[head].append(segment)
    used = np.zeros(len(tails), dtype=bool)

    def walk(segment: int, start: int) -> tuple[list[int], list[bool], int]:
        """Follow segments from a node; return them, whether each runs backwards, and the last node."""
        order, backwards, node = [], [], start
        while True:
            used[segment] = True
            order.append(segment)
            backwards.append(bool(tails[segment] != node))
            node = int(tails[segment] if backwards[-1] else heads[segment])
            onward = [s for s in segments_at[node] if not used[s]] if through[node] else []
            if not onward:
                return order, backwards, node
            segment = onward[0]

    polylines = []
    for pass_through in (False, True):  # first from ends and junctions; the segments left form loops
        for segment in range(len(tails)):
            start = int(tails[segment])
            if not directed and not pass_through and through[start]:
                start = int(heads[segment])
            if used[segment] or (not pass_through and through[start]):
                continue
            order, backwards, end = walk(segment, start)
            polylines.append((np.array(order), np.array(backwards), end == start))
    return polylines


def leaving(points: Floats, closed: bool, room: Floats) -> Ints:
    """Return the indices of the points of a polyline that are farther than their `room`, (n,), from the next point.

    The last point of an open polyline is always among them.
    """
    moves = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) > room
    if not closed:
        moves[-1] = True
    return np.flatnonzero(moves)


def filled_outlines(outlines: Sequence[Floats], rule: FillRule) -> list[Floats]:
    """Return the outlines of the region that closed outlines, (n, 2) points each, fill by a rule.

    They run clockwise, and around holes counter-clockwise. With "nonzero", an outline inside another is a hole if it
    runs in the opposite direction. Apart from that, directions do not matter.
    """
    chosen(rule, FillRule, "fill")
    points = np.concatenate([np.empty((0, 2)), *outlines])
    if not len(points):
        return []
    lower, upper = points.min(axis=0), points.max(axis=0)
    center = 0.5 * (lower + upper)
    # manifold3d rounds coordinates to 1e-8
    scale = float(np.ldexp(2.0**30, -int(np.frexp((upper - lower).max())[1])))
    scaled = [scale * (outline - center) for outline in outlines]
    if rule == "evenodd":
        region = manifold3d.CrossSection(scaled, manifold3d.FillRule.EvenOdd)
    else:
        region = _united(scaled)
    polygons = [polygon[::-1] / scale + center for polygon in region.to_polygons()]
    return [polygon for polygon in polygons if np.ptp(polygon, axis=0).any()]  # a point remains where outlines touch


def rounding_in_plane(segments: Floats) -> float:
    """Return the distance up to which only rounding keeps points on (m, 2, 2) segments apart."""
    points = segments.reshape(-1, 2)
    size, largest = float(np.ptp(points, axis=0).max(initial=0.0)), float(np.abs(points).max(initial=0.0))
    return max(1e-12 * size, ONE_PLACE * float(np.spacing(largest)))


def without_seams(segments: Floats) -> Floats:
    """Cut (k, 2, 2) segments of outlines where corners lie on them, and leave out parts that others run along reversed.

    Returns (j, 2, 2) segments.
    """
    # where outlines share a line, the boundary of the filled region runs along it there and back, up to rounding
    places = np.pad(segments.reshape(-1, 2), ((0, 0), (0, 1)))
    if not np.ptp(places, axis=0).any():
        return segments
    near = rounding_in_plane(segments)
    first, ends = np.unique(welded(places, near), return_inverse=True)
    ends = ends.reshape(-1, 2)
    # the corners that lie on each segment, in order along it
    in_space, (tails, heads) = places[first], ends[ends[:, 0] != ends[:, 1]].T
    corners = in_space[:, :2]
    start, step = corners[tails], corners[heads] - corners[tails]
    lengths = np.linalg.norm(step, axis=1)
    begins, touched = BoxTree.of(in_space, in_space).meeting(in_space[np.stack([tails, heads, heads], axis=1)], near)
    owners = np.repeat(np.arange(len(tails)), np.diff(begins))
    away, along = corners[touched] - start[owners], step[owners] / lengths[owners, None]
    share, off = (away * along).sum(axis=1), np.abs(along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0])
    on = (off <= near) & (share >= -near) & (share <= lengths[owners] + near)
    order = np.flatnonzero(on)[np.lexsort((share[on], owners[on]))]
    goes_on = np.diff(owners[order]) == 0
    parts = np.stack([touched[order][:-1], touched[order][1:]], axis=1)[goes_on]
    # parts that run there and back cancel
    pairs, pair = np.unique(np.sort(parts, axis=1), axis=0, return_inverse=True)
    net = np.bincount(pair.ravel(), np.where(parts[:, 0] < parts[:, 1], 1, -1), len(pairs))
    kept = np.where(net[:, None] < 0, pairs[:, ::-1], pairs)[net != 0]
    return corners[kept]


def _united(outlines: list[Floats]) -> Any:
    """Return the region that outlines, (k, 2) each, fill by the rule "nonzero" if all outermost ones run the same way.

    It is a `CrossSection` of manifold3d. Outlines inside another are flipped together with it.
    """
    nonzero = manifold3d.FillRule.NonZero
    # the outermost outline around each, if some run clockwise and some do not
    parts = [manifold3d.CrossSection([outline], nonzero) for outline in outlines]
    boxes = np.array([[outline.min(axis=0), outline.max(axis=0)] for outline in outlines])
    runs_back = np.array([_doubled_area(outline) < 0 for outline in outlines])
    areas, outermost = np.array([part.area() for part in parts]), np.arange(len(parts))
    by_size = np.argsort(-areas, kind="stable")
    for index, inner in enumerate(by_size) if runs_back.any() and not runs_back.all() else ():
        larger = by_size[:index][areas[by_size[:index]] > (1 + AREA_ROUNDING) * areas[inner]]
        around = ((boxes[larger, 0] <= boxes[inner, 0]) & (boxes[larger, 1] >= boxes[inner, 1])).all(axis=1)
        for outer in larger[around]:
            if (parts[inner] - parts[outer]).area() <= AREA_ROUNDING * areas[inner]:
                outermost[inner] = outermost[outer]
                break
    turned = runs_back != runs_back[outermost]  # `to_polygons` makes each counter-clockwise: holes are reversed again
    polygons = [
        polygon[:: -1 if turn else 1]
        for part, turn in zip(parts, turned, strict=True)
        for polygon in part.to_polygons()
    ]
    return manifold3d.CrossSection(polygons, nonzero)


def _doubled_area(outline: Floats) -> float:
    """Return twice the signed area that an outline, (n, 2) points, encloses; positive if it runs counter-clockwise."""
    x, y = (outline - outline[0]).T
    return float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)
