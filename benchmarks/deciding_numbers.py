"""The numbers that decide what bounds a solid: each halved and doubled, over shapes of its own.

    python benchmarks/deciding_numbers.py [seeds]

A scene is made of parts of which it is known whether they bound a solid, and of which half are turned. A face is wrong
if it is taken for a sheet though it bounds, the other way round, or if it faces inwards. Printed are the share of the
area that is wrong in each scene, and, for each number, the scenes where that changes by more than a hundredth. Of
shares above a half, twice is half of the way to one. The numbers that choose between readings are also swept over
assemblies of boxes; those of what is proven equal to a solid over surfaces of assemblies; the one that decides
between lids and heat over the volume that shapes enclose, that of seams of surfaces over seams that were rounded, and
slits; those within which points are one over boxes that touch; those of seals over bodies with double skins, leaks
and bodies within; the size of parts that `signedheat info` calls small over
bodies with crumbs, and with screws, which are none.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import assemblies
import numpy as np
from every_number import changed_to, set_everywhere
from numpy.typing import NDArray

from signedheat import Polyline, TriangleMesh, complete, morphology, orientation, samples
from signedheat.mesh import welding
from signedheat.mesh.components import element_components
from signedheat.mesh.triangles import area_vectors
from signedheat.shapes import inspection
from signedheat.solids import bodies, bounding, completion, gauss, kept_faces, overlaps, regions, sealing

MODULES = (bounding, gauss, overlaps, bodies, kept_faces)
NUMBERS = (
    "LEAST_GAIN", "WELL_EXPLAINED", "MOSTLY_WRONG",
    "SHEET", "COHERENT_LEVELS", "CHANCE_LEVEL", "PARTLY_INSIDE", "GAP_REACH", "HINT", "OUTSIDE", "WEIGHT_DAMPING",
    "PLANE_AGREEMENT", "LOOSE_DIPOLES", "SLENDER_TRIANGLE",
)  # fmt: skip
CHANGED = 0.01
"""Share of the area by which a scene must change to be printed."""


@dataclass(frozen=True)
class Scene:
    """Triangles that face outwards, which of them bound a solid, and which are turned; half of the parts if None."""

    mesh: TriangleMesh
    bounds: NDArray[np.bool_]
    turned: NDArray[np.bool_] | None = None

    def __add__(self, other: Scene) -> Scene:
        return Scene(samples.union(self.mesh, other.mesh), np.concatenate([self.bounds, other.bounds]))


Random = np.random.Generator


def body(mesh: TriangleMesh) -> Scene:
    return Scene(mesh, np.ones(mesh.n_faces, dtype=bool))


def sheet(mesh: TriangleMesh) -> Scene:
    return Scene(mesh, np.zeros(mesh.n_faces, dtype=bool))


def rectangle(
    corner: NDArray[np.float64], first: NDArray[np.float64], second: NDArray[np.float64], n: int = 8
) -> TriangleMesh:
    """A rectangle of n × n cells."""
    steps = np.linspace(0, 1, n + 1)
    u, v = np.meshgrid(steps, steps, indexing="ij")
    points = corner + u[..., None] * first + v[..., None] * second
    i = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (rows.ravel() for rows in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    return TriangleMesh(points.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def sides(
    size: tuple[float, float, float],
    left_out: tuple[int, ...] = (),
    at: tuple[float, float, float] = (0, 0, 0),
    n: int = 8,
) -> TriangleMesh:
    """Separate sides of a box, of n × n cells each, numbered −x, +x, −y, +y, −z, +z."""
    made = []
    for side in set(range(6)) - set(left_out):
        axis, end = divmod(side, 2)
        first, second = (np.eye(3)[(axis + k) % 3] * size[(axis + k) % 3] for k in (1, 2))
        corner = np.array(at) + end * size[axis] * np.eye(3)[axis]
        made.append(rectangle(corner, first, second, n) if end else rectangle(corner, second, first, n))
    return samples.union(*made)


def cards(rng: Random, n: int, width: float, height: float) -> TriangleMesh:
    """Flat cards at random in a box of 2."""
    made = []
    for _ in range(n):
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        made.append(rectangle(rng.uniform(-1, 1, 3), width * frame[0], height * frame[1], 2))
    return samples.union(*made)


def wavy() -> TriangleMesh:
    flat = rectangle(np.zeros(3), np.array([2.0, 0, 0]), np.array([0, 2.0, 0]), 30)
    heights = 0.15 * np.sin(5 * flat.vertices[:, 0]) * np.cos(4 * flat.vertices[:, 1])
    return TriangleMesh(flat.vertices + np.c_[np.zeros((len(heights), 2)), heights], flat.faces)


def part_of(mesh: TriangleMesh, kept: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces[kept(mesh.vertices[mesh.faces].mean(axis=1))])


def litter(rng: Random, n: int) -> TriangleMesh:
    corners = rng.uniform(-1.5, 1.5, (n, 1, 3)) + 0.05 * rng.normal(size=(n, 3, 3))
    return TriangleMesh(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))


def noisy_copies(rng: Random, mesh: TriangleMesh, share: float) -> TriangleMesh:
    """Loose copies of some triangles, each of their corners moved by a tenth of its size."""
    corners = mesh.vertices[mesh.faces[rng.random(mesh.n_faces) < share]]
    noise = 0.1 * np.sqrt(np.linalg.norm(area_vectors(corners), axis=1))[:, None, None]
    return TriangleMesh(
        (corners + noise * rng.normal(size=corners.shape)).reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )


def noisy_strips(rng: Random) -> TriangleMesh:
    """The triangles of a cylinder of 48 strips and of its fans, loose, each of their corners moved a little."""
    turn, up = np.linspace(0, 2 * np.pi, 49), np.array([0.0, 0.0, 3.0])
    low = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    high, (a, b) = low + up, (low[:-1], low[1:])
    c, d, foot = high[1:], high[:-1], np.zeros((48, 3))
    corners = np.concatenate(
        [np.stack(each, axis=1) for each in ((a, b, c), (a, c, d), (b, a, foot), (d, c, foot + up))]
    )
    corners += 0.01 * rng.normal(size=corners.shape)
    return TriangleMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def nested(rng: Random, share: float) -> Scene:
    """A ball within a ball, both given outwards but for some of their faces."""
    mesh = samples.union(samples.sphere(3), samples.sphere(2, radius=0.5))
    return Scene(mesh, np.ones(mesh.n_faces, dtype=bool), rng.random(mesh.n_faces) < share)


def overlapping() -> TriangleMesh:
    """Five balls that overlap, each without some patches, the smaller ones for the most part in the largest."""
    places = [(0.0, 0, 0), (0.7, 0, 0), (-0.3, 0.8, 0), (0.1, -0.6, 0.6), (0, 0.1, -0.9)]
    return samples.union(
        *(
            samples.without_patches(samples.sphere(3, radius=radius, center=center), 4, 0.3 * radius)
            for radius, center in zip((1, 0.5, 0.45, 0.4, 0.6), places, strict=True)
        )
    )


def bowl(rng: Random, width: float) -> Scene:
    """The outside and the inside of a ball, both open at the top, without the lip between them."""
    shells = [samples.sphere(3), samples.sphere(3, radius=1 - width)]
    inner = shells[1].faces[:, ::-1]
    shells[1] = TriangleMesh(shells[1].vertices, inner)
    return body(samples.union(*(part_of(shell, lambda at: at[:, 2] < 0.5) for shell in shells)))


SCENES: dict[str, Callable[[Random], Scene]] = {
    "ball, 30 % of the triangles gone": lambda rng: body(samples.without_faces(samples.sphere(3), 0.3)),
    "ball, 75 % gone": lambda rng: body(samples.without_faces(samples.sphere(3), 0.75)),
    "ball, 85 % gone": lambda rng: body(samples.without_faces(samples.sphere(3), 0.85)),
    "loose noisy triangles of a torus": lambda rng: body(samples.soup(samples.torus(n_around=48, n_across=24), 0.01)),
    "loose noisy strips of a cylinder": lambda rng: body(noisy_strips(rng)),
    "half a ball": lambda rng: body(part_of(samples.sphere(4), lambda at: at[:, 2] > 0)),
    "torus with holes": lambda rng: body(samples.without_patches(samples.torus(), 4, 0.25)),
    "six sides": lambda rng: body(sides((1, 0.8, 0.6))),
    "five sides": lambda rng: body(sides((1, 0.8, 0.6), (5,))),
    "four sides": lambda rng: body(sides((1, 0.8, 0.6), (1, 5))),
    "thin plate of six sides": lambda rng: body(sides((1, 1, 0.04))),
    "boxes without tops on a ground": lambda rng: (
        body(samples.union(*(sides((0.5, 0.5, 0.4), (5,), (x, y, 0.05)) for x in range(4) for y in range(3))))
        + sheet(rectangle(np.array([-1.0, -1, 0]), np.array([6.0, 0, 0]), np.array([0, 5.0, 0])))
    ),
    "ball among litter": lambda rng: body(samples.without_patches(samples.sphere(3), 2, 0.3)) + sheet(litter(rng, 60)),
    "ball and noisy copies of its faces": lambda rng: (
        body(samples.sphere(3)) + sheet(noisy_copies(rng, samples.sphere(3), 0.5))
    ),
    "ball in a ball, a fifth of the faces turned": lambda rng: nested(rng, 0.2),
    "balls with holes that overlap": lambda rng: Scene(
        overlapping(), np.ones(overlapping().n_faces, bool), np.zeros(overlapping().n_faces, bool)
    ),
    "balls with holes that overlap, half of them turned": lambda rng: body(overlapping()),
    "bowl without its lip": lambda rng: bowl(rng, 0.2),
    "open box with cards in it": lambda rng: (
        body(sides((2.4, 2.4, 2.4), (5,), (-1.2, -1.2, -1.2))) + sheet(cards(rng, 6, 0.3, 0.3))
    ),
    "14 cards": lambda rng: sheet(cards(rng, 14, 0.6, 0.6)),
    "40 cards": lambda rng: sheet(cards(rng, 40, 0.5, 0.5)),
    "150 cards": lambda rng: sheet(cards(rng, 150, 0.3, 0.3)),
    "200 strips": lambda rng: sheet(cards(rng, 200, 0.6, 0.1)),
    "wavy sheet": lambda rng: sheet(wavy()),
    "two sheets, half a width apart": lambda rng: sheet(sides((1, 1, 0.5), (0, 1, 2, 3))),
}


def wrong(scene: Scene, rng: Random) -> float:
    """Share of the area that is decided wrongly, half of the parts turned."""
    turned = scene.turned
    if turned is None:
        parts = element_components(scene.mesh.faces)
        turned = (rng.random(parts.max() + 1) < 0.5)[parts]
    faces = np.where(turned[:, None], scene.mesh.faces[:, ::-1], scene.mesh.faces)
    found = orientation(TriangleMesh(scene.mesh.vertices, faces))
    outwards = found.turned == turned[found.faces]
    right = np.where(scene.bounds[found.faces], outwards & ~found.undecided, found.undecided)
    areas = np.linalg.norm(area_vectors(scene.mesh.vertices[scene.mesh.faces]), axis=1)[found.faces]
    return float(areas[~right].sum() / areas.sum())


def table(seeds: int) -> dict[str, float]:
    """Mean share of the area that is wrong, of each scene."""
    return {
        name: float(
            np.mean([wrong(make(np.random.default_rng(k)), np.random.default_rng(100 + k)) for k in range(seeds)])
        )
        for name, make in SCENES.items()
    }


def enclosed(seeds: int) -> dict[str, float]:
    """Mean error of the volume of shapes of which a share of the triangles is gone."""
    shapes = {"ball": samples.sphere(3), "torus": samples.torus(n_around=48, n_across=24)}
    return {
        f"{name}, {share:.0%} gone": float(
            np.mean(
                [abs(complete(samples.without_faces(mesh, share, k)).volume / whole - 1) for k in range(seeds)],
            )
        )
        for name, mesh in shapes.items()
        for whole in [complete(mesh).volume]
        for share in (0.3, 0.45, 0.55, 0.65, 0.75)
    }


def torn(mesh: TriangleMesh, moved: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> tuple[TriangleMesh, int]:
    """A surface in two halves, one of them moved, and the number of vertices that are there twice."""
    half = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0.03
    low, high = (part_of(mesh, lambda _, side=side: half == side) for side in (False, True))
    first, second = (np.unique(part.faces) for part in (low, high))
    faces = [np.searchsorted(first, low.faces), len(first) + np.searchsorted(second, high.faces)]
    points = np.concatenate([low.vertices[first], moved(high.vertices[second])])
    return TriangleMesh(points, np.concatenate(faces)), len(np.intersect1d(first, second))


def single(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points.astype(np.float32).astype(np.float64)


def turned_in_single(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Through six turns, there and back, about a place ten times as far away."""
    x, turns = points.astype(np.float32), [np.linalg.qr(np.eye(3) + 0.3 * k)[0].astype(np.float32) for k in range(6)]
    for turn in [*turns, *(turn.T for turn in turns[::-1])]:
        x = (x - np.float32(10)) @ turn + np.float32(10)
    return x.astype(np.float64)


SEAMS: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "exact": lambda points: points,
    "single precision": single,
    "single precision, moved far away": lambda points: single(points + 10) - 10,
    "six decimals": lambda points: points.round(6),
    "turned in single precision": turned_in_single,
    "six decimals, in single precision": lambda points: single(points.round(6)),
    "slit of 1e-4": lambda points: points + 1e-4 * np.eye(3)[0],
    "slit of 1e-3": lambda points: points + 1e-3 * np.eye(3)[0],
}


def joined(units: float) -> dict[str, float]:
    """Share of the vertices that are there twice and joined, of each of the seams."""
    result = {}
    for shape, mesh in (("ball", samples.sphere(4)), ("torus", samples.torus(n_around=96, n_across=48))):
        for name, moved in SEAMS.items():
            surface, twice = torn(mesh, moved)
            halfedges = surface.faces.ravel(), np.roll(surface.faces, -1, axis=1).ravel()
            places = [welding.joined_rims(offset + surface.vertices, *halfedges, units) for offset in (0.0, 1e6)]
            alone = [surface.n_vertices - len(np.unique(each)) for each in places]
            result[f"{shape}, {name}"], result[f"{shape}, {name}, 1e6 away"] = (count / twice for count in alone)
    return result


def parted(seeds: int, apart: bool = False) -> dict[str, float]:
    """Share of assemblies of touching boxes whose volume is wrong, by how far rounding moves their corners.

    Boxes are closed, or their sides are `apart`.
    """
    box = sides((1.0, 1.0, 1.0))
    corners, numbers = np.unique(box.vertices.round(9), axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[box.faces]
    if apart:
        corners, faces = box.vertices, box.faces
    result = {}
    for rounding in (1e-13, 1e-11, 1e-9, 1e-8, 3e-8, 1e-7, 3e-7, 1e-6, 1e-5):
        wrong = 0
        for seed in range(10 * seeds):
            rng = np.random.default_rng([seed, 11])
            cells = np.argwhere(rng.random((2, 2, 2)) < 0.7) if seed % 2 else np.array([[0, 0, 0], [0.4, 0, 0]])
            size = rng.uniform(0.3, 1.0, 3)
            volume = float(size.prod() * (len(cells) if seed % 2 else 1.4))
            points = (cells[:, None] + corners[None]).reshape(-1, 3) * size
            points = points @ np.linalg.qr(rng.normal(size=(3, 3)))[0] + rounding * rng.normal(size=points.shape)
            many = (faces + len(corners) * np.arange(len(cells))[:, None, None]).reshape(-1, 3)
            wrong += abs(complete((points, many)).volume / volume - 1) > 1e-9 + 20 * rounding
        result[f"{rounding:g}"] = wrong / (10 * seeds)
    return result


def reversed_faces(mesh: TriangleMesh) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def leaky(rng: Random, mesh: TriangleMesh, radius: float, n: int = 12) -> TriangleMesh:
    """A mesh without the faces around some of its points."""
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    leaks = centres[rng.integers(len(centres), size=n)]
    return TriangleMesh(
        mesh.vertices, mesh.faces[(np.linalg.norm(centres[:, None] - leaks, axis=2) > radius).all(axis=1)]
    )


def grooved(angle: float) -> TriangleMesh:
    """A block with a groove of an angle in degrees, half as deep as it is high."""
    half = 0.5 * np.tan(np.radians(angle / 2))
    outline = [[-1, 0], [1, 0], [1, 1], [half, 1], [0, 0.5], [-half, 1], [-1, 1]]
    return morphology.extrude(Polyline(outline, closed=True), 1.0)


def with_square_hole(size: float) -> TriangleMesh:
    """A box of two skins, 2 wide, with a square hole of a size through both at the top."""
    made = []
    for half in (1.0, 0.95):
        rings = [w * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) for w in (half, 0.5 * size)]
        points = np.column_stack([np.concatenate(rings), np.full(8, half)])
        frame = [[k, (k + 1) % 4, 4 + (k + 1) % 4] for k in range(4)]
        frame += [[k, 4 + (k + 1) % 4, 4 + k] for k in range(4)]
        skin = samples.union(sides((2 * half,) * 3, (5,), (-half,) * 3), TriangleMesh(points, frame))
        made.append(skin if half == 1.0 else reversed_faces(skin))
    return samples.union(*made)


def filled_by_seals(seeds: int) -> dict[str, float]:
    """Error of the volume that is filled by seals of 0.25, relative to what it should be, of bodies about 2 wide."""
    ball, result = samples.sphere(4), {}
    volume = complete(ball).volume
    for apart in (0.06, 0.001):
        two = samples.union(ball, reversed_faces(samples.sphere(4, radius=1 - apart)), samples.sphere(2, 0.2))
        for width in (0.08, 0.16):
            found = [complete(leaky(np.random.default_rng(k), two, width / 2), seal=0.25).volume for k in range(seeds)]
            result[f"skins {apart} apart, leaks of {width}"] = float(np.mean(np.abs(np.array(found) / volume - 1)))
    for angle in (120.0, 75.0, 60.0):
        groove = grooved(angle)
        result[f"groove of {angle:g}°"] = abs(complete(groove, seal=0.25).volume / groove.volume - 1)
    for size, is_sealed in ((0.2, True), (0.23, True), (0.27, False), (0.3, False)):
        inside = complete(with_square_hole(size), seal=0.25).inside([0.0, 0.0, 0.0])
        result[f"hole of {size}, which {'is' if is_sealed else 'is not'} sealed"] = float(bool(inside) != is_sealed)
    return result


def small_parts(seeds: int) -> dict[str, float]:
    """Mean share of the small parts that are counted wrongly: crumbs of scans, and what belongs to a machine."""
    crumbs, screws = [], []
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 5])
        around = [samples.sphere(1, radius, rng.normal(size=3)) for radius in rng.uniform(5e-4, 4e-3, 20)]
        crumbs.append(1 - inspection.inspect(samples.union(samples.sphere(3), *around)).small_parts / 20)
        around = [sides((size, size, 2 * size), (), tuple(rng.normal(size=3))) for size in rng.uniform(0.02, 0.1, 20)]
        joined_boxes = [TriangleMesh(*_welded(box)) for box in around]
        screws.append(inspection.inspect(samples.union(samples.sphere(3), *joined_boxes)).small_parts / 20)
    return {"crumbs that are not named": float(np.mean(crumbs)), "screws that are": float(np.mean(screws))}


def _welded(mesh: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces with one vertex at each place."""
    places, numbers = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    return places, numbers.reshape(-1)[mesh.faces]


def sweep(name: str, value: float, measured: Callable[[int], dict[str, float]], seeds: int) -> None:
    """Print what changes by more than `CHANGED` with half and twice a number."""
    usual = measured(seeds)
    print(f"{name} {value:g}: " + ", ".join(f"{case} {figure:.4f}" for case, figure in usual.items()), flush=True)
    for changed in changed_to(value):
        set_everywhere(name, changed)
        other = measured(seeds)
        set_everywhere(name, value)
        moved = [f"{case} {other[case]:.3f}" for case in usual if abs(other[case] - usual[case]) > CHANGED]
        print(f"{name} {value:g} → {changed:g}: {'; '.join(moved) or 'nothing'}", flush=True)


def seals_and_small_parts(seeds: int = 2) -> None:
    """Sweep the numbers of seals, and that of small parts."""
    for name in ("CELLS_PER_OPENING", "TOUCHING", "NEARER", "SMALLEST_BALL", "CORNER_DEPTH"):
        sweep(name, getattr(sealing, name), filled_by_seals, seeds)
    sweep("SMALL_PART", inspection.SMALL_PART, small_parts, seeds)


def assembly(rng: Random, kind: str) -> tuple[TriangleMesh, float]:
    """Boxes with vertices of their own that touch or cross, some of their triangles changed; and their volume."""
    cells = np.argwhere(rng.random((3, 2, 2)) < 0.7)
    if kind == "corners":
        cells = cells[cells.sum(axis=1) % 2 == 0]
    sizes = rng.uniform(0.6, 1.4, (len(cells), 3)) if kind == "crossing" else np.ones((len(cells), 3))
    boxes = [sides(tuple(size), (), tuple(cell), 2) for cell, size in zip(cells, sizes, strict=True)]
    whole = samples.union(*(TriangleMesh(*_welded(box)) for box in boxes))
    volume = complete(whole).volume
    faces = whole.faces.copy()
    flipped = rng.random(len(faces)) < 0.2
    faces[flipped] = faces[flipped][:, ::-1]
    return TriangleMesh(whole.vertices, faces[rng.random(len(faces)) > 0.01]), volume


def assemblies_wrong(seeds: int) -> dict[str, float]:
    """Share of changed assemblies whose volume is off by more than a hundredth."""
    result = {}
    for kind in ("bricks", "corners", "crossing"):
        wrong = 0
        for seed in range(10 * seeds):
            mesh, volume = assembly(np.random.default_rng([seed, 12]), kind)
            wrong += volume > 0 and abs(complete(mesh).volume / volume - 1) > 0.01
        result[kind] = wrong / (10 * seeds)
    return result


def surfaces_wrong(seeds: int) -> dict[str, float]:
    """Share of the surfaces of assemblies that are not closed, or not of the volume of the parts."""
    result = {}
    for damage in ("none", "faces turned", "single, each part", "four digits"):
        wrong = 0
        for kind in (assemblies.stack, assemblies.frame, assemblies.pipes, assemblies.rail):
            for seed in range(seeds):
                parts = kind(np.random.default_rng(seed))
                for part in parts:
                    part.merge_vertices()
                whole = assemblies.united(parts)
                shape = assemblies.damaged(parts, damage, np.random.default_rng([seed, 5]))
                surface = complete(shape).surface()
                near = 1e-3 if damage == "four digits" else 1e-6
                right = surface.is_watertight and whole and abs(surface.volume / whole.volume() - 1) < near
                wrong += not right
        result[damage] = wrong / (4 * seeds)
    return result


def value_of(number: str) -> float:
    """Value of a number of the package, by its name."""
    value: float = next(getattr(module, number) for module in MODULES if hasattr(module, number))
    return value


def main(seeds: int = 2) -> None:
    usual = table(seeds)
    for name, share in usual.items():
        print(f"{name:36s} {share:6.3f}")
    for number in NUMBERS:
        value = value_of(number)
        for changed in changed_to(value):
            set_everywhere(number, changed)
            other = table(seeds)
            set_everywhere(number, value)
            moved = [f"{scene} {other[scene]:.3f}" for scene in usual if abs(other[scene] - usual[scene]) > CHANGED]
            print(f"{number} {value:g} → {changed:g}: {'; '.join(moved) or 'nothing'}", flush=True)

    for number in ("LEAST_GAIN", "WELL_EXPLAINED", "MOSTLY_WRONG", "HINT"):
        sweep(number, value_of(number), assemblies_wrong, seeds)
    for number in ("PROOF_SAMPLES", "WRONG_VOLUME", "ROUNDING", "MOST_CONTOURS"):
        sweep(number, value_of(number), surfaces_wrong, seeds)

    value, errors = completion.TORN_LEVEL, {}
    for changed in (value / 2, value, 2 * value):
        set_everywhere("TORN_LEVEL", changed)
        errors[changed] = enclosed(seeds)
    set_everywhere("TORN_LEVEL", value)
    print("error of the volume with completion.TORN_LEVEL " + ", ".join(f"{changed:g}" for changed in errors))
    for name in errors[value]:
        print(f"{name:36s} " + " ".join(f"{row[name]:6.4f}" for row in errors.values()))

    shares = {
        units: joined(units)
        for units in (welding.SEAM_UNITS / 2, welding.SEAM_UNITS, 2 * welding.SEAM_UNITS, welding.GAP_UNITS)
    }
    print("share of seams that is joined with welding.SEAM_UNITS " + ", ".join(f"{units:g}" for units in shares))
    for name in shares[welding.SEAM_UNITS]:
        print(f"{name:54s} " + " ".join(f"{row[name]:4.0%}" for row in shares.values()))

    tolerances = regions.TOLERANCES
    for most in range(1, len(tolerances) + 1):
        regions.TOLERANCES = tolerances[:most]
        print(f"assemblies wrong with {most} of regions.TOLERANCES, by rounding: {listed(parted(seeds))}", flush=True)
    for units in (welding.ONE_PLACE / 4, welding.ONE_PLACE, 4 * welding.ONE_PLACE):
        set_everywhere("ONE_PLACE", units)
        print(f"with sides apart and welding.ONE_PLACE {units:g}: {listed(parted(seeds, apart=True))}", flush=True)
    seals_and_small_parts(seeds)


def listed(shares: dict[str, float]) -> str:
    """Shares in one line."""
    return ", ".join(f"{name} {share:.0%}" for name, share in shares.items())


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
