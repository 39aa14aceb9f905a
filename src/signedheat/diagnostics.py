"""Diagnostics of the computation of a field, with one class for each kind of note."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import ClassVar, TypeVar

import numpy as np

from .arrays import Frozen, Ints, ShortRepr, place
from .errors import Sentence, percent

SMALL_SHARE = 0.005
"""Fraction of a surface above which a note on its completion, or on parts that bound nothing or that a contour misses,
is important."""


@dataclass(frozen=True, eq=False, repr=False)
class Note(Frozen, ShortRepr):
    """Base class of notes on a computation. A note has numbers and lists as fields, and ``str(note)`` is a sentence.

    `text` is a format string in which ``{0.name}`` stands for a field. A note is important if any of its fields exceeds
    the number of the same name in `limits`.
    """

    text: ClassVar[str] = ""
    limits: ClassVar[Mapping[str, float]] = {}

    def __str__(self) -> str:
        return Sentence().format(self.text, self)

    @property
    def important(self) -> bool:
        """Whether the note should be read before the result is trusted. Commands print important notes."""
        return any(getattr(self, name) > limit for name, limit in self.limits.items())

    def __post_init__(self) -> None:
        for entry in fields(self):  # counts and areas are often scalars of NumPy
            value = getattr(self, entry.name)
            if isinstance(value, np.generic):
                object.__setattr__(self, entry.name, value.item())

    def as_dict(self) -> dict[str, object]:
        """Return the fields of the note by name, as values that JSON can hold."""
        return asdict(self)


AnyNote = TypeVar("AnyNote", bound=Note)


@dataclass(frozen=True, eq=False, repr=False)
class Diagnostics(ShortRepr):
    """Timings, diffusion time, and notes on the computation of a field.

    Attributes
    ----------
    timings : mapping of str to float
        Seconds that each step took, by the name of the step.
    time : float
        Time for which normals of the source were diffused like heat, in squared units of length; NaN if none were.
    unreached : (k,) int
        Ids of the unknowns that are connected to no source, at which the field is NaN.
    notes : tuple of Note
        Notes such as on faces that were flipped, sources that were left out, or residuals. `note` finds one by its
        type.

    See Also
    --------
    complete : Make a solid of a broken shape.
    signed_distance : Distance on a grid, on tets or along a surface.

    Examples
    --------
    >>> diagnostics = Diagnostics().noting(TetsTurned(3), SlopeErrors(0.2, 0.1))
    >>> print(diagnostics.note(TetsTurned))
    tets flipped: 3
    >>> diagnostics.note(LargeAngles) is None
    True
    """

    timings: Mapping[str, float] = field(default_factory=dict)
    time: float = float("nan")
    unreached: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    notes: tuple[Note, ...] = ()

    @property
    def important(self) -> list[Note]:
        """The notes that should be read before the result is trusted, in order."""
        return [note for note in self.notes if note.important]

    def note(self, kind: type[AnyNote]) -> AnyNote | None:
        """Return the note of a given type, or None if there is none.

        Parameters
        ----------
        kind : type
            A class of notes in `signedheat.diagnostics`, such as ``TetsTurned``.

        Returns
        -------
        Note or None
            The first of `notes` that has this type.

        See Also
        --------
        results.Diagnostics.noting : Add notes.

        Examples
        --------
        >>> Diagnostics(notes=(TetsTurned(3),)).note(TetsTurned)
        TetsTurned(tets_turned=3)
        """
        return next((note for note in self.notes if isinstance(note, kind)), None)

    def noting(self, *notes: Note) -> Diagnostics:
        """Return a copy with more notes. A new note replaces older ones of the same type.

        Parameters
        ----------
        *notes : Note
            The notes to add, in the order in which they should be read.

        Returns
        -------
        Diagnostics
            The copy. This object does not change.

        See Also
        --------
        results.Diagnostics.note : Find a note by its type.

        Examples
        --------
        >>> Diagnostics().noting(TetsTurned(3)).noting(TetsTurned(4)).notes
        (TetsTurned(tets_turned=4),)
        """
        kinds = {type(note) for note in notes}
        return replace(self, notes=(*(note for note in self.notes if type(note) not in kinds), *notes))


@dataclass(frozen=True, eq=False, repr=False)
class SampledSource(Note):
    """Samples that represent a source on a grid: their number, the area outside the grid, and the area that cancels."""

    samples: int
    area_outside: float
    area_cancelled: float
    text: ClassVar[str] = (
        "{0.samples:sample} of the source; {0.area_outside:.3g} of its area lies outside the grid, "
        "{0.area_cancelled:.3g} cancels"
    )


@dataclass(frozen=True, eq=False, repr=False)
class OutsideMesh(Note):
    """Indices of the sources that leave a tet mesh, and the fraction of the area of each that is outside."""

    sources_outside: list[int]
    area_left_out: list[float]

    def __str__(self) -> str:
        shares = zip(self.sources_outside, self.area_left_out, strict=True)
        return "; ".join(f"source {k} outside the mesh: {percent(part)} of its area, left out" for k, part in shares)


@dataclass(frozen=True, eq=False, repr=False)
class ShapeOriented(Note):
    """Numbers on the orientation of a shape's faces, as in `Orientation`, with areas as fractions of the whole area."""

    turned_faces: int = 0
    turned_area: float = 0.0
    turned_parts: int = 0
    merged_faces: int = 0
    nonorientable_parts: int = 0
    undecided_area: float = 0.0
    nested_bodies: int = 0
    cavities: int = 0
    limits: ClassVar[Mapping[str, float]] = {"turned_faces": 0, "merged_faces": 0}

    def __str__(self) -> str:
        texts = [
            (self.turned_faces, f"faces flipped: {self.turned_faces}, {percent(self.turned_area)} of the area"),
            (self.merged_faces, f"duplicate faces merged: {self.merged_faces}"),
            (self.nonorientable_parts, f"parts that cannot be oriented: {self.nonorientable_parts}"),
            (self.nested_bodies, f"bodies hidden in others: {self.nested_bodies}"),
            (self.cavities, f"cavities: {self.cavities}"),
            (self.undecided_area, f"sheets without an inside: {percent(self.undecided_area)} of the area"),
        ]
        return "; ".join(text for value, text in texts if value) or "faces are oriented as they were given"


@dataclass(frozen=True, eq=False, repr=False)
class OrientedPoints(Note):
    """Numbers of the normals of a point cloud that were fitted, and of those that were flipped."""

    normals_fitted: int
    normals_turned: int
    limits: ClassVar[Mapping[str, float]] = {"normals_fitted": 0, "normals_turned": 0}
    text: ClassVar[str] = "{0.normals_fitted:normal} fitted, {0.normals_turned} flipped"


@dataclass(frozen=True, eq=False, repr=False)
class StrayPoints(Note):
    """Points far from all others, which were left out of a point cloud."""

    stray_points: int
    limits: ClassVar[Mapping[str, float]] = {"stray_points": 0}
    text: ClassVar[str] = "stray points left out: {0.stray_points}"


@dataclass(frozen=True, eq=False, repr=False)
class SmallParts(Note):
    """Connected parts of a mesh that are smaller than asked for, which were left out."""

    small_parts: int
    small_area: float  # their fraction of the area
    limits: ClassVar[Mapping[str, float]] = {"small_parts": 0}
    text: ClassVar[str] = "left out: {0.small_parts:part} smaller than asked for, {0.small_area:%} of the area"


@dataclass(frozen=True, eq=False, repr=False)
class LeftOut(Note):
    """Faces that were left out of a shape because they lie inside other bodies of it."""

    covered_faces: int = 0  # number of faces, or points of a cloud, that lie inside other bodies, wholly or in part
    covered_area: float = 0.0  # their area, as a fraction of the whole area
    cut_faces: int = 0  # number of faces that lie inside in part, and were cut
    limits: ClassVar[Mapping[str, float]] = {"covered_faces": 0}
    text: ClassVar[str] = (
        "left out: {0.covered_faces:face}, {0.covered_area:%} of the area, that lie inside other bodies "
        "({0.cut_faces} of them in part)"
    )


@dataclass(frozen=True, eq=False, repr=False)
class FacesRestored(Note):
    """Number of missing faces that were restored between existing vertices, and their share of the area."""

    restored_faces: int
    restored_area: float
    limits: ClassVar[Mapping[str, float]] = {"restored_faces": 0}
    text: ClassVar[str] = "lost faces restored: {0.restored_faces}, {0.restored_area:%} of the area"


@dataclass(frozen=True, eq=False, repr=False)
class SharpenedToShape(Note):
    """Fraction of the zero set that completes a shape: its triangles far from faces, to which distance is measured."""

    completed_zero_set: float
    text: ClassVar[str] = "{0.completed_zero_set:%} of the zero set completes the shape"


@dataclass(frozen=True, eq=False, repr=False)
class CompletedArea(Note):
    """Area of a solid's surface that was added by completion, and boxes around it."""

    completed_area: float  # in squared units of length
    completed_share: float  # the same as a fraction of the area of the whole surface
    where: list[list[list[float]]]  # (k, 2, d) lower and upper corners of boxes around the completion
    limits: ClassVar[Mapping[str, float]] = {"completed_share": SMALL_SHARE}

    def __str__(self) -> str:
        text = f"{percent(self.completed_share)} of the surface is completed"
        if not len(self.where):
            return text
        lower, upper = (place(corner, self.where[0]) for corner in self.where[0])
        return f"{text}, most of it between {lower} and {upper}"


@dataclass(frozen=True, eq=False, repr=False)
class BoundsNothing(Note):
    """Fraction of the area that bounds nothing. Both of its sides are outside, and distance to it is positive."""

    open_area: float
    limits: ClassVar[Mapping[str, float]] = {"open_area": SMALL_SHARE}
    text: ClassVar[str] = "{0.open_area:%} of the area bounds nothing: distance to it is positive on both sides"


@dataclass(frozen=True, eq=False, repr=False)
class TetsTurned(Note):
    """Number of tets that were given with negative volume, and were flipped."""

    tets_turned: int
    text: ClassVar[str] = "tets flipped: {0.tets_turned}"


@dataclass(frozen=True, eq=False, repr=False)
class EdgesLengthened(Note):
    """Length, in units of the mesh, that mollification has added to every edge, so that no triangle is flat."""

    added_to_edge_lengths: float
    text: ClassVar[str] = "added to edge lengths: {0.added_to_edge_lengths:.3g}"


@dataclass(frozen=True, eq=False, repr=False)
class LargeAngles(Note):
    """Fraction of angles above 120°, noted if it is 1 % or more. An intrinsic triangulation is then more accurate."""

    large_angles: float
    text: ClassVar[str] = "{0.large_angles:%} of the angles exceed 120°"


@dataclass(frozen=True, eq=False, repr=False)
class WithoutLength(Note):
    """Numbers of curves that were left out since all of their points coincide, as when a user only clicks."""

    without_length: list[int]

    def __str__(self) -> str:
        return f"curves without length left out: {', '.join(map(str, self.without_length))}"


@dataclass(frozen=True, eq=False, repr=False)
class SmallLoops(Note):
    """Number of closed curves smaller than a few triangles. The signed heat method is inaccurate for them."""

    small_loops: int
    text: ClassVar[str] = "closed curves smaller than a few triangles: {0.small_loops}"


@dataclass(frozen=True, eq=False, repr=False)
class VerticesJoined(Note):
    """Number of vertices on seams of a mesh that were welded to others at the same position."""

    vertices_joined: int
    text: ClassVar[str] = "vertices joined at seams: {0.vertices_joined}"


@dataclass(frozen=True, eq=False, repr=False)
class VerticesAdded(Note):
    """Number of vertices that were added to a triangulation so that sources run along its edges."""

    vertices_added: int
    text: ClassVar[str] = "vertices added for sources: {0.vertices_added}"


@dataclass(frozen=True, eq=False, repr=False)
class IntrinsicTriangles(Note):
    """Summary of the angles of the intrinsic triangulation on which distance was computed."""

    intrinsic_triangulation: str
    text: ClassVar[str] = "intrinsic triangulation: {0.intrinsic_triangulation}"


@dataclass(frozen=True, eq=False, repr=False)
class PointsLeftOut(Note):
    """Number of points of a cloud that coincide with earlier ones, and the indices of points without a triangle."""

    duplicate_points: int
    points_without_triangles: list[int]

    def __str__(self) -> str:
        return f"{self.duplicate_points} duplicate points; {len(self.points_without_triangles)} without triangles"


@dataclass(frozen=True, eq=False, repr=False)
class SlopeErrors(Note):
    """Root mean square of ``|∇φ| − 1`` over the domain, before and after sharpening."""

    slope_error_before: float
    slope_error_after: float
    # whether slopes on most of the domain became worse, so that the field before is the better distance. Flat cells and
    # kinks of the distance hardly count for this, although they may raise the root mean square
    worse: bool = False

    def __str__(self) -> str:
        text = f"slope error before: {self.slope_error_before:.3g}; after: {self.slope_error_after:.3g}"
        return text + ("; the field before is the better distance" if self.worse else "")


@dataclass(frozen=True, eq=False, repr=False)
class SharpenedToCurves(Note):
    """Shares that φ and the given curves have in the distance and sign of a field that was sharpened to curves."""

    completed_length: float  # length of the zero set of φ in place of missing curves, relative to the whole length
    free_ends: int  # ends of oriented curves inside the surface, and points where curves run head to head
    sides_by_curves: float  # fraction of the vertices whose sign the curves decide; φ decides the others
    text: ClassVar[str] = (
        "{0.completed_length:%} of the curve completed between {0.free_ends} free ends; curves decide the sign of "
        "{0.sides_by_curves:%} of the vertices"
    )


@dataclass(frozen=True, eq=False, repr=False)
class GeodesicWindows(Note):
    """Number of windows in the computation of exact polyhedral distance, a measure of its work."""

    windows: int
    cut_short: bool = False  # whether some distances are lengths of paths along edges instead of shortest paths

    def __str__(self) -> str:
        return f"windows: {self.windows}" + ("; some distances are along edges, too long" if self.cut_short else "")


@dataclass(frozen=True, eq=False, repr=False)
class RoundCorners(Note):
    """Number of vertices whose shortest path to the zero set bends around the boundary of the tet mesh."""

    round_corners: int
    text: ClassVar[str] = "round corners: {0.round_corners}"


@dataclass(frozen=True, eq=False, repr=False)
class ConvexRounds(Note):
    """Number of iterations and final residual of the convex method of sharpening."""

    rounds: int
    residual: float
    text: ClassVar[str] = "{0.rounds:round}, residual {0.residual:.3g}"


@dataclass(frozen=True, eq=False, repr=False)
class Jumps(Note):
    """Objective of `piecewise_distance` with a lower bound of it, and the size of the jumps."""

    objective: float  # value of Eq. 16, before φ was made continuous away from the cut
    bound: float  # a lower bound of the objective
    gap: float  # relative difference of the objective and its bound
    rounds: int  # iterations of the minimisation
    continuous: bool  # whether there is no cut
    largest_jump: float
    cut_length: float  # total length of all cuts
    integration_error: float  # root mean square of ∇φ̄ − Y, φ̄ being φ averaged at the vertices of `Field.expand`

    def __str__(self) -> str:
        cut = "continuous" if self.continuous else f"cuts of length {self.cut_length:.3g}"
        return f"{cut}; objective within {percent(self.gap)} of the least"
