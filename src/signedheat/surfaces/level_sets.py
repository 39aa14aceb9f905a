"""Curves on a surface: level sets of functions, boundaries of regions, and the boundary of the surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..mesh.polylines import assemble_polylines, leaving
from ..mesh.surface_points import SNAP, barycentric_on_edges, crossed_sides
from ..mesh.triangles import Triangles, area_vectors
from .surface_curves import Curve

SAME = 2e-5
"""Distance, over a face's least height, up to which points in a row are one: where a line passes a vertex that rounding
puts next to it, it crosses edges up to 1e-5 of that apart. Of 22,000 steps of completed curves on spheres none is
between 3e-6 and 3e-5, and 15 between 3e-5 and 1e-3."""


def level_set(mesh: Triangles, values: Floats, level: float) -> list[Curve]:
    """Level set of a piecewise linear function by marching triangles, with larger values to the left.

    Values equal to the level count as larger, so that every face is crossed along one segment or not at all; loops that
    degenerate to a point are dropped, and faces with a NaN corner skipped. Where the faces are not consistently
    oriented, the curves get normals along the gradient. What differs from the level by less than `SNAP` of the step to
    a neighbour equals it, so that rounding moves no curve to the other side of a vertex.
    """
    faces, edges = mesh.faces, mesh.edges
    values = snapped(values, edges.vertices, level)
    finite = np.asarray(np.isfinite(values)[faces].all(axis=1))
    crossed, sides = crossed_sides((values >= level)[faces], finite)
    on_edges = edges.face_edges[crossed[:, None], sides]

    tail, head = (values[edges.vertices[:, k]] for k in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = np.clip((level - tail) / (head - tail), 0.0, 1.0)
    oriented = is_consistent(mesh)
    normals = None if oriented else gradient_directions(mesh, values, crossed)
    curves = []
    for order, backwards, closed in assemble_polylines(on_edges[:, 0], on_edges[:, 1], directed=oriented):
        first = np.where(backwards, sides[order, 1], sides[order, 0])
        last = np.where(backwards, sides[order, 0], sides[order, 1])[-1:]
        face = crossed[order]
        if not closed:
            face, first = np.append(face, face[-1]), np.append(first, last)
        weights = barycentric_on_edges(edges, face, first, along[edges.face_edges[face, first]])
        own = None if normals is None else normals[order]
        curves.append(Curve(face, weights, closed=closed, normals=own))
    return without_repeats(mesh, curves)


def without_repeats(mesh: Triangles, curves: Sequence[Curve]) -> list[Curve]:
    """Curves whose points differ: those in a row that differ by rounding alone are one, and one alone is no curve.

    Of points less than `SAME` of a face's least height apart the last stays, whose face holds what follows.
    """
    found = []
    for curve in curves:
        corners = mesh.vertices[mesh.faces[curve.faces]]
        points = np.einsum("ik,ikd->id", curve.barycentric, corners)
        sides = np.roll(corners, -1, axis=1) - corners
        longest = np.linalg.norm(sides, axis=2).max(axis=1)
        twice = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        room = SAME * twice / np.where(longest > 0, longest, 1.0)
        kept = leaving(points, curve.closed, room)
        if len(kept) > 1:
            leaves = kept if curve.closed else kept[:-1]
            normals = None if curve.normals is None else curve.normals[leaves]
            found.append(Curve(curve.faces[kept], curve.barycentric[kept], curve.closed, curve.oriented, normals))
    return found


def snapped(values: Floats, ends: Ints, level: float) -> Floats:
    """Values; those that differ from a level by rounding only are set to that level."""
    with np.errstate(invalid="ignore"):  # values may be infinite
        steps = np.abs(values[ends[:, 0]] - values[ends[:, 1]])
    steps[~np.isfinite(steps)] = 0.0
    steepest = np.zeros(len(values))
    np.maximum.at(steepest, ends, steps[:, None])
    return np.where(np.abs(values - level) <= SNAP * steepest, level, values)


def gradient_directions(mesh: Triangles, values: Floats, faces: Ints) -> Floats:
    """(k, 3) gradients of a piecewise linear function on some faces, up to a positive factor each."""
    corners = mesh.vertices[mesh.faces[faces]]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    of_corners = np.cross(area_vectors(corners)[:, None], opposite)
    rise = values[mesh.faces[faces]]
    most = np.abs(rise).max(axis=1, keepdims=True, initial=0.0)
    rise = rise / np.where(most > 0, most, 1.0)  # lest their sum is beyond what can be written
    return np.einsum("ik,ikj->ij", rise - rise.mean(axis=1, keepdims=True), of_corners)


def along_sides(mesh: Triangles, chosen: Bools) -> list[Curve]:
    """Curves along chosen sides of faces, in the direction in which the face is to the left."""
    faces, sides = np.nonzero(chosen)
    following = (sides + 1) % 3
    tails, heads = mesh.faces[faces, sides], mesh.faces[faces, following]
    oriented = is_consistent(mesh)
    curves = []
    for order, backwards, closed in assemble_polylines(tails, heads, directed=oriented):
        face = faces[order]
        corner = np.where(backwards, following[order], sides[order])
        if not closed:
            face = np.append(face, face[-1])
            corner = np.append(corner, sides[order[-1]] if backwards[-1] else following[order[-1]])
        normals = None if oriented else inward(mesh, faces[order], sides[order])
        curves.append(Curve(face, np.eye(3)[corner], closed=closed, normals=normals))
    return curves


def inward(mesh: Triangles, faces: Ints, sides: Ints) -> Floats:
    """(k, 3) directions in faces, orthogonal to one of their sides, inward."""
    corners = mesh.vertices[mesh.faces[faces]]
    row = np.arange(len(faces))
    along = corners[row, (sides + 1) % 3] - corners[row, sides]
    return np.cross(area_vectors(corners), along)


def is_consistent(mesh: Triangles) -> bool:
    """Whether the faces are consistently oriented: no two run along an edge in the same direction."""
    edges = mesh.edges
    return bool((edges.face_counts + np.abs(edges.balance) <= 2).all())
