"""Interface that a `Field` needs of the solid whose distance it holds."""

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
        The nearest points, in the units of the shape.
    faces : (...) int
        Face of the given shape on which each point lies; −1 on the completion.
    barycentric : (..., 3) float
        Weights of the corners of that face, if it is a triangle. NaN elsewhere.
    gradients : (..., 3) float
        Gradients of the distance, of length 1; on the surface, its normals.
    confidence : (...) float
        1 on the given surface. On the completion it is less, the farther from the given surface.

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
        """Whether each nearest point lies on the completion instead of the given shape, (...) bool."""
        return self.faces < 0

    def __repr__(self) -> str:
        return f"Closest({counted(np.size(self.faces), 'point')}, {np.count_nonzero(self.completed)} on the completion)"


class SolidQueries(Protocol):
    """An object that answers queries at points exactly, as a `Solid` does."""

    @property
    def triangles(self) -> Floats: ...  # (m, 3, 3) corners of the triangles that distance is measured to
    def distance(self, points: ArrayLike) -> Floats: ...  # (...) signed distances of (..., d) points
    def inside(self, points: ArrayLike) -> Bools: ...  # (...) whether points are inside
    def closest(self, points: ArrayLike) -> Closest: ...  # the nearest surface points of (..., d) points


@runtime_checkable
class MakesFields(Protocol):
    """An object, such as a `Solid`, whose signed distance can be computed on the domain of a given field."""

    def field_on(self, field: Any) -> Any:
        """Compute the field of the signed distance to this object on the domain of a field."""

    def _surface_on(self, field: Any, level: float) -> Any:
        """Extract the level set at a level, with sharp edges and corners, in the cells of the field's grid."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """Queries of a solid with all distances multiplied by a factor."""

    solid: SolidQueries
    factor: float  # not 0; a negative factor exchanges inside and outside

    @property
    def triangles(self) -> Floats:
        """Corners of the m triangles that distance is measured to, (m, 3, 3) float."""
        return self.solid.triangles

    def distance(self, points: ArrayLike) -> Floats:
        """Return the (...) scaled signed distances of (..., d) points."""
        return self.factor * self.solid.distance(points)

    def inside(self, points: ArrayLike) -> Bools:
        """Return (...) bool, true where the scaled signed distance of (..., d) points is negative."""
        inside = self.solid.inside(points)
        return inside if self.factor > 0 else ~inside

    def closest(self, points: ArrayLike) -> Closest:
        """Find the nearest surface points of (..., d) points, with scaled distances and gradients."""
        closest = self.solid.closest(points)
        return replace(closest, distances=self.factor * closest.distances, gradients=self.factor * closest.gradients)


def scaled(solid: SolidQueries, factor: float) -> SolidQueries:
    """Multiply the distances that a solid returns by a factor, which is not 0; return the solid itself if it is 1."""
    if isinstance(solid, Scaled):
        return scaled(solid.solid, solid.factor * factor)
    return solid if factor == 1 else Scaled(solid, factor)
