"""Signed distance at points, beside libigl, Open3D and pysdf: seconds, and the share of wrong signs on broken shapes.

    python benchmarks/queries.py [--subdivisions 5 8] [--share 10] [--broken | --start]

Closed shapes are a ball with bumps. Building is apart from asking. Processor seconds of all threads, for a million
points at random in a box, within 0.02 of the surface, on a grid in its order, and along a thousand rays; one point
alone in milliseconds, the median of 200. Differences are the largest of 100,000 from libigl's distance with
pseudonormals. libigl builds its trees at each call: what a call of one point takes is building. Open3D and pysdf
compute in single precision, and pysdf looks at the faces around near vertices only. With ``--share 10`` all but ours
have every tenth run of a thousand points, and their times are multiplied.

With ``--start``: what a program that loads a saved solid waits for, and the memory of many points.

With ``--broken``: signs at points of the box that are farther from the whole shape than a hundredth of its size, beside
those of the whole shape; the damages of ``solids.py``.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import signedheat as sh
from signedheat import samples

COUNT = 1_000_000
RUN = 1000
"""Points of a ray, and of those that follow each other where only a share of them is taken."""
Array = NDArray[np.float64]
Ask: TypeAlias = Callable[[Array], Array]


def bumpy(subdivisions: int) -> sh.TriangleMesh:
    """A ball with bumps."""
    ball = samples.sphere(subdivisions)
    bumps = 1 + 0.12 * np.sin(5 * ball.vertices[:, :1]) * np.cos(4 * ball.vertices[:, 1:2] + ball.vertices[:, 2:])
    return sh.TriangleMesh(ball.vertices * bumps, ball.faces)


def ours(mesh: sh.TriangleMesh) -> Ask:
    """Completed, and its trees built."""
    solid = sh.complete(mesh)
    solid.distance([[0.0, 0.0, 0.0]])
    return solid.distance


def libigl(kind: str) -> Callable[[sh.TriangleMesh], Ask]:
    """It builds its trees anew at each call, which is part of asking."""
    import igl

    chosen = getattr(igl, f"SIGNED_DISTANCE_TYPE_{kind}")

    def build(mesh: sh.TriangleMesh) -> Ask:
        vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
        return lambda points: igl.signed_distance(points, vertices, faces, chosen)[0]

    return build


def open3d(mesh: sh.TriangleMesh) -> Ask:
    """Embree: sign by counting crossings of one ray."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))

    def ask(points: Array) -> Array:
        return np.asarray(scene.compute_signed_distance(points.astype(np.float32)).numpy(), dtype=np.float64)

    ask(np.zeros((1, 3)))
    return ask


def pysdf(mesh: sh.TriangleMesh) -> Ask:
    """Positive inside, as it has it; turned here."""
    from pysdf import SDF

    measure = SDF(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    return lambda points: -np.asarray(measure(points.astype(np.float32)), dtype=np.float64)


def programs() -> dict[str, Callable[[sh.TriangleMesh], Ask]]:
    """Those that are installed."""
    found: dict[str, Callable[[sh.TriangleMesh], Ask]] = {"signedheat": ours}
    if find_spec("igl"):
        found["libigl, pseudonormals"] = libigl("PSEUDONORMAL")
        found["libigl, fast winding"] = libigl("FAST_WINDING_NUMBER")
    if find_spec("open3d"):
        found["Open3D"] = open3d
    if find_spec("pysdf"):
        found["pysdf"] = pysdf
    return found


def clocked(run: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What a function returns, and its processor seconds."""
    begin = time.process_time()
    result = run(*arguments)
    return result, time.process_time() - begin


def alone(ask: Ask, points: Array) -> float:
    """Milliseconds of the clock for one point, the median."""
    times = []
    for k in range(len(points)):
        begin = time.perf_counter()
        ask(points[k : k + 1])
        times.append(1e3 * (time.perf_counter() - begin))
    return float(np.median(times))


def point_sets(half: float, size: float) -> dict[str, Array]:
    """A million points each: at random in a box, near the surface, the nodes of a grid in its order, along rays."""
    rng = np.random.default_rng(0)
    ball = bumpy(5)
    spots = ball.vertices[rng.integers(0, len(ball.vertices), COUNT)]
    axis = np.linspace(-half, half, 100)
    ends = rng.uniform(-half, half, (2, COUNT // RUN, 1, 3))
    return {
        "random": rng.uniform(-half, half, (COUNT, 3)),
        "near": spots + rng.normal(0, 0.02 * size, (COUNT, 3)),
        "grid": np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3),
        "rays": (ends[0] + np.linspace(0, 1, RUN)[:, None] * (ends[1] - ends[0])).reshape(-1, 3),
    }


def speed(subdivisions: int, share: int) -> None:
    """Print a table for one shape."""
    mesh = bumpy(subdivisions)
    sets = point_sets(1.3, 1.0)
    some = {name: points.reshape(-1, RUN, 3)[::share].reshape(-1, 3) for name, points in sets.items()}
    print(f"{mesh.n_faces:,} faces")
    print(f"{'':<24}{'build':>9}", *(f"{name:>8}" for name in sets), f"{'one, ms':>8}{'largest difference':>20}")
    found = programs()
    truth = found["libigl, pseudonormals"](mesh)(sets["random"][:100_000])
    for name, build in found.items():
        ask, building = clocked(build, mesh)
        anew = clocked(ask, sets["random"][:1])[1] if "libigl" in name else 0.0
        times, of = (1, sets) if build is ours else (share, some)
        seconds = [times * (clocked(ask, points)[1] - anew) for points in of.values()]
        single = np.nan if anew else alone(ask, sets["random"][:200])
        off = float(np.abs(ask(sets["random"][:100_000]) - truth).max())
        print(f"{name:<24}{building + anew:>9.2f}", *(f"{s:>8.2f}" for s in seconds), f"{single:>8.3f}", end="")
        print(f"{off:>20.1e}", flush=True)


def start(subdivisions: int) -> None:
    """Print what a new process waits for, and what memory it takes."""
    mesh = bumpy(subdivisions)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "solid.npz"
        sh.complete(mesh).save(path)
        print(f"{mesh.n_faces:,} faces, {path.stat().st_size / 1e6:.1f} MB", flush=True)
        for count in (1, COUNT, 10 * COUNT):
            subprocess.run([sys.executable, __file__, "--wait", str(path), str(count)], check=True)


def wait(path: str, count: int) -> None:
    """Load a solid, and ask it."""
    begin = time.perf_counter()
    solid = sh.read(path)
    loaded = time.perf_counter() - begin
    solid.distance([[0.0, 0.0, 0.0]])
    answered = time.perf_counter() - begin
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (count, 3))
    values = solid.distance(points)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    arrays = (points.nbytes + values.nbytes) / 2**20
    print(f"loaded in {loaded:.2f} s, first answer after {answered:.2f} s with {before / 1024:.0f} MB;", end=" ")
    print(f"{count:,} points ({arrays:.0f} MB with their distances): {peak / 1024:.0f} MB at most", flush=True)


def broken() -> None:
    """Print the share of wrong signs."""
    from solids import DAMAGES, shapes

    found = programs()
    print(f"{'wrong signs, %':<40}", *(f"{name:>23}" for name in found))
    points = np.random.default_rng(1).uniform(-1.3, 1.3, (50_000, 3))
    for damage, wreck in DAMAGES.items():
        shares: dict[str, list[float]] = {name: [] for name in found}
        for mesh in shapes().values():
            size = float(np.ptp(mesh.vertices, axis=0).max())
            truth = ours(mesh)(points)
            off = np.abs(truth) > 0.01 * size
            wrecked = wreck(mesh)
            for name, build in found.items():
                values = build(wrecked)(points)
                shares[name].append(100 * float(((values < 0) != (truth < 0))[off].mean()))
        text = (f"{np.median(each):.2f} ({np.max(each):.2f})" for each in shares.values())
        print(f"{damage:<40}", *(f"{each:>23}" for each in text), flush=True)


def main() -> None:
    """Print tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--subdivisions", nargs="*", type=int, default=[5, 8], help="of the ball: 20 · 4ⁿ faces")
    parser.add_argument("--share", type=int, default=1, help="one of how many runs of points the others are given")
    parser.add_argument("--broken", action="store_true", help="signs on broken shapes instead")
    parser.add_argument("--start", action="store_true", help="time to the first answer, and memory, instead")
    parser.add_argument("--wait", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.wait:
        wait(options.wait[0], int(options.wait[1]))
        return
    if options.broken:
        broken()
        return
    ours(bumpy(2))(np.zeros((10_000, 3)))  # compiles
    for subdivisions in options.subdivisions:
        if options.start:
            start(subdivisions)
        else:
            speed(subdivisions, options.share)


if __name__ == "__main__":
    main()
