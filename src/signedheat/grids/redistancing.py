"""Signed distance to the zero set of any array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError, OutsideError
from ..validation import array_of, flag, numbers, positive_steps
from .zero_contour import distances_to, smoothed_signs, zero_contour


def redistance(
    values: ArrayLike, spacing: ArrayLike = 1.0, *, periodic: bool | Sequence[bool] = False
) -> NDArray[np.float64]:
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


def _distances(
    values: NDArray[np.float64], spacing: NDArray[np.float64], pads: NDArray[np.int64]
) -> NDArray[np.float64]:
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
    if signs and values.ndim < 4:  # which say nothing of how the zero set bends
        contour = contour._replace(smooth=np.zeros_like(contour.smooth))
    inner = [np.arange(pad, n - pad) * step for pad, n, step in zip(pads, values.shape, steps[unused:], strict=True)]
    places = np.stack(np.meshgrid(*[np.zeros(1)] * unused, *inner, indexing="ij"), axis=-1)
    return scale * distances_to(contour, places.reshape(-1, 4))
