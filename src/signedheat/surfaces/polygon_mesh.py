"""Polygon meshes: faces with any number of corners, which may be nonconvex and mildly nonplanar."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError
from ..exchange import Elements, Exchangeable
from ..validation import array_of, coordinates, frozen, used_bounds, whole_numbers
from .surface import Surface, check_mask
from .triangle_mesh import TriangleMesh
from .virtual_refinement import VirtualRefinement, virtual_refinement

Polygons = Sequence[Sequence[int] | NDArray[np.int64]] | NDArray[np.int64]
"""Vertex ids of each polygon."""


@dataclass(frozen=True, eq=False)
class PolygonMesh(Exchangeable[NoReturn], Surface):
    """Polygons in space.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions.
    polygons : sequence of sequences of int
        Vertex ids of each polygon, three or more, counter-clockwise seen from where its normal points to.

    Raises
    ------
    GeometryError
        If there is no polygon, one has fewer than three corners or names a vertex that does not exist,
        or a coordinate is NaN or infinite.

    Examples
    --------
    >>> mesh = PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> mesh.polygon_area_vectors
    array([[0., 0., 1.]])
    """

    vertices: NDArray[np.float64]
    corners: NDArray[np.int64]
    offsets: NDArray[np.int64]

    def __init__(self, vertices: ArrayLike, polygons: Polygons) -> None:
        positions = coordinates(vertices, "vertices", 3)
        if isinstance(polygons, np.ndarray):
            polygons = array_of(polygons, "polygons")
        try:
            counts = np.fromiter((len(p) for p in polygons), dtype=np.int64, count=len(polygons))
        except TypeError:
            raise GeometryError(
                "polygons must be a sequence with a sequence of vertex ids for each", element="polygons"
            ) from None
        if len(counts) == 0:
            raise GeometryError("there are no polygons: the shape is empty", element="polygons")
        if (counts < 3).any():
            first = int(np.argmax(counts < 3))
            raise GeometryError(
                f"polygon {first} has {counts[first]} corners, and needs at least 3",
                element=f"polygon {first}",
            )
        corners = whole_numbers(list(itertools.chain.from_iterable(polygons)), "polygons")
        if corners.ndim != 1:
            raise GeometryError(
                f"polygons must hold vertex ids, not arrays of shape {corners.shape[1:]}", element="polygons"
            )
        offsets = np.concatenate([[0], np.cumsum(counts)])
        outside = np.flatnonzero((corners < 0) | (corners >= len(positions)))
        if len(outside):
            first = int(np.searchsorted(offsets, outside[0], side="right") - 1)
            raise GeometryError(
                f"polygon {first} names vertex {corners[outside[0]]}, but vertex ids go from 0 to {len(positions) - 1}",
                element=f"polygon {first}",
            )
        vars(self).update(vertices=positions, corners=frozen(corners), offsets=frozen(offsets))

    @classmethod
    def _of(cls, elements: Elements) -> PolygonMesh:
        return cls(elements.points, elements.faces)

    @property
    def _elements(self) -> Elements:
        return Elements(self.vertices, self.corners, np.diff(self.offsets))

    @property
    def n_vertices(self) -> int:
        """Number of vertices, used by a polygon or not."""
        return len(self.vertices)

    @property
    def n_polygons(self) -> int:
        """Number of polygons."""
        return len(self.offsets) - 1

    @property
    def polygons(self) -> list[NDArray[np.int64]]:
        """Vertex ids of each polygon."""
        return np.split(self.corners, self.offsets[1:-1])

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lower and upper corner of the bounding box of the polygons, without unreferenced vertices."""
        return used_bounds(self.vertices, self.corners)

    @cached_property
    def corner_polygons(self) -> NDArray[np.int64]:
        """Polygon of each entry of `corners`."""
        return np.repeat(np.arange(self.n_polygons), np.diff(self.offsets))

    @cached_property
    def next_corners(self) -> NDArray[np.int64]:
        """Vertex that follows each entry of `corners` around its polygon."""
        following = np.roll(self.corners, -1)
        following[self.offsets[1:] - 1] = self.corners[self.offsets[:-1]]
        return following

    @cached_property
    def polygon_centroids(self) -> NDArray[np.float64]:
        """(p, 3) mean of each polygon's corners."""
        sums = np.add.reduceat(self.vertices[self.corners], self.offsets[:-1], axis=0)
        return sums / np.diff(self.offsets)[:, None]

    @cached_property
    def polygon_area_vectors(self) -> NDArray[np.float64]:
        """(p, 3) vector areas, which depend on the boundary of the polygon only, planar or not."""
        center = self.polygon_centroids[self.corner_polygons]
        a, b = self.vertices[self.corners] - center, self.vertices[self.next_corners] - center
        return 0.5 * np.add.reduceat(np.cross(a, b), self.offsets[:-1], axis=0)

    @cached_property
    def refinement(self) -> VirtualRefinement:
        """The polygons as triangles, usually by a virtual vertex in each polygon with more than three corners."""
        return virtual_refinement(self.vertices, self.corners, self.offsets)

    @cached_property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to, polygon after polygon; virtual vertices follow those of the mesh."""
        refinement = self.refinement
        return TriangleMesh(np.concatenate([self.vertices, refinement.virtual_vertices]), refinement.faces)

    def on_triangulation(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the vertices of `triangulation`, from values at the vertices of the mesh.

        Parameters
        ----------
        values : (n,) float
            One for each vertex.

        Returns
        -------
        (m,) float
            One for each vertex of the triangulation.

        Examples
        --------
        >>> square = PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
        >>> square.on_triangulation(np.array([0.0, 1.0, 1.0, 0.0])).max().item()
        1.0
        """
        return self.refinement.prolongation @ values

    def _triangle_mask(self, face_mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        check_mask(face_mask, self.n_polygons)
        return face_mask[self.refinement.face_polygons]

    def __repr__(self) -> str:
        return f"PolygonMesh({self.n_vertices} vertices, {self.n_polygons} polygons)"
