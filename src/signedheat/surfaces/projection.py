"""Projection of polylines in space on a surface."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SourceError
from ..geodesics.shortest_paths import join
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import locate_points
from ..mesh.triangles import Triangles
from ..search.nearest_triangles import TriangleTree
from ..validation import coordinates, finite_number
from .surface_curves import Curve


class Joined(Protocol):
    """Triangles along which points are joined."""

    @property
    def intrinsic(self) -> IntrinsicMesh:
        """The triangles in the plane."""


class PlaceableTriangles(Triangles, Protocol):
    """Triangles on which points in space are placed and joined; what that takes is made once."""

    @property
    def joined(self) -> Joined:
        """The same triangles, with one vertex for those of rims at one place."""

    @property
    def search_tree(self) -> TriangleTree:
        """Tree of the faces."""


def projected_curve(
    mesh: PlaceableTriangles, points: ArrayLike, closed: bool, oriented: bool, max_distance: float | None
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
    triangles = mesh.joined.intrinsic
    start = np.arange(len(points) if closed else len(points) - 1)
    located, starts, ends, _ = join(
        triangles, locate_points(triangles, faces, weights), start, (start + 1) % len(points), "polyline"
    )
    order = starts if closed else np.append(starts, ends[-1])
    return Curve(located.faces[order], located.barycentric[order], closed=closed, oriented=oriented)


def closest_points(
    mesh: PlaceableTriangles, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Face, barycentric coordinates and distance of the closest point on a mesh, for each of (n, 3) points."""
    faces, weights = mesh.search_tree.nearest(points)
    found = np.einsum("ik,ikj->ij", weights, mesh.vertices[mesh.faces[faces]])
    return faces, weights, np.linalg.norm(points - found, axis=1)
