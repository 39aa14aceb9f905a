"""Curves that bound nothing: lines and forks of the cut, its length, error of slopes, objective and time.

Two rows a shape: Eq. 16 in the triangles of the mesh, and the default, which is continuous off the cut and refines bad
triangles intrinsically. Run with ``python -m benchmarks.cuts``.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np

import signedheat as sh
from benchmarks.reproduction.shapes import organic, subdivided
from shapes.triangulated import angles, cylinder, grid, klein_bottle, moebius
from signedheat.diagnostics import Jumps
from signedheat.samples import sphere, torus

Case = tuple[sh.TriangleMesh, list[sh.Curve]]


def sheared_torus() -> sh.TriangleMesh:
    """Triangles with large angles."""
    u, v = np.meshgrid(angles(96), angles(32), indexing="ij")
    u = u + 0.25 * np.sin(v + 0.5)
    ring = 1 + 0.4 * np.cos(v)
    return grid(np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=-1), around=1, across=True)


def bumpy_sphere(seed: int, level: int = 5) -> sh.TriangleMesh:
    rng = np.random.default_rng(seed)
    ball = sphere(level)
    points = ball.vertices + rng.normal(scale=0.05 / 2**level, size=ball.vertices.shape)
    waves = np.cos(points @ rng.normal(scale=2.0, size=(3, 5)) + rng.uniform(0, 6, 5)).sum(axis=1)
    return sh.TriangleMesh(points * (1 + 0.08 * waves[:, None]), ball.faces)


def section(mesh: sh.TriangleMesh, normal: list[float], offset: float = 0.0) -> sh.Curve:
    return max(mesh.level_set(mesh.vertices @ normal, offset), key=lambda curve: curve.n_points)


def part(curve: sh.Curve, start: float, end: float) -> sh.Curve:
    kept = slice(int(start * curve.n_points), int(end * curve.n_points))
    return sh.Curve(curve.faces[kept], curve.barycentric[kept])


def halves(mesh: sh.TriangleMesh) -> Case:
    whole = section(mesh, [0.3, 0.2, 1.0])
    return mesh, [part(whole, 0, 0.5), part(whole, 0.5, 1).reversed()]


def cases() -> Iterator[tuple[str, Callable[[], Case]]]:
    yield "torus, loop", lambda: ((m := torus(n_around=96, n_across=40)), [m.path(np.arange(40), closed=True)])
    yield "torus in thin triangles, loop", lambda: ((m := sheared_torus()), [section(m, [1, 0, 0.1], 0.1)])
    yield "organic torus, loop", lambda: ((m := subdivided(organic(3, 300, 1), 2)), [section(m, [1, 0.2, 0.1])])
    yield "organic torus, coarse, loop", lambda: ((m := organic(5, 600, 1)), [section(m, [0.3, 1, 0.1])])
    yield (
        "organic torus, arc",
        lambda: (
            (m := subdivided(organic(7, 300, 1), 2)),
            [part(section(m, [0.2, 0.1, 1]), 0, 0.4)],
        ),
    )
    yield "bumpy sphere, halves", lambda: halves(bumpy_sphere(1))
    yield "bumpy sphere, arc", lambda: ((m := bumpy_sphere(2)), [part(section(m, [0.3, 0.2, 1.0]), 0, 0.4)])
    yield "decimated sphere, halves", lambda: halves(subdivided(organic(2, 300), 1))
    yield "Klein bottle, loop", lambda: ((m := klein_bottle(96, 48)), [m.path(np.arange(48) + 480, closed=True)])
    yield "Klein bottle, path", lambda: ((m := klein_bottle(96, 48)), [m.path(np.arange(60) * 48 + 12)])
    yield "Moebius strip, core", lambda: ((m := moebius(120, 12)), [m.path(np.arange(120) * 13 + 6, closed=True)])
    yield "cylinder, line", lambda: ((m := cylinder(96, 48)), [m.path(np.arange(48))])


def row(mesh: sh.TriangleMesh, curves: list[sh.Curve], **options: object) -> str:
    start = time.process_time()
    phi = sh.piecewise_distance(curves, mesh, **options)
    seconds = time.process_time() - start
    note = phi.diagnostics.note(Jumps)
    ends = Counter(int(end) for line in phi.domain.cuts(phi.values) for end in line.vertices[[0, -1]])
    forks = sum(count > 2 for count in ends.values())
    return (
        f"{phi.domain.triangles.n_faces:6d} | {len(phi.domain.cuts(phi.values))} | {forks} | {note.cut_length:.2f} | "
        f"{note.integration_error:.4f} | {note.objective:.3f} | {seconds:.1f}"
    )


def main() -> None:
    print("| shape and curve | jumps | faces | lines | forks | length | slope error | objective | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, build in cases():
        mesh, curves = build()
        print(f"| {name} | Eq. 16 | {row(mesh, curves, smooth=False, intrinsic=False)} |", flush=True)
        print(f"| | default | {row(mesh, curves)} |", flush=True)


if __name__ == "__main__":
    main()
