"""Drawings of other programs: geometries of shapely and GeoJSON, DXF files."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused

shapely = pytest.importorskip("shapely")
PLATE = shapely.Polygon([(0, 0), (10, 0), (10, 5), (0, 5)], [[(2, 2), (3, 2), (3, 3), (2, 3)]])
PLACES = np.array([[5, 4], [-1, 2.5], [2.5, 2.5], [22, 1]])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kind", ["shapely", "list", "multi", "collection", "geojson", "interface"])
def test_polygons_keep_their_holes_whichever_way_their_rings_run(kind, turned):
    plate, other = PLATE, shapely.box(20, 0, 24, 5)
    if turned:
        plate = shapely.Polygon(PLATE.exterior.coords[::-1], [ring.coords[:] for ring in PLATE.interiors])

    class Place:
        __geo_interface__ = shapely.geometry.mapping(shapely.MultiPolygon([plate, other]))

    given = {
        "shapely": shapely.union(plate, other),
        "list": [plate, other],
        "multi": shapely.MultiPolygon([plate, other]),
        "collection": shapely.GeometryCollection([plate, other]),
        "geojson": {"type": "Feature", "properties": {}, "geometry": Place.__geo_interface__},
        "interface": Place(),
    }[kind]
    field = sh.signed_distance(given, resolution=32)
    np.testing.assert_allclose(field(PLACES), [-1, 1, 0.5, -1], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_distance_to_random_polygons_is_that_of_shapely(seed):
    random = np.random.default_rng(seed)
    discs = [shapely.Point(*random.uniform(-1, 1, 2)).buffer(random.uniform(0.1, 0.5), quad_segs=3) for _ in range(12)]
    region = shapely.union_all(discs[:8]) - shapely.union_all(discs[8:])
    points = random.uniform(-2, 2, (300, 2))
    dots = shapely.points(points)
    exact = shapely.distance(dots, region.boundary) * np.where(shapely.contains(region, dots), -1, 1)
    field = sh.signed_distance(region, resolution=128)
    np.testing.assert_allclose(field(points), exact, atol=1e-9)
    back = sh.to_shapely(field.offset(0.05))
    assert back.symmetric_difference(region.buffer(0.05, quad_segs=32)).area < 0.06 * region.area


def test_lines_and_outlines_go_back():
    outer = sh.Polyline([[0, 0], [4, 0], [4, 4], [0, 4]], closed=True)
    hole, line = sh.Polyline([[1, 1], [2, 1], [2, 2], [1, 2]], closed=True), sh.Polyline([[5, 0], [6, 1]])
    region = sh.to_shapely([outer, hole])
    assert isinstance(region, shapely.Polygon) and len(region.interiors) == 1 and region.area == 15
    assert sh.to_shapely(line).equals(shapely.LineString([(5, 0), (6, 1)]))
    assert sh.to_shapely([outer, line]).length == pytest.approx(16 + 2**0.5)


def test_points_are_no_lines():
    with refused(sh.errors.UnsupportedTypeError, "Point"):
        sh.signed_distance(shapely.Point(0, 0))
    with refused(sh.errors.GeometryError):
        sh.signed_distance(shapely.Polygon())
    features = [{"type": "Feature", "geometry": part} for part in (None, shapely.geometry.mapping(PLATE))]
    features += [{"type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": [[0, 0]]}}]
    with refused(sh.errors.UnsupportedTypeError, "feature 2"):
        sh.signed_distance({"type": "FeatureCollection", "features": features})


def test_geojson_files(tmp_path):
    (tmp_path / "plate.geojson").write_text(json.dumps(shapely.geometry.mapping(PLATE)))
    lines = sh.io.read_polylines(tmp_path / "plate.geojson")
    assert [line.closed for line in lines] == [True, True]
    assert sh.to_shapely(lines).equals(PLATE)
    for text in ("{", '{"a": 1}', "[1]", '{"type": "Polygon", "coordinates": [[[0, "x"], [1, 2], [3, 4]]]}'):
        (tmp_path / "bad.geojson").write_text(text)
        with pytest.raises(sh.SignedHeatError):
            sh.io.read_polylines(tmp_path / "bad.geojson")


def test_dxf_files(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    space = document.modelspace()
    for begin, end in (((0, 0), (10, 0)), ((10, 6), (10, 0)), ((10, 6), (0, 6)), ((0, 0), (0, 6))):
        space.add_line(begin, end)  # the sides of a plate, either way
    space.add_circle((5, 3), 1)
    document.blocks.new("slot").add_lwpolyline([(0, 0), (1, 0), (1, 1)], close=True)
    space.add_blockref("slot", (1, 1))
    space.add_line((12, 0), (13, 1))
    space.add_text("no line")
    document.saveas(tmp_path / "plate.dxf")
    lines = sh.io.read_polylines(tmp_path / "plate.dxf")
    assert [line.closed for line in lines] == [True, True, True, False]
    assert sh.to_shapely(lines[:3]).area == pytest.approx(60 - np.pi - 0.5, abs=0.05)
    field = sh.signed_distance(lines[:3], resolution=32)
    np.testing.assert_allclose(field([[5, 3], [3, 3], [1.8, 1.3]]), [1, -1, 0.2], atol=0.02)
    (tmp_path / "bad.dxf").write_text("0\nSECTION\n2\nHEADER\n")
    with pytest.raises(sh.SignedHeatError):
        sh.io.read_polylines(tmp_path / "bad.dxf")
