"""The command line, as a user meets it: files made, one-line errors, exit codes, nothing lost."""

import json
import os
import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples
from signedheat.batches import Job
from signedheat.cli import main
from signedheat.shapes.inspection import inspect


@pytest.fixture
def ball(tmp_path):
    """A sphere with a fifth of its faces gone, which lids close."""
    path = tmp_path / "ball.ply"
    samples.without_faces(samples.sphere(3), 0.2).save(path)
    return str(path)


NOTE, COMPLETED = "lost faces restored", "of the surface is completed"
"""What standard error tells of the ball; nothing else is to be said of it."""


def succeed(capsys, *arguments):
    assert main(list(arguments)) == 0
    out, err = capsys.readouterr()
    assert all(line.startswith("signedheat: ") and (NOTE in line or COMPLETED in line) for line in err.splitlines())
    return out


def fail(capsys, *arguments, code=1):
    assert main(list(arguments)) == code
    out, err = capsys.readouterr()
    assert out == ""
    said = [line for line in err.splitlines() if NOTE not in line and COMPLETED not in line]
    assert len(said) == 1 and said[0].startswith("signedheat")
    return said[0]


@pytest.mark.parametrize("ending", ["npz", "vti", "nrrd", "npy"])
def test_volume(tmp_path, ball, capsys, ending):
    output = str(tmp_path / f"phi.{ending}")
    summary = json.loads(succeed(capsys, "volume", ball, "-o", output, "--resolution", "32", "--json"))
    phi = sh.read_field(output)
    assert summary["shape"] == list(phi.domain.shape)
    assert max(phi.domain.shape) == 32
    assert abs(phi([[1.2, 0, 0]])[0] - 0.2) < 0.03
    assert phi([[0, 0, 0]])[0] < -0.8


def test_volume_is_sharpened_unless_plain(tmp_path):
    """Of points, which heat completes, so that its time counts."""
    ball, ours, papers = (str(tmp_path / name) for name in ("ball.xyz", "sharp.npz", "plain.npz"))
    samples.oriented_points(samples.sphere(3), 500).save(ball)
    options = ["--resolution", "32", "--quiet", "--diffusion", "4"]
    assert main(["volume", ball, "-o", ours, *options]) == 0
    assert main(["volume", ball, "-o", papers, *options, "--plain"]) == 0
    plain = sh.read_field(papers)
    grid = plain.domain
    np.testing.assert_array_equal(plain.values, sh.SignedHeatSolver(grid, diffusion=4.0).distance(sh.read(ball)).values)
    solid = sh.signed_distance(sh.read(ball), grid, diffusion=4.0)
    np.testing.assert_array_equal(sh.read_field(ours).values, solid.values)
    assert (solid.values != sh.signed_distance(sh.read(ball), grid).values).any()


@pytest.mark.parametrize("constraint", ["free", "zero-set", "hard", "each-component", "soft:10"])
def test_every_constraint_has_a_name(tmp_path, ball, capsys, constraint):
    output = str(tmp_path / "phi.npz")
    succeed(capsys, "volume", ball, "-o", output, "--resolution", "20", "--constraint", constraint, "--plain")
    assert sh.read_field(output)([[0, 0, 0]])[0] < -0.7


def test_volume_on_a_grid_of_ones_own(tmp_path, ball, capsys):
    output = str(tmp_path / "phi.npz")
    own = ["--origin", "-1.5", "-1.6", "-1.7", "--spacing", "0.2", "0.25", "0.3", "--shape", "16", "14", "12"]
    succeed(capsys, "volume", ball, "-o", output, *own)
    grid = sh.read_field(output).domain
    assert grid.origin.tolist() == [-1.5, -1.6, -1.7]
    assert grid.spacing.tolist() == [0.2, 0.25, 0.3]
    assert grid.shape == (16, 14, 12)


def test_spacing_and_padding(tmp_path, ball, capsys):
    output = str(tmp_path / "phi.npz")
    succeed(capsys, "volume", ball, "-o", output, "--spacing", "0.125", "--padding", "0.5")
    grid = sh.read_field(output).domain
    assert grid.spacing.tolist() == [0.125] * 3
    assert (grid.origin <= -1.5 + 0.05).all()


def test_offsets_are_closed_one_file_each(tmp_path, ball, capsys):
    output = str(tmp_path / "shell.stl")
    arguments = ["offset", ball, "0.2", "-1e-1", "0.6", "-o", output, "--resolution", "48", "--json"]
    summary = json.loads(succeed(capsys, *arguments))
    names = ["shell_+0.2.stl", "shell_-0.1.stl", "shell_+0.6.stl"]
    assert [os.path.basename(surface["output"]) for surface in summary["surfaces"]] == names
    for name, radius in zip(names, (1.2, 0.9, 1.6), strict=True):
        surface = sh.read(tmp_path / name)
        report = inspect(surface)
        assert report.is_closed
        assert report.is_manifold
        assert report.inconsistent_edges == 0
        np.testing.assert_allclose(np.linalg.norm(surface.vertices, axis=1).mean(), radius, rtol=0.02)
        volume = np.einsum("ij,ij->", surface.vertices[surface.faces[:, 0]], surface.face_area_vectors) / 3
        assert volume > 0


@pytest.mark.parametrize("ending", ["ply", "vtp"])
def test_offsets_tell_at_each_vertex_what_was_completed(tmp_path, capsys, ending):
    """Of a ball without its cap: 1 below, less over the hole, least in its middle; and one number in the summary."""
    ball = samples.sphere(4)
    kept = ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.7]
    shape, output = tmp_path / "open.ply", tmp_path / f"offset.{ending}"
    sh.TriangleMesh(ball.vertices, kept).save(shape)
    assert main(["offset", str(shape), "0.1", "-o", str(output), "--resolution", "40", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert 0.5 < summary["field"]["confidence"] < 0.999
    places = sh.read(output).vertices
    height, middle = places[:, 2], np.hypot(places[:, 0], places[:, 1]) < 0.3
    if ending == "ply":
        found = trimesh.load(output, process=False).metadata["_ply_raw"]["vertex"]["data"]["confidence"]
    else:
        found = pytest.importorskip("pyvista").read(output)["confidence"]
    assert (found[height < 0.4] == 1).all()
    assert found[middle & (height > 0.5)].max() < 0.7


def test_offsets_have_the_edges_of_the_function_whoever_makes_them(tmp_path):
    """Of a turned box made smaller, of which contours cut the edges off: they lose 6e-4 of its volume."""
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.5, 0.7]))
    trimesh.creation.box([1, 1, 1], turn).export(tmp_path / "box.stl")
    shape, nodes = sh.read(tmp_path / "box.stl"), ("--resolution", "48")
    assert main(["offset", str(tmp_path / "box.stl"), "-0.1", "-o", str(tmp_path / "command.stl"), *nodes]) == 0
    assert main(["morph", "erode", str(tmp_path / "box.stl"), "0.1", "-o", str(tmp_path / "morph.stl"), *nodes]) == 0
    Job(offsets=(-0.1,), resolution=48)(tmp_path / "box.stl", tmp_path / "batch")
    made = [sh.read(tmp_path / name) for name in ("command.stl", "morph.stl", "batch_-0.1.stl")]
    for surface in (*made, sh.offset(shape, -0.1, resolution=48), sh.morphology.erode(shape, 0.1, resolution=48)):
        assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(0.8**3, rel=1e-5)


def test_offset_of_one_distance_has_the_name_given(tmp_path, ball, capsys):
    text = succeed(capsys, "offset", ball, "0.1", "-o", str(tmp_path / "a.obj"), "--resolution", "24")
    assert "a.obj" in text
    assert sh.read(tmp_path / "a.obj").n_faces > 100


def test_options_that_mean_nothing_are_refused(tmp_path, ball, capsys):
    out, field = str(tmp_path / "wall.stl"), str(tmp_path / "ball.npz")
    for option in (["--lids", "flat"], ["--nested", "bodies"], ["--keep-overlaps"], ["--band", "0.5"]):
        told = fail(capsys, "morph", "thicken", ball, "0.1", "-o", out, *option, code=2)
        assert f"{option[0]} is for solids" in told
    line = str(tmp_path / "line.csv")
    Path(line).write_text("0,0\n1,0\n")
    for shape, own in ((ball, ["--plain"]), (ball, ["--constraint", "each-component"]), (line, [])):
        for option in (["--lids", "flat"], ["--nested", "bodies"], ["--keep-overlaps"], ["--band", "0.5"]):
            told = fail(capsys, "volume", shape, "-o", field, *own, *option, code=2)
            assert f"{option[0]} is for solids" in told
    for command in (["watertight", ball], ["batch", ball, "--info"]):
        assert "goes with --sample" in fail(capsys, *command, "-o", out, "--normalize", code=2)
    sh.signed_distance(sh.read(ball), resolution=12).save(field)
    assert "curves lie on surfaces" in fail(capsys, "info", field, "--curves", "c.json")


def test_contour(tmp_path, ball, capsys):
    field, output = str(tmp_path / "phi.npz"), str(tmp_path / "zero.ply")
    succeed(capsys, "volume", ball, "-o", field, "--resolution", "32")
    succeed(capsys, "contour", field, "0.1", "-o", output)
    assert inspect(sh.read(output)).is_closed
    assert "phi.npz" in fail(capsys, "contour", field, "100", "-o", output)


def test_info_of_shapes_and_fields(tmp_path, ball, capsys):
    summary = json.loads(succeed(capsys, "info", ball, "--json", "--resolution", "64", "512"))
    report = inspect(sh.read(ball))
    assert summary["open_edges"] == report.open_edges
    assert summary["memory_bytes"]["512"] > 30 * summary["memory_bytes"]["64"] > 0  # the base is counted
    told = succeed(capsys, "info", ball)
    assert "open edges" in told and told.splitlines()[0].split(maxsplit=1) == ["verdict", summary["verdict"]]
    field = str(tmp_path / "phi.vti")
    succeed(capsys, "volume", ball, "-o", field, "--resolution", "16")
    assert json.loads(succeed(capsys, "info", field, "--json"))["domain"] == "Grid"
    cloud = str(tmp_path / "points.xyz")
    samples.oriented_points(samples.sphere(2), 50).save(cloud)
    assert json.loads(succeed(capsys, "info", cloud, "--json"))["has_normals"] is True


@pytest.mark.usefixtures("in_this_process")
def test_info_names_a_command_for_each_defect_that_mends_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball = samples.sphere(2)
    inner = samples.sphere(1, radius=0.5)
    shapes = {
        "ball with holes.ply": (samples.without_patches(ball, 2, 0.4), {"holes"}),
        "doubled.stl": (sh.TriangleMesh(ball.vertices, [*ball.faces, *ball.faces[:5]]), {"duplicate_faces"}),
        "touching.stl": (
            samples.union(box((0, 0, 0), (1, 1, 1)), box((1, 1, 0), (2, 2, 1))),
            {"nonmanifold_edges"},
        ),
        "hidden.off": (samples.union(ball, inner), {"hidden_parts"}),
        "sheet.obj": (sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0.2]], [[0, 1, 2]]), {"sheets"}),
    }
    for name, (shape, kinds) in shapes.items():
        shape.save(name)
        report = json.loads(succeed(capsys, "info", name, "--json"))
        assert kinds <= {defect["defect"] for defect in report["defects"]}, name
        assert report["remedy"] in {defect["remedy"] for defect in report["defects"]}
        assert all(defect["remedy"] in succeed(capsys, "info", name) for defect in report["defects"])
        command = shlex.split(report["remedy"])
        succeed(capsys, *command[1:])
        mended = json.loads(succeed(capsys, "info", command[-1], "--json"))
        assert (mended["defects"], mended["remedy"]) == ([], None), name


def test_info_tells_which_way_parts_face(tmp_path, capsys):
    outer, inner = samples.sphere(1), samples.sphere(1, radius=0.8)
    flat = sh.TriangleMesh([[2, 0, 0], [3, 0, 0], [2, 1, 0]], [[0, 1, 2]])
    wall = sh.TriangleMesh([[0, 0, 3], [1, 0, 3], [0, 1, 3]], [[0, 1, 2], [0, 2, 1]])
    shapes = {
        "outwards.ply": (outer, "facing outwards"),
        "inwards.ply": (sh.TriangleMesh(outer.vertices, outer.faces[:, ::-1]), "all facing inwards"),
        "turned.ply": (samples.with_flipped_faces(outer, 0.1), "faces disagree at"),
        "within.ply": (samples.union(outer, inner), "1 body hidden in another"),
        "cavity.ply": (
            samples.union(outer, sh.TriangleMesh(inner.vertices, inner.faces[:, ::-1])),
            "1 cavity",
        ),
        "sheet.ply": (samples.union(outer, flat), "in 1 sheet without an inside"),
        "wall.ply": (samples.union(outer, wall), "1 duplicate face to merge"),
    }
    for name, (shape, said) in shapes.items():
        path = str(tmp_path / name)
        shape.save(path)
        assert said in succeed(capsys, "info", path)
        told = json.loads(succeed(capsys, "info", path, "--json"))
        assert told["orientation"] == sh.orientation(sh.read(path)).summary
        assert told["least_spacing"] > 0
    told = json.loads(succeed(capsys, "info", str(tmp_path / "cavity.ply"), "--json"))
    assert told["thickness"]["wall"] == pytest.approx(0.2, rel=0.15)
    assert told["thickness"]["spacing"] == told["thickness"]["wall"] / 2


@pytest.mark.usefixtures("small_pictures")
def test_pictures(tmp_path, ball, capsys):
    import matplotlib.image

    field, slices, scene = (str(tmp_path / name) for name in ("phi.npz", "slices.png", "scene.png"))
    succeed(capsys, "volume", ball, "-o", field, "--resolution", "24", "--preview", slices)
    succeed(capsys, "view", ball, "-o", scene)
    for picture in (slices, scene):
        assert matplotlib.image.imread(picture)[..., :3].std() > 0.05
    succeed(capsys, "view", field, "-o", slices)


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.usefixtures("coarse_duck", "small_pictures")
def test_demo_needs_no_file(tmp_path, capsys):
    assert main(["demo", "-o", str(tmp_path / "demo"), "--resolution", "24", "--json"]) == 0
    out, err = capsys.readouterr()
    summary = json.loads(out)
    assert "faces flipped" in err and "of the surface is completed" in err
    assert sorted(p.name for p in (tmp_path / "demo").iterdir()) == sorted(map(os.path.basename, summary["files"]))
    assert inspect(sh.read(tmp_path / "demo" / "offset.stl")).is_closed
    assert sh.read_field(tmp_path / "demo" / "distance.vti").values.min() < -0.2


def test_quiet_prints_nothing(tmp_path, ball, capsys):
    assert succeed(capsys, "offset", ball, "0.1", "-o", str(tmp_path / "a.stl"), "--resolution", "16", "--quiet") == ""


def test_grids_that_cannot_be(tmp_path, ball, capsys):
    output = tmp_path / "phi.npz"
    output.write_text("precious")
    assert "GB" in fail(capsys, "volume", ball, "-o", str(output), "--resolution", "40000")
    assert "GB" in fail(capsys, "volume", ball, "-o", str(output), "--spacing", "1e-9")
    with refused(sh.errors.MemoryLimitError):
        sh.SignedHeatSolver(sh.Grid.around(sh.read(ball), 40_000)).distance(sh.read(ball))
    assert output.read_text() == "precious"


def test_offset_outside_the_grid(tmp_path, ball, capsys):
    output = tmp_path / "a.stl"
    output.write_text("precious")
    arguments = ["offset", ball, "0.9", "-o", str(output), "--resolution", "24", "--padding", "0.3"]
    assert "padding" in fail(capsys, *arguments)
    assert "ball.ply" in fail(capsys, "offset", ball, "-5", "-o", str(output), "--resolution", "16", "--quiet")
    assert output.read_text() == "precious"


def test_outputs_are_checked_before_anything_else(tmp_path, capsys):
    """The shape does not even exist: the complaint is about the output."""
    for output in (tmp_path / "none" / "phi.npz", tmp_path / "phi.doc", tmp_path):
        error = fail(capsys, "volume", "missing.stl", "-o", str(output))
        assert str(output) in error
        assert "missing" not in error
    assert "p.txt" in fail(capsys, "volume", "missing.stl", "-o", str(tmp_path / "a.npz"), "--preview", "p.txt")
    error = fail(capsys, "offset", "missing.stl", "1", "-o", str(tmp_path / "points.xyz"))
    assert "points.xyz" in error


def test_bands_are_written_and_contoured(tmp_path, ball, capsys):
    output, surface = str(tmp_path / "band.npz"), str(tmp_path / "offset.ply")
    options = ["--resolution", "48", "--padding", "0.4", "--band", "0.2"]
    summary = json.loads(succeed(capsys, "volume", ball, "-o", output, *options, "--json"))
    assert summary["band"] == 0.2
    assert summary["nodes"] == 512 * summary["blocks"]
    band = sh.read_field(output)
    assert band.domain.blocks is not None
    assert abs(band([[1.1, 0, 0]])[0] - 0.1) < 0.02
    succeed(capsys, "contour", output, "0.1", "-o", surface)
    one = sh.read(surface)
    succeed(capsys, "offset", ball, "0.1", "-o", surface, *options)
    other = sh.read(surface)
    assert one.n_faces == other.n_faces
    assert np.abs(one.vertices - other.vertices).mean() < 0.001  # the file does not know the shape
    fail(capsys, "offset", ball, "0.3", "-o", surface, *options, code=2)
    fail(capsys, "volume", ball, "-o", output, *options, "--plain", code=2)


def test_tiles_go_on_where_they_were_and_give_what_the_band_gives(tmp_path, ball, capsys):
    store, output, other = str(tmp_path / "tiles"), str(tmp_path / "a.npz"), str(tmp_path / "b.npz")
    grid = ["--origin", "-8.9", "-1.3", "-1.3", "--spacing", "0.07", "--shape", "146", "38", "38"]  # a seam in the ball
    options = [*grid, "--band", "0.15"]
    notes = []
    for _ in range(2):
        told = succeed(capsys, "volume", ball, "-o", output, *options, "--tiles", store, "--json", "--quiet")
        notes.append(json.loads(told)["notes"]["tiles_computed"])
    assert notes[0]["reused"] == 0 and notes[1]["reused"] == notes[1]["tiles"] == notes[0]["tiles"] > 1
    succeed(capsys, "volume", ball, "-o", other, *options, "--quiet")
    tiled, single = sh.read_field(output), sh.read_field(other)
    np.testing.assert_array_equal(tiled.values, single.values)
    np.testing.assert_array_equal(tiled.domain.blocks.places, single.domain.blocks.places)
    assert "another" in fail(capsys, "volume", ball, "-o", output, *options[:-1], "0.16", "--tiles", store)
    fail(capsys, "volume", ball, "-o", output, "--tiles", store, code=2)
    fail(capsys, "volume", ball, "-o", output, *options, "--workers", "2", code=2)
    fail(capsys, "volume", ball, "-o", output, *options, "--tiles", store, "--workers", "2", "--scheduler", "x", code=2)


@pytest.mark.usefixtures("in_this_process")
def test_archives_of_solids_and_fields_are_taken_for_shapes(tmp_path, ball, capsys):
    """Nothing is completed again, so that there is nothing to say of them."""
    solid = sh.complete(sh.read(ball))
    names = [str(tmp_path / name) for name in ("solid.npz", "field.npz")]
    solid.save(names[0])
    solid.field(24).save(names[1])
    for name in names:
        assert isinstance(sh.read(name), sh.Solid)
        output = str(tmp_path / "larger.stl")
        assert main(["offset", name, "0.2", "-o", output, "--resolution", "24"]) == 0
        assert "turned" not in capsys.readouterr().err
        assert np.abs(np.linalg.norm(sh.read(output).vertices, axis=1) - 1.2).max() < 0.05
    moved = str(tmp_path / "moved.npz")
    assert main(["sample", names[0], "-n", "50", "-o", moved, "--units", "m:cm"]) == 0
    assert np.load(moved)["radius"] > 100
    assert "Solid" in succeed(capsys, "info", names[0])
    assert main(["batch", *names, "-o", str(tmp_path / "out"), "--info", "--workers", "1"]) == 0


@pytest.mark.parametrize(("name", "volume"), [("union", 12.0), ("intersect", 4.0), ("subtract", 4.0)])
def test_boxes_are_combined(tmp_path, capsys, name, volume):
    """Of a box of which a face is missing and one beside it: volumes in closed form, places to the last bit."""
    first, second = (trimesh.creation.box([2, 2, 2]) for _ in range(2))
    second.apply_translation([1, 0, 0])
    first.update_faces(np.arange(12) > 0)
    files = [str(tmp_path / "first.ply"), str(tmp_path / "second.ply")]
    for mesh, file in zip((first, second), files, strict=True):
        mesh.export(file)
    output = str(tmp_path / "out.ply")
    assert main([name, *files, "-o", output, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["volume"] == pytest.approx(volume)
    result = sh.read(output)
    assert inspect(result).is_closed
    assert set(np.abs(result.vertices).ravel()) <= {0.0, 1.0, 2.0}
    fail(capsys, name, files[0], "-o", output, code=2)


def test_a_shape_is_cut_and_sliced(tmp_path, capsys):
    """A box of which a face is missing: areas, volumes and coordinates in closed form."""
    mesh = trimesh.creation.box([2, 2, 2])
    mesh.update_faces(np.arange(12) > 0)
    file, drawing, part = (str(tmp_path / name) for name in ("box.ply", "out.svg", "part.ply"))
    mesh.export(file)
    summary = json.loads(succeed(capsys, "section", file, "-o", drawing, "--json"))
    assert [entry["area"] for entry in summary["sections"]] == [pytest.approx(4)]
    [square] = sh.io.read_polylines(drawing)
    assert square.closed and square.bounds.tolist() == [[-1, -1], [1, 1]]
    succeed(capsys, "section", file, "-o", drawing, "--normal", "1", "1", "0", "--heights", "0", "0.5", "9")
    [upright] = sh.io.read_polylines(tmp_path / "out_+0.5.svg")
    assert upright.signed_area == pytest.approx(2 * (2 * np.sqrt(2) - 1))
    assert not (tmp_path / "out_+9.svg").exists()
    fail(capsys, "section", file, "-o", drawing, "--heights", "9")
    fail(capsys, "section", file, "-o", "-", "--heights", "0", "1", code=2)
    summary = json.loads(succeed(capsys, "cut", file, "-o", part, "--origin", "0", "0", "0.5", "--json"))
    assert [half["volume"] for half in summary["halves"]] == pytest.approx([2, 6])
    assert all(inspect(sh.read(half["output"])).is_closed for half in summary["halves"])
    fail(capsys, "cut", file, "-o", part, "--origin", "0", "0", "5")
