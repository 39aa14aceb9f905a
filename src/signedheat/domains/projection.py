"""Projection of polylines in space on a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SourceError
from ..geometry.box_tree import BoxTree
from ..geometry.geodesics.paths import join
from ..geometry.intrinsic_mesh import MARGIN, laid_out
from ..geometry.meshes import Triangles
from ..geometry.nearest import nearest_on_triangles
from ..geometry.surface_points import locate_points
from .curves import Curve
from .validation import coordinates, finite_number


def projected_curve(
    mesh: Triangles, points: ArrayLike, closed: bool, oriented: bool, max_distance: float | None
) -> Curve:
    """The curve through the closest points on a mesh, joined by geodesic paths."""
    points = coordinates(points, "points of the polyline", 3, SourceError)
    if len(points) < 2:
        raise SourceError(
            f"a polyline needs at least two points, not {len(points)}",
            remedy="for isolated points use points_at",
        )
    faces, weights, distances = closest_points(mesh, points)
    if max_distance is None:
        max_distance = 0.05 * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    far = int(distances.argmax())
    if distances[far] > finite_number(max_distance, "max_distance", least=0):
        raise SourceError(
            f"the polyline leaves the mesh: point {far}, {points[far].tolist()}, is "
            f"{distances[far]:.6g} away from it, and at most {max_distance:.6g} is allowed",
            remedy="check units and placement, or raise max_distance",
            element=f"point {far}",
        )
    triangles, _ = laid_out(mesh, MARGIN)
    start = np.arange(len(points) if closed else len(points) - 1)
    located, starts, ends, _ = join(
        triangles, locate_points(triangles, faces, weights), start, (start + 1) % len(points), "polyline"
    )
    order = starts if closed else np.append(starts, ends[-1])
    return Curve(located.faces[order], located.barycentric[order], closed=closed, oriented=oriented)


def closest_points(
    mesh: Triangles, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Face, barycentric coordinates and distance of the closest point on a mesh, for each of (n, 3) points."""
    corners = mesh.vertices[mesh.faces]
    tree = BoxTree.of(corners.min(axis=1), corners.max(axis=1))
    faces, weights = nearest_on_triangles(corners, tree, np.ascontiguousarray(points))
    found = np.einsum("ik,ikj->ij", weights, corners[faces])
    return faces, weights, np.linalg.norm(points - found, axis=1)
