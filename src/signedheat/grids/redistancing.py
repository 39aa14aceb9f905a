"""Signed distance to the zero set of any array: of a smooth function, of one with edges, or of nothing but signs.

The zero set is the contour of values that are linear along the edges of the grid, and distance is that to the contour's
triangles. A crossing of the contour with an edge is smooth where the next ones lie on the paraboloid that the values
say touches there: around such crossings distance is that to the touching circle.

Within, arrays have four axes and vectors four components, of which the first ones are unused in fewer dimensions;
positions are in units of length from the grid's origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..errors import GeometryError, OutsideError
from ..packages import lazy_module
from ..parallel import in_chunks
from ..search.face_features import FaceFeatures
from ..search.face_tree import FaceTree
from ..validation import array_of, flag, numbers, positive_steps
from .wavefront import padded_shape


def redistance(values: ArrayLike, spacing: ArrayLike = 1.0, *, periodic: bool | Sequence[bool] = False) -> Floats:
    """Signed distance of the nodes of a grid to the zero set of an array: of a level set, or of an image of ±1.

    Where the zero set is smooth, distance is of second order, and exact for planes and spheres; at its edges it is
    that to the contour of values that are linear between nodes. An array of two opposite values has the side of each
    node and nothing else: of the contours that separate them so, a smooth one is taken.

    Parameters
    ----------
    values : array with one to four axes
        Positive on one side, negative on the other; zero is on the zero set.
    spacing : float, or one for each axis
        Distance between neighbouring nodes.
    periodic : bool, or one for each axis
        Axes behind whose last node the first comes again.

    Returns
    -------
    array of the same shape
        Distances, with the signs of the values.

    Raises
    ------
    OutsideError
        If the array has no zero set: one sign everywhere.
    GeometryError
        If the array has no axis or more than four, or values that are masked or not finite.

    See Also
    --------
    sharpen : The same for a `GridField`.

    Examples
    --------
    >>> redistance([-1.0, -1.0, 1.0, 1.0], 0.5)
    array([-0.75, -0.25,  0.25,  0.75])
    >>> redistance([[-8.0, -2.0, 4.0], [-8.0, -2.0, 4.0]], [2, 3]).round(9)
    array([[-4., -1.,  2.],
           [-4., -1.,  2.]])
    """
    if np.ma.is_masked(values):
        raise GeometryError(
            "distance does not go round masked nodes",
            remedy="fill them in, or use scikit-fmm, whose distance does",
            element="values",
        )
    read = array_of(np.ma.getdata(values) if np.ma.isMaskedArray(values) else values, "values")
    given = numbers(read, "values")
    if not 1 <= given.ndim <= 4 or given.size < 2:
        raise GeometryError(f"values must have one to four axes, and two nodes, not {given.shape}", element="values")
    if read.dtype == np.bool_:
        raise GeometryError("booleans have no sign", remedy="pass numpy.where(inside, -1.0, 1.0)", element="values")
    steps, again = positive_steps(spacing, given.ndim), _axes(periodic, given.ndim)
    if not np.isfinite(given).all():
        raise GeometryError("values must be finite", remedy="fill in those that are not", element="values")
    largest = float(np.abs(given).max())
    scaled = given / largest if largest > 0 else given
    pads = np.where(again, np.array(given.shape) // 2 + 2, 0)
    whole = np.pad(scaled, np.stack([pads, pads], axis=1), mode="wrap")
    wide = np.array(whole.shape) > 1
    distances = _distances(whole.squeeze(), steps[wide], pads[wide]).reshape(given.shape)
    return np.where(given == 0, 0.0, np.copysign(distances, given))


def _axes(periodic: bool | Sequence[bool], count: int) -> list[bool]:
    """Whether each axis is periodic."""
    each = [periodic] * count if np.ndim(periodic) == 0 else list(periodic)  # type: ignore[arg-type]
    if len(each) != count:
        raise GeometryError(f"periodic must be one or {count} of True and False, not {periodic!r}", element="periodic")
    return [flag(one, "periodic") for one in each]


def _distances(values: Floats, spacing: Floats, pads: Ints) -> Floats:
    """Distance of each node that is no padding; axes have at least two nodes."""
    signs = values.ndim > 1 and bool((np.abs(values) == 1).all())
    if signs:
        values = smoothed_signs(values)
    scale, unused = float(spacing.max()), 4 - values.ndim
    steps = np.concatenate([np.ones(unused), spacing / scale])
    contour = zero_contour(values, steps)
    if not len(contour.points) and not len(contour.zeros):
        raise OutsideError(
            "the values have one sign everywhere, so there is no zero set to measure distance to",
            remedy="subtract a level; of an image of 0 and 1, for instance, pass 0.5 - image",
            element="values",
        )
    if signs:  # which say nothing of how the zero set bends
        contour = contour._replace(smooth=np.zeros_like(contour.smooth))
    inner = [np.arange(pad, n - pad) * step for pad, n, step in zip(pads, values.shape, steps[unused:], strict=True)]
    places = np.stack(np.meshgrid(*[np.zeros(1)] * unused, *inner, indexing="ij"), axis=-1)
    return scale * distances_to(contour, places.reshape(-1, 4))


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

FLAT = 0.25
"""Radius around a crossing, relative to a cell's diagonal, within which the zero set of signs with four axes is flat.
Of balls and half spaces, 13 to 17 nodes wide, distances come out best with .125 to .25, of boxes with more."""


class Contour(NamedTuple):
    """The zero set of an array."""

    # (v, 3) and (m, 3): the contour of values that are linear along edges: axes 1 to 3. None in four dimensions.
    vertices: Floats
    faces: Ints
    numbers: Ints  # (v,) the crossing at each vertex; −1 at such as are on no edge of the array
    zeros: Floats  # (k, 3) nodes that are zero, without a negative neighbour
    # (c, 18) crossings, normals and shape operators of the cubic interpolant: see `crossings_at`
    curved: Floats
    # (c, 4) the crossings: where smooth on the zero set of the cubic interpolant, else of values linear along edges
    points: Floats
    smooth: Bools  # (c,) whether the interpolant tells distance around a crossing
    uneven: float  # how much distance to the interpolant may differ from that to the triangles
    reach: float  # no point of the zero set is farther from its nearest crossing


def smoothed_signs(signs: Floats) -> Floats:
    """Values with the given signs, ±1, whose contour is smoother.

    Examples
    --------
    >>> smoothed_signs(np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])).round(2).tolist()
    [-0.6, -0.6, -0.4, 0.4, 0.6, 0.6]
    """
    agreement = scipy.ndimage.gaussian_filter(signs, SMOOTHING, mode="nearest") * signs
    return signs * np.clip(agreement, LEAST, MOST)


def zero_contour(values: Floats, steps: Floats) -> Contour:
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


def distances_to(contour: Contour, places: Floats) -> Floats:
    """(n,) distances of (n, 4) places to the zero set, without sign."""
    if not len(contour.vertices) and len(contour.points):  # four axes
        nearest = scipy.spatial.cKDTree(contour.points).query(places, workers=-1)[1]
        return _around_crossings(contour, nearest, places)
    distances = np.full(len(places), np.inf)
    if len(contour.faces):
        features = FaceFeatures.of(contour.vertices, contour.faces)
        tree, corners = FaceTree.of(features), contour.numbers[contour.faces[features.ids]]

        def measured(some: Floats) -> tuple[Floats]:
            faces, squares = tree.nearest(np.ascontiguousarray(some[:, 1:]))
            return (_around(contour, corners[faces], squares, some),)

        distances = in_chunks(measured, places)[0]
    if len(contour.zeros):
        to_zeros = scipy.spatial.cKDTree(contour.zeros).query(places[:, 1:], workers=-1)[0]
        distances = np.minimum(distances, to_zeros)
    return distances


@compiled
def _around(contour: Contour, corners: Ints, squares: Floats, places: Floats) -> Floats:
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
def _around_crossings(contour: Contour, nearest: Ints, places: Floats) -> Floats:
    """(n,) distances to the interpolant's zero set around the nearest crossings; where not smooth, to a flat piece."""
    result, away, room = np.empty(len(places)), np.empty(4), np.empty(4)
    for i in range(len(places)):
        height, square = 0.0, 0.0
        for d in range(4):
            away[d] = places[i, d] - contour.curved[nearest[i], d]
            height += away[d] * contour.curved[nearest[i], 4 + d]
            square += away[d] ** 2
        if contour.smooth[nearest[i]]:
            result[i] = circle_distance(contour.curved[nearest[i]], away, room, contour.reach)
        else:
            beyond = max(0.0, np.sqrt(max(0.0, square - height**2)) - FLAT * contour.reach)
            result[i] = np.sqrt(height**2 + beyond**2)
    return result


def _marched(values: Floats) -> tuple[Floats, Ints, NDArray[np.int32], Ints, Ints]:
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


def _between_others(vertices: Floats, faces: Ints, chosen: Bools) -> None:
    """Move vertices amid those that they share triangles with."""
    sums, counts = np.zeros_like(vertices), np.zeros(len(vertices))
    for k in range(3):
        for other in (k - 1, k - 2):
            tail, head = faces[:, k], faces[:, other]
            joined = chosen[tail] & ~chosen[head]
            np.add.at(sums, tail[joined], vertices[head[joined]])
            np.add.at(counts, tail[joined], 1.0)
    vertices[counts > 0] = sums[counts > 0] / counts[counts > 0, None]


def _lone_zeros(values: Floats) -> Ints:
    """(k, d) nodes whose value is zero, with no negative one before or behind them."""
    around = scipy.ndimage.generate_binary_structure(values.ndim, 1)
    return np.argwhere((values == 0) & ~scipy.ndimage.binary_dilation(values < 0, around))


def _unevenness(curved: Floats, linear: Floats, pairs: Ints) -> Floats:
    """(e,) how far each crossing moves, and how far those it is joined to lie off its paraboloid, at the most."""
    uneven: Floats = np.linalg.norm(curved[:, :4] - linear, axis=1)
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    away, height, at = curved[other, :4] - curved[one, :4], np.zeros(len(one)), 8
    for d in range(4):
        height += away[:, d] * curved[one, 4 + d]
        for f in range(d + 1):
            height += (1.0 if f < d else 0.5) * away[:, d] * away[:, f] * curved[one, at]
            at += 1
    np.maximum.at(uneven, one, np.abs(height))
    return uneven


def crossed_edges(field: Floats) -> NDArray[np.int32]:
    """(e, 5) node (4 indices) and axis of each edge whose two ends have different signs; zero counts as positive."""
    found = [np.argwhere(np.diff(field < 0, axis=axis)) for axis in range(4)]
    return np.concatenate([np.insert(nodes, 4, axis, axis=1) for axis, nodes in enumerate(found)]).astype(np.int32)


@compiled
def _cubic(field: Floats, place: Floats, weights: Floats, gradient: Floats) -> float:
    """Value of the cubic convolution interpolant (Keys 1981) at a position in cells; writes its `gradient`."""
    base = np.empty(4, dtype=np.int64)
    for axis in range(4):
        n = field.shape[axis]
        base[axis] = min(max(np.int64(np.floor(place[axis])), 0), max(n - 2, 0))
        f = place[axis] - base[axis]
        g = 1.0 - f
        for side in range(2):  # weights of the value, and of the derivative
            if n == 1:
                w0, w1, w2, w3 = 0.0, 1.0 - side, 0.0, 0.0
            elif side == 0:
                w0, w3 = -0.5 * f * g * g, -0.5 * f * f * g
                w1, w2 = g * (1.0 + f - 1.5 * f * f), f * (1.0 + g - 1.5 * g * g)
            else:
                w0, w3 = -0.5 * g * (1.0 - 3.0 * f), 0.5 * f * (1.0 - 3.0 * g)
                w1, w2 = f * (4.5 * f - 5.0), -g * (4.5 * g - 5.0)
            if n > 1 and base[axis] == 0:  # linear extrapolation beyond the walls
                w1, w2, w0 = w1 + 2.0 * w0, w2 - w0, 0.0
            if n > 1 and base[axis] == n - 2:
                w2, w1, w3 = w2 + 2.0 * w3, w1 - w3, 0.0
            weights[side, axis, 0], weights[side, axis, 1] = w0, w1
            weights[side, axis, 2], weights[side, axis, 3] = w2, w3
    value = 0.0
    gradient[:] = 0.0
    for i in range(4):
        wi, si = weights[0, 0, i], weights[1, 0, i]
        if wi == 0.0 and si == 0.0:
            continue
        for j in range(4):
            wj, sj = weights[0, 1, j], weights[1, 1, j]
            if wj == 0.0 and sj == 0.0:
                continue
            for k in range(4):
                wk, sk = weights[0, 2, k], weights[1, 2, k]
                if wk == 0.0 and sk == 0.0:
                    continue
                line, slope = 0.0, 0.0
                for m in range(4):
                    if weights[0, 3, m] != 0.0 or weights[1, 3, m] != 0.0:
                        here = field[base[0] + i - 1, base[1] + j - 1, base[2] + k - 1, base[3] + m - 1]
                        line += weights[0, 3, m] * here
                        slope += weights[1, 3, m] * here
                value += wi * wj * wk * line
                gradient[0] += si * wj * wk * line
                gradient[1] += wi * sj * wk * line
                gradient[2] += wi * wj * sk * line
                gradient[3] += wi * wj * wk * slope
    return value


@compiled
def crossings_at(field: Floats, edges: NDArray[np.int32], steps: Floats) -> Floats:
    """(e, 18) position, unit normal and shape operator (symmetric, ten numbers) of the zero set at crossed edges."""
    result = np.zeros((len(edges), 18))
    weights = np.empty((2, 4, 4))
    slope, start, place, ahead, behind = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    bend = np.empty((4, 4))
    for e in range(len(edges)):
        axis = edges[e, 4]
        i, j, k, m = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        here = field[i, j, k, m]
        there = field[i + (axis == 0), j + (axis == 1), k + (axis == 2), m + (axis == 3)]
        for d in range(4):
            start[d] = edges[e, d]
        start[axis] += here / (here - there)
        for d in range(4):
            place[d] = start[d]
        # Newton's method along the gradient, onto the zero set of the interpolant; back to the crossing if it diverges
        for _ in range(3):
            value = _cubic(field, place, weights, slope)
            square, moved = 0.0, 0.0
            for d in range(4):
                slope[d] /= steps[d]
                square += slope[d] ** 2
            for d in range(4):
                if square > 0.0:
                    place[d] -= value * slope[d] / (square * steps[d])
                moved = max(moved, abs(place[d] - start[d]))
                if place[d] < 0.0 or place[d] > field.shape[d] - 1:
                    moved = 2.0
            if not moved < 1.0:
                for d in range(4):
                    place[d] = start[d]
                break
        _cubic(field, place, weights, slope)
        square = 0.0
        for d in range(4):
            slope[d] /= steps[d]
            square += slope[d] ** 2
        length = np.sqrt(square)
        if length == 0.0:
            slope[axis] = 1.0 if there > here else -1.0
            length = 1.0
        for d in range(4):
            result[e, d] = place[d] * steps[d]
            result[e, 4 + d] = slope[d] / length
        # differences of the gradient one cell apart
        for d in range(4):
            for f in range(4):
                ahead[f] = behind[f] = place[f]
                bend[d, f] = 0.0
            ahead[d] = min(place[d] + 1.0, field.shape[d] - 1.0)
            behind[d] = max(place[d] - 1.0, 0.0)
            span = (ahead[d] - behind[d]) * steps[d] * length
            if span > 0.0:
                _cubic(field, ahead, weights, slope)
                for f in range(4):
                    bend[d, f] += slope[f] / steps[f] / span
                _cubic(field, behind, weights, slope)
                for f in range(4):
                    bend[d, f] -= slope[f] / steps[f] / span
        at = 8
        for d in range(4):
            for f in range(d + 1):
                result[e, at] = 0.5 * (bend[d, f] + bend[f, d])
                at += 1
    return result


@compiled
def circle_distance(crossing: Floats, away: Floats, across: Floats, reach: float) -> float:
    """Distance to the touching circle in the plane of a point, `away` from a crossing, and the normal there.

    With s along the normal, r across it and bending k in the direction of r, the distance to the circle of radius 1/k
    is ``(√((1 + ks)² + k²r²) − 1) / k``, here without the cancellation. `across` is room to work in.
    """
    s, square = 0.0, 0.0
    for d in range(4):
        s += away[d] * crossing[4 + d]
        square += away[d] ** 2
    side = 0.0
    for d in range(4):
        across[d] = away[d] - s * crossing[4 + d]
        side += across[d] ** 2
    distance = np.sqrt(square)
    if side > 1e-12 * square:
        bend, at = 0.0, 8
        for d in range(4):
            for f in range(d):
                bend += 2.0 * across[d] * crossing[at] * across[f]
                at += 1
            bend += across[d] ** 2 * crossing[at]
            at += 1
        bend /= side
        root = np.sqrt(max(0.0, 1.0 + 2.0 * bend * s + bend * bend * square))
        if 1.0 + bend * s > 0.0:  # beyond its centre the other side of the circle is nearer, which is no surface
            circle = abs(2.0 * s + bend * square) / (1.0 + root)
            distance = min(distance, max(circle, distance - reach))
    return float(distance)
