"""Sharpening to a shape: exact distance where it is there, a zero set where it is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, singledispatch
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError
from ..geometry.face_features import FaceFeatures
from ..geometry.face_tree import FaceTree
from ..geometry.nearest_faces import NearestFaces
from ..geometry.winding_tree import WindingTree
from ..operators.grid.closest_points import crossed_edges, crossings_at
from ..operators.grid.exact_surface import ExactSurface
from ..operators.grid.fitted_points import REACH, fitted_to_points, mean_gap, points_as_crossings
from ..operators.grid.layering import layered_faces
from ..operators.grid.sampled_surface import FaceBand, sampled_surface, signed_distances
from ..parallel import over_slabs

Fit = Literal["auto", "exact", "smooth"]
"""Which faces distance is measured to: all but those that lie in layers, all, or none."""
Shape = TriangleMesh | PolygonMesh | PointCloud

FAR = 1.5
"""Cells: what the zero set has farther from any face stands in for missing surface."""
BEYOND, LEVEL = 0.3, 0.5
"""Cells from the end of a face from which on it does so there, too, up to this sine of the angle with the face."""
COVERED, CLEAR = 0.5, 0.25
"""Winding numbers above which no face has its front, which is at most 0, and below which hardly one its back."""
DOUBT = 0.05
"""Distance from the shape, over its diagonal, at which confidence in a completed surface has fallen to a half."""


@singledispatch
def triangles_of(shape: object) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles that a shape in space consists of."""
    raise SourceError(
        f"a field on a grid in space is sharpened to a TriangleMesh, PolygonMesh or PointCloud, "
        f"not to a {type(shape).__name__}",
        element="shape",
    )


@triangles_of.register
def _(shape: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    return shape.vertices, shape.faces


@triangles_of.register
def _(shape: PolygonMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles as they are, other polygons as fans around their centroids."""
    centres = shape.n_vertices + shape.corner_polygons
    fans = np.stack([shape.corners, shape.next_corners, centres], axis=1)
    return np.concatenate([shape.vertices, shape.polygon_centroids]), fans


@dataclass(frozen=True, eq=False)
class Assembled:
    """Distance put together from a shape and a zero set.

    Attributes
    ----------
    values, confidence : (*shape) float
        At the nodes.
    surface : ExactSurface
        What distance is measured to.
    layered, completed : float
        Share of the faces that were left out as layers, and of the zero set that stands in for missing surface.
    """

    values: NDArray[np.float64]
    confidence: NDArray[np.float32]
    surface: ExactSurface
    layered: float
    completed: float


def assemble(
    parts: Sequence[Shape],
    grid: Grid,
    sides: NDArray[np.float64],
    fit: Fit | Literal["alone"],
    phi: Callable[[], NDArray[np.float64]] | None = None,
    tells: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
    restored: NDArray[np.bool_] | None = None,
) -> Assembled:
    """Signed distance to shapes, and to the zero set of `sides` where they are missing.

    1. The zero set is fitted to the points of clouds (`fitted_to_points`); points far from it stand for themselves.
    2. Faces that lie in layers are left out (`layered_faces`), as all are where the fit is to be smooth; where it is
       "alone", only those that touch no other.
    3. Crossings of the zero set away from the others, or beyond their ends, stand in for what is missing (`stands_in`).
    4. All nodes find the nearest of both (`sampled_surface`), and the sides from faces nearby or from `sides`.

    Around layers what `phi` returns, where given, takes the place of `sides`, which need not run in their middle; it is
    called where there are layers only, and its memory is used. Faces tell no side where `tells`, given (s, 3) places on
    them in cells from the first node, is False.
    """
    steps = np.array(grid.spacing)

    @cache
    def middle() -> NDArray[np.float64]:
        return sides if phi is None else phi()

    clouds = [part for part in parts if isinstance(part, PointCloud)]
    for cloud in clouds if fit != "smooth" else []:
        if cloud.normals is None:
            raise SourceError("the point cloud has no normals, which say what is inside", remedy="give it normals")
        sides = fitted_to_points(sides, steps, cloud.points - grid.origin, cloud.normals)
    joined = joined_triangles([part for part in parts if not isinstance(part, PointCloud)], grid.origin)
    features = FaceFeatures.of(*joined, None if restored is None else _trust_in_faces(*joined, restored))
    band = FaceBand.of(features, grid.shape, steps)
    whole, n_faces = features, len(features.rows)
    left_out = np.full(n_faces, fit == "smooth")
    if fit in ("auto", "alone") and n_faces:
        left_out = layered_faces(features, band, middle, steps)
        if fit == "alone":
            left_out &= np.all(features.across < 0, axis=1)
    if left_out.any():
        if phi is not None:
            there = middle()
            np.copyto(there, sides, where=~_around_faces(left_out, band))
            sides = there
        kept = features.faces[~left_out].astype(np.int64)
        features = FaceFeatures.of(features.vertices, kept, features.trusted[~left_out])
        band = FaceBand.of(features, grid.shape, steps)
    edges, crossings, completed = _missing(sides, features, band, steps)
    gaps = max((REACH * mean_gap(cloud.points) for cloud in clouds), default=0.0)
    for cloud in clouds if fit != "smooth" else []:
        kept = _unreached(cloud.points - grid.origin, cloud.normals, crossings, gaps + FAR * float(steps.max()))
        nodes, rows = points_as_crossings(*kept, steps, grid.shape)
        edges, crossings = np.concatenate([edges, nodes]), np.concatenate([crossings, rows])
    nearby = sampled_surface(features, band, edges, crossings, steps)
    telling, telling_faces = (None, None) if tells is None else _telling(tells, features, band, len(crossings), steps)
    surface = ExactSurface(features, crossings, np.array(grid.origin), steps, telling_faces, nearby.nearest)
    trees = []
    if len(crossings) and n_faces:
        trees = [surface.tree if whole is features else FaceTree.of(whole)]
    points = [cloud.points - grid.origin for cloud in clouds]
    trusted = confidence_at(np.ascontiguousarray(crossings[:, 1:4]), trees, points, gaps)
    inside = sides < 0
    values, confidence = signed_distances(nearby, inside, trusted, telling)
    _unfold(values, inside, surface)
    share = float(left_out.mean()) if n_faces else 0.0
    return Assembled(values, confidence, surface, share, completed)


def _unfold(values: NDArray[np.float64], inside: NDArray[np.bool_], surface: ExactSurface) -> None:
    """Turn, in place, values with the sign of a face that is folded over: the whole shape winds the other way there."""
    if not len(surface.features.rows):  # all faces lie in layers
        return
    turned = np.empty(inside.shape, dtype=bool)

    def planes(here: slice) -> None:
        turned[here] = (values[here] < 0) != inside[here]

    over_slabs(planes, inside.shape)
    doubtful = np.argwhere(turned)
    if not len(doubtful):
        return
    triangles = surface.features.corners.reshape(-1, 3, 3)
    winding = WindingTree(triangles, surface.tree.tree).numbers(doubtful * surface.steps)
    doubtful = doubtful[np.where(inside[tuple(doubtful.T)], winding > COVERED, winding < CLEAR)]
    values[tuple(doubtful.T)] *= -1.0


def _missing(
    sides: NDArray[np.float64], features: FaceFeatures, band: FaceBand, steps: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64], float]:
    """Crossed edges of the zero set of `sides` where faces are missing; crossings there; their share."""
    edges = crossed_edges(sides[None])
    n_edges = len(edges)
    with_ends: NDArray[np.bool_] = np.any(features.across < 0, axis=1)
    edges = edges[band.leave(edges, sides[None], with_ends)]
    if not len(edges):
        return edges, np.empty((0, 18)), 0.0
    crossings = crossings_at(sides[None], edges, np.array([1.0, *steps]))
    points = np.ascontiguousarray(crossings[:, 1:4])
    missing = stands_in(band.search(features, points, steps), float(steps.max()))
    return edges[missing], crossings[missing], float(missing.sum() / n_edges)


def stands_in(found: NearestFaces, cell: float) -> NDArray[np.bool_]:
    """(n,) whether places of a zero set are where faces are missing: far from the nearest, or beyond an end of it."""
    beyond = ~found.regular & (np.abs(found.cosines) < LEVEL) & (found.distances > BEYOND * cell)
    return beyond | (found.distances > FAR * cell)


def _telling(
    tells: Callable[[NDArray[np.float64]], NDArray[np.bool_]],
    features: FaceFeatures,
    band: FaceBand,
    n_crossings: int,
    steps: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Feet of a band, followed by crossings, and faces that tell a side; a face does where most of its feet do."""
    feet = tells(band.feet[:, 1:] / steps)
    votes = np.bincount(band.faces, np.where(feet, 1, -1), len(features.rows))
    faces = votes > 0
    silent = np.bincount(band.faces, minlength=len(votes)) == 0  # faces too small to be the nearest of any node
    faces[silent] = tells(features.corners[silent].reshape(-1, 3, 3).mean(axis=1) / steps)
    return np.concatenate([feet, np.zeros(n_crossings, dtype=bool)]), faces


def _unreached(
    points: NDArray[np.float64], normals: NDArray[np.float64] | None, crossings: NDArray[np.float64], far: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points, and their normals, that the zero set keeps away from: of sheets, and of walls thinner than a cell."""
    assert normals is not None
    alone = np.ones(len(points), dtype=bool)
    if len(crossings):
        alone = scipy.spatial.cKDTree(crossings[:, 1:4]).query(points, workers=-1)[0] > far
    return points[alone], normals[alone]


def _around_faces(chosen: NDArray[np.bool_], band: FaceBand) -> NDArray[np.bool_]:
    """Nodes near some faces, and the two layers around them."""
    near = band.nearest >= 0
    near[near] = chosen[band.faces[band.nearest[near]]]
    return np.asarray(scipy.ndimage.binary_dilation(near, iterations=2))


def confidence_at(
    points: NDArray[np.float64], trees: Sequence[FaceTree], clouds: Sequence[NDArray[np.float64]], gap: float = 0.0
) -> NDArray[np.float32]:
    """(n,) from 1 at the shape to 0 far from it: ``1 / (1 + excess / (DOUBT · diagonal))``, excess beyond a gap."""
    places = [tree.features.corners.reshape(-1, 3) for tree in trees] + list(clouds)
    if not len(points) or not sum(map(len, places)):
        return np.zeros(len(points), dtype=np.float32)
    diagonal = float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0)))
    distances = [tree.distances(points) for tree in trees]
    distances += [scipy.spatial.cKDTree(cloud).query(points, workers=-1)[0] for cloud in clouds]
    excess = np.maximum(np.min(distances, axis=0) - gap, 0.0)
    return _trust_at(excess, DOUBT * diagonal).astype(np.float32)


def _trust_in_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], restored: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """(m,) 1 in faces that were there; in others as at the centre of their incircle, as far from the rim as can be."""
    corners = vertices[faces[restored]]
    sides = np.roll(corners, -1, axis=1) - corners
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    radii = areas / np.maximum(np.linalg.norm(sides, axis=2).sum(axis=1), np.finfo(float).tiny)
    doubt = DOUBT * float(np.linalg.norm(np.ptp(vertices[faces].reshape(-1, 3), axis=0)))
    trust = np.ones(len(faces), dtype=np.float32)
    trust[restored] = np.minimum(_trust_at(radii, doubt), np.nextafter(np.float32(1.0), np.float32(0.0)))
    return trust


def _trust_at(distances: NDArray[np.float64], doubt: float) -> NDArray[np.float64]:
    """(n,) from 1 where distances are zero to 1/2 where they are `doubt`, which is zero for shapes of one point."""
    return np.divide(doubt, doubt + distances, out=np.ones_like(distances), where=distances > 0)


def joined_triangles(
    parts: Sequence[Shape], origin: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices around `origin` and triangles of shapes with faces."""
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for part in parts:
        positions, corners = triangles_of(part)
        vertices.append(positions - origin)
        faces.append(corners + count)
        count += len(positions)
    return np.concatenate(vertices), np.concatenate(faces)
