"""Distance along surfaces of every kind, under every constraint, and what is made of it."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, family
from fuzz.inputs import (
    Random,
    chance,
    one_of,
    points,
    polygons,
    spoiled,
    spoiled_ids,
    triangles,
    volume,
)
from fuzz.judging import Subject, announced, judge, length_of_edges, levels_of, subject, unchanged


def surface(random: Random) -> Any:
    """A domain of any kind."""
    kind = random.integers(9)
    if kind < 4:
        return triangle_mesh(random)
    if kind == 4:
        mesh = triangle_mesh(random)
        keep = [source(random, mesh) for _ in range(random.integers(3))]
        angle = random.uniform(1, 30)
        return sh.intrinsic_delaunay(mesh, keep, refine=chance(random, 0.6), angle=angle, max_vertices=3000)
    if kind == 5:
        vertices, faces = polygons(random)
        vertices = spoiled(random, vertices)
        with unchanged(vertices):
            return sh.PolygonMesh(vertices, faces)
    if kind < 8:
        return cloud(random)
    radius = one_of(random, (None, None, 0.0, 1.0, 5.0, 1e3, 1e9, 1e300))
    spacing = one_of(random, (1.0, 1.0, 1e-12, 1e12, 1e-150, 1e150, (1.0, 1e-3, 1.0), (1e-6, 1.0, 1e6)))
    origin = random.normal(size=3) * one_of(random, (0.0, 1.0, 1e6, 1e12))
    return sh.DigitalSurface(volume(random), spacing, origin, radius)


def triangle_mesh(random: Random) -> sh.TriangleMesh:
    vertices, faces = triangles(random)
    vertices, faces = spoiled(random, vertices), spoiled_ids(random, faces)
    with unchanged(vertices, faces):
        return sh.TriangleMesh(vertices, faces)


def cloud(random: Random) -> sh.PointCloud:
    places, normals = points(random)
    places = spoiled(random, places)
    areas = np.full(len(places), one_of(random, (1.0, 1e-300, 1e300))) if chance(random, 0.2) else None
    neighbors = one_of(random, (30, 30, 6, 3, 1000))
    with unchanged(places, normals, areas):
        return sh.PointCloud(places, normals, areas, n_neighbors=neighbors)


def embedded(domain: Any) -> Any:
    """What sources on a domain are given on."""
    return domain.mesh if isinstance(domain, sh.IntrinsicTriangulation) else domain


def source(random: Random, domain: Any) -> Any:
    """A curve or points, valid or not quite."""
    domain = embedded(domain)
    mesh = domain.triangulation
    kind = random.integers(8)
    if kind == 0:
        ids = spoiled_ids(random, random.integers(_n_vertices(domain), size=int(random.integers(1, 5))))
        return domain.points_at(ids)
    if kind == 1:
        ids = spoiled_ids(random, random.integers(_n_vertices(domain), size=int(random.integers(2, 6))))
        return domain.path(ids, closed=chance(random, 0.3), oriented=chance(random, 0.7))
    if kind == 2:
        values = spoiled(random, mesh_function(random, _positions(domain)))
        found = domain.level_set(values, float(np.nanmedian(np.where(np.isfinite(values), values, 0.0))))
        return found if chance(random, 0.7) or not found else found[0]
    if kind == 3:
        return domain.boundary_curves()
    if kind == 4:
        return domain.region_boundary(random.random(_n_faces(domain)) < 0.4)
    if kind == 5:
        places = spoiled(random, _positions(domain)[random.integers(_n_vertices(domain), size=3)])
        return domain.polyline(places, closed=chance(random, 0.5), max_distance=one_of(random, (None, 1.0, 1e9)))
    n = int(random.integers(1, 9))
    faces = spoiled_ids(random, random.integers(mesh.n_faces, size=n))
    if chance(random, 0.4):
        faces[:] = faces[0]
    weights = random.random((n, 3)) ** one_of(random, (1, 20))
    weights[random.random((n, 3)) < 0.3] = 0.0
    weights[weights.sum(axis=1) == 0, 0] = 1.0
    weights = spoiled(random, weights / weights.sum(axis=1, keepdims=True))
    if kind == 6:
        return sh.SurfacePoints(faces, weights)
    closed = chance(random, 0.3)
    normals = random.normal(size=(n if closed else n - 1, 3)) if chance(random, 0.2) else None
    with unchanged(faces, weights, normals):
        return sh.Curve(faces, weights, closed, chance(random, 0.7), normals)


def mesh_function(random: Random, positions: np.ndarray) -> np.ndarray:
    """A coordinate, noise, or whole numbers, which level sets run along edges of."""
    kind = random.integers(3)
    if kind == 0:
        return positions[:, int(random.integers(3))].copy()
    made = random.normal(size=len(positions))
    return made if kind == 1 else np.round(made)


def constraint(random: Random) -> Any:
    numbers = (0.0, 1.0, -1.0, 1e-12, 1e12, 1e150, 1e300, 1e-300)
    return one_of(
        random,
        (
            None,
            sh.constraints.ZeroSet(),
            sh.constraints.ZeroSet(hard=True),
            sh.constraints.Free(),
            sh.constraints.EachComponent(),
            sh.constraints.LevelValues([one_of(random, numbers) for _ in range(random.integers(1, 4))]),
            sh.constraints.Soft(abs(one_of(random, numbers[1:]))),
        ),
    )


def _n_vertices(domain: Any) -> int:
    return len(_positions(domain))


def _n_faces(domain: Any) -> int:
    if isinstance(domain, sh.PolygonMesh):
        return len(domain.offsets) - 1
    return len(domain.normals) if isinstance(domain, sh.DigitalSurface) else domain.triangulation.n_faces


def _positions(domain: Any) -> np.ndarray:
    return domain.points if isinstance(domain, sh.PointCloud) else domain.vertices


def distance(random: Random) -> tuple[Any, Any, bool]:
    """A field that has been judged, its sources, and whether parts are out of reach."""
    domain = surface(random)
    sources = [source(random, domain) for _ in range(random.integers(1, 3))]
    asked = constraint(random)
    diffusion = one_of(random, (1.0, 1.0, 1.0, 1e-6, 100.0, 1e6, 1e12, 1e-12))
    intrinsic = isinstance(domain, sh.TriangleMesh) and chance(random, 0.2)
    solver = sh.SignedHeatSolver(domain, diffusion, intrinsic=intrinsic)
    given = embedded(domain)
    with unchanged(_positions(given), given.triangulation.faces):
        phi, warned = announced(lambda: solver.distance(sources, asked))
    judge(phi.values, warned, length_of_edges(given) + levels_of(asked))
    if chance(random, 0.1):
        again = pickle.loads(pickle.dumps(copy.copy(solver)))
        twin = announced(lambda: again.distance(sources, asked))[0]
        if not np.array_equal(twin.values, phi.values, equal_nan=True):
            raise Wrong("another value from a copy")
    if isinstance(domain, sh.IntrinsicTriangulation) and np.isfinite(judged_area(domain.mesh)):
        compare_area(domain)
    return phi, sources, warned


def judged_area(mesh: sh.TriangleMesh) -> float:
    with np.errstate(all="ignore"):
        return float(mesh.face_areas.sum())


def compare_area(domain: sh.IntrinsicTriangulation) -> None:
    """Flips and refinement keep the area, but for what mollification adds: see `intrinsic_delaunay`."""
    area, base = judged_area(domain.triangles), judged_area(domain.mesh)
    if abs(area - base) > 1e-4 * base:
        raise Wrong("area changed", f"{base:.17g} → {area:.17g}")


def check_distance(given: Subject) -> str:
    phi, _, warned = distance(given.random)
    kind = type(phi.domain).__name__
    return f"{kind}, in part" if warned else kind


def check_use(given: Subject) -> str:
    """What fields and curves are used for."""
    random = given.random
    phi, sources, warned = distance(random)
    size = length_of_edges(embedded(phi.domain))
    kind = int(random.integers(6))
    if kind < 2:
        method = one_of(random, (None, sh.methods.Geodesic(), sh.methods.Convex(max_rounds=30)))
        sharp, _ = announced(lambda: sh.sharpen(phi, method=method))
        lost = np.isnan(sharp.values) & ~np.isnan(phi.values)
        judge(sharp.values[~np.isnan(phi.values)], False, size, f"sharpened by {method}")
        return "sharpened" if not lost.any() else "sharpened in part"
    if kind == 2:
        span = phi.values[np.isfinite(phi.values)]
        level = float(random.uniform(span.min(), span.max()) if len(span) else 0.0)
        for curve in phi.contour(one_of(random, (0.0, level))):
            judge(curve.barycentric, False, 1.0, "contour")
        return "contour"
    if kind == 3:
        places = _positions(embedded(phi.domain))[:5] + random.normal(size=3)
        found, _ = announced(lambda: phi(places))
        judge(found, warned, size + float(np.nan_to_num(np.abs(phi.values)).max()), "interpolated")
        slopes, _ = announced(lambda: phi.gradient(places))
        judge(slopes, warned, np.inf, "gradient")
        return "evaluated"
    if kind == 4:
        found, _ = announced(lambda: sh.close_curves(sources, phi.domain))
        for curve in found:
            judge(curve.barycentric, False, 1.0, "closed curve")
        return "closed"
    operation = one_of(
        random, (sh.morphology.dilate, sh.morphology.erode, sh.morphology.opening, sh.morphology.closing)
    )
    reach = float(np.nanmax(np.abs(phi.values), initial=0.0)) * random.random() ** 2
    made, _ = announced(lambda: operation(sources, reach, phi.domain))
    for curve in made:
        judge(curve.barycentric, False, 1.0, operation.__name__)
    return operation.__name__


def check_piecewise(given: Subject) -> str:
    """Distance with jumps, on what it is defined on."""
    random = given.random
    domain = surface(random)
    sources = [source(random, domain) for _ in range(random.integers(1, 3))]
    smooth = chance(random, 0.7)
    phi, warned = announced(lambda: sh.piecewise_distance(sources, domain, smooth=smooth))
    judge(phi.values, warned, length_of_edges(embedded(domain)))
    for cut in phi.domain.cuts(phi.values):
        judge(cut.points, False, np.inf, "cut")
    if smooth:
        if (np.abs(phi.domain.jumps(phi.values))[~phi.domain.is_cut] > 0).any():
            raise Wrong("jumps off the cut")
    return "distance"


def check_triangulation(given: Subject) -> str:
    """Intrinsic triangulations keep the surface: area, vertices, and places of points."""
    random = given.random
    mesh = triangle_mesh(random)
    keep = [source(random, mesh) for _ in range(random.integers(3))]
    made, _ = announced(
        lambda: sh.intrinsic_delaunay(
            mesh, keep, refine=chance(random, 0.7), angle=random.uniform(1, 30), max_vertices=3000
        )
    )
    compare_area(made)
    judge(made.vertices, False, np.inf, "vertices")
    if not np.array_equal(made.vertices[: mesh.n_vertices], mesh.vertices):
        raise Wrong("vertices moved")
    weights = random.dirichlet(np.ones(3), size=5)
    faces = random.integers(mesh.n_faces, size=5)
    found, at = made.locate(faces, weights)
    judge(at, False, 1.0, "located points")
    if (found < 0).any() or (found >= made.n_faces).any():
        raise Wrong("located in a face that does not exist")
    if chance(random, 0.3):
        whole, _ = announced(lambda: sh.common_subdivision(made)[0])
        judge(whole.vertices, False, np.inf, "common subdivision")
    return "complete" if made.complete else "limited"


family("surface distance", subject, check_distance)
family("surface use", subject, check_use, memory=1 << 31)  # exact distance takes up to 17 kB for each of 60,000 faces
family("surface piecewise", subject, check_piecewise)
family("surface triangulation", subject, check_triangulation)
