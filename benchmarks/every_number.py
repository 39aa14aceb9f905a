"""What hangs on each number that is named in the package: each halved and doubled, over shapes and curves of all kinds.

    python benchmarks/every_number.py [NAME …]

A number between a half and one goes half of the way to one instead of being doubled. Codes are left out, and so are
numbers of files, pictures, commands, memory and input. Each change runs in a process of its own, since kernels hold the
numbers that they were compiled with. A row of the table lists the cases whose values change by more than `CHANGED` of
the largest, and by how much, or the error that they end in; the numbers that change nothing are named below it.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import math
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from lid_shapes import shapes, volume
from numpy.typing import NDArray

import signedheat as sh
from signedheat import morphology, samples

Floats = NDArray[np.float64]
ROOT = Path(sh.__file__).parent
ROOMS = ("curves", "geodesics", "grids", "mesh", "search", "solids", "surfaces", "tets", ".")
ELSEWHERE = ("compiled", "exchange", "foreign", "memory", "parallel", "torch", "validation")
CHANGED = 1e-3
SECONDS = 120
"""Of a processor, for all cases."""
KILLED = (-signal.SIGXCPU, -signal.SIGKILL, 128 + signal.SIGXCPU, 128 + signal.SIGKILL)
BALL = samples.sphere(3)
SURFACE = samples.sphere(4)
PLACES = np.random.default_rng(0).uniform(-1.4, 1.4, (200, 3))


def boxes(*corners: tuple[float, ...]) -> sh.TriangleMesh:
    """Boxes from lower to upper corners, (6,) each."""
    unit = np.array(list(np.ndindex(2, 2, 2)), dtype=np.float64)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[quad[0], quad[k], quad[k + 1]] for quad in quads for k in (1, 2)])
    vertices = [np.array(c[:3]) + unit * np.subtract(c[3:], c[:3]) for c in corners]
    numbers = faces + 8 * np.arange(len(corners))[:, None, None]
    return sh.TriangleMesh(np.concatenate(vertices), numbers.reshape(-1, 3))


TWO_BOXES = boxes((-1, -1, -1, 0.3, 0.4, 0.5), (-0.2, -0.3, -0.4, 1, 1, 1))


def open_boxes() -> sh.TriangleMesh:
    """Three boxes that lack a face here and there, two of which cross, on a ground."""
    mesh = boxes((-1, -1, -0.9, 0, 0, 0), (-0.5, -0.5, -0.5, 0.6, 0.6, 0.6), (0.7, -0.5, -0.9, 1, 0, 0))
    ground = sh.TriangleMesh([[-2, -2, -1], [2, -2, -1], [2, 2, -1], [-2, 2, -1]], [[0, 1, 2], [0, 2, 3]])
    return samples.union(sh.TriangleMesh(mesh.vertices, np.delete(mesh.faces, [0, 13, 26, 27], axis=0)), ground)


def ring(on: Any, begin: float, end: float, height: float = 0.2, wave: float = 0.0) -> sh.Curve:
    """A part of a circle on the unit sphere, or of a wave, between shares of it."""
    angle = 2 * np.pi * np.linspace(begin, end, 40)
    points = np.stack([np.cos(angle), np.sin(angle), height + wave * np.sin(5 * angle)], axis=1)
    curve: sh.Curve = on.polyline(points / np.linalg.norm(points, axis=1, keepdims=True))
    return curve


def stretched() -> sh.TriangleMesh:
    """A ball of triangles thirty times as long as they are wide."""
    return sh.TriangleMesh(BALL.vertices * [1, 1, 30], BALL.faces)


def values(*fields: Any) -> Floats:
    """Values of fields, where there are none 9."""
    return np.concatenate([np.nan_to_num(np.asarray(field.values, np.float64).ravel(), nan=9.0) for field in fields])


def solid(shape: Any, **options: Any) -> Floats:
    """Distances and volume of a solid, and how sure its triangles are."""
    found = sh.complete(shape, **options)
    return np.append(found.distance(PLACES), [found.volume, found.confidence.mean()])


def strokes(turned: bool) -> Floats:
    """Distance to eight strokes along a circle, to one that was drawn twice, and a scribble."""
    pieces = [ring(SURFACE, k / 8, (k + 0.85) / 8) for k in range(8)]
    pieces = [piece.reversed() if turned and k % 3 == 0 else piece for k, piece in enumerate(pieces)]
    return values(sh.signed_distance([*pieces, ring(SURFACE, 0.3, 0.42, 0.22), ring(SURFACE, 0, 0.1, 1, 0.1)], SURFACE))


def drawing() -> Floats:
    """Distance to a flower in five strokes, one of them turned, and a dot beside it."""
    angle = np.linspace(0, 2 * np.pi, 200)
    flower = np.stack([np.cos(angle), np.sin(angle)], axis=1) * (1 + 0.2 * np.cos(5 * angle))[:, None]
    lines = [flower[40 * k : 40 * k + 36] for k in range(5)]
    lines[1] = lines[1][::-1]
    return values(
        sh.signed_distance([*map(sh.Polyline, lines), sh.Polyline(0.05 * flower[::20] + [1.6, 0])], resolution=48)
    )


def on_a_surface() -> Floats:
    """The method's own distance, sharpened in three ways."""
    field = sh.SignedHeatSolver(SURFACE).distance([ring(SURFACE, 0, 0.9, 0.2, 0.1), SURFACE.points_at(3)])
    return values(
        field,
        sh.sharpen(field),
        sh.sharpen(field, method=sh.methods.Convex()),
        sh.sharpen(field, method=sh.methods.Geodesic()),
    )


def on_thin_triangles() -> Floats:
    """Distance to a point, and the method's own to a line, on triangles thirty times as long as they are wide."""
    mesh = stretched()
    line = mesh.level_set(mesh.vertices[:, 2] + mesh.vertices[:, 0], 0.1)
    return values(sh.signed_distance(mesh.points_at(5), mesh), sh.SignedHeatSolver(mesh).distance(line))


def on_tets() -> Floats:
    """The same on tets, of a ball with holes."""
    broken = samples.without_faces(samples.sphere(2), 0.2, 0)
    field = sh.SignedHeatSolver(sh.tetrahedralize(broken, resolution=9)).distance(broken)
    return values(field, sh.sharpen(field))


def on_a_grid() -> Floats:
    """The same on a grid, and held softly."""
    broken = samples.without_faces(samples.sphere(2), 0.2, 0)
    field = sh.SignedHeatSolver(sh.Grid.around(broken, 16)).distance(broken)
    soft = sh.SignedHeatSolver(sh.Grid.around(broken, 12)).distance(broken, constraint=sh.constraints.Soft(10.0))
    return values(field, sh.sharpen(field), soft)


def on_points() -> Floats:
    """Distance to a curve with a gap on noisy points."""
    cloud = sh.PointCloud(BALL.vertices + 0.002 * np.random.default_rng(1).normal(size=BALL.vertices.shape))
    return values(sh.signed_distance(ring(cloud, 0, 0.9), cloud))


def on_points_with_normals() -> Floats:
    """Share of edges at holes, and distance on points of both sides of a plate; a ball with normals of which some are
    turned."""
    random = np.random.default_rng(2)
    points = random.uniform(-1, 1, (1200, 3)) * [1, 1, 0]
    up = np.where(np.arange(1200) % 2, 1.0, -1.0)[:, None] * [0, 0, 1]
    plate = sh.PointCloud(points + 0.03 * up, up)
    edges = np.sort(plate.triangulation.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    uses = np.unique(edges, axis=0, return_counts=True)[1]
    turned = np.where(random.random(BALL.n_vertices) < 0.2, -1, 1)[:, None] * BALL.vertices
    ball = solid(sh.PointCloud(BALL.vertices, turned))
    return np.concatenate([values(sh.signed_distance(plate.points_at(1), plate)), ball, [5 * (uses == 1).mean()]])


def on_voxels() -> Floats:
    """Distance to a face of voxels, and where the corners of the smooth surface are."""
    squares = sh.DigitalSurface(np.linalg.norm(np.indices((15, 15, 15)) - 7, axis=0) < 6.3)
    return np.append(values(sh.SignedHeatSolver(squares).distance(squares.points_at(0))), squares.smooth_vertices)


def checks() -> Floats:
    """Thickness, deviation of noise, and distances of samples."""
    thin, noisy = sh.wall_thickness(TWO_BOXES, resolution=24), samples.with_noise(BALL, 0.02, 0)
    found = sh.deviation(noisy, BALL), sh.complete(BALL).sample(1000)
    return np.concatenate([*(np.sort(np.asarray(each.distances)) for each in found), np.sort(thin.values)[::20]])


CASES: dict[str, Callable[[], Floats]] = {
    "30 % gone": lambda: solid(samples.without_faces(BALL, 0.3, 0)),
    "75 % gone": lambda: solid(samples.without_faces(samples.sphere(2), 0.7, 0)),
    "half a ball": lambda: solid((BALL.vertices, BALL.faces[BALL.vertices[BALL.faces].mean(axis=1)[:, 2] > 0])),
    "torus with holes": lambda: solid(samples.without_patches(samples.torus(n_around=48, n_across=24), 4, 0.25)),
    "two balls with holes": lambda: solid(
        samples.union(
            *(samples.without_patches(each, 3, 0.2) for each in (BALL, samples.sphere(3, center=(0.8, 0, 0))))
        )
    ),
    "turned faces": lambda: solid(samples.with_flipped_faces(BALL, 0.4)),
    "soup": lambda: solid(samples.soup(BALL, 0.03)),
    "open boxes": lambda: solid(open_boxes()),
    "points": lambda: solid(sh.PointCloud(BALL.vertices)),
    "noisy points": lambda: solid(sh.PointCloud(samples.with_noise(BALL, 0.02, 0).vertices)),
    "lids": lambda: np.array([volume(shape) / whole for shape, whole in shapes().values()]),
    "sharp surface": lambda: solid(sh.complete(TWO_BOXES).surface(resolution=32)),
    "kept faces": lambda: solid(sh.complete(open_boxes()).surface()),
    "level, simplified": lambda: solid(sh.complete(BALL).surface(level=0.1, resolution=32, tolerance=0.01)),
    "opening": lambda: solid(morphology.opening(TWO_BOXES, 0.1, resolution=40)),
    "thickness, deviation, samples": checks,
    "strokes": lambda: strokes(False),
    "strokes, some turned": lambda: strokes(True),
    "a gap": lambda: values(sh.signed_distance(ring(SURFACE, 0, 0.85), SURFACE)),
    "drawing": drawing,
    "jumps": lambda: values(sh.piecewise_distance([ring(SURFACE, 0, 0.6), ring(SURFACE, 0.1, 0.3, 1.0)], SURFACE)),
    "surface": on_a_surface,
    "thin triangles": on_thin_triangles,
    "point cloud": on_points,
    "points with normals": on_points_with_normals,
    "voxels": on_voxels,
    "tets": on_tets,
    "grid": on_a_grid,
    "redistanced": lambda: sh.redistance((np.linalg.norm(np.indices((17,) * 3) - 8.2, axis=0) - 5.3) ** 3 / 30).ravel(),
}


def numbers() -> Iterator[tuple[str, str, float]]:
    """Module, name and value of each number that is no code: those count up, or are 0 or −1."""
    for room in ROOMS:
        for path in sorted((ROOT / room).glob("*.py")):
            if path.stem in ELSEWHERE or path.stem.startswith("__"):
                continue
            module = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
            for statement in ast.parse(path.read_text()).body:
                targets = statement.targets if isinstance(statement, ast.Assign) else []
                for target in targets:
                    names = target.elts if isinstance(target, ast.Tuple) else [target]
                    found = [name.id for name in names if isinstance(name, ast.Name) and name.id.strip("_").isupper()]
                    held = [vars(importlib.import_module(module))[name] for name in found]
                    if not all(isinstance(value, (int, float)) for value in held):
                        continue
                    if len(held) > 1 and all(second - first == 1 for first, second in pairwise(held)):
                        continue
                    for name, value in zip(found, held, strict=True):
                        if not name.startswith("BYTES") and value not in (0, -1):
                            yield module, name, value


def changed_to(value: float) -> tuple[float, float]:
    """Half of a number and twice it, as the number is: whole, or a share."""
    twice = (1 + value) / 2 if 0.5 < value < 1 else (value - 1) / 2 if -1 < value < -0.5 else 2 * value
    return (max(value // 2, 1), 2 * value) if isinstance(value, int) else (value / 2, twice)


def set_everywhere(name: str, value: float) -> None:
    """Change a number in all modules that are imported and hold it."""
    for module in [module for key, module in sys.modules.items() if key.startswith("signedheat.")]:
        if name in vars(module):
            setattr(module, name, type(vars(module)[name])(value))


def run() -> None:
    """Write the values of all cases to standard output, with a number changed if its module, name and value follow."""
    importlib.import_module("signedheat.public")
    for room in ROOMS:
        for path in (ROOT / room).glob("*.py"):
            if not path.stem.startswith("__"):
                importlib.import_module(".".join(path.relative_to(ROOT.parent).with_suffix("").parts))
    if len(sys.argv) > 2:
        set_everywhere(sys.argv[-2], float(sys.argv[-1]))
    warnings.simplefilter("ignore")
    found: dict[str, Any] = {}
    for case, make in CASES.items():
        try:
            found[case] = make().tolist()
        except Exception as error:
            found[case] = type(error).__name__
    json.dump(found, sys.stdout)


def outcome(*change: object) -> dict[str, Any] | str:
    """Values of all cases in a process of its own, or how it ended."""
    limit = f'ulimit -t {SECONDS}; exec "$@"'
    command = ["sh", "-c", limit, "sh", sys.executable, __file__, "--run", *map(str, change)]
    one_thread = {**os.environ, "NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=one_thread, check=False)
    if done.returncode:
        return "does not end" if done.returncode in KILLED else done.stderr.strip().split("\n")[-1]
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def differences(usual: dict[str, Any], other: dict[str, Any] | str) -> dict[str, str]:
    """By how much cases changed, relative to their largest value."""
    if isinstance(other, str):
        return {"all": other}
    found = {}
    for case, values in usual.items():
        if isinstance(other[case], str) or len(values) != len(other[case]):
            found[case] = other[case] if isinstance(other[case], str) else "other places"
        else:
            change = float(np.abs(np.subtract(values, other[case])).max() / np.abs(values).max())
            if change > CHANGED or math.isnan(change):
                found[case] = f"{change:.2g}"
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    options = parser.parse_args()
    usual = outcome()
    assert isinstance(usual, dict), usual
    wrong = {case: values for case, values in usual.items() if isinstance(values, str)}
    assert not wrong, wrong
    chosen = [row for row in numbers() if not options.names or row[1] in options.names]
    jobs = [(*row[:2], value) for row in chosen for value in changed_to(row[2])]
    idle = []
    print("| number | value | half | twice |\n|---|--:|---|---|")
    with ThreadPoolExecutor(options.processes) as pool:
        told = pool.map(lambda job: differences(usual, outcome(*job)), jobs)
        for module, name, value in chosen:
            rows = [", ".join(f"{case} {change}" for case, change in next(told).items()) for _ in range(2)]
            if any(rows):
                print(
                    f"| `{module.removeprefix('signedheat.')}.{name}` | {value:g} | {rows[0]} | {rows[1]} |", flush=True
                )
            else:
                idle.append(name)
    print(f"\nNothing changes with {', '.join(idle)}.")


if __name__ == "__main__":
    run() if "--run" in sys.argv else main()
