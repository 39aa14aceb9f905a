"""The nearest places of the surface that a field is the distance to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SourceError
from ..operators.grid.exact_surface import ExactSurface


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The nearest place of a surface for each of some points.

    Attributes
    ----------
    points : (n, 3) float
        The nearest places.
    distances : (n,) float
        Signed distances to them, negative inside.
    gradients : (n, 3) float
        Gradients of the distance, of length 1; on the surface, its normals.
    completed : (n,) bool
        Whether the place lies on surface that was not there: completed, or on a face that was put back.
    """

    points: NDArray[np.float64]
    distances: NDArray[np.float64]
    gradients: NDArray[np.float64]
    completed: NDArray[np.bool_]

    def __repr__(self) -> str:
        return f"ClosestPoints({len(self.points)} points, {int(self.completed.sum())} on completed surface)"


def known_surface(surface: ExactSurface | None) -> ExactSurface:
    """The surface of a field, which is refused if there is none."""
    if surface is None:
        raise SourceError(
            "the field does not know the surface that it is the distance to",
            remedy="take it from solid_distance or sharpen(field, shape), not from a file",
        )
    return surface


def closest_points(
    surface: ExactSurface | None,
    points: NDArray[np.float64],
    field: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> ClosestPoints:
    """The nearest place of a surface for each of (n, 3) points; `field` gives the side where no face near tells it."""
    surface = known_surface(surface)
    places = surface.nearest(points - surface.origin)
    untold = places.sides == 0
    sides = places.sides.copy()
    sides[untold] = np.where(field(points[untold]) < 0, -1.0, 1.0)
    towards = np.where(places.distances > 0, sides, 1.0)
    return ClosestPoints(
        places.feet + surface.origin,
        sides * places.distances,
        places.directions * towards[:, None],
        places.completed | places.restored,
    )
