"""Unions, intersections and differences of solids, by adding winding numbers.

Where w is 1 inside a solid and 0 outside, ``w(a) − w(b)`` is 1 in a without b and at most 0 elsewhere, and
``w(a) + w(b) − 1`` is 1 in both only. So each combination is what lies behind triangles of the two, turned where they
are subtracted, across which such a sum passes ½; a box around both, turned inside out, is the − 1.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays import Floats
from ..diagnostics import Diagnostics
from ..errors import SourceError
from ..mesh.arrangement import arranged
from ..mesh.welding import indexed
from ..surfaces.triangle_mesh import TriangleMesh
from ..transforms import concatenated
from .regions import cut_and_sided
from .solid import Solid, still_true
from .winding import Windings

BOX = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Corners of the sides of a box, counter-clockwise as seen from outside; corner 4 i + 2 j + k is at (i, j, k)."""


def union(a: Solid, b: Solid) -> Solid:
    """Return the union of two solids."""
    return _combination(a, b, turned=False)


def difference(a: Solid, b: Solid) -> Solid:
    """Return the part of the first solid outside the second."""
    return _combination(a, b, turned=True)


def intersection(a: Solid, b: Solid) -> Solid:
    """Return the intersection of two solids."""
    bounds = np.stack([np.minimum(a.bounds[0], b.bounds[0]), np.maximum(a.bounds[1], b.bounds[1])])
    room = float(np.ptp(bounds, axis=0).max())
    lower, upper = bounds[0] - room, bounds[1] + room
    corners = np.where(np.array(list(np.ndindex(2, 2, 2))) > 0, upper, lower)
    inwards = np.concatenate([BOX[:, [0, 2, 1]], BOX[:, [0, 3, 2]]])
    return _combination(a, b, turned=False, around=corners[inwards])


def _combination(a: Solid, b: Solid, turned: bool, around: Floats | None = None) -> Solid:
    """Make the solid of `a`, and `b`, turned or not; its winding number is the sum of theirs and that of `around`."""
    (first, of_first), (second, of_second) = ((x.triangles[x.bounding], np.flatnonzero(x.bounding)) for x in (a, b))
    triangles = np.concatenate([first, second[:, ::-1] if turned else second])
    if not len(triangles):
        raise SourceError("neither shape encloses anything", remedy="combine solids, not sheets", element="solid")
    chain = triangles if around is None else np.concatenate([triangles, around])
    windings = Windings(chain)
    cut, regions = cut_and_sided(
        partial(arranged, *indexed(triangles), None), np.ones(len(triangles), dtype=bool), windings
    )
    kept = regions.bounds
    if not kept.any():
        raise SourceError("nothing is inside the result", remedy="check that the solids overlap", element="solid")
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
    bounding = np.ones(len(pieces), dtype=np.bool_)
    return Solid(pieces, origins[parents], confidence[parents], bounding, windings, source, Diagnostics(notes=notes))
