"""Distance on tet meshes: time, memory and error by size, against the closed form, and a peer where it is installed.

A sphere in a box, on lattices that do not follow it (and, with the optional `tetgen`, on unstructured tets that do not
follow it either).

    python benchmarks/tets.py [--most 300000]
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
import trimesh

import signedheat as sh

HALF = 1.6


def lattice(n_tets: float) -> sh.TetMesh:
    """About so many tets of a body-centred cubic lattice."""
    diagonal = sh.TriangleMesh(HALF * np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]]), [[0, 1, 2]])
    cells = round((n_tets / 12) ** (1 / 3))
    return sh.tetrahedralize(diagonal, resolution=cells, padding=0, grading=np.inf)


def unstructured(n_tets: float) -> sh.TetMesh | None:
    """About so many tets from TetGen, if it is installed."""
    try:
        import pyvista
        import tetgen
    except ImportError:
        return None
    box = pyvista.Box((-HALF, HALF) * 3, level=0).triangulate()
    volume = 2.4 * (2 * HALF) ** 3 / n_tets
    out = tetgen.TetGen(box).tetrahedralize(order=1, mindihedral=15, minratio=1.3, maxvolume=volume, fixedvolume=True)
    return sh.TetMesh(out[0], out[1])


def measure(mesh: sh.TetMesh, ball: sh.TriangleMesh, diffusion: float) -> dict[str, float]:
    """Seconds of a first distance, and its errors."""
    fresh = sh.TetMesh(mesh.vertices, mesh.tets)
    begin = time.perf_counter()
    phi = sh.SignedHeatSolver(fresh, diffusion).distance(ball)
    seconds = time.perf_counter() - begin
    gap = phi.values - (np.linalg.norm(mesh.vertices, axis=1) - 1)
    return {
        "total": seconds,
        **phi.diagnostics.timings,
        "rms": float(np.sqrt(np.mean(gap**2))),
        "relative": float(np.sqrt(np.mean(gap**2)) / (HALF * np.sqrt(3))),
        "max": float(np.abs(gap).max()),
    }


def main() -> None:
    """Print one line per mesh."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=float, default=3e5, help="tets of the largest mesh")
    most = parser.parse_args().most
    ball = trimesh.creation.icosphere(subdivisions=5)
    ball = sh.TriangleMesh(ball.vertices, ball.faces)
    measure(lattice(2000), ball, 1.0)  # compile
    measure(lattice(30000), ball, 1.0)
    print(
        f"{'mesh':14}{'tets':>9}{'τ':>3}{'total s':>9}{'sources':>9}{'step 1':>8}{'step 3':>8}{'rms':>9}{'/range':>9}"
        f"{'max':>8}{'µs/tet':>8}{'growth':>8}{'peak GB':>9}"
    )
    for name, make in (("lattice", lattice), ("unstructured", unstructured)):
        for diffusion in (1.0, 4.0):
            previous = None
            for n_tets in (8e3, 7.1e4, 2.62e5, 1.14e6):
                if n_tets > most or (mesh := make(n_tets)) is None:
                    continue
                found = measure(mesh, ball, diffusion)
                growth = (
                    np.log(found["total"] / previous[1]) / np.log(mesh.n_tets / previous[0]) if previous else np.nan
                )
                previous = mesh.n_tets, found["total"]
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
                print(
                    f"{name:14}{mesh.n_tets:9d}{diffusion:3.0f}{found['total']:9.2f}{found['sources']:9.2f}"
                    f"{found['diffuse']:8.2f}{found['integrate']:8.2f}{found['rms']:9.5f}{found['relative']:9.5f}"
                    f"{found['max']:8.4f}{1e6 * found['total'] / mesh.n_tets:8.1f}{growth:8.2f}{peak:9.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
