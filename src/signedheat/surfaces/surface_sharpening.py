"""Sharpening on surfaces: exact geodesic distance to curves and points, and to the zero set of φ where curves end.

Closed curves decide the sides of the surface by themselves, without heat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from ..arrays import Bools, Floats, Ints, mask_of
from ..diagnostics import GeodesicWindows, Note, SharpenedToCurves
from ..discretization import SourceTerm, discretize
from ..errors import InexactWarning, SourceError, UnsupportedTypeError, percent, warn_user
from ..fields.field import Field
from ..geodesics.exact_distance import cleared, distance_to_segments, distance_to_zero_line, window_limit
from ..geodesics.geodesic_sources import PlacedSegments, nearest_shares, zero_line
from ..mesh.components import connected_components
from ..mesh.curve_segments import CurveSegments, interpolation_at
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import EDGE, VERTEX, incident_faces
from ..methods import LinearElements, Method, Nearest, nearest, sharpen_on, sharpened
from ..search.face_tree import EQUALLY_NEAR
from ..shapes.foreign import as_list
from ..shapes.kinds import SurfaceDomain
from .intrinsic_triangulation import IntrinsicTriangulation
from .source_segments import given_curves
from .surface import Surface
from .surface_curves import CurvesAndPoints
from .surface_discretization import SurfaceDiscretization
from .surface_source import SurfaceSource, lie_along

ROUGHLY = 1e-4
"""Tolerance of distances that are only compared, where differences below a thousandth do not matter."""
INVENTED = 0.05
"""If more than this share of the curves and what completes them is completion, though no curve has a free end, there is
a warning that they bound nothing."""
UNDECIDED = 0.1
"""Curves that decide the sides of at most this share of the vertices bound nothing, since curves that bound a region
decide all vertices but those next to them. With it, no level set of 96 on eight meshes causes a warning."""
INVENTED_IF_UNDECIDED = 1e-3
"""The same as `INVENTED` for curves that bound nothing. A loop around a hole through a plate has a completion of this
share if the circumference of the hole is this share of its own."""
FALSE_ZERO_WIDTH = 4.0
"""Zeros of φ within this distance of an unoriented source, relative to h, may be due to that source alone."""


@sharpen_on.register(Surface)
@sharpen_on.register(IntrinsicTriangulation)
def _(
    domain: SurfaceDomain,
    field: Field[SurfaceDomain],
    source: CurvesAndPoints | None,
    method: Method | None,
) -> Field[SurfaceDomain]:
    """Sharpen a field on a surface; with a finer field, that is sharpened, and its first values are used."""
    if field.finest is not field:
        same = replace(field.finest, diagnostics=field.diagnostics)
        fine = sharpen_on(same.domain, same, source, method)
        values = fine.values[: len(field.values)]
        return replace(field, values=values, diagnostics=fine.diagnostics, finer=fine)
    surface = discretize(field.domain)
    if not isinstance(surface, SurfaceDiscretization):
        raise UnsupportedTypeError(
            f"a field on a {type(field.domain).__name__} cannot be sharpened: its domain is not a surface",
            element="field",
        )
    elements = LinearElements.on_triangles(surface.triangles)
    new, diagnostics = sharpened(field, surface, elements, at_triangles(surface, field), source, method)
    return replace(field, values=new[surface.restriction], diagnostics=diagnostics)


def at_triangles(surface: SurfaceDiscretization, field: Field[SurfaceDomain]) -> Floats:
    """(n_vertices,) values of a field at the vertices of the surface's triangles.

    If the triangles are not those of `on_triangulation`, they are NaN at vertices that the field's domain lacks.
    """
    if isinstance(field.domain, IntrinsicTriangulation):
        return field.values  # its vertices are those of the triangles
    values = field.domain.on_triangulation(field.values)
    if len(values) != surface.triangles.n_vertices:
        values = np.full(surface.triangles.n_vertices, np.nan)
        values[surface.restriction] = field.values
    return values


@nearest.register
def _(
    surface: SurfaceDiscretization,
    values: Floats,
    source: SourceTerm | None,
    given: CurvesAndPoints | None,
    tolerance: float,
) -> Nearest:
    """Measure distance to `given` curves, and to the zero set of φ where it completes oriented ones.

    Without any, distance is that to the zero set, and to unoriented curves and points from which φ was computed.
    `values`, (n,), are φ at the vertices of the triangles, NaN where it is unknown. `tolerance` is the largest change
    of a distance, relative to the length of an edge, by which windows on the edge may be merged. Returns (n,) unsigned
    distances, and the signs that the curves decide.
    """
    if given is None:
        return nearest_zero(surface, values, source, tolerance)
    curves, _left_out = given_curves(surface.domain, as_list(given))
    parts = list(chain.from_iterable(surface.segments(curves)))
    if not parts:
        raise SourceError("there are no curves to sharpen to", remedy="leave them out", element="curves")
    return nearest_curve(surface.triangles, values, parts, surface.spacing, tolerance)


def nearest_zero(
    surface: SurfaceDiscretization, values: Floats, source: SourceTerm | None, tolerance: float
) -> Nearest:
    """Measure distance to the zero set of φ, and to the unoriented curves and points that φ was computed from.

    `values` are φ at the vertices, (n,), and distances have errors below `tolerance` times the lengths of edges. Where
    all sources are unoriented, sides are 1, elsewhere 0: the sign of φ counts. Zeros of φ near an unoriented source
    that no oriented one meets are due to it alone, and left out.
    """
    unsided = [part for part in source.parts if not part.oriented] if isinstance(source, SurfaceSource) else []
    sides = np.zeros(len(values), dtype=np.int64)
    if not isinstance(source, SurfaceSource) or not unsided:
        distance, windows = distance_to_zero_line(surface.triangles, values, tolerance)
        return Nearest(distance, sides, (note_on_searches(surface.triangles, windows),))
    # Unoriented curves run along edges of refined triangles, whose first vertices are those of the surface.
    near, windows = distance_to_segments(source.triangles, PlacedSegments.of(source.triangles, unsided), tolerance)
    note = note_on_searches(source.triangles, windows)
    near = near[: len(values)]
    if not source.oriented:
        return Nearest(near, np.ones_like(sides), (note,))
    sided = np.concatenate(
        [interpolation_at(source.triangles, part.nodes).indices for part in source.parts if part.oriented]
    )
    lines = without_false_zeros(
        surface.triangles, values, near < FALSE_ZERO_WIDTH * surface.spacing, sided[sided < len(values)]
    )
    distance, more = distance_to_zero_line(surface.triangles, lines, tolerance)
    also = note_on_searches(surface.triangles, more)
    both = GeodesicWindows(windows + more, note.cut_short or also.cut_short)
    return Nearest(np.minimum(near, distance), sides, (both,))


def nearest_curve(
    triangles: IntrinsicMesh,
    values: Floats,
    parts: Sequence[CurveSegments],
    spacing: float,
    tolerance: float,
) -> Nearest:
    """Measure distance to curves and points, and to the zero set of φ where it completes oriented curves.

    Curves decide sides in regions that they bound, and next to them; elsewhere the signs of φ, `values`, do.
    """
    placed = PlacedSegments.of(triangles, parts)
    if not any(part.oriented for part in parts):
        distance, windows = distance_to_segments(triangles, placed, tolerance)
        return Nearest(distance, np.ones(len(values), dtype=np.int64), (note_on_searches(triangles, windows),))
    sides = curve_sides(triangles, placed)
    bounded = sides.regions != 0
    # What is missing, and which side is which, is decided near the curves: a short search is enough.
    size = float(np.sqrt(2 * triangles.face_areas.max()))
    reach = max(3 * size, float(sides.reach[np.isfinite(sides.reach)].max(initial=0.0)) * (1 + 1e-9))
    near, windows = distance_to_segments(triangles, placed, tolerance, reach)
    counts = [windows]
    is_near = sides.reach <= near * (1 + 1e-9)
    side = np.where(bounded, sides.regions, np.where(is_near, sides.nearby, 0))
    contradicts = (side != 0) & (np.sign(values) != side) & ~np.isnan(values)
    values = np.where(contradicts, np.copysign(np.minimum(near, reach), side), values)
    missing, more = missing_parts(triangles, values, parts, placed, near, sides, spacing, reach)
    counts += more
    completed = float(missing.lengths.sum())
    # A path from a bounded region to what is missing elsewhere crosses a curve, so that one search is enough.
    distance, windows = distance_to_segments(triangles, placed.joined(missing) if completed > 0 else placed, tolerance)
    counts.append(windows)
    there_length = sum(float(part.lengths.sum()) for part in parts)
    share = completed / (completed + there_length or 1.0)
    note = SharpenedToCurves(share, len(sides.free_ends), float(bounded.mean()))
    reached = ~np.isnan(values)
    decided = (bounded & reached).sum() / max(reached.sum(), 1)
    if share > (INVENTED if decided > UNDECIDED else INVENTED_IF_UNDECIDED) and not note.free_ends:
        warn_user(
            f"curves without free ends bound no region: {percent(share)} of what distance is measured to is "
            "where its sign must change elsewhere. piecewise_distance lets it jump there",
            InexactWarning,
        )
    return Nearest(distance, side, (note, note_on_searches(triangles, *counts)))


def distance_without_heat(source: SurfaceSource, tolerance: float) -> tuple[Floats, tuple[Note, ...]] | None:
    """Measure signed distance to curves that decide the sides of all vertices: (n,) values, and notes.

    None if they do not decide all. The values are those of `nearest_curve`, which then needs no φ.
    """
    triangles, parts = source.triangles, source.parts
    placed = PlacedSegments.of(triangles, parts)
    decided: tuple[Note, ...] = ()
    side = np.ones(triangles.n_vertices, dtype=np.int64)
    if any(part.oriented for part in parts):
        if len(free_ends(triangles, placed)):
            return None
        side = curve_sides(triangles, placed).regions
        reached = connected_to(triangles, placed.faces)
        if (reached & (side == 0) & ~on_curves(triangles, placed)).any():
            return None
        decided = (SharpenedToCurves(0.0, 0, float((side != 0).mean())),)
    distance, windows = distance_to_segments(triangles, placed, tolerance)
    signed = np.where(side < 0, -distance, distance)
    signed[np.isinf(distance)] = np.nan  # vertices without faces, and on other parts
    return signed, (*decided, note_on_searches(triangles, windows))


def connected_to(triangles: IntrinsicMesh, faces: Ints) -> Bools:
    """(n,) whether each vertex is a corner of a face that is connected to one of (k,) `faces`."""
    parts = triangles.face_components
    return mask_of(triangles.n_vertices, triangles.corner_vertices[np.isin(parts, parts[faces])])


def missing_parts(
    triangles: IntrinsicMesh,
    values: Floats,
    parts: Sequence[CurveSegments],
    placed: PlacedSegments,
    distance: Floats,
    sides: CurveSides,
    spacing: float,
    reach: float,
) -> tuple[PlacedSegments, list[int]]:
    """Find the parts of the zero set of φ that complete the curves, as segments, and the window counts of searches.

    They lie away from the curves, or beyond their free ends, and not in regions that curves bound. `values` are φ,
    (n,), `parts` the curves, which are `placed` in faces, and `spacing` is h of the surface. `distance` are the (n,)
    distances from the curves, inf beyond `reach`, which is three times the size of a face or more.
    """
    size = np.sqrt(2 * triangles.face_areas)
    corners = triangles.corner_vertices
    may_miss = distance[corners].mean(axis=1) > size  # (m,) faces in which parts may be missing
    counts = []
    if len(sides.free_ends):
        ends = CurveSegments.of_points(placed.nodes[sides.free_ends])
        to_ends, windows = distance_to_segments(triangles, PlacedSegments.of(triangles, [ends]), ROUGHLY, reach)
        counts.append(windows)
        beyond = to_ends <= distance * (1 + 1e-3)
        may_miss |= beyond[corners].all(axis=1)
    may_miss[placed.faces] = False
    may_miss &= (sides.regions[corners] == 0).any(axis=1)
    values = cleared(triangles, values, 1e-7 * float(triangles.lengths_of_edges.mean()))
    unsided = [part for part in parts if not part.oriented]
    if unsided:
        width = FALSE_ZERO_WIDTH * spacing
        near, windows = distance_to_segments(triangles, PlacedSegments.of(triangles, unsided), ROUGHLY, width)
        sided = [incident_faces(triangles, part.nodes)[1] for part in parts if part.oriented]
        values = without_false_zeros(triangles, values, near < width, corners[np.concatenate(sided)].ravel())
        counts.append(windows)
    return zero_line(triangles, values, may_miss), counts


def without_false_zeros(triangles: IntrinsicMesh, values: Floats, near: Bools, sided: Ints) -> Floats:
    """(n,) φ, with NaN around parts of its zero set that are only due to unoriented sources.

    Such a part has only vertices `near`, (n,), these sources, and none of the `sided` vertices of oriented ones. φ is
    zero at an unoriented source only on average, so it may change sign around it.
    """
    signs = np.sign(values)[triangles.corner_vertices]
    crossed = np.flatnonzero((signs.min(axis=1) < 0) & (signs.max(axis=1) > 0))
    m, e = len(crossed), triangles.n_edges
    through = np.roll(signs, -1, axis=1)[crossed] * signs[crossed] < 0
    face, side = np.nonzero(through)
    # nodes are the crossed faces, then all edges; each face is linked to the edges at which it is crossed
    line = connected_components(m + e, face, m + triangles.edges.face_edges[crossed[face], side])[:m]
    corners = triangles.corner_vertices[crossed]
    is_sided = mask_of(len(values), sided)
    is_false = np.ones(line.max(initial=-1) + 1, dtype=bool)
    is_false[line[(~near[corners] | is_sided[corners]).any(axis=1)]] = False
    result = values.copy()
    result[corners[is_false[line]]] = np.nan
    return result


def note_on_searches(triangles: IntrinsicMesh, *counts: int) -> GeodesicWindows:
    """Return a note on the numbers of windows of searches; warn if one was cut short."""
    note = GeodesicWindows(sum(counts), cut_short=max(counts) >= window_limit(triangles))
    if note.cut_short:
        warn_user(f"exact distance was cut short: {note}", InexactWarning)
    return note


@dataclass(frozen=True, eq=False)
class CurveSides:
    """The sides of the vertices of a surface, as far as oriented curves decide them."""

    regions: Ints  # (n,) 1 or −1 in regions that curves bound from one side only, without free ends; 0 elsewhere
    nearby: Ints  # (n,) side of the nearest segment in the faces at a vertex; 0 where there is none, and near free ends
    reach: Floats  # (n,) distance to that segment; inf where there is none
    free_ends: Ints  # (k,) nodes at which curves end, away from the boundary of the surface, or run head to head


def curve_sides(triangles: IntrinsicMesh, placed: PlacedSegments) -> CurveSides:
    """Find the sides of vertices: a region that no curve crosses lies on one side if all segments next to it agree."""
    ends = free_ends(triangles, placed)
    nearby, reach = nearest_sides(triangles, placed, ends)
    oriented = placed.sides != 0
    nodes = placed.nodes[np.unique(placed.ends[oriented])]
    on_curve = on_curves(triangles, placed)
    tail, head = triangles.edges.vertices.T
    is_open = ~(on_curve[tail] | on_curve[head])
    is_open[nodes.elements[nodes.kinds == EDGE]] = False
    region = connected_components(triangles.n_vertices, tail[is_open], head[is_open])
    reached = np.zeros((2, region.max(initial=-1) + 1), dtype=bool)
    reached[0, region[nearby > 0]] = reached[1, region[nearby < 0]] = True
    if len(ends):
        around = triangles.corner_vertices[incident_faces(triangles, placed.nodes[ends])[1]]
        reached[:, region[around]] = True
    side = reached[0].astype(np.int64) - reached[1]
    return CurveSides(np.where(on_curve, 0, side[region]), np.where(on_curve, 0, nearby), reach, ends)


def on_curves(triangles: IntrinsicMesh, placed: PlacedSegments) -> Bools:
    """(n,) whether each vertex is a node of oriented curves."""
    nodes = placed.nodes[np.unique(placed.ends[placed.sides != 0])]
    return mask_of(triangles.n_vertices, nodes.elements[nodes.kinds == VERTEX])


def free_ends(triangles: IntrinsicMesh, placed: PlacedSegments) -> Ints:
    """(k,) nodes at which not as many segments of oriented curves begin as end, off the boundary of the surface."""
    _, once = np.unique(placed.given, return_index=True)
    sides, ends = placed.sides[once], placed.ends[once]
    n = len(placed.nodes)
    surplus = np.bincount(ends[:, 1], sides, n) - np.bincount(ends[:, 0], sides, n)
    return np.flatnonzero((surplus != 0) & ~lie_along(triangles, placed.nodes, triangles.edges.face_counts == 1))


def nearest_sides(triangles: IntrinsicMesh, placed: PlacedSegments, ends: Ints) -> tuple[Ints, Floats]:
    """(n,) side of the nearest oriented segment in the faces at each vertex, 1, −1 or 0, and (n,) distance to it.

    Of equally near segments, it is the one that the vertex is most in front of. The side is 0 without any, if such
    segments disagree, and next to free `ends`, (k,) nodes.
    """
    n = triangles.n_vertices
    rows = np.flatnonzero(placed.sides != 0)
    start, step = placed.positions[rows, :1], np.diff(placed.positions[rows], axis=1)
    faces, sides = placed.faces[rows], placed.sides[rows]
    corner = triangles.corner_positions[faces] - start
    share, gap = nearest_shares(corner, step)
    height = (np.conj(step) * corner).imag / np.abs(step)
    height[np.abs(height) <= EQUALLY_NEAR * np.abs(step)] = 0.0
    is_end = mask_of(len(placed.nodes), ends)
    # (k, 3) corners of the faces that are nearest to a free end, beyond which there are no sides
    nearest_to_end = (share == 0) & is_end[placed.ends[rows, 0], None]
    nearest_to_end |= (share == 1) & is_end[placed.ends[rows, 1], None]
    vertex = triangles.corner_vertices[faces]
    reach = np.full(n, np.inf)
    np.minimum.at(reach, vertex, gap)
    nearest = gap <= reach[vertex] * (1 + EQUALLY_NEAR)
    sine = np.abs(height) / np.maximum(gap, 1e-300)  # 1 in front of the segment, less beyond its ends
    largest_sine = np.zeros(n)
    np.maximum.at(largest_sine, vertex[nearest], sine[nearest])
    chosen = nearest & (sine >= largest_sine[vertex] - EQUALLY_NEAR)
    side_of_corner = np.where(nearest_to_end, 0, np.sign(height) * sides[:, None])
    positive, negative, at_end = (
        np.bincount(vertex[chosen & test], minlength=n) > 0
        for test in (side_of_corner > 0, side_of_corner < 0, nearest_to_end)
    )
    return np.where(at_end, 0, positive.astype(np.int64) - negative), reach
