"""Notes on shapes in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .note import Note

SMALL = 0.005
"""Fraction of the surface that may be completed, or bound nothing, without being important."""


@dataclass(frozen=True, eq=False, repr=False)
class SampledSource(Note):
    """The source on a grid, merged in its cells: number of samples, fractions of the area outside and cancelled."""

    samples: int
    area_outside: float
    area_cancelled: float

    def __str__(self) -> str:
        return (
            f"{self.samples} samples of the source; {self.area_outside:.3g} of its area lies outside the grid, "
            f"{self.area_cancelled:.3g} cancels"
        )


@dataclass(frozen=True, eq=False, repr=False)
class OutsideMesh(Note):
    """Sources that leave the tet mesh: their indices, and the fraction of the area of each that is dropped."""

    sources_outside: NDArray[np.int64]
    area_left_out: NDArray[np.float64]

    def __str__(self) -> str:
        shares = zip(self.sources_outside, self.area_left_out, strict=True)
        return "; ".join(f"source {k} outside the mesh: {100 * part:.3g} % of its area, left out" for k, part in shares)


@dataclass(frozen=True, eq=False, repr=False)
class ShapeOriented(Note):
    """How the faces of a shape were oriented; fractions are of its area. The values are those of `Orientation`."""

    turned_faces: int
    turned_area: float
    turned_parts: int
    merged_faces: int
    nonorientable_parts: int
    undecided_area: float
    doubled_walls: int
    nested_bodies: int
    cavities: int

    @property
    def important(self) -> bool:
        return self.turned_faces > 0 or self.merged_faces > 0

    def __str__(self) -> str:
        texts = [
            (self.turned_faces, f"faces turned: {self.turned_faces}, {self.turned_area:.1%} of the area"),
            (self.merged_faces, f"duplicate faces merged: {self.merged_faces}"),
            (self.nonorientable_parts, f"parts that cannot be oriented: {self.nonorientable_parts}"),
            (self.doubled_walls, f"doubled walls: {self.doubled_walls}"),
            (self.nested_bodies, f"bodies hidden in others: {self.nested_bodies}"),
            (self.cavities, f"cavities: {self.cavities}"),
            (self.undecided_area, f"sheets without an inside: {self.undecided_area:.1%} of the area"),
        ]
        return "; ".join(text for value, text in texts if value) or "faces are oriented as they were given"


@dataclass(frozen=True, eq=False, repr=False)
class OrientedPoints(Note):
    """Number of normals of a point cloud that were fitted, and that were turned."""

    normals_fitted: int
    normals_turned: int

    @property
    def important(self) -> bool:
        return self.normals_fitted > 0 or self.normals_turned > 0

    def __str__(self) -> str:
        return f"{self.normals_fitted} normals fitted, {self.normals_turned} turned"


@dataclass(frozen=True, eq=False, repr=False)
class LeftOut(Note):
    """What a union leaves out of a shape.

    Attributes
    ----------
    covered_faces : int
        Faces, or points, that lie inside other bodies, wholly or in part.
    covered_area : float
        Their fraction of the area, as far as they do.
    cut_faces : int
        Those that lie inside in part, and were cut.
    merged_faces : int
        Duplicates.
    doubled_walls : int
        Faces that are there twice, once facing each way; they stay, unless they lie inside a body.
    """

    covered_faces: int = 0
    covered_area: float = 0.0
    cut_faces: int = 0
    merged_faces: int = 0
    doubled_walls: int = 0

    @property
    def important(self) -> bool:
        return self.covered_faces > 0

    def __str__(self) -> str:
        return (
            f"left out: {self.covered_faces} faces, {self.covered_area:.1%} of the area, that lie inside other bodies "
            f"({self.cut_faces} of them in part), and {self.merged_faces} duplicates"
        )


@dataclass(frozen=True, eq=False, repr=False)
class FacesRestored(Note):
    """Number of faces that were lost between vertices which are there, and are put back; their share of the area."""

    restored_faces: int
    restored_area: float

    @property
    def important(self) -> bool:
        return True

    def __str__(self) -> str:
        return f"lost faces restored: {self.restored_faces}, {self.restored_area:.1%} of the area"


@dataclass(frozen=True, eq=False, repr=False)
class SharpenedToShape(Note):
    """Fraction of the zero set's triangles that distance is measured to, where the shape has no faces."""

    completed_zero_set: float

    def __str__(self) -> str:
        return f"{self.completed_zero_set:.1%} of the zero set completes the shape"


@dataclass(frozen=True, eq=False, repr=False)
class CompletedArea(Note):
    """How much of the surface of a solid is its completion, not a face that was given.

    Attributes
    ----------
    completed_area : float
        Area of the completion, in squared units of length.
    completed_share : float
        The same, over the area of the whole surface.
    where : (k, 2, d) float
        Lower and upper corners of boxes around it.
    """

    completed_area: float
    completed_share: float
    where: NDArray[np.float64]

    @property
    def important(self) -> bool:
        return self.completed_share > SMALL

    def __str__(self) -> str:
        text = f"{self.completed_share:.1%} of the surface is completed"
        if not len(self.where):
            return text
        lower, upper = ("(" + ", ".join(f"{x:.4g}" for x in corner) + ")" for corner in self.where[0])
        return f"{text}, most of it between {lower} and {upper}"


@dataclass(frozen=True, eq=False, repr=False)
class BoundsNothing(Note):
    """Fraction of the area that has the same side on both sides: distance to it is positive all around."""

    open_area: float

    @property
    def important(self) -> bool:
        return self.open_area > SMALL

    def __str__(self) -> str:
        return f"{self.open_area:.1%} of the area bounds nothing: distance to it is positive on both sides"
