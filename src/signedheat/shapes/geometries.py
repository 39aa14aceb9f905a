"""Geometries of shapely, GeoPandas and GeoJSON as polylines in the plane, and polylines as geometries of shapely."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import Any, Protocol, cast

from ..errors import GeometryError, UnsupportedTypeError
from ..grids.polyline import Polyline
from ..packages import lazy_module
from ..validation import json_numbers

shapely: Any = lazy_module("shapely", "geometries of shapely")


class HasGeoInterface(Protocol):
    """Protocol for type checkers that geometries of shapely and GeoPandas satisfy."""

    @property
    def __geo_interface__(self) -> object: ...


def geometry_of(thing: object) -> Mapping[str, Any] | None:
    """Return the GeoJSON mapping of a geometry, or None for other objects.

    A geometry is such a mapping itself, or an object with ``__geo_interface__``.
    """
    geometry = getattr(thing, "__geo_interface__", thing)
    return geometry if isinstance(geometry, Mapping) and isinstance(geometry.get("type"), str) else None


def polylines_of(geometry: Mapping[str, Any]) -> list[Polyline]:
    """Return the lines and the rings of polygons of a GeoJSON geometry.

    Outlines run clockwise and holes counter-clockwise. Only the first two coordinates are used.

    Raises
    ------
    UnsupportedTypeError
        If it contains points, or a type that GeoJSON does not define.
    GeometryError
        If it contains no line, or coordinates are not pairs of numbers.
    """
    lines = list(_lines(geometry))
    if not lines:
        raise GeometryError("the geometry is empty", remedy="leave it out", element=geometry["type"])
    return lines


def _lines(geometry: Mapping[str, Any], feature: int | None = None) -> Iterator[Polyline]:
    """Yield the lines of `polylines_of`, also of nested collections; errors name the number of a feature."""
    kind, coordinates = str(geometry.get("type")), geometry.get("coordinates") or ()
    if kind == "Feature":
        if geometry.get("geometry"):
            yield from _lines(geometry["geometry"], feature)
    elif kind in ("FeatureCollection", "GeometryCollection"):
        members = geometry.get("features" if kind == "FeatureCollection" else "geometries") or ()
        for number, part in enumerate(members):
            yield from _lines(part, number if kind == "FeatureCollection" else feature)
    elif kind in ("LineString", "LinearRing", "MultiLineString"):
        for points in (coordinates if kind == "MultiLineString" else [coordinates]) if coordinates else ():
            yield _polyline(points, kind == "LinearRing")
    elif kind in ("Polygon", "MultiPolygon"):
        for rings in (coordinates if kind == "MultiPolygon" else [coordinates]) if coordinates else ():
            for number, points in enumerate(rings):
                line = _polyline(points, True)
                yield line.reversed() if (line.signed_area > 0) == (number == 0) else line
    else:
        raise UnsupportedTypeError(
            f"a {kind} has no lines" if feature is None else f"feature {feature} is a {kind}, which has no lines",
            remedy="leave it out, and pass lines and polygons; for points use sh.PointCloud",
            element=kind if feature is None else f"feature {feature}",
        )


def _polyline(points: Any, closed: bool) -> Polyline:
    """Return the polyline through points of GeoJSON; it is closed if `closed`, or if it ends at its first point."""
    try:
        pairs = [[point[0], point[1]] for point in points]
    except (TypeError, LookupError) as error:
        raise GeometryError(
            f"coordinates of a geometry must be pairs of numbers ({error})", element="coordinates"
        ) from error
    positions = json_numbers(pairs, "coordinates")
    return Polyline(positions, closed or (len(positions) > 2 and bool((positions[0] == positions[-1]).all())))


def to_shapely(lines: Polyline | Sequence[Polyline]) -> HasGeoInterface:
    """Convert polylines in the plane, such as offsets, to a geometry of shapely.

    Parameters
    ----------
    lines : Polyline or sequence of Polyline
        Closed polylines bound polygons, with the points inside that an odd number of them enclose, so that outlines
        within others are holes. Open polylines become lines.

    Returns
    -------
    shapely.Polygon, MultiPolygon, LineString, MultiLineString or GeometryCollection
        The geometry, of the simplest of these types that can hold it, with the same coordinates.

    Raises
    ------
    MissingPackageError
        If shapely is not installed.

    See Also
    --------
    signed_distance : Takes geometries of shapely and GeoJSON in place of polylines.

    Examples
    --------
    >>> square = Polyline([[0, 0], [4, 0], [4, 4], [0, 4]], closed=True)
    >>> hole = Polyline([[1, 1], [2, 1], [2, 2], [1, 2]], closed=True)
    >>> to_shapely([square, hole]).__geo_interface__["type"]
    'Polygon'
    """
    listed = [lines] if isinstance(lines, Polyline) else list(lines)
    areas = [shapely.make_valid(shapely.Polygon(line.points)) for line in listed if line.closed and line.n_points > 2]
    parts = [reduce(shapely.symmetric_difference, areas)] if areas else []
    open_lines = [
        shapely.LineString(line.segments[:, 0] if line.closed else line.points)
        for line in listed
        if not line.closed or line.n_points < 3
    ]
    if len(open_lines) == 1:
        parts += open_lines
    elif open_lines:
        parts.append(shapely.MultiLineString(open_lines))
    return cast("HasGeoInterface", parts[0] if len(parts) == 1 else shapely.GeometryCollection(parts))
