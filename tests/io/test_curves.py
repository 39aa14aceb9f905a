"""Files of curves: OBJ lines, JSON with vertex ids and weights."""

from __future__ import annotations

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.surface_cases import positions, sphere, square


def some_curves(mesh):
    return [
        mesh.path([3, 17, 42]),
        mesh.polyline(positions(mesh, mesh.level_set(mesh.vertices[:, 2], 0.3)[0])[:25]),
        mesh.level_set(mesh.vertices[:, 2], -0.25)[0],
        mesh.path([50, 60], oriented=False),
        mesh.points_at([7, 9]),
        sh.SurfacePoints([11], [[0.25, 0.25, 0.5]]),
    ]


def test_curves_read_back_the_same(tmp_path):
    mesh = sphere(2)
    curves = some_curves(mesh)
    sh.io.write_curves(curves, tmp_path / "curves.json", mesh)
    back = sh.io.read_curves(tmp_path / "curves.json", mesh)
    assert len(back) == len(curves)
    for old, new in zip(curves, back, strict=True):
        assert type(old) is type(new)
        if isinstance(old, sh.Curve):
            assert (old.closed, old.oriented) == (new.closed, new.oriented)
        assert np.abs(positions(mesh, old) - positions(mesh, new)).max() < 1e-15


def test_strict_reading_refuses_points_that_share_no_face(tmp_path):
    mesh = square(5)
    walk = mesh.path([6, 7, 12, 11], closed=True)
    sh.io.write_curves(walk, tmp_path / "walk.json", mesh)
    sh.io.write_curves([walk, mesh.path([0, 1, 24])], tmp_path / "jump.json", mesh)
    assert len(sh.io.read_curves(tmp_path / "walk.json", mesh, strict=True)) == 1
    assert len(sh.io.read_curves(tmp_path / "jump.json", mesh)) == 2
    with refused(sh.errors.SourceError, "curve 1"):
        sh.io.read_curves(tmp_path / "jump.json", mesh, strict=True)


def test_curves_across_a_seam_have_no_gap_there(tmp_path):
    """The method runs through seams, whose vertices lie in pairs at one place."""
    corners = [[x, y, 0] for left in (0, 1) for x, y in ((left, 0), (left + 1, 0), (left + 1, 1), (left, 1))]
    mesh = sh.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    nodes = [{"v": [vertex], "w": [1]} for vertex in (0, 1, 5)]
    group = {"kind": "signed_curve", "nodes": nodes, "segments": [[0, 1], [1, 2]]}
    (tmp_path / "across.json").write_text(json.dumps({"groups": [group]}))
    assert sh.io.read_curves(tmp_path / "across.json", mesh, strict=True)[0].n_points == 3


def test_obj_lines_read_back_as_the_same_lines(tmp_path):
    mesh = sphere(2)
    curves = [c for c in some_curves(mesh) if not isinstance(c, sh.Curve) or c.oriented][1:]
    sh.io.write_curves(curves, tmp_path / "curves.obj", mesh)
    back = sh.io.read_curves(tmp_path / "curves.obj", mesh)
    for old, new in zip(curves, back, strict=True):
        assert np.abs(positions(mesh, old) - positions(mesh, new)).max() < 1e-12


def test_obj_lines_on_the_vertices_of_the_mesh(tmp_path):
    mesh = square(4)
    path = tmp_path / "mesh.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices.tolist()]
    path.write_text("\n".join([*lines, "l 6 7 11", "l 1 2 6 5 1", "l -1 -2", "p 16"]) + "\n")
    curves = sh.io.read_curves(path, mesh)
    assert [c.n_points for c in curves] == [3, 4, 2, 1]
    assert curves[1].closed
    assert (mesh.faces[curves[0].faces, curves[0].barycentric.argmax(axis=1)] == [5, 6, 10]).all()


def test_portable_json_joins_segments_in_any_order(tmp_path):
    mesh = square(5)
    nodes = [{"v": [v], "w": [1.0]} for v in (6, 7, 8, 13, 12)]
    segments = [[3, 4], [1, 2], [0, 1], [2, 3]]
    path = tmp_path / "curves.json"
    path.write_text(json.dumps({"groups": [{"kind": "signed_curve", "nodes": nodes, "segments": segments}]}))
    (curve,) = sh.io.read_curves(path, mesh)
    assert (mesh.faces[curve.faces, curve.barycentric.argmax(axis=1)] == [6, 7, 8, 13, 12]).all()


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("{", sh.errors.FileFormatError),
        ("[]", sh.errors.FileFormatError),
        ('{"groups": [{"kind": "curve", "nodes": [], "segments": []}]}', sh.errors.FileFormatError),
        (
            '{"groups": [{"kind": "signed_curve", "segments": [[0, 1]], '
            '"nodes": [{"v": [0, 15], "w": [0.5, 0.5]}, {"v": [1], "w": [1]}]}]}',
            sh.errors.SourceError,
        ),
        (
            '{"groups": [{"kind": "signed_curve", "nodes": [{"v": [0], "w": [1]}], "segments": [[0, 4]]}]}',
            sh.errors.FileFormatError,
        ),
    ],
)
def test_damaged_json_is_refused(content, error, tmp_path):
    path = tmp_path / "broken.json"
    path.write_text(content)
    with refused(error):
        sh.io.read_curves(path, square(4))


@pytest.mark.parametrize("content", [
    [[0, 0, 0], [1, 0, 0]], {"curves": []}, {"type": "LineString", "coordinates": [[0, 0], [1, 0]]},
])  # fmt: skip
def test_json_of_another_kind_says_how_curves_are_written(content, tmp_path):
    path = tmp_path / "lines.json"
    path.write_text(json.dumps(content))
    with refused(sh.errors.FileFormatError) as caught:
        sh.io.read_curves(path, square(4))
    assert '"polylines"' in caught.value.remedy and "Error" not in str(caught.value)


def test_unknown_formats_are_refused_and_nothing_is_overwritten(tmp_path):
    mesh = square(4)
    with refused(sh.errors.FileFormatError):
        sh.io.read_curves(tmp_path / "curves.svg", mesh)
    path = tmp_path / "curves.json"
    path.write_text("kept")
    with refused(sh.errors.SourceError, "item 0"):
        sh.io.write_curves(["no curve"], path, mesh)
    assert path.read_text() == "kept"
