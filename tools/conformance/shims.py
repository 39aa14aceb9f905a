"""A plugin for pytest that puts our functions in place of an installed package's, and notes which tests call them.

``CONFORMANCE`` names the package. A test that calls none of our functions says nothing about us.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from held import install_igl as install_igl
from numpy.typing import NDArray

import signedheat as sh
from signedheat.solids.completion import complete
from signedheat.solids.solid import Solid

CALLED: set[str] = set()
SOLIDS: dict[bytes, Solid] = {}


def ours(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of ours, whose calls are noted."""

    @wraps(function)
    def noted(*arguments: Any, **options: Any) -> Any:
        CALLED.add(os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0])
        return function(*arguments, **options)

    return noted


def solid(vertices: Any, faces: Any) -> Solid:
    """The solid of some faces as they are; the last ones are kept, since tests ask point by point."""
    vertices, faces = np.array(vertices, dtype=float), np.array(faces, dtype=np.int64)
    key = vertices.tobytes() + faces.tobytes()
    if key not in SOLIDS:
        SOLIDS.clear()
        SOLIDS[key] = complete((vertices, faces), as_oriented=True, keep_overlaps=True)
    return SOLIDS[key]


# trimesh: distance is positive inside


def closest(mesh: Any, points: Any) -> Any:
    return solid(mesh.vertices, mesh.faces).closest(points)


@ours
def closest_point(mesh: Any, points: Any) -> tuple[Any, ...]:
    found = closest(mesh, points)
    return found.points, np.abs(found.distances), found.faces


@ours
def trimesh_distance(mesh: Any, points: Any) -> Any:
    return -solid(mesh.vertices, mesh.faces).distance(points)


@ours
def contains_points(intersector: Any, points: Any, check_direction: Any = None) -> Any:
    return solid(intersector.mesh.vertices, intersector.mesh.faces).inside(points)


def install_trimesh() -> None:
    proximity: Any = import_module("trimesh.proximity")
    ray_triangle: Any = import_module("trimesh.ray.ray_triangle")
    ray_util: Any = import_module("trimesh.ray.ray_util")
    proximity.closest_point = closest_point
    proximity.signed_distance = trimesh_distance
    proximity.ProximityQuery.signed_distance = lambda query, points: trimesh_distance(query._mesh, points)
    ray_util.contains_points = ray_triangle.contains_points = contains_points


# gpytoolbox: lines in the plane are walls in space, high enough that nothing is nearer above or below


def walls(vertices: Any, edges: Any, reach: float) -> tuple[Any, Any, NDArray[np.int64]]:
    """A prism over segments in the plane, and which one each of its faces is over; outlines run counter-clockwise."""
    vertices, edges, n = np.asarray(vertices), np.asarray(edges, dtype=np.int64), len(vertices)
    levels = [np.column_stack([vertices, np.full(n, z)]) for z in (-reach, reach)]
    a, b = edges.T
    faces = np.concatenate([np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)])
    return np.concatenate(levels), faces, np.tile(np.arange(len(edges)), 2)


def outline(vertices: Any, edges: Any) -> Any:
    count = len(vertices)
    return np.column_stack([np.arange(count), np.roll(np.arange(count), -1)]) if edges is None else np.asarray(edges)


def planar(points: Any, vertices: Any, edges: Any) -> tuple[Solid, Any, NDArray[np.int64]]:
    places = np.pad(np.asarray(points, dtype=float), ((0, 0), (0, 1)))
    reach = 1e3 * float(np.abs(np.concatenate([places[:, :2], vertices])).max())
    corners, faces, owners = walls(vertices, outline(vertices, edges), reach)
    return solid(corners, faces), places, owners


@ours
def gpytoolbox_distance(Q: Any, V: Any, F: Any = None, **options: Any) -> tuple[Any, ...]:
    if np.shape(V)[1] == 2:
        whole, places, owners = planar(Q, V, F)
        found = whole.closest(places)
        segments = owners[found.faces]
        a, b = (np.asarray(V)[end] for end in outline(V, F)[segments].T)
        along = ((found.points[:, :2] - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
        return found.distances, segments, np.column_stack([1 - along, along])
    found = solid(V, F).closest(Q)
    return found.distances, found.faces, found.barycentric


@ours
def gpytoolbox_winding(O: Any, V: Any, F: Any, **options: Any) -> Any:
    if np.shape(V)[1] == 2:
        whole, places, _ = planar(O, V, F)
        return whole.windings.numbers(places)
    return solid(V, F).windings.numbers(np.asarray(O, dtype=float))


@ours
def gpytoolbox_offset(V: Any, F: Any, iso: float, grid_size: int = 100) -> tuple[Any, Any]:
    surface: Any = sh.signed_distance((V, np.asarray(F)), resolution=grid_size, padding=2.5 * abs(iso)).contour(iso)
    return surface.vertices, surface.faces


def install_gpytoolbox() -> None:
    gpytoolbox: Any = import_module("gpytoolbox")
    gpytoolbox.signed_distance = gpytoolbox_distance
    gpytoolbox.signed_distance_polygon = ours(lambda P, V: gpytoolbox_distance(P, V[::-1])[0])
    gpytoolbox.winding_number = gpytoolbox.fast_winding_number = gpytoolbox_winding
    gpytoolbox.offset_surface = gpytoolbox_offset


# pygeodesic


class Geodesics:
    """Exact distance along a mesh from vertices; of paths only their lengths."""

    def __init__(self, points: Any, faces: Any) -> None:
        self.mesh = sh.TriangleMesh(points, faces)

    @ours
    def geodesicDistances(self, sources: Any, targets: Any = None) -> tuple[Any, Any]:
        values = sh.signed_distance(self.mesh.points_at(sources), self.mesh).values
        return (values if targets is None else values[targets]), None

    @ours
    def geodesicDistance(self, source: int, target: int) -> tuple[float, Any]:
        curve = self.mesh.polyline(self.mesh.vertices[[target, source]])
        return float(self.geodesicDistances([source])[0][target]), self.mesh.positions(curve)


def install_pygeodesic() -> None:
    geodesic: Any = import_module("pygeodesic.geodesic")
    geodesic.PyGeodesicAlgorithmExact = Geodesics


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    getattr(sys.modules[__name__], f"install_{os.environ['CONFORMANCE']}")()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Any:
    outcome = yield
    report = outcome.get_result()
    if report.when == "call" and os.environ["CONFORMANCE"] != "igl":  # whose calls print lines themselves
        why = str(report.longrepr.reprcrash.message).splitlines()[0] if report.failed else ""
        print(f"\nCONFORMANCE\t{item.nodeid}\t{report.outcome}\t{item.nodeid in CALLED}\t{why:.100}")
