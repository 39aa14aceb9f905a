"""Point clouds, as domains, and, with normals, as sources in space; and the outward orientation of normals.

The ball around a Delaunay tet touches four points and contains none. Where it touches two of them along their normals,
it lies on the same side of the surface near both. So tets link the signs of normals, across edges, gaps and thin walls
alike, without a triangulated surface. Faces of the convex hull link them with the outside. (Poles of Voronoi cells:
Amenta & Bern 1999; labels from balls that overlap: Kolluri, Shewchuk & O'Brien 2004.)

Gauss's formula (`signedheat.solids.gauss`) needs an inside, which clouds need not have: on points of open sheets
(waves, terrains, saddles) it turns half of the normals, where these links turn none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..errors import GeometryError, InexactWarning, counted, percent, warn_user
from ..jobs import interruptible
from ..mesh.signed_graph import Links, signs_of
from ..mesh.unit_vectors import SAME_WAY, unit
from ..mesh.welding import same_rows
from ..parallel import PointTree
from ..shapes.exchange import Elements, Exchangeable
from ..validation import coordinates, finite_rows, frozen, numbers, whole_number
from .local_triangulations import SAME_SIDE_HEIGHT, LocalTriangulations, local_triangulations, opposed_normals
from .plane_fits import (
    CLEAN_NEIGHBORS,
    MERGED_SHARE,
    POINT_NEIGHBORS,
    PlaneFits,
    fit_planes,
    noise_scale,
    noisy_sizes,
    point_spacing,
    share_of_two_sides,
)
from .surface import Surface
from .triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    import trimesh  # noqa: F401  named in the base class

CONTRARY_NORMALS = 0.35
"""Share of the given normals, or of their inverses, that may contradict the orientation of the points. It is 0.39 to
0.49 where both sides of a plate are taken for one, and 0.3 where 0.3 of the normals are turned."""
BAD_SEAM = 0.35
"""Number of edges next to another side across which triangles face opposite ways, relative to the root of the number
of points, above which there is a warning. On scans, CAD and a box with up to 0.15 spacings of noise it is at most 0.07,
where parts of thin plates face the wrong way mostly 0.41 to 0.96."""


@dataclass(frozen=True, eq=False)
class PointCloud(Exchangeable["trimesh.PointCloud"], Surface):
    """Points in space of any dimension, with or without normals and areas.

    Parameters
    ----------
    points : (n, d) float
        Positions.
    normals : (n, d) float, optional
        Directions pointing out of the shape; normalised here. A zero normal is an error.
    areas : (n,) float, optional
        Surface area that each point represents. If absent, estimated from neighbours when needed.
    n_neighbors : int
        Size of the neighbourhoods in which tangent planes are fitted and triangles made, when distance is measured on
        the cloud.

    Raises
    ------
    GeometryError
        If there are no points, a value is NaN or infinite, a normal is zero, an area is not positive, lengths
        differ, or neighbourhoods are smaller than 3.

    See Also
    --------
    TriangleMesh : Triangles in space.
    as_shape : Convert objects of other packages.
    complete : Make a solid of a broken shape.

    Notes
    -----
    As a domain, a cloud needs no normals, and its normals need not be consistent. Normals and triangles are oriented
    together, each connected component to the side to which most of its given normals point; without given normals
    outward, and upward for points in a plane. The left of a curve is as seen from that side, unless the
    curve has normals of its own. Points that coincide count once; points without a triangle, such as outliers, get NaN.

    Examples
    --------
    >>> cloud = PointCloud([[0, 0, 0], [1, 0, 0]], normals=[[0, 0, 2], [0, 0, 1]])
    >>> cloud.normals[0]
    array([0., 0., 1.])
    """

    points: Floats
    normals: Floats | None
    areas: Floats | None
    n_neighbors: int
    _has_faces = False

    def __init__(
        self, points: ArrayLike, normals: ArrayLike | None = None, areas: ArrayLike | None = None, n_neighbors: int = 30
    ) -> None:
        positions = coordinates(points, "points")
        if len(positions) == 0:
            raise GeometryError("there are no points: the point cloud is empty", element="points")
        directions = sizes = None
        if normals is not None:
            directions = finite_rows(normals, "normals", positions.shape[1])
            _same_length(directions, positions, "normals")
            lengths = np.abs(directions).max(axis=1)
            if not lengths.all():
                zero = f"point {np.argmin(lengths)}"
                raise GeometryError(f"the normal of {zero} is zero", remedy="remove it or estimate it", element=zero)
            directions = directions / lengths[:, None]
            directions = frozen(directions / np.linalg.norm(directions, axis=1)[:, None])
        if areas is not None:
            sizes = numbers(areas, "areas")
            if sizes.ndim == 1:
                _same_length(sizes, positions, "areas")
            if sizes.ndim != 1 or not (np.isfinite(sizes) & (sizes > 0)).all():
                raise GeometryError("areas must be one positive, finite number per point", element="areas")
            sizes = frozen(sizes)
        neighbors = whole_number(n_neighbors, "n_neighbors", 3)
        vars(self).update(points=positions, normals=directions, areas=sizes, n_neighbors=neighbors)

    @classmethod
    def _of(cls, elements: Elements) -> PointCloud:
        return cls(elements.points, elements.normals, elements.areas)

    @property
    def _elements(self) -> Elements:
        if self.points.shape[1] != 3:
            raise GeometryError(
                f"files and other packages hold points in space, and these have {self.points.shape[1]} coordinates",
                remedy="add z = 0",
                element="points",
            )
        return Elements(self.points, normals=self.normals, areas=self.areas)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def n_vertices(self) -> int:
        """Number of points, each of which has a value of a field."""
        return len(self.points)

    @property
    def bounds(self) -> Floats:
        """(2, d) lower and upper corner of the box around the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def representatives(self) -> Ints:
        """(n,) first point that coincides with each point, within a ten-millionth of the size of the cloud."""
        lower, upper = self.bounds
        cell = 1e-7 * max(float((upper - lower).max()), np.finfo(float).tiny)
        cells = np.rint((self.points - lower) / cell)
        return frozen(same_rows(cells.astype(np.int64)))

    @cached_property
    def _distinct(self) -> tuple[Ints, LocalTriangulations]:
        """Ids of the distinct points, sorted by coordinates, and their local triangulations."""
        if self.points.shape[1] != 3:
            raise GeometryError(
                f"distance is measured on point clouds in space: points need 3 coordinates, not {self.points.shape[1]}",
                element="points",
            )
        ids = np.unique(self.representatives)
        ids = ids[np.lexsort(self.points[ids].T)]  # so that the order in which points are given decides nothing
        points, given = self.points[ids], None if self.normals is None else self.normals[ids]
        if len(ids) < 3:
            raise GeometryError(
                f"the point cloud has {len(ids)} distinct points, and a surface needs at least 3", element="points"
            )
        normals = given if given is not None and neighbors_agree(points, given) else outward_normals(points, given)[0]
        triangulated = local_triangulations(points, normals, self.n_neighbors, given)
        if len(triangulated.faces) == 0:
            raise GeometryError(
                "no triangles could be made of the point cloud: its points lie along a line or too far apart",
                remedy="add points, or raise n_neighbors",
                element="points",
            )
        against = 0.0 if given is None else float(((normals * given).sum(axis=1) < 0).mean())
        if min(against, 1 - against) > CONTRARY_NORMALS:
            warn_user(
                f"{percent(against)} of the normals contradict the sides that the points show, as on plates "
                "thinner than half of the distance between points",
                InexactWarning,
            )
        elif share_of_two_sides(points, triangulated.normals) > MERGED_SHARE:
            warn_user(
                "the points look like those of both sides of a plate thinner than they are apart, which are taken for "
                "one side with noise. Give normals, or more points",
                InexactWarning,
            )
        elif (turned := edges_turned(points, triangulated.normals, triangulated.faces)) > BAD_SEAM * np.sqrt(len(ids)):
            warn_user(
                f"along {turned} edges the sides of neighbours contradict each other: which side is which is a guess "
                "there. Give normals, or more points",
                InexactWarning,
            )
        return ids, triangulated

    @cached_property
    def triangulation(self) -> TriangleMesh:
        """The triangles that curves refer to; of points that coincide, the first is the vertex."""
        ids, triangulated = self._distinct
        return TriangleMesh(self.points, ids[triangulated.faces])

    @cached_property
    def surface_normals(self) -> Floats:
        """(n, 3) unit normals, estimated from neighbours, on the side to which the faces of `triangulation` point."""
        ids, triangulated = self._distinct
        normals = np.empty_like(self.points)
        normals[ids] = triangulated.normals
        return frozen(normals[self.representatives])

    def _triangulation_vertices(self, vertices: Ints) -> Ints:
        exists = (vertices >= 0) & (vertices < self.n_points)
        return np.where(exists, self.representatives[np.where(exists, vertices, 0)], vertices)

    def __repr__(self) -> str:
        normals = "without normals" if self.normals is None else "with normals"
        return f"PointCloud({counted(self.n_points, 'point')}, {normals})"


def edges_turned(points: Floats, normals: Floats, faces: Ints) -> int:
    """Count edges next to another side across which triangles face opposite ways."""
    halfedges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, uses = np.unique(halfedges, axis=0, return_counts=True)
    twice = edges[uses > 1]
    near = PointTree(points).query(points[twice], k=min(1 + CLEAN_NEIGHBORS, len(points)))[1]
    offsets = points[near] - points[twice][:, :, None]
    # a neighbour straight above or below lies on another side
    over = np.abs((offsets * normals[twice][:, :, None]).sum(axis=3)) > SAME_WAY * np.linalg.norm(offsets, axis=3)
    return int(over.any(axis=(1, 2)).sum())


def _same_length(values: Floats, points: Floats, name: str) -> None:
    if len(values) != len(points):
        raise GeometryError(f"there are {counted(len(points), 'point')}, but {len(values)} {name}", element=name)


KEPT_SPACING = 0.35
"""Least distance between the noisy points that are kept, in reaches: larger than the noise that planes leave."""
MOST_TET_POINTS = 100_000
"""Largest number of points for which tets are made; the others take the signs of their neighbours."""
WEAK_WEIGHT = 0.1
"""Weight of what tells sides less surely than balls do: of a link between neighbours, relative to that of a ball (with
noisy points they weigh the same), and of given signs, relative to half the typical sum of all links of a point."""
MOST_WRONG = 3.0
"""Given signs stay unless the share that seems wrong exceeds this many times the share of contradictions."""
COHERENCE_GAIN = 0.0015
"""Gain of coherence for which larger neighbourhoods are taken, and loss at which no larger ones are tried."""
JOGGLE = 1e-4
"""Random shift of points, relative to their reach, since flat faces and lattices are slow to triangulate."""
BALL_COSINE = 0.5
"""Cosine between a normal and the direction to a ball's centre below which a ball links no signs."""
OUTLIER_DISTANCE = 4.0
"""Distance from a point to its neighbours, relative to that from these to theirs, above which it is an outlier. It is
up to 1.4 where spacing is even, and 1.6 where density halves within three spacings."""
UPWARD = np.array([0.01, 0.1, 1.0])
"""Outward direction where nothing decides it, as for points in a plane: up, and on vertical planes along the second
axis. If a component is halved or doubled, planes keep their sides."""
MUTUALLY_BELOW = 0.98
"""Given normals are kept on thin sheets if, of all near points with opposite normals, the shares below and above the
other point differ by at least this. On thin sheets the difference is 1, and 0.9 if a fifth of the normals are turned.
"""
LISTED_AT_ONCE = 4096
"""Number of points whose neighbours are listed at once."""


@dataclass(frozen=True, eq=False)
class OutwardSigns:
    """Signs that turn axes outwards."""

    signs: Floats  # (n,) 1 or −1
    sided: bool  # whether some link decides which side is out
    coherence: float  # share of the weights of links that the signs agree with, less the share that they contradict


def outward_normals(points: Floats, given: Floats | None = None) -> tuple[Floats, PlaneFits, OutwardSigns]:
    """Orient normals at (n, 3) distinct points outwards: the given ones, some of which are inverted, or fitted ones."""
    if given is None:
        fits, outward = fitted_outward(points)
        return fits.axes * outward.signs[:, None], fits, outward
    fits = fit_planes(points, noise_scale(points, given))
    outward = outward_signs(fits, given, given=True)
    outward = replace(outward, signs=kept_on_thin_sheets(points, given, outward.signs))
    return given * outward.signs[:, None], fits, outward


def kept_on_thin_sheets(points: Floats, given: Floats, signs: Floats) -> Floats:
    """Keep the signs of given normals (n, 3) on sheets thinner than the spacing, where balls are no evidence.

    They are kept if, all over the cloud, near points with opposite normals are each below the other, or each above.
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
    """Fit planes to neighbourhoods of the size at which signs contradict each other least; return these signs, too."""
    tried: list[tuple[PlaneFits, OutwardSigns]] = []
    for size in noisy_sizes(points) or (None,):
        fits = fit_planes(points, size)
        tried.append((fits, outward_signs(fits, fits.axes)))
        best = max(outward.coherence for _, outward in tried)
        if tried[-1][1].coherence < best - COHERENCE_GAIN:
            break
    return next((fits, outward) for fits, outward in tried if outward.coherence >= best - COHERENCE_GAIN)


def outward_signs(fits: PlaneFits, axes: Floats, given: bool = False) -> OutwardSigns:
    """Find signs that turn axes (n, 3) outwards."""
    # links between chosen points; node m of the graph is the outside, node m + 1 the signs as given
    n = len(axes)
    chosen = spread_out(fits.places, KEPT_SPACING * fits.reaches) if fits.noisy else np.arange(n)
    chosen = chosen[~_lone(fits.places[chosen], fits.reaches[chosen])]
    if len(chosen) > MOST_TET_POINTS:
        chosen = np.sort(np.random.default_rng(0).choice(chosen, MOST_TET_POINTS, replace=False))
    places = fits.places[chosen]
    links, sided = sign_links(places, axes[chosen], fits.reaches[chosen], fits.noisy)
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
        signs[rest] = _followed(places, axes[chosen] * signs[chosen, None], fits.places[rest], axes[rest])
    coherence = links.coherence(decision)
    if given and min((signs < 0).mean(), (signs > 0).mean()) <= MOST_WRONG * (1 - coherence):
        signs = np.full(n, 1.0 if signs.sum() >= 0 else -1.0)
    return OutwardSigns(signs, sided, coherence)


def _lone(places: Floats, reaches: Floats) -> Bools:
    """(n,) whether a point is an outlier, much farther from its neighbours than these are from theirs."""
    near = PointTree(places).query(places, k=min(POINT_NEIGHBORS + 1, len(places)))[1]
    return reaches > OUTLIER_DISTANCE * np.median(reaches[near.reshape(len(places), -1)[:, 1:]], axis=1)


def _followed(places: Floats, normals: Floats, others: Floats, axes: Floats) -> Floats:
    """(k,) signs that make the axes at `others` (k, 3) agree with the normals around them."""
    distances, near = PointTree(places).query(others, k=min(6, len(places)))
    distances, near = distances.reshape(len(others), -1), near.reshape(len(others), -1)
    weights = 1.0 / (distances + 1e-9 * max(float(distances.max()), np.finfo(float).tiny))
    cosines = np.einsum("nj,nkj->nk", axes, normals[near])
    return np.where((weights * cosines * np.abs(cosines)).sum(axis=1) >= 0, 1.0, -1.0)


def sign_links(places: Floats, axes: Floats, reaches: Floats, noisy: bool = False) -> tuple[Links, bool]:
    """Link signs of axes (n, 3) by neighbours, balls and the hull (to the outside, node n); tell if there are balls."""
    near = _neighbor_links(places, axes, 1.0 if noisy else WEAK_WEIGHT)
    moves = np.random.default_rng(0).uniform(-1, 1, places.shape) * (JOGGLE * reaches[:, None])
    try:
        tets = interruptible(scipy.spatial.Delaunay, places + moves)
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
    """Signed fourth power of cosines, zero below `BALL_COSINE`."""
    return np.where(np.abs(cosines) > BALL_COSINE, np.sign(cosines) * cosines**4, 0.0)


def _ball_links(places: Floats, axes: Floats, tets: Ints) -> Links:
    """Link the signs at every two corners of a tet (t, 4) along whose axes its circumscribed ball lies."""
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
    """Link corners of the hull with the outside, which faces away from the mean: tets behind faces may be flat."""
    tet, opposite = np.nonzero(tets.neighbors < 0)
    faces = tets.simplices[tet[:, None], (opposite[:, None] + [1, 2, 3]) % 4].astype(np.int64)
    a, b, c = places[faces].transpose(1, 0, 2)
    outward = unit(np.cross(b - a, c - a))
    outward *= np.sign((outward * (a - places.mean(axis=0))).sum(axis=1))[:, None]
    weights = _confidence(np.einsum("fj,fkj->fk", outward, axes[faces]))
    return Links(faces.ravel(), np.full(faces.size, len(places)), weights.ravel())


def neighbors_agree(points: Floats, normals: Floats) -> bool:
    """Say whether nowhere among (n, 3) points the normals of neighbours contradict each other.

    Then whole components may face the wrong way, but no single points, for which balls would be needed. Normals that
    point the same way never contradict each other, even where noise puts one point above the other.
    """
    links = _neighbor_links(points, normals, 1.0)
    against = links.weights < 0
    first, second = normals[links.tails[against]], normals[links.heads[against]]
    return bool(((first * second).sum(axis=1) > SAME_WAY).all())


def _neighbor_links(places: Floats, axes: Floats, weight: float) -> Links:
    """Link neighbours as if on a circle: reflection in the plane midway between them maps one axis to the other."""
    n, k = len(places), min(POINT_NEIGHBORS, len(places) - 1)
    neighbors = PointTree(places).query(places, k=k + 1)[1].reshape(n, -1)[:, 1:]
    tails, heads = np.repeat(np.arange(n), k), neighbors.ravel()
    step = unit(places[heads] - places[tails])
    first, second = axes[tails], axes[heads]
    cosines = (first * second).sum(axis=1) - 2 * (first * step).sum(axis=1) * (second * step).sum(axis=1)
    return Links(tails, heads, weight * _confidence(cosines))


def spread_out(points: Floats, radii: Floats) -> Ints:
    """Ids, ascending, of the points (n, d) that are kept: those not within the radius (n,) of any kept before them."""
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
    """Unmark in `kept` the later neighbours ``near[ends[i]:ends[i + 1]]`` of each kept point ``ids[i]``."""
    for i in range(len(ids)):
        if kept[ids[i]]:
            for k in range(ends[i], ends[i + 1]):
                if near[k] > ids[i]:
                    kept[near[k]] = False
