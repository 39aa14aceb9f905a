"""Run everything that has compiled functions on small shapes, so that `warmup` compiles them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

import signedheat as sh
from signedheat import samples

from ..linear.superlu import SuperLUFactor
from ..shapes.inspection import inspect
from ..solids.thickness import widths


def solids() -> None:
    """Run solids on grids: faces, loose ones too, points without normals, surfaces, sharpening, samples."""
    ball = samples.sphere(2)
    broken = samples.with_flipped_faces(samples.without_faces(samples.union(ball, samples.sphere(2, center=(1, 0, 0))),
                                                              0.1), 0.1)  # fmt: skip
    field = sh.signed_distance(broken, sh.Grid.around(broken.bounds, 20))
    field.offset(0.1)
    sh.sample_distances(field, 20)
    fine = sh.Grid.around(ball.bounds, 48)
    narrow = sh.signed_distance(ball, fine, band=3 * float(fine.spacing.max()))
    narrow.offset(0.0)
    narrow.interpolate(ball.vertices)
    points = sh.PointCloud(ball.vertices)
    sh.signed_distance(points, sh.Grid.around(ball.bounds, 20))
    sh.complete(samples.without_patches(ball, 2, 0.8)).surface()
    whole = sh.complete(samples.soup(ball, 0.1))
    whole.offset(0.1, corners="mitre", resolution=16)
    (whole | sh.complete(ball)).surface()
    field = sh.SignedHeatSolver(sh.Grid.around(broken, 12)).distance(broken)
    sh.sharpen(field)
    sh.redistance(field)


def reports() -> None:
    """Run what `info` and pictures need."""
    ball = samples.sphere(2)
    inspect(ball)
    widths(sh.orientation(ball).shape)
    sh.view.draw_shape(ball, sh.view.new_figure(1, 1).add_subplot(1, 1, 1))


def plane() -> None:
    """Run distance to lines in the plane."""
    line = sh.Polyline([[0.5, 0.2], [0.2, 7.5]])
    sh.signed_distance(line, sh.Grid((0, 0), 1.0, (9, 9))).contour(0.0)


def curves() -> None:
    """Run exact distance, paths, completion and jumps of curves on triangles."""
    ball = samples.sphere(2)
    ball.shortest_path(ball.vertices[3], ball.vertices[9])
    curve = _curve(ball)
    sh.signed_distance(curve, ball)
    sh.close_curves(curve, ball)
    sh.piecewise_distance(curve, ball)


def surfaces() -> None:
    """Run the method, contours and sharpening for curves on triangles."""
    ball = samples.sphere(2)
    curve = _curve(ball)
    field = sh.SignedHeatSolver(ball).distance([curve, ball.points_at(3)])
    field.contour(0.1)
    for method in (None, sh.methods.Convex(), sh.methods.Geodesic()):
        sh.sharpen(field) if method is None else sh.sharpen(field, method=method)
    sh.sharpen(sh.SignedHeatSolver(ball).distance(sh.Curve(curve.faces, curve.barycentric, oriented=False)))


def other_surfaces() -> None:
    """Run points, polygons and voxels."""
    ball = samples.sphere(2)
    cloud = sh.PointCloud(ball.vertices)
    sh.SignedHeatSolver(cloud).distance(cloud.points_at(3))
    voxels = sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool))
    for domain in (voxels, voxels.squares):
        sh.SignedHeatSolver(domain).distance(domain.points_at(3))


def intrinsic() -> None:
    """Run intrinsic triangulations."""
    ball = samples.sphere(1)
    field = sh.SignedHeatSolver(ball, intrinsic=True).distance(_curve(ball))
    field.restrict().contour(0.1)
    sh.common_subdivision(sh.intrinsic_delaunay(ball, refine=True))


def tets() -> None:
    """Run distance on few tets and on many, as systems are factorised or solved iteratively."""
    ball = samples.sphere(1)
    sh.SignedHeatSolver(sh.tetrahedralize(ball, resolution=7, grading=np.inf)).distance(ball)
    field = sh.SignedHeatSolver(sh.tetrahedralize(ball, resolution=5)).distance(ball)
    field.contour(0.1)
    sh.sharpen(field)
    sh.signed_distance(ball, field.domain)(0.5 * ball.vertices)
    hollow = sh.TetMesh(field.domain.vertices, field.domain.tets[:-1])
    sh.SignedHeatSolver(hollow).distance(ball)


def factors() -> None:
    """Run SciPy's factors, which surfaces and tets need where there is no MKL, for real and complex matrices."""
    for dtype in (np.float64, np.complex128):
        factor = SuperLUFactor(sparse.csr_matrix(np.eye(3, dtype=dtype)))
        factor.solve(np.ones(3))
        factor.solve(np.ones((3, 2)))


def _curve(ball: sh.TriangleMesh) -> sh.Curve:
    """Return an open curve on a unit sphere."""
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
    "factors": factors,
}
"""Functions of this module by what they run, the slowest first. They share few compiled functions."""
