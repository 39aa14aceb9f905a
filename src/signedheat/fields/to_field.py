"""From the unknowns of a discretisation to a field on its domain, one function for each kind of discretisation."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Diagnostics, SampledSource, SmallLoops, TetsTurned
from ..domains.point_cloud import PointCloud
from ..errors import InexactWarning, UnreachedWarning, UnsupportedTypeError, warn_user
from ..geometry.neighbor_paths import spread
from ..lowering.grid.discretization import GridDiscretization
from ..lowering.grid.masked import MaskedGridDiscretization, MaskedSource
from ..lowering.grid.source import GridSource
from ..lowering.surface.discretization import SurfaceDiscretization
from ..lowering.surface.small_loops import small_loops
from ..lowering.surface.source import SurfaceSource
from ..lowering.tets.discretization import TetDiscretization
from ..lowering.tets.source import TetSource
from .grid_field import GridField
from .tet_field import TetField
from .vertex_field import VertexField

Field = GridField | VertexField | TetField
"""What a solver returns."""

AnyField = TypeVar("AnyField", GridField, VertexField, TetField, Field)


@singledispatch
def to_field(discretization: Any, values: NDArray[np.float64], source: Any, diagnostics: Diagnostics) -> Field:
    """The field with the values of a discretisation's unknowns, and with its notes added to the diagnostics."""
    raise UnsupportedTypeError(f"there is no field for {type(discretization).__name__}", element="domain")


@to_field.register
def _(
    discretization: GridDiscretization, values: NDArray[np.float64], source: GridSource, diagnostics: Diagnostics
) -> GridField:
    return GridField(discretization.grid, values, diagnostics.noting(sampled(source)))


@to_field.register
def _(
    discretization: MaskedGridDiscretization,
    values: NDArray[np.float64],
    source: MaskedSource,
    diagnostics: Diagnostics,
) -> GridField:
    """φ at the nodes of the grid, NaN at solid ones."""
    grid, ids = discretization.grid, discretization.nodes.ids
    everywhere = np.full(grid.n_nodes, np.nan)
    everywhere[ids] = values
    unreached = ids[np.isnan(values)]
    if len(unreached):
        warn_user(
            f"{len(unreached)} of {len(values)} free nodes are cut off from every source by solid ones: the "
            "distance there is NaN",
            UnreachedWarning,
        )
    noted = replace(diagnostics, unreached=unreached).noting(sampled(source))
    return GridField(grid, everywhere.reshape(grid.shape), noted)


@to_field.register
def _(
    discretization: SurfaceDiscretization,
    values: NDArray[np.float64],
    source: SurfaceSource,
    diagnostics: Diagnostics,
) -> VertexField:
    """φ at the vertices of the domain; NaN where diffusion did not reach, such as behind a single shared vertex."""
    values = np.where(discretization.reached_by(source.vectors), values, np.nan)
    triangulation, everywhere = discretization.triangulation, values
    if discretization.restriction is not None:
        values = values[discretization.restriction]
    if isinstance(discretization.domain, PointCloud) and np.isnan(values).any():  # its triangles may have gaps
        cloud = discretization.domain
        used = np.zeros(cloud.n_points, dtype=bool)
        used[cloud.triangulation.faces] = True
        values = spread(cloud.points, values, used)[cloud.representatives]
    unreached = np.flatnonzero(np.isnan(values))
    if len(unreached):
        warn_user(
            f"no source is connected to {len(unreached)} of {len(values)} vertices, the first of them number "
            f"{unreached[0]}: distance there is NaN. Put a source on every part, or join the parts",
            UnreachedWarning,
        )
    small = small_loops(source)
    notes = (*discretization.notes, *([SmallLoops(small)] if small else []))
    noted = replace(diagnostics, unreached=unreached).noting(*notes)
    finer = None
    if triangulation is not None:
        finer = VertexField(triangulation, everywhere[: triangulation.n_vertices], noted, source)
    return VertexField(discretization.domain, values, noted, source, finer)


@to_field.register
def _(
    discretization: TetDiscretization, values: NDArray[np.float64], source: TetSource, diagnostics: Diagnostics
) -> TetField:
    """φ at the vertices of the mesh."""
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
    return TetField(mesh, at_vertices, noted, source)


def sampled(source: GridSource) -> SampledSource:
    return SampledSource(len(source.weights), source.samples.outside, source.samples.cancelled)


def warned(field: AnyField) -> AnyField:
    """The field; with a warning if it is that of the method, and curves are too small for its triangles."""
    note = field.diagnostics.note(SmallLoops)
    if note:
        warn_user(
            f"{note}. The method hardly sees them: sh.signed_distance measures to the curves themselves, as does, on "
            "triangle meshes, intrinsic=True by triangles that have them along edges",
            InexactWarning,
        )
    return field
