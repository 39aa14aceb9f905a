"""Fewer triangles for a closed surface, within a distance of it that is proven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..geometry.face_features import FaceFeatures
from ..geometry.face_tree import FaceTree
from ..geometry.nearest import foot_on_triangle
from ..geometry.self_intersections import self_intersections
from ..packages import lazy_module

manifold3d = lazy_module("manifold3d", "simplified surfaces")

ATTEMPTS = 6
"""Attempts, each with half the tolerance for manifold3d, until its result is one that can be taken: on six surfaces at
tolerances of .02 and .1 cell the fourth was the last."""
SMALLEST = 0.05
"""Longest side, over the tolerance, of pieces that are not divided further: their distance is above .95 of it."""


def simplified(mesh: TriangleMesh, tolerance: float) -> TriangleMesh:
    """A surface of few triangles, no point of which is farther than a tolerance from another surface, and the converse.

    Edges are collapsed by manifold3d. Its result is taken if both distances are proven to be within the tolerance, and
    no triangles of it pass through each other; otherwise edges are collapsed less. If no result can be taken, it is the
    surface as it was.

    Raises
    ------
    GeometryError
        If the surface is not closed and manifold.
    MissingPackageError
        If manifold3d is not installed.
    """
    given = manifold3d.Manifold(
        manifold3d.Mesh64(np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.uint64))
    )
    if given.status() != manifold3d.Error.NoError or given.is_empty():
        raise GeometryError(
            f"manifold3d does not simplify the surface: {given.status().name}",
            remedy="leave out the tolerance",
            element="surface",
        )
    for attempt in range(ATTEMPTS):
        made = given.simplify(0.5**attempt * tolerance).to_mesh64()
        found = TriangleMesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64))
        if is_within(found, mesh, tolerance) and is_within(mesh, found, tolerance):
            if not len(self_intersections(found.vertices, found.faces)):
                return found
    return mesh


def is_within(mesh: TriangleMesh, other: TriangleMesh, distance: float) -> bool:
    """Whether no point of a surface is farther than a distance from another one; not where it is barely so.

    Distance to one triangle is convex, so that no point of a piece is farther from it than a corner. Pieces near no one
    triangle as a whole are divided.

    Examples
    --------
    >>> flat = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]], [[0, 1, 2]])
    >>> raised = TriangleMesh([[0, 0, 0.1], [1, 0, 0], [0, 1, 0.0]], [[0, 1, 2]])
    >>> is_within(raised, flat, 0.11), is_within(raised, flat, 0.09)
    (True, False)
    """
    tree = FaceTree.of(FaceFeatures.of(other.vertices, other.faces))
    pieces = mesh.vertices[mesh.faces]
    while len(pieces):
        places = np.concatenate([pieces, pieces.mean(axis=1, keepdims=True)], axis=1)
        faces, squares = tree.nearest(np.ascontiguousarray(places.reshape(-1, 3)))
        if squares.max() > distance**2:
            return False
        rest = pieces[_bounds(tree.features.rows, pieces, faces.reshape(-1, 4)) > distance**2]
        sides = np.linalg.norm(rest - np.roll(rest, -1, axis=1), axis=2)
        if len(rest) and sides.max() < SMALLEST * distance:
            return False
        longest = np.argmax(sides, axis=1)
        a, b, c = (np.take_along_axis(rest, ((longest + k) % 3)[:, None, None], axis=1)[:, 0] for k in range(3))
        middle = 0.5 * (a + b)
        pieces = np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1).reshape(
            -1, 3, 3
        )
    return True


@compiled
def _bounds(rows: NDArray[np.float64], pieces: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """(n,) square of the distance of the farthest corner of each of (n, 3, 3) pieces from the best of some faces."""
    result = np.full(len(pieces), np.inf)
    for p in range(len(pieces)):
        for k in range(faces.shape[1]):
            if k and faces[p, k] == faces[p, k - 1]:
                continue
            worst = 0.0
            for c in range(3):
                square = foot_on_triangle(rows, faces[p, k], pieces[p, c, 0], pieces[p, c, 1], pieces[p, c, 2])[0]
                worst = max(worst, square)
            result[p] = min(result[p], worst)
    return result
