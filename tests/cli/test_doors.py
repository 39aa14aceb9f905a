"""Several files at once, and options of `morph` beside those of its sisters."""

import json
import warnings

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.ply"
    samples.without_faces(samples.sphere(3), 0.2).save(path)
    return str(path)


def test_info_of_several_files(tmp_path, ball, capsys):
    other = str(tmp_path / "points.xyz")
    samples.oriented_points(samples.sphere(2), 50).save(other)
    assert main(["info", ball, other, "--json"]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert [each["file"] for each in files] == [ball, other]
    alone = main(["info", ball, "--json"]), json.loads(capsys.readouterr().out)
    assert alone[1].keys() == files[0].keys()
    assert main(["info", ball, str(tmp_path / "missing.stl"), other]) == 1
    printed, said = capsys.readouterr()
    assert ball in printed and other in printed and said.count("\n") == 1 and "missing.stl" in said


def test_two_obj_files_are_two_shapes(tmp_path, capsys):
    for name in "ab":
        samples.sphere(1).save(tmp_path / f"{name}.obj")
    assert main(["info", str(tmp_path / "a.obj"), str(tmp_path / "b.obj"), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["files"]) == 2
    assert main(["info", str(tmp_path / "a.obj"), str(tmp_path / "b.obj"), "--curves", "c.json"]) == 2


def test_morph_takes_a_spacing_and_tells_what_it_found(tmp_path, ball, capsys):
    output, picture = tmp_path / "grown.stl", tmp_path / "grown.png"
    options = ["--spacing", "0.1", "--padding", "0.5", "--preview", str(picture), "--json"]
    turned = samples.with_flipped_faces(samples.sphere(3), 0.1)
    turned.save(tmp_path / "turned.ply")
    assert main(["morph", "dilate", str(tmp_path / "turned.ply"), "0.2", "-o", str(output), *options]) == 0
    printed, said = capsys.readouterr()
    assert "faces flipped" in said
    field = json.loads(printed)["field"]
    assert field["spacing"] == [0.1] * 3 and picture.stat().st_size > 5000
    assert np.linalg.norm(sh.read(output).vertices, axis=1) == pytest.approx(1.2, abs=0.02)


def test_morph_leaves_steps_out(tmp_path, capsys):
    body = samples.union(samples.sphere(3), samples.sphere(2, radius=0.5))
    body.save(tmp_path / "nested.ply")
    volumes = []
    for options in ([], ["--keep-overlaps"]):
        output = tmp_path / "eroded.ply"
        arguments = ["morph", "erode", str(tmp_path / "nested.ply"), "0.1", "-o", str(output), "--resolution", "40"]
        assert main([*arguments, *options, "--quiet"]) == 0
        surface = sh.read(output)
        volumes.append(np.einsum("ij,ij->", surface.vertices[surface.faces[:, 0]], surface.face_area_vectors) / 3)
    assert volumes[0] == pytest.approx(4 / 3 * np.pi * 0.9**3, rel=0.03)
    assert volumes[1] < 0.97 * volumes[0]


def test_a_measure_of_ones_own(tmp_path):
    asked = []

    def measure(shape, grid):
        asked.append(shape)
        return sh.signed_distance(shape, grid)

    ball = samples.sphere(2)
    same = sh.morphology.closing(ball, 0.1, resolution=20, measure=measure)
    assert len(asked) == 2 and asked[0] is ball
    np.testing.assert_array_equal(same.vertices, sh.morphology.closing(ball, 0.1, resolution=20).vertices)
    sh.morphology.shell(ball, 0.0, 0.4, resolution=20, measure=measure)
    assert len(asked) == 3


def test_shells_keep_their_outside_and_have_a_drain(tmp_path):
    given = box((0, 0, 0), (2, 1.3, 1))
    given.save(tmp_path / "box.ply")
    options = "--keep-outside", "--drain", "0.2", "--resolution", "48"
    assert (
        main(["morph", "shell", str(tmp_path / "box.ply"), "-0.15", "0", "-o", str(tmp_path / "a.ply"), *options]) == 0
    )
    made = sh.read(tmp_path / "a.ply")
    corners = made.vertices[made.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(2 * 1.3 - 1.7 * 1.0 * 0.7 - np.pi * 0.1**2 * 0.15, rel=1e-3)
    assert {tuple(v) for v in given.vertices} <= {tuple(v) for v in made.vertices.round(9)}
    assert made.n_vertices - made.n_faces // 2 == 2  # outside and inside are joined by one hole


def test_what_packages_tell_each_other_is_no_warning_of_a_command(tmp_path, monkeypatch, capsys):
    """As matplotlib 3.8 about pyparsing, which has warnings of its own shown."""

    def deprecated(_):
        warnings.simplefilter("always")
        warnings.warn("parseString is deprecated", DeprecationWarning, stacklevel=1)
        warnings.warn("a surface\nwith holes", UserWarning, stacklevel=1)
        return samples.sphere(1)

    monkeypatch.setattr("signedheat.io.shape_files.READERS", {".ply": deprecated})
    assert main(["info", "ball.ply"]) == 0
    assert capsys.readouterr().err == "signedheat: a surface with holes\n"


def test_info_of_voxels_in_an_array(tmp_path, capsys):
    """An array without the description of a field holds voxels."""
    volume = np.zeros((6, 6, 6), dtype=bool)
    volume[1:4, 2:4, 3:4] = True
    np.save(tmp_path / "box.npy", volume)
    assert main(["info", str(tmp_path / "box.npy"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["n_faces"], found["open_edges"], found["area"]) == ("DigitalSurface", 22, 0, 22.0)


def test_alone_it_says_what_it_can(capsys):
    assert main([]) == 0
    printed, said = capsys.readouterr()
    assert "watertight" in printed and "usage" in printed and said == ""


def test_info_of_a_folder(tmp_path, ball, capsys):
    (tmp_path / "inner").mkdir()
    samples.sphere(1).save(tmp_path / "inner" / "small.stl")
    (tmp_path / "notes.txt").write_text("no shape")
    assert main(["info", str(tmp_path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["files"]
    assert [each["file"] for each in found] == [ball, str(tmp_path / "inner" / "small.stl")]


@pytest.mark.parametrize(
    "command",
    [
        ["offset", "ball.ply", "0.1", "-o", "ball.ply"],
        ["volume", "ball.ply", "-o", "./ball.ply"],
        ["watertight", "ball.ply", "-o", "ball.ply"],
        ["watertight", "ball.ply", "-o", ".", "--surface", "ply"],
        ["deviation", "ball.ply", "ball.ply", "-o", "table.csv", "ball.ply"],
    ],
    ids=" ".join,
)
def test_an_output_that_is_the_input_is_refused(tmp_path, ball, capsys, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    before = (tmp_path / "ball.ply").read_bytes()
    assert main(command) in (1, 2)
    assert "replace" in capsys.readouterr().err
    assert (tmp_path / "ball.ply").read_bytes() == before


@pytest.mark.parametrize("order", ["shapes first", "outputs first", "outputs between", "each with its own option"])
def test_several_outputs_of_deviation(tmp_path, ball, capsys, order):
    outputs = [str(tmp_path / "table.csv"), str(tmp_path / "coloured.ply")]
    command = {
        "shapes first": [ball, ball, "-o", *outputs],
        "outputs first": ["-o", *outputs, ball, ball],
        "outputs between": [ball, "-o", *outputs, ball],
        "each with its own option": [ball, ball, "-o", outputs[0], "-o", outputs[1]],
    }[order]
    assert main(["deviation", *command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["output"] == outputs
    assert all((tmp_path / name).stat().st_size for name in ("table.csv", "coloured.ply"))
    assert main(["deviation", ball]) == 2


def test_info_of_a_solid_says_that_nothing_is_left_to_mend(tmp_path, ball, capsys):
    """Its completion has edges of three faces, and lies anywhere: neither is a defect of a solid."""
    solid = sh.complete(sh.read(ball)) | sh.complete(samples.sphere(2, center=(1.0, 0.0, 0.0)))
    solid.save(tmp_path / "solid.npz")
    assert main(["info", str(tmp_path / "solid.npz"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"].startswith("a solid: closed") and "orientation" not in found
    assert found["thickness"]["wall"] > 0.1
    in_batch = sh.batches.Job(info=True)(tmp_path / "solid.npz", tmp_path / "made")["info"]
    assert all(found[name] == pytest.approx(value) for name, value in in_batch.items() if name != "thickness")
    assert in_batch["thickness"]["wall"] == found["thickness"]["wall"] and "orientation" not in in_batch


def test_curves_lie_on_the_surface_of_a_solid(tmp_path, capsys):
    solid = sh.complete(samples.sphere(2))
    solid.save(tmp_path / "ball.npz")
    sh.io.write_curves([solid.boundary.path([0, 9])], tmp_path / "curve.json", solid.boundary)
    names = [str(tmp_path / name) for name in ("ball.npz", "curve.json", "phi.vtp")]
    assert main(["surface", *names[:2], "-o", names[2], "--quiet"]) == 0
    assert sh.read_field(names[2]).values.shape == (len(solid.boundary.vertices),)


def test_options_of_completion_are_refused_of_solids(tmp_path, capsys):
    """They had no effect on what is complete, without a word."""
    sh.complete(samples.sphere(1)).save(tmp_path / "solid.npz")
    shape, output = str(tmp_path / "solid.npz"), str(tmp_path / "made.npz")
    for command, name, value in (
        ("volume", "--lids", "flat"),
        ("thickness", "--lids", "flat"),
        ("volume", "--diffusion", "2"),
    ):
        assert main([command, shape, "-o", output, "--resolution", "9", name, value]) == 1
        assert f"{name} is for shapes that are completed" in capsys.readouterr().err
