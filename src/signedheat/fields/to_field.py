"""From the unknowns of a discretisation to the field that users see, one function for each kind of discretisation."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..discretization import Diagnostics
from ..errors import UnreachedWarning, warn_user
from ..lowering.grid.discretization import GridDiscretization
from ..lowering.grid.masked import MaskedGridDiscretization
from ..lowering.grid.masked_source import MaskedSource
from ..lowering.grid.source import GridSource
from ..lowering.surface.discretization import SurfaceDiscretization
from ..lowering.surface.source import SurfaceSource
from ..lowering.tets.discretization import TetDiscretization
from ..lowering.tets.source import TetSource
from .grid_field import GridField
from .tet_field import TetField
from .vertex_field import VertexField

Field = GridField | VertexField | TetField
"""What a solver returns."""


@singledispatch
def to_field(discretization: Any, values: NDArray[np.float64], source: Any, diagnostics: Diagnostics) -> Field:
    """The field whose values a discretisation found, with what it has to tell added to the diagnostics."""
    raise TypeError(f"no field is known for {type(discretization).__name__}")


@to_field.register
def _(
    discretization: GridDiscretization, values: NDArray[np.float64], source: GridSource, diagnostics: Diagnostics
) -> GridField:
    notes = {**diagnostics.notes, **_sampled(source)}
    return GridField(discretization.grid, values, replace(diagnostics, notes=notes))


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
    notes = {**diagnostics.notes, **_sampled(source.whole)}
    return GridField(grid, everywhere.reshape(grid.shape), replace(diagnostics, unreached=unreached, notes=notes))


@to_field.register
def _(
    discretization: SurfaceDiscretization,
    values: NDArray[np.float64],
    source: SurfaceSource,
    diagnostics: Diagnostics,
) -> VertexField:
    """φ at the vertices of the domain; NaN where nothing was diffused, beyond single vertices for instance."""
    values = np.where(discretization.reached_by(source.vectors), values, np.nan)
    if discretization.restriction is not None:
        values = values[discretization.restriction]
    unreached = np.flatnonzero(np.isnan(values))
    if len(unreached):
        warn_user(
            f"no source is connected to {len(unreached)} of {len(values)} vertices, the first of them number "
            f"{unreached[0]}: distance there is NaN. Put a source on every part, or join the parts",
            UnreachedWarning,
        )
    notes = {**diagnostics.notes, **discretization.notes}
    return VertexField(discretization.domain, values, replace(diagnostics, unreached=unreached, notes=notes), source)


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
    notes = {**diagnostics.notes, **source.notes}
    if len(mesh.reoriented):
        notes["tets turned"] = len(mesh.reoriented)
    return TetField(mesh, at_vertices, replace(diagnostics, unreached=unreached, notes=notes), source)


def _sampled(source: GridSource) -> dict[str, float]:
    return {
        "samples": len(source.weights),
        "area outside the grid": source.samples.outside,
        "area that cancels": source.samples.cancelled,
    }
