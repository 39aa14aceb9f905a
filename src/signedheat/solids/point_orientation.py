"""Point clouds without normals get normals, and normals known up to sign get signs: outwards, together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import GeometryError
from ..frozen import ShortRepr
from ..surfaces.outward_signs import outward_normals
from ..surfaces.point_cloud import PointCloud


@dataclass(frozen=True, eq=False, repr=False)
class PointOrientation(ShortRepr):
    """What orienting a point cloud did.

    Attributes
    ----------
    cloud : PointCloud
        The points, with outward unit normals.
    n_fitted : int
        Normals that were fitted: all of them, or none.
    n_turned : int
        Normals given that were turned round.
    n_neighbors : int
        Neighbours from which planes were fitted.
    noisy : bool
        Whether noise called for neighbourhoods larger than the smallest.
    sided : bool
        Whether anything decided which side is out; for points in a plane, say, nothing does.
    coherence : float
        How far points confirm each other: 1 where all do. A low value is a warning; a high one is no proof, since thin
        sheets of noisy points can agree on a wrong side.
    """

    cloud: PointCloud
    n_fitted: int
    n_turned: int
    n_neighbors: int
    noisy: bool
    sided: bool
    coherence: float


def orient_points(cloud: PointCloud) -> PointOrientation:
    """Turn the normals of a point cloud outwards, all together; fit them first where there are none.

    Normals given are weak evidence for which side is out, and relative: if most are inverted, that is found out.

    Parameters
    ----------
    cloud : PointCloud
        Points in space, with or without normals.

    Raises
    ------
    GeometryError
        If the points are not in space, or fewer than four are distinct.

    Notes
    -----
    Growth is n log n; the sides are decided with at most 100,000 of the points.

    Examples
    --------
    >>> from signedheat import samples
    >>> found = orient_points(PointCloud(samples.oriented_points(samples.torus(), 2000).points))
    >>> ring = found.cloud.points * (1, 1, 0)
    >>> outward = found.cloud.points - ring / np.linalg.norm(ring, axis=1, keepdims=True)
    >>> bool(((outward * found.cloud.normals).sum(axis=1) > 0).all())
    True
    """
    if cloud.points.shape[1] != 3:
        raise GeometryError(
            f"point clouds are oriented in space: points need 3 coordinates, not {cloud.points.shape[1]}",
            remedy="in the plane, give a Polyline",
            element="points",
        )
    ids, which = np.unique(cloud.representatives, return_inverse=True)
    if len(ids) < 4:
        raise GeometryError(
            f"the point cloud has {len(ids)} distinct points, and a surface needs at least 4",
            remedy="add some",
            element="points",
        )
    given = None if cloud.normals is None else cloud.normals[ids]
    outward, fits, found = outward_normals(cloud.points[ids], given)
    if cloud.normals is None:
        normals = outward[which.ravel()]
        fitted, turned = cloud.n_points, 0
    else:
        every = found.signs[which.ravel()]
        normals = cloud.normals * every[:, None]
        fitted, turned = 0, int((every < 0).sum())
    oriented = PointCloud(cloud.points, normals, cloud.areas, cloud.n_neighbors)
    return PointOrientation(oriented, fitted, turned, fits.n_neighbors, fits.noisy, found.sided, found.coherence)
