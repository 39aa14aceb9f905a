"""Pictures of shapes: outer sides light, inner sides red, so that holes and flipped faces are visible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..domains.digital_surface import DigitalSurface
from ..domains.foreign import ForeignShape, as_shape
from ..domains.kinds import Shape
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..io.files import PathLike
from .figures import ensure_picture_writable, new_figure, write_figure
from .rasterizer import Camera, oblique, rasterize

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTSIDE, INSIDE = np.array([0.96, 0.86, 0.55]), np.array([0.80, 0.25, 0.20])
MOST_POINTS = 200_000
"""Of larger clouds an even subset is drawn."""


def save_scene(shape: Shape | ForeignShape, path: PathLike, up: int = 2) -> None:
    """Write a picture of a shape seen obliquely from above, with axis `up` pointing up.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    UnsupportedTypeError
        If it is no shape.
    """
    ensure_picture_writable(path)
    figure = new_figure(7, 6)
    draw_shape(shape, figure.add_subplot(), up=up)
    write_figure(figure, path)


def draw_shape(shape: Shape | ForeignShape, axes: Axes, view: tuple[float, float] = (18, -58), up: int = 2) -> None:
    """Draw a shape into axes, seen from an elevation and an azimuth in degrees."""
    shape = outside_of(shape)
    direction = oblique(*view, up)
    axes.set_axis_off()
    if isinstance(shape, PointCloud):
        points = shape.points[:: max(1, shape.n_points // MOST_POINTS)]
        pixels = Camera.around(points, direction, up).pixels(points)
        near = np.argsort(pixels[:, 2])
        depth = pixels[near, 2]
        axes.scatter(*pixels[near, :2].T, s=4, c=depth, cmap="Blues", vmin=depth[0] - np.ptp(depth), linewidths=0)
        axes.set_aspect("equal")
        return
    mesh = triangulated(shape)
    camera = Camera.around(mesh.vertices[np.unique(mesh.faces)], direction, up)
    corners = camera.pixels(mesh.vertices)[mesh.faces]
    _, face, _ = rasterize(corners, np.zeros((mesh.n_faces, 3)), camera.width, camera.height)
    outwards = mesh.face_area_vectors @ camera.frame[2] > 0
    colors = np.where(outwards[:, None], OUTSIDE, INSIDE) * camera.shades(mesh.face_area_vectors)[:, None]
    axes.imshow(np.where((face >= 0)[..., None], colors[face], 1.0), origin="lower", interpolation="antialiased")


def outside_of(shape: Shape | ForeignShape) -> TriangleMesh | PolygonMesh | PointCloud:
    """What is seen of a shape of any kind: of voxels and tets, the boundary."""
    own = as_shape(shape)
    if isinstance(own, DigitalSurface):
        return own.squares
    return own.boundary if isinstance(own, TetMesh) else own


def triangulated(mesh: Any) -> TriangleMesh:
    """Polygons as fans around their centroids, for drawing."""
    if isinstance(mesh, TriangleMesh):
        return mesh
    center = mesh.n_vertices + mesh.corner_polygons
    faces = np.stack([mesh.corners, mesh.next_corners, center], axis=1)
    return TriangleMesh(np.concatenate([mesh.vertices, mesh.polygon_centroids]), faces)
