"""Convergence as in the paper's Fig. 25, on meshes of your own: decimated, then Loop-subdivided four times.

The sources are level sets of the three lowest eigenfunctions of the Laplacian, subdivided with the mesh; the meshes
have 1,250 vertices at first and 320,000 in the end. For each source: order (slope of log ε against the log of the mean
edge length) and ε in per cent at each level, of the default, of the paper's one time, and of `sh.signed_distance`.
Truth is exact distance to the zero line of the eigenfunction, taken as linear in every triangle.
Run with ``python -m benchmarks.convergence MESH ...``; without meshes it takes two generated ones.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np
import trimesh
from scipy import sparse
from scipy.sparse import linalg

import signedheat as sh
from benchmarks.reproduction.baselines import cotan_laplacian, error
from benchmarks.reproduction.shapes import mean_edge, organic, subdivided

Array = np.ndarray
Way = Callable[[sh.TriangleMesh, list[sh.Curve]], sh.Field[sh.TriangleMesh]]

VERTICES, LEVELS, SOURCES = 1250, 4, 3
EXACT = 1e-3  # per cent

WAYS: dict[str, Way] = {
    "default": lambda mesh, curves: sh.SignedHeatSolver(mesh).distance(curves),
    "one time": lambda mesh, curves: sh.SignedHeatSolver(mesh, 1.0).distance(curves),
    "one call": lambda mesh, curves: sh.signed_distance(curves, mesh),
}


def main(paths: list[str]) -> None:
    print(f"{'mesh':>16} {'source':>6} {'way':>9} {'order':>6} falls  ε % at levels 0 to {LEVELS}")
    for name, mesh in meshes(paths):
        for source, by_way in enumerate(errors(decimated(mesh))):
            for way, (edges, found) in by_way.items():
                order = f"{np.polyfit(np.log(edges), np.log(found), 1)[0]:.2f}" if max(found) > EXACT else "exact"
                falls = "yes" if (np.diff(found) < 0).all() else "" if order == "exact" else "no"
                listed = " ".join(f"{value:.3g}" for value in found)
                print(f"{name:>16} {source:6d} {way:>9} {order:>6} {falls:>5}  {listed}", flush=True)


def meshes(paths: list[str]) -> Iterator[tuple[str, sh.TriangleMesh]]:
    if not paths:
        yield from ((f"organic {seed}", organic(seed, 6000)) for seed in (1, 3))
    for path in paths:
        shape = sh.read(path)
        yield path.rsplit("/", 1)[-1], shape if isinstance(shape, sh.TriangleMesh) else shape.triangulation


def decimated(mesh: sh.TriangleMesh) -> sh.TriangleMesh:
    """About `VERTICES` vertices, by quadric errors; the largest connected part, of diameter 1."""
    share = VERTICES / mesh.n_vertices
    fewer = mesh.to_pyvista().clean().decimate(1 - share) if share < 1 else mesh.to_pyvista()
    parts = trimesh.Trimesh(fewer.points, fewer.regular_faces).split(only_watertight=False)
    largest = max(parts, key=lambda part: len(part.faces))
    points = largest.vertices - largest.vertices.mean(axis=0)
    return sh.TriangleMesh(points / np.linalg.norm(np.ptp(points, axis=0)), largest.faces)


def eigenfunctions(mesh: sh.TriangleMesh) -> Array:
    """(n, `SOURCES`) the lowest that are not constant, of size 1."""
    laplacian, areas = cotan_laplacian(mesh)
    values, functions = linalg.eigsh(laplacian, k=SOURCES + 1, M=sparse.diags(areas), sigma=-1e-3)
    lowest = functions[:, np.argsort(values)[1:]]
    return lowest / np.abs(lowest).max(axis=0)


def errors(base: sh.TriangleMesh) -> list[dict[str, tuple[list[float], list[float]]]]:
    """Mean edges and ε at each level, for each way and each source."""
    lowest = eigenfunctions(base)
    found: list[dict[str, tuple[list[float], list[float]]]] = [{} for _ in range(SOURCES)]
    for level in range(LEVELS + 1):
        mesh, functions = subdivided(base, level), lowest
        if level:
            functions = trimesh.remesh.subdivide_loop(lowest, base.faces, iterations=level)[0]
        for source, by_way in enumerate(found):
            heights = functions[:, source] + 0.0123  # off the vertices
            curves = mesh.level_set(heights, 0.0)
            exact = sh.sharpen(sh.Field(mesh, heights)).values
            for way, distance in WAYS.items():
                edges, listed = by_way.setdefault(way, ([], []))
                edges.append(mean_edge(mesh))
                listed.append(error(distance(mesh, curves).values, exact))
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
