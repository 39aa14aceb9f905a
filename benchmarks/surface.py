"""Distance on triangle meshes beside potpourri3d, and beside nothing but the two sparse solves it cannot do without.

    python benchmarks/surface.py [--levels 5 6 7 8] [--peer-up-to 7]
    python benchmarks/surface.py --triangles
    python benchmarks/surface.py --errors --levels 4 5 6 7

Each program runs in a process of its own, one after the other, on the same mesh and curves: a bumpy sphere and level
sets that cross its faces, nothing imposed but where said. Seconds of all threads or, with --wall, on the clock; memory
in megabytes above what imports and input take. "ours" is the scheme of the peer, one diffusion time; "default" is
`SignedHeatSolver(mesh)`, which extrapolates in it.

With --triangles instead: what refining meshes of large angles and needles gains and costs (`auto_refinement.py`).
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import auto_refinement
import numpy as np

BATCH = 64
TOGETHER = 16  # columns that the bare solver takes at once


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=int, nargs="+", default=[5, 6, 7], help="subdivisions of an icosahedron")
    parser.add_argument("--peer-up-to", type=int, default=7)
    parser.add_argument("--repeats", type=int, default=3, help="rounds of all programs in turn; the best times count")
    parser.add_argument("--wall", action="store_true", help="seconds on the clock instead of those of all threads")
    parser.add_argument("--triangles", action="store_true", help="what refining bad triangles gains and costs instead")
    parser.add_argument("--errors", action="store_true", help="seconds beside errors on unit spheres instead")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.triangles:
        auto_refinement.tables()
        return
    if arguments.errors:
        errors(arguments.levels)
        return
    if arguments.worker:
        program, file = arguments.worker
        clock = Clock(time.perf_counter if arguments.wall else time.process_time)
        print(json.dumps({"ours": ours, "default": default, "peer": peer, "bare": bare}[program](np.load(file), clock)))
        return
    columns = ["first", "next", "next zero set", "batched", "batched zero", "memory"]
    print(f"{'vertices':>9} {'':>10}" + "".join(f"{c:>15}" for c in columns))
    with tempfile.TemporaryDirectory() as folder:
        for level in arguments.levels:
            file = Path(folder) / f"{level}.npz"
            n = write_input(file, level)
            run("ours", file, arguments.wall)  # compiles and warms the file cache
            programs = ("bare", "ours", "default") + (("peer",) if level <= arguments.peer_up_to else ())
            rounds = [{p: run(p, file, arguments.wall) for p in programs} for _ in range(arguments.repeats)]
            results = {p: {c: min(r[p][c] for r in rounds) for c in rounds[0][p]} for p in programs}
            for program, row in results.items():
                print(f"{n:>9} {program:>10}" + "".join(f"{row.get(c, np.nan):>15.3f}" for c in columns), flush=True)
            pairs = [(other, mine) for mine in ("ours", "default") for other in ("bare", "peer") if other in results]
            for other, mine in pairs:
                ratios = [results[other].get(c, np.nan) / results[mine][c] for c in columns]
                print(f"{'':>9} {other + '/' + mine:>12}" + "".join(f"{r:>15.2f}" for r in ratios), flush=True)
            if "peer" in results:
                fields = [np.load(f"{file}.{p}.npy") for p in ("ours", "peer")]
                print(
                    f"{'':>9} largest difference / range: {np.abs(fields[0] - fields[1]).max() / np.ptp(fields[1]):.1e}"
                )


def run(program: str, file: Path, wall: bool) -> dict[str, float]:
    """One worker's figures."""
    command = [sys.executable, __file__, "--worker", program, str(file), *(["--wall"] if wall else [])]
    out = subprocess.run(command, capture_output=True, text=True, check=False)
    if out.returncode:
        raise SystemExit(f"{program} failed on {file.name}:\n{out.stderr}")
    row = json.loads(out.stdout.splitlines()[-1])
    if row.get("phi"):
        np.save(f"{file}.{program}.npy", np.array(row.pop("phi")))
    return row


def write_input(file: Path, level: int) -> int:
    """The mesh, and curves as (edge, t) nodes."""
    import trimesh

    import signedheat as sh

    ball = trimesh.creation.icosphere(level)
    x, y, _ = ball.vertices.T
    points = ball.vertices * (1 + 0.2 * np.sin(5 * x) * np.cos(4 * y))[:, None]
    mesh = sh.TriangleMesh(points, ball.faces)
    arrays = {}
    for k, height in enumerate(np.linspace(0.3, -0.3, BATCH + 2)):
        curve = max(mesh.level_set(points @ [0.1, 0.2, 1.0], height), key=lambda c: c.n_points)
        arrays[f"faces{k}"], arrays[f"barycentric{k}"] = curve.faces, curve.barycentric
        arrays[f"edge{k}"], arrays[f"t{k}"] = on_edges(mesh, curve)
    np.savez(file, vertices=points, faces=np.asarray(ball.faces), **arrays)
    return len(points)


def on_edges(mesh, curve) -> tuple[np.ndarray, np.ndarray]:
    """The edges that a level set crosses, and where on them, as potpourri3d takes them."""
    corner = (curve.barycentric.argmin(axis=1) + 1) % 3
    edge = mesh.edges.face_edges[curve.faces, corner]
    tail_first = mesh.edges.vertices[edge, 0] == mesh.faces[curve.faces, corner]
    return edge, curve.barycentric[np.arange(len(edge)), np.where(tail_first, (corner + 1) % 3, corner)]


def errors(levels: list[int]) -> None:
    """Seconds beside errors: a circle on unit spheres, nothing imposed, each up to its best constant."""
    import potpourri3d as pp3d
    import trimesh

    import signedheat as sh

    def timed(distance) -> tuple[float, np.ndarray]:
        begin = time.process_time()
        values = np.asarray(distance())
        return time.process_time() - begin, values

    for level in levels:
        ball = trimesh.creation.icosphere(level)
        mesh, heights = sh.TriangleMesh(ball.vertices, ball.faces), ball.vertices @ (np.array([1, 2, 10]) / 105**0.5)
        curve = max(mesh.level_set(heights, 0.2), key=lambda c: c.n_points)
        nodes = [(int(e), [float(t)]) for e, t in zip(*on_edges(mesh, curve), strict=True)]
        exact = np.arcsin(heights.clip(-1, 1)) - np.arcsin(0.2)
        ours = sh.SignedHeatSolver(mesh)
        theirs = pp3d.MeshSignedHeatSolver(ball.vertices, ball.faces)
        for name, distance in (
            ("default", lambda ours=ours, curve=curve: ours.distance(curve, sh.constraints.Free()).values),
            ("peer", lambda p=theirs, n=nodes: p.compute_distance([[*n, n[0]]], level_set_constraint="None")),
        ):
            first, values = timed(distance)
            values = values * np.sign(values @ exact)
            away = values - exact - np.median(values - exact)
            seconds = min(timed(distance)[0] for _ in range(5))
            error = 100 * np.sqrt((away**2).mean()) / np.ptp(exact)
            print(f"{len(exact):>9} {name:>10} first {first:7.3f}  next {seconds:7.3f}  ε {error:.4f} %", flush=True)


def default(data, clock) -> dict[str, object]:
    return ours(data, clock, None)


def ours(data, clock, diffusion=1.0) -> dict[str, object]:
    import signedheat as sh

    curves = [sh.Curve(data[f"faces{k}"], data[f"barycentric{k}"], closed=True) for k in range(BATCH + 2)]
    vertices, faces = data["vertices"], data["faces"]
    small = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    for constraint in (sh.constraints.Free(), sh.constraints.ZeroSet()):  # load compiled kernels and libraries
        sh.SignedHeatSolver(small).distance(sh.Curve([0, 0], [[0.5, 0.5, 0], [0, 0.5, 0.5]]), constraint)
    before, _ = memory(), clock.lap()
    solver = sh.SignedHeatSolver(sh.TriangleMesh(vertices, faces), diffusion)
    phi = solver.distance(curves[0], sh.constraints.Free()).values
    row = {"first": clock.lap(), "phi": phi.tolist()}
    solver.distance(curves[1], sh.constraints.Free())
    row["next"] = clock.lap()
    row["memory"] = peak() - before
    clock.lap()
    solver.distance(curves[1])
    row["next zero set"] = clock.lap()
    solver.distance_many(curves[2:], sh.constraints.Free())
    row["batched"] = clock.lap() / BATCH
    solver.distance_many(curves[2 : 2 + TOGETHER])
    row["batched zero"] = clock.lap() / TOGETHER
    return row


def peer(data, clock) -> dict[str, object]:
    import potpourri3d as pp3d

    curves = []
    for k in range(BATCH + 2):
        nodes = [(int(e), [float(t)]) for e, t in zip(data[f"edge{k}"], data[f"t{k}"], strict=True)]
        curves.append([*nodes, nodes[0]])
    vertices, faces = data["vertices"], data["faces"]
    before, _ = memory(), clock.lap()
    solver = pp3d.MeshSignedHeatSolver(vertices, faces)
    phi = np.asarray(solver.compute_distance([curves[0]], level_set_constraint="None"))
    row = {"first": clock.lap(), "phi": phi.tolist()}
    solver.compute_distance([curves[1]], level_set_constraint="None")
    row["next"] = clock.lap()
    row["memory"] = peak() - before
    clock.lap()
    solver.compute_distance([curves[1]], level_set_constraint="ZeroSet")
    row["next zero set"] = row["batched zero"] = clock.lap()
    for curve in curves[2:6]:
        solver.compute_distance([curve], level_set_constraint="None")
    row["batched"] = clock.lap() / 4  # it has no batches: one after the other
    return row


def bare(data, clock) -> dict[str, object]:
    """Order, factorise and solve M + tL and C, assembled beforehand, as the solver library does it by itself."""
    import signedheat as sh
    from signedheat.linear import factorize
    from signedheat.surfaces.vector_heat import vector_heat_matrix

    surface = sh.SignedHeatSolver(sh.TriangleMesh(data["vertices"], data["faces"])).discretization
    heat, stiffness = vector_heat_matrix(surface.triangles, surface.spacing**2), surface.stiffness.copy()
    stiffness.data[0] *= 2
    ones = [np.ones(heat.shape[0], dtype=complex), np.ones(stiffness.shape[0])]
    before, _ = memory(), clock.lap()
    factors = [factorize(heat), factorize(stiffness)]
    for factor, rhs in zip(factors, ones, strict=True):
        factor.solve(rhs)
    row = {"first": clock.lap()}
    for factor, rhs in zip(factors, ones, strict=True):
        factor.solve(rhs)
    row["next"] = clock.lap()
    row["memory"] = peak() - before
    clock.lap()
    for _ in range(BATCH // TOGETHER):
        for factor, rhs in zip(factors, ones, strict=True):
            factor.solve(np.repeat(rhs[:, None], TOGETHER, axis=1))
    row["batched"] = clock.lap() / BATCH
    return row


def memory() -> float:
    """Megabytes in use; from here on, `peak` counts anew (on Linux; elsewhere it goes on from the highest so far)."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return peak()
    return status("VmRSS")


def peak() -> float:
    """Most megabytes in use since `memory`."""
    return (
        status("VmHWM")
        if Path("/proc/self/status").exists()
        else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    )


def status(name: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(name))


class Clock:
    """Seconds since the last lap."""

    def __init__(self, now) -> None:
        self.now, self.begin = now, now()

    def lap(self) -> float:
        begin, self.begin = self.begin, self.now()
        return self.begin - begin


if __name__ == "__main__":
    main()
