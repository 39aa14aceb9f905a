"""The outward orientation of normals at points.

The ball around a Delaunay tet touches four points and contains none. Where it touches two of them along their normals,
it lies on the same side of the surface near both. So tets link the signs of normals, across edges, gaps and thin walls
alike, without a triangulated surface. Faces of the convex hull link them with the outside. (Poles of Voronoi cells:
Amenta & Bern 1999; labels from balls that overlap: Kolluri, Shewchuk & O'Brien 2004.)

Gauss's formula (`signedheat.solids.gauss`) needs an inside, which clouds need not have: on points of open sheets
(waves, terrains, saddles) it gets half of the normals wrong, where these links get none wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..jobs import interruptible
from ..mesh.signed_graph import Links, signs_of
from ..mesh.unit_vectors import SAME_WAY, unit
from ..parallel import PointTree
from .local_triangulations import SAME_SIDE_HEIGHT, opposed_normals
from .plane_fits import POINT_NEIGHBORS, PlaneFits, fit_planes, noise_scale, noisy_sizes, point_spacing

KEPT_SPACING = 0.35
"""Noisy points are thinned to at least this distance, relative to their reach; the noise that planes leave is less."""
MOST_TET_POINTS = 100_000
"""Largest number of points for which tets are made; the others get the signs of their neighbours."""
WEAK_WEIGHT = 0.1
"""Weight of evidence that is weaker than balls. It is the weight of links between neighbours, relative to that of balls
(for noisy points both weigh the same); and that of given signs, relative to half the typical sum of all links of a
point."""
MOST_WRONG = 3.0
"""Given signs are kept unless the share that seems wrong exceeds this many times the share of contradictions."""
COHERENCE_GAIN = 0.0015
"""Larger neighbourhoods are preferred if they gain this much coherence. Once it falls by as much, no larger ones are
tried."""
JOGGLE = 1e-4
"""Random shift of points, relative to their reach, since flat faces and lattices are slow to triangulate."""
BALL_COSINE = 0.5
"""A ball links the sign of a point only if the cosine between its normal and the direction to the ball's centre is
above this."""
OUTLIER_DISTANCE = 4.0
"""A point is an outlier if it is this many times as far from its neighbours as these are from theirs. The factor is up
to 1.4 where spacing is even, and 1.6 where density halves within three spacings."""
UPWARD = np.array([0.01, 0.1, 1.0])
"""Outward direction where nothing decides it, as for points in a plane: up, and on vertical planes along the second
axis. If a component is halved or doubled, planes keep their sides."""
MUTUALLY_BELOW = 0.98
"""Given normals are kept on thin sheets if, among near points with opposite normals, the share that lies below the
other point and the share above it differ by at least this. On thin sheets the difference is 1, and 0.9 if a fifth of
the normals are flipped."""
LISTED_AT_ONCE = 4096
"""Batch size of points whose neighbours are listed."""


@dataclass(frozen=True, eq=False)
class OutwardSigns:
    """Signs by which axes are multiplied so that they point outwards."""

    signs: Floats  # (n,) 1 or −1
    sided: bool  # whether some link decides which side is outside
    coherence: float  # share of the weights of links that the signs agree with, less the share that they contradict


def outward_normals(points: Floats, given: Floats | None = None) -> tuple[Floats, PlaneFits, OutwardSigns]:
    """Orient normals at (n, 3) distinct points outwards: the (n, 3) given ones, or else fitted ones.

    Return (n, 3) unit normals, the fitted planes, and the signs by which given or fitted normals were multiplied.
    """
    if given is None:
        fits, outward = fitted_outward(points)
        return fits.axes * outward.signs[:, None], fits, outward
    fits = fit_planes(points, noise_scale(points, given))
    outward = outward_signs(fits, given, given=True)
    outward = replace(outward, signs=kept_on_thin_sheets(points, given, outward.signs))
    return given * outward.signs[:, None], fits, outward


def kept_on_thin_sheets(points: Floats, given: Floats, signs: Floats) -> Floats:
    """(n,) signs in which those on sheets thinner than the spacing, where balls are no evidence, are all the same.

    So the (n, 3) given normals are kept there, or all inverted. This is done only if, all over the cloud, near points
    with opposite normals are each below the other, or each above.
    """
    k = min(POINT_NEIGHBORS, len(points) - 1)
    distances, near = PointTree(points).query(points, k=k + 1)
    flat = SAME_SIDE_HEIGHT * point_spacing(distances[:, k], k)
    offsets = points[near] - points[:, None]
    opposed = opposed_normals(points, given, flat, near)
    below = -np.sign((offsets * given[:, None]).sum(axis=2))[opposed]
    if len(below) == 0 or abs(below.mean()) < MUTUALLY_BELOW:
        return signs
    thin = opposed.any(axis=1)
    inverted = below.mean() < 0 and (signs[~thin] if not thin.all() else signs).sum() < 0
    return np.where(thin, -1.0 if inverted else 1.0, signs)


def fitted_outward(points: Floats) -> tuple[PlaneFits, OutwardSigns]:
    """Fit planes to (n, 3) points, with as many neighbours as make signs most coherent; return planes and signs."""
    tried: list[tuple[PlaneFits, OutwardSigns]] = []
    for size in noisy_sizes(points) or (None,):
        fits = fit_planes(points, size)
        tried.append((fits, outward_signs(fits, fits.axes)))
        best = max(outward.coherence for _, outward in tried)
        if tried[-1][1].coherence < best - COHERENCE_GAIN:
            break
    return next((fits, outward) for fits, outward in tried if outward.coherence >= best - COHERENCE_GAIN)


def outward_signs(fits: PlaneFits, axes: Floats, given: bool = False) -> OutwardSigns:
    """Find signs that orient (n, 3) axes outwards.

    Axes that were `given` are mostly right: all keep their sign, or all are inverted, unless much more than
    contradictions of links explain speaks against single ones (`MOST_WRONG`).
    """
    # links between chosen points; node m of the graph is the outside, node m + 1 the signs as given
    n = len(axes)
    chosen = spread_out(fits.points, KEPT_SPACING * fits.reaches) if fits.noisy else np.arange(n)
    chosen = chosen[~_lone(fits.points[chosen], fits.reaches[chosen])]
    if len(chosen) > MOST_TET_POINTS:
        chosen = np.sort(np.random.default_rng(0).choice(chosen, MOST_TET_POINTS, replace=False))
    kept_points = fits.points[chosen]
    links, sided = sign_links(kept_points, axes[chosen], fits.reaches[chosen], fits.noisy)
    m = len(chosen)
    if given or not sided:
        typical = 0.5 * float(np.median(links.strength(m + 1)[:m]))
        own = np.ones(m) if given else axes[chosen] @ UPWARD
        links = Links.joined(links, Links(np.arange(m), np.full(m, m + 1), WEAK_WEIGHT * typical * own))
    # signs of the chosen points, relative to the outside or to the given signs; others follow their neighbours
    decision = signs_of(links, m + 2)
    signs = np.zeros(n)
    signs[chosen] = decision[:m] * decision[m if sided else m + 1]
    rest = np.flatnonzero(signs == 0)
    if len(rest):
        signs[rest] = _nearest_signs(kept_points, axes[chosen] * signs[chosen, None], fits.points[rest], axes[rest])
    coherence = links.coherence(decision)
    if given and min((signs < 0).mean(), (signs > 0).mean()) <= MOST_WRONG * (1 - coherence):
        signs = np.full(n, 1.0 if signs.sum() >= 0 else -1.0)
    return OutwardSigns(signs, sided, coherence)


def _lone(points: Floats, reaches: Floats) -> Bools:
    """(n,) whether each point is an outlier, much farther from its neighbours than these are from theirs.

    `reaches` are the (n,) distances of points to their neighbours.
    """
    near = PointTree(points).query(points, k=min(POINT_NEIGHBORS + 1, len(points)))[1]
    return reaches > OUTLIER_DISTANCE * np.median(reaches[near.reshape(len(points), -1)[:, 1:]], axis=1)


def _nearest_signs(points: Floats, normals: Floats, queries: Floats, axes: Floats) -> Floats:
    """(k,) signs that make the (k, 3) axes at `queries`, (k, 3), agree with the (n, 3) normals at nearest points."""
    distances, near = PointTree(points).query(queries, k=min(6, len(points)))
    distances, near = distances.reshape(len(queries), -1), near.reshape(len(queries), -1)
    weights = 1.0 / (distances + 1e-9 * max(float(distances.max()), np.finfo(float).tiny))
    cosines = np.einsum("nj,nkj->nk", axes, normals[near])
    return np.where((weights * cosines * np.abs(cosines)).sum(axis=1) >= 0, 1.0, -1.0)


def sign_links(points: Floats, axes: Floats, reaches: Floats, noisy: bool = False) -> tuple[Links, bool]:
    """Link the signs of (n, 3) axes by neighbours, by balls, and by the hull to the outside, which is node n.

    Balls are circumscribed about the tets of the Delaunay triangulation, whose points are moved by a small share of
    their (n,) `reaches`, so that none are on one sphere. Also return whether there are balls; without them, as for
    points in a plane, neighbours alone are linked. Neighbours count less unless points are `noisy`.
    """
    near = _neighbor_links(points, axes, 1.0 if noisy else WEAK_WEIGHT)
    moves = np.random.default_rng(0).uniform(-1, 1, points.shape) * (JOGGLE * reaches[:, None])
    try:
        tets = interruptible(scipy.spatial.Delaunay, points + moves)
    except (scipy.spatial.QhullError, ValueError):
        return near, False
    if tets.simplices.max() >= len(points):  # Qhull gave up on precision, and its point at infinity is a corner
        return near, False
    flat = np.ptp(points @ np.linalg.eigh(np.cov(points.T))[1][:, 0]) <= 10 * JOGGLE * float(reaches.max())
    if flat:
        return near, False
    balls = _ball_links(points, axes, tets.simplices.astype(np.int64))
    return Links.joined(near, balls, _hull_links(points, axes, tets)), True


def _confidence(cosines: Floats) -> Floats:
    """Fourth powers of cosines, with their signs; 0 if they are below `BALL_COSINE` in absolute value."""
    return np.where(np.abs(cosines) > BALL_COSINE, np.sign(cosines) * cosines**4, 0.0)


def _ball_links(points: Floats, axes: Floats, tets: Ints) -> Links:
    """Link the signs at every two corners of a tet along whose axes its circumscribed ball lies; tets are (t, 4).

    There are no points in such a ball, so that it is taken to lie on one side: all axes point into it, or none does.
    `points` and `axes` are (n, 3).
    """
    corners = points[tets]
    # the centre, relative to the first corner, of the ball through all corners
    u, v, w = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    uu, vv, ww = ((side * side).sum(axis=1, keepdims=True) for side in (u, v, w))
    vw = np.cross(v, w)
    volume = (u * vw).sum(axis=1)
    center = uu * vw + vv * np.cross(w, u) + ww * np.cross(u, v)  # times twice the volume
    size = np.maximum(np.maximum(uu, vv), ww)[:, 0]
    solid = np.abs(volume) > 1e-10 * size**1.5
    center /= 2 * np.where(solid, volume, 1.0)[:, None]
    radius = np.linalg.norm(center, axis=1)
    toward = (corners[:, :1] + center[:, None] - corners) / np.where(solid, radius, 1.0)[:, None, None]
    sides = _confidence(np.einsum("tkj,tkj->tk", toward, axes[tets]) * solid[:, None])
    pairs = [(a, b) for a in range(4) for b in range(a)]
    weights = np.concatenate([sides[:, a] * sides[:, b] for a, b in pairs])
    linked = weights != 0
    tails, heads = (np.concatenate([tets[:, pair[k]] for pair in pairs])[linked] for k in (0, 1))
    return Links(tails, heads, weights[linked])


def _hull_links(points: Floats, axes: Floats, tets: scipy.spatial.Delaunay) -> Links:
    """Link the corners of the convex hull with the outside, node n, which is away from the mean of the points.

    The tets behind faces of the hull cannot tell the side, since they may be flat.
    """
    tet, opposite = np.nonzero(tets.neighbors < 0)
    faces = tets.simplices[tet[:, None], (opposite[:, None] + [1, 2, 3]) % 4].astype(np.int64)
    a, b, c = points[faces].transpose(1, 0, 2)
    outward = unit(np.cross(b - a, c - a))
    outward *= np.sign((outward * (a - points.mean(axis=0))).sum(axis=1))[:, None]
    weights = _confidence(np.einsum("fj,fkj->fk", outward, axes[faces]))
    return Links(faces.ravel(), np.full(faces.size, len(points)), weights.ravel())


def neighbors_agree(points: Floats, normals: Floats) -> bool:
    """Whether the (n, 3) normals of neighbours among (n, 3) points contradict each other nowhere.

    Then whole components may face the wrong way, but not single points. Normals that point the same way never
    contradict each other, even where noise puts one point above the other.
    """
    links = _neighbor_links(points, normals, 1.0)
    against = links.weights < 0
    first, second = normals[links.tails[against]], normals[links.heads[against]]
    return bool(((first * second).sum(axis=1) > SAME_WAY).all())


def _neighbor_links(points: Floats, axes: Floats, weight: float) -> Links:
    """Link neighbours as if on a circle: reflection in the plane midway between them maps one axis to the other."""
    n, k = len(points), min(POINT_NEIGHBORS, len(points) - 1)
    neighbors = PointTree(points).query(points, k=k + 1)[1].reshape(n, -1)[:, 1:]
    tails, heads = np.repeat(np.arange(n), k), neighbors.ravel()
    step = unit(points[heads] - points[tails])
    first, second = axes[tails], axes[heads]
    cosines = (first * second).sum(axis=1) - 2 * (first * step).sum(axis=1) * (second * step).sum(axis=1)
    return Links(tails, heads, weight * _confidence(cosines))


def spread_out(points: Floats, radii: Floats) -> Ints:
    """(k,) ids, ascending, of (n, d) points that are not within the radius, (n,), of a point that was kept before."""
    tree = PointTree(points)
    kept = np.ones(len(points), dtype=bool)
    for begin in range(0, len(points), LISTED_AT_ONCE):
        part = np.arange(begin, min(begin + LISTED_AT_ONCE, len(points)))
        part = part[kept[part]]
        near = tree.query_ball_point(points[part], radii[part])
        ends = np.cumsum([0, *map(len, near)])
        _keep_first(part, ends, np.concatenate([*map(np.asarray, near), np.zeros(0)]).astype(np.int64), kept)
    return np.flatnonzero(kept)


@compiled
def _keep_first(ids: Ints, ends: Ints, near: Ints, kept: Bools) -> None:
    """Set `kept`, (n,), to False at later neighbours ``near[ends[i]:ends[i + 1]]`` of each kept point ``ids[i]``."""
    for i in range(len(ids)):
        if kept[ids[i]]:
            for k in range(ends[i], ends[i + 1]):
                if near[k] > ids[i]:
                    kept[near[k]] = False
