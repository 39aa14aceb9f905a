"""What empty balls tell about the sides of points on an unknown surface.

The ball around a Delaunay tet touches four points and holds none. Where it touches two of them from along their
normals, it lies on one side of the surface near both: inside or outside, but the same. So the tets say how normals
known up to sign belong together, across edges, gaps and thin walls alike, without any triangulated surface. The hull's
faces say which side is out. (Poles of Voronoi cells: Amenta & Bern 1999; labels from balls that overlap: Kolluri,
Shewchuk & O'Brien 2004.)
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.signed_graph import Links

JOGGLE = 1e-4
"""Part of the distance to neighbours by which points are moved: flat faces and lattices are slow to triangulate."""
STEEPEST = 0.5
"""Cosine between a normal and the direction to a ball's centre below which the ball tells nothing about the side."""
NEARBY = 8
"""Neighbours that a point is compared with directly."""
DIRECT_WEIGHT = 0.1
"""Weight of a direct comparison beside that of a ball; that of a ball where the points are noisy."""


def sign_links(
    places: NDArray[np.float64], axes: NDArray[np.float64], reaches: NDArray[np.float64], noisy: bool = False
) -> tuple[Links, bool]:
    """What balls and neighbours say about the signs of axes; whether there were balls.

    One node past the points is the outside, whose sign is 1. Points in a plane have no tets: then there are links
    between neighbours alone, and none with the outside.

    Parameters
    ----------
    places : (n, 3) float
        Distinct points.
    axes : (n, 3) float
        Unit normals, up to sign.
    reaches : (n,) float
        Distance to neighbours.
    noisy : bool
        Whether places are known so roughly that balls tell no more than neighbours.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(1).vertices
    >>> links, _ = sign_links(ball, ball, np.ones(len(ball)))
    >>> bool((links.weights >= 0).all())
    True
    """
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


def _confidence(cosines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed fourth power of cosines, zero where they tell nothing."""
    return np.where(np.abs(cosines) > STEEPEST, np.sign(cosines) * cosines**4, 0.0)


def _ball_links(places: NDArray[np.float64], axes: NDArray[np.float64], tets: NDArray[np.int64]) -> Links:
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
    told = weights != 0
    tails, heads = (np.concatenate([tets[:, pair[k]] for pair in pairs])[told] for k in (0, 1))
    return Links(tails, heads, weights[told])


def _hull_links(places: NDArray[np.float64], axes: NDArray[np.float64], tets: scipy.spatial.Delaunay) -> Links:
    tet, opposite = np.nonzero(tets.neighbors < 0)
    faces = tets.simplices[tet[:, None], (opposite[:, None] + [1, 2, 3]) % 4].astype(np.int64)
    a, b, c = places[faces].transpose(1, 0, 2)
    outward = np.cross(b - a, c - a)
    inner = places[tets.simplices[tet, opposite]] - a
    length = np.linalg.norm(outward, axis=1) * -np.sign((outward * inner).sum(axis=1))
    outward /= np.where(length != 0, length, np.inf)[:, None]
    weights = _confidence(np.einsum("fj,fkj->fk", outward, axes[faces]))
    return Links(faces.ravel(), np.full(faces.size, len(places)), weights.ravel())


def _neighbor_links(places: NDArray[np.float64], axes: NDArray[np.float64], weight: float) -> Links:
    """Neighbours compared as if on a circle: one axis reflected in the plane midway is the other."""
    n, k = len(places), min(NEARBY, len(places) - 1)
    neighbors = scipy.spatial.cKDTree(places).query(places, k=k + 1, workers=-1)[1].reshape(n, -1)[:, 1:]
    tails, heads = np.repeat(np.arange(n), k), neighbors.ravel()
    step = places[heads] - places[tails]
    length = np.linalg.norm(step, axis=1)
    step /= np.where(length > 0, length, 1.0)[:, None]
    here, there = axes[tails], axes[heads]
    cosines = (here * there).sum(axis=1) - 2 * (here * step).sum(axis=1) * (there * step).sum(axis=1)
    return Links(tails, heads, weight * _confidence(cosines))
