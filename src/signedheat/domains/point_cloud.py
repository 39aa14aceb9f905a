"""Point clouds: as a domain, and, with normals, as a shape in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError
from .exchange import Exchangeable
from .validation import finite_rows, frozen


@dataclass(frozen=True, eq=False)
class PointCloud(Exchangeable):
    """Points in space of any dimension, with or without normals and areas.

    Parameters
    ----------
    points : (n, d) float
        Positions.
    normals : (n, d) float, optional
        Directions pointing out of the shape; normalised here. A zero normal is an error.
    areas : (n,) float, optional
        Surface area that each point stands for. Estimated from neighbours where needed and absent.

    Raises
    ------
    GeometryError
        If there are no points, a value is NaN or infinite, a normal is zero, an area is not positive, or
        lengths differ.

    Examples
    --------
    >>> cloud = PointCloud([[0, 0, 0], [1, 0, 0]], normals=[[0, 0, 2], [0, 0, 1]])
    >>> cloud.normals[0]
    array([0., 0., 1.])
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    areas: NDArray[np.float64] | None

    def __init__(self, points: ArrayLike, normals: ArrayLike | None = None, areas: ArrayLike | None = None) -> None:
        positions = finite_rows(points, "points")
        if len(positions) == 0:
            raise GeometryError("there are no points: the point cloud is empty")
        directions = sizes = None
        if normals is not None:
            directions = finite_rows(normals, "normals", positions.shape[1])
            _same_length(directions, positions, "normals")
            lengths = np.abs(directions).max(axis=1)
            if not lengths.all():
                raise GeometryError(f"the normal of point {int(np.argmin(lengths))} is zero: remove it or estimate it")
            directions = directions / lengths[:, None]
            directions = frozen(directions / np.linalg.norm(directions, axis=1)[:, None])
        if areas is not None:
            sizes = np.array(areas, dtype=np.float64)
            _same_length(sizes, positions, "areas")
            if sizes.ndim != 1 or not (np.isfinite(sizes) & (sizes > 0)).all():
                raise GeometryError("areas must be one positive, finite number per point")
            sizes = frozen(sizes)
        object.__setattr__(self, "points", positions)
        object.__setattr__(self, "normals", directions)
        object.__setattr__(self, "areas", sizes)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, d) lower and upper corner of the box around the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    def __repr__(self) -> str:
        return f"PointCloud({self.n_points} points, {'with' if self.normals is not None else 'without'} normals)"


def _same_length(values: NDArray, points: NDArray, name: str) -> None:
    if len(values) != len(points):
        raise GeometryError(f"there are {len(points)} points, but {len(values)} {name}")
