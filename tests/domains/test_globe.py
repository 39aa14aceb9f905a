"""Curves in longitude and latitude: great circles on globes, closed forms of distance."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes import domain_cases as cases
from signedheat import samples
from signedheat.cli import main
from signedheat.domains.globe import directions, great_circles


@pytest.fixture(scope="module")
def globe():
    return samples.sphere(4, radius=6371.0, center=(10.0, -20, 30))


def places(mesh, center=(10.0, -20, 30)):
    away = mesh.vertices - np.array(center)
    return np.degrees(np.arctan2(away[:, 1], away[:, 0])), np.degrees(np.arcsin(away[:, 2] / 6371.0))


def parallel(latitude, step=5):
    return [[longitude, latitude] for longitude in range(-180, 180, step)]


def test_great_circles_are_even_and_lie_in_a_plane():
    start, end = directions([[20, 50], [140, 35]])
    way = great_circles(np.array([start, end]), closed=False, step=0.1)
    normal = np.cross(start, end)
    assert np.abs(way @ normal).max() < 1e-12
    angles = np.arccos(np.clip(np.einsum("ij,ij->i", way[1:], way[:-1]), -1, 1))
    assert np.ptp(angles) < 1e-9 and angles[0] <= 0.1
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1)
    # the way over the north, not along the parallel
    assert np.degrees(np.arcsin(way[:, 2])).max() > 60


def test_distance_to_the_equator_is_the_latitude(globe):
    circle = sh.globe_curve(globe, parallel(0.0), closed=True)
    phi = sh.signed_distance(circle, globe).values
    _, latitude = places(globe)
    # eastwards, north is left; the polyhedron is a little smaller than its sphere
    assert np.abs(phi - np.radians(latitude) * 6371).max() < 0.01 * np.pi / 2 * 6371


def test_a_gap_in_a_coast_is_closed(globe, tmp_path, capsys):
    rows = [f"{x},{y}" for x, y in parallel(40.0)]
    (tmp_path / "coast.csv").write_text("longitude,latitude\n" + "\n".join([*rows[:30], "", *rows[34:]]) + "\n")
    globe.save(tmp_path / "globe.ply")
    output = tmp_path / "phi.npz"
    arguments = [str(tmp_path / "globe.ply"), str(tmp_path / "coast.csv"), "-o", str(output), "--globe"]
    assert main(["surface", *arguments]) == 0
    phi = sh.load_field(output).values
    _, latitude = places(globe)
    far = np.abs(latitude - 40) > 12
    assert ((phi > 0) == (latitude > 40))[far].all()
    assert main(["close", *arguments[:3], str(tmp_path / "whole.json"), "--globe"]) == 0
    curves = sh.io.read_curves(tmp_path / "whole.json", globe)
    assert len(curves) == 1 and curves[0].closed


def test_geojson_land_is_positive_whichever_way_its_rings_run(globe, tmp_path):
    ring = [[-40, -30], [50, -30], [50, 35], [-40, 35], [-40, -30]]
    lake = [[0, 0], [20, 0], [20, 20], [0, 20], [0, 0]]
    for name, polygon in (("left", [ring, lake]), ("right", [ring[::-1], lake[::-1]])):
        feature = {"type": "Feature", "geometry": {"type": "MultiPolygon", "coordinates": [polygon]}}
        text = json.dumps({"type": "FeatureCollection", "features": [feature, {"type": "Feature", "geometry": None}]})
        (tmp_path / f"{name}.geojson").write_text(text)
        curves = sh.io.read_globe_curves(tmp_path / f"{name}.geojson", globe)
        assert [curve.closed for curve in curves] == [True, True]
        phi = sh.SignedHeatSolver(globe).distance(curves).values
        longitude, latitude = places(globe)
        at = [np.argmin(np.hypot(longitude - x, latitude - y)) for x, y in ((-20, -15), (10, 10), (120, 0), (0, -60))]
        assert (phi[at] > 0).tolist() == [True, False, False, False]


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("ring", "inside", "outside"), [
    ([[170, -20], [-160, -20], [-160, 30], [170, 30]], (-175, 0), (0, 0)),  # over the 180th meridian
    ([[x, -60] for x in range(-180, 180, 20)], (40, -80), (40, 0)),  # around the south pole
    ([[x, 50] for x in range(-170, 180, 20)] + [[180, 50], [180, 90], [-180, 90], [-180, 50]], (0, 80), (0, -10)),
])  # fmt: skip
def test_land_over_the_last_meridian_and_around_poles(globe, tmp_path, ring, inside, outside, way):
    ring = ring[::way]
    text = json.dumps({"type": "Polygon", "coordinates": [[*ring, ring[0]]]})
    (tmp_path / "land.geojson").write_text(text)
    phi = sh.SignedHeatSolver(globe).distance(sh.io.read_globe_curves(tmp_path / "land.geojson", globe)).values
    longitude, latitude = places(globe)
    at = [np.argmin(np.hypot(longitude - x, latitude - y)) for x, y in (inside, outside)]
    assert (phi[at] > 0).tolist() == [True, False]


def test_what_is_no_curve_on_a_globe_is_refused(globe, tmp_path):
    for wrong, element in (
        ([[0, 95], [1, 0]], "point 0"),
        ([[0, 0], [400, 0]], "point 1"),
        ([[0, 0], [180, 0]], "point 0"),
        ([[0, 10], [0, 10]], "1 points"),
        ([[0, 0, 0], [1, 1, 1]], "points"),
    ):
        with pytest.raises(sh.errors.SourceError) as caught:
            sh.globe_curve(globe, wrong)
        assert caught.value.element == element
    with pytest.raises(sh.errors.SourceError):
        sh.globe_curve(samples.torus(n_around=12, n_across=6), [[0, 0], [10, 0]])
    for name, text in (("a.geojson", "[1, 2]"), ("b.geojson", '{"type": "Point"}'), ("c.geojson", "{"), ("d.svg", "x")):
        (tmp_path / name).write_text(text)
        with pytest.raises(sh.errors.FileFormatError) as caught:
            sh.io.read_globe_curves(tmp_path / name, globe)
        assert caught.value.path == str(tmp_path / name)
    west_is_east = sh.globe_curve(globe, [[170, 0], [180, 0], [-180, 0], [-170, 0]])
    assert len(west_is_east.faces) > 2


def test_a_globe_may_be_of_quadrangles_and_of_another_package():
    quads = sh.PolygonMesh(*cases.globe(18))
    curve = sh.globe_curve(quads, parallel(0.0), closed=True)
    phi = sh.signed_distance(curve, quads).values
    latitude = np.arcsin(np.clip(quads.vertices[:, 2], -1, 1))
    assert np.abs(phi - latitude).max() < 0.02 * np.pi / 2  # chords are shorter than arcs by (5°)² / 6, and less
    triangles = samples.sphere(3)
    given = sh.globe_curve(triangles.to_trimesh(), parallel(30.0), closed=True)
    assert np.array_equal(given.barycentric, sh.globe_curve(triangles, parallel(30.0), closed=True).barycentric)
    for no_mesh in (samples.oriented_points(triangles, 50), sh.Grid((0, 0, 0), 1.0, (3, 3, 3))):
        with refused(sh.errors.UnsupportedTypeError, "mesh"):
            sh.globe_curve(no_mesh, parallel(0.0))


def test_curves_are_written_in_longitude_and_latitude(tmp_path):
    globe = samples.sphere(4, 6371.0, (10.0, 20.0, 30.0))
    open_one = sh.globe_curve(globe, [[170, 10], [-170, 40], [-120, 60]])
    ring = sh.globe_curve(globe, [[0, 30], [120, 30], [240, 30]], closed=True)
    sh.io.write_curves(tmp_path / "curves.geojson", [open_one, ring], globe)
    back = sh.io.read_globe_curves(tmp_path / "curves.geojson", globe)
    assert [curve.closed for curve in back] == [False, True]
    for one, other in zip((open_one, ring), back, strict=True):
        ends = globe.positions(one)[[0, -1]], globe.positions(other)[[0, -1]]
        np.testing.assert_allclose(*ends, atol=60.0)  # the mesh lies up to 20 under the globe
    field = sh.signed_distance(back[1], globe)
    assert np.abs(field(ring)).max() < 60.0
    with refused(sh.errors.SourceError):
        torus = samples.torus(n_around=12, n_across=6)
        sh.io.write_curves(tmp_path / "torus.geojson", [torus.path([0, 1, 2])], torus)
