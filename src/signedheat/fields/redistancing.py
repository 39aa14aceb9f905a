"""Signed distance to the zero set of any array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..domains.validation import flag, numbers, positive_steps
from ..errors import GeometryError, OutsideError
from ..operators.grid.walls import distances_around_walls
from ..operators.grid.wavefront import padded_shape
from ..operators.grid.zero_contour import distances_to_contour, moved, nearest_crossings, smoothed_signs, zero_contour


def redistance(
    values: ArrayLike, spacing: ArrayLike = 1.0, *, periodic: bool | Sequence[bool] = False
) -> NDArray[np.float64]:
    """Signed distance of the nodes of a grid to the zero set of an array: of a level set, or of an image of ±1.

    Where the zero set is smooth, distance is of second order, and exact for planes and spheres; at its edges it is
    that to the contour of values that are linear between nodes. An array of two opposite values has the side of each
    node and nothing else: of the contours that separate them so, a smooth one is taken. In rough arrays the nearest
    piece of the zero set may be missed, and distance be up to a third of a cell too large.

    Parameters
    ----------
    values : array with one to four axes
        Positive on one side, negative on the other; zero is on the zero set. Masked nodes, and NaN, are walls, each a
        box of one cell around its node: distance is measured around them, along ways that bend at nodes.
    spacing : float, or one for each axis
        Distance between neighbouring nodes.
    periodic : bool, or one for each axis
        Axes behind whose last node the first comes again.

    Returns
    -------
    array of the same shape
        Distances, with the signs of the values. Masked, or NaN, at walls and where no way leads to the zero set.

    Raises
    ------
    OutsideError
        If the array has no zero set: one sign everywhere, or walls between the two.
    GeometryError
        If the array has no axis or more than four, or infinite values, or there are walls on a periodic grid.

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
    >>> redistance([0.0, 2.0, np.nan, 1.0])
    array([ 0.,  1., nan, nan])
    """
    masked = isinstance(values, np.ma.MaskedArray)
    given = numbers(np.ma.getdata(values) if masked else values, "values")
    if not 1 <= given.ndim <= 4 or given.size < 2:
        raise GeometryError(f"values must have one to four axes, and two nodes, not {given.shape}", element="values")
    if np.asanyarray(values).dtype == np.bool_:
        raise GeometryError("booleans have no sign", remedy="pass numpy.where(inside, -1.0, 1.0)", element="values")
    walls = np.isnan(given) | (np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else False)
    steps, again = positive_steps(spacing, given.ndim), _axes(periodic, given.ndim)
    if walls.all() or np.isinf(given[~walls]).any():
        raise GeometryError(
            "values must be numbers somewhere, and finite there", remedy="mask others", element="values"
        )
    if walls.any() and any(again):
        raise GeometryError(
            "distance around walls is not measured on periodic grids",
            remedy="repeat the array along its periodic axes, or fill in what is masked",
            element="periodic",
        )
    pads = np.where(again, np.array(given.shape) // 2 + 2, 0)
    whole = np.pad(_filled(given, walls), np.stack([pads, pads], axis=1), mode="wrap")
    wide = np.array(whole.shape) > 1
    around = walls.squeeze() if walls.any() else None
    distances = _distances(whole.squeeze(), steps[wide], around, pads[wide]).reshape(given.shape)
    result, lost = np.where(given == 0, 0.0, np.copysign(distances, given)), walls | np.isinf(distances)
    return np.ma.masked_array(np.where(lost, 0.0, result), lost) if masked else np.where(lost, np.nan, result)


def _axes(periodic: bool | Sequence[bool], count: int) -> list[bool]:
    """Whether each axis is periodic."""
    each = [periodic] * count if np.ndim(periodic) == 0 else list(periodic)  # type: ignore[arg-type]
    if len(each) != count:
        raise GeometryError(f"periodic must be one or {count} of True and False, not {periodic!r}", element="periodic")
    return [flag(one, "periodic") for one in each]


def _filled(values: NDArray[np.float64], walls: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Values from −1 to 1, at walls those of the nearest node that has one."""
    if walls.any():
        nearest = scipy.ndimage.distance_transform_edt(walls, return_distances=False, return_indices=True)
        values = values[tuple(nearest)]
    largest = float(np.abs(values).max())
    return values / largest if largest > 0 else values


def _distances(
    values: NDArray[np.float64],
    spacing: NDArray[np.float64],
    walls: NDArray[np.bool_] | None,
    pads: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Distance of each node that is no padding, infinite where no way leads; axes have at least two nodes."""
    signs = values.ndim > 1 and bool((np.abs(values) == 1).all())
    if signs:
        values = smoothed_signs(values)
    shape, scale = padded_shape(values.shape), float(spacing.max())
    steps = np.concatenate([np.ones(4 - values.ndim), spacing / scale])
    contour = zero_contour(values, steps, walls)
    if not len(contour.points):
        raise OutsideError(
            "the values have one sign everywhere, so there is no zero set to measure distance to",
            remedy="subtract a level; of an image of 0 and 1, for instance, pass 0.5 - image",
            element="values",
        )
    if signs and values.ndim < 4:  # which say nothing of how the zero set bends
        contour = contour._replace(smooth=np.zeros_like(contour.smooth))
    nearest = nearest_crossings(contour, shape, steps)
    if pads.any():
        first = np.concatenate([np.zeros(4 - values.ndim, dtype=np.int64), pads])
        inner = tuple(slice(pad, n - pad) for pad, n in zip(first, shape, strict=True))
        nearest, contour = np.ascontiguousarray(nearest[inner]), moved(contour, -first * steps)
    distances = distances_to_contour(contour, nearest, steps)
    if walls is not None:
        distances_around_walls(contour, nearest, distances, walls.reshape(shape), steps)
    return distances * scale
