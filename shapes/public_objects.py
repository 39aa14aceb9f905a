"""One of every public object, used before it is handed out, so that what it derives from itself is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

import signedheat as sh
from shapes.tet_cases import boxes
from signedheat import samples

BALL = samples.sphere(1)
RING = BALL.level_set(BALL.vertices[:, 2], 0.1)
BOX = boxes((2, 2, 2), 1.0)
INNER = sh.TriangleMesh(0.4 * BALL.vertices + 1, BALL.faces)


def triangles() -> sh.TriangleMesh:
    mesh = sh.TriangleMesh(BALL.vertices, BALL.faces)
    assert len(mesh.face_areas) == mesh.edges.face_edges.shape[0]
    return mesh


def polygons() -> sh.PolygonMesh:
    mesh = sh.PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    assert mesh.triangulation.n_faces == 4
    return mesh


def points() -> sh.PointCloud:
    cloud = samples.oriented_points(BALL, 60)
    assert cloud.triangulation.n_faces
    return cloud


def voxels() -> sh.DigitalSurface:
    surface = sh.DigitalSurface(np.ones((3, 3, 3), dtype=bool))
    assert len(surface.normals)
    return surface


def tets() -> sh.TetMesh:
    mesh = sh.TetMesh(BOX.vertices, BOX.tets)
    assert mesh.geometry is not None
    return mesh


def grid() -> sh.Grid:
    return sh.Grid((-2, -2, -2), 0.5, (9, 9, 9))


def triangulation() -> sh.IntrinsicTriangulation:
    return sh.intrinsic_delaunay(BALL, keep=RING, refine=True)


def used(domain: object, sources: object, **options: object) -> sh.SignedHeatSolver:
    """A solver after use, with every factor that it keeps."""
    solver = sh.SignedHeatSolver(domain, **options)
    for constraint in (sh.constraints.ZeroSet(), sh.constraints.Free()):
        solver.distance(sources, constraint)
    return solver


def curve_on(surface: sh.PolygonMesh | sh.PointCloud | sh.DigitalSurface) -> sh.Curve:
    return surface.path([0, 1])


def jumping() -> sh.Field[sh.results.CutSurface]:
    """A field that jumps across a cut of the surface."""
    return sh.piecewise_distance(BALL.path([0, 5]), BALL)


def banded() -> sh.Field[sh.Grid]:
    """A band after use: its trees are there."""
    band = sh.signed_distance(samples.without_patches(samples.sphere(2), 2, 0.2), resolution=24, band=0.3)
    assert band.offset(0.1).n_faces and band.closest([[1.2, 0.0, 0.0]]).distances.shape == (1,)
    return band


SOLVERS: dict[str, Callable[[], sh.SignedHeatSolver]] = {
    "triangles": lambda: used(triangles(), RING),
    "intrinsic": lambda: used(triangles(), RING, intrinsic=True),
    "triangulation": lambda: used(triangulation(), RING),
    "polygons": lambda: used(polygons(), curve_on(polygons())),
    "points": lambda: used(points(), points().points_at(0)),
    "voxels": lambda: used(voxels(), curve_on(voxels())),
    "tets": lambda: used(tets(), INNER),
    "grid": lambda: used(grid(), BALL),
}

SOURCES: dict[str, Callable[[], object]] = {
    "triangles": lambda: RING,
    "intrinsic": lambda: RING,
    "triangulation": lambda: RING,
    "polygons": lambda: curve_on(polygons()),
    "points": lambda: points().points_at(0),
    "voxels": lambda: curve_on(voxels()),
    "tets": lambda: INNER,
    "grid": lambda: BALL,
}

OBJECTS: dict[str, Callable[[], object]] = {
    "triangles": triangles,
    "polygons": polygons,
    "points": points,
    "voxels": voxels,
    "tets": tets,
    "grid": grid,
    "triangulation": triangulation,
    "thickness": lambda: sh.wall_thickness(samples.sphere(1)),
    "filled triangles": lambda: sh.fill_holes(sh.TriangleMesh(BALL.vertices, BALL.faces[1:])),
    "filled polygons": lambda: sh.fill_holes(sh.PolygonMesh(BALL.vertices, BALL.faces[1:].tolist())),
    "polyline": lambda: sh.Polyline([[0, 0], [1, 0], [1, 1]]),
    "curve": lambda: RING[0],
    "isolated points": lambda: BALL.points_at([0, 3]),
    "vertex field": lambda: sh.SignedHeatSolver(BALL).distance(RING),
    "sharpened": lambda: sh.sharpen(sh.SignedHeatSolver(BALL).distance(RING)),
    "triangulation's field": lambda: sh.SignedHeatSolver(triangulation()).distance(RING),
    "tet field": lambda: sh.SignedHeatSolver(BOX).distance(INNER),
    "grid field": lambda: sh.SignedHeatSolver(grid()).distance(BALL),
    "solid": lambda: sh.signed_distance(BALL, resolution=16),
    "piecewise field": lambda: jumping(),
    "orientation": lambda: sh.orientation(BALL),
    "deviation": lambda: sh.deviation(samples.sphere(1, 1.1), BALL),
    "completed solid": lambda: sh.complete(samples.without_patches(samples.sphere(2), 2, 0.2)),
    "closest": lambda: sh.complete(samples.sphere(2)).closest([[0.5, 0.0, 0.0]]),
    "band": lambda: banded(),
    "band of nodes": lambda: banded().domain,
    "section": lambda: sh.complete(BALL).section([0.0, 0.0, 0.1], [0.0, 0.0, 1.0]),
    "cut surface": lambda: jumping().domain,
    "cut": lambda: jumping().domain.cuts(jumping().values)[0],
    "samples": lambda: sh.sample_distances(sh.signed_distance(BALL, resolution=16), 20),
    "curve orientation": lambda: sh.orientation(RING, BALL),
    "labels": lambda: sh.io.LabelImage(np.arange(8).reshape(2, 2, 2), np.eye(3), np.zeros(3)),
    "sampling": lambda: sh.batches.Sampling(n=10),
    "batch job": lambda: sh.batches.Job(offsets=(0.1,), constraint=sh.constraints.Soft(2.0)),
    "outcome": lambda: sh.batches.Outcome("a", "a.stl", "done", 1.0, outputs=("a.npz",), figures={"faces": 3}),
    "watertight": lambda: sh.batches.Watertight(thickness=0.1),
    "batch": lambda: sh.batches.Batch((sh.batches.Outcome("a", "a.stl", "failed", 1.0),), Path("manifest.jsonl")),
    "extrapolated": sh.methods.Extrapolated,
    "free": sh.constraints.Free,
    "zero set": lambda: sh.constraints.ZeroSet(hard=True),
    "each component": sh.constraints.EachComponent,
    "level values": lambda: sh.constraints.LevelValues([0.0, 1.0]),
    "soft": lambda: sh.constraints.Soft(10.0),
    "convex": sh.methods.Convex,
    "geodesic": sh.methods.Geodesic,
    "diagnostics": sh.results.Diagnostics,
}
