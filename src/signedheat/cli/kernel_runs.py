"""Everything that has kernels, run on small shapes: what `warmup` compiles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import samples
from ..curves.curve_completion import close_curves
from ..curves.jumping_distance import piecewise_distance
from ..distances import signed_distance
from ..grids.grid import Grid
from ..grids.polyline import Polyline
from ..grids.redistancing import redistance
from ..inspection import inspect
from ..sharpening import sharpen
from ..sharpening_methods import Convex, Geodesic
from ..solids.completion import complete
from ..solids.mesh_orientation import orientation
from ..solids.sampling import sample
from ..solids.thickness import widths
from ..solver import SignedHeatSolver
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.intrinsic_triangulation import intrinsic_delaunay
from ..surfaces.point_cloud import PointCloud
from ..surfaces.subdivision import common_subdivision
from ..surfaces.surface_curves import Curve
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.lattice import tetrahedralize
from ..view import draw_shape, new_figure


def solids() -> None:
    """Run solids on grids: faces, points without normals, surfaces, sharpening, samples."""
    ball = samples.sphere(2)
    broken = samples.with_flipped_faces(samples.without_faces(samples.union(ball, samples.sphere(2, center=(1, 0, 0))),
                                                              0.1), 0.1)  # fmt: skip
    field = signed_distance(broken, Grid.around(broken.bounds, 20))
    field.offset(0.1)
    sample(field, 20)
    fine = Grid.around(ball.bounds, 48)
    signed_distance(ball, fine, band=3 * float(fine.spacing.max())).offset(0.0)
    points = PointCloud(ball.vertices)
    signed_distance(points, Grid.around(ball.bounds, 20))
    complete(samples.without_patches(ball, 1, 0.5)).surface(keep_faces=True)
    field = SignedHeatSolver(Grid.around(broken, 12)).distance(broken)
    sharpen(field)
    redistance(field)


def reports() -> None:
    """Run what `info` and pictures need."""
    ball = samples.sphere(2)
    inspect(ball)
    widths(orientation(ball).shape)
    draw_shape(ball, new_figure(1, 1).add_subplot(1, 1, 1))


def plane() -> None:
    """Run distance to lines in the plane."""
    line = Polyline([[0.5, 0.2], [0.2, 7.5]])
    signed_distance(line, Grid((0, 0), 1.0, (9, 9))).contour(0.0)


def curves() -> None:
    """Run exact distance, completion and jumps of curves on triangles."""
    ball = samples.sphere(2)
    curve = _curve(ball)
    signed_distance(curve, ball)
    close_curves(ball, curve)
    piecewise_distance(ball, curve)


def surfaces() -> None:
    """Run the method, contours and sharpening for curves on triangles."""
    ball = samples.sphere(2)
    field = SignedHeatSolver(ball).distance([_curve(ball), ball.points_at(3)])
    field.contour(0.1)
    for how in (None, Convex(), Geodesic()):
        sharpen(field) if how is None else sharpen(field, method=how)
    sharpen(SignedHeatSolver(ball).distance(Curve(_curve(ball).faces, _curve(ball).barycentric, oriented=False)))


def other_surfaces() -> None:
    """Run points, polygons and voxels."""
    ball = samples.sphere(2)
    cloud = PointCloud(ball.vertices)
    SignedHeatSolver(cloud).distance(cloud.points_at(3))
    voxels = DigitalSurface(np.ones((2, 2, 2), dtype=bool))
    for domain in (voxels, voxels.squares):
        SignedHeatSolver(domain).distance(domain.points_at(3))


def intrinsic() -> None:
    """Run intrinsic triangulations."""
    ball = samples.sphere(1)
    field = SignedHeatSolver(ball, intrinsic=True).distance(_curve(ball))
    field.restrict().contour(0.1)
    common_subdivision(intrinsic_delaunay(ball, refine=True))


def tets() -> None:
    """Run distance on few tets and on many: systems are factorised or iterated."""
    ball = samples.sphere(1)
    SignedHeatSolver(tetrahedralize(ball, resolution=7, grading=np.inf)).distance(ball)
    field = SignedHeatSolver(tetrahedralize(ball, resolution=5)).distance(ball)
    field.contour(0.1)
    sharpen(field)
    signed_distance(ball, field.mesh)


def _curve(ball: TriangleMesh) -> Curve:
    return ball.polyline([[1.0, 0.1, 0.2], [0.0, 1.0, -0.1], [-1.0, 0.0, 0.3]])


JOBS: dict[str, Callable[[], None]] = {
    "solids": solids,
    "intrinsic triangulations": intrinsic,
    "curves": curves,
    "surfaces": surfaces,
    "tets": tets,
    "points, polygons, voxels": other_surfaces,
    "reports": reports,
    "lines in the plane": plane,
}
"""Jobs, the longest first, which share few kernels. Of 100 s of processor time solids take 36, and refining 27."""
