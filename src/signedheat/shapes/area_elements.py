"""Oriented area elements, the form in which the signed heat method uses every shape on a grid (Eq. 11 in space).

A shape is split into simplices with a vector, area times normal. These are triangles (polygons are split), segments of
a polyline, or oriented points. They are bisected until they are no larger than a cell, and merged per cell and
connected component. So neither huge faces nor millions of tiny ones cost more than the cells through which they pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from typing import Any

import numpy as np

from ..arrays import Floats, Ints
from ..errors import CancellingNormalsError, SourceError
from ..grids.grid import Grid
from ..grids.node_sources import NodeSources, merge_in_cells
from ..grids.polyline import Polyline
from ..grids.stencil import padded_shape
from ..mesh.components import element_components
from ..mesh.triangles import AREA_ROUNDING, area_vectors
from ..mesh.unit_vectors import unit
from ..mesh.welding import same_positions
from ..parallel import PointTree
from ..surfaces.plane_fits import POINT_NEIGHBORS, areas_per_point
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .foreign import what_to_pass


@dataclass(frozen=True, eq=False)
class AreaElements:
    """m simplices in d dimensions, with area vectors; in the plane, areas are lengths."""

    corners: Floats  # (m, c, d) positions of corners; c is 3 for triangles, 2 for segments and 1 for points
    vectors: Floats  # (m, d) area times unit normal
    weights: Floats  # (m,) area; negative for those parts of a nonconvex polygon's fan that lie outside it
    components: Ints  # (m,) connected component of the shape, from 0
    spacing: float = 0.0  # mean distance between points of a cloud; simplices are sampled as densely as needed


@dataclass(frozen=True, eq=False)
class AreaSamples:
    """s samples of a source on a grid, area elements that are merged per cell and per connected component."""

    positions: Floats  # (s, d) mean position, from the grid's origin in units of its spacing
    vectors: Floats  # (s, d) sum of area times unit normal
    weights: Floats  # (s,) sum of areas
    components: Ints  # (s,) connected component of each sample
    source_ids: Ints  # (s,) source of each sample
    spacing: float  # the largest of the mean spacings of point clouds among the sources
    outside: float  # fraction of the area that lies outside the grid
    # fraction of the area in the grid whose normals cancel with others of the same cell and component: sheets thinner
    # than a cell, and faces given twice with opposite orientations
    cancelled: float
    nodes: NodeSources  # X₀ of Eq. 12, the vectors spread to the nodes by linear interpolation, up to a common factor

    def chosen(self, rows: Ints) -> AreaSamples:
        """Return the samples with the given indices; numbers that describe all samples together are not changed."""
        by_sample = ("positions", "vectors", "weights", "components", "source_ids")
        return replace(self, **{name: getattr(self, name)[rows] for name in by_sample})


@singledispatch
def area_elements(shape: Any) -> AreaElements:
    """Split a shape in space or in the plane into simplices with area vectors.

    Every type of shape registers a function of its own.
    """
    raise SourceError(
        f"distance in space is measured to a TriangleMesh, PolygonMesh or PointCloud with normals, in the plane to a "
        f"Polyline, not to a {type(shape).__name__}",
        remedy=what_to_pass(shape),
        element="source",
    )


@area_elements.register
def _(shape: TriangleMesh) -> AreaElements:
    corners = shape.vertices[shape.faces]
    components = components_of(shape.vertices, shape.faces)
    return AreaElements(corners, shape.face_area_vectors, shape.face_areas, components)


@area_elements.register
def _(shape: TetMesh) -> AreaElements:
    return area_elements(shape.boundary)


@area_elements.register
def _(shape: PolygonMesh) -> AreaElements:
    """Split polygons into fans of triangles around their centroids, whose area vectors sum to that of the polygon."""
    polygon = shape.corner_polygons
    fans = np.stack([shape.corners, shape.next_corners], axis=1)
    corners = np.concatenate([shape.polygon_centroids[polygon][:, None], shape.vertices[fans]], axis=1)
    vectors = area_vectors(corners)
    weights = np.einsum("ij,ij->i", vectors, unit(shape.polygon_area_vectors)[polygon])
    return AreaElements(corners, vectors, weights, components_of(shape.vertices, fans))


@area_elements.register
def _(shape: PointCloud) -> AreaElements:
    """Return one element for each point: its area times its normal."""
    if shape.normals is None:
        raise SourceError(
            "the point cloud has no normals, which are needed to tell inside from outside",
            remedy="give them, or estimate and orient them first",
        )
    areas = point_areas(shape.points) if shape.areas is None else shape.areas
    components = np.zeros(shape.n_points, dtype=np.int64)
    sides = shape.points.shape[1] - 1  # dimension of the boundary; that of an interval is points without a spacing
    spacing = float(np.mean(areas)) ** (1.0 / sides) if sides else 0.0
    return AreaElements(shape.points[:, None], areas[:, None] * shape.normals, areas, components, spacing)


def bounds_around(shapes: Sequence[Any]) -> Floats:
    """Return the (2, d) lower and upper corner of the box around shapes; raise an error for other objects."""
    for shape in shapes:
        if area_elements.dispatch(type(shape)) is area_elements.dispatch(object):
            area_elements(shape)  # which raises
    bounds = np.stack([shape.bounds for shape in shapes])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def point_areas(points: Floats) -> Floats:
    """Estimate the (n,) areas of the surface that (n, d) points represent.

    It is the area of the disk up to the k-th neighbour, divided by k. Coinciding points share it equally.
    """
    distinct, number, counts = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    dimension = points.shape[1] - 1
    k = min(POINT_NEIGHBORS, len(distinct) - 1)
    if dimension == 0 or k == 0:
        return np.ones(len(points)) / counts[number.ravel()]
    reach = PointTree(distinct).query(distinct, k=[k + 1])[0][:, 0]
    return (areas_per_point(reach, k, dimension) / counts)[number.ravel()]


def components_of(vertices: Floats, faces: Ints) -> Ints:
    """Return (m,) the connected component of each face; vertices at exactly the same position count as one."""
    return element_components(same_positions(vertices)[faces])


def sample_on_grid(shapes: Sequence[Any], grid: Grid) -> AreaSamples:
    """Return the samples of shapes on a grid.

    Area elements are bisected until no edge is longer than a cell, and merged per cell and connected component. Raises
    `SourceError` if nothing of the shapes lies in the grid, or all normals cancel.
    """
    steps = np.zeros(4)
    steps[4 - grid.dimension :] = grid.spacing
    nodes = NodeSources.empty(padded_shape(grid.shape), steps)
    scale = float(np.prod(grid.spacing)) ** ((grid.dimension - 1) / grid.dimension)
    parts, first, spacing = [], 0, 0.0
    total = inside = 0.0
    for owner, shape in enumerate(shapes):
        elements = area_elements(shape)
        if elements.corners.shape[2] != grid.dimension:
            raise SourceError(
                f"source {owner} lives in {elements.corners.shape[2]} dimensions, and the grid in {grid.dimension}",
                element=f"source {owner}",
            )
        corners = np.ascontiguousarray((elements.corners - grid.origin) / grid.spacing)
        simplices = corners, np.ascontiguousarray(elements.vectors), elements.weights, elements.components
        samples, nodes = merge_in_cells(simplices, np.array(grid.shape), 1.0, nodes, scale)
        positions, vectors, weights, components = samples
        total += float(elements.weights.sum())
        inside += float(weights.sum())
        spacing = max(spacing, elements.spacing)
        parts.append((positions, vectors, weights, components + first, np.full(len(weights), owner)))
        first += int(elements.components.max()) + 1
    positions, vectors, weights, components, owners = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    if total <= 0:
        raise SourceError("the source has no area: every face is degenerate", element="source")
    if not len(weights):
        raise SourceError(
            f"the grid from {grid.origin.tolist()} to {grid.upper.tolist()} misses the shape",
            remedy="move or enlarge it",
        )
    if not nodes.sums.any() and vectors.any():
        raise SourceError(
            f"the cells of the grid, of size {grid.spacing.tolist()}, are too large for the shape",
            element="source",
            remedy="choose a smaller spacing, or scale the shape",
        )
    left = float(np.linalg.norm(vectors, axis=1).sum() / weights.sum())
    if left < AREA_ROUNDING:
        raise CancellingNormalsError(
            "the normals of the source cancel each other everywhere, so that nothing separates inside from outside",
            remedy="remove or flip one of its coinciding sides",
        )
    outside = max(0.0, 1.0 - inside / total)
    cancelled = max(0.0, 1.0 - left)
    return AreaSamples(positions, vectors, weights, components, owners, spacing, outside, cancelled, nodes)


@area_elements.register
def _(shape: Polyline) -> AreaElements:
    tangents = shape.segments[:, 1] - shape.segments[:, 0]
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    return AreaElements(shape.segments, normals, shape.segment_lengths, np.zeros(len(tangents), dtype=np.int64))
