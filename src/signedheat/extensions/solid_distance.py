"""What people get by default: distance that is exact where the shape is there, and completed where it is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import overload

from numpy.typing import ArrayLike

from ..constraints import Constraint
from ..domains.grid import Grid
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..domains.tet_mesh import TetMesh
from ..domains.validation import positive_number
from ..errors import UnsupportedTypeError
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..lowering.area_elements import bounds_around
from ..progress import Progress, within
from ..solids.complete import complete, oriented
from ..solver import SignedHeatSolver, checked
from .joining import Shape, joined_shape
from .sharpening import sharpen


@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> GridField: ...
@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    progress: Progress | None = None,
) -> GridField: ...
@overload
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: TetMesh,
    *,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> TetField: ...
def solid_distance(
    shape: ShapeLike | Sequence[ShapeLike],
    domain: Grid | TetMesh | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    band: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    plain: bool = False,
    progress: Progress | None = None,
) -> GridField | TetField:
    """Signed distance to a solid: `complete` the shape, and measure to what was given and to its completion, exactly.

    Around sheets that bound nothing distance is positive on both sides. On tets, and on grids with solid nodes,
    distance is that along ways around walls, with the signs of φ.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh; or several meshes
        Broken or not; points with normals or without. Objects of trimesh, PyVista, meshio and Open3D and pairs
        (vertices, faces) are taken wherever a shape is.
    domain : Grid or TetMesh, optional
        Where to measure; by default a grid of cubic cells around the shape.
    resolution : int
        Nodes along the longest side of that grid.
    spacing : float or (3,) float, optional
        Distance between its nodes, in place of `resolution`.
    padding : float, optional
        Room around the shape, in its units; by default a fifth of its longest side.
    band : float, optional
        Only the nodes of the grid whose distance is at most this, in units of length: for fine grids.
    constraint : Free, ZeroSet, EachComponent, LevelValues or Soft, optional
        What is imposed on φ at the faces, where φ is computed; `ZeroSet` by default.
    diffusion : float
        τ in ``t = τ h²``, likewise.
    as_oriented : bool
        Take faces as they are, whichever way they face.
    keep_overlaps : bool
        Count what lies inside other bodies as surface.
    plain : bool
        Return φ of the oriented shape as the method gives it.
    progress : callable, optional
        Called as ``progress(fraction, step)``; what it raises cancels.

    Returns
    -------
    GridField or TetField
        Negative inside. ``diagnostics.notes`` say what was turned, left out and completed.

    Raises
    ------
    SourceError
        If the shape cannot be a source, for instance points without normals, or does not fit the domain.
    GeometryError
        If resolution, spacing or padding make no grid.
    MemoryLimitError
        If the grid cannot fit in memory; nothing has been allocated then.

    Examples
    --------
    >>> import numpy as np
    >>> from signedheat import samples
    >>> ball, other = samples.sphere(3), samples.sphere(3, center=(1.0, 0, 0))
    >>> field = solid_distance(samples.union(ball, other), resolution=32)
    >>> bool(np.abs(field([[0.5, 0, 0]]) + np.sqrt(0.75)) < 0.05)
    True
    """
    joined = joined_shape(shape)
    if domain is None:
        domain = Grid.around(bounds_around([joined]), resolution, padding, spacing)
    diffusion, constraint = positive_number(diffusion, "diffusion"), checked(constraint)
    in_space = isinstance(domain, Grid) and domain.dimension == 3 and domain.mask is None
    if plain:
        if band is not None:
            raise UnsupportedTypeError("φ has no band", remedy="leave out the band", element="band")
        turned, notes = (joined, ()) if as_oriented else oriented(joined)
        phi = _phi(turned, domain, constraint, diffusion, progress)
        return replace(phi, diagnostics=phi.diagnostics.noting(*notes))
    first, then = within(progress, 0.0, 0.5), within(progress, 0.5, 1.0)
    solid = complete(
        joined,
        as_oriented=as_oriented,
        keep_overlaps=keep_overlaps,
        constraint=constraint,
        diffusion=diffusion,
        progress=first,
    )
    if in_space:
        assert isinstance(domain, Grid)
        return solid.field(grid=domain, band=band, progress=then)
    if band is not None:
        raise UnsupportedTypeError(
            "a band is computed around solids, on a grid in space without walls", remedy="leave out the band"
        )
    source = joined if isinstance(joined, PointCloud) else solid.boundary
    phi = _phi(source, domain, constraint, diffusion, then)
    if isinstance(phi, TetField):
        phi = sharpen(phi, solid.boundary)
    return replace(phi, diagnostics=phi.diagnostics.noting(*solid.diagnostics.notes))


def _phi(
    shape: Shape, domain: Grid | TetMesh, constraint: Constraint, diffusion: float, progress: Progress | None
) -> GridField | TetField:
    phi = SignedHeatSolver(domain, diffusion, progress).distance(shape, constraint)
    if not isinstance(phi, GridField | TetField):
        kind = type(domain).__name__
        raise UnsupportedTypeError(f"a solid is measured on a Grid or a TetMesh, not on a {kind}", element="domain")
    return phi
