"""Reading and writing of polylines in the plane: drawings (SVG) and tables of points (CSV)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.polyline import Polyline
from ..errors import FileFormatError, GeometryError
from ..packages import lazy_module
from .files import PathLike, contents, format_for, parsed_by_others, reading, replacing
from .points import read_point_lists, write_point_lists

svgpathtools: Any = lazy_module("svgpathtools", "SVG drawings")

CURVE_PIECES = 64
"""Number of segments that approximate a Bézier curve or an arc."""


def read_polylines(path: PathLike) -> list[Polyline]:
    """Read polylines in the plane, in the format given by the extension.

    Parameters
    ----------
    path : str or path
        ``.svg``: all paths, lines, polylines, polygons, rectangles, circles and ellipses, with their transforms, in
        user units. The y axis, which points down in such files, is turned up, so that the left of a path is its left in
        the drawing. ``.csv``: x and y on each line, an empty line between polylines; a polyline is closed if its last
        point equals its first.

    Returns
    -------
    list of Polyline
        In the order of the file.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, damaged, or has no polyline.
    GeometryError
        If a polyline is invalid.

    Examples
    --------
    >>> import tempfile
    >>> square = Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_polylines(f"{folder}/square.svg", square)
    ...     read_polylines(f"{folder}/square.svg")
    [Polyline(4 points, closed)]
    """
    read_lists = format_for(path, READERS, "polylines in the plane")
    with reading(path):
        lists = read_lists(path)
    lines = []
    for number, (points, closed) in enumerate(lists):
        try:
            lines.append(Polyline(points, closed))
        except GeometryError as error:
            raise GeometryError(
                f"polyline {number}: {error.cause}", remedy=error.remedy, element=f"polyline {number}", path=path
            ) from error
    return lines


def write_polylines(path: PathLike, lines: Polyline | Sequence[Polyline]) -> None:
    """Write polylines in the plane, in the format given by the extension.

    Parameters
    ----------
    path : str or path
        ``.svg`` or ``.csv``, which `read_polylines` reads back exactly. It is written under a temporary name and
        renamed, so that an existing file survives a failure.
    lines : Polyline or sequence of Polyline
        The polylines.

    Raises
    ------
    FileFormatError
        If the format is unknown or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_polylines(f"{folder}/square.csv", Polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True))
    ...     read_polylines(f"{folder}/square.csv")
    [Polyline(4 points, closed)]
    """
    content_of = format_for(path, WRITERS, "polylines in the plane")
    content = content_of([lines] if isinstance(lines, Polyline) else list(lines))
    with replacing(path) as temporary:
        temporary.write_text(content, encoding="utf-8")


def read_svg(path: PathLike) -> list[tuple[NDArray[np.float64], bool]]:
    """Points of each subpath, and whether it is closed."""
    data = contents(path)
    found = parsed_by_others(lambda: _subpaths(data), len(data))
    if not found:
        raise FileFormatError(
            "there is no line in the drawing", remedy="convert text and images to paths first", path=path
        )
    return [(np.stack([points.real, -points.imag], axis=1), closed) for points, closed in found]


def _subpaths(data: bytes) -> list[tuple[NDArray[np.complex128], bool]]:
    """Complex points of each subpath, and whether it is closed."""
    conversions = {**svgpathtools.document.CONVERSIONS, "circle": clockwise_ellipse, "ellipse": clockwise_ellipse}
    whole_paths = svgpathtools.Document(BytesIO(data)).paths(path_conversions=conversions)
    subpaths = [part for whole in whole_paths for part in whole.continuous_subpaths()]
    found = []
    for subpath in subpaths:
        pieces = [
            [0.0] if isinstance(s, svgpathtools.Line) else np.arange(CURVE_PIECES) / CURVE_PIECES for s in subpath
        ]
        places = [s.point(t) for s, ts in zip(subpath, pieces, strict=True) for t in ts]
        closed = abs(subpath.end - subpath.start) <= 1e-9 * max(map(abs, places), default=0.0)
        found.append((np.array(places if closed else [*places, subpath.end]), closed))
    return found


def clockwise_ellipse(element: Any) -> str:
    """A circle or ellipse as a path in the direction of the SVG standard, clockwise in the drawing."""
    x, y, r, rx, ry = (float(element.get(name, 0)) for name in ("cx", "cy", "r", "rx", "ry"))
    rx, ry = rx or r, ry or r
    return f"M{x + rx},{y} A{rx},{ry} 0 1 1 {x - rx},{y} A{rx},{ry} 0 1 1 {x + rx},{y} Z"


def svg(lines: Sequence[Polyline]) -> str:
    """An SVG drawing of polylines, with the y axis pointing down."""
    points = np.concatenate([line.points for line in lines])
    lower, upper = points.min(axis=0), points.max(axis=0)
    margin = 0.05 * float((upper - lower).max())
    box = [lower[0] - margin, -upper[1] - margin, *(upper - lower + 2 * margin)]
    paths = []
    for line in lines:
        steps = " L ".join(f"{x!r},{-y!r}" for x, y in line.points.tolist())
        paths.append(f'<path d="M {steps}{" Z" if line.closed else ""}"/>')
    style = f'fill="none" stroke="black" stroke-width="{0.1 * margin:.6g}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{" ".join(f"{value:.9g}" for value in box)}">\n'
        f"<g {style}>\n" + "\n".join(paths) + "\n</g>\n</svg>\n"
    )


READERS: dict[str, Callable[[PathLike], list[tuple[NDArray[np.float64], bool]]]] = {
    ".csv": lambda path: read_point_lists(path, 2),
    ".svg": read_svg,
}
WRITERS: dict[str, Callable[[Sequence[Polyline]], str]] = {
    ".csv": lambda lines: write_point_lists([(line.points, line.closed) for line in lines]),
    ".svg": svg,
}
POLYLINE_FORMATS = frozenset(READERS)
