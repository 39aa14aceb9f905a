"""What is inside a broken shape does not depend on who asks: turned, moved, scaled, cut finer, on other grids.

    python benchmarks/stability.py [SHAPE ...] [--seed N]

For each damaged shape: the largest change of the enclosed volume, in per cent of it, and how many of 2,048 places in
the box around it flip, when the shape is turned (five rotations), moved far away, scaled by 10⁻⁴ and 10⁴, its faces put
in another order, its faces cut in four, and its vertices moved by noise of 10⁻¹⁵ of its size; then whether fields in
three rooms at 40 to 128 nodes have at every node the distance that the solid has there. Places nearer to the surface
than a thousandth of the shape do not count. Afterwards a hole that grows, a plate that becomes thin, and a shell.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import signedheat as sh
from signedheat import samples

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes.triangulated import grid

PLACES = 2048
NEAR = 1e-3


def box(
    size: tuple[float, ...], lower: tuple[float, ...], without: tuple[int, ...] = (), cells: int = 6
) -> sh.TriangleMesh:
    """A box of square cells without some of its sides: −x, +x, −y, +y, −z, +z."""
    steps = np.linspace(0, 1, cells + 1)
    sides = []
    for side in range(6):
        if side in without:
            continue
        axis, end = divmod(side, 2)
        u, v = np.meshgrid(steps, steps, indexing="ij")
        places = np.empty((cells + 1, cells + 1, 3))
        places[..., axis] = end
        places[..., (axis + 1) % 3], places[..., (axis + 2) % 3] = u, v
        mesh = grid(np.array(lower) + places * size)
        sides.append(mesh if end else reversed_faces(mesh))
    return samples.union(*sides)


def some(mesh: sh.TriangleMesh, keep: NDArray[np.bool_]) -> sh.TriangleMesh:
    """Some faces of a mesh."""
    return sh.TriangleMesh(mesh.vertices, mesh.faces[keep])


def below(mesh: sh.TriangleMesh, height: float, axis: int = 2) -> sh.TriangleMesh:
    """The faces whose middle is below a plane."""
    return some(mesh, mesh.vertices[mesh.faces].mean(axis=1)[:, axis] < height)


def reversed_faces(mesh: sh.TriangleMesh) -> sh.TriangleMesh:
    """The same, facing the other way."""
    return sh.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def scaled(mesh: sh.TriangleMesh, factor: float) -> sh.TriangleMesh:
    """Around the origin."""
    return sh.TriangleMesh(factor * mesh.vertices, mesh.faces)


def shapes(seed: int) -> Iterator[tuple[str, Callable[[], sh.TriangleMesh]]]:
    """Twenty damaged shapes."""
    ball, tube, duck = samples.sphere(4), samples.torus(n_around=64, n_across=32), samples.duck(40)
    legs = [box((0.2, 0.2, 1), (x, y, -1)) for x in (-0.9, 0.7) for y in (-0.6, 0.4)]
    top = box((2, 1.4, 0.15), (-1, -0.7, 0))
    bracket = [box((2, 1, 0.2), (0, 0, 0), (0, 3)), box((0.2, 1, 1.5), (0, 0, 0.2), (4,))]
    cup = samples.union(below(ball, 0.3), reversed_faces(below(scaled(ball, 0.9), 0.3)))
    yield "ball, 30 % of the faces gone", lambda: samples.without_faces(ball, 0.3, seed)
    yield "ball, five holes", lambda: samples.without_patches(ball, 5, 0.4, seed)
    yield "ball without its top", lambda: below(ball, 0.5)
    yield "half a ball", lambda: below(ball, 0.0)
    yield "a quarter of a ball", lambda: below(below(ball, 0.0), 0.0, 0)
    yield "a third of a torus gone", lambda: below(tube, 0.6, 0)
    yield "torus, holes", lambda: samples.without_patches(tube, 6, 0.3, seed)
    yield "torus, noise and holes", lambda: samples.without_patches(samples.with_noise(tube, 0.01, seed), 4, 0.3, seed)
    yield "box −1", lambda: box((1.6, 1, 1.2), (0, 0, 0), (1,))
    yield "box −2, beside each other", lambda: box((1.6, 1, 1.2), (0, 0, 0), (1, 3))
    yield "box −2, opposite", lambda: box((1.6, 1, 1.2), (0, 0, 0), (0, 1))
    yield "three sides of a box", lambda: box((1.6, 1, 1.2), (0, 0, 0), (1, 3, 5))
    yield "L-bracket without some sides", lambda: samples.union(*bracket)
    yield "cup", lambda: cup
    yield "table without its top face", lambda: samples.union(box((2, 1.4, 0.15), (-1, -0.7, 0), (5,)), *legs)
    yield "table and a sheet", lambda: samples.union(top, *legs, below(box((4, 4, 1e-9), (-2, -2, -1.2)), -1.0))
    yield "duck, holes", lambda: samples.without_patches(duck, 4, 0.25, seed)
    yield (
        "duck, turned and doubled faces",
        lambda: samples.with_flipped_faces(samples.with_duplicate_faces(duck, 0.2, seed), 0.2, seed),
    )
    yield (
        "two balls, holes",
        lambda: samples.union(
            samples.without_patches(ball, 3, 0.35, seed),
            samples.without_patches(samples.sphere(4, 0.8, (1.1, 0, 0)), 3, 0.3, seed + 1),
        ),
    )
    yield (
        "hollow ball, holes",
        lambda: samples.union(
            samples.without_patches(ball, 3, 0.35, seed),
            reversed_faces(samples.without_patches(scaled(ball, 0.5), 3, 0.2, seed + 1)),
        ),
    )


def halved(mesh: sh.TriangleMesh) -> sh.TriangleMesh:
    """Every face cut in four."""
    pairs = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    (a, b, c), (d, e, f) = mesh.faces.T, mesh.n_vertices + number.reshape(-1, 3).T
    faces = np.concatenate([np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    return sh.TriangleMesh(np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)]), faces)


def variants(mesh: sh.TriangleMesh, random: np.random.Generator) -> Iterator[tuple[str, sh.TriangleMesh, Callable]]:
    """The same shape, given in other ways, and how places move with it."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    for turn in Rotation.random(5, random_state=random).as_matrix():
        yield "turned", sh.TriangleMesh(mesh.vertices @ turn.T, mesh.faces), lambda x, turn=turn: x @ turn.T
    for shift in (0.37 * size, 100 * size):
        yield "moved", sh.TriangleMesh(mesh.vertices + shift, mesh.faces), lambda x, shift=shift: x + shift
    for factor in (1e-4, 1e4):
        yield "scaled", scaled(mesh, factor), lambda x, factor=factor: factor * x
    rolled = np.stack(
        [np.roll(face, k) for face, k in zip(mesh.faces, random.integers(3, size=len(mesh.faces)), strict=True)]
    )
    yield "in another order", sh.TriangleMesh(mesh.vertices, random.permutation(rolled)), lambda x: x
    yield "cut finer", halved(mesh), lambda x: x
    noise = 1e-15 * size * random.normal(size=mesh.vertices.shape)
    yield "with noise", sh.TriangleMesh(mesh.vertices + noise, mesh.faces), lambda x: x


def volume(solid: sh.Solid, size: float) -> float:
    """Enclosed by the triangles that are inside on one side, in cubes of the size of the shape."""
    a, b, c = ((solid.triangles - solid.bounds[0]) / size).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    middles, step = solid.triangles.mean(axis=1), 1e-6 * size * normals
    bounds = solid.inside(middles - step) != solid.inside(middles + step)
    return float((a * np.cross(b, c)).sum(axis=1)[bounds].sum() / 6)


def measured(mesh: sh.TriangleMesh, random: np.random.Generator) -> tuple[dict[str, tuple[float, int]], float]:
    """Per kind of variant the change of the volume in per cent and the places that flip; and how fields differ."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    solid = sh.complete(mesh)
    base = volume(solid, size)
    low, high = mesh.bounds
    places = random.uniform(low - 0.2 * size, high + 0.2 * size, (PLACES, 3))
    phi = solid.distance(places)
    places, inside = places[np.abs(phi) > NEAR * size], (phi < 0)[np.abs(phi) > NEAR * size]
    found: dict[str, tuple[float, int]] = {}
    for kind, variant, move in variants(mesh, random):
        other = sh.complete(variant)
        unit = float(np.linalg.norm(move(np.eye(3)[:1]) - move(np.zeros((1, 3)))))
        change = abs(volume(other, size * unit) - base)
        flips = int((other.inside(move(places)) != inside).sum())
        change = 100 * change / max(abs(base), 1e-3)
        before = found.get(kind, (0.0, 0))
        found[kind] = max(change, before[0]), max(flips, before[1])
    apart = 0.0
    for padding, resolution in ((0.1, 40), (0.5, 64), (2.0, 128)):
        field = solid.field(resolution, padding=padding * size)
        nodes = random.integers(0, np.prod(field.domain.shape), 500)
        at = field.domain.points.reshape(-1, 3)[nodes]
        apart = max(apart, float(np.abs(field.values.ravel()[nodes] - solid.distance(at)).max()) / size)
    return found, apart


def series() -> Iterator[tuple[str, list[tuple[float, float]]]]:
    """What grows or thins, and the volume inside over the true one at each step."""
    ball = samples.sphere(4)
    grown = []
    for height in np.linspace(1.01, -0.8, 25):
        solid = sh.complete(below(ball, height))
        grown.append(((1 - height) / 2, volume(solid, 1.0) / (4 * np.pi / 3)))
    yield "ball, share of its height gone", grown
    boxes = []
    for gone in np.linspace(0, 0.9, 10):
        walls = box((1, 1, 1), (0, 0, 0), cells=20)
        middle = walls.vertices[walls.faces].mean(axis=1)
        lost = (middle[:, 2] > 0.999) & (np.abs(middle[:, :2] - 0.5).max(axis=1) < gone / 2)
        boxes.append((gone, volume(sh.complete(some(walls, ~lost)), 1.0)))
    yield "box, width of a hole in its top", boxes
    yield (
        "plate without a side, thickness",
        [(d, volume(sh.complete(box((1, 1, d), (0, 0, 0), (5,))), 1.0) / d) for d in 0.2 * 0.5 ** np.arange(8)],
    )
    yield (
        "shell with a hole, thickness",
        [
            (
                d,
                volume(
                    sh.complete(samples.union(below(ball, 0.8), reversed_faces(below(scaled(ball, 1 - d), 0.8)))), 1.0
                )
                / (4 * np.pi / 3 * (1 - (1 - d) ** 3)),
            )
            for d in 0.2 * 0.5 ** np.arange(6)
        ],
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shapes", nargs="*")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    kinds = ("turned", "moved", "scaled", "in another order", "cut finer", "with noise")
    print("| shape | " + " | ".join(kinds) + " | fields |")
    print("|---|" + "---|" * (len(kinds) + 1))
    for name, make in shapes(arguments.seed):
        if arguments.shapes and not any(word in name for word in arguments.shapes):
            continue
        found, apart = measured(make(), np.random.default_rng(arguments.seed))
        cells = (f"{found[kind][0]:.2g} % {found[kind][1] or ''}".strip() for kind in kinds)
        print(f"| {name} | " + " | ".join(cells) + f" | {apart:.0e} |", flush=True)
    if not arguments.shapes:
        for name, rows in series():
            print(f"\n{name}: " + "  ".join(f"{x:.3g}: {y:.3f}" for x, y in rows), flush=True)


if __name__ == "__main__":
    main()
