"""Read and write polylines in the plane: SVG drawings, with their shapes and transforms, and tables of points (CSV)."""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np

from ..arrays import Complexes, Floats
from ..curves.outlines import WHOLE, distinct, outlines_filled
from ..errors import FileFormatError, GeometryError, quoted
from ..grids.polyline import Polyline
from ..mesh.polylines import filled_outlines
from ..shapes.geometries import geometry_of, polylines_of
from .budgets import XML, charge, charge_tree, charge_words
from .files import PathLike, contents, damaged, format_for, reading, replacing, text
from .numerals import finite_numbers, integers, json_of
from .point_files import read_point_lists, write_point_lists
from .sandbox import parsed

CURVE_PIECES = 64
"""Number of segments that approximate a Bézier curve or an arc."""
NUMBER = re.compile(r"[\s,]*([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
"""Matches a number after spaces and commas."""
FLAG = re.compile(r"[\s,]*([01])")
"""Matches a flag of an arc, which is one digit that needs no space after it."""
COMMAND = re.compile(r"[\s,]*([MmZzLlHhVvCcSsQqTtAa])")
"""Matches the letter of a command of a path."""
ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
"""Number of arguments of each command of a path."""
SVG_UNITS = {"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "q": 96 / 101.6, "in": 96.0}
"""User units per unit of length; ems are those of the default font."""
SVG_UNITS |= {"em": 16.0, "ex": 8.0}
MOST_DEPTH = 100
"""Largest depth of nested elements of a drawing."""
CONTAINERS = ("svg", "g", "a", "switch")
"""Names of elements whose children are drawn."""
PLACED = {"svg": ("viewBox", "x", "y"), "symbol": ("viewBox",)}
"""Attributes by which an element within a drawing has coordinates of its own, which are refused, by its name."""
AXES = {"x": 0, "x1": 0, "x2": 0, "cx": 0, "rx": 0, "width": 0, "y": 1, "y1": 1, "y2": 1, "cy": 1, "ry": 1, "height": 1}
"""Axis, 0 or 1, of each attribute that is a length along x or y."""
BYTES_PER_CURVE_POINT = 64
"""Memory for a point of a line while a drawing is read."""


def read_svg(path: PathLike) -> list[tuple[Floats, bool]]:
    """Return the (n, 2) points of each subpath, with y upwards, and whether it is closed, in the order of drawing."""
    data = contents(path)
    charge_tree(data, XML)
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise damaged(f"it is not XML ({error})") from error
    named = {key: element for element in root.iter() if (key := element.get("id")) is not None}
    drawing = _Drawing(named, _size(root))
    charge(elements=sum(map(drawing.n_used, _uses(root))))
    lines = [line for part in drawing.drawn(root, np.eye(3)) for line in part]
    if not lines:
        raise FileFormatError("the drawing contains no lines", remedy="convert text and images to paths first")
    return [(points * (1.0, -1.0) + 0.0, closed) for points, closed in lines]  # adding 0 turns −0 into 0


@dataclass
class _Drawing:
    """Converts the elements of a drawing to polylines."""

    named: dict[str, ElementTree.Element]  # elements by id
    size: tuple[float, float]  # width and height in user units, NaN where the drawing does not give them
    counts: dict[ElementTree.Element, int] = field(default_factory=dict)  # results of `n_used`
    parts: dict[tuple[ElementTree.Element, str], list[tuple[Floats, bool]]] = field(default_factory=dict)
    """Subpaths of elements by element and fill rule, before any transform."""

    def drawn(
        self, element: ElementTree.Element, outer: Floats, depth: int = 0, is_used: bool = False, rule: str = "nonzero"
    ) -> Iterator[list[tuple[Floats, bool]]]:
        """Yield the subpaths of an element and of its children as lists of (n, 2) points and whether they are closed.

        Parameters
        ----------
        element : Element
            The element.
        outer : (3, 3) float
            The transform from its parent to the drawing, which maps the result.
        depth : int
            How many elements contain it.
        is_used : bool
            Whether a ``<use>`` draws it, so that its points count as repeated in the budget of the file.
        rule : str
            The fill rule of its parent. With ``"evenodd"``, outlines of what closed subpaths fill replace them.
        """
        if depth > MOST_DEPTH:
            raise damaged(f"its elements lie more than {MOST_DEPTH} levels deep, or contain themselves")
        kind = _kind(element)
        style = _declared(element.get("style", ""))
        if "none" in (element.get("display"), style.get("display")):
            return
        matrix = outer @ _transform(element.get("transform", ""))
        rule = style.get("fill-rule") or element.get("fill-rule") or rule
        if kind in CONTAINERS or (kind == "symbol" and is_used):
            if depth and any(name in element.attrib for name in PLACED.get(kind, ())):
                raise FileFormatError(f"a {kind} in it has coordinates of its own", remedy="convert it to paths first")
            for child in element:
                yield from self.drawn(child, matrix, depth + 1, is_used, rule)
        elif kind == "use":
            target = self._target(element)
            if target is not None:
                move = np.eye(3)
                move[:2, 2] = self._length(element, "x"), self._length(element, "y")
                yield from self.drawn(target, matrix @ move, depth + 1, True, rule)
        else:
            if (element, rule) not in self.parts:
                self.parts[element, rule] = self._parts(self._path(element, kind), rule)
            parts = self.parts[element, rule]
            made = sum(len(points) for points, _ in parts)
            charge(BYTES_PER_CURVE_POINT * made, points=made * is_used)
            yield [(points @ matrix[:2, :2].T + matrix[:2, 2], closed) for points, closed in parts]

    def n_used(self, element: ElementTree.Element, depth: int = 0) -> int:
        """Return the number of elements that drawing this one draws: itself, its children, and what these use."""
        if element not in self.counts:
            if depth > MOST_DEPTH:
                raise damaged(f"its elements lie more than {MOST_DEPTH} levels deep, or contain themselves")
            target = self._target(element) if _kind(element) == "use" else None
            inner = [*element, *([] if target is None else [target])]
            self.counts[element] = 1 + sum(self.n_used(child, depth + 1) for child in inner)
        return self.counts[element]

    def _target(self, element: ElementTree.Element) -> ElementTree.Element | None:
        """Return the element that a ``<use>`` names, or None if it does not exist."""
        name = next((value for key, value in element.attrib.items() if key.rpartition("}")[2] == "href"), "")
        return self.named.get(name[1:])

    def _parts(self, data: str, rule: str) -> list[tuple[Floats, bool]]:
        """Return the subpaths of path data. With the evenodd rule, outlines of what they fill replace closed ones."""
        parts = list(_subpaths(data))
        if rule != "evenodd" or not any(closed for _, closed in parts):
            return parts
        filled = filled_outlines([points for points, closed in parts if closed], "evenodd")
        return [*((outline[::-1], True) for outline in filled), *(part for part in parts if not part[1])]

    def _path(self, element: ElementTree.Element, kind: str) -> str:
        """Return the path data of an element of a given kind, such as ``circle``; empty if it draws no line.

        Circles, ellipses and rectangles run clockwise in the drawing.
        """
        if kind == "path":
            return element.get("d", "")
        if kind == "line":
            x1, y1, x2, y2 = (self._length(element, name) for name in ("x1", "y1", "x2", "y2"))
            return f"M{x1},{y1} L{x2},{y2}"
        if kind in ("polyline", "polygon"):
            return f"M{element.get('points', '')}{'Z' if kind == 'polygon' else ''}" if element.get("points") else ""
        if kind in ("circle", "ellipse"):
            x, y, r, rx, ry = (self._length(element, name) for name in ("cx", "cy", "r", "rx", "ry"))
            rx, ry = rx or r or ry, ry or r or rx
            return f"M{x + rx},{y} A{rx},{ry} 0 1 1 {x - rx},{y} A{rx},{ry} 0 1 1 {x + rx},{y} Z" if rx * ry else ""
        if kind == "rect":
            x, y, w, h, rx, ry = (self._length(element, name) for name in ("x", "y", "width", "height", "rx", "ry"))
            rx, ry = min(rx or ry, w / 2), min(ry or rx, h / 2)
            if w * h == 0:
                return ""
            if rx * ry == 0:
                return f"M{x},{y} h{w} v{h} h{-w} Z"
            arc = f"a{rx},{ry} 0 0 1"
            return (
                f"M{x + rx},{y} h{w - 2 * rx} {arc} {rx},{ry} v{h - 2 * ry} {arc} {-rx},{ry} "
                f"h{2 * rx - w} {arc} {-rx},{-ry} v{2 * ry - h} {arc} {rx},{-ry} Z"
            )
        return ""

    def _length(self, element: ElementTree.Element, name: str) -> float:
        """Return an attribute in user units, including percentages of the width, height or diagonal."""
        whole = self.size[AXES[name]] if name in AXES else math.hypot(*self.size) / math.sqrt(2)
        return length(element.get(name, "0"), whole, name)


def _uses(root: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Yield the ``<use>`` elements that are drawn themselves, not those within definitions."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        if _kind(element) == "use":
            yield element
        elif _kind(element) in CONTAINERS:
            waiting += element


def _kind(element: ElementTree.Element) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def length(word: str, whole: float = math.nan, name: str = "length") -> float:
    """Return a length in user units, 96 of which are an inch.

    Examples
    --------
    >>> length("25.4mm"), length("3"), length("50%", 8.0)
    (96.0, 3.0, 4.0)
    """
    match = NUMBER.match(word)
    unit = word[match.end() :].strip().lower() if match else ""
    if word.strip() == "auto":
        return 0.0
    if match is None or (unit != "%" and unit not in SVG_UNITS):
        raise damaged(f"{name} is {quoted(word)}, which is not a length", element=name)
    value = _finite(match, name) * (whole / 100 if unit == "%" else SVG_UNITS[unit])
    if not math.isfinite(value):
        raise FileFormatError(f"{name} is {quoted(word)} of a drawing without a size", remedy="give it a viewBox")
    return value


def _finite(match: re.Match[str], name: str) -> float:
    """Return the number that `NUMBER` or `FLAG` matched; raise an error if it is too large for a float."""
    value = float(match[1])
    if math.isinf(value):
        raise damaged(f"{name} has a number that is too large, {quoted(match[1])}", element=name)
    return value


def _declared(style: str) -> dict[str, str]:
    """Return the declarations in a ``style`` attribute by name, in lower case."""
    pairs = (declaration.partition(":") for declaration in style.lower().split(";"))
    return {name.strip(): value.replace("!important", "").strip() for name, _, value in pairs}


def _numbers(text: str, name: str) -> list[float]:
    """Return the numbers in an attribute, which spaces, commas or only signs separate."""
    numbers, position, end = [], 0, len(text.rstrip(" \t\r\n,"))
    while position < end:
        match = NUMBER.match(text, position)
        if match is None:
            raise damaged(f"{name} has '{text[position : position + 20].strip()}' where a number must be", element=name)
        numbers.append(_finite(match, name))
        position = match.end()
    return numbers


def _size(root: ElementTree.Element) -> tuple[float, float]:
    """Return the width and height of a drawing in user units; NaN where they are not given."""
    box = _numbers(root.get("viewBox", ""), "viewBox")
    if len(box) == 4:
        return box[2], box[3]
    sides = (root.get(name, "100%") for name in ("width", "height"))
    width, height = (math.nan if "%" in side else length(side) for side in sides)
    return width, height


def _transform(text: str) -> Floats:
    """Return the (3, 3) product of the transforms listed in an attribute; columns of points are multiplied by it."""
    matrix = np.eye(3)
    *steps, rest = text.split(")")
    for written in (*steps, *([rest] if rest.strip() else [])):
        kind, _, inside = written.partition("(")
        kind, numbers = kind.strip(" \t\r\n,"), _numbers(inside, "transform")
        step = np.eye(3)
        if kind == "matrix" and len(numbers) == 6:
            step[:2] = np.reshape(numbers, (3, 2)).T
        elif kind == "translate" and numbers:
            step[:2, 2] = (*numbers, 0.0)[:2]
        elif kind == "scale" and numbers:
            step[0, 0], step[1, 1] = numbers[0], numbers[-1]
        elif kind == "rotate" and len(numbers) in (1, 3):
            cos, sin = math.cos(math.radians(numbers[0])), math.sin(math.radians(numbers[0]))
            step[:2, :2] = [[cos, -sin], [sin, cos]]
            center = np.array(numbers[1:] or (0.0, 0.0))
            step[:2, 2] = center - step[:2, :2] @ center
        elif kind in ("skewX", "skewY") and numbers:
            step[(0, 1) if kind == "skewX" else (1, 0)] = math.tan(math.radians(numbers[0]))
        else:
            raise damaged(f"{quoted(written)} is not a transform", element="transform")
        matrix = matrix @ step
    return matrix


def _steps(data: str) -> Iterator[tuple[str, list[float]]]:
    """Yield the commands of a path with their arguments; further arguments without a command repeat the last one."""
    position, command = 0, ""
    end = len(data.rstrip())
    while position < end:
        word = COMMAND.match(data, position)
        if word:
            position, command = word.end(), word[1]
        elif command in "Zz":  # also true at the beginning, where it is empty
            raise damaged(f"a path goes on with '{data[position : position + 20].strip()}', which is not a command")
        numbers = []
        for index in range(ARGUMENTS[command.upper()]):
            pattern = FLAG if command in "Aa" and index in (3, 4) else NUMBER  # flags of arcs need no space after them
            number = pattern.match(data, position)
            if number is None:
                raise damaged(
                    f"a path has '{data[position : position + 20].strip()}' where a number of '{command}' must be"
                )
            position = number.end()
            numbers.append(_finite(number, "a path"))
        yield command, numbers
        command = {"M": "L", "m": "l"}.get(command, command)


def _subpaths(data: str) -> Iterator[tuple[Floats, bool]]:
    """Yield the (n, 2) points of each subpath of path data that has a length, and whether it is closed."""
    points: list[Complexes] = []
    current = start = control = 0j
    before, closed = "", False
    for command, numbers in _steps(data):
        name, origin = command.upper(), current if command.islower() else 0j
        if name == "M" or (before == "Z" and name != "Z"):
            yield from _whole(points, closed)
            start = current = origin + complex(*numbers) if name == "M" else start
            points, closed = [np.array([start])], False
        if not points:
            raise damaged(f"a path begins with '{command}', not with M")
        ends = [origin + complex(x, y) for x, y in zip(numbers[::2], numbers[1::2], strict=False)]
        if name == "Z":
            closed, current = True, start
        elif name in "HV":
            across, along = (current.imag, origin.real) if name == "H" else (current.real, origin.imag)
            current = complex(along + numbers[0], across) if name == "H" else complex(across, along + numbers[0])
            points.append(np.array([current]))
        elif name == "L":
            current = ends[0]
            points.append(np.array([current]))
        elif name in "CSQT":
            smooth = 2 * current - control if before and before in ("CS" if name in "CS" else "QT") else current
            corners = [current, *([smooth] if name in "ST" else []), *ends]
            points.append(_bezier(corners))
            control, current = corners[-2], corners[-1]
        elif name == "A":
            end = origin + complex(*numbers[5:])
            points.append(_arc(current, end, *numbers[:5]))
            current = end
        before = name
    yield from _whole(points, closed)


def _whole(parts: list[Complexes], closed: bool) -> Iterator[tuple[Floats, bool]]:
    """Yield the subpath joined from parts, with (n, 2) points, unless it has no length; and whether it is closed.

    It is also closed if it ends where it begins, up to rounding.
    """
    points = np.concatenate([np.zeros(0, dtype=np.complex128), *parts])
    if len(points) == 0 or (points == points[0]).all():
        return
    rounding = len(points) * np.finfo(float).eps * np.abs(points).max()
    if len(points) > 2 and abs(points[-1] - points[0]) <= rounding:
        points, closed = points[:-1], True
    yield np.stack([points.real, points.imag], axis=1), closed


def _bezier(corners: list[complex]) -> Complexes:
    """Return points of a Bézier curve of any degree without its first, by de Casteljau's algorithm.

    Points are complex numbers; `corners` are the control points.
    """
    t = np.arange(1, CURVE_PIECES + 1) / CURVE_PIECES
    rows = [np.full(CURVE_PIECES, corner) for corner in corners]
    while len(rows) > 1:
        rows = [(1 - t) * row + t * after for row, after in pairwise(rows)]
    rows[0][-1] = corners[-1]
    return rows[0]


def _arc(
    begin: complex, end: complex, rx: float, ry: float, degrees: float, is_large: float, is_clockwise: float
) -> Complexes:
    """Return points of an elliptical arc without its first, by a map of the ellipse to a circle (SVG 1.1, F.6.5).

    Points are complex numbers; the other arguments are those of the command ``A``.
    """
    rx, ry = abs(rx), abs(ry)
    if rx * ry == 0 or begin == end:
        return np.array([end])
    turn = complex(math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))

    def on_circle(point: complex) -> complex:
        turned = point / turn
        return complex(turned.real / rx, turned.imag / ry)

    first, last = on_circle(begin), on_circle(end)
    half = (last - first) / 2
    rise = math.sqrt(max(1 / abs(half) ** 2 - 1, 0.0))  # 0 where the radii are too small: they are scaled up
    center = (first + last) / 2 + half * 1j * (rise if bool(is_large) != bool(is_clockwise) else -rise)
    sweep = cmath.phase((last - center) / (first - center))
    if is_clockwise and sweep < 0:
        sweep += 2 * math.pi
    elif not is_clockwise and sweep > 0:
        sweep -= 2 * math.pi
    t = np.arange(1, CURVE_PIECES + 1) / CURVE_PIECES
    circle = center + (first - center) * np.exp(1j * sweep * t)
    points = (circle.real * rx + 1j * circle.imag * ry) * turn
    points[-1] = end
    return points


def svg(lines: Sequence[Polyline]) -> str:
    """Return an SVG drawing of polylines, with the y axis pointing down."""
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


def read_polylines(path: PathLike) -> list[Polyline]:
    """Read polylines in the plane, in the format given by the extension.

    Parameters
    ----------
    path : str or path
        A file in one of these formats:

        - SVG (``.svg``) has paths, lines, polylines, polygons, rectangles, circles and ellipses. They are transformed
          as the file says, to user units, 96 of which are an inch. The y axis, which points down in such files, is
          flipped, so that the left of a path is its left in the drawing. Subpaths without length are left out. Where a
          file says ``fill-rule: evenodd``, closed subpaths become the outlines of what they fill.
        - CSV (``.csv``) has x and y on each line, and an empty line between polylines. A polyline is closed if its last
          point equals its first.
        - GeoJSON (``.geojson``) has lines, and the rings of polygons, in the plane of their coordinates.
        - DXF (``.dxf``), read by the package ezdxf, has lines, polylines, arcs, circles, ellipses, splines and hatches,
          also in inserted blocks. They are seen along z. Closed lines become the outlines of what lies within an odd
          number of them.

    Returns
    -------
    list of Polyline
        The polylines in the order of the file.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, damaged, or has no polyline.
    GeometryError
        If a polyline is invalid.

    See Also
    --------
    io.write_polylines : Write lines in the plane.
    Polyline : A line in the plane.

    Examples
    --------
    >>> import tempfile
    >>> square = Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_polylines(square, f"{folder}/square.svg")
    ...     read_polylines(f"{folder}/square.svg")
    [Polyline(4 points, closed)]
    """
    read_lists = format_for(path, POLYLINE_READERS, "polylines in the plane")
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


def write_polylines(lines: Polyline | Sequence[Polyline], path: PathLike) -> None:
    """Write polylines in the plane, in the format given by the extension.

    Parameters
    ----------
    lines : Polyline or sequence of Polyline
        The polylines.
    path : str or path
        A ``.svg`` or ``.csv`` file, which `read_polylines` reads back exactly. It is written under a temporary name
        and renamed, so that an existing file survives a failure.

    Raises
    ------
    FileFormatError
        If there is no polyline, the format is unknown or the file cannot be written.

    See Also
    --------
    io.read_polylines : Read lines in the plane.
    Polyline : A line in the plane.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_polylines(Polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True), f"{folder}/square.csv")
    ...     read_polylines(f"{folder}/square.csv")
    [Polyline(4 points, closed)]
    """
    content_of = format_for(path, POLYLINE_WRITERS, "polylines in the plane")
    listed = [lines] if isinstance(lines, Polyline) else list(lines)
    if not listed:
        raise FileFormatError("there is no polyline to write", remedy="pass at least one", path=path)
    content = content_of(listed)
    with replacing(path) as temporary:
        temporary.write_text(content, encoding="utf-8")


def read_geojson(path: PathLike) -> list[tuple[Floats, bool]]:
    """Return the (n, 2) points of lines and of the rings of polygons in GeoJSON, and whether each is closed."""
    geometry = geometry_of(json_of(contents(path)))
    if geometry is None:
        raise damaged("it holds no geometry")
    return [(line.points, line.closed) for line in polylines_of(geometry)]


DXF_KINDS: dict[int, type] = {
    code: kind
    for kind, ranges in (
        (float, ((10, 60), (110, 150), (210, 240), (460, 470), (1010, 1060))),
        (int, ((60, 80), (90, 100), (160, 180), (270, 300), (370, 390), (400, 410), (420, 430), (440, 460))),
    )
    for codes in ranges
    for code in range(*codes)
}
"""Types of the values of DXF groups by their codes."""
DXF_SAG = 1e-3
"""Largest distance of a segment from the arc or spline that it approximates, relative to the drawing's size."""


def read_dxf(path: PathLike) -> list[tuple[Floats, bool]]:
    """Return the (n, 2) points of each line of a DXF drawing, seen along z, and whether it is closed.

    Lines of blocks are read where these are inserted, and curved lines become segments.

    Such files have no rule for filling, and parts with holes are drawn as outlines that run either way: closed ones
    become the outlines of what lies within an odd number of them, copies left out.
    """
    content = contents(path)
    if not content.startswith(b"AutoCAD Binary DXF"):
        _refuse_wrong_groups(text(path))
    drawing = parsed("dxf", path, "ezdxf", ".dxf files", sag=DXF_SAG)
    lines = np.split(drawing["points"], np.cumsum(drawing["counts"])[:-1])
    drawn = [Polyline(p, len(p) > 2 and bool((p[0] == p[-1]).all())) for p in lines if (p != p[0]).any()]
    outlines, *_ = outlines_filled(list(distinct(dict(enumerate(drawn))).values()), "evenodd", WHOLE)
    return [(line.points, line.closed) for line in outlines]


def _refuse_wrong_groups(content: str) -> None:
    """Raise `FileFormatError` if lines of a DXF drawing that must hold numbers hold anything else.

    Codes and values stand on alternate lines, and a code says what the value is.
    """
    charge_words(content)
    lines = content.rstrip().split("\n")
    codes, values = integers([line.strip() for line in lines[::2]], "group codes", 0).tolist(), lines[1::2]
    groups = list(zip(map(DXF_KINDS.get, codes), values, strict=False))  # a value may lack at the end
    finite_numbers([value.strip() for kind, value in groups if kind is float], "coordinates")
    integers(finite_numbers([value.strip() for kind, value in groups if kind is int], "counts"), "counts")


POLYLINE_READERS: dict[str, Callable[[PathLike], list[tuple[Floats, bool]]]] = {
    ".csv": lambda path: read_point_lists(path, 2),
    ".dxf": read_dxf,
    ".geojson": read_geojson,
    ".svg": read_svg,
}
POLYLINE_WRITERS: dict[str, Callable[[Sequence[Polyline]], str]] = {
    ".csv": lambda lines: write_point_lists([(line.points, line.closed) for line in lines]),
    ".svg": svg,
}
POLYLINE_FORMATS = frozenset(POLYLINE_WRITERS)
