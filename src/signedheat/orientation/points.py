"""Point clouds without normals get normals, and normals known up to sign get signs: outwards, together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..errors import GeometryError
from ..reprs import ShortRepr
from .axes import fitted_outward, outward_signs
from .plane_fits import fit_planes, noise_scale


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
        Whether anything told which side is out; points in a plane, say, tell nothing.
    coherence : float
        How far points confirm each other: 1 where all do. A low value means doubt; a high one is no proof, since thin
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
    Growth is n log n; up to 100,000 points, which stand for all, tell the sides.

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
    if cloud.normals is None:
        fits, found = fitted_outward(cloud.points[ids])
        normals = (fits.axes * found.signs[:, None])[which.ravel()]
        fitted, turned = cloud.n_points, 0
    else:
        fits = fit_planes(cloud.points[ids], noise_scale(cloud.points[ids]))
        found = outward_signs(fits, cloud.normals[ids], given=True)
        every = found.signs[which.ravel()]
        normals = cloud.normals * every[:, None]
        fitted, turned = 0, int((every < 0).sum())
    oriented = PointCloud(cloud.points, normals, cloud.areas, cloud.n_neighbors)
    return PointOrientation(oriented, fitted, turned, fits.n_neighbors, fits.noisy, found.sided, found.coherence)


def orient_axes(
    points: NDArray[np.float64], axes: NDArray[np.float64], given: bool = False, groups: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """(n,) signs that turn normals known up to sign outwards, all together.

    Parameters
    ----------
    points : (n, 3) float
        Points on a surface; of those that coincide, the first counts.
    axes : (n, 3) float
        Unit normals, up to sign.
    given : bool
        Whether the axes' own signs are evidence: weak, and relative; if most are inverted, that is found out.
    groups : (n,) int, optional
        Points of the same group, of one triangle, say, share one sign.

    Notes
    -----
    Of fewer than four distinct points nothing can be told: their signs are positive.

    Examples
    --------
    >>> from signedheat import samples
    >>> truth = samples.oriented_points(samples.sphere(), 500)
    >>> axes = truth.normals * np.where(truth.normals[:, :1] < 0, -1, 1)
    >>> bool((orient_axes(truth.points, axes) == np.where(truth.normals[:, 0] < 0, -1, 1)).all())
    True
    """
    members = np.arange(len(points)) if groups is None else np.unique(groups, return_inverse=True)[1].ravel()
    _, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
    if len(first) < 4:
        return np.ones(len(points))
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first, place = first[order], rank[place.ravel()]
    present, kept = np.unique(members[first], return_inverse=True)
    fits = fit_planes(points[first], noise_scale(points[first]))
    found = outward_signs(fits, axes[first], given, None if groups is None else kept.ravel()).signs
    if groups is None:
        agrees = (axes * axes[first[place]]).sum(axis=1) >= 0
        return np.where(agrees, 1.0, -1.0) * found[place]
    signs = np.ones(int(members.max()) + 1)
    signs[present[kept.ravel()]] = found
    return signs[members]


def orient_triangles(
    corners: NDArray[np.float64],
    given: bool = True,
    n_samples: int = 20_000,
    groups: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """(m,) signs, −1 for triangles to turn round so that loose triangles, taken together, face outwards.

    Parameters
    ----------
    corners : (m, 3, 3) float
        Corners of triangles, of which nothing is known to be connected.
    given : bool
        Whether the order of their corners is evidence: weak, and relative; if most are inverted, that is found out.
    n_samples : int
        Points that stand for the triangles, at least one for each, as many more as their areas ask for.
    groups : (m,) int, optional
        Triangles of the same group, which agree with each other, share one sign.

    Notes
    -----
    Triangles without area keep their order.

    Examples
    --------
    >>> from signedheat import samples
    >>> mesh = samples.sphere(3)
    >>> corners = mesh.vertices[mesh.faces]
    >>> corners[::2] = corners[::2, ::-1]
    >>> signs = orient_triangles(corners)
    >>> bool((signs[::2] == -1).all() and (signs[1::2] == 1).all())
    True
    """
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(vectors, axis=1)
    signs = np.ones(len(corners))
    solid = np.flatnonzero(areas > 0)
    if len(solid) < 4:
        return signs
    counts = np.maximum(1, np.rint(areas[solid] / areas.sum() * n_samples)).astype(np.int64)
    owners = np.repeat(np.arange(len(solid)), counts)
    order = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    points = _spread(corners[solid][owners], order, counts[owners])
    axes = (vectors[solid] / areas[solid, None])[owners]
    members = np.arange(len(corners)) if groups is None else groups
    signs[solid[owners]] = orient_axes(points, axes, given, members[solid[owners]])
    return signs


def _spread(corners: NDArray[np.float64], order: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The centroid where a triangle has one sample; else samples spread evenly by a sequence of low discrepancy.

    The sequence is that of Roberts (2018), with steps of the inverse plastic number and its square.
    """
    plastic = 1.324717957244746
    u, v = np.mod(0.5 + order / plastic, 1.0), np.mod(0.5 + order / plastic**2, 1.0)
    root = np.sqrt(u)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    weights = np.where((counts == 1)[:, None], 1 / 3, weights)
    return np.asarray((weights[:, :, None] * corners).sum(axis=1))
