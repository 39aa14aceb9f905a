"""Which side of a shape is inside, on a grid: what `choose_sides` needs, made from the shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..lowering.area_elements import AreaSamples
from ..operators.grid.boundary_areas import distances_to_samples
from ..operators.grid.fitted_points import REACH, mean_gap
from .inside import Sides, nothing_inside
from .rims import rims_of
from .shape_sharpening import Shape
from .sides import FAR, choose_sides


def sides_of_shape(
    shape: Shape,
    phi: NDArray[np.float64] | None,
    winding: NDArray[np.float64],
    samples: AreaSamples | None,
    grid: Grid,
) -> Sides:
    """The sides of a broken shape, from φ, winding numbers and samples; nothing is inside where those cancel."""
    if phi is None or samples is None:
        return nothing_inside(grid.shape)
    cell = float(grid.spacing.max())
    between = max(REACH * mean_gap(shape.points) - FAR * cell, 0.0) if isinstance(shape, PointCloud) else 0.0
    nodes = (grid.shape[0], grid.shape[1], grid.shape[2])
    distance = distances_to_samples(samples.positions, samples.vectors, nodes, grid.spacing, (FAR + 1) * cell + between)
    if between:  # nothing is missing between points that are farther apart than cells
        np.maximum(distance - between, 0.0, out=distance)
    rims = None if isinstance(shape, PointCloud) else rims_of(shape.triangulation, grid)
    return choose_sides(phi, winding, distance, samples.positions, samples.vectors, grid.spacing, grid.origin, rims)
