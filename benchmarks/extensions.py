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
from scipy.spatial import Delaunay

import signedheat as sh
from signedheat.diagnostics import Jumps, SlopeErrors
from signedheat.samples import sphere, torus


def timed(action: Callable[[], Any], repeats: int = 1) -> tuple[Any, float]:
    """Result, and the least of the seconds that it took."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        result = action()
        best = min(best, time.perf_counter() - begin)
    return result, best


def moebius(n: int) -> tuple[sh.TriangleMesh, sh.Curve]:
    """A strip with half a twist, n around and n / 8 across, and the curve along its core, which has no two sides."""
    m = 2 * (n // 16)
    u, v = np.meshgrid(np.arange(n), np.arange(m + 1), indexing="ij")
    angle, across = 2 * np.pi * u / n, 0.4 * (2 * v / m - 1)
    ring = 1 + across * np.cos(angle / 2)
    points = np.stack([ring * np.cos(angle), ring * np.sin(angle), across * np.sin(angle / 2)], axis=-1)
    ids = np.arange(n * (m + 1)).reshape(n, m + 1)
    following = np.vstack([ids[1:], ids[:1, ::-1]])
    a, b, c, d = ids[:, :-1], following[:, :-1], following[:, 1:], ids[:, 1:]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    mesh = sh.TriangleMesh(points.reshape(-1, 3), faces)
    return mesh, mesh.path(ids[:, m // 2], closed=True)


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
        cases = {
            "round the tube": (ring, ring.path(np.arange(m), closed=True)),
            "round the hole": (ring, ring.path(np.arange(n) * m + m // 4, closed=True)),
            "open arc on sphere": (ball, ball.polyline(arc)),
            "Möbius core": moebius(int(np.sqrt(8 / 2 * ring.n_faces))),
        }
        for name, (mesh, curve) in cases.items():
            phi, seconds = timed(lambda mesh=mesh, curve=curve: sh.piecewise_distance(mesh, curve))
            jumps = phi.diagnostics.note(Jumps)
            print(f"{name:18} {mesh.n_faces:8d} {seconds:8.2f} {jumps.rounds:7d} {jumps.gap:8.2%}", flush=True)


def disk(n: int, stretch: float = 1.0, jitter: float = 0.0) -> sh.TriangleMesh:
    """The unit disk in 2n triangles: Delaunay after a stretch, hence obtuse where it is not 1."""
    i = np.arange(n) + 0.5
    radius, angle = np.sqrt(i / n), np.pi * (1 + 5**0.5) * i
    inner = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)[radius < 1 - 1 / np.sqrt(n)]
    inner += np.random.default_rng(n).uniform(-jitter, jitter, inner.shape) / np.sqrt(n)
    rim = np.linspace(0, 2 * np.pi, int(2 * np.sqrt(np.pi * n)), endpoint=False)
    points = np.concatenate([inner, np.stack([np.cos(rim), np.sin(rim)], axis=1)])
    faces = Delaunay(points * [stretch, 1.0]).simplices
    return sh.TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces)


def anisotropic(n: int, ratio: float) -> sh.TriangleMesh:
    """The square around the unit disk, with vertices `ratio` times as dense along y as along x."""
    along_x, along_y = (int(np.sqrt(n * r)) for r in (1 / ratio, ratio))
    x, y = np.meshgrid(np.linspace(-1, 1, along_x + 1), np.linspace(-1, 1, along_y + 1), indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    a = (np.arange(along_x)[:, None] * (along_y + 1) + np.arange(along_y)).ravel()
    b = a + along_y + 1
    return sh.TriangleMesh(points, np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)]))


def incident_faces(waves: float, n: int = 1500) -> np.ndarray:
    """Corners of a five-pointed wave around a circle."""
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return 0.5 * (1 + waves * np.cos(5 * t))[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)


def polygon_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Exact, positive inside."""
    from matplotlib.path import Path as Outline

    distance = np.full(len(points), np.inf)
    for a, side in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True):
        along = np.clip((points - a) @ side / (side @ side), 0, 1)
        distance = np.minimum(distance, np.hypot(*(points - a - along[:, None] * side).T))
    return np.where(Outline(corners).contains_points(points), distance, -distance)


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
    convex, slow = timed(lambda: sh.sharpen(plain, method=sh.Convex()))
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
                compare(curve, disk(n), incident_faces(waves), diffusion)


def awkward() -> None:
    """Triangles that one would rather not have."""
    heading()
    meshes = {
        "jittered": lambda n: disk(n, jitter=0.35),
        "obtuse 4:1": lambda n: disk(n, stretch=4.0),
        "obtuse 10:1": lambda n: disk(n, stretch=10.0),
        "anisotropic 5:1": lambda n: anisotropic(n, 5.0),
        "anisotropic 30:1": lambda n: anisotropic(n, 30.0),
    }
    for name, make in meshes.items():
        for curve, waves in (("star", 0.3), ("circle", 0.0)):
            for diffusion in (1, 100):
                compare(
                    f"{name[:-2] if ':' in name else name} {curve}"[:18], make(5000), incident_faces(waves), diffusion
                )


def in_tets() -> None:
    """A sphere in a box, and a wall in an L of jittered tets, round whose corner distance runs."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from shapes.tet_cases import boxes, lattice, rectangle
    from shapes.tet_cases import sphere as ball

    print("\nε as above; slope: root mean square of |∇φ| − 1; seconds")
    print(f"{'':12} {'tets':>8} {'t/h²':>4} | {'heat':>29} | {'+ geodesic':>29} | {'+ convex':>29}")

    def line(name: str, mesh: sh.TetMesh, shape: sh.TriangleMesh, exact: np.ndarray, diffusion: float) -> None:
        used = np.unique(mesh.tets)
        plain, seconds = timed(lambda: sh.SignedHeatSolver(mesh, diffusion).distance(shape))
        texts = []
        for method in (sh.Geodesic(), sh.Convex()):
            phi, spent = timed(lambda method=method: sh.sharpen(plain, method=method))
            slopes = phi.diagnostics.note(SlopeErrors)
            texts.append(f"{off(phi.values[used], exact[used])} {slopes.slope_error_after:6.4f} {spent:6.2f}s")
        before = f"{off(plain.values[used], exact[used])} {slopes.slope_error_before:6.4f} {seconds:6.2f}s"
        print(f"{name:12} {mesh.n_tets:8d} {diffusion:4g} | {' | '.join([before, *texts])}", flush=True)

    round_shape = ball(5)
    corners = round_shape.vertices[round_shape.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    round_shape = sh.TriangleMesh(round_shape.vertices * (4 / 3 * np.pi / volume) ** (1 / 3), round_shape.faces)
    for n in (9, 16, 28):
        for diffusion in (1, 4):
            mesh = lattice(n)
            line("sphere", mesh, round_shape, np.linalg.norm(mesh.vertices, axis=1) - 1, diffusion)
    for n in (6, 12, 24):
        mesh = boxes((2 * n, 2 * n, n // 2), 1 / n, keep=lambda c: ~((c[:, 0] > 1) & (c[:, 1] > 1)), jitter=0.1)
        x, y, _ = mesh.vertices.T
        wall = rectangle([1.55, -0.5, -0.5], [0, 3, 0], [0, 0, 3])
        exact = np.where((x <= 1) & (y > 1), -(0.55 + np.hypot(x - 1, y - 1)), x - 1.55)
        line("L", mesh, wall, exact * np.sign(wall.face_area_vectors[0, 0]), 1)


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
