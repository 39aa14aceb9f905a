"""Curves and points on surfaces, as they are given, and cut into segments in one face or along one edge each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from numbers import Integral
from typing import Any, TypeAlias, TypeGuard

import numpy as np

from ..arrays import Floats, Ints, mask_of
from ..diagnostics import WithoutLength
from ..errors import SourceError
from ..geodesics.shortest_paths import join
from ..mesh.components import connected_components
from ..mesh.curve_segments import CurveSegments, carried_left, given_directions, loses_orientation
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import (
    EDGE,
    FACE,
    VERTEX,
    barycentric_in,
    corners_at,
    edges_between,
    locate_points,
    refuse_missing,
    shared_faces,
    unique_points,
)
from ..mesh.triangles import Triangles
from ..parallel import PointTree
from .surface import Surface
from .surface_curves import Curve, CurveOrPoints, ElementList, SurfacePoints
from .triangle_mesh import TriangleMesh

Positions: TypeAlias = Floats | None
SOURCE_POINT = 1e-14
"""A curve of at most this extent, relative to the size of its surface, counts as a point."""


@singledispatch
def segments_of(
    source: CurveOrPoints | CurveSegments, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0
) -> CurveSegments:
    """Cut a curve or points, whose faces are those of `triangles`, into segments; return `CurveSegments` as they are.

    Consecutive points that share no face are joined by geodesics. Curves with normals need `positions` of vertices or
    corners. `number` is that of the source, for error messages.
    """
    raise SourceError(
        f"source {number} is a {type(source).__name__}: on a surface, distance is measured to a "
        "Curve or SurfacePoints (see the domain's path, polyline, level_set and points_at)",
        element=f"source {number}",
    )


def segments_of_each(
    sources: Sequence[CurveOrPoints | Sequence[CurveOrPoints]], triangles: IntrinsicMesh, positions: Positions = None
) -> list[list[CurveSegments]]:
    """Cut several sources into segments, a list for each; a sequence of curves and points counts as one source."""
    return [
        [
            segments_of(item, triangles, positions, number)
            for item in (source if isinstance(source, Sequence) else [source])
        ]
        for number, source in enumerate(sources)
    ]


@segments_of.register
def _(source: CurveSegments, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    """Return segments as they are."""
    return source


@segments_of.register
def _(source: SurfacePoints, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    """Locate points; those that coincide become one."""
    located = locate_points(triangles, source.faces, source.barycentric, f"source {number}: point")
    return CurveSegments.of_points(located[unique_points(located)[0]])


@segments_of.register
def _(source: Curve, triangles: IntrinsicMesh, positions: Positions = None, number: int = 0) -> CurveSegments:
    """Cut a curve where it crosses edges; its normals, or else its left, give the side of each segment."""
    name = f"curve {number}"
    located = locate_points(triangles, source.faces, source.barycentric, f"{name}: point")
    start = np.arange(source.n_segments)
    located, start, end, segment = join(triangles, located, start, (start + 1) % source.n_points, name)
    faces = shared_faces(triangles, located[start], located[end])
    first, point_ids = unique_points(located)
    ends = np.stack([point_ids[start], point_ids[end]], axis=1)
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
    """List the numbers of sources with a curve, oriented but without normals, along which no side can be told.

    Faces cannot be oriented consistently along such a curve, as around a Möbius band.
    """
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


def is_element_list(source: object) -> TypeGuard[ElementList]:
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


def curve_of_elements(triangles: Triangles, points: ElementList) -> Curve | SurfacePoints:
    """Make a curve, or a point source for a single point, of a list in the format of potpourri3d: see `ElementList`."""
    kinds = np.array([min(len(given), FACE) for _, given in points])
    # ids of points of each kind; points of other kinds have ids that exist, so that all are looked up alike
    vertices, edges, faces = (
        np.array([element if kind == wanted else least for (element, _), kind in zip(points, kinds, strict=True)])
        for wanted, least in ((VERTEX, triangles.faces.min()), (EDGE, 0), (FACE, 0))
    )
    starts, halfedges = triangles.edges.halfedges
    refuse_missing("edge", edges, len(starts) - 1, "list of elements: point")
    refuse_missing("face", faces, triangles.n_faces, "list of elements: point")
    corners = corners_at(triangles.faces, vertices, triangles.n_vertices, "list of elements: point")
    begin = np.where(kinds == VERTEX, corners, halfedges[starts[edges]])
    faces, sides = np.where(kinds == FACE, faces, begin // 3), begin % 3
    weights = np.zeros((len(points), 3))
    for k, (_, given) in enumerate(points):
        if kinds[k] == FACE:
            weights[k] = given if len(given) == 3 else (*given, 1 - given[0] - given[1])
        else:
            share = given[0] if kinds[k] == EDGE else 0.0
            weights[k, [sides[k], (sides[k] + 1) % 3]] = 1 - share, share
    return Curve(faces, weights) if len(points) > 1 else SurfacePoints(faces, weights)


def as_curves(domain: object, sources: list[Any]) -> list[Any]:
    """Convert sources that are lists of elements to curves, if the domain is a surface; return others as they are.

    Curves for an intrinsic triangulation are on its mesh.
    """
    domain = getattr(domain, "mesh", domain)
    if not isinstance(domain, Surface):
        return sources
    return [_converted(domain, source) for source in ([sources] if is_element_list(sources) else sources)]


def given_curves(domain: object, sources: list[Any]) -> tuple[list[Any], WithoutLength | None]:
    """Convert lists of elements to curves; leave out curves without length, with a note, if there are other sources."""
    curves = as_curves(domain, sources)
    domain = getattr(domain, "mesh", domain)
    if not isinstance(domain, Surface):
        return curves, None
    for k, source in enumerate(curves):  # errors name its number before others are left out
        if isinstance(source, Curve | SurfacePoints):
            name = f"{'curve' if isinstance(source, Curve) else 'source'} {k}: point"
            refuse_missing("face", source.faces, domain.triangulation.n_faces, name)
    lengthless = [k for k, source in enumerate(curves) if isinstance(source, Curve) and _is_point(domain, source)]
    if not lengthless or len(lengthless) == len(curves):
        return curves, None
    return [source for k, source in enumerate(curves) if k not in lengthless], WithoutLength(lengthless)


def numbers_kept(n: int, left_out: WithoutLength | None) -> Ints:
    """(n,) numbers, among all sources that were given, of the n that `given_curves` kept."""
    dropped = [] if left_out is None else left_out.without_length
    return np.setdiff1d(np.arange(n + len(dropped)), dropped)


def numbers_given(sources: Sequence[Any], left_out: WithoutLength | None) -> Ints:
    """(k,) index of each curve that was kept in the list of all curves given, with groups unpacked.

    `sources` are those kept. Curves that were `left_out` have an index, too, but are not returned.
    """
    kept = numbers_kept(len(sources), left_out)
    counts = np.ones(kept.max(initial=-1) + 1, dtype=np.int64)
    counts[kept] = [len(source) if isinstance(source, Sequence) else 1 for source in sources]
    return np.flatnonzero(np.repeat(mask_of(len(counts), kept), counts))


def _converted(domain: Surface, source: object) -> object:
    """Convert lists of elements to curves, also within sequences; return other sources as they are."""
    if is_element_list(source):
        return curve_of_elements(domain.triangulation, source)
    if isinstance(source, Sequence) and not isinstance(source, str | bytes):
        return [_converted(domain, part) for part in source]
    return source


def _is_point(domain: Surface, curve: Curve) -> bool:
    """Whether all points of a curve coincide, up to `SOURCE_POINT` times the size of the surface."""
    triangles = domain.triangulation
    if not hasattr(triangles, "vertices"):
        return False
    extent = np.ptp(domain.positions(curve), axis=0).max()
    return bool(extent <= SOURCE_POINT * np.ptp(triangles.bounds, axis=0).max())


NEARLY_CLOSED = 0.5
"""A single open curve is a loop with a gap if the distance between its ends, relative to its length, is less than
this."""


@dataclass(frozen=True, eq=False)
class CurveGroups:
    """Sizes of groups of open oriented curves; each group is treated as one curve with gaps."""

    lengths: Floats  # (g,) total length of the curves of each group
    scales: Floats  # (g,) their mean length, weighted by length; for a single curve the radius of a circle as long

    @classmethod
    def of(cls, mesh: TriangleMesh, curves: Sequence[Any]) -> CurveGroups:
        """Group open oriented curves by linking each end to the nearest end of another; drop single straight ones."""
        listed = [curve for item in curves for curve in (item if isinstance(item, Sequence) else [item])]
        pieces = [curve for curve in listed if isinstance(curve, Curve) and curve.oriented and not curve.closed]
        if not pieces:
            return cls(np.empty(0), np.empty(0))
        points = [mesh.positions(piece) for piece in pieces]
        lengths = np.array([float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in points])
        ends = np.array([p[[0, -1]] for p in points]).reshape(-1, 3)
        groups = connected_components(len(pieces), *nearest_others(ends).T)
        gaps = np.linalg.norm(ends[::2] - ends[1::2], axis=1)
        used = (np.bincount(groups)[groups] > 1) | (gaps < NEARLY_CLOSED * lengths)
        groups, lengths = np.unique(groups[used], return_inverse=True)[1].ravel(), lengths[used]
        totals = np.bincount(groups, lengths).astype(np.float64)
        means = np.bincount(groups, lengths**2) / np.maximum(totals, 1e-300)
        return cls(totals, np.where(np.bincount(groups) > 1, means, totals / (2 * np.pi)))


def nearest_others(ends: Floats) -> Ints:
    """(2 k, 2) for each end of k curves, its curve, and the curve with the nearest end, perhaps the same one.

    `ends` are (2 k, 3) positions, two for each curve.
    """
    rows = np.arange(len(ends))
    piece = rows // 2
    distances, near = PointTree(ends).query(ends, k=min(3, len(ends)))
    own = piece[near] == piece[:, None]
    own[:, 0] |= near[:, 0] == rows
    first = np.where(own, np.inf, distances).argmin(axis=1)
    gap = np.linalg.norm(ends[::2] - ends[1::2], axis=1)[piece]
    alone = own.all(axis=1) | (distances[rows, first] > gap)
    return np.stack([piece, np.where(alone, piece, piece[near[rows, first]])], axis=1)
