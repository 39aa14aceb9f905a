"""Extensions: nonbounding curves (time, distance from the optimum) and sharpening (error, time), side by side.

    python benchmarks/extensions.py [planar] [awkward] [tets] [jumps] [--large]

planar: curves in the plane as in the paper's Fig. 24, against exact distance. awkward: the same on jittered, obtuse and
anisotropic triangles. tets: a sphere in a box, and a wall in an L. jumps: curves that bound nothing; 300 thousand faces
with ``--large``. All of it without a name.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import signedheat as sh
from signedheat.diagnostics import Jumps, SlopeErrors
from signedheat.samples import sphere, torus

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes.tet_cases import ell, lattice, round_ball
from shapes.triangulated import disk, moebius, planks, polygon_distance, star


def timed(action: Callable[[], Any], repeats: int = 1) -> tuple[Any, float]:
    """Result, and the least of the seconds that it took."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        result = action()
        best = min(best, time.perf_counter() - begin)
    return result, best


def jumps(large: bool) -> None:
    """Curves that bound nothing: seconds, and the certified gap to the least objective."""
    print(f"\n{'curve':18} {'faces':>8} {'seconds':>8} {'rounds':>7} {'gap':>8}")
    arc = np.linspace(0, 2, 60)
    arc = np.stack([0.9 * np.cos(arc), 0.9 * np.sin(arc), 0.4 + 0 * arc], axis=1)
    for n, level in ((52, 3), (160, 5), (320, 6), *(((620, 7),) if large else ())):
        m = n * 2 // 5
        ring, ball = torus(n_around=n, n_across=m), sphere(level)
        noise = np.random.default_rng(0).normal(size=ring.vertices.shape)
        ring = sh.TriangleMesh(ring.vertices + 0.1 * ring.edge_lengths.mean() * noise, ring.faces)
        around = int(np.sqrt(8 / 2 * ring.n_faces))
        half = around // 16
        strip = moebius(around, 2 * half, 0.4)
        cases = {
            "round the tube": (ring, ring.path(np.arange(m), closed=True)),
            "round the hole": (ring, ring.path(np.arange(n) * m + m // 4, closed=True)),
            "open arc on sphere": (ball, ball.polyline(arc)),
            "Möbius core": (strip, strip.path(np.arange(around) * (2 * half + 1) + half, closed=True)),
        }
        for name, (mesh, curve) in cases.items():
            phi, seconds = timed(lambda mesh=mesh, curve=curve: sh.piecewise_distance(curve, mesh))
            jumps = phi.diagnostics.note(Jumps)
            print(f"{name:18} {mesh.n_faces:8d} {seconds:8.2f} {jumps.rounds:7d} {jumps.gap:8.2%}", flush=True)


def off(values: np.ndarray, exact: np.ndarray) -> str:
    """Root mean square and largest error, per cent of the range."""
    error = 100 * np.abs(values - exact) / np.ptp(exact)
    return f"{np.sqrt(np.mean(error**2)):6.4f} /{error.max():6.3f}"


def compare(name: str, mesh: sh.TriangleMesh, corners: np.ndarray, diffusion: float) -> None:
    """One line: heat; both ways of sharpening; heat on the intrinsic refinement; seconds of each."""
    exact = polygon_distance(mesh.vertices[:, :2], corners)
    source = mesh.level_set(exact, 0.0)
    plain, seconds = timed(lambda: sh.SignedHeatSolver(mesh, diffusion).distance(source), 3)
    sharp, own = timed(lambda: sh.sharpen(plain), 3)
    convex, slow = timed(lambda: sh.sharpen(plain, method=sh.methods.Convex()))
    fine, refined = timed(lambda: sh.SignedHeatSolver(mesh, diffusion, intrinsic=True).distance(source))
    cells = [(plain, seconds), (sharp, own), (convex, slow), (fine, refined)]
    texts = [f"{off(phi.values, exact)} {spent:5.2f}s" for phi, spent in cells]
    before, after = (np.sqrt(np.mean((phi.values - exact) ** 2)) for phi in (plain, sharp))
    print(
        f"{mesh.n_faces:6d} {name:18} {diffusion:4g} | {' | '.join(texts)} | {(seconds + own) / seconds:5.2f} "
        f"{after / before:6.3f}",
        flush=True,
    )


def heading() -> None:
    print("\nε: root mean square / largest error, per cent of the range; seconds of the step")
    print(
        f"{'faces':>6} {'mesh, curve':18} {'t/h²':>4} | {'heat':>21} | {'+ geodesic':>21} | {'+ convex':>21} | "
        f"{'heat, intrinsic':>21} | time  ε, each (heat + geodesic) / heat"
    )


def planar() -> None:
    """Fig. 24."""
    heading()
    for n in (2500, 5000, 10_000, 20_000):
        for curve, waves in (("star", 0.3), ("circle", 0.0)):
            for diffusion in (1, 100) if n == 20_000 else (1,):
                compare(curve, disk(n), star(waves), diffusion)


def awkward() -> None:
    """Triangles that one would rather not have."""
    heading()
    meshes = {
        "jittered": lambda n: disk(n, jitter=0.35),
        "obtuse 4:1": lambda n: disk(n, stretch=4.0),
        "obtuse 10:1": lambda n: disk(n, stretch=10.0),
        "anisotropic 5:1": lambda n: planks(n, 5.0),
        "anisotropic 30:1": lambda n: planks(n, 30.0),
    }
    for name, make in meshes.items():
        for curve, waves in (("star", 0.3), ("circle", 0.0)):
            for diffusion in (1, 100):
                compare(f"{name[:-2] if ':' in name else name} {curve}"[:18], make(5000), star(waves), diffusion)


def in_tets() -> None:
    """A sphere in a box, and a wall in an L of jittered tets, round whose corner distance runs."""
    print("\nε as above; slope: root mean square of |∇φ| − 1; seconds")
    print(f"{'':12} {'tets':>8} {'t/h²':>4} | {'heat':>29} | {'+ geodesic':>29} | {'+ convex':>29}")

    def line(name: str, mesh: sh.TetMesh, shape: sh.TriangleMesh, exact: np.ndarray, diffusion: float) -> None:
        used = np.unique(mesh.tets)
        plain, seconds = timed(lambda: sh.SignedHeatSolver(mesh, diffusion).distance(shape))
        texts = []
        for method in (sh.methods.Geodesic(), sh.methods.Convex()):
            phi, spent = timed(lambda method=method: sh.sharpen(plain, method=method))
            slopes = phi.diagnostics.note(SlopeErrors)
            texts.append(f"{off(phi.values[used], exact[used])} {slopes.slope_error_after:6.4f} {spent:6.2f}s")
        before = f"{off(plain.values[used], exact[used])} {slopes.slope_error_before:6.4f} {seconds:6.2f}s"
        print(f"{name:12} {mesh.n_tets:8d} {diffusion:4g} | {' | '.join([before, *texts])}", flush=True)

    for n in (9, 16, 28):
        for diffusion in (1, 4):
            mesh = lattice(n)
            line("sphere", mesh, round_ball(5), np.linalg.norm(mesh.vertices, axis=1) - 1, diffusion)
    for n in (6, 12, 24):
        line("L", *ell(n), 1)


def main() -> None:
    """Compile on something small, then measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help="planar, awkward, tets, jumps (all)")
    parser.add_argument("--large", action="store_true", help="jumps on 300 thousand faces too")
    arguments = parser.parse_args()
    parts = {"planar": planar, "awkward": awkward, "tets": in_tets, "jumps": lambda: jumps(arguments.large)}
    unknown = set(arguments.parts) - set(parts)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: none of {', '.join(parts)}")
    small = disk(300)
    field = sh.SignedHeatSolver(small).distance(small.level_set(small.vertices[:, 0], 0.1))
    sh.sharpen(field)
    for name in arguments.parts or parts:
        parts[name]()


if __name__ == "__main__":
    main()
