"""Unite the triangles that close a solid: cut faces where they cross, and leave out those inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..diagnostics import BoundsNothing, Diagnostics, LeftOut, Note
from ..mesh.arrangement import Arrangement, arranged, meeting_faces
from ..mesh.components import first_members
from ..mesh.triangles import face_areas
from ..mesh.welding import same_positions
from .regions import cut_and_sided
from .solid import Solid, completed_area
from .winding import Windings

TRUST = 0.05
"""Confidence in the completion is ½ at this distance from given faces, relative to the shape's diagonal."""


@dataclass(frozen=True, eq=False)
class TriangleGroup:
    """Triangles of one kind."""

    triangles: Floats  # (m, 3, 3) corners
    ids: Ints  # (m, 3) vertices, one number for each position
    origins: Ints  # (m,) face that was given, or −1
    closing: bool  # whether they count in the winding number

    @classmethod
    def made(cls, triangles: Floats, closing: bool = True) -> TriangleGroup:
        """Triangles that were not given; their vertices have negative numbers."""
        ids = -1 - same_positions(triangles.reshape(-1, 3)).reshape(-1, 3)
        return cls(triangles, ids, np.full(len(triangles), -1), closing)


def united(
    surfaces: list[TriangleGroup], keep_overlaps: bool, notes: Sequence[Note] = (), points: Floats | None = None
) -> Solid:
    """Make the solid that surfaces close, with confidence that falls from `points`, (n, 3), or given corners."""
    whole = joined_surfaces(surfaces)
    closing = np.concatenate([np.full(len(surface.triangles), surface.closing) for surface in surfaces])
    windings = Windings(whole.triangles if closing.all() else whole.triangles[closing])
    pieces, regions = cut_and_sided(partial(_cut, whole, closing), closing, windings)
    uncut = np.array_equal(pieces.origins, np.arange(len(whole.triangles)))
    triangles = whole.triangles if uncut else pieces.points[pieces.faces]
    behind, ahead = regions.behind.copy(), regions.ahead.copy()
    closes = closing[pieces.origins]
    # winding numbers do not step across sheets
    behind[~closes], ahead[~closes] = windings.sides(triangles[~closes])
    origins = whole.origins[pieces.origins]
    given = origins >= 0
    buried = behind & ahead
    doubled = regions.doubled | (~closes & given & (behind != ahead))  # sheets that lie on walls
    bounds = (behind != ahead) & ~doubled
    kept = np.where(given, (~buried & ~doubled) | keep_overlaps, bounds | ~closes)
    if not kept.any():
        kept[:] = True
    confidence = _confidence(triangles[kept], given[kept], whole, points)
    diagnostics = Diagnostics(notes=(*notes, *_notes(triangles, origins, kept, buried & ~kept, bounds)))
    bounding = (bounds & behind)[kept]
    return Solid(
        triangles if kept.all() else triangles[kept], origins[kept], confidence, bounding, windings, None, diagnostics
    )


def _cut(whole: TriangleGroup, closing: Bools, touching: float) -> Arrangement:
    """Faces divided where they meet: those that close by each other, all others by these."""
    ids = whole.ids
    points = whole.triangles.reshape(-1, 3)[first_members(ids.ravel(), int(ids.max()) + 1)]
    faces = same_positions(points)[ids]
    pairs = meeting_faces(points, faces, touching)
    both = closing[pairs].all(axis=1)
    closed = np.flatnonzero(closing)
    number = np.cumsum(closing) - 1
    pieces = _arranged(points, faces, closed, number[pairs[both]], touching)
    if closing.all():
        return pieces
    across = pairs[closing[pairs].any(axis=1) & ~both]
    asked = ~closing
    asked[across] = True
    used = np.flatnonzero(asked)
    number = np.full(len(faces), -1)
    number[used] = np.arange(len(used))
    others = _arranged(points, faces, used, number[across], touching)
    sheets = ~closing[others.origins]
    return Arrangement(
        np.concatenate([pieces.points, others.points]),
        np.concatenate([pieces.faces, others.faces[sheets] + len(pieces.points)]),
        np.concatenate([pieces.origins, others.origins[sheets]]),
        np.concatenate([pieces.cells, others.cells[sheets] + 1 + int(pieces.cells.max(initial=-1))]),
    )


def _arranged(points: Floats, faces: Ints, chosen: Ints, pairs: Ints, touching: float) -> Arrangement:
    """Return some faces, divided where pairs of them meet."""
    if not len(pairs):
        return Arrangement(points, faces[chosen], chosen, np.arange(len(chosen)))
    pieces = arranged(points, faces[chosen], pairs, touching)
    return pieces._replace(origins=chosen[pieces.origins])


def _notes(triangles: Floats, origins: Ints, kept: Bools, buried: Bools, bounds: Bools) -> list[Note]:
    """Say what was left out (`buried`), what was completed, and how much bounds nothing."""
    notes: list[Note] = []
    areas, given = face_areas(triangles), origins >= 0
    total = max(float(areas[given].sum()), np.finfo(float).tiny)
    covered = buried & given
    if covered.any():
        faces, others = np.unique(origins[covered]), np.unique(origins[given & kept])
        cut = int(np.isin(faces, others).sum())
        notes.append(LeftOut(len(faces), float(areas[covered].sum()) / total, cut))
    notes += completed_area(triangles[kept], ~given[kept])
    idle = given & kept & ~bounds
    if float(areas[idle].sum()) > 1e-6 * total:
        notes.append(BoundsNothing(float(areas[idle].sum()) / total))
    return notes


def _confidence(triangles: Floats, given: Bools, whole: TriangleGroup, points: Floats | None) -> NDArray[np.float32]:
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


def joined_surfaces(surfaces: list[TriangleGroup]) -> TriangleGroup:
    """Several surfaces as one; numbers of vertices that are new, which are negative, stay apart."""
    ids, lowest = [], 0
    for surface in surfaces:
        own = np.where(surface.ids < 0, surface.ids + lowest, surface.ids)
        lowest = min(lowest, int(own.min(initial=0)))
        ids.append(own)
    joined = np.concatenate(ids)
    return TriangleGroup(
        surfaces[0].triangles if len(surfaces) == 1 else np.concatenate([surface.triangles for surface in surfaces]),
        np.unique(joined, return_inverse=True)[1].reshape(joined.shape),
        np.concatenate([surface.origins for surface in surfaces]),
        True,
    )
