"""Samples for learning beside other programs: 250,000 points near a shape with signed distances.

``python benchmarks/samples.py SHAPE…`` prints, for each file and program, processor seconds for what all shapes need
(ours: the field) and for the points, and how far distances are off those of libigl without a tree of winding numbers.
Packages: libigl, MeshLib (pip install libigl meshlib).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import signedheat as sh
from signedheat import samples

COUNT = 250_000
CHECKED = 2_000
"""Points whose distances are compared."""
Points = NDArray[np.float64]


def clock(run: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What a function returns, and its processor seconds."""
    begin = time.process_time()
    result = run(*arguments)
    return result, time.process_time() - begin


def libigl(vertices: Points, faces: NDArray[np.int64], points: Points) -> NDArray[np.float64]:
    """Distances to the faces, signed by fast winding numbers."""
    import igl

    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    distances: NDArray[np.float64] = igl.signed_distance(points, vertices, faces, kind)[0]
    return distances


def meshlib(vertices: Points, faces: NDArray[np.int64], points: Points) -> NDArray[np.float64]:
    """The same of MeshLib."""
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(faces.astype(np.int32), vertices)
    cloud = mrmeshnumpy.pointCloudFromPoints(points)
    found = mrmeshpy.findSignedDistances(mesh, cloud.points)
    return np.array(found.vec, dtype=np.float64) if hasattr(found, "vec") else np.array(list(found))


def exact(vertices: Points, faces: NDArray[np.int64], points: Points) -> NDArray[np.float64]:
    """libigl's, signed by winding numbers of all faces."""
    import igl

    distances = igl.signed_distance(points, vertices, faces, igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_UNSIGNED)[0]
    winding = igl.winding_number(vertices, faces, points)
    result: NDArray[np.float64] = np.where(winding > 0.5, -distances, distances)
    return result


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shapes", nargs="+", type=Path)
    options = parser.parse_args()
    sh.sample_distances(sh.signed_distance(samples.sphere(2), resolution=32), 1000)  # compiles
    print("| shape | faces | with | CPU s | largest difference | signs that differ |")
    print("|---|---|---|---|---|---|")
    for path in options.shapes:
        shape = sh.read(path)
        vertices, faces = np.array(shape.vertices), np.array(shape.triangulation.faces, dtype=np.int64)
        field, before = clock(sh.signed_distance, shape)
        taken, seconds = clock(sh.sample_distances, field, COUNT)
        chosen = np.random.default_rng(0).choice(COUNT, CHECKED, replace=False)
        truth = exact(vertices, faces, taken.points[chosen])
        size = float(np.ptp(vertices, axis=0).max())
        rows = [(f"signedheat ({before:.1f} s of it the field)", taken.distances, before + seconds)]
        rows += [(run.__name__, *clock(run, vertices, faces, taken.points)) for run in (libigl, meshlib)]
        for name, distances, spent in rows:
            away = np.abs(np.abs(distances[chosen]) - np.abs(truth)).max() / size
            signs = int(((distances[chosen] < 0) != (truth < 0)).sum())
            print(
                f"| {path.name} | {len(faces)} | {name} | {spent:.1f} | {away:.1e} | {signs} of {CHECKED} |", flush=True
            )


if __name__ == "__main__":
    main()
