"""Queries of a solid at points: what a field needs of the solid whose distance it holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints
from ..errors import counted


@dataclass(frozen=True, eq=False)
class Closest:
    """The nearest points on a solid's surface, in arrays of the shape of the query points.

    Attributes
    ----------
    distances : (...) float
        Signed distances, negative inside, in the units of the shape.
    points : (..., 3) float
        The nearest points.
    faces : (...) int
        Face of the given shape on which each point lies; −1 on the completion.
    barycentric : (..., 3) float
        Weights of the corners of that face, if it is a triangle. NaN elsewhere.
    gradients : (..., 3) float
        Gradients of the distance, of length 1; on the surface, its normals.
    confidence : (...) float
        1 on the given surface; on the completion less, the farther from its boundary.

    See Also
    --------
    Solid.closest : Nearest points on the surface.

    Examples
    --------
    >>> from signedheat import complete, samples
    >>> found = complete(samples.sphere(2)).closest([[0.0, 0.0, 3.0]])
    >>> found.distances.round(3), found.gradients.round(3).tolist(), found.completed
    (array([2.]), [[0.0, 0.0, 1.0]], array([False]))
    """

    distances: Floats
    points: Floats
    faces: Ints
    barycentric: Floats
    gradients: Floats
    confidence: NDArray[np.float32]

    @property
    def completed(self) -> Bools:
        """(...) whether the place lies on the completion."""
        return self.faces < 0

    def __repr__(self) -> str:
        return f"Closest({counted(np.size(self.faces), 'point')}, {np.count_nonzero(self.completed)} on the completion)"


class SolidQueries(Protocol):
    """An object that answers queries at points exactly, as a `Solid` does."""

    @property
    def triangles(self) -> Floats: ...  # (m, 3, 3) corners of the triangles that distance is measured to
    def distance(self, points: ArrayLike) -> Floats: ...  # (...) signed distances of (..., d) points
    def inside(self, points: ArrayLike) -> Bools: ...  # (...) whether points are inside
    def closest(self, points: ArrayLike) -> Closest: ...  # the nearest place for each of (..., d) points


@runtime_checkable
class MakesFields(Protocol):
    """An object whose distance can be computed where a field has values, such as a `Solid`."""

    def field_on(self, field: Any) -> Any:
        """Compute distance on the domain of a field."""

    def _surface_on(self, field: Any, level: float) -> Any:
        """Extract the surface at a level of its field, with edges and corners, in the cells of the field's grid."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """The distance to a solid times a number."""

    solid: SolidQueries
    factor: float  # not 0; a negative factor exchanges inside and outside

    @property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners of the triangles that distance is measured to."""
        return self.solid.triangles

    def distance(self, points: ArrayLike) -> Floats:
        """Return (...) values at (..., d) points."""
        return self.factor * self.solid.distance(points)

    def inside(self, points: ArrayLike) -> Bools:
        """Return (...) whether the values are negative at points."""
        inside = self.solid.inside(points)
        return inside if self.factor > 0 else ~inside

    def closest(self, points: ArrayLike) -> Closest:
        """Find the nearest place for each of (..., d) points, with the values and their gradients."""
        closest = self.solid.closest(points)
        return replace(closest, distances=self.factor * closest.distances, gradients=self.factor * closest.gradients)


def scaled(solid: SolidQueries, factor: float) -> SolidQueries:
    """Multiply the distance to a solid by a number; return the solid itself if that is 1."""
    if isinstance(solid, Scaled):
        return scaled(solid.solid, solid.factor * factor)
    return solid if factor == 1 else Scaled(solid, factor)
