"""The surface that the signed heat method makes of points, and of loose triangles that scatter around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..area_elements import sample_on_grid
from ..arrays import Floats, Ints
from ..constraints import Constraint, ZeroSet
from ..discretization import discretize
from ..errors import OutsideError
from ..grids import grid_discretization  # noqa: F401  registers grids
from ..grids.grid import Grid
from ..grids.grid_discretization import GridSource
from ..grids.grid_winding import winding_numbers
from ..grids.marching import closed_surface
from ..method import diffuse, integrate, normalize
from ..surfaces.point_cloud import PointCloud
from ..surfaces.triangle_mesh import TriangleMesh
from .fitted_points import fitted_to_points

ROOM = 0.15
"""Room around the shape, over its longest side: the surface stays within it, whatever the room of later grids."""
NODES = (32, 144)
"""Least and most nodes along the longest side."""
SURE = 0.4
"""How far from 0 and 1 the winding number, over what it is inside, may be where it decides instead of φ, which bulges
towards the corners of the box: of half a cow as points 11 % are wrong (20 with .25, 32 without it)."""
FRAGMENTS = 0.06
"""Level of a whole shape up to which it bounds nothing: an eighth of the faces of a ball has .0625, 400 leaves anywhere
up to .034, 40 on a stem .043."""


@dataclass(frozen=True)
class Heat:
    """How the signed heat method is run: what is imposed on φ, `ZeroSet` if None, and τ in ``t = τ h²``."""

    constraint: Constraint | None = None
    diffusion: float = 1.0


def heat_surface(shape: TriangleMesh | PointCloud, method: Heat, cell: float = 0.0) -> tuple[Floats, Ints] | None:
    """Vertices and faces of the zero set of φ around a shape, closed; None where the shape bounds nothing.

    Cells are as large as noise is wide, or a share of the gaps between points, within bounds; 0 means the smallest.
    Where winding numbers, over what they would be inside of a shape as complete as this one, are clear, they decide.
    """
    bounds = shape.bounds
    side = float(np.ptp(bounds, axis=0).max())
    nodes = int(np.clip((1 + 2 * ROOM) * side / cell, *NODES)) if cell > 0 else NODES[1]
    grid = Grid.around(bounds, nodes, ROOM * side)
    samples = sample_on_grid([shape], grid)
    winding = winding_numbers(samples.nodes, grid.shape, samples.positions, samples.vectors)
    areas = np.linalg.norm(samples.vectors, axis=1)
    level = float(np.average(scipy.ndimage.map_coordinates(winding, samples.positions.T, order=1), weights=areas))
    if level < FRAGMENTS:
        return None
    source = GridSource(samples, grid, method.diffusion)
    discretization = discretize(grid)
    phi = integrate(
        discretization,
        normalize(discretization, diffuse(discretization, source)),
        source,
        method.constraint or ZeroSet(),
    )
    share = winding / (2 * level)
    phi[((phi < 0) & (share < SURE)) | ((phi >= 0) & (share > 1 - SURE))] *= -1.0
    steps = np.array(grid.spacing)
    if isinstance(shape, PointCloud) and shape.normals is not None:
        phi = fitted_to_points(phi, steps, shape.points - grid.origin, shape.normals)
    try:
        return closed_surface(phi, grid.origin, steps, 0.0)
    except OutsideError:
        return None
