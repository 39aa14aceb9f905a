"""Curves and isolated points on a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..domains.validation import finite_rows, frozen
from ..errors import SourceError


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve on a surface, from point to point; φ > 0 to its left if it is oriented.

    Parameters
    ----------
    faces : (n,) int
        Face that each point lies in; any face that has the point will do.
    barycentric : (n, 3) float
        Where in that face.
    closed : bool
        Whether the last point is joined to the first.
    oriented : bool
        Whether the curve has two sides; an unoriented curve has distance like |φ|.
    normals : (segments, 3) float, optional
        Direction in space in which φ grows across each segment. Needed where left has no meaning.
    """

    faces: NDArray[np.int64]
    barycentric: NDArray[np.float64]
    closed: bool = False
    oriented: bool = True
    normals: NDArray[np.float64] | None = None

    def __init__(
        self,
        faces: ArrayLike,
        barycentric: ArrayLike,
        closed: bool = False,
        oriented: bool = True,
        normals: ArrayLike | None = None,
    ) -> None:
        ids, weights = np.asarray(faces), finite_rows(barycentric, "barycentric coordinates", 3)
        if ids.ndim != 1 or len(ids) != len(weights) or not np.issubdtype(ids.dtype, np.integer):
            raise SourceError(f"a curve needs one integer face id per point: {ids.shape} for {len(weights)} points")
        object.__setattr__(self, "faces", frozen(ids.astype(np.int64)))
        object.__setattr__(self, "barycentric", weights)
        object.__setattr__(self, "closed", bool(closed))
        object.__setattr__(self, "oriented", bool(oriented))
        object.__setattr__(self, "normals", None if normals is None else finite_rows(normals, "curve normals", 3))

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.faces)

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return self.n_points if self.closed else self.n_points - 1


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Isolated points on a surface; φ grows away from each.

    Parameters
    ----------
    faces : (n,) int
        Face that each point lies in; any face that has the point will do.
    barycentric : (n, 3) float
        Where in that face.
    """

    faces: NDArray[np.int64]
    barycentric: NDArray[np.float64]

    def __init__(self, faces: ArrayLike, barycentric: ArrayLike) -> None:
        ids, weights = np.asarray(faces), finite_rows(barycentric, "barycentric coordinates", 3)
        if ids.ndim != 1 or len(ids) != len(weights) or not np.issubdtype(ids.dtype, np.integer):
            raise SourceError(f"points need one integer face id each: {ids.shape} for {len(weights)} points")
        object.__setattr__(self, "faces", frozen(ids.astype(np.int64)))
        object.__setattr__(self, "barycentric", weights)
