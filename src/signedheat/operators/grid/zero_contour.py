"""Distance to the zero set of an array: of a smooth function, of one with edges, or of nothing but signs.

The zero set is the contour of values that are linear along the edges of the grid. A crossing of the contour with an
edge is smooth where the next ones lie on the paraboloid that the values say touches there: from such crossings distance
is that to the touching circle. From all others it is that to the triangles of the contour.

Arrays have four axes, of which the first ones are unused in fewer dimensions; positions are in units of length.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ...compiled import compiled
from ...geometry.components import grouped, members_of
from ...geometry.nearest import foot_on_triangle, triangle_rows
from ...packages import lazy_module
from .closest_points import circle_distance, crossed_edges, crossings_at, nearest_tiles, seed_edge_ends
from .stencil import by_slabs
from .wavefront import padded_shape, sweep_lines

measure: Any = lazy_module("skimage.measure", "contours")

SMOOTHING = 1.0
"""Standard deviation, in cells, of the Gaussian that smooths arrays of signs. Of balls, half spaces and boxes, 24 to 96
nodes wide, distances come out best with .7 to 1; more rounds the edges of boxes."""
LEAST, MOST = 0.3, 0.6
"""Between these a smoothed sign is kept, so that contours cross the middle third of an edge: signs contain no more.
With the middle three fifths balls and half spaces come out a tenth better, and boxes a tenth worse."""
UNEVEN = 0.05
"""Cells by which crossings may lie off the paraboloid of the next where the zero set is smooth. Of balls of four cells'
radius, distances are .04 cells off at the most, with .1 by .01; of clipped ones .07 and .12."""
AT_NODE = 1e-6
"""Cells from a node within which all crossings are in one place. A walk from one to the next, which needs ways that
become shorter, is lost in less than the root of the rounding error, 1e-8."""


class Contour(NamedTuple):
    """The zero set of an array.

    Attributes
    ----------
    edges : (e, 5) int
        Node (4 indices) and axis of each edge that it crosses.
    zeros : (c − e, 4) int
        Nodes that are zero, without a negative neighbor: they count as crossings, behind the others.
    points : (c, 4) float
        The crossings: where smooth on the zero set of the cubic interpolant, else of values linear along edges.
    curved : (c, 18) float
        Crossings, normals and shape operators of the cubic interpolant: see `crossings_at`.
    smooth : (c,) bool
        Whether these hold.
    rows : (m, 16) float
        Triangles, for `foot_on_triangle`: axes 1 to 3.
    corners : (m, 3) int
        Crossings at the corners of each triangle; −1 for such as are on no edge of the array.
    starts, around : (c + 1,), (k,) int
        The triangles at each crossing, and at others in the same place: where they begin, and the triangles.
    reach : float
        No point of the zero set is farther from its nearest crossing.
    """

    edges: NDArray[np.int32]
    zeros: NDArray[np.int64]
    points: NDArray[np.float64]
    curved: NDArray[np.float64]
    smooth: NDArray[np.bool_]
    rows: NDArray[np.float64]
    corners: NDArray[np.int64]
    starts: NDArray[np.int64]
    around: NDArray[np.int64]
    uneven: float
    reach: float


def smoothed_signs(signs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values with the given signs, ±1, whose contour is smoother.

    Examples
    --------
    >>> smoothed_signs(np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])).round(2).tolist()
    [-0.6, -0.6, -0.4, 0.4, 0.6, 0.6]
    """
    agreement = scipy.ndimage.gaussian_filter(signs, SMOOTHING, mode="nearest") * signs
    return signs * np.clip(agreement, LEAST, MOST)


def zero_contour(
    values: NDArray[np.float64], steps: NDArray[np.float64], solid: NDArray[np.bool_] | None = None
) -> Contour:
    """The zero set of an array with one to four axes; zero counts as positive. On four it is smooth, without triangles.

    Steps along unused axes are 1. Solid nodes have no value: only crossings between two others count.
    """
    unused = 4 - values.ndim
    field = np.ascontiguousarray(values).reshape(padded_shape(values.shape))
    if values.ndim == 4:
        return _of_crossings(field, steps, solid)
    vertices, faces, edges, numbers = _marched(values, solid)
    zeros = np.pad(_lone_zeros(values, solid), ((0, 0), (unused, 0)))
    crossings = vertices[numbers >= 0]
    triangles = np.concatenate([vertices[faces], np.repeat(zeros[:, None, 1:], 3, axis=1)]) * steps[1:]
    alone = np.full((len(zeros), 3), -1)
    alone[:, 0] = np.arange(len(edges), len(edges) + len(zeros))
    corners = np.concatenate([numbers[faces], alone])
    around, where = np.nonzero(corners >= 0)
    at = corners[around, where]
    cells = np.concatenate([np.pad(crossings, ((0, 0), (1, 0))), zeros])
    places = _places(cells)
    of_crossings, members = members_of(*grouped(places[at], len(cells)), places)
    starts = np.searchsorted(of_crossings, np.arange(len(cells) + 1))
    linear = cells * steps
    curved, smooth = np.zeros((len(linear), 18)), np.zeros(len(linear), dtype=np.bool_)
    curved[: len(edges)] = crossings_at(field, edges, steps)
    pairs = np.concatenate([corners[:, [k, k - 1]] for k in range(3)])
    uneven = _unevenness(curved[: len(edges)], linear[: len(edges)], pairs[(pairs >= 0).all(axis=1)])
    least = UNEVEN * float(steps[unused:].min())
    smooth[: len(edges)] = uneven <= least
    points = np.where(smooth[:, None], curved[:, :4], linear)
    rows = triangle_rows(triangles.reshape(-1, 9))
    return Contour(
        edges,
        zeros,
        points,
        curved,
        smooth,
        rows,
        corners,
        starts,
        around[members],
        least,
        float(np.linalg.norm(steps[unused:])),
    )


def _of_crossings(field: NDArray[np.float64], steps: NDArray[np.float64], solid: NDArray[np.bool_] | None) -> Contour:
    """The zero set of an array with four axes."""
    edges = crossed_edges(field)
    if solid is not None:
        ends = edges[:, :4] + np.eye(4, dtype=np.int32)[edges[:, 4]]
        edges = edges[~solid[tuple(edges[:, :4].T)] & ~solid[tuple(ends.T)]]
    curved, reach = crossings_at(field, edges, steps), float(np.linalg.norm(steps))
    smooth, starts = np.ones(len(edges), dtype=np.bool_), np.zeros(len(edges) + 1, dtype=np.int64)
    none, rows = np.empty((0, 4), dtype=np.int64), np.empty((0, 16))
    points = curved[:, :4].copy()
    return Contour(edges, none, points, curved, smooth, rows, none[:, :3].copy(), starts, none[:, 0].copy(), 0.0, reach)


def _marched(
    values: NDArray[np.float64], solid: NDArray[np.bool_] | None
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """Vertices, in cells, and triangles; the edges that the array's crossings are on; their numbers by vertex, or −1.

    Marching cubes (Lewiner et al. 2003) decides how crossings are connected, by values that are compressed, so that
    the edge of every crossing can be read off. Arrays with fewer than three axes are repeated along axes before theirs.
    """
    unused = 3 - values.ndim
    if not ((values < 0).any() and (values >= 0).any()):
        return np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty((0, 5), np.int32), np.empty(0, np.int64)
    size = np.abs(values)
    compressed = np.where(values < 0, -1.0, 1.0) * (1.0 + size / (size + np.median(size[size > 0])))
    found = measure.marching_cubes(np.broadcast_to(compressed, (2,) * unused + values.shape), 0.0)
    vertices, faces = found[0].astype(np.float64), found[1].astype(np.int64)
    nodes = np.floor(vertices).astype(np.int64)
    along = vertices - nodes > 0.1  # compressed values cross edges from a third to two thirds
    axes, on_edge = along.argmax(axis=1), along.sum(axis=1) == 1
    ends = nodes.copy()
    ends[np.arange(len(ends)), axes] += 1
    here, there = (size[tuple(at[on_edge, unused:].T)] for at in (nodes, ends))
    largest = np.maximum(here, there)
    vertices[on_edge] = nodes[on_edge]
    vertices[on_edge, axes[on_edge]] += here / largest / (here / largest + there / largest)
    if not on_edge.all():
        _between_others(vertices, faces, ~on_edge)
    if solid is not None:
        on_edge &= ~solid[tuple(nodes[:, unused:].T)] & ~solid[tuple(ends[:, unused:].T)]
    own = on_edge & (nodes[:, :unused] == 0).all(axis=1) & (axes >= unused)
    numbers = np.where(own, np.cumsum(own) - 1, -1)
    edges = np.column_stack([np.zeros(len(nodes)), nodes, axes + 1])[own].astype(np.int32)
    return vertices, faces, edges, numbers


def _places(cells: NDArray[np.float64]) -> NDArray[np.int64]:
    """(c,) one number for all crossings at a node that is zero, or nearly: triangles between them have no area."""
    rounded = np.rint(cells)
    apart = (np.abs(cells - rounded) > AT_NODE).any(axis=1)
    result: NDArray[np.int64] = np.arange(len(cells))
    if not apart.all():
        _, first, which = np.unique(rounded[~apart], axis=0, return_index=True, return_inverse=True)
        result[~apart] = np.flatnonzero(~apart)[first][which.ravel()]
    return result


def _between_others(vertices: NDArray[np.float64], faces: NDArray[np.int64], chosen: NDArray[np.bool_]) -> None:
    """Move vertices amid those that they share triangles with."""
    sums, counts = np.zeros_like(vertices), np.zeros(len(vertices))
    for k in range(3):
        for other in (k - 1, k - 2):
            tail, head = faces[:, k], faces[:, other]
            joined = chosen[tail] & ~chosen[head]
            np.add.at(sums, tail[joined], vertices[head[joined]])
            np.add.at(counts, tail[joined], 1.0)
    vertices[counts > 0] = sums[counts > 0] / counts[counts > 0, None]


def _lone_zeros(values: NDArray[np.float64], solid: NDArray[np.bool_] | None) -> NDArray[np.int64]:
    """(k, d) nodes whose value is zero, with no negative one before or behind them."""
    if not (values == 0).any():
        return np.empty((0, values.ndim), dtype=np.int64)
    around = scipy.ndimage.generate_binary_structure(values.ndim, 1)
    negative = values < 0 if solid is None else (values < 0) & ~solid
    alone = (values == 0) & ~scipy.ndimage.binary_dilation(negative, around)
    return np.argwhere(alone if solid is None else alone & ~solid)


def _unevenness(
    curved: NDArray[np.float64], linear: NDArray[np.float64], pairs: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(e,) how far each crossing moves, and how far those it is joined to lie off its paraboloid, at the most."""
    uneven: NDArray[np.float64] = np.linalg.norm(curved[:, :4] - linear, axis=1)
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    away, height, at = curved[other, :4] - curved[one, :4], np.zeros(len(one)), 8
    for d in range(4):
        height += away[:, d] * curved[one, 4 + d]
        for f in range(d + 1):
            height += (1.0 if f < d else 0.5) * away[:, d] * away[:, f] * curved[one, at]
            at += 1
    np.maximum.at(uneven, one, np.abs(height))
    return uneven


def nearest_crossings(contour: Contour, shape: tuple[int, ...], steps: NDArray[np.float64]) -> NDArray[np.int32]:
    """(*shape) the crossing that is nearest to each node, or nearly (Danielsson 1980); four axes."""
    nearest, squares = np.full(shape, -1, dtype=np.int32), np.full(shape, np.inf, dtype=np.float32)
    points = contour.points.astype(np.float32)
    seed_edge_ends(nearest, squares, contour.edges, points, steps, 0)
    zeros = tuple(contour.zeros.T)
    nearest[zeros], squares[zeros] = np.arange(len(contour.edges), len(points)), 0.0
    sweep_lines(nearest_tiles, shape, 1, nearest, squares, points, steps)
    return nearest


def moved(contour: Contour, way: NDArray[np.float64]) -> Contour:
    """The same in another place, (4,) `way` from there; its edges and zeros stay numbered as they are."""
    curved, rows = contour.curved.copy(), contour.rows.copy()
    curved[:, :4] += way
    rows[:, :3] += way[1:]
    return contour._replace(points=contour.points + way, curved=curved, rows=rows)


def distances_to_contour(
    contour: Contour, nearest: NDArray[np.int32], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(*shape) distance of each node to the zero set around a crossing; four axes. `nearest` becomes more exact."""
    distances = np.empty(nearest.shape)
    by_slabs(nearest.shape, _distances, contour, nearest, steps, distances)
    return distances


@compiled
def _distances(
    contour: Contour,
    nearest: NDArray[np.int32],
    steps: NDArray[np.float64],
    out: NDArray[np.float64],
    axis: int,
    start: int,
    stop: int,
) -> None:
    """Walk to the nearest crossing of each node, and measure from there."""
    n0, n1, n2, n3 = nearest.shape
    place, away, room = np.empty(4), np.empty(4), np.empty(4)
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                for m in range(n3):
                    place[0], place[1], place[2], place[3] = i * steps[0], j * steps[1], k * steps[2], m * steps[3]
                    crossing = nearer_crossing(contour, nearest[i, j, k, m], place)
                    nearest[i, j, k, m] = crossing
                    out[i, j, k, m] = distance_around(contour, crossing, place, away, room)


@compiled
def nearer_crossing(contour: Contour, crossing: int, place: NDArray[np.float64]) -> int:
    """The crossing at the end of a walk along the contour, each step of which leads nearer to a place."""
    least, found = np.inf, np.int64(crossing)
    while found >= 0:
        crossing, found = found, np.int64(-1)
        for at in range(contour.starts[crossing], contour.starts[crossing + 1]):
            for corner in range(3):
                other = contour.corners[contour.around[at], corner]
                if other >= 0:
                    square = 0.0
                    for d in range(4):
                        square += (contour.points[other, d] - place[d]) ** 2
                    if square < least:
                        least, found = square, other
    return crossing


@compiled
def distance_around(
    contour: Contour, crossing: int, place: NDArray[np.float64], away: NDArray[np.float64], room: NDArray[np.float64]
) -> float:
    """Distance of a place to the zero set around a crossing; two arrays of four numbers are overwritten.

    The nearest triangle is sought around the crossing, then around the corners of the nearest that was found.
    """
    square, nearest, found = np.inf, np.int64(-1), np.int64(-1)
    for at in range(contour.starts[crossing], contour.starts[crossing + 1]):
        to_triangle, _, _, _, _ = foot_on_triangle(contour.rows, contour.around[at], place[1], place[2], place[3])
        if to_triangle < square:
            square, nearest = to_triangle, contour.around[at]
    while nearest != found:
        found = nearest
        for corner in range(3):
            other = contour.corners[found, corner]
            if other >= 0 and other != crossing:
                for at in range(contour.starts[other], contour.starts[other + 1]):
                    to_triangle, _, _, _, _ = foot_on_triangle(
                        contour.rows, contour.around[at], place[1], place[2], place[3]
                    )
                    if to_triangle < square:
                        square, nearest = to_triangle, contour.around[at]
    distance = np.sqrt(square)
    if contour.smooth[crossing]:
        for d in range(4):
            away[d] = place[d] - contour.curved[crossing, d]
        curved = circle_distance(contour.curved[crossing], away, room, contour.reach)
        distance = curved if nearest < 0 else min(max(curved, distance - contour.uneven), distance + contour.uneven)
    return float(distance)
