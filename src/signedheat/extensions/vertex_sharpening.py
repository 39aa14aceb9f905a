"""Sharpening of distance on the vertices of a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import GeodesicWindows, Note
from ..discretization import SourceTerm, discretize
from ..domains.intrinsic_triangulation import IntrinsicTriangulation
from ..errors import GeometryError, InexactWarning, UnsupportedTypeError, warn_user
from ..fields.vertex_field import VertexField
from ..geometry.components import connected_components
from ..geometry.curve_segments import CurveSegments, interpolation_at
from ..geometry.geodesics.exact import distance_to_edges_and_points, distance_to_zero_line, window_limit
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..geometry.surface_points import VERTEX, barycentric_in, concatenated, incident_faces
from ..lowering.surface.discretization import SurfaceDiscretization
from ..lowering.surface.source import SurfaceSource
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from .sharpening import Method, sharpen_field, sharpened
from .sharpening_methods import straight_distance

HALO = 4.0
"""Distance from an unoriented source, relative to h, within which zeros of φ may be due to that source alone."""


@sharpen_field.register
def _(field: VertexField, method: Method | None = None, progress: Progress | None = None) -> VertexField:
    surface = discretize(field.domain)
    if not isinstance(surface, SurfaceDiscretization):
        raise UnsupportedTypeError(
            f"a field on a {type(field.domain).__name__} cannot be sharpened: its domain is no surface", element="field"
        )
    elements = LinearElements.on_triangles(surface.triangles)
    new, diagnostics = sharpened(field, surface, elements, at_triangles(surface, field), method, progress)
    values = new if surface.restriction is None else new[surface.restriction]
    return replace(field, values=values, diagnostics=diagnostics)


def at_triangles(surface: SurfaceDiscretization, field: VertexField) -> NDArray[np.float64]:
    """Values at the vertices of the surface's triangles; averages of neighbours at those that the domain lacks."""
    n = surface.triangles.n_vertices
    values = np.asarray(field.values)
    wanted = n if surface.restriction is None else len(surface.restriction)
    if values.shape != (wanted,) or not np.issubdtype(values.dtype, np.number):
        raise GeometryError(
            f"the field has {values.dtype} values of shape {values.shape}, and its domain {wanted} vertices",
            remedy="give one number for each",
        )
    if surface.restriction is None:
        return values.astype(np.float64)
    assert not isinstance(field.domain, IntrinsicTriangulation)  # it has the vertices of its triangles
    values = field.domain.on_triangulation(field.values)
    if len(values) != n:
        values = np.full(n, np.nan)
        values[surface.restriction] = field.values
    return values


@straight_distance.register
def _(
    surface: SurfaceDiscretization,
    values: NDArray[np.float64],
    source: SourceTerm | None,
    tolerance: float,
    report: Callable[[], None] | None,
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Polyhedral distance from the zero set of the values and from unoriented sources."""
    unsided = [part for part in source.parts if not part.oriented] if isinstance(source, SurfaceSource) else []
    if not isinstance(source, SurfaceSource) or not unsided:
        distance, windows = distance_to_zero_line(surface.triangles, values, tolerance, report)
        return distance, (told(surface.triangles, windows),)
    # Unoriented curves run along edges of refined triangles, whose first vertices are those of the surface.
    near, windows = distance_to_segments(source.triangles, unsided, tolerance, report)
    note = told(source.triangles, windows)
    near = near[: len(values)]
    if source.oriented:
        sided = np.concatenate(
            [interpolation_at(source.triangles, part.nodes).indices for part in source.parts if part.oriented]
        )
        lines = without_halos(surface.triangles, values, near < HALO * surface.spacing, sided[sided < len(values)])
        distance, more = distance_to_zero_line(surface.triangles, lines, tolerance, report)
        also = told(surface.triangles, more)
        near, note = np.minimum(near, distance), GeodesicWindows(windows + more, note.cut_short or also.cut_short)
    return near, (note,)


def told(triangles: IntrinsicMesh, windows: int) -> GeodesicWindows:
    """The note on a search with so many windows, and a warning if it was cut short."""
    note = GeodesicWindows(windows, cut_short=windows >= window_limit(triangles))
    if note.cut_short:
        warn_user(f"exact distance was cut short: {note}", InexactWarning)
    return note


def without_halos(
    triangles: IntrinsicMesh, values: NDArray[np.float64], beside: NDArray[np.bool_], sided: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Values with NaN along those parts of the zero set that are due to unoriented sources.

    φ is zero at such a source only on average, so it may change sign around it. A connected part of the zero set that
    lies entirely beside the source, and at no vertex of an oriented curve, is due to the source alone.
    """
    signs = np.sign(values)[triangles.corner_vertices]
    crossed = np.flatnonzero((signs.min(axis=1) < 0) & (signs.max(axis=1) > 0))
    m, e = len(crossed), triangles.n_edges
    through = np.roll(signs, -1, axis=1)[crossed] * signs[crossed] < 0
    face, side = np.nonzero(through)
    line = connected_components(m + e, face, m + triangles.edges.face_edges[crossed[face], side])[:m]
    corners = triangles.corner_vertices[crossed]
    is_sided = np.zeros(len(values), dtype=bool)
    is_sided[sided] = True
    own = np.ones(line.max(initial=-1) + 1, dtype=bool)
    own[line[(~beside[corners] | is_sided[corners]).any(axis=1)]] = False
    result = values.copy()
    result[corners[own[line]]] = np.nan
    answer: NDArray[np.float64] = result
    return answer


def distance_to_segments(
    triangles: IntrinsicMesh,
    parts: list[CurveSegments],
    tolerance: float,
    report: Callable[[], None] | None = None,
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to curves along edges and to points anywhere; and the number of windows."""
    nodes = concatenated([part.nodes for part in parts])
    at_vertex = nodes.kinds == VERTEX
    inside = nodes[~at_vertex]
    which, faces = incident_faces(triangles, inside)
    weights = barycentric_in(triangles, faces, inside[which])
    return distance_to_edges_and_points(
        triangles,
        np.concatenate([part.edges for part in parts]),
        nodes.elements[at_vertex],
        faces,
        (weights * triangles.corner_positions[faces]).sum(axis=1),
        tolerance,
        report,
    )
