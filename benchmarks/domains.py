"""Every domain beside its peer, on shapes with a known answer: CPU seconds of all threads, memory, error, in one run.

    python benchmarks/domains.py [polygons points voxels volumes] [--sizes 4000 16000 64000] [--volumes 70000 260000]

Polygons and points: potpourri3d. The others have no peer here (signedheat3d has no wheel), but a comparison: voxels
without corrected normals; tets and grids, with and without solid corners, plain beside sharpened. Each measurement runs
in a process of its own, so that its peak memory is its own; numba kernels are compiled before any clock starts.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from shapes import domain_cases as cases

HEIGHT = 0.3
TILT = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])


def globe(size: int) -> tuple:
    """Sphere in quads; the parallel nearest to 30° north; distance to it."""
    n = 6 * round(np.sqrt(size / 2) / 6)
    vertices, polygons = cases.globe(n)
    ring = np.arange(2 * n) + (n // 3 - 1) * 2 * n
    return vertices, polygons, ring, np.arcsin(np.clip(vertices[:, 2], -1, 1)) - np.pi / 6


def brick_plate(size: int) -> tuple:
    """Plate of hexagons with jitter; a line of edges along x, which stays straight; distance to it."""
    n = 2 * round(np.sqrt(size) / 2)
    vertices, polygons = cases.bricks(n)
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    move = np.random.default_rng(0).uniform(-0.2, 0.2, (n + 1, n + 1, 2)) * 2 / n
    move[[0, -1]] = move[:, [0, n // 2, -1]] = 0
    vertices[:, :2] += move.reshape(-1, 2)
    return vertices, polygons, ids[:, n // 2], vertices[:, 1]


def sphere_cloud(size: int) -> tuple:
    """Noisy spiral on the sphere with a circle of points in it."""
    ring = cases.parallel(int(np.sqrt(size)), HEIGHT)
    points = cases.sphere_points(size)
    away = np.abs(np.arcsin(points[:, 2]) - np.arcsin(HEIGHT)) > 1.0 / np.sqrt(size)
    points = np.concatenate([ring, points[away]])
    return points, points.copy(), np.arange(len(ring)), np.arcsin(points[:, 2]) - np.arcsin(HEIGHT)


def cylinder_cloud(size: int) -> tuple:
    """Independent random points on an open cylinder with a circle of points among them."""
    rng = np.random.default_rng(0)
    angle, z = 2 * np.pi * rng.random(size), 4 * rng.random(size) - 2
    keep = np.abs(z - 0.2) > 0.8 / np.sqrt(size)
    ring = np.linspace(0, 2 * np.pi, int(0.8 * np.sqrt(size)), endpoint=False)
    angle, z = np.concatenate([ring, angle[keep]]), np.concatenate([np.full(len(ring), 0.2), z[keep]])
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return normals + [0, 0, 1] * z[:, None], normals, np.arange(len(ring)), z - 0.2


def plane_cloud(size: int) -> tuple:
    """Independent random points on a square with a circle of points among them."""
    rng = np.random.default_rng(0)
    points = np.column_stack([2 * rng.random((size, 2)) - 1, np.zeros(size)])
    points = points[np.abs(np.linalg.norm(points, axis=1) - 0.5) > 0.8 / np.sqrt(size)]
    angle = np.linspace(0, 2 * np.pi, int(0.7 * np.sqrt(size)), endpoint=False)
    ring = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([ring, points])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return points, normals, np.arange(len(ring)), 0.5 - np.linalg.norm(points, axis=1)


POLYGONS = {"sphere of quads": globe, "plate of hexagons": brick_plate}
CLOUDS = {"sphere": sphere_cloud, "open cylinder": cylinder_cloud, "plane": plane_cloud}


def lattice(size: int):
    """About so many tets of a lattice in [−1.6, 1.6]³."""
    import signedheat as sh

    diagonal = sh.TriangleMesh(1.6 * np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]]), [[0, 1, 2]])
    return sh.tetrahedralize(diagonal, resolution=round((size / 12) ** (1 / 3)), padding=0, grading=np.inf)


def box_grid(size: int):
    """About so many nodes in the same box."""
    import signedheat as sh

    n = round(size ** (1 / 3))
    return sh.Grid((-1.6, -1.6, -1.6), 3.2 / (n - 1), (n, n, n))


VOLUMES = {"sphere in tets": lattice, "sphere in a grid": box_grid}


def measured_volume(program: str, make, size: int) -> dict:
    """Distance to the unit sphere; "peer" is the plain field, "ours" the sharpened one where it can be."""
    import trimesh

    import signedheat as sh

    ball = trimesh.creation.icosphere(subdivisions=5)
    ball = sh.TriangleMesh(ball.vertices, ball.faces)

    def run(domain):
        field = sh.SignedHeatSolver(domain).distance(ball)
        return field if program == "peer" else sh.sharpen(field)

    run(make(8000))
    run(make(60000))  # beyond factorisation
    domain = make(size)
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    values = run(domain).values.ravel()
    seconds, known = time.process_time() - begin, ~np.isnan(values)
    places = domain.points.reshape(-1, 3) if isinstance(domain, sh.Grid) else domain.vertices
    return {
        "vertices": domain.n_tets if isinstance(domain, sh.TetMesh) else int(known.sum()),
        "seconds": seconds,
        "megabytes": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
        "error": cases.error(values[known], np.linalg.norm(places, axis=1)[known] - 1),
    }


def measured(program: str, kind: str, name: str, size: int) -> dict:
    """One measurement, in this process."""
    if kind == "volumes":
        return measured_volume(program, VOLUMES[name], size)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if kind == "voxels":
        n = round(np.sqrt(size / 5.0))
        volume, spacing, first = cases.ball(n)
        import signedheat as sh

        def run():
            surface = sh.DigitalSurface(volume, spacing, first, radius=None if program == "ours" else 0.0)
            unit = surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True)
            exact = np.arcsin(np.clip(unit @ TILT, -1, 1)) - np.arcsin(HEIGHT)
            source = surface.level_set(exact)
            begin = time.process_time()
            return sh.SignedHeatSolver(surface, 1.0).distance(source).values, exact, begin
    else:
        vertices, about, ring, exact = (POLYGONS if kind == "polygons" else CLOUDS)[name](size)
        closed = kind == "points" or "sphere" in name

        def run():
            begin = time.process_time()
            if program == "ours":
                import signedheat as sh

                domain = sh.PolygonMesh(vertices, about) if kind == "polygons" else sh.PointCloud(vertices, about)
                solver = sh.SignedHeatSolver(domain, 1.0)
                return solver.distance(domain.path(ring, closed=closed)).values, exact, begin
            import potpourri3d

            nodes = [int(i) for i in ring] + [int(ring[0])] * closed
            if kind == "polygons":
                phi = potpourri3d.PolygonMeshHeatSolver(vertices, about).compute_signed_distance([nodes])
            else:
                phi = potpourri3d.PointCloudHeatSolver(vertices).compute_signed_distance([nodes], about)
            phi = np.asarray(phi)
            return (phi if (phi * exact).sum() > 0 else -phi), exact, begin

    if program == "ours" or kind == "voxels":
        warm(kind)
    phi, exact, begin = run()
    seconds = time.process_time() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "vertices": len(phi),
        "seconds": seconds,
        "megabytes": (peak - before) / 1024,
        "error": cases.error(phi, exact),
    }


def warm(kind: str) -> None:
    """Load every kernel, on something small."""
    import signedheat as sh

    if kind == "polygons":
        domain = sh.PolygonMesh(*cases.globe(6))
    elif kind == "points":
        domain = sh.PointCloud(cases.sphere_points(200))
    else:
        domain = sh.DigitalSurface(*cases.ball(6))
    positions = domain.points if kind == "points" else domain.vertices
    sh.SignedHeatSolver(domain).distance(domain.level_set(positions[:, 2], 0.1))


def in_process_of_its_own(*arguments: str) -> dict:
    """The same measurement in a fresh interpreter."""
    output = subprocess.run(
        [sys.executable, __file__, "--one", *arguments], capture_output=True, text=True, check=False
    )
    if output.returncode:
        raise SystemExit(output.stderr)
    return json.loads(output.stdout.splitlines()[-1])


def main() -> None:
    """Print one line per case, with ratios (below 1: ours is better)."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = ["polygons", "points", "voxels", "volumes"]
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"some of {', '.join(kinds)}; by default all")
    parser.add_argument(
        "--repeats", type=int, default=3, help="runs of ours and the peer's in turn; the fastest counts"
    )
    parser.add_argument("--sizes", type=int, nargs="+", default=[4000, 16000, 64000])
    parser.add_argument("--volumes", type=int, nargs="+", default=[70000, 260000], help="tets, or nodes")
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        program, kind, name, size = arguments.one
        print(json.dumps(measured(program, kind, name, int(size))))
        return
    if unknown := set(arguments.kinds) - set(kinds):
        parser.error(f"{', '.join(sorted(unknown))}: none of {', '.join(kinds)}")
    print(f"{'case':33}{'unknowns':>8} | {'ours s':>7}{'MB':>7}{'ε':>9} | {'peer s':>7}{'MB':>7}{'ε':>9} | ratios s, ε")
    table = [("polygons", n) for n in POLYGONS] + [("points", n) for n in CLOUDS] + [("voxels", "ball (raw as peer)")]
    table += [("volumes", name) for name in VOLUMES]
    for kind, name in table:
        if arguments.kinds and kind not in arguments.kinds:
            continue
        previous = None
        for size in arguments.volumes if kind == "volumes" else arguments.sizes:
            rounds = [
                [in_process_of_its_own(program, kind, name, str(size)) for program in ("ours", "peer")]
                for _ in range(arguments.repeats)
            ]
            ours, peer = (min(runs, key=lambda run: run["seconds"]) for runs in zip(*rounds, strict=True))
            columns = [f"{r['seconds']:7.2f}{r['megabytes']:7.0f}{r['error']:9.1e}" for r in (ours, peer)]
            ratio = f"{ours['seconds'] / peer['seconds']:.2f}, {ours['error'] / max(peer['error'], 1e-15):.3f}"
            if previous is not None:
                steps = [np.log(ours[key] / previous[key]) for key in ("seconds", "vertices")]
                ratio += f", growth {steps[0] / steps[1]:.2f}"
            slowest = [max(run["seconds"] for run in runs) for runs in zip(*rounds, strict=True)]
            over = [f"{100 * (s / r['seconds'] - 1):.0f}" for s, r in zip(slowest, (ours, peer), strict=True)]
            ratio += f"; slowest +{over[0]}, +{over[1]} %"
            previous = ours
            print(f"{kind + ': ' + name:33}{ours['vertices']:8} | {columns[0]} | {columns[1]} | {ratio}", flush=True)


if __name__ == "__main__":
    main()
