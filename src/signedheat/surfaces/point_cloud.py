"""Point clouds, as domains, and, with normals, as sources in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import GeometryError, InexactWarning, warn_user
from ..exchange import Elements, Exchangeable
from ..mesh.welding import same_rows
from ..validation import coordinates, finite_rows, frozen, numbers, whole_number
from .local_triangulations import LocalTriangulations, local_triangulations
from .outward_signs import outward_normals
from .plane_fits import MERGED, share_of_two_sides
from .surface import Surface
from .triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    import trimesh  # noqa: F401  named in the base class

CONTRARY = 0.35
"""Share of the given normals that may contradict the orientation of the points, unless all are inverted. It is .39 to
.49 where both sides of a plate are taken for one, and .3 where .3 of the normals are turned."""
SEAM = 0.35
"""Number of edges next to another side across which triangles face opposite ways, over the root of the number of
points, above which there is a warning. On scans, CAD and a box with up to .15 spacings of noise it is at most .07,
where parts of thin plates face the wrong way mostly .41 to .96."""
STEEP = 0.7
"""Cosine between a normal and the direction to a neighbour above which the neighbour lies on another side."""
_NEARBY = 13
"""Number of points near an edge that may lie on another side: about twice its own neighbourhood."""


@dataclass(frozen=True, eq=False)
class PointCloud(Exchangeable["trimesh.PointCloud"], Surface):
    """Points in space of any dimension, with or without normals and areas.

    Parameters
    ----------
    points : (n, d) float
        Positions.
    normals : (n, d) float, optional
        Directions pointing out of the shape; normalised here. A zero normal is an error.
    areas : (n,) float, optional
        Surface area that each point represents. If absent, estimated from neighbours when needed.
    n_neighbors : int
        Size of the neighbourhoods in which tangent planes are fitted and triangles made, when distance is measured on
        the cloud.

    Raises
    ------
    GeometryError
        If there are no points, a value is NaN or infinite, a normal is zero, an area is not positive, lengths
        differ, or neighbourhoods are smaller than 3.

    Notes
    -----
    As a domain, a cloud needs no normals, and its normals need not be consistent: they are oriented together, and
    triangles on the points with them, each connected component to the side to which most of the normals given point;
    without any outward, and upward for points in a plane. The left of a curve is as seen from that side, unless the
    curve has normals of its own. Points that coincide count once; points without a triangle, such as outliers, get NaN.

    Examples
    --------
    >>> cloud = PointCloud([[0, 0, 0], [1, 0, 0]], normals=[[0, 0, 2], [0, 0, 1]])
    >>> cloud.normals[0]
    array([0., 0., 1.])
    """

    points: Floats
    normals: Floats | None
    areas: Floats | None
    n_neighbors: int
    _has_faces = False

    def __init__(
        self, points: ArrayLike, normals: ArrayLike | None = None, areas: ArrayLike | None = None, n_neighbors: int = 30
    ) -> None:
        positions = coordinates(points, "points")
        if len(positions) == 0:
            raise GeometryError("there are no points: the point cloud is empty", element="points")
        directions = sizes = None
        if normals is not None:
            directions = finite_rows(normals, "normals", positions.shape[1])
            _same_length(directions, positions, "normals")
            lengths = np.abs(directions).max(axis=1)
            if not lengths.all():
                raise GeometryError(
                    f"the normal of point {int(np.argmin(lengths))} is zero",
                    remedy="remove it or estimate it",
                    element=f"point {int(np.argmin(lengths))}",
                )
            directions = directions / lengths[:, None]
            directions = frozen(directions / np.linalg.norm(directions, axis=1)[:, None])
        if areas is not None:
            sizes = numbers(areas, "areas")
            if sizes.ndim == 1:
                _same_length(sizes, positions, "areas")
            if sizes.ndim != 1 or not (np.isfinite(sizes) & (sizes > 0)).all():
                raise GeometryError("areas must be one positive, finite number per point", element="areas")
            sizes = frozen(sizes)
        if whole_number(n_neighbors, "n_neighbors", 0) < 3:
            raise GeometryError(f"neighbourhoods need at least 3 points, not {n_neighbors}", element="n_neighbors")
        vars(self).update(points=positions, normals=directions, areas=sizes, n_neighbors=int(n_neighbors))

    @classmethod
    def _of(cls, elements: Elements) -> PointCloud:
        return cls(elements.points, elements.normals, elements.areas)

    @property
    def _elements(self) -> Elements:
        return Elements(self.points, normals=self.normals, areas=self.areas)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def bounds(self) -> Floats:
        """(2, d) lower and upper corner of the box around the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def representatives(self) -> Ints:
        """(n,) first point that coincides with each point, within a ten-millionth of the size of the cloud."""
        lower, upper = self.bounds
        cell = 1e-7 * max(float((upper - lower).max()), np.finfo(float).tiny)
        cells = np.rint((self.points - lower) / cell)
        return frozen(same_rows(cells.astype(np.int64)))

    @cached_property
    def _distinct(self) -> tuple[Ints, LocalTriangulations]:
        """Ids of the distinct points, sorted by coordinates, and their local triangulations."""
        if self.points.shape[1] != 3:
            raise GeometryError(
                f"distance is measured on point clouds in space: points need 3 coordinates, not {self.points.shape[1]}",
                element="points",
            )
        ids = np.unique(self.representatives)
        ids = ids[np.lexsort(self.points[ids].T)]  # so that the order in which points are given decides nothing
        points, given = self.points[ids], None if self.normals is None else self.normals[ids]
        if len(ids) < 3:
            raise GeometryError(
                f"the point cloud has {len(ids)} distinct points, and a surface needs at least 3", element="points"
            )
        normals, _, _ = outward_normals(points, given)
        found = local_triangulations(points, normals, self.n_neighbors, given)
        if len(found.faces) == 0:
            raise GeometryError(
                "no triangles could be made of the point cloud: its points lie along a line or too far apart",
                remedy="add points, or raise n_neighbors",
                element="points",
            )
        against = 0.0 if given is None else float(((normals * given).sum(axis=1) < 0).mean())
        if min(against, 1 - against) > CONTRARY:
            warn_user(
                f"{against:.0%} of the normals contradict the sides that the points show, as on plates "
                "thinner than half of the distance between points",
                InexactWarning,
            )
        elif share_of_two_sides(points, found.normals) > MERGED:
            warn_user(
                "the points look like those of both sides of a plate thinner than they are apart, which are taken for "
                "one side with noise. Give normals, or more points",
                InexactWarning,
            )
        elif (turned := edges_turned(points, found.normals, found.faces)) > SEAM * np.sqrt(len(ids)):
            warn_user(
                f"along {turned} edges the sides of neighbours contradict each other: which side is which is a guess "
                "there. Give normals, or more points",
                InexactWarning,
            )
        return ids, found

    @cached_property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to; of points that coincide, the first is the vertex."""
        ids, found = self._distinct
        return TriangleMesh(self.points, ids[found.faces])

    @cached_property
    def surface_normals(self) -> Floats:
        """(n, 3) unit normals, estimated from neighbours, on the side from which `triangulation` is oriented."""
        ids, found = self._distinct
        normals = np.empty_like(self.points)
        normals[ids] = found.normals
        return frozen(normals[self.representatives])

    def _triangulation_vertices(self, vertices: Ints) -> Ints:
        exists = (vertices >= 0) & (vertices < self.n_points)
        return np.where(exists, self.representatives[np.where(exists, vertices, 0)], vertices)

    def __repr__(self) -> str:
        return f"PointCloud({self.n_points} points, {'with' if self.normals is not None else 'without'} normals)"


def edges_turned(points: Floats, normals: Floats, faces: Ints) -> int:
    """Count edges next to another side across which triangles face opposite ways.

    Surfaces with one side have such edges, too, but no other side is near.
    """
    halfedges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, uses = np.unique(halfedges, axis=0, return_counts=True)
    twice = edges[uses > 1]
    near = scipy.spatial.cKDTree(points).query(points[twice], k=min(_NEARBY, len(points)))[1]
    offsets = points[near] - points[twice][:, :, None]
    over = np.abs((offsets * normals[twice][:, :, None]).sum(axis=3)) > STEEP * np.linalg.norm(offsets, axis=3)
    return int(over.any(axis=(1, 2)).sum())


def _same_length(values: Floats, points: Floats, name: str) -> None:
    if len(values) != len(points):
        raise GeometryError(f"there are {len(points)} points, but {len(values)} {name}", element=name)
