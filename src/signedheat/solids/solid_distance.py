"""Signed distance to shapes in space: complete them, then measure to their faces and the completion."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from ..area_elements import bounds_around
from ..constraints import Constraint
from ..errors import UnsupportedTypeError
from ..grids.grid import Grid
from ..grids.grid_field import GridField
from ..jobs import Progress, within
from ..joining import joined_shape
from ..kinds import Shapes
from ..sharpening import sharpen
from ..solver import SignedHeatSolver, checked
from ..surfaces.point_cloud import PointCloud
from ..tets.tet_field import TetField
from ..tets.tet_mesh import TetMesh
from ..validation import positive_number
from .completion import Completing, Completion, Lids, completed
from .heat_surfaces import Heat
from .overlaps import Nesting
from .solid import Solid


def distance_to_shapes(
    shape: Shapes,
    domain: Grid | TetMesh | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    completion: Completing = "lids",
    lids: Lids = "bent",
    nested: Nesting = "given",
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> GridField | TetField:
    """Compute the signed distance to shapes in space: see `signed_distance`.

    On tets, distance is along paths around walls, with the signs of the solid: where none is in between, it is the
    solid's.
    """
    options = Completion(completion, lids, nested, as_oriented, keep_overlaps)
    method = Heat(checked(constraint), positive_number(diffusion, "diffusion"))
    joined = joined_shape(shape)
    if domain is None:
        domain = Grid.around(bounds_around([joined]), resolution, padding, spacing)
    return completed_distance(joined, domain, options, method, band, progress)


def completed_distance(
    shape: Shapes,
    domain: Grid | TetMesh,
    options: Completion,
    method: Heat,
    band: float | None = None,
    progress: Progress | None = None,
) -> GridField | TetField:
    """Complete a shape, then measure the distance to it on a grid or on tets."""
    if not isinstance(domain, Grid | TetMesh):
        kind = type(domain).__name__
        raise UnsupportedTypeError(
            f"distance to a shape in space is measured on a Grid or a TetMesh, not on a {kind}", element="domain"
        )
    in_space = isinstance(domain, Grid) and domain.dimension == 3
    if band is not None and not in_space:
        raise UnsupportedTypeError(
            "a band is computed around solids, on a grid in space without walls", remedy="leave out the band"
        )
    joined = shape if isinstance(shape, Solid) else joined_shape(shape)
    solid = completed(joined, options, method, within(progress, 0.0, 0.5))
    progress = within(progress, 0.5, 1.0)
    if isinstance(domain, Grid) and in_space:
        return solid.field(grid=domain, band=band, progress=progress)
    if isinstance(domain, TetMesh):
        phi: GridField | TetField = sharpen(TetField(domain, solid.distance(domain.vertices)), solid.boundary)
    else:
        source = joined if isinstance(joined, PointCloud) else solid.boundary
        phi = SignedHeatSolver(domain, method.diffusion, progress).distance(source, method.constraint)
    return replace(phi, diagnostics=phi.diagnostics.noting(*solid.diagnostics.notes))
