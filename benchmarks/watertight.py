"""Closed meshes of whole and of broken parts with sharp edges, beside libigl, MeshLib, and trimesh with manifold3d.

    python benchmarks/watertight.py [--resolution 96] [FILE ...]

Parts made here, or those in files, are taken whole, with 30 % of their faces turned, and with holes. Truth is the whole
part. Distances are between points on one surface and the other surface, in cells of the grid that the programs contour
on: root mean square and largest, from the result to the truth and back. Normals: mean angle to those of the truth
within two cells of its edges of more than 30°. Meeting: pairs of faces that pass through each other. Bodies: connected
parts; the truth has one. Figures are means over the parts, the largest distance is the largest, meeting is a sum;
seconds are wall time.

manifold3d takes closed meshes only: what it does not take after ``trimesh.repair`` counts as refused.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy

import signedheat as sh
from signedheat import samples
from signedheat.geometry.components import element_components
from signedheat.geometry.edges import edge_table
from signedheat.geometry.face_features import FaceFeatures
from signedheat.geometry.face_tree import FaceTree
from signedheat.geometry.self_intersections import self_intersections

Mesh = sh.TriangleMesh
N_POINTS = 20_000


def prism(outline: np.ndarray, centre: tuple[float, float], height: float) -> Mesh:
    """An extruded polygon, counter-clockwise, all of whose corners a centre sees."""
    n = len(outline)
    rims = [np.c_[outline, np.full(n, z)] for z in (0.0, height)]
    points = np.concatenate([*rims, [[*centre, 0.0], [*centre, height]]])
    a, b = np.arange(n), np.roll(np.arange(n), -1)
    low, high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    sides = (b, a, low), (a + n, b + n, high), (a, b, b + n), (a, b + n, a + n)
    return Mesh(points, np.concatenate([np.stack(each, 1) for each in sides]))


def turned(mesh: Mesh, seed: int) -> Mesh:
    turn = scipy.spatial.transform.Rotation.random(random_state=seed).as_matrix()
    return Mesh(mesh.vertices @ turn.T, mesh.faces)


def divided(mesh: Mesh, times: int) -> Mesh:
    """Each face into four, so that damage is smaller than a side."""
    for _ in range(times):
        table = edge_table(mesh.faces)
        middles = len(mesh.vertices) + table.face_edges
        (a, b, c), (p, q, r) = mesh.faces.T, middles.T
        faces = np.concatenate([np.stack(each, 1) for each in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))])
        mesh = Mesh(np.concatenate([mesh.vertices, mesh.vertices[table.vertices].mean(axis=1)]), faces)
    return mesh


def parts() -> dict[str, Mesh]:
    corners = np.array([[0, 0], [1.6, 0], [1.6, 0.4], [0.4, 0.4], [0.4, 1.3], [0, 1.3]])
    steps = np.linspace(0, 2 * np.pi, 49)[:-1]
    circle = np.stack([np.cos(steps), np.sin(steps)], axis=1)
    teeth = np.where(np.arange(48) // 2 % 2, 0.8, 1.0)[:, None]
    made = {
        "bracket": prism(corners, (0.2, 0.2), 0.7),
        "gear": prism(teeth * circle, (0.0, 0.0), 0.4),
        "nut": prism(circle[::8], (0.0, 0.0), 0.8),
    }
    return {name: divided(turned(part, k), 3) for k, (name, part) in enumerate(made.items())}


DAMAGES: dict[str, Callable[[Mesh], Mesh]] = {
    "whole": lambda mesh: mesh,
    "30 % of the faces turned": lambda mesh: samples.with_flipped_faces(mesh, 0.3, seed=1),
    "three holes": lambda mesh: samples.without_patches(
        mesh, 3, 0.1 * float(np.ptp(mesh.bounds, axis=0).max()), seed=3
    ),
}


def ours_kept(mesh: Mesh, cell: float) -> Mesh:
    return sh.complete(mesh).surface(keep_faces=True)


def ours_sharp(mesh: Mesh, cell: float) -> Mesh:
    return sh.complete(mesh).surface(spacing=cell)


def ours_marching(mesh: Mesh, cell: float) -> Mesh:
    return sh.complete(mesh).surface(sharp=False, spacing=cell)


def libigl(mesh: Mesh, cell: float) -> Mesh:
    import igl
    from skimage.measure import marching_cubes

    grid = sh.Grid.around(mesh.bounds, spacing=cell)
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    values = igl.signed_distance(grid.points.reshape(-1, 3), np.array(mesh.vertices), np.array(mesh.faces), kind)[0]
    vertices, faces, _, _ = marching_cubes(np.asarray(values).reshape(grid.shape), 0.0, gradient_direction="descent")
    return Mesh(grid.origin + vertices * grid.spacing, faces)


def meshlib(mesh: Mesh, cell: float, sharpening: bool) -> Mesh:
    from meshlib import mrmeshpy
    from peers.calls import meshlib_arrays, meshlib_mesh

    options = mrmeshpy.GeneralOffsetParameters()
    options.voxelSize = cell
    options.signDetectionMode = mrmeshpy.SignDetectionMode.HoleWindingRule
    if sharpening:
        options.mode = mrmeshpy.OffsetMode.Sharpening
    vertices, faces = meshlib_arrays(mrmeshpy.generalOffsetMesh(meshlib_mesh(mesh), 0.0, options))
    return Mesh(vertices, faces)


def repaired(mesh: Mesh, cell: float) -> Mesh | None:
    import manifold3d
    import trimesh

    given = trimesh.Trimesh(mesh.vertices, mesh.faces)
    trimesh.repair.fix_normals(given)
    trimesh.repair.fill_holes(given)
    made = manifold3d.Manifold(
        manifold3d.Mesh(np.asarray(given.vertices, dtype=np.float32), np.asarray(given.faces, dtype=np.uint32))
    )
    if made.status() != manifold3d.Error.NoError or made.is_empty():
        return None
    result = made.to_mesh()
    return Mesh(np.asarray(result.vert_properties)[:, :3], np.asarray(result.tri_verts))


PROGRAMS: dict[str, Callable[[Mesh, float], Mesh | None]] = {
    "signedheat, faces kept": ours_kept,
    "signedheat, sharp": ours_sharp,
    "signedheat, marching cubes": ours_marching,
    "libigl + marching cubes": libigl,
    "MeshLib": partial(meshlib, sharpening=False),
    "MeshLib, sharpening": partial(meshlib, sharpening=True),
    "trimesh + manifold3d": repaired,
}


def tree_of(mesh: Mesh) -> FaceTree:
    triangles = mesh.vertices[mesh.faces]
    return FaceTree.of(FaceFeatures.of(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)))


def normals_of(mesh: Mesh) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]


def scattered(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Points spread evenly, and their faces."""
    rng = np.random.default_rng(0)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    which = rng.choice(len(areas), N_POINTS, p=areas / areas.sum())
    u, v = rng.random((2, N_POINTS, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[which] + u * (b - a)[which] + v * (c - a)[which], which


def points_on_edges(mesh: Mesh) -> np.ndarray:
    table = edge_table(mesh.faces)
    two = np.argsort(table.face_edges.ravel(), kind="stable").reshape(-1, 2) // 3
    normals = normals_of(mesh)
    sharp = (normals[two[:, 0]] * normals[two[:, 1]]).sum(axis=1) < np.cos(np.deg2rad(30))
    a, b = mesh.vertices[table.vertices[sharp]].transpose(1, 0, 2)
    return (a[:, None] + np.linspace(0, 1, 40)[:, None] * (b - a)[:, None]).reshape(-1, 3)


def figures(made: Mesh, truth: Mesh, cell: float) -> list[float]:
    there, back = tree_of(truth), tree_of(made)
    points, which = scattered(made)
    found = there.search(points)
    off = np.concatenate([found.distances, back.distances(scattered(truth)[0])]) / cell
    near = scipy.spatial.cKDTree(points_on_edges(truth)).query(points)[0] < 2 * cell
    cosines = (normals_of(made)[which] * there.features.face_normals[found.faces]).sum(axis=1)[near]
    angle = float(np.rad2deg(np.arccos(np.clip(cosines, -1, 1))).mean())
    meeting = len(self_intersections(made.vertices, made.faces))
    bodies = int(element_components(made.faces).max()) + 1
    return [float(np.sqrt((off**2).mean())), float(off.max()), angle, len(made.faces), meeting, bodies]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", help="closed parts; by default three made here")
    parser.add_argument("--resolution", type=int, default=96)
    arguments = parser.parse_args()
    shapes = {name: sh.read(name) for name in arguments.files} or parts()
    for damage, broken in DAMAGES.items():
        print(f"\n| {damage} | rms | largest | normals ° | faces | meeting | bodies | refused | seconds |")
        print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
        for program, close in PROGRAMS.items():
            rows, seconds, refused = [], 0.0, 0
            for truth in shapes.values():
                cell = float(np.ptp(truth.bounds, axis=0).max()) / (arguments.resolution / 1.4)
                shape = broken(truth)
                close(shape, 4 * cell)  # compiles
                begin = time.perf_counter()
                try:
                    made = close(shape, cell)
                except (sh.errors.SignedHeatError, ImportError) as error:
                    print(f"{program}: {error}", file=sys.stderr)
                    made = None
                seconds += time.perf_counter() - begin
                if made is None:
                    refused += 1
                else:
                    rows.append(figures(made, truth, cell))
            if not rows:
                print(f"| {program} | – | – | – | – | – | – | {refused} | {seconds:.2f} |")
                continue
            mean, worst, total = np.mean(rows, axis=0), np.max(rows, axis=0), np.sum(rows, axis=0)
            print(
                f"| {program} | {mean[0]:.4f} | {worst[1]:.3f} | {mean[2]:.2f} | {mean[3]:.0f} | {total[4]:.0f} "
                f"| {mean[5]:.1f} | {refused} | {seconds:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
