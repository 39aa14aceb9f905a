"""Points on a surface, at vertices, on edges or inside faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Bools, Floats, Ints, mask_of
from ..errors import SourceError
from .components import by_first_use, grouped, members_of
from .edges import EdgeTable
from .intrinsic_mesh import IntrinsicMesh

VERTEX, EDGE, FACE = 0, 1, 2
"""Kinds of elements on which a point can lie."""

ZERO_COORDINATE = 1e-9
"""Barycentric coordinate below which it counts as zero, so that the point lies on an edge or at a vertex. Differences
and distances in such coordinates below it count as zero, too."""


@dataclass(frozen=True, eq=False)
class LocatedPoints:
    """n points of a surface, each with the lowest-dimensional element that contains it."""

    faces: Ints  # (n,) a face that contains the point
    barycentric: Floats  # (n, 3) weights of the corners of that face; exact zeros on edges and at vertices
    kinds: Ints  # (n,) `VERTEX`, `EDGE` or `FACE`
    elements: Ints  # (n,) id of the vertex, edge or face
    along: Floats  # (n,) for points on edges, the fraction of the edge from its tail; otherwise 0

    def __len__(self) -> int:
        return len(self.faces)

    def __getitem__(self, index: Ints) -> LocatedPoints:
        return LocatedPoints(
            self.faces[index], self.barycentric[index], self.kinds[index], self.elements[index], self.along[index]
        )


def refuse_missing(kind: str, ids: Ints, n: int, name: str = "point") -> None:
    """Raise an error if ids of vertices, edges or faces, as `kind` says, are not between 0 and n − 1."""
    missing = np.flatnonzero((ids < 0) | (ids >= n))
    if len(missing):
        first = ids[missing[0]]
        raise SourceError(
            f"{name} {missing[0]} names {kind} {first}, but {kind} ids go from 0 to {n - 1}",
            remedy="make it for this mesh, if it was made for another mesh",
            element=f"{kind} {first}",
        )


def locate_points(triangles: IntrinsicMesh, faces: Ints, barycentric: Floats, name: str = "point") -> LocatedPoints:
    """Find the vertex, edge or face that contains each point, given by (n,) faces and (n, 3) barycentric coordinates.

    `name` names a point in error messages.
    """
    refuse_missing("face", faces, triangles.n_faces, name)
    inside = np.where(barycentric < ZERO_COORDINATE, 0.0, barycentric)
    inside /= inside.sum(axis=1, keepdims=True)
    positive = inside > 0
    kinds = positive.sum(axis=1) - 1
    elements = faces.copy()
    along = np.zeros(len(faces))

    at_vertex = kinds == VERTEX
    elements[at_vertex] = triangles.corner_vertices[faces[at_vertex], inside[at_vertex].argmax(axis=1)]

    on_edge = np.flatnonzero(kinds == EDGE)
    side = (np.argmin(inside[on_edge], axis=1) + 1) % 3  # the edge opposite to the corner with coordinate zero
    of_face = faces[on_edge], side
    elements[on_edge] = triangles.edges.face_edges[of_face]
    forward = triangles.edges.forward[of_face]
    along[on_edge] = np.where(forward, inside[on_edge, (side + 1) % 3], inside[on_edge, side])
    return LocatedPoints(faces, inside, kinds, elements, along)


def points_at_vertices(triangles: IntrinsicMesh, vertices: Ints) -> LocatedPoints:
    """Return (n,) vertices as points, each in its first face."""
    corners = corners_at(triangles.corner_vertices, vertices, triangles.n_vertices)
    kinds = np.full(len(vertices), VERTEX)
    return LocatedPoints(corners // 3, np.eye(3)[corners % 3], kinds, vertices, np.zeros(len(vertices)))


def corners_at(faces: Ints, vertices: Ints, n_vertices: int, name: str = "point") -> Ints:
    """Return (k,) the first corner ``3 face + corner`` at each of k vertices.

    Raises an error for vertices without a face, and for ids that are not below `n_vertices`.
    """
    if not np.issubdtype(vertices.dtype, np.integer):
        if len(vertices) == 0:
            return np.empty(0, dtype=np.int64)
        raise SourceError(f"{name}s are given by integer vertex ids, not {vertices.dtype}", element="vertices")
    refuse_missing("vertex", vertices, n_vertices, name)
    n_all = max(n_vertices, int(faces.max(initial=-1)) + 1)  # virtual vertices of polygons have higher numbers
    corners = np.flatnonzero(mask_of(n_all, vertices)[faces])[::-1]
    first = np.full(n_all, -1)
    first[faces.ravel()[corners]] = corners
    alone = np.flatnonzero(first[vertices] < 0)
    if len(alone):
        raise SourceError(
            f"{name} {alone[0]} is vertex {vertices[alone[0]]}, which no face has",
            remedy="choose a vertex of the surface",
            element=f"vertex {vertices[alone[0]]}",
        )
    return first[vertices]


def contain(triangles: IntrinsicMesh, faces: Ints, located: LocatedPoints) -> Bools:
    """Return (n,) bool, true if face faces[k] contains point k."""
    of_vertices, of_edges = (
        (table[faces] == located.elements[:, None]).any(axis=1)
        for table in (triangles.corner_vertices, triangles.edges.face_edges)
    )
    return np.choose(located.kinds, [of_vertices, of_edges, faces == located.elements])


def barycentric_in(triangles: IntrinsicMesh, faces: Ints, located: LocatedPoints) -> Floats:
    """Return (n, 3) barycentric coordinates of each point k in face faces[k], which must contain it."""
    weights: Floats = located.barycentric.copy()
    moved = np.flatnonzero(faces != located.faces)
    kinds, elements, along, moved_to = (
        column[moved] for column in (located.kinds, located.elements, located.along, faces)
    )
    weights[moved] = 0.0

    at_vertex = kinds == VERTEX
    corner = (triangles.corner_vertices[moved_to[at_vertex]] == elements[at_vertex, None]).argmax(axis=1)
    weights[moved[at_vertex], corner] = 1.0

    on_edge = kinds == EDGE
    rows, face = moved[on_edge], moved_to[on_edge]
    side = (triangles.edges.face_edges[face] == elements[on_edge, None]).argmax(axis=1)
    weights[rows] = barycentric_on_edges(triangles.edges, face, side, along[on_edge])
    return weights


def barycentric_on_edges(edges: EdgeTable, faces: Ints, sides: Ints, along: Floats) -> Floats:
    """Return (n, 3) barycentric coordinates in faces of points on their edges.

    The edges are given as sides, 0 to 2, of (n,) faces, and the points as fractions from the tails of the edges.
    """
    return barycentric_on_sides(sides, np.where(edges.forward[faces, sides], along, 1 - along))


def edges_between(triangles: IntrinsicMesh, faces: Ints, starts: Floats, ends: Floats) -> tuple[Ints, Ints]:
    """Return (k,) the edge along which each segment in a face runs, or −1, and (k,) the side of the face.

    The ends of segments are barycentric coordinates in (k,) faces, (k, 3).
    """
    empty = (starts == 0) & (ends == 0)
    sides = (empty.argmax(axis=1) + 1) % 3
    return np.where(empty.any(axis=1), triangles.edges.face_edges[faces, sides], -1), sides


def barycentric_on_sides(sides: Ints, shares: Floats) -> Floats:
    """Return (n, 3) barycentric coordinates of points at fractions along sides, 0 to 2, of faces."""
    weights, row = np.zeros((len(sides), 3)), np.arange(len(sides))
    weights[row, sides] = 1 - shares
    weights[row, (sides + 1) % 3] = shares
    return weights


def crossed_sides(above: Bools, chosen: Bools) -> tuple[Ints, Ints]:
    """Return (k,) chosen faces that a level set crosses, and (k, 2) the sides by which it enters and leaves them.

    `above`, (m, 3), says whether each corner is above the level, and `chosen`, (m,), which faces count. The level set
    has what is above it to its left.
    """
    faces = np.flatnonzero(chosen & above.any(axis=1) & ~above.all(axis=1))  # `above` is to the left of the level set
    starts, ends = above[faces], np.roll(above[faces], -1, axis=1)
    return faces, np.stack([(starts & ~ends).argmax(axis=1), (ends & ~starts).argmax(axis=1)], axis=1)


def shared_faces(triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints) -> Ints:
    """Return (k,) a face that contains both `start` and `end` of each segment, or −1.

    A face in which one of the two is given is preferred; otherwise it is the one of least id.
    """
    shared = np.where(contain(triangles, end.faces, start), end.faces, -1)
    shared = np.where(contain(triangles, start.faces, end), start.faces, shared)
    # points on edges and at vertices are in more faces than those in which they are given
    left = np.flatnonzero((shared < 0) & (start.kinds != FACE))
    if len(left):
        owners, faces = incident_faces(triangles, start[left])
        fits = contain(triangles, faces, end[left[owners]])
        least = np.full(len(left), triangles.n_faces)
        np.minimum.at(least, owners[fits], faces[fits])
        shared[left] = np.where(least < triangles.n_faces, least, -1)
    return shared


def incident_faces(triangles: IntrinsicMesh, located: LocatedPoints) -> tuple[Ints, Ints]:
    """Return all pairs of a point and a face that contains it, as (k,) indices of points and (k,) faces."""
    inside = np.flatnonzero(located.kinds == FACE)
    owners, faces = [inside], [located.elements[inside]]
    for kind, table, count in (
        (VERTEX, triangles.corner_vertices, triangles.n_vertices),
        (EDGE, triangles.edges.face_edges, triangles.n_edges),
    ):
        members = np.flatnonzero(located.kinds == kind)
        if not len(members):
            continue
        # all corners or sides of faces that are elements of these points
        starts, members_at = grouped(located.elements[members], count)
        face, corner = np.nonzero((np.diff(starts) > 0)[table])
        row, point = members_of(starts, members_at, table[face, corner])
        owners.append(members[point])
        faces.append(face[row])
    return np.concatenate(owners), np.concatenate(faces)


def unique_points(located: LocatedPoints) -> tuple[Ints, Ints]:
    """Find points that coincide up to `ZERO_COORDINATE`.

    Returns (u,) the first index of each distinct point, ascending, and (n,) the index of each point among these.
    """
    inner = np.where((located.kinds == FACE)[:, None], located.barycentric, 0.0)
    columns = [located.kinds, located.elements, located.along, inner[:, 0], inner[:, 1]]
    order = np.lexsort(columns[::-1])
    new = np.zeros(len(located), dtype=bool)
    new[:1] = True
    for column in columns:
        new[1:] |= np.abs(np.diff(column[order])) > ZERO_COORDINATE
    group = np.empty(len(located), dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    numbers, _ = by_first_use(group, int(new.sum()))
    return np.unique(numbers, return_index=True)[1], numbers


def concatenated(parts: Sequence[LocatedPoints]) -> LocatedPoints:
    """Concatenate several sets of located points."""
    return LocatedPoints(*(np.concatenate([getattr(p, f) for p in parts]) for f in LocatedPoints.__dataclass_fields__))
