"""Distance on grids: seconds per step beside one cosine transform of that size, memory, error, and what others take.

    python benchmarks/grid.py [64 128 256 …]
    python benchmarks/grid.py --peers

Each size runs in a process of its own, so that its peak memory is its own. With ``--peers`` a like job is done at 128³
by libigl (unsigned distance with the sign of fast winding numbers, each tree built once), MeshLib (general offset) and
signedheat3d, where they are installed; they are not needed otherwise. The first gives wall-clock times, the
second CPU seconds of all threads.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import signedheat as sh

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes.grid_cases import box, relative_error
from shapes.grid_cases import sphere as spiral_sphere
from shapes.surface_cases import flipped

OFFSET = 0.2
REPEATS = 6


def sphere(n_vertices: int, missing: float = 0.0) -> sh.TriangleMesh:
    """The unit sphere, without the faces within round holes that make up a fraction of it."""
    whole = spiral_sphere(n_vertices)
    spots = np.random.default_rng(7).normal(size=(60, 3))
    spots /= np.linalg.norm(spots, axis=1)[:, None]
    nearness = (whole.vertices[whole.faces].mean(axis=1) @ spots.T).max(axis=1)
    return sh.TriangleMesh(whole.vertices, whole.faces[nearness <= np.quantile(nearness, 1 - missing)])


def scattered(missing: float) -> sh.TriangleMesh:
    """The unit sphere without every face that chance takes away."""
    whole = sphere(10_000)
    kept = np.random.default_rng(7).random(whole.n_faces) >= missing
    return sh.TriangleMesh(whole.vertices, whole.faces[kept])


def soup(noise: float) -> sh.TriangleMesh:
    """The unit sphere's faces, each moved a little on its own."""
    whole = sphere(10_000)
    moves = noise * np.random.default_rng(7).normal(size=(whole.n_faces, 1, 3))
    corners = (whole.vertices[whole.faces] + moves).reshape(-1, 3)
    return sh.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


def best(job: Callable[[], Any]) -> tuple[float, Any]:
    """Least wall-clock seconds of a few runs, and the last result."""
    seconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        result = job()
        seconds.append(time.perf_counter() - begin)
    return min(seconds), result


def repeated(job: Callable[[], Any], times: int = 3) -> tuple[list[float], Any]:
    """CPU seconds of all threads of each run, and the last result."""
    seconds = []
    for _ in range(times):
        begin = time.process_time()
        result = job()
        seconds.append(time.process_time() - begin)
    return seconds, result


def told(seconds: list[float]) -> str:
    """The least, and how far above it the slowest was."""
    return f"{min(seconds):7.2f} s (+{100 * (max(seconds) / min(seconds) - 1):3.0f} %)"


def peak_bytes() -> int:
    """Peak resident memory of this process, where the system tells it."""
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def measure(n: int) -> dict[str, Any]:
    """One size: distance, sharpening and offset, on the sphere of about 20k faces."""
    from scipy.fft import dctn

    shape, grid = sphere(10_000), box(n)
    sh.sharpen(sh.SignedHeatSolver(box(36)).distance(shape)).offset(OFFSET)  # compile
    before = peak_bytes()
    totals, fields = [], []
    transform, peak = np.inf, 0
    for _ in range(REPEATS):
        begin = time.perf_counter()
        field = sh.SignedHeatSolver(grid).distance(shape)
        totals.append(time.perf_counter() - begin)
        fields.append(field.diagnostics.timings)
        peak = peak or peak_bytes()  # of the first run alone
        if n <= 256:
            values = np.ones(grid.shape)
            transform = min(transform, best(lambda values=values: dctn(values, workers=-1))[0])
    steps = {step: min(timings[step] for timings in fields) for step in fields[0]}
    sharpening, sharpened = best(lambda: sh.sharpen(field))
    contouring, _ = best(lambda: sharpened.offset(OFFSET))
    exact = np.linalg.norm(grid.points, axis=-1) - 1 if n <= 256 else None
    return {
        "n": n,
        "steps": steps,
        "total": min(totals),
        "transform": transform,
        "sharpen": sharpening,
        "offset": contouring,
        "bytes per node": (peak - before) / grid.n_nodes,
        "peak": peak,
        "plain": None if exact is None else relative_error(field.values, exact),
        "sharpened": None if exact is None else relative_error(sharpened.values, exact),
    }


def report(n: int) -> None:
    output = subprocess.run([sys.executable, __file__, "--measure", str(n)], check=True, capture_output=True, text=True)
    row = json.loads(output.stdout.splitlines()[-1])
    steps = "  ".join(f"{step} {1000 * seconds:.0f}" for step, seconds in row["steps"].items())
    print(f"{n}³  total {row['total']:.3f} s = {row['total'] / row['transform']:.1f} dctn of {row['transform']:.4f} s")
    print(f"     steps in ms: {steps};  then sharpen {1000 * row['sharpen']:.0f}, offset {1000 * row['offset']:.0f}")
    print(f"     peak {row['peak'] / 1e9:.2f} GB, {row['bytes per node']:.0f} bytes per node beyond the libraries")
    if row["plain"] is not None:
        print(f"     ε plain {100 * row['plain']:.4f} %, sharpened {100 * row['sharpened']:.4f} %", flush=True)


def peers(n: int) -> None:
    """The same job, whole and broken, beside other programs."""
    grid = box(n)
    exact = np.linalg.norm(grid.points, axis=-1) - 1
    shapes = {
        "sphere, 82k faces": sphere(41_000),
        "sphere, 35 % missing in 60 places": sphere(10_000, 0.35),
        "sphere, 35 % missing here and there": scattered(0.35),
        "sphere, 10 % flipped": flipped(sphere(10_000), 0.1, seed=7),
        "sphere, a soup with noise": soup(0.01),
    }
    for name, shape in shapes.items():
        print(f"{name}, {n}³")
        times, field = repeated(lambda shape=shape: sh.signed_distance(shape, grid))
        seconds = min(times)
        print(f"  signedheat     {told(times)}  ε {relative_error(field.values, exact):.5f}", flush=True)
        times, surface = repeated(lambda shape=shape: sh.offset(shape, OFFSET, spacing=float(grid.spacing[0])))
        radius = np.abs(np.linalg.norm(surface.vertices, axis=1) - 1 - OFFSET).max()
        print(f"  signedheat     {told(times)}  (offset)   radius off by {radius:.4f}", flush=True)
        for peer, ours in ((libigl, seconds), (signedheat3d, seconds), (meshlib, min(times))):
            try:
                print("  " + peer(shape, grid, exact, ours), flush=True)
            except ImportError:
                print(f"  {peer.__name__:14s} not installed")


def libigl(shape: sh.TriangleMesh, grid: sh.Grid, exact: np.ndarray, ours: float) -> str:
    import igl

    points, vertices, faces = grid.points.reshape(-1, 3), np.array(shape.vertices), np.array(shape.faces)

    def signed() -> np.ndarray:
        tree = igl.AABB()
        tree.init(vertices, faces)
        unsigned = np.sqrt(tree.squared_distance(vertices, faces, points)[0])
        inside = np.asarray(igl.fast_winding_number(vertices, faces, points)) > 0.5
        return np.where(inside, -unsigned, unsigned)

    seconds, values = repeated(signed)
    error = relative_error(values.reshape(grid.shape), exact)
    return f"libigl         {told(seconds)}  ε {error:.5f}   {min(seconds) / ours:.1f} times ours"


def meshlib(shape: sh.TriangleMesh, grid: sh.Grid, exact: np.ndarray, ours: float) -> str:
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(np.array(shape.faces, dtype=np.int32), np.array(shape.vertices))
    settings = mrmeshpy.GeneralOffsetParameters()
    settings.voxelSize = float(grid.spacing[0])
    settings.signDetectionMode = mrmeshpy.SignDetectionMode.HoleWindingRule
    seconds, surface = repeated(lambda: mrmeshpy.generalOffsetMesh(mesh, OFFSET, settings))
    radius = np.linalg.norm(mrmeshnumpy.getNumpyVerts(surface), axis=1)
    off = np.abs(radius - 1 - OFFSET).max()
    return f"MeshLib        {told(seconds)}  (offset)   {min(seconds) / ours:.1f} times ours, radius off by {off:.4f}"


def signedheat3d(shape: sh.TriangleMesh, grid: sh.Grid, exact: np.ndarray, ours: float) -> str:
    import signedheat3d as peer

    solver = peer.SignedHeatGridSolver()
    begin = time.perf_counter()
    values = solver.compute_distance_to_mesh(np.array(shape.vertices), shape.faces.tolist())
    seconds = time.perf_counter() - begin
    return (
        f"signedheat3d   {seconds:7.2f} s  {np.size(values)} nodes of its own choice   {seconds / ours:.1f} times ours"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sizes", nargs="*", type=int, help="nodes along each axis; by default 64 128 256")
    parser.add_argument(
        "--peers", action="store_true", help="instead, compare with libigl, MeshLib and signedheat3d at 128³"
    )
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.measure)))
        return
    if options.peers:
        peers(128)
        return
    for n in options.sizes or (64, 128, 256):
        report(n)


if __name__ == "__main__":
    main()
