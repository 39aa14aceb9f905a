"""Deviations and thickness as coloured shapes, pictures with histograms, and tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..exchange import Elements
from ..foreign import elements
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..io.numpy_files import write_npz
from ..io.ply import write_ply
from ..solids.deviations import Deviation
from ..solids.thickness import Thickness
from ..surfaces.point_cloud import PointCloud
from ..surfaces.vertex_field import VertexField
from .figures import INSIDE_TO_OUTSIDE, PICTURE_FORMATS, even_colors, picture
from .rasterizer import oblique
from .surface_pictures import draw_points, draw_shape, draw_surface

VIEW = (22, -58)
"""Elevation and azimuth of the view, in degrees."""
DEVIATION_FORMATS = frozenset({".csv", ".ply"}) | PICTURE_FORMATS
THICKNESS_FORMATS = frozenset({".npz", ".ply"}) | PICTURE_FORMATS
THICK = 95.0
"""Percentile of thickness at which colours end."""
BINS = 40
"""Number of bins of the histogram of thickness."""
UNKNOWN = 190
"""Grey of faces without a thickness."""
COLORS = np.array([[int(color[at : at + 2], 16) for at in (1, 3, 5)] for color in INSIDE_TO_OUTSIDE])


def save_deviation(found: Deviation, path: PathLike) -> None:
    """Write deviations as a coloured shape, a picture or a table."""
    ensure_writable(path, DEVIATION_FORMATS, "deviations")
    if extension(path) in PICTURE_FORMATS:
        return _draw_deviation(found, path)
    with replacing(path) as temporary:
        if extension(path) == ".ply":
            scan = elements(found.scan, {"deviation": found.distances})
            reach = found.extreme or 1.0
            temporary.write_bytes(write_ply(scan, path, _mixed(found.distances, -reach, reach, COLORS)))
        else:
            rows, names = np.column_stack([found.points, found.distances, found.nearest]), "x,y,z,deviation"
            np.savetxt(temporary, rows, "%.9g", ",", header=f"{names},nearest_x,nearest_y,nearest_z", comments="")


def save_thickness(found: Thickness, path: PathLike) -> None:
    """Write thickness as a coloured shape, arrays or a picture."""
    ensure_writable(path, THICKNESS_FORMATS, "thickness")
    mesh = found.mesh
    if extension(path) in PICTURE_FORMATS:
        _draw_thickness(found, path)
    elif extension(path) == ".npz":
        arrays = {"vertices": mesh.vertices, "faces": mesh.faces, "origins": found.origins}
        write_npz(path, **arrays, thickness=found.values)
    else:  # each face with corners of its own, since programs show colours of vertices
        corners, faces = mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3)
        shape = Elements.of_triangles(corners, faces)
        values = {"thickness": np.repeat(found.values, 3)}
        shape = Elements(shape.points, shape.corners, shape.counts, values=values)
        with replacing(path) as temporary:
            temporary.write_bytes(write_ply(shape, path, np.repeat(_thickness_colors(found), 3, axis=0)))


def _mixed(values: Floats, low: float, high: float, stops: Ints) -> NDArray[np.uint8]:
    """(n, 3) colours of values between two limits."""
    places = np.linspace(low, high, len(stops))
    mixed = [np.interp(values, places, stops[:, channel]) for channel in range(3)]
    return np.stack(mixed, axis=1).round().astype(np.uint8)


def _thickness_colors(found: Thickness) -> NDArray[np.uint8]:
    """(m, 3) colours of faces: thin walls orange, thick ones blue, grey where nothing is opposite."""
    known = ~np.isnan(found.values)
    colors = np.full((len(known), 3), UNKNOWN, dtype=np.uint8)
    if known.any():
        colors[known] = _mixed(found.values[known], *_limits(found), COLORS[::-1])
    return colors


def _limits(found: Thickness) -> tuple[float, float]:
    """Thicknesses at which colours begin and end."""
    low, high = found.percentiles([0.0, THICK]).tolist()
    return (low, high) if high > low + 1e-9 * high else (0.0, high)


def _draw_thickness(found: Thickness, path: PathLike) -> None:
    """Draw the faces in colours, and the area of each thickness."""
    low, high = _limits(found)
    colors = _thickness_colors(found) / 255
    with picture(path, 12, 5) as figure:
        surface, histogram = figure.subplots(1, 2)
        draw_shape(found.mesh, surface, VIEW, colors=colors)
        known = np.flatnonzero(~np.isnan(found.values))
        values, areas = np.clip(found.values[known], low, high), found.mesh.face_areas
        counts, limits = np.histogram(values, BINS, (low, high), weights=100 * areas[known] / areas.sum())
        middles = 0.5 * (limits[1:] + limits[:-1])
        bars: Any = {"color": _mixed(middles, low, high, COLORS[::-1]) / 255, "edgecolor": "0.5", "linewidth": 0.5}
        histogram.bar(middles, counts, np.diff(limits), **bars)
        least, place = found.thinnest
        where = ", ".join(f"{x:.4g}" for x in place)
        histogram.set(xlabel=f"thickness (the last bar: all beyond {limits[-2]:.3g})", ylabel="% of the area")
        histogram.set_title(f"thinnest {least:.4g}, at ({where})\nmedian {found.percentiles([50])[0]:.4g}", fontsize=10)


def _draw_deviation(found: Deviation, path: PathLike) -> None:
    """Draw the scan in colours, and a histogram with percentiles; without isolines, since scans are noisy."""
    scale = even_colors(found.extreme or 1.0)
    with picture(path, 12, 5) as figure:
        scan, histogram = figure.subplots(1, 2)
        if isinstance(found.scan, PointCloud):
            draw_points(found.points, scan, oblique(*VIEW), colors=scale.to_rgba(found.distances))
        else:
            draw_surface(VertexField(found.scan, found.distances), scan, colors=scale)
        figure.colorbar(scale, ax=scan, shrink=0.85, pad=0.015, extend="both", format="{x:g}")
        counts, limits = found.histogram()
        middles = 0.5 * (limits[1:] + limits[:-1])
        look = {"color": scale.to_rgba(middles), "edgecolor": "0.5", "linewidth": 0.5}
        histogram.bar(middles, counts, np.diff(limits), **look)
        low, middle, high = found.percentiles((1, 50, 99))
        title = f"root mean square {found.rms:.4g}\n1 %: {low:.4g}, 50 %: {middle:.4g}, 99 %: {high:.4g}"
        beyond = f"the first and last bar: all beyond {limits[-2]:.3g}"
        histogram.set(xlabel=f"deviation, positive outside of the nominal part\n({beyond})", ylabel="points")
        histogram.set_title(title, fontsize=10)
