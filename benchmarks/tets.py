"""Distance on tet meshes: CPU seconds, memory and error by size, against the closed form, and beside a plain recipe.

The unit sphere in [−1.6, 1.6]³, on lattices and (with the optional `tetgen`) on unstructured tets, neither of which
follow the sphere; then on tets of which faces make up the sphere, where a recipe of 30 lines, on its own assembly, is
the comparison: X₀ = area times normal on those faces, lumped masses, normalised means in the tets, cotan Laplacian.

ε is the rms over the vertices, after removing the mean error, over the range of the distance, 1.6 √3.

    python benchmarks/tets.py [--most 300000]
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh

import signedheat as sh

sys.path.insert(0, str(Path(__file__).parent.parent))
from shapes.tet_cases import plain_recipe

HALF = 1.6
SIZES = (8e3, 7.1e4, 2.62e5, 1.14e6)


def ball(subdivisions: int) -> sh.TriangleMesh:
    """The unit sphere, facing outward."""
    found = trimesh.creation.icosphere(subdivisions=subdivisions)
    return sh.TriangleMesh(found.vertices, found.faces)


def lattice(n_tets: float) -> sh.TetMesh:
    """About so many tets of a body-centred cubic lattice."""
    diagonal = sh.TriangleMesh(HALF * np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]]), [[0, 1, 2]])
    cells = round((n_tets / 12) ** (1 / 3))
    return sh.tetrahedralize(diagonal, resolution=cells, padding=0, grading=np.inf)


def walls_for(n_tets: float) -> tuple[np.ndarray, np.ndarray]:
    """The sides of the box in triangles about as large as the faces of so many tets."""
    n = round((n_tets / 9) ** (1 / 3))
    cube = sh.DigitalSurface(np.ones((n, n, n)), 2 * HALF / n, np.full(3, HALF / n - HALF)).squares
    squares = cube.corners.reshape(-1, 4)
    return cube.vertices, np.concatenate([squares[:, :3], squares[:, [0, 2, 3]]])


def with_tetgen(vertices: np.ndarray, faces: np.ndarray, n_tets: float) -> sh.TetMesh:
    """Tets between the given faces, which are all kept."""
    import tetgen

    mesher = tetgen.TetGen(vertices, faces.astype(np.int32))
    volume = 1.64 * (2 * HALF) ** 3 / n_tets
    out = mesher.tetrahedralize(
        order=1, nobisect=True, mindihedral=10, minratio=1.4, maxvolume=volume, fixedvolume=True
    )
    return sh.TetMesh(out[0], out[1])


def unstructured(n_tets: float) -> sh.TetMesh:
    """About so many tets of TetGen's in the box."""
    return with_tetgen(*walls_for(n_tets), n_tets)


def following(n_tets: float) -> sh.TetMesh:
    """About so many tets of TetGen's, some faces of which are those of `sphere_for` that many."""
    box, walls = walls_for(n_tets)
    inner = sphere_for(n_tets)
    vertices = np.concatenate([inner.vertices, box])
    return with_tetgen(vertices, np.concatenate([inner.faces, walls + inner.n_vertices]), n_tets)


def sphere_for(n_tets: float) -> sh.TriangleMesh:
    """The sphere with faces about as large as those of so many tets."""
    return ball(2 if n_tets < 3e4 else 3 if n_tets < 2e5 else 4)


def ours(mesh: sh.TetMesh, sphere: sh.TriangleMesh, diffusion: float) -> np.ndarray:
    """φ at the vertices, everything computed anew."""
    return sh.SignedHeatSolver(sh.TetMesh(mesh.vertices, mesh.tets), diffusion).distance(sphere).values


def sharpened(mesh: sh.TetMesh, sphere: sh.TriangleMesh) -> np.ndarray:
    """The same, sharpened."""
    return sh.sharpen(sh.SignedHeatSolver(sh.TetMesh(mesh.vertices, mesh.tets)).distance(sphere)).values


def cases() -> Iterator[tuple[str, Callable, Callable, Callable]]:
    """Name, meshes, spheres, and what to run on them."""
    fine = ball(5)
    yield "lattice, sharpened", lattice, lambda n: fine, sharpened
    for diffusion in (1.0, 4.0):

        def run(mesh, sphere, diffusion=diffusion):
            return ours(mesh, sphere, diffusion)

        yield f"lattice, τ = {diffusion:.0f}", lattice, lambda n: fine, run
        try:
            import tetgen  # noqa: F401
        except ImportError:
            continue
        yield f"unstructured, τ = {diffusion:.0f}", unstructured, lambda n: fine, run
        yield f"following, τ = {diffusion:.0f}", following, sphere_for, run
        if diffusion == 1:
            yield "following, recipe", following, sphere_for, plain_recipe


def main() -> None:
    """Print one line per mesh, and the order fitted to the errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=float, default=3e5, help="tets of the largest mesh")
    most = parser.parse_args().most
    warnings.filterwarnings("ignore", module="tetgen|pyvista")
    for n_tets in (2000, 30000):  # compile
        sharpened(lattice(n_tets), ball(5))
    print(f"{'case':24}{'tets':>9}{'seconds':>9}{'µs/tet':>8}{'growth':>8}{'rms':>9}{'ε':>9}{'max':>8}{'peak GB':>9}")
    for name, make, sphere, run in cases():
        sizes, errors, seconds = [], [], []
        for n_tets in (n for n in SIZES if n <= most):
            mesh, source = make(n_tets), sphere(n_tets)
            begin = time.process_time()
            phi = run(mesh, source)
            seconds.append(time.process_time() - begin)
            gap = phi - (np.linalg.norm(mesh.vertices, axis=1) - 1)
            sizes.append(mesh.n_tets)
            errors.append(gap.std() / (HALF * np.sqrt(3)))
            growth = np.log(seconds[-1] / seconds[-2]) / np.log(sizes[-1] / sizes[-2]) if len(sizes) > 1 else np.nan
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
            print(
                f"{name:24}{mesh.n_tets:9d}{seconds[-1]:9.2f}{1e6 * seconds[-1] / mesh.n_tets:8.1f}{growth:8.2f}"
                f"{np.sqrt(np.mean(gap**2)):9.5f}{errors[-1]:9.5f}{np.abs(gap).max():8.4f}{peak:9.2f}",
                flush=True,
            )
        if len(sizes) > 1:
            order = -3 * np.polyfit(np.log(sizes), np.log(errors), 1)[0]
            print(f"{'':24}order of ε {order:.2f}", flush=True)


if __name__ == "__main__":
    main()
