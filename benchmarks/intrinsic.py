"""Intrinsic triangulations: time and size, angles before and after, and distance on awful triangulations.

    python benchmarks/intrinsic.py [FOLDER] [--picture FILE] [--growth]

Every mesh is taken as it is and with each face cut into needles, caps and slivers of an aspect ratio of a million,
which changes nothing of the surface. ε is the root mean square error over the mesh's own vertices, weighted by area, in
parts of the range, against the distance along the surface, or, where the curves bound nothing, against the solution on
the mesh with every face split in 16.

FOLDER holds meshes, ``NAME.obj``, with their curves, ``NAME.json``, along edges; a mesh without curves gets the line
where z is 0.3 of the largest. Without a folder shapes made here are taken.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

import signedheat as sh
from signedheat.geodesics.exact_distance import distance_to_zero_line
from signedheat.samples import sphere, torus

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes.triangulated import cut_quads, upward


@dataclass(frozen=True)
class Case:
    """A mesh and its curves: paths along its edges (vertex ids, closed), or the zero line of values at its vertices."""

    name: str
    mesh: sh.TriangleMesh
    paths: tuple[tuple[np.ndarray, bool], ...] = ()
    values: np.ndarray | None = None

    def curves(self) -> list[sh.Curve]:
        if self.values is not None:
            return self.mesh.level_set(self.values)
        return [self.mesh.path(ids, closed=closed) for ids, closed in self.paths]

    def cut(self, kind: str) -> Case:
        """Every face cut in the same way; old vertices go first."""
        inner, triples = CUTS[kind]
        n, m = self.mesh.n_vertices, self.mesh.n_faces
        new = n + np.arange(m * len(inner)).reshape(m, len(inner))
        faces = np.concatenate([self.mesh.faces, new], axis=1)[:, triples].reshape(-1, 3)
        vertices, values = (
            None
            if f is None
            else np.concatenate([f, np.einsum("ik,fk...->fi...", inner, f[self.mesh.faces]).reshape(-1, *f.shape[1:])])
            for f in (self.mesh.vertices, self.values)
        )
        return Case(self.name, sh.TriangleMesh(vertices, faces), self.paths, values)

    def split(self) -> Case:
        """Every face split in four; old vertices go first."""
        mesh, edges = self.mesh, self.mesh.edges
        corner, middle = mesh.faces, mesh.n_vertices + edges.face_edges
        parts = [np.stack([corner[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(3)]
        halves = [
            None if f is None else np.concatenate([f, f[edges.vertices].mean(axis=1)])
            for f in (mesh.vertices, self.values)
        ]
        number = {tuple(pair): mesh.n_vertices + k for k, pair in enumerate(np.sort(edges.vertices, axis=1).tolist())}
        paths = []
        for ids, closed in self.paths:
            ends = np.stack([ids, np.roll(ids, -1)], axis=1)
            between = [number.get(tuple(sorted(pair)), -1) for pair in ends.tolist()]
            double = np.stack([ids, between], axis=1).ravel()
            paths.append((double if closed else double[:-1], closed))
        return Case(self.name, sh.TriangleMesh(halves[0], np.concatenate([*parts, middle])), tuple(paths), halves[1])


def template(inner: list[list[float]], stretch: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A triangle cut at inner points as if `stretch` times as wide: their barycentric coordinates, and faces."""
    points = np.concatenate([np.eye(3), inner])[:, 1:]
    return np.array(inner), upward(points, Delaunay(points * [stretch, 1]).simplices, 0.0)


HEIGHTS = np.array([0.15, 0.5, 0.3, 0.6, 0.2])  # of points on a line, in the wrong order
ACROSS = 0.3 + 1e-6 * np.arange(5)
CUTS = {
    "needles": template([[1 - 2e-6, 1e-6, 1e-6]]),
    "caps": template([[0.5 - 5e-7, 0.5 - 5e-7, 1e-6]]),
    "slivers": template(np.stack([1 - ACROSS - HEIGHTS, ACROSS, HEIGHTS], axis=1).tolist(), 1e6),
}


def made() -> Iterator[Case]:
    """Shapes whose distance is known, crossed by curves."""
    for jitter, name in (0.0, "square"), (0.35, "jittered square"):
        mesh = sheet(40, 40, lambda u, v: (2 * u - 1, 2 * v - 1, 0 * u), jitter)
        yield Case(name, mesh, values=0.55 - np.linalg.norm(mesh.vertices[:, :2], axis=1))
    mesh = sheet(96, 30, lambda u, v: (np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), 2 * v), around=1)
    yield Case("cylinder", mesh, values=mesh.vertices[:, 2] - 1.03)
    mesh = sphere(4)
    yield Case("sphere", mesh, values=mesh.vertices[:, 2] - 0.3)
    mesh = torus()
    yield Case("torus", mesh, values=mesh.vertices @ [1.0, 0.2, 0.0] - 0.13)
    mesh = sheet(120, 14, moebius, around=-1)
    yield Case("Möbius strip", mesh, values=0.25 - np.linalg.norm(mesh.vertices - [1.0, 0, 0], axis=1))
    page = sheet(24, 24, lambda u, v: (u, 0 * u, v))
    pages = sh.TriangleMesh(*welded([page.vertices @ turn(k * 2 * np.pi / 3) for k in range(3)], page.faces))
    away, first = np.linalg.norm(pages.vertices[:, :2], axis=1), pages.vertices[:, 0] > 1e-9
    yield Case("book", pages, values=np.where(first, away, -away) - 0.51)


def sheet(n: int, m: int, shape, jitter: float = 0.0, around: int = 0) -> sh.TriangleMesh:
    """A sheet of n × m quads, each cut in two; its first side joined to its last for ±1, turned over for −1."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    moved = np.random.default_rng(0).uniform(-jitter, jitter, (2, n + 1, m + 1)) / [[[n]], [[m]]]
    u[1:-1, 1:-1] += moved[0, 1:-1, 1:-1]
    v[1:-1, 1:-1] += moved[1, 1:-1, 1:-1]
    ids = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    if around:
        ids[-1] = ids[0, ::around]
    points = np.stack(shape(u.ravel(), v.ravel()), axis=1)[: len(u.ravel()) - (m + 1 if around else 0)]
    return sh.TriangleMesh(points, cut_quads(ids))


def moebius(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    half, width = np.pi * u, 0.8 * v - 0.4
    radius = 1 + width * np.sin(half)
    return radius * np.cos(2 * half), radius * np.sin(2 * half), width * np.cos(half)


def turn(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def welded(parts: list[np.ndarray], faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parts with the same faces as one mesh, vertices at the same place joined."""
    points = np.concatenate(parts)
    _, kept, number = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    return points[kept], number.ravel()[np.concatenate([faces + k * len(parts[0]) for k in range(len(parts))])]


def read(folder: Path) -> Iterator[Case]:
    """The meshes of a folder, loose triangles left out."""
    for file in sorted(folder.glob("*.obj")):
        mesh = sh.read(file)
        if mesh.n_vertices == 3 * mesh.n_faces:
            continue
        described = file.with_suffix(".json")
        if described.exists():
            curves = sh.io.read_curves(described, mesh)
            ids = [mesh.faces[c.faces, c.barycentric.argmax(axis=1)] for c in curves]
            yield Case(file.stem, mesh, tuple((i, c.closed) for i, c in zip(ids, curves, strict=True)))
        else:
            yield Case(file.stem, mesh, values=mesh.vertices[:, 2] - 0.3 * mesh.vertices[:, 2].max())


def reference(case: Case) -> tuple[np.ndarray, str]:
    """φ at the vertices of a case, and how it is known."""
    once = case.split()
    fine = once.split()
    solved = sh.SignedHeatSolver(sh.intrinsic_delaunay(fine.mesh)).distance(fine.curves()).restrict().values
    if case.values is None:
        values = solved[: once.mesh.n_vertices].copy()
        values[np.concatenate([ids for ids, _ in once.paths])] = 0.0
        case_with_line = replace(once, paths=(), values=values)
    else:
        case_with_line = case
    n = case.mesh.n_vertices
    away, solved = away_from_zero(case_with_line)[:n], solved[:n]
    bounds = np.sqrt(np.nanmean((away - np.abs(solved)) ** 2)) < 0.03 * np.ptp(solved[np.isfinite(solved)])
    return (np.copysign(away, solved), "exact") if bounds else (solved, "fine mesh")


def away_from_zero(case: Case) -> np.ndarray:
    """Distance along the surface from the line where the case's values are zero."""
    triangles = sh.SignedHeatSolver(case.mesh, intrinsic=False).discretization.triangles
    return distance_to_zero_line(triangles, case.values, 0.0)[0]


def accuracy(cases: Iterator[Case]) -> None:
    print(f"{'':>48}{'ε':^36}{'seconds':^23}{'below 20°':^17}{'above 130°':^17}")
    columns = ["as it is", "flips", "refined", "gain"], ["as it is", "making", "solving"]
    print(
        f"{'surface':22} {'':7} {'faces':>6}  {'known by':9}",
        *(f"{c:>8}" for c in columns[0]),
        *(f"{c:>8}" for c in columns[1]),
    )
    for case in cases:
        expected, known = reference(case)
        areas = np.bincount(case.mesh.faces.ravel(), np.repeat(case.mesh.face_areas, 3), case.mesh.n_vertices)
        for kind in ("as it is", *CUTS):
            cut = case if kind == "as it is" else case.cut(kind)
            print(f"{case.name:22} {kind:8} {cut.mesh.n_faces:6d} {known:9}", compare(cut, expected, areas), flush=True)


def compare(case: Case, expected: np.ndarray, areas: np.ndarray) -> str:
    """ε and seconds, as it is and on intrinsic triangulations, and the share of small and of large angles."""
    curves = case.curves()
    flipped = sh.intrinsic_delaunay(case.mesh, keep=curves)
    refined, making = timed(lambda: sh.intrinsic_delaunay(case.mesh, keep=curves, refine=True))
    errors, seconds = [], []
    for domain in (case.mesh, flipped, refined):
        phi, taken = timed(lambda domain=domain: sh.SignedHeatSolver(domain, intrinsic=False).distance(curves))
        squares = (phi.values[: len(expected)] - np.where(np.isfinite(expected), expected, np.nan)) ** 2
        known = np.isfinite(squares) & (areas > 0)
        errors.append(np.sqrt(areas[known] @ squares[known] / areas[known].sum()) / np.ptp(expected[known]))
        seconds.append(taken)
    before, after = angles_of(refined)
    shares = [
        f"{np.mean(before < 20):6.1%} →{np.mean(after < 20):6.1%}",
        f"{np.mean(before > 130):6.1%} →{np.mean(after > 130):6.1%}",
    ]
    cells = [f"{e:8.5f}" for e in errors] + [f"{min(errors[0] / errors[2], 9999):8.1f}"]
    return " ".join([*cells, *(f"{s:8.2f}" for s in (seconds[0], making, seconds[2])), "  ", *shares])


def angles_of(better: sh.IntrinsicTriangulation) -> tuple[np.ndarray, np.ndarray]:
    """Degrees, in the mesh and in its intrinsic triangulation."""
    return np.degrees(np.arctan2(1, better.base.corner_cotangents)), np.degrees(better.corner_angles)


def timed(action):
    begin = time.perf_counter()
    result = action()
    return result, time.perf_counter() - begin


def picture(file: Path) -> None:
    """A sheet cut in the three ways, its intrinsic triangulation, and the angles of both."""
    from matplotlib.figure import Figure

    mesh = sheet(4, 4, lambda u, v: (u, v, 0 * u), 0.35)
    sound = Case("sheet", mesh, values=0.3 - np.linalg.norm(mesh.vertices[:, :2] - 0.45, axis=1))
    many = sheet(40, 40, lambda u, v: (u, v, 0 * u), 0.35)
    figure = Figure(figsize=(13, 8), layout="constrained")
    axes = figure.subplots(2, len(CUTS))
    for column, kind in enumerate(CUTS):
        cut = sound.cut(kind)
        above, below = axes[:, column]
        better = sh.intrinsic_delaunay(cut.mesh, keep=cut.curves(), refine=True)
        owners, starts, ends = better.edge_lines()
        for start, end, owner in zip(starts, ends, owners, strict=True):
            color, width = ("tab:red", 2.0) if better.marked[owner] else ("tab:blue", 0.8)
            above.plot(*np.stack([start, end])[:, :2].T, color=color, linewidth=width)
        above.triplot(*cut.mesh.vertices[:, :2].T, cut.mesh.faces, color="0.75", linewidth=2.5, zorder=0)
        above.set(aspect="equal", title=kind)
        above.set_axis_off()
        before, after = angles_of(sh.intrinsic_delaunay(Case("sheet", many).cut(kind).mesh, refine=True))
        bins = np.linspace(0, 180, 61)
        below.hist(before.ravel(), bins, density=True, color="0.75", label="before")
        below.hist(after.ravel(), bins, density=True, histtype="step", color="tab:blue", linewidth=2, label="after")
        below.set(xlabel="angles in degrees", xlim=(0, 180), yscale="log", ylim=(1e-5, 1))
        below.legend()
    figure.savefig(file, dpi=80)


def growth() -> None:
    print(f"{'faces':>9} {'flips':>9} {'seconds':>8} {'refined':>9} {'seconds':>8} {'smallest angle':>22}")
    for level in (4, 6, 7, 8):
        ball = sphere(level)
        mesh = sh.TriangleMesh(ball.vertices * [4, 1, 1], ball.faces)
        _ = mesh.edge_lengths
        flipped, one = timed(lambda mesh=mesh: sh.intrinsic_delaunay(mesh))
        refined, two = timed(lambda mesh=mesh: sh.intrinsic_delaunay(mesh, refine=True))
        angles = [angles_of(refined)[0].min(), *(np.degrees(t.corner_angles.min()) for t in (flipped, refined))]
        print(
            f"{mesh.n_faces:9d} {len(flipped.history.steps):9d} {one:8.2f} {refined.n_faces:9d} {two:8.2f} "
            + " → ".join(f"{a:5.2f}°" for a in angles)
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--growth", action="store_true", help="measure time and size of ever larger meshes instead")
    parser.add_argument("--picture", type=Path, help="draw the three ways to cut a face, and angles, instead")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", sh.errors.UnreachedWarning)  # parts that holes cut off
    if arguments.picture:
        picture(arguments.picture)
    elif arguments.growth:
        growth()
    else:
        accuracy(made() if arguments.folder is None else read(arguments.folder))
