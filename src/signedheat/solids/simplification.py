"""Simplify a closed surface within a proven distance."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import GeometryError, InexactWarning, warn_user
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import halved, side_lengths
from ..packages import lazy_module
from ..search.face_tree import FaceFeatures, FaceTree, feet_on
from ..surfaces.triangle_mesh import TriangleMesh

manifold3d: Any = lazy_module("manifold3d", "simplified surfaces")

TOLERANCE_ATTEMPTS = 8
"""Number of attempts, each with half the tolerance for manifold3d, until its result is acceptable. Of 51 surfaces at
0.02 to 0.5 cells 48 took seven or fewer. In the others manifold3d removed a spike or a body that was larger."""


def simplified(mesh: TriangleMesh, tolerance: float) -> TriangleMesh:
    """Simplify a surface by manifold3d to a proven tolerance; unchanged, with an `InexactWarning`, if that fails."""
    given = manifold3d.Manifold(
        manifold3d.Mesh64(np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.uint64))
    )
    if given.status() != manifold3d.Error.NoError or given.is_empty():
        raise GeometryError(
            f"manifold3d does not simplify the surface: {given.status().name}",
            remedy="leave out the tolerance",
            element="surface",
        )
    for attempt in range(TOLERANCE_ATTEMPTS):
        simpler = given.simplify(0.5**attempt * tolerance)
        if simpler.is_empty():
            continue
        made = simpler.to_mesh64()
        surface = TriangleMesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64))
        if is_within(surface, mesh, tolerance) and is_within(mesh, surface, tolerance):
            if not len(self_intersections(surface.vertices, surface.faces)):
                return surface
    warn_user(
        f"the surface was not simplified: manifold3d finds none with fewer triangles within {tolerance:.3g} of it and "
        "does not meet itself; another tolerance may do",
        InexactWarning,
    )
    return mesh


def is_within(mesh: TriangleMesh, other: TriangleMesh, distance: float) -> bool:
    """Whether all of a surface lies within a distance of another one; False if it is too close to call.

    Distance to a triangle is convex, so over a face it is greatest at a corner. A face that is not within the distance
    of a single triangle is divided, and its parts are tested in the same way.
    """
    tree = FaceTree.of(FaceFeatures.of(other.vertices, other.faces))
    pieces = mesh.vertices[mesh.faces]
    if tree.nearest(mesh.vertices)[1].max() > distance**2:
        return False
    for _ in range(60):  # more would prove hardly anything: parts of 14,000 faces took 17
        faces, squares = tree.nearest(pieces.mean(axis=1))
        if squares.max() > distance**2:
            return False
        of_corners = feet_on(tree.features, np.repeat(faces, 3), pieces.reshape(-1, 3)).distances
        rest = of_corners.reshape(-1, 3).max(axis=1) > distance
        if not rest.any():
            return True
        pieces = _divided(pieces[rest], tree.features.rows[faces[rest]], 1e-3 * distance)
    return False


def _divided(pieces: Floats, rows: Floats, least: float) -> Floats:
    """(k, 3, 3) triangles that (n, 3, 3) triangles are divided into, for `is_within`.

    `rows` are the `triangle_rows` of the nearest triangles: see there. A triangle is cut by the plane that stands on a
    side of the nearest one, if it reaches farther than `least` to both sides of it. If not, or if it is more than three
    times as large as the nearest one, it is halved.
    """
    relative = pieces - rows[:, None, :3]
    # coordinates of corners in the plane of the nearest triangle, along its first side and across
    p = (relative * rows[:, None, 3:6]).sum(axis=2)
    q = (relative * rows[:, None, 6:9]).sum(axis=2)
    length, (px, qx), (py, qy) = rows[:, 9, None], rows[:, 10:12].T[..., None], rows[:, 13:15].T[..., None]
    # (n, 3, 3) distances of each corner beyond the three sides
    beyond = np.stack([-q, q * px - p * qx, (p - length) * qy - q * py], axis=1)
    shorter_reach = np.minimum(beyond.max(axis=2), -beyond.min(axis=2))
    side = shorter_reach.argmax(axis=1)
    row = np.arange(len(pieces))
    is_large = side_lengths(pieces).max(axis=1) > 3.0 * rows[:, [9, 12, 15]].max(axis=1)
    is_cut = ~is_large & (shorter_reach[row, side] > least)
    return np.concatenate([_cut(pieces[is_cut], beyond[row, side][is_cut]), halved(pieces[~is_cut])])


def _cut(pieces: Floats, heights: Floats) -> Floats:
    """(3 n, 3, 3) triangles: each of n is cut in three where the (n, 3) heights of its corners change sign."""
    above = heights > 0
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3  # first the corner that is alone on its side
    a, b, c = np.take_along_axis(pieces, order[:, :, None], axis=1).swapaxes(0, 1)
    height_a, height_b, height_c = np.take_along_axis(heights, order, axis=1).T[:, :, None]
    on_b, on_c = a + height_a / (height_a - height_b) * (b - a), a + height_a / (height_a - height_c) * (c - a)
    parts = [[a, on_b, on_c], [on_b, b, c], [on_b, c, on_c]]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3, 3)
