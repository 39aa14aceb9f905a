"""Closed meshes of whole and of broken shapes, made by us and by others.

    python benchmarks/watertight.py [--resolution 96] [--shapes parts furniture] [FILE ...]

Shapes: parts with sharp edges, furniture and a car made here, or those in files, which are closed. They are taken as
they are, with 30 % of their faces turned, and with holes. Truth is the whole shape; of furniture, given as boards that
overlap, and of the car, given as sheets that face either way, with gaps between them, and closed wheels, it is their
union. Distances are between points on one surface and the other surface, in cells of the grid that the programs contour
on: root mean square of both ways; largest from the result to the truth, and back. Normals: mean angle to those of the
truth within two cells of its edges of more than 30°. Meeting: pairs of faces that pass through each other. Bodies:
connected parts; the truth has one. Figures are means over the shapes, largest distances are the largest, meeting is a
sum; seconds are of a processor.

manifold3d takes closed meshes only: what it does not take after ``trimesh.repair`` counts as refused. Two recipes of
programs that prepare shapes for generators are made again from their descriptions, with our distance: a shell inflated
by one cell around all faces, of which the outer side of the largest part is kept; and the same shell filled with what
cannot be reached from outside.
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
from signedheat.mesh.components import element_components
from signedheat.mesh.edges import edge_table
from signedheat.mesh.self_intersections import self_intersections
from signedheat.search.face_tree import FaceFeatures, FaceTree

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


def joined(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def united(meshes: list[Mesh]) -> Mesh:
    import manifold3d

    solids = [manifold3d.Manifold(manifold3d.Mesh64(np.array(m.vertices), np.array(m.faces, "u8"))) for m in meshes]
    made = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    return Mesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64))


def board(size: tuple[float, float, float], at: tuple[float, float, float]) -> Mesh:
    x, y = 0.5 * size[0], 0.5 * size[1]
    made = prism(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), (0.0, 0.0), size[2])
    return Mesh(made.vertices + at, made.faces)


def furniture() -> dict[str, tuple[Mesh, Mesh]]:
    """What is given, and the truth."""
    legs = [board((0.08, 0.08, 1.02), (x, y, -1.0)) for x in (-0.9, 0.9) for y in (-0.5, 0.5)]
    table = [board((2, 1.2, 0.06), (0, 0, 0)), board((1.8, 0.06, 0.15), (0, -0.5, -0.14)), *legs]
    sides = [board((0.06, 0.5, 1.8), (x, 0, 0)) for x in (-0.6, 0.6)]
    shelf = [board((1.26, 0.5, 0.06), (0, 0, z)) for z in (0.0, 0.5, 1.0, 1.74)] + sides
    outline = np.array([[-2, 0.3], [2, 0.3], [2, 0.8], [0.9, 0.95], [0.4, 1.4], [-1.1, 1.4], [-1.5, 0.95], [-2, 0.85]])
    car = prism(outline, (-0.2, 0.7), 1.5)
    steps = np.linspace(0, 2 * np.pi, 33)[:-1]
    circle = 0.32 * np.stack([np.cos(steps), np.sin(steps)], axis=1)
    wheel = prism(circle, (0.0, 0.0), 0.25)
    places = [np.array([x, 0.32, z]) for x in (-1.3, 1.3) for z in (-0.05, 1.3)]
    wheels = [Mesh(wheel.vertices + place, wheel.faces) for place in places]
    rng = np.random.default_rng(0)
    n = len(outline)
    panels = []
    for k in range(n):
        m = (k + 1) % n
        a, b, c, d = (np.r_[outline[i], z] for i, z in ((k, 0.0), (m, 0.0), (m, 1.5), (k, 1.5)))
        panels.append(np.stack([a, b, c, d]))
    panels += [np.c_[outline, np.full(n, z)] for z in (0.0, 1.5)]
    sheets = []
    for panel in panels:
        middle = panel.mean(axis=0)
        fan = np.stack([np.arange(len(panel)), np.roll(np.arange(len(panel)), -1), np.full(len(panel), len(panel))], 1)
        shrunk = np.concatenate([middle + 0.99 * (panel - middle), middle[None]])
        sheets.append(Mesh(shrunk, fan if rng.random() < 0.5 else fan[:, ::-1]))
    made = {
        "table": (joined(table), united(table)),
        "shelf": (joined(shelf), united(shelf)),
        "car": (joined([*sheets, *wheels]), united([car, *wheels])),
    }
    return {name: tuple(divided(turned(each, k), 2) for each in both) for k, (name, both) in enumerate(made.items())}


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
    return sh.complete(mesh).surface()


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


def meshfix(mesh: Mesh, cell: float) -> Mesh:
    import pymeshfix

    given = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)
    vertices, faces = pymeshfix.clean_from_arrays(*given, remove_smallest_components=False)
    return Mesh(np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64))


def manifold_plus(mesh: Mesh, cell: float) -> Mesh:
    import point_cloud_utils

    given = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)
    nodes = np.ptp(mesh.bounds, axis=0).max() / cell
    vertices, faces = point_cloud_utils.make_mesh_watertight(*given, resolution=round(6 * nodes**2))
    return Mesh(np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64))


def alpha_wrap(mesh: Mesh, cell: float) -> Mesh:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.array(mesh.vertices), np.array(mesh.faces)))
    offset = pymeshlab.PureValue(cell / 30)  # 30 is what CGAL's manual advises
    meshes.generate_alpha_wrap(alpha=pymeshlab.PureValue(cell), offset=offset)
    made = meshes.current_mesh()
    return Mesh(made.vertex_matrix(), made.face_matrix().astype(np.int64))


def dual_contouring(mesh: Mesh, cell: float) -> Mesh:
    import gpytoolbox
    import igl

    grid = sh.Grid.around(mesh.bounds, spacing=cell)
    points = grid.points.transpose(2, 1, 0, 3).reshape(-1, 3)
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    values = igl.signed_distance(np.array(points), np.array(mesh.vertices), np.array(mesh.faces), kind)[0]
    vertices, quads = gpytoolbox.dual_contouring_of_signed_distance_data(np.asarray(values), points, *grid.shape)
    return Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def inflated(mesh: Mesh, cell: float, filled: bool) -> Mesh:
    """A shell of one cell around all faces: the outer side of its largest part, or filled."""
    from skimage.measure import marching_cubes

    grid = sh.Grid.around(mesh.bounds, spacing=cell)
    values = tree_of(mesh).distances(grid.points.reshape(-1, 3)).reshape(grid.shape) - cell
    if filled:
        labels, _ = scipy.ndimage.label(values > 0)
        values = np.where((values > 0) & (labels != labels[0, 0, 0]), -values, values)
    vertices, faces, _, _ = marching_cubes(values, 0.0, gradient_direction="ascent")
    if not filled:
        bodies = element_components(faces)
        sizes = [
            np.ptp(vertices[faces[bodies == body]].reshape(-1, 3), axis=0).sum() for body in range(bodies.max() + 1)
        ]
        faces = faces[bodies == np.argmax(sizes)]
    used, faces = np.unique(faces, return_inverse=True)
    made = Mesh(grid.origin + vertices[used] * grid.spacing, faces.reshape(-1, 3))
    corners = made.vertices[made.faces]
    outward = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0
    return made if outward else Mesh(made.vertices, made.faces[:, ::-1])


PROGRAMS: dict[str, Callable[[Mesh, float], Mesh | None]] = {
    "signedheat, faces kept": ours_kept,
    "signedheat, sharp": ours_sharp,
    "signedheat, marching cubes": ours_marching,
    "libigl + marching cubes": libigl,
    "libigl + gpytoolbox's dual contouring": dual_contouring,
    "inflated shell, largest part": partial(inflated, filled=False),
    "inflated shell, filled": partial(inflated, filled=True),
    "MeshLib": partial(meshlib, sharpening=False),
    "MeshLib, sharpening": partial(meshlib, sharpening=True),
    "trimesh + manifold3d": repaired,
    "pymeshfix": meshfix,
    "point-cloud-utils": manifold_plus,
    "pymeshlab, alpha wrap": alpha_wrap,
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
    there_off, back_off = found.distances / cell, back.distances(scattered(truth)[0]) / cell
    edges, angle = points_on_edges(truth), np.nan
    if len(edges):
        near = scipy.spatial.cKDTree(edges).query(points)[0] < 2 * cell
        cosines = (normals_of(made)[which] * there.features.face_normals[found.faces]).sum(axis=1)[near]
        angle = float(np.rad2deg(np.arccos(np.clip(cosines, -1, 1))).mean()) if near.any() else np.nan
    meeting = len(self_intersections(made.vertices, made.faces))
    bodies = int(element_components(made.faces).max()) + 1
    rms = float(np.sqrt((np.concatenate([there_off, back_off]) ** 2).mean()))
    return [rms, float(there_off.max()), float(back_off.max()), angle, len(made.faces), meeting, bodies]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", help="closed shapes; by default those made here")
    parser.add_argument("--resolution", type=int, default=96)
    parser.add_argument("--shapes", nargs="*", choices=("parts", "furniture"), default=["parts", "furniture"])
    parser.add_argument("--programs", help="only those whose names have this in them", default="")
    parser.add_argument("--without", help="not those whose names have this in them", default="none")
    arguments = parser.parse_args()
    groups: dict[str, dict[str, tuple[Mesh, Mesh]]] = {}
    if arguments.files:
        groups["files"] = {name: (mesh, mesh) for name in arguments.files for mesh in [sh.read(name)]}
    elif "parts" in arguments.shapes:
        groups["parts"] = {name: (mesh, mesh) for name, mesh in parts().items()}
    if not arguments.files and "furniture" in arguments.shapes:
        groups["furniture"] = furniture()
    for group, shapes in groups.items():
        for damage, broken in DAMAGES.items():
            print(f"\n| {group}, {damage} | rms | to truth | back | normals ° | faces | meeting | bodies ", end="")
            print("| refused | seconds |")
            print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
            for program, close in PROGRAMS.items():
                if arguments.programs in program and arguments.without not in program:
                    row(program, close, broken, shapes, arguments.resolution)


def row(
    program: str,
    close: Callable[[Mesh, float], Mesh | None],
    broken: Callable[[Mesh], Mesh],
    shapes: dict[str, tuple[Mesh, Mesh]],
    resolution: int,
) -> None:
    rows, seconds, refused = [], 0.0, 0
    for name, (given, truth) in shapes.items():
        cell = float(np.ptp(truth.bounds, axis=0).max()) / (resolution / 1.4)
        shape = broken(given)
        try:
            close(shape, 4 * cell)  # compiles
            begin = time.process_time()
            made = close(shape, cell)
            seconds += time.process_time() - begin
        except (sh.errors.SignedHeatError, ImportError, ValueError, RuntimeError) as error:
            print(f"{program}, {name}: {error}", file=sys.stderr)
            made = None
        if made is None or not len(made.faces):
            refused += 1
        else:
            rows.append(figures(made, truth, cell))
    if not rows:
        print(f"| {program} | – | – | – | – | – | – | – | {refused} | {seconds:.1f} |", flush=True)
        return
    angles = np.array(rows)[:, 3]
    angle = f"{np.nanmean(angles):.2f}" if np.isfinite(angles).any() else "–"
    mean, worst, total = np.mean(rows, axis=0), np.max(rows, axis=0), np.sum(rows, axis=0)
    print(
        f"| {program} | {mean[0]:.4f} | {worst[1]:.3f} | {worst[2]:.3f} | {angle} | {mean[4]:.0f} | {total[5]:.0f} "
        f"| {mean[6]:.1f} | {refused} | {seconds:.1f} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
