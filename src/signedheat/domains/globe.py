"""Curves on a globe, given in longitude and latitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SourceError, UnsupportedTypeError
from .curves import Curve
from .foreign import ForeignShape, converted
from .polygon_mesh import PolygonMesh
from .triangle_mesh import TriangleMesh

ROUND = 0.1
"""How much the radii of a globe may differ from their mean, over it."""
OPPOSITE = 1e-6
"""Radians short of half a turn from which two points have no one great circle through them."""


def globe_curve(
    mesh: TriangleMesh | PolygonMesh | ForeignShape, points: ArrayLike, closed: bool = False, oriented: bool = True
) -> Curve:
    """A curve along great circles on a mesh of a globe, which may also be a little flat or rough.

    Parameters
    ----------
    mesh : TriangleMesh or PolygonMesh
        The globe, of any size; its centre is that of the box around it, and north is up along z.
    points : (n, 2) float
        Longitude, east positive, from the x axis on, and latitude, in degrees.
    closed : bool
        Whether the last point is joined to the first.
    oriented : bool
        Whether the sides of the curve are distinguished.

    Returns
    -------
    Curve
        On the mesh; left of it φ is positive.

    Raises
    ------
    SourceError
        If a latitude or a longitude is out of range, two points in succession are opposite each other, or the mesh is
        no globe.
    UnsupportedTypeError
        If it is no mesh.

    Examples
    --------
    >>> from signedheat import samples
    >>> circle = globe_curve(samples.sphere(3), [[0, 30], [120, 30], [240, 30]], closed=True)
    >>> circle.closed
    True
    """
    mesh = converted(mesh)
    if not isinstance(mesh, TriangleMesh | PolygonMesh):
        raise UnsupportedTypeError(
            f"a globe is a mesh, and this is a {type(mesh).__name__}", remedy="triangulate it", element="mesh"
        )
    center, radius = globe_frame(mesh)
    step = float(np.mean(mesh.triangulation.edge_lengths)) / radius
    ways = great_circles(directions(points), closed, step)
    return mesh.polyline(center + radius * ways, closed=closed, oriented=oriented, max_distance=2 * ROUND * radius)


def globe_frame(mesh: TriangleMesh | PolygonMesh) -> tuple[NDArray[np.float64], float]:
    """Centre and mean radius of a mesh of a globe.

    Raises
    ------
    SourceError
        If it is none.
    """
    triangles = mesh.triangulation
    lower, upper = mesh.bounds
    center = (lower + upper) / 2
    radii = np.linalg.norm(triangles.vertices[np.unique(triangles.faces)] - center, axis=1)
    radius = float(radii.mean())
    if not np.abs(radii - radius).max() <= ROUND * radius:
        raise SourceError(
            f"the mesh is no globe: its vertices are {radii.min():.4g} to {radii.max():.4g} from its centre",
            remedy="use a mesh of a sphere",
            element="mesh",
        )
    return center, radius


def directions(points: ArrayLike) -> NDArray[np.float64]:
    """(n, 3) unit vectors from the centre of a globe, of longitudes and latitudes in degrees.

    Examples
    --------
    >>> directions([[0, 0], [90, 0], [0, 90]]).round(6).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
        raise SourceError(f"points on a globe are rows of longitude and latitude, not {places.shape}", element="points")
    for column, name, most in ((1, "latitude", 90.0), (0, "longitude", 360.0)):
        beyond = np.flatnonzero(np.abs(places[:, column]) > most)
        if len(beyond):
            raise SourceError(
                f"point {beyond[0]} has the {name} {places[beyond[0], column]:g}",
                remedy="give degrees, longitude first",
                element=f"point {beyond[0]}",
            )
    longitude, latitude = np.radians(places).T
    level = np.cos(latitude)
    return np.column_stack([level * np.cos(longitude), level * np.sin(longitude), np.sin(latitude)])


def longitudes_and_latitudes(ways: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) in degrees, of vectors from the centre of a globe: the reverse of `directions`.

    Examples
    --------
    >>> longitudes_and_latitudes(np.array([[2.0, 0, 0], [0, -1, 0], [0, 1, 1]])).round(6).tolist()
    [[0.0, 0.0], [-90.0, 0.0], [90.0, 45.0]]
    """
    x, y, z = ways.T
    return np.degrees(np.column_stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]))


def great_circles(points: NDArray[np.float64], closed: bool, step: float) -> NDArray[np.float64]:
    """Unit vectors along the great circles through unit vectors in succession, at most `step` radians apart.

    Raises
    ------
    SourceError
        If two in succession are opposite each other, or fewer than two differ.

    Examples
    --------
    >>> great_circles(np.eye(3)[:2], closed=False, step=0.8).round(3).tolist()
    [[1.0, 0.0, 0.0], [0.707, 0.707, 0.0], [0.0, 1.0, 0.0]]
    """
    after = np.roll(points, -1, axis=0)
    fresh = np.linalg.norm(after - points, axis=1) > 1e-12  # 180° west is 180° east
    if not closed:
        fresh[-1] = True
    points = points[fresh]
    if len(points) < 2:
        raise SourceError(
            "a curve needs at least two different points", remedy="leave it out", element=f"{len(points)} points"
        )
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    ways = []
    for k, (start, end) in enumerate(zip(points, ends, strict=False)):
        angle = 2 * np.arctan2(np.linalg.norm(end - start), np.linalg.norm(end + start))
        if angle > np.pi - OPPOSITE:
            raise SourceError(
                f"points {k} and {k + 1} are opposite each other: every way is as short",
                remedy="add a point between them",
                element=f"point {k}",
            )
        share = np.linspace(0, 1, max(int(np.ceil(angle / step)), 1) + 1)[:-1, None]
        ways.append((np.sin((1 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle))
    return np.concatenate(ways if closed else [*ways, points[-1:]])
