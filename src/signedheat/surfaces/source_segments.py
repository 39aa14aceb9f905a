"""Curves and points as segments on an intrinsic mesh, each in one face or along one edge."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import TypeAlias

import numpy as np

from ..arrays import Floats
from ..errors import SourceError
from ..geodesics.shortest_paths import join
from ..mesh.curve_segments import CurveSegments, carried_left, given_directions, loses_orientation
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import barycentric_in, edges_between, locate_points, shared_faces, unique_points
from .surface_curves import Curve, CurveOrPoints, SurfacePoints

Positions: TypeAlias = Floats | None


@singledispatch
def segments_of(
    source: CurveOrPoints | CurveSegments, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0
) -> CurveSegments:
    """Cut a source, whose faces are those of the triangles, into segments; return `CurveSegments` as they are.

    Consecutive points of a curve that share no face are joined by a geodesic path. Curves with given normals need the
    `positions` in space of vertices or, if every face lies in a plane of its own, of corners. `number` is the index of
    the source, for messages.
    """
    raise SourceError(
        f"source {number} is a {type(source).__name__}: on a surface, distance is measured to a "
        "Curve or SurfacePoints (see the domain's path, polyline, level_set and points_at)",
        element=f"source {number}",
    )


def segments_of_each(
    sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]], triangles: IntrinsicMesh, positions: Positions = None
) -> list[list[CurveSegments]]:
    """Cut several sources into segments; a sequence of curves and points among them counts as one source."""
    return [
        [
            segments_of(item, triangles, positions, number)
            for item in (source if isinstance(source, Sequence) else [source])
        ]
        for number, source in enumerate(sources)
    ]


@segments_of.register
def _(source: CurveSegments, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    return source


@segments_of.register
def _(source: SurfacePoints, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    located = locate_points(triangles, source.faces, source.barycentric, f"source {number}: point")
    return CurveSegments.of_points(located[unique_points(located)[0]])


@segments_of.register
def _(source: Curve, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    name = f"curve {number}"
    located = locate_points(triangles, source.faces, source.barycentric, f"{name}: point")
    start = np.arange(source.n_segments)
    located, start, end, segment = join(triangles, located, start, (start + 1) % source.n_points, name)
    faces = shared_faces(triangles, located[start], located[end])
    first, who = unique_points(located)
    ends = np.stack([who[start], who[end]], axis=1)
    at_start = barycentric_in(triangles, faces, located[start])
    at_end = barycentric_in(triangles, faces, located[end])
    corners = triangles.corner_positions[faces]
    steps = ((at_end - at_start) * corners).sum(axis=1)
    keep = (ends[:, 0] != ends[:, 1]) & (np.abs(steps) > 0)
    if not keep.any():
        raise SourceError(
            f"{name} has no length: all its points coincide",
            remedy="use SurfacePoints for isolated points",
            element=name,
        )

    edges, sides = edges_between(triangles, faces, at_start, at_end)
    faces, edges, sides, steps, ends, segment = (a[keep] for a in (faces, edges, sides, steps, ends, segment))
    ahead = np.sign((np.conj(triangles.edge_directions[faces, sides]) * steps).real)
    vectors = 1j * np.where(edges < 0, steps, ahead * np.abs(steps))
    if source.normals is None and not triangles.is_consistently_oriented:
        vectors = vectors * carried_left(triangles, faces, edges, np.abs(steps))
    elif source.normals is not None and source.oriented:
        if positions is None:
            raise SourceError(
                f"{name} has normals in space, but this surface has no positions", remedy="leave the normals out"
            )
        vectors = np.abs(steps) * given_directions(triangles, positions, faces, edges, source.normals[segment], name)
    return CurveSegments(located[first], ends, faces, edges, vectors, source.oriented)


def one_sided(sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]], triangles: IntrinsicMesh) -> list[int]:
    """List the sources with a curve without normals along which faces cannot be turned to agree: it has one side."""
    if triangles.is_consistently_oriented:
        return []
    numbers = []
    for number, source in enumerate(sources):
        for curve in source if isinstance(source, Sequence) else [source]:
            if isinstance(curve, Curve) and curve.oriented and curve.normals is None:
                part = segments_of(curve, triangles, None, number)
                if loses_orientation(triangles, part.faces, part.edges):
                    numbers.append(number)
    return numbers
