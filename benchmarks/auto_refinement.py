"""What the default, ``intrinsic="auto"``, gains and costs on meshes of large angles and needles.

There is one table for meshes as CAD programs make, whose triangles are few, and one for decimated organic meshes.

For each limit on the largest triangles (the default's first) and for the triangles as they are: error beside that of
``intrinsic=True``, which makes triangles for every curve; vertices; seconds of all threads for the first distance and a
further one, as multiples of those of the triangles as they are. Two level curves of distance in space on each mesh;
truth is exact distance along the surface. `python benchmarks/surface.py --triangles` prints it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator

import numpy as np
import pyvista
import trimesh

import signedheat as sh
from signedheat.samples import torus
from signedheat.surfaces import intrinsic_discretization as intrinsic

LIMITS = (intrinsic.COARSEST_TRIANGLE, 1.25, 2.0, np.inf)


def tables() -> None:
    warnings.simplefilter("ignore", sh.errors.InexactWarning)
    table(meshes())
    table(decimated())


def table(listed_meshes: Iterator[tuple[str, sh.TriangleMesh]]) -> None:
    rows: dict[str, list[tuple[float, ...]]] = {}
    default = intrinsic.COARSEST_TRIANGLE
    for name, mesh in listed_meshes:
        if not intrinsic.is_spoiled(mesh):
            continue
        cases = [case(mesh, seed) for seed in (10, 11)]
        plain = measured(mesh, cases, False)
        for limit in LIMITS:
            intrinsic.COARSEST_TRIANGLE = limit
            found = measured(mesh, cases, "auto")
            ratios = [a / b for a, b in zip(found[:3], plain[:3], strict=True)]
            rows.setdefault(f"largest {limit:g}", []).extend((*ratios, error) for error in found[3:])
        intrinsic.COARSEST_TRIANGLE = default
        rows.setdefault("as they are", []).extend((1.0, 1.0, 1.0, error) for error in plain[3:])
        shown = rows[f"largest {default:g}"][-1]
        print(
            f"{name:>14} {mesh.n_vertices:6d} vertices: {shown[2]:.1f} × vertices, first {shown[0]:.1f} ×", flush=True
        )
    print(f"{'median / worst':>16}{'ε of True':>16}{'within 1.2':>12}{'vertices':>16}{'first':>16}{'next':>16}")
    for way, listed in rows.items():
        first, following, vertices, error = np.array(listed).T
        cells = "".join(f"{np.median(c):9.2f} /{c.max():5.1f}" for c in (vertices, first, following))
        within = f"{int((error <= 1.2).sum())} of {len(error)}"
        print(f"{way:>16}{np.median(error):9.2f} /{error.max():5.1f}{within:>12}{cells}")


def meshes() -> Iterator[tuple[str, sh.TriangleMesh]]:
    """Prisms, plates and bodies of revolution in as few triangles as they take, and with each face in 16."""
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    gear = np.where((np.arange(96) // 4) % 2, 3.0, 2.6)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    bracket = np.array([[0, 0], [8, 0], [8, 1.2], [1.2, 1.2], [1.2, 6], [0, 6]])
    turns = np.linspace(0, np.pi / 2, 40)
    fillet = np.concatenate(
        [[[0, 0], [6, 0], [6, 1]], np.stack([2 - np.sin(turns), 2 - np.cos(turns)], 1), [[1, 6], [0, 6]]]
    )
    few = {
        "gear": prism(gear, 1.0),
        "bracket": prism(bracket, 2.0),
        "fillet": prism(fillet, 8.0),
        "cylinder": of(trimesh.creation.cylinder(1.0, 6.0, sections=96)),
        "cone": of(trimesh.creation.cone(1.0, 4.0, sections=80)),
        "tube": of(trimesh.creation.annulus(1.0, 2.0, 5.0, sections=90)),
        "capsule": of(trimesh.creation.capsule(5.0, 1.0, count=[24, 24])),
    }
    for name, mesh in few.items():
        yield name, mesh
        yield f"{name}/16", of(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).subdivide().subdivide())
    for around, across in ((120, 12), (240, 12), (20, 40)):
        yield f"torus {around}×{across}", torus(n_around=around, n_across=across)


def decimated() -> Iterator[tuple[str, sh.TriangleMesh]]:
    """Organic meshes by quadric decimation, and with each face in 16."""
    for seed, faces in enumerate((1500, 1500, 4000, 4000, 12000)):
        mesh = blobs(seed)
        polygons = pyvista.make_tri_mesh(mesh.vertices, mesh.faces)
        fewer = polygons.decimate(1 - faces / mesh.n_faces)
        for suffix, some in {"": fewer, "/16": fewer.subdivide(2, "linear")}.items():
            yield f"blobs {faces}{suffix}", sh.TriangleMesh(some.points.astype(float), some.regular_faces)


def blobs(seed: int) -> sh.TriangleMesh:
    """The largest part of a level set of a sum of bumps, smooth as scanned bodies are."""
    centers = np.random.default_rng(seed).uniform(-0.6, 0.6, (12, 3))
    grid = sh.Grid((-1.5, -1.5, -1.5), 0.03, (101, 101, 101))
    heights = sum(np.exp(-(((grid.points - c) / 0.3) ** 2).sum(axis=-1)) for c in centers)
    level = sh.Field(grid, 0.6 - heights).contour()
    parts = trimesh.Trimesh(level.vertices, level.faces, process=False).split(only_watertight=True)
    return of(max(parts, key=lambda part: len(part.faces)))


def of(mesh: trimesh.Trimesh) -> sh.TriangleMesh:
    mesh.merge_vertices()
    return sh.TriangleMesh(mesh.vertices, mesh.faces)


def prism(outline: np.ndarray, height: float) -> sh.TriangleMesh:
    """An outline extruded; its caps are cut into triangles ear by ear."""
    n, i = len(outline), np.arange(len(outline))
    caps, j = np.array(ears(outline)), (i + 1) % n
    points = np.concatenate(
        [np.pad(outline, ((0, 0), (0, 1))), np.pad(outline, ((0, 0), (0, 1)), constant_values=height)]
    )
    sides = [np.stack([i, j, n + j], 1), np.stack([i, n + j, n + i], 1)]
    return sh.TriangleMesh(points, np.concatenate([*sides, caps[:, ::-1], caps + n]))


def ears(outline: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of a polygon that runs counter-clockwise: the first corner with nothing in its triangle goes first."""
    left, triangles = list(range(len(outline))), []

    def area(a: int, b: int, c: int) -> float:
        u, v = outline[b] - outline[a], outline[c] - outline[a]
        return float(u[0] * v[1] - u[1] * v[0])

    while len(left) > 2:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            inside = (min(area(a, b, p), area(b, c, p), area(c, a, p)) > 0 for p in left if p not in (a, b, c))
            if area(a, b, c) > 0 and not any(inside):
                triangles.append((a, b, c))
                left.pop(k)
                break
    return triangles


def case(mesh: sh.TriangleMesh, seed: int) -> tuple[list[sh.Curve], np.ndarray, float]:
    """Where distance in space from a vertex has its 60 % quantile; the truth; and the error of ``intrinsic=True``."""
    center = mesh.vertices[np.random.default_rng(seed).integers(mesh.n_vertices)]
    heights = -np.linalg.norm(mesh.vertices - center, axis=1)
    heights = heights * (1 + 1e-7 * np.random.default_rng(1).normal(size=len(heights)))
    level = float(np.quantile(heights, 0.6))
    curves = mesh.level_set(heights, level)
    away = np.abs(sh.signed_distance(curves, mesh, as_oriented=True).restrict().values)
    truth = np.where(heights > level, away, -away)
    return curves, truth, error(sh.SignedHeatSolver(mesh, intrinsic=True).distance(curves), truth)


def error(field: sh.Field, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((field.restrict().values - truth) ** 2)) / np.ptp(truth))


def measured(mesh: sh.TriangleMesh, cases: list, refine: bool | str) -> tuple[float, ...]:
    """Seconds of a first distance and of a further one, vertices, and the error of both beside that of ``True``."""
    best = [np.inf, np.inf]
    for _ in range(3):
        solver = sh.SignedHeatSolver(sh.TriangleMesh(mesh.vertices, mesh.faces), intrinsic=refine)
        for k, (curves, _, _) in enumerate(cases):
            best[k] = min(best[k], seconds(lambda solver=solver, curves=curves: solver.distance(curves)))
    errors = [error(solver.distance(curves), truth) / other for curves, truth, other in cases]
    return (*best, solver.discretization.triangles.n_vertices, *errors)


def seconds(action: Callable[[], object]) -> float:
    begin = time.process_time()
    action()
    return time.process_time() - begin
