"""Peak memory of a first distance, in a process of its own, beside its estimate.

``python benchmarks/memory.py`` prints the table of docs/evidence.md, ``… KIND`` the rows that begin so, and
``… KIND SIZE`` measures one of them, here.
"""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples
from signedheat.curves.jumping_distance import memory_estimate as piecewise_estimate
from signedheat.grids.blocks import BLOCK_NODES
from signedheat.grids.grid_discretization import bytes_of_area
from signedheat.grids.grid_discretization import memory_estimate as grid_estimate
from signedheat.memory import libraries
from signedheat.shapes.foreign import SurfaceShape
from signedheat.solids.completion import bytes_to_complete, complete
from signedheat.solids.sampling import BYTES_PER_SAMPLE
from signedheat.solids.tiles import BYTES_AT_WORK, BYTES_IN_BAND, BYTES_PER_DENSE_NODE, blocks_near
from signedheat.surfaces.digital_surface import count_surfels
from signedheat.surfaces.intrinsic_discretization import BYTES_PER_REFINED
from signedheat.surfaces.surface_discretization import BYTES_OF_NEIGHBORS, BYTES_PER_POINT, BYTES_PER_VOXEL, LIGHTER
from signedheat.surfaces.surface_discretization import memory_estimate as surface_estimate
from signedheat.tets.tet_discretization import memory_estimate as tet_estimate

SIZES = {
    "triangles": (70, 140, 280),
    "polygons": (50, 100, 200),
    "points": (20_000, 40_000, 80_000),
    "voxels": (64, 96, 128),
    "tets": (20, 28, 36),
    "intrinsic": (70, 140, 200),
    "piecewise": (50, 100, 200),
    "φ alone, a ball": (96, 160, 256),
    "φ alone, 8 balls": (96, 160, 256),
    "φ alone, 64 balls": (96, 160, 256),
    "closed solids": (96, 160, 288),
    "solids with holes": (96, 160, 288),
    "points as solids": (96, 160, 256),
    "noisy soups": (96, 144, 192),
    "bands, closed": (256, 512, 1024),
    "bands, with holes": (256, 512, 1024),
    "samples": (1_000_000, 2_000_000, 4_000_000),
}
"""Of each kind: parallels of a globe, points, voxels and cells along an edge, nodes along the longest side."""


def globe(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The unit sphere in quads between n parallels and 2n meridians, open at the poles."""
    polar, azimuth = np.linspace(0, np.pi, n + 1)[1:-1, None], np.arange(2 * n)[None] * np.pi / n
    rows = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth]
    ids = np.arange((n - 1) * 2 * n).reshape(n - 1, 2 * n)
    right = np.roll(ids, -1, axis=1)
    quads = np.stack([ids[:-1], ids[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
    return np.stack(rows, -1).reshape(-1, 3), quads


def case(kind: str, size: int) -> tuple[Callable[[], object], float]:
    """What is computed, on a domain that is there, and its estimate besides libraries."""
    if kind == "triangles":
        mesh = triangulated(size)
        curves = mesh.level_set(mesh.vertices[:, 2], 0.3)
        return lambda: sh.SignedHeatSolver(mesh).distance(curves), surface_estimate(mesh.n_faces)
    if kind == "polygons":
        vertices, quads = globe(size)
        polygons = sh.PolygonMesh(vertices, quads)
        at = polygons.points_at(0)
        return lambda: sh.SignedHeatSolver(polygons).distance(at), surface_estimate(round(LIGHTER * 4 * len(quads)))
    if kind == "points":
        cloud = sh.PointCloud(spiral(size))
        beside = BYTES_OF_NEIGHBORS + BYTES_PER_POINT * size
        both = [0, size // 2]  # `points_at` makes the triangles
        return lambda: sh.SignedHeatSolver(cloud).distance(cloud.points_at(both)), surface_estimate(2 * size) + beside
    if kind == "voxels":
        along = (np.arange(size) - size / 2 + 0.5) ** 2
        volume = along[:, None, None] + along[:, None] + along < (0.45 * size) ** 2
        surface = sh.DigitalSurface(volume, 1 / size)
        start = surface.points_at(0)
        estimate = surface_estimate(4 * count_surfels(volume)) + BYTES_PER_VOXEL * size**3
        return lambda: sh.SignedHeatSolver(surface).distance(start), estimate
    if kind == "tets":
        diagonal = sh.TriangleMesh([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]], [[0, 1, 2]])
        tets = sh.tetrahedralize(diagonal, resolution=size, padding=0, grading=np.inf)
        ball = samples.sphere(3, radius=0.7)
        return lambda: sh.SignedHeatSolver(tets).distance(ball), tet_estimate(tets.n_tets)
    return CASES[kind](size)


def refined(size: int) -> tuple[Callable[[], object], float]:
    """Distance on the refinement of a squashed globe, whose number of triangles is known once it is refined."""
    mesh = triangulated(size, (1.0, 1.0, 0.3))
    ring = mesh.path(size // 2 * 2 * size + np.arange(2 * size), closed=True)
    code = "import sys, memory; print(memory.count_refined(int(sys.argv[1])))"
    found = subprocess.run(
        [sys.executable, "-c", code, str(size)], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
    )
    n = int(found.stdout)
    return lambda: sh.SignedHeatSolver(mesh, intrinsic=True).distance(ring), surface_estimate(n) + BYTES_PER_REFINED * n


def count_refined(size: int) -> int:
    """Triangles of the refinement, counted in a process of its own."""
    return sh.intrinsic_delaunay(triangulated(size, (1.0, 1.0, 0.3)), refine=True).n_faces


def piecewise(size: int) -> tuple[Callable[[], object], float]:
    """Half of the equator, which bounds nothing."""
    mesh = triangulated(size)
    half = mesh.path(size // 2 * 2 * size + np.arange(size))
    return lambda: sh.piecewise_distance(half, mesh), piecewise_estimate(mesh.n_faces)


def phi_alone(balls: int, size: int) -> tuple[Callable[[], object], float]:
    """The method alone, around balls in a cube, of which one has holes."""
    around = itertools.product(range(balls), repeat=3)
    mesh = samples.union(*(samples.sphere(3, center=tuple(2.6 * x for x in at)) for at in around))
    mesh = samples.without_patches(mesh, 4, 0.1)
    grid = sh.Grid.around(mesh.bounds, size)
    surface = bytes_of_area(float(mesh.face_areas.sum()), grid.spacing, grid.n_nodes)
    return lambda: sh.SignedHeatSolver(grid).distance(mesh), grid_estimate(grid) + surface - libraries()


def solid(shape: Callable[[], SurfaceShape], closed: bool, size: int) -> tuple[Callable[[], object], float]:
    """A solid in a grid of this resolution."""
    made = shape()
    grid = sh.Grid.around(made.bounds, size)
    count = made.n_points if isinstance(made, sh.PointCloud) else made.triangulation.n_faces
    estimate = max(
        grid_estimate(grid, BYTES_PER_DENSE_NODE, BYTES_AT_WORK) - libraries(), bytes_to_complete(made, count)
    )
    return lambda: sh.signed_distance(made, grid), estimate


def band(closed: bool, size: int) -> tuple[Callable[[], object], float]:
    """A band four nodes wide to either side, from a solid that is there."""
    ball = samples.sphere(5)
    made = complete(ball if closed else samples.without_patches(ball, 4, 0.1))
    grid = sh.Grid.around(made.bounds, size)
    width = 4 * float(grid.spacing.max())
    places = blocks_near(made.tree, grid, width + float(np.linalg.norm(grid.spacing)), 2**40)
    assert places is not None
    return lambda: made.field(grid=grid, band=width), BLOCK_NODES * BYTES_IN_BAND * len(places) + BYTES_AT_WORK


def sampled(size: int) -> tuple[Callable[[], object], float]:
    """Samples of a ball with holes."""
    field = sh.signed_distance(samples.without_patches(samples.sphere(5), 4, 0.1), resolution=96)
    sh.sample_distances(field, 10)
    return lambda: sh.sample_distances(field, size), float(BYTES_PER_SAMPLE * size)


CASES = {
    "bands, closed": partial(band, True),
    "bands, with holes": partial(band, False),
    "samples": sampled,
    "φ alone, a ball": partial(phi_alone, 1),
    "φ alone, 8 balls": partial(phi_alone, 2),
    "φ alone, 64 balls": partial(phi_alone, 4),
    "closed solids": partial(solid, lambda: samples.sphere(5), True),
    "solids with holes": partial(solid, lambda: samples.without_patches(samples.sphere(5), 4, 0.1), False),
    "points as solids": partial(solid, lambda: sh.PointCloud(samples.sphere(5).vertices), True),
    "noisy soups": partial(solid, lambda: samples.soup(samples.sphere(5), 0.02), True),
    "intrinsic": refined,
    "piecewise": piecewise,
}


def triangulated(size: int, scales: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> sh.TriangleMesh:
    """The globe in triangles, scaled along the axes."""
    vertices, quads = globe(size)
    return sh.TriangleMesh(vertices * scales, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]))


def spiral(size: int) -> np.ndarray:
    """Points on the unit sphere, evenly."""
    k = np.arange(size) + 0.5
    polar, azimuth = np.arccos(1 - 2 * k / size), np.pi * (1 + 5**0.5) * k
    rows = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    return np.stack(rows, -1)


def resident(name: str) -> int:
    """Bytes of memory, held now (VmRSS) or at the most until now (VmHWM), without what is held of files.

    How much of libraries' files is held differs between folders by 50 MB, and the system can take it back.
    """
    lines = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
    held = {words[0]: 1024 * int(words[1]) for words in lines if words[-1] == "kB"}
    return held[f"{name}:"] - held["RssFile:"]


def measure(kind: str, size: int) -> dict[str, float]:
    """Peak of a first distance above what was held before it, and its estimate."""
    compute, estimate = case(kind, size)
    before, loading = resident("VmRSS"), libraries()
    _ = compute()
    return {"measured": resident("VmHWM") - before, "estimated": estimate + loading}


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
    else:
        print("| domain | size | measured, MB | estimated, MB | ratio |\n|---|--:|--:|--:|--:|")
        wanted = sys.argv[1] if len(sys.argv) > 1 else ""
        for kind, sizes in SIZES.items():
            for size in sizes if kind.startswith(wanted) else ():
                done = subprocess.run(
                    [sys.executable, __file__, kind, str(size)], capture_output=True, text=True, check=True
                )
                row = json.loads(done.stdout)
                ratio = row["estimated"] / row["measured"]
                print(f"| {kind} | {size} | {row['measured'] / 1e6:.0f} | {row['estimated'] / 1e6:.0f} | {ratio:.2f} |")
