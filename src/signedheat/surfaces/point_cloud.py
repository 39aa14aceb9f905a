"""Point clouds, as domains, and, with normals, as sources in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import GeometryError, InexactWarning, counted, percent, warn_user
from ..mesh.unit_vectors import SAME_WAY
from ..mesh.welding import same_rows
from ..parallel import PointTree
from ..shapes.exchange import Elements, Exchangeable
from ..validation import coordinates, finite_rows, frozen, numbers, whole_number
from .local_triangulations import LocalTriangulations, local_triangulations
from .normal_orientation import neighbors_agree, outward_normals
from .plane_fits import (
    CLEAN_NEIGHBORS,
    MERGED_SHARE,
    share_of_two_sides,
)
from .surface import Surface
from .triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    import trimesh  # noqa: F401  named in the base class

COINCIDING = 1e-7
"""Points coincide if they round to the same multiples of this share of the size of the cloud. From 5e-8 to 1e-5 no
volume of two clouds, each also given twice, 1e-13 or 1e-9 apart, changes by more than 1e-4."""
CONTRARY_NORMALS = 0.35
"""If a larger share of the given normals, and of their inverses, contradicts the orientation of the points, there is a
warning. It is 0.39 to 0.49 if both sides of a plate are merged, and 0.3 if 0.3 of the normals are flipped."""
BAD_SEAM = 0.35
"""There is a warning if the number of edges next to another side across which triangles face opposite ways, relative to
the root of the number of points, exceeds this. On scans, CAD and a box with up to 0.15 spacings of noise it is at most
0.07, where parts of thin plates face the wrong way mostly 0.41 to 0.96."""


@dataclass(frozen=True, eq=False)
class PointCloud(Exchangeable["trimesh.PointCloud"], Surface):
    """Points in space of any dimension, with or without normals and areas.

    Parameters
    ----------
    points : (n, d) float
        Positions.
    normals : (n, d) float, optional
        Directions pointing out of the shape, of any length but 0; they are scaled to length 1. By default the cloud
        has none, and `complete` fits them.
    areas : (n,) float, optional
        Surface area that each point represents, in square units. If absent, estimated from neighbours when needed.
    n_neighbors : int
        Number of nearest points to which tangent planes are fitted and with which triangles are made, when distance is
        measured on the cloud; 30 by default.

    Raises
    ------
    GeometryError
        If there are no points, a value is NaN or infinite, a normal is zero, an area is not positive, lengths
        differ, or neighbourhoods are smaller than 3.

    See Also
    --------
    TriangleMesh : Triangles in space.
    as_shape : Convert objects of other packages.
    complete : Make a solid of a broken shape.

    Notes
    -----
    As a domain, a cloud needs no normals, and its normals need not be consistent. Normals and triangles are oriented
    together, each connected component to the side to which most of its given normals point. Without given normals they
    are oriented outwards, or upwards if points lie in a plane. The left of a curve is as seen from that side, unless
    the curve has normals of its own. Points that coincide count once. Points without a triangle, such as outliers, get
    NaN.

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
                zero = f"point {np.argmin(lengths)}"
                raise GeometryError(f"the normal of {zero} is zero", remedy="remove it or estimate it", element=zero)
            directions = directions / lengths[:, None]
            directions = frozen(directions / np.linalg.norm(directions, axis=1)[:, None])
        if areas is not None:
            sizes = numbers(areas, "areas")
            if sizes.ndim == 1:
                _same_length(sizes, positions, "areas")
            if sizes.ndim != 1 or not (np.isfinite(sizes) & (sizes > 0)).all():
                raise GeometryError("areas must be one positive, finite number per point", element="areas")
            sizes = frozen(sizes)
        neighbors = whole_number(n_neighbors, "n_neighbors", 3)
        vars(self).update(points=positions, normals=directions, areas=sizes, n_neighbors=neighbors)

    @classmethod
    def _of(cls, elements: Elements) -> PointCloud:
        """Make a cloud of the points of a converted shape."""
        return cls(elements.points, elements.normals, elements.areas)

    @property
    def _elements(self) -> Elements:
        """The points, normals and areas in the form that files and other packages need."""
        if self.points.shape[1] != 3:
            raise GeometryError(
                f"files and other packages hold points in space, and these have {self.points.shape[1]} coordinates",
                remedy="add z = 0",
                element="points",
            )
        return Elements(self.points, normals=self.normals, areas=self.areas)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def n_vertices(self) -> int:
        """Number of points, each of which has a value of a field."""
        return len(self.points)

    @property
    def bounds(self) -> Floats:
        """(2, d) lower and upper corner of the box around the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def representatives(self) -> Ints:
        """(n,) id of the first point that coincides with each, within `COINCIDING` of the size of the cloud.

        The size is the largest interquartile range of coordinates, since strays may be anywhere.
        """
        lower, upper = np.quantile(self.points, [0.25, 0.75], axis=0)
        size = float((upper - lower).max()) or float(np.ptp(self.points, axis=0).max())
        cell = COINCIDING * max(size, np.finfo(float).tiny)
        cells = np.rint((self.points - lower) / cell).clip(-(2.0**62), 2.0**62)
        return frozen(same_rows(cells.astype(np.int64)))

    @cached_property
    def _distinct(self) -> tuple[Ints, LocalTriangulations]:
        """(k,) ids of the distinct points, sorted by coordinates, and their local triangulations.

        Warn if normals or sides are uncertain; raise `GeometryError` if no triangle can be made.
        """
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
        normals = given if given is not None and neighbors_agree(points, given) else outward_normals(points, given)[0]
        triangulated = local_triangulations(points, normals, self.n_neighbors, given)
        if len(triangulated.faces) == 0:
            raise GeometryError(
                "no triangles could be made of the point cloud: its points lie along a line or too far apart",
                remedy="add points, or raise n_neighbors",
                element="points",
            )
        against = 0.0 if given is None else float(((normals * given).sum(axis=1) < 0).mean())
        if min(against, 1 - against) > CONTRARY_NORMALS:
            warn_user(
                f"{percent(against)} of the normals contradict the sides that the points show, as on plates "
                "thinner than half of the distance between points",
                InexactWarning,
            )
        elif share_of_two_sides(points, triangulated.normals) > MERGED_SHARE:
            warn_user(
                "the points look like both sides of a plate thinner than their spacing, which count as "
                "one side with noise. Give normals, or more points",
                InexactWarning,
            )
        elif (turned := edges_turned(points, triangulated.normals, triangulated.faces)) > BAD_SEAM * np.sqrt(len(ids)):
            warn_user(
                f"along {turned} edges the sides of neighbours contradict each other: which side is which is a guess "
                "there. Give normals, or more points",
                InexactWarning,
            )
        return ids, triangulated

    @cached_property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to; of points that coincide, only the first is a vertex of triangles."""
        ids, triangulated = self._distinct
        return TriangleMesh(self.points, ids[triangulated.faces])

    @cached_property
    def surface_normals(self) -> Floats:
        """(n, 3) unit normals, estimated from neighbours, on the side to which the faces of `triangulation` point."""
        ids, triangulated = self._distinct
        normals = np.empty_like(self.points)
        normals[ids] = triangulated.normals
        return frozen(normals[self.representatives])

    def _triangulation_vertices(self, vertices: Ints) -> Ints:
        """(n,) first coinciding points of (n,) points, which are vertices of triangles; ids that do not exist stay."""
        exists = (vertices >= 0) & (vertices < self.n_points)
        return np.where(exists, self.representatives[np.where(exists, vertices, 0)], vertices)

    def __repr__(self) -> str:
        normals = "without normals" if self.normals is None else "with normals"
        return f"PointCloud({counted(self.n_points, 'point')}, {normals})"


def edges_turned(points: Floats, normals: Floats, faces: Ints) -> int:
    """Return the number of edges across which triangles face opposite ways, and near which there is another side.

    Points and unit normals are (n, 3), faces (m, 3).
    """
    halfedges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, uses = np.unique(halfedges, axis=0, return_counts=True)
    twice = edges[uses > 1]
    near = PointTree(points).query(points[twice], k=min(1 + CLEAN_NEIGHBORS, len(points)))[1]
    offsets = points[near] - points[twice][:, :, None]
    # a neighbour straight above or below lies on another side
    over = np.abs((offsets * normals[twice][:, :, None]).sum(axis=3)) > SAME_WAY * np.linalg.norm(offsets, axis=3)
    return int(over.any(axis=(1, 2)).sum())


def _same_length(values: Floats, points: Floats, name: str) -> None:
    """Raise `GeometryError` unless there is one value for each point."""
    if len(values) != len(points):
        raise GeometryError(f"there are {counted(len(points), 'point')}, but {len(values)} {name}", element=name)
