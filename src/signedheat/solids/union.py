"""Unite the triangles that close a solid, or combine two solids: cut faces where they cross, keep those that bound.

Where w is 1 inside a solid and 0 outside, ``w(a) − w(b)`` is 1 in a without b and at most 0 elsewhere, and
``w(a) + w(b) − 1`` is 1 in both only. So each combination is bounded by those triangles of both, reversed if
subtracted, across which such a sum passes ½. A box around both that faces inwards contributes the − 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..diagnostics import BoundsNothing, Diagnostics, LeftOut, Note, ShapeOriented
from ..errors import GeometryError, OutsideError, SourceError
from ..mesh.arrangement import SAME_POINT, Arrangement, arranged
from ..mesh.components import boxes_of, element_components, first_members
from ..mesh.edges import edge_table, has_three_corners
from ..mesh.self_intersections import overlapping_faces
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.welding import indexed, same_positions, tolerances
from ..parallel import PointTree
from ..shapes.transforms import concatenated
from ..surfaces.triangle_mesh import TriangleMesh
from .bodies import same_solid
from .regions import cut_and_sided
from .sections import Plane
from .solid import Solid, completed_area, still_true
from .winding import Windings

TRUST_DISTANCE = 0.05
"""Confidence in the completion is ½ at this distance from given faces, relative to the diagonal of what was given of
the same connected surface."""


@dataclass(frozen=True, eq=False)
class TriangleGroup:
    """Triangles that all count in the winding number, or that all do not."""

    triangles: Floats  # (m, 3, 3) corners
    ids: Ints  # (m, 3) vertices, one number for each position
    origins: Ints  # (m,) face that was given, or −1
    closing: bool  # whether they count in the winding number

    @classmethod
    def made(cls, triangles: Floats, closing: bool = True) -> TriangleGroup:
        """Make a group of (m, 3, 3) triangles that were added; their vertices have negative numbers."""
        ids = -1 - same_positions(triangles.reshape(-1, 3)).reshape(-1, 3)
        return cls(triangles, ids, np.full(len(triangles), -1), closing)


def solid_as_given(mesh: TriangleMesh) -> tuple[Solid, ShapeOriented] | None:
    """Return the solid of a mesh of closed surfaces, and a note, if none crosses another and all face out of the solid.

    All but those of cavities face outwards. Otherwise return None.
    """
    points, faces = mesh.vertices, same_positions(mesh.vertices)[mesh.faces]
    table = edge_table(faces)
    is_closed = (table.face_counts == 2).all() and not table.balance.any()
    if not is_closed or not has_three_corners(faces).all():
        return None
    triangles, surfaces = points.take(faces, axis=0), element_components(table.face_edges)
    firsts = first_members(surfaces, int(surfaces.max()) + 1)
    corners = triangles - triangles[firsts, :1][surfaces]  # so that no digits cancel far away
    vectors = area_vectors(corners)
    volumes = np.bincount(surfaces, np.einsum("ij,ij->i", corners[:, 0], vectors))
    outwards = volumes > 0
    if not outwards.any() or not volumes.all() or not vectors.any(axis=1).all():
        return None
    if len(overlapping_faces(points, faces, tolerances(points, faces, SAME_POINT))):
        return None
    no_edges = points[table.vertices[table.balance != 0]]
    windings, nested = Windings(triangles, open_edges=no_edges), 0
    if len(firsts) > 1:
        behind, ahead = windings.sides(triangles[firsts])
        if ahead.any() or not behind.all():
            return None
    if 1 < outwards.sum() < len(firsts):  # bodies may lie in cavities of others
        of_bodies = Windings(triangles[outwards[surfaces]], open_edges=no_edges)
        nested = int(of_bodies.sides(triangles[firsts[outwards]])[1].sum())
    note = ShapeOriented(nested_bodies=nested, cavities=int((~outwards).sum()))
    all_bounding, full_confidence = np.ones(len(faces), dtype=np.bool_), np.ones(len(faces), dtype=np.float32)
    solid = Solid(triangles, np.arange(len(faces)), full_confidence, all_bounding, windings, mesh, uncrossed=True)
    return solid, note


def united(
    surfaces: list[TriangleGroup], keep_overlaps: bool, notes: Sequence[Note] = (), points: Floats | None = None
) -> Solid:
    """Make a solid of groups of triangles: cut them where they cross, and keep those that bound it, and sheets.

    With `keep_overlaps`, given faces inside the solid are kept, too. Confidence in added faces falls with their
    distance from (n, 3) `points`, or else from the corners of given faces.
    """
    # cut where faces cross, and find on which sides of the pieces the inside lies
    whole = joined_surfaces(surfaces)
    closing = np.concatenate([np.full(len(surface.triangles), surface.closing) for surface in surfaces])
    windings = Windings(whole.triangles if closing.all() else whole.triangles[closing])
    vertices, faces = _connected(whole)
    slacks = tolerances(vertices, faces, SAME_POINT)
    pieces, regions = cut_and_sided(partial(_cut, vertices, faces, closing), slacks, closing, windings)
    uncut = np.array_equal(pieces.origins, np.arange(len(whole.triangles)))
    triangles = whole.triangles if uncut else pieces.points[pieces.faces]
    behind, ahead = regions.behind.copy(), regions.ahead.copy()
    closes = closing[pieces.origins]
    # winding numbers do not change across sheets
    behind[~closes], ahead[~closes] = windings.sides(triangles[~closes])
    # keep what bounds the inside, and given faces that are neither inside nor copies
    origins = whole.origins[pieces.origins]
    given = origins >= 0
    buried = behind & ahead
    doubled = regions.doubled | (~closes & given & (behind != ahead))  # sheets that lie on walls
    bounds = (behind != ahead) & ~doubled
    kept = np.where(given, (~buried & ~doubled) | keep_overlaps, bounds | ~closes)
    if not kept.any():
        kept[:] = True
    confidence = _confidence(triangles[kept], pieces.origins[kept], whole, points)
    diagnostics = Diagnostics(notes=(*notes, *_notes(triangles, origins, kept, buried & ~kept, bounds)))
    bounding = bounds & behind
    if not (uncut and bounding.all()):
        windings = _windings_of(triangles[bounding], windings)
    triangles = triangles if kept.all() else triangles[kept]
    uncrossed = uncut and pieces.points is vertices  # no two of them met
    return Solid(triangles, origins[kept], confidence, bounding[kept], windings, None, diagnostics, uncrossed)


def _windings_of(triangles: Floats, given: Windings) -> Windings:
    """Return the winding numbers of (m, 3, 3) triangles, or `given` if the triangles do not bound its solid."""
    if np.array_equal(triangles, given.triangles) or not same_solid(triangles, given):
        return given
    return Windings(triangles)


def _connected(whole: TriangleGroup) -> tuple[Floats, Ints]:
    """Return (n, 3) points, one for each corner id of joined surfaces, from 0 to n − 1, and their (m, 3) faces.

    Added vertices have other ids than given ones at the same position. So faces use the first of the points at each
    position, and share vertices where they touch.
    """
    points = whole.triangles.reshape(-1, 3)[first_members(whole.ids.ravel(), int(whole.ids.max()) + 1)]
    return points, same_positions(points)[whole.ids]


def _cut(points: Floats, faces: Ints, closing: Bools, slacks: Floats) -> Arrangement:
    """Divide (m, 3) faces where they meet: closing faces where they meet each other, all others where they meet these.

    `closing`, (m,), tells which faces count in the winding number; `slacks`, (m,), are their tolerances.
    """
    pairs = overlapping_faces(points, faces, slacks, closing)
    both = closing[pairs].all(axis=1)
    closing_ids = np.flatnonzero(closing)
    number = np.cumsum(closing) - 1
    pieces = _arranged(points, faces, closing_ids, number[pairs[both]], slacks)
    if closing.all():
        return pieces
    # the others, with the closing faces that they meet, of which the pieces are not used
    mixed = pairs[~both]
    is_involved = ~closing
    is_involved[mixed] = True
    involved = np.flatnonzero(is_involved)
    number = np.full(len(faces), -1)
    number[involved] = np.arange(len(involved))
    others = _arranged(points, faces, involved, number[mixed], slacks)
    sheets = ~closing[others.origins]
    return Arrangement(
        np.concatenate([pieces.points, others.points]),
        np.concatenate([pieces.faces, others.faces[sheets] + len(pieces.points)]),
        np.concatenate([pieces.origins, others.origins[sheets]]),
        np.concatenate([pieces.cells, others.cells[sheets] + 1 + int(pieces.cells.max(initial=-1))]),
    )


def _arranged(points: Floats, faces: Ints, chosen: Ints, pairs: Ints, slacks: Floats) -> Arrangement:
    """Return the (k,) `chosen` faces, divided where (p, 2) pairs of them meet; pairs are indices into `chosen`."""
    if not len(pairs):
        return Arrangement(points, faces[chosen], chosen, np.arange(len(chosen)))
    pieces = arranged(points, faces[chosen], pairs, slacks[chosen])
    return pieces._replace(origins=chosen[pieces.origins])


def _notes(triangles: Floats, origins: Ints, kept: Bools, buried: Bools, bounds: Bools) -> list[Note]:
    """Return notes: how much was left out (`buried`), how much was completed, and how much bounds nothing.

    All arrays are (m,) for the triangles; `origins` are their given faces or −1.
    """
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


def _confidence(triangles: Floats, owners: Ints, whole: TriangleGroup, points: Floats | None) -> NDArray[np.float32]:
    """(m,) confidence in triangles: 1 for given ones, and less for added ones, the farther they are from `points`.

    `owners` are the (m,) triangles of `whole` that they are parts of. If `points` is None, distance is measured from
    the corners of given triangles.
    """
    confidence, given = np.ones(len(triangles), dtype=np.float32), whole.origins >= 0
    added = np.flatnonzero(~given[owners])
    corners = whole.triangles[given].reshape(-1, 3) if points is None else points
    if not len(added):
        return confidence
    if not len(corners):
        confidence[added] = 0.5
        return confidence
    # trust falls over a share of the size of the given part of the same surface
    surfaces = element_components(whole.ids)
    n = int(surfaces.max()) + 1
    low, high = boxes_of(whole.triangles[given].reshape(-1, 3), np.repeat(surfaces[given], 3), n)
    alone = ~np.isfinite(low).all(axis=1)  # level sets that replace what was given
    low[alone], high[alone] = corners.min(axis=0), corners.max(axis=0)
    reach = TRUST_DISTANCE * np.linalg.norm(high - low, axis=1)[surfaces[owners[added]]]
    away = PointTree(corners).query(triangles[added].mean(axis=1))[0]
    trust = reach / np.maximum(reach + away, np.finfo(float).tiny)
    confidence[added] = np.minimum(trust, np.nextafter(np.float32(1), np.float32(0)))
    return confidence


def joined_surfaces(surfaces: list[TriangleGroup]) -> TriangleGroup:
    """Join groups of triangles into one whose vertices are numbered anew.

    Vertices with the same number are one vertex, but negative numbers, of added triangles, count only within a group.
    """
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


BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Corners of the sides of a box, counter-clockwise as seen from outside; corner 4 i + 2 j + k is at (i, j, k)."""


def union(a: Solid, b: Solid) -> Solid:
    """Return the union of two solids."""
    return _combination(a, b, subtracted=False)


def difference(a: Solid, b: Solid) -> Solid:
    """Return the part of the first solid outside the second."""
    return _combination(a, b, subtracted=True)


def intersection(a: Solid, b: Solid) -> Solid:
    """Return the intersection of two solids."""
    bounds = np.stack([np.minimum(a.bounds[0], b.bounds[0]), np.maximum(a.bounds[1], b.bounds[1])])
    room = float(np.ptp(bounds, axis=0).max())
    lower, upper = bounds[0] - room, bounds[1] + room
    corners = np.where(np.array(list(np.ndindex(2, 2, 2))) > 0, upper, lower)
    inwards = np.concatenate([BOX_SIDES[:, [0, 2, 1]], BOX_SIDES[:, [0, 3, 2]]])
    return _combination(a, b, subtracted=False, around=corners[inwards])


def halves(solid: Solid, plane: Plane) -> tuple[Solid, Solid]:
    """Return the parts of a solid in front of a plane and behind it, closed by caps: see `Solid.cut`."""
    if not solid.bounding.any():
        raise GeometryError("nothing of the shape bounds a solid", remedy="thicken it first", element="shape")
    corners = solid.outward.reshape(-1, 3)
    heights, slack = (corners - plane.origin) @ plane.axes[2], plane.rounding(corners)
    low, high = float(heights.min()), float(heights.max())
    if low >= -slack or high <= slack:
        raise OutsideError(
            f"the plane does not cut the solid, which reaches from {low:.4g} to {high:.4g} along its normal",
            remedy="move the origin of the plane by a distance in between",
            element="origin",
        )
    middle = corners.mean(axis=0)
    foot = middle - ((middle - plane.origin) @ plane.axes[2]) * plane.axes[2]
    room = 2.0 * float(np.linalg.norm(np.ptp(corners, axis=0)))
    # a half space is a box with one side in the plane, and reaches beyond the solid
    steps = np.array(list(np.ndindex(2, 2, 2))) * np.array([2, 2, 1]) - np.array([1, 1, 0])
    sides = (foot + room * steps @ plane.axes)[np.concatenate([BOX_SIDES[:, [0, 1, 2]], BOX_SIDES[:, [0, 2, 3]]])]
    no_origins, full_confidence, all_bounding = (
        np.full(12, -1),
        np.ones(12, dtype=np.float32),
        np.ones(12, dtype=np.bool_),
    )
    half_space = Solid(sides, no_origins, full_confidence, all_bounding, Windings(sides))
    front, back = intersection(solid, half_space), difference(solid, half_space)
    return replace(front, source=solid.source), replace(back, source=solid.source)


def _combination(a: Solid, b: Solid, subtracted: bool, around: Floats | None = None) -> Solid:
    """Make the solid whose winding number is that of `a`, plus or minus that of `b`, plus that of `around`.

    `around` are (k, 3, 3) triangles or None.
    """
    of_first, of_second = (np.flatnonzero(solid.bounding) for solid in (a, b))
    first, second = a.triangles[a.bounding], b.triangles[b.bounding]
    triangles = np.concatenate([first, second[:, ::-1] if subtracted else second])
    if not len(triangles):
        raise SourceError("neither shape encloses anything", remedy="combine solids, not sheets", element="solid")
    chain = triangles if around is None else np.concatenate([triangles, around])
    windings = Windings(chain)
    points, faces = indexed(triangles)
    slacks, every = tolerances(points, faces, SAME_POINT), np.ones(len(triangles), dtype=bool)
    cut, regions = cut_and_sided(partial(arranged, points, faces, None), slacks, every, windings)
    kept = regions.bounds
    if not kept.any():
        raise SourceError("nothing is inside the result", remedy="check that the solids overlap", element="solid")
    # faces of b are numbered after those of the mesh that a was made from
    pieces, parents = cut.points[cut.faces[kept]], cut.origins[kept]
    count = a.source.n_faces if a.source is not None else int(a.origins.max()) + 1
    origins = np.concatenate(
        [a.origins[of_first], np.where(b.origins[of_second] < 0, -1, b.origins[of_second] + count)]
    )
    confidence = np.concatenate([a.confidence[of_first], b.confidence[of_second]])
    source = None
    if a.source is not None and b.source is not None:
        source = TriangleMesh(*concatenated([(mesh.vertices, mesh.faces) for mesh in (a.source, b.source)]))
    notes = still_true((*a.diagnostics.notes, *b.diagnostics.notes), pieces, origins[parents] < 0)
    bounding, windings = np.ones(len(pieces), dtype=np.bool_), _windings_of(pieces, windings)
    return Solid(pieces, origins[parents], confidence[parents], bounding, windings, source, Diagnostics(notes=notes))
