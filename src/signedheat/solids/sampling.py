"""Points with distances and gradients, to learn a signed distance from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import OutsideError, SignedHeatError, SourceError
from ..grids.grid_field import GridField
from ..kinds import Shapes
from ..memory import refuse_beyond_memory
from ..mesh.triangles import face_areas
from ..validation import finite_number, whole_number
from .completion import complete
from .sample_set import Samples

WIDTHS = (0.05, 0.0158)
"""Widths of the noise by default, over the radius of the shape: variances of .0025 and .00025 (Park et al. 2019)."""
BYTES_PER_SAMPLE = 165
"""At the most, with what finding its nearest face takes."""


def sample(
    shape: GridField | Shapes, n: int = 250_000, *, near: float = 0.8, widths: Sequence[float] = WIDTHS, seed: int = 0
) -> Samples:
    """Points with distances and gradients, near the surface of a shape and all around it.

    Near the surface: places on it, evenly by area, moved by normal noise along each axis. All around it: evenly spread
    over the cube around the sphere that holds the shape. Distances are measured anew (`Solid.closest`), not
    interpolated between the nodes of the field.

    Parameters
    ----------
    shape : GridField, Solid or shape
        Distance in space, from `signed_distance` or ``sharpen(field, shape)``; or a solid; or a shape, completed here.
    n : int
        Number of points.
    near : float
        Share of them that are near the surface.
    widths : sequence of float
        Standard deviations of the noise, over the radius of the shape; each gets the same share of the points near.
    seed : int
        The same seed gives the same points.

    Returns
    -------
    Samples
        Points, distances, gradients; with centre and radius of the shape.

    Raises
    ------
    SourceError
        If the field does not know its solid: it was not sharpened to a shape, or arithmetic has changed it.
    MemoryLimitError
        If so many samples do not fit.
    SignedHeatError
        If n is not positive, the share not from 0 to 1, or a width negative.

    Examples
    --------
    >>> from signedheat import samples, signed_distance
    >>> field = signed_distance(samples.without_faces(samples.sphere(3), 0.3), resolution=32)
    >>> taken = sample(field, 2000, near=0.5, widths=[0.1, 0.01], seed=7)
    >>> away = np.abs(taken.distances - (np.linalg.norm(taken.points, axis=1) - 1))
    >>> bool(np.quantile(away, 0.9) < 0.01 and away.max() < 0.1)
    True
    """
    n = whole_number(n, "the number of samples", 1, SignedHeatError)
    refuse_beyond_memory(f"{n} samples", n, lambda k: BYTES_PER_SAMPLE * k, lambda k: f"take {k} at a time")
    if not 0 <= near <= 1:
        raise SignedHeatError(f"the share near the surface is {near:g}", remedy="choose it from 0 to 1")
    scales = [finite_number(width, "the width of the noise", least=0) for width in widths]
    n_near = round(near * n) if scales else 0
    solid = shape.solid if isinstance(shape, GridField) else complete(shape)
    if solid is None or solid.triangles.shape[-1] != 3:
        raise SourceError(
            "the field does not know the solid that it is the distance to",
            remedy="take it from signed_distance or Solid.field, or pass the solid",
            element="field",
        )
    triangles = solid.triangles
    if not len(triangles):
        raise OutsideError("the field has no zero set to sample", remedy="compute it on a finer grid", element="field")
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    center = (lower + upper) / 2
    radius = float(np.linalg.norm(triangles - center, axis=2).max())
    random = np.random.default_rng(seed)
    points = np.empty((n, 3))
    ends = np.rint(np.linspace(0, n_near, len(scales) + 1)).astype(int) if scales else np.zeros(1, dtype=int)
    for start, stop, width in zip(ends[:-1], ends[1:], scales, strict=True):
        places, _ = evenly_on(triangles, stop - start, random)
        points[start:stop] = places + random.normal(scale=width * radius, size=places.shape)
    points[n_near:] = center + radius * random.uniform(-1.0, 1.0, (n - n_near, 3))
    found = solid.closest(points)
    is_near = np.arange(n) < n_near
    return Samples(points, found.distances, found.gradients, is_near, found.completed, center, radius)


def evenly_on(
    triangles: NDArray[np.float64], n: int, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, 3) points on triangles, evenly by area, one in each nth of it; and the triangle of each."""
    a, b, c = triangles.transpose(1, 0, 2)
    areas = np.cumsum(face_areas(triangles))
    marks = (np.arange(n) + random.random(n)) / max(n, 1) * areas[-1]
    faces = np.minimum(np.searchsorted(areas, marks, side="right"), len(triangles) - 1)
    u, v = random.random((2, n))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u)[:, None], np.where(over, 1 - v, v)[:, None]
    a, b, c = a[faces], b[faces], c[faces]
    return a + u * (b - a) + v * (c - a), faces
