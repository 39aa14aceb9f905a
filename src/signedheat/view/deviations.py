"""Deviations as coloured shapes, pictures and tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.foreign import elements
from ..fields.vertex_field import VertexField
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..io.ply import write_ply
from ..solids.deviation import Deviation
from .drawing import draw
from .figures import INSIDE_TO_OUTSIDE, PICTURE_FORMATS, picture

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


def colors(values: NDArray[np.float64], found: Deviation) -> NDArray[np.uint8]:
    """(n, 3) colours of deviations: blue below the part, light on it, orange above."""
    stops = np.array([[int(color[at : at + 2], 16) for at in (1, 3, 5)] for color in INSIDE_TO_OUTSIDE])
    places = np.linspace(-found.extreme or -1.0, found.extreme or 1.0, len(stops))
    mixed = [np.interp(values, places, stops[:, channel]) for channel in range(3)]
    result: NDArray[np.uint8] = np.stack(mixed, axis=1).round().astype(np.uint8)
    return result


def _draw(found: Deviation, path: PathLike) -> None:
    """The scan in colours, and the histogram with the percentiles."""
    with picture(path, 12, 5) as figure:
        scan, histogram = figure.subplots(1, 2)
        draw(VertexField(found.scan, found.distances), scan)
        counts, limits = found.histogram()
        middles = 0.5 * (limits[1:] + limits[:-1])
        histogram.bar(
            middles, counts, np.diff(limits), color=colors(middles, found) / 255, edgecolor="0.5", linewidth=0.5
        )
        low, middle, high = found.percentiles((1, 50, 99))
        title = f"1 %, 50 %, 99 %: {low:.4g}, {middle:.4g}, {high:.4g}; root mean square {found.rms:.4g}"
        histogram.set(xlabel="deviation, positive outside of the nominal part", ylabel="points", title=title)
