"""``signedheat watertight``, as a user meets it."""

import functools
import json
import shlex

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box, distance_to_box, sheet
from shapes.grid_cases import assert_closed_manifold
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def folder(tmp_path):
    shapes = tmp_path / "in"
    shapes.mkdir()
    plank = box((-1, -0.7, -0.2), (1, 0.6, 0.3))
    sh.TriangleMesh(plank.vertices, plank.faces[1:]).save(shapes / "plank.ply")
    samples.without_patches(samples.sphere(3), 2, 0.4, seed=1).save(shapes / "ball.stl")
    return shapes


def figures(tmp_path, capsys, *arguments):
    main(["watertight", *map(str, arguments), "-o", str(tmp_path / "out"), "--workers", "1", "--json"])
    return json.loads(capsys.readouterr().out)


def test_closed_meshes_and_a_line_for_each(tmp_path, folder, capsys):
    assert main(["watertight", str(folder), "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "plank.stl: 1 body, volume 1.3, 12 faces, 1 opening completed" in printed
    assert printed.count("no self-intersections; faces kept") == 2
    assert "2 of 2 shapes closed" in printed
    assert_closed_manifold(sh.read(tmp_path / "out" / "ball.stl"))


@pytest.mark.usefixtures("in_this_process")
def test_contours_say_how_far_they_are_from_the_faces(tmp_path, folder, capsys):
    options = "--contour", "--spacing", "0.07", "--surface", "ply"
    (found,) = figures(tmp_path, capsys, folder / "plank.ply", *options)["shapes"]
    assert found["output"] == ["plank.ply"] and found["way"] == "contoured"
    assert found["bodies"] == 1 and found["openings"] == 1 and found["self_intersections"] == 0
    assert found["volume"] == pytest.approx(2 * 1.3 * 0.5, rel=1e-3)
    assert found["to_faces"] < 0.07 and found["from_faces"] < 0.07
    assert_closed_manifold(sh.read(tmp_path / "out" / "plank.ply"))


@pytest.mark.usefixtures("in_this_process")
def test_surfaces_through_loose_triangles_and_points_say_that_no_face_is_kept(tmp_path, capsys):
    """Distances are measured where something was given: not from the surface, and from points not at all."""
    ball = samples.sphere(3)
    corners = ball.vertices[ball.faces].reshape(-1, 3)
    loose = corners + np.random.default_rng(0).normal(0.0, 0.01, corners.shape)
    sh.TriangleMesh(loose, np.arange(len(loose)).reshape(-1, 3)).save(tmp_path / "loose.ply")
    sh.PointCloud(ball.vertices).save(tmp_path / "points.ply")
    line = ["watertight", str(tmp_path / "loose.ply"), str(tmp_path / "points.ply"), "-o", str(tmp_path / "out")]
    assert main([*line, "--json", "--surface", "ply"]) == 0
    loosely, by_points = json.loads(capsys.readouterr().out)["shapes"]
    away = np.abs(sh.complete(sh.read(tmp_path / "out" / "loose.ply")).distance(loose)).max()
    assert away > 0.01 and away <= loosely["from_faces"] <= away + 0.01
    assert by_points["from_faces"] is None
    for found in (loosely, by_points):
        assert found["to_faces"] is None and found["way"] == "no face kept"
    assert main([*line[:2], "-o", str(tmp_path / "loose.stl")]) == 0
    assert f"{loosely['from_faces']:.2g} from the given faces to it at most" in capsys.readouterr().out


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize(("surface", "bad_edges"), [("stl", 1), ("ply", 0)])
def test_edges_that_the_format_joins_are_counted(tmp_path, capsys, surface, bad_edges):
    """STL files have no ids: two cubes that touch along an edge have one of four faces there."""
    samples.union(box((0, 0, 0), (1, 1, 1)), box((1, 1, 0), (2, 2, 1))).save(tmp_path / "two.ply")
    (found,) = figures(tmp_path, capsys, tmp_path / "two.ply", "--surface", surface)["shapes"]
    assert (found["bodies"], found["bad_edges"], found["self_intersections"]) == (2, bad_edges, 0)


@pytest.mark.usefixtures("in_this_process")
def test_sheets_need_a_thickness(tmp_path, capsys):
    sheet([[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, 0.1]]).save(tmp_path / "sheet.ply")
    command = ["watertight", str(tmp_path / "sheet.ply"), "-o", str(tmp_path / "out"), "--workers", "1"]
    assert main(command) == 1
    assert "bounds nothing" in capsys.readouterr().err
    (found,) = figures(tmp_path, capsys, tmp_path / "sheet.ply", "--thickness", "0.1", "--resolution", "60")["shapes"]
    assert found["bodies"] == 1
    area, rim, thickness = 1.005, 4 * np.hypot(1, 0.1), 0.1
    assert found["volume"] == pytest.approx(area * thickness + rim * np.pi * thickness**2 / 8, rel=0.02)


@pytest.mark.usefixtures("in_this_process")
def test_samples_for_trainers(tmp_path, folder, capsys):
    """Of a box with a face gone: all in closed form."""
    (found,) = figures(tmp_path, capsys, folder / "plank.ply", "--sample", "300")["shapes"]
    assert found["output"] == ["plank.stl", "plank_sdf.npz", "plank_surface.npz"]
    low, high = np.array([-1, -0.7, -0.2]), np.array([1, 0.6, 0.3])
    with np.load(tmp_path / "out" / "plank_surface.npz") as on, np.load(tmp_path / "out" / "plank_sdf.npz") as around:
        for name, fixed, length in (("random_surface", 1, 1.0), ("sharp_surface", 2, np.sqrt(2))):
            places, normals = np.split(on[name], 2, axis=1)
            assert places.shape == (300, 3)
            ahead, behind = np.abs(places - high) < 1e-6, np.abs(places - low) < 1e-6
            assert ((ahead | behind).sum(axis=1) >= fixed).all()
            np.testing.assert_allclose(normals * length, ahead.astype(float) - behind, atol=1e-6)
        near = "vol", "random_near", "sharp_near"  # as documented by hy3dshape/tools of Hunyuan3D 2.1
        assert set(on) == {"random_surface", "sharp_surface"}
        assert set(around) == {f"{name}_{kind}" for name in near for kind in ("points", "label")}
        for name in near:
            assert (around[f"{name}_points"].shape, around[f"{name}_label"].shape) == ((300, 3), (300,))
            expected = distance_to_box(around[f"{name}_points"], low, high)
            np.testing.assert_allclose(around[f"{name}_label"], expected, atol=1e-6)
    figures(tmp_path, capsys, folder / "plank.ply", "--sample", "300", "--normalize")
    with np.load(tmp_path / "out" / "plank_surface.npz") as on:
        assert np.linalg.norm(on["random_surface"][:, :3], axis=1).max() <= 1


@pytest.mark.usefixtures("in_this_process")
def test_one_shape_goes_into_a_file(tmp_path, folder, capsys):
    target = tmp_path / "whole.ply"
    command = ["watertight", str(folder / "plank.ply"), "-o", str(target), "--workers", "1"]
    assert main([*command, "--sample", "50"]) == 0
    printed, said = capsys.readouterr()
    assert printed.startswith(f"{target}: 1 body, volume 1.3") and printed.count("\n") == 1 and said == ""
    assert_closed_manifold(sh.read(target))
    made = {"whole.ply", "whole_sdf.npz", "whole_surface.npz", "in"}
    assert {path.name for path in tmp_path.iterdir()} == made
    assert main([*command, "--json"]) == 0
    (shape,) = json.loads(capsys.readouterr().out)["shapes"]
    assert shape["output"] == [str(target)]


@pytest.mark.usefixtures("in_this_process")
def test_folders_are_named_as_such(tmp_path, folder, capsys):
    plank = str(folder / "plank.ply")
    for name in ("whole.stl/", "whole"):
        assert main(["watertight", plank, "-o", f"{tmp_path}/{name}", "--workers", "1"]) == 0
        assert (tmp_path / name / "plank.stl").is_file()
    capsys.readouterr()
    for inputs in ([plank, str(folder / "ball.stl")], [str(folder)]):
        assert main(["watertight", *inputs, "-o", str(tmp_path / "both.stl")]) == 2
        assert "folder" in capsys.readouterr().err
    assert main(["watertight", plank, "-o", str(tmp_path / "a.stl"), "--surface", "obj"]) == 2
    assert not (tmp_path / "both.stl").exists() and not (tmp_path / "a.stl").exists()


@pytest.mark.usefixtures("in_this_process")
def test_one_label_of_an_image(tmp_path, capsys):
    """Where the image is: turned and moved."""
    nrrd = pytest.importorskip("nrrd")
    labels = np.zeros((8, 9, 10), dtype=np.uint8)
    labels[2:6, 2:6, 2:6], labels[6:8] = 3, 1
    turned = np.array([[0, 0.5, 0], [-0.5, 0, 0], [0, 0, 0.5]])
    header = {"space": "left-posterior-superior", "space directions": turned, "space origin": np.array([10, 20, 30.0])}
    nrrd.write(str(tmp_path / "labels.nrrd"), labels, header)
    target = tmp_path / "three.stl"
    command = ["watertight", str(tmp_path / "labels.nrrd"), "-o", str(target), "--workers", "1"]
    assert main([*command, "--label", "3"]) == 0
    bounds = sh.read(target).bounds
    middle = np.array([10, 20, 30]) + np.array([3.5, 3.5, 3.5]) @ turned
    assert bounds.mean(axis=0) == pytest.approx(middle, abs=0.02)
    assert bounds[1] - bounds[0] == pytest.approx([2, 2, 2], abs=0.1)
    assert main(command) == 1
    assert "label" in capsys.readouterr().err


@pytest.mark.usefixtures("in_this_process")
def test_small_parts_are_named_and_left_out(tmp_path, capsys):
    dust = [samples.sphere(1, radius=0.003, center=(1.2, 0.1 * k, 0)) for k in range(4)]
    mesh = functools.reduce(samples.union, dust, samples.sphere(3))
    mesh.save(tmp_path / "scan.ply")
    assert main(["info", str(tmp_path / "scan.ply"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["small_parts"] == 4 and told["defects"] == []
    command = shlex.split(told["without_small_parts"])[1:]
    assert main([*command, "--workers", "1"]) == 0
    assert sh.read(tmp_path / "scan_whole.ply").n_faces == 1280


@pytest.mark.usefixtures("in_this_process")
def test_openings_are_sealed(tmp_path, capsys):
    """A ball with two skins and a hole in both is one body."""
    skins = samples.union(samples.sphere(3), samples.sphere(3, radius=0.9))
    centres = skins.vertices[skins.faces].mean(axis=1)
    sh.TriangleMesh(skins.vertices, skins.faces[centres[:, 2] < 0.88]).save(tmp_path / "skins.ply")
    command = ["watertight", str(tmp_path / "skins.ply"), "-o", str(tmp_path / "solid.ply"), "--workers", "1"]
    assert main([*command, "--seal", "1.5", "--json"]) == 0
    (shape,) = json.loads(capsys.readouterr().out)["shapes"]
    assert shape["bodies"] == 1 and shape["volume"] == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert_closed_manifold(sh.read(tmp_path / "solid.ply"))
