"""The common subdivision of a mesh and an intrinsic triangulation of it: flat polygons on which both are linear.

The edges of both divide the surface into convex polygons. Each lies in one face of the mesh, so that it is flat in
space, and in one intrinsic triangle, so that a field on the triangulation is linear on it.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Floats, Ints
from ..errors import GeometryError
from ..mesh.components import first_members
from ..mesh.surface_points import EDGE, VERTEX, LocatedPoints, locate_points
from ..validation import public_call
from .intrinsic_history import misplaced_lines
from .intrinsic_triangulation import IntrinsicTriangulation
from .polygon_mesh import PolygonMesh


@public_call
def common_subdivision(triangulation: IntrinsicTriangulation) -> tuple[PolygonMesh, csr_matrix]:
    """Subdivide the triangles of an intrinsic triangulation along the edges of its mesh.

    Parameters
    ----------
    triangulation : IntrinsicTriangulation
        The result of `intrinsic_delaunay`.

    Returns
    -------
    PolygonMesh
        Flat polygons in space; the vertices of the triangulation come first.
    (n_polygon_vertices, n_vertices) sparse
        Interpolation: maps values at the vertices of the triangulation to values at those of the polygons.

    Raises
    ------
    GeometryError
        If the argument is not an intrinsic triangulation, or has triangles as thin as rounding.

    See Also
    --------
    intrinsic_delaunay : Make an intrinsic triangulation.
    IntrinsicTriangulation : Better triangles on the same surface.

    Examples
    --------
    >>> import signedheat as sh
    >>> mesh = sh.TriangleMesh([[0, 0, 0], [10, 0, 0], [10, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> better = sh.intrinsic_delaunay(mesh, refine=True)
    >>> polygons, interpolate = sh.common_subdivision(better)
    >>> bool(abs(interpolate @ better.vertices - polygons.vertices).max() < 1e-12)
    True
    """
    if not isinstance(triangulation, IntrinsicTriangulation):
        raise GeometryError(
            f"a {type(triangulation).__name__} is not an IntrinsicTriangulation", remedy="see intrinsic_delaunay"
        )
    triangles, n = triangulation.triangles, triangulation.n_vertices
    polygons, _, where = subdivided(triangulation)
    corner_of = first_members(triangles.corner_vertices.ravel(), n)
    own = corner_of >= 0
    weights = np.concatenate([np.eye(3)[corner_of % 3] * own[:, None], where.barycentric])
    faces = np.concatenate([corner_of // 3, where.faces])
    matrix = csr_matrix(
        (weights.ravel(), triangles.corner_vertices[faces].ravel(), 3 * np.arange(len(faces) + 1)), (len(faces), n)
    )
    matrix.eliminate_zeros()
    return PolygonMesh(np.concatenate([triangulation.vertices, positions(triangulation, where)]), polygons), matrix


def subdivided(triangulation: IntrinsicTriangulation) -> tuple[list[list[int]], Ints, LocatedPoints]:
    """Cut the triangles of an intrinsic triangulation along the edges of its mesh.

    Return the vertex ids of each polygon, the (p,) triangle that each is part of, and the points where edges cross,
    whose ids follow those of the vertices.
    """
    triangles, n = triangulation.triangles, triangulation.n_vertices
    lines = triangulation.history.edges_after()
    lost = misplaced_lines(triangles, lines, triangulation.history.before.lengths_of_edges)
    if len(lost):
        raise GeometryError(
            f"edge {lost[0]} of the mesh crosses triangles as thin as rounding, which flip it",
            remedy="merge the vertices that nearly coincide",
            element=f"edge {lost[0]}",
        )
    starts = locate_points(triangles, lines.faces, lines.starts)
    ends = locate_points(triangles, lines.faces, lines.ends)
    last = np.append(np.diff(lines.owners) > 0, True)
    crossing = (ends.kinds == EDGE) & ~last
    node = np.where(ends.kinds == VERTEX, ends.elements, n + np.cumsum(crossing) - 1)
    begin = np.where(starts.kinds == VERTEX, starts.elements, np.roll(node, 1))

    on_edge = defaultdict(list)
    where = ends[np.flatnonzero(crossing)]
    for k in np.lexsort([where.along, where.elements]).tolist():
        on_edge[int(where.elements[k])].append(n + k)
    chords = defaultdict(list)
    inside = ~((lines.starts < 1e-9) & (lines.ends < 1e-9)).any(axis=1)
    for k in np.flatnonzero(inside & (begin != node)).tolist():
        chords[int(lines.faces[k])].append((int(begin[k]), int(node[k])))

    polygons, owners = [], []
    table = triangles.edges
    rows = (a.tolist() for a in (triangles.corner_vertices, table.face_edges, table.forward))
    for face, (corners, edges, forward) in enumerate(zip(*rows, strict=True)):
        outline = []
        for corner, edge, ahead in zip(corners, edges, forward, strict=True):
            outline += [corner, *on_edge.get(edge, [])[:: 1 if ahead else -1]]
        parts = cut(outline, chords.get(face, []))
        polygons += parts
        owners += [face] * len(parts)
    return polygons, np.array(owners), where


def cut(outline: list[int], chords: list[tuple[int, int]]) -> list[list[int]]:
    """Cut a convex polygon along chords between its corners; return the corners of each part, in linear time.

    `outline` lists its corners, and `chords` the two corners of each chord.
    """
    if not chords:
        return [outline]
    indices_of = defaultdict(list)
    for k, corner in enumerate(outline):
        indices_of[corner].append(k)
    between = [(a, b) for a, b in chords if a in indices_of and b in indices_of]
    between.sort(key=lambda ends: abs(indices_of[ends[0]][0] - indices_of[ends[1]][0]))
    following = [*range(1, len(outline)), 0]
    alive = [True] * len(outline)
    parts, n_left = [], len(outline)
    for chord in between:
        ends = [next((k for k in indices_of[corner] if alive[k]), -1) for corner in chord]
        first, last = min(ends), max(ends)
        if first < 0 or following[first] == last:
            continue
        part = [first]
        while part[-1] != last:
            part.append(following[part[-1]])
        if len(part) < n_left:  # else it is a side of what is left
            parts.append([outline[k] for k in part])
            for k in part[1:-1]:
                alive[k] = False
            following[first], n_left = last, n_left - len(part) + 2
    return [*parts, [corner for corner, is_left in zip(outline, alive, strict=True) if is_left]]


def positions(triangulation: IntrinsicTriangulation, points: LocatedPoints) -> Floats:
    """(p, 3) positions in space of p points of the triangulation."""
    faces, barycentric, _ = triangulation.history.backward(points.faces, points.barycentric)
    return triangulation.in_space(*triangulation.refinement.pull_back(faces, barycentric))
