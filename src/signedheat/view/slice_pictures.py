"""Pictures of fields on grids: slices with isolines and the cross-section of the shape."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import GeometryError
from ..fields.field import Field
from ..grids.grid import Grid
from ..grids.marching import level_lines
from ..grids.polyline import Polyline
from ..io.files import PathLike
from ..packages import lazy_module
from ..shapes.kinds import SpaceSources
from ..surfaces.point_cloud import PointCloud
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import numbers
from .figures import add_color_bar, distance_colors, isolines_between, picture, range_of
from .surface_pictures import outside_of, refuse_to_draw, triangulated

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

mpl_collections: Any = lazy_module("matplotlib.collections", "pictures")

AXIS_NAMES = "xyz"
TET_NODES = 80
"""Number of nodes along the longest side of the grid on which a field on tets is drawn."""


def save_slices(
    field: Field[Grid] | Field[TetMesh], path: PathLike, shape: SpaceSources | None = None, levels: Sequence[float] = ()
) -> None:
    """Write a picture of three orthogonal slices through a field.

    Each slice is where its area inside is largest. Blue is inside, orange outside, and grey without a value. Of the
    field φ, the black line is φ = 0, dashed where the surface was completed, and the shape is red. A field in the plane
    is drawn whole.

    Parameters
    ----------
    field : Field
        A field on a grid in two or three dimensions, in a band, or on tets.
    path : str or path
        The file, in the format ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    shape : a shape, optional
        The shape to which the field is the distance, to be drawn too; by default none is. In the plane, a `Polyline` or
        a sequence of them.
    levels : sequence of float
        Further values of the field whose level sets are drawn, with heavier lines than the isolines; none by default.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    GeometryError
        If the field has one dimension, or more than three, or no value anywhere.
    """
    refuse_to_draw(field, on_surface=False)
    if isinstance(field.domain, TetMesh):
        grid = Grid.around(field.domain.bounds, resolution=TET_NODES, padding=0.0)
        field = Field(grid, field(grid.points.reshape(-1, 3)).reshape(grid.shape))
    if field.domain.dimension not in (2, 3):
        raise GeometryError(
            f"fields are drawn in 2 and 3 dimensions, and this one has {field.domain.dimension}", element="field"
        )
    if field.domain.dimension == 2:
        sides = field.domain.upper - field.domain.origin
        with picture(path, *(7.5 * sides / sides.max() + [1.6, 0.6])) as figure:
            draw_plane(field, figure.add_subplot(), shape, levels)
    else:
        with picture(path, 13.2, 4.6) as figure:
            draw_slices(field, figure.subplots(1, 3).tolist(), shape, levels)


def draw_slices(
    field: Field[Grid],
    axes: Sequence[Axes],
    shape: SpaceSources | None = None,
    levels: Sequence[float] = (),
    across: Sequence[int] = (2, 1, 0),
) -> None:
    """Draw slices through a field in space, each where its area inside is largest, and a colour bar.

    Parameters
    ----------
    field : Field
        A field on a grid in three dimensions. Of a field in a band, the coarse field is drawn.
    axes : sequence of Matplotlib axes
        The axes of a figure, one for each slice.
    shape : a shape, optional
        A shape whose section with each slice is drawn in red; by default none is.
    levels : sequence of float
        Further values of the field whose level sets are drawn, with heavier lines than the isolines; none by default.
    across : sequence of int
        The axis normal to each slice: 0, 1 or 2. By default the slices lie across z, y and x.
    """
    field = field.coarse or field
    colors, isolines, step = _colors_and_isolines(field)
    for panel, normal in zip(axes, across, strict=True):
        horizontal, vertical = (axis for axis in range(3) if axis != normal)
        layer = clearest_layer(field, normal)
        position = float(field.domain.axes[normal][layer])
        u, v = field.domain.axes[horizontal], field.domain.axes[vertical]
        index = (slice(None),) * normal + (layer,)
        trusted = None if field.confidence is None else field.confidence[index]
        _draw_panel(panel, u, v, field.values[index], colors, isolines, levels, trusted)
        _draw_section(panel, shape, normal, position, float(field.domain.spacing[normal]))
        panel.set(xlabel=AXIS_NAMES[horizontal], ylabel=AXIS_NAMES[vertical])
        panel.set_title(f"{AXIS_NAMES[normal]} = {rounded(position, field.domain.spacing[normal])}", fontsize=10)
    add_color_bar(axes[0].figure, axes, colors, isolines, step)


def clearest_layer(field: Field[Grid], axis: int) -> int:
    """Return the index along an axis of the layer of nodes with the most nodes inside, or if there are none, near zero.

    Of layers with nearly as many, it is the one nearest to the middle.
    """
    inside = field.values < 0
    if not inside.any():
        inside = np.abs(field.values) < 1.5 * field.domain.spacing.max()
    others = tuple(other for other in range(3) if other != axis)
    counts = inside.sum(axis=others)
    most = np.flatnonzero(counts >= 0.98 * counts.max())
    return int(most[np.abs(most - (len(counts) - 1) / 2).argmin()])


def rounded(position: float, spacing: float) -> str:
    """Write a position as text, rounded to the resolution of the grid."""
    digits = max(0, 1 - int(np.floor(np.log10(spacing))))
    return f"{round(position, digits) + 0.0:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{position:.0f}"


def draw_plane(field: Field[Grid], axes: Axes, shape: SpaceSources | None = None, levels: Sequence[float] = ()) -> None:
    """Draw a field in the plane with isolines and a colour bar.

    Parameters
    ----------
    field : Field
        A field on a grid in two dimensions.
    axes : Matplotlib axes
        Where to draw it.
    shape : Polyline, PointCloud or a sequence of them, optional
        What is drawn in red on top, by default nothing; other shapes are left out.
    levels : sequence of float
        Further values of the field whose level sets are drawn, with heavier lines than the isolines; none by default.
    """
    colors, isolines, step = _colors_and_isolines(field)
    u, v = field.domain.axes
    _draw_panel(axes, u, v, field.values, colors, isolines, levels)
    for line in shape if isinstance(shape, Sequence) else [shape]:
        if isinstance(line, PointCloud):
            axes.scatter(line.points[:, 0], line.points[:, 1], s=6, c="#d4145a", linewidths=0, zorder=3)
        elif isinstance(line, Polyline):
            draw_line(line, axes)
    axes.set(xlabel=AXIS_NAMES[0], ylabel=AXIS_NAMES[1])
    add_color_bar(axes.figure, [axes], colors, isolines, step)


def draw_line(line: Polyline, axes: Axes) -> None:
    """Draw a polyline in the plane into axes, in red above everything else."""
    points = np.concatenate([line.points, line.points[:1]]) if line.closed else line.points
    axes.plot(*points.T, color="#d4145a", linewidth=2.0, zorder=3)


def _colors_and_isolines(field: Field[Grid]) -> tuple[ScalarMappable, Floats, float]:
    """Return a colour scale for a field, values of its isolines, and the step between these."""
    low, high = range_of(field.values)
    return distance_colors(low, high), *isolines_between(low, high)


def _draw_panel(
    panel: Axes,
    u: Floats,
    v: Floats,
    values: Floats,
    colors: ScalarMappable,
    isolines: Floats,
    levels: Sequence[float],
    trusted: NDArray[np.float32] | None = None,
) -> None:
    """Draw values at the nodes of a plane grid as colours and isolines.

    Parameters
    ----------
    panel : Matplotlib axes
        Where to draw.
    u, v : (nu,) and (nv,) float
        Coordinates of the nodes.
    values : (nu, nv) float
        Values at the nodes; NaN is grey.
    colors : ScalarMappable
        Colours of the values.
    isolines : (k,) float
        Values of the isolines.
    levels : sequence of float
        Further values, whose level sets have heavier green lines. That of 0 is black.
    trusted : (nu, nv) float, optional
        Confidence, below 1 where the surface was completed; there, the heavier lines are dashed.
    """
    shown = np.ma.masked_invalid(values.T)
    shading: Literal["nearest", "gouraud"] = "nearest" if shown.mask.any() else "gouraud"
    panel.pcolormesh(u, v, shown, shading=shading, rasterized=True).set(cmap=colors.cmap, norm=colors.norm)
    panel.set_facecolor("#b9b9b9")
    low, high = float(shown.min()), float(shown.max())
    isolines = isolines[(isolines > low) & (isolines < high)]
    if len(isolines):
        panel.contour(u, v, shown, isolines, colors="#20303c", linewidths=0.35, alpha=0.7)
    given = numbers(levels, "levels")
    if given.ndim != 1 or not np.isfinite(given).all():
        raise GeometryError("levels must be finite numbers", remedy="give a list of numbers", element="levels")
    for level, color in ((0.0, "black"), *((level, "#1b6e3c") for level in given.tolist())):
        if low < level < high:
            for style, lines in lines_by_style(u, v, values, level, trusted).items():
                panel.add_collection(
                    mpl_collections.LineCollection(lines, colors=color, linewidths=1.3, linestyles=style, zorder=2)
                )
    panel.set(aspect="equal", xlim=u[[0, -1]], ylim=v[[0, -1]])
    panel.tick_params(labelsize=8)
    for spine in panel.spines.values():
        spine.set_visible(False)


def lines_by_style(
    u: Floats, v: Floats, values: Floats, level: float, trusted: NDArray[np.float32] | None = None
) -> dict[str, list[Floats]]:
    """Return the level set of values at the nodes of a plane grid as (k, 2) polylines, by style.

    They are ``"solid"`` where the confidence `trusted` is 1 and ``"dashed"`` elsewhere, on completed surface.
    """
    spacing = np.array([u[1] - u[0], v[1] - v[0]])
    lines: dict[str, list[Floats]] = {"solid": [], "dashed": []}
    for line, _ in level_lines(values, np.ones(2), level):
        points = line * spacing + [u[0], v[0]]
        is_given = np.ones(len(line), dtype=bool)
        if trusted is not None:
            is_given = scipy.ndimage.map_coordinates(trusted, line.T, order=0, mode="nearest") >= 1.0
        is_solid = is_given[1:] & is_given[:-1]  # for each segment
        ends = np.flatnonzero(np.diff(is_solid)) + 1
        for first, last in pairwise([0, *ends.tolist(), len(is_solid)]):
            if last > first:
                lines["solid" if is_solid[first] else "dashed"].append(points[first : last + 1])
    return lines


def cross_section(mesh: TriangleMesh, axis: int, position: float) -> Floats:
    """Return the segments in which the plane of points with a given position on an axis cuts a mesh.

    The result has the (s, 2, 2) ends of s segments, in the other two coordinates.
    """
    corners = mesh.vertices[mesh.faces]
    height = corners[:, :, axis] - position
    above = height >= 0
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    corners, height, above = corners[cut], height[cut], above[cut]
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))  # the corner that lies alone
    row = np.arange(len(cut))
    ends = []
    for step in (1, 2):
        other = (lone + step) % 3
        share = height[row, lone] / (height[row, lone] - height[row, other])
        ends.append(corners[row, lone] + share[:, None] * (corners[row, other] - corners[row, lone]))
    return np.delete(np.stack(ends, axis=1), axis, axis=2)


def _draw_section(panel: Axes, given: Any, axis: int, position: float, spacing: float) -> None:
    """Draw in red where a plane normal to an axis cuts a shape `given`, or the points within a spacing of the plane."""
    shape = None if given is None else outside_of(given)
    if isinstance(shape, PointCloud):
        near = shape.points[np.abs(shape.points[:, axis] - position) < spacing]
        x, y = np.delete(near, axis, axis=1).T
        panel.scatter(x, y, s=3, c="#d4145a", linewidths=0, zorder=3)
    elif shape is not None:
        segments = cross_section(triangulated(shape), axis, position)
        panel.add_collection(mpl_collections.LineCollection(list(segments), colors="#d4145a", linewidths=1.1, zorder=3))
