"""The command line on the other domains: polylines in the plane, voxels, points, polygons; completed curves."""

from __future__ import annotations

import json

import numpy as np
import pytest

import signedheat as sh
from shapes.degenerate_meshes import stretched_square
from shapes.surface_cases import sphere
from signedheat.cli import main

DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><g transform="translate(10 10) scale(2)">
<circle cx="20" cy="20" r="15"/></g><path d="M 100 100 C 130 100 130 140 100 140"/></svg>"""


@pytest.fixture
def ball(tmp_path):
    """A sphere, and half a circle on it as a path in space."""
    sphere(3).save(tmp_path / "ball.ply")
    angle = np.linspace(0, 1.5 * np.pi, 40)
    half = np.stack([np.sqrt(0.91) * np.cos(angle), np.sqrt(0.91) * np.sin(angle), np.full(40, 0.3)], axis=1)
    np.savetxt(tmp_path / "half.csv", half, delimiter=",", header="x,y,z")
    content = {"polylines": [{"points": half.tolist(), "closed": False}]}
    (tmp_path / "half.json").write_text(json.dumps(content))
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in half.tolist()]
    (tmp_path / "half.obj").write_text("\n".join([*rows, "l " + " ".join(map(str, range(1, 41)))]) + "\n")
    return tmp_path


@pytest.fixture
def arcs(tmp_path):
    """A circle of radius 1, clockwise, of which three parts are missing."""
    angle = -2 * np.pi * np.arange(120) / 120
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lines = [sh.Polyline(points[k : k + 32]) for k in (0, 40, 80)]
    sh.io.write_polylines(lines, tmp_path / "arcs.csv")
    sh.io.write_polylines(lines, tmp_path / "arcs.svg")
    return tmp_path


def succeed(capsys, *arguments):
    assert main([str(argument) for argument in arguments]) == 0
    out, err = capsys.readouterr()
    assert all("bounds nothing" in line or "gap" in line for line in err.splitlines())
    return out


def fail(capsys, *arguments, code=1):
    assert main([str(argument) for argument in arguments]) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("signedheat") and err.count("\n") == 1
    return err


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("ending", ["csv", "svg"])
def test_volume_in_the_plane(arcs, capsys, ending):
    out, picture = arcs / "phi.npz", arcs / "phi.png"
    options = ["--resolution", "64", "--preview", picture, "--json"]
    summary = json.loads(succeed(capsys, "volume", arcs / f"arcs.{ending}", "-o", out, *options))
    assert len(summary["shape"]) == 2 and max(summary["shape"]) == 64
    phi = sh.read_field(out)
    np.testing.assert_allclose(phi([[0.3, 0], [1.25, 0], [0, -0.5]]), [-0.7, 0.25, -0.5], atol=0.03)
    assert picture.read_bytes().startswith(b"\x89PNG")
    kept = sh.signed_distance(sh.io.read_polylines(arcs / f"arcs.{ending}"), resolution=64)
    np.testing.assert_array_equal(phi.values, kept.values)


def test_a_grid_of_ones_own_in_the_plane(arcs, capsys):
    out = arcs / "phi.npz"
    own = ["--origin", "-1.5", "-1.25", "--spacing", "0.1", "0.125", "--shape", "31", "21"]
    succeed(capsys, "volume", arcs / "arcs.csv", "-o", out, *own)
    grid = sh.read_field(out).domain
    assert grid.origin.tolist() == [-1.5, -1.25] and grid.shape == (31, 21) and grid.spacing.tolist() == [0.1, 0.125]


def test_offsets_in_the_plane(arcs, capsys):
    arguments = ["offset", arcs / "arcs.csv", "0.2", "-0.3", "-o", arcs / "out.svg", "--json"]
    summary = json.loads(succeed(capsys, *arguments))
    assert [row["closed"] for row in summary["lines"]] == [1, 1]
    for name, radius in (("out_+0.2.svg", 1.2), ("out_-0.3.svg", 0.7)):
        [line] = sh.io.read_polylines(arcs / name)
        assert line.closed and line.signed_area == pytest.approx(-np.pi * radius**2, rel=0.02)
    assert "1 line (1 closed)" in succeed(capsys, "offset", arcs / "arcs.svg", "0.1", "-o", arcs / "one.csv")


@pytest.mark.usefixtures("small_pictures")
def test_contour_view_and_info_in_the_plane(arcs, capsys):
    succeed(capsys, "volume", arcs / "arcs.csv", "-o", arcs / "phi.vti", "--resolution", "48")
    assert "1 line" in succeed(capsys, "contour", arcs / "phi.vti", "0.1", "-o", arcs / "line.csv")
    [line] = sh.io.read_polylines(arcs / "line.csv")
    np.testing.assert_allclose(np.linalg.norm(line.points, axis=1), 1.1, atol=0.04)
    assert "lines in the plane" in fail(capsys, "contour", arcs / "phi.vti", "0.1", "-o", arcs / "line.stl")
    succeed(capsys, "view", arcs / "phi.vti", "-o", arcs / "view.png")
    assert json.loads(succeed(capsys, "info", arcs / "phi.vti", "--json"))["shape"] == [48, 48]
    told = json.loads(succeed(capsys, "info", arcs / "arcs.svg", "--json"))
    assert told["n_polylines"] == 3 and told["n_closed"] == 0 and told["n_points"] == 96


def test_drawings(tmp_path):
    (tmp_path / "drawing.svg").write_text(DRAWING)
    circle, curve = sh.io.read_polylines(tmp_path / "drawing.svg")
    assert circle.closed and circle.signed_area == pytest.approx(-np.pi * 30**2, rel=1e-3)  # clockwise as one sees it
    np.testing.assert_allclose(circle.bounds.mean(axis=0), [50, -50])
    assert not curve.closed
    np.testing.assert_allclose(curve.points[[0, -1]], [[100, -100], [100, -140]])
    np.testing.assert_allclose(curve.bounds[1, 0], 122.5)


@pytest.mark.parametrize("ending", ["svg", "csv"])
def test_polylines_come_back_to_the_last_bit(tmp_path, ending):
    rng = np.random.default_rng(3)
    lines = [sh.Polyline(rng.normal(size=(n, 2)), closed=n > 3) for n in (2, 5, 9)]
    sh.io.write_polylines(lines, tmp_path / f"lines.{ending}")
    again = sh.io.read_polylines(tmp_path / f"lines.{ending}")
    for line, other in zip(lines, again, strict=True):
        np.testing.assert_array_equal(line.points, other.points)
        assert line.closed == other.closed


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "0,0\n1,zwei\n", "line 2, '1,zwei', does not hold 2 numbers"),
        ("a.csv", "0,0,0\n1,1,1\n", "does not hold 2 numbers"),
        ("a.csv", "x,y\n", "contains no points"),
        ("a.csv", "0,0\n\n1,1\n", "polyline 0: a polyline needs at least 2 points"),
        ("a.csv", "0,0\nnan,1\n", "NaN"),
        ("a.svg", "<svg", "not XML"),
        ("a.svg", '<svg xmlns="http://www.w3.org/2000/svg"/>', "contains no lines"),
        ("a.svg", "", "the file is empty"),
    ],
)
def test_bad_polylines_are_one_line(tmp_path, capsys, name, content, message):
    (tmp_path / name).write_text(content)
    error = fail(capsys, "volume", tmp_path / name, "-o", tmp_path / "phi.npz")
    assert message in error and name in error
    assert not (tmp_path / "phi.npz").exists()


@pytest.mark.parametrize("curves", ["half.csv", "half.json", "half.obj"])
def test_curves_in_space_on_a_mesh(ball, capsys, curves):
    out = ball / "phi.npz"
    succeed(capsys, "surface", ball / "ball.ply", ball / curves, "-o", out, "--constraint", "free")
    mesh = sh.read(ball / "ball.ply")
    top = np.argmax(mesh.vertices[:, 2])
    assert np.load(out)["values"][top] == pytest.approx(np.pi / 2 - np.arcsin(0.3), abs=0.05)  # a quarter is missing


def test_surface_of_voxels(ball, capsys):
    index = np.stack(np.indices((36, 36, 36)), axis=-1)
    np.save(ball / "voxels.npy", np.linalg.norm((index - 17.5) / 15, axis=-1) < 1)
    about = {"origin": [-17.5 / 15] * 3, "spacing": [1 / 15] * 3}
    (ball / "voxels.json").write_text(json.dumps(about))
    out = ball / "phi.npz"
    summary = json.loads(succeed(capsys, "surface", ball / "voxels.npy", ball / "half.csv", "-o", out, "--json"))
    assert summary["maximum"] == pytest.approx(np.pi / 2 - np.arcsin(0.3), abs=0.06)
    assert summary["minimum"] == pytest.approx(-np.pi / 2 - np.arcsin(0.3), abs=0.06)


def test_surface_of_points_and_of_polygons(ball, capsys):
    k = np.arange(2500) + 0.5
    height, turn = 1 - 2 * k / 2500, np.pi * (1 + 5**0.5) * k
    width = np.sqrt(1 - height**2)
    sh.PointCloud(np.stack([width * np.cos(turn), width * np.sin(turn), height], axis=1)).save(ball / "points.xyz")
    out = ball / "phi.npz"
    succeed(capsys, "surface", ball / "points.xyz", ball / "half.csv", "-o", out, "--constraint", "free")
    assert np.load(out)["values"][0] == pytest.approx(np.pi / 2 - np.arcsin(0.3), abs=0.05)
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    corner = np.arange(81).reshape(9, 9)[:-1, :-1].ravel()
    flat = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    sh.PolygonMesh(flat, (corner[:, None] + [0, 9, 10, 1]).tolist()).save(ball / "squares.off")
    (ball / "line.csv").write_text("0 3.5 0\n8 3.5 0\n")
    succeed(capsys, "surface", ball / "squares.off", ball / "line.csv", "-o", out)
    np.testing.assert_allclose(np.load(out)["values"], y.ravel() - 3.5, atol=1e-6)


def test_close_completes_curves(ball, capsys):
    out, picture = ball / "whole.json", ball / "whole.png"
    text = succeed(capsys, "close", ball / "ball.ply", ball / "half.csv", "-o", out, "--preview", picture)
    assert "1 curve, 1 of them closed" in text
    mesh = sh.read(ball / "ball.ply")
    [whole] = sh.io.read_curves(out, mesh)
    [wanted] = sh.close_curves(sh.io.read_curves(ball / "half.csv", mesh), mesh)
    points, others = (
        np.einsum("ik,ikj->ij", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]]) for curve in (whole, wanted)
    )
    np.testing.assert_allclose(points, others, atol=1e-12)
    assert np.abs(points[:, 2] - 0.3).max() < 0.1
    assert picture.stat().st_size > 20_000
    assert "use one of" in fail(capsys, "close", ball / "ball.ply", ball / "half.csv", "-o", ball / "whole.stl")
    assert "no such file" in fail(capsys, "close", ball / "ball.ply", ball / "none.csv", "-o", out)


def test_intrinsic_triangles_for_meshes_with_large_angles(tmp_path, capsys):
    mesh = stretched_square(80, 30.0)
    mesh.save(tmp_path / "square.ply")
    (tmp_path / "line.csv").write_text("-1 0.1 0\n1 0.1 0\n")
    out = tmp_path / "phi.npz"
    task = ("surface", tmp_path / "square.ply", tmp_path / "line.csv", "-o", out)
    exact, found = mesh.vertices[:, 1] - 0.1, []
    for options in ((), ("--intrinsic",), ("--plain",), ("--plain", "--intrinsic")):
        assert "--intrinsic" not in succeed(capsys, *task, *options)
        found.append(np.abs(np.load(out)["values"] - exact).max())
    assert max(found) < 1e-5
    np.save(tmp_path / "volume.npy", np.pad(np.ones((4, 4, 4), dtype=bool), 2))
    assert "--intrinsic is for triangle meshes" in fail(
        capsys, "surface", tmp_path / "volume.npy", tmp_path / "line.csv", "-o", out, "--intrinsic"
    )


def test_version(capsys):
    assert sh.__version__ in succeed(capsys, "--version")


@pytest.mark.usefixtures("small_pictures")
def test_tets_from_the_command_line(tmp_path, capsys):
    """Around the shape, sharpened unless told otherwise; contoured, looked at and described again."""
    import matplotlib.image

    sphere(3).save(tmp_path / "ball.stl")
    flags = ("--tets", "--resolution", "6", "--padding", "0.3")
    fields = []
    for name, more in (("sharp.vtu", ()), ("plain.vtu", ("--plain",))):
        succeed(capsys, "volume", tmp_path / "ball.stl", *flags, *more, "-o", tmp_path / name)
        fields.append(sh.read_field(tmp_path / name))
    errors = [np.abs(phi.values - np.linalg.norm(phi.domain.vertices, axis=1) + 1).mean() for phi in fields]
    assert errors[0] < 0.6 * errors[1] < 0.02
    succeed(capsys, "contour", tmp_path / "sharp.vtu", "0.1", "-o", tmp_path / "shell.stl")
    assert "open edges             0" in succeed(capsys, "info", tmp_path / "shell.stl")
    for name in ("sharp.vtu", "shell.stl"):
        succeed(capsys, "view", tmp_path / name, "-o", tmp_path / "picture.png")
    fields[0].domain.save(tmp_path / "bare.vtu")
    succeed(capsys, "view", tmp_path / "bare.vtu", "-o", tmp_path / "picture.png")
    fields[0].domain.save(tmp_path / "own.mesh")
    own = ("--tets", tmp_path / "own.mesh", "--preview", tmp_path / "slices.png")
    succeed(capsys, "volume", tmp_path / "ball.stl", *own, "-o", tmp_path / "own.msh")
    np.testing.assert_allclose(sh.read_field(tmp_path / "own.msh").values, fields[0].values, atol=1e-9)
    assert matplotlib.image.imread(tmp_path / "slices.png")[..., :3].std() > 0.05
    told = json.loads(succeed(capsys, "info", tmp_path / "own.mesh", "--json"))
    assert told["n_tets"] == fields[0].domain.n_tets
