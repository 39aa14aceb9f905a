"""Closed meshes of solids, and how far they are from the faces that were given."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from ..errors import GeometryError, SourceError
from ..grids.grid import Grid
from ..mesh.components import element_components
from ..mesh.edges import edge_table
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import face_areas, part_volumes
from ..search.face_tree import FaceTree
from ..surfaces.triangle_mesh import TriangleMesh
from .kept_faces import given_surface, unjoined
from .simplification import simplified
from .solid import Solid

BOUNDS = 1e-3
"""A shape is a sheet if a smaller share of its area is on the boundary of its solid."""
PARTS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3]])
"""Barycentric coordinates at which distances of a triangle are measured: corners, middles of sides, and centre."""


def closed_surface(
    solid: Solid,
    thickness: float | None = None,
    contoured: bool = False,
    tolerance: float | None = None,
    resolution: int = 256,
    spacing: float | None = None,
) -> tuple[TriangleMesh, str]:
    """Make a closed surface of a solid, and say how; the options are those of `signedheat.batches.Watertight`."""

    def contour(level: float) -> TriangleMesh:
        return solid.surface(level, tolerance=tolerance, resolution=resolution, spacing=spacing)

    if thickness is not None:
        return contour(0.5 * thickness), f"thickened to {thickness:g}"
    areas = face_areas(solid.triangles)
    if areas[solid.bounding].sum() < BOUNDS * areas.sum():
        raise SourceError("the shape is a sheet, which bounds nothing", remedy="give it a thickness")
    if contoured:
        return contour(0.0), "contoured"
    cell = float(Grid.around(solid.bounds, resolution, None, spacing).spacing.max())
    try:
        kept, places = given_surface(solid, lambda: solid.surface(resolution=resolution, spacing=spacing), cell)
        made = kept if tolerance is None else simplified(kept, tolerance)
        return made, f"faces kept but {unjoined(places)}" if len(places) else "faces kept"
    except GeometryError as error:
        reason = str(error).partition(":")[0]
        return contour(0.0), f"contoured, since {reason}"


def figures_of(surface: TriangleMesh, solid: Solid, level: float = 0.0) -> dict[str, object]:
    """Return counts and sizes of a closed surface, and its distances from the faces of a solid and back.

    `to_faces` is the largest distance from the surface, but where it lies on the completion, to its level around the
    faces that were given; `from_faces` that from faces that bound the solid to the surface, less the level.
    """
    corners = surface.vertices[surface.faces]
    volumes = part_volumes(surface.vertices, surface.faces)[1]
    bounds = solid.bounding | (level > 0)
    given, made = solid.triangles[bounds & (solid.origins >= 0)], solid.triangles[bounds & (solid.origins < 0)]
    closest = solid.closest(_places(corners))
    off = np.abs(closest.distances - level)[~closest.completed]
    back = FaceTree.of_triangles(corners).distances(_places(given)) - level if len(given) else np.zeros(1)
    return {
        "bodies": int((volumes > 0).sum()),
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
        "volume": float(volumes.sum()),
        "area": float(face_areas(corners).sum()),
        "openings": _openings(made),
        "completed_area": float(face_areas(made).sum()),
        "to_faces": float(off.max(initial=0.0)),
        "from_faces": float(np.abs(back).max(initial=0.0)),
    }


def faults_of(surface: TriangleMesh) -> dict[str, object]:
    """Pairs of faces that cross, and edges that not exactly two faces share."""
    return {
        "self_intersections": len(self_intersections(surface.vertices, surface.faces)),
        "bad_edges": int((edge_table(surface.faces).face_counts != 2).sum()),
    }


def _places(triangles: Floats) -> Floats:
    places: Floats = np.einsum("pk,mkj->mpj", PARTS, triangles).reshape(-1, 3)
    return places


def _openings(completion: Floats) -> int:
    """Return connected parts of what completes."""
    if not len(completion):
        return 0
    _, faces = np.unique(completion.reshape(-1, 3), axis=0, return_inverse=True)
    return int(element_components(faces.reshape(-1, 3)).max()) + 1
