"""Sharpening of distance on the vertices of a surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import GeodesicWindows, Note
from ..discretization import SourceTerm, discretize
from ..domains.curves import Curve, CurvesAndPoints, SurfacePoints
from ..domains.intrinsic_triangulation import IntrinsicTriangulation
from ..errors import GeometryError, UnsupportedTypeError
from ..fields.vertex_field import VertexField
from ..geometry.curve_segments import interpolation_at
from ..geometry.geodesics.exact import distance_to_segments, distance_to_zero_line
from ..geometry.geodesics.sources import PlacedSegments
from ..lowering.surface.discretization import SurfaceDiscretization
from ..lowering.surface.source import SurfaceSource
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from .methods import straight_distance
from .sharpen import Method, sharpen_field, sharpened
from .to_curves import FALSE_ZERO_WIDTH, ToCurves, note_on_searches, without_false_zeros


@sharpen_field.register
def _(
    field: VertexField,
    method: Method | CurvesAndPoints | None = None,
    progress: Progress | None = None,
    curves: CurvesAndPoints | None = None,
) -> VertexField:
    if field.finest is not field:
        same = replace(field.finest, diagnostics=field.diagnostics)
        fine = sharpen_field(same, method, progress, curves)
        assert isinstance(fine, VertexField)
        values = fine.values[: len(field.values)]
        return replace(field, values=values, diagnostics=fine.diagnostics, finer=cast("VertexField[Any]", fine))
    surface = discretize(field.domain)
    if not isinstance(surface, SurfaceDiscretization):
        raise UnsupportedTypeError(
            f"a field on a {type(field.domain).__name__} cannot be sharpened: its domain is no surface", element="field"
        )
    if isinstance(method, str):
        raise UnsupportedTypeError(f"{method!r} is no method of sharpening", remedy="pass Geodesic() or Convex()")
    if isinstance(method, Curve | SurfacePoints | Sequence):
        method, curves = None, method
    if curves is not None:
        method = ToCurves(curves)
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
        return distance, (note_on_searches(surface.triangles, windows),)
    # Unoriented curves run along edges of refined triangles, whose first vertices are those of the surface.
    near, windows = distance_to_segments(
        source.triangles, [PlacedSegments.of(source.triangles, unsided)], tolerance, report
    )
    note = note_on_searches(source.triangles, windows)
    near = near[: len(values)]
    if source.oriented:
        sided = np.concatenate(
            [interpolation_at(source.triangles, part.nodes).indices for part in source.parts if part.oriented]
        )
        lines = without_false_zeros(
            surface.triangles, values, near < FALSE_ZERO_WIDTH * surface.spacing, sided[sided < len(values)]
        )
        distance, more = distance_to_zero_line(surface.triangles, lines, tolerance, report)
        also = note_on_searches(surface.triangles, more)
        near, note = np.minimum(near, distance), GeodesicWindows(windows + more, note.cut_short or also.cut_short)
    return near, (note,)
