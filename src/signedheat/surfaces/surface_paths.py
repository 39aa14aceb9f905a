"""Shortest paths between points or curves on a surface."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

import numpy as np

from ..errors import SourceError
from ..geodesics.geodesic_sources import PlacedSegments
from ..geodesics.traced_paths import traced_path
from ..mesh.surface_points import locate_points
from ..validation import coordinates
from .source_segments import segments_of
from .surface import Place, Surface, closest_points
from .surface_curves import Curve, CurveOrPoints, SurfacePoints


def shortest_path(surface: Surface, start: Place, end: Place) -> Curve:
    """Find the shortest path along a surface: see `Surface.shortest_path`."""
    triangles = surface.triangulation.intrinsic
    sources, ends = _placed(surface, start, "start"), _placed(surface, end, "end")
    if not all(isinstance(item, SurfacePoints) for item in ends):
        raise SourceError("a path ends at points", remedy="give the curves as its start", element="end")
    faces, weights = (np.concatenate([getattr(item, name) for item in ends]) for name in ("faces", "barycentric"))
    parts = [segments_of(item, triangles, None, number) for number, item in enumerate(sources)]
    path = traced_path(triangles, PlacedSegments.of(triangles, parts), locate_points(triangles, faces, weights, "end"))
    if len(path) < 2 or (surface.positions(SurfacePoints(path.faces, path.barycentric)).std(axis=0) == 0).all():
        raise SourceError("the end is at the start: no path leads there", element="end")
    return Curve(path.faces, path.barycentric, oriented=False)


def _placed(surface: Surface, place: Place, name: str) -> list[CurveOrPoints]:
    """Return the start or end of a path as curves and points on the surface; `name` is for error messages."""
    if isinstance(place, Curve | SurfacePoints):
        return [place]
    if isinstance(place, Integral):
        return [surface.points_at(int(place))]
    if isinstance(place, Sequence) and place and all(isinstance(item, Curve | SurfacePoints) for item in place):
        return list(place)
    points = np.atleast_2d(coordinates(np.atleast_2d(np.asarray(place)), name, 3, SourceError))
    faces, weights, _ = closest_points(surface.triangulation, points)
    return [SurfacePoints(faces, weights)]
