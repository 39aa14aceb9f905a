"""Sharpening of distance on tets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Note, RoundCorners
from ..discretization import SourceTerm
from ..domains.foreign import as_shapes
from ..domains.kinds import Shapes
from ..errors import UnsupportedTypeError
from ..fields.tet_field import TetField
from ..geometry.marching_tets import level_triangles
from ..jobs import run_cancellable
from ..lowering.tets.discretization import TetDiscretization, lowered_tets
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from ..solids.joining import Shape
from .methods import straight_distance
from .sharpen import Method, sharpen_field, sharpened
from .tet_distance import Surface, distance_around
from .to_shapes import ToShapes


@sharpen_field.register
def _(
    field: TetField,
    method: Method | Shapes | None = None,
    progress: Progress | None = None,
    shape: Shapes | None = None,
) -> TetField:
    if method is not None and not isinstance(method, Method | type):
        method, shape = None, method
    if method is not None and shape is not None:
        raise UnsupportedTypeError(
            "a method measures to the zero set alone", remedy="leave out the method or the shape"
        )
    if shape is not None:
        method = ToShapes(tuple(cast("list[Shape]", as_shapes(shape))))
    lowered = lowered_tets(field.mesh)  # of which nothing is solved
    elements = LinearElements.on_tets(field.mesh.geometry, lowered.unknowns, lowered.n_unknowns)
    new, diagnostics = sharpened(field, lowered, elements, field.values[lowered.vertices], method, progress)
    return replace(field, values=lowered.at_vertices(new), diagnostics=diagnostics)


@straight_distance.register
def _(
    lowered: TetDiscretization,
    values: NDArray[np.float64],
    source: SourceTerm | None,
    tolerance: float,
    report: Callable[[], None] | None,
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Any-angle distance from the zero set in space, around the boundary of the mesh."""
    points = lowered.mesh.vertices[lowered.vertices] - lowered.planes.center
    surface = Surface(*level_triangles(points, lowered.unknowns, values, 0.0))
    if not len(surface.corners):
        return np.full(len(values), np.inf), ()
    found = run_cancellable(lambda: distance_around(lowered, points, values, surface), report)
    return found.distances, (RoundCorners(found.hidden),)
