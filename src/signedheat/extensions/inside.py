"""What of a grid is inside a shape, and what there is to tell of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import BoundsNothing, CompletedArea, ReachesBox


@dataclass(frozen=True, eq=False)
class Sides:
    """What is inside.

    Attributes
    ----------
    inside : (*shape) bool
        Nodes that are inside.
    function : (*shape) float
        Negative inside; its zero set, where it is farther than 1.5 cells from any face, is the completed surface.
        Outside the box it is φ.
    refused : (*shape) bool
        Nodes beside open sheets: φ and the winding number put them inside, and nothing solid is there.
    box : tuple of slice
        The part of the grid with all that may be inside.
    given : array
        φ in the box.
    open_sheets : bool
        Whether many faces bound nothing, so that what is open was taken for open.
    completed : CompletedArea, optional
    reaches_box : ReachesBox, optional
    bounds_nothing : BoundsNothing, optional
        What there is to tell.
    """

    inside: NDArray[np.bool_]
    function: NDArray[np.float64]
    refused: NDArray[np.bool_]
    box: tuple[slice, ...]
    given: NDArray[np.float64]
    open_sheets: bool = False
    completed: CompletedArea | None = None
    reaches_box: ReachesBox | None = None
    bounds_nothing: BoundsNothing | None = None

    def phi(self) -> NDArray[np.float64]:
        """(*shape) φ as it was given."""
        result: NDArray[np.float64] = self.function.copy()
        result[self.box] = self.given
        return result


def nothing_inside(shape: tuple[int, ...]) -> Sides:
    """The sides of a shape that bounds nothing."""
    nowhere = np.zeros(shape, dtype=bool)
    return Sides(nowhere, np.ones(shape), nowhere, (), np.ones(shape), True, bounds_nothing=BoundsNothing(1.0))


def closed_sides(winding: NDArray[np.float64], cell: float) -> Sides:
    """The sides of a shape whose parts are all closed: it bounds something, however small or thin its bodies are."""
    function = (0.5 - winding) * cell
    return Sides(function < 0, function, np.zeros(winding.shape, dtype=bool), (), function)
