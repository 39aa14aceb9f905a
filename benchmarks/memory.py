"""Peak memory of a first distance, in a process of its own, beside its estimate.

``python benchmarks/memory.py`` prints the table of docs/reliability.md; ``… KIND SIZE`` measures one row, here.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples
from signedheat.geometry.surfels import count_surfels
from signedheat.lowering.surface.digital_surfaces import BYTES_PER_VOXEL
from signedheat.lowering.surface.memory import memory_estimate as surface_estimate
from signedheat.lowering.surface.point_clouds import BYTES_PER_POINT, NEIGHBORS
from signedheat.lowering.tets.discretization import memory_estimate as tet_estimate
from signedheat.memory import libraries

SIZES = {
    "triangles": (70, 140, 280),
    "polygons": (50, 100, 200),
    "points": (20_000, 40_000, 80_000),
    "voxels": (64, 96, 128),
    "tets": (20, 28, 36),
}
"""Of each kind: parallels of a globe, points, voxels and cells along an edge."""


def globe(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The unit sphere in quads between n parallels and 2n meridians, open at the poles."""
    polar, azimuth = np.linspace(0, np.pi, n + 1)[1:-1, None], np.arange(2 * n)[None] * np.pi / n
    rows = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth]
    ids = np.arange((n - 1) * 2 * n).reshape(n - 1, 2 * n)
    right = np.roll(ids, -1, axis=1)
    quads = np.stack([ids[:-1], ids[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
    return np.stack(rows, -1).reshape(-1, 3), quads


def case(kind: str, size: int) -> tuple[object, object, float]:
    """A domain, a source on it, and the estimate."""
    if kind == "triangles":
        vertices, quads = globe(size)
        mesh = sh.TriangleMesh(vertices, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]))
        return mesh, mesh.level_set(vertices[:, 2], 0.3), surface_estimate(mesh.n_faces)
    if kind == "polygons":
        vertices, quads = globe(size)
        polygons = sh.PolygonMesh(vertices, quads)
        return polygons, polygons.points_at(0), surface_estimate(4 * len(quads))
    if kind == "points":
        k = np.arange(size) + 0.5
        polar, azimuth = np.arccos(1 - 2 * k / size), np.pi * (1 + 5**0.5) * k
        rows = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
        beside = NEIGHBORS + BYTES_PER_POINT * size
        return sh.PointCloud(np.stack(rows, -1)), [0, size // 2], surface_estimate(2 * size) + beside
    if kind == "voxels":
        along = (np.arange(size) - size / 2 + 0.5) ** 2
        volume = along[:, None, None] + along[:, None] + along < (0.45 * size) ** 2
        surface = sh.DigitalSurface(volume, 1 / size)
        return surface, surface.points_at(0), surface_estimate(4 * count_surfels(volume)) + BYTES_PER_VOXEL * size**3
    diagonal = sh.TriangleMesh([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]], [[0, 1, 2]])
    mesh = sh.tetrahedralize(diagonal, resolution=size, padding=0, grading=np.inf)
    return mesh, samples.sphere(3, radius=0.7), tet_estimate(mesh.n_tets)


def resident(name: str) -> int:
    """Bytes of memory held now (VmRSS), or at the most until now (VmHWM)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(name))


def measure(kind: str, size: int) -> dict[str, float]:
    """Peak of a first distance above what was held before it, and its estimate."""
    domain, source, estimate = case(kind, size)
    before, loading = resident("VmRSS"), libraries()
    if kind == "points":
        source = domain.points_at(source)  # makes the triangles
    sh.SignedHeatSolver(domain).distance(source)
    return {"measured": resident("VmHWM") - before, "estimated": estimate + loading}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
    else:
        print("| domain | size | measured, MB | estimated, MB | ratio |\n|---|--:|--:|--:|--:|")
        for kind, sizes in SIZES.items():
            for size in sizes:
                done = subprocess.run(
                    [sys.executable, __file__, kind, str(size)], capture_output=True, text=True, check=True
                )
                row = json.loads(done.stdout)
                ratio = row["estimated"] / row["measured"]
                print(f"| {kind} | {size} | {row['measured'] / 1e6:.0f} | {row['estimated'] / 1e6:.0f} | {ratio:.2f} |")
