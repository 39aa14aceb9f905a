"""Planes fitted to points on an unknown surface, and how large the neighbourhoods must be for that."""

from __future__ import annotations

from dataclasses import dataclass
from math import gamma, pi

import numpy as np

from ..arrays import Bools, Floats, Ints, read_only
from ..compiled import compiled
from ..mesh.unit_vectors import axes_across
from ..parallel import PointTree, in_chunks

POINT_NEIGHBORS = 8
"""Number of nearest points that count as the neighbours of a point: on a surface about six lie around it."""
CLEAN_NEIGHBORS = 12
"""Number of neighbours to which a plane is fitted where there is no noise."""
NOISY_NEIGHBORS = (12, 24, 48, 96, 192)
"""Numbers of neighbours that planes of noisy points may be fitted to."""
CLEAN_DEVIATION = 0.07
"""Points are noisy if they deviate from robust planes by more than this, relative to the reach of neighbourhoods.
Curvature stays below 0.06, also on thin sheets and at edges that the points resolve; noise as wide as the neighbourhood
has 0.09 or more."""
ANGLE_ERROR = 0.13
"""Neighbourhoods are large enough if noise tilts planes by less than this angle, in radians, estimated from their
deviation."""
CLEAN_HEIGHTS = (0.25, 0.15, 0.1)
"""In successive fits, neighbours are left out if they are higher over the plane than this, relative to the reach."""
NOISY_HEIGHTS = (0.5, 0.5, 0.5)
"""The same for noisy points, over planes that move from a point to where its neighbours are densest."""
TWO_SIDES = 0.9
"""Neighbours lie on two sides if their mean distance from a fitted quadric, relative to the root mean square, exceeds
this. It is 0.88 to 0.99 for two sides with even points, 0.83 to 0.96 with random ones, but 0.74 to 0.86 for one noisy
side."""
MERGED_SHARE = 0.03
"""If a larger share of the points has neighbours on two sides, there is a warning. Of scans, CAD and tori with up to
0.4 spacings of noise at most 0.014 are such; of plates, bowls, lenses and tubes whose sides are merged 0.25 to 1."""
ONE_SIDE = 0.02
"""Neighbours lie on one side if their root mean square distance from a quadric is at most this, in spacings."""
STARTS = 5
"""Number of planes from which the fit to points on a surface starts, since it ends at the nearest of several sheets."""
TRIED_POINTS = 2000
"""Number of points that are examined to find out whether a cloud is noisy, or has two sides."""


@dataclass(frozen=True, eq=False)
class PlaneFits:
    """Planes fitted near n points."""

    axes: Floats  # (n, 3) unit normals, up to sign
    points: Floats  # (n, 3) the points themselves; if they are noisy, their projections onto the planes
    reaches: Floats  # (n,) distance to the last neighbour used
    n_neighbors: int  # number of neighbours that each plane was fitted to
    noisy: bool  # whether the points lie around the surface rather than on it


def fit_planes(points: Floats, n_neighbors: int | None = None) -> PlaneFits:
    """Fit a plane near each of (n, 3) distinct points.

    Points are noisy if `n_neighbors` is given, and planes are fitted to this number of neighbours. Otherwise points lie
    on the surface, and planes are fitted to at most `CLEAN_NEIGHBORS`. Neighbours far above or below are left out.
    """
    tree = PointTree(points)
    noisy = n_neighbors is not None
    size = n_neighbors or min(CLEAN_NEIGHBORS, len(points) - 1)
    limits = NOISY_HEIGHTS if noisy else CLEAN_HEIGHTS
    axes, centers, reaches, _ = planes_near(points, tree, np.arange(len(points)), size, limits, on_surface=not noisy)
    projected = points - ((points - centers) * axes).sum(axis=1, keepdims=True) * axes if noisy else points
    return PlaneFits(axes, projected, reaches, size, noisy)


def noisy_sizes(points: Floats, normals: Floats | None = None) -> list[int]:
    """List numbers of neighbours, ascending, that allow planes to be fitted to (n, 3) noisy points; none without noise.

    `normals`, (n, 3) if given, keep points of different sides apart.
    """
    largest = (len(points) - 1) // 4
    if largest < CLEAN_NEIGHBORS:
        return []
    tree = PointTree(points)
    tried = np.arange(0, len(points), -(-len(points) // TRIED_POINTS))
    if normals is not None:
        reach = float(np.median(tree.query(points[tried], k=CLEAN_NEIGHBORS + 1)[0][:, -1]))
        tree = PointTree(np.column_stack([points, reach * normals]))
    deviations = planes_near(points, tree, tried, CLEAN_NEIGHBORS, NOISY_HEIGHTS, on_surface=True)[3]
    if np.median(deviations) < CLEAN_DEVIATION:
        return []
    sizes = [k for k in NOISY_NEIGHBORS if k <= largest]
    errors = []
    for k in sizes:
        deviations = planes_near(points, tree, tried, k, (np.inf,), on_surface=False)[3]
        errors.append(2 * float(np.median(deviations)) / k**0.5)
    return [k for k, error in zip(sizes, errors, strict=True) if error < ANGLE_ERROR] or sizes[-1:]


def noise_scale(points: Floats, normals: Floats | None = None) -> int | None:
    """Return the number of neighbours to which planes of (n, 3) noisy points should be fitted; None without noise."""
    sizes = noisy_sizes(points, normals)
    return sizes[min(2, len(sizes) - 1)] if sizes else None


def areas_per_point(distances: Floats, k: int, dimension: int = 2) -> Floats:
    """(n,) area per point, from the distances to the k-th neighbours; the length or volume for other dimensions."""
    unit_ball = pi ** (dimension / 2) / gamma(dimension / 2 + 1)
    return np.asarray(unit_ball * distances**dimension / k)


def point_spacing(distances: Floats, k: int) -> Floats:
    """(n,) spacing of points on a surface, estimated from the (n,) distances to their k-th neighbours."""
    return np.sqrt(areas_per_point(distances, k))


def share_of_two_sides(points: Floats, normals: Floats) -> float:
    """Return the share of points whose neighbours lie on two sides of a quadric, as on plates thinner than the spacing.

    Points and their unit normals are (n, 3); at most about `TRIED_POINTS` are examined.
    """
    k = min(2 * CLEAN_NEIGHBORS, len(points) - 1)  # a quadric has twice as many coefficients as a plane
    tree = PointTree(points)

    def two_sided(tried: Ints) -> tuple[Bools]:
        """(k,) whether the neighbours of points with ids `tried`, (k,), lie on two sides of a fitted quadric."""
        distances, near = tree.query(points[tried], k=k + 1)
        offsets, normal = points[near] - points[tried, None], normals[tried]
        weights = np.exp(-((distances / distances[:, -1:]) ** 2)) * (np.einsum("nkd,nd->nk", normals[near], normal) > 0)
        frame = np.stack([*axes_across(normal), normal], axis=1)
        spacing = point_spacing(distances[:, -1], k)
        x, y, z = np.einsum("nkd,nad->ank", offsets, frame) / spacing[:, None]
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
        moments = np.einsum("nka,nk,nkb->nab", terms, weights, terms) + 1e-9 * np.eye(6)
        factors = np.linalg.solve(moments, np.einsum("nka,nk,nk->na", terms, weights, z)[..., None])
        heights, total = np.abs(z - (terms @ factors)[..., 0]), weights.sum(axis=1)  # above the quadric
        mean, root = (weights * heights).sum(axis=1) / total, np.sqrt((weights * heights**2).sum(axis=1) / total)
        enough = (weights > 0).sum(axis=1) > k / 2
        return ((mean > TWO_SIDES * root) & (root > ONE_SIDE) & enough,)

    return float(in_chunks(two_sided, np.arange(0, len(points), -(-len(points) // TRIED_POINTS)))[0].mean())


def planes_near(
    points: Floats,
    tree: PointTree,
    chosen: Ints,
    n_neighbors: int,
    heights: tuple[float, ...],
    *,
    on_surface: bool,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Fit planes near (c,) `chosen` points to their neighbours, leaving out those beyond each of `heights` in turn.

    Heights are relative to the reach, the distance to the last neighbour. They are over the plane through the point, if
    `on_surface`, or else over that through the mean of the neighbours. Return (c, 3) normals, (c, 3) means, (c,)
    reaches, and (c,) root mean square heights.
    """

    def fit(ids: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """Fit planes near points with (k,) ids: normals, centres, reaches and deviations."""
        distances, neighbors = tree.query(tree.data[ids], k=n_neighbors + 1)
        neighbors[:, 0] = ids  # the point itself
        fitted = axes, centers, deviations = np.zeros((len(ids), 3)), points[ids], np.zeros(len(ids))
        starts = STARTS if on_surface else 1
        robust_planes(read_only(points), neighbors, distances, np.array(heights), on_surface, starts, *fitted)
        return axes, centers, distances[:, -1], deviations

    axes, centers, reaches, deviations = in_chunks(fit, chosen)
    return axes, centers, reaches, deviations


@compiled
def least_eigenvector(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, axis: Floats) -> float:
    """Return the least eigenvalue of a symmetric 3×3 matrix (Smith 1961), and write its unit eigenvector to `axis`."""
    mean = (xx + yy + zz) / 3.0
    ax, ay, az = xx - mean, yy - mean, zz - mean
    p = ((ax * ax + ay * ay + az * az + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0) ** 0.5
    if not p > 1e-15 * abs(mean):
        axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
        return mean
    half = (ax * (ay * az - yz * yz) - xy * (xy * az - yz * xz) + xz * (xy * yz - ay * xz)) / (2.0 * p * p * p)
    least = mean + 2.0 * p * np.cos((np.arccos(min(max(half, -1.0), 1.0)) + 2.0 * np.pi) / 3.0)
    ax, ay, az = xx - least, yy - least, zz - least
    longest = -1.0
    for pair in range(3):
        if pair == 0:
            u, v, w = xy * yz - xz * ay, xz * xy - ax * yz, ax * ay - xy * xy
        elif pair == 1:
            u, v, w = xy * az - xz * yz, xz * xz - ax * az, ax * yz - xy * xz
        else:
            u, v, w = ay * az - yz * yz, yz * xz - xy * az, xy * yz - ay * xz
        square = u * u + v * v + w * w
        if square > longest:
            longest = square
            axis[0], axis[1], axis[2] = u, v, w
    if longest <= 1e-24 * p**4:  # points along a line, whose direction each row has: any axis across it will do
        u, v, w = xx - least, xy, xz
        if yy - least > u:
            u, v, w = xy, yy - least, yz
        if zz - least > max(xx, yy) - least:
            u, v, w = xz, yz, zz - least
        if abs(u) <= abs(v) and abs(u) <= abs(w):
            axis[0], axis[1], axis[2] = 0.0, w, -v
        elif abs(v) <= abs(w):
            axis[0], axis[1], axis[2] = -w, 0.0, u
        else:
            axis[0], axis[1], axis[2] = v, -u, 0.0
        longest = axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2
    length = longest**0.5
    axis[0], axis[1], axis[2] = axis[0] / length, axis[1] / length, axis[2] / length
    return max(least, 0.0)


@compiled
def weighted_plane(offsets: Floats, weights: Floats, count: int, axis: Floats, center: Floats) -> float:
    """Fit a plane to the first `count` of (k, 3) weighted points; return their mean squared height over it.

    Write its unit normal to `axis`, and the weighted mean of the points to `center`.
    """
    total = x = y = z = 0.0
    for j in range(count):
        total += weights[j]
        x += weights[j] * offsets[j, 0]
        y += weights[j] * offsets[j, 1]
        z += weights[j] * offsets[j, 2]
    x, y, z = x / total, y / total, z / total
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(count):
        a, b, c = offsets[j, 0] - x, offsets[j, 1] - y, offsets[j, 2] - z
        wa, wb = weights[j] * a, weights[j] * b
        xx, xy, xz = xx + wa * a, xy + wa * b, xz + wa * c
        yy, yz, zz = yy + wb * b, yz + wb * c, zz + weights[j] * c * c
    center[0], center[1], center[2] = x, y, z
    return least_eigenvector(xx / total, xy / total, xz / total, yy / total, yz / total, zz / total, axis)


@compiled
def plane_through(a: Floats, b: Floats, axis: Floats) -> bool:
    """Write the unit normal of the plane spanned by two vectors to `axis`; return whether they span one."""
    u, v, w = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    square = u * u + v * v + w * w
    if square <= 1e-16 * (a[0] ** 2 + a[1] ** 2 + a[2] ** 2) * (b[0] ** 2 + b[1] ** 2 + b[2] ** 2):
        return False
    length = square**0.5
    axis[0], axis[1], axis[2] = u / length, v / length, w / length
    return True


@compiled
def weigh_by_height(offsets: Floats, near: Floats, axis: Floats, base: Floats, height: float, weights: Floats) -> float:
    """Write Tukey's biweights of the heights of (k, 3) points over a plane, times (k,) `near`; return their sum.

    The plane goes through `base` across `axis`; at heights of `height` and more, weights are 0.
    """
    total = 0.0
    level = axis[0] * base[0] + axis[1] * base[1] + axis[2] * base[2]
    for j in range(len(near)):
        part = (axis[0] * offsets[j, 0] + axis[1] * offsets[j, 1] + axis[2] * offsets[j, 2] - level) / height
        weights[j] = near[j] * (1.0 - part * part) ** 2 if abs(part) < 1.0 else 0.0
        total += weights[j]
    return total


@compiled
def robust_planes(
    points: Floats,
    neighbors: Ints,
    distances: Floats,
    heights: Floats,
    on_surface: bool,
    n_starts: int,
    axes: Floats,
    centers: Floats,
    deviations: Floats,
) -> None:
    """Fit a plane near each point to those of its neighbours within each of `heights` in turn.

    `neighbors` are (n, k) ids, a point itself first, and `distances` (n, k). Heights are relative to the last distance.
    They are over the plane through the point, if `on_surface`, or else through the last centre. The best of `n_starts`
    fits is kept: its normal, centre and root mean square height are written to `axes`, `centers` and `deviations`.
    """
    n, k = neighbors.shape
    offsets, near, weights = np.empty((k, 3)), np.empty(k), np.empty(k)
    axis, center, origin = np.empty(3), np.empty(3), np.zeros(3)
    base = origin if on_surface else center
    for i in range(n):
        reach, most = distances[i, k - 1], -1.0
        axes[i, 2] = 1.0
        if not reach > 0.0:
            continue
        for j in range(k):
            for c in range(3):
                offsets[j, c] = points[neighbors[i, j], c] - points[neighbors[i, 0], c]
            near[j] = np.exp(-((distances[i, j] / reach) ** 2))
        for start in range(n_starts):
            if start < 2:
                weighted_plane(offsets, near, k if start == 0 else min(k, 7), axis, center)
            elif k < 4 or not plane_through(offsets[1 + start // 4], offsets[2 + (start > 2)], axis):
                continue
            square, center[0], center[1], center[2] = 0.0, 0.0, 0.0, 0.0
            for height in heights:
                weigh_by_height(offsets, near, axis, base, height * reach, weights)
                square = weighted_plane(offsets, weights, k, axis, center)
            explained = weigh_by_height(offsets, near, axis, base, heights[-1] * reach, weights)
            if explained > most:
                most, deviations[i] = explained, square**0.5 / reach
                for c in range(3):
                    axes[i, c], centers[i, c] = axis[c], points[neighbors[i, 0], c] + center[c]
