"""Pictures of distance on surfaces: shaded, with isolines, by a small rasteriser that needs no screen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..domains.curves import Curve
from ..fields.vertex_field import VertexField
from ..io.files import PathLike, ensure_writable
from .slices import INSIDE_TO_OUTSIDE, PICTURE_FORMATS, _direction, _write, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 900
"""Pixels along the longer side."""


def save_surface(field: VertexField, path: PathLike, sources: Sequence[Any] = (), n_contours: int = 20) -> None:
    """A surface coloured by φ, with isolines and sources, seen from where most of the sources show.

    Blue is φ < 0, orange φ > 0; the heavy line is φ = 0; yellow are the sources.

    Parameters
    ----------
    field : VertexField
        Distance on a surface.
    path : str or path
        The picture: ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    sources : sequence of Curve and SurfacePoints
        What to draw in yellow.
    n_contours : int
        About how many isolines.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    """
    ensure_writable(path, PICTURE_FORMATS, "a picture")
    figure = new_figure(8.0, 7.0)
    axes = figure.add_subplot(1, 1, 1)
    image = draw_surface(field, axes, sources, n_contours)
    figure.colorbar(image, ax=axes, shrink=0.7, label="signed distance")
    _write(figure, path)


def draw_surface(
    field: VertexField,
    axes: Axes,
    sources: Sequence[Any] = (),
    n_contours: int = 20,
    view: NDArray[np.float64] | None = None,
) -> Any:
    """Draw into axes; what a colour bar needs comes back. `view` is a direction from the surface to the eye."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    field = field.restrict()
    mesh, values = field.domain.triangulation, field.domain.on_triangulation(field.values)
    flat = [item for source in sources for item in (source if isinstance(source, Sequence) else [source])]
    frame = camera(mesh, flat) if view is None else looking(view)
    seen = mesh.vertices @ frame.T
    used = seen[mesh.faces.ravel()]
    lower, upper = used[:, :2].min(axis=0), used[:, :2].max(axis=0)
    scale = (SIZE - 20) / max(float((upper - lower).max()), 1e-300)
    seen = np.column_stack([(seen[:, :2] - lower) * scale + 10, seen[:, 2] * scale])
    width, height = (np.ceil((upper - lower) * scale).astype(int) + 20).tolist()
    depth, face, phi = rasterised(seen[mesh.faces], values[mesh.faces], width, height)

    bound = float(np.nanmax(np.abs(values))) or 1.0
    colours = ScalarMappable(Normalize(-bound, bound), LinearSegmentedColormap.from_list("phi", INSIDE_TO_OUTSIDE))
    known = face >= 0
    normals = mesh.face_area_vectors @ frame.T
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    light = 0.45 + 0.55 * np.abs(normals[face] @ np.array([0.25, 0.35, 0.9]) / 0.998)
    image = np.ones((height, width, 3))
    shade = colours.to_rgba(np.where(np.isfinite(phi), phi, 0.0))[..., :3] * light[..., None]
    shade[~np.isfinite(phi)] = 0.7
    image[known] = shade[known]
    span = float(np.nanmax(values) - np.nanmin(values))
    if n_contours > 0 and span > 0:
        darken(image, phi, known, span / n_contours)
    axes.imshow(image, origin="lower", interpolation="antialiased")
    for item in flat:
        draw_source(axes, item, mesh, frame, lower, scale, depth)
    axes.set_axis_off()
    return colours


def darken(image: NDArray[np.float64], phi: NDArray[np.float64], known: NDArray[np.bool_], step: float) -> None:
    """Isolines at multiples of a step, one pixel wide, and a heavier one at zero."""
    for spacing, width, strength in ((step, 0.6, 0.55), (np.inf, 1.4, 0.9)):
        level = phi / spacing if np.isfinite(spacing) else phi
        rise = np.hypot(*np.gradient(level))
        away = np.abs(level - np.round(level)) if np.isfinite(spacing) else np.abs(level)
        with np.errstate(invalid="ignore", divide="ignore"):
            cover = np.clip(width + 0.5 - away / rise, 0, 1)
        smooth = known & np.isfinite(cover) & (rise < 0.5 if np.isfinite(spacing) else rise < 2 * step)
        image[smooth] *= (1 - strength * cover[smooth])[:, None]


def draw_source(
    axes: Axes, item: Any, mesh: Any, frame: NDArray, lower: NDArray, scale: float, depth: NDArray[np.float64]
) -> None:
    """Those parts of a source that nothing hides."""
    points = np.einsum("ik,ikj->ij", item.barycentric, mesh.vertices[mesh.faces[item.faces]]) @ frame.T
    if isinstance(item, Curve) and item.closed:
        points = np.concatenate([points, points[:1]])
    pixels = (points[:, :2] - lower) * scale + 10
    column, row = np.clip(np.round(pixels).astype(int).T, 0, np.array(depth.shape[::-1])[:, None] - 1)
    visible = points[:, 2] * scale >= depth[row, column] - 6
    if isinstance(item, Curve):
        shown = np.where(visible[:, None], pixels, np.nan)
        axes.plot(*shown.T, color="black", linewidth=3.2, solid_capstyle="round")
        axes.plot(*shown.T, color="#ffd83b", linewidth=1.8, solid_capstyle="round")
    else:
        axes.plot(*pixels[visible].T, "o", color="#ffd83b", markeredgecolor="black", markersize=6)


def camera(mesh: Any, sources: Sequence[Any]) -> NDArray[np.float64]:
    """Axes of the picture: right, up, towards the eye."""
    normals = [mesh.face_area_vectors[s.faces] for s in sources]
    mean = np.zeros(3)
    if normals:
        stacked = np.concatenate(normals)
        lengths = np.linalg.norm(stacked, axis=1)
        mean = (stacked[lengths > 0] / lengths[lengths > 0, None]).sum(axis=0) / len(stacked)
    direction = _direction(22, -58)
    if np.linalg.norm(mean) > 0.3:
        direction = mean / np.linalg.norm(mean) + 0.2 * direction
    elif not normals or np.ptp(mesh.bounds, axis=0).min() < 1e-3 * np.ptp(mesh.bounds, axis=0).max():
        total = mesh.face_area_vectors.sum(axis=0)
        if np.linalg.norm(total) > 0.5 * mesh.face_areas.sum():
            direction = total
    return looking(direction)


def looking(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) right, up and towards the eye, for a direction to the eye."""
    towards = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    up = np.array([0.0, 0.0, 1.0]) if abs(towards[2]) < 0.95 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def rasterised(
    corners: NDArray[np.float64], values: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Depth, face and value at each pixel: (height, width), face −1 where there is none."""
    depth = np.full((height, width), -np.inf)
    face = np.full((height, width), -1, dtype=np.int64)
    shown = np.full((height, width), np.nan)
    _fill(corners, values, depth, face, shown)
    return depth, face, shown


@compiled
def _fill(corners, values, depth, face, shown):
    height, width = depth.shape
    for f in range(len(corners)):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[f]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        for row in range(max(int(np.ceil(min(ay, by, cy))), 0), min(int(max(ay, by, cy)), height - 1) + 1):
            for column in range(max(int(np.ceil(min(ax, bx, cx))), 0), min(int(max(ax, bx, cx)), width - 1) + 1):
                u = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                v = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                z = az + u * (bz - az) + v * (cz - az)
                if z > depth[row, column]:
                    depth[row, column], face[row, column] = z, f
                    shown[row, column] = (1 - u - v) * values[f, 0] + u * values[f, 1] + v * values[f, 2]
