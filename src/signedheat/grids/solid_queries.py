"""Queries of a solid at points: what a field needs of the solid that it is the distance to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Closest:
    """The nearest place of a solid's surface for each of some points, in the shape of these.

    Attributes
    ----------
    distances : (...) float
        Signed distances, negative inside.
    points : (..., 3) float
        The nearest places.
    faces : (...) int
        Face of the shape that was given on which each lies; −1 on the completion.
    barycentric : (..., 3) float
        Where in it: weights of its corners, for triangles; NaN elsewhere.
    gradients : (..., 3) float
        Gradients of the distance, of length 1; on the surface, its normals.
    confidence : (...) float
        1 where surface was given; on the completion less, the farther from its rim.

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
        return f"Closest({np.size(self.faces)} points, {np.count_nonzero(self.completed)} on the completion)"


class SolidQueries(Protocol):
    """What can answer queries at points exactly, as a `Solid` does."""

    @property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners of all that distance is measured to."""

    def distance(self, points: ArrayLike) -> Floats:
        """(...) signed distances of (..., d) points, negative inside."""

    def inside(self, points: ArrayLike) -> Bools:
        """(...) whether points are inside."""

    def closest(self, points: ArrayLike) -> Closest:
        """The nearest place for each of (..., d) points."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """The distance to a solid times a number, which is not 0."""

    solid: SolidQueries
    factor: float  # what its distance is multiplied by; where it is negative inside and outside are exchanged

    @property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners of all that distance is measured to."""
        return self.solid.triangles

    def distance(self, points: ArrayLike) -> Floats:
        """(...) values at (..., d) points."""
        return self.factor * self.solid.distance(points)

    def inside(self, points: ArrayLike) -> Bools:
        """(...) whether points are where the values are negative."""
        found = self.solid.inside(points)
        return found if self.factor > 0 else ~found

    def closest(self, points: ArrayLike) -> Closest:
        """The nearest place for each of (..., d) points, with the values and their gradients."""
        found = self.solid.closest(points)
        return replace(found, distances=self.factor * found.distances, gradients=self.factor * found.gradients)


def scaled(solid: SolidQueries, factor: float) -> SolidQueries:
    """The distance to a solid times a number; the solid itself, where that is 1."""
    if isinstance(solid, Scaled):
        return scaled(solid.solid, solid.factor * factor)
    return solid if factor == 1 else Scaled(solid, factor)
