"""A surface near the nodes of a grid: faces where they are there, crossings of a zero set where they are missing.

Positions are in units of length from the grid's first node. Grids have three axes.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ...errors import OutsideError
from ...geometry.face_band import nearest_in_band
from ...geometry.face_features import FaceFeatures
from ...geometry.nearest_faces import NearestFaces, facing, feet_of_nodes, search_from, walk_to_nearest
from ...geometry.point_triangle import foot_on_triangle
from ...parallel import n_threads
from .closest_points import circle_distance, nearest_tiles, seed_edge_ends
from .wavefront import SMALL, sweep_lines

BAND = 1.0
"""Half width, in cells, of the band in which every face near a node is looked at: at least half a cell's diagonal."""
NEAR = 2.0
"""Cells from a face within which it tells the side."""
PLANES = 16
"""Planes of nodes that one thread goes through, each after the one before."""


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """What is nearest to each node.

    Attributes
    ----------
    features : FaceFeatures
        The faces.
    crossings : (c, 18) float
        Points of a zero set where there are no faces; see `crossings_at`.
    steps : (3,) float
        Distance between nodes along each axis.
    owners : (s,) int
        Which face each sample lies on, or −1 minus which crossing it is.
    nearest : (*shape) int
        The sample that is nearest to each node, or nearly.
    """

    features: FaceFeatures
    crossings: NDArray[np.float64]
    steps: NDArray[np.float64]
    owners: NDArray[np.int32]
    nearest: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class FaceBand:
    """Feet of the nodes near faces.

    Attributes
    ----------
    nearest, squares : (*shape)
        Nearest foot of each node that has a face near it, −1 elsewhere; and the square of its distance.
    feet : (s, 4) float
        Positions, 0 in front.
    faces : (s,) int
        Where they lie.
    """

    nearest: NDArray[np.int32]
    squares: NDArray[np.float32]
    feet: NDArray[np.float32]
    faces: NDArray[np.int32]

    @classmethod
    def of(cls, features: FaceFeatures, shape: tuple[int, ...], steps: NDArray[np.float64]) -> FaceBand:
        """The band of `BAND` cells around faces."""
        nearest, squares = nearest_in_band(features.rows, shape, steps, BAND * float(steps.max()))
        feet, faces = feet_of_nodes(features.rows, nearest, steps)
        return cls(nearest, squares, feet, faces)

    def leave(self, edges: NDArray[np.int32], field: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of some crossed edges of the grid may be crossed farther than half a cell outside the band.

        (e, 5) edges as `crossed_edges` gives them, of a field with four axes. A crossing lies at most half a cell from
        the nearer end of its edge; where that is in the band, so nearly is the crossing.
        """
        near, far = edges[:, :4], edges[:, :4].copy()
        far[np.arange(len(edges)), edges[:, 4]] += 1
        swap = np.abs(field[tuple(near.T)]) > np.abs(field[tuple(far.T)])
        ends = np.where(swap[:, None], far, near)[:, 1:]
        feet: NDArray[np.int32] = self.nearest[tuple(ends.T)]
        return feet < 0

    def search(self, features: FaceFeatures, points: NDArray[np.float64], steps: NDArray[np.float64]) -> NearestFaces:
        """Nearest face of each of (n, 3) points, among those near the nodes of its cell and one layer around; or −1."""
        candidates = np.empty((len(points), 64), dtype=np.int32)
        _faces_around_cells(points, steps, self.nearest, self.faces, candidates)
        return search_from(features, points, candidates)


def sampled_surface(
    features: FaceFeatures,
    band: FaceBand,
    edges: NDArray[np.int32],
    crossings: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> SampledSurface:
    """Carry the feet of a band, which is used up, and crossings of edges to all nodes (Danielsson 1980).

    Raises
    ------
    OutsideError
        If there is nothing to carry.
    """
    if not len(band.faces) and not len(crossings):
        raise OutsideError(
            "there is nothing to measure distance to: the shape has no faces, and the field one sign everywhere",
            element="shape",
        )
    nearest, squares = band.nearest[None], band.squares[None]
    owners = np.concatenate([band.faces, -1 - np.arange(len(crossings), dtype=np.int32)])
    samples = np.concatenate([band.feet, crossings[:, :4].astype(np.float32)])
    padded = np.array([1.0, *steps])
    if len(crossings):
        seed_edge_ends(nearest, squares, edges, samples, padded, len(band.feet))
    sweep_lines(nearest_tiles, nearest.shape, 1, nearest, squares, samples, padded)
    return SampledSurface(features, crossings, steps, owners, nearest[0])


def signed_distances(
    surface: SampledSurface,
    inside: NDArray[np.bool_],
    trusted: NDArray[np.float32],
    telling: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Signed distance of every node to what is nearest to it or to nodes before; and how far that can be trusted.

    Near a face the face tells the side, where the surface is closed and consistent around the foot; elsewhere `inside`.

    Parameters
    ----------
    surface : SampledSurface
        What is near.
    inside : (*shape) bool
        Sides where no face tells them.
    trusted : (c,) float
        From 0 to 1, for each crossing; faces have 1.
    telling : (s,) bool, optional
        Samples whose faces tell a side; those of open sheets do not.
    """
    shape = surface.nearest.shape
    values, confidence = np.empty(shape), np.ones(shape, dtype=np.float32)
    cell, reach = float(surface.steps.max()), float(np.linalg.norm(surface.steps))
    features = surface.features
    told = np.ones(0, dtype=np.bool_) if telling is None else telling

    def planes(which: range) -> None:
        _distances_of_planes(
            features.rows,
            features.vertices,
            features.faces,
            features.across,
            features.vertex_starts,
            features.vertex_corners,
            features.spokes,
            features.edges,
            features.face_normals,
            features.edge_normals,
            features.vertex_normals,
            features.edge_regular,
            features.vertex_regular,
            surface.owners,
            surface.nearest,
            told,
            surface.crossings,
            trusted,
            surface.steps,
            (NEAR * cell) ** 2,
            reach,
            inside,
            which.start,
            which.stop,
            values,
            confidence,
        )

    threads = n_threads() if surface.nearest.size >= SMALL else 1
    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(planes, range(k, min(k + PLANES, shape[0]))) for k in range(0, shape[0], PLANES)]
        for job in jobs:
            job.result()
    return values, confidence


@compiled(nogil=True, error_model="numpy")
def _distances_of_planes(
    rows: NDArray[np.float64],
    places: NDArray[np.float64],
    faces: NDArray[np.int32],
    across: NDArray[np.int32],
    starts: NDArray[np.int64],
    around: NDArray[np.int32],
    spokes: NDArray[np.float32],
    edges: NDArray[np.int32],
    face_normals: NDArray[np.float64],
    edge_normals: NDArray[np.float64],
    vertex_normals: NDArray[np.float64],
    edge_regular: NDArray[np.bool_],
    vertex_regular: NDArray[np.bool_],
    owners: NDArray[np.int32],
    nearest: NDArray[np.int32],
    telling: NDArray[np.bool_],
    crossings: NDArray[np.float64],
    trusted: NDArray[np.float32],
    steps: NDArray[np.float64],
    near: float,
    reach: float,
    inside: NDArray[np.bool_],
    first: int,
    last: int,
    values: NDArray[np.float64],
    confidence: NDArray[np.float32],
) -> None:
    """See `signed_distances`; `near` is the square of a length.

    What is nearest to the nodes before, along each axis, are candidates, too: they are often right.
    """
    n1, n2 = nearest.shape[1:]
    away, side = np.zeros(4), np.empty(4)
    plane = np.full((n1, n2), np.int32(-1))  # the last face at each place, of this plane or the one before
    for i in range(first, last):
        before = np.int64(-1)
        for j in range(n1):
            for k in range(n2):
                x, y, z = i * steps[0], j * steps[1], k * steps[2]
                sample = nearest[i, j, k]
                own = np.int64(owners[sample])
                face, square, feature, fx, fy, fz = -1, np.inf, 0, x, y, z
                for candidate in range(4):
                    other = own
                    if candidate == 0:
                        other = np.int64(plane[j - 1, k]) if j > 0 else np.int64(-1)
                    elif candidate == 1:
                        other = before
                    elif candidate == 3:
                        other = np.int64(plane[j, k])
                    if other >= 0 and other != face:
                        s, which, u, v, w = foot_on_triangle(rows, other, x, y, z)
                        if s < square:
                            face, square, feature, fx, fy, fz = other, s, which, u, v, w
                if feature != 0:
                    face, square, feature, fx, fy, fz = walk_to_nearest(
                        rows,
                        places,
                        faces,
                        across,
                        starts,
                        around,
                        spokes,
                        vertex_regular,
                        x,
                        y,
                        z,
                        face,
                        square,
                        feature,
                        fx,
                        fy,
                        fz,
                    )
                before = face
                plane[j, k] = face
                distance, told = np.sqrt(square), square < near and (len(telling) == 0 or telling[sample])
                if own < 0:
                    c = -1 - own
                    away[1], away[2], away[3] = x - crossings[c, 1], y - crossings[c, 2], z - crossings[c, 3]
                    other_distance = circle_distance(crossings[c], away, side, reach)
                    if other_distance < distance:
                        distance, told = other_distance, False
                        confidence[i, j, k] = trusted[c]
                behind = inside[i, j, k]
                if told:
                    cosine, regular = facing(
                        faces,
                        edges,
                        face_normals,
                        edge_normals,
                        vertex_normals,
                        edge_regular,
                        vertex_regular,
                        face,
                        feature,
                        x - fx,
                        y - fy,
                        z - fz,
                        square,
                    )
                    if regular:
                        behind = cosine < 0.0
                values[i, j, k] = -distance if behind else distance


@compiled(nogil=True)
def _faces_around_cells(
    points: NDArray[np.float64],
    steps: NDArray[np.float64],
    nearest: NDArray[np.int32],
    faces: NDArray[np.int32],
    candidates: NDArray[np.int32],
) -> None:
    """Faces near the 4³ nodes around each point; −1 where a node has none, or the one before has the same."""
    n0, n1, n2 = nearest.shape
    for p in range(len(points)):
        i0 = np.int64(np.floor(points[p, 0] / steps[0])) - 1
        j0 = np.int64(np.floor(points[p, 1] / steps[1])) - 1
        k0 = np.int64(np.floor(points[p, 2] / steps[2])) - 1
        at = 0
        for i in range(i0, i0 + 4):
            for j in range(j0, j0 + 4):
                for k in range(k0, k0 + 4):
                    candidates[p, at] = -1
                    if 0 <= i < n0 and 0 <= j < n1 and 0 <= k < n2 and nearest[i, j, k] >= 0:
                        candidates[p, at] = faces[nearest[i, j, k]]
                    at += 1
