"""Code as users write it, for the type checker: every ``assert_type`` says what an editor has to show. Never run."""

from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray
from typing_extensions import assert_type

import signedheat as sh

# --- shapes from files and from other packages
shape = sh.read("broken.stl")
assert_type(shape, sh.TriangleMesh | sh.PolygonMesh | sh.PointCloud | sh.DigitalSurface | sh.TetMesh | sh.Solid)
mesh = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.array([[0, 1, 2]]))
assert_type(sh.TriangleMesh.from_trimesh(trimesh.Trimesh()), sh.TriangleMesh)
assert_type(mesh.to_trimesh(), trimesh.Trimesh)
polygons = sh.PolygonMesh(mesh.vertices, [[0, 1, 2]])
cloud = sh.PointCloud.from_trimesh(object())
assert_type(cloud, sh.PointCloud)
voxels = sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool))
line = sh.Polyline([[0, 0], [1, 1]])

# --- space: on the grid around a shape
sdf = sh.signed_distance(shape, resolution=64)
assert_type(sdf, sh.Field[sh.Grid[Literal[3]]])
assert_type(sdf.values, NDArray[np.float64])
assert_type(sdf([[0.0, 0.0, 0.0]]), NDArray[np.float64])
assert_type(sdf.gradient([[0.0, 0.0, 0.0]]), NDArray[np.float64])
assert_type(sdf.contour(0.0), sh.TriangleMesh)
assert_type(sdf.offset(0.5), sh.TriangleMesh)
assert_type(sdf.contour(0).to_trimesh(), trimesh.Trimesh)
assert_type(sdf.domain, sh.Grid[Literal[3]])
assert_type(sh.sharpen(sdf), sh.Field[sh.Grid[Literal[3]]])
assert_type(sh.signed_distance([mesh, cloud]), sh.Field[sh.Grid[Literal[3]]])
assert_type(sh.signed_distance(line), sh.Field[sh.Grid[Literal[2]]])
assert_type(sh.signed_distance([line, line]).contour(), list[sh.Polyline])

# --- on a grid of one's own: its dimension is known where its shape is written out
space, plane = sh.Grid((0, 0, 0), 0.1, (8, 8, 8)), sh.Grid((0, 0), 0.1, (8, 8))
assert_type(space, sh.Grid[Literal[3]])
assert_type(plane, sh.Grid[Literal[2]])
assert_type(sh.signed_distance(mesh, space).contour(), sh.TriangleMesh)
assert_type(sh.signed_distance(line, plane).offset(0.1), list[sh.Polyline])
somewhere = sh.Grid.around(mesh.bounds)
assert_type(somewhere, sh.Grid)
assert_type(sh.signed_distance(mesh, somewhere).contour(), sh.TriangleMesh | list[sh.Polyline])
assert_type(sh.SignedHeatSolver(space).distance(mesh), sh.Field[sh.Grid[Literal[3]]])
assert_type(sh.SignedHeatSolver(space).distance_many([mesh, cloud]), list[sh.Field[sh.Grid[Literal[3]]]])
assert_type(sh.SignedHeatSolver(space, 4.0).with_diffusion(1.0).distance(mesh), sh.Field[sh.Grid[Literal[3]]])

# --- on tets
tets = sh.tetrahedralize(mesh)
assert_type(tets, sh.TetMesh)
assert_type(sh.signed_distance(mesh, tets), sh.Field[sh.TetMesh])
in_tets = sh.SignedHeatSolver(tets).distance([mesh], sh.constraints.Free())
assert_type(in_tets.offset(0.1), sh.TriangleMesh)
assert_type(sh.sharpen(in_tets, method=sh.methods.Convex()), sh.Field[sh.TetMesh])

# --- on surfaces
curve = mesh.path([0, 1])
solver = sh.SignedHeatSolver(mesh, intrinsic=True)
phi = solver.distance([curve, mesh.points_at(2)], constraint=sh.constraints.LevelValues([0.0, 1.0]))
assert_type(phi, sh.Field[sh.TriangleMesh])
assert_type(phi.domain.faces, NDArray[np.int64])
assert_type(phi.contour(0.5), list[sh.Curve])
assert_type(sh.sharpen(phi, method=sh.methods.Geodesic()), sh.Field[sh.TriangleMesh])
assert_type(sh.sharpen(phi, [curve]), sh.Field[sh.TriangleMesh])
assert_type(sh.signed_distance(curve, mesh, intrinsic=True), sh.Field[sh.TriangleMesh])
assert_type(sh.signed_distance(curve, mesh), sh.Field[sh.TriangleMesh])
assert_type(sh.SignedHeatSolver(polygons).distance(curve), sh.Field[sh.PolygonMesh])
assert_type(sh.SignedHeatSolver(cloud).distance_many([curve, [curve]]), list[sh.Field[sh.PointCloud]])
assert_type(sh.signed_distance(curve, voxels).restrict(), sh.Field[sh.DigitalSurface])
better = sh.intrinsic_delaunay(mesh, keep=curve, refine=True)
on_better = sh.SignedHeatSolver(better).distance(curve)
assert_type(on_better, sh.Field[sh.IntrinsicTriangulation])
assert_type(on_better.restrict(), sh.Field[sh.TriangleMesh])
pieces = sh.piecewise_distance([curve], mesh)
assert_type(pieces, sh.Field[sh.results.CutSurface])
assert_type(pieces.gradient(mesh.points_at([0])), NDArray[np.float64])
assert_type(sh.close_curves([curve, curve], mesh), list[sh.Curve])
assert_type(sh.io.read_curves("curves.json", mesh), list[sh.Curve | sh.SurfacePoints])

# --- unions where it truly is one
field = sh.read_field("phi.npz")
assert_type(field, sh.Field)
assert_type(sh.sharpen(field), sh.Field)
for surface in (mesh, polygons):
    assert_type(sh.SignedHeatSolver(surface).distance(curve), sh.Field[sh.TriangleMesh | sh.PolygonMesh])

# --- morphology
assert_type(sh.morphology.dilate(shape, 0.1), sh.TriangleMesh)
assert_type(sh.morphology.opening(line, 0.1), list[sh.Polyline])
assert_type(sh.morphology.closing(curve, 0.1, mesh), list[sh.Curve])
assert_type(sh.morphology.shell(mesh, 0.0, 0.1), sh.TriangleMesh)
assert_type(sh.morphology.thicken(mesh, 0.1), sh.TriangleMesh)

# --- what does not fit is told: mypy fails where an ignore is not needed
sh.signed_distance(curve)  # type: ignore[call-overload]
sh.SignedHeatSolver("mesh")  # type: ignore[type-var]
sh.morphology.dilate(curve, 0.1)  # type: ignore[call-overload]
_ = sdf.contour(0).normals  # type: ignore[attr-defined]
mesh.path("abc", closed="yes")  # type: ignore[arg-type]
