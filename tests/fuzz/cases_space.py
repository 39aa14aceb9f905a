"""Distance in space and in the plane, on grids, on tets, to solids; and every constructor."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

import signedheat as sh
from fuzz.cases_surfaces import constraint
from fuzz.frame import family
from fuzz.inputs import (
    NONSENSE,
    Random,
    chance,
    laid_out,
    one_of,
    placed,
    points,
    polygons,
    spoiled,
    spoiled_ids,
    tets,
    triangles,
    volume,
)
from fuzz.judging import Subject, announced, judge, levels_of, subject, unchanged
from signedheat import samples


def shape(random: Random) -> Any:
    """A source in space."""
    kind = random.integers(5)
    if kind < 3:
        vertices, faces = triangles(random)
        vertices, faces = spoiled(random, vertices), spoiled_ids(random, faces)
        with unchanged(vertices, faces):
            return sh.TriangleMesh(vertices, faces)
    if kind == 3:
        return sh.PolygonMesh(*polygons(random))
    places, normals = points(random)
    return sh.PointCloud(spoiled(random, places), normals)


def line(random: Random) -> sh.Polyline:
    """A source in the plane."""
    made = random.normal(size=(int(random.integers(1, 9)), 2))
    if chance(random, 0.2):
        made[1:] = made[0]
    return sh.Polyline(spoiled(random, placed(random, made)), closed=chance(random, 0.5))


def grid(random: Random, bounds: np.ndarray) -> sh.Grid:
    """A grid around a box, or anywhere."""
    if chance(random, 0.7):
        made = sh.Grid.around(bounds, resolution=int(random.integers(2, 14)), padding=one_of(random, (None, 0.0)))
    else:
        counts = random.integers(1, 9, bounds.shape[1])
        spacing = one_of(random, (1.0, 1e-12, 1e12, 10.0 ** random.uniform(-3, 3, bounds.shape[1])))
        made = sh.Grid(spoiled(random, random.normal(size=bounds.shape[1])), spacing, counts)
    return made


def size_of(bounds: np.ndarray, asked: Any) -> float:
    return float(np.abs(np.diff(bounds, axis=0)).sum() + 1e-9 * np.abs(bounds).max()) + levels_of(asked)


def check_grid(given: Subject) -> str:
    """Distance on grids, by the solver or in one call, and its sharpening."""
    random = given.random
    plane = chance(random, 0.3)
    sources = [(line if plane else shape)(random) for _ in range(random.integers(1, 3))]
    asked = constraint(random)
    domain = grid(random, sources[0].bounds)
    solver = sh.SignedHeatSolver(domain, one_of(random, (1.0, 1.0, 1e-6, 100.0, 1e12)))
    phi, warned = announced(lambda: solver.distance(sources, asked))
    every = np.concatenate([np.stack([domain.origin, domain.upper]), *(source.bounds for source in sources)])
    size = size_of(np.stack([every.min(axis=0), every.max(axis=0)]), asked)
    judge(phi.values, warned, max(size, 1.0), "grid")
    judge(phi(random.normal(size=(4, domain.dimension))), warned, np.inf, "evaluated")
    if chance(random, 0.4):
        sharp, _ = announced(lambda: sh.sharpen(phi))
        judge(sharp.values, warned, size, "sharpened")
    if chance(random, 0.3) and domain.dimension in (2, 3):
        announced(lambda: phi.contour())
    return f"{domain.dimension}-D"


def check_solid(given: Subject) -> str:
    """Solids, orientation, union, offsets."""
    random = given.random
    source = shape(random)
    kind = random.integers(4)
    resolution = int(random.integers(4, 20))
    size = size_of(source.bounds, None)
    if kind == 0:
        phi, warned = announced(lambda: sh.signed_distance(source, resolution=resolution))
        judge(phi.values, warned, size, "solid")
        return "solid"
    if kind == 1:
        made, _ = announced(lambda: sh.orient(source))
        judge(made.vertices, False, np.inf, "oriented")
        return "oriented"
    if kind == 2:
        made, _ = announced(lambda: sh.complete(source))
        judge(made.triangles, False, np.inf, "completed")
        return "completed"
    operation = one_of(
        random,
        (
            sh.morphology.dilate,
            sh.morphology.erode,
            sh.morphology.closing,
            sh.morphology.opening,
            sh.morphology.thicken,
        ),
    )
    made, _ = announced(lambda: operation(source, size * random.random() ** 2, resolution=resolution))
    judge(made.vertices, False, np.inf, operation.__name__)
    return operation.__name__


def check_tets(given: Subject) -> str:
    """Distance on tets."""
    random = given.random
    vertices, cells = tets(random)
    vertices, cells = spoiled(random, vertices), spoiled_ids(random, cells)
    with unchanged(vertices, cells):
        domain = sh.TetMesh(vertices, cells)
    if chance(random, 0.5):
        middle, reach = domain.vertices.mean(axis=0), np.ptp(domain.vertices, axis=0).max()
        faces = triangles(random)[1]
        source = sh.TriangleMesh(middle + 0.4 * reach * random.uniform(-1, 1, (faces.max() + 1, 3)), faces)
    else:
        source = shape(random)
    asked = constraint(random)
    phi, warned = announced(lambda: sh.SignedHeatSolver(domain).distance(source, asked))
    size = size_of(np.stack([domain.vertices.min(axis=0), domain.vertices.max(axis=0)]), asked)
    judge(phi.values[np.unique(domain.tets)], warned, size * len(cells), "tets")
    if chance(random, 0.5):
        sharp, _ = announced(lambda: sh.sharpen(phi, method=one_of(random, (None, sh.methods.Convex(max_rounds=30)))))
        judge(sharp.values[~np.isnan(phi.values)], False, size * len(cells), "sharpened")
    return "in part" if warned else "tets"


def check_arguments(given: Subject) -> str:
    """One argument of one function is nonsense, or has another layout; the rest is right."""
    random = given.random

    ball = samples.sphere(1)
    cube = np.ones((3, 3, 3), dtype=bool)
    right: list[tuple[Any, dict[str, Any]]] = [
        (sh.TriangleMesh, {"vertices": ball.vertices, "faces": ball.faces}),
        (sh.PolygonMesh, {"vertices": ball.vertices, "polygons": ball.faces}),
        (sh.PointCloud, {"points": ball.vertices, "normals": ball.vertices, "areas": np.ones(42), "n_neighbors": 9}),
        (sh.DigitalSurface, {"volume": cube, "spacing": np.ones(3), "origin": np.zeros(3), "radius": 1.0}),
        (sh.TetMesh, {"vertices": np.eye(4)[:, :3], "tets": np.arange(4)[None]}),
        (sh.Polyline, {"points": np.eye(2), "closed": True}),
        (sh.Polyline.from_mask, {"mask": cube[0], "origin": np.zeros(2), "spacing": np.ones(2)}),
        (sh.Grid, {"origin": np.zeros(3), "spacing": np.ones(3), "shape": np.array([3, 3, 3])}),
        (sh.Grid.around, {"bounds": ball.bounds, "resolution": 5, "padding": 0.1, "spacing": 0.3}),
        (sh.Curve, {"faces": np.array([0, 0]), "barycentric": np.eye(3)[:2], "closed": False, "normals": None}),
        (sh.SurfacePoints, {"faces": np.array([0]), "barycentric": np.eye(3)[:1]}),
        (ball.path, {"vertices": np.array([0, 1, 2]), "closed": True, "oriented": False}),
        (ball.points_at, {"vertices": np.array([0, 1])}),
        (ball.polyline, {"points": ball.vertices[:3], "closed": False, "max_distance": 1.0}),
        (ball.level_set, {"values": ball.vertices[:, 0], "level": 0.1}),
        (ball.region_boundary, {"face_mask": ball.vertices[ball.faces[:, 0], 0] > 0}),
        (sh.constraints.LevelValues, {"values": np.array([0.0, 1.0])}),
        (sh.constraints.Soft, {"weight": 1.0}),
        (sh.methods.Geodesic, {"tolerance": 0.01}),
        (sh.methods.Convex, {"tolerance": 0.01, "max_rounds": 3, "relaxation": 1.5}),
        (sh.SignedHeatSolver, {"domain": ball, "diffusion": 1.0}),
        (sh.SignedHeatSolver(ball).distance, {"sources": ball.path([0, 1]), "constraint": sh.constraints.Free()}),
        (sh.complete, {"shape": ball, "keep_overlaps": False, "diffusion": 1.0}),
        (sh.signed_distance, {"source": ball, "resolution": 8, "padding": 0.1, "constraint": None, "diffusion": 1.0}),
        (sh.sharpen, {"field": sh.Field(ball, ball.vertices[:, 2]), "method": sh.methods.Geodesic()}),
        (sh.Field(ball, ball.vertices[:, 2]), {"points": ball.vertices[:3]}),
        (sh.Field(ball, ball.vertices[:, 2]).contour, {"level": 0.0}),
        (sh.Field, {"domain": sh.Grid((0, 0), 1.0, (3, 3)), "values": np.zeros((3, 3))}),
        (sh.Field(sh.Grid((0, 0), 1.0, (3, 3)), np.zeros((3, 3))), {"points": np.eye(2)}),
        (sh.intrinsic_delaunay, {"mesh": ball, "keep": (), "angle": 20.0, "max_vertices": 99}),
        (sh.piecewise_distance, {"domain": ball, "sources": ball.path([0, 1]), "diffusion": 1.0}),
        (sh.morphology.dilate, {"shape": ball, "distance": 0.1, "resolution": 8}),
        (sh.close_curves, {"domain": ball, "curves": ball.path([0, 1])}),
        (sh.tetrahedralize, {"shape": ball, "resolution": 3, "padding": 0.1, "grading": 3.0}),
        (sh.orient, {"shape": ball}),
        (sh.complete, {"shape": ball}),
    ]
    call, arguments = one_of(random, right)
    parameters = inspect.signature(call).parameters.values()
    others = [each.name for each in parameters if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)]
    name = one_of(random, list(dict.fromkeys([*arguments, *others])))
    value = arguments.get(name)
    if isinstance(value, np.ndarray) and chance(random, 0.4):
        arguments[name] = laid_out(random, value)
        announced(lambda: call(**arguments))
        return "another layout"
    arguments[name] = one_of(random, NONSENSE)
    announced(lambda: call(**arguments))
    return "taken"


def check_voxels(given: Subject) -> str:
    """Volumes of any type and layout."""
    random = given.random
    made = laid_out(random, volume(random).astype(one_of(random, (bool, np.uint8, float, np.int64))))
    surface = sh.DigitalSurface(made, one_of(random, (1.0, 0.1, (1.0, 2.0, 0.5))))
    judge(surface.normals, False, 1.0, "normals")
    return "voxels"


family("space grid", subject, check_grid)
family("space solid", subject, check_solid)
family("space tets", subject, check_tets)
family("space voxels", subject, check_voxels)
family("arguments", subject, check_arguments)
