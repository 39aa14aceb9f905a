"""Read and write polylines in the plane: drawings (SVG) and tables of points (CSV)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..arrays import Floats
from ..errors import GeometryError
from ..grids.polyline import Polyline
from .files import PathLike, format_for, reading, replacing
from .point_files import read_point_lists, write_point_lists
from .svg import read_svg, svg


def read_polylines(path: PathLike) -> list[Polyline]:
    """Read polylines in the plane, in the format given by the extension.

    Parameters
    ----------
    path : str or path
        ``.svg``: all paths, lines, polylines, polygons, rectangles, circles and ellipses, with their transforms, in
        user units, 96 of which are an inch. The y axis, which points down in such files, is turned up, so that the left
        of a path is its left in the drawing. Subpaths without length are left out. Where a file says ``fill-rule:
        evenodd``, closed subpaths become the outlines of what they fill. ``.csv``: x and y on each line, an empty line
        between polylines; a polyline is closed if its last point equals its first.

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


READERS: dict[str, Callable[[PathLike], list[tuple[Floats, bool]]]] = {
    ".csv": lambda path: read_point_lists(path, 2),
    ".svg": read_svg,
}
WRITERS: dict[str, Callable[[Sequence[Polyline]], str]] = {
    ".csv": lambda lines: write_point_lists([(line.points, line.closed) for line in lines]),
    ".svg": svg,
}
POLYLINE_FORMATS = frozenset(READERS)
