"""Sharpening on tets: distance to faces and to the zero set along straight lines, which bend around the boundary.

Where the segment from a vertex to the nearest point of the surface lies in the mesh, its length is the distance.
Elsewhere shortest paths bend at the boundary of the mesh. They are found vertex by vertex, in order of distance. The
path of a vertex starts from the same triangle, or last bend, as that of a neighbour, if this is visible from it.
Otherwise it bends at the neighbour (any-angle search, Nash et al. 2007). Since paths bend at vertices only, instead of
anywhere on an edge, they are too long by an error of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..diagnostics import Note, RoundCorners, SharpenedToShape
from ..discretization import SourceTerm
from ..errors import SourceError
from ..fields.field import Field
from ..geodesics.heap_kernels import Queue, pop, push
from ..jobs import run_cancellable
from ..mesh.components import grouped
from ..methods import LinearElements, Method, Nearest, nearest, sharpen_on, sharpened
from ..search.face_tree import FaceFeatures, FaceTree
from ..search.nearest_triangles import TriangleTree, foot_on_triangle
from ..shapes.foreign import SurfaceShape, as_shapes
from ..shapes.kinds import Shapes
from ..shapes.transforms import joined_triangles
from ..surfaces.point_cloud import PointCloud
from .tet_clipping import SIGHT_OUTSIDE, Planes, barycentric, beyond, stays_inside
from .tet_discretization import TetDiscretization, lowered_tets
from .tet_levels import level_triangles
from .tet_mesh import TetMesh

FACE_EDGES = 2.0
"""Within this distance of a face, in mean edges, its side decides the sign; farther from all faces, the zero set
completes the shape."""


@sharpen_on.register
def _(mesh: TetMesh, field: Field[TetMesh], source: Shapes | None, method: Method | None) -> Field[TetMesh]:
    """Sharpen a field on a tet mesh, to the zero set and to the faces of `source` if there is one."""
    lowered = lowered_tets(mesh)  # nothing is solved on it
    elements = LinearElements.on_tets(mesh.geometry, lowered.unknowns, lowered.n_unknowns)
    given = None if source is None else as_shapes(source)
    values = field.values[lowered.vertices]
    new, diagnostics = sharpened(field, lowered, elements, values, given, method)
    return replace(field, values=lowered.at_vertices(new), diagnostics=diagnostics)


@nearest.register
def _(
    lowered: TetDiscretization,
    values: Floats,
    source: SourceTerm | None,
    given: Sequence[SurfaceShape] | None,
    tolerance: float,
) -> Nearest:
    """Measure any-angle distance to the given faces, and to the zero set where it is over `FACE_EDGES` from all.

    Within `FACE_EDGES` of a face its side decides the sign, where the shape is closed and consistently oriented around
    the nearest point.
    """
    points = lowered.mesh.vertices[lowered.vertices] - lowered.planes.center
    positions, corners, owners = level_triangles(points, lowered.unknowns, values, 0.0)
    sides = np.zeros(len(values), dtype=np.int64)
    notes: tuple[Note, ...] = ()
    features = None if given is None else _faces_of(given, lowered.planes.center)
    if features is not None:
        face_tree, n_faces = FaceTree.of(features), len(features.rows)
        missing = face_tree.distances(positions[corners].mean(axis=1)) > FACE_EDGES * lowered.spacing
        corners = np.concatenate([features.faces, corners[missing] + len(features.vertices)])
        owners = np.concatenate([np.full(n_faces, -1), owners[missing]])
        positions = np.concatenate([features.vertices, positions])
        notes = (SharpenedToShape(float(missing.mean()) if len(missing) else 0.0),)
    if not len(corners):
        return Nearest(np.full(len(values), np.inf), sides)

    def measured() -> tuple[Floats, Ints, int]:
        """Return the results of `_distance_around`."""
        return _distance_around(lowered, points, values, positions, corners, owners)

    distances, triangles, hidden = run_cancellable(measured)
    if features is not None:
        near = face_tree.search(points)
        decided = near.regular & (near.distances < FACE_EDGES * lowered.spacing)
        decided &= (triangles < n_faces) & (distances <= near.distances * (1 + 1e-9))
        sides[decided] = np.where(near.cosines < 0, -1, 1)[decided]
    return Nearest(distances, sides, (RoundCorners(hidden), *notes))


def _faces_of(shapes: Sequence[SurfaceShape], center: Floats) -> FaceFeatures | None:
    """Return the faces of some shapes, with positions relative to a centre; None if no face has any extent."""
    meshes = [shape for shape in shapes if not isinstance(shape, PointCloud)]
    if len(meshes) != len(shapes):
        raise SourceError("fields on tets are sharpened to faces, and points have none", element="shape")
    features = FaceFeatures.of(*joined_triangles(meshes, center))
    return features if len(features.rows) else None


class Vertices(NamedTuple):
    """The unknowns of φ as vertices of the tets."""

    points: Floats  # (n, 3) positions relative to the centre of the mesh, as those of `Planes` are
    tets: Ints  # (m, 4) the vertices of each tet
    neighbors: Ints  # (m, 4) the tet beyond each face, or −1
    # (n + 1,) and (4 m,): the tets at vertex v are ``tets_at[first_tet[v] : first_tet[v + 1]]``
    first_tet: Ints
    tets_at: Ints


class SourceSurface(NamedTuple):
    """The triangles that distance is measured to."""

    rows: Floats  # (k, 16) see `triangle_rows`, relative to the centre of the mesh
    corners: Ints  # (k, 3) vertex ids; corners at the same position have the same id
    # the triangles at vertex id v are ``triangles_at[first_triangle[v] : first_triangle[v + 1]]``
    first_triangle: Ints
    triangles_at: Ints
    owners: Ints  # (k,) the tet that each triangle lies in; −1 for triangles that lie in several


def _distance_around(
    lowered: TetDiscretization, points: Floats, values: Floats, positions: Floats, corners: Ints, owners: Ints
) -> tuple[Floats, Ints, int]:
    """Measure the any-angle distance of n unknowns to triangles, from whose zero set φ may deviate since it is curved.

    Return (n,) distances, (n,) nearest triangles, or −1 without a value, and how many unknowns do not see them. The
    unknowns have positions `points` and values of φ. Triangles have `positions` of vertices, (t, 3) `corners`, and
    `owners`, the tets that they lie in, or −1. A curved φ vanishes ``½ Σ_k λ_k(x) ∇φ_k · (x − p_k) / |∇φ|`` away from
    the zero set of its linear interpolant.
    """
    mesh, planes, unknowns = lowered.mesh, lowered.planes, lowered.unknowns
    tree = TriangleTree.of(positions[corners])
    triangles, _ = tree.nearest(points)
    triangles[np.isnan(values)] = -1
    vertices = Vertices(points, unknowns, mesh.faces.neighbors, *_rows_with(unknowns, len(values)))
    surface = SourceSurface(tree.rows, corners, *_rows_with(corners, len(positions)), owners)
    slack = SIGHT_OUTSIDE * lowered.spacing
    distances, feet, hidden = _any_angle(planes, vertices, surface, triangles, slack, Queue.empty(len(points)))
    curved = np.flatnonzero(np.isfinite(distances) & (owners[triangles] >= 0))
    tets, feet = owners[triangles[curved]], feet[curved]
    weights = barycentric(mesh.geometry, tets, feet + planes.center)
    gradients = mesh.geometry.mean_gradients(np.nan_to_num(values), unknowns, len(values))[unknowns[tets]]
    slope = np.linalg.norm(np.einsum("pk,pki->pi", weights, gradients), axis=1)
    rise = 0.5 * np.einsum("pk,pki,pki->p", weights, gradients, feet[:, None] - points[unknowns[tets]])
    most = lowered.spacing  # at creases of φ the correction has no meaning
    bend = np.clip(rise / np.where(slope > 0, slope, np.inf), -most, most)
    distances[curved] = np.maximum(distances[curved] + np.copysign(1.0, values[curved]) * bend, 0.0)
    return distances, triangles, hidden


def _rows_with(ids: Ints, n: int) -> tuple[Ints, Ints]:
    """(n + 1,) starts, and a list of rows of (m, k) ids: those from ``starts[i]`` to ``starts[i + 1]`` contain id i."""
    starts, entries = grouped(ids.ravel(), n)
    return starts, entries // ids.shape[1]


@compiled
def _any_angle(
    planes: Planes, vertices: Vertices, surface: SourceSurface, nearest: Ints, slack: float, queue: Queue
) -> tuple[Floats, Floats, int]:
    """(n,) distances of vertices from the surface, (n, 3) points where their paths start, and how many are hidden.

    A path starts on the surface, runs inside the mesh, and bends at vertices only. Hidden are vertices that do not see
    the nearest point; their paths grow from vertex to vertex of a tet, the shortest first. `nearest`, (n,), has the
    nearest triangles, in sight or not, or −1 for vertices without a value, which no path reaches; it is overwritten by
    the triangles that paths start from. Distances that no path reaches are infinite. Lines may lie `slack` outside the
    mesh.
    """
    points, tets, _, first_tet, tets_at = vertices
    n = len(points)
    distance = np.full(n, np.inf)
    bend, feet = np.full(n, -1), np.zeros((n, 3))  # the vertex where the path to each last bends, −1 if it is straight
    known = np.zeros(n, dtype=np.bool_)  # whether it sees the nearest point, so that its distance is final
    for v in range(n):
        if nearest[v] >= 0:
            x, y, z = points[v]
            square, _, feet[v, 0], feet[v, 1], feet[v, 2] = foot_on_triangle(surface.rows, nearest[v], x, y, z)
            if _sees(planes, vertices, v, feet[v], slack):
                distance[v], known[v] = np.sqrt(square), True
    for i in range(len(surface.rows)):  # each is visible from the corners of its tet, though it may not be the nearest
        for k in range(4):
            v = tets[surface.owners[i], k]
            if surface.owners[i] >= 0 and not known[v] and nearest[v] >= 0:
                x, y, z = points[v]
                square, _, a, b, c = foot_on_triangle(surface.rows, i, x, y, z)
                if square < distance[v] ** 2:
                    distance[v], nearest[v] = np.sqrt(square), i
                    feet[v, 0], feet[v, 1], feet[v, 2] = a, b, c
                    push(queue, v, distance[v])
    hidden = 0
    for v in range(n):
        if not known[v] and nearest[v] >= 0:
            hidden += 1
            for i in range(first_tet[v], first_tet[v + 1]):
                for k in range(4):
                    u = tets[tets_at[i], k]
                    if known[u]:
                        push(queue, u, distance[u])
    done = np.zeros(n, dtype=np.bool_)  # whether the distance of a vertex was passed on to its neighbours
    while queue.size[0] > 0:
        u = pop(queue)
        done[u] = True
        for i in range(first_tet[u], first_tet[u + 1]):
            for k in range(4):
                v = tets[tets_at[i], k]
                if known[v] or done[v] or nearest[v] < 0:
                    continue
                x, y, z = points[v]
                if bend[u] >= 0:  # try a line from the last bend of the path to u, or from the surface; else bend at u
                    via, triangle, foot, length = bend[u], nearest[u], feet[u], distance[bend[u]]
                    target = points[via]
                else:
                    triangle, foot = _nearest_around(surface, nearest[u], x, y, z)
                    via, length, target = -1, 0.0, foot
                length += _length(target, x, y, z)
                if length >= distance[v]:
                    continue
                if not _sees(planes, vertices, v, target, slack):
                    via, triangle, foot, length = u, nearest[u], feet[u], distance[u] + _length(points[u], x, y, z)
                if length < distance[v]:
                    distance[v], bend[v], nearest[v] = length, via, triangle
                    for d in range(3):
                        feet[v, d] = foot[d]
                    push(queue, v, length)
    return distance, feet, hidden


@compiled
def _sees(planes: Planes, vertices: Vertices, v: int, target: Floats, slack: float) -> bool:
    """Whether the segment from vertex v to a (3,) target in the mesh lies in the mesh, up to `slack`."""
    x, y, z = vertices.points[v]
    target_x, target_y, target_z = target
    tet, least = -1, np.inf
    for i in range(vertices.first_tet[v], vertices.first_tet[v + 1]):  # the tet that the segment starts into
        worst = -np.inf
        for k in range(4):
            if vertices.tets[vertices.tets_at[i], k] != v:
                worst = max(worst, beyond(planes, vertices.tets_at[i], k, target_x, target_y, target_z))
        if worst < least:
            tet, least = vertices.tets_at[i], worst
    if least > slack:
        return False
    return stays_inside(planes, vertices.neighbors, tet, x, y, z, target_x, target_y, target_z, slack)


@compiled
def _nearest_around(surface: SourceSurface, triangle: int, x: float, y: float, z: float) -> tuple[int, Floats]:
    """Return the triangle nearest to (x, y, z) of those that share a corner with a given one, and its nearest point."""
    least, closest, foot = np.inf, triangle, np.zeros(3)
    for c in range(3):
        corner = surface.corners[triangle, c]
        for i in range(surface.first_triangle[corner], surface.first_triangle[corner + 1]):
            square, _, u, v, w = foot_on_triangle(surface.rows, surface.triangles_at[i], x, y, z)
            if square < least:
                least, closest = square, surface.triangles_at[i]
                foot[0], foot[1], foot[2] = u, v, w
    return closest, foot


@compiled
def _length(point: Floats, x: float, y: float, z: float) -> float:
    """Distance between two points."""
    return np.sqrt((point[0] - x) ** 2 + (point[1] - y) ** 2 + (point[2] - z) ** 2)
