"""Deviations as coloured shapes, pictures and tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..foreign import elements
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..io.ply import write_ply
from ..solids.deviations import Deviation
from ..surfaces.point_cloud import PointCloud
from ..surfaces.vertex_field import VertexField
from .figures import INSIDE_TO_OUTSIDE, PICTURE_FORMATS, even_colors, picture
from .rasterizer import oblique
from .surface_pictures import draw_points, draw_surface

VIEW = (22, -58)
"""Elevation and azimuth of the view, in degrees."""
DEVIATION_FORMATS = frozenset({".csv", ".ply"}) | PICTURE_FORMATS


def save_deviation(found: Deviation, path: PathLike) -> None:
    """Write deviations as a coloured shape, a picture or a table."""
    ensure_writable(path, DEVIATION_FORMATS, "deviations")
    if extension(path) in PICTURE_FORMATS:
        return _draw(found, path)
    with replacing(path) as temporary:
        if extension(path) == ".ply":
            scan = elements(found.scan, {"deviation": found.distances})
            temporary.write_bytes(write_ply(scan, path, colors(found.distances, found)))
        else:
            rows, names = np.column_stack([found.points, found.distances, found.nearest]), "x,y,z,deviation"
            np.savetxt(temporary, rows, "%.9g", ",", header=f"{names},nearest_x,nearest_y,nearest_z", comments="")


def colors(values: Floats, found: Deviation) -> NDArray[np.uint8]:
    """(n, 3) colours of deviations: blue below the part, light on it, orange above."""
    stops = np.array([[int(color[at : at + 2], 16) for at in (1, 3, 5)] for color in INSIDE_TO_OUTSIDE])
    places = np.linspace(-found.extreme or -1.0, found.extreme or 1.0, len(stops))
    mixed = [np.interp(values, places, stops[:, channel]) for channel in range(3)]
    return np.stack(mixed, axis=1).round().astype(np.uint8)


def _draw(found: Deviation, path: PathLike) -> None:
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
