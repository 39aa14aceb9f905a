"""Polygon meshes: faces with any number of corners, which may be nonconvex and mildly nonplanar.

Polygons are divided into fans of triangles around an added *virtual* vertex (Bunge, Herholz, Kazhdan & Botsch 2020). It
minimises the sum of the squared areas of these triangles. It is an affine combination of the corners, so that functions
on the corners can be extended to it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import Bools, Floats, Ints, mask_of
from ..errors import GeometryError, counted
from ..mesh.components import next_in_groups, sums_of
from ..mesh.planar_triangulation import triangulate_polygon
from ..mesh.triangles import area_vectors
from ..mesh.unit_vectors import axes_across
from ..shapes.exchange import Elements, Exchangeable
from ..validation import array_of, coordinates, from_zero, frozen, used_bounds, whole_numbers
from .surface import Surface, check_mask
from .triangle_mesh import TriangleMesh

Polygons = Sequence[Sequence[int] | Ints] | Ints
"""Vertex ids of each polygon."""


@dataclass(frozen=True, eq=False)
class PolygonMesh(Exchangeable[NoReturn], Surface):
    """Polygons in space.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions.
    polygons : sequence of sequences of int
        Vertex ids of each polygon, three or more, counter-clockwise as seen from the side to which its normal points.

    Raises
    ------
    GeometryError
        If there is no polygon, one has fewer than three corners or names a vertex that does not exist,
        or a coordinate is NaN or infinite.

    See Also
    --------
    TriangleMesh : Triangles in space.
    as_shape : Convert objects of other packages.
    complete : Make a solid of a broken shape.

    Examples
    --------
    >>> mesh = PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> mesh.polygon_area_vectors
    array([[0., 0., 1.]])
    """

    vertices: Floats
    corners: Ints
    offsets: Ints

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
                f"polygon {first} has {counts[first]} corners, and needs at least 3", element=f"polygon {first}"
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
                remedy=from_zero(corners, len(positions), "polygons"),
                element=f"polygon {first}",
            )
        vars(self).update(vertices=positions, corners=frozen(corners), offsets=frozen(offsets))

    @classmethod
    def _of(cls, elements: Elements) -> PolygonMesh:
        """Make a mesh of the points and polygons of a converted shape."""
        return cls(elements.points, elements.faces)

    @property
    def _elements(self) -> Elements:
        """The vertices and polygons in the form that files and other packages need."""
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
    def polygons(self) -> list[Ints]:
        """List of the (k,) vertex ids of each polygon."""
        return np.split(self.corners, self.offsets[1:-1])

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lower and upper corner of the bounding box of the polygons, without unreferenced vertices."""
        return used_bounds(self.vertices, self.corners)

    @property
    def area(self) -> float:
        """Area of all polygons, in square units."""
        return self.triangulation.area

    @property
    def volume(self) -> float:
        """Volume inside a watertight mesh, in cubic units, negative if it faces inwards: see `TriangleMesh.volume`."""
        return self.triangulation.volume

    @property
    def is_watertight(self) -> bool:
        """Whether each edge has exactly two polygons, in opposite directions: see `TriangleMesh.is_watertight`."""
        return self.triangulation.is_watertight

    @cached_property
    def corner_polygons(self) -> Ints:
        """(c,) polygon of each entry of `corners`."""
        return np.repeat(np.arange(self.n_polygons), np.diff(self.offsets))

    @cached_property
    def next_corners(self) -> Ints:
        """(c,) vertex that follows each entry of `corners` around its polygon."""
        return self.corners[next_in_groups(self.offsets)]

    @cached_property
    def polygon_centroids(self) -> Floats:
        """(p, 3) mean of each polygon's corners."""
        sums = np.add.reduceat(self.vertices[self.corners], self.offsets[:-1], axis=0)
        return sums / np.diff(self.offsets)[:, None]

    @cached_property
    def polygon_area_vectors(self) -> Floats:
        """(p, 3) area times mean normal, in square units, which depends on the boundary of a polygon only."""
        center = self.polygon_centroids[self.corner_polygons]
        a, b = self.vertices[self.corners] - center, self.vertices[self.next_corners] - center
        return 0.5 * np.add.reduceat(np.cross(a, b), self.offsets[:-1], axis=0)

    @cached_property
    def refinement(self) -> VirtualRefinement:
        """The triangles of the polygons, usually around a virtual vertex in those with more than three corners."""
        return virtual_refinement(self.vertices, self.corners, self.offsets)

    @cached_property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to, polygon after polygon; virtual vertices follow those of the mesh."""
        refinement = self.refinement
        return TriangleMesh(np.concatenate([self.vertices, refinement.virtual_vertices]), refinement.faces)

    def on_triangulation(self, values: Floats) -> Floats:
        return self.refinement.prolongation @ values

    def _triangle_mask(self, face_mask: Bools) -> Bools:
        """Convert a mask of the polygons to one of their triangles; raise if it does not fit."""
        check_mask(face_mask, self.n_polygons)
        return face_mask[self.refinement.face_polygons]

    def __repr__(self) -> str:
        return f"PolygonMesh({counted(self.n_vertices, 'vertex')}, {counted(self.n_polygons, 'polygon')})"


TWICE_APART = 1e-9
"""While diagonals are found, corners that a polygon passes twice are moved inwards by this, relative to its size."""
_SLIVER = 1e-6  # a fan triangle is flipped over if its area is less than this fraction of its polygon's


@dataclass(frozen=True, eq=False)
class VirtualRefinement:
    """Triangles that subdivide polygons."""

    faces: Ints  # (m, 3) vertex ids, polygon after polygon and side after side; virtual vertices follow the given ones
    face_polygons: Ints  # (m,) polygon that each triangle is part of
    virtual_vertices: Floats  # (q, 3) positions
    prolongation: sparse.csr_matrix  # (n + q, n) P: values at the given vertices, then affine combinations of them


def virtual_refinement(vertices: Floats, corners: Ints, offsets: Ints) -> VirtualRefinement:
    """Subdivide polygons into fans, or by diagonals where fan triangles would be flipped over.

    `corners`, (c,), are their vertex ids, polygon by polygon; polygon k begins at ``offsets[k]``. Corners that repeat
    the one before are left out, and polygons of three stay as they are.
    """
    before = np.roll(corners, 1)
    before[offsets[:-1]] = corners[offsets[1:] - 1]
    differs = corners != before
    corners, polygons = corners[differs], np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))[differs]
    counts = np.bincount(polygons, minlength=len(offsets) - 1)
    begin = np.cumsum(counts) - counts
    following = next_in_groups(np.append(begin, len(corners)))

    in_fan = counts[polygons] > 3
    fans, fan_of = np.unique(polygons[in_fan], return_inverse=True)
    tails, heads = corners[in_fan], corners[following[in_fan]]
    centers, weights = virtual_vertices(vertices, tails, heads, fan_of, len(fans))

    areas = area_vectors(np.stack([vertices[tails], vertices[heads], centers[fan_of]], axis=1))
    total = sums_of(areas, fan_of, len(fans))
    projected = (areas * total[fan_of]).sum(axis=1)  # on the area vector of the polygon
    flipped_fans = mask_of(len(fans), fan_of[projected < _SLIVER * (total * total).sum(axis=1)[fan_of]])
    # what passes a corner twice goes round a hole, which a fan would fill
    order = np.lexsort((tails, fan_of))
    again = (np.diff(tails[order]) == 0) & (np.diff(fan_of[order]) == 0)
    flipped_fans |= mask_of(len(fans), fan_of[order][1:][again])
    cuts = {k: _cut(vertices[corners[polygons == fans[k]]]) for k in np.flatnonzero(flipped_fans)}
    cuts = {k: triangles for k, triangles in cuts.items() if len(triangles)}
    kept = np.ones(len(fans), dtype=bool)
    kept[list(cuts)] = False

    number = np.cumsum(kept) - 1
    fan_of_kept = kept[fan_of]
    faces = [
        corners[begin[counts == 3][:, None] + np.arange(3)],
        np.stack([tails, heads, len(vertices) + number[fan_of]], axis=1)[fan_of_kept],
        *(corners[begin[fans[k]] + triangles] for k, triangles in cuts.items()),
    ]
    owners = [
        np.flatnonzero(counts == 3),
        fans[fan_of[fan_of_kept]],
        *(np.full(len(triangles), fans[k]) for k, triangles in cuts.items()),
    ]
    order = np.argsort(np.concatenate(owners), kind="stable")
    rows, n = number[fan_of[fan_of_kept]], len(vertices)
    average = sparse.csr_matrix((weights[fan_of_kept], (rows, tails[fan_of_kept])), shape=(int(kept.sum()), n))
    return VirtualRefinement(
        np.concatenate(faces)[order],
        np.concatenate(owners)[order],
        centers[kept],
        sparse.vstack([sparse.identity(n, format="csr"), average], format="csr"),
    )


def virtual_vertices(
    vertices: Floats, tails: Ints, heads: Ints, polygons: Ints, n_polygons: int
) -> tuple[Floats, Floats]:
    """Find the (n_polygons, 3) points that minimise Σ |fan triangle|², and the (k,) affine weights of corners for them.

    Sides of polygons have (k,) tails, heads and polygons; a weight is that of the tail. Of all weights, those of least
    norm are chosen. Twice the area vector of side ``a → b`` and apex x is ``a × b + (b − a) × x``, which gives three
    equations for each polygon.
    """
    count = np.bincount(polygons, minlength=n_polygons)
    mean = sums_of(vertices[tails], polygons, n_polygons) / count[:, None]
    a, b = vertices[tails] - mean[polygons], vertices[heads] - mean[polygons]
    side = b - a
    normal_matrix = sums_of(
        (side * side).sum(axis=1)[:, None, None] * np.eye(3) - side[:, :, None] * side[:, None, :], polygons, n_polygons
    )
    load = sums_of(np.cross(side, np.cross(a, b)), polygons, n_polygons)
    offset = _solve_symmetric(normal_matrix, load)
    spread = sums_of(a[:, :, None] * a[:, None, :], polygons, n_polygons)
    slope = _solve_symmetric(spread, offset)
    weights = 1.0 / count[polygons] + (a * slope[polygons]).sum(axis=1)
    return mean + sums_of(weights[:, None] * a, polygons, n_polygons), weights


def _cut(polygon: Floats) -> Ints:
    """(k − 2, 3) triangles into which diagonals cut a polygon of (k, 3) corners, or (0, 3) if it cannot be cut.

    It may pass an edge in both directions.
    """
    around = polygon - polygon.mean(axis=0)
    normal = np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
    if not normal.any():
        return np.empty((0, 3), dtype=np.int64)
    plane = (around @ np.concatenate(axes_across(normal[None])).T) @ [1, 1j]
    _, position_ids, copies = np.unique(plane, return_inverse=True, return_counts=True)
    twice, directions = copies[position_ids] > 1, np.roll(plane, -1) - plane
    directions /= np.maximum(np.abs(directions), 1e-300)
    inwards = 1j * (directions + np.roll(directions, 1))[twice]  # along bisectors
    plane[twice] += TWICE_APART * np.abs(plane).max() * inwards / np.maximum(np.abs(inwards), 1e-300)
    triangles = triangulate_polygon(np.stack([plane.real, plane.imag], axis=1), len(plane))
    return np.empty((0, 3), dtype=np.int64) if triangles is None else np.sort(triangles, axis=1)


def _solve_symmetric(matrices: Floats, loads: Floats) -> Floats:
    """(p, 3) nearly minimum-norm solutions of (p, 3, 3) semidefinite systems with (p, 3) right-hand sides.

    The systems of flat polygons are singular along their normals.
    """
    size = np.trace(matrices, axis1=1, axis2=2)
    damped = matrices + (1e-11 * np.where(size > 0, size, 1))[:, None, None] * np.eye(3)
    return np.linalg.solve(damped, loads[..., None])[..., 0].astype(np.float64, copy=False)
