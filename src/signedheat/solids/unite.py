"""Unite what closes a solid: faces cut where they cross, and those left out that lie inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..diagnostics import BoundsNothing, CompletedArea, Diagnostics, LeftOut, Note
from ..geometry.cut_faces import cut_faces
from ..geometry.meshes import face_areas
from ..geometry.welding import same_positions
from . import parts
from .solid import Solid
from .winding import Windings

TRUST = 0.05
"""Distance from what was given, over its diagonal, at which confidence in the completion has fallen to a half."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one kind.

    Attributes
    ----------
    triangles : (m, 3, 3) float
        Corners.
    ids : (m, 3) int
        Vertices, one number for each position.
    origins : (m,) int
        Face that was given, or −1.
    closing : bool
        Whether they count in the winding number.
    """

    triangles: NDArray[np.float64]
    ids: NDArray[np.int64]
    origins: NDArray[np.int64]
    closing: bool

    @classmethod
    def made(cls, triangles: NDArray[np.float64], closing: bool = True) -> Surface:
        """Triangles that were not given; their vertices have negative numbers."""
        ids = -1 - same_positions(triangles.reshape(-1, 3)).reshape(-1, 3)
        return cls(triangles, ids, np.full(len(triangles), -1), closing)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64], closing: bool) -> Surface:
        """Some of its triangles."""
        return Surface(self.triangles[chosen], self.ids[chosen], self.origins[chosen], closing)


def united(
    surfaces: list[Surface],
    keep_overlaps: bool,
    notes: Sequence[Note] = (),
    points: NDArray[np.float64] | None = None,
    copies: int = 0,
) -> Solid:
    """The solid that surfaces close: without what lies inside, where bodies overlap, and without idle completion."""
    whole = _joined(surfaces)
    closing = np.concatenate([np.full(len(each.triangles), each.closing) for each in surfaces])
    windings = Windings(whole.triangles[closing])
    triangles, parents, behind, ahead = _cut(whole, closing, windings)
    origins = whole.origins[parents]
    given = origins >= 0
    buried = behind & ahead
    bounds = behind != ahead
    kept = np.where(given, ~buried | keep_overlaps, bounds | ~closing[parents])
    if not kept.any():
        kept[:] = True
    confidence = _confidence(triangles[kept], given[kept], whole, points)
    diagnostics = Diagnostics(notes=(*notes, *_notes(triangles, origins, kept, buried & ~kept, bounds, copies)))
    bounding = (behind & ~ahead)[kept]
    return Solid(triangles[kept], origins[kept], confidence, bounding, windings, None, diagnostics)


def _cut(
    whole: Surface, closing: NDArray[np.bool_], windings: Windings
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Triangles cut along those that close, the triangle each is a piece of, and whether it is inside behind and ahead.

    Between cuts both sides are the same all over a part, which is looked at once.
    """
    pieces, parents, met = cut_faces(whole.triangles, whole.ids, whole.triangles[closing], whole.ids[closing])
    regions = np.arange(len(pieces))
    uncut = np.flatnonzero(~met[parents])
    if len(uncut):
        labels = parts.parts_of(whole.ids[parents[uncut]])
        largest = np.lexsort((-face_areas(pieces[uncut]), labels))
        _, first = np.unique(labels[largest], return_index=True)
        regions[uncut] = uncut[largest[first]][labels]
    some, where = np.unique(regions, return_inverse=True)
    behind, ahead = windings.sides(pieces[some])
    return pieces, parents, behind[where], ahead[where]


def _notes(
    triangles: NDArray[np.float64],
    origins: NDArray[np.int64],
    kept: NDArray[np.bool_],
    buried: NDArray[np.bool_],
    bounds: NDArray[np.bool_],
    copies: int,
) -> list[Note]:
    notes: list[Note] = []
    areas, given = face_areas(triangles), origins >= 0
    total = max(float(areas[given].sum()), np.finfo(float).tiny)
    covered = buried & given
    if covered.any() or copies:
        faces, others = np.unique(origins[covered]), np.unique(origins[given & kept])
        cut = int(np.isin(faces, others).sum())
        notes.append(LeftOut(len(faces), float(areas[covered].sum()) / total, cut, copies))
    made = kept & ~given
    if made.any():
        area, corners = float(areas[made].sum()), triangles[made].reshape(-1, 3)
        box = np.stack([corners.min(axis=0), corners.max(axis=0)])
        notes.append(CompletedArea(area, area / float(areas[kept].sum()), [box.tolist()]))
    idle = given & kept & ~bounds
    if float(areas[idle].sum()) > 1e-6 * total:
        notes.append(BoundsNothing(float(areas[idle].sum()) / total))
    return notes


def _confidence(
    triangles: NDArray[np.float64], given: NDArray[np.bool_], whole: Surface, points: NDArray[np.float64] | None
) -> NDArray[np.float32]:
    """(m,) 1 where surface was given; where it was completed less, the farther from what was given."""
    confidence = np.ones(len(triangles), dtype=np.float32)
    if points is None:
        points = whole.triangles[whole.origins >= 0].reshape(-1, 3)
    if given.all():
        return confidence
    if not len(points):
        confidence[~given] = 0.5
        return confidence
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    away = scipy.spatial.cKDTree(points).query(triangles[~given].mean(axis=1), workers=-1)[0]
    trust = TRUST * diagonal / np.maximum(TRUST * diagonal + away, np.finfo(float).tiny)
    confidence[~given] = np.minimum(trust, np.nextafter(np.float32(1), np.float32(0)))
    return confidence


def _joined(surfaces: list[Surface]) -> Surface:
    """Several surfaces as one; numbers of vertices that are new, which are negative, stay apart."""
    ids, lowest = [], 0
    for each in surfaces:
        own = np.where(each.ids < 0, each.ids + lowest, each.ids)
        lowest = min(lowest, int(own.min(initial=0)))
        ids.append(own)
    joined = np.concatenate(ids)
    return Surface(
        np.concatenate([each.triangles for each in surfaces]),
        np.unique(joined, return_inverse=True)[1].reshape(joined.shape),
        np.concatenate([each.origins for each in surfaces]),
        True,
    )
