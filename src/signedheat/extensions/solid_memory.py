"""How much memory distance to solids takes on grids, estimated before any of it is allocated."""

from __future__ import annotations

import numpy as np

from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..lowering.grid.discretization import BYTES_PER_AREA, refuse_beyond_memory
from .joining import Shape
from .steps import Steps

BYTES_PER_NODE, BYTES_IF_PLAIN, BYTES_IF_CLOSED = 42, 45, 29
"""Measured peak memory: of shapes with holes or overlaps; of φ alone; of shapes whose parts are closed."""
BYTES_PER_CELL = 600
"""What each square cell of their surface adds, of shapes with holes or overlaps."""
BYTES_IF_SCATTERED, BYTES_IF_POINTS = 62, 46
"""The same of noisy soups, whose faces lie in layers, and of points."""
BYTES_PER_FACE, BYTES_PER_OPEN_FACE = 400, 1200
"""What each triangle of the shape adds, and each of one that is not closed, as those of noisy soups."""
BYTES_IF_OPEN, BYTES_OF_POINTS = 10_000_000, 210_000_000
"""Of libraries and kernels that only shapes which are not closed, and turning points, need."""
BYTES_IF_SOUP = 20_000_000
"""The same of noisy soups."""
ONCE = 0.9
"""Share of the vertices with a coordinate of their own from which on a soup has noise, so that it is never joined."""


def bytes_per_node(shape: Shape, steps: Steps, closed: bool) -> int:
    """Peak for each node of a grid, of a shape whose parts are closed, or may be: the least then."""
    if not steps.sharpen:
        return BYTES_IF_PLAIN
    if isinstance(shape, PointCloud):
        return BYTES_IF_POINTS
    if isinstance(shape, TriangleMesh) and is_scattered(shape):
        return BYTES_IF_SCATTERED
    return BYTES_IF_CLOSED if closed and steps.orient else BYTES_PER_NODE


def bytes_of_faces(shape: Shape) -> float:
    """What is added by the faces of a shape, of which most is taken when they are oriented."""
    if isinstance(shape, PointCloud):
        return float(BYTES_OF_POINTS)
    if isinstance(shape, PolygonMesh):
        return float(BYTES_PER_FACE * len(shape.corners))
    if is_scattered(shape):
        return float(BYTES_IF_SOUP + BYTES_PER_OPEN_FACE * shape.n_faces)
    return float(BYTES_PER_FACE * shape.n_faces)


def most_memory(shape: Shape, steps: Steps) -> tuple[float, float, float]:
    """Bytes for each node, bytes besides, and area as `bytes_of_area` counts it, of a shape that is not closed."""
    per_node, beside = bytes_per_node(shape, steps, closed=False), bytes_of_faces(shape)
    if isinstance(shape, PointCloud) or per_node != BYTES_PER_NODE:
        return per_node, beside, 0.0
    beside *= BYTES_PER_OPEN_FACE / BYTES_PER_FACE
    area = float(shape.triangulation.face_areas.sum())
    return per_node, beside + BYTES_IF_OPEN, area * BYTES_PER_CELL / BYTES_PER_AREA


def refuse_even_if_closed(shape: Shape, grid: Grid, steps: Steps) -> None:
    """Raise `MemoryLimitError`, before anything is allocated, if even a closed shape would not fit."""
    per_node, most = bytes_per_node(shape, steps, closed=True), most_memory(shape, steps)
    refuse_beyond_memory(grid, per_node, bytes_of_faces(shape), at_most=most, scale=_scale(grid, steps))


def refuse_if_open(shape: Shape, grid: Grid, steps: Steps) -> None:
    """The same for a shape that turns out not to be closed, whose faces are there already."""
    per_node, beside, area = most_memory(shape, steps)
    refuse_beyond_memory(grid, per_node, beside - bytes_of_faces(shape), area, scale=_scale(grid, steps))


def _scale(grid: Grid, steps: Steps) -> float:
    """Spacing of the band that a grid is coarse for, over its own."""
    return 1.0 if steps.finest is None else steps.finest / float(grid.spacing.min())


def is_scattered(mesh: TriangleMesh) -> bool:
    """Whether triangles have vertices of their own, which lie in places of their own: noise has moved each.

    Examples
    --------
    >>> from signedheat.samples import soup, sphere
    >>> is_scattered(soup(sphere(2))), is_scattered(soup(sphere(2), 0.01))
    (False, True)
    """
    n = mesh.n_vertices
    return n == 3 * mesh.n_faces and any(len(np.unique(along)) > ONCE * n for along in mesh.vertices.T)
