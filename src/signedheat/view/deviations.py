"""Deviations as coloured shapes, pages and tables."""

from __future__ import annotations

import html
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..domains.display import html_of
from ..fields.vertex_field import VertexField
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..io.surface_fields import ply_of
from ..solids.deviation import Deviation, save_deviation
from .colors import INSIDE_TO_OUTSIDE

DEVIATION_FORMATS = frozenset([".csv", ".html", ".ply"])
WIDTH, HEIGHT = 640, 220
"""Of the histogram, in pixels."""


@save_deviation.provide
def _(found: object, path: PathLike) -> None:
    assert isinstance(found, Deviation)
    ensure_writable(path, DEVIATION_FORMATS, "deviations")
    kind = extension(path)
    with replacing(path) as temporary:
        if kind == ".ply":
            temporary.write_bytes(ply_of(found.scan, "deviation", found.distances, colors(found.distances, found)))
        elif kind == ".html":
            temporary.write_text(_page(found, Path(path).stem), encoding="utf-8")
        else:
            rows = np.column_stack([found.points, found.distances, found.nearest])
            np.savetxt(
                temporary, rows, "%.9g", ",", header="x,y,z,deviation,nearest_x,nearest_y,nearest_z", comments=""
            )


def colors(values: NDArray[np.float64], found: Deviation) -> NDArray[np.uint8]:
    """(n, 3) colours of deviations: blue below the part, light on it, orange above."""
    stops = np.array([[int(color[at : at + 2], 16) for at in (1, 3, 5)] for color in INSIDE_TO_OUTSIDE])
    reach = found.extreme if found.extreme > 0 else 1.0
    places = np.linspace(-reach, reach, len(stops))
    mixed = [np.interp(values, places, stops[:, channel]) for channel in range(3)]
    result: NDArray[np.uint8] = np.stack(mixed, axis=1).round().astype(np.uint8)
    return result


def _page(found: Deviation, title: str) -> str:
    """A page that needs no other file."""
    lines = [("points", f"{len(found.distances)}"), ("mean", f"{found.distances.mean():.6g}")]
    lines += [("root mean square", f"{found.rms:.6g}")]
    figures = found.figures["percentiles"]
    assert isinstance(figures, dict)
    lines += [(f"{percent} %", f"{value:.6g}") for percent, value in figures.items()]
    lines += [("nearest to completed surface", f"{found.completed.mean():.2%}")]
    table = "".join(f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in lines)
    return (
        f'<!doctype html><meta charset="utf-8"><title>{html.escape(title)}</title>'
        "<style>body{font:15px sans-serif;margin:2em;max-width:60em}td{padding:.1em 1em .1em 0}"
        "td:last-child{text-align:right;font-variant-numeric:tabular-nums}</style>"
        f"<h1>{html.escape(title)}</h1><p>Signed deviations, positive outside of the nominal part. Colours are full at "
        f"{found.extreme:.3g}, which 99 % of the points are within.</p>"
        f"{html_of(VertexField(found.scan, found.distances))}<h2>Histogram</h2>{_bars(found)}"
        f"<h2>Percentiles</h2><table>{table}</table>\n"
    )


def _bars(found: Deviation) -> str:
    """The histogram, as SVG."""
    counts, limits = found.histogram()
    width, most = WIDTH / len(counts), max(int(counts.max()), 1)
    middles = 0.5 * (limits[1:] + limits[:-1])
    bars = []
    for at, (count, color) in enumerate(zip(counts.tolist(), colors(middles, found).tolist(), strict=True)):
        tall = (HEIGHT - 30) * count / most
        bars.append(
            f'<rect x="{at * width:.1f}" y="{HEIGHT - 25 - tall:.1f}" width="{width:.1f}" height="{tall:.1f}" '
            f'fill="rgb({color[0]},{color[1]},{color[2]})" stroke="#888" stroke-width=".5">'
            f"<title>{limits[at]:.3g} to {limits[at + 1]:.3g}: {count}</title></rect>"
        )
    marks = [(0, "start", limits[0]), (WIDTH / 2, "middle", 0.0), (WIDTH, "end", limits[-1])]
    text = "".join(f'<text x="{x}" y="{HEIGHT - 6}" text-anchor="{side}">{v:.3g}</text>' for x, side, v in marks)
    base = f'<line x1="0" x2="{WIDTH}" y1="{HEIGHT - 25}" y2="{HEIGHT - 25}" stroke="#888"/>'
    return f'<svg width="{WIDTH}" height="{HEIGHT}" font-size="13">{"".join(bars)}{base}{text}</svg>'
