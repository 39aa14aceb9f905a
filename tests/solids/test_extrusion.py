"""Sheets and outlines extruded to a plane: volumes in closed form, closed meshes, and what is refused."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.morphology import extrude


def terrain(n=20):
    x, y = np.meshgrid(np.linspace(0, 3, n), np.linspace(0, 2, n), indexing="ij")
    z = 1 + 0.3 * np.sin(3 * x) * np.cos(4 * y)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = [
        np.stack([corner, corner + n, corner + n + 1], axis=1),
        np.stack([corner, corner + n + 1, corner + 1], axis=1),
    ]
    return sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), np.concatenate(faces))


def volume_above(mesh, height):
    corners = mesh.vertices[mesh.faces]
    flat = corners[..., :2]
    areas = 0.5 * np.abs(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]))
    return float((areas * np.abs(corners[..., 2].mean(axis=1) - height)).sum())


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
@pytest.mark.parametrize("height", [-0.5, 2.0])
def test_terrain_gets_walls_and_a_base_below_or_above(height):
    sheet = terrain()
    turned = np.random.default_rng(0).random(sheet.n_faces) < 0.3
    mixed = sh.TriangleMesh(sheet.vertices, np.where(turned[:, None], sheet.faces[:, ::-1], sheet.faces))
    for shape in (sheet, mixed):
        block = extrude(shape, height)
        assert block.to_trimesh().is_watertight
        assert block.volume == pytest.approx(volume_above(sheet, height), rel=1e-12)
        assert sh.complete(block).volume == pytest.approx(block.volume, rel=1e-12)
    assert {tuple(v) for v in sheet.vertices} <= {tuple(v) for v in block.vertices}


@pytest.mark.parametrize("place", [0.0, 5e5])
def test_polygons_with_holes(place):
    outer = np.array([[0, 0], [4, 0], [4, 3], [0, 3]]) + place
    hole = np.array([[1, 1], [2, 1], [2, 2], [1, 2]]) + place
    apart = np.array([[6, 0], [7, 0], [6.5, 2]]) + place
    lines = [sh.Polyline(points, closed=True) for points in (outer, hole[::-1], apart)]
    prism = extrude(lines, -2.0)
    assert prism.to_trimesh().is_watertight
    assert prism.volume == pytest.approx(2 * (12 - 1 + 1), rel=1e-9)
    assert prism.bounds[:, 2].tolist() == [-2, 0]


def test_an_extruded_polygon_of_shapely():
    shapely = pytest.importorskip("shapely")
    ring = shapely.Point(0, 0).buffer(1.0).difference(shapely.Point(0, 0).buffer(0.5))
    assert extrude(ring, 3.0).volume == pytest.approx(3 * ring.area, rel=1e-9)


def test_what_is_refused():
    with refused(sh.errors.GeometryError, element="to"):
        extrude(terrain(), 1.0)
    with refused(sh.errors.GeometryError, element="shape"):
        extrude(samples.sphere(2), -2.0)
    with refused(sh.errors.GeometryError, element="polyline 0"):
        extrude(sh.Polyline([[0, 0], [1, 0], [1, 1]]), 1.0)
    with refused(sh.errors.GeometryError):
        extrude(sh.PointCloud(samples.sphere(2).vertices), -2.0)
    with refused(sh.SignedHeatError, element="to"):
        extrude(terrain(), np.nan)
