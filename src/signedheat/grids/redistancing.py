"""Signed distance to the zero set of an array, whether it is smooth, has edges, or is known by signs only; sharpening.

The zero set is the contour of values that are linear along the edges of the grid, and distance is measured to its
triangles. A crossing of the contour with an edge is smooth if neighbouring crossings lie on the paraboloid that touches
the zero set there. Around smooth crossings distance is measured to the touching circle.

Internally arrays have four axes and vectors four components. In fewer dimensions, the first are not used. Positions are
in units of length from the grid's origin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..discretization import SourceTerm
from ..errors import GeometryError, OutsideError, UnsupportedTypeError
from ..fields.field import Field
from ..fields.solid_queries import Scaled
from ..jobs import run_cancellable
from ..methods import Method, Nearest, distance_to_nearest, nearest, sharpen_on, timed
from ..parallel import PointTree, in_threads
from ..search.face_tree import FaceFeatures, FaceTree
from ..validation import array_of, flag, numbers, positive_steps, public_call
from .band import Band
from .blocks import BLOCK
from .grid import Grid
from .marching import zero_set
from .nearest_nodes import Lattice, nearest_at_nodes
from .stencil import padded_shape


@public_call
def redistance(values: ArrayLike, spacing: ArrayLike = 1.0, *, periodic: bool | Sequence[bool] = False) -> Floats:
    """Compute the signed distance of the nodes of a grid to the zero set of an array of values, or of signs.

    Where the zero set is smooth, the error is of second order, and zero for planes and spheres. At its edges, distance
    is to the contour of values that are linear between nodes. An array of two opposite values tells only the side of
    each node. Then a smooth contour that separates the two sides is used.

    Parameters
    ----------
    values : array with one to four axes
        Values at the nodes of a grid: positive on one side, negative on the other, and 0 on the zero set.
    spacing : float, or one for each axis
        Distance between neighbouring nodes, in units of length; 1 by default.
    periodic : bool, or one for each axis
        Whether the first node follows the last one along an axis. By default it does not.

    Returns
    -------
    array of the same shape
        Distances, in the units of the spacing, with the signs of the values.

    Raises
    ------
    OutsideError
        If the array has no zero set: one sign everywhere.
    GeometryError
        If the array has no axis or more than four, or values that are masked or not finite.

    See Also
    --------
    sharpen : Replace a field by distance to its zero set.

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
            "masked nodes are not supported: distance would pass through them",
            remedy="fill them in, or use scikit-fmm, whose distance goes around them",
            element="values",
        )
    read = array_of(np.ma.getdata(values) if np.ma.isMaskedArray(values) else values, "values")
    given = numbers(read, "values")
    if not 1 <= given.ndim <= 4 or given.size < 2:
        raise GeometryError(f"values must have one to four axes, and two nodes, not {given.shape}", element="values")
    if read.dtype == np.bool_:
        raise GeometryError("booleans have no sign", remedy="pass numpy.where(inside, -1.0, 1.0)", element="values")
    if read.dtype.kind == "u":
        raise GeometryError(
            f"values of {read.dtype} have no sign", remedy="pass numpy.where(values > 0, -1.0, 1.0)", element="values"
        )
    flags = [periodic] * given.ndim if np.ndim(periodic) == 0 else list(periodic)  # type: ignore[arg-type]
    if len(flags) != given.ndim:
        raise GeometryError(
            f"periodic must be one or {given.ndim} of True and False, not {periodic!r}", element="periodic"
        )
    steps, again = positive_steps(spacing, given.ndim), [flag(value, "periodic") for value in flags]
    zeros = given == 0
    if (zeros | (given == 1)).all() and not zeros.all() and scipy.ndimage.binary_erosion(zeros).any():
        raise GeometryError(
            "values of 0 and 1 alone, 0 in a whole region, are a mask, which has no sign",
            remedy="pass numpy.where(mask == 1, -1.0, 1.0)",
            element="values",
        )
    if not np.isfinite(given).all():
        raise GeometryError("values must be finite", remedy="fill in those that are not", element="values")
    largest = float(np.abs(given).max())
    scaled = given / largest if largest > 0 else given
    pads = np.where(again, np.array(given.shape) // 2 + 2, 0)
    whole = np.pad(scaled, np.stack([pads, pads], axis=1), mode="wrap")
    wide = np.array(whole.shape) > 1
    distances = _distances(whole.squeeze(), steps[wide], pads[wide]).reshape(given.shape)
    return np.where(given == 0, 0.0, np.copysign(distances, given))


@sharpen_on.register
def _(grid: Grid, field: Field[Grid], source: object, method: Method | None) -> Field[Grid]:
    """Measure the distance of every node to the zero set.

    A field that holds its solid is exact already, so that only a factor, if it has one, is removed.
    """
    if source is not None or method is not None:
        raise UnsupportedTypeError(
            "fields on grids are measured to their zero set", remedy="leave out source and method", element="method"
        )
    if field.solid is not None:
        return field / (abs(field.solid.factor) if isinstance(field.solid, Scaled) else 1.0)
    if isinstance(grid, Band):
        raise GeometryError("a field in a band cannot be sharpened", remedy="use its expand()", element="field")
    if not np.isfinite(field.values).all():
        raise GeometryError(
            "a field with values that are not finite cannot be sharpened",
            remedy="fill them in, or use it as it is",
            element="field",
        )
    run = partial(distance_to_nearest, grid, field.values, source=None, given=None, tolerance=0.0)
    values, diagnostics = timed(run, field.diagnostics)
    return Field(grid, values, diagnostics)


@nearest.register
def _(grid: Grid, values: Floats, source: SourceTerm | None, given: None, tolerance: float) -> Nearest:
    """Measure the distance of every node to the zero set of values, and their sides."""
    distances = run_cancellable(lambda: redistance(values, grid.spacing))
    return Nearest(np.abs(distances), np.sign(distances).astype(np.int64))


def _distances(values: Floats, spacing: Floats, pads: Ints) -> Floats:
    """Return unsigned distances from the nodes to the zero set of values in d dimensions, without those of padding.

    (d,) `pads` nodes at both ends of each axis are padding. Every axis has at least two nodes.
    """
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
    if signs:  # signs say nothing about how the zero set bends
        contour = contour._replace(smooth=np.zeros_like(contour.smooth))
    first, shape = np.zeros(4), np.ones(4, dtype=np.int64)
    first[unused:], shape[unused:] = pads * steps[unused:], np.array(values.shape) - 2 * pads
    return scale * distances_to(contour, first, steps, shape)


SIGN_BLUR = 1.0
"""Standard deviation, in cells, of the Gaussian that smooths arrays of signs. Distances of balls, half spaces and boxes
24 to 96 nodes wide are best with 0.7 to 1; more rounds the edges of boxes."""
LEAST_SIGN = 0.3
"""Absolute values of smoothed signs are between this and twice as much, so that contours cross the middle third of an
edge, since signs tell no more. With the middle three fifths balls and half spaces come out a tenth better, and boxes a
tenth worse."""
SMOOTH_CROSSING = 0.05
"""A crossing is smooth if its neighbours are at most this far from its paraboloid, in cells. Distances of balls of four
cells' radius are wrong by at most 0.04 cells, with 0.1 by 0.01; those of clipped balls by 0.07 and 0.12."""

FLAT_RADIUS = 0.25
"""The zero set of signs with four axes is a flat disc with this radius around each crossing, relative to a cell's
diagonal. Distances of balls and half spaces 13 to 17 nodes wide are best with 0.125 to 0.25, those of boxes with more.
"""


Measured: TypeAlias = Callable[[Ints, Ints, Floats], Floats]
"""A function that returns (n,) distances of the nodes of a tile, given its first node, the node beyond its last, and
the (n, 4) positions of its nodes."""
TILE_NODES = (4 * BLOCK) ** 3
"""Approximate number of nodes that a thread measures at a time."""


class Crossings(NamedTuple):
    """Points of the zero set of the cubic interpolant near crossed edges, with its normals and curvatures there."""

    positions: Floats  # (c, 4)
    normals: Floats  # (c, 4) unit normals
    bends: Floats  # (c, 4, 4) symmetric shape operators

    def heights(self, chosen: Ints, away: Floats) -> Floats:
        """(n,) heights of points over the tangent planes at (n,) chosen crossings, given (n, 4) vectors from these."""
        return np.einsum("ni,ni->n", away, self.normals[chosen])

    def bend_along(self, chosen: Ints, across: Floats) -> Floats:
        """(n,) curvatures of the zero set at (n,) chosen crossings along (n, 4) vectors, times squared lengths."""
        return np.einsum("ni,nij,nj->n", across, self.bends[chosen], across)


class Contour(NamedTuple):
    """The zero set of an array."""

    # the contour of values that are linear along edges; empty with four axes
    vertices: Floats  # (v, 3) along axes 1 to 3
    faces: Ints  # (m, 3)
    numbers: Ints  # (v,) the crossing at each vertex; −1 at vertices on no edge of the array
    zeros: Floats  # (k, 4) nodes that are zero, without a negative neighbour
    curved: Crossings  # of edges with the zero set of the cubic interpolant
    # (c, 4) the crossings: smooth ones on the zero set of the cubic interpolant, others on that linear along edges
    points: Floats
    smooth: Bools  # (c,) whether distance around a crossing is measured to the interpolant's zero set
    uneven: float  # largest difference between distance to circles and distance to triangles
    reach: float  # largest distance of a point of the zero set from its nearest crossing


def smoothed_signs(signs: Floats) -> Floats:
    """Return values with the same signs as an array of ±1, whose contour is smoother."""
    agreement = scipy.ndimage.gaussian_filter(signs, SIGN_BLUR, mode="nearest") * signs
    return signs * np.clip(agreement, LEAST_SIGN, 2 * LEAST_SIGN)


def zero_contour(values: Floats, steps: Floats) -> Contour:
    """Extract the zero set of an array with one to four axes, without triangles if four; zero counts as positive.

    The last of the four `steps`, (4,), are the spacings along these axes.
    """
    unused = 4 - values.ndim
    field = np.ascontiguousarray(values).reshape(padded_shape(values.shape))
    reach = float(np.linalg.norm(steps[unused:]))
    around = scipy.ndimage.generate_binary_structure(4, 1)
    zeros = np.argwhere((field == 0) & ~scipy.ndimage.binary_dilation(field < 0, around)) * steps
    if values.ndim == 4:
        curved = Crossings(*crossings_at(field, crossed_edges(field), steps))
        smooth, none = np.ones(len(curved.positions), dtype=np.bool_), np.empty((0, 3))
        ids = none.astype(np.int64)
        return Contour(none, ids, ids[:, 0], zeros, curved, curved.positions, smooth, 0.0, reach)
    vertices, faces, edges, first, numbers = _marched(values)
    vertices *= steps[1:]
    curved = Crossings(*crossings_at(field, edges, steps))
    linear = np.pad(vertices[first], ((0, 0), (1, 0)))
    linear[:, :unused] = 0.0
    corners = numbers[faces]
    pairs = np.concatenate([corners[:, [k, k - 1]] for k in range(3)])
    uneven = _unevenness(curved, linear, pairs[(pairs >= 0).all(axis=1)])
    least = SMOOTH_CROSSING * float(steps[unused:].min())
    smooth = uneven <= least
    points = np.where(smooth[:, None], curved.positions, linear)
    return Contour(vertices, faces, numbers, zeros, curved, points, smooth, least, reach)


def distances_to(contour: Contour, origin: Floats, steps: Floats, shape: Ints) -> Floats:
    """Return unsigned distances from the nodes of a grid with four axes, in its shape, to a zero set.

    `origin` and `steps` are the (4,) position of its first node, and its spacing.
    """
    distances, zeros = np.full(tuple(shape), np.inf), PointTree(contour.zeros)
    side = BLOCK * max(1, round(TILE_NODES ** (1 / max((shape > 1).sum(), 1)) / BLOCK))
    measured = _to_triangles(contour, origin, steps, shape) if len(contour.faces) else _to_crossings(contour)

    def measure(first: Ints) -> None:
        """Write the distances of the tile that begins at node `first`."""
        stop = np.minimum(first + side, shape)
        axes = [np.arange(*ends) for ends in zip(first, stop, strict=True)]
        nodes = origin + np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4) * steps
        near = measured(first, stop, nodes)
        if len(contour.zeros):
            near = np.minimum(near, zeros.query(nodes)[0])
        distances[np.ix_(*axes)] = near.reshape(stop - first)

    firsts = np.meshgrid(*(np.arange(0, n, side) for n in shape), indexing="ij")
    list(in_threads(measure, np.stack(firsts, axis=-1).reshape(-1, 4)))
    return distances


def _to_triangles(contour: Contour, origin: Floats, steps: Floats, shape: Ints) -> Measured:
    """Return a function that measures distance from tiles of a grid with up to three axes to the contour."""
    features = FaceFeatures.of(contour.vertices, contour.faces)
    tree, corners = FaceTree.of(features), contour.numbers[contour.faces[features.ids]]
    _ = tree.discs  # before threads compute them twice
    lattice = Lattice(origin[1:], steps[1:], shape[1:])

    def measured(first: Ints, stop: Ints, nodes: Floats) -> Floats:
        """(n,) distances of a tile, see `Measured`."""
        if (shape[1:] > 1).all():
            blocks = np.stack(np.meshgrid(*map(np.arange, (first // BLOCK)[1:], -(-stop // BLOCK)[1:])), axis=-1)
            squares, faces = nearest_at_nodes(tree, lattice, first[1:], blocks.reshape(-1, 3))
        else:  # blocks of a plane are nearly empty
            faces, squares = tree.nearest(np.ascontiguousarray(nodes[:, 1:]))
        return _around(contour, corners[faces.ravel()], np.sqrt(squares.ravel()), nodes)

    return measured


def _to_crossings(contour: Contour) -> Measured:
    """Return a function that measures distance from tiles of a grid with four axes to crossings, ∞ without any."""
    crossings = PointTree(contour.points)

    def measured(first: Ints, stop: Ints, nodes: Floats) -> Floats:
        """(n,) distances of a tile, see `Measured`."""
        if not len(contour.points):
            return np.full(len(nodes), np.inf)
        return _around_crossings(contour, crossings.query(nodes)[1], nodes)

    return measured


def _around(contour: Contour, corners: Ints, distances: Floats, nodes: Floats) -> Floats:
    """(n,) distances of (n, 4) nodes, given those to the nearest triangles, whose corners are (n, 3) crossings.

    Where the nearest corner is smooth, distance is to its circle instead, at most `uneven` nearer or farther.
    """
    crossings = _nearest_corners(contour.points, corners, nodes)
    rows = np.flatnonzero((crossings >= 0) & contour.smooth[crossings])
    curved = circle_distances(contour, crossings[rows], nodes[rows])
    low, high = distances[rows] - contour.uneven, distances[rows] + contour.uneven
    distances[rows] = np.minimum(np.maximum(curved, low), high)
    return distances


def _around_crossings(contour: Contour, crossings: Ints, nodes: Floats) -> Floats:
    """(n,) distances of (n, 4) nodes to the touching circles at the nearest crossings, or discs if not smooth."""
    away = nodes - contour.curved.positions[crossings]
    heights = contour.curved.heights(crossings, away)
    across = np.sqrt(np.maximum((away**2).sum(axis=1) - heights**2, 0.0))
    flat = np.hypot(heights, np.maximum(across - FLAT_RADIUS * contour.reach, 0.0))
    return np.where(contour.smooth[crossings], circle_distances(contour, crossings, nodes), flat)


def circle_distances(contour: Contour, crossings: Ints, nodes: Floats) -> Floats:
    """(n,) distances of (n, 4) nodes to circles that touch the zero set at (n,) crossings and are as curved."""
    return _circle_distances(*contour.curved, contour.reach, crossings, nodes)


@compiled
def _nearest_corners(points: Floats, corners: Ints, nodes: Floats) -> Ints:
    """(n,) the point that is nearest to each of (n, 4) nodes, of those in its row of (n, k) corners, or −1.

    A corner of −1 stands for none.
    """
    chosen = np.full(len(nodes), -1)
    for row in range(len(nodes)):
        least = np.inf
        for k in range(corners.shape[1]):
            c, square = corners[row, k], 0.0
            for d in range(4):
                square += (nodes[row, d] - points[c, d]) ** 2
            if c >= 0 and square < least:
                least, chosen[row] = square, c
    return chosen


@compiled
def _circle_distances(
    points: Floats, normals: Floats, bends: Floats, reach: float, crossings: Ints, nodes: Floats
) -> Floats:
    """(r,) distances of (r, 4) `nodes` to the circles that touch the zero set at the (r,) `crossings`.

    Crossings lie at (c, 4) `points` and have (c, 4) unit `normals` and (c, 4, 4) `bends`, symmetric shape operators.
    No circle is nearer than its crossing by more than `reach`.
    """
    distances, away, across = np.empty(len(nodes)), np.empty(4), np.empty(4)
    for row in range(len(nodes)):
        c = crossings[row]
        # of the node: height above the tangent plane, squared distances from the crossing and along the plane; and the
        # curvature in its direction
        height, square, square_aside, bend = 0.0, 0.0, 0.0, 0.0
        for d in range(4):
            away[d] = nodes[row, d] - points[c, d]
            height += away[d] * normals[c, d]
            square += away[d] * away[d]
        for d in range(4):
            across[d] = away[d] - height * normals[c, d]
            square_aside += across[d] * across[d]
        for d in range(4):
            for e in range(4):
                bend += across[d] * bends[c, d, e] * across[e]
        bend = bend / square_aside if square_aside > 1e-12 * square else 0.0
        distances[row] = np.sqrt(square)
        # beyond the centre the other side of the circle is nearer, which is no surface
        if square_aside > 1e-12 * square and 1.0 + bend * height > 0.0:
            root = np.sqrt(max(1.0 + 2.0 * bend * height + bend * bend * square, 0.0))
            circle = abs(2.0 * height + bend * square) / (1.0 + root)
            distances[row] = min(distances[row], max(circle, distances[row] - reach))
    return distances


def _marched(values: Floats) -> tuple[Floats, Ints, NDArray[np.int32], Ints, Ints]:
    """Contour values with up to three axes by marching cubes.

    Return (v, 3) vertices, in cells; (m, 3) triangles; (e, 5) crossed edges, as node and axis; (e,) a vertex on each
    edge; and the (v,) edge of each vertex, or −1.
    """
    unused = 3 - values.ndim
    if not ((values < 0).any() and (values >= 0).any()):
        none = np.empty(0, dtype=np.int64)
        return np.empty((0, 3)), none.reshape(0, 3), np.empty((0, 5), dtype=np.int32), none, none
    size = np.abs(values)
    compressed = np.where(values < 0, -1.0, 1.0) * (1.0 + size / (size + np.median(size[size > 0])))
    vertices, faces = zero_set(np.broadcast_to(compressed, (2,) * unused + values.shape))
    nodes = np.floor(vertices).astype(np.int64)
    along = vertices - nodes > 0.1  # compressed values cross edges from a third to two thirds
    axes, on_edge = along.argmax(axis=1), along.sum(axis=1) == 1
    ends = nodes.copy()
    ends[np.arange(len(ends)), axes] += 1
    tail_sizes, head_sizes = (size[tuple(corner_nodes[on_edge, unused:].T)] for corner_nodes in (nodes, ends))
    largest = np.maximum(tail_sizes, head_sizes)
    vertices[on_edge] = nodes[on_edge]
    vertices[on_edge, axes[on_edge]] += tail_sizes / largest / (tail_sizes / largest + head_sizes / largest)
    if not on_edge.all():
        _between_others(vertices, faces, ~on_edge)
    edges = np.column_stack([np.zeros(len(nodes)), nodes, axes + 1])[on_edge].astype(np.int32)
    edges[:, 1 : 1 + unused] = 0  # copies along unused axes are one edge
    edges, first, numbers_of = np.unique(edges, axis=0, return_index=True, return_inverse=True)
    numbers = np.full(len(vertices), -1)
    numbers[on_edge] = numbers_of.ravel()
    return vertices, faces, edges, np.flatnonzero(on_edge)[first], numbers


def _between_others(vertices: Floats, faces: Ints, chosen: Bools) -> None:
    """Move the (v,) chosen vertices to the mean of the other vertices that they share triangles with, in place."""
    sums, counts = np.zeros_like(vertices), np.zeros(len(vertices))
    for k in range(3):
        for neighbor in (k - 1, k - 2):
            tail, head = faces[:, k], faces[:, neighbor]
            joined = chosen[tail] & ~chosen[head]
            np.add.at(sums, tail[joined], vertices[head[joined]])
            np.add.at(counts, tail[joined], 1.0)
    vertices[counts > 0] = sums[counts > 0] / counts[counts > 0, None]


def _unevenness(curved: Crossings, linear: Floats, pairs: Ints) -> Floats:
    """(c,) distance of each crossing from its (c, 4) linear one, or of its neighbours from its paraboloid, if larger.

    `pairs` are (p, 2) neighbouring crossings.
    """
    uneven: Floats = np.linalg.norm(curved.positions - linear, axis=1)
    crossing, neighbor = np.concatenate([pairs, pairs[:, ::-1]]).T
    away = curved.positions[neighbor] - curved.positions[crossing]
    heights = curved.heights(crossing, away) + 0.5 * curved.bend_along(crossing, away)
    np.maximum.at(uneven, crossing, np.abs(heights))
    return uneven


def crossed_edges(field: Floats) -> NDArray[np.int32]:
    """(e, 5) node, four indices, and axis of each edge whose ends have different signs; zero counts as positive."""
    nodes_by_axis = [np.argwhere(np.diff(field < 0, axis=axis)) for axis in range(4)]
    edges = np.concatenate([np.insert(nodes, 4, axis, axis=1) for axis, nodes in enumerate(nodes_by_axis)])
    return np.ascontiguousarray(edges, dtype=np.int32)


@compiled
def _cubic(field: Floats, position: Floats, weights: Floats, gradient: Floats) -> float:
    """Return the cubic convolution interpolant (Keys 1981) of a field with four axes; write its gradient, (4,).

    `position` is (4,) in cells. `weights` is working memory, (2, 4, 4): those of values and of derivatives, along each
    axis, of four nodes.
    """
    base = np.empty(4, dtype=np.int64)
    for axis in range(4):
        n = field.shape[axis]
        base[axis] = min(max(np.int64(np.floor(position[axis])), 0), max(n - 2, 0))
        f = position[axis] - base[axis]
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
                        value_at_node = field[base[0] + i - 1, base[1] + j - 1, base[2] + k - 1, base[3] + m - 1]
                        line += weights[0, 3, m] * value_at_node
                        slope += weights[1, 3, m] * value_at_node
                value += wi * wj * wk * line
                gradient[0] += si * wj * wk * line
                gradient[1] += wi * sj * wk * line
                gradient[2] += wi * wj * sk * line
                gradient[3] += wi * wj * wk * slope
    return value


@compiled
def crossings_at(field: Floats, edges: NDArray[np.int32], steps: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (e, 4) positions on the zero set, (e, 4) normals and (e, 4, 4) shape operators there, as in `Crossings`.

    They are those of the cubic interpolant of a field with four axes of spacings `steps`, (4,). Crossed edges are the
    four indices of their tail, and the axis along which they run, (e, 5).
    """
    n = len(edges)
    positions, normals, bends = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4, 4))
    weights = np.empty((2, 4, 4))
    slope, start, position, ahead, behind = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    bend = np.empty((4, 4))
    for e in range(len(edges)):
        axis = edges[e, 4]
        i, j, k, m = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        tail_value = field[i, j, k, m]
        head_value = field[i + (axis == 0), j + (axis == 1), k + (axis == 2), m + (axis == 3)]
        for d in range(4):
            start[d] = edges[e, d]
        start[axis] += tail_value / (tail_value - head_value)
        for d in range(4):
            position[d] = start[d]
        # Newton's method along the gradient, onto the zero set of the interpolant; back to the crossing if it diverges
        for _ in range(3):
            value = _cubic(field, position, weights, slope)
            square, moved = 0.0, 0.0
            for d in range(4):
                slope[d] /= steps[d]
                square += slope[d] ** 2
            for d in range(4):
                if square > 0.0:
                    position[d] -= value * slope[d] / (square * steps[d])
                moved = max(moved, abs(position[d] - start[d]))
                if position[d] < 0.0 or position[d] > field.shape[d] - 1:
                    moved = 2.0
            if not moved < 1.0:
                for d in range(4):
                    position[d] = start[d]
                break
        _cubic(field, position, weights, slope)
        square = 0.0
        for d in range(4):
            slope[d] /= steps[d]
            square += slope[d] ** 2
        length = np.sqrt(square)
        if length == 0.0:
            slope[axis] = 1.0 if head_value > tail_value else -1.0
            length = 1.0
        for d in range(4):
            positions[e, d] = position[d] * steps[d]
            normals[e, d] = slope[d] / length
        # differences of the gradient one cell apart
        for d in range(4):
            for f in range(4):
                ahead[f] = behind[f] = position[f]
                bend[d, f] = 0.0
            ahead[d] = min(position[d] + 1.0, field.shape[d] - 1.0)
            behind[d] = max(position[d] - 1.0, 0.0)
            span = (ahead[d] - behind[d]) * steps[d] * length
            if span > 0.0:
                _cubic(field, ahead, weights, slope)
                for f in range(4):
                    bend[d, f] += slope[f] / steps[f] / span
                _cubic(field, behind, weights, slope)
                for f in range(4):
                    bend[d, f] -= slope[f] / steps[f] / span
        for d in range(4):
            for f in range(4):
                bends[e, d, f] = 0.5 * (bend[d, f] + bend[f, d])
    return positions, normals, bends
