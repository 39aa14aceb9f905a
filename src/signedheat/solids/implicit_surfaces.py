"""Level sets of functions of points, and of values at the nodes of a grid, as closed surfaces with sharp edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError, OutsideError, SignedHeatError, counted
from ..grids.exact_levels import on_level
from ..grids.grid import RESOLUTION, Grid
from ..grids.grid_discretization import refuse_large_grid
from ..grids.marching import CAP, closed_surface
from ..mesh.unit_vectors import unit
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import finite_number, flag, numbers, positive_steps, public_call, refuse_beside, whole_number
from .contouring import crossed_between, traced

Function: TypeAlias = Callable[[Floats], ArrayLike]
"""A function that returns one number for each of (n, 3) points; a gradient returns three."""
NODES_AT_ONCE = 1 << 17
"""Batch size for calls of the function."""
LEAST_WEIGHT = 1e-9
"""Nodes with a smaller weight do not count for a point: on an edge of the grid only its ends do."""
EDGE_COSINE = np.cos(np.deg2rad(15.0))
"""A sharp edge passes between nodes if the cosine between the gradient at one and their mean direction is below
this."""
KNOWN_SLOPE = 0.1
"""The gradient at a node counts as unknown if it changes by a larger share of its length from node to node."""
CLEAR_ERRORS = 0.25
"""At a sharp edge, planes are joined by their maximum if its error at nodes is below this share of that of their
minimum, and the other way round."""
CELL_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
"""(8, 3) offsets of the corners of a cell from the lowest."""


@dataclass(frozen=True, eq=False)
class Implicit:
    """The zero set of a function within a box, the walls of which close it."""

    function: Callable[[Floats], Floats]  # (n,) values at (n, 3) points in the box, negative inside
    gradient: Callable[[Floats], Floats]  # (n, 3) gradients there
    box: Floats  # (2, 3) lower and upper corner

    def distance(self, points: Floats) -> Floats:
        """(n,) values of the function at (n, 3) points, or distances beyond the walls where these are greater."""
        return np.maximum(self.function(np.clip(points, *self.box)), self._beyond(points).max(axis=1))

    def slopes(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) estimated distances from the surface, values over the length of gradients; (n, 3) unit gradients."""
        inside_box = np.clip(points, *self.box)
        gradients = self.gradient(inside_box)
        steepness = np.maximum(np.linalg.norm(gradients, axis=1), np.finfo(float).tiny)
        away, directions = self.function(inside_box) / steepness, gradients / steepness[:, None]
        walls = self._beyond(points)
        rows, nearest = np.arange(len(points)), walls.argmax(axis=1)
        outside = walls[rows, nearest] > away
        normals = np.concatenate([-np.eye(3), np.eye(3)])[nearest]
        return np.where(outside, walls[rows, nearest], away), np.where(outside[:, None], normals, directions)

    def planes(self, points: Floats) -> tuple[Floats, Floats]:
        """(n, 3) points on the surface near given ones, estimated, and (n, 3) unit normals there."""
        away, normals = self.slopes(points)
        return points - away[:, None] * normals, normals

    def _beyond(self, points: Floats) -> Floats:
        """(n, 6) distances of points beyond the three lower and the three upper walls, negative within."""
        return np.concatenate([self.box[0] - points, points - self.box[1]], axis=1)


@dataclass(frozen=True, eq=False)
class NodePlanes:
    """A function that interpolates planes at grid nodes linearly; at sharp edges it is their maximum or minimum."""

    origin: Floats  # (3,) position of the first node
    spacing: Floats  # (3,) distance between nodes
    values: Floats  # (nx, ny, nz) values at nodes
    gradients: Floats  # (nx, ny, nz, 3) gradients at nodes
    known: Bools  # (nx, ny, nz) nodes whose gradients are known well; others get the mean of such neighbours

    def function(self, points: Floats) -> Floats:
        """(n,) values at (n, 3) points."""
        return self._values_and_gradients(points)[0]

    def gradient(self, points: Floats) -> Floats:
        """(n, 3) gradients at (n, 3) points."""
        return self._values_and_gradients(points)[1]

    def _values_and_gradients(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) values and (n, 3) gradients at (n, 3) points, from the planes at the eight nodes of the cell.

        The planes are weighted trilinearly, but where a sharp edge passes the cell, only one of them counts.
        """
        # the eight nodes of the cell of each point, their weights, and the heights of their planes at the point
        cells = (points - self.origin) / self.spacing
        base = np.clip(np.floor(cells).astype(np.int64), 0, np.array(self.values.shape) - 2)
        shares = (cells - base)[:, None]  # (n, 1, 3) positions in the cells, from 0 to 1
        weights = np.where(CELL_CORNERS == 1, shares, 1 - shares).prod(axis=2)
        weights[weights < LEAST_WEIGHT] = 0.0
        nodes = tuple((base[:, None] + CELL_CORNERS).transpose(2, 0, 1))
        values, known = self.values[nodes], (weights > 0) & self.known[nodes]
        slopes = _completed(self.gradients[nodes], known, weights)
        heights = values + np.einsum("nkd,nkd->nk", slopes, (shares - CELL_CORNERS) * self.spacing)
        results, gradients = (weights * heights).sum(axis=1), (weights[..., None] * slopes).sum(axis=1)
        node = _node_that_counts(values, slopes, heights, known, self.spacing)
        sharp = np.flatnonzero(node >= 0)
        results[sharp] = heights[sharp, node[sharp]]
        gradients[sharp] = slopes[sharp, node[sharp]]
        return results, gradients


def _completed(slopes: Floats, known: Bools, weights: Floats) -> Floats:
    """(n, 8, 3) gradients at nodes; those not `known`, (n, 8), become the mean of known ones by (n, 8) weights."""
    known_weights = np.where(known, weights, 0.0)
    total = known_weights.sum(axis=1, keepdims=True)
    mean = (known_weights[..., None] * slopes).sum(axis=1) / np.maximum(total, LEAST_WEIGHT)
    return np.where((known | (total < LEAST_WEIGHT))[..., None], slopes, mean[:, None])


def _node_that_counts(values: Floats, slopes: Floats, heights: Floats, known: Bools, spacing: Floats) -> Ints:
    """(n,) the node, 0 to 7, whose plane counts alone at each point, if a sharp edge passes its cell; else −1.

    The planes, with (n, 8) values and (n, 8, 3) slopes at their own nodes, have (n, 8) `heights` at the points. At a
    convex edge the surface is their maximum, at a concave one their minimum: whichever reproduces the values clearly
    better. Where neither does, no plane counts alone.
    """
    directions = unit(slopes)
    mean_direction = unit(np.where(known[..., None], directions, 0.0).sum(axis=1))
    agreement = np.where(known, np.einsum("nkd,nd->nk", directions, mean_direction), 1.0).min(axis=1)
    rows = np.flatnonzero(agreement < EDGE_COSINE)  # points whose cells a sharp edge passes
    values, slopes, heights, known = values[rows], slopes[rows], heights[rows], known[rows]
    offsets = (CELL_CORNERS[None, :] - CELL_CORNERS[:, None]) * spacing  # from each corner to the others
    # (r, 8, 8) height of the plane of node k at node j
    planes_at_nodes = values[:, :, None] + np.einsum("nkd,kjd->nkj", slopes, offsets)
    excluded = np.where(known, 0.0, -np.inf)
    errors, extreme_nodes = [], []
    for sign in (1.0, -1.0):  # the maximum; the minimum
        extremes = sign * (sign * planes_at_nodes + excluded[:, :, None]).max(axis=1)
        errors.append(np.where(known, np.abs(extremes - values), 0.0).sum(axis=1))
        extreme_nodes.append((sign * heights + excluded).argmax(axis=1))
    result = np.full(len(agreement), -1)
    for k in range(2):
        clear = errors[k] < CLEAR_ERRORS * errors[1 - k]
        result[rows[clear]] = extreme_nodes[k][clear]
    return result


@public_call
def contour(
    f: Function | ArrayLike,
    bounds: ArrayLike,
    spacing: ArrayLike | None = None,
    level: float = 0.0,
    *,
    sharp: bool = True,
    gradient: Function | ArrayLike | None = None,
    resolution: int | None = None,
) -> TriangleMesh:
    """Extract the closed, manifold surface on which a function, or an array of values, equals a level.

    Normals point to greater values. Sharp surfaces have the edges and corners of the function, as those of
    `Solid.surface` do, and do not intersect themselves. Where the function is less than the level at the walls of the
    box, these close the surface.

    Parameters
    ----------
    f : callable, or (nx, ny, nz) float
        A function that takes (n, 3) points and returns (n,) numbers; or values at the nodes of a grid.
    bounds : (2, 3) float
        Lower and upper corner of the box. For an array, the positions of its first and last nodes.
    spacing : float or (3,) float, optional
        Size of the cells in which a function is sampled, in units of length; by default that of `resolution`. The cells
        of an array follow from `bounds`.
    level : float
        Value of the function, or of the array, on the surface; 0 by default.
    sharp : bool
        Whether to use dual contouring, the default, or else marching cubes, which cut edges off.
    gradient : callable, or (nx, ny, nz, 3) float, optional
        A function that returns the (n, 3) gradients of `f` at (n, 3) points; or, for an array, the gradients at its
        nodes. By default they are estimated by differences.
    resolution : int, optional
        Number of cells along the longest side of the box, for a function without `spacing`; 128 by default.

    Returns
    -------
    TriangleMesh
        A closed surface. For functions with flat sides, edges and corners are exact up to rounding where cells resolve
        them; for curved ones, errors are quadratic in the size of cells. For arrays, edges are exact if gradients are
        given. With differences they are off by up to a quarter of a cell, and corners and edges of holes by more.

    Raises
    ------
    OutsideError
        If the values at all nodes are below the level, or none of them is.
    SignedHeatError
        If a function does not return a finite number for each point.
    UnsupportedTypeError
        If `spacing` or `resolution` is given with an array.
    GeometryError
        If the box or the array has another shape, or the array holds NaN or infinity.
    MemoryLimitError
        If the grid does not fit in memory. Raised before anything is computed.

    See Also
    --------
    redistance : Distance from an array of values or signs.
    Solid.surface : The closed surface.
    offset : The closed surface at a distance.

    Examples
    --------
    >>> def box(points):
    ...     return np.abs(points).max(axis=1) - 0.7
    >>> surface = contour(box, [[-1, -1, -1], [1, 1, 1]], 0.1)
    >>> surface.bounds.round(9).tolist()
    [[-0.7, -0.7, -0.7], [0.7, 0.7, 0.7]]
    """
    box = numbers(bounds, "bounds")
    if box.shape != (2, 3) or not np.isfinite(box).all() or not (box[0] < box[1]).all():
        raise GeometryError("bounds must be the lower and the upper corner of a box, (2, 3)", element="bounds")
    height, is_sharp = finite_number(level, "level"), flag(sharp, "sharp")
    if callable(f):
        cells = whole_number(RESOLUTION if resolution is None else resolution, "resolution", 1)
        steps = positive_steps(np.ptp(box, axis=0).max() / cells if spacing is None else spacing, 3)
        counts = np.ceil(np.ptp(box, axis=0) / steps - 1e-9).astype(np.int64) + 2
        grid = Grid(box[0] - 0.5 * steps, steps, counts)
        surface = _of_function(f, gradient, box, grid, height)
    else:
        refuse_beside("an array, which has its own cells", spacing=spacing, resolution=resolution)
        surface, grid = _of_array(f, gradient, box, height)
    refuse_large_grid(grid, 40.0)  # measured bytes for each node
    parts = []
    for begin in range(0, grid.n_nodes, NODES_AT_ONCE):
        nodes = np.unravel_index(np.arange(begin, min(begin + NODES_AT_ONCE, grid.n_nodes)), grid.shape)
        parts.append(surface.distance(grid.origin + np.stack(nodes, axis=1) * grid.spacing))
    values = np.concatenate(parts).reshape(grid.shape)
    within = [(box[0, k] <= x) & (x <= box[1, k]) for k, x in enumerate(grid.axes)]
    if (values[np.ix_(*within)] < 0).all():
        raise OutsideError(f"the function is below level {height:g} everywhere", remedy="choose another level")
    if not is_sharp:
        points, faces = closed_surface(values, grid.spacing, 0.0)
        return TriangleMesh(on_level(surface.distance, points, values, grid.origin, grid.spacing, 0.0), faces)
    return TriangleMesh(*traced(surface, grid, values, *crossed_between(values, grid)))


def _of_function(f: Function, gradient: Function | ArrayLike | None, box: Floats, grid: Grid, level: float) -> Implicit:
    """Make the level set of a function. If no gradient is given, it is estimated by differences of the function.

    Their steps suit the precision in which the function computes.
    """

    def values(points: Floats) -> Floats:
        """(n,) values of the function above the level at (n, 3) points."""
        return _called(f, points, ())[..., 0] - level

    precision = np.asarray(f(box.mean(axis=0, keepdims=True))).dtype
    rounding = np.finfo(precision if precision.kind == "f" else float).eps
    steps = float(rounding) ** 0.25 * grid.spacing

    def differences(points: Floats) -> Floats:
        """(n, 3) central differences of the function at (n, 3) points, one-sided at the walls of the box."""
        steps_along_axes = steps * np.eye(3)
        around = np.stack([points[:, None] + steps_along_axes, points[:, None] - steps_along_axes])
        ahead, back = values(np.clip(around, *box).reshape(-1, 3)).reshape(2, len(points), 3)
        return (ahead - back) / np.einsum("nkk->nk", np.clip(around[0], *box) - np.clip(around[1], *box))

    if gradient is None:
        return Implicit(values, differences, box)
    if not callable(gradient):
        raise SignedHeatError("the gradient of a function must be a function", element="gradient")
    return Implicit(values, lambda points: _called(gradient, points, (3,)), box)


def _called(f: Function, points: Floats, shape: tuple[int, ...]) -> Floats:
    """Call a function on (n, 3) points in batches; return (n, 1) values, or (n, 3) if `shape` is (3,).

    Raise if it returns another shape, or numbers that are not finite.
    """
    parts = [np.empty((0, *(shape or (1,))))]
    for begin in range(0, len(points), NODES_AT_ONCE):
        asked = points[begin : begin + NODES_AT_ONCE]
        values = numbers(f(asked), "values of the function", SignedHeatError)
        if values.shape not in ((len(asked), *shape), (len(asked), *(shape or (1,)))):
            raise SignedHeatError(
                f"the function returns shape {values.shape} for {counted(len(asked), 'point')}",
                element="f",
                remedy="return one number for each of (n, 3) points, or three numbers for a gradient",
            )
        values = values.reshape(len(asked), -1)
        lost = ~np.isfinite(values).all(axis=1)
        if lost.any():
            place = ", ".join(f"{x:.4g}" for x in asked[np.argmax(lost)])
            raise SignedHeatError(f"the function is not finite at ({place})", element="f")
        parts.append(values)
    return np.concatenate(parts)


def _of_array(f: ArrayLike, gradient: Function | ArrayLike | None, box: Floats, level: float) -> tuple[Implicit, Grid]:
    """Make the level set of values f, (nx, ny, nz), in a box, and the grid to contour it on, with walls outside.

    `gradient` are (nx, ny, nz, 3) gradients at nodes, or a function that returns them. By default they are estimated by
    differences, and count as unknown where these change too fast.
    """
    values = numbers(f, "f")
    if values.ndim != 3 or min(values.shape) < 2 or not np.isfinite(values).all():
        raise GeometryError(
            f"an array must hold finite numbers at 2 nodes or more along each of 3 axes, not {values.shape}",
            element="f",
            remedy="fill in unknown values",
        )
    steps = np.ptp(box, axis=0) / (np.array(values.shape) - 1)
    if gradient is None:
        along = [_slopes(values, axis) for axis in range(3)]
        slopes, bends = (np.stack(parts, axis=-1) / steps for parts in zip(*along, strict=True))
        known = np.linalg.norm(bends, axis=-1) <= KNOWN_SLOPE * np.linalg.norm(slopes, axis=-1)
    else:
        known = np.ones(values.shape, dtype=bool)
        if callable(gradient):
            nodes = np.indices(values.shape).reshape(3, -1).T
            gradient = _called(gradient, box[0] + nodes * steps, (3,)).reshape(*values.shape, 3)
        slopes = numbers(gradient, "gradient")
        if slopes.shape != (*values.shape, 3) or not np.isfinite(slopes).all():
            raise GeometryError(f"gradients must be finite, of shape {(*values.shape, 3)}", element="gradient")
    planes = NodePlanes(box[0], steps, values - level, slopes, known)
    grid = Grid(box[0] - steps, steps, np.array(values.shape) + 2)
    walls = box + CAP * steps * np.array([[-1.0], [1.0]])
    return Implicit(  # between box and walls, values are those on the box
        lambda points: planes.function(np.clip(points, *box)),
        lambda points: planes.gradient(np.clip(points, *box)),
        walls,
    ), grid


def _slopes(values: Floats, axis: int) -> tuple[Floats, Floats]:
    """Differentiate values along an axis by the parabola, of three, that bends least (Harten 1987): slopes, and bends.

    Both have the shape of the values, and are differences per node. Bends are absolute second differences, halved if
    the node is in the middle of the parabola.
    """
    v = np.moveaxis(values, axis, 0)
    if len(v) < 3:  # a straight line
        return np.broadcast_to(np.moveaxis(v[1:] - v[:1], 0, axis), values.shape), np.zeros(values.shape)
    # second difference of each parabola, and its slope at its middle node
    bends, middle = v[2:] - 2 * v[1:-1] + v[:-2], 0.5 * (v[2:] - v[:-2])
    least, sides, slopes = np.full(v.shape, np.inf), np.zeros(v.shape), np.empty_like(v)
    for shift in (0, -1, 1):  # shift of the parabola's middle node; 0 unless another parabola bends less
        nodes = slice(1 - shift, len(v) - 1 - shift)
        bent = np.abs(bends) * (1.0 if shift else 0.5)
        better = bent < least[nodes]
        slopes[nodes] = np.where(better, middle - shift * bends, slopes[nodes])
        least[nodes] = np.where(better, bent, least[nodes])
        if shift:
            sides[nodes] = np.fmax(sides[nodes], bent)
    through = sides[1:-1] < CLEAR_ERRORS * np.abs(bends)  # both sides bend far less: an edge runs through the node
    least[1:-1] = np.where(through, np.abs(bends), least[1:-1])
    return np.moveaxis(slopes, 0, axis), np.moveaxis(least, 0, axis)
