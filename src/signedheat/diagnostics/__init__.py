"""Diagnostics of the computation of a field: one class for each kind of note."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..reprs import ShortRepr
from .note import Note
from .solids import (
    BoundsNothing,
    CompletedArea,
    FacesRestored,
    LeftOut,
    OrientedPoints,
    OutsideMesh,
    SampledSource,
    ShapeOriented,
    SharpenedToShape,
)
from .surfaces import (
    ConvexRounds,
    EdgesLengthened,
    GeodesicWindows,
    IntrinsicTriangles,
    Jumps,
    LargeAngles,
    PointsLeftOut,
    RoundCorners,
    SharpenedToCurves,
    SlopeErrors,
    SmallLoops,
    TetsTurned,
    VerticesAdded,
    WithoutLength,
)

__all__ = [
    "BoundsNothing",
    "CompletedArea",
    "ConvexRounds",
    "Diagnostics",
    "EdgesLengthened",
    "FacesRestored",
    "GeodesicWindows",
    "IntrinsicTriangles",
    "Jumps",
    "LargeAngles",
    "LeftOut",
    "Note",
    "OrientedPoints",
    "OutsideMesh",
    "PointsLeftOut",
    "RoundCorners",
    "SampledSource",
    "ShapeOriented",
    "SharpenedToCurves",
    "SharpenedToShape",
    "SlopeErrors",
    "SmallLoops",
    "TetsTurned",
    "VerticesAdded",
    "WithoutLength",
]

AnyNote = TypeVar("AnyNote", bound=Note)


@dataclass(frozen=True, repr=False)
class Diagnostics(ShortRepr):
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

    @property
    def important(self) -> list[Note]:
        """Notes to read before the result is trusted."""
        return [note for note in self.notes if note.important]

    def note(self, kind: type[AnyNote]) -> AnyNote | None:
        """The note of a given type, or None."""
        return next((note for note in self.notes if isinstance(note, kind)), None)

    def noting(self, *notes: Note) -> Diagnostics:
        """The same with further notes, each replacing an older one of the same type."""
        kinds = {type(note) for note in notes}
        return replace(self, notes=(*(note for note in self.notes if type(note) not in kinds), *notes))
