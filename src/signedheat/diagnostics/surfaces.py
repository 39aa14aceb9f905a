"""Notes on meshes, curves and sharpening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .note import Note


@dataclass(frozen=True, eq=False, repr=False)
class TetsTurned(Note):
    """Number of tets given with negative volume, which have been turned."""

    tets_turned: int

    def __str__(self) -> str:
        return f"tets turned: {self.tets_turned}"


@dataclass(frozen=True, eq=False, repr=False)
class EdgesLengthened(Note):
    """Length that mollification has added to every edge, so that no triangle is flat."""

    added_to_edge_lengths: float

    def __str__(self) -> str:
        return f"added to edge lengths: {self.added_to_edge_lengths:.3g}"


@dataclass(frozen=True, eq=False, repr=False)
class LargeAngles(Note):
    """Fraction of angles above 120°, if it is 1 % or more: an intrinsic triangulation is then more accurate."""

    large_angles: float

    def __str__(self) -> str:
        return f"{self.large_angles:.0%} of the angles exceed 120°"


@dataclass(frozen=True, eq=False, repr=False)
class WithoutLength(Note):
    """Curves that were left out, by number, since all points of each coincide: a click where a stroke was meant."""

    without_length: NDArray[np.int64]

    def __str__(self) -> str:
        return f"curves without length left out: {', '.join(map(str, self.without_length))}"


@dataclass(frozen=True, eq=False, repr=False)
class SmallLoops(Note):
    """Number of closed curves that are smaller than a few triangles, to which the method is inaccurate."""

    small_loops: int

    def __str__(self) -> str:
        return f"closed curves smaller than a few triangles: {self.small_loops}"


@dataclass(frozen=True, eq=False, repr=False)
class VerticesAdded(Note):
    """Number of vertices added so that sources run along edges."""

    vertices_added: int

    def __str__(self) -> str:
        return f"vertices added for sources: {self.vertices_added}"


@dataclass(frozen=True, eq=False, repr=False)
class IntrinsicTriangles(Note):
    """The intrinsic triangulation on which distance was computed: summary of its angles."""

    intrinsic_triangulation: str

    def __str__(self) -> str:
        return f"intrinsic triangulation: {self.intrinsic_triangulation}"


@dataclass(frozen=True, eq=False, repr=False)
class PointsLeftOut(Note):
    """Points of a cloud that coincide with earlier ones, and points without a triangle."""

    duplicate_points: int
    points_without_triangles: NDArray[np.int64]

    def __str__(self) -> str:
        return f"{self.duplicate_points} duplicate points; {len(self.points_without_triangles)} without triangles"


@dataclass(frozen=True, eq=False, repr=False)
class SlopeErrors(Note):
    """Root mean square of ``|∇φ| − 1`` over the domain, before and after sharpening.

    Attributes
    ----------
    slope_error_before, slope_error_after : float
        The two.
    worse : bool
        Whether the slopes of most of the domain became worse, so that the field before is the better distance. Cells
        without height and the kinks that every distance has do not count: they may raise the root mean square.
    """

    slope_error_before: float
    slope_error_after: float
    worse: bool = False

    def __str__(self) -> str:
        found = f"slope error before: {self.slope_error_before:.3g}; after: {self.slope_error_after:.3g}"
        return found + ("; the field before is the better distance" if self.worse else "")


@dataclass(frozen=True, eq=False, repr=False)
class SharpenedToCurves(Note):
    """What distance of a field sharpened to curves is measured to, and what decided its sign.

    Attributes
    ----------
    completed_length : float
        Fraction of what distance is measured to that is zero set of φ, standing in for missing curve.
    free_ends : int
        Ends of oriented curves, but for those at the boundary of the surface, and points where curves run head to head.
    sides_by_curves : float
        Fraction of the vertices whose sign the curves decide by themselves; φ decides that of the others.
    """

    completed_length: float
    free_ends: int
    sides_by_curves: float

    def __str__(self) -> str:
        return (
            f"{self.completed_length:.1%} of the curve completed between {self.free_ends} free ends; "
            f"curves decide the sign of {self.sides_by_curves:.1%} of the vertices"
        )


@dataclass(frozen=True, eq=False, repr=False)
class GeodesicWindows(Note):
    """Number of windows in the exact polyhedral distance.

    Attributes
    ----------
    windows : int
        Their number, a measure of the work.
    cut_short : bool
        Whether there were so many that some distances are lengths of paths along edges instead of shortest ones.
    """

    windows: int
    cut_short: bool = False

    def __str__(self) -> str:
        return f"windows: {self.windows}" + ("; some distances are along edges, too long" if self.cut_short else "")


@dataclass(frozen=True, eq=False, repr=False)
class RoundCorners(Note):
    """Number of vertices whose path to the zero set bends around the boundary of the mesh."""

    round_corners: int

    def __str__(self) -> str:
        return f"round corners: {self.round_corners}"


@dataclass(frozen=True, eq=False, repr=False)
class ConvexRounds(Note):
    """Number of iterations and final residual of the convex method of sharpening."""

    rounds: int
    residual: float

    def __str__(self) -> str:
        return f"{self.rounds} rounds, residual {self.residual:.3g}"


@dataclass(frozen=True, eq=False, repr=False)
class Jumps(Note):
    """Objective of a piecewise distance with its lower bound, and the size of its jumps.

    Attributes
    ----------
    objective : float
        The objective of Eq. 16, before what jumps off the cut was smoothed.
    least : float
        The least that was found, before jumps were concentrated: `objective` itself where they were not.
    bound, gap : float
        A lower bound of the objective, and the relative difference of `least` and it.
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
    least: float
    bound: float
    gap: float
    rounds: int
    continuous: bool
    largest_jump: float
    cut_length: float
    integration_error: float

    def __str__(self) -> str:
        cut = "continuous" if self.continuous else f"cuts of length {self.cut_length:.3g}"
        given = f"{self.objective / self.least - 1:.2%} above it" if self.objective > self.least > 0 else "reached"
        return f"{cut}; least objective found within {self.gap:.2%}, {given}"
