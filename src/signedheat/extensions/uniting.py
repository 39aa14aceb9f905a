"""Bodies that overlap become one: what lies inside other bodies is left out (winding numbers on a grid tell)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray

from ..diagnostics import LeftOut
from ..domains.foreign import ForeignShape, converted
from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import CancellingNormalsError, UnsupportedTypeError
from ..geometry.components import same_positions
from ..geometry.edges import edge_table
from ..geometry.refining import split_at_edges
from ..lowering.area_elements import AreaSamples, grid_around, sample_on_grid
from ..operators.grid.face_values import ranges_on_faces, values_at
from ..operators.grid.winding import winding_numbers
from ..reprs import ShortRepr

Shape = TriangleMesh | PolygonMesh | PointCloud

COVERED = 1.1
"""Mean of the winding numbers on both sides of a face from which it lies inside another body.

It is ½ on the boundary of the union, 1½ on a body's face inside another one, 1 where two bodies touch: that stays, and
so do the sides of a gap, however narrow.
"""
BURIED = 0.75
"""The same for a doubled wall, of which both sides see the same."""
OVERLAP = 1.5
"""Winding number from which bodies overlap at a node."""
NEAR = 2
"""Cells around overlaps in which faces are looked at."""
SAMPLE_SIZE = 1.0
"""Longest edge, in cells, of the pieces into which faces are cut to take winding numbers."""
ROUNDS = 40
"""How often faces are halved at most."""
MARGIN = 0.02
"""Share of an edge that a cut keeps from its ends."""


@dataclass(frozen=True, eq=False, repr=False)
class Union(ShortRepr):
    """A shape without what lies inside other bodies of it.

    Attributes
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud
        What is left; the shape itself where nothing was left out, or else triangles, or points.
    left_out : LeftOut
        What is not.
    origins : (m,) int, optional
        Triangle of the shape that each face which is left is part of, if some were left out.
    """

    shape: Shape
    left_out: LeftOut
    origins: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class Merged:
    """A shape without duplicates.

    Attributes
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud
        The shape itself where there were none.
    walls : (m,) bool
        Faces of doubled walls.
    count : int
        Duplicates left out.
    restored : (m,) bool, optional
        Faces that it had lost.
    """

    shape: Shape
    walls: NDArray[np.bool_]
    count: int
    restored: NDArray[np.bool_] | None = None

    def without(self, union: Union) -> Merged:
        """What the union with itself left of it."""
        if union.origins is None:
            return replace(self, shape=union.shape)
        restored = None if self.restored is None else self.restored[union.origins]
        return replace(self, shape=union.shape, walls=self.walls_among_triangles()[union.origins], restored=restored)

    def walls_among_triangles(self) -> NDArray[np.bool_]:
        """(t,) which triangles are faces of doubled walls: none of those of polygons."""
        if isinstance(self.shape, PolygonMesh):
            return np.zeros(self.shape.triangulation.n_faces, dtype=bool)
        return self.walls


def unite(shape: Shape | ForeignShape, domain: Grid | None = None, *, resolution: int = 128) -> Shape:
    """A shape whose bodies overlap, without what lies inside others: the boundary of their union.

    Walls of cavities, which face into them, stay. Faces that are partly inside are cut where they enter, to a fraction
    of a cell; all others are left as they are. Duplicates count once.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or PointCloud with normals
        A shape whose faces or normals point outwards (see `orient`), whole or broken.
    domain : Grid, optional
        On which winding numbers are taken; by default a grid around the shape.
    resolution : int
        Nodes along the longest side of that default grid.

    Returns
    -------
    TriangleMesh, PolygonMesh or PointCloud
        The shape itself where nothing is left out. `union_of` also tells what was.

    Raises
    ------
    SourceError
        If the shape is of another kind, or is missed by the grid.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball, other = samples.sphere(3), samples.sphere(3, center=(1.0, 0, 0))
    >>> united = unite(samples.union(ball, other), resolution=96)
    >>> bool(abs(united.face_areas.sum() - 6 * np.pi) < 0.15)
    True
    """
    return union_of(shape, domain, resolution=resolution).shape


def union_of(shape: Shape | ForeignShape, domain: Grid | None = None, *, resolution: int = 128) -> Union:
    """What `unite` gives, and what was left out for it; see there for parameters and errors."""
    own = cast("Shape", converted(shape))
    grid = grid_around([own], resolution) if domain is None else domain
    merged = merge_duplicates(own)
    return without_covered(merged, wound(merged.shape, grid)[1], grid)


def wound(shape: Shape, grid: Grid) -> tuple[AreaSamples | None, NDArray[np.float64]]:
    """Samples of a shape and its winding numbers; none and zeros where all its normals cancel."""
    try:
        samples = sample_on_grid([shape], grid, SAMPLE_SIZE)
    except CancellingNormalsError:
        return None, np.zeros(grid.shape)
    return samples, winding_of(samples, grid)


def winding_of(samples: AreaSamples, grid: Grid) -> NDArray[np.float64]:
    """(*grid.shape) winding numbers of a sampled shape."""
    return winding_numbers(samples.nodes, grid.shape, samples.positions, samples.vectors)


def merge_duplicates(shape: Shape) -> Merged:
    """Faces on the same corners as others count once, or, if they face both ways, once each way.

    Raises
    ------
    UnsupportedTypeError
        If the shape is neither a mesh nor a point cloud.
    """
    if isinstance(shape, PointCloud):
        return Merged(shape, np.zeros(shape.n_points, dtype=bool), 0)
    if isinstance(shape, PolygonMesh):
        return Merged(shape, np.zeros(shape.n_polygons, dtype=bool), 0)
    if not isinstance(shape, TriangleMesh):
        raise UnsupportedTypeError(
            f"bodies of a TriangleMesh, PolygonMesh or PointCloud are united, not of a {type(shape).__name__}",
            element="shape",
        )
    corners = same_positions(shape.vertices)[shape.faces]
    first = corners.argmin(axis=1)
    rows = np.arange(len(corners))
    ahead, behind = corners[rows, (first + 1) % 3], corners[rows, (first + 2) % 3]
    triples = np.stack([corners[rows, first], np.minimum(ahead, behind), np.maximum(ahead, behind)], axis=1)
    _, group, counts = np.unique(triples, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    if (counts == 1).all():
        return Merged(shape, np.zeros(len(corners), dtype=bool), 0)
    way = np.where(ahead < behind, 1, -1)
    excess = np.bincount(group, way)
    first_ahead, first_back = (
        np.isin(rows, np.unique(np.where(way == sign, group, -1), return_index=True)[1]) & (way == sign)
        for sign in (1, -1)
    )
    walls = (excess[group] == 0) & (first_ahead | first_back)
    kept = walls | (first_ahead & (excess[group] > 0)) | (first_back & (excess[group] < 0))
    mesh = shape if kept.all() else TriangleMesh(shape.vertices, shape.faces[kept])
    return Merged(mesh, walls[kept], int((~kept).sum()))


def without_covered(merged: Merged, winding: NDArray[np.float64], grid: Grid) -> Union:
    """Leave out what lies inside other bodies, as winding numbers tell.

    Parameters
    ----------
    merged : Merged
        The shape.
    winding : (*grid.shape) float
        Its winding numbers.
    grid : Grid
        Three axes.
    """
    shape, walls = merged.shape, int(merged.walls.sum()) // 2
    overlap = winding > OVERLAP
    buried = merged.walls.any() and bool((winding > BURIED).any())
    if not (overlap.any() or buried):
        return Union(shape, LeftOut(merged_faces=merged.count, doubled_walls=walls))
    near = scipy.ndimage.binary_dilation(overlap, np.ones((3,) * winding.ndim), iterations=NEAR)
    depth = np.where(near, winding, np.minimum(winding, 1.0))
    if isinstance(shape, PointCloud):
        covered = values_at(depth, (shape.points - grid.origin) / grid.spacing) > COVERED
        return _points_left(shape, covered)
    mesh = shape.triangulation
    flags = merged.walls_among_triangles()
    return what_is_left(merged, mesh, flags, *_cut_where_covered(mesh, flags, depth, grid))


def _points_left(cloud: PointCloud, covered: NDArray[np.bool_]) -> Union:
    if not covered.any():
        return Union(cloud, LeftOut())
    normals, areas = (None if each is None else each[~covered] for each in (cloud.normals, cloud.areas))
    share = float(covered.mean() if cloud.areas is None else cloud.areas[covered].sum() / cloud.areas.sum())
    left = PointCloud(cloud.points[~covered], normals, areas, cloud.n_neighbors)
    return Union(left, LeftOut(int(covered.sum()), share))


def what_is_left(
    merged: Merged,
    mesh: TriangleMesh,
    walls: NDArray[np.bool_],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    origins: NDArray[np.int64],
    covered: NDArray[np.bool_],
) -> Union:
    """Faces that are not covered of those, (k, 3), into which a mesh was cut.

    Parameters
    ----------
    merged, mesh, walls
        The shape, its triangles, and which of them are doubled walls.
    vertices, faces : arrays
        The triangles that it was cut into.
    origins, covered : (k,)
        The triangle that each is part of, and whether it lies inside other bodies.
    """
    duplicates = LeftOut(merged_faces=merged.count, doubled_walls=int(walls.sum()) // 2)
    if not covered.any() or covered.all():  # of bodies that bury each other nothing would be left
        return Union(merged.shape, duplicates)
    left_out, kept = np.zeros(mesh.n_faces, dtype=bool), np.zeros(mesh.n_faces, dtype=bool)
    left_out[origins[covered]] = True
    kept[origins[~covered]] = True
    result = TriangleMesh(vertices, faces[~covered])
    share = 1.0 - float(result.face_areas.sum() / mesh.face_areas.sum())
    in_part = int((left_out & kept).sum())
    told = replace(duplicates, covered_faces=int(left_out.sum()), covered_area=share, cut_faces=in_part)
    return Union(result, told, origins[~covered])


def _cut_where_covered(
    mesh: TriangleMesh, walls: NDArray[np.bool_], depth: NDArray[np.float64], grid: Grid
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Vertices, faces, the face of the mesh that each is part of, and whether it is covered."""
    vertices, faces = mesh.vertices, same_positions(mesh.vertices)[mesh.faces]
    origins = np.arange(len(faces))

    def in_cells(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return (points - grid.origin) / grid.spacing

    low, high = ranges_on_faces(depth, in_cells(vertices[faces]))
    covered = np.where(walls, high > BURIED, low > COVERED)
    partly = ~walls & (low <= COVERED) & (high > COVERED)
    for _ in range(ROUNDS):
        table = edge_table(faces)
        ends = in_cells(vertices[table.vertices])
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1.0
        split = np.zeros(len(long), dtype=bool)
        split[table.face_edges[partly]] = True
        split &= long
        if not split.any():
            break
        vertices, faces, parents = split_at_edges(vertices, faces, split, np.full(len(split), 0.5))
        origins, covered, partly = origins[parents], covered[parents], partly[parents]
        low, high = ranges_on_faces(depth, in_cells(vertices[faces[partly]]))
        covered[partly] = low > COVERED
        partly[partly] = (low <= COVERED) & (high > COVERED)
    table = edge_table(faces)
    height = values_at(depth, in_cells(vertices)) - COVERED
    a, b = height[table.vertices].T
    cut = np.zeros(len(table.vertices), dtype=bool)
    cut[table.face_edges[partly]] = True
    cut &= (a > 0) != (b > 0)
    shares = np.clip(a / np.where(cut, a - b, 1.0), MARGIN, 1 - MARGIN)
    vertices, faces, parents = split_at_edges(vertices, faces, cut, shares)
    height = np.concatenate([height, np.zeros(len(vertices) - len(height))])
    covered = np.where(partly[parents], height[faces].sum(axis=1) > 0, covered[parents])
    return vertices, faces, origins[parents], covered
