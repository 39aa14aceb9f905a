"""Surfaces from narrow bands, beside other programs at the same spacing.

``python benchmarks/bands.py [RESOLUTION]`` prints what docs/performance.md sums up.
Each row is a process of its own. The error is that of the vertices of the closed surface, against the unit sphere;
its volume is told over that of the sphere, since specks beside faces have small errors, too.
Packages: MeshLib's voxels, libigl's fast winding numbers (pip install meshlib libigl).
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import signedheat as sh
from signedheat import samples
from signedheat.grids.blocks import BLOCK, Blocks, BlockValues
from signedheat.grids.marching import contour_parts

CELLS = 4.0
"""Half width of the band, in cells."""
SHAPES: dict[str, Callable[[], sh.TriangleMesh]] = {
    "whole": lambda: samples.sphere(6),
    "six holes": lambda: samples.without_patches(samples.sphere(6), 6, 0.25, seed=3),
    "half of the faces turned": lambda: samples.with_flipped_faces(samples.sphere(6), 0.5, seed=1),
    "10 % of the faces missing": lambda: samples.without_faces(samples.sphere(6), 0.1, seed=2),
}
Surface = tuple[np.ndarray, np.ndarray]


def band(mesh: sh.TriangleMesh, grid: sh.Grid) -> Surface:
    """Ours, in a band."""
    surface = sh.signed_distance(mesh, grid, band=CELLS * float(grid.spacing[0])).contour()
    return surface.vertices, surface.faces


def dense(mesh: sh.TriangleMesh, grid: sh.Grid) -> Surface:
    """Ours, on the whole grid."""
    surface = sh.signed_distance(mesh, grid).contour()
    return surface.vertices, surface.faces


def _meshlib(mesh: sh.TriangleMesh, grid: sh.Grid, mode: str) -> Surface:
    from meshlib import mrmeshnumpy, mrmeshpy

    options = mrmeshpy.OffsetParameters()
    options.voxelSize = float(grid.spacing[0])
    options.signDetectionMode = getattr(mrmeshpy.SignDetectionMode, mode)
    theirs = mrmeshnumpy.meshFromFacesVerts(np.array(mesh.faces, dtype=np.int32), np.array(mesh.vertices))
    found = mrmeshpy.offsetMesh(mrmeshpy.MeshPart(theirs), 0.0, options)
    return mrmeshnumpy.getNumpyVerts(found), mrmeshnumpy.getNumpyFaces(found.topology)


def meshlib_vdb(mesh: sh.TriangleMesh, grid: sh.Grid) -> Surface:
    """MeshLib with OpenVDB, which asks for closed meshes."""
    return _meshlib(mesh, grid, "OpenVDB")


def meshlib_winding(mesh: sh.TriangleMesh, grid: sh.Grid) -> Surface:
    """MeshLib with winding numbers that know of holes."""
    return _meshlib(mesh, grid, "HoleWindingRule")


def libigl(mesh: sh.TriangleMesh, grid: sh.Grid) -> Surface:
    """Distance to the faces, signed by fast winding numbers, in the blocks around the true surface, contoured by us.

    The blocks are given: where holes are closed is not known from the faces alone.
    """
    import igl

    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    steps, limit = grid.spacing, -(-np.array(grid.shape) // BLOCK)
    places = np.argwhere(np.ones(tuple(limit), dtype=bool))
    centres = grid.origin + (places * BLOCK + 0.5 * (BLOCK - 1)) * steps
    radius = 0.5 * float(np.linalg.norm((BLOCK - 1) * steps)) + (CELLS + 2) * float(steps[0])
    blocks = Blocks.of(places[np.abs(np.linalg.norm(centres, axis=1) - 1) < radius], grid.shape)
    inner = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    points = grid.origin + (blocks.places[:, None] * BLOCK + inner).reshape(-1, 3) * steps
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    values = np.concatenate(
        [igl.signed_distance(points[k : k + 500_000], vertices, faces, kind)[0] for k in range(0, len(points), 500_000)]
    )
    blocks_of = BlockValues(blocks, values.astype(np.float32).reshape(-1, BLOCK, BLOCK, BLOCK))
    low, cells = map(np.concatenate, zip(*contour_parts(blocks_of, steps, 0.0), strict=True))
    return grid.origin + low * steps, cells


WHO = {each.__name__: each for each in (band, dense, meshlib_vdb, meshlib_winding, libigl)}


def is_closed(faces: np.ndarray) -> bool:
    """Whether every edge is passed once to and once fro."""
    a, b = faces[:, [0, 1, 2]].ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    n = int(faces.max()) + 1
    there, back = np.sort(a * n + b), np.sort(b * n + a)
    return bool((there[1:] != there[:-1]).all() and (there == back).all())


def measure(resolution: int, shape: str, who: str) -> dict[str, object]:
    """One row, in this process; everything is compiled before the clock starts."""
    mesh = SHAPES[shape]()
    if who in ("band", "dense"):
        WHO[who](samples.without_faces(samples.sphere(3), 0.1), sh.Grid.around(mesh.bounds, 48))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    grid = sh.Grid.around(mesh.bounds, resolution)
    wall, work = time.perf_counter(), time.process_time()
    vertices, faces = WHO[who](mesh, grid)
    wall, work = time.perf_counter() - wall, time.process_time() - work
    if not len(faces):
        raise SystemExit("no surface")
    away = (np.linalg.norm(vertices, axis=1) - 1) / float(grid.spacing[0])
    return {
        "seconds": round(wall, 1),
        "cpu": round(work, 1),
        "peak": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, 2),
        "before": round(before / 1e6, 2),
        "error": float(np.sqrt(np.mean(away**2))),
        "worst": float(np.abs(away).max()),
        "volume": float(np.linalg.det(vertices[faces]).sum() / 6 / (4 / 3 * np.pi)),
        "faces": len(faces),
        "closed": is_closed(faces),
    }


def main() -> None:
    """Print all rows, or one as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("resolution", nargs="?", type=int, default=256, help="nodes along a side")
    parser.add_argument("--shapes", nargs="+", default=list(SHAPES), choices=SHAPES)
    parser.add_argument("--row", nargs=2, metavar=("SHAPE", "WHO"), help="measure this one, here")
    options = parser.parse_args()
    if options.row:
        print(json.dumps(measure(options.resolution, *options.row)))
        return
    print("| sphere | with | CPU s | peak GB | error, cells | worst | volume | closed |")
    print("|---|---|---|---|---|---|---|---|")
    for shape in options.shapes:
        for who in WHO:
            command = [sys.executable, __file__, str(options.resolution), "--row", shape, who]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                print(
                    f"| {shape} | {who} | {(done.stderr.strip().splitlines() or ['died'])[-1][:80]} | | | | | |",
                    flush=True,
                )
                continue
            row = json.loads(done.stdout)
            errors = f"{row['error']:.3f} | {row['worst']:.1f} | {row['volume']:.3f}"
            figures = f"{row['cpu']} | {row['peak']} | {errors} | {row['closed']}"
            print(f"| {shape} | {who} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
