"""Every kind of domain holding the same thing, a unit ball with a source of known distance, for one list of cases.

On surfaces the source is a circle on the sphere, in space a sphere; both are broken, turned round, moved and scaled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import signedheat as sh
from shapes import domain_cases as cases
from shapes import tet_cases

TILT = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])
APART = 4.0
TURN = np.eye(3)[[1, 2, 0]]
"""x, y, z → y, z, x: what grids bear, too."""
BALL = tet_cases.sphere(4)


@dataclass(frozen=True)
class Kind:
    """One kind of domain.

    Attributes
    ----------
    make : callable
        The domain around so many unit balls, `APART` along x.
    moved : callable
        The domain turned by `TURN`, scaled and shifted.
    mixed : callable, optional
        The domain with its vertices and cells in another order, and the order of the vertices.
    deviation : float
        By how much φ may depend on which axis is which: few sweeps leave a tenth of a cell.
    """

    make: Callable[[int], object]
    moved: Callable[[object, float, np.ndarray], object]
    mixed: Callable[[object, np.random.Generator], tuple[object, np.ndarray]] | None = None
    deviation: float = 1e-4


class Surface(Kind):
    """Circles on the unit sphere; distance grows along `TILT`."""

    def exact(self, domain, height=0.3):
        points = positions(domain)
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        return np.arcsin(np.clip(unit @ TILT, -1, 1)) - np.arcsin(height)

    def levels(self, *heights):
        return [float(np.arcsin(height) - np.arcsin(heights[0])) for height in heights]

    def source(self, domain, height=0.3):
        return domain.level_set(np.where(positions(domain)[:, 0] < 2, self.exact(domain, height), np.nan))

    def reversed(self, sources):
        return [curve.reversed() for curve in sources]

    def broken(self, domain):
        (whole,) = self.source(domain)
        n = whole.n_points
        parts = [slice(0, int(0.3 * n)), slice(int(0.42 * n), int(0.6 * n)), slice(int(0.7 * n), int(0.95 * n))]
        return [sh.Curve(whole.faces[p], whole.barycentric[p]) for p in parts]

    def source_moved(self, domain, scale, shift):
        back = (positions(domain) - shift) / scale @ TURN
        return domain.level_set(np.arcsin(back @ TILT / np.linalg.norm(back, axis=1)) - np.arcsin(0.3))


class Space(Kind):
    """Spheres around the origin."""

    def exact(self, domain, height=0.3):
        return np.linalg.norm(positions(domain), axis=1) - 0.7 - height

    def levels(self, *heights):
        return [height - heights[0] for height in heights]

    def source(self, domain, height=0.3):
        return [sh.TriangleMesh((0.7 + height) * BALL.vertices, BALL.faces)]

    def reversed(self, sources):
        return [sh.TriangleMesh(shape.vertices, shape.faces[:, ::-1]) for shape in sources]

    def broken(self, domain):
        keep = np.random.default_rng(0).random(BALL.n_faces) > 0.3
        return [sh.TriangleMesh(BALL.vertices, BALL.faces[keep])]

    def source_moved(self, domain, scale, shift):
        return [moved_mesh(shape, scale, shift) for shape in self.source(domain)]


def positions(domain):
    """(n, 3) of the values of a field."""
    if isinstance(domain, sh.Grid):
        return domain.points.reshape(-1, 3)
    return domain.points if isinstance(domain, sh.PointCloud) else domain.vertices


def copies(vertices, cells, n_copies):
    """Vertices and cells, several times."""
    n = len(vertices)
    vertices = np.concatenate([np.add(vertices, [APART * k, 0, 0]) for k in range(n_copies)])
    return vertices, [[int(i) + k * n for i in cell] for k in range(n_copies) for cell in cells]


def triangle_balls(n):
    vertices, polygons = cases.globe(24)
    triangles = [t for p in polygons for t in ([p[0], p[1], p[2]], [p[0], *p[2:]]) if len(t) == 3]
    return sh.TriangleMesh(*copies(vertices, triangles, n))


def polygon_balls(n):
    return sh.PolygonMesh(*copies(*cases.globe(24), n))


def cloud_of_balls(n):
    return sh.PointCloud(copies(cases.sphere_points(1200), [], n)[0])


def voxels_of_balls(n):
    spacing = 4 / 48
    volume = np.linalg.norm(lattice_of_voxels(spacing), axis=-1) < 1
    return sh.DigitalSurface(np.concatenate([volume] * n), spacing, lattice_of_voxels(spacing)[0, 0, 0])


def lattice_of_voxels(spacing):
    """Centres of voxels that fill a box of 4 along x, off the middle."""
    first = spacing * (0.5 + np.array([0.13, 0.07, 0.21])) - [2.0, 1.2, 1.2]
    return first + spacing * np.stack(np.indices((48, 29, 29)), axis=-1)


def tets_around_balls(n):
    mesh = tet_cases.boxes((12, 12, 12), 3.2 / 12, jitter=0.15)
    return sh.TetMesh(*copies(mesh.vertices - 1.6, mesh.tets, n))


def grid_around_balls(n):
    return sh.Grid((-1.6, -1.6, -1.6), 0.1, (33 + 40 * (n - 1), 33, 33))


def moved_mesh(domain, scale, shift):
    cells = {sh.TriangleMesh: "faces", sh.PolygonMesh: "polygons", sh.TetMesh: "tets"}[type(domain)]
    return type(domain)(scale * domain.vertices @ TURN.T + shift, getattr(domain, cells))


def moved_points(domain, scale, shift):
    return sh.PointCloud(scale * domain.points @ TURN.T + shift)


def moved_voxels(domain, scale, shift):
    spacing = scale * domain.spacing
    return sh.DigitalSurface(np.moveaxis(domain.volume, 0, 2), spacing, scale * domain.origin @ TURN.T + shift)


def moved_grid(domain, scale, shift):
    shape = (*domain.shape[1:], domain.shape[0])
    return sh.Grid(scale * domain.origin @ TURN.T + shift, scale * domain.spacing, shape)


def mixed_mesh(domain, rng):
    name = {sh.TriangleMesh: "faces", sh.PolygonMesh: "polygons", sh.TetMesh: "tets"}[type(domain)]
    cells, order = list(getattr(domain, name)), rng.permutation(len(domain.vertices))
    new = np.argsort(order)
    turned = [new[np.roll(cells[k], 2 if name == "tets" else 1)].tolist() for k in rng.permutation(len(cells))]
    return type(domain)(domain.vertices[order], turned), order


def mixed_points(domain, rng):
    order = rng.permutation(len(domain.points))
    return sh.PointCloud(domain.points[order]), order


KINDS = {
    "triangles": Surface(triangle_balls, moved_mesh, mixed_mesh),
    "polygons": Surface(polygon_balls, moved_mesh, mixed_mesh),
    "points": Surface(cloud_of_balls, moved_points, mixed_points),
    "voxels": Surface(voxels_of_balls, moved_voxels),
    "tets": Space(tets_around_balls, moved_mesh, mixed_mesh),
    "grid": Space(grid_around_balls, moved_grid, deviation=0.015),
}
