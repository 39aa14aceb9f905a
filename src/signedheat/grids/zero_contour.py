"""Distance to the zero set of an array: of a smooth function, of one with edges, or of nothing but signs.

The zero set is the contour of values that are linear along the edges of the grid, and distance is that to the contour's
triangles. A crossing of the contour with an edge is smooth where the next ones lie on the paraboloid that the values
say touches there: around such crossings distance is that to the touching circle.

Arrays have four axes, of which the first ones are unused in fewer dimensions; positions are in units of length.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ..compiled import compiled
from ..packages import lazy_module
from ..parallel import in_chunks
from ..search.face_features import FaceFeatures
from ..search.face_tree import FaceTree
from .closest_points import circle_distance, crossed_edges, crossings_at
from .wavefront import padded_shape

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


class Contour(NamedTuple):
    """The zero set of an array.

    Attributes
    ----------
    vertices, faces : (v, 3) float, (m, 3) int
        The contour of values that are linear along edges: axes 1 to 3. None in four dimensions.
    numbers : (v,) int
        The crossing at each vertex; −1 at such as are on no edge of the array.
    zeros : (k, 3) float
        Nodes that are zero, without a negative neighbour.
    curved : (c, 18) float
        Crossings, normals and shape operators of the cubic interpolant: see `crossings_at`.
    points : (c, 4) float
        The crossings: where smooth on the zero set of the cubic interpolant, else of values linear along edges.
    smooth : (c,) bool
        Whether the interpolant tells distance around a crossing.
    uneven : float
        How much distance to the interpolant may differ from that to the triangles.
    reach : float
        No point of the zero set is farther from its nearest crossing.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    numbers: NDArray[np.int64]
    zeros: NDArray[np.float64]
    curved: NDArray[np.float64]
    points: NDArray[np.float64]
    smooth: NDArray[np.bool_]
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


def zero_contour(values: NDArray[np.float64], steps: NDArray[np.float64]) -> Contour:
    """The zero set of an array with one to four axes; zero counts as positive. On four it is smooth, without triangles.

    Steps along unused axes are 1.
    """
    unused = 4 - values.ndim
    field = np.ascontiguousarray(values).reshape(padded_shape(values.shape))
    reach = float(np.linalg.norm(steps[unused:]))
    if values.ndim == 4:
        curved = crossings_at(field, crossed_edges(field), steps)
        smooth, none = np.ones(len(curved), dtype=np.bool_), np.empty((0, 3))
        ids = none.astype(np.int64)
        return Contour(none, ids, ids[:, 0], none, curved, curved[:, :4].copy(), smooth, 0.0, reach)
    vertices, faces, edges, first, numbers = _marched(values)
    vertices *= steps[1:]
    curved = crossings_at(field, edges, steps)
    linear = np.pad(vertices[first], ((0, 0), (1, 0)))
    linear[:, :unused] = 0.0
    corners = numbers[faces]
    pairs = np.concatenate([corners[:, [k, k - 1]] for k in range(3)])
    uneven = _unevenness(curved, linear, pairs[(pairs >= 0).all(axis=1)])
    least = UNEVEN * float(steps[unused:].min())
    smooth = uneven <= least
    points = np.where(smooth[:, None], curved[:, :4], linear)
    zeros = np.pad(_lone_zeros(values), ((0, 0), (3 - values.ndim, 0))) * steps[1:]
    return Contour(vertices, faces, numbers, zeros, curved, points, smooth, least, reach)


def distances_to(contour: Contour, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) distances of (n, 4) places to the zero set, without sign."""
    if not len(contour.vertices) and len(contour.points):  # four axes
        nearest = scipy.spatial.cKDTree(contour.points).query(places, workers=-1)[1]
        return _around_crossings(contour, nearest, places)
    distances = np.full(len(places), np.inf)
    if len(contour.faces):
        features = FaceFeatures.of(contour.vertices, contour.faces)
        tree, corners = FaceTree.of(features), contour.numbers[contour.faces[features.ids]]

        def measured(some: NDArray[np.float64]) -> tuple[NDArray[np.float64]]:
            faces, squares = tree.nearest(np.ascontiguousarray(some[:, 1:]))
            return (_around(contour, corners[faces], squares, some),)

        distances = in_chunks(measured, places)[0]
    if len(contour.zeros):
        to_zeros = scipy.spatial.cKDTree(contour.zeros).query(places[:, 1:], workers=-1)[0]
        distances = np.minimum(distances, to_zeros)
    return distances


@compiled
def _around(
    contour: Contour, corners: NDArray[np.int64], squares: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) distances to triangles of (n, 3) corners, given squared; where smooth, those to the interpolant instead."""
    result, away, room = np.empty(len(places)), np.empty(4), np.empty(4)
    for i in range(len(places)):
        distance, least, crossing = np.sqrt(squares[i]), np.inf, -1
        for k in range(3):
            corner = corners[i, k]
            if corner >= 0:
                square = 0.0
                for d in range(4):
                    square += (places[i, d] - contour.points[corner, d]) ** 2
                if square < least:
                    least, crossing = square, corner
        if crossing >= 0 and contour.smooth[crossing]:
            for d in range(4):
                away[d] = places[i, d] - contour.curved[crossing, d]
            curved = circle_distance(contour.curved[crossing], away, room, contour.reach)
            distance = min(max(curved, distance - contour.uneven), distance + contour.uneven)
        result[i] = distance
    return result


@compiled
def _around_crossings(contour: Contour, nearest: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) distances to the interpolant's zero set around the nearest crossings."""
    result, away, room = np.empty(len(places)), np.empty(4), np.empty(4)
    for i in range(len(places)):
        for d in range(4):
            away[d] = places[i, d] - contour.curved[nearest[i], d]
        result[i] = circle_distance(contour.curved[nearest[i]], away, room, contour.reach)
    return result


def _marched(
    values: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices, in cells, and triangles; edges that are crossed, a vertex on each; numbers of edges by vertex, or −1.

    Marching cubes (Lewiner et al. 2003) decides how crossings are connected, by values that are compressed, so that
    the edge of every crossing can be read off. Arrays with fewer than three axes are repeated along axes before theirs.
    """
    unused = 3 - values.ndim
    if not ((values < 0).any() and (values >= 0).any()):
        none = np.empty(0, dtype=np.int64)
        return np.empty((0, 3)), none.reshape(0, 3), np.empty((0, 5), dtype=np.int32), none, none
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
    edges = np.column_stack([np.zeros(len(nodes)), nodes, axes + 1])[on_edge].astype(np.int32)
    edges[:, 1 : 1 + unused] = 0  # copies of one edge
    edges, first, which = np.unique(edges, axis=0, return_index=True, return_inverse=True)
    numbers = np.full(len(vertices), -1)
    numbers[on_edge] = which.ravel()
    return vertices, faces, edges, np.flatnonzero(on_edge)[first], numbers


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


def _lone_zeros(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """(k, d) nodes whose value is zero, with no negative one before or behind them."""
    around = scipy.ndimage.generate_binary_structure(values.ndim, 1)
    return np.argwhere((values == 0) & ~scipy.ndimage.binary_dilation(values < 0, around))


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
