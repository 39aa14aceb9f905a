"""``signedheat surface``, and what ``signedheat info`` says of curves."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

import signedheat as sh
from shapes.surface_cases import sphere, square
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def files(tmp_path):
    mesh = sphere(3)
    mesh.save(tmp_path / "ball.ply")
    curve = mesh.level_set(mesh.vertices[:, 2], 0.2)[0]
    half = sh.Curve(curve.faces[:60], curve.barycentric[:60])
    sh.io.write_curves([half, mesh.path([0, 30])], tmp_path / "curves.json", mesh)
    return tmp_path


def test_a_field_comes_out(files, capsys):
    out = files / "phi.npz"
    arguments = ["surface", str(files / "ball.ply"), str(files / "curves.json"), "-o", str(out)]
    assert main([*arguments, "--constraint", "each-component", "--diffusion", "2"]) == 0
    assert "642 vertices" in capsys.readouterr().out
    mesh = sh.read(files / "ball.ply")
    curves = sh.io.read_curves(files / "curves.json", mesh)
    phi = sh.SignedHeatSolver(mesh, 2.0).distance(curves, sh.constraints.EachComponent())
    assert (np.load(out)["values"] == phi.values).all()


def test_json_contours_and_a_picture(files, capsys):
    out, picture = files / "phi.vtp", files / "phi.png"
    arguments = ["surface", str(files / "ball.ply"), str(files / "curves.json"), "-o", str(out), "--json"]
    assert main([*arguments, "--contours", "5", "--preview", str(picture)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["minimum"] < 0 < summary["maximum"] and summary["unreached"] == 0
    mesh = sh.read(files / "ball.ply")
    assert len(sh.io.read_curves(summary["contours"], mesh)) >= 5
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 20_000


def test_vertices_that_no_curve_reaches_are_told_on_standard_error(tmp_path, capsys):
    mesh = square(5)
    samples.union(mesh, sh.TriangleMesh(mesh.vertices + 5, mesh.faces)).save(tmp_path / "two.ply")
    sh.io.write_curves([mesh.path([10, 11, 12, 13, 14])], tmp_path / "curve.json", mesh)
    command = ["surface", str(tmp_path / "two.ply"), str(tmp_path / "curve.json"), "-o", str(tmp_path / "phi.npz")]
    assert main([*command, "--quiet"]) == 0
    said = capsys.readouterr().err
    assert said.startswith("signedheat: no source is connected to 25 of 50 vertices") and said.count("\n") == 1


def test_levels(files, capsys):
    arguments = ["surface", str(files / "ball.ply"), str(files / "curves.json"), "-o", str(files / "phi.ply")]
    assert main([*arguments, "--constraint", "levels:0,0.5"]) == 0
    assert main([*arguments, "--constraint", "levels:0,0.5,1,2"]) == 1
    assert "4 level values" in capsys.readouterr().err


def test_info_says_what_lies_where(tmp_path, capsys):
    mesh = square(6)
    mesh.save(tmp_path / "flat.ply")
    curves = [mesh.path([7, 8, 20]), mesh.path([21, 22, 16, 15], closed=True), mesh.points_at([0])]
    sh.io.write_curves(curves, tmp_path / "curves.json", mesh)
    assert main(["info", str(tmp_path / "flat.ply"), str(tmp_path / "curves.json"), "--json"]) == 0
    first, second, third = json.loads(capsys.readouterr().out)["curves"]
    assert first["share_no_face"] == [1] and first["open_ends"] == ["vertex 7", "vertex 20"]
    assert first["length"] == pytest.approx(0.4 + np.hypot(0.8, 0))
    assert second["open_ends"] == [] and second["at_vertices"] == 4 and second["along_edges"] == 4
    assert third["kind"] == "points"
    assert main(["info", str(tmp_path / "flat.ply"), str(tmp_path / "curves.json")]) == 0
    assert "1 segment within no common face: 1" in capsys.readouterr().out


def test_fields_on_surfaces_can_be_contoured_viewed_and_told_about(files, capsys):
    field = str(files / "phi.npz")
    assert main(["surface", str(files / "ball.ply"), str(files / "curves.json"), "-o", field, "--quiet"]) == 0
    assert isinstance(sh.read_field(field).domain, sh.TriangleMesh)
    assert main(["contour", field, "0.3", "-o", str(files / "line.json")]) == 0
    phi = sh.read_field(field)
    for curve in sh.io.read_curves(files / "line.json", phi.domain):
        assert phi(curve) == pytest.approx(0.3)
    assert main(["contour", field, "0.3", "-o", str(files / "line.stl")]) == 1
    assert main(["contour", field, "99", "-o", str(files / "line.obj")]) == 1
    capsys.readouterr()
    assert main(["info", field, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["domain"] == "TriangleMesh"
    assert main(["view", field, "-o", str(files / "view.png")]) == 0
    assert (files / "view.png").stat().st_size > 20_000


def test_turned_pieces_are_told_and_left_with_as_oriented(tmp_path, capsys):
    mesh = sphere(3)
    ring = mesh.level_set(mesh.vertices[:, 2], 0.2)[0]
    cuts = np.linspace(0, ring.n_points, 5).astype(int)
    runs = [np.arange(a, b - 3) for a, b in pairwise(cuts)]
    pieces = [sh.Curve(ring.faces[run], ring.barycentric[run]) for run in runs]
    mesh.save(tmp_path / "ball.ply")
    sh.io.write_curves([pieces[0], pieces[1].reversed(), *pieces[2:]], tmp_path / "pieces.json", mesh)
    arguments = ["surface", str(tmp_path / "ball.ply"), str(tmp_path / "pieces.json"), "-o", str(tmp_path / "phi.ply")]
    assert main([*arguments, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["turned"], summary["left_out"]) == ([1], [])
    assert main(arguments) == 0
    assert "curves flipped: 1, the first of them number 1" in capsys.readouterr().out
    assert main([*arguments, "--as-oriented", "--json"]) == 0
    assert "turned" not in json.loads(capsys.readouterr().out)


def test_a_refined_field_is_written_on_its_pieces(tmp_path):
    square(3).save(tmp_path / "square.ply")
    mesh = sh.read(tmp_path / "square.ply")
    sh.io.write_curves(mesh.polyline([[0.3, 0.2, 0], [0.4, 0.6, 0]]), tmp_path / "line.json", mesh)
    arguments = ["surface", str(tmp_path / "square.ply"), str(tmp_path / "line.json"), "--intrinsic"]
    for name, options in (("own", []), ("pieces", ["--subdivide", "--preview", str(tmp_path / "p.png"), "--up", "y"])):
        assert main([*arguments, "-o", str(tmp_path / f"{name}.npz"), *options]) == 0
    own, pieces = (np.load(tmp_path / f"{name}.npz") for name in ("own", "pieces"))
    assert len(own["values"]) == mesh.n_vertices < len(pieces["values"])
    assert (pieces["vertices"][: mesh.n_vertices] == own["vertices"]).all()
    assert np.allclose(pieces["values"][: mesh.n_vertices], own["values"], atol=1e-12)
