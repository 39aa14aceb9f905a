"""Fields made of the unknowns of a discretisation, one function for each kind of discretisation."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Ints, mask_of, place
from ..diagnostics import Diagnostics, SampledSource, SmallLoops, TetsTurned
from ..errors import InexactWarning, UnreachedWarning, UnsupportedTypeError, warn_user
from ..geodesics.exact_distance import shortest_arcs
from ..grids.grid import Grid
from ..grids.grid_discretization import GridDiscretization, GridSource
from ..mesh.components import connected_components
from ..parallel import PointTree
from ..shapes.kinds import SurfaceDomain
from ..surfaces.plane_fits import POINT_NEIGHBORS
from ..surfaces.point_cloud import PointCloud
from ..surfaces.surface_discretization import SurfaceDiscretization
from ..surfaces.surface_source import SurfaceSource, joined
from ..tets.tet_discretization import TetDiscretization
from ..tets.tet_mesh import TetMesh
from ..tets.tet_source import TetSource
from .field import Domain, Field

SMALL_LOOP = 3.5
"""Length of a closed curve, in mean sides of the triangles it crosses, below which it counts as small. At least a
quarter of the heat of a small loop cancels, so φ is inaccurate and a note says so."""


@singledispatch
def to_field(discretization: Any, values: Floats, source: Any, diagnostics: Diagnostics) -> Field[Any]:
    """Make a field of the values at the unknowns of a discretisation of any domain.

    `values` has one value for each unknown, and NaN where no source is connected. The notes of the discretisation and
    of the source are added to the diagnostics.
    """
    raise UnsupportedTypeError(f"there is no field for {type(discretization).__name__}", element="domain")


@to_field.register
def _(discretization: GridDiscretization, values: Floats, source: GridSource, diagnostics: Diagnostics) -> Field[Grid]:
    return Field(discretization.grid, values, diagnostics.noting(sampled(source)))


@to_field.register
def _(
    discretization: SurfaceDiscretization, values: Floats, source: SurfaceSource, diagnostics: Diagnostics
) -> Field[SurfaceDomain]:
    """Make a field on the surface, and one on its finer triangulation if it was retriangulated for the source."""
    # NaN where diffusion did not reach, such as behind a single shared vertex
    values = np.where(discretization.reached_by(source.vectors), values, np.nan)
    triangulation, all_values = discretization.triangulation, values
    values = values[discretization.restriction]
    if isinstance(discretization.domain, PointCloud) and np.isnan(values).any():  # its triangles may have gaps
        cloud = discretization.domain
        used = mask_of(cloud.n_points, cloud.triangulation.faces)
        values = spread(cloud.points, values, used)[cloud.representatives]
    unreached = unreached_vertices(discretization.domain, values)
    small = small_loops(source)
    notes = (*discretization.notes, *([SmallLoops(small)] if small else []))
    noted = replace(diagnostics, unreached=unreached).noting(*notes)
    finer = None
    if triangulation is not None:
        added = all_values[len(values) : triangulation.n_vertices]
        finer = Field(triangulation, np.concatenate([values, added]), noted, source=source)
    return Field(discretization.domain, values, noted, source=source, finer=finer)


def unreached_vertices(domain: object, values: Floats) -> Ints:
    """Return (k,) the vertices of a surface whose distance, (n,), is NaN, after a warning if there are any."""
    unreached = np.flatnonzero(np.isnan(values))
    if len(unreached):
        warn_user(
            f"no source is connected to {len(unreached)} of {len(values)} vertices, the first of them "
            f"{_named(domain, unreached[0])}: distance there is NaN. Put a source on every part, or join the parts",
            UnreachedWarning,
        )
    return unreached


def _named(domain: object, vertex: int) -> str:
    """Name a vertex for a message by its coordinates, or by its number if the domain has no coordinates."""
    positions = getattr(domain, "vertices", getattr(domain, "points", None))
    return f"number {vertex}" if positions is None else f"at {place(positions[vertex], positions)}"


@to_field.register
def _(discretization: TetDiscretization, values: Floats, source: TetSource, diagnostics: Diagnostics) -> Field[TetMesh]:
    mesh, at_vertices = discretization.mesh, discretization.at_vertices(values)
    unreached = np.flatnonzero(np.isnan(at_vertices))
    if np.isnan(values).any():
        warn_user(
            f"{np.isnan(values[discretization.unknowns]).any(axis=1).sum()} of {mesh.n_tets} tets are not connected to "
            "any source through faces: the distance there is NaN",
            UnreachedWarning,
        )
    turned = (TetsTurned(len(mesh.reoriented)),) if len(mesh.reoriented) else ()
    noted = replace(diagnostics, unreached=unreached).noting(*source.notes, *turned)
    return Field(mesh, at_vertices, noted, source=source)


def sampled(source: GridSource) -> SampledSource:
    """Return the note on the number of samples of a source on a grid, the area outside it and the cancelled area."""
    return SampledSource(len(source.weights), source.samples.outside, source.samples.cancelled)


def warned(field: Field[Domain]) -> Field[Domain]:
    """Return the field, after an `InexactWarning` if its diagnostics have a note on curves too small for triangles."""
    note = field.diagnostics.note(SmallLoops)
    if note:
        warn_user(
            f"{note}. The method hardly resolves them: sh.signed_distance measures to the curves themselves; on "
            "triangle meshes, intrinsic=True makes triangles with the curves along their edges",
            InexactWarning,
        )
    return field


def small_loops(source: SurfaceSource) -> int:
    """Count closed oriented curves shorter than `SMALL_LOOP` mean sides of the triangles they cross.

    Segments along edges of the mesh count as resolved, with sides of length 0.
    """
    parts = [part for part in source.parts if part.oriented and len(part.ends)]
    if not parts:
        return 0
    triangles = source.triangles
    nodes, ends = joined(parts)
    label = connected_components(len(nodes), ends[:, 0], ends[:, 1])[ends[:, 0]]
    lengths = np.concatenate([part.lengths for part in parts])
    faces = np.concatenate([part.faces for part in parts])
    inside = np.concatenate([part.edges < 0 for part in parts])
    sides = np.where(inside, np.sqrt(4 / 3**0.5 * triangles.face_areas[faces]), 0.0)  # 0 along edges: resolved
    length, weighted = np.bincount(label, lengths), np.bincount(label, lengths * sides)
    odd = np.bincount(ends.ravel(), minlength=len(nodes)) % 2 == 1
    is_open = mask_of(len(length), label[odd[ends].any(axis=1)])
    return int(((length > 0) & ~is_open & (length**2 < SMALL_LOOP * weighted)).sum())


def spread(points: Floats, values: Floats, used: Bools) -> Floats:
    """Replace NaN in (n,) signed distances at `used` points by lengths of shortest paths from points with a value.

    Paths run in the graph of nearest neighbours of the (n, 3) points. The sign is that of the point where a path
    starts. Points that no path reaches stay NaN.
    """
    lacking = np.isnan(values) & used
    ids = np.flatnonzero(used)
    if not lacking.any() or len(ids) <= POINT_NEIGHBORS:
        return values
    far, near = PointTree(points[ids]).query(points[ids], k=POINT_NEIGHBORS + 1)
    rows = np.repeat(np.arange(len(ids)), POINT_NEIGHBORS)
    graph = sparse.csr_matrix(
        (np.maximum(far[:, 1:].ravel(), 1e-300), (rows, near[:, 1:].ravel())), shape=(len(ids),) * 2
    )
    graph = sparse.csr_matrix(graph.minimum(graph.T))  # else coarse sheets join fine ones beside them
    finite = np.flatnonzero(~lacking[ids])
    start = np.abs(values[ids[finite]])
    pairs, source = graph.tocoo(), np.full(len(finite), len(ids))
    tails, heads = np.concatenate([pairs.row, source]), np.concatenate([pairs.col, finite])
    whole = shortest_arcs(tails, heads, np.concatenate([pairs.data, start]), len(ids) + 1)
    away, before = sparse.csgraph.dijkstra(whole, directed=False, indices=len(ids), return_predecessors=True)
    result: Floats = values.copy()
    sign = np.where(values[ids] < 0, -1.0, 1.0)
    for k in np.argsort(away, kind="stable").tolist():
        if k == len(ids) or not lacking[ids[k]] or not np.isfinite(away[k]):
            continue
        sign[k] = sign[before[k]]
        result[ids[k]] = sign[k] * away[k]
    return result
