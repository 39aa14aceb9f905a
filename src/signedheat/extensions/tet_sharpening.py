"""Sharpening of distance on tets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Note, RoundCorners
from ..discretization import SourceTerm, discretize
from ..fields.tet_field import TetField
from ..geometry.box_tree import BoxTree
from ..geometry.geodesics.any_angle import FacePlanes, any_angle_distance
from ..geometry.geodesics.heap_kernels import Queue
from ..geometry.marching_tets import level_triangles
from ..geometry.nearest import nearest_on_triangles
from ..geometry.tet_clipping import barycentric
from ..geometry.visibility import tet_neighbors
from ..lowering.tets.discretization import TetDiscretization
from ..operators.linear_elements import LinearElements
from ..parallel import run_cancellable
from ..progress import Progress
from .sharpening import Method, sharpen_field, sharpened
from .sharpening_methods import straight_distance

GRAZING = 1e-6
"""Distance, relative to the size of the tets, by which a line may lie outside the mesh."""

LARGEST_BEND = 1.0
"""Limit on the quadratic correction of the zero set, relative to h; at creases of φ the correction has no meaning."""


@sharpen_field.register
def _(field: TetField, method: Method | None = None, progress: Progress | None = None) -> TetField:
    lowered = discretize(field.mesh)
    assert isinstance(lowered, TetDiscretization)
    elements = LinearElements.on_tets(field.mesh.geometry, lowered.unknowns, lowered.n_unknowns)
    new, diagnostics = sharpened(field, lowered, elements, field.values[lowered.vertices], method, progress)
    return replace(field, values=lowered.at_vertices(new), diagnostics=diagnostics)


@straight_distance.register
def _(
    lowered: TetDiscretization,
    values: NDArray[np.float64],
    source: SourceTerm | None,
    tolerance: float,
    report: Callable[[], None] | None,
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Any-angle distance from the zero set in space, around the boundary of the mesh.

    A curved φ does not vanish where its linear interpolant does. The difference is known to second order from the
    gradients at the corners of the tet: ``½ Σ_k λ_k(x) ∇φ_k · (x − p_k)``.
    """
    mesh, planes, unknowns = lowered.mesh, lowered.planes, lowered.unknowns
    points = mesh.vertices[lowered.vertices] - planes.center
    positions, corners, owners = level_triangles(points, unknowns, values, 0.0)
    if not len(corners):
        return np.full(len(values), np.inf), ()
    triangles = positions[corners]
    nearest, _ = nearest_on_triangles(triangles, BoxTree.of(triangles.min(axis=1), triangles.max(axis=1)), points)
    nearest[np.isnan(values)] = -1
    walls = FacePlanes(
        unknowns, tet_neighbors(mesh.faces), mesh.faces.tet_faces, planes.normals, planes.offsets, planes.signs
    )
    tets_at, triangles_at = by_element(unknowns, len(values), 4), by_element(corners, len(positions), 3)
    distance, nearest, feet, hidden = run_cancellable(
        lambda: any_angle_distance(
            walls,
            points,
            *tets_at,
            triangles,
            corners,
            *triangles_at,
            owners,
            nearest,
            GRAZING * lowered.spacing,
            Queue.empty(len(points)),
        ),
        report,
    )
    reached = np.flatnonzero(np.isfinite(distance))
    tets, feet = owners[nearest[reached]], feet[reached]
    weights = barycentric(mesh, tets, feet + planes.center)
    gradients = mesh.geometry.mean_gradients(np.nan_to_num(values), unknowns, len(values))[unknowns[tets]]
    slope = np.linalg.norm(np.einsum("pk,pki->pi", weights, gradients), axis=1)
    rise = 0.5 * np.einsum("pk,pki,pki->p", weights, gradients, feet[:, None] - points[unknowns[tets]])
    most = LARGEST_BEND * lowered.spacing
    bend = np.clip(rise / np.where(slope > 0, slope, np.inf), -most, most)
    distance[reached] = np.maximum(distance[reached] + np.copysign(1.0, values[reached]) * bend, 0.0)
    return distance, (RoundCorners(int(hidden)),)


def by_element(ids: NDArray[np.int64], n: int, width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Inverse index: where the rows that contain each of n ids begin, and these rows, `width` ids to a row."""
    starts = np.concatenate([[0], np.cumsum(np.bincount(ids.ravel(), minlength=n))])
    return starts, np.argsort(ids.ravel(), kind="stable") // width
