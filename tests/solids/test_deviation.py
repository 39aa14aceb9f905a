"""Deviations of scans from nominal parts."""

import json
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples
from signedheat.cli import main
from signedheat.io.ply import read_ply


def test_of_a_box_that_is_too_high_and_shifted():
    part = box((-1, -1, -1), (1, 1, 1))
    scan = box((-1, -1, -1), (1, 1, 1.25))
    points = np.array([[0, 0, 1.25], [0, 0, 0.5], [1.5, 0, 0], [0.0, 0.25, -1]])
    np.testing.assert_allclose(sh.deviation(points, part).distances, [0.25, -0.5, 0.5, 0.0], atol=1e-12)
    found = sh.deviation(scan, sh.complete(part))
    np.testing.assert_allclose(np.sort(found.distances), np.repeat([0, 0.25], 4), atol=1e-12)
    assert found.within(0.1) == 0.5 and found.percentiles((50,)) == pytest.approx(0.125)
    assert found.rms == pytest.approx(0.25 / np.sqrt(2))
    assert found.histogram()[0].sum() == 8


def test_turned_faces_of_scan_and_part_do_not_matter():
    part, scan = samples.sphere(3), samples.sphere(2, 1.1)
    exact = sh.deviation(scan, part).distances
    broken = samples.with_flipped_faces(part, 0.3, seed=1)
    np.testing.assert_array_equal(sh.deviation(samples.with_flipped_faces(scan, 0.5), broken).distances, exact)


@pytest.mark.parametrize("kind", [sh.TriangleMesh, sh.PolygonMesh])
def test_vertices_that_no_face_uses_were_not_scanned(kind):
    ball, nominal = samples.sphere(2, 1.1), samples.sphere(3)
    stray = kind(np.vstack([[[9.0, 9.0, 9.0]], ball.vertices]), ball.faces + 1)
    found = sh.deviation(stray, nominal)
    alone = sh.deviation(ball, nominal)
    np.testing.assert_array_equal(found.distances[1:], alone.distances)
    assert len(found.distances) == len(stray.vertices)
    assert found.rms == alone.rms and found.extreme == alone.extreme and found.within(0.2) == 1
    np.testing.assert_array_equal(found.percentiles(), alone.percentiles())
    assert found.histogram()[0].sum() == found.figures["points"] == ball.n_vertices
    sheet = sh.deviation(stray, sh.TriangleMesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0.0]], [[0, 1, 2]]))
    assert sheet.figures["beyond_rim"] == sheet.beyond_rim[1:].mean() != sheet.beyond_rim.mean()


def test_places_on_completion_are_marked():
    half = samples.sphere(3)
    half = sh.TriangleMesh(half.vertices, half.faces[half.vertices[half.faces].mean(axis=1)[:, 2] < 0.8])
    found = sh.deviation(np.array([[0, 0, 1.5], [0, 0, -1.5]]), half)
    assert found.completed.tolist() == [True, False]
    assert found.figures["on_completion"] == 0.5


@pytest.mark.parametrize("scan", [samples.sphere(2, 1.1), samples.oriented_points(samples.sphere(2, 0.9), 300)])
def test_files(tmp_path, scan):
    found = sh.deviation(scan, samples.sphere(3))
    for kind in ("ply", "png", "csv"):
        found.save(tmp_path / f"out.{kind}")
    np.testing.assert_array_equal(read_ply(tmp_path / "out.ply", ("deviation",)).values["deviation"], found.distances)
    assert {"red", "green", "blue"} <= set((tmp_path / "out.ply").read_bytes()[:400].decode("latin1").split())
    table = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack([found.points, found.distances, found.nearest]), atol=1e-8)
    assert matplotlib.image.imread(tmp_path / "out.png")[..., :3].std() > 0.05
    with refused(sh.errors.FileFormatError, file="out.stl"):
        found.save(tmp_path / "out.stl")


def test_command(tmp_path, capsys):
    sh.save(samples.sphere(2, 1.1), tmp_path / "scan.stl")
    sh.save(samples.without_faces(samples.sphere(3), 0.1), tmp_path / "part.stl")
    words = ["deviation", str(tmp_path / "scan.stl"), str(tmp_path / "part.stl"), "--tolerance", "0.2"]
    outputs = [str(tmp_path / "deviation.pdf"), str(tmp_path / "deviation.ply")]
    assert main([*words, "--json", "-o", outputs[0], "-o", outputs[1]]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (
        said["within"] == {"0.2": 1.0}
        and said["units"] is None
        and said["percentiles"]["50"] == pytest.approx(0.1, abs=0.02)
    )
    assert said["output"] == outputs and all(Path(each).exists() for each in outputs)
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "within ±0.2: 100 %" and len(lines) == 12 and lines[2].startswith("+0.1")


def test_the_worst_places_are_apart():
    """Two dents and a bump of known depths: each is named once, the deepest first."""
    vertices, faces = terrain(HEIGHTS["panel"], 60)
    scan = vertices.copy()
    for x, y, depth in ((2, 2, -0.3), (8, 3, 0.2), (5, 8, -0.1)):
        scan[:, 2] += depth * np.exp(-(((vertices[:, :2] - [x, y]) ** 2).sum(axis=1)) / 0.1)
    found = sh.deviation(sh.TriangleMesh(scan, faces), (vertices, faces))
    worst = found.worst(3)
    np.testing.assert_allclose(found.points[worst][:, :2], [[2, 2], [8, 3], [5, 8]], atol=0.1)
    np.testing.assert_allclose(found.distances[worst], [-0.3, 0.2, -0.1], rtol=0.1)


def test_files_in_different_units_are_brought_into_one(tmp_path, capsys):
    """A scan in metres, as in GLB, and a part without a unit, in millimetres."""
    box((0, 0, 0), (0.02, 0.02, 0.0101)).to_trimesh().export(tmp_path / "scan.glb")
    sh.save(box((0, 0, 0), (20, 20, 10)), tmp_path / "part.stl")
    words = ["deviation", str(tmp_path / "scan.glb"), str(tmp_path / "part.stl"), "--units", "mm", "--json"]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["units"] == "mm" and said["worst"][0]["deviation"] == pytest.approx(0.1, rel=1e-4)
    assert main(["union", *words[1:3], "-o", str(tmp_path / "both.stl"), "--units", "m:mm"]) == 0
    out = capsys.readouterr().out
    assert "mm³" in out and float(out.split("volume ")[1].split()[0]) == pytest.approx(20_000**2 * 10_000, rel=1e-6)


def terrain(height, n=16):
    """A graph over a square with sides of 10, its normals up."""
    x, y = np.meshgrid(np.linspace(0, 10, n), np.linspace(0, 10, n), indexing="ij")
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = (ids[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    vertices = np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()])
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


HEIGHTS = {
    "panel": lambda x, y: 0 * x,
    "waves": lambda x, y: 0.5 * np.sin(1.5 * x) * np.cos(y),
    "valley": lambda x, y: 0.08 * ((x - 5) ** 2 + (y - 5) ** 2),
    "hill": lambda x, y: -0.08 * ((x - 5) ** 2 + (y - 5) ** 2),
    "tilted facade": lambda x, y: 2 * x + np.where((x > 4) & (x < 6) & (y > 4), -1.0, 0.0),
}


@pytest.mark.parametrize("name", HEIGHTS)
@pytest.mark.parametrize("place", [(0, 0, 0), (431250.5, 5412300.25, 80)])
def test_open_nominals_have_sides(name, place):
    vertices, faces = terrain(HEIGHTS[name])
    turned = faces.copy()
    turned[::5] = turned[::5, ::-1]
    inner = np.flatnonzero((np.abs(vertices[:, :2] - 5) < 4).all(axis=1))
    rise = np.random.default_rng(0).choice([-0.02, 0.02], len(inner))
    points = vertices[inner] + rise[:, None] * [0, 0, 1]
    for part in (faces, turned):
        found = sh.deviation(points + place, (vertices + place, part))
        np.testing.assert_array_equal(np.sign(found.distances), np.sign(rise))
        assert not found.completed.any() and not found.beyond_rim.any()
    opposite = sh.deviation(points, sh.complete((vertices, faces[:, ::-1])))
    np.testing.assert_array_equal(np.sign(opposite.distances), -np.sign(rise))


def test_polygons_and_parts_of_an_assembly_have_sides():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    points = np.array([[0.5, 0.5, 0.1], [0.5, 0.5, -0.1]])
    np.testing.assert_allclose(sh.deviation(points, sh.PolygonMesh(corners, [[0, 1, 2, 3]])).distances, [0.1, -0.1])
    body = box((0, 0, 1), (1, 1, 2))
    both = samples.union(body, sh.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]]))
    found = sh.deviation(np.vstack([points, [[0.5, 0.5, 1.25], [0.5, 0.5, 0.75]]]), both)
    np.testing.assert_allclose(found.distances, [0.1, -0.1, -0.25, 0.25])


def test_solids_of_polygons_have_the_sides_of_the_polygons():
    """Their faces are triangles, numbered otherwise than the polygons."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    ids = np.arange(16).reshape(4, 4)
    quads = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4)
    sheet = np.column_stack([x.ravel(), y.ravel(), 0.1 * x.ravel() ** 2])
    body = box((5, 0, 0), (6, 1, 1))
    part = sh.PolygonMesh(np.concatenate([body.vertices, sheet]), [*body.faces, *(quads + len(body.vertices))])
    points = sheet[ids[1:3, 1:3].ravel()] + np.array([0.0, 0, 0.1]) * np.array([[1], [-1], [-1], [1]])
    distances = sh.deviation(points, part).distances
    np.testing.assert_array_equal(np.sign(distances), [1, -1, -1, 1])
    np.testing.assert_allclose(sh.deviation(points, sh.complete(part)).distances, distances)


def test_faces_given_twice_have_the_sides_of_one():
    vertices, faces = terrain(HEIGHTS["waves"], 12)
    faces[::5] = faces[::5, ::-1]
    points = vertices + np.array([0, 0, 0.1]) * np.random.default_rng(0).choice([-1, 1], (len(vertices), 1))
    once = sh.deviation(points, (vertices, faces))
    for copies in (faces, faces[:1], np.roll(faces, 1, axis=1)):
        twice = sh.deviation(points, (vertices, np.concatenate([faces, copies])))
        np.testing.assert_allclose(twice.distances, once.distances)
        np.testing.assert_array_equal(twice.beyond_rim, once.beyond_rim)


def test_points_beyond_the_rim_say_so():
    vertices, faces = terrain(HEIGHTS["panel"])
    points = np.array([[5, 5, 1], [-1, 5, 1], [11, 11, -1], [0, 5, 1], [0, 0, -1]])
    found = sh.deviation(points, (vertices, faces))
    assert found.beyond_rim.tolist() == [False, True, True, False, False]
    assert found.figures["beyond_rim"] == 0.4
    np.testing.assert_allclose(found.distances, [1, np.sqrt(2), -np.sqrt(3), 1, -1])
