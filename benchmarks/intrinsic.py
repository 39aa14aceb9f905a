"""Intrinsic triangulations: time and size, angles before and after, and distance on awful triangulations.

``python benchmarks/intrinsic.py``
"""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import Delaunay

import signedheat as sh
from signedheat.samples import sphere


def timed(action):
    begin = time.perf_counter()
    result = action()
    return result, time.perf_counter() - begin


def growth() -> None:
    print(f"{'faces':>9} {'flips':>9} {'seconds':>8} {'refined':>9} {'seconds':>8} {'smallest angle':>22}")
    for level in (4, 6, 7, 8):
        ball = sphere(level)
        mesh = sh.TriangleMesh(ball.vertices * [4, 1, 1], ball.faces)
        _ = mesh.edge_lengths
        flipped, one = timed(lambda mesh=mesh: sh.intrinsic_delaunay(mesh))
        refined, two = timed(lambda mesh=mesh: sh.intrinsic_delaunay(mesh, refine=True))
        angles = [np.degrees(t.corner_angles.min()) for t in (flipped, refined)]
        angles.insert(0, np.degrees(np.arctan2(1, refined.base.corner_cotangents).min()))
        print(
            f"{mesh.n_faces:9d} {len(flipped.history.steps):9d} {one:8.2f} {refined.n_faces:9d} {two:8.2f} "
            + " → ".join(f"{a:5.2f}°" for a in angles)
        )


def grid(n: int, width: float) -> tuple[np.ndarray, np.ndarray]:
    """[0, width] × [−1, 1] in right triangles."""
    m = max(round(n * width / 2), 3)
    x, y = np.meshgrid(np.linspace(0, width, m + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    ids = np.arange((m + 1) * (n + 1)).reshape(m + 1, n + 1)
    a, b, c, d = (ids[:-1, :-1].ravel(), ids[1:, :-1].ravel(), ids[1:, 1:].ravel(), ids[:-1, 1:].ravel())
    return np.column_stack([x.ravel(), y.ravel()]), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def sheared(points: np.ndarray, stretch: float) -> np.ndarray:
    """Faces as if everything were `stretch` times as wide."""
    rng = np.random.default_rng(0)
    faces = Delaunay(points * [stretch, 1] + rng.uniform(-1e-9, 1e-9, points.shape)).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[double < 0] = faces[double < 0][:, ::-1]
    return faces[np.abs(double) > 1e-9]


def with_vertices(vertices: np.ndarray, faces: np.ndarray, weights: list[float]) -> sh.TriangleMesh:
    """Every face gets a vertex inside."""
    new = len(vertices) + np.arange(len(faces))
    a, b, c = faces.T
    cut = np.concatenate([np.stack(corners, axis=1) for corners in ((a, b, new), (b, c, new), (c, a, new))])
    return sh.TriangleMesh(np.concatenate([vertices, np.einsum("k,mkd->md", weights, vertices[faces])]), cut)


def scattered(points: np.ndarray, size: float) -> np.ndarray:
    """Inner points moved about, for shears to have something to work with."""
    inside = (points > points.min(axis=0) + 1e-9).all(axis=1) & (points < points.max(axis=0) - 1e-9).all(axis=1)
    return points + inside[:, None] * np.random.default_rng(1).uniform(-0.4, 0.4, points.shape) * size


def cases(n: int):
    """Name, vertices and faces of a sound surface, faces of a sheared one, source, exact distance."""
    angle = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)

    points, faces = grid(n, 2.0)
    points = scattered(points, 2 / n) - [1, 0]
    flat = np.column_stack([points, 0 * points[:, 0]])
    yield "square", flat, faces, sheared(points, 30), 0.55 * circle, lambda v: 0.55 - np.linalg.norm(v[:, :2], axis=1)

    m = round(n * np.pi)
    points, faces = grid(n, 2 * np.pi)
    points = scattered(points, 2 / n)
    points[:, 0] = np.round(points[:, 0] * m / (2 * np.pi)) * (2 * np.pi / m)  # on the edges of a prism
    prism = np.column_stack([np.cos(points[:, 0]), np.sin(points[:, 0]), points[:, 1]])
    prism = prism[: -n - 1]
    higher = np.add(circle, [0, 0, 0.1])
    yield "cylinder", prism, faces % len(prism), None, higher, lambda v: v[:, 2] - 0.1

    ball = sphere(4 if n > 30 else 3)
    height = 0.3
    ring = np.sqrt(1 - height**2) * circle + [0, 0, height]
    yield (
        "sphere",
        ball.vertices,
        ball.faces,
        None,
        ring,
        lambda v: np.arccos(height) - np.arccos(np.clip(v[:, 2], -1, 1)),
    )


def accuracy(n: int) -> None:
    head = f"{'surface':9} {'triangles':9} {'faces':>7} {'as it is':>9} {'flips':>9} {'refined':>9}"
    print(f"\n{head}   {'seconds':>16}   below 20°, above 130°")
    for name, vertices, faces, shear, source, exact in cases(n):
        meshes = {
            "sound": sh.TriangleMesh(vertices, faces),
            "needles": with_vertices(vertices, faces, [1 - 2e-6, 1e-6, 1e-6]),
            "caps": with_vertices(vertices, faces, [0.5 - 5e-7, 0.5 - 5e-7, 1e-6]),
        }
        if shear is not None:
            meshes["sheared"] = sh.TriangleMesh(vertices, shear)
        for kind, mesh in meshes.items():
            print(f"{name:9} {kind:9} {mesh.n_faces:7d} {compare(mesh, source, exact(vertices))}", flush=True)


def compare(mesh: sh.TriangleMesh, source: np.ndarray, exact: np.ndarray) -> str:
    """ε over the vertices of the sound mesh and seconds, as it is and on intrinsic triangulations; parts of angles."""
    curve = mesh.polyline(source, closed=True)
    flipped = sh.intrinsic_delaunay(mesh, keep=curve)
    refined, making = timed(lambda: sh.intrinsic_delaunay(mesh, keep=curve, refine=True))
    errors, seconds = [], []
    for domain in (mesh, flipped, refined):
        phi, taken = timed(lambda domain=domain: sh.SignedHeatSolver(domain).distance(curve))
        errors.append(f"{np.sqrt(np.mean((phi.values[: len(exact)] - exact) ** 2)) / np.ptp(exact):9.5f}")
        seconds.append(taken)
    before, after = np.degrees(np.arctan2(1, refined.base.corner_cotangents)), np.degrees(refined.corner_angles)
    small = f"{np.mean(before < 20):.0%} → {np.mean(after < 20):.1%}"
    large = f"{np.mean(before > 130):.0%} → {np.mean(after > 130):.1%}"
    return f"{' '.join(errors)}   {seconds[0]:4.2f}, {making:4.2f} + {seconds[2]:4.2f}   {small}, {large}"


if __name__ == "__main__":
    growth()
    accuracy(24)
    accuracy(48)
