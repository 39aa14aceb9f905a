"""Curves in longitude and latitude, from tables and GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..domains.curves import Curve, CurveOrPoints
from ..domains.foreign import ForeignShape, converted
from ..domains.globe import globe_curve, globe_frame, longitudes_and_latitudes
from ..domains.kinds import EmbeddedSurface
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, UnsupportedTypeError
from .files import PathLike, format_for, reading, text
from .points import read_point_lists

Line = tuple[NDArray[np.float64], bool]
"""Longitudes and latitudes in degrees, and whether the last point is joined to the first."""


def read_globe_curves(path: PathLike, mesh: TriangleMesh | PolygonMesh | ForeignShape) -> list[Curve]:
    """Read curves in longitude and latitude, along great circles of a globe.

    Parameters
    ----------
    path : str or path
        ``.csv`` with longitude and latitude on each line and an empty line between curves, closed where the last point
        is the first; or GeoJSON (``.geojson``, ``.json``): lines and the rings of polygons, in whatever collection.
        What polygons enclose is left of their rings, where φ is positive.
    mesh : TriangleMesh or PolygonMesh
        The globe.

    Returns
    -------
    list of Curve
        In the order of the file.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, damaged, or has no curve.
    SourceError
        If a point is out of range, two in succession are opposite each other, or the mesh is no globe.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from signedheat import samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "meridian.csv")
    ...     _ = path.write_text("0,0" + chr(10) + "0,90")
    ...     [curve] = read_globe_curves(path, samples.sphere(3))
    >>> curve.closed
    False
    """
    mesh = converted(mesh)
    read_lines = format_for(path, GLOBE_FORMATS, "curves on a globe")
    with reading(path):
        lines = read_lines(path)
        if not lines:
            raise FileFormatError("there is no curve in it", remedy="export lines or polygons", path=path)
        return [globe_curve(mesh, points, closed) for points, closed in lines]


def write_geojson(curves: Sequence[CurveOrPoints], domain: EmbeddedSurface) -> str:
    """Longitudes and latitudes of curves on a globe: closed ones end with their first point.

    Lines that cross the 180th meridian are not cut there.
    """
    if not isinstance(domain, TriangleMesh | PolygonMesh):
        raise UnsupportedTypeError(f"a globe is a mesh, and this is a {type(domain).__name__}", element="domain")
    center, _ = globe_frame(domain)
    features = []
    for curve in curves:
        places = longitudes_and_latitudes(domain.positions(curve) - center).tolist()
        if isinstance(curve, Curve) and curve.closed:
            places.append(places[0])
        kind = "LineString" if isinstance(curve, Curve) else "MultiPoint"
        geometry = {"type": kind, "coordinates": places}
        features.append({"type": "Feature", "properties": {}, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": features}) + "\n"


def _lines(thing: object, depth: int) -> Iterator[Line]:
    """The curves of a GeoJSON object."""
    if not isinstance(thing, dict) or depth > 64:
        raise ValueError("this is no GeoJSON")
    kind, places = thing.get("type"), thing.get("coordinates") or []
    for inner in (*(thing.get("features") or ()), *(thing.get("geometries") or ())):
        yield from _lines(inner, depth + 1)
    if kind == "Feature" and thing.get("geometry") is not None:
        yield from _lines(thing["geometry"], depth + 1)
    elif kind in ("LineString", "MultiLineString"):
        for line in [places] if kind == "LineString" else places:
            yield _line(line)
    elif kind in ("Polygon", "MultiPolygon"):
        for polygon in [places] if kind == "Polygon" else places:
            for number, ring in enumerate(polygon):
                points, closed = _line(ring)
                wanted = 1.0 if number == 0 else -1.0  # what is inside lies to the left, whichever way the file goes
                yield points if _turns_left(points) == wanted else points[::-1], closed


def _line(places: list[list[float]]) -> Line:
    points = np.array([place[:2] for place in places], dtype=np.float64)
    closed = len(points) > 3 and bool((points[0] == points[-1]).all())
    return (points[:-1] if closed else points), closed


def _turns_left(points: NDArray[np.float64]) -> float:
    """1 if what a ring encloses is left of it, else −1; around a pole that is the side of the pole that is nearer."""
    x, y = np.append(points, points[:1], axis=0).T
    x = np.unwrap(x, period=360.0)  # the shorter way, over the 180th meridian, too
    turns = round(float(x[-1] - x[0]) / 360.0)
    size = turns * float(y.mean()) if turns else float(x[:-1] @ y[1:] - y[:-1] @ x[1:])
    return 1.0 if size > 0 else -1.0


def _geojson(path: PathLike) -> list[Line]:
    return list(_lines(json.loads(text(path)), 0))


GLOBE_FORMATS: dict[str, Callable[[PathLike], list[Line]]] = {
    ".csv": lambda path: read_point_lists(path, 2),
    ".geojson": _geojson,
    ".json": _geojson,
}
