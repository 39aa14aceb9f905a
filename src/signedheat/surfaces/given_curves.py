"""Curves as they are given on a surface: lists of elements, as potpourri3d writes them; and such as have no length."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from ..diagnostics import WithoutLength
from ..errors import SourceError
from ..mesh.triangles import Triangles
from .surface import Surface
from .surface_curves import Curve, SurfacePoints

ONE_POINT = 1e-14
"""Distance of points, relative to the size of a surface, up to which they are one."""


def is_element_list(source: object) -> bool:
    """Whether something is a curve in the format of potpourri3d: a list of (element, barycentric coordinates)."""
    return (
        isinstance(source, Sequence)
        and len(source) > 0
        and all(
            isinstance(point, tuple | list)
            and len(point) == 2
            and isinstance(point[0], Integral)
            and isinstance(point[1], Sequence | np.ndarray)
            and len(point[1]) <= 3
            for point in source
        )
    )


def curve_of_elements(triangles: Triangles, points: Sequence[tuple[int, Sequence[float]]]) -> Curve | SurfacePoints:
    """Make the curve through points, each a vertex, an edge and a fraction of it, or a face and its coordinates.

    Edges are numbered and directed as they first occur in the sides of the faces. A single point is a point source.
    """
    starts, halfedges = triangles.edges.halfedges
    first_corner = np.full(triangles.n_vertices, -1)
    first_corner[triangles.faces.ravel()[::-1]] = np.arange(triangles.faces.size)[::-1]
    faces, weights = np.zeros(len(points), dtype=np.int64), np.zeros((len(points), 3))
    for k, (element, given) in enumerate(points):
        kind, count = (
            ("vertex", triangles.n_vertices), ("edge", len(starts) - 1), ("face", triangles.n_faces)
        )[min(len(given), 2)]  # fmt: skip
        if not 0 <= element < count or (kind == "vertex" and first_corner[element] < 0):
            raise SourceError(f"point {k} of a curve is on {kind} {element}, which is none", element=f"point {k}")
        if kind == "face":
            faces[k] = element
            weights[k] = (*given[:2], 1 - given[0] - given[1])
            continue
        halfedge, share = (first_corner[element], 0.0) if kind == "vertex" else (halfedges[starts[element]], given[0])
        faces[k], side = divmod(int(halfedge), 3)
        weights[k, [side, (side + 1) % 3]] = 1 - share, share
    return Curve(faces, weights) if len(points) > 1 else SurfacePoints(faces, weights)


def given_curves(domain: object, sources: list[Any]) -> tuple[list[Any], WithoutLength | None]:
    """Make curves of lists of elements, and leave out curves without length if there are other sources."""
    if not isinstance(domain, Surface):
        return sources, None
    if is_element_list(sources):
        sources = [sources]
    taken = [_converted(domain, source) for source in sources]
    lengthless = [k for k, source in enumerate(taken) if isinstance(source, Curve) and _is_point(domain, source)]
    if not lengthless or len(lengthless) == len(taken):
        return taken, None
    return [source for k, source in enumerate(taken) if k not in lengthless], WithoutLength(lengthless)


def _converted(domain: Surface, source: object) -> object:
    if is_element_list(source):
        return curve_of_elements(domain.triangulation, source)  # type: ignore[arg-type]
    if isinstance(source, Sequence) and not isinstance(source, str | bytes):
        return [_converted(domain, part) for part in source]
    return source


def _is_point(domain: Surface, curve: Curve) -> bool:
    """Whether all points of a curve coincide; faces that do not exist are refused later."""
    triangles = domain.triangulation
    if not hasattr(triangles, "vertices") or not ((curve.faces >= 0) & (curve.faces < triangles.n_faces)).all():
        return False
    extent = np.ptp(domain.positions(curve), axis=0).max()
    return bool(extent <= ONE_POINT * np.ptp(triangles.bounds, axis=0).max())
