"""The surface that the signed heat method makes of points, and of loose triangles that scatter around it.

The winding number of a surface falls by one where it is crossed along its normal and is harmonic elsewhere (Jacobson et
al. 2013). So one Poisson equation gives it on a grid, ``−Δw = ∇·(n δ)``, with n δ the area vectors spread over the
nodes around them. On the walls of the box w is the far field of the area vectors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..constraints import Constraint, ZeroSet
from ..discretization import discretize
from ..errors import OutsideError
from ..grids.grid import Grid
from ..grids.grid_discretization import GridSource
from ..grids.marching import closed_surface
from ..grids.stencil import solve_poisson
from ..mesh.box_tree import room_around
from ..mesh.components import sums_of
from ..method import diffuse, integrate, normalize
from ..parallel import in_threads
from ..shapes.area_elements import AreaSamples, sample_on_grid
from ..surfaces.point_cloud import PointCloud
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import positive_number
from .point_orientation import fitted_to_points

DIPOLE_CELLS = 4
"""Edge, in cells, of the blocks whose area vectors are summed to one dipole for the far field at the walls."""
DIPOLE_CORE = 2.0
"""Within this distance, in cells, the field of a dipole is that of a ball."""
FAR_FIELD = 10
"""Number of cells that the far field needs between the shape and the walls."""


def winding_numbers(samples: AreaSamples) -> Floats:
    """Compute (nx, ny, nz) winding numbers, smoothed over two cells, at the nodes of the grid of some samples.

    They solve Poisson's equation with the divergence of the area vectors as right side. The flux through the walls of
    the grid, and the constant, are those of the field of the area vectors as dipoles in free space.
    """
    shape, spacing = np.array(samples.nodes.shape[1:]), samples.nodes.steps[1:]
    nodes, vectors = samples.nodes.nonzero()
    nodes = nodes[:, 1:]
    # layers of nodes are added so that no vectors are near the walls
    below, above = (np.maximum(0, FAR_FIELD - room) for room in (nodes.min(axis=0), shape - 1 - nodes.max(axis=0)))
    inner = tuple(slice(first, first + n) for first, n in zip(below, shape, strict=True))
    size = tuple((shape + below + above).tolist())
    right_side = _divergence(nodes + below, vectors, size, spacing)
    dipoles, strengths = blocks_of_dipoles(samples.positions + below, samples.vectors)
    walls = [_wall(axis, end, size) for axis in range(3) for end in (0, 1)]
    core = DIPOLE_CORE * float(spacing.max())

    def far_field(wall: tuple[int, int, Floats]) -> tuple[Floats, Floats]:
        """Winding numbers of the dipoles at the points of a wall, and their derivatives across it."""
        axis, _, lattice = wall
        return _far_field(lattice.reshape(-1, 3) * spacing, dipoles * spacing, strengths, axis, core)

    fields = []
    for (axis, end, lattice), (w, flux) in zip(walls, in_threads(far_field, walls), strict=True):
        flux = _refined(flux.reshape(lattice.shape[:-1]), size, axis) / spacing[axis]
        layer = np.moveaxis(right_side, axis, 0)[-1 if end else 0]
        layer += flux if end else -flux
        fields.append(_refined(w.reshape(lattice.shape[:-1]), size, axis))
    result = solve_poisson(right_side, spacing, overwrite=True)
    excess = [
        result.take(-1 if end else 0, axis=axis) - field for (axis, end, _), field in zip(walls, fields, strict=True)
    ]
    result -= np.median(np.concatenate([part.ravel() for part in excess]))
    return result[inner]


def blocks_of_dipoles(positions: Floats, vectors: Floats) -> tuple[Floats, Floats]:
    """Sum (n, 3) area vectors in blocks of `DIPOLE_CELLS` cells: (b, 3) mean positions, and (b, 3) sums.

    Positions, (n, 3), are in cells.
    """
    blocks = np.floor(positions / DIPOLE_CELLS).astype(np.int64)
    blocks -= blocks.min(axis=0)
    owners = blocks[:, 0]
    for column in blocks.T[1:]:
        if float(owners.max()) * float(column.max()) > 2.0**60:  # a shape far larger than the grid
            owners, column = (np.unique(part, return_inverse=True)[1] for part in (owners, column))
        owners = owners * (column.max() + 1) + column
    _, owners = np.unique(owners, return_inverse=True)
    weights = np.linalg.norm(vectors, axis=1) + 1e-300
    total = np.bincount(owners, weights)
    n = len(total)
    return sums_of(weights[:, None] * positions, owners, n) / total[:, None], sums_of(vectors, owners, n)


def _divergence(nodes: Ints, vectors: NDArray[np.float32], shape: tuple[int, ...], spacing: Floats) -> Floats:
    """(nx, ny, nz) values of ∇·(n δ), by central differences of (k, 3) vectors at (k, 3) nodes off the boundary."""
    result = np.zeros(shape)
    volume = float(np.prod(spacing))
    flows = (-0.5 / spacing * volume ** (2 / 3) / volume) * vectors[:, :3].astype(np.float64)
    for axis, flow in enumerate(flows.T):
        step = np.arange(3) == axis
        result[tuple((nodes + step).T)] += flow
        result[tuple((nodes - step).T)] -= flow
    return result


def _wall(axis: int, end: int, shape: tuple[int, ...]) -> tuple[int, int, Floats]:
    """Return axis, end and (a, b, 3) points of a wall of the grid's box, which is half a cell beyond the last nodes.

    Points are about 8 cells apart, in units of cells. `end` is 0 for the lower wall, and 1 for the upper one.
    """
    lines = [np.linspace(-0.5, n - 0.5, max(2, 1 + -(-n // 8))) for n in shape]
    lines[axis] = lines[axis][[-1 if end else 0]]
    lattice = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    return axis, end, lattice.squeeze(axis=axis)


def _refined(values: Floats, shape: tuple[int, ...], axis: int) -> Floats:
    """Interpolate values on the coarse lattice of a wall of a grid's box, linearly, to the nodes next to the wall.

    `shape` is that of the grid, and `axis` the one across the wall.
    """
    for d, n in enumerate(m for k, m in enumerate(shape) if k != axis):
        position = (np.arange(n) + 0.5) / n * (values.shape[d] - 1)
        below = np.minimum(position.astype(np.int64), values.shape[d] - 2)
        f = (position - below).reshape(-1, *(1,) * (values.ndim - 1 - d))
        values = values.take(below, axis=d) * (1 - f) + values.take(below + 1, axis=d) * f
    return values


@compiled
def _far_field(points: Floats, dipoles: Floats, strengths: Floats, axis: int, core: float) -> tuple[Floats, Floats]:
    """(k,) winding number due to dipoles at (k, 3) points, and (k,) its derivative along an axis.

    Dipoles have (d, 3) positions and (d, 3) area vectors `strengths`; within `core` of one its field is bounded. The
    winding number of a dipole a at a vector r from the point is ``a · r / 4π |r|³``.
    """
    value, slope = np.zeros(len(points)), np.zeros(len(points))
    for i in range(len(points)):
        for j in range(len(dipoles)):
            square, product = 0.0, 0.0
            for d in range(3):
                away = dipoles[j, d] - points[i, d]
                square += away * away
                product += away * strengths[j, d]
            square = max(square, core * core)
            sphere = 4.0 * np.pi * square * np.sqrt(square)
            value[i] += product / sphere
            away = dipoles[j, axis] - points[i, axis]
            slope[i] += (3 * product * away / square - strengths[j, axis]) / sphere
    return value, slope


HEAT_NODES = (32, 144)
"""Least and most nodes along the longest side."""
SURE_WINDING = 0.4
"""The winding number, relative to that inside, decides instead of φ where it is nearer to 0 or 1 than this. φ bulges
towards the corners of the box: of half a cow as points 11 % are wrong (20 % with 0.25, 32 % without the rule)."""
FRAGMENT_LEVEL = 0.06
"""A shape with a mean level below this bounds nothing. An eighth of the faces of a ball has 0.0625, 400 leaves anywhere
up to 0.034, 40 on a stem 0.043."""


@dataclass(frozen=True)
class Heat:
    """Options of the signed heat method: constraint on φ (None for `ZeroSet`), and τ in ``t = τ h²``."""

    constraint: Constraint | None = None
    diffusion: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "diffusion", positive_number(self.diffusion, "diffusion"))


def heat_surface(shape: TriangleMesh | PointCloud, method: Heat, cell: float = 0.0) -> tuple[Floats, Ints] | None:
    """Extract the closed zero set of φ as (n, 3) vertices and (m, 3) faces; None if the shape bounds nothing.

    Cells of the grid are about `cell` wide, or as small as `HEAT_NODES` allows if it is 0.
    """
    bounds = shape.bounds
    side = float(np.ptp(bounds, axis=0).max())
    room = room_around(bounds)  # the surface stays within it, however large later grids are
    nodes = int(np.clip((side + 2 * room) / cell, *HEAT_NODES)) if cell > 0 else HEAT_NODES[1]
    grid = Grid.around(bounds, nodes, room)
    samples = sample_on_grid([shape], grid)
    winding = winding_numbers(samples)
    areas = np.linalg.norm(samples.vectors, axis=1)
    level = float(np.average(scipy.ndimage.map_coordinates(winding, samples.positions.T, order=1), weights=areas))
    if level < FRAGMENT_LEVEL:
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
    phi[((phi < 0) & (share < SURE_WINDING)) | ((phi >= 0) & (share > 1 - SURE_WINDING))] *= -1.0
    steps = np.array(grid.spacing)
    if isinstance(shape, PointCloud) and shape.normals is not None:
        phi = fitted_to_points(phi, steps, shape.points - grid.origin, shape.normals)
    try:
        points, faces = closed_surface(phi, steps, 0.0)
    except OutsideError:
        return None
    return grid.origin + points * steps, faces
