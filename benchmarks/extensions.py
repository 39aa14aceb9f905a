"""Extensions: nonbounding curves (time, gap to the certified bound) and sharpening (error, time), side by side.

``python benchmarks/extensions.py [--large]``
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.spatial import Delaunay

import signedheat as sh
from signedheat.samples import sphere, torus


def timed(action):
    begin = time.perf_counter()
    result = action()
    return result, time.perf_counter() - begin


def nonbounding(large: bool) -> None:
    print(
        f"{'curve':18} {'faces':>8} {'seconds':>8} {'rounds':>7} {'gap':>8}   {'exact, s':>14} {'fast/exact − 1':>15}"
    )
    arc = np.linspace(0, 2, 60)
    arc = np.stack([0.9 * np.cos(arc), 0.9 * np.sin(arc), 0.4 + 0 * arc], axis=1)
    for n, level in ((32, 3), (100, 5), (200, 6), *(((388, 7),) if large else ())):
        m = n // 2 - n // 10
        ring, ball = torus(n_around=n, n_across=m), sphere(level)
        noise = np.random.default_rng(0).normal(size=ring.vertices.shape)
        ring = sh.TriangleMesh(ring.vertices + 0.1 * ring.edge_lengths.mean() * noise, ring.faces)
        cases = {
            "round the tube": (ring, ring.path(np.arange(m), closed=True)),
            "round the hole": (ring, ring.path(np.arange(n) * m + m // 4, closed=True)),
            "open arc on sphere": (ball, ball.polyline(arc)),
        }
        for name, (mesh, curve) in cases.items():
            phi, seconds = timed(lambda mesh=mesh, curve=curve: sh.piecewise_distance(mesh, curve))
            notes = phi.diagnostics.notes
            line = f"{name:18} {mesh.n_faces:8d} {seconds:8.2f} {notes['rounds']:7d} {notes['gap']:8.2%}"
            if mesh.n_faces < 25_000:
                exact, slow = timed(lambda mesh=mesh, curve=curve: sh.piecewise_distance(mesh, curve, exact=True))
                line += f"   {slow:14.2f} {notes['objective'] / exact.diagnostics.notes['objective'] - 1:15.2%}"
            print(line, flush=True)


def disk(n: int, stretch: float = 1.0) -> sh.TriangleMesh:
    i = np.arange(n) + 0.5
    radius, angle = np.sqrt(i / n), np.pi * (1 + 5**0.5) * i
    inner = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)[radius < 1 - 1 / np.sqrt(n)]
    rim = np.linspace(0, 2 * np.pi, int(2 * np.sqrt(np.pi * n)), endpoint=False)
    points = np.concatenate([inner, np.stack([np.cos(rim), np.sin(rim)], axis=1)])
    return sh.TriangleMesh(np.pad(points, ((0, 0), (0, 1))), Delaunay(points * [stretch, 1.0]).simplices)


def star_distance(points: np.ndarray, waves: float) -> np.ndarray:
    from matplotlib.path import Path

    t = np.linspace(0, 2 * np.pi, 1500, endpoint=False)
    corners = 0.5 * (1 + waves * np.cos(5 * t))[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)
    distance = np.full(len(points), np.inf)
    for a, side in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True):
        along = np.clip((points - a) @ side / (side @ side), 0, 1)
        distance = np.minimum(distance, np.hypot(*(points - a - along[:, None] * side).T))
    return np.where(Path(corners).contains_points(points), distance, -distance)


def sharpening() -> None:
    print("\nerror, per cent of the range: root mean square / largest; seconds of the step")
    print(
        f"{'faces':>6} {'mesh':10} {'curve':6} {'t/h²':>5} | {'heat':>20} | {'geodesic':>20} | {'convex':>20} | ratio"
    )
    for n in (5000, 20000):
        for kind, stretch in (("good", 1.0), ("obtuse 4:1", 4.0)):
            mesh = disk(n, stretch)
            for curve, waves in (("star", 0.3), ("circle", 0.0)):
                exact = star_distance(mesh.vertices[:, :2], waves)
                for diffusion in (1, 100):
                    source = mesh.level_set(exact, 0.0)
                    solve = lambda: sh.SignedHeatSolver(mesh, diffusion).distance(source)  # noqa: B023, E731
                    solve()
                    plain, seconds = timed(solve)
                    sh.sharpen(plain)  # compiled
                    cells = [(plain, seconds)]
                    for method in (sh.Geodesic(), sh.Convex()):
                        cells.append(timed(lambda: sh.sharpen(plain, method=method)))  # noqa: B023
                    texts = []
                    for phi, spent in cells:
                        off = 100 * np.abs(phi.values - exact) / np.ptp(exact)
                        texts.append(f"{np.sqrt(np.mean(off**2)):6.4f}/{off.max():6.3f} {spent:5.2f}s")
                    ratio = (seconds + cells[1][1]) / seconds
                    print(f"{mesh.n_faces:6d} {kind:10} {curve:6} {diffusion:5d} | {' | '.join(texts)} | {ratio:5.2f}")


if __name__ == "__main__":
    sharpening()
    nonbounding("--large" in sys.argv)
