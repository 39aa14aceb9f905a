"""Distance to broken solids, and closed surfaces outside them, beside libigl and MeshLib: errors and seconds.

    python benchmarks/solids.py [DAMAGE …] [--repeats 3] [--errors-only]

Four closed shapes (a machined part, a ball with bumps, a torus, a thick plate) are damaged in nine ways. Truth is
libigl's exact distance to the whole shape. Two jobs, by the calls of `peers/calls.py`:

* distance at 3,000 random points of the box. Error: root mean square in per cent of the range.
* the surface 0.1 outside, at 96 nodes along the longest side. Error: root mean square of what the exact distance of its
  vertices misses 0.1 by, in per cent of the diagonal. "not closed": how many of the four are not watertight or refused.

Errors are the median and the worst of the four shapes. Seconds are CPU seconds of all threads, for each job and all
four shapes: the least of the repeats, in which the programs take turns, and how far above it the slowest was. We
compute a grid for either job.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from features import part
from peers import calls

import signedheat as sh
from signedheat import samples

OFFSET = 0.1
PROGRAMS = {"signedheat": calls.OURS, "libigl": calls.LIBIGL, "MeshLib": calls.MESHLIB}
Mesh = sh.TriangleMesh


@cache
def shapes() -> dict[str, Mesh]:
    """The whole shapes, about two units long."""
    ball = samples.sphere(5)
    bumps = 1 + 0.12 * np.sin(5 * ball.vertices[:, :1]) * np.cos(4 * ball.vertices[:, 1:2] + ball.vertices[:, 2:])
    grid = sh.Grid((-1.3, -1.0, -0.4), 0.05, (53, 41, 17))
    away = np.abs(grid.points) - [1.0, 0.7, 0.1]
    plate = sh.Field(grid, np.linalg.norm(np.maximum(away, 0), axis=-1) + np.minimum(away.max(axis=-1), 0) - 0.04)
    return {
        "part": part(),
        "bumpy ball": Mesh(ball.vertices * bumps, ball.faces),
        "torus": samples.torus(0.8, 0.3),
        "plate": plate.contour(),
    }


def doubled(mesh: Mesh) -> Mesh:
    """Every face twice, the second time shifted by a hundredth."""
    return samples.union(mesh, Mesh(mesh.vertices + np.array([0.01, 0.006, -0.004]), mesh.faces))


def without_half(mesh: Mesh) -> Mesh:
    """Only the faces whose middles are on one side of a tilted plane."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    heights = middles @ np.array([0.5, 0.6, 0.62])
    return Mesh(mesh.vertices, mesh.faces[heights < np.median(heights)])


DAMAGES: dict[str, Callable[[Mesh], Mesh]] = {
    "whole": lambda mesh: mesh,
    "10 % of the faces turned": lambda mesh: samples.with_flipped_faces(mesh, 0.1, seed=1),
    "half of the faces turned": lambda mesh: samples.with_flipped_faces(mesh, 0.5, seed=1),
    "15 % of the faces missing": lambda mesh: samples.without_faces(mesh, 0.15, seed=2),
    "six holes": lambda mesh: samples.without_patches(mesh, 6, 0.22, seed=3),
    "half of it missing": without_half,
    "noise": lambda mesh: samples.with_noise(mesh, 0.01, seed=4),
    "loose faces with noise": lambda mesh: samples.soup(mesh, 0.01, seed=5),
    "every face twice, shifted": doubled,
}


def exact(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Distance to the whole shape."""
    import igl

    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    return np.asarray(igl.signed_distance(points, np.array(mesh.vertices), np.array(mesh.faces), kind)[0])


def places(mesh: Mesh) -> np.ndarray:
    low, high = mesh.bounds + np.array([[-0.3], [0.3]])
    return np.random.default_rng(0).uniform(low, high, size=(3000, 3))


def is_open(faces: np.ndarray) -> bool:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] % 2).any())


def surface_outside(program: str, broken: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """The surface at `OFFSET`, or nothing where it is refused."""
    try:
        vertices, faces = PROGRAMS[program]["offset surface"](broken, OFFSET)
    except sh.errors.OutsideError as error:
        print(f"  {program} refuses: {error}", file=sys.stderr)
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    return np.ascontiguousarray(vertices, dtype=float), np.asarray(faces)


def timed(job: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.process_time()
    result = job()
    return result, time.process_time() - begin


def measured(program: str, damage: str) -> dict[str, list[float]]:
    """Errors and seconds of both jobs, by shape."""
    found: dict[str, list[float]] = {
        key: [] for key in ("points", "surface", "not closed", "at points", "for surfaces")
    }
    for whole in shapes().values():
        broken, at = DAMAGES[damage](whole), places(whole)
        values, seconds = timed(lambda broken=broken, at=at: PROGRAMS[program]["distance at points"](broken, at))
        truth = exact(whole, at)
        found["points"].append(100 * float(np.sqrt(np.mean((values - truth) ** 2)) / np.ptp(truth)))
        found["at points"].append(seconds)
        result, seconds = timed(lambda broken=broken: surface_outside(program, broken))
        vertices, faces = result
        missed = exact(whole, vertices) - OFFSET if len(faces) else np.array([np.nan])
        diagonal = np.linalg.norm(np.ptp(whole.vertices, axis=0))
        found["surface"].append(100 * float(np.sqrt(np.mean(missed**2)) / diagonal))
        found["not closed"].append(float(not len(faces) or is_open(faces)))
        found["for surfaces"].append(seconds)
    return found


def pair(values: list[float]) -> str:
    return f"{np.nanmedian(values):.2g} / {np.nanmax(values):.2g}"


def spread(seconds: list[float]) -> str:
    return f"{min(seconds):.2f} s +{100 * (max(seconds) / min(seconds) - 1):.0f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = ", ".join(DAMAGES).replace("%", "%%")
    parser.add_argument("damages", nargs="*", metavar="DAMAGE", help=f"some of: {names}")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    unknown = set(arguments.damages) - set(DAMAGES)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: none of {', '.join(DAMAGES)}")
    calls.our_offset(DAMAGES["six holes"](part()), OFFSET)  # compiles
    head = ("distance at points, %", "surface 0.1 outside, %", "not closed", "points", "surfaces")
    print(f"{'median / worst of four':28}{'':11}" + "".join(f"{title:>24}" for title in head))
    for damage in arguments.damages or DAMAGES:
        rounds = [{program: measured(program, damage) for program in PROGRAMS} for _ in range(arguments.repeats)]
        for program, found in rounds[0].items():
            times = [spread([sum(each[program][job]) for each in rounds]) for job in ("at points", "for surfaces")]
            cells = [pair(found["points"]), pair(found["surface"]), f"{sum(found['not closed']):.0f}", *times]
            print(f"{damage:28}{program:11}" + "".join(f"{cell:>24}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
