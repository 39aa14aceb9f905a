"""Sharpening on tets: distance to faces and to the zero set along straight lines, which bend around the boundary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Ints
from ..diagnostics import Note, RoundCorners, SharpenedToShape
from ..discretization import SourceTerm
from ..errors import SourceError
from ..foreign import SurfaceShape, as_shapes
from ..geodesics.heap_kernels import Queue
from ..jobs import run_cancellable
from ..joining import joined_triangles
from ..kinds import Shapes
from ..linear_elements import LinearElements
from ..mesh.components import grouped
from ..progress import Progress
from ..search.face_features import FaceFeatures
from ..search.face_tree import FaceTree
from ..search.nearest_triangles import TriangleTree
from ..sharpening_methods import Method, Nearest, nearest, sharpen_field, sharpened
from ..surfaces.point_cloud import PointCloud
from .any_angle import any_angle_distance
from .marching_tets import level_triangles
from .tet_clipping import barycentric
from .tet_discretization import TetDiscretization, lowered_tets
from .tet_field import TetField
from .visibility import GRAZING

NEAR = 2.0
"""Mean edges from a face within which its side decides the sign."""
FAR = 1.5
"""Mean edges: the zero set farther than that from any face completes the shape."""
LARGEST_BEND = 1.0
"""Limit on the quadratic correction of the zero set, relative to h; at creases of φ the correction has no meaning."""


@sharpen_field.register
def _(field: TetField, source: Shapes | None, method: Method | None, progress: Progress | None) -> TetField:
    lowered = lowered_tets(field.mesh)  # of which nothing is solved
    elements = LinearElements.on_tets(field.mesh.geometry, lowered.unknowns, lowered.n_unknowns)
    given = None if source is None else as_shapes(source)
    values = field.values[lowered.vertices]
    new, diagnostics = sharpened(field, lowered, elements, values, given, method, progress)
    return replace(field, values=lowered.at_vertices(new), diagnostics=diagnostics)


@nearest.register
def _(
    lowered: TetDiscretization,
    values: Floats,
    source: SourceTerm | None,
    given: Sequence[SurfaceShape] | None,
    tolerance: float,
    report: Callable[[], None] | None,
) -> Nearest:
    """Any-angle distance in space, around the boundary of the mesh, to faces given and the zero set where none is.

    The zero set counts farther than `FAR` mean edges from all faces. Within `NEAR` mean edges of a face its side
    decides the sign, where the shape is closed and consistent around the nearest place.
    """
    points = lowered.mesh.vertices[lowered.vertices] - lowered.planes.center
    positions, corners, owners = level_triangles(points, lowered.unknowns, values, 0.0)
    sides = np.zeros(len(values), dtype=np.int64)
    notes: tuple[Note, ...] = ()
    features = None if given is None else faces_of(given, lowered.planes.center)
    if features is None:
        surface = Surface(positions, corners, owners)
    else:
        tree, n_faces = FaceTree.of(features), len(features.rows)
        missing = tree.distances(positions[corners].mean(axis=1)) > FAR * lowered.spacing
        surface = Surface(
            np.concatenate([features.vertices, positions]),
            np.concatenate([features.faces, corners[missing] + len(features.vertices)]),
            np.concatenate([np.full(n_faces, -1), owners[missing]]),
        )
        notes = (SharpenedToShape(float(missing.mean()) if len(missing) else 0.0),)
    if not len(surface.corners):
        return Nearest(np.full(len(values), np.inf), sides)
    found = run_cancellable(lambda: distance_around(lowered, points, values, surface), report)
    if features is not None:
        near = tree.search(points)
        decided = near.regular & (near.distances < NEAR * lowered.spacing)
        decided &= (found.nearest < n_faces) & (found.distances <= near.distances * (1 + 1e-9))
        sides[decided] = np.where(near.cosines < 0, -1, 1)[decided]
    return Nearest(found.distances, sides, (RoundCorners(found.hidden), *notes))


def faces_of(shapes: Sequence[SurfaceShape], center: Floats) -> FaceFeatures | None:
    """The faces of some shapes around a centre; None if none has any extent."""
    meshes = [shape for shape in shapes if not isinstance(shape, PointCloud)]
    if len(meshes) != len(shapes):
        raise SourceError("fields on tets are sharpened to faces, and points have none", element="shape")
    features = FaceFeatures.of(*joined_triangles(meshes, center))
    return features if len(features.rows) else None


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

    positions: Floats
    corners: Ints
    owners: Ints


@dataclass(frozen=True, eq=False)
class Reached:
    """Distances to a surface, without sign: see `any_angle_distance`."""

    distances: Floats
    nearest: Ints
    points: Floats
    hidden: int


def distance_around(lowered: TetDiscretization, points: Floats, values: Floats, surface: Surface) -> Reached:
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
    weights = barycentric(mesh.geometry, tets, places + planes.center)
    gradients = mesh.geometry.mean_gradients(np.nan_to_num(values), unknowns, len(values))[unknowns[tets]]
    slope = np.linalg.norm(np.einsum("pk,pki->pi", weights, gradients), axis=1)
    rise = 0.5 * np.einsum("pk,pki,pki->p", weights, gradients, places[:, None] - points[unknowns[tets]])
    most = LARGEST_BEND * lowered.spacing
    bend = np.clip(rise / np.where(slope > 0, slope, np.inf), -most, most)
    distance[curved] = np.maximum(distance[curved] + np.copysign(1.0, values[curved]) * bend, 0.0)
    return Reached(distance, nearest, found, int(hidden))


def by_element(ids: Ints, n: int, width: int) -> tuple[Ints, Ints]:
    """Inverse index: where the rows that contain each of n ids begin, and these rows, `width` ids to a row."""
    starts, places = grouped(ids.ravel(), n)
    return starts, places // width
