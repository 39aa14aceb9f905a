"""Diagnostics of the computation of a field: one class for each kind of note."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

AnyNote = TypeVar("AnyNote", bound="Note")


@dataclass(frozen=True, eq=False)
class Note:
    """A note on a computation; ``str(note)`` is its text."""

    def as_dict(self) -> dict[str, object]:
        """The values of the note by name, ready for JSON."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values.items()}


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class OutsideMesh(Note):
    """Sources that leave the tet mesh: their indices, and the fraction of the area of each that is dropped."""

    sources_outside: NDArray[np.int64]
    area_left_out: NDArray[np.float64]

    def __str__(self) -> str:
        told = zip(self.sources_outside, self.area_left_out, strict=True)
        return "; ".join(f"source {k} outside the mesh: {100 * part:.3g} % of its area, left out" for k, part in told)


@dataclass(frozen=True, eq=False)
class TetsTurned(Note):
    """Number of tets given with negative volume, which have been turned."""

    tets_turned: int

    def __str__(self) -> str:
        return f"tets turned: {self.tets_turned}"


@dataclass(frozen=True, eq=False)
class EdgesLengthened(Note):
    """Length that mollification has added to every edge, so that no triangle is flat."""

    added_to_edge_lengths: float

    def __str__(self) -> str:
        return f"added to edge lengths: {self.added_to_edge_lengths:.3g}"


@dataclass(frozen=True, eq=False)
class LargeAngles(Note):
    """Fraction of angles above 120°, if it is 1 % or more: an intrinsic triangulation is then more accurate."""

    large_angles: float

    def __str__(self) -> str:
        return f"{self.large_angles:.0%} of the angles exceed 120°"


@dataclass(frozen=True, eq=False)
class VerticesAdded(Note):
    """Number of vertices added so that sources run along edges."""

    vertices_added: int

    def __str__(self) -> str:
        return f"vertices added for sources: {self.vertices_added}"


@dataclass(frozen=True, eq=False)
class IntrinsicTriangles(Note):
    """The intrinsic triangulation on which distance was computed: summary of its angles."""

    intrinsic_triangulation: str

    def __str__(self) -> str:
        return f"intrinsic triangulation: {self.intrinsic_triangulation}"


@dataclass(frozen=True, eq=False)
class PointsLeftOut(Note):
    """Points of a cloud that coincide with earlier ones, and points without a triangle."""

    duplicate_points: int
    points_without_triangles: NDArray[np.int64]

    def __str__(self) -> str:
        return f"{self.duplicate_points} duplicate points; {len(self.points_without_triangles)} without triangles"


@dataclass(frozen=True, eq=False)
class SlopeErrors(Note):
    """Root mean square of ``|∇φ| − 1`` over the domain, before and after sharpening."""

    slope_error_before: float
    slope_error_after: float

    def __str__(self) -> str:
        return f"slope error before: {self.slope_error_before:.3g}; after: {self.slope_error_after:.3g}"


@dataclass(frozen=True, eq=False)
class SharpenedToShape(Note):
    """Fraction of the faces left out because they lie in layers, and of the zero set that stands in for faces."""

    layered_faces: float
    completed_zero_set: float

    def __str__(self) -> str:
        return (
            f"{self.completed_zero_set:.1%} of the zero set completed, {self.layered_faces:.1%} of the faces in layers"
        )


@dataclass(frozen=True, eq=False)
class GeodesicWindows(Note):
    """Number of windows in the exact polyhedral distance."""

    windows: int

    def __str__(self) -> str:
        return f"windows: {self.windows}"


@dataclass(frozen=True, eq=False)
class RoundCorners(Note):
    """Number of vertices whose path to the zero set bends around the boundary of the mesh."""

    round_corners: int

    def __str__(self) -> str:
        return f"round corners: {self.round_corners}"


@dataclass(frozen=True, eq=False)
class ConvexRounds(Note):
    """Number of iterations and final residual of the convex method of sharpening."""

    rounds: int
    residual: float

    def __str__(self) -> str:
        return f"{self.rounds} rounds, residual {self.residual:.3g}"


@dataclass(frozen=True, eq=False)
class Jumps(Note):
    """Objective of a piecewise distance with its lower bound, and the size of its jumps.

    Attributes
    ----------
    objective, bound, gap : float
        The objective of Eq. 16, a lower bound of it, and the relative difference of the two.
    rounds : int
        Number of iterations.
    continuous : bool
        Whether there is no cut.
    largest_jump, cut_length : float
        The largest jump, and the total length of all cuts.
    integration_error : float
        Root mean square of ∇φ̄ − Y, φ̄ being φ averaged at the vertices of `PiecewiseField.split`.
    """

    objective: float
    bound: float
    gap: float
    rounds: int
    continuous: bool
    largest_jump: float
    cut_length: float
    integration_error: float

    def __str__(self) -> str:
        cut = "continuous" if self.continuous else f"cuts of length {self.cut_length:.3g}"
        return f"{cut}; within {self.gap:.2%} of the least objective"


@dataclass(frozen=True)
class Diagnostics:
    """Timings, diffusion time, and notes on the computation of a field.

    Attributes
    ----------
    timings : mapping of str to float
        Seconds per step.
    time : float
        Diffusion time t, in squared units of length.
    unreached : (k,) int
        Unknowns that are connected to no source; φ is NaN there.
    notes : tuple of Note
        Residuals, repairs, subdivisions, dropped parts of sources; `note` finds one by its type.

    Examples
    --------
    >>> diagnostics = Diagnostics().noting(TetsTurned(3), SlopeErrors(0.2, 0.1))
    >>> print(diagnostics.note(TetsTurned))
    tets turned: 3
    >>> diagnostics.note(LargeAngles) is None
    True
    """

    timings: Mapping[str, float] = field(default_factory=dict)
    time: float = float("nan")
    unreached: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    notes: tuple[Note, ...] = ()

    def note(self, kind: type[AnyNote]) -> AnyNote | None:
        """The note of a given type, or None."""
        return next((note for note in self.notes if isinstance(note, kind)), None)

    def noting(self, *notes: Note) -> Diagnostics:
        """The same with further notes, each replacing an older one of the same type."""
        kinds = {type(note) for note in notes}
        return replace(self, notes=(*(note for note in self.notes if type(note) not in kinds), *notes))
