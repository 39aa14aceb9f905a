"""Pictures of fields and shapes, by matplotlib, without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..fields.grid_field import GridField
from ..io.files import PathLike, ensure_writable, extension, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE_FORMATS = frozenset({".png", ".pdf", ".svg", ".jpg"})
INSIDE_TO_OUTSIDE = ["#0b3c5d", "#3f7fae", "#a9cce3", "#fbfaf5", "#f6c9a0", "#d9793a", "#8c2d04"]
"""Deep to far: blue inside, light at the surface, orange outside."""
AXES = "xyz"


def save_slices(field: GridField, path: PathLike, shape: Any = None, levels: Sequence[float] = ()) -> None:
    """Three orthogonal slices through a field, with isolines and the cross-section of the shape it came from.

    Blue is inside, orange outside; the black line is φ = 0; red is the shape. Of a field in the plane, one picture;
    solid nodes are grey.

    Parameters
    ----------
    field : GridField
        A field in two or three dimensions.
    path : str or path
        The picture: ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    shape : TriangleMesh, PolygonMesh or PointCloud, optional
        What the field is a distance to. The slices go through the middle of its bounds, or of the grid. In the plane,
        a `Polyline` or a sequence of them.
    levels : sequence of float
        Further levels to draw, heavier than the isolines.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    GeometryError
        If the field has one dimension, or more than three.
    """
    ensure_writable(path, PICTURE_FORMATS, "a picture")
    if field.grid.dimension not in (2, 3):
        raise GeometryError(f"fields are drawn in 2 and 3 dimensions, and this one has {field.grid.dimension}")
    if field.grid.dimension == 2:
        sides = field.grid.upper - field.grid.origin
        figure = new_figure(*(7.5 * sides / sides.max() + [1.6, 0.6]))
        draw_plane(field, figure.add_subplot(), shape, levels)
        return _write(figure, path)
    figure = new_figure(13.2, 4.6)
    axes = [figure.add_subplot(1, 3, k + 1) for k in range(3)]
    draw_slices(field, axes, shape, levels)
    _write(figure, path)


def save_scene(shape: Any, path: PathLike) -> None:
    """A shape in perspective: outsides light, insides red, so that holes and flipped faces show.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    """
    ensure_writable(path, PICTURE_FORMATS, "a picture")
    figure = new_figure(7, 6)
    draw_shape(shape, figure.add_subplot(projection="3d"))
    _write(figure, path)


def draw_slices(
    field: GridField,
    axes: Sequence[Axes],
    shape: Any = None,
    levels: Sequence[float] = (),
    across: Sequence[int] = (2, 1, 0),
) -> None:
    """Draw one slice into each of some axes of a figure; `across` says which coordinate is constant on it."""
    look = _look(field)
    middle = _middle(field, shape)
    for panel, normal in zip(axes, across, strict=True):
        horizontal, vertical = (axis for axis in range(3) if axis != normal)
        u, v = field.grid.axes[horizontal], field.grid.axes[vertical]
        image = _draw_panel(panel, u, v, _slice(field, normal, middle[normal]), look, levels)
        _draw_section(panel, shape, normal, middle[normal], float(field.grid.spacing[normal]))
        panel.set(xlabel=AXES[horizontal], ylabel=AXES[vertical])
        panel.set_title(f"{AXES[normal]} = {middle[normal]:.4g}", fontsize=10)
    _add_color_bar(image, axes, look)


def draw_plane(field: GridField, axes: Axes, shape: Any = None, levels: Sequence[float] = ()) -> None:
    """Draw a field in the plane into axes; polylines, or points, in red."""
    look = _look(field)
    image = _draw_panel(axes, *field.grid.axes, field.values, look, levels)
    for line in shape if isinstance(shape, Sequence) else [] if shape is None else [shape]:
        if isinstance(line, PointCloud):
            axes.scatter(*line.points.T, s=6, c="#d4145a", linewidths=0, zorder=3)
        else:
            points = np.concatenate([line.points, line.points[:1]]) if line.closed else line.points
            axes.plot(*points.T, color="#d4145a", linewidth=2.0, zorder=3)
    axes.set(xlabel=AXES[0], ylabel=AXES[1])
    _add_color_bar(image, [axes], look)


@dataclass(frozen=True)
class _Look:
    """Colours and isolines, the same in all panels of a picture."""

    norm: Any
    colors: Any
    step: float
    isolines: NDArray[np.float64]


def _look(field: GridField) -> _Look:
    from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm

    low, high = float(np.nanmin(field.values)), float(np.nanmax(field.values))
    reach = max(abs(low), abs(high), np.finfo(float).tiny)
    norm = TwoSlopeNorm(0.0, min(low, -0.02 * reach), max(high, 0.02 * reach))
    colors = LinearSegmentedColormap.from_list("inside to outside", INSIDE_TO_OUTSIDE)
    step = _round_step((high - low) / 16)
    isolines = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return _Look(norm, colors, step, isolines[np.abs(isolines) > 0.5 * step])


def _draw_panel(
    panel: Axes, u: NDArray, v: NDArray, values: NDArray[np.float64], look: _Look, levels: Sequence[float]
) -> Any:
    """Values on a plane, indexed [u, v], as colours and isolines; what a colour bar needs comes back."""
    shown = np.ma.masked_invalid(values.T)
    shading = "nearest" if shown.mask.any() else "gouraud"
    image = panel.pcolormesh(u, v, shown, cmap=look.colors, norm=look.norm, shading=shading, rasterized=True)
    panel.set_facecolor("#b9b9b9")
    low, high = float(shown.min()), float(shown.max())
    isolines = look.isolines[(look.isolines > low) & (look.isolines < high)]
    for lines, color, width, alpha in (
        (isolines, "#20303c", 0.35, 0.7),
        ([0.0], "black", 1.3, 1.0),
        *(([level], "#1b6e3c", 1.3, 1.0) for level in levels),
    ):
        if any(low < line < high for line in lines):
            panel.contour(u, v, shown, lines, colors=color, linewidths=width, alpha=alpha)
    panel.set(aspect="equal", xlim=u[[0, -1]], ylim=v[[0, -1]])
    panel.tick_params(labelsize=8)
    for spine in panel.spines.values():
        spine.set_visible(False)
    return image


def _add_color_bar(image: Any, axes: Sequence[Axes], look: _Look) -> None:
    label = f"signed distance, a line every {look.step:g}"
    axes[0].figure.colorbar(image, ax=list(axes), shrink=0.85, pad=0.015, label=label)


def draw_shape(shape: Any, axes: Any, view: tuple[float, float] = (18, -58), max_faces: int = 200_000) -> None:
    """Draw a shape in perspective into 3-D axes; of larger shapes an even selection of the faces or points."""
    points = shape.points if isinstance(shape, PointCloud) else shape.vertices
    eye = _direction(*view)
    if isinstance(shape, PointCloud):
        some = points[:: max(1, len(points) // max_faces)]
        axes.scatter(*some.T, s=2, c="#3f7fae", linewidths=0)
        used = some
    else:
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        mesh = triangulated(shape)
        faces = mesh.faces[:: -(-mesh.n_faces // max_faces)]
        corners = mesh.vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
        facing = normals @ eye
        light = 0.45 + 0.55 * np.abs(normals @ _direction(55, view[1] + 40))
        tint = np.where((facing > 0)[:, None], [0.96, 0.86, 0.55], [0.80, 0.25, 0.20])
        colors = np.clip(tint * light[:, None], 0, 1)
        axes.add_collection3d(Poly3DCollection(corners, facecolors=colors, edgecolors=colors, linewidths=0.2))
        used = corners.reshape(-1, 3)
    lower, upper = used.min(axis=0), used.max(axis=0)
    extent = np.maximum(upper - lower, 1e-3 * max(float((upper - lower).max()), np.finfo(float).tiny))
    axes.set(xlim=(lower[0], lower[0] + extent[0]), ylim=(lower[1], lower[1] + extent[1]))
    axes.set(zlim=(lower[2], lower[2] + extent[2]))
    axes.set_box_aspect(extent, zoom=0.75 * np.linalg.norm(extent) / extent.max())  # long shapes fit, too
    axes.view_init(*view)
    axes.set_axis_off()


def cross_section(mesh: TriangleMesh, axis: int, position: float) -> NDArray[np.float64]:
    """Where a plane across an axis cuts the faces.

    Returns
    -------
    (s, 2, 2) float
        Ends of the segments, in the two other coordinates.
    """
    corners = mesh.vertices[mesh.faces]
    height = corners[:, :, axis] - position
    above = height >= 0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    corners, height, above = corners[cut], height[cut], above[cut]
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    row = np.arange(len(cut))
    ends = []
    for step in (1, 2):
        other = (lone + step) % 3
        share = height[row, lone] / (height[row, lone] - height[row, other])
        ends.append(corners[row, lone] + share[:, None] * (corners[row, other] - corners[row, lone]))
    return np.delete(np.stack(ends, axis=1), axis, axis=2)


def triangulated(mesh: TriangleMesh | PolygonMesh) -> TriangleMesh:
    """Polygons as fans around their centroids, for drawing."""
    if isinstance(mesh, TriangleMesh):
        return mesh
    center = mesh.n_vertices + mesh.corner_polygons
    faces = np.stack([mesh.corners, mesh.next_corners, center], axis=1)
    return TriangleMesh(np.concatenate([mesh.vertices, mesh.polygon_centroids]), faces)


def _draw_section(panel: Axes, shape: Any, axis: int, position: float, spacing: float) -> None:
    from matplotlib.collections import LineCollection

    if isinstance(shape, PointCloud):
        near = shape.points[np.abs(shape.points[:, axis] - position) < spacing]
        panel.scatter(*np.delete(near, axis, axis=1).T, s=3, c="#d4145a", linewidths=0, zorder=3)
    elif shape is not None:
        segments = cross_section(triangulated(shape), axis, position)
        panel.add_collection(LineCollection(list(segments), colors="#d4145a", linewidths=1.1, zorder=3))


def _middle(field: GridField, shape: Any) -> NDArray[np.float64]:
    box = np.stack([field.grid.origin, field.grid.upper]) if shape is None else shape.bounds
    return np.clip(box.mean(axis=0), field.grid.origin, field.grid.upper)


def _slice(field: GridField, axis: int, position: float) -> NDArray[np.float64]:
    """Values on a plane across an axis, linear between the layers of nodes."""
    place = (position - field.grid.origin[axis]) / field.grid.spacing[axis]
    layer = min(max(int(place), 0), field.grid.shape[axis] - 2)
    share = place - layer
    return (1 - share) * field.values.take(layer, axis) + share * field.values.take(layer + 1, axis)


def _round_step(width: float) -> float:
    """1, 2 or 5 times a power of ten, about as large as `width`."""
    if not width > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(width))
    return float(power * min((1, 2, 5, 10), key=lambda digit: abs(np.log(width / power / digit))))


def _direction(elevation: float, azimuth: float) -> NDArray[np.float64]:
    e, a = np.radians([elevation, azimuth])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that needs no screen and no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _write(figure: Figure, path: PathLike) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130, format=extension(path)[1:])
