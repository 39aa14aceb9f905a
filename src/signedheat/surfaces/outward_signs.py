"""Orientation of the normals of points on an unknown surface, whose axes are known but not which way is out.

The ball around a Delaunay tet touches four points and contains none. Where it touches two of them along their normals,
it lies on the same side of the surface near both. So tets link the signs of normals, across edges, gaps and thin walls
alike, without a triangulated surface. Faces of the convex hull link them with the outside. (Poles of Voronoi cells:
Amenta & Bern 1999; labels from balls that overlap: Kolluri, Shewchuk & O'Brien 2004.)

Gauss's formula (`signedheat.solids.gauss`) needs an inside, which clouds need not have: on points of open sheets
(waves, terrains, saddles) it turns half of the normals, where these links turn none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.signed_graph import Links, signs_of
from .local_triangulations import FLAT, turned_alike
from .plane_fits import PlaneFits, fit_planes, noise_scale, noisy_sizes, point_spacing

SPREAD = 0.35
"""Distance between the noisy points that are kept, in reaches: larger than the noise that planes leave."""
MOST = 100_000
"""Number of points for which tets are made; the others take the signs of their neighbours."""
GIVEN_WEIGHT = 0.1
"""Weight of given signs, over half the sum of the weights of all links of a point."""
MOST_WRONG = 3.0
"""Given signs stay unless the share that seems wrong exceeds this many times the share of contradictions."""
WORSE = 0.0015
"""Gain of coherence for which larger neighbourhoods are taken, and loss at which no larger ones are tried."""
JOGGLE = 1e-4
"""Random move of points, over the distance to neighbours: flat faces and lattices are slow to triangulate."""
STEEPEST = 0.5
"""Cosine between a normal and the direction to a ball's centre below which a ball links no signs."""
LONE = 4.0
"""Distance from a point to its neighbours, over that of these to theirs, above which it is an outlier. Where spacing is
even it is up to 1.4, where density halves within three spacings 1.6."""
NEARBY = 8
"""Number of neighbours with which a point is compared directly."""
DIRECT_WEIGHT = 0.1
"""Weight of a link between neighbours, over that of a ball; with noisy points they weigh the same."""
UPWARD = np.array([0.01, 0.1, 1.0])
"""Direction of out where nothing decides it, as for points in a plane: up, and on vertical planes along the second
axis. If a component is halved or doubled, planes keep their sides."""
MUTUAL = 0.98
"""Share of pairs of near points with opposite normals of which each is below the other, less the share of those of
which each is above it, above which given normals are kept on thin sheets: there it is 1, and .9 if a fifth of the
normals are turned."""
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class OutwardSigns:
    """Signs that turn axes outwards."""

    signs: Floats  # (n,) 1 or −1
    sided: bool  # whether some link decides which side is out
    coherence: float  # share of the weights of links that the signs agree with, less the share that they contradict


def outward_normals(points: Floats, given: Floats | None = None) -> tuple[Floats, PlaneFits, OutwardSigns]:
    """Orient normals at (n, 3) distinct points outwards: the given ones, some of which are turned, or fitted ones."""
    if given is None:
        fits, outward = fitted_outward(points)
        return fits.axes * outward.signs[:, None], fits, outward
    fits = fit_planes(points, noise_scale(points, given))
    outward = outward_signs(fits, given, given=True)
    outward = replace(outward, signs=kept_on_thin_sheets(points, given, outward.signs))
    return given * outward.signs[:, None], fits, outward


def kept_on_thin_sheets(points: Floats, given: Floats, signs: Floats) -> Floats:
    """Keep the signs of given normals (n, 3) on thin sheets, if the normals fit each other there.

    Balls between the sides of a sheet thinner than the spacing are flat, and no evidence. Normals fit each other if of
    two near points with opposite ones each is below the other, all over the cloud; or above it, where all are inverted,
    or lie on both sides of a gap: then most of the other points decide.
    """
    k = min(NEARBY, len(points) - 1)
    distances, near = scipy.spatial.cKDTree(points).query(points, k=k + 1)
    flat = FLAT * point_spacing(distances[:, k:], k)
    offsets = points[near] - points[:, None]
    opposed = turned_alike(offsets, given[:, None], given[near], flat)[1]
    below = -np.sign((offsets * given[:, None]).sum(axis=2))[opposed]
    if len(below) == 0 or abs(below.mean()) < MUTUAL:
        return signs
    thin = opposed.any(axis=1)
    inverted = below.mean() < 0 and (signs[~thin] if not thin.all() else signs).sum() < 0
    return np.where(thin, -1.0 if inverted else 1.0, signs)


def fitted_outward(points: Floats) -> tuple[PlaneFits, OutwardSigns]:
    """Fit planes near (n, 3) distinct points, and find signs that turn their normals outwards.

    Too small neighbourhoods fit planes to noise, and too large ones to several sheets at once: either way the points
    contradict each other. The size with which they do so least is taken.
    """
    tried: list[tuple[PlaneFits, OutwardSigns]] = []
    for size in noisy_sizes(points) or (None,):
        fits = fit_planes(points, size)
        tried.append((fits, outward_signs(fits, fits.axes)))
        best = max(outward.coherence for _, outward in tried)
        if tried[-1][1].coherence < best - WORSE:
            break
    return next((fits, outward) for fits, outward in tried if outward.coherence >= best - WORSE)


def outward_signs(fits: PlaneFits, axes: Floats, given: bool = False, groups: Ints | None = None) -> OutwardSigns:
    """Find signs that turn axes (n, 3) outwards, the same for all points of a group (n,)."""
    # links between chosen points; node m of the graph is the outside, node m + 1 the signs as given
    n = len(axes)
    chosen = spread_out(fits.places, SPREAD * fits.reaches) if fits.noisy else np.arange(n)
    chosen = chosen[~_lone(fits.places[chosen], fits.reaches[chosen])]
    if len(chosen) > MOST:
        chosen = np.sort(np.random.default_rng(0).choice(chosen, MOST, replace=False))
    places = fits.places[chosen]
    links, sided = sign_links(places, axes[chosen], fits.reaches[chosen], fits.noisy)
    m = len(chosen)
    if given or not sided:
        typical = 0.5 * float(np.median(links.strength(m + 1)[:m]))
        own = np.ones(m) if given else axes[chosen] @ UPWARD
        links = Links.joined(links, Links(np.arange(m), np.full(m, m + 1), GIVEN_WEIGHT * typical * own))
    nodes = np.arange(m + 2)
    if groups is not None:
        outside = int(groups.max()) + 1
        nodes = np.unique(np.append(groups[chosen], [outside, outside + 1]), return_inverse=True)[1].ravel()
    # signs of the chosen points, relative to the outside or to the given signs; others follow their neighbours
    found = signs_of(links.renamed(nodes), int(nodes.max()) + 1)[nodes]
    signs = np.zeros(n)
    signs[chosen] = found[:m] * found[m if sided else m + 1]
    rest = np.flatnonzero(signs == 0)
    if len(rest):
        signs[rest] = _followed(places, axes[chosen] * signs[chosen, None], fits.places[rest], axes[rest])
    coherence = links.coherence(found)
    if groups is not None:  # the sign of the majority of each group
        signs = np.where(np.bincount(groups, signs) >= 0, 1.0, -1.0)[groups]
    if given and min((signs < 0).mean(), (signs > 0).mean()) <= MOST_WRONG * (1 - coherence):
        signs = np.full(n, 1.0 if signs.sum() >= 0 else -1.0)
    return OutwardSigns(signs, sided, coherence)


def _lone(places: Floats, reaches: Floats) -> Bools:
    """(n,) outliers: points farther from their neighbours than these are from theirs."""
    near = scipy.spatial.cKDTree(places).query(places, k=min(NEARBY + 1, len(places)), workers=-1)[1]
    return reaches > LONE * np.median(reaches[near.reshape(len(places), -1)[:, 1:]], axis=1)


def _followed(places: Floats, normals: Floats, others: Floats, axes: Floats) -> Floats:
    """Signs of axes at other places that agree with the normals around them."""
    distances, near = scipy.spatial.cKDTree(places).query(others, k=min(6, len(places)), workers=-1)
    distances, near = distances.reshape(len(others), -1), near.reshape(len(others), -1)
    weights = 1.0 / (distances + 1e-9 * max(float(distances.max()), np.finfo(float).tiny))
    cosines = np.einsum("nj,nkj->nk", axes, normals[near])
    return np.where((weights * cosines * np.abs(cosines)).sum(axis=1) >= 0, 1.0, -1.0)


def sign_links(places: Floats, axes: Floats, reaches: Floats, noisy: bool = False) -> tuple[Links, bool]:
    """Link the signs of axes (n, 3) by neighbours, balls, and with the outside, node n; say whether there are balls."""
    near = _neighbor_links(places, axes, 1.0 if noisy else DIRECT_WEIGHT)
    moves = np.random.default_rng(0).uniform(-1, 1, places.shape) * (JOGGLE * reaches[:, None])
    try:
        tets = scipy.spatial.Delaunay(places + moves)
    except (scipy.spatial.QhullError, ValueError):
        return near, False
    if tets.simplices.max() >= len(places):  # Qhull gave up on precision, and its point at infinity is a corner
        return near, False
    flat = np.ptp(places @ np.linalg.eigh(np.cov(places.T))[1][:, 0]) <= 10 * JOGGLE * float(reaches.max())
    if flat:
        return near, False
    balls = _ball_links(places, axes, tets.simplices.astype(np.int64))
    return Links.joined(near, balls, _hull_links(places, axes, tets)), True


def _confidence(cosines: Floats) -> Floats:
    """Signed fourth power of cosines, zero below `STEEPEST`."""
    return np.where(np.abs(cosines) > STEEPEST, np.sign(cosines) * cosines**4, 0.0)


def _ball_links(places: Floats, axes: Floats, tets: Ints) -> Links:
    corners = places[tets]
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


def _hull_links(places: Floats, axes: Floats, tets: scipy.spatial.Delaunay) -> Links:
    """Link faces of the hull with the outside: flat tets behind them do not tell the inner side."""
    tet, opposite = np.nonzero(tets.neighbors < 0)
    faces = tets.simplices[tet[:, None], (opposite[:, None] + [1, 2, 3]) % 4].astype(np.int64)
    a, b, c = places[faces].transpose(1, 0, 2)
    outward = np.cross(b - a, c - a)
    length = np.linalg.norm(outward, axis=1) * np.sign((outward * (a - places.mean(axis=0))).sum(axis=1))
    outward /= np.where(length != 0, length, np.inf)[:, None]
    weights = _confidence(np.einsum("fj,fkj->fk", outward, axes[faces]))
    return Links(faces.ravel(), np.full(faces.size, len(places)), weights.ravel())


def _neighbor_links(places: Floats, axes: Floats, weight: float) -> Links:
    """Link neighbours as if on a circle: reflected in the plane midway, one axis is the other."""
    n, k = len(places), min(NEARBY, len(places) - 1)
    neighbors = scipy.spatial.cKDTree(places).query(places, k=k + 1, workers=-1)[1].reshape(n, -1)[:, 1:]
    tails, heads = np.repeat(np.arange(n), k), neighbors.ravel()
    step = places[heads] - places[tails]
    length = np.linalg.norm(step, axis=1)
    step /= np.where(length > 0, length, 1.0)[:, None]
    here, there = axes[tails], axes[heads]
    cosines = (here * there).sum(axis=1) - 2 * (here * step).sum(axis=1) * (there * step).sum(axis=1)
    return Links(tails, heads, weight * _confidence(cosines))


def spread_out(points: Floats, radii: Floats) -> Ints:
    """Ids of points, none within the radius of an earlier one, and every point within that of one of them."""
    tree = scipy.spatial.cKDTree(points)
    free = np.ones(len(points), dtype=bool)
    for begin in range(0, len(points), _CHUNK):
        part = np.arange(begin, min(begin + _CHUNK, len(points)))
        part = part[free[part]]
        near = tree.query_ball_point(points[part], radii[part], workers=-1)
        ends = np.cumsum([0, *map(len, near)])
        _keep_first(part, ends, np.concatenate([*map(np.asarray, near), np.zeros(0)]).astype(np.int64), free)
    return np.flatnonzero(free)


@compiled
def _keep_first(ids: Ints, ends: Ints, near: Ints, free: Bools) -> None:
    for i in range(len(ids)):
        if free[ids[i]]:
            for k in range(ends[i], ends[i + 1]):
                if near[k] > ids[i]:
                    free[near[k]] = False
