"""Shaded pictures of shapes, with inner sides red, of distance on surfaces, and of deviations and thickness.

A small software rasteriser finds depth, face and value at each pixel. Matplotlib sorts whole faces by depth, which is
wrong where they pass through each other, as those of broken shapes do. VTK takes half a gigabyte, and needs a display,
or a library to draw without one, which servers do not have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, place
from ..compiled import compiled
from ..curves.cut_surface import CutSurface
from ..errors import GeometryError, UnsupportedTypeError
from ..fields.field import Field
from ..grids.grid import Grid
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..io.numpy_files import write_npz
from ..io.ply import write_ply
from ..shapes.exchange import Elements
from ..shapes.foreign import ForeignShape, as_shape, elements
from ..shapes.kinds import Shape
from ..solids.deviations import HISTOGRAM_BINS, Deviation
from ..solids.thickness import Thickness
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface_curves import Curve, CurveOrPoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import finite_number, numbers, whole_number
from .figures import (
    INSIDE_TO_OUTSIDE,
    PICTURE_FORMATS,
    add_color_bar,
    distance_colors,
    even_colors,
    isolines_between,
    picture,
    range_of,
)

MOST_ISOLINES = 1000
"""Largest number of isolines in a picture."""
LONGER_SIDE = 900
"""The larger of width and height of pictures of surfaces, in pixels."""
MARGIN_PIXELS = 10
"""Width of the empty margin in pixels."""
VIEW_ANGLES = (22, -58)
"""Elevation and azimuth of the view on a coloured surface, in degrees."""
LIGHT = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
"""Direction to the light: right, up and towards the eye."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A parallel projection from space to the pixels of a picture."""

    frame: Floats  # (3, 3) right, up and towards the eye
    lower: Floats  # (2,) lower left corner of the picture, in units of length
    scale: float  # pixels per unit of length
    width: int  # in pixels
    height: int

    @classmethod
    def around(cls, points: Floats, direction: Floats, up: int = 2) -> Camera:
        """Make a camera whose picture is filled by (n, 3) points, seen from a direction.

        `direction` leads from the points to the eye, and axis `up` (0, 1 or 2) points up in the picture.
        """
        frame = axes_of_view(direction, up)
        projected = points @ frame[:2].T
        lower, upper = projected.min(axis=0), projected.max(axis=0)
        scale = (LONGER_SIDE - 2 * MARGIN_PIXELS) / max(float((upper - lower).max()), 1e-300)
        width, height = (np.ceil((upper - lower) * scale).astype(int) + 2 * MARGIN_PIXELS).tolist()
        return cls(frame, lower, scale, width, height)

    def pixels(self, points: Floats) -> Floats:
        """Return the column, row and depth of (n, 3) points in pixels, (n, 3). Depths grow towards the eye."""
        rotated = points @ self.frame.T
        return np.column_stack([(rotated[:, :2] - self.lower) * self.scale + MARGIN_PIXELS, rotated[:, 2] * self.scale])

    def shades(self, area_vectors: Floats) -> Floats:
        """Return the (m,) brightness of faces with (m, 3) area vectors, from 0.45 to 1, the same for both sides."""
        normals = area_vectors @ self.frame.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        return 0.45 + 0.55 * np.abs(normals @ LIGHT)


def axes_of_view(direction: Floats, up: int = 2) -> Floats:
    """Return (3, 3) unit vectors to the right, upwards and towards the eye, for a direction towards the eye.

    Axis `up` points upwards in the picture, unless the eye looks along it.
    """
    up, towards = axis_number(up), np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    upwards = np.eye(3)[up] if abs(towards[up]) < 0.95 else np.eye(3)[up - 1]
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards]) + 0.0


def oblique(elevation: float, azimuth: float, up: int = 2) -> Floats:
    """Return the (3,) direction to an eye at an elevation above the plane normal to axis `up`, and an azimuth.

    Both are in degrees.
    """
    e, a = np.radians([finite_number(elevation, "elevation"), finite_number(azimuth, "azimuth")])
    return np.roll([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis_number(up) - 2)


def axis_number(up: int) -> int:
    """Return the number of an axis, or raise an error unless it is 0, 1 or 2."""
    number = whole_number(up, "up", 0)
    if number > 2:
        raise GeometryError(f"up must be 0, 1 or 2, not {number:g}", element="up")
    return number


def rasterize(corners: Floats, values: Floats, width: int, height: int) -> tuple[Floats, Ints, Floats]:
    """Return the depth, face and value at each pixel of a picture of triangles.

    Parameters
    ----------
    corners : (m, 3, 3) float
        Column, row and depth of the corners of the triangles in pixels, as `Camera.pixels` returns them.
    values : (m, 3) float
        Values at the corners.
    width, height : int
        The size of the picture in pixels.

    Returns
    -------
    depth : (height, width) float
        The depth of the nearest triangle; −∞ if there is none.
    face : (height, width) int
        The number of this triangle, or −1.
    value : (height, width) float
        The interpolated value on it, or NaN.
    """
    depth, face = np.full(height * width, -np.inf), np.full(height * width, -1)
    value = np.full(height * width, np.nan)
    _draw(np.ascontiguousarray(corners), width, height, depth, face)
    pixels = np.flatnonzero(face >= 0)
    a, b, c = (corners[face[pixels], k, :2] @ [1, 1j] for k in range(3))
    from_a = pixels % width + 1j * (pixels // width) - a
    area = (np.conj(b - a) * (c - a)).imag
    u, v = (np.conj(from_a) * (c - a)).imag / area, (np.conj(b - a) * from_a).imag / area
    value[pixels] = (np.stack([1 - u - v, u, v], axis=1) * values[face[pixels]]).sum(axis=1)
    return depth.reshape(height, width), face.reshape(height, width), value.reshape(height, width)


@compiled
def _draw(corners: Floats, width: int, height: int, depth: Floats, face: Ints) -> None:
    """Write the depth and number of the nearest triangle at each pixel into `depth` and `face`, (height · width,).

    `corners`, (m, 3, 3), are column, row and depth of the corners of triangles, in pixels; depths grow towards the eye.
    In each row a triangle covers its left end and not its right, so that each pixel is in one of two neighbours.
    """
    for t in range(len(corners)):
        ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
        bx, by, bz = corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2]
        cx, cy, cz = corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2]
        twice_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if twice_area == 0.0:
            continue
        slope_x = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) / twice_area
        slope_y = ((cz - az) * (bx - ax) - (bz - az) * (cx - ax)) / twice_area
        least, most = min(az, bz, cz), max(az, bz, cz)
        for row in range(max(np.int64(np.ceil(min(ay, by, cy))), 0), min(np.int64(np.ceil(max(ay, by, cy))), height)):
            left, right = np.inf, -np.inf
            if (ay < row) != (by < row):
                x = _crossed(ax, ay, bx, by, row)
                left, right = min(left, x), max(right, x)
            if (by < row) != (cy < row):
                x = _crossed(bx, by, cx, cy, row)
                left, right = min(left, x), max(right, x)
            if (cy < row) != (ay < row):
                x = _crossed(cx, cy, ax, ay, row)
                left, right = min(left, x), max(right, x)
            if not left < right:
                continue
            for column in range(max(np.int64(np.ceil(left)), 0), min(np.int64(np.ceil(right)), width)):
                # the plane of a triangle seen edge-on is steep, so its depth is bounded by those of the corners
                z = min(max(az + slope_x * (column - ax) + slope_y * (row - ay), least), most)
                if z >= depth[row * width + column]:
                    depth[row * width + column], face[row * width + column] = z, t


@compiled
def _crossed(ax: float, ay: float, bx: float, by: float, y: float) -> float:
    """Return x of the point of the side from a to b at height y, the same number if a and b are swapped."""
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (bx - ax) * ((y - ay) / (by - ay))


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

OUTER_COLOR, INNER_COLOR = np.array([0.96, 0.86, 0.55]), np.array([0.80, 0.25, 0.20])
"""Colours of the outer and inner sides of faces, red, green and blue from 0 to 1."""


def save_scene(shape: Shape | ForeignShape, path: PathLike, up: int = 2) -> None:
    """Write a picture of a shape, seen obliquely from above.

    Parameters
    ----------
    shape : a shape
        The shape.
    path : str or path
        The file, in the format ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    up : int
        The axis that points up in the picture: 0, 1 or 2.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    UnsupportedTypeError
        If `shape` is not a shape.
    """
    with picture(path, 7, 6) as figure:
        draw_shape(shape, figure.add_subplot(), up=up)


def draw_shape(
    shape: Shape | ForeignShape,
    axes: Axes,
    view: tuple[float, float] = (18, -58),
    up: int = 2,
    colors: Floats | None = None,
) -> None:
    """Draw a shape in space, with the inner sides of its faces in red.

    Parameters
    ----------
    shape : a shape
        The shape. Of voxels and tets, the boundary is drawn.
    axes : Matplotlib axes
        Where to draw it.
    view : (elevation, azimuth)
        The direction to the eye in degrees; by default from slightly above.
    up : int
        The axis that points up in the picture: 0, 1 or 2.
    colors : (m, 3) float, optional
        Colours of the faces of a triangle mesh, red, green and blue from 0 to 1. By default outer sides are light.
    """
    shape = outside_of(shape)
    direction = oblique(*view, up)
    axes.set_axis_off()
    if isinstance(shape, PointCloud):
        draw_points(shape.points, axes, direction, up)
        return
    mesh = triangulated(shape)
    camera = Camera.around(mesh.vertices[np.unique(mesh.faces)], direction, up)
    corners = camera.pixels(mesh.vertices)[mesh.faces]
    _, face, _ = rasterize(corners, np.zeros((mesh.n_faces, 3)), camera.width, camera.height)
    outwards = mesh.face_area_vectors @ camera.frame[2] > 0
    colors = np.where(outwards[:, None], OUTER_COLOR, INNER_COLOR) if colors is None else colors
    colors = colors * camera.shades(mesh.face_area_vectors)[:, None]
    axes.imshow(np.where((face >= 0)[..., None], colors[face], 1.0), origin="lower", interpolation="antialiased")


def draw_points(points: Floats, axes: Axes, direction: Floats, up: int = 2, colors: Floats | None = None) -> None:
    """Draw (n, 3) points into axes, seen from a direction, the nearer above the farther.

    They have (n, 4) colours, or are blue, darker the nearer they are. Of many points, only some are drawn.
    """
    drawn = slice(None, None, max(1, len(points) // 200_000))  # of larger clouds an even subset
    pixels = Camera.around(points[drawn], direction, up).pixels(points[drawn])
    order = np.argsort(pixels[:, 2])
    x, y, depth = pixels[order].T
    if colors is None:
        axes.scatter(x, y, s=4, c=depth, cmap="Blues", vmin=depth[0] - np.ptp(depth), linewidths=0)
    else:
        axes.scatter(x, y, s=4, c=colors[drawn][order], linewidths=0)
    axes.set_axis_off()
    axes.set_aspect("equal")


def outside_of(shape: Shape | ForeignShape) -> TriangleMesh | PolygonMesh | PointCloud:
    """Return the mesh or point cloud to draw for a shape: the boundary of voxels and tets, or else the shape itself."""
    own = as_shape(shape)
    if isinstance(own, DigitalSurface):
        return own.squares
    return own.boundary if isinstance(own, TetMesh) else own


def triangulated(mesh: TriangleMesh | PolygonMesh) -> TriangleMesh:
    """Split polygons into triangles around their centroids, which is fast and accurate enough to draw."""
    if isinstance(mesh, TriangleMesh):
        return mesh
    center = mesh.n_vertices + mesh.corner_polygons
    faces = np.stack([mesh.corners, mesh.next_corners, center], axis=1)
    return TriangleMesh(np.concatenate([mesh.vertices, mesh.polygon_centroids]), faces)


def save_surface(
    field: Field[Any],
    path: PathLike,
    sources: CurveOrPoints | Sequence[CurveOrPoints | Sequence[CurveOrPoints]] = (),
    n_contours: int = 20,
    up: int = 2,
) -> None:
    """Write a picture of a surface coloured by a field φ, with isolines, seen from a side that shows the sources.

    Blue is φ < 0, orange φ > 0, the heavy line is φ = 0, and sources are yellow.

    Parameters
    ----------
    field : Field
        Distance on a surface.
    path : str or path
        The file, in the format ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    sources : Curve, SurfacePoints or a sequence of them
        The sources to draw; none by default.
    n_contours : int
        The approximate number of isolines, 20 by default; 0 for none.
    up : int
        The axis that points up in the picture: 0, 1 or 2.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    """
    with picture(path, 8.0, 7.0) as figure:
        axes = figure.add_subplot()
        draw_surface(field, axes, sources, n_contours, up=up)
        axes.plot([], [], color="0.1", linewidth=1.6, label="φ = 0")
        if sources:
            axes.plot([], [], color="#ffd83b", linewidth=2.5, label="source")
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=2, frameon=False, fontsize=8)


def refuse_to_draw(field: object, on_surface: bool) -> None:
    """Raise an error unless an object is a field on a surface or, if not `on_surface`, on a grid or on tets."""
    if not isinstance(field, Field):
        raise UnsupportedTypeError(
            f"{type(field).__name__} is no field",
            remedy="pass what signed_distance returns; shapes are drawn by save_scene",
            element="field",
        )
    if isinstance(field.domain, Grid | TetMesh) == on_surface:
        raise UnsupportedTypeError(
            f"the field lies on a {type(field.domain).__name__}",
            remedy=f"draw it by {'save_slices' if on_surface else 'save_surface'}",
            element="field",
        )


def draw_surface(
    field: Field[Any],
    axes: Axes,
    sources: CurveOrPoints | Sequence[CurveOrPoints | Sequence[CurveOrPoints]] = (),
    n_contours: int = 20,
    view: Floats | tuple[float, float] | None = None,
    up: int = 2,
    colors: ScalarMappable | None = None,
) -> None:
    """Draw a field on a surface as colours, with isolines and a colour bar.

    Parameters
    ----------
    field : Field
        Distance on a surface.
    axes : Matplotlib axes
        Where to draw it.
    sources : Curve, SurfacePoints or a sequence of them
        The sources to draw, in yellow; none by default.
    n_contours : int
        The approximate number of isolines, 20 by default; 0 for none.
    view : (3,) or (2,) float, optional
        The direction from the surface to the eye, or its elevation and azimuth in degrees; by default a side that shows
        the sources.
    up : int
        The axis that points up in the picture: 0, 1 or 2.
    colors : matplotlib.cm.ScalarMappable, optional
        The colours of values. If they are given, isolines and colour bar are left out.
    """
    refuse_to_draw(field, on_surface=True)
    source_mesh, mesh, values = _source_mesh_and_painted(field)
    given = sources if isinstance(sources, Sequence) else [sources]
    flat = [item for source in given for item in (source if isinstance(source, Sequence) else [source])]
    n_contours = whole_number(n_contours, "n_contours", 0)
    if n_contours > MOST_ISOLINES:
        raise GeometryError(f"n_contours must be at most {MOST_ISOLINES}, not {n_contours:g}", element="n_contours")
    direction = toward_sources(source_mesh, flat, up) if view is None else numbers(view, "view")
    if view is not None and (
        direction.shape not in ((2,), (3,)) or not (np.isfinite(direction).all() and direction.any())
    ):
        raise GeometryError("view must be two angles in degrees, or a direction", element="view")
    if len(direction) == 2:
        direction = oblique(direction[0], direction[1], up)
    camera = Camera.around(mesh.vertices[np.unique(mesh.faces)], direction, up)
    corners = camera.pixels(mesh.vertices)[mesh.faces]
    depth, face, phi = rasterize(corners, values[mesh.faces], camera.width, camera.height)

    low, high = range_of(values)
    scale = distance_colors(low, high) if colors is None else colors
    shade = scale.to_rgba(np.where(np.isfinite(phi), phi, 0.0))[..., :3]
    shade[~np.isfinite(phi)] = 0.7
    covered = face >= 0
    image = np.where(covered[..., None], shade * camera.shades(mesh.face_area_vectors)[face][..., None], 1.0)
    isolines, step = isolines_between(low, high, n_contours)
    if n_contours > 0 and high > low and colors is None:
        darken(image, phi, covered, step)
    axes.imshow(image, origin="lower", interpolation="antialiased")
    for item in flat:
        draw_source(axes, item, source_mesh, camera, depth)
    axes.set_axis_off()
    if colors is None:
        spanned = (
            np.array([low, *isolines, high]) if high > low else isolines
        )  # the bar spans all values, not only isolines
        add_color_bar(axes.figure, [axes], scale, spanned, step)


def _source_mesh_and_painted(field: Field[Any]) -> tuple[TriangleMesh, Any, Floats]:
    """Return the mesh to whose faces sources refer, the mesh on whose faces φ is linear, and φ at its (n,) vertices."""
    domain = field.domain
    surface = domain.surface if isinstance(domain, CutSurface) else domain
    source_mesh = surface.mesh if isinstance(surface, IntrinsicTriangulation) else surface.triangulation
    painted = field.expand()
    drawn: Any = painted.domain
    return source_mesh, drawn.triangulation, drawn.on_triangulation(painted.values)


def darken(image: Floats, phi: Floats, covered: Bools, step: float) -> None:
    """Draw isolines at multiples of `step`, and a heavier one at zero, by darkening pixels of an image.

    Parameters
    ----------
    image : (height, width, 3) float
        The colours, which are changed.
    phi : (height, width) float
        The value of the field at each pixel.
    covered : (height, width) bool
        The pixels that the surface covers.
    step : float
        The difference between isolines.
    """
    for spacing, width, strength in ((step, 0.6, 0.55), (np.inf, 1.4, 0.9)):
        level = phi / spacing if np.isfinite(spacing) else phi
        rise = np.hypot(*np.gradient(level))
        off = np.abs(level - np.round(level)) if np.isfinite(spacing) else np.abs(level)  # from the nearest isoline
        with np.errstate(invalid="ignore", divide="ignore"):
            cover = np.clip(width + 0.5 - off / rise, 0, 1)
        smooth = covered & np.isfinite(cover) & (rise < 0.5 if np.isfinite(spacing) else rise < 2 * step)
        image[smooth] *= (1 - strength * cover[smooth])[:, None]


def draw_source(axes: Axes, item: Any, mesh: Any, camera: Camera, depth: Floats) -> None:
    """Draw the parts of a source on a mesh that are not behind the surface, whose depth at each pixel is given."""
    points = np.einsum("ik,ikj->ij", item.barycentric, mesh.vertices[mesh.faces[item.faces]])
    if isinstance(item, Curve) and item.closed:
        points = np.concatenate([points, points[:1]])
    pixels, near = np.split(camera.pixels(points), [2], axis=1)
    column, row = np.clip(np.round(pixels).astype(int).T, 0, np.array(depth.shape[::-1])[:, None] - 1)
    visible = near[:, 0] >= depth[row, column] - 6
    if isinstance(item, Curve):
        shown = np.where(visible[:, None], pixels, np.nan)
        axes.plot(*shown.T, color="black", linewidth=3.2, solid_capstyle="round")
        axes.plot(*shown.T, color="#ffd83b", linewidth=1.8, solid_capstyle="round")
    else:
        axes.plot(*pixels[visible].T, "o", color="#ffd83b", markeredgecolor="black", markersize=6)


def toward_sources(mesh: TriangleMesh, sources: Sequence[Any], up: int = 2) -> Floats:
    """Return a (3,) direction to the eye from which most of the sources are visible.

    Without sources it is an oblique view, for flat surfaces along their normal.
    """
    normals = [mesh.face_area_vectors[s.faces] for s in sources]
    mean = np.zeros(3)
    if normals:
        stacked = np.concatenate(normals)
        lengths = np.linalg.norm(stacked, axis=1)
        mean = (stacked[lengths > 0] / lengths[lengths > 0, None]).sum(axis=0) / len(stacked)
    direction = oblique(*VIEW_ANGLES, up)
    if np.linalg.norm(mean) > 0.3:
        return mean / np.linalg.norm(mean) + 0.2 * direction
    extents = np.ptp(mesh.bounds, axis=0)
    if not normals or extents.min() < 1e-3 * extents.max():
        total: Floats = mesh.face_area_vectors.sum(axis=0)
        if np.linalg.norm(total) > 0.5 * mesh.face_areas.sum():
            return total
    return direction


DEVIATION_FORMATS = frozenset({".csv", ".ply"}) | PICTURE_FORMATS
"""Extensions of files to which deviations can be written."""
THICKNESS_FORMATS = frozenset({".npz", ".ply"}) | PICTURE_FORMATS
"""Extensions of files to which thickness can be written."""
COLORS = np.array([[int(color[k : k + 2], 16) for k in (1, 3, 5)] for color in INSIDE_TO_OUTSIDE])
"""The colours `INSIDE_TO_OUTSIDE` as (k, 3) red, green and blue from 0 to 255."""


def save_deviation(deviation: Deviation, path: PathLike) -> None:
    """Write deviations as a coloured shape (PLY), a picture, or a table (CSV) of points, distances, nearest points."""
    ensure_writable(path, DEVIATION_FORMATS, "deviations")
    if extension(path) in PICTURE_FORMATS:
        return _draw_deviation(deviation, path)
    with replacing(path) as temporary:
        if extension(path) == ".ply":
            scan = elements(deviation.scan, {"deviation": deviation.distances})
            reach = deviation.extreme or 1.0
            temporary.write_bytes(write_ply(scan, path, _colors_of(deviation.distances, -reach, reach, COLORS)))
        else:
            rows, names = np.column_stack([deviation.points, deviation.distances, deviation.nearest]), "x,y,z,deviation"
            np.savetxt(temporary, rows, "%.9g", ",", header=f"{names},nearest_x,nearest_y,nearest_z", comments="")


def save_thickness(thickness: Thickness, path: PathLike) -> None:
    """Write thickness as a coloured shape (PLY), arrays (NPZ) or a picture."""
    ensure_writable(path, THICKNESS_FORMATS, "thickness")
    mesh = thickness.mesh
    if extension(path) in PICTURE_FORMATS:
        _draw_thickness(thickness, path)
    elif extension(path) == ".npz":
        arrays = {"vertices": mesh.vertices, "faces": mesh.faces, "origins": thickness.origins}
        write_npz(path, **arrays, thickness=thickness.values)
    else:  # each face with corners of its own, since programs show colours of vertices
        corners, counts = mesh.vertices[mesh.faces].reshape(-1, 3), np.full(mesh.n_faces, 3)
        shape = Elements(corners, np.arange(len(corners)), counts, values={"thickness": np.repeat(thickness.values, 3)})
        with replacing(path) as temporary:
            temporary.write_bytes(write_ply(shape, path, np.repeat(_thickness_colors(thickness), 3, axis=0)))


def _colors_of(values: Floats, low: float, high: float, stops: Ints) -> NDArray[np.uint8]:
    """Return (n, 3) colours of values, interpolated between (k, 3) colours at even steps from `low` to `high`."""
    positions = np.linspace(low, high, len(stops))
    channels = [np.interp(values, positions, stops[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=1).round().astype(np.uint8)


def _thickness_colors(thickness: Thickness) -> NDArray[np.uint8]:
    """Return (m, 3) colours of faces: orange for thin walls, blue for thick ones, grey for faces without thickness."""
    known = ~np.isnan(thickness.values)
    colors = np.full((len(known), 3), 190, dtype=np.uint8)
    if known.any():
        colors[known] = _colors_of(thickness.values[known], *_limits(thickness), COLORS[::-1])
    return colors


def _limits(thickness: Thickness) -> tuple[float, float]:
    """Return the thicknesses of the first and the last colour: the least, and one that 95 % do not exceed."""
    low, high = thickness.percentiles([0.0, 95.0]).tolist()
    return (low, high) if high > low + 1e-9 * high else (0.0, high)


def _draw_thickness(thickness: Thickness, path: PathLike) -> None:
    """Write a picture of the faces in colours, and a histogram of area over thickness."""
    low, high = _limits(thickness)
    colors = _thickness_colors(thickness) / 255
    with picture(path, 12, 5) as figure:
        surface, histogram = figure.subplots(1, 2)
        draw_shape(thickness.mesh, surface, VIEW_ANGLES, colors=colors)
        known = np.flatnonzero(~np.isnan(thickness.values))
        values, areas = np.clip(thickness.values[known], low, high), thickness.mesh.face_areas
        counts, limits = np.histogram(values, HISTOGRAM_BINS, (low, high), weights=100 * areas[known] / areas.sum())
        middles = 0.5 * (limits[1:] + limits[:-1])
        bars: Any = {"color": _colors_of(middles, low, high, COLORS[::-1]) / 255, "edgecolor": "0.5", "linewidth": 0.5}
        histogram.bar(middles, counts, np.diff(limits), **bars)
        least, point = thickness.thinnest
        where = place(point, thickness.mesh.bounds)
        median = thickness.percentiles([50])[0]
        histogram.set(xlabel=f"thickness (the last bar: all beyond {limits[-2]:.3g})", ylabel="% of the area")
        histogram.set_title(f"thinnest {least:.4g}, at {where}\nmedian {median:.4g}", fontsize=10)


def _draw_deviation(deviation: Deviation, path: PathLike) -> None:
    """Write a picture of the scan in colours, without isolines, since scans are noisy, and a histogram."""
    scale = even_colors(deviation.extreme or 1.0)
    with picture(path, 12, 5) as figure:
        scan, histogram = figure.subplots(1, 2)
        if isinstance(deviation.scan, PointCloud):
            draw_points(deviation.points, scan, oblique(*VIEW_ANGLES), colors=scale.to_rgba(deviation.distances))
        else:
            draw_surface(Field(deviation.scan, deviation.distances), scan, colors=scale)
        figure.colorbar(scale, ax=scan, shrink=0.85, pad=0.015, extend="both", format="{x:g}")
        counts, limits = deviation.histogram()
        middles = 0.5 * (limits[1:] + limits[:-1])
        bars = {"color": scale.to_rgba(middles), "edgecolor": "0.5", "linewidth": 0.5}
        histogram.bar(middles, counts, np.diff(limits), **bars)
        low, middle, high = deviation.percentiles((1, 50, 99))
        title = f"root mean square {deviation.rms:.4g}\n1 %: {low:.4g}, 50 %: {middle:.4g}, 99 %: {high:.4g}"
        beyond = f"the first and last bar: all beyond {limits[-2]:.3g}"
        histogram.set(xlabel=f"deviation, positive outside of the nominal part\n({beyond})", ylabel="points")
        histogram.set_title(title, fontsize=10)
