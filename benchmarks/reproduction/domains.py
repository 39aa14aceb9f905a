"""Figures on other surfaces: polygons, points, voxels, nonmanifold and nonorientable meshes."""

from __future__ import annotations

import numpy as np

import signedheat as sh
from shapes.triangulated import angles, cut_quads, moebius
from signedheat import samples
from signedheat.view import draw_surface, new_figure

from . import baselines
from .pages import Page, figure


@figure("16", "Polygon meshes, point clouds, digital surfaces")
def other_surfaces(page: Page) -> None:
    """A circle of latitude on a sphere of polygons, points and voxels, against arc length; sharpened where sharpening
    exists.
    """
    from shapes import domain_cases as cases

    vertices, polygons = cases.globe(36)
    globe = sh.PolygonMesh(vertices, polygons)
    ball = samples.sphere(4)
    cloud = samples.oriented_points(ball, 4000)
    cloud = sh.PointCloud(cloud.points / np.linalg.norm(cloud.points, axis=1, keepdims=True), cloud.points)
    side = np.linspace(-1.2, 1.2, 49)
    x, y, z = np.meshgrid(side, side, side, indexing="ij")
    voxels = sh.DigitalSurface(x * x + y * y + z * z < 1, spacing=side[1] - side[0], origin=(-1.2, -1.2, -1.2))
    picture = new_figure(15, 4.6)
    angle = -np.linspace(0, 2 * np.pi, 90, endpoint=False)
    height = 0.4
    ring = np.sqrt(1 - height**2) * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + [0, 0, height]
    for k, (name, domain) in enumerate({"polygons": globe, "points": cloud, "voxels": voxels}.items()):
        curve = domain.polyline(ring, closed=True, max_distance=0.2)
        field = sh.SignedHeatSolver(domain, 1.0).distance(curve)
        positions = domain.points if name == "points" else domain.vertices
        unit = positions / np.linalg.norm(positions, axis=1, keepdims=True)
        exact = np.arcsin(height) - np.arcsin(np.clip(unit[:, 2], -1, 1))
        values = field.values * np.sign(np.nanmedian(field.values * exact))
        page.add(domain=name, unknowns=len(values), **{"ε %": baselines.error(values, exact)})
        axes = picture.add_subplot(1, 3, k + 1)
        draw_surface(field, axes, [curve], view=np.array([0.4, -0.8, 0.6]))
        axes.set_title(name)
    page.draw(picture)


@figure("23", "Robust domains")
def robust_domains(page: Page) -> None:
    """Three sheets that meet along a line, a Möbius strip, and a sphere without a quarter of its faces; ε against
    closed forms in the unbroken domain. On the strip φ jumps once, and Eq. 16 alone has 0.078 %.
    """
    picture = new_figure(15, 4.6)
    for k, (name, mesh, curve, exact, view) in enumerate((_book(), _moebius(), _sieve())):
        if name == "Möbius strip":
            field = sh.piecewise_distance(curve, mesh).expand()
            corners = mesh.faces.ravel()
            given = field.values[field.domain.faces].ravel()
            values = np.bincount(corners, given) / np.bincount(corners)
        else:
            field = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve)
            values = field.values
        known = np.isfinite(exact)
        values = values * np.sign(np.nanmedian((values * exact)[known]))
        page.add(
            domain=name,
            faces=mesh.n_faces,
            **{"edges with ≠ 2 faces": int((mesh.edges.face_counts != 2).sum())},
            **{"ε %": baselines.error(values, exact)},
        )
        axes = picture.add_subplot(1, 3, k + 1)
        draw_surface(field, axes, [curve], view=np.array(view))
        axes.set_title(name)
    page.draw(picture)


def _sheet(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A jittered unit square, with n vertices along each side, and its triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(-1, 1, 2 * n - 1), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1), cut_quads(np.arange(x.size).reshape(x.shape))


def _book() -> tuple[str, sh.TriangleMesh, sh.Curve, np.ndarray, list[float]]:
    """Three pages joined at the spine x = 0; the curve runs along one page at x = 0.3."""
    points, faces = _sheet(31)
    spine = points[:, 0] == 0
    vertices, listed, exact, start = [], [], [], 0
    for page, angle in enumerate((0.3, 2.4, 4.4)):
        ids = np.full(len(points), -1)
        new = np.ones(len(points), dtype=bool) if page == 0 else ~spine
        ids[new] = start + np.arange(new.sum())
        if page:
            ids[spine] = np.flatnonzero(spine)
        vertices.append(np.stack([points[:, 0] * np.cos(angle), points[:, 1], points[:, 0] * np.sin(angle)], 1)[new])
        exact.append((points[:, 0] - 0.3 if page == 0 else -points[:, 0] - 0.3)[new])
        listed.append(ids[faces])
        start += int(new.sum())
    mesh = sh.TriangleMesh(np.concatenate(vertices), np.concatenate(listed))
    across = np.linspace(-1, 1, 40)
    line = np.stack([np.full(40, 0.3 * np.cos(0.3)), across, np.full(40, 0.3 * np.sin(0.3))], axis=1)
    return "three pages", mesh, mesh.polyline(line), np.concatenate(exact), [0.8, -1.6, 0.9]


def _moebius() -> tuple[str, sh.TriangleMesh, sh.Curve, np.ndarray, list[float]]:
    """A Möbius strip; the curve crosses it once, so that distance is along the strip; known near the curve only."""
    n, m = 180, 12
    mesh = moebius(n, m, 0.35)
    curve = mesh.path(n // 2 * (m + 1) + np.arange(m + 1))
    middle = np.full((n, m + 1), np.nan)
    middle[:, m // 2] = angles(n) - np.pi
    middle = middle.ravel()
    middle[np.abs(middle) > 0.8] = np.nan
    return "Möbius strip", mesh, curve, middle, [-0.5, -1.2, 1.2]


def _sieve() -> tuple[str, sh.TriangleMesh, sh.Curve, np.ndarray, list[float]]:
    """A fine sphere without a random quarter of its faces; the curve is the equator."""
    whole = samples.sphere(5)
    z = whole.vertices[:, 2]
    holed = samples.without_faces(whole, 0.25, seed=3)
    curves = [part for part in holed.level_set(z, 0.013) if part.n_points > 1]
    used = np.zeros(holed.n_vertices, dtype=bool)
    used[holed.faces] = True
    exact = np.where(used, np.arcsin(np.clip(z, -1, 1)) - np.arcsin(0.013), np.nan)
    return "a quarter of the faces gone", holed, curves, exact, [0.4, -0.9, 0.5]
