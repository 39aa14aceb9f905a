"""Normals of point clouds, fitted where there are none and oriented outwards, and surfaces fitted to points."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints
from ..diagnostics import OrientedPoints, StrayPoints
from ..errors import GeometryError
from ..mesh.unit_vectors import unit
from ..parallel import PointTree, in_chunks
from ..surfaces.normal_orientation import outward_normals
from ..surfaces.plane_fits import point_spacing
from ..surfaces.point_cloud import PointCloud

STRAY_DISTANCE = 3.0
"""A point is a stray if its distance to the nearest points is more than this many times that of the points around."""
STRAY_NEIGHBORS = 4, 64
"""Number of nearest points to which the mean distance is measured, and number of points around with which it is
compared. These are so many that most of them lie on the surface, even if strays are near other strays."""


def without_strays(cloud: PointCloud) -> tuple[PointCloud, list[StrayPoints]]:
    """Leave out points that lie far from all others, compared with the points around them; say how many in a note."""
    ids, owners = np.unique(cloud.representatives, return_inverse=True)
    n_nearest, n_around = STRAY_NEIGHBORS
    n_around = min(n_around, len(ids) // 4)
    if n_around <= n_nearest:
        return cloud, []
    points = cloud.points[ids]
    distances, near = PointTree(points).query(points, n_around + 1)
    gaps = distances[:, 1 : n_nearest + 1].mean(axis=1)
    strays = (gaps > STRAY_DISTANCE * np.median(gaps[near[:, 1:]], axis=1))[owners.ravel()]
    if not strays.any():
        return cloud, []
    normals, areas = (None if each is None else each[~strays] for each in (cloud.normals, cloud.areas))
    return PointCloud(cloud.points[~strays], normals, areas, cloud.n_neighbors), [StrayPoints(int(strays.sum()))]


def orient_points(cloud: PointCloud) -> tuple[PointCloud, OrientedPoints]:
    """Orient the normals of a point cloud outwards, or fit them if it has none; say how many were flipped or fitted."""
    if cloud.points.shape[1] != 3:
        raise GeometryError(
            f"point clouds are oriented in space: points need 3 coordinates, not {cloud.points.shape[1]}",
            remedy="in the plane, give a Polyline",
            element="points",
        )
    ids, owners = np.unique(cloud.representatives, return_inverse=True)
    if len(ids) < 4:
        raise GeometryError(
            f"the point cloud has {len(ids)} distinct points, and a surface needs at least 4",
            remedy="add some",
            element="points",
        )
    given = None if cloud.normals is None else cloud.normals[ids]
    outward, _, decision = outward_normals(cloud.points[ids], given)
    if cloud.normals is None:
        normals = outward[owners.ravel()]
        fitted, turned = cloud.n_points, 0
    else:
        every = decision.signs[owners.ravel()]
        normals = cloud.normals * every[:, None]
        fitted, turned = 0, int((every < 0).sum())
    return PointCloud(cloud.points, normals, cloud.areas, cloud.n_neighbors), OrientedPoints(fitted, turned)


FIT_NEIGHBORS = 30
"""Number of nearest points that are searched for each node."""
WEIGHTED_POINTS = 12
"""Number of points that get a weight at a node: the nearest of those that face along ∇φ."""
FACING_COSINE = 0.3
"""Cosine between normal and ∇φ above which a point faces along ∇φ."""
FIT_WIDTH = 2.0
"""The fit replaces φ at nodes where |φ| is below this number of cells, as a cubic interpolant needs."""
FIT_REACH = 1.5
"""The fit has full weight within this distance of points, in mean spacings; one spacing farther it has none."""


def fitted_to_points(phi: Floats, steps: Floats, points: Floats, normals: Floats) -> Floats:
    """Return φ, (nx, ny, nz), with its zero set moved onto a smooth surface through oriented points.

    Nodes are (3,) `steps` apart, and the (n, 3) points relative to the first node. Near the zero set φ becomes the
    weighted mean of ``½ (n_i + n) · (x − p_i)`` over points p_i, where n is the mean of their normals n_i: planes with
    normals n_i and n lie on opposite sides of a curved surface. Points whose normals are against ∇φ do not count.
    """
    tree = PointTree(points)
    n_neighbours = min(FIT_NEIGHBORS, len(points))
    gap = mean_gap(points)
    result = np.array(phi, dtype=np.float64)
    nodes = np.argwhere(np.abs(phi) < FIT_WIDTH * float(steps.max()))

    def changes(rows: Ints) -> tuple[Floats]:
        """(k,) changes of φ at (k, 3) nodes."""
        positions, directions = rows * steps, unit(_gradients(phi, rows, steps))
        distances, near = tree.query(positions, k=[*range(1, n_neighbours + 1)])
        heights, weights = _fit(positions, directions, distances, points[near], normals[near], gap)
        return (weights * (heights - phi[tuple(rows.T)]),)

    result[tuple(nodes.T)] += in_chunks(changes, nodes)[0]
    return result


def _gradients(phi: Floats, nodes: Ints, steps: Floats) -> Floats:
    """(k, 3) gradients of φ at (k, 3) nodes by central differences, one-sided at the boundary of the grid."""
    gradients = np.empty((len(nodes), 3))
    for axis, step in enumerate(steps):
        low, high = nodes.copy(), nodes.copy()
        low[:, axis] = np.maximum(low[:, axis] - 1, 0)
        high[:, axis] = np.minimum(high[:, axis] + 1, phi.shape[axis] - 1)
        gradients[:, axis] = (phi[tuple(high.T)] - phi[tuple(low.T)]) / ((high[:, axis] - low[:, axis]) * step)
    return gradients


def mean_gap(points: Floats) -> float:
    """Return the mean spacing of (n, 3) points on a surface: the root of the area per point, by six neighbours each."""
    reach = PointTree(points).query(points, k=[min(7, len(points))])[0]
    return float(np.median(point_spacing(reach, 7)))


def _fit(
    places: Floats, ahead: Floats, reach: Floats, points: Floats, normals: Floats, gap: float
) -> tuple[Floats, Floats]:
    """(k,) heights of (k, 3) places above the surface through the (k, n, 3) points around each, and (k,) weights.

    `ahead` are (k, 3) directions of ∇φ at the places, `reach` the (k, n) distances to the points, `normals` the (k, n,
    3) unit normals of these, and `gap` their mean spacing. Weights are 1 close to enough points, and fall to 0.
    """
    # the weighted mean of heights above planes through the points whose normals agree with ∇φ. The normal of a plane is
    # half-way between that of its point and their mean: on a sphere all heights are then 0
    cosines = np.einsum("pki,pi->pk", normals, ahead)
    facing = cosines > FACING_COSINE
    ranked = np.sort(np.where(facing, reach, np.inf), axis=1)
    last = ranked[:, min(WEIGHTED_POINTS, ranked.shape[1]) - 1]
    radius = 1.01 * np.where(np.isfinite(last), last, reach[:, -1])
    bell = np.maximum(1.0 - (reach / radius[:, None]) ** 2, 0.0) ** 2
    weights = np.where(facing, bell * cosines**2, 0.0)
    total = weights.sum(axis=1)
    mean = unit(np.einsum("pk,pki->pi", weights, normals))
    planes = 0.5 * (normals + mean[:, None])
    heights = np.einsum("pk,pki,pki->p", weights, planes, places[:, None] - points)
    heights /= np.where(total > 0, total, 1.0)
    gap = gap if gap > 0 else float(reach.max()) or 1.0  # most points coincide
    enough = np.clip(((weights > 0).sum(axis=1) - 2) / 4, 0.0, 1.0)
    return heights, enough * np.where(total > 0, np.clip(1.0 + FIT_REACH - ranked[:, 0] / gap, 0.0, 1.0), 0.0)
