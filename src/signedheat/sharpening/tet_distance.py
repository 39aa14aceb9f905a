"""Distance on tets along straight lines in space, which bend around the boundary of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.components import grouped
from ..geometry.geodesics.any_angle import any_angle_distance
from ..geometry.geodesics.heap_kernels import Queue
from ..geometry.nearest import TriangleTree
from ..geometry.tet_clipping import barycentric
from ..geometry.visibility import GRAZING
from ..lowering.tets.discretization import TetDiscretization

LARGEST_BEND = 1.0
"""Limit on the quadratic correction of the zero set, relative to h; at creases of φ the correction has no meaning."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that distance on tets is measured to.

    Attributes
    ----------
    positions : (p, 3) float
        Around the centre of the mesh.
    corners : (k, 3) int
        Of the triangles; corners that coincide have the same id.
    owners : (k,) int
        The tet that each triangle lies in; −1 for such as lie in several.
    """

    positions: NDArray[np.float64]
    corners: NDArray[np.int64]
    owners: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Reached:
    """Distances to a surface, without sign: see `any_angle_distance`."""

    distances: NDArray[np.float64]
    nearest: NDArray[np.int64]
    points: NDArray[np.float64]
    hidden: int


def distance_around(
    lowered: TetDiscretization, points: NDArray[np.float64], values: NDArray[np.float64], surface: Surface
) -> Reached:
    """Any-angle distance of all points with a value from a surface, of which triangles in one tet are φ's zero set.

    A curved φ does not vanish where its linear interpolant does. The difference is known to second order from the
    gradients at the corners of the tet: ``½ Σ_k λ_k(x) ∇φ_k · (x − p_k)``.
    """
    mesh, planes, unknowns = lowered.mesh, lowered.planes, lowered.unknowns
    triangles = surface.positions[surface.corners]
    tree = TriangleTree.of(triangles)
    nearest, _ = tree.nearest(points)
    nearest[np.isnan(values)] = -1
    tets_at = by_element(unknowns, len(values), 4)
    triangles_at = by_element(surface.corners, len(surface.positions), 3)
    queue = Queue.empty(len(points))
    slack = GRAZING * lowered.spacing
    distance, nearest, found, hidden = any_angle_distance(
        planes,
        mesh.faces.neighbors,
        unknowns,
        points,
        *tets_at,
        tree.rows,
        surface.corners,
        *triangles_at,
        surface.owners,
        nearest,
        slack,
        queue,
    )
    curved = np.flatnonzero(np.isfinite(distance) & (surface.owners[nearest] >= 0))
    tets, places = surface.owners[nearest[curved]], found[curved]
    weights = barycentric(mesh, tets, places + planes.center)
    gradients = mesh.geometry.mean_gradients(np.nan_to_num(values), unknowns, len(values))[unknowns[tets]]
    slope = np.linalg.norm(np.einsum("pk,pki->pi", weights, gradients), axis=1)
    rise = 0.5 * np.einsum("pk,pki,pki->p", weights, gradients, places[:, None] - points[unknowns[tets]])
    most = LARGEST_BEND * lowered.spacing
    bend = np.clip(rise / np.where(slope > 0, slope, np.inf), -most, most)
    distance[curved] = np.maximum(distance[curved] + np.copysign(1.0, values[curved]) * bend, 0.0)
    return Reached(distance, nearest, found, int(hidden))


def by_element(ids: NDArray[np.int64], n: int, width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Inverse index: where the rows that contain each of n ids begin, and these rows, `width` ids to a row."""
    starts, places = grouped(ids.ravel(), n)
    return starts, places // width
