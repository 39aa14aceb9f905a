"""Curves and isolated points on a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen, Ints
from ..errors import SourceError, counted
from ..validation import array_of, finite_rows, flag, frozen, whole_numbers


@dataclass(frozen=True, eq=False)
class Curve(Frozen):
    """A polyline on a surface. If it is oriented, φ, the signed distance to it, is positive to its left.

    Left is the direction of the curve rotated by 90° counter-clockwise, as seen with the face normal towards you. For a
    segment along an edge it is left in the first face at that edge. Where faces are not consistently oriented, left is
    what it is along most of the curve. Points on an edge or at a vertex are recognised as such, whichever face they are
    given in (barycentric coordinates below 1e-9 count as zero). Consecutive points that share no face are joined by a
    geodesic path. Consecutive points may coincide.

    Parameters
    ----------
    faces : (n,) int
        Face that each point lies in; any face that contains the point.
    barycentric : (n, 3) float
        Barycentric coordinates in that face: weights of its three corners, which add up to 1.
    closed : bool
        Whether the last point is joined to the first. By default the curve is open.
    oriented : bool
        Whether the curve has a positive and a negative side, as it has by default. Distance to an unoriented curve is
        unsigned.
    normals : (segments, 3) float, optional
        Direction in space in which φ grows across each segment. Needed where left has no meaning: for curves along
        which a surface that is not orientable loses its orientation, and for curves in several parts of a surface that
        are oriented differently. Normals are projected on the surface; their lengths are ignored.

    Raises
    ------
    SourceError
        If there are fewer than two points, a number is NaN or infinite, coordinates are not barycentric, or the number
        of normals is not that of the segments. Face ids are checked when the curve is used on its surface.

    See Also
    --------
    SurfacePoints : Points on a surface.
    io.read_curves : Read curves on a surface.
    signed_distance : Distance on a grid, on tets or along a surface.
    close_curves : Close the gaps of curves on a surface.

    Examples
    --------
    >>> across = Curve([0, 0], [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]])
    >>> across.n_segments
    1
    >>> across.reversed().barycentric[0].tolist()
    [0.0, 0.5, 0.5]
    """

    faces: Ints
    barycentric: Floats
    closed: bool = False
    oriented: bool = True
    normals: Floats | None = None

    def __init__(
        self,
        faces: ArrayLike,
        barycentric: ArrayLike,
        closed: bool = False,
        oriented: bool = True,
        normals: ArrayLike | None = None,
    ) -> None:
        ids, weights = surface_points(faces, barycentric, "curve")
        if len(ids) < 2:
            raise SourceError(
                f"a curve needs at least two points, not {len(ids)}", remedy="use SurfacePoints for isolated points"
            )
        closed, oriented = flag(closed, "closed"), flag(oriented, "oriented")
        vars(self).update(faces=ids, barycentric=weights, closed=closed, oriented=oriented)
        if normals is not None:
            normals = finite_rows(normals, "curve normals", 3, SourceError)
            if len(normals) != self.n_segments:
                raise SourceError(
                    f"a curve of {self.n_segments} segments needs as many normals, not {len(normals)}: "
                    "they belong to segments, not to points",
                    element="normals",
                )
        vars(self).update(normals=normals)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.faces)

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return self.n_points if self.closed else self.n_points - 1

    def reversed(self) -> Curve:
        """Reverse the curve, which exchanges left and right; given normals stay the same.

        Returns
        -------
        Curve
            The same points, from last to first.

        See Also
        --------
        orient : Flip curves so that they agree.

        Examples
        --------
        >>> curve = Curve([0, 0], [[1, 0, 0], [0, 1, 0]])
        >>> curve.reversed().barycentric.tolist()
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
        """
        normals = None
        if self.normals is not None:
            normals = np.roll(self.normals[::-1], -1, axis=0) if self.closed else self.normals[::-1]
        return Curve(self.faces[::-1], self.barycentric[::-1], self.closed, self.oriented, normals)

    def __repr__(self) -> str:
        kind = ("closed" if self.closed else "open", "oriented" if self.oriented else "unoriented")
        return f"Curve({counted(self.n_points, 'point')}, {kind[0]}, {kind[1]})"


@dataclass(frozen=True, eq=False)
class SurfacePoints(Frozen):
    """Isolated points on a surface, from each of which distance grows in all directions.

    Parameters
    ----------
    faces : (n,) int
        Face that each point lies in; any face that contains the point.
    barycentric : (n, 3) float
        Weights of the three corners of that face, which add up to 1.

    Raises
    ------
    SourceError
        If no point was given, a number is NaN or infinite, or coordinates are not barycentric.

    See Also
    --------
    Curve : A curve on a surface.
    signed_distance : Distance on a grid, on tets or along a surface.

    Examples
    --------
    >>> SurfacePoints([4], [[0.2, 0.3, 0.5]])
    SurfacePoints(1 point)
    """

    faces: Ints
    barycentric: Floats

    def __init__(self, faces: ArrayLike, barycentric: ArrayLike) -> None:
        ids, weights = surface_points(faces, barycentric, "point source")
        if not len(ids):
            raise SourceError("no point was given", remedy="pass at least one")
        vars(self).update(faces=ids, barycentric=weights)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.faces)

    def __repr__(self) -> str:
        return f"SurfacePoints({counted(self.n_points, 'point')})"


CurveOrPoints: TypeAlias = Curve | SurfacePoints
"""A source of distance on a surface."""
CurvesAndPoints: TypeAlias = CurveOrPoints | Sequence[CurveOrPoints | Sequence[CurveOrPoints]]
"""One source or several; curves and points in a sequence within the sequence count as one source."""
ElementList: TypeAlias = Sequence[tuple[int, Sequence[float]]]
"""A curve in the format of potpourri3d: vertices (id, []), edges (id, [t]) and faces (id, [u, v]) in order."""


def surface_points(faces: ArrayLike, barycentric: ArrayLike, name: str) -> tuple[Ints, Floats]:
    """Check face ids and barycentric coordinates as far as possible without the surface.

    Return (n,) ids and (n, 3) coordinates, read-only; raise `SourceError` if they are invalid. `name` is for messages.
    """
    ids = np.atleast_1d(array_of(faces, f"face ids of a {name}", SourceError))
    if ids.size == 0:
        return frozen(np.empty(0, dtype=np.int64)), frozen(np.empty((0, 3)))
    weights = finite_rows(barycentric, f"barycentric coordinates of a {name}", 3, SourceError)
    if ids.ndim != 1 or len(ids) != len(weights) or ids.dtype.kind not in "iuO":
        raise SourceError(
            f"a {name} needs one integer face id per point: {ids.dtype} of shape {ids.shape} for {len(weights)} points",
            element="faces",
        )
    wrong = np.flatnonzero((weights < -1e-6).any(axis=1) | (np.abs(weights.sum(axis=1) - 1) > 1e-6))
    if len(wrong):
        raise SourceError(
            f"point {wrong[0]} of a {name} has barycentric coordinates {weights[wrong[0]].tolist()}: "
            "they must be at least 0 and add up to 1",
            element=f"point {wrong[0]}",
        )
    return frozen(whole_numbers(ids, f"face ids of a {name}", SourceError)), weights
